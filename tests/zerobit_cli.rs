//! Zerobit through the program: options, conflicts, messages, JSON.
#![cfg(feature = "cli")]

mod support;

use assert_cmd::Command;
use serde_json::{Value, json};
use std::path::Path;
use support::{ball_at, hash};
use tempfile::TempDir;
use vug::{Extent, Grid};

struct Run {
    code: i32,
    out: String,
    err: String,
}

fn run(dir: &Path, args: &[&str]) -> Run {
    let output = Command::cargo_bin("vug").unwrap().current_dir(dir).args(args).output().unwrap();
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    Run { code: output.status.code().unwrap(), out: text(output.stdout), err: text(output.stderr) }
}

fn ok(dir: &Path, args: &[&str]) -> String {
    let r = run(dir, args);
    assert_eq!(r.code, 0, "{args:?}: {}{}", r.out, r.err);
    r.out
}

const SHAPE: [&str; 2] = ["--shape", "40,36,33"];

/// A folder with `colour.raw` (rgb8), `grey.raw` (u16), `float.raw` and `mask.raw` (u8) of the same shape.
fn folder() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    let e = Extent::new(40, 36, 33);
    let colour = |c| [ball_at(e, c), ball_at(e, c) / 2, (hash(c) % 30) as u8 * u8::from(ball_at(e, c) > 0)];
    let save = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    save("colour.raw", Grid::from_fn(e, colour).unwrap().bytes());
    save("grey.raw", Grid::from_fn(e, |c| u16::from(ball_at(e, c)) * 100).unwrap().bytes());
    save("float.raw", Grid::from_fn(e, |c| f32::from(ball_at(e, c))).unwrap().bytes());
    save("mask.raw", Grid::from_fn(e, |c| u8::from(c[0] < 20)).unwrap().bytes());
    dir
}

fn encode<'a>(source: &'a str, t: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["encode", source, "out.vug", "--dtype", t, "--force"], &SHAPE[..], more].concat()
}

fn encode_json(dir: &Path, source: &str, t: &str, more: &[&str]) -> Value {
    let report = serde_json::from_str(&ok(dir, &[&encode(source, t, more)[..], &["--json"]].concat())).unwrap();
    ok(dir, &["verify", "out.vug"]);
    report
}

fn refused(dir: &Path, source: &str, t: &str, more: &[&str]) -> String {
    let r = run(dir, &encode(source, t, more));
    assert!(r.code == 2 && r.out.is_empty(), "{more:?}: {} {}", r.code, r.out);
    assert!(!dir.join("out.vug").exists(), "{more:?}");
    r.err
}

#[test]
fn options_and_what_the_file_says_of_them() {
    let dir = folder();
    let d = dir.path();
    for (more, expected) in [
        (&["--codec", "zerobit"][..], json!(["new", 0.03, "adaptive", "energy", "median-cut"])),
        (&["--keep", "5%"], json!(["new", 0.05, "adaptive", "energy", "median-cut"])),
        (&["--keep", "0.0125", "--threshold", "global"], json!(["new", 0.0125, "global", "energy", "median-cut"])),
        (&["--norm", "plain", "--training", "refined"], json!(["new", 0.03, "adaptive", "plain", "refined"])),
        (&["--stream", "old", "--keep", "100%"], json!(["old", 1.0, "adaptive", "energy", "median-cut"])),
        (&["--keep", "0%"], json!(["new", 0.0, "adaptive", "energy", "median-cut"])),
    ] {
        for (source, t) in [("colour.raw", "rgb8"), ("grey.raw", "u16")] {
            let report = encode_json(d, source, t, more);
            assert_eq!((&report["codec"], &report["keep"]), (&json!("zerobit"), &expected[1]), "{more:?}");
            assert_eq!(
                (&report["codebooks"], &report["index_bits"], &report["block"]),
                (&json!(1), &Value::Null, &Value::Null)
            );
            assert_eq!(report["ratio"]["formula"], Value::Null);
            let info: Value = serde_json::from_str(&ok(d, &["info", "out.vug", "--json"])).unwrap();
            assert_eq!(info["codec"], "zerobit");
            let codec = &info["codecs"][0];
            let said = ["stream", "keep", "threshold", "norm", "training"].map(|k| codec[k].clone());
            assert_eq!(json!(said), expected, "{more:?}");
            assert_eq!(codec["selected_voxels"], Value::Null);
        }
    }
    let text = ok(d, &encode("colour.raw", "rgb8", &["--keep", "2.5%"]));
    assert!(
        text.contains("zerobit, 2.5000 % kept, adaptive thresholds, energy norm, 1 codebook(s), median-cut"),
        "{text}"
    );
    let report = encode_json(d, "colour.raw", "rgb8", &["--keep", "4%", "--brick", "16", "--codebook-region", "2"]);
    assert_eq!(report["codebooks"], 2, "the other six regions are background");
    // What comes back is what the report says.
    ok(d, &["decode", "out.vug", "back.nrrd"]);
    let compare = [&["compare", "colour.raw", "back.nrrd", "--dtype", "rgb8", "--json"], &SHAPE[..]].concat();
    let compared: Value = serde_json::from_str(&ok(d, &compare)).unwrap();
    assert_eq!(compared["max_error"], report["max_error"]);
    ok(d, &["slice", "out.vug", "--output", "slice.png", "--axis", "z"]);
}

