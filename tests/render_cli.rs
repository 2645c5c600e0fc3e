//! `vug render` as its users see it: pictures, scenes, reports, turntables. On the CPU, so that no GPU is needed.
#![cfg(all(feature = "cli", feature = "gpu"))]

mod support;

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;
use vug::Extent;

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

#[track_caller]
fn ok(dir: &Path, args: &[&str]) -> String {
    let r = run(dir, args);
    assert_eq!(r.code, 0, "{args:?}: {}{}", r.out, r.err);
    r.out
}

#[track_caller]
fn refused(dir: &Path, args: &[&str], code: i32, words: &[&str]) {
    let r = run(dir, args);
    assert_eq!(r.code, code, "{args:?}: {}{}", r.out, r.err);
    for word in words {
        assert!(r.err.contains(word), "{args:?} does not say {word}: {}", r.err);
    }
}

/// ball.raw, 40×36×30 u8, and ball.vug with three levels.
fn folder() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("ball.raw"), support::ball(Extent::new(40, 36, 30)).bytes()).unwrap();
    let args =
        ["encode", "ball.raw", "ball.vug", "--shape", "40,36,30", "--dtype", "u8", "--brick", "16", "--levels", "3"];
    ok(dir.path(), &args);
    dir
}

/// Small and by the CPU.
const FAST: [&str; 4] = ["--adapter", "cpu", "--size", "32x24"];

fn pixels(path: &Path) -> (u32, u32, Vec<u8>) {
    let mut reader =
        png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    (info.width, info.height, bytes)
}

#[test]
fn a_picture_and_how_true_it_is() {
    let dir = folder();
    let d = dir.path();
    let args = [&["render", "ball.vug", "-o", "a.png", "--report", "a.json", "--lod-pixels", "2"], &FAST[..]].concat();
    let text = ok(d, &args);
    assert!(text.contains("off by at most") && text.contains("cpu"), "{text}");
    let (w, h, bytes) = pixels(&d.join("a.png"));
    assert_eq!((w, h), (32, 24));
    assert!(bytes.iter().any(|v| *v > 60) && bytes[..3] == [0; 3], "a ball in front of black");
    let report: Value = serde_json::from_slice(&std::fs::read(d.join("a.json")).unwrap()).unwrap();
    let level = &report["levels"][0];
    assert!(
        level["level"].as_u64().unwrap() > 0 && report["is_final"] == false,
        "few pixels, a coarse level: {report}"
    );
    assert!(level["error_bound"].as_f64().unwrap() > 0.0 && report["bytes"]["read"].as_u64().unwrap() > 100);
    assert_eq!(report["bytes"]["missing"], 0);
    assert!(report["passes"].as_array().unwrap().iter().any(|p| p["median_ms"].as_f64().is_some()));
    // Nothing is overwritten unasked.
    refused(d, &args, 2, &["a.png", "--force"]);
    // The finest level: the bound is that of the codec.
    let args = [&["render", "ball.vug", "-o", "b.png", "--level", "0", "--json"], &FAST[..]].concat();
    let json: Value = serde_json::from_str(&ok(d, &args)).unwrap();
    assert_eq!(json["report"]["is_final"], true);
    assert!(json["report"]["levels"][0]["error_bound"].as_f64() < level["error_bound"].as_f64());
}

#[test]
fn other_formats_are_rendered_as_they_are() {
    let dir = folder();
    let d = dir.path();
    let raw = ["--shape", "40,36,30", "--dtype", "u8", "--level", "0"];
    ok(d, &[&["render", "ball.raw", "-o", "raw.png"], &raw[..], &FAST].concat());
    ok(d, &[&["encode", "ball.raw", "same.vug", "--codec", "raw"], &raw[..4]].concat());
    ok(d, &[&["render", "same.vug", "-o", "same.png", "--level", "0"], &FAST[..]].concat());
    assert!(pixels(&d.join("raw.png")) == pixels(&d.join("same.png")));
    refused(d, &[&["render", "ball.raw", "-o", "x.png"], &FAST[..]].concat(), 2, &["shape"]);
}

