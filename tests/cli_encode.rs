//! What `vug encode` does besides coding: pipes with large planes, labels, logs that replace other files.
#![cfg(feature = "cli")]

mod support;

use assert_cmd::Command;
use std::fs;
use std::path::Path;
use vug::volume::{At, Volume};

fn vug(dir: &Path, args: &[&str], stdin: &[u8]) -> (i32, String) {
    let output = Command::cargo_bin("vug").unwrap().current_dir(dir).args(args).write_stdin(stdin).output().unwrap();
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test] // a plane of more bytes than are taken from a pipe at a time
fn pipes_with_large_planes_go_through_temporary_files() {
    let folder = tempfile::tempdir().unwrap();
    let d = folder.path();
    let (nx, ny, nz) = (4096u32, 2100u32, 3u32);
    let bytes: Vec<u8> = (0..nx * ny * nz).map(|i| (i / 7 + i / nx) as u8).collect();
    let shape = format!("{nx},{ny},{nz}");
    let base =
        ["encode", "-", "--shape", &shape, "--dtype", "u8", "--codec", "raw", "--levels", "auto", "--brick", "16"];
    let mut files = Vec::new();
    // In memory; a slab in a temporary file; all of it in one, since a bound is looked for first.
    for (name, more) in
        [("a.vug", &[][..]), ("b.vug", &["--memory", "24M", "--jobs", "2"]), ("c.vug", &["--max-error", "0"])]
    {
        let mut args = base.to_vec();
        args.insert(2, name);
        args.extend(more);
        let (code, err) = vug(d, &args, &bytes);
        assert_eq!(code, 0, "{more:?}: {err}");
        assert_eq!(err.contains("temporary file"), name == "b.vug", "{more:?}: {err}");
        files.push(fs::read(d.join(name)).unwrap());
    }
    assert!(files.windows(2).all(|pair| pair[0] == pair[1]), "the same volume, the same bytes");
    let whole = Volume::open_path(d.join("a.vug")).unwrap().read(At::default()).unwrap();
    assert!(whole.bytes() == bytes);
    let (code, err) = vug(d, &["encode", "-", "d.vug", "--shape", &shape, "--dtype", "u8", "--max-error", "5"], &bytes);
    assert_eq!(code, 0, "{err}");
    assert!(err.contains("temporary file"), "two looks at a pipe: {err}");
}

/// A NIfTI file that says that its numbers are labels.
fn labels(path: &Path) {
    let mut header = vec![0u8; 352];
    header[0..4].copy_from_slice(&348i32.to_le_bytes());
    for (i, n) in [3i16, 40, 30, 20, 1, 1, 1, 1].into_iter().enumerate() {
        header[40 + 2 * i..42 + 2 * i].copy_from_slice(&n.to_le_bytes());
    }
    header[68..70].copy_from_slice(&1002i16.to_le_bytes()); // intent: label
    header[70..72].copy_from_slice(&2i16.to_le_bytes()); // u8
    header[72..74].copy_from_slice(&8i16.to_le_bytes());
    (0..4).for_each(|i| header[76 + 4 * i..80 + 4 * i].copy_from_slice(&1f32.to_le_bytes()));
    header[108..112].copy_from_slice(&352f32.to_le_bytes());
    header[344..348].copy_from_slice(b"n+1\0");
    header.extend((0..40 * 30 * 20u32).map(|i| if i / 3 % 2 == 0 { 3 } else { 200 }));
    fs::write(path, header).unwrap();
}

#[test] // no mean of labels is ever taken unless somebody asks for it by name
fn labels_are_never_averaged() {
    let folder = tempfile::tempdir().unwrap();
    let d = folder.path();
    labels(&d.join("l.nii"));
    for (more, operator) in [
        (&[][..], "nearest"),
        (&["--codec", "raw"], "nearest"),
        (&["--max-error", "0"], "nearest"),
        (&["--codec", "s3dc", "--index-bits", "1"], "nearest"),
        (&["--labels"], "nearest"),
        (&["--downsample", "max"], "max"),
        (&["--codec", "raw", "--downsample", "mean"], "mean"),
    ] {
        let (code, err) =
            vug(d, &[&["encode", "l.nii", "l.vug", "--force", "--levels", "2", "--brick", "16"], more].concat(), &[]);
        assert_eq!(code, 0, "{more:?}: {err}");
        let volume = Volume::open_path(d.join("l.vug")).unwrap();
        assert_eq!(volume.info().downsample.name(), operator, "{more:?}");
        let coarse = volume.read(At::lod(1)).unwrap();
        let known = coarse.samples::<u8>().iter().all(|v| [3, 200].contains(v));
        assert_eq!(known, operator != "mean", "{more:?}: labels that nobody gave");
        assert_eq!(err.contains("holds labels"), !more.contains(&"--labels"), "{more:?}: {err}");
    }
}

#[test] // what fails before there is anything to read leaves the old file, and no new one
fn a_log_that_fails_early_leaves_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let d = folder.path();
    let floats: Vec<u8> = [f32::NAN; 64].iter().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(d.join("nan.raw"), floats).unwrap();
    let nan = ["encode", "nan.raw", "a.vug", "--shape", "4,4,4", "--dtype", "f32", "--log"];
    assert_eq!(vug(d, &nan, &[]).0, 3);
    assert_eq!(fs::read_dir(d).unwrap().count(), 1, "no new file");
    fs::write(d.join("a.vug"), "old").unwrap();
    assert_eq!(vug(d, &[&nan[..], &["--force"]].concat(), &[]).0, 3);
    assert_eq!(fs::read(d.join("a.vug")).unwrap(), b"old");
    assert_eq!(fs::read_dir(d).unwrap().count(), 2, "no debris");
    let ramp: Vec<u8> = (0..64).collect();
    let good = ["encode", "-", "a.vug", "--shape", "4,4,4", "--dtype", "u8", "--log", "--codec", "raw", "--force"];
    assert_eq!(vug(d, &good, &ramp).0, 0);
    let volume = Volume::open_path(d.join("a.vug")).unwrap();
    assert_eq!(volume.read(At::default()).unwrap().bytes(), ramp);
    assert!(volume.head().commit.is_some(), "a log");
}
