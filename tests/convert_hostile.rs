//! Files that lie: no import panics, takes memory that the file does not justify, or reads past what is there.
#![cfg(feature = "convert")]

use proptest::prelude::*;
use std::path::Path;
use std::sync::OnceLock;
use vug::affine::{Placement, Space, ValueMap};
use vug::convert::{ExportInfo, ImportOptions, export, export_series, import};
use vug::error::Code;
use vug::time::{TimeUnit, Times};
use vug::{Extent, Grid};

/// Imports and reads everything; what comes out does not matter.
fn swallow(path: &Path) -> vug::Result<()> {
    let options = ImportOptions {
        shape: Some(Extent::new(4, 3, 2)),
        dtype: None,
        raw_dtype: "u16".parse().ok(),
        max_bytes: 1 << 20,
        ..ImportOptions::default()
    };
    let mut found = import(path, &options)?;
    let extent = found.reader.extent();
    assert!(extent.voxels() <= 1 << 20, "{extent} of a file of some hundred bytes");
    found.placement.check().unwrap();
    let (steps, channels) = found.reader.series();
    assert!(u64::from(steps) * u64::from(channels) * extent.voxels() <= 1 << 20, "{steps} {channels} of {extent}");
    if let Some(times) = found.times {
        times.check(steps).unwrap();
    }
    let mut slab = vec![0; extent.voxels() as usize * found.reader.sample_type().bytes()];
    for volume in 0..steps * channels {
        found.reader.turn_to(volume / channels, volume % channels)?;
        found.reader.read_slab(0..extent.z, &mut slab)?;
    }
    Ok(())
}