#[test]
fn scenes_are_kept_in_files_and_in_volumes() {
    let dir = folder();
    let d = dir.path();
    let look = ["--transfer", "ct-bone", "--azimuth", "75", "--step", "0.7", "--background", "#204060"];
    ok(d, &[&["render", "ball.vug", "-o", "a.png"], &look[..], &FAST].concat());
    ok(
        d,
        &[&["render", "ball.vug", "--save-scene", "scene.toml", "--save-transfer", "tf.json"], &look[..], &FAST]
            .concat(),
    );
    ok(d, &["render", "scene.toml", "-o", "b.png", "--adapter", "cpu"]);
    assert!(pixels(&d.join("a.png")) == pixels(&d.join("b.png")), "a scene file says all of it");
    ok(d, &[&["render", "ball.vug", "--store", "seen.vug"], &look[..], &FAST].concat());
    ok(d, &["verify", "seen.vug"]);
    assert!(ok(d, &["info", "seen.vug"]).contains("scene       stored"));
    assert!(ok(d, &["info", "ball.vug"]).contains("scene       none"));
    let info: Value = serde_json::from_str(&ok(d, &["info", "seen.vug", "--json"])).unwrap();
    assert!(info["scene"].as_str().unwrap().contains("azimuth = 75"));
    ok(d, &["render", "seen.vug", "-o", "c.png", "--adapter", "cpu"]);
    assert!(pixels(&d.join("a.png")) == pixels(&d.join("c.png")), "so does the volume's own scene");
    // Options come over it.
    ok(d, &["render", "seen.vug", "-o", "e.png", "--adapter", "cpu", "--azimuth", "10"]);
    assert!(pixels(&d.join("a.png")) != pixels(&d.join("e.png")));
    // Also from the start, and kept by editors.
    std::fs::write(d.join("plain.toml"), "size = [32, 24]\nlevel = 1\n").unwrap();
    let raw = ["--shape", "40,36,30", "--dtype", "u8", "--levels", "2", "--brick", "32"];
    ok(d, &[&["encode", "ball.raw", "born.vug", "--scene", "plain.toml"], &raw[..]].concat());
    ok(d, &["pack", "born.vug", "packed.vug"]);
    ok(d, &["verify", "packed.vug"]);
    let json: Value =
        serde_json::from_str(&ok(d, &["render", "packed.vug", "--explain", "--json", "--adapter", "cpu"])).unwrap();
    assert_eq!((&json["plan"]["size"][0], &json["plan"]["levels"][0]["lod"]), (&32.into(), &1.into()));
    // A transfer function of its own file.
    let tf = [&["render", "ball.vug", "-o", "f.png", "--transfer", "tf.json"], &look[2..], &FAST].concat();
    ok(d, &tf);
    assert!(pixels(&d.join("a.png")) == pixels(&d.join("f.png")));
    std::fs::write(d.join("away.toml"), "[[volume]]\npath = \"/etc/passwd\"\n").unwrap();
    refused(d, &[&["encode", "ball.raw", "x.vug", "--scene", "away.toml"], &raw[..]].concat(), 2, &["names no others"]);
    refused(d, &[&["render", "ball.raw", "--store", "y.vug"], &raw[..4]].concat(), 2, &["store"]);
}

#[test]
fn turntables() {
    let dir = folder();
    let d = dir.path();
    let turn = ["--turntable", "4", "--level", "1"];
    ok(d, &[&["render", "ball.vug", "-o", "t_##.png"], &turn[..], &FAST].concat());
    let frames: Vec<_> = (0..4).map(|i| pixels(&d.join(format!("t_{i:02}.png")))).collect();
    assert!(frames[0] != frames[1] && frames[1] != frames[2]);
    // Picture by picture they are those that the camera would show.
    ok(d, &[&["render", "ball.vug", "-o", "side.png", "--azimuth", "210", "--level", "1"], &FAST[..]].concat());
    let (_, _, side) = pixels(&d.join("side.png"));
    let off = side.iter().zip(&frames[2].2).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(off <= 1, "{off}");
    for name in ["t.gif", "t.apng"] {
        ok(d, &[&["render", "ball.vug", "-o", name], &turn[..], &FAST].concat());
    }
    let mut gif = gif::DecodeOptions::new().read_info(std::fs::File::open(d.join("t.gif")).unwrap()).unwrap();
    let mut count = 0;
    while gif.read_next_frame().unwrap().is_some() {
        count += 1;
    }
    assert_eq!(count, 4);
    assert_eq!(pixels(&d.join("t.apng")), frames[0], "the first picture of the animation");
    ok(d, &[&["render", "ball.vug", "-o", "u_#.png", "--frames", "2"], &turn[..], &FAST].concat());
    assert!(pixels(&d.join("u_2.png")) == frames[2] && !d.join("u_0.png").exists());
    refused(d, &[&["render", "ball.vug", "-o", "t.png"], &turn[..], &FAST].concat(), 2, &["turn_####.png"]);
    refused(d, &[&["render", "ball.vug", "-o", "t.gif"], &FAST[..]].concat(), 2, &["--turntable"]);
}

