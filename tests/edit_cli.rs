//! `vug pack`, `repack` and `extract` as programs.
#![cfg(feature = "cli")]

mod support;

use assert_cmd::Command;
use std::path::{Path, PathBuf};
use support::{ball, encode, explicit, open, verify};
use vug::volume::{At, EncodeOptions};
use vug::{Extent, Region};

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
