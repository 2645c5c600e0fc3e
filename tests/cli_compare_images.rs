//! `vug compare` of two pictures through the program.
#![cfg(feature = "cli")]

use serde_json::Value;
use std::path::Path;
use std::process::Output;

fn vug(dir: &Path, args: &[&str]) -> Output {
    assert_cmd::Command::cargo_bin("vug").unwrap().current_dir(dir).args(args).output().unwrap()
}

fn png(path: &Path, width: u32, height: u32, color: png::ColorType, depth: png::BitDepth, bytes: &[u8]) {
    let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
}

/// A grey ramp, as colour or as grey, with `add` upon every fourth pixel.
fn ramp(path: &Path, coloured: bool, add: u8) {
    let value = |i: usize| (i % 64 * 3) as u8 + if i.is_multiple_of(4) { add } else { 0 };
    let grey: Vec<u8> = (0..64 * 48).map(value).collect();
    let rgb: Vec<u8> = grey.iter().flat_map(|&v| [v; 3]).collect();
    let (color, bytes) = if coloured { (png::ColorType::Rgb, rgb) } else { (png::ColorType::Grayscale, grey) };
    png(path, 64, 48, color, png::BitDepth::Eight, &bytes);
}

#[test]
fn pictures_are_compared_as_pictures() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    ramp(&d.join("a.png"), true, 0);
    ramp(&d.join("b.png"), false, 20);
    let out = vug(d, &["compare", "a.png", "b.png", "--json", "--diff", "d.png"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let json: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!((json["kind"].as_str(), json["max_error"].as_u64()), (Some("image"), Some(20)));
    assert_eq!((json["mse_per_channel"].as_f64(), json["mse_per_pixel"].as_f64()), (Some(100.0), Some(300.0)));
    assert!((json["psnr"].as_f64().unwrap() - 10.0 * 650.25f64.log10()).abs() < 1e-9);
    assert_eq!(json["classes"], serde_json::json!([64 * 36, 0, 64 * 12, 0, 0]));
    for score in ["ssim", "ms_ssim"] {
        let mean = json[score]["mean"].as_f64().unwrap();
        assert!(mean > 0.1 && mean < 1.0, "{score} {mean}");
        assert!((json[score]["geometric_mean"].as_f64().unwrap() - mean).abs() < 1e-12);
    }
    assert!(json["flip"].as_f64().unwrap() > 0.01);
    assert!(d.join("d.png").exists());
    let again = vug(d, &["compare", "a.png", "b.png", "--diff", "d.png"]);
    assert!(!again.status.success(), "the difference is not overwritten unasked");
}

#[test]
fn equal_pictures_bounds_and_what_is_no_picture() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    ramp(&d.join("a.png"), true, 0);
    ramp(&d.join("b.png"), true, 20);
    let out = vug(d, &["compare", "a.png", "a.png", "--min-psnr", "99", "--max-error", "0"]);
    assert!(out.status.success() && String::from_utf8_lossy(&out.stdout).contains("PSNR        inf dB"));
    assert_eq!(vug(d, &["compare", "a.png", "b.png", "--max-error", "5%"]).status.code(), Some(1));
    assert_eq!(vug(d, &["compare", "a.png", "b.png", "--max-error", "20"]).status.code(), Some(0));
    assert_eq!(vug(d, &["compare", "a.png", "b.png", "--min-psnr", "40"]).status.code(), Some(1));
    png(&d.join("small.png"), 3, 2, png::ColorType::Rgb, png::BitDepth::Eight, &[0; 18]);
    assert_eq!(vug(d, &["compare", "a.png", "small.png"]).status.code(), Some(2));
    // Deeper grey is no picture on a screen, but a volume of one slice.
    png(&d.join("deep.png"), 2, 2, png::ColorType::Grayscale, png::BitDepth::Sixteen, &[1, 2, 3, 4, 5, 6, 7, 8]);
    let deep = vug(d, &["compare", "deep.png", "deep.png"]);
    assert!(deep.status.success() && String::from_utf8_lossy(&deep.stdout).starts_with("range"));
    assert_eq!(vug(d, &["compare", "deep.png", "deep.png", "--diff", "x.png"]).status.code(), Some(2));
}
