//! The program on stacks of images and on colour volumes: in, out, compared, pictured.
#![cfg(feature = "cli")]

mod support;

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::Path;
use vug::affine::{Placement, ValueMap};
use vug::convert::{ExportInfo, export};
use vug::{Extent, Grid};

fn vug(dir: &Path, args: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("vug").unwrap().current_dir(dir).args(args).output().unwrap();
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

fn json(dir: &Path, args: &[&str]) -> Value {
    let (code, out, err) = vug(dir, &[args, &["--json"]].concat());
    assert_eq!(code, 0, "{args:?}: {out}{err}");
    serde_json::from_str(&out).unwrap()
}

fn identical(dir: &Path, a: &str, b: &str) -> bool {
    json(dir, &["compare", a, b])["identical"] == true
}

fn save(path: &Path, grid: &Grid) {
    let info =
        ExportInfo { placement: &Placement::default(), value_map: ValueMap::default(), times: None, header: None };
    export(path, grid, &info).unwrap();
}

/// Files of a folder, those of other writers included.
fn count(dir: &Path) -> usize {
    fs::read_dir(dir).unwrap().count()
}

#[test]
fn a_folder_becomes_a_file_and_a_folder_again() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let e = Extent::new(33, 21, 70);
    let colour = Grid::from_fn(e, |[x, y, z]| [(x * 7) as u8, (y * 12) as u8, (z * 3) as u8]).unwrap();
    let deep = Grid::from_fn(e, |[x, y, z]| (x * 1900 + y * 31 + z) as u16).unwrap();
    for (name, grid) in [("colour", &colour), ("deep", &deep), ("grey", &support::ball(e))] {
        save(&d.join(name).join("s_###.png"), grid);
        let file = format!("{name}.vug");
        let report = json(d, &["encode", name, &file, "--codec", "raw"]);
        assert_eq!(report["dims"], serde_json::json!([33, 21, 70]));
        assert_eq!(vug(d, &["verify", &file]).0, 0);
        let info = json(d, &["info", &file]);
        assert_eq!(info["meta"]["source"]["slices"], 70, "{info}");
        for target in ["f/", "p/s_#.tif", "all.tif", "v.nrrd", "v.nii.gz"] {
            let target = format!("{name}-{target}");
            json(d, &["decode", &file, &target]);
            let source = target.rsplit_once('/').map_or(&*target, |(folder, _)| folder);
            assert!(identical(d, &file, source) && identical(d, source, name), "{target}");
        }
        assert_eq!(count(&d.join(format!("{name}-f"))), 70);
        assert!(d.join(format!("{name}-f/0069.png")).exists());
        // An existing folder needs no separator.
        fs::create_dir(d.join(format!("{name}-there"))).unwrap();
        json(d, &["decode", &file, &format!("{name}-there"), "--region", "0:33,0:21,5:6"]);
        assert_eq!(count(&d.join(format!("{name}-there"))), 1);
        // Pictures of a stack and of the file made from it are the same.
        for (source, picture) in [(name, "a.png"), (&*file, "b.png")] {
            assert_eq!(vug(d, &["slice", source, "--axis", "y", "-o", picture, "--force"]).0, 0);
        }
        assert_eq!(fs::read(d.join("a.png")).unwrap(), fs::read(d.join("b.png")).unwrap());
    }
    let (code, _, err) = vug(d, &["encode", "deep", "narrow.vug", "--dtype", "u8"]);
    assert!(code == 3 && err.contains("E_UNSUPPORTED"), "{err}");
    assert_eq!(vug(d, &["encode", "deep", "x.vug", "--shape", "1,1,1"]).0, 2);
    json(d, &["decode", "grey.vug", "lossy/#.jpg"]);
    let near = json(d, &["compare", "grey", "lossy"]);
    assert!(near["psnr"].as_f64().unwrap() > 30.0, "{near}");
}

