//! The program as its users see it: commands, JSON keys, exit codes, files that appear whole or not at all.
#![cfg(feature = "cli")]

mod support;

use assert_cmd::Command;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use vug::Extent;

fn vug() -> Command {
    Command::cargo_bin("vug").unwrap()
}

struct Run {
    code: i32,
    out: String,
    err: String,
}

fn run(dir: &Path, args: &[&str]) -> Run {
    let output = vug().current_dir(dir).args(args).output().unwrap();
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    Run { code: output.status.code().unwrap(), out: text(output.stdout), err: text(output.stderr) }
}

fn ok(dir: &Path, args: &[&str]) -> String {
    let r = run(dir, args);
    assert_eq!(r.code, 0, "{args:?}: {}{}", r.out, r.err);
    r.out
}

fn json(dir: &Path, args: &[&str]) -> Value {
    serde_json::from_str(&ok(dir, &[args, &["--json"]].concat())).unwrap()
}

/// A folder with a raw volume: ball.raw, 70×60×50 u8.
fn folder() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("ball.raw"), support::ball(Extent::new(70, 60, 50)).bytes()).unwrap();
    dir
}

const RAW: [&str; 4] = ["--shape", "70,60,50", "--dtype", "u8"];

fn encoded() -> TempDir {
    let dir = folder();
    ok(dir.path(), &[&["encode", "ball.raw", "ball.vug"], &RAW[..]].concat());
    dir
}

#[test]
fn the_main_job() {
    let dir = encoded();
    let d = dir.path();
    ok(d, &["verify", "ball.vug"]);
    ok(d, &["decode", "ball.vug", "back.nrrd"]);
    let c = json(d, &[&["compare", "ball.raw", "back.nrrd"], &RAW[..]].concat());
    let [max, psnr, ssim] = ["max_error", "psnr", "ssim"].map(|k| c[k].as_f64().unwrap());
    assert!(max > 0.0 && max <= 9.0 && psnr > 30.0 && ssim > 0.9, "{c}");
    let same = json(d, &["compare", "ball.vug", "back.nrrd"]);
    assert_eq!((&same["psnr"], &same["identical"]), (&Value::Null, &Value::Bool(true)));
    let info = ok(d, &["info", "ball.vug"]);
    assert!(info.contains("70 × 60 × 50 u8 (x, y, z)"), "{info}");
}

#[test]
fn json_keys() {
    let dir = encoded();
    let d = dir.path();
    let info = json(d, &["info", "ball.vug"]);
    for key in ["dims", "sample_type", "channels", "codec", "levels", "spacing", "bytes", "bits_per_voxel", "max_error"]
    {
        assert!(info.get(key).is_some(), "info.{key}");
    }
    for key in ["total", "stored", "constant", "empty"] {
        assert!(info["bricks"][key].is_u64(), "info.bricks.{key}");
    }
    for key in ["formula", "payload", "file"] {
        assert!(info["ratio"][key].is_f64(), "info.ratio.{key}");
    }
    // K-20, S-20: what textures padded to powers of two would give is told, and is less.
    let ratio = |key: &str| info["ratio"][key].as_f64().unwrap();
    assert!(ratio("padded") < ratio("formula") / 2.0, "128×64×64 instead of 70×60×50");
    assert_eq!(info["dims"], serde_json::json!([70, 60, 50]));
    let c = json(d, &["compare", "ball.vug", "ball.vug"]);
    for key in ["range", "max_error", "mean_error", "rmse", "psnr", "ssim", "identical"] {
        assert!(c.get(key).is_some(), "compare.{key}");
    }
    let v = json(d, &["verify", "ball.vug"]);
    assert_eq!((&v["ok"], v["errors"].as_array().unwrap().len()), (&Value::Bool(true), 0));
    let e = json(d, &[&["encode", "ball.raw", "b.vug"], &RAW[..]].concat());
    for key in ["codec", "max_error", "rmse", "psnr", "bits_per_voxel", "ratio"] {
        assert!(e.get(key).is_some(), "encode.{key}");
    }
}

