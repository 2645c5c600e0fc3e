//! Fitted end points: never worse than minimum and maximum in squared error, block by block, and much better at few bits.

mod s3dc_support;
mod support;

use proptest::prelude::*;
use vug::codec::Codec;
use vug::codec::s3dc::{Endpoints, Params};
use vug::convert::{ImportOptions, import};
use vug::geometry::{Coord, Extent, Region};
use vug::grid::{Grid, View};
use vug::voxel::Sample;
use vug::with_sample;

fn decoded(codec: &Codec, src: View<'_>) -> Grid {
    let mut payload = Vec::new();
    codec.encode(src, &mut payload).unwrap();
    codec.check(&payload, src.sample_type, src.extent, 0).unwrap();
    let mut again = Vec::new();
    codec.encode(src, &mut again).unwrap();
    assert!(payload == again, "the same brick gave other bytes");
    let mut back = Grid::zeros(src.extent, src.sample_type).unwrap();
    codec.decode(&payload, src.extent, &Region::whole(src.extent), back.view_mut()).unwrap();
    back
}

/// Squared error of every block.
fn errors<T: Sample>(src: View<'_>, back: &Grid, block: Extent) -> Vec<f64> {
    let blocks = src.extent.div_ceil(block);
    let mut sums = vec![0.0; blocks.voxels() as usize];
    for z in 0..src.extent.z {
        for y in 0..src.extent.y {
            for (x, (a, b)) in (0..).zip(src.row::<T>(y, z).iter().zip(back.view().row::<T>(y, z))) {
                let at: Coord = [x / block.x, y / block.y, z / block.z];
                sums[blocks.index(at) as usize] += (a.component(0) - b.component(0)).powi(2);
            }
        }
    }
    sums
}

/// Squared errors of both ways, after comparing every block and the ranges.
fn compare(src: View<'_>, i_bits: u8, block: Extent) -> (f64, f64) {
    let of = |endpoints| {
        let back = decoded(&Codec::S3dc(Params::new(i_bits, block, endpoints).unwrap()), src);
        let sums = with_sample!(src.sample_type, T => errors::<T>(src, &back, block));
        (sums, back.range().unwrap())
    };
    let ((plain, range), (fitted, inside)) = (of(Endpoints::MinMax), of(Endpoints::Fitted));
    assert!(inside.0 >= range.0 && inside.1 <= range.1, "{inside:?} leaves {range:?}");
    for (k, (f, p)) in fitted.iter().zip(&plain).enumerate() {
        // The order of summation differs between the encoder and this test.
        assert!(*f <= p * (1.0 + 1e-9), "block {k}: {f} > {p}");
    }
    (plain.iter().sum(), fitted.iter().sum())
}

#[test] // minmax 0 dB; fitted: what the literature's least squares gain on real volumes
fn real_volumes_gain_decibels() {
    let Some(dir) = support::data() else { return };
    for name in [
        "ct_visiblehuman_head_u8.nrrd",
        "ct_chest_lidc2.nhdr",
        "mri_stroke_t1.nii.gz",
        "mri_mni152_i16.nii.gz",
        "mr_cardiac_u16.nrrd",
        "turb_wmag91.nhdr",
        "cryoem_betagal.nhdr",
        "density_acrolein_f32.nrrd",
    ] {
        let mut source = import(&dir.join(name), &ImportOptions::default()).unwrap();
        let (extent, t) = (source.reader.extent(), source.reader.sample_type());
        let planes = extent.z.min(32);
        let mut grid = Grid::zeros(Extent { z: planes, ..extent }, t).unwrap();
        let first = (extent.z - planes) / 2;
        source.reader.read_slab(first..first + planes, grid.bytes_mut()).unwrap();
        let gains = [(1, 3.0), (2, 1.5), (4, 0.2), (8, 0.0)].map(|(i_bits, least)| {
            let (plain, fitted) = compare(grid.view(), i_bits, Extent::cube(4));
            let gain = if plain == fitted { 0.0 } else { 10.0 * (plain / fitted).log10() };
            assert!(gain >= if plain > 0.0 { least } else { 0.0 }, "{name}, {i_bits} bits: {gain} dB");
            gain
        });
        println!("{name:<30} {t}: fitted gains {gains:.2?} dB at 1, 2, 4, 8 bits");
    }
}

#[test]
fn constant_blocks_stay_constant() {
    for i_bits in [1, 2, 4, 8] {
        let codec = Codec::S3dc(Params::new(i_bits, Extent::cube(4), Endpoints::Fitted).unwrap());
        let grid = Grid::from_fn(Extent::new(9, 5, 4), |_| 7.25f32).unwrap();
        assert!(decoded(&codec, grid.view()).bytes() == grid.bytes());
    }
}

#[test] // K-13
fn non_finite_samples_are_refused() {
    let codec = Codec::S3dc(Params::new(4, Extent::cube(4), Endpoints::Fitted).unwrap());
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let grid = Grid::from_fn(Extent::cube(6), |c| if c == [5, 5, 5] { bad } else { c[0] as f32 }).unwrap();
        let mut out = vec![1, 2];
        assert_eq!(codec.encode(grid.view(), &mut out).unwrap_err().code(), vug::error::Code::NonFinite);
        assert_eq!(out, [1, 2]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn no_block_gets_worse(
        t in 0..4, i_bits in prop::sample::select(vec![1u8, 2, 4, 8]), block in [1u32..9, 1u32..9, 1u32..9],
        e in [1u32..20, 1u32..10, 1u32..10], levels in 1u32..70_000, salt in any::<u32>(),
    ) {
        let extent = Extent::from(e);
        let value = |c: Coord| support::hash([c[0] ^ salt, c[1], c[2]]) % levels;
        let grid = match t {
            0 => Grid::from_fn(extent, |c| value(c) as u8),
            1 => Grid::from_fn(extent, |c| value(c) as u16),
            2 => Grid::from_fn(extent, |c| value(c) as i16),
            _ => Grid::from_fn(extent, |c| (value(c) as f32 - 50.0).powi(3) * 1e-3),
        }.unwrap();
        compare(grid.view(), i_bits, Extent::from(block));
    }
}