/// Small valid files of every format.
fn seeds() -> &'static [(&'static str, Vec<u8>)] {
    static SEEDS: OnceLock<Vec<(&'static str, Vec<u8>)>> = OnceLock::new();
    SEEDS.get_or_init(make_seeds)
}

fn make_seeds() -> Vec<(&'static str, Vec<u8>)> {
    let temp = tempfile::tempdir().unwrap();
    let mut place = Placement::from_spacing([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]);
    place.space = Space::Lps;
    let info =
        ExportInfo { placement: &place, value_map: ValueMap { scale: 2.0, offset: 1.0 }, times: None, header: None };
    let grid = Grid::from_fn(Extent::new(4, 3, 2), |[x, y, z]| (x + 4 * y + 12 * z) as u16).unwrap();
    let mut seeds = Vec::new();
    for ending in ["npy", "nrrd", "nii", "nii.gz"] {
        let path = temp.path().join(format!("a.{ending}"));
        export(&path, &grid, &info).unwrap();
        seeds.push((ending, std::fs::read(path).unwrap()));
    }
    let text = "NRRD0004\ntype: double\ndimension: 4\nsizes: 1 2 2 1\nkinds: scalar domain domain domain\n\
        space: RAS\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: ascii\n\
        line skip: 0\nbyte skip: 0\na:=b\n# c\n\n1 2.5 3 4\n";
    seeds.push(("nrrd", text.into()));
    let raw = "NRRD0004\ntype: int\ndimension: 3\nsizes: 1 2 2\nspacings: 1 2 nan\nunits: \"mm\" \"mm\" \"mm\"\n\
        axis mins: 0 1 2\ncenters: cell node cell\nendian: big\nbyte skip: -1\nencoding: raw\n\n\0\0\0a\0\0\0b\0\0\0c\0\0\0d";
    seeds.push(("nrrd", raw.into()));
    // NIfTI-2, made by a far place.
    let mut far = place.clone();
    far.matrix[0][3] = 1e300;
    let path = temp.path().join("b.nii");
    export(&path, &grid, &ExportInfo { placement: &far, ..info }).unwrap();
    seeds.push(("nii", std::fs::read(path).unwrap()));
    // Series: every order of axes, times by the step and one by one.
    let series = "NRRD0005\ntype: short\ndimension: 5\nsizes: 2 2 1 3 2\nkinds: vector domain domain time domain\n\
        spacings: nan 1 1 0.5 1\nunits: \"\" \"mm\" \"mm\" \"ms\" \"mm\"\naxis mins: nan 0 0 1 0\n\
        centers: ??? cell cell cell cell\nendian: big\nencoding: raw\n\n0123456789abcdef0123456789abcdef0123456789abcdef";
    seeds.push(("nrrd", series.into()));
    let slicer = "NRRD0005\ntype: uchar\ndimension: 4\nspace: LPS\nsizes: 3 2 1 1\nkinds: list domain domain domain\n\
        space directions: none (2,0,0) (0,2,0) (0,0,2)\nlabels: \"time\" \"\" \"\" \"\"\nencoding: raw\n\
        axis 0 index values:=0 0.5 2.25\nSegmentation_MasterRepresentation:=Binary labelmap\n\nabcxyz";
    seeds.push(("nrrd", slicer.into()));
    let times = Times::regular(TimeUnit::Second, 1.0, 0.5, 3);
    let raw = temp.path().join("series.raw");
    std::fs::write(&raw, [7; 4 * 3 * 2 * 2 * 3 * 2]).unwrap();
    let shape = ImportOptions {
        shape: Some(Extent::new(4, 3, 2)),
        raw_dtype: "u16".parse().ok(),
        time_steps: Some(3),
        channels: Some(2),
        ..ImportOptions::default()
    };
    for ending in ["npy", "nii", "nrrd"] {
        let path = temp.path().join(format!("c.{ending}"));
        let info = ExportInfo { times: Some(&times), ..info };
        export_series(&path, &mut *import(&raw, &shape).unwrap().reader, &info).unwrap();
        seeds.push((ending, std::fs::read(path).unwrap()));
    }
    seeds
}

#[test]
fn seeds_are_valid_and_every_prefix_is_an_error_or_the_whole() {
    let temp = tempfile::tempdir().unwrap();
    for (i, (ending, bytes)) in seeds().iter().enumerate() {
        let path = temp.path().join(format!("{i}.{ending}"));
        std::fs::write(&path, bytes).unwrap();
        swallow(&path).unwrap();
        for cut in 0..bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            // The newline behind text or raw data may go.
            let newline = cut + 1 == bytes.len() && bytes[cut] == b'\n';
            // With "byte skip: -1" or in text a shorter file may still hold enough; the seeds hold no more than needed.
            assert!(newline || swallow(&path).is_err(), "{ending} {i} cut at {cut}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn mutated_files_never_panic(
        seed in 0usize..12,
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..4), 1..6),
    ) {
        let temp = tempfile::tempdir().unwrap();
        let (ending, mut bytes) = seeds()[seed].clone();
        for (at, value, how) in edits {
            let at = at.index(bytes.len());
            match how {
                0 => bytes[at] = value,
                1 => bytes[at] ^= 1 << (value % 8),
                2 => bytes.insert(at, b"0123456789-. \n(),'\"%e"[usize::from(value) % 21]),
                _ => { bytes.truncate(at.max(1)); }
            }
        }
        let path = temp.path().join(format!("a.{ending}"));
        std::fs::write(&path, bytes).unwrap();
        let _ = swallow(&path);
    }

    #[test]
    fn noise_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..700), kind in 0usize..5) {
        let temp = tempfile::tempdir().unwrap();
        let ending = ["npy", "nrrd", "nii", "nii.gz", "raw"][kind];
        let path = temp.path().join(format!("a.{ending}"));
        std::fs::write(&path, bytes).unwrap();
        let _ = swallow(&path);
    }

    #[test]
    fn hostile_numbers_never_panic(
        sizes in prop::collection::vec(any::<u64>().prop_map(|v| v >> (v % 64)), 1..6),
        kind in 0usize..4,
        fortran in any::<bool>(),
    ) {
        let temp = tempfile::tempdir().unwrap();
        let list = sizes.iter().map(u64::to_string).collect::<Vec<_>>();
        let path = temp.path().join("a.nrrd");
        let encoding = ["raw", "gzip", "bzip2", "ascii"][kind];
        std::fs::write(&path, format!(
            "NRRD0004\ntype: double\ndimension: {}\nsizes: {}\nendian: little\nbyte skip: {}\nline skip: {}\nencoding: {encoding}\n\nxyz",
            sizes.len(), list.join(" "), sizes[0], sizes[sizes.len() - 1] % 3,
        )).unwrap();
        prop_assert!(swallow(&path).is_err());
        let path = temp.path().join("a.npy");
        let text = format!(
            "{{'descr': '<f8', 'fortran_order': {}, 'shape': ({},)}}",
            if fortran { "True" } else { "False" }, list.join(","),
        );
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.as_bytes());
        std::fs::write(&path, bytes).unwrap();
        prop_assert!(swallow(&path).is_err());
    }
}