#[test]
fn exit_codes() {
    let dir = encoded();
    let d = dir.path();
    let code = |args: &[&str]| run(d, args).code;
    // 1: over the bound
    assert_eq!(code(&[&["compare", "ball.raw", "ball.vug", "--max-error", "0.1"], &RAW[..]].concat()), 1);
    assert_eq!(code(&[&["compare", "ball.raw", "ball.vug", "--min-psnr", "99"], &RAW[..]].concat()), 1);
    assert_eq!(code(&[&["compare", "ball.raw", "ball.vug", "--max-error", "9"], &RAW[..]].concat()), 0);
    // 2: usage
    for args in [
        &["encode"][..],
        &["encode", "ball.raw", "x.vug"],
        &["encode", "ball.raw", "x.vug", "--shape", "70,60", "--dtype", "u8"],
        &["encode", "ball.raw", "x.vug", "--index-bits", "3"],
        &["encode", "ball.raw", "x.vug", "--index-bits", "4", "--psnr", "40"],
        &["encode", "ball.raw", "x.vug", "--max-error", "1", "--psnr", "40"],
        &["encode", "ball.raw", "x.vug", "--max-error", "-1"],
        &["encode", "ball.raw", "x.vug", "--rate", "4", "--block", "4"],
        &["decode", "ball.vug", "x.nrrd", "--region", "0:10,0:10,0:51"],
        &["decode", "ball.vug", "x.nrrd", "--level", "1"],
        &["slice", "ball.vug", "--axis", "w", "-o", "x.png"],
        &["slice", "ball.vug", "--index", "50", "-o", "x.png"],
        &["slice", "ball.vug", "--colormap", "nosuch", "-o", "x.png"],
        &["compare", "ball.vug", "ball.vug", "--jobs", "0"],
        &["encode", "ball.raw", "ball.raw", "--shape", "70,60,50", "--dtype", "u8", "--force"],
        &["encode", "ball.raw", "x.nrrd", "--shape", "70,60,50", "--dtype", "u8"],
        &["encode", "ball.raw", "x.vug", "--shape", "70,60,50", "--dtype", "u8", "--codec", "raw", "--block", "8"],
        &["compare", "ball.vug", "ball.vug", "--shape", "70,60,50"],
        &["slice", "ball.vug", "--dtype", "u8", "-o", "x.png"],
    ] {
        assert_eq!(code(args), 2, "{args:?}: {}", run(d, args).err);
    }
    // 3: unreadable or corrupt
    std::fs::write(d.join("bad.nrrd"), "NRRD0004\ntype: float\n").unwrap();
    let mut bytes = std::fs::read(d.join("ball.vug")).unwrap();
    let at = bytes.len() - 100;
    bytes[at] ^= 1;
    std::fs::write(d.join("bad.vug"), &bytes).unwrap();
    std::fs::write(d.join("text.vug"), "hello").unwrap();
    for args in [
        &["info", "nosuch.vug"][..],
        &["info", "text.vug"],
        &["verify", "bad.vug"],
        &["verify", "text.vug"],
        &["decode", "bad.vug", "x.nrrd"],
        &["encode", "bad.nrrd", "x.vug"],
        &["encode", "ball.raw", "x.vug", "--shape", "70,60,51", "--dtype", "u8"],
    ] {
        assert_eq!(code(args), 3, "{args:?}: {}", run(d, args).err);
    }
    let left: Vec<_> = std::fs::read_dir(d).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(!left.iter().any(|n| n.to_str().unwrap().starts_with(['x', '.'])), "nothing half-made: {left:?}");
}

#[test]
fn errors_say_code_offset_field_and_what_to_do() {
    let dir = encoded();
    let d = dir.path();
    let mut bytes = std::fs::read(d.join("ball.vug")).unwrap();
    let at = bytes.len() - 100;
    bytes[at] ^= 1;
    std::fs::write(d.join("bad.vug"), &bytes).unwrap();
    let r = run(d, &["verify", "bad.vug", "--json"]);
    let v: Value = serde_json::from_str(&r.out).unwrap();
    let e = &v["errors"][0];
    assert_eq!((r.code, &v["ok"], &e["code"]), (3, &Value::Bool(false), &"E_BRICK_CRC".into()));
    assert!(
        e["offset"].is_u64() && e["field"] == "brick.payload" && e["message"].as_str().unwrap().contains("salvage")
    );
    let r = run(d, &["decode", "bad.vug", "x.nrrd"]);
    assert!(r.err.contains("E_BRICK_CRC at byte"), "{}", r.err);
    let r = run(d, &["decode", "bad.vug", "x.nrrd", "--salvage"]);
    assert_eq!(r.code, 1);
    assert!(r.err.contains("lost: brick") && d.join("x.nrrd").exists(), "{}", r.err);
}

