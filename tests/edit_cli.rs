//! `vug pack`, `repack` and `extract` as programs.
#![cfg(feature = "cli")]

mod support;

use assert_cmd::Command;
use std::path::{Path, PathBuf};
use support::{ball, encode, explicit, open, verify};
use vug::volume::{At, EncodeOptions};
use vug::{Extent, Region};

#[derive(Debug)]
struct Run {
    code: i32,
    out: String,
    err: String,
}

fn run(args: &[&str], paths: &[&Path]) -> Run {
    let output = Command::cargo_bin("vug").unwrap().args(args).args(paths).output().unwrap();
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    Run { code: output.status.code().expect("no signal"), out: text(output.stdout), err: text(output.stderr) }
}

fn json(r: &Run) -> serde_json::Value {
    assert_eq!(r.code, 0, "{}", r.err);
    serde_json::from_str(&r.out).unwrap()
}

/// A file of 3 levels of 16³ bricks.
fn file(dir: &Path) -> PathBuf {
    let mut grid = ball(Extent::new(64, 50, 40));
    let path = dir.join("a.vug");
    std::fs::write(&path, encode(&mut grid, &EncodeOptions { brick: Some(16), levels: 3, ..explicit(4, 4) }).0)
        .unwrap();
    path
}

#[test]
fn pack_and_repack_there_and_back() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (file(dir.path()), dir.path().join("b.vug"));
    assert_eq!(json(&run(&["pack", "--json"], &[&a, &b]))["converted"], 0);
    assert_eq!(std::fs::read(&a).unwrap(), std::fs::read(&b).unwrap());
    let r = run(&["pack", "--clustered"], &[&a, &b]);
    assert_eq!(r.code, 2, "the target is there already");
    assert!(r.err.contains("--force"), "{}", r.err);
    let r = run(&["pack", "--clustered", "--force", "--file-id", &"ab".repeat(16)], &[&a, &b]);
    assert_eq!(r.code, 0, "{}", r.err);
    assert!(r.out.contains("stored") && r.out.contains("64×50×40 u8"), "{}", r.out);
    let packed = std::fs::read(&b).unwrap();
    assert!(open(packed.clone()).head().superblock.clustered && open(packed).head().superblock.file_id == [0xab; 16]);
    // In place.
    let plain = json(&run(&["repack", "--no-zstd", "--force", "--json"], &[&b, &b]));
    assert_eq!(plain["stored_bytes"], plain["payload_bytes"]);
    let small = json(&run(&["repack", "--zstd", "--force", "--json"], &[&b, &b]));
    assert!(small["converted"].as_u64() > Some(0) && small["stored_bytes"].as_u64() < plain["stored_bytes"].as_u64());
    assert!(verify(&std::fs::read(&b).unwrap()).is_empty());
    let compared = json(&run(&["compare", "--json"], &[&a, &b]));
    assert_eq!(compared["identical"], true);
    // Not where something would be lost by it, nor under the name of standard output.
    let r = run(&["extract", "--force", "--levels", "1:2"], &[&b, &b]);
    assert!(r.code == 2 && r.err.contains("source itself"), "{}", r.err);
    let r = run(&["recover", "--force"], &[&b, &b]);
    assert!(r.code == 2 && r.err.contains("source itself"), "{}", r.err);
    assert_eq!(run(&["pack"], &[&b, Path::new("-")]).code, 2);
    for args in [&["repack"][..], &["repack", "--zstd", "--no-zstd"]] {
        assert_eq!(run(args, &[&a, &b]).code, 2);
    }
}

#[test]
fn extract_says_what_it_kept() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (file(dir.path()), dir.path().join("b.vug"));
    let region = "17:30,0:16,3:4";
    let r = run(&["extract", "--region", region, "--json"], &[&a, &b]);
    let found = json(&r);
    assert_eq!((&found["dims"], &found["region"]), (&serde_json::json!([16, 16, 16]), &"16:32,0:16,0:16".into()));
    assert_eq!(found["levels"], serde_json::json!([0, 1]));
    let notes = found["notes"].as_array().unwrap();
    assert!(notes.len() == 2 && notes[1].as_str().unwrap().contains("levels 1 to 2 are left out"), "{notes:?}");
    let r = run(&["extract", "--region", region, "--levels", "0:2", "--force"], &[&a, &b]);
    assert_eq!(r.code, 0, "{}", r.err);
    assert!(r.out.contains("32×32×32 u8") && r.err.contains("0:32,0:32,0:32"), "{} {}", r.out, r.err);
    let (whole, part) = (open(std::fs::read(&a).unwrap()), open(std::fs::read(&b).unwrap()));
    let wanted = whole.read_region(At::lod(1), Region { start: [0; 3], end: [16; 3] }).unwrap();
    assert_eq!(part.read(At::lod(1)).unwrap().bytes(), wanted.bytes());
    let found = json(&run(&["extract", "--levels", "1", "--force", "--json", "--clustered"], &[&a, &b]));
    assert_eq!((&found["levels"], found["notes"].as_array().unwrap().len()), (&serde_json::json!([1, 2]), 0));
    for bad in [["--levels", "3"], ["--times", "1"], ["--channels", "0:2"], ["--region", "0:65,0:1,0:1"]] {
        let r = run(&[&["extract", "--force"], &bad[..]].concat(), &[&a, &b]);
        assert_eq!(r.code, 2, "{bad:?}: {}", r.err);
        assert!(r.err.contains("E_RANGE"), "{}", r.err);
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2, "nothing is left behind");
}