#[test] // D-60, D-61
fn promises_that_the_file_cannot_keep() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.nrrd");
    for (sizes, encoding, codes) in [
        ("2000000 2000000 10", "raw", [Code::Foreign, Code::Foreign]),
        ("2000000 2000000 10", "ascii", [Code::Foreign, Code::Foreign]),
        // Above the limit that `swallow` sets, before anything is inflated.
        ("2000000 2000000 10", "gzip", [Code::Limit, Code::Foreign]),
        ("4294967295 4294967295 4294967295", "raw", [Code::Limit, Code::Limit]),
    ] {
        let text =
            format!("NRRD0004\ntype: float\ndimension: 3\nsizes: {sizes}\nendian: little\nencoding: {encoding}\n\n.");
        std::fs::write(&path, text).unwrap();
        assert_eq!(swallow(&path).unwrap_err().code(), codes[0], "{encoding}");
        let unlimited = ImportOptions { max_bytes: u64::MAX, ..ImportOptions::default() };
        assert_eq!(import(&path, &unlimited).err().unwrap().code(), codes[1], "{encoding}");
    }
}

#[test] // 100 MB of zeros in 100 kB: no more is inflated than the header asks for, and one byte
fn a_bomb_does_not_go_off() {
    use std::io::Write;
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.nrrd");
    let mut file = std::fs::File::create(&path).unwrap();
    file.write_all(b"NRRD0004\ntype: uchar\ndimension: 1\nsizes: 10\nencoding: gzip\n\n").unwrap();
    let mut packed = flate2::write::GzEncoder::new(file, flate2::Compression::fast());
    for _ in 0..100 {
        packed.write_all(&vec![0; 1 << 20]).unwrap();
    }
    packed.finish().unwrap();
    let e = swallow(&path).unwrap_err();
    assert!(e.code() == Code::Foreign && e.message().contains("go on after"), "{e}");
}

#[test]
fn files_that_are_none() {
    let temp = tempfile::tempdir().unwrap();
    for name in ["missing.nrrd", "missing.nii", "missing.npy", "missing.raw", "missing.img"] {
        let e = swallow(&temp.path().join(name)).unwrap_err();
        assert!(e.message().contains("missing"), "{e}");
    }
    let folder = temp.path().join("folder.nii");
    std::fs::create_dir(&folder).unwrap();
    assert!(swallow(&folder).is_err());
    let header = temp.path().join("a.nhdr");
    for data in ["missing.raw", ".", "LIST", "a%03d.raw 0 9 1", "/dev/zero", ""] {
        let text = format!("NRRD0004\ntype: uchar\ndimension: 1\nsizes: 10\nencoding: raw\ndata file: {data}\n");
        std::fs::write(&header, text).unwrap();
        let e = swallow(&header).unwrap_err();
        println!("{e}");
        let code = e.code();
        assert!(matches!(code, Code::Source | Code::Unsupported | Code::Foreign), "{e}");
        if data == "LIST" || data.contains('%') {
            assert!(code == Code::Unsupported && e.message().contains("several files"), "{e}");
        }
    }
}
