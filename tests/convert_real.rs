//! Real volumes: every file of the data folder is read as its table says, or refused with the reason that holds.
#![cfg(feature = "convert")]

#[path = "support/data.rs"]
mod data;

use std::path::Path;
use vug::convert::{ExportInfo, Import, ImportOptions, export, import};
use vug::error::Code;
use vug::{Extent, Grid, SampleType};

fn read(path: &Path, options: &ImportOptions) -> vug::Result<(Grid, Import)> {
    let mut import = import(path, options)?;
    let (extent, sample_type) = (import.reader.extent(), import.reader.sample_type());
    let mut grid = Grid::zeros(extent, sample_type)?;
    // Two slabs, the later one first: slabs may be asked for in any order.
    let plane = grid.bytes().len() / extent.z as usize;
    let half = extent.z / 2;
    let (low, high) = grid.bytes_mut().split_at_mut(half as usize * plane);
    import.reader.read_slab(half..extent.z, high)?;
    import.reader.read_slab(0..half, low)?;
    if let Some(view) = import.reader.as_view() {
        assert_eq!(view.bytes, grid.bytes());
    }
    Ok((grid, import))
}

struct Row {
    file: &'static str,
    dims: [u32; 3],
    sample_type: SampleType,
    range: (f64, f64),
    spacing: Option<[f64; 3]>,
}

const fn row(file: &'static str, dims: [u32; 3], t: SampleType, range: (f64, f64), spacing: Option<[f64; 3]>) -> Row {
    Row { file, dims, sample_type: t, range, spacing }
}

use SampleType::{F32, I16, Rgb8, U8, U16};

/// What the constant volume holds: 3.14, rounded to f32.
const CONSTANT: f64 = 314.0 / 100.0;

const VOLUMES: &[Row] = &[
    row("ct_visiblehuman_head_u8.nrrd", [512, 512, 234], U8, (0.0, 255.0), None),
    row("ct_chest_lidc2.nhdr", [256, 256, 133], U8, (0.0, 255.0), Some([1.40625, 1.40625, 2.5])),
    row("mri_stroke_t1.nii.gz", [124, 160, 140], U8, (0.0, 252.0), Some([1.0; 3])),
    row("mri_mni152_i16.nii.gz", [193, 229, 193], I16, (0.0, 1570.0), Some([1.0; 3])),
    row("mr_cardiac_u16.nrrd", [640, 640, 44], U16, (0.0, 2420.0), Some([0.625, 0.625, 2.5])),
    row("tooth.nhdr", [103, 94, 161], U16, (0.0, 1300.0), Some([1.0; 3])),
    row("turb_wmag91.nhdr", [91; 3], F32, (0.0497, 265.3), None),
    row("density_acrolein_f32.nrrd", [77, 69, 96], F32, (3.5e-24, 7.35), Some([0.190777; 3])),
    row("cryoem_betagal.nhdr", [100; 3], F32, (-0.053, 0.197), Some([3.54; 3])),
    row("rgb_stroke_t1t2flair.nrrd", [124, 160, 140], Rgb8, (0.0, 255.0), None),
    row("rgb_dti_dec.nrrd", [128, 128, 53], Rgb8, (0.0, 255.0), None),
    row("rgb24_ct_perfusion.nii.gz", [256, 286, 15], Rgb8, (0.0, 255.0), Some([0.781, 0.781, 10.0])),
    row("edge/nifti-rs_minimal.nii", [64, 64, 10], U8, (0.0, 63.0), Some([3.0; 3])),
    row("edge/nifti-rs_minimal.nii.gz", [64, 64, 10], U8, (0.0, 63.0), Some([3.0; 3])),
    row("edge/minimal.hdr", [64, 64, 10], U8, (0.0, 63.0), Some([3.0; 3])),
    row("edge/minimal.img", [64, 64, 10], U8, (0.0, 63.0), Some([3.0; 3])),
    row("edge/minimal2.hdr", [64, 64, 10], U8, (0.0, 63.0), Some([3.0; 3])),
    row("edge/minimal2.img.gz", [64, 64, 10], U8, (0.0, 63.0), Some([3.0; 3])),
    row("edge/nifti-rs_minimal_extended_hdr.nii", [8, 8, 1], F32, (0.0, 0.0), None),
    row("edge/nifti-rs_27_uint8.nii", [3; 3], U8, (0.0, 26.0), None),
    row("edge/nifti-rs_27_uint16.nii", [3; 3], U16, (0.0, 26.0), None),
    row("edge/nifti-rs_27_uint32.nii", [3; 3], U16, (0.0, 26.0), None),
    row("edge/nifti-rs_27_uint64.nii", [3; 3], U16, (0.0, 26.0), None),
    row("edge/nifti-rs_27_int8.nii", [3; 3], I16, (0.0, 26.0), None),
    row("edge/nifti-rs_27_int16.nii", [3; 3], I16, (0.0, 26.0), None),
    row("edge/nifti-rs_27_int32.nii", [3; 3], U16, (0.0, 26.0), None),
    row("edge/nifti-rs_27_int64.nii", [3; 3], U16, (0.0, 26.0), None),
    row("edge/nifti-rs_27_float32.nii", [3; 3], F32, (0.0, 26.0), None),
    row("edge/nifti-rs_27_float64.nii", [3; 3], F32, (0.0, 26.0), None),
    row("edge/nifti-rs_rgb_3D.nii", [3; 3], Rgb8, (0.0, 55.0), None),
    row("edge/nifti-rs_f32.nii.gz", [11; 3], F32, (0.0, 1.0), None),
    row("edge/nibabel_standard.nii.gz", [4, 5, 7], U8, (0.0, 255.0), None),
    row("edge/papaya_zstat1_f32be.nii.gz", [64, 64, 21], F32, (-7.708, 15.641), None),
    row("edge/BallBinary30x30x30.nhdr", [30; 3], I16, (0.0, 257.0), Some([1.0; 3])),
    row("edge/BallBinary30x30x30_gz.nrrd", [30; 3], I16, (0.0, 257.0), Some([1.0; 3])),
    row("edge/BallBinary30x30x30_bz2.nrrd", [30; 3], I16, (0.0, 257.0), Some([1.0; 3])),
    row("edge/BallBinary30x30x30_gz_lineskip.nrrd", [30; 3], I16, (0.0, 257.0), Some([1.0; 3])),
    row("edge/BallBinary30x30x30_gz_byteskip_minus_one.nrrd", [30; 3], I16, (0.0, 257.0), Some([1.0; 3])),
    row("edge/BallBinary30x30x30_byteskip_minus_one.nhdr", [30; 3], I16, (0.0, 257.0), Some([1.0; 3])),
    row("edge/BallBinary30x30x30_byteskip_minus_one_nifti.nhdr", [30; 3], I16, (0.0, 257.0), Some([1.0; 3])),
    row("edge/BallBinary30x30x30.nii.gz", [30; 3], I16, (0.0, 257.0), Some([1.0; 3])),
    row("edge/test1d_ascii.nrrd", [27, 1, 1], U8, (1.0, 27.0), Some([1.0458, 1.0, 1.0])),
    row("edge/test_customFields.nrrd", [27, 1, 1], U8, (1.0, 27.0), Some([1.0458, 1.0, 1.0])),
    row("edge/test2d_ascii.nrrd", [3, 9, 1], U16, (1.0, 27.0), Some([1.0458, 2.0, 1.0])),
    row("edge/const32x20x16.nhdr", [32, 20, 16], F32, (CONSTANT, CONSTANT), None),
    row("edge/seg3d_label_brain.nrrd", [160, 232, 160], U8, (0.0, 1.0), Some([1.0, 0.898437, 0.898437])),
    row("edge/flair_oblique.nrrd", [124, 160, 140], U8, (0.0, 255.0), Some([1.0; 3])),
];

