//! Round trips through every format; NIfTI files are judged by the crate `nifti`, too.
#![cfg(feature = "convert")]

use std::path::Path;
use vug::affine::{Placement, Space, Unit, ValueMap};
use vug::convert::{ExportInfo, Import, ImportOptions, Target, export, import};
use vug::{Extent, Grid, SampleType};

const EXTENT: Extent = Extent::new(5, 4, 3);
/// Every file that can be written, by its ending, and whether it holds placements.
const ENDINGS: [(&str, bool); 10] = [
    ("raw", false),
    ("bin", false),
    ("npy", false),
    ("nrrd", true),
    ("nhdr", true),
    ("nii", true),
    ("nii.gz", true),
    ("hdr", true),
    ("img", true),
    ("img.gz", true),
];

/// A grid whose every byte differs from its neighbours.
fn grid(t: SampleType) -> Grid {
    let mut grid = Grid::zeros(EXTENT, t).unwrap();
    for (i, b) in grid.bytes_mut().iter_mut().enumerate() {
        *b = (i * 37 % 251) as u8;
    }
    grid
}

fn load(path: &Path, options: &ImportOptions) -> vug::Result<(Grid, Import)> {
    let mut import = import(path, options)?;
    let mut grid = Grid::zeros(import.reader.extent(), import.reader.sample_type())?;
    for z in 0..grid.extent().z {
        let plane = grid.bytes().len() / grid.extent().z as usize;
        import.reader.read_slab(z..z + 1, &mut grid.bytes_mut()[z as usize * plane..][..plane])?;
    }
    Ok((grid, import))
}

fn options(t: SampleType) -> ImportOptions {
    ImportOptions { shape: Some(EXTENT), dtype: Some(t), ..ImportOptions::default() }
}

#[test]
fn samples_survive_every_format() {
    let temp = tempfile::tempdir().unwrap();
    for t in SampleType::ALL {
        let grid = grid(t);
        for (ending, _) in ENDINGS {
            let path = temp.path().join(format!("{t}.{ending}"));
            let info = ExportInfo {
                placement: &Placement::default(),
                value_map: ValueMap::default(),
                times: None,
                header: None,
            };
            export(&path, &grid, &info).unwrap();
            let (back, import) = load(&path, &options(t)).unwrap();
            assert!(back.bytes() == grid.bytes() && back.extent() == EXTENT, "{t} {ending}");
            let packed = matches!(ending, "nrrd" | "nii.gz" | "img.gz");
            assert_eq!(import.streamed, !packed, "{t} {ending}");
            assert_eq!(import.reader.as_view().is_some(), packed, "{t} {ending}");
        }
    }
}

/// Placements that f32 holds exactly, so that NIfTI-1 does, too.
fn placements() -> Vec<Placement> {
    let oblique = [[0.0, -1.5, 0.25, -10.5], [0.5, 0.0, 0.0, 20.0], [0.0, 0.125, 2.0, 0.75]];
    let mut all = vec![Placement::from_spacing([0.5, 1.5, 2.5], [0.0; 3])];
    for space in Space::ALL {
        for (i, unit) in Unit::ALL.iter().enumerate() {
            let mut p = Placement::from_spacing([1.0, 2.0, 4.0], [i as f64, -3.5, 7.0]);
            (p.space, p.unit) = (*space, *unit);
            all.push(p.clone());
            p.matrix = oblique;
            all.push(p);
        }
    }
    all
}

#[test]
fn placements_survive_where_the_format_can_hold_them() {
    let temp = tempfile::tempdir().unwrap();
    let value_map = ValueMap { scale: 0.5, offset: -1024.0 };
    for placement in placements() {
        for (ending, _) in ENDINGS.iter().filter(|(_, places)| *places) {
            let path = temp.path().join(format!("p.{ending}"));
            export(
                &path,
                &grid(SampleType::U8),
                &ExportInfo { placement: &placement, value_map, times: None, header: None },
            )
            .unwrap();
            let (_, back) = load(&path, &ImportOptions::default()).unwrap();
            assert_eq!(back.value_map, value_map, "{ending}");
            if ending.starts_with("nr") || ending.starts_with("nh") {
                assert_eq!(back.placement, placement, "{ending}");
                continue;
            }
            let holds = matches!(placement.unit, Unit::Unknown | Unit::Metre | Unit::Millimetre | Unit::Micrometre);
            if holds {
                assert_eq!(back.placement.unit, placement.unit);
            } else {
                assert_eq!(back.placement.unit, Unit::Micrometre);
                continue;
            }
            let sign = |row: usize| match placement.space {
                Space::Lps if row < 2 => -1.0,
                Space::Las if row == 0 => -1.0,
                _ => 1.0,
            };
            for (row, (got, want)) in back.placement.matrix.iter().zip(placement.matrix).enumerate() {
                assert_eq!(*got, want.map(|v| v * sign(row) + 0.0), "{ending} {placement:?}");
            }
        }
    }
}

