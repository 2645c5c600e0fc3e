//! What is left when a writer is killed, or the disk is full: the old file, the new file, or one that can be recovered.
#![cfg(all(feature = "cli", unix))]

mod support;

use std::collections::HashSet;
use std::io::{Cursor, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use support::{explicit, noise, open};
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{self, At, CopyOptions, EncodeOptions, Volume, ZstdPolicy};
use vug::{Code, Extent, Region};

/// Kills per command.
const KILLS: u32 = 50;

/// Moments to kill at: the seed is printed, `VUG_CRASH_SEED` sets it.
struct Moments(u64);

impl Moments {
    fn new(salt: u64) -> Self {
        let seed = std::env::var("VUG_CRASH_SEED").ok().and_then(|s| s.parse().ok()).unwrap_or_else(|| {
            std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_micros() as u64
        });
        println!("VUG_CRASH_SEED={seed}");
        Moments(seed ^ salt << 48)
    }

    /// A moment up to a fifth after the end.
    fn next(&mut self, whole: Duration) -> Duration {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        whole.mul_f64((self.0 >> 40) as f64 / (1u64 << 24) as f64 * 1.2)
    }
}

fn vug(dir: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("vug"));
    command.current_dir(dir).args(args).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// Runs to the end; how long that took.
fn finish(dir: &Path, args: &[&str]) -> Duration {
    let start = Instant::now();
    assert!(vug(dir, args).status().unwrap().success(), "{args:?}");
    start.elapsed()
}

/// Starts and kills (SIGKILL); whether it was still running.
fn kill_after(dir: &Path, args: &[&str], delay: Duration) -> bool {
    let mut child = vug(dir, args).spawn().unwrap();
    std::thread::sleep(delay);
    child.kill().unwrap();
    !child.wait().unwrap().success()
}

/// 8 Mvoxel of noise as `a.raw`; `a.vug` is made of it, with 2 levels.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().to_owned();
    let bytes: Vec<u8> = (0..1u32 << 20).map(|i| (support::hash([i, 5, 6]) >> 25) as u8).collect();
    std::fs::write(path.join("a.raw"), bytes.repeat(8)).unwrap();
    finish(&path, &[&["encode", "a.raw", "a.vug"], ENCODE].concat());
    (dir, path)
}

const ENCODE: &[&str] =
    &["--shape", "256,256,128", "--dtype", "u8", "--brick", "16", "--levels", "2", "--index-bits", "2"];

fn temporaries(dir: &Path) -> usize {
    let names = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    names.filter(|n| n.ends_with(".vug-tmp")).count()
}

/// Kills a command that writes `out.vug` anew: the file is always the old one or the new one.
fn all_or_nothing(salt: u64, args: &[&str]) {
    let (_guard, dir) = folder();
    let out = dir.join("out.vug");
    let whole = finish(&dir, args);
    let new = std::fs::read(&out).unwrap();
    let old = std::fs::read(dir.join("a.raw")).unwrap();
    let mut moments = Moments::new(salt);
    let (mut killed, mut replaced) = (0, 0);
    for i in 0..KILLS {
        match i % 2 {
            0 => std::fs::write(&out, &old).unwrap(),
            _ => std::fs::remove_file(&out).unwrap(),
        }
        killed += u32::from(kill_after(&dir, args, moments.next(whole)));
        match std::fs::read(&out) {
            Ok(found) if found == new => replaced += 1,
            Ok(found) => assert!(i % 2 == 0 && found == old, "{args:?}, kill {i}: neither old nor new"),
            Err(_) => assert_eq!(i % 2, 1, "{args:?}, kill {i}: the old file is gone"),
        }
        if !out.exists() {
            std::fs::write(&out, &old).unwrap();
        }
    }
    println!("{}: {killed} of {KILLS} killed before their end, {replaced} files replaced", args[0]);
    finish(&dir, args);
    assert_eq!(temporaries(&dir), 0, "what the killed ones left is gone");
    assert_eq!(std::fs::read(&out).unwrap(), new);
}

#[test]
fn a_killed_encoder_leaves_the_old_file_or_the_new_one() {
    all_or_nothing(1, &[&["encode", "a.raw", "out.vug", "--force"], ENCODE].concat());
}

