//! Logs made of head files and back, and time steps appended to them.

mod support;

use std::io::Cursor;
use std::path::{Path, PathBuf};
use support::{ball, encode, explicit, hash, noise, open, verify};
use vug::limits::Limits;
use vug::source::{FileSource, MemorySource};
use vug::time::{TimeUnit, Times};
use vug::volume::{self, Appender, At, CodecChoice, CopyOptions, EncodeOptions, Quality, Volume, VolumeWriter};
use vug::{Code, Extent, Grid};

fn log_of(file: &[u8]) -> Vec<u8> {
    let volume = open(file.to_vec());
    volume.excerpt(&CopyOptions::default()).unwrap().write_log(Vec::new(), &mut |_, _| {}).unwrap().0
}

fn head_of(log: &[u8]) -> Vec<u8> {
    let volume = open(log.to_vec());
    let excerpt = volume.excerpt(&CopyOptions::default()).unwrap();
    excerpt.write_head(Cursor::new(Vec::new()), &mut |_, _| {}).unwrap().0.into_inner()
}

/// One step: a ball that grows, EMPTY and CONSTANT bricks around it.
fn step(k: u32) -> Grid {
    let e = Extent::new(50, 37, 33);
    Grid::from_fn(e, |c| {
        let r2: i32 = c.iter().map(|&v| (v as i32 - 18).pow(2)).sum();
        if r2 < (8 + k as i32).pow(2) { (100 + 10 * k + hash(c) % 30) as u8 } else { u8::from(c[0] >= 48) * 9 }
    })
    .unwrap()
}

fn options(codec: CodecChoice) -> EncodeOptions {
    let quality = match codec {
        CodecChoice::Zerobit => Quality::Keep(80_000),
        _ => explicit(4, 4).quality,
    };
    EncodeOptions { codec, quality, brick: Some(16), levels: 2, ..EncodeOptions::default() }
}

/// A log of step 0, in a file.
fn log_file(dir: &Path, codec: CodecChoice, times: Option<Times>) -> PathBuf {
    let path = dir.join("log.vug");
    let file = encode(&mut step(0), &EncodeOptions { times, ..options(codec) }).0;
    std::fs::write(&path, log_of(&file)).unwrap();
    path
}

/// Step `k`, encoded as the log is.
fn encoded(log: &Volume, k: u32) -> Volume {
    open(encode(&mut step(k), &log.encode_options().unwrap()).0)
}

fn append(path: &Path, k: u32, times: Option<Times>) -> vug::Result<()> {
    let mut log = Appender::open(path)?;
    let steps = encoded(log.volume(), k);
    log.append(&steps, times, &mut |_, _| {}).map(|_| ())
}

fn assert_steps(volume: &Volume, codec: CodecChoice, steps: u32) {
    assert_eq!(volume.info().time_steps, steps);
    for k in 0..steps {
        let alone = open(encode(&mut step(k), &options(codec)).0);
        for lod in 0..2 {
            let found = volume.read(At { time: k, channel: 0, lod }).unwrap();
            assert_eq!(found.bytes(), alone.read(At::lod(lod)).unwrap().bytes(), "{codec:?}, step {k}, level {lod}");
        }
    }
}

