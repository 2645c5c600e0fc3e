//! Time series and channels: in from every format that holds them, from folders and pipes, and out again.
#![cfg(feature = "convert")]

#[path = "support/data.rs"]
mod data;

use std::fs;
use std::io::Write;
use vug::affine::{Placement, Space, Unit, ValueMap};
use vug::convert::{ExportInfo, Import, ImportOptions, export_series, import};
use vug::error::Code;
use vug::grid::SlabReader;
use vug::time::{TimeUnit, Times};
use vug::{Extent, SampleType};

const EXTENT: Extent = Extent::new(5, 4, 3);
const VOXELS: usize = 60;

/// The value of voxel `i` of a volume: every sample of a series differs.
fn value(time: u32, channel: u32, i: usize) -> u16 {
    (time * 1000 + channel * 100) as u16 + i as u16
}

fn volume(time: u32, channel: u32) -> Vec<u16> {
    (0..VOXELS).map(|i| value(time, channel, i)).collect()
}

fn bytes(samples: &[u16]) -> Vec<u8> {
    samples.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// All volumes of a series, the last one first: volumes may be turned to in any order.
fn read_all(reader: &mut dyn SlabReader) -> vug::Result<Vec<Vec<u8>>> {
    let (steps, channels) = reader.series();
    let len = reader.extent().voxels() as usize * reader.sample_type().bytes();
    let mut all = Vec::new();
    for time in (0..steps).rev() {
        for channel in (0..channels).rev() {
            reader.turn_to(time, channel)?;
            let mut out = vec![0; len];
            reader.read_slab(0..reader.extent().z, &mut out)?;
            check_parts(reader, &out)?;
            all.push(out);
        }
    }
    all.reverse();
    Ok(all)
}

/// Slabs, rows and the view hold what the whole volume holds.
fn check_parts(reader: &mut dyn SlabReader, whole: &[u8]) -> vug::Result<()> {
    let (e, size) = (reader.extent(), reader.sample_type().bytes());
    if let Some(view) = reader.as_view() {
        assert!(view.bytes == whole && view.extent == e);
    }
    if e.voxels() > 100_000 {
        return Ok(());
    }
    let row = e.x as usize * size;
    let plane = row * e.y as usize;
    for z in [0..1, e.z - 1..e.z, e.z / 2..e.z] {
        for y in [0..1, e.y / 2..e.y, 0..e.y] {
            let mut out = vec![0; z.len() * y.len() * row];
            reader.read_rows(z.clone(), y.clone(), &mut out)?;
            for (i, part) in z.clone().zip(out.chunks_exact(y.len() * row)) {
                assert!(part == &whole[i as usize * plane + y.start as usize * row..][..part.len()], "{z:?} {y:?}");
            }
        }
    }
    Ok(())
}

fn assert_series(import: &mut Import, steps: u32, channels: u32) {
    assert_eq!((import.reader.series(), import.reader.extent()), ((steps, channels), EXTENT));
    let all = read_all(&mut *import.reader).unwrap();
    for time in 0..steps {
        for channel in 0..channels {
            let wanted: Vec<u8> = volume(time, channel).iter().flat_map(|v| v.to_ne_bytes()).collect();
            assert!(all[(time * channels + channel) as usize] == wanted, "{time} {channel}");
        }
    }
    assert_eq!(import.reader.turn_to(steps, 0).unwrap_err().code(), Code::Range);
    assert_eq!(import.reader.turn_to(0, channels).unwrap_err().code(), Code::Range);
}

fn raw_options(steps: Option<u32>, channels: Option<u32>) -> ImportOptions {
    ImportOptions {
        shape: Some(EXTENT),
        dtype: Some(SampleType::U16),
        time_steps: steps,
        channels,
        ..ImportOptions::default()
    }
}

/// A NRRD file of 2 time steps and 3 channels with its axes in this order (x, y, z, t, c), the first one fastest.
fn nrrd(order: &str, encoding: &str) -> Vec<u8> {
    let size = |axis| match axis {
        'x' => 5,
        'y' => 4,
        'z' => 3,
        't' => 2,
        _ => 3,
    };
    let word = |axis| match axis {
        't' => "time",
        'c' => "list",
        _ => "domain",
    };
    let axes: Vec<char> = order.chars().collect();
    let sizes = axes.iter().map(|a| size(*a).to_string()).collect::<Vec<_>>().join(" ");
    let kinds = axes.iter().map(|a| word(*a)).collect::<Vec<_>>().join(" ");
    let spacings = axes.iter().map(|a| if *a == 't' { "0.5" } else { "1" }).collect::<Vec<_>>().join(" ");
    let total: usize = axes.iter().map(|a| size(*a)).product();
    let mut samples = Vec::new();
    for i in 0..total {
        let mut rest = i;
        let mut at = std::collections::HashMap::new();
        for a in &axes {
            at.insert(*a, rest % size(*a));
            rest /= size(*a);
        }
        let get = |a| at.get(&a).copied().unwrap_or(0);
        samples.push(value(get('t') as u32, get('c') as u32, get('x') + 5 * get('y') + 20 * get('z')));
    }
    let mut file = format!(
        "NRRD0005\ntype: ushort\ndimension: {}\nsizes: {sizes}\nkinds: {kinds}\nspacings: {spacings}\nendian: little\n\
         encoding: {encoding}\n\n",
        axes.len()
    )
    .into_bytes();
    match encoding {
        "gzip" => {
            let mut packed = flate2::write::GzEncoder::new(&mut file, flate2::Compression::fast());
            packed.write_all(&bytes(&samples)).unwrap();
        }
        "text" => file.extend(samples.iter().map(u16::to_string).collect::<Vec<_>>().join(" ").bytes()),
        _ => file.extend(bytes(&samples)),
    }
    file
}

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

fn info<'a>(placement: &'a Placement, times: Option<&'a Times>) -> ExportInfo<'a> {
    ExportInfo { placement, value_map: ValueMap::default(), times, header: None }
}

/// The series of these tests as a reader.
fn series(steps: u32, channels: u32, folder: &std::path::Path) -> Import {
    let path = folder.join("series.raw");
    let all: Vec<u16> = (0..steps).flat_map(|t| (0..channels).flat_map(move |c| volume(t, c))).collect();
    fs::write(&path, bytes(&all)).unwrap();
    import(&path, &raw_options(Some(steps), Some(channels))).unwrap()
}

const ENDINGS: [&str; 8] = ["raw", "npy", "nrrd", "nhdr", "nii", "nii.gz", "hdr", "img.gz"];

#[test]
fn series_survive_every_format_that_holds_them() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let mut placement = Placement::from_spacing([0.5, 1.5, 2.5], [1.0, 2.0, 3.0]);
    (placement.space, placement.unit) = (Space::Ras, Unit::Millimetre);
    for (steps, channels) in [(1, 1), (2, 1), (1, 3), (7, 3)] {
        let times = Times::regular(TimeUnit::Second, 1.0, 0.5, steps);
        let mut source = series(steps, channels, d);
        for ending in ENDINGS {
            let path = d.join(format!("a.{ending}"));
            export_series(&path, &mut *source.reader, &info(&placement, Some(&times))).unwrap();
            let options = match ending {
                "raw" => raw_options(Some(steps), Some(channels)),
                _ => ImportOptions::default(),
            };
            let mut back = import(&path, &options).unwrap_or_else(|e| panic!("{ending}: {e}"));
            assert_series(&mut back, steps, channels);
            if ending.starts_with('n') && ending != "npy" {
                assert_eq!(back.placement, placement, "{ending}");
                assert_eq!(back.times, Some(times.clone()).filter(|_| steps > 1), "{ending}");
            }
        }
        for images in ["a.tif", "slices/", "s_####.png"] {
            let written = export_series(&d.join(images), &mut *source.reader, &info(&placement, None));
            match (steps, channels) {
                (1, 1) => written.unwrap(),
                _ => {
                    let e = written.unwrap_err();
                    assert!(e.code() == Code::Unsupported && e.message().contains("--time"), "{e}");
                }
            }
        }
        fs::remove_dir_all(d.join("slices")).ok();
        for z in 0..3 {
            fs::remove_file(d.join(format!("s_{z:04}.png"))).ok();
        }
    }
}