#[test]
fn every_f64_survives_nrrd() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("p.nrrd");
    let mut p = Placement::from_spacing([0.1, 1.0 / 3.0, 1e-30], [1e9 + 0.1, -0.0, 1e300]);
    p.matrix[0][1] = std::f64::consts::PI * 1e-5;
    p.space = Space::Lps;
    let value_map = ValueMap { scale: 0.1, offset: 1e-17 };
    export(&path, &grid(SampleType::U8), &ExportInfo { placement: &p, value_map, times: None, header: None }).unwrap();
    let (_, back) = load(&path, &ImportOptions::default()).unwrap();
    assert_eq!((back.placement, back.value_map), (p, value_map));
    // What nobody knows stays unknown: in a known space, too.
    for space in Space::ALL {
        let p = Placement { space: *space, ..Placement::default() };
        export(&path, &grid(SampleType::Rgb8), &ExportInfo { placement: &p, value_map, times: None, header: None })
            .unwrap();
        assert_eq!(load(&path, &ImportOptions::default()).unwrap().1.placement, p);
    }
}

#[test] // D-59: an axis beyond i16 needs NIfTI-2; so does a coordinate beyond f32
fn long_axes_and_far_places_become_nifti_2() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("long.nii");
    let long = Grid::zeros(Extent::new(1, 70_000, 1), SampleType::U8).unwrap();
    let far = Grid::zeros(EXTENT, SampleType::U8).unwrap();
    let mut place = Placement::from_spacing([0.1, 0.2, 0.3], [1e300, 0.1, 0.2]);
    place.space = Space::Ras;
    for grid in [long, far] {
        let info = ExportInfo { placement: &place, value_map: ValueMap::default(), times: None, header: None };
        export(&path, &grid, &info).unwrap();
        assert_eq!(std::fs::read(&path).unwrap()[..4], 540i32.to_le_bytes());
        let (back, import) = load(&path, &ImportOptions::default()).unwrap();
        assert_eq!((back.extent(), &import.placement), (grid.extent(), &place));
        assert_eq!(import.header["format"], "nifti-2");
    }
}

#[test]
fn headers_are_kept_and_put_back() {
    let temp = tempfile::tempdir().unwrap();
    let nrrd = temp.path().join("a.nrrd");
    let text = "NRRD0005\n# made by hand\ntype: unsigned char\ndimension: 3\nspace: LPS\nsizes: 1 1 2\n\
        space directions: (1,0,0) (0,1,0) (0,0,2)\nspace origin: (0,0,0)\nspace units: \"cm\" \"cm\" \"cm\"\n\
        kinds: domain domain domain\nencoding: raw\ncontent: head: of N.N.\nmeasurement frame: (1,0,0) (0,1,0) (0,0,1)\n\
        thicknesses: nan nan 3\nlabels: \"a b\" \"y\" \"z\"\npatient:=N. N.\nlist:= 1 2\n\nAB";
    std::fs::write(&nrrd, text).unwrap();
    let (grid, first) = load(&nrrd, &ImportOptions::default()).unwrap();
    assert_eq!(first.header["comments"][0], "made by hand");
    assert_eq!(first.header["fields"]["content"], "head: of N.N.");
    assert_eq!(first.header["key_values"]["patient"], "N. N.");
    for ending in ["nrrd", "nhdr"] {
        let path = temp.path().join(format!("b.{ending}"));
        // Through the text of META, as a file would.
        let header: serde_json::Value = serde_json::from_str(&first.header.to_string()).unwrap();
        let info =
            ExportInfo { placement: &first.placement, value_map: first.value_map, times: None, header: Some(&header) };
        export(&path, &grid, &info).unwrap();
        let (_, second) = load(&path, &ImportOptions::default()).unwrap();
        for key in ["comments", "key_values"] {
            assert_eq!(second.header[key], first.header[key], "{ending}");
        }
        for (name, value) in first.header["fields"].as_object().unwrap() {
            let same = name == "space directions" || name == "space origin" || second.header["fields"][name] == *value;
            assert!(same, "{ending} {name}: {}", second.header);
        }
    }
    // What a NIfTI header has a place for.
    let nii = temp.path().join("c.nii");
    let info = ExportInfo {
        placement: &first.placement,
        value_map: first.value_map,
        times: None,
        header: Some(&first.header),
    };
    export(&nii, &grid, &info).unwrap();
    assert_eq!(load(&nii, &ImportOptions::default()).unwrap().1.header["descrip"], "head: of N.N.");
    // Without the header, nothing of it is left.
    export(&nrrd, &grid, &ExportInfo { header: None, ..info }).unwrap();
    assert!(!String::from_utf8_lossy(&std::fs::read(&nrrd).unwrap()).contains("N."));
}

