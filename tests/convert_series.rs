//! Time series and channels in: from every format that holds them, in every order of axes, from folders and pipes.
#![cfg(feature = "convert")]

mod series_support;

use series_support::{VOXELS, assert_series, bytes, nrrd, raw_options, read_all, volume};
use std::fs;
use std::io::Write;
use vug::SampleType;
use vug::convert::{ImportOptions, import};
use vug::error::Code;
use vug::time::{TimeUnit, Times};

#[test]
fn nrrd_axes_in_any_order() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.nrrd");
    for order in ["xyzt", "xyzc", "cxyz", "txyz", "xytz", "xcyz", "xyzct", "xyztc", "cxyzt", "tcxyz", "xtycz"] {
        for (encoding, memory) in [("raw", 1 << 30), ("gzip", 1 << 30), ("gzip", 0), ("text", 1 << 30), ("text", 0)] {
            fs::write(&path, nrrd(order, encoding)).unwrap();
            let options = ImportOptions { memory, ..ImportOptions::default() };
            let mut import = import(&path, &options).unwrap_or_else(|e| panic!("{order} {encoding}: {e}"));
            let (steps, channels) = (if order.contains('t') { 2 } else { 1 }, if order.contains('c') { 3 } else { 1 });
            assert_series(&mut import, steps, channels);
            let times = order.contains('t').then(|| Times::regular(TimeUnit::Unknown, 0.0, 0.5, 2));
            assert_eq!(import.times, times, "{order}");
            assert_eq!(import.placement.spacing(), [1.0; 3]);
            let spooled = if memory == 0 { u64::from(steps * channels) * 120 } else { 0 };
            assert_eq!(
                (import.spooled, import.streamed),
                (spooled, encoding == "raw" || memory == 0),
                "{order} {encoding}"
            );
        }
    }
}

#[test] // a wide type is narrowed over the whole series, and what does not fit is named with its step
fn narrowing_looks_at_every_step() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.nrrd");
    let mut values = vec![7i32; 24];
    let write = |values: &[i32]| {
        let mut file = b"NRRD0005\ntype: int\ndimension: 4\nsizes: 2 2 2 3\nkinds: domain domain domain time\n\
            endian: little\nencoding: raw\n\n"
            .to_vec();
        file.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        fs::write(&path, file).unwrap();
    };
    write(&values);
    assert_eq!(import(&path, &ImportOptions::default()).unwrap().reader.sample_type(), SampleType::U16);
    values[21] = -1;
    write(&values);
    assert_eq!(import(&path, &ImportOptions::default()).unwrap().reader.sample_type(), SampleType::I16);
    values[21] = (1 << 24) + 1;
    write(&values);
    let e = import(&path, &ImportOptions::default()).err().unwrap();
    assert!(e.message().contains("(1, 0, 1) of time step 2, channel 0"), "{e}");
}

#[test]
fn labels_are_recognised_by_what_slicer_writes() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.seg.nrrd");
    for (kind, pairs, labels) in [
        ("uchar", "", false),
        ("uchar", "Segmentation_ContainedRepresentationNames:=Binary labelmap|\n", true),
        ("uchar", "Segmentation_MasterRepresentation:=Binary labelmap\n", true),
        ("uchar", "Segmentation_MasterRepresentation:=Fractional labelmap\n", false),
        ("uchar", "DataNodeClassName:=vtkMRMLLabelMapVolumeNode\n", true),
        ("uchar", "DataNodeClassName:=vtkMRMLScalarVolumeNode\n", false),
        ("float", "Segmentation_MasterRepresentation:=Binary labelmap\n", false),
    ] {
        let text =
            format!("NRRD0004\ntype: {kind}\ndimension: 1\nsizes: 2\nencoding: text\nendian: little\n{pairs}\n1 2\n");
        fs::write(&path, text).unwrap();
        assert_eq!(import(&path, &ImportOptions::default()).unwrap().labels, labels, "{kind} {pairs}");
    }
}

#[test] // raw: channels of a time step together
fn raw_series() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.raw");
    let all: Vec<u16> = (0..2).flat_map(|t| (0..3).flat_map(move |c| volume(t, c))).collect();
    fs::write(&path, bytes(&all)).unwrap();
    assert_series(&mut import(&path, &raw_options(Some(2), Some(3))).unwrap(), 2, 3);
    for (steps, channels, code) in [
        (None, None, Code::Size),
        (Some(2), None, Code::Size),
        (Some(7), Some(3), Code::Size),
        (Some(2), Some(0), Code::Param), // C-18
        (Some(0), None, Code::Param),
    ] {
        assert_eq!(import(&path, &raw_options(steps, channels)).err().unwrap().code(), code);
    }
    let e = import(&path, &raw_options(Some(2), None)).err().unwrap();
    assert!(e.message().contains("2 time steps") && e.message().contains("--channels"), "{e}");
    assert_eq!(import(&path, &raw_options(Some(u32::MAX), Some(9))).err().unwrap().code(), Code::Limit);
}