#[test]
fn the_crate_nifti_reads_our_series() {
    use nifti::{NiftiObject, NiftiVolume, RandomAccessNiftiVolume, ReaderOptions};
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.nii");
    let placement = Placement::from_spacing([1.0, 2.0, 3.0], [0.0; 3]);
    let times = Times::regular(TimeUnit::Millisecond, 0.0, 2.5, 4);
    export_series(&path, &mut *series(4, 2, temp.path()).reader, &info(&placement, Some(&times))).unwrap();
    let object = ReaderOptions::new().read_file(&path).unwrap();
    let header = object.header();
    assert_eq!((header.dim, header.pixdim[4]), ([5, 5, 4, 3, 4, 2, 1, 1], 2.5));
    assert_eq!(header.xyzt_units & 0x38, 16);
    assert_eq!(object.volume().dim(), [5, 4, 3, 4, 2]);
    for (time, channel) in [(0, 0), (3, 0), (0, 1), (2, 1)] {
        for (i, wanted) in volume(u32::from(time), u32::from(channel)).into_iter().enumerate() {
            let at = [i as u16 % 5, i as u16 / 5 % 4, i as u16 / 20, time, channel];
            assert_eq!(object.volume().get_f64(&at).unwrap(), f64::from(wanted));
        }
    }
}