#[test]
fn a_hostile_header_object_cannot_break_the_file() {
    let temp = tempfile::tempdir().unwrap();
    let header = serde_json::json!({
        "comments": ["a\n\ntype: float", 7], "fields": { "content": "x\r\nsizes: 9 9 9", "labels": "\"a", "kinds": 3 },
        "key_values": { "a:=b\n\n": "c", "k\n": "v\n\nencoding: raw", "a: b": "c", "#": "d" },
        "descrip": 5, "sform_code": 1e300, "qform_code": -7, "pixdim": ["a"], "intent_code": 99999, "slice_code": -3,
    });
    for header in [&header, &serde_json::json!([1, 2]), &serde_json::json!(null)] {
        for (ending, _) in ENDINGS {
            let path = temp.path().join(format!("h.{ending}"));
            let place = Placement::from_spacing([1.0; 3], [0.0; 3]);
            let info =
                ExportInfo { placement: &place, value_map: ValueMap::default(), times: None, header: Some(header) };
            export(&path, &grid(SampleType::U16), &info).unwrap();
            let (back, _) = load(&path, &options(SampleType::U16)).unwrap();
            assert!(back.bytes() == grid(SampleType::U16).bytes(), "{ending}");
        }
    }
}

#[test]
fn a_region_of_a_nifti_file_gets_its_own_place() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.nii");
    let mut place = Placement::from_spacing([1.0, 2.0, 4.0], [5.0, 6.0, 7.0]);
    place.space = Space::Ras;
    let info = ExportInfo { placement: &place, value_map: ValueMap::default(), times: None, header: None };
    export(&path, &grid(SampleType::U8), &info).unwrap();
    let (_, first) = load(&path, &ImportOptions::default()).unwrap();
    let mut moved = place.clone();
    moved.matrix[0][3] += 100.0;
    let info = ExportInfo { placement: &moved, header: Some(&first.header), ..info };
    export(&path, &grid(SampleType::U8), &info).unwrap();
    let (_, second) = load(&path, &ImportOptions::default()).unwrap();
    assert_eq!(second.placement, moved);
    assert_eq!(second.header["qoffset"][0], 105.0);
}

#[test]
fn the_crate_nifti_reads_our_files() {
    use nifti::volume::RandomAccessNiftiVolume;
    use nifti::{NiftiObject, ReaderOptions};
    let temp = tempfile::tempdir().unwrap();
    let mut place = Placement::from_spacing([1.0, 2.0, 4.0], [5.0, 6.0, 7.0]);
    (place.space, place.unit) = (Space::Ras, Unit::Millimetre);
    let value_map = ValueMap { scale: 2.0, offset: -1.0 };
    for t in [SampleType::U8, SampleType::U16, SampleType::I16] {
        for ending in ["nii", "nii.gz", "hdr"] {
            let path = temp.path().join(format!("{t}.{ending}"));
            let grid = grid(t);
            export(&path, &grid, &ExportInfo { placement: &place, value_map, times: None, header: None }).unwrap();
            let object = ReaderOptions::new().read_file(&path).unwrap();
            let h = object.header();
            assert_eq!(
                (h.sform_code, h.qform_code, h.xyzt_units, h.pixdim[..4].to_vec()),
                (1, 1, 2, vec![1., 1., 2., 4.])
            );
            assert_eq!((h.srow_x, h.srow_z), ([1.0, 0.0, 0.0, 5.0], [0.0, 0.0, 4.0, 7.0]));
            let volume = object.into_volume();
            for [x, y, z] in [[0u16, 0, 0], [4, 3, 2], [1, 2, 0]] {
                let ours = grid.value([x, y, z].map(u32::from)).unwrap();
                // The crate applies the slope.
                assert_eq!(volume.get_f64(&[x, y, z]).unwrap(), ours.component(0) * 2.0 - 1.0);
            }
        }
    }
}