#[test]
fn bounds_take_zerobit_for_colours() {
    let dir = folder();
    let d = dir.path();
    let report = encode_json(d, "colour.raw", "rgb8", &["--psnr", "30"]);
    assert!(report["codec"] == "zerobit" && report["psnr"].as_f64().unwrap() >= 30.0, "{report}");
    let report = encode_json(d, "colour.raw", "rgb8", &["--rate", "1.5"]);
    assert_eq!(report["codec"], "zerobit");
    let report = encode_json(d, "colour.raw", "rgb8", &["--max-error", "0"]);
    assert!(
        report["codec"] == "raw" && report["notes"][0].as_str().unwrap().contains("zerobit cannot reach"),
        "{report}"
    );
    let report = encode_json(d, "grey.raw", "u16", &["--max-error", "10%", "--codec", "zerobit"]);
    assert!(report["codec"] == "zerobit" && report["max_error"].as_f64().unwrap() <= 2_450.0, "{report}");
    let report = encode_json(d, "grey.raw", "u16", &["--psnr", "30", "--training", "refined"]);
    assert_eq!(report["codec"], "zerobit", "an option of zerobit means zerobit");
    // Without any wish grey is s3dc, and colour is raw.
    assert_eq!(encode_json(d, "grey.raw", "u16", &[])["codec"], "s3dc");
    assert_eq!(encode_json(d, "colour.raw", "rgb8", &[])["codec"], "raw");
    let err = {
        std::fs::remove_file(d.join("out.vug")).unwrap();
        refused(d, "colour.raw", "rgb8", &["--max-error", "0", "--codec", "zerobit"])
    };
    assert!(err.contains("E_PARAM") && err.contains("a largest error of") && err.contains("weaker bound"), "{err}");
    let err = refused(d, "colour.raw", "rgb8", &["--rate", "0.0001", "--codec", "zerobit"]);
    assert!(err.contains("at least"), "{err}");
}

#[test]
fn refusals() {
    let dir = folder();
    let d = dir.path();
    let meant = refused(d, "colour.raw", "rgb8", &["--keep=1.5"]);
    assert!(meant.contains("is 1.5% meant?"), "{meant}");
    for keep in ["150%", "150", "-1%", "x", "100.001%", "nan", "inf"] {
        let err = refused(d, "colour.raw", "rgb8", &[&format!("--keep={keep}")]);
        assert!(err.contains("0% to 100%"), "{keep}: {err}");
    }
    for other in [["--max-error", "3"], ["--psnr", "40"], ["--rate", "2"]] {
        let err = refused(d, "colour.raw", "rgb8", &[&["--keep", "3%"], &other[..]].concat());
        assert!(err.contains("cannot be used with"), "{err}");
    }
    for (more, word) in [
        (&["--codec", "s3dc", "--keep", "3%"][..], "--codec zerobit"),
        (&["--codec", "raw", "--training", "refined"], "--codec zerobit"),
        (&["--codec", "auto", "--stream", "old"], "--codec zerobit"),
        (&["--codec", "zerobit", "--index-bits", "4"], "no index bits"),
        (&["--keep", "3%", "--block", "8"], "no index bits"),
        (&["--keep", "3%", "--endpoints", "fitted"], "no index bits"),
        (&["--keep", "3%", "--codebook-region", "0"], "--codebook-region"),
        (&["--codec", "s3dc"], "zerobit"),
    ] {
        let err = refused(d, "colour.raw", "rgb8", more);
        assert!(err.contains(word), "{more:?}: {err}");
    }
    let err = refused(d, "float.raw", "f32", &["--keep", "3%"]);
    assert!(err.contains("E_PARAM") && err.contains("f32") && err.contains("s3dc"), "{err}");
    let help = ok(d, &["encode", "--help"]);
    for option in ["--keep", "--threshold", "--norm", "--training", "--codebook-region", "--stream", "--select"] {
        assert!(help.contains(option), "{option}");
    }
}

#[test]
fn selections() {
    let dir = folder();
    let d = dir.path();
    // Shape and type given are those of the source; the mask has its own, or as a raw file a byte per voxel.
    ok(d, &[&["encode", "mask.raw", "mask.vug", "--codec", "raw", "--dtype", "u8"], &SHAPE[..]].concat());
    ok(d, &["decode", "mask.vug", "mask.nrrd"]);
    ok(d, &["decode", "mask.vug", "small.nrrd", "--region", "0:40,0:36,0:32"]);
    let whole = encode_json(d, "colour.raw", "rgb8", &["--keep", "5%"]);
    for mask in ["mask.nrrd", "mask.vug", "mask.raw"] {
        let part = encode_json(d, "colour.raw", "rgb8", &["--keep", "5%", "--select", mask]);
        assert!(part["bytes"].as_u64().unwrap() < whole["bytes"].as_u64().unwrap());
        let info: Value = serde_json::from_str(&ok(d, &["info", "out.vug", "--json"])).unwrap();
        assert_eq!(info["codecs"][0]["selected_voxels"], 20 * 36 * 33);
    }
    std::fs::remove_file(d.join("out.vug")).unwrap();
    let err = refused(d, "colour.raw", "rgb8", &["--keep", "5%", "--select", "small.nrrd"]);
    assert!(err.contains("selection") && err.contains("40×36×32") && err.contains("40×36×33"), "{err}");
    let r = run(d, &encode("colour.raw", "rgb8", &["--keep", "5%", "--select", "missing.nrrd"]));
    assert!(r.code != 0 && r.err.contains("missing.nrrd"), "{}", r.err);
}
