//! The program on time series and channels: decoded whole and in part, compared, pictured, and read from pipes.
#![cfg(feature = "cli")]

mod support;

use assert_cmd::Command;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use vug::codec::Codec;
use vug::convert::{ImportOptions, import};
use vug::geometry::Region;
use vug::time::{TimeUnit, Times};
use vug::volume::{At, EncodeOptions, Shape, Volume, VolumeWriter};
use vug::{Extent, Grid, SampleType};

const EXTENT: Extent = Extent::new(40, 33, 20);
const BRICK: u32 = 16;

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

fn volume(time: u32, channel: u32) -> Grid {
    support::noise(EXTENT, |h| ((h >> 20) + (time * 8 + channel) * 5000) as u16)
}

/// A file of raw bricks without zstd, so that each takes what its samples take.
fn series(path: &Path, steps: u32, channels: u32) {
    let options = EncodeOptions {
        zstd: false,
        times: Some(Times::regular(TimeUnit::Second, 0.0, 1.5, steps)),
        brick: Some(BRICK),
        ..EncodeOptions::default()
    };
    let shape = Shape { extent: EXTENT, sample_type: SampleType::U16, time_steps: steps, channels };
    let out = fs::File::create(path).unwrap();
    let mut writer = VolumeWriter::create(out, shape, Codec::Raw, 4, &options).unwrap();
    let bricks = EXTENT.div_ceil(Extent::cube(BRICK));
    for time in 0..steps {
        for channel in 0..channels {
            let grid = volume(time, channel);
            for z in 0..bricks.z {
                for y in 0..bricks.y {
                    for x in 0..bricks.x {
                        let start = [x * BRICK, y * BRICK, z * BRICK];
                        let region = Region::at(start, Extent::cube(BRICK)).intersect(&Region::whole(EXTENT));
                        writer.write_brick(At { time, channel, lod: 0 }, [x, y, z], grid.view().sub(&region)).unwrap();
                    }
                }
            }
        }
    }
    writer.finish().unwrap();
}

/// All volumes of a foreign file.
fn read(path: &Path) -> (Vec<Vec<u8>>, Option<Times>, (u32, u32)) {
    let mut found = import(path, &ImportOptions::default()).unwrap();
    let (steps, channels) = found.reader.series();
    let mut all = Vec::new();
    for i in 0..steps * channels {
        found.reader.turn_to(i / channels, i % channels).unwrap();
        let e = found.reader.extent();
        let mut out = vec![0; e.voxels() as usize * found.reader.sample_type().bytes()];
        found.reader.read_slab(0..e.z, &mut out).unwrap();
        all.push(out);
    }
    (all, found.times, (steps, channels))
}

#[test]
fn a_series_is_decoded_whole_and_in_part() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    series(&d.join("a.vug"), 4, 2);
    for target in ["a.nrrd", "a.nhdr", "a.nii.gz", "a.hdr", "a.npy"] {
        let report = json(d, &["decode", "a.vug", target]);
        assert_eq!(
            (&report["time_steps"], &report["channels"], &report["dims"]),
            (&json!(4), &json!(2), &json!([40, 33, 20]))
        );
        let (all, times, found) = read(&d.join(target));
        assert_eq!(found, (4, 2), "{target}");
        for (i, bytes) in (0..).zip(&all) {
            assert!(volume(i / 2, i % 2).bytes() == bytes, "{target} {i}");
        }
        if target != "a.npy" {
            assert_eq!(times, Some(Times::regular(TimeUnit::Second, 0.0, 1.5, 4)), "{target}");
        }
        assert_eq!(json(d, &["compare", "a.vug", target])["identical"], true);
    }
    for (target, args, series, first) in [
        ("b.nrrd", &["--time", "2"][..], (1, 2), 4),
        ("c.nii", &["--time", "1:3", "--channel", "1"], (2, 1), 3),
        ("d.nrrd", &["--channel", "0"], (4, 1), 0),
        ("e.npy", &["--time", "3", "--channel", "1", "--region", "1:40,2:33,3:20"], (1, 1), 7),
    ] {
        json(d, &[&["decode", "a.vug", target][..], args].concat());
        let (all, times, found) = read(&d.join(target));
        assert_eq!(found, series, "{target}");
        match target {
            "e.npy" => {
                let region = Region { start: [1, 2, 3], end: [40, 33, 20] };
                let mut part = Grid::zeros(region.extent(), SampleType::U16).unwrap();
                vug::grid::SlabReader::read_slab(&mut volume(3, 1).view().sub(&region), 0..17, part.bytes_mut())
                    .unwrap();
                assert!(part.bytes() == all[0]);
            }
            _ => assert!(volume(first / 2, first % 2).bytes() == all[0], "{target}"),
        }
        if target == "c.nii" {
            assert_eq!(times, Some(Times::regular(TimeUnit::Second, 1.5, 1.5, 2)));
        }
    }
}