#[test] // what the source said of its axes comes back where it still holds
fn nrrd_keeps_the_order_of_its_axes() {
    let temp = tempfile::tempdir().unwrap();
    let (path, again) = (temp.path().join("a.nrrd"), temp.path().join("b.nrrd"));
    let header = |path: &std::path::Path| {
        let file = fs::read(path).unwrap();
        let end = file.windows(2).position(|w| w == b"\n\n").unwrap();
        String::from_utf8_lossy(&file[..end]).into_owned()
    };
    for order in ["xyzt", "xyzc", "cxyz", "txyz", "xyzct", "xyztc", "cxyzt", "tcxyz"] {
        fs::write(&path, nrrd(order, "gzip")).unwrap();
        let mut first = import(&path, &ImportOptions::default()).unwrap();
        let (steps, channels) = first.reader.series();
        let info = ExportInfo {
            placement: &first.placement,
            value_map: first.value_map,
            times: first.times.as_ref(),
            header: Some(&first.header),
        };
        export_series(&again, &mut *first.reader, &info).unwrap();
        let mut back = import(&again, &ImportOptions::default()).unwrap();
        assert_series(&mut back, steps, channels);
        assert_eq!(
            (&back.times, &back.placement, &back.header),
            (&first.times, &first.placement, &first.header),
            "{order}"
        );
        let line = |text: &str, name: &str| text.lines().find(|l| l.starts_with(name)).map(str::to_owned);
        for name in ["sizes", "kinds", "dimension"] {
            assert_eq!(line(&header(&again), name), line(&header(&path), name), "{order}");
        }
    }
}

#[test] // a sequence of 3D Slicer: a list whose items are times
fn slicer_sequences_come_back() {
    let temp = tempfile::tempdir().unwrap();
    let (path, again) = (temp.path().join("a.seq.nrrd"), temp.path().join("b.seq.nrrd"));
    let mut file = b"NRRD0005\ntype: uchar\ndimension: 4\nspace: right-anterior-superior\nsizes: 3 2 1 1\n\
        space directions: none (2,0,0) (0,2,0) (0,0,2)\nkinds: list domain domain domain\n\
        labels: \"time\" \"\" \"\" \"\"\nunits: \"s\" \"\" \"\" \"\"\nencoding: raw\nspace origin: (1,2,3)\n\
        axis 0 index type:=numeric\naxis 0 index values:=0 0.5 2.25\nDataNodeClassName:=vtkMRMLScalarVolumeNode\n\n"
        .to_vec();
    file.extend(b"abcxyz");
    fs::write(&path, file).unwrap();
    let mut first = import(&path, &ImportOptions::default()).unwrap();
    assert_eq!(first.times, Some(Times { unit: TimeUnit::Second, steps: vec![0.0, 0.5, 2.25] }));
    assert_eq!(read_all(&mut *first.reader).unwrap(), [b"ax", b"by", b"cz"]);
    let info = ExportInfo {
        placement: &first.placement,
        value_map: first.value_map,
        times: first.times.as_ref(),
        header: Some(&first.header),
    };
    export_series(&again, &mut *first.reader, &info).unwrap();
    let mut back = import(&again, &ImportOptions::default()).unwrap();
    assert_eq!((&back.times, &back.placement), (&first.times, &first.placement));
    assert_eq!(back.header["key_values"]["DataNodeClassName"], "vtkMRMLScalarVolumeNode");
    assert_eq!(back.header["key_values"]["axis 0 index values"], "0.0 0.5 2.25");
    assert_eq!(back.header["fields"]["labels"], first.header["fields"]["labels"]);
    assert_eq!(read_all(&mut *back.reader).unwrap(), read_all(&mut *first.reader).unwrap());
    // Times that are not evenly apart have no place in NIfTI: they are not known there, rather than wrong.
    let nii = temp.path().join("a.nii");
    export_series(&nii, &mut *first.reader, &info).unwrap();
    assert_eq!(import(&nii, &ImportOptions::default()).unwrap().times, None);
}

