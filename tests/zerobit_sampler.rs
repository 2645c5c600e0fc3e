//! Single voxels, batches, planes and cells through a sampler are those of a whole read (§3.3.2 of the paper).

use proptest::prelude::*;
use std::io::Cursor;
use vug::codec::zerobit::Stream;
use vug::geometry::Extent;
use vug::grid::Grid;
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{self, At, Axis, CodecChoice, EncodeOptions, Quality, Volume, ZerobitOptions};
use vug::voxel::Sample;

fn noise(seed: u64, i: u64) -> u64 {
    let mut v = (seed ^ i.wrapping_mul(0x9E37_79B9_7F4A_7C15)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    v ^= v >> 29;
    v.wrapping_mul(0x94D0_49BB_1331_11EB) >> 32
}

fn written(grid: &mut Grid, options: &EncodeOptions, cache_bytes: u64) -> Volume {
    let mut file = Cursor::new(Vec::new());
    volume::encode(grid, &mut file, options, &mut |_, _| {}).unwrap();
    Volume::open(MemorySource(file.into_inner()), Limits { cache_bytes, ..Limits::default() }).unwrap()
}

/// Compares every way with a whole read.
fn check<T: Sample>(volume: &Volume, seed: u64) {
    let whole = volume.read(At::default()).unwrap();
    let extent = whole.extent();
    let at = |c: [u32; 3]| whole.samples::<T>()[extent.index(c) as usize];
    let coords: Vec<[u32; 3]> = (0..200)
        .map(|i| {
            let v = |k: u64, n: u32| noise(seed, 3 * i + k) as u32 % n;
            [v(0, extent.x), v(1, extent.y), v(2, extent.z)]
        })
        .collect();
    let sampler = volume.sampler::<T>(At::default()).unwrap();
    let mut batch = vec![at([0; 3]); coords.len()];
    for _ in 0..2 {
        sampler.get_many(&coords, &mut batch).unwrap();
        for (&c, &v) in coords.iter().zip(&batch) {
            assert_eq!(v, at(c), "batch, {c:?}");
            assert_eq!(sampler.get(c).unwrap(), at(c), "{c:?}");
            assert_eq!(volume.get::<T>(At::default(), c).unwrap(), at(c), "one, {c:?}");
            let first = c.map(|v| v & !3);
            let mut cell = [at([0; 3]); 64];
            sampler.cell(c, &mut cell).unwrap();
            for (k, &v) in (0u32..).zip(&cell) {
                let c = [first[0] + (k & 3), first[1] + (k >> 2 & 3), first[2] + (k >> 4)];
                assert!(!extent.contains(c) || v == at(c), "cell, {c:?}");
            }
            for axis in [Axis::X, Axis::Y, Axis::Z] {
                let mut plane = [at([0; 3]); 16];
                sampler.plane(axis, c, &mut plane).unwrap();
                for (k, &v) in (0u32..).zip(&plane) {
                    let mut p = c;
                    for (a, step) in (0..3).filter(|&a| a != axis as usize).zip([k & 3, k >> 2]) {
                        p[a] = first[a] + step;
                    }
                    assert!(!extent.contains(p) || v == at(p), "plane across {axis:?}, {p:?}");
                }
            }
        }
    }
    let outside = [extent.x, 0, 0];
    assert!(sampler.get(outside).is_err() && sampler.get_many(&[outside], &mut batch[..1]).is_err());
    assert!(sampler.cell(outside, &mut [at([0; 3]); 64]).is_err());
    assert!(sampler.plane(Axis::Z, outside, &mut [at([0; 3]); 16]).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test] // spec: ZBT-26; K-38
    fn every_way_gives_the_same_voxels(
        dims in [1..70u32, 1..40u32, 1..40u32],
        (seed, keep) in (any::<u64>(), 1_000..300_000u32),
        (zstd, old, small_cache, codec) in (any::<bool>(), any::<bool>(), any::<bool>(), 0..3u32),
    ) {
        let extent = Extent::from(dims);
        let options = EncodeOptions {
            codec: [CodecChoice::Zerobit, CodecChoice::Zerobit, CodecChoice::Raw][codec as usize],
            quality: if codec == 2 { EncodeOptions::default().quality } else { Quality::Keep(keep) },
            zerobit: ZerobitOptions { stream: if old { Stream::Old } else { Stream::New }, ..ZerobitOptions::default() },
            zstd,
            brick: Some(16),
            ..EncodeOptions::default()
        };
        let cache = if small_cache { 3000 } else { 1 << 24 };
        let soft = |c: [u32; 3], k: u64| {
            let body = c[0] / 9 % 3 != 1; // bricks with nothing in them, too
            if body { (c[0] * 3 + c[1] * 5 + c[2] * 2) % 200 + (noise(seed, k + u64::from(c[0] * c[1])) % 40) as u32 } else { 0 }
        };
        let mut colours = Grid::from_fn(extent, |c| [0, 1, 2].map(|k| soft(c, k) as u8)).unwrap();
        check::<[u8; 3]>(&written(&mut colours, &options, cache), seed);
        let mut grey = Grid::from_fn(extent, |c| soft(c, 7) as u16 * 200).unwrap();
        check::<u16>(&written(&mut grey, &options, cache), seed);
    }
}
