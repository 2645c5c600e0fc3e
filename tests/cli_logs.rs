//! What the program says of logs that their writers did not finish, and of wrong usage.
#![cfg(feature = "cli")]

mod support;

use assert_cmd::Command;
use std::path::Path;
use vug::Extent;
use vug::volume::{At, CodecChoice, EncodeOptions, Volume};

fn vug(dir: &Path, args: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("vug").unwrap().current_dir(dir).args(args).output().unwrap();
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// A log whose writer was stopped: all but its last bytes are there, and no commit but the first.
fn torn(dir: &Path) -> (usize, usize) {
    let mut grid = support::noise(Extent::new(70, 50, 40), |h| (h >> 24) as u8);
    let options = EncodeOptions { codec: CodecChoice::Raw, brick: Some(16), zstd: false, ..EncodeOptions::default() };
    let mut log = Vec::new();
    vug::volume::encode_log(&mut grid, &mut log, &options, &mut |_, _| {}).unwrap();
    log.truncate(log.len() * 3 / 4);
    std::fs::write(dir.join("torn.vug"), &log).unwrap();
    let volume = Volume::open_path(dir.join("torn.vug")).unwrap();
    (log.len(), volume.head().unfinished() as usize)
}

#[test]
fn unfinished_logs_say_so_and_keep_what_was_finished() {
    let folder = tempfile::tempdir().unwrap();
    let d = folder.path();
    let (len, behind) = torn(d);
    assert!(behind > len / 2, "{behind} of {len} bytes have no commit");
    let (code, out, err) = vug(d, &["info", "torn.vug"]);
    assert!(code == 0 && out.contains(&format!("log, unfinished: {behind} bytes")), "{out}");
    assert!(err.contains("unfinished") && err.contains("vug recover"), "{err}");
    let (code, _, err) = vug(d, &["decode", "torn.vug", "a.raw"]);
    assert!(code == 0 && err.contains("null value"), "what no commit has is not passed over in silence: {err}");
    // Appending would cut off what can be saved.
    let before = std::fs::read(d.join("torn.vug")).unwrap();
    std::fs::write(d.join("step.raw"), vec![7; 70 * 50 * 40]).unwrap();
    let append = ["append", "torn.vug", "step.raw", "--shape", "70,50,40", "--dtype", "u8"];
    let (code, _, err) = vug(d, &append);
    assert!(code == 2 && err.contains("finished bricks") && err.contains("--cut"), "{err}");
    assert!(std::fs::read(d.join("torn.vug")).unwrap() == before);
    let (code, out, err) = vug(d, &["recover", "torn.vug", "saved.vug", "--json"]);
    let found: serde_json::Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}: {out}{err}"));
    assert!(code <= 1 && found["live"].as_array().unwrap().len() > 20, "{found}");
    let (code, _, err) = vug(d, &[&append[..], &["--cut"]].concat());
    assert_eq!(code, 0, "{err}");
    let volume = Volume::open_path(d.join("torn.vug")).unwrap();
    assert_eq!((volume.info().time_steps, volume.head().unfinished()), (2, 0));
    let step = volume.read(At { time: 1, ..At::default() }).unwrap();
    assert!(step.samples::<u8>().iter().all(|v| *v == 7));
}

#[test]
fn wrong_usage_is_json_too() {
    let folder = tempfile::tempdir().unwrap();
    let d = folder.path();
    torn(d);
    for (args, code, word) in [
        (&["slice", "torn.vug", "--axis", "w", "-o", "a.png"][..], 2, "axis"),
        (&["encode"], 2, "SOURCE"),
        (&["nonsense"], 2, "nonsense"),
        (&["encode", "nosuch.nrrd", "a.vug"], 3, "nosuch.nrrd"),
        (&["encode", "torn.vug", "a.vug"], 2, "already"),
        (&["pack", "torn.vug", "-"], 2, "standard output"),
        (&["extract", "torn.vug", "torn.vug", "--force", "--times", "0"], 2, "source itself"),
    ] {
        let (found, out, err) = vug(d, &[args, &["--json"]].concat());
        assert_eq!(found, code, "{args:?}: {out}{err}");
        let json: serde_json::Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{args:?}: {e}: {out:?}"));
        assert!(json["error"]["message"].as_str().unwrap().contains(word), "{args:?}: {json}");
    }
}
