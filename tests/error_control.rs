//! Bounds hold for every voxel; rates are kept; what was achieved is what is stored; bytes depend on nothing but the input.

mod support;

use proptest::prelude::*;
use support::{ball, encode, explicit, hash, open, verify};
use vug::codec::s3dc::Endpoints;
use vug::metrics::{compare, error_stats};
use vug::volume::{At, Bound, CodecChoice, EncodeOptions, NonFinite, Quality, Volume};
use vug::{Code, Extent, Grid, SampleType};

fn with(quality: Quality) -> EncodeOptions {
    EncodeOptions { quality, codec: CodecChoice::Auto, ..EncodeOptions::default() }
}

/// Encodes, checks the file and the report against the decoded voxels, and returns volume and largest error.
fn checked(grid: &mut Grid, options: &EncodeOptions) -> (Volume, f64) {
    let (bytes, report) = encode(grid, options);
    let errors = verify(&bytes);
    assert!(errors.is_empty(), "{errors:?}");
    let volume = open(bytes);
    let decoded = volume.read(At::default()).unwrap();
    let found = error_stats(&grid.view(), &decoded.view()).unwrap();
    assert_eq!(found.max_abs, report.max_error, "the report is measured");
    assert!((found.rmse() - report.rmse).abs() <= 1e-9 * report.rmse);
    let stored = volume.info().achieved.unwrap();
    assert_eq!((stored.max_error, stored.rmse, stored.mean_error), (report.max_error, report.rmse, report.mean_error));
    (volume, found.max_abs)
}

#[test]
fn bounds_are_held_on_every_type() {
    let e = Extent::new(45, 33, 38);
    let grids = [
        ball(e),
        support::noise(e, |h| (h >> 17) as u16),
        support::noise(e, |h| (h >> 16) as u16 as i16),
        Grid::from_fn(e, |c| (hash(c) as f32 / 4e9).powi(7) * 1e4 - 3.0).unwrap(),
        support::noise::<[u8; 3]>(e, |h| h.to_le_bytes()[1..].try_into().unwrap()),
    ];
    for mut grid in grids {
        let (lo, hi) = grid.range().unwrap();
        for percent in [0.0, 0.01, 0.3, 1.0, 5.0, 30.0, 100.0] {
            for endpoints in [Endpoints::MinMax, Endpoints::Fitted] {
                let options = EncodeOptions { endpoints, ..with(Quality::MaxError(Bound::Percent(percent))) };
                let (_, error) = checked(&mut grid, &options);
                assert!(error <= percent / 100.0 * (hi - lo), "{:?}: {error} > {percent} %", grid.sample_type());
            }
        }
        for psnr in [20.0, 45.0, 70.0] {
            let (volume, _) = checked(&mut grid, &with(Quality::Psnr(psnr)));
            let c = compare(&grid.view(), &volume.read(At::default()).unwrap().view()).unwrap();
            assert!(c.identical || c.psnr.unwrap() >= psnr, "{psnr}: {:?}", c.psnr);
        }
    }
}

#[test]
fn rates_are_kept() {
    let e = Extent::new(64, 64, 64);
    let mut grid = ball(e);
    let mut last = f64::INFINITY;
    for rate in [1.02, 1.3, 2.3, 4.1, 8.2] {
        let options = EncodeOptions { codec: CodecChoice::S3dc, ..with(Quality::Rate(rate)) };
        let (volume, _) = checked(&mut grid, &options);
        let bits = volume.info().payload_bytes as f64 * 8.0 / e.voxels() as f64;
        assert!(bits <= rate, "{bits} > {rate}");
        let rmse = volume.info().achieved.unwrap().rmse;
        assert!(rmse <= last, "more bits are never worse");
        last = rmse;
    }
    // Coarser levels count.
    let options = EncodeOptions { codec: CodecChoice::S3dc, levels: 0, brick: Some(16), ..with(Quality::Rate(4.5)) };
    let (volume, _) = checked(&mut grid, &options);
    assert!(volume.info().lod_count > 1 && volume.info().payload_bytes as f64 * 8.0 / e.voxels() as f64 <= 4.5);
    let mut file = std::io::Cursor::new(Vec::new());
    let options = EncodeOptions { codec: CodecChoice::S3dc, ..with(Quality::Rate(0.01)) };
    let error = vug::volume::encode(&mut grid, &mut file, &options, &mut |_, _| {}).unwrap_err();
    assert_eq!((error.code(), error.field()), (Code::Param, "rate"));
}

