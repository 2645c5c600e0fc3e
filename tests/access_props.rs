//! Random volumes, random settings, random places: every way of reading gives the voxels of the whole.

mod support;

use proptest::prelude::*;
use support::{encode, hash, open, verify};
use vug::codec::s3dc::Endpoints;
use vug::limits::Limits;
use vug::source::{ByteSource, MemorySource};
use vug::volume::{At, Axis, CodecChoice, EncodeOptions, Quality, Volume};
use vug::voxel::Sample;
use vug::{Extent, Grid, Region, SampleType};

/// A source that cannot lend its bytes, as a network cannot.
struct Remote(Vec<u8>);

impl ByteSource for Remote {
    fn len(&self) -> u64 {
        self.0.len() as u64
    }
    fn read_at(&self, offset: u64, out: &mut [u8]) -> vug::Result<()> {
        MemorySource(&self.0[..]).read_at(offset, out)
    }
}

#[derive(Clone, Debug)]
struct Case {
    extent: Extent,
    sample_type: SampleType,
    options: EncodeOptions,
    /// How many of 8 bricks are empty, constant, ramps; the rest is noise.
    mix: [u32; 3],
    seed: u32,
}

fn cases() -> impl Strategy<Value = Case> {
    let types = [SampleType::U8, SampleType::U16, SampleType::I16, SampleType::F32, SampleType::Rgb8];
    let block = prop_oneof![
        (1u32..=16).prop_map(Extent::cube),
        prop::sample::select(vec![2, 4, 8, 16, 32]).prop_map(Extent::cube),
        (1u32..=16, 1u32..=16, 1u32..=16).prop_map(|(x, y, z)| Extent::new(x, y, z)),
    ];
    (
        (1u32..90, 1u32..70, 1u32..60),
        prop::sample::select(types.to_vec()),
        (prop::sample::select(vec![1u8, 2, 4, 8]), block, prop::sample::select(vec![16u32, 32, 64])),
        (any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>()),
        ([0u32..4, 0..3, 0..3], any::<u32>()),
    )
        .prop_map(
            |(dims, sample_type, (index_bits, block, brick), (zstd, fitted, raw, all_levels), (mix, seed))| {
                let raw = raw || sample_type == SampleType::Rgb8;
                let options = EncodeOptions {
                    codec: if raw { CodecChoice::Raw } else { CodecChoice::S3dc },
                    quality: Quality::Explicit { index_bits, block },
                    endpoints: if fitted { Endpoints::Fitted } else { Endpoints::MinMax },
                    brick: Some(brick.max(block.x)),
                    zstd,
                    levels: u8::from(!all_levels),
                    ..EncodeOptions::default()
                };
                Case { extent: Extent::new(dims.0, dims.1, dims.2), sample_type, options, mix, seed }
            },
        )
}

impl Case {
    fn grid(&self) -> Grid {
        fn fill<T: Sample>(case: &Case, f: impl Fn(u32) -> T) -> Grid {
            Grid::from_fn(case.extent, |c| f(case.number(c))).unwrap()
        }
        match self.sample_type {
            SampleType::U8 => fill(self, |n| (n >> 8) as u8),
            SampleType::U16 => fill(self, |n| n as u16),
            SampleType::I16 => fill(self, |n| n as u16 as i16),
            SampleType::F32 => fill(self, |n| n as f32 * 0.37),
            SampleType::Rgb8 => fill(self, |n| [n as u8, (n >> 4) as u8, (n >> 8) as u8]),
        }
    }

    /// 16 bits for a voxel: 0, constant, a ramp or noise, by the 16³ cell it lies in.
    fn number(&self, c: [u32; 3]) -> u32 {
        let kind = (hash(c.map(|v| v / 16)) ^ self.seed) % 8;
        let [empty, constant, ramp] = self.mix;
        match kind {
            k if k < empty => 0,
            k if k < empty + constant => 4711,
            k if k < empty + constant + ramp => (c[0] + 3 * c[1] + 7 * c[2]) * 40,
            _ => hash(c.map(|v| v ^ self.seed)) & 0xFFFF,
        }
    }
}

/// The dense bytes of a part of a grid.
fn cut(whole: &Grid, region: &Region) -> Vec<u8> {
    let (e, size) = (whole.extent(), whole.sample_type().bytes());
    let mut out = Vec::new();
    for z in region.start[2]..region.end[2] {
        for y in region.start[1]..region.end[1] {
            let row = e.index([region.start[0], y, z]) as usize * size;
            out.extend_from_slice(&whole.bytes()[row..row + region.extent().x as usize * size]);
        }
    }
    out
}

fn place(seed: u32, n: u32, e: Extent) -> [u32; 3] {
    [hash([seed, n, 1]) % e.x, hash([seed, n, 2]) % e.y, hash([seed, n, 3]) % e.z]
}