#[test] // (time, channel, z, y, x), as arrays of images are mostly kept
fn npy_series() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.npy");
    let write = |descr: &str, shape: &str, fortran: &str, samples: &[u8]| {
        let text = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes.extend(samples);
        fs::write(&path, bytes).unwrap();
        import(&path, &ImportOptions::default())
    };
    let all: Vec<u16> = (0..2).flat_map(|t| (0..3).flat_map(move |c| volume(t, c))).collect();
    assert_series(&mut write("<u2", "(2, 3, 3, 4, 5)", "False", &bytes(&all)).unwrap(), 2, 3);
    assert_series(&mut write("<u2", "(5, 4, 3, 3, 2)", "True", &bytes(&all)).unwrap(), 2, 3);
    let steps: Vec<u16> = (0..2).flat_map(|t| volume(t, 0)).collect();
    assert_series(&mut write("<u2", "(2, 3, 4, 5)", "False", &bytes(&steps)).unwrap(), 2, 1);
    let colours = write("|u1", "(2, 1, 4, 5, 3)", "False", &[9; 120]).unwrap();
    assert_eq!((colours.reader.series(), colours.reader.sample_type()), ((2, 1), SampleType::Rgb8));
    let e = write("<f4", "(9, 9, 9, 3)", "False", &[0; 8748]).err().unwrap();
    assert!(e.code() == Code::Unsupported && e.message().contains("moveaxis"), "{e}");
}

#[test]
fn files_of_a_folder_are_time_steps() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    for t in 0..12 {
        fs::write(d.join(format!("step_{t:04}.raw")), bytes(&volume(t, 0))).unwrap();
    }
    for path in [d.to_owned(), d.join("step_####.raw")] {
        let mut import = import(&path, &raw_options(None, None)).unwrap();
        assert_series(&mut import, 12, 1);
        assert_eq!((import.header["files"].as_u64(), &import.times), (Some(12), &None));
    }
    assert_series(&mut import(d, &raw_options(Some(12), None)).unwrap(), 12, 1);
    assert_eq!(import(d, &raw_options(Some(11), None)).err().unwrap().code(), Code::Param);
    // A file of another size is found before anything is read.
    fs::write(d.join("step_0011.raw"), [0; 7]).unwrap();
    let e = import(d, &raw_options(None, None)).err().unwrap();
    assert!(e.code() == Code::Size && e.message().contains("step_0011"), "{e}");

    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let write = |name: &str, kind: &str, sizes: &str, extra: &str| {
        let text = format!(
            "NRRD0004\ntype: {kind}\ndimension: 1\nsizes: {sizes}\n{extra}encoding: text\nendian: little\n\n1 2\n"
        );
        fs::write(d.join(name), text).unwrap();
    };
    write("a2.nrrd", "int", "2", "");
    write("a10.nrrd", "int", "2", "");
    let mut two = import(d, &ImportOptions::default()).unwrap();
    assert_eq!((two.reader.series(), two.reader.sample_type()), ((2, 1), SampleType::U16));
    assert_eq!(read_all(&mut *two.reader).unwrap().len(), 2);
    for (kind, sizes, extra, word) in [
        ("short", "2", "", "one size and type"),
        ("int", "1 2", "", "a10.nrrd"),
        ("int", "2", "vug value scale:=2.0\n", "meaning of values"),
        ("int", "x", "", "a10.nrrd"),
    ] {
        write("a10.nrrd", kind, sizes, extra);
        let e = import(d, &ImportOptions::default()).err().unwrap();
        assert!(e.message().contains(word), "{e}");
    }
    // What is narrowed differently is found when it is read.
    fs::write(
        d.join("a10.nrrd"),
        "NRRD0004\ntype: int\ndimension: 1\nsizes: 2\nencoding: text\nendian: little\n\n1 -2\n",
    )
    .unwrap();
    let mut two = import(d, &ImportOptions::default()).unwrap();
    let e = two.reader.turn_to(1, 0).unwrap_err();
    assert!(e.message().contains("--dtype") && e.message().contains("a10"), "{e}");
    assert_eq!(two.reader.read_slab(0..1, &mut [0; 4]).unwrap_err().code(), Code::Source);
    two.reader.turn_to(0, 0).unwrap();
    two.reader.read_slab(0..1, &mut [0; 4]).unwrap();
}

#[cfg(unix)]
#[test]
fn a_pipe_with_a_name() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("samples");
    if !std::process::Command::new("mkfifo").arg(&path).status().is_ok_and(|s| s.success()) {
        println!("skipped: a_pipe_with_a_name: no mkfifo here");
        return;
    }
    let target = path.clone();
    let writer = std::thread::spawn(move || {
        let all: Vec<u16> = (0..3).flat_map(|t| volume(t, 0)).collect();
        fs::OpenOptions::new().write(true).open(target).unwrap().write_all(&bytes(&all)).unwrap();
    });
    let mut import = import(&path, &raw_options(Some(3), None)).unwrap();
    assert!(import.reader.is_sequential());
    for t in 0..3 {
        import.reader.turn_to(t, 0).unwrap();
        let mut out = vec![0; VOXELS * 2];
        import.reader.read_slab(0..3, &mut out).unwrap();
        assert_eq!(out, volume(t, 0).iter().flat_map(|v| v.to_ne_bytes()).collect::<Vec<_>>());
    }
    writer.join().unwrap();
}