#[test]
fn a_killed_packer_leaves_the_old_file_or_the_new_one() {
    all_or_nothing(2, &["pack", "a.vug", "out.vug", "--clustered", "--force"]);
}

#[test]
fn a_killed_repacker_leaves_the_old_file_or_the_new_one() {
    all_or_nothing(3, &["repack", "a.vug", "out.vug", "--no-zstd", "--force"]);
}

#[test]
fn a_killed_appender_leaves_the_old_log_or_the_new_one() {
    let (_guard, dir) = folder();
    finish(&dir, &["pack", "a.vug", "log.vug", "--log"]);
    let log = dir.join("log.vug");
    let (old, raw) = (std::fs::read(&log).unwrap(), std::fs::read(dir.join("a.raw")).unwrap());
    let args = ["append", "log.vug", "a.raw", "--shape", "256,256,128", "--dtype", "u8"];
    let whole = finish(&dir, &args);
    let new = std::fs::read(&log).unwrap();
    assert!(new.starts_with(&old));
    let copied = ["append", "log.vug", "a.vug"];
    let copying = {
        std::fs::write(&log, &old).unwrap();
        finish(&dir, &copied)
    };
    assert!(std::fs::read(&log).unwrap() == new, "encoded or copied, a step is the same");
    let mut moments = Moments::new(4);
    let (mut killed, mut appended, mut torn) = (0, 0, 0);
    for i in 0..KILLS {
        std::fs::write(&log, &old).unwrap();
        let (args, time): (&[&str], _) = if i % 2 == 0 { (&args, whole) } else { (&copied, copying) };
        killed += u32::from(kill_after(&dir, args, moments.next(time)));
        let found = std::fs::read(&log).unwrap();
        assert!(new.starts_with(&found) && found.starts_with(&old), "kill {i}: other bytes");
        torn += u32::from(found.len() > old.len() && found.len() < new.len());
        appended += u32::from(found.len() == new.len());
        let volume = open(found.clone());
        let steps = volume.info().time_steps;
        assert_eq!(steps, 1 + u32::from(found.len() == new.len()), "kill {i}");
        // Every committed brick is there.
        if i % 10 == 0 {
            let original = open(old.clone()).read(At::default()).unwrap();
            for time in 0..steps {
                assert!(volume.read(At { time, channel: 0, lod: 0 }).unwrap().bytes() == original.bytes());
            }
            finish(&dir, &copied);
            assert_eq!(open(std::fs::read(&log).unwrap()).info().time_steps, steps + 1, "kill {i}: appended to");
        }
    }
    assert_eq!(raw.len(), 256 * 256 * 128);
    println!("append: {killed} of {KILLS} killed before their end, {appended} appended, {torn} torn");
    assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 3, "no temporary is left");
}

