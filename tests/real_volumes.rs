//! Every real volume through the whole chain: import, encode, verify, decode, compare. Skipped where there are none.
#![cfg(feature = "convert")]

mod support;

use std::path::Path;
use support::{encode, explicit, open, verify};
use vug::convert::{ImportOptions, import};
use vug::metrics::error_stats;
use vug::volume::{At, Bound, CodecChoice, EncodeOptions, Quality};
use vug::{Grid, SampleType};

/// Scalar volumes, with their type and the bound of 4 bits and 16³ blocks: floor(R/(2q) + ½), or R/(2q) for floats.
const SCALARS: &[(&str, SampleType)] = &[
    ("ct_visiblehuman_head_u8.nrrd", SampleType::U8),
    ("ct_chest_lidc2.nhdr", SampleType::U8),
    ("mri_stroke_t1.nii.gz", SampleType::U8),
    ("mri_mni152_i16.nii.gz", SampleType::I16),
    ("mr_cardiac_u16.nrrd", SampleType::U16),
    ("tooth.nhdr", SampleType::U16),
    ("turb_wmag91.nhdr", SampleType::F32),
    ("density_acrolein_f32.nrrd", SampleType::F32),
    ("cryoem_betagal.nhdr", SampleType::F32),
    ("edge/seg3d_label_brain.nrrd", SampleType::U8),
    ("edge/flair_oblique.nrrd", SampleType::U8),
    ("edge/const32x20x16.nhdr", SampleType::F32),
    ("edge/papaya_zstat1_f32be.nii.gz", SampleType::F32),
];

const COLOURS: &[&str] = &["rgb_stroke_t1t2flair.nrrd", "rgb_dti_dec.nrrd", "rgb24_ct_perfusion.nii.gz"];

fn load(dir: &Path, name: &str) -> Grid {
    let mut source = import(&dir.join(name), &ImportOptions::default()).unwrap();
    let mut grid = Grid::zeros(source.reader.extent(), source.reader.sample_type()).unwrap();
    let planes = 0..grid.extent().z;
    source.reader.read_slab(planes, grid.bytes_mut()).unwrap();
    grid
}

/// Encodes, verifies, decodes; returns the largest error.
fn round_trip(grid: &mut Grid, options: &EncodeOptions) -> f64 {
    let (bytes, report) = encode(grid, options);
    let errors = verify(&bytes);
    assert!(errors.is_empty(), "{errors:?}");
    let decoded = open(bytes).read(At::default()).unwrap();
    let found = error_stats(&grid.view(), &decoded.view()).unwrap().max_abs;
    assert_eq!(found, report.max_error);
    found
}

#[test] // V2, K-24: the paper's bound on real data, 4 bits, 16³ blocks
fn four_bits_hold_the_bound_of_eq_6() {
    let Some(dir) = support::data() else { return };
    for &(name, t) in SCALARS {
        let mut grid = load(&dir, name);
        assert_eq!(grid.sample_type(), t, "{name}");
        let (lo, hi) = grid.range().unwrap();
        let half_step = (hi - lo) / 30.0;
        let bound = if t == SampleType::F32 {
            half_step * (1.0 + 1e-6) + f64::from(f32::EPSILON) * lo.abs().max(hi.abs())
        } else {
            (half_step + 0.5).floor()
        };
        let error = round_trip(&mut grid, &explicit(4, 16));
        println!("{name}: {} {t}, max error {error} ≤ {bound}", grid.extent());
        assert!(error <= bound, "{name}: {error} > {bound}");
        if name == "ct_visiblehuman_head_u8.nrrd" {
            assert_eq!(error, 8.0);
        }
    }
}

#[test]
fn a_maximum_error_holds_on_every_voxel() {
    let Some(dir) = support::data() else { return };
    for &(name, _) in SCALARS {
        let mut grid = load(&dir, name);
        let (lo, hi) = grid.range().unwrap();
        for percent in [0.1, 2.0] {
            let quality = Quality::MaxError(Bound::Percent(percent));
            let options = EncodeOptions { quality, codec: CodecChoice::Auto, ..EncodeOptions::default() };
            let error = round_trip(&mut grid, &options);
            assert!(error <= percent / 100.0 * (hi - lo), "{name}: {error} > {percent} %");
        }
    }
}

#[test]
fn raw_gives_back_every_bit() {
    let Some(dir) = support::data() else { return };
    let names = SCALARS.iter().map(|(name, _)| *name).chain(COLOURS.iter().copied());
    for name in names {
        let mut grid = load(&dir, name);
        let raw = EncodeOptions { codec: CodecChoice::Raw, ..EncodeOptions::default() };
        let bytes = encode(&mut grid, &raw).0;
        assert!(verify(&bytes).is_empty());
        assert!(open(bytes).read(At::default()).unwrap().bytes() == grid.bytes(), "{name}");
    }
}
