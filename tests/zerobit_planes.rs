//! The cache of 4×4 planes: the same voxels as without it, and as many planes decoded as it takes (Z-42).

mod support;

use proptest::prelude::*;
use support::{encode, hash, open};
use vug::volume::{At, Axis, CodecChoice, EncodeOptions, PlaneSampler, Quality, Volume};
use vug::voxel::Sample;
use vug::{Extent, Grid};

fn volume<T: Sample>(extent: Extent, codec: CodecChoice, zstd: bool, f: impl Fn(u32) -> T) -> Volume {
    // Soft, with bricks and cells that are empty.
    let value = |c: [u32; 3]| {
        if hash(c.map(|v| v / 7)).is_multiple_of(4) { 0 } else { (c[0] + 2 * c[1] + 3 * c[2]) % 200 + hash(c) % 20 }
    };
    let mut grid = Grid::from_fn(extent, |c| f(value(c))).unwrap();
    let quality = match codec {
        CodecChoice::Zerobit => Quality::Keep(60_000),
        _ => EncodeOptions::default().quality,
    };
    let options = EncodeOptions { codec, quality, brick: Some(16), zstd, levels: 1, ..EncodeOptions::default() };
    open(encode(&mut grid, &options).0)
}

/// Random voxels with neighbours, some of them outside, with and without the cache.
fn check<T: Sample>(volume: &Volume, seed: u32, planes: usize) {
    let extent = volume.info().dims;
    let plain = volume.sampler::<T>(At::default()).unwrap();
    for axis in [Axis::X, Axis::Y, Axis::Z] {
        let mut cached = PlaneSampler::new(volume.sampler::<T>(At::default()).unwrap(), axis, planes);
        let mut inside = 0;
        for i in 0..2000 {
            let near = |a: u32| hash([seed, i / 20, a]) + hash([seed + i, a, 9]) % 4;
            let c = [near(0) % (extent.x + 1), near(1) % (extent.y + 1), near(2) % (extent.z + 1)];
            match plain.get(c) {
                Ok(value) => assert_eq!(cached.get(c).unwrap(), value, "{c:?} across {axis:?}"),
                Err(e) => assert_eq!(cached.get(c).unwrap_err().code(), e.code()),
            }
            inside += u64::from(extent.contains(c));
        }
        assert!(cached.hits() > 0 && cached.hits() + cached.misses() == 2000 && cached.hits() < 2000);
        assert!(inside > 1000);
        cached.clear();
        assert_eq!((cached.hits(), cached.misses()), (0, 0));
        assert_eq!(cached.get([0; 3]).unwrap(), plain.get([0; 3]).unwrap());
        assert_eq!((cached.hits(), cached.misses(), cached.axis()), (0, 1, axis));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test] // Z-42
    fn cached_planes_hold_the_same_voxels(
        dims in (20u32..60, 20u32..50, 20u32..40), zstd in any::<bool>(), seed in 0u32..1 << 20,
        planes in prop::sample::select(vec![0usize, 4, 64, 1024]), which in 0..7,
    ) {
        let extent = Extent::new(dims.0, dims.1, dims.2);
        let (zerobit, other) = (CodecChoice::Zerobit, CodecChoice::S3dc);
        match which {
            0 => check::<u8>(&volume(extent, zerobit, zstd, |v| v as u8), seed, planes),
            1 => check::<u16>(&volume(extent, zerobit, zstd, |v| 90 * v as u16), seed, planes),
            2 => check::<i16>(&volume(extent, zerobit, zstd, |v| 90 * v as i16 - 5000), seed, planes),
            3 => check::<[u8; 3]>(&volume(extent, zerobit, zstd, |v| [v as u8, 7, 255 - v as u8]), seed, planes),
            4 => check::<f32>(&volume(extent, other, zstd, |v| v as f32 / 3.0), seed, planes),
            5 => check::<u8>(&volume(extent, other, zstd, |v| v as u8), seed, planes),
            _ => check::<[u8; 3]>(&volume(extent, CodecChoice::Raw, zstd, |v| [v as u8; 3]), seed, planes),
        }
    }
}

#[test] // Z-42
fn simple_walks_decode_each_plane_once() {
    let volume = volume(Extent::cube(64), CodecChoice::Zerobit, false, |v| [v as u8, 1, 2]);
    for axis in [Axis::X, Axis::Y, Axis::Z] {
        let mut cached = volume.plane_sampler::<[u8; 3]>(At::default(), axis).unwrap();
        assert_eq!(cached.capacity(), 1024);
        let place = |a: u32, b: u32, depth: u32| match axis {
            Axis::X => [depth, a, b],
            Axis::Y => [a, depth, b],
            Axis::Z => [a, b, depth],
        };
        // Row by row: the planes of a row of cells, 16 of them, are there still when the next row of voxels comes.
        for b in 0..64 {
            for a in 0..64 {
                cached.get(place(a, b, 21)).unwrap();
            }
        }
        assert_eq!((cached.misses(), cached.hits()), (256, 64 * 64 - 256), "across {axis:?}");
        // Planes next to it are others.
        cached.get(place(0, 0, 22)).unwrap();
        assert_eq!(cached.misses(), 257);
        // A ray along the axis finds nothing twice.
        cached.clear();
        (0..64).for_each(|depth| _ = cached.get(place(5, 5, depth)).unwrap());
        assert_eq!((cached.misses(), cached.hits()), (64, 0));
    }
}