/// A source that breaks off.
struct Broken;

impl SlabReader for Broken {
    fn extent(&self) -> Extent {
        Extent::cube(300)
    }
    fn sample_type(&self) -> SampleType {
        SampleType::U8
    }
    fn read_slab(&mut self, z: std::ops::Range<u32>, _: &mut [u8]) -> vug::Result<()> {
        if z.end < 200 { Ok(()) } else { Err(vug::Error::new(Code::BrickCrc, "payload", "the brick is damaged")) }
    }
}

#[test] // an error of the source arrives as itself, not as one of the target
fn a_source_that_breaks_off() {
    let temp = tempfile::tempdir().unwrap();
    for ending in ENDINGS.iter().chain(&["tif", "png"]) {
        let name = if *ending == "png" { "s_#.png".to_owned() } else { format!("a.{ending}") };
        let e = export_series(&temp.path().join(name), &mut Broken, &info(&Placement::default(), None)).unwrap_err();
        assert_eq!((e.code(), e.field()), (Code::BrickCrc, "payload"), "{ending}");
    }
}

#[test]
fn real_series() {
    let Some(folder) = data::folder("real_series") else { return };
    let times = |t: &Times| (t.unit, t.steps[0], t.interval());
    for (file, dims, series, t, range, interval) in [
        (
            "fmri4d_u16.nrrd",
            [80, 80, 35],
            (40, 1),
            SampleType::U16,
            (0.0, 792.0),
            Some((TimeUnit::Unknown, 0.0, Some(2.0))),
        ),
        ("bfield_femm_vec3_f32.nrrd", [47; 3], (1, 3), SampleType::F32, (-0.0052, 0.0092), None),
        ("rgbf32_lut_srgb.nrrd", [32; 3], (1, 3), SampleType::F32, (0.0, 1.096), None),
        ("edge/nifti-rs_rgb_4D.nii", [3; 3], (2, 1), SampleType::Rgb8, (0.0, 55.0), None),
        (
            "edge/nibabel_example_nifti2.nii.gz",
            [32, 20, 12],
            (2, 1),
            SampleType::I16,
            (46.0, 757.0),
            Some((TimeUnit::Second, 0.0, None)),
        ),
    ] {
        let mut found = import(&folder.join(file), &ImportOptions::default()).unwrap();
        let (extent, sample_type) = (found.reader.extent(), found.reader.sample_type());
        assert_eq!((extent, found.reader.series(), sample_type), (Extent::from(dims), series, t), "{file}");
        let mut low = f64::INFINITY;
        let mut high = f64::NEG_INFINITY;
        for volume in read_all(&mut *found.reader).unwrap() {
            let mut grid = vug::Grid::zeros(extent, sample_type).unwrap();
            grid.bytes_mut().copy_from_slice(&volume);
            let (lo, hi) = grid.range().unwrap();
            (low, high) = (low.min(lo), high.max(hi));
        }
        let near = |a: f64, b: f64| (a - b).abs() <= 6e-3 * b.abs().max(1e-30);
        assert!(near(low, range.0) && near(high, range.1), "{file}: {low} {high}");
        println!("{file}: {:?}", found.times);
        if file.starts_with("fmri") {
            assert_eq!(found.times.as_ref().map(times), interval, "{file}");
        }
        // Out again: the same header, samples and times.
        let temp = tempfile::tempdir().unwrap();
        let ending = if file.ends_with("nrrd") { "nrrd" } else { "nii.gz" };
        let path = temp.path().join(format!("copy.{ending}"));
        let info = ExportInfo {
            placement: &found.placement,
            value_map: found.value_map,
            times: found.times.as_ref(),
            header: Some(&found.header),
        };
        export_series(&path, &mut *found.reader, &info).unwrap();
        let mut back = import(&path, &ImportOptions::default()).unwrap();
        assert!(read_all(&mut *back.reader).unwrap() == read_all(&mut *found.reader).unwrap(), "{file}");
        // A small series needs no NIfTI-2.
        back.header["format"] = found.header["format"].clone();
        assert_eq!((back.header, back.times, back.placement), (found.header, found.times, found.placement), "{file}");
    }
}