#[test]
fn plans_and_prices() {
    let dir = folder();
    let d = dir.path();
    let text = ok(d, &["render", "ball.vug", "--explain", "--adapter", "cpu", "--shading"]);
    for word in ["raycast", "linear_opt", "fetches", "where it is lit", "left out", "clip_box"] {
        assert!(text.contains(word), "{word} in {text}");
    }
    let args = [&["render", "ball.vug", "-o", "m.png", "--measure", "--json", "--shading"], &FAST[..]].concat();
    let json: Value = serde_json::from_str(&ok(d, &args)).unwrap();
    let rows = json["measured"]["without"].as_array().unwrap();
    let row = |name: &str| rows.iter().find(|r| r["effect"] == name).unwrap_or_else(|| panic!("{name} in {json}"));
    // What skips and culls changes nothing; light does.
    for free in ["empty_skip", "tf_cull"] {
        assert_eq!((row(free)["max_difference"].as_f64(), row(free)["ssim"].as_f64()), (Some(0.0), Some(1.0)));
    }
    assert!(row("gradient_shading")["max_difference"].as_f64().unwrap() > 0.01);
    assert!(row("early_out")["max_difference"].as_f64().unwrap() <= 1.0 / 255.0);
}

#[test]
fn what_cannot_be_rendered_says_so() {
    let dir = folder();
    let d = dir.path();
    let with =
        |more: &[&str]| [&["render", "ball.vug", "-o", "x.png"], more, &["--adapter", "cpu"]].concat().join("\n");
    for (more, words) in [
        (&["--effects", "shadows"][..], &["shadows", "gradient_shading"][..]),
        (&["--sampler", "cubic"], &["cubic", "linear_opt"]),
        (&["--transfer", "bone"], &["bone", "ct-bone"]),
        (&["--step", "0"], &["step"]),
        (&["--step", "nan"], &["step"]),
        (&["--step=-1"], &["step"]),
        (&["--fov", "180"], &["fov"]),
        (&["--size", "0x10"], &["size"]),
        (&["--without", "clip_box"], &["clip_box"]),
        (&["--plane", "0,0,0:0,0,0"], &["normal"]),
        (&["--transfer-range", "0,1"], &["transfer-range"]),
        (&["--transfer", "mri", "--transfer-range", "5,1"], &["LO,HI"]),
        (&["--gpu-mem", "1G"], &["gpu-mem"]),
        (&["--frames", "1"], &["turntable"]),
    ] {
        let args = with(more);
        refused(d, &args.split('\n').collect::<Vec<_>>(), 2, words);
        assert!(!d.join("x.png").exists());
    }
    refused(d, &["render", "ball.vug"], 2, &["output"]);
    refused(d, &["render", "ball.vug", "-o", "x.jpg"], 2, &[".png"]);
    refused(d, &["render", "none.vug", "-o", "x.png"], 3, &["none.vug"]);
    std::fs::write(d.join("odd.toml"), "[[volume]]\npath = \"ball.vug\"\ncolour = 1\n").unwrap();
    refused(d, &["render", "odd.toml", "-o", "x.png"], 2, &["colour", "line 3"]);
    // hard case: R-07; the step is a number, but a ray would never end
    refused(d, &["render", "ball.vug", "-o", "x.png", "--step", "1e-9", "--adapter", "cpu"], 2, &["samples"]);
}

#[test] // hard case: D-57
fn a_volume_far_from_the_origin_looks_like_one_near_it() {
    let dir = folder();
    let d = dir.path();
    let bytes = std::fs::read(d.join("ball.raw")).unwrap();
    for (name, origin) in [("near", "0"), ("far", "1000000000")] {
        let header = format!(
            "NRRD0004\ntype: uint8\ndimension: 3\nspace dimension: 3\nsizes: 40 36 30\nspace directions: (1e-6,0,0) (0,1e-6,0) (0,0,1e-6)\nspace origin: ({origin},{origin},{origin})\nencoding: raw\n\n"
        );
        std::fs::write(d.join(format!("{name}.nrrd")), [header.as_bytes(), &bytes].concat()).unwrap();
        ok(
            d,
            &[&["render", &format!("{name}.nrrd"), "-o", &format!("{name}.png"), "--level", "0"], &FAST[..]].concat(),
        );
    }
    let ((_, _, near), (_, _, far)) = (pixels(&d.join("near.png")), pixels(&d.join("far.png")));
    let off = near.iter().zip(&far).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(near.iter().any(|v| *v > 60) && off <= 1, "{off}");
}