#[test]
fn what_cannot_be_is_said_before_anything_is_written() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    series(&d.join("a.vug"), 2, 2);
    for (args, code, word) in [
        (&["decode", "a.vug", "x.nrrd", "--time", "2"][..], 2, "0 to 1"),
        (&["decode", "a.vug", "x.nrrd", "--channel", "0:3"], 2, "0 to 1"),
        (&["decode", "a.vug", "x.nrrd", "--time", "1:1"], 2, "A < B"),
        (&["decode", "a.vug", "x.tif"], 3, "--time"),
        (&["decode", "a.vug", "x/"], 3, "--time"),
        (&["slice", "a.vug", "-o", "x.png", "--time", "2"], 2, "E_RANGE"),
        (&["compare", "a.vug", "b.nrrd"], 2, "time steps"),
        (&["encode", "b.nrrd", "x.vug", "--time-steps", "2"], 2, "only raw"),
        (&["encode", "no_####.nrrd", "x.vug"], 3, "digits"),
    ] {
        if !d.join("b.nrrd").exists() {
            json(d, &["decode", "a.vug", "b.nrrd", "--time", "1"]);
        }
        let (found, out, err) = vug(d, args);
        assert!(found == code && err.contains(word), "{args:?}: {found} {out}{err}");
        assert!(
            !fs::read_dir(d).unwrap().any(|f| f.unwrap().file_name().to_string_lossy().starts_with('x')),
            "{args:?}"
        );
    }
    // One volume of a series fits into images.
    json(d, &["decode", "a.vug", "one.tif", "--time", "1", "--channel", "1"]);
    assert!(read(&d.join("one.tif")).0[0] == volume(1, 1).bytes());
}

#[test] // a time step costs its own bricks, and those of no other
fn a_time_step_alone_reads_only_its_own_bricks() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    series(&d.join("a.vug"), 40, 1);
    let one = EXTENT.voxels() * 2;
    let all = json(d, &["decode", "a.vug", "all.nrrd"])["bytes_read"].as_u64().unwrap();
    let step = json(d, &["decode", "a.vug", "step.nrrd", "--time", "17"])["bytes_read"].as_u64().unwrap();
    println!("bytes read: {step} for a step of {one}, {all} for 40 steps of {}", 40 * one);
    // Leaders and padding of 18 bricks, a page of the index, and the head.
    assert!(step < one + 18 * 512 + (16 << 10) + 4096 && all >= 40 * one, "{step} {all}");
    let volume = Volume::open_path(d.join("a.vug")).unwrap();
    volume.reset_cost();
    let grid = volume.read(At { time: 17, channel: 0, lod: 0 }).unwrap();
    assert!(grid.bytes() == self::volume(17, 0).bytes());
    let cost = volume.cost();
    assert!(cost.bytes < one + 18 * 512 + 4096, "{cost:?}");
}

#[test]
fn slices_show_the_step_that_is_asked_for() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    series(&d.join("a.vug"), 3, 2);
    json(d, &["decode", "a.vug", "a.nrrd"]);
    let picture = |file: &str, time: &str, channel: &str| {
        let args =
            ["slice", file, "-o", "s.png", "--force", "--time", time, "--channel", channel, "--range", "0,65535"];
        json(d, &args);
        fs::read(d.join("s.png")).unwrap()
    };
    assert_eq!(picture("a.vug", "2", "1"), picture("a.nrrd", "2", "1"));
    assert_ne!(picture("a.vug", "2", "1"), picture("a.vug", "2", "0"));
    assert_ne!(picture("a.vug", "0", "1"), picture("a.vug", "2", "1"));
}