#[test]
fn an_unreachable_bound_is_an_error_or_raw() {
    let mut grid = support::noise(Extent::cube(20), |h| h as u16);
    let bound = Quality::MaxError(Bound::Absolute(0.0));
    let (volume, error) = checked(&mut grid, &with(bound));
    assert_eq!((volume.info().codecs[0].id, error), (1, 0.0));
    let strict = EncodeOptions { codec: CodecChoice::S3dc, ..with(bound) };
    let mut file = std::io::Cursor::new(Vec::new());
    let error = vug::volume::encode(&mut grid, &mut file, &strict, &mut |_, _| {}).unwrap_err();
    assert_eq!((error.code(), error.field()), (Code::Param, "max-error"));
}

#[test] // C-06; lossless can be smaller than lossy
fn raw_is_taken_where_it_is_no_larger() {
    // Noise, 8 bits per index: the end points come on top of what raw takes.
    let mut grid = support::noise(Extent::cube(64), |h| (h >> 24) as u8);
    let auto = EncodeOptions { codec: CodecChoice::Auto, ..explicit(8, 2) };
    let (bytes, report) = encode(&mut grid, &auto);
    assert_eq!(report.codec, "raw");
    assert!(report.notes[0].contains("no larger"), "{:?}", report.notes);
    let (lossy, report) = encode(&mut grid, &explicit(8, 2));
    assert_eq!(report.codec, "s3dc");
    assert!(report.notes[0].contains("--codec raw"), "{:?}", report.notes);
    assert!(bytes.len() <= lossy.len());
}

#[test] // K-28, C-16, S-05: bytes do not depend on threads, nor on how the source is read
fn one_input_one_file() {
    struct Slabs(Grid);
    impl vug::grid::SlabReader for Slabs {
        fn extent(&self) -> Extent {
            self.0.extent()
        }
        fn sample_type(&self) -> SampleType {
            self.0.sample_type()
        }
        fn read_slab(&mut self, z: std::ops::Range<u32>, out: &mut [u8]) -> vug::Result<()> {
            self.0.read_slab(z, out)
        }
    }
    let e = Extent::new(150, 70, 90);
    for options in [
        EncodeOptions { levels: 0, ..explicit(2, 4) },
        EncodeOptions { endpoints: Endpoints::Fitted, ..explicit(4, 8) },
        with(Quality::MaxError(Bound::Percent(1.0))),
    ] {
        let expected = encode(&mut ball(e), &options).0;
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                assert!(encode(&mut ball(e), &options).0 == expected, "{threads} threads");
                let mut file = std::io::Cursor::new(Vec::new());
                vug::volume::encode(&mut Slabs(ball(e)), &mut file, &options, &mut |_, _| {}).unwrap();
                assert!(file.into_inner() == expected, "{threads} threads, slab by slab");
                let volume = open(expected.clone());
                let whole = volume.read(At::default()).unwrap();
                let plain = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
                assert!(plain.install(|| volume.read(At::default()).unwrap().bytes() == whole.bytes()));
            });
        }
    }
}