fn box_at(seed: u32, n: u32, e: Extent) -> Region {
    let (a, b) = (place(seed, 2 * n, e), place(seed, 2 * n + 1, e));
    Region { start: std::array::from_fn(|i| a[i].min(b[i])), end: std::array::from_fn(|i| a[i].max(b[i]) + 1) }
}

fn all_ways_agree<T: Sample + PartialEq + std::fmt::Debug>(volume: &Volume, at: At, whole: &Grid, seed: u32) {
    let e = whole.extent();
    let sample = |c: [u32; 3]| whole.samples::<T>()[e.index(c) as usize];
    let coords: Vec<_> = (0..150).map(|n| place(seed, n, e)).collect();
    let expected: Vec<T> = coords.iter().map(|&c| sample(c)).collect();
    let sampler = volume.sampler::<T>(at).unwrap();
    for n in 0..4 {
        let region = box_at(seed ^ 7, n, e);
        assert_eq!(volume.read_region(at, region).unwrap().bytes(), cut(whole, &region), "{region:?}");
        let axis = [Axis::X, Axis::Y, Axis::Z][n as usize % 3];
        let index = coords[n as usize][axis as usize];
        let mut slab = Region::whole(e);
        (slab.start[axis as usize], slab.end[axis as usize]) = (index, index + 1);
        assert_eq!(volume.plane(at, axis, index).unwrap().bytes(), cut(whole, &slab), "{axis:?} {index}");
        let (region, block) = volume.block(at, coords[n as usize]).unwrap();
        assert!((0..3).all(|a| (region.start[a]..region.end[a]).contains(&coords[n as usize][a])), "{region:?}");
        assert_eq!(block.bytes(), cut(whole, &region));
        let brick = coords[n as usize].map(|v| v >> volume.info().brick_log2);
        let start = brick.map(|v| v << volume.info().brick_log2);
        let region = Region::at(start, Extent::cube(1 << volume.info().brick_log2)).intersect(&Region::whole(e));
        assert_eq!(volume.read_brick(at, brick).unwrap().bytes(), cut(whole, &region));
        let bounds = volume.bounds(at, region).unwrap();
        let part = volume.read_region(at, region).unwrap().range().unwrap();
        assert!(f64::from(bounds.min) <= part.0 && part.1 <= f64::from(bounds.max), "{bounds:?} {part:?}");
    }
    // Twice: what is learnt the first time is a shortcut the second time.
    for _ in 0..2 {
        let mut many = vec![sample([0; 3]); coords.len()];
        volume.voxels(at, &coords, &mut many).unwrap();
        assert_eq!(many, expected);
        for (&c, &v) in coords.iter().zip(&expected) {
            assert_eq!((sampler.get(c).unwrap(), volume.get::<T>(at, c).unwrap()), (v, v), "{c:?}");
        }
        let mut many = vec![sample([0; 3]); coords.len()];
        sampler.get_many(&coords, &mut many).unwrap();
        assert_eq!(many, expected);
    }
    for &c in coords.iter().step_by(11) {
        assert_eq!(volume.voxel(at, c).unwrap(), whole.value(c).unwrap());
    }
}

fn typed(volume: &Volume, at: At, whole: &Grid, seed: u32) {
    match whole.sample_type() {
        SampleType::U8 => all_ways_agree::<u8>(volume, at, whole, seed),
        SampleType::U16 => all_ways_agree::<u16>(volume, at, whole, seed),
        SampleType::I16 => all_ways_agree::<i16>(volume, at, whole, seed),
        SampleType::F32 => all_ways_agree::<f32>(volume, at, whole, seed),
        SampleType::Rgb8 => all_ways_agree::<[u8; 3]>(volume, at, whole, seed),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test] // S-38, S-10, S-02
    fn every_way_of_reading_gives_the_same_voxels(case in cases()) {
        let mut grid = case.grid();
        let (bytes, report) = encode(&mut grid, &case.options);
        let errors = verify(&bytes);
        prop_assert!(errors.is_empty(), "{:?}", errors);
        let whole = open(bytes.clone()).read(At::default()).unwrap();
        if report.codec == "raw" {
            prop_assert_eq!(whole.bytes(), grid.bytes());
        }
        let lods = open(bytes.clone()).info().lod_count;
        for lod in 0..lods.min(3) {
            let at = At::lod(lod);
            let whole = open(bytes.clone()).read(at).unwrap();
            // Fresh volumes, so that no access profits from what another one has brought; small caches, too.
            let small = Limits { cache_bytes: 1 << 14, ..Limits::default() };
            for volume in [
                open(bytes.clone()),
                Volume::open(Remote(bytes.clone()), Limits::default()).unwrap(),
                Volume::open(Remote(bytes.clone()), small).unwrap(),
            ] {
                typed(&volume, at, &whole, case.seed);
            }
        }
    }
}