#[test]
fn what_is_there_stays_unless_forced() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    save(&d.join("a.npy"), &support::ball(Extent::cube(5)));
    json(d, &["encode", "a.npy", "a.vug", "--codec", "raw"]);
    json(d, &["decode", "a.vug", "s/"]);
    fs::write(d.join("s/0003.png"), "mine").unwrap();
    fs::remove_file(d.join("s/0001.png")).unwrap();
    let (code, _, err) = vug(d, &["decode", "a.vug", "s/"]);
    assert!(code == 2 && err.contains("--force") && err.contains("0000.png"), "{err}");
    fs::remove_file(d.join("s/0000.png")).unwrap();
    let (code, _, err) = vug(d, &["decode", "a.vug", "s/s_####.tif"]);
    assert_eq!(code, 0, "other names are other files: {err}");
    fs::remove_file(d.join("s/0002.png")).unwrap();
    let (code, _, err) = vug(d, &["decode", "a.vug", "s"]);
    assert!(code == 2 && err.contains("s_0000.tif"), "slices of two volumes in one folder: {err}");
    assert_eq!(count(&d.join("s")), 7, "nothing was written");
    (0..5).for_each(|z| fs::remove_file(d.join(format!("s/s_{z:04}.tif"))).unwrap());
    assert_eq!(vug(d, &["decode", "a.vug", "s"]).0, 2);
    assert_eq!((count(&d.join("s")), fs::read(d.join("s/0003.png")).unwrap()), (2, b"mine".to_vec()));
    json(d, &["decode", "a.vug", "s", "--force"]);
    assert!(count(&d.join("s")) == 5 && identical(d, "s", "a.npy"));
    // What cannot be held is refused before a folder is made.
    save(&d.join("f.npy"), &Grid::from_fn(Extent::cube(3), |[x, ..]| x as f32 / 3.0).unwrap());
    json(d, &["encode", "f.npy", "f.vug"]);
    for (source, target, code, word) in [
        ("f.vug", "f/", 3, "TIFF does"),
        ("f.vug", "f/#.jpg", 3, "TIFF does"),
        ("f.vug", "f/s.png", 2, "s_####.png"),
        ("f.vug", "f/#_#.tif", 2, "one place"),
        ("a.vug", "f.vug/", 3, "E_SOURCE"),
    ] {
        let (found, _, err) = vug(d, &["decode", source, target]);
        assert!(found == code && err.contains(word), "{target}: {found} {err}");
        assert!(!d.join("f").exists());
    }
    let (code, _, err) = vug(d, &["encode", "a.npy", "s"]);
    assert!(code == 2 && err.contains("folder"), "{err}");
    fs::create_dir(d.join("empty")).unwrap();
    let (code, _, err) = vug(d, &["encode", "empty", "b.vug"]);
    assert!(code == 3 && err.contains("no images") && !d.join("b.vug").exists(), "{err}");
}

#[test]
#[cfg(unix)]
fn more_slices_than_files_may_be_open() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    save(&d.join("a.npy"), &support::ball(Extent::new(4, 3, 300)));
    json(d, &["encode", "a.npy", "a.vug", "--codec", "raw"]);
    let program = assert_cmd::cargo::cargo_bin("vug");
    for args in ["decode a.vug s/", "encode s b.vug --codec raw", "compare s b.vug"] {
        let script = format!("ulimit -n 32 && exec '{}' {args}", program.display());
        let output = std::process::Command::new("sh").args(["-c", &script]).current_dir(d).output().unwrap();
        assert!(output.status.success(), "{args}: {}", String::from_utf8_lossy(&output.stderr));
    }
    assert!(count(&d.join("s")) == 300 && identical(d, "a.npy", "b.vug"));
}

#[test]
fn real_colour_volumes_go_all_the_way() {
    let Some(data) = support::data() else { return };
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    for name in ["rgb_stroke_t1t2flair.nrrd", "rgb_dti_dec.nrrd", "rgb24_ct_perfusion.nii.gz"] {
        let source = data.join(name);
        let source = source.to_str().unwrap();
        let report = json(d, &["encode", source, "a.vug", "--codec", "raw", "--force"]);
        assert_eq!((&report["sample_type"], &report["max_error"]), (&"rgb8".into(), &0.0.into()), "{name}");
        assert_eq!(vug(d, &["verify", "a.vug"]).0, 0);
        for target in ["back.nrrd", "back.nhdr", "back.nii", "back.tif", "back/"] {
            json(d, &["decode", "a.vug", target, "--force"]);
            assert!(identical(d, source, target.trim_end_matches('/')), "{name} {target}");
        }
        fs::remove_dir_all(d.join("back")).unwrap();
        for source in [source, "a.vug"] {
            json(d, &["slice", source, "-o", "s.png", "--no-aspect", "--force"]);
            let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(d.join("s.png")).unwrap()));
            assert_eq!(decoder.read_info().unwrap().info().color_type, png::ColorType::Rgb, "{name} in colour");
        }
    }
}