/// Raw steps 0 to 3 of 40×30×20 u8, and a log of the first.
fn series(dir: &Path) -> PathBuf {
    for k in 0..4u32 {
        let grid = vug::Grid::from_fn(Extent::new(40, 30, 20), |c| (c[0] * 3 + c[1] * k + c[2]) as u8).unwrap();
        std::fs::write(dir.join(format!("{k}.raw")), grid.bytes()).unwrap();
    }
    let (head, log) = (dir.join("head.vug"), dir.join("log.vug"));
    let args = ["encode", "--shape", "40,30,20", "--dtype", "u8", "--brick", "16", "--levels", "2"];
    assert_eq!(run(&args, &[&dir.join("0.raw"), &head]).code, 0);
    assert_eq!(run(&["pack", "--log"], &[&head, &log]).code, 0);
    log
}

#[test]
fn append_and_pack() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let log = series(d);
    let raw = ["--shape", "40,30,20", "--dtype", "u8", "--json"];
    let first = [&["append"], &raw[..]].concat();
    let found = json(&run(&first, &[&log, &d.join("1.raw"), &d.join("2.raw")]));
    assert_eq!((&found["time_steps"], found["appended"].as_array().unwrap().len()), (&3.into(), 2));
    // A .vug file as a step; what a killed writer left behind is cut off.
    let args = ["encode", "--shape", "40,30,20", "--dtype", "u8", "--brick", "16", "--levels", "2", "--no-zstd"];
    assert_eq!(run(&args, &[&d.join("3.raw"), &d.join("3.vug")]).code, 0);
    let mut torn = std::fs::read(&log).unwrap();
    torn.extend([7; 100]);
    std::fs::write(&log, torn).unwrap();
    let found = json(&run(&["pack", "--json"], &[&log, &d.join("torn.vug")]));
    assert!(found["notes"][0].as_str().unwrap().starts_with("100 bytes behind the last commit"), "{found}");
    let r = run(&["append"], &[&log, &d.join("3.vug")]);
    assert_eq!(r.code, 0, "{}", r.err);
    assert!(r.out.contains("time step(s) 3 to 3") && r.err.contains("100 bytes behind the last commit"), "{r:?}");
    let packed = d.join("packed.vug");
    assert_eq!(run(&["pack", "--clustered"], &[&log, &packed]).code, 0);
    assert_eq!(run(&["verify"], &[&packed]).code, 0);
    let volume = open(std::fs::read(&packed).unwrap());
    assert_eq!(volume.info().time_steps, 4);
    for (k, one) in [(1u32, "1.vug"), (3, "3.vug")] {
        let cut = d.join("cut.vug");
        assert_eq!(run(&["extract", "--force", "--times", &k.to_string()], &[&log, &cut]).code, 0);
        if k == 3 {
            let (a, b) = (open(std::fs::read(&cut).unwrap()), open(std::fs::read(d.join(one)).unwrap()));
            assert_eq!(a.read(At::default()).unwrap().bytes(), b.read(At::default()).unwrap().bytes());
            assert_eq!(a.read(At::lod(1)).unwrap().bytes(), b.read(At::lod(1)).unwrap().bytes());
        }
    }
}

#[test]
fn append_refuses_what_does_not_fit() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let log = series(d);
    let before = std::fs::read(&log).unwrap();
    let raw = |shape: &str, extra: &[&str]| {
        run(&[&["append", "--shape", shape, "--dtype", "u8"], extra].concat(), &[&log, &d.join("1.raw")])
    };
    let r = raw("30,40,20", &[]);
    assert!(r.code == 2 && r.err.contains("40×30×20"), "{r:?}");
    let r = raw("40,30,20", &["--time", "1"]);
    assert!(r.code == 2 && r.err.contains("no times"), "{r:?}");
    let r = run(&["append", "--shape", "40,30,20", "--dtype", "u8"], &[&d.join("head.vug"), &d.join("1.raw")]);
    assert!(r.code == 2 && r.err.contains("pack --log"), "{r:?}");
    assert_eq!(std::fs::read(&log).unwrap(), before);
    assert_eq!(std::fs::read_dir(d).unwrap().count(), 6, "no temporary is left");
}