#[test]
fn a_killed_writer_of_a_log_loses_nothing_that_was_committed() {
    let (_guard, dir) = folder();
    // Payloads of 48 MiB: a commit is written every 16 MiB.
    let raw = std::fs::read(dir.join("a.raw")).unwrap();
    std::fs::write(dir.join("big.raw"), raw.repeat(6)).unwrap();
    let args = ["encode", "big.raw", "log.vug", "--log", "--force", "--codec", "raw", "--no-zstd", "--shape"];
    let args = [&args[..], &["256,256,768", "--dtype", "u8", "--brick", "32"]].concat();
    let whole = finish(&dir, &args);
    let log = dir.join("log.vug");
    let original = open(std::fs::read(&log).unwrap());
    let old = std::fs::read(dir.join("a.vug")).unwrap();
    let mut moments = Moments::new(5);
    let (mut killed, mut kept, mut committed, mut more) = (0, 0, 0, 0);
    for i in 0..KILLS / 2 {
        // Every other time over an old file.
        match i % 2 {
            0 => std::fs::write(&log, &old).unwrap(),
            _ => std::fs::remove_file(&log).unwrap_or_default(),
        }
        killed += u32::from(kill_after(&dir, &args, moments.next(whole)));
        let found = match std::fs::read(&log) {
            Ok(found) if i % 2 == 0 && found == old => {
                kept += 1;
                continue;
            }
            Ok(found) => found,
            Err(_) => {
                assert_eq!(i % 2, 1, "kill {i}: the old file is gone");
                continue;
            }
        };
        let Ok(torn) = Volume::open(MemorySource(found.clone()), Limits::default()) else {
            assert!(found.len() < 4096, "kill {i}: {} bytes without a commit", found.len());
            continue;
        };
        let out = Cursor::new(Vec::new());
        let (out, saved) = volume::recover(MemorySource(found), Limits::default(), out, &mut |_, _| {}).unwrap();
        let recovered = open(out.into_inner());
        let live: HashSet<_> = saved.live.iter().map(|&(at, brick)| (at.lod, brick)).collect();
        // What the last commit has, brick by brick: all of it is saved, and as it would be had nobody been killed.
        let bricks = torn.levels().next().unwrap().div_ceil(Extent::cube(32));
        let mut stored = 0;
        for n in 0..bricks.voxels() as u32 {
            let brick = [n % bricks.x, n / bricks.x % bricks.y, n / bricks.x / bricks.y];
            let there = torn.bounds(At::default(), Region::at(brick.map(|v| v * 32), Extent::cube(32))).unwrap();
            if there.max == 0.0 {
                continue; // EMPTY: noise is not.
            }
            stored += 1;
            assert!(live.contains(&(0, brick)), "kill {i}: {brick:?} was committed and is lost: {:?}", saved.lost);
            let committed = torn.read_brick(At::default(), brick).unwrap();
            assert!(committed.bytes() == recovered.read_brick(At::default(), brick).unwrap().bytes(), "{brick:?}");
        }
        assert_eq!(stored, torn.brick_counts().unwrap().stored, "kill {i}: each of them was looked at");
        for &(at, brick) in &saved.live {
            let (a, b) = (recovered.read_brick(at, brick).unwrap(), original.read_brick(at, brick).unwrap());
            assert!(a.bytes() == b.bytes(), "kill {i}: {brick:?}");
        }
        committed += u32::from(stored > 0);
        more += u32::from(saved.by_leader > 0);
    }
    println!(
        "log: {killed} of {} killed before their end, {kept} old files kept, {committed} with committed bricks, {more} with more",
        KILLS / 2
    );
    assert!(committed > 0, "some were killed behind a commit");
}

/// Takes so many bytes, and few at a time.
struct Disk {
    file: Cursor<Vec<u8>>,
    room: usize,
    at_a_time: usize,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let len = bytes.len().min(self.at_a_time).min(self.room);
        if len == 0 && !bytes.is_empty() {
            return Err(std::io::ErrorKind::StorageFull.into());
        }
        self.room -= len;
        self.file.write(&bytes[..len])
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.file.seek(to)
    }
}

#[test]
fn a_writer_that_fails_fails_the_call_and_short_writes_change_nothing() {
    let mut grid = noise(Extent::new(100, 90, 80), |h| (h >> 24) as u8);
    let options = EncodeOptions { brick: Some(16), levels: 2, ..explicit(8, 4) };
    let disk = |room, at_a_time| Disk { file: Cursor::new(Vec::new()), room, at_a_time };
    let mut whole = disk(usize::MAX, usize::MAX);
    volume::encode(&mut grid, &mut whole, &options, &mut |_, _| {}).unwrap();
    let whole = whole.file.into_inner();
    let source = open(whole.clone());
    let copy = |out| {
        let excerpt = source.excerpt(&CopyOptions { zstd: ZstdPolicy::Compress, ..CopyOptions::default() }).unwrap();
        excerpt.write_head(out, &mut |_, _| {}).map(|(out, _)| out)
    };
    let log = |out: Disk| {
        let excerpt = source.excerpt(&CopyOptions::default()).unwrap();
        excerpt.write_log(out, &mut |_, _| {}).map(|(out, _)| out.file.into_inner())
    };
    let whole_log = log(disk(usize::MAX, usize::MAX)).unwrap();
    for at_a_time in [1, 7, 4097] {
        assert!(log(disk(usize::MAX, at_a_time)).unwrap() == whole_log);
        let mut short = disk(usize::MAX, at_a_time);
        volume::encode(&mut grid, &mut short, &options, &mut |_, _| {}).unwrap();
        assert!(short.file.into_inner() == whole, "{at_a_time} bytes at a time");
        assert!(copy(disk(usize::MAX, at_a_time)).unwrap().file.into_inner() == whole);
    }
    for room in [0, 1, 255, 16 << 10, 20_000, whole.len() / 2, whole.len() - 1] {
        let mut full = disk(room, 5000);
        let e = volume::encode(&mut grid, &mut full, &options, &mut |_, _| {}).unwrap_err();
        assert_eq!(e.code(), Code::Source, "{room} bytes: {e}");
        assert_eq!(copy(disk(room, 5000)).err().map(|e| e.code()), Some(Code::Source), "{room} bytes");
        assert_eq!(log(disk(room, 5000)).err().map(|e| e.code()), Some(Code::Source), "{room} bytes");
    }
}