#[test]
fn nothing_is_overwritten_unless_forced() {
    let dir = encoded();
    let d = dir.path();
    let before = std::fs::read(d.join("ball.vug")).unwrap();
    let args = [&["encode", "ball.raw", "ball.vug", "--index-bits", "1"], &RAW[..]].concat();
    let r = run(d, &args);
    assert!(r.code == 2 && r.err.contains("--force"), "{}", r.err);
    assert!(std::fs::read(d.join("ball.vug")).unwrap() == before);
    ok(d, &[&args[..], &["--force"]].concat());
    assert!(std::fs::read(d.join("ball.vug")).unwrap() != before);
    // Forced, but failing: the old file stays.
    let before = std::fs::read(d.join("ball.vug")).unwrap();
    assert_eq!(run(d, &["encode", "ball.raw", "ball.vug", "--shape", "1,1,1", "--dtype", "u8", "--force"]).code, 3);
    assert!(std::fs::read(d.join("ball.vug")).unwrap() == before);
}

#[test] // C-14
fn a_killed_encoder_leaves_nothing_and_its_rest_is_cleared_away() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    // Large and slow enough to be killed half-way: least squares on 64 Mvoxel.
    let file = std::fs::File::create(d.join("big.raw")).unwrap();
    let noise: Vec<u8> = (0..1u32 << 20).map(|i| (support::hash([i, 1, 2]) >> 24) as u8).collect();
    for _ in 0..64 {
        std::io::Write::write_all(&mut &file, &noise).unwrap();
    }
    let args = [
        "encode",
        "big.raw",
        "big.vug",
        "--shape",
        "1024,1024,64",
        "--dtype",
        "u8",
        "--endpoints",
        "fitted",
        "--brick",
        "16",
    ];
    let exe = assert_cmd::cargo::cargo_bin("vug");
    let mut child =
        std::process::Command::new(exe).current_dir(d).args(args).stdout(std::process::Stdio::null()).spawn().unwrap();
    let temporary = || {
        let found = std::fs::read_dir(d).unwrap().map(|e| e.unwrap().path());
        found.filter(|p| p.to_str().unwrap().ends_with(".vug-tmp")).collect::<Vec<PathBuf>>()
    };
    while temporary().is_empty() && child.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    child.kill().unwrap(); // SIGKILL
    let status = child.wait().unwrap();
    assert!(!status.success(), "it was killed half-way");
    assert!(!d.join("big.vug").exists());
    assert_eq!(temporary().len(), 1);
    std::fs::write(d.join("small.raw"), [7u8; 8]).unwrap();
    ok(d, &["encode", "small.raw", "big.vug", "--shape", "2,2,2", "--dtype", "u8"]);
    assert!(temporary().is_empty(), "the dead temporary is gone");
    ok(d, &["verify", "big.vug"]);
}

#[test]
fn parts_levels_and_formats() {
    let dir = folder();
    let d = dir.path();
    ok(d, &[&["encode", "ball.raw", "ball.vug", "--levels", "auto", "--brick", "16"], &RAW[..]].concat());
    assert_eq!(json(d, &["info", "ball.vug"])["levels"], 4);
    let part = json(d, &["decode", "ball.vug", "part.npy", "--region", "10:30,5:6,0:50"]);
    assert_eq!(part["dims"], serde_json::json!([20, 1, 50]));
    let coarse = json(d, &["decode", "ball.vug", "coarse.nii.gz", "--level", "2"]);
    assert_eq!(coarse["dims"], serde_json::json!([18, 15, 13]));
    for target in ["a.nrrd", "a.nhdr", "a.nii", "a.nii.gz", "b.hdr", "a.npy"] {
        ok(d, &["decode", "ball.vug", target, "--force"]);
        assert_eq!(json(d, &["compare", "ball.vug", target])["identical"], true, "{target}");
    }
    assert_eq!(run(d, &["decode", "ball.vug", "a.xyz"]).code, 3);
}