#[test] // K-13; spec: S3D-14
fn nan_is_refused_by_position_or_replaced_and_counted() {
    let e = Extent::new(40, 30, 50);
    for (first, other) in [([0, 0, 0], [39, 29, 49]), ([33, 2, 5], [1, 3, 5]), ([39, 29, 17], [0, 0, 18])] {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let make = |c| if c == first || c == other { bad } else { (hash(c) >> 20) as f32 };
            for codec in [CodecChoice::S3dc, CodecChoice::Raw, CodecChoice::Auto] {
                for quality in [explicit(4, 4).quality, Quality::Psnr(40.0)] {
                    let options = EncodeOptions { codec, quality, brick: Some(16), ..EncodeOptions::default() };
                    let mut file = std::io::Cursor::new(Vec::new());
                    let mut grid = Grid::from_fn(e, make).unwrap();
                    let error = vug::volume::encode(&mut grid, &mut file, &options, &mut |_, _| {}).unwrap_err();
                    assert_eq!(error.code(), Code::NonFinite);
                    let [x, y, z] = first;
                    assert!(error.message().contains(&format!("voxel {x},{y},{z} ")), "{error}");
                }
            }
            let options = EncodeOptions {
                non_finite: NonFinite::Null,
                null_value: 7.0,
                levels: 2,
                brick: Some(16),
                ..explicit(8, 2)
            };
            let mut grid = Grid::from_fn(e, make).unwrap();
            let (bytes, report) = encode(&mut grid, &options);
            assert!(verify(&bytes).is_empty(), "{:?}", verify(&bytes));
            assert_eq!(report.replaced, 2);
            let volume = open(bytes);
            assert_eq!((volume.info().replaced, volume.head().superblock.optional & 1), (2, 1));
            let value = volume.voxel(At::default(), first).unwrap().component(0);
            assert!((value - 7.0).abs() <= report.max_error, "{value}");
        }
    }
}

#[test] // K-12
fn negative_zero() {
    let mut grid = Grid::from_fn(Extent::cube(8), |[x, ..]| if x % 2 == 0 { -0.0f32 } else { 0.0 }).unwrap();
    let volume = open(encode(&mut grid, &explicit(4, 4)).0);
    assert_eq!(volume.brick_counts().unwrap().empty, 1, "both zeros are one value");
    assert_eq!(volume.get::<f32>(At::default(), [0; 3]).unwrap().to_bits(), 0);
    let raw = EncodeOptions { codec: CodecChoice::Raw, ..EncodeOptions::default() };
    let volume = open(encode(&mut grid, &raw).0);
    assert_eq!(volume.read(At::default()).unwrap().bytes(), grid.bytes(), "lossless is every bit");
}