/// Runs a command that must fail for want of room, and leave what was there.
fn must_fail(dir: &Path, shell: &str, args: &[&str]) {
    let before = std::fs::read(dir.join("out.vug")).unwrap();
    let exe = assert_cmd::cargo::cargo_bin("vug");
    let command = format!("{shell} {} {}", exe.display(), args.join(" "));
    let output = Command::new("sh").current_dir(dir).args(["-c", &command]).output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{args:?}: {err}");
    assert!(err.contains("E_SOURCE"), "{args:?}: {err}");
    assert_eq!(temporaries(dir), 0, "{args:?}");
    assert!(std::fs::read(dir.join("out.vug")).unwrap() == before, "{args:?}");
}

#[test]
fn no_room_leaves_the_old_file_and_no_debris() {
    let (_guard, dir) = folder();
    std::fs::write(dir.join("out.vug"), b"old").unwrap();
    // Files of at most 64 KiB: a write beyond fails, as on a full disk.
    let limit = "trap '' XFSZ; ulimit -f 128;";
    must_fail(&dir, limit, &[&["encode", "a.raw", "out.vug", "--force"], ENCODE].concat());
    must_fail(&dir, limit, &["pack", "a.vug", "out.vug", "--force"]);
    must_fail(&dir, limit, &["repack", "a.vug", "out.vug", "--force", "--zstd"]);
    must_fail(&dir, limit, &["extract", "a.vug", "out.vug", "--force", "--levels", "0"]);
    // A log stays what it was, to the byte.
    finish(&dir, &["pack", "a.vug", "out.vug", "--log", "--force"]);
    let blocks = std::fs::metadata(dir.join("out.vug")).unwrap().len() / 512 + 200;
    must_fail(&dir, &format!("trap '' XFSZ; ulimit -f {blocks};"), &["append", "out.vug", "a.vug"]);
}

#[test]
fn a_full_disk_is_an_error_and_keeps_nothing() {
    let (_guard, dir) = folder();
    std::fs::create_dir(dir.join("disk")).unwrap();
    let exe = assert_cmd::cargo::cargo_bin("vug");
    let script = format!(
        "mount -t tmpfs -o size=512k none disk || exit 77
         {exe} pack a.vug disk/b.vug; echo \"pack $?\"; ls -A disk
         {exe} repack a.vug disk/b.vug --zstd; echo \"repack $?\"; ls -A disk
         {exe} encode a.raw disk/b.vug {}; echo \"encode $?\"; ls -A disk",
        ENCODE.join(" "),
        exe = exe.display()
    );
    let output = Command::new("unshare").current_dir(&dir).args(["-m", "sh", "-c", &script]).output();
    let Some(output) = output.ok().filter(|o| !matches!(o.status.code(), Some(77 | 1))) else {
        println!("skipped: a_full_disk_is_an_error_and_keeps_nothing: no file system can be mounted here");
        return;
    };
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(out, "pack 3\nrepack 3\nencode 3\n", "{err}");
    assert_eq!(err.matches("E_SOURCE").count(), 3, "{err}");
}
