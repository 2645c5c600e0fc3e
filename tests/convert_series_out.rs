//! Time series and channels out: to every format that holds them, and back, with times, header and order of axes.
#![cfg(feature = "convert")]

#[path = "support/data.rs"]
mod data;
mod series_support;

use series_support::{assert_series, bytes, nrrd, raw_options, read_all, volume};
use std::fs;
use vug::affine::{Placement, Space, Unit, ValueMap};
use vug::convert::{ExportInfo, Import, ImportOptions, export_series, import};
use vug::error::Code;
use vug::grid::SlabReader;
use vug::time::{TimeUnit, Times};
use vug::{Extent, SampleType};

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