#[test]
fn a_head_file_becomes_a_log_and_the_same_head_file_again() {
    let meta = Some(r#"{"a":"b"}"#.to_owned());
    for codec in [CodecChoice::S3dc, CodecChoice::Raw, CodecChoice::Zerobit] {
        let file = encode(&mut step(3), &EncodeOptions { meta: meta.clone(), ..options(codec) }).0;
        let log = log_of(&file);
        assert!(open(log.clone()).head().commit.is_some());
        assert_eq!(open(log.clone()).meta().unwrap(), meta);
        assert!(head_of(&log) == file, "{codec:?}");
        assert!(log_of(&log) == log, "{codec:?}: a log packed as a log");
    }
}

#[test]
fn appended_steps_are_what_they_would_be_alone_and_old_bytes_stay() {
    for codec in [CodecChoice::S3dc, CodecChoice::Raw, CodecChoice::Zerobit] {
        let dir = tempfile::tempdir().unwrap();
        let path = log_file(dir.path(), codec, None);
        for k in 1..5 {
            let before = std::fs::read(&path).unwrap();
            append(&path, k, None).unwrap();
            let after = std::fs::read(&path).unwrap();
            assert!(after.len() > before.len() && after.starts_with(&before), "{codec:?}: only more bytes");
            assert_steps(&open(after.clone()), codec, k + 1);
            let errors = verify(&after);
            assert!(errors.is_empty(), "{codec:?}: {errors:?}");
        }
        let packed = head_of(&std::fs::read(&path).unwrap());
        let errors = verify(&packed);
        assert!(errors.is_empty(), "{codec:?}: {errors:?}");
        assert_steps(&open(packed.clone()), codec, 5);
        let d = open(packed).info().clone();
        let alone: Vec<_> = (0..5).map(|k| encode(&mut step(k), &options(codec)).1).collect();
        let largest = alone.iter().map(|r| r.max_error).fold(0.0, f64::max);
        let squares: f64 = alone.iter().map(|r| r.rmse * r.rmse).sum();
        let achieved = d.achieved.unwrap();
        assert_eq!(achieved.max_error, largest);
        assert!((achieved.rmse - (squares / 5.0).sqrt()).abs() < 1e-9);
        assert_eq!(d.source_range.1, alone.iter().map(|r| r.source_range.1).fold(0.0, f64::max));
    }
}

#[test]
fn several_steps_at_once_and_times() {
    let dir = tempfile::tempdir().unwrap();
    let times = |steps: &[f64]| Some(Times { unit: TimeUnit::Second, steps: steps.to_vec() });
    let path = log_file(dir.path(), CodecChoice::Raw, times(&[1.5]));
    let mut log = Appender::open(&path).unwrap();
    let two = {
        let part = encoded(log.volume(), 1);
        let d = part.info().clone();
        let shape = volume::Shape { extent: d.dims, sample_type: d.sample_type, time_steps: 2, channels: 1 };
        let options = log.volume().encode_options().unwrap();
        let mut writer =
            VolumeWriter::create(Cursor::new(Vec::new()), shape, vug::codec::Codec::Raw, 4, &options).unwrap();
        let grid = noise(Extent::cube(16), |h| (h >> 24) as u8);
        writer.write_brick(At { time: 1, channel: 0, lod: 0 }, [1, 0, 0], grid.view()).unwrap();
        open(writer.finish().unwrap().0.into_inner())
    };
    let before = std::fs::read(&path).unwrap();
    for (bad, code) in [
        (None, Code::Param),
        (times(&[3.0]), Code::Size),
        (times(&[1.5, 2.0]), Code::Order),
        (times(&[2.0, f64::NAN]), Code::NonFinite),
        (Some(Times { unit: TimeUnit::Day, steps: vec![2.0, 3.0] }), Code::Param),
    ] {
        let e = log.append(&two, bad.clone(), &mut |_, _| {}).unwrap_err();
        assert_eq!(e.code(), code, "{bad:?}: {e}");
        assert!(std::fs::read(&path).unwrap() == before, "{bad:?}: nothing has changed");
    }
    log.append(&two, times(&[2.0, 4.0]), &mut |_, _| {}).unwrap();
    assert_eq!(log.volume().info().time_steps, 3);
    assert_eq!(log.volume().times().unwrap(), times(&[1.5, 2.0, 4.0]));
    let value = log.volume().voxel(At { time: 2, channel: 0, lod: 0 }, [16, 0, 0]).unwrap();
    assert_eq!(value, noise(Extent::cube(16), |h| (h >> 24) as u8).value([0; 3]).unwrap());
    // A cut keeps the times of its steps.
    let part = log.volume().excerpt(&CopyOptions { times: Some(1..3), ..CopyOptions::default() }).unwrap();
    let cut = part.write_head(Cursor::new(Vec::new()), &mut |_, _| {}).unwrap().0.into_inner();
    assert!(verify(&cut).is_empty());
    assert_eq!(open(cut).times().unwrap(), times(&[2.0, 4.0]));
}

#[test] // old state valid until the commit is whole
fn an_append_that_is_cut_short_is_the_old_log() {
    let dir = tempfile::tempdir().unwrap();
    let path = log_file(dir.path(), CodecChoice::Zerobit, None);
    append(&path, 1, None).unwrap();
    let old = std::fs::read(&path).unwrap();
    append(&path, 2, None).unwrap();
    let new = std::fs::read(&path).unwrap();
    let torn = dir.path().join("torn.vug");
    let cuts = (old.len()..new.len()).step_by(97).chain(new.len() - 40..new.len());
    for len in cuts {
        let volume = Volume::open(MemorySource(new[..len].to_vec()), Limits::default());
        let volume = volume.unwrap_or_else(|e| panic!("{len}: {e}"));
        assert_eq!(volume.info().time_steps, 2, "{len} bytes");
        if len % 5 == 0 {
            std::fs::write(&torn, &new[..len]).unwrap();
            let mut log = Appender::open(&torn).unwrap();
            assert_eq!(log.unfinished_bytes(), (len - old.len()) as u64);
            let steps = encoded(log.volume(), 2);
            log.append(&steps, None, &mut |_, _| {}).unwrap();
            drop(log);
            assert!(std::fs::read(&torn).unwrap() == new, "appended again, it is the same");
        }
    }
}

#[test] // spec: LOG-9, LOG-10
fn a_long_append_that_is_killed_leaves_a_log_that_opens() {
    let dir = tempfile::tempdir().unwrap();
    let path = log_file(dir.path(), CodecChoice::Raw, None);
    let old = open(std::fs::read(&path).unwrap()).head().commit.unwrap();
    let mut log = Appender::open(&path).unwrap();
    log.commit_every(1000);
    let steps = encoded(log.volume(), 1);
    log.append(&steps, None, &mut |_, _| {}).unwrap();
    drop(log);
    let new = std::fs::read(&path).unwrap();
    let last = open(new.clone()).head().commit.unwrap();
    assert!(last.generation > old.generation + 2, "{last:?}");
    assert_steps(&open(new.clone()), CodecChoice::Raw, 2);
    let errors = verify(&new);
    assert!(errors.is_empty(), "{errors:?}");
    let mut renewed = 0;
    for len in (old.end as usize..new.len()).step_by(1009) {
        // The old state, said near the end.
        let volume = Volume::open(MemorySource(new[..len].to_vec()), Limits::default()).unwrap();
        let commit = volume.head().commit.unwrap();
        assert!(volume.info().time_steps == 1 && len as u64 - commit.end < 8000, "{len}: {commit:?}");
        renewed = renewed.max(commit.generation);
    }
    assert_eq!(renewed + 1, last.generation);
    let torn = dir.path().join("torn.vug");
    std::fs::write(&torn, &new[..last.offset as usize - 9]).unwrap();
    append(&torn, 1, None).unwrap();
    let again = std::fs::read(&torn).unwrap();
    assert!(verify(&again).is_empty());
    assert_steps(&open(again), CodecChoice::Raw, 2);
}

#[test]
fn equal_codebooks_are_not_added_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = log_file(dir.path(), CodecChoice::Zerobit, None);
    let count = |path: &Path| Volume::open_path(path).unwrap().codebooks().unwrap().len();
    let one = count(&path);
    assert!(one > 0);
    // The third brings its own; then the first and the third once more.
    let two = [(0, one), (0, one), (3, 2 * one), (0, 2 * one), (3, 2 * one)];
    let mut balls = vec![0];
    for (k, books) in two {
        append(&path, k, None).unwrap();
        balls.push(k);
        assert_eq!(count(&path), books, "{balls:?}");
    }
    let file = std::fs::read(&path).unwrap();
    assert!(verify(&file).is_empty());
    let volume = open(file);
    for (time, &k) in (0..).zip(&balls) {
        let alone = open(encode(&mut step(k), &options(CodecChoice::Zerobit)).0);
        let found = volume.read(At { time, channel: 0, lod: 0 }).unwrap();
        assert_eq!(found.bytes(), alone.read(At::lod(0)).unwrap().bytes(), "time step {time}");
    }
}