#[test] // the difference is where it is, in the volume that it is in
fn compare_names_the_volume() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    series(&d.join("a.vug"), 3, 2);
    json(d, &["decode", "a.vug", "a.npy"]);
    let mut bytes = fs::read(d.join("a.npy")).unwrap();
    // Time step 1, channel 1, voxel (5, 4, 3): the volumes start behind a header of 128 bytes.
    let at = 128 + 2 * (3 * EXTENT.voxels() as usize + 5 + 40 * (4 + 33 * 3));
    let value = u16::from_le_bytes([bytes[at], bytes[at + 1]]) + 9;
    bytes[at..at + 2].copy_from_slice(&value.to_le_bytes());
    fs::write(d.join("a.npy"), bytes).unwrap();
    let c = json(d, &["compare", "a.vug", "a.npy"]);
    assert_eq!((&c["max_error"], &c["max_error_at"]), (&json!(9.0), &json!([5, 4, 3])));
    assert_eq!(c["max_error_in"], json!({ "time": 1, "channel": 1 }));
    let (_, out, _) = vug(d, &["compare", "a.vug", "a.npy"]);
    assert!(out.contains("5,4,3 (x,y,z) of time step 1, channel 1"), "{out}");
}

#[test]
fn salvage_says_which_step_lost_a_brick() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    series(&d.join("a.vug"), 2, 2);
    let mut bytes = fs::read(d.join("a.vug")).unwrap();
    let sample = volume(1, 0).bytes()[..32].to_vec();
    let at = bytes.windows(32).position(|w| w == sample).unwrap();
    bytes[at] ^= 1;
    fs::write(d.join("bad.vug"), bytes).unwrap();
    let (code, _, err) = vug(d, &["decode", "bad.vug", "x.nrrd"]);
    assert!(code == 3 && err.contains("E_BRICK_CRC") && !d.join("x.nrrd").exists(), "{err}");
    let (code, out, _) = vug(d, &["decode", "bad.vug", "x.nrrd", "--salvage", "--json"]);
    let report: Value = serde_json::from_str(&out).unwrap();
    let lost = report["lost"].as_array().unwrap();
    assert!(code == 1 && lost.len() == 1, "{out}");
    assert_eq!((&lost[0]["time"], &lost[0]["channel"], &lost[0]["brick"]), (&json!(1), &json!(0), &json!([0, 0, 0])));
    let all = read(&d.join("x.nrrd")).0;
    assert!(all[1] == volume(0, 1).bytes() && all[3] == volume(1, 1).bytes() && all[2] != volume(1, 0).bytes());
}

#[test]
fn samples_come_through_a_pipe() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let grid = support::ball(Extent::new(50, 40, 70));
    fs::write(d.join("a.raw"), grid.bytes()).unwrap();
    let encode = |stdin: &[u8], extra: &[&str]| {
        let mut command = Command::cargo_bin("vug").unwrap();
        command.current_dir(d).args(["encode", "-", "a.vug", "--shape", "50,40,70", "--force"]).args(extra);
        let output = command.write_stdin(stdin).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let same = || {
        json(d, &["decode", "a.vug", "b.npy", "--force"]);
        read(&d.join("b.npy")).0[0] == grid.bytes()
    };
    let (code, err) = encode(grid.bytes(), &["--dtype", "u8", "--codec", "raw"]);
    assert!(code == 0 && same(), "{err}");
    let (code, err) = encode(&grid.bytes()[1..], &["--dtype", "u8"]);
    assert!(code == 3 && err.contains("E_SIZE") && err.contains("ends after 139999"), "{err}");
    let (code, err) = encode(&[grid.bytes(), &[0]].concat(), &["--dtype", "u8"]);
    assert!(code == 3 && err.contains("goes on"), "{err}");
    assert!(same(), "what was there before is still there");
    // i8 has to be looked at before it is known to fit i16.
    let (code, err) = encode(&vec![0xff; 140_000], &["--dtype", "i8", "--codec", "raw"]);
    assert_eq!(code, 0, "{err}");
    json(d, &["decode", "a.vug", "b.npy", "--force"]);
    assert!(read(&d.join("b.npy")).0[0].as_chunks::<2>().0.iter().all(|v| i16::from_ne_bytes(*v) == -1));
}