#[test] // peers' failures: zfp, SZ3, SPERR and NanoVDB lose at least one of these
fn hard_floats_keep_their_bound() {
    let e = Extent::cube(32);
    let base = |c| hash(c) as f32 / u32::MAX as f32;
    type Case = (&'static str, Box<dyn Fn([u32; 3]) -> f32>);
    let cases: [Case; 8] = [
        ("subnormal", Box::new(move |c| base(c) * 1e-40)),
        ("tiny normal", Box::new(move |c| (base(c) - 0.5) * 1e-31)),
        ("full range", Box::new(move |c| (base(c) - 0.5) * 2.0 * 3.3e38)),
        ("one outlier", Box::new(move |c| if c == [5, 6, 7] { 1e30 } else { base(c) })),
        ("constant pi", Box::new(|_| std::f32::consts::PI)),
        ("signed zeros", Box::new(move |c| if base(c) < 0.5 { -0.0 } else { 0.0 })),
        ("one step", Box::new(move |c| if base(c) < 0.5 { 1.0 } else { 1.0f32.next_up() })),
        ("large and close", Box::new(move |c| 1.5e6 + base(c))),
    ];
    for (name, f) in cases {
        let mut grid = Grid::from_fn(e, &f).unwrap();
        let (lo, hi) = grid.range().unwrap();
        for percent in [1e-3, 0.1, 1.0, 10.0] {
            let bound = percent / 100.0 * (hi - lo);
            let (_, error) = checked(&mut grid, &with(Quality::MaxError(Bound::Percent(percent))));
            assert!(error <= bound, "{name}: {error} > {bound}");
        }
        for (bits, block) in [(1, 2), (4, 4), (8, 32)] {
            let (volume, error) = checked(&mut grid, &explicit(bits, block));
            let decoded = volume.read(At::default()).unwrap();
            assert!(decoded.samples::<f32>().iter().all(|v| v.is_finite()), "{name}");
            let q = f64::from((1u32 << bits) - 1);
            // Half a step of the largest block, and the two roundings to f32.
            let slack = f64::from(f32::EPSILON) * lo.abs().max(hi.abs()) + 1e-45;
            assert!(error <= (hi - lo) / (2.0 * q) * (1.0 + 1e-12) + slack, "{name}: {error}");
        }
    }
}

#[test] // K-25: one outlier costs its block, and only its block
fn an_outlier_stays_in_its_block() {
    let e = Extent::cube(128);
    let mut grid = Grid::from_fn(e, |c| if c == [64, 64, 64] { 60_000u16 } else { (hash(c) % 16) as u16 }).unwrap();
    let (_, error) = checked(&mut grid, &explicit(4, 4));
    let (_, wide) = checked(&mut grid, &explicit(4, 128));
    assert!(error <= 2000.0 && wide <= 2000.0, "R / 2q");
    let volume = open(encode(&mut grid, &explicit(4, 4)).0);
    let decoded = volume.read(At::default()).unwrap();
    let off = grid.samples::<u16>().iter().zip(decoded.samples::<u16>()).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    assert!(off <= 64, "{off} voxels are off");
}

#[test] // S-39: levels of detail carry the bounds of everything below them
fn levels_have_their_own_source_and_joined_bounds() {
    let e = Extent::new(100, 50, 70);
    let mut grid = support::noise(e, |h| (h >> 18) as u16);
    let options = EncodeOptions { levels: 0, brick: Some(16), ..explicit(4, 4) };
    let (volume, _) = checked(&mut grid, &options);
    assert_eq!(volume.info().lod_count, 4);
    let top = At::lod(3);
    assert_eq!(volume.read(top).unwrap().extent(), Extent::new(13, 7, 9));
    let all = volume.bounds(top, vug::Region::whole(Extent::new(13, 7, 9))).unwrap();
    for lod in 0..4 {
        let (lo, hi) = volume.read(At::lod(lod)).unwrap().range().unwrap();
        assert!(f64::from(all.min) <= lo && f64::from(all.max) >= hi, "level {lod}");
    }
    assert!(f64::from(all.max_error.unwrap()) >= volume.info().achieved.unwrap().max_error);
    // Too many levels is an error, not a file with nothing in it.
    let mut file = std::io::Cursor::new(Vec::new());
    let five = EncodeOptions { levels: 5, ..options };
    assert_eq!(vug::volume::encode(&mut grid, &mut file, &five, &mut |_, _| {}).unwrap_err().field(), "levels");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn a_bound_holds_for_any_volume(
        dims in (1u32..40, 1u32..40, 1u32..40),
        kind in 0..4,
        spread in 1u32..31,
        percent in prop_oneof![Just(0.0), 0.0..100.0f64],
        fitted in any::<bool>(),
    ) {
        let e = Extent::new(dims.0, dims.1, dims.2);
        let mut grid = match kind {
            0 => support::noise(e, |h| (h >> spread) as u8),
            1 => support::noise(e, |h| (h >> spread) as u16),
            2 => support::noise(e, |h| (h >> spread) as i16),
            _ => support::noise(e, |h| (h >> spread) as f32 * 1e-3 - 7.0),
        };
        let (lo, hi) = grid.range().unwrap();
        let bound = percent / 100.0 * (hi - lo);
        let endpoints = if fitted { Endpoints::Fitted } else { Endpoints::MinMax };
        let options = EncodeOptions { endpoints, ..with(Quality::MaxError(Bound::Percent(percent))) };
        let (_, error) = checked(&mut grid, &options);
        prop_assert!(error <= bound, "{error} > {bound}");
    }
}