/// Remembers where it was flushed.
#[derive(Default)]
struct Flushed {
    bytes: Vec<u8>,
    at: Vec<usize>,
}

impl std::io::Write for Flushed {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.bytes.write(bytes)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.at.push(self.bytes.len());
        Ok(())
    }
}

#[test]
fn all_that_a_commit_speaks_of_is_flushed_before_it() {
    let source = open(encode(&mut step(1), &options(CodecChoice::Zerobit)).0);
    let excerpt = source.excerpt(&CopyOptions::default()).unwrap();
    let log = excerpt.write_log(Flushed::default(), &mut |_, _| {}).unwrap().0;
    let commit = open(log.bytes.clone()).head().commit.unwrap();
    let last = &log.at[log.at.len() - 2..];
    assert_eq!(last, [commit.offset as usize, commit.end as usize]);
}

#[test]
fn what_does_not_fit_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = log_file(dir.path(), CodecChoice::S3dc, None);
    let before = std::fs::read(&path).unwrap();
    let mut log = Appender::open(&path).unwrap();
    let e = Appender::open(&path).map(|_| ()).unwrap_err();
    assert!(e.code() == Code::Source && e.message().contains("another process"), "{e}");
    let own = || log.volume().encode_options().unwrap();
    let bad = [
        ("dims", encode(&mut ball(Extent::new(50, 37, 32)), &own()).0),
        ("sample_type", encode(&mut noise(Extent::new(50, 37, 33), |h| h as u16), &own()).0),
        ("levels", encode(&mut step(1), &EncodeOptions { levels: 1, ..own() }).0),
        ("brick", encode(&mut step(1), &EncodeOptions { brick: Some(32), ..own() }).0),
        ("null-value", encode(&mut step(1), &EncodeOptions { null_value: 3.0, ..own() }).0),
    ];
    for (field, file) in bad {
        let e = log.append(&open(file), None, &mut |_, _| {}).unwrap_err();
        assert_eq!((e.code(), e.field()), (Code::Param, field), "{e}");
    }
    // Another codec is welcome.
    let raw = open(encode(&mut step(1), &options(CodecChoice::Raw)).0);
    log.append(&raw, None, &mut |_, _| {}).unwrap();
    assert_eq!(log.volume().info().codecs.len(), 2);
    let found = log.volume().read(At { time: 1, channel: 0, lod: 0 }).unwrap();
    assert_eq!(found.bytes(), step(1).bytes());
    assert!(std::fs::read(&path).unwrap().starts_with(&before));
    drop(log);
    let head = dir.path().join("head.vug");
    std::fs::write(&head, encode(&mut step(0), &options(CodecChoice::Raw)).0).unwrap();
    let e = Appender::open(&head).map(|_| ()).unwrap_err();
    assert!(e.code() == Code::Param && e.message().contains("pack --log"), "{e}");
}

#[test]
fn a_damaged_step_is_not_appended() {
    let dir = tempfile::tempdir().unwrap();
    let path = log_file(dir.path(), CodecChoice::S3dc, None);
    let before = std::fs::read(&path).unwrap();
    let mut log = Appender::open(&path).unwrap();
    let mut bad = encode(&mut step(1), &log.volume().encode_options().unwrap()).0;
    // The last brick: others are written before it is looked at.
    let brik = open(bad.clone()).head().section(*b"BRIK").unwrap().end() as usize;
    bad[brik - 20] ^= 1;
    let e = log.append(&open(bad), None, &mut |_, _| {}).unwrap_err();
    assert_eq!(e.code(), Code::BrickCrc, "{e}");
    assert!(std::fs::read(&path).unwrap() == before);
    let source = FileSource::open(&path).unwrap();
    assert_eq!(Volume::open(source, Limits::default()).unwrap().info().time_steps, 1);
}