#[test]
fn a_pair_is_two_files_and_the_header_comes_last() {
    let place = Placement::default();
    let info = ExportInfo { placement: &place, value_map: ValueMap::default(), times: None, header: None };
    let target = Target::of_path(Path::new("dir/a.nhdr")).unwrap();
    let mut parts = [Vec::new(), Vec::new()];
    for (i, part) in parts.iter_mut().enumerate() {
        target.write(i, &mut std::io::Cursor::new(part), &mut grid(SampleType::U8), &info).unwrap();
    }
    assert_eq!(parts[0], grid(SampleType::U8).bytes());
    assert!(String::from_utf8_lossy(&parts[1]).ends_with("data file: a.raw\n"));
}

/// Bytes of samples in one byte order.
fn ordered(grid: &Grid, big: bool) -> Vec<u8> {
    let mut bytes = grid.bytes().to_vec();
    if big != cfg!(target_endian = "big") {
        bytes.chunks_exact_mut(grid.sample_type().bytes()).for_each(<[u8]>::reverse);
    }
    bytes
}

#[test]
fn every_encoding_of_nrrd() {
    use std::io::Write;
    let temp = tempfile::tempdir().unwrap();
    for t in [SampleType::U16, SampleType::I16, SampleType::F32] {
        let grid = grid(t);
        let name = match t {
            SampleType::U16 => "ushort",
            SampleType::I16 => "short",
            _ => "float",
        };
        for encoding in ["raw", "gz", "GZIP", "bz2", "text"] {
            for (big, skip, detached) in [(false, 0, false), (true, 0, true), (true, 5, false), (false, 7, true)] {
                let samples = match encoding {
                    "text" => with_text(&grid).into_bytes(),
                    _ => ordered(&grid, big),
                };
                let unpacked = [vec![b'?'; skip], samples].concat();
                let data = match encoding {
                    "gz" | "GZIP" => {
                        let mut e = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
                        e.write_all(&unpacked).unwrap();
                        e.finish().unwrap()
                    }
                    "bz2" => {
                        let mut e = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
                        e.write_all(&unpacked).unwrap();
                        e.finish().unwrap()
                    }
                    _ => unpacked,
                };
                // Two lines before the data, which are skipped first.
                let data = [b"one\ntwo\n".to_vec(), data].concat();
                let mut header = format!(
                    "NRRD0004\r\nType: {name}\ndimension: 3\nsizes: 5 4 3\nline skip: 2\nbyte skip: {skip}\n\
                     endian: {}\nencoding: {encoding}\n",
                    if big { "big" } else { "little" },
                );
                let path = temp.path().join("a.nhdr");
                if detached {
                    std::fs::write(temp.path().join("the data.bin"), data).unwrap();
                    header.push_str("data file: the data.bin\n");
                    std::fs::write(&path, header).unwrap();
                } else {
                    std::fs::write(&path, [format!("{header}\n").into_bytes(), data].concat()).unwrap();
                }
                let (back, import) = load(&path, &ImportOptions::default()).unwrap();
                assert!(back.bytes() == grid.bytes(), "{name} {encoding} {big} {skip} {detached}");
                assert_eq!(import.streamed, encoding == "raw");
            }
        }
    }
}

fn with_text(grid: &Grid) -> String {
    let e = grid.extent();
    let mut text = String::new();
    for i in 0..e.voxels() as u32 {
        let at = [i % e.x, i / e.x % e.y, i / e.x / e.y];
        text += &format!("{}{}", grid.value(at).unwrap(), if i % 7 == 6 { "\n" } else { " " });
    }
    text
}