#[test]
fn every_volume_is_read_and_survives_every_format() {
    let Some(folder) = data::folder("every_volume_is_read_and_survives_every_format") else { return };
    let temp = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    for row in VOLUMES {
        let (grid, found) = match read(&folder.join(row.file), &ImportOptions::default()) {
            Ok(found) => found,
            Err(e) => {
                wrong.push(format!("{}: {e}", row.file));
                continue;
            }
        };
        let range = grid.range().unwrap();
        // The table rounds to some digits.
        let near = |a: f64, b: f64| (a - b).abs() <= 6e-3 * b.abs().max(1e-30);
        let spacing = found.placement.spacing();
        if grid.extent() != Extent::from(row.dims)
            || grid.sample_type() != row.sample_type
            || !near(range.0, row.range.0)
            || !near(range.1, row.range.1)
            || row.spacing.is_some_and(|s| (0..3).any(|i| !near(spacing[i], s[i])) || found.placement.spacing_unknown)
        {
            let p = &found.placement;
            wrong.push(format!("{}: {} {} {range:?} {spacing:?} {p:?}", row.file, grid.extent(), grid.sample_type()));
        }
        // Big volumes once, small ones through every format.
        let endings: &[&str] = match grid.extent().voxels() {
            0..1_000_000 => &["raw", "npy", "nrrd", "nhdr", "nii", "nii.gz", "hdr", "img.gz"],
            _ => &["nhdr"],
        };
        for ending in endings {
            let path = temp.path().join(format!("copy.{ending}"));
            let info = ExportInfo {
                placement: &found.placement,
                value_map: found.value_map,
                times: None,
                header: Some(&found.header),
            };
            export(&path, &grid, &info).unwrap();
            let options = ImportOptions {
                shape: Some(grid.extent()),
                dtype: (*ending == "raw").then_some(grid.sample_type()),
                ..ImportOptions::default()
            };
            let (back, again) = read(&path, &options).unwrap();
            assert!(back.bytes() == grid.bytes() && back.extent() == grid.extent(), "{} as {ending}", row.file);
            if ending.starts_with('n') && *ending != "npy" {
                assert_eq!(again.value_map, found.value_map, "{} as {ending}", row.file);
            }
            if matches!(*ending, "nrrd" | "nhdr") {
                assert_eq!(again.placement, found.placement, "{} as {ending}", row.file);
            }
            if found.format == again.format && found.format == vug::convert::Format::Nifti {
                assert_eq!(again.header, found.header, "{} as {ending}", row.file);
                assert_eq!(again.placement.matrix, found.placement.matrix, "{} as {ending}", row.file);
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn what_cannot_be_held_is_refused_by_name() {
    let Some(folder) = data::folder("what_cannot_be_held_is_refused_by_name") else { return };
    for (file, code, words) in [
        ("lf_shop_9x9_480x320_rgb.nrrd", Code::Unsupported, &["3×480×320×9×9", "light fields"][..]),
        ("edge/nifti-rs_rgba_4D.nii", Code::Unsupported, &["2304", "RGBA"]),
        ("edge/nifti-rs_complex_complex32.nii", Code::Unsupported, &["32", "complex"]),
        ("edge/nifti-rs_complex_complex64.nii", Code::Unsupported, &["1792", "complex"]),
        ("edge/nifti-rs_fuzz_artifacts_crash-1.nii", Code::Foreign, &["crash-1"]),
        ("edge/nifti-rs_fuzz_artifacts_crash-2.nii", Code::Foreign, &["crash-2"]),
        ("edge/nibabel_nifti1.hdr", Code::Foreign, &[]),
        ("edge/nibabel_nifti2.hdr", Code::Foreign, &[]),
        ("edge/nibabel_analyze.hdr", Code::Unsupported, &["Analyze"]),
        ("edge/BallBinary30x30x30_byteskip_minus_five.nhdr", Code::Foreign, &["-5"]),
        ("edge/BallBinary30x30x30_nifti.nhdr", Code::Foreign, &["54000"]),
        ("edge/test_simple4d_raw.nrrd", Code::Unsupported, &["0.769", "--dtype"]),
        ("density_acrolein.cube.gz", Code::Unsupported, &["ending"]),
    ] {
        let path = folder.join(file);
        let error = import(&path, &ImportOptions::default()).err().unwrap_or_else(|| panic!("{file} was read"));
        println!("{error}");
        assert_eq!(error.code(), code, "{file}: {error}");
        for word in words.iter().chain([&path.to_string_lossy().split('_').next().unwrap()]) {
            assert!(error.message().contains(*word), "{word:?} is not in {file}: {error}");
        }
    }
}

#[test]
fn forced_types() {
    let Some(folder) = data::folder("forced_types") else { return };
    let forced = |t| ImportOptions { dtype: Some(t), ..ImportOptions::default() };
    let (grid, _) = read(&folder.join("edge/test_simple4d_raw.nrrd"), &forced(F32)).unwrap();
    assert!((grid.samples::<f32>()[0] - 0.769).abs() < 1e-3);
    let (grid, _) = read(&folder.join("edge/nifti-rs_27_float64.nii"), &forced(U8)).unwrap();
    let mut values = grid.samples::<u8>().to_vec();
    values.sort_unstable();
    assert_eq!(values, (0..27).collect::<Vec<u8>>());
    let e = read(&folder.join("edge/BallBinary30x30x30.nhdr"), &forced(U8)).err().unwrap();
    assert!(e.message().contains("257") && e.message().contains("at voxel"), "{e}");
}

#[test]
fn the_same_voxels_however_they_are_packed() {
    let Some(folder) = data::folder("the_same_voxels_however_they_are_packed") else { return };
    let (first, _) = read(&folder.join("edge/BallBinary30x30x30.nhdr"), &ImportOptions::default()).unwrap();
    let mean = first.samples::<i16>().iter().map(|v| f64::from(*v)).sum::<f64>() / 27_000.0;
    assert!((mean - 136.4).abs() < 0.1, "{mean}");
    for name in ["_gz.nrrd", "_bz2.nrrd", "_gz_lineskip.nrrd", "_byteskip_minus_one_nifti.nhdr", ".nii.gz"] {
        let (other, _) =
            read(&folder.join(format!("edge/BallBinary30x30x30{name}")), &ImportOptions::default()).unwrap();
        assert!(other.bytes() == first.bytes(), "{name}");
    }
    // Big endian: the first samples of the file, read by hand.
    let raw = std::fs::read(folder.join("tooth.raw")).unwrap();
    let (tooth, import) = read(&folder.join("tooth.nhdr"), &ImportOptions::default()).unwrap();
    assert!(import.streamed);
    assert!(raw.chunks_exact(2).zip(tooth.samples::<u16>()).all(|(b, v)| u16::from_be_bytes([b[0], b[1]]) == *v));
    // The oblique volume is one of the three colours.
    let (flair, _) = read(&folder.join("edge/flair_oblique.nrrd"), &ImportOptions::default()).unwrap();
    let (colours, _) = read(&folder.join("rgb_stroke_t1t2flair.nrrd"), &ImportOptions::default()).unwrap();
    assert!(flair.samples::<u8>().iter().zip(colours.samples::<[u8; 3]>()).all(|(v, rgb)| *v == rgb[2]));
}