#[test]
fn metadata_is_kept_or_stripped() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let header = "NRRD0005\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nspace: left-posterior-superior\n\
                  space directions: (2,0,0) (0,3,0) (0,0,4)\nspace origin: (1,2,3)\ncontent: of Jane Doe\nname:=Jane Doe\n\n";
    std::fs::write(d.join("a.nrrd"), [header.as_bytes(), &[1, 2, 3, 4, 5, 6, 7, 8]].concat()).unwrap();
    ok(d, &["encode", "a.nrrd", "kept.vug"]);
    ok(d, &["encode", "a.nrrd", "stripped.vug", "--strip-metadata"]);
    let holds = |name: &str| std::fs::read(d.join(name)).unwrap().windows(8).any(|w| w == b"Jane Doe");
    let says = |name: &str| json(d, &["info", name])["meta"].to_string().contains("Jane Doe");
    assert!(says("kept.vug") && !says("stripped.vug") && !holds("stripped.vug"));
    ok(d, &["decode", "kept.vug", "back.nhdr"]);
    assert!(holds("back.nhdr"));
    for file in ["kept.vug", "stripped.vug"] {
        let info = json(d, &["info", file]);
        assert_eq!(
            (&info["space"], &info["spacing"], &info["origin"]),
            (&"LPS".into(), &serde_json::json!([2.0, 3.0, 4.0]), &serde_json::json!([1.0, 2.0, 3.0]))
        );
    }
}

#[test]
fn slices_are_pngs() {
    let dir = encoded();
    let d = dir.path();
    for (i, extra) in
        [&[][..], &["--axis", "y"], &["--axis", "x", "--index", "3"], &["--range", "-5,300", "--colormap", "viridis"]]
            .into_iter()
            .enumerate()
    {
        let name = format!("{i}.png");
        ok(d, &[&["slice", "ball.vug", "-o", &name], extra].concat());
        assert!(std::fs::read(d.join(&name)).unwrap().starts_with(b"\x89PNG\r\n\x1a\n"));
    }
    ok(d, &[&["slice", "ball.vug", "--against", "ball.raw", "-o", "diff.png"], &RAW[..]].concat());
    assert_eq!(run(d, &["slice", "ball.vug", "-o", "noending"]).code, 2);
}

#[test]
fn help_has_examples() {
    let dir = tempfile::tempdir().unwrap();
    for command in ["demo", "encode", "decode", "info", "verify", "compare", "slice"] {
        let help = ok(dir.path(), &[command, "--help"]);
        assert!(help.contains("Examples:"), "{command}");
    }
}

#[test]
fn a_colour_volume_from_file_to_picture() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let extent = Extent::new(40, 36, 20);
    let grid = vug::Grid::from_fn(extent, |[x, y, z]| {
        let inside = (x as i32 - 20).pow(2) + (y as i32 - 18).pow(2) < 200;
        if inside { [(6 * x) as u8, (3 * y + 4 * z) as u8, 90] } else { [0; 3] }
    });
    std::fs::write(d.join("c.raw"), grid.unwrap().bytes()).unwrap();
    let raw = ["--shape", "40,36,20", "--dtype", "rgb8"];
    let report = json(d, &[&["encode", "c.raw", "c.vug", "--keep", "20%", "--training", "refined"], &raw[..]].concat());
    assert_eq!((&report["codec"], &report["codebooks"]), (&Value::from("zerobit"), &Value::from(1)));
    ok(d, &["verify", "c.vug"]);
    let info = ok(d, &["info", "c.vug"]);
    let line = "zerobit, 20 % kept, stream new, threshold adaptive, norm energy, training refined, 1 codebook(s)";
    assert!(info.contains(line), "{info}");
    assert_eq!(json(d, &["info", "c.vug"])["codebooks"], 1);
    let compared = json(d, &[&["compare", "c.raw", "c.vug"], &raw[..]].concat());
    assert!(compared["psnr"].as_f64().unwrap() > 25.0, "{compared}");
    assert_eq!(compared["max_error"], report["max_error"]);
    for (axis, size) in [("x", (36, 20)), ("y", (40, 20)), ("z", (40, 36))] {
        ok(d, &["slice", "c.vug", "--axis", axis, "-o", "s.png", "--force"]);
        let png = std::fs::read(d.join("s.png")).unwrap();
        let be = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
        let enlarged = be(16) / size.0;
        assert_eq!((be(16), be(20)), (enlarged * size.0, enlarged * size.1), "{axis}");
        assert_eq!(png[25], 2, "a picture in colour");
    }
    ok(d, &[&["slice", "c.vug", "--against", "c.raw", "-o", "difference.png"], &raw[..]].concat());
    // A colour cannot be compared with a number.
    std::fs::write(d.join("g.raw"), vec![0; 40 * 36 * 20]).unwrap();
    ok(d, &["encode", "g.raw", "g.vug", "--shape", "40,36,20", "--dtype", "u8"]);
    let r = run(d, &["compare", "c.vug", "g.vug"]);
    assert_eq!(r.code, 2, "{}", r.err);
    assert!(r.err.contains("rgb8 and u8"), "{}", r.err);
}