#[test]
fn big_endian_nifti_1() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.nii");
    let grid = grid(SampleType::F32);
    let mut place = Placement::from_spacing([1.0, 2.0, 4.0], [5.0, 6.0, 7.0]);
    (place.space, place.unit) = (Space::Ras, Unit::Metre);
    let value_map = ValueMap { scale: 2.0, offset: -1.0 };
    export(&path, &grid, &ExportInfo { placement: &place, value_map, times: None, header: None }).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    // Offset, width and number of the header's fields (nifti1.h).
    for (at, width, count) in [
        (0, 4, 1),
        (32, 4, 1),
        (36, 2, 1),
        (40, 2, 8),
        (56, 4, 3),
        (68, 2, 4),
        (76, 4, 11),
        (120, 2, 1),
        (124, 4, 6),
        (252, 2, 2),
        (256, 4, 18),
        (352, 4, 60),
    ] {
        bytes[at..at + width * count].chunks_exact_mut(width).for_each(<[u8]>::reverse);
    }
    std::fs::write(&path, bytes).unwrap();
    let (back, import) = load(&path, &ImportOptions::default()).unwrap();
    assert!(back.bytes() == grid.bytes() && import.streamed);
    assert_eq!((import.placement, import.value_map), (place, value_map));
}

#[test]
fn nifti_headers_are_kept_and_put_back() {
    let temp = tempfile::tempdir().unwrap();
    let header = serde_json::json!({
        "format": "nifti-1", "descrip": "a head", "aux_file": "aux", "intent_name": "mean", "db_name": "db",
        "data_type": "dt", "qform_code": 1, "xyzt_units": 10, "intent_code": 3, "dim_info": 57, "slice_code": 1,
        "slice_end": 2, "cal_max": 100.5, "cal_min": -1.0, "slice_duration": 0.25, "toffset": 1.5,
        "intent_p": [9.0, 0.0, 0.0],
        // An oblique qform, whose matrix no f32 holds.
        "pixdim": [-1.0, 0.5, 0.75, 1.5], "quatern": [0.125, 0.25, 0.5], "qoffset": [1.0, 2.0, 3.0],
    });
    let path = temp.path().join("a.nii");
    let write = |placement: &Placement, header: &serde_json::Value| {
        let info = ExportInfo { placement, value_map: ValueMap::default(), times: None, header: Some(header) };
        export(&path, &grid(SampleType::U8), &info).unwrap();
        load(&path, &ImportOptions::default()).unwrap().1
    };
    // Its placement, from a file with that very qform.
    write(&Placement { space: Space::Ras, unit: Unit::Millimetre, ..Placement::default() }, &header);
    let mut bytes = std::fs::read(&path).unwrap();
    let floats = [
        (76, -1.0f32),
        (80, 0.5),
        (84, 0.75),
        (88, 1.5),
        (256, 0.125),
        (260, 0.25),
        (264, 0.5),
        (268, 1.0),
        (272, 2.0),
        (276, 3.0),
    ];
    for (at, v) in floats {
        bytes[at..at + 4].copy_from_slice(&v.to_le_bytes());
    }
    bytes[254..256].fill(0);
    bytes[280..328].fill(0);
    std::fs::write(&path, bytes).unwrap();
    let first = load(&path, &ImportOptions::default()).unwrap().1;
    assert_eq!(first.placement.unit, Unit::Millimetre);
    let text = first.header.to_string();
    let second = write(&first.placement, &serde_json::from_str(&text).unwrap());
    // Bit for bit: the qform has been put back, not computed anew.
    assert_eq!(second.placement, first.placement);
    assert_eq!(second.header, first.header);
    for (key, value) in header.as_object().unwrap() {
        assert_eq!(second.header[key], *value, "{key}");
    }
    // Moved, the old qform no longer holds: a sform says where it is, to the precision of f32.
    let mut moved = first.placement.clone();
    moved.matrix[1][3] += 8.0;
    let third = write(&moved, &first.header);
    assert_eq!(third.placement.origin(), moved.origin());
    assert_eq!(third.header["sform_code"], 1);
    assert_eq!(third.header["descrip"], "a head");
}