#[test] // also where the samples are wanted twice, for a bound
fn a_series_comes_through_a_pipe() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let all: Vec<Grid> = (0..6).map(|i| volume(i / 2, i % 2)).collect();
    let bytes: Vec<u8> = all.iter().flat_map(|g| g.bytes().to_vec()).collect();
    for (args, bound) in [
        (&["--codec", "raw", "--levels", "2"][..], 0.0),
        (&["--max-error", "900", "--codec", "s3dc", "--levels", "auto"], 900.0),
    ] {
        let mut command = Command::cargo_bin("vug").unwrap();
        command
            .current_dir(d)
            .args(["encode", "-", "a.vug", "--shape", "40,33,20", "--dtype", "u16", "--brick", "16", "--force"]);
        let output =
            command.args(["--time-steps", "3", "--channels", "2"]).args(args).write_stdin(&*bytes).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(vug(d, &["verify", "a.vug"]).0, 0);
        json(d, &["decode", "a.vug", "a.npy", "--force"]);
        let (found, _, series) = read(&d.join("a.npy"));
        assert_eq!(series, (3, 2));
        for (found, wanted) in found.iter().zip(&all) {
            let samples = found.as_chunks::<2>().0.iter().map(|v| u16::from_ne_bytes(*v));
            let worst = samples.zip(wanted.samples::<u16>()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
            assert!(f64::from(worst) <= bound, "{args:?} {worst}");
        }
        // A coarser level of some of it.
        let report = json(d, &["decode", "a.vug", "half.nrrd", "--level", "1", "--time", "1:3", "--force"]);
        assert_eq!((&report["dims"], &report["time_steps"]), (&json!([20, 17, 10]), &json!(2)));
        assert_eq!(read(&d.join("half.nrrd")).2, (2, 2));
    }
}

#[test] // in and out, exact with raw, bounded with S3Dc
fn real_series_through_the_program() {
    let Some(folder) = support::data() else { return };
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    for (name, series) in [("fmri4d_u16.nrrd", [40, 1]), ("bfield_femm_vec3_f32.nrrd", [1, 3])] {
        let source = folder.join(name);
        let source = source.to_str().unwrap();
        let (samples, times, _) = read(&folder.join(name));
        for (target, args, percent) in
            [("raw.vug", &["--codec", "raw"][..], 0.0), ("s3dc.vug", &["--codec", "s3dc", "--max-error", "1%"], 1.0)]
        {
            json(d, &[&["encode", source, target, "--force"][..], args].concat());
            assert_eq!(vug(d, &["verify", target]).0, 0);
            let report = json(d, &["decode", target, "back.nrrd", "--force"]);
            assert_eq!([&report["time_steps"], &report["channels"]], [&json!(series[0]), &json!(series[1])]);
            let compared = json(d, &["compare", source, "back.nrrd"]);
            println!("{name} {target}: {compared}");
            let bound = compared["range"].as_f64().unwrap() * percent / 100.0;
            assert!(compared["max_error"].as_f64().unwrap() <= bound, "{name} {target}");
            let (back, found, _) = read(&d.join("back.nrrd"));
            assert_eq!(found, times, "{name}");
            assert!(bound > 0.0 || back == samples, "{name}");
            if bound == 0.0 {
                let header = |path: &Path| import(path, &ImportOptions::default()).unwrap().header;
                assert_eq!(header(&d.join("back.nrrd")), header(&folder.join(name)));
            }
        }
    }
    let all =
        json(d, &["encode", folder.join("fmri4d_u16.nrrd").to_str().unwrap(), "f.vug", "--codec", "raw", "--no-zstd"]);
    let one = 80 * 80 * 35 * 2;
    let step = json(d, &["decode", "f.vug", "step.nii.gz", "--time", "17"]);
    println!("time step 17: {} reads, {} bytes of {}", step["reads"], step["bytes_read"], all["bytes"]);
    assert!(step["bytes_read"].as_u64().unwrap() < one + (32 << 10));
}