#[test]
fn recover_lists_what_lives_and_what_is_lost() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let log = series(d);
    let whole = json(&run(&["recover", "--json"], &[&log, &d.join("whole.vug")]));
    assert_eq!((whole["lost"].as_array().unwrap().len(), whole["damage"].as_array().unwrap().len()), (0, 0));
    let all = whole["live"].as_array().unwrap().len();
    assert!(all > 0 && whole["commit"]["generation"].as_u64() > Some(0), "{whole}");
    // The last brick of the log is damaged.
    let mut bytes = std::fs::read(&log).unwrap();
    let id = open(bytes.clone()).head().superblock.file_id;
    let (at, leader) = vug::container::find_leaders(&bytes, 0, &id).pop().unwrap();
    bytes[at as usize + 33] ^= 1;
    std::fs::write(&log, &bytes).unwrap();
    let (rest, brick) = (d.join("rest.vug"), leader.brick);
    let r = run(&["recover"], &[&log, &rest]);
    assert_eq!(r.code, 1, "{r:?}");
    let lost = format!("lost: time step 0, channel 0, level {}, brick {brick:?}: E_BRICK_CRC", leader.level);
    assert!(r.err.contains(&lost) && r.err.contains("1 bricks are lost"), "{r:?}");
    assert!(r.out.contains("live        time step 0, channel 0, level 0:"), "{r:?}");
    let found = run(&["recover", "--json", "--force"], &[&log, &rest]);
    assert_eq!(found.code, 1);
    let found: serde_json::Value = serde_json::from_str(&found.out).unwrap();
    assert_eq!(found["live"].as_array().unwrap().len(), all - 1);
    assert_eq!(found["lost"][0]["error"]["code"], "E_BRICK_CRC");
    assert_eq!(run(&["verify"], &[&rest]).code, 0);
    assert_eq!(run(&["verify"], &[&log]).code, 3);
    // Nothing to start from.
    std::fs::write(&log, &bytes[..300]).unwrap();
    let r = run(&["recover", "--force"], &[&log, &rest]);
    assert!(r.code == 3 && r.err.contains("E_COMMIT"), "{r:?}");
    assert_eq!(run(&["verify"], &[&rest]).code, 0, "the old file is still there");
}

#[test]
fn append_says_where_steps_are_further_from_their_source_than_the_file_was() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let of = |f: fn(u32) -> u8| (0..32 * 32 * 32).map(f).collect::<Vec<u8>>();
    std::fs::write(d.join("smooth.raw"), of(|i| (i % 32 + i / 1024) as u8)).unwrap();
    std::fs::write(d.join("rough.raw"), of(|i| (i.wrapping_mul(0x9E37_79B1) >> 24) as u8)).unwrap();
    let (head, log) = (d.join("head.vug"), d.join("log.vug"));
    let raw = ["--shape", "32,32,32", "--dtype", "u8"];
    let r = run(
        &[&["encode", "--codec", "s3dc", "--max-error", "1", "--brick", "16"], &raw[..]].concat(),
        &[&d.join("smooth.raw"), &head],
    );
    assert_eq!(r.code, 0, "{}", r.err);
    assert_eq!(run(&["pack", "--log"], &[&head, &log]).code, 0);
    let append = |name: &str, extra: &[&str]| {
        let r = run(&[&["append"], &raw[..], extra].concat(), &[&log, &d.join(name)]);
        assert_eq!(r.code, 0, "{}", r.err);
        r.err
    };
    assert!(!append("smooth.raw", &[]).contains("largest error"));
    let before = open(std::fs::read(&log).unwrap()).info().achieved.unwrap().max_error;
    let copy = std::fs::read(&log).unwrap();
    let said = append("rough.raw", &[]);
    let after = open(std::fs::read(&log).unwrap()).info().achieved.unwrap().max_error;
    assert!(before <= 1.0 && after > 1.0);
    assert!(said.contains(&format!("rough.raw is {after}")) && said.contains(&format!("so far {before}")), "{said}");
    std::fs::write(&log, copy).unwrap();
    assert!(!append("rough.raw", &["--quiet"]).contains("note"));
}
