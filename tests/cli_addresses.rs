//! The program on foreign volumes at addresses: they are fetched to a temporary file, which goes again.
#![cfg(all(feature = "cli", feature = "http"))]

#[path = "support/server.rs"]
mod server;
mod support;

use assert_cmd::Command;
use server::Server;
use std::fs;
use std::path::Path;
use vug::affine::{Placement, ValueMap};
use vug::convert::{ExportInfo, export};
use vug::time::{TimeUnit, Times};
use vug::{Extent, Grid};

fn vug(dir: &Path, args: &[&str]) -> (i32, String, String) {
    let temp = dir.join("temp");
    fs::create_dir_all(&temp).unwrap();
    let mut command = Command::cargo_bin("vug").unwrap();
    let output = command.current_dir(dir).env("TMPDIR", &temp).args(args).output().unwrap();
    assert_eq!(fs::read_dir(&temp).unwrap().count(), 0, "{args:?} left something behind");
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// A file in this format, on a server.
fn served(dir: &Path, grid: &Grid, name: &str) -> Server {
    let mut placement = Placement::from_spacing([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]);
    placement.space = vug::affine::Space::Ras;
    let times = Times::regular(TimeUnit::Second, 0.0, 1.0, 1);
    let info = ExportInfo { placement: &placement, value_map: ValueMap::default(), times: Some(&times), header: None };
    let path = dir.join(name);
    export(&path, grid, &info).unwrap();
    Server::of(fs::read(path).unwrap())
}

#[test]
fn volumes_are_fetched_wherever_a_file_is_read() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let grid = support::ball(Extent::new(40, 30, 20));
    for name in ["a.nrrd", "a.nii.gz", "a.npy", "a.tif"] {
        let server = served(d, &grid, name);
        // What is behind the name is for the server alone.
        let url = server.url(&format!("folder/{name}?key=a/b.raw"));
        let (code, _, err) = vug(d, &["encode", &url, "a.vug", "--codec", "raw", "--force"]);
        assert_eq!(code, 0, "{err}");
        let (code, out, err) = vug(d, &["compare", &url, name, "--json"]);
        assert!(code == 0 && out.contains("\"identical\": true"), "{name}: {out}{err}");
        let (code, out, err) = vug(d, &["compare", "a.vug", &url, "--json"]);
        assert!(code == 0 && out.contains("\"identical\": true"), "{name}: {out}{err}");
        let (code, _, err) = vug(d, &["slice", &url, "-o", "s.png", "--force"]);
        assert_eq!(code, 0, "{err}");
    }
    fs::write(d.join("a.raw"), grid.bytes()).unwrap();
    let server = Server::of(grid.bytes().to_vec());
    let url = server.url("a.raw");
    let (code, _, err) =
        vug(d, &["encode", &url, "a.vug", "--shape", "40,30,20", "--dtype", "u8", "--codec", "raw", "--force"]);
    assert_eq!(code, 0, "{err}");
    assert_eq!(vug(d, &["compare", "a.vug", "a.npy", "--max-error", "0"]).0, 0);
    // A .vug file is not copied: its bricks are read where they are, whatever it is called.
    let server = Server::of(fs::read(d.join("a.vug")).unwrap());
    for name in ["a.vug", "volume"] {
        let (code, _, err) = vug(d, &["compare", &server.url(name), "a.npy", "--max-error", "0"]);
        assert_eq!(code, 0, "{err}");
    }
}

#[test]
fn time_steps_are_fetched() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let grid = support::ball(Extent::new(40, 30, 200));
    fs::write(d.join("a.raw"), grid.bytes()).unwrap();
    let raw = ["--shape", "40,30,200", "--dtype", "u8"];
    let (code, _, err) =
        vug(d, &[&["encode", "a.raw", "a.vug", "--log", "--codec", "raw", "--brick", "16"], &raw[..]].concat());
    assert_eq!(code, 0, "{err}");
    let server = Server::of(grid.bytes().to_vec());
    let (code, _, err) = vug(d, &[&["append", "a.vug", &server.url("a.raw")], &raw[..]].concat());
    assert!(code == 0 && err.is_empty(), "{err}");
    // One that is compressed, and larger than what memory may be taken: it waits beside the log.
    let server = served(d, &grid, "a.nii.gz");
    let (code, _, err) = vug(d, &["append", "a.vug", &server.url("a.nii.gz?key=1"), "--memory", "400K"]);
    assert!(code == 0 && err.contains("temporary"), "{err}");
    // Encoded already.
    let server = Server::of(fs::read(d.join("a.vug")).unwrap());
    let (code, _, err) = vug(d, &["append", "a.vug", &server.url("b.vug")]);
    assert_eq!(code, 0, "{err}");
    let volume = vug::volume::Volume::open_path(d.join("a.vug")).unwrap();
    assert_eq!(volume.info().time_steps, 6);
    for time in 0..6 {
        let at = vug::volume::At { time, ..Default::default() };
        assert_eq!(volume.read(at).unwrap().bytes(), grid.bytes(), "step {time}");
    }
    // What was fetched goes again.
    let mut names: Vec<_> = fs::read_dir(d).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["a.nii.gz", "a.raw", "a.vug", "temp"]);
    server.change(|mode| mode.fail = [(404, None), (404, None)].into());
    let (code, _, err) = vug(d, &[&["append", "a.vug", &server.url("a.raw")], &raw[..]].concat());
    assert!(code == 3 && err.contains("404"), "{err}");
}

#[test]
fn what_cannot_be_fetched_says_why() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let server = served(d, &support::ball(Extent::cube(8)), "a.nrrd");
    for (name, word) in [("a.nhdr", "second file"), ("a.img.gz", "second file"), ("a.txt", "")] {
        let (code, _, err) = vug(d, &["encode", &server.url(name), "x.vug"]);
        assert!(code == 3 && err.contains("E_UNSUPPORTED") && err.contains(word), "{name}: {err}");
    }
    server.change(|mode| mode.fail = [(404, None), (404, None)].into());
    let (code, _, err) = vug(d, &["encode", &server.url("a.nrrd"), "x.vug"]);
    assert!(code == 3 && err.contains("404"), "{err}");
    assert!(!d.join("x.vug").exists());
}