#[test]
fn demo_makes_a_page_that_needs_nothing_else() {
    let dir = tempfile::tempdir().unwrap();
    let (d, out) = (dir.path(), dir.path().join("out"));
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("index.html"), "mine").unwrap();
    assert_eq!(run(d, &["demo", "out"]).code, 2, "pages are overwritten only when forced");
    assert_eq!(std::fs::read(out.join("index.html")).unwrap(), b"mine");
    ok(d, &["demo", "out", "--force"]);
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("synthetic") && page.contains("data:image/png;base64,"));
    assert!(!page.contains("http://") && !page.contains("https://"), "nothing is fetched");
    let files: Vec<_> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().path()).collect();
    let vugs = files.iter().filter(|p| p.extension().is_some_and(|e| e == "vug"));
    assert!(vugs.clone().count() >= 3);
    for file in vugs {
        ok(d, &["verify", file.to_str().unwrap()]);
    }
    for picture in ["2bit-4-fitted.png", "colour-3.png"] {
        assert!(out.join(picture).exists(), "{picture}");
    }
    #[cfg(feature = "gpu")]
    {
        assert!(out.join("rendered.png").exists());
        for words in ["Rendered", "iso-surface", "linear_opt", "synthetic data"] {
            assert!(page.contains(words), "{words}");
        }
    }
    // Its lines work when pasted, and make the same file again.
    let page = page.replace("&amp;", "&");
    for file in ["2bit-4.vug", "colour-3-best.vug"] {
        let before = std::fs::read(out.join(file)).unwrap();
        let lines: Vec<&str> =
            page.lines().filter(|l| l.contains("vug ") && l.contains(&format!(" {file} "))).collect();
        assert_eq!(lines.len(), 2, "{lines:?}");
        for command in lines.into_iter().flat_map(|line| line.split("&&")) {
            let command = &command[command.find("vug ").unwrap()..];
            let command = command.split('<').next().unwrap_or("");
            let arguments: Vec<&str> = command.split_whitespace().skip(1).collect();
            ok(&out, &arguments);
        }
        let after = std::fs::read(out.join(file)).unwrap();
        assert!(
            after.len() >= before.len() && after.len() < before.len() + 4096,
            "{file}: the same, and the header's text"
        );
    }
}

#[test]
fn a_reader_that_has_had_enough_is_no_error() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("s.vug");
    std::fs::write(dir.path().join("s.raw"), [7u8; 4096]).unwrap();
    let vug = assert_cmd::cargo::cargo_bin("vug");
    let run = |args: &[&std::ffi::OsStr]| std::process::Command::new(&vug).args(args).output().unwrap();
    let raw = dir.path().join("s.raw");
    let made = run(&[
        "encode".as_ref(),
        raw.as_ref(),
        target.as_ref(),
        "--shape".as_ref(),
        "16,16,16".as_ref(),
        "--dtype".as_ref(),
        "u8".as_ref(),
    ]);
    assert!(made.status.success(), "{made:?}");
    let mut info = std::process::Command::new(&vug)
        .arg("info")
        .arg(&target)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(info.stdout.take()); // nobody reads
    let done = info.wait_with_output().unwrap();
    assert!(done.status.success() && done.stderr.is_empty(), "{done:?}");
}
