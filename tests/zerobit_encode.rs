//! Whole files of codec zerobit: one input, one file; every way of reading; what the report and the file say.

mod support;
mod zerobit_coding;

use proptest::prelude::*;
use std::io::Cursor;
use support::{ball, encode, hash, noise, open, verify};
use vug::codec::zerobit::{KEEP_ALL, Norm, Stream, Threshold, Training};
use vug::grid::SlabReader;
use vug::metrics::error_stats;
use vug::volume::{
    At, Axis, CodecChoice, EncodeOptions, EncodeReport, Quality, Shape, Volume, VolumeWriter, ZerobitOptions,
};
use vug::{Code, Extent, Grid, Region, SampleType};

fn keep(ppm: u32) -> EncodeOptions {
    EncodeOptions { codec: CodecChoice::Zerobit, quality: Quality::Keep(ppm), ..EncodeOptions::default() }
}

fn colours(e: Extent) -> Grid {
    Grid::from_fn(e, |c| {
        let (v, h) = (support::ball_at(e, c), hash(c));
        if v == 0 { [0; 3] } else { [v, (c[1] * 3) as u8 ^ (h as u8 & 15), 255 - v] }
    })
    .unwrap()
}

/// Encodes; the file is valid, and what the report says is what was measured.
fn checked(grid: &mut Grid, options: &EncodeOptions) -> (Vec<u8>, Volume, EncodeReport) {
    let (bytes, report) = encode(grid, options);
    let errors = verify(&bytes);
    assert!(errors.is_empty(), "{} {options:?}: {errors:?}", grid.extent());
    let volume = open(bytes.clone());
    let found = error_stats(&grid.view(), &volume.read(At::default()).unwrap().view()).unwrap();
    assert_eq!(found.max_abs, report.max_error, "the report is measured");
    assert!((found.rmse() - report.rmse).abs() <= 1e-9 * report.rmse);
    assert_eq!((report.codec, report.bytes), ("zerobit", bytes.len() as u64));
    assert_eq!(report.codebooks, volume.codebooks().unwrap().len() as u64);
    (bytes, volume, report)
}

struct Slabs(Grid);
impl SlabReader for Slabs {
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

#[test] // K-28, C-16: threads, and how the source is read, do not change a byte
fn one_input_one_file() {
    let e = Extent::new(150, 70, 90);
    let with = |zerobit| EncodeOptions { zerobit, levels: 0, brick: Some(32), ..keep(20_000) };
    let usual = ZerobitOptions::default();
    for options in [
        with(ZerobitOptions { codebook_region: Some(2), ..usual }),
        with(ZerobitOptions { threshold: Threshold::Global, training: Training::Refined, ..usual }),
        with(ZerobitOptions { stream: Stream::Old, norm: Norm::Plain, codebook_region: Some(1), ..usual }),
        EncodeOptions { quality: Quality::Psnr(30.0), ..with(usual) },
    ] {
        let expected = encode(&mut colours(e), &options).0;
        assert!(verify(&expected).is_empty());
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                assert!(encode(&mut colours(e), &options).0 == expected, "{threads} threads");
                let mut file = Cursor::new(Vec::new());
                vug::volume::encode(&mut Slabs(colours(e)), &mut file, &options, &mut |_, _| {}).unwrap();
                assert!(file.into_inner() == expected, "{threads} threads, slab by slab");
            });
        }
    }
}

#[test] // spec: ZBT-9, ZBT-10, ZBT-34: regions of bricks that share a codebook
fn codebooks_of_regions() {
    let e = Extent::new(150, 70, 90);
    // 5 × 3 × 3 bricks, levels of 3 × 2 × 2, 2 × 1 × 1, 1.
    for (region, books) in [(None, 4), (Some(1), 45 + 12 + 2 + 1), (Some(2), 12 + 2 + 1 + 1), (Some(3), 2 + 1 + 1 + 1)]
    {
        let zerobit = ZerobitOptions { codebook_region: region, ..ZerobitOptions::default() };
        let options = EncodeOptions { zerobit, levels: 0, brick: Some(32), ..keep(50_000) };
        let mut grid = noise(e, |h| [h as u8, (h >> 8) as u8, (h >> 16) as u8]);
        let (_, volume, report) = checked(&mut grid, &options);
        assert_eq!((volume.info().lod_count, report.codebooks), (4, books), "{region:?}");
        for lod in 0..4 {
            volume.read(At::lod(lod)).unwrap();
        }
    }
    // More codebooks than a file may have: a reason, and what to do.
    let zerobit = ZerobitOptions { codebook_region: Some(1), ..ZerobitOptions::default() };
    let options = EncodeOptions { zerobit, brick: Some(16), ..keep(50_000) };
    let mut grid = Grid::from_fn(Extent::new(16 * 17, 256, 256), |c| c[0] as u8).unwrap();
    let error = vug::volume::encode(&mut grid, Cursor::new(Vec::new()), &options, &mut |_, _| {}).unwrap_err();
    assert_eq!((error.code(), error.field()), (Code::Param, "codebook-region"));
    // A file without a codebook has no section for them.
    let (_, volume, report) = checked(&mut noise(Extent::cube(40), |_| 9u8), &keep(50_000));
    assert_eq!((report.codebooks, report.bricks), (0, [0, 1, 0]));
    assert!(volume.head().section(*b"CBOK").is_none());
}

#[test] // spec: ZBT-10: brick by brick each has its own codebook
fn bricks_one_by_one() {
    let grid = colours(Extent::new(100, 64, 64));
    let e = grid.extent();
    let params = vug::codec::zerobit::Params::new(80_000).unwrap();
    let null = vug::voxel::SampleValue::Rgb8([0; 3]);
    let codec = vug::codec::Codec::Zerobit(vug::codec::zerobit::Zerobit::new(Stream::New, params, null));
    let shape = Shape::single(e, SampleType::Rgb8);
    let mut writer = VolumeWriter::create(Cursor::new(Vec::new()), shape, codec, 6, &keep(80_000)).unwrap();
    for (brick, region) in
        [([1, 0, 0], Region { start: [64, 0, 0], end: [100, 64, 64] }), ([0; 3], Region::at([0; 3], Extent::cube(64)))]
    {
        writer.write_brick(At::default(), brick, grid.view().sub(&region)).unwrap();
    }
    let (file, report) = writer.finish().unwrap();
    assert_eq!(report.codebooks, 2);
    let bytes = file.into_inner();
    assert!(verify(&bytes).is_empty());
    let back = open(bytes).read(At::default()).unwrap();
    assert_eq!(error_stats(&grid.view(), &back.view()).unwrap().max_abs, report.max_error);
}

/// Every way of reading gives the same.
fn read_every_way(volume: &Volume, lod: u8) {
    let at = At::lod(lod);
    let whole = volume.read(at).unwrap();
    let e = whole.extent();
    let same = |region: Region, part: &Grid| {
        assert_eq!(part.extent(), region.extent());
        let size = e.voxels() / 3000 + 1;
        for i in (0..region.extent().voxels()).step_by(size as usize) {
            let p = region.extent();
            let c = [i % u64::from(p.x), i / u64::from(p.x) % u64::from(p.y), i / u64::from(p.x) / u64::from(p.y)]
                .map(|v| v as u32);
            let there = std::array::from_fn(|a| c[a] + region.start[a]);
            assert_eq!(part.value(c).unwrap(), whole.value(there).unwrap(), "{region:?}");
        }
    };
    let all = Region::whole(e);
    let [x, y, z] = e.to_array();
    for i in 0..e.voxels().min(400) {
        let h = hash([i as u32, 7, lod.into()]);
        let c = [h % x, (h >> 9) % y, (h >> 18) % z];
        assert_eq!(volume.voxel(at, c).unwrap(), whole.value(c).unwrap(), "{c:?}");
    }
    for (axis, n) in [(Axis::X, x), (Axis::Y, y), (Axis::Z, z)] {
        for i in [0, n / 2, n - 1] {
            let mut region = all;
            (region.start[axis as usize], region.end[axis as usize]) = (i, i + 1);
            same(region, &volume.plane(at, axis, i).unwrap());
        }
    }
    let bricks = e.div_ceil(Extent::cube(1 << volume.info().brick_log2));
    let last = [bricks.x - 1, bricks.y - 1, bricks.z - 1];
    let start = last.map(|v| v << volume.info().brick_log2);
    same(Region { start, end: e.to_array() }, &volume.read_brick(at, last).unwrap());
    let odd = Region { start: [x / 3, y / 5, z / 2], end: [x - x / 4, y, z / 2 + 1] };
    same(odd, &volume.read_region(at, odd).unwrap());
    let beyond = volume.voxel(at, [x - 1, y, z - 1]).unwrap_err();
    assert_eq!(beyond.code(), Code::Range, "no voxel lies in the padding");
}

#[test] // regions that begin and end anywhere, over one to five bricks side by side
fn regions_across_bricks() {
    let e = Extent::new(75, 9, 6);
    let at = At::default();
    for mut grid in [noise(e, |h| h as u8), noise(e, |h| (h >> 8) as u16), colours(e)] {
        let volume = checked(&mut grid, &EncodeOptions { brick: Some(16), zstd: false, ..keep(400_000) }).1;
        let whole = volume.read(at).unwrap();
        for x0 in 0..20 {
            for x1 in [x0 + 1, x0 + 6, 33, 49, 64, 75].into_iter().filter(|&x1| x1 > x0) {
                let region = Region { start: [x0, x0 % 5, 1], end: [x1, 9, 6] };
                let part = volume.read_region(at, region).unwrap();
                for x in 0..x1 - x0 {
                    let expected = whole.value([x0 + x, 8, 5]).unwrap();
                    assert_eq!(part.value([x, 8 - x0 % 5, 4]).unwrap(), expected, "{region:?}, {x}");
                }
            }
        }
    }
}

#[test] // K-50, K-48, K-49: sizes, types, null values; spec: ZBT-12, ZBT-26
fn sizes_types_and_null_values() {
    for dims in [[1, 1, 1], [17, 16, 16], [16, 16, 225], [5, 1, 66], [65, 3, 17]] {
        let e = Extent::from(dims);
        for ppm in [30_000, KEEP_ALL] {
            let mut grids = [
                (noise(e, |h| (h >> 9) as u8), 0.0),
                (noise(e, |h| (h >> 9) as u16), 65_535.0),
                (noise(e, |h| if h % 3 == 0 { -1024 } else { (h >> 16) as u16 as i16 }), -1024.0),
                (noise(e, |h| [h as u8, (h >> 9) as u8, 3]), 255.0),
            ];
            for (grid, null_value) in &mut grids {
                let options = EncodeOptions { null_value: *null_value, brick: Some(16), levels: 0, ..keep(ppm) };
                let (_, volume, report) = checked(grid, &options);
                let exact = ppm == KEEP_ALL && grid.sample_type() == SampleType::U8;
                assert!(!exact || report.max_error <= 7.0, "{e}: {}", report.max_error);
                (0..volume.info().lod_count).for_each(|lod| read_every_way(&volume, lod));
            }
        }
    }
    // f32 is refused before anything is written, in words that help.
    let mut grid = noise(Extent::cube(9), |h| h as f32);
    let error = vug::volume::encode(&mut grid, Cursor::new(Vec::new()), &keep(9), &mut |_, _| {}).unwrap_err();
    assert_eq!(error.code(), Code::Param);
    println!("{error}");
}

#[test] // K-56; spec: ZBT-8: never longer than the bound and the codebooks
fn noise_within_the_bound() {
    let e = Extent::cube(64);
    let mut grid = noise(e, |h| [h as u8, (h >> 8) as u8, (h >> 16) as u8]);
    for (stream, unit) in [(Stream::New, 5_004), (Stream::Old, 4_748)] {
        let zerobit = ZerobitOptions { stream, ..ZerobitOptions::default() };
        let (bytes, volume, _) = checked(&mut grid, &EncodeOptions { zerobit, zstd: false, ..keep(KEEP_ALL) });
        let book = 8 + 3 * 512;
        assert!(volume.info().payload_bytes <= 64 * unit + 16);
        assert!(bytes.len() <= 64 * unit as usize + 16 + book + 8192 + 4096, "{} bytes", bytes.len());
        assert!(volume.info().payload_bytes as usize > 3 * 64 * 64 * 64 / 3);
    }
}

#[test] // spec: ZBT-26: a brick of which nothing is kept is stored without anything, or as the null value
fn nothing_kept() {
    let (_, volume, report) = checked(&mut ball(Extent::new(70, 40, 40)), &keep(0));
    assert_eq!(report.bricks, [1, 0, 1]);
    assert!(volume.codebooks().unwrap().iter().all(|b| b.averages().is_empty() && b.details().is_empty()));
    assert!(volume.read(At::default()).unwrap().bytes().iter().all(|&b| b == 0));
}

/// Any small volume of any type: dims, spread of values, background.
fn any_grid() -> impl Strategy<Value = (Grid, f64)> {
    let dims = (1u32..40, 1u32..40, 1u32..40);
    (dims, 0u32..4, any::<u32>(), 1u32..17, 0u32..5).prop_map(|((x, y, z), t, seed, bits, background)| {
        let e = Extent::new(x, y, z);
        let value = move |c: [u32; 3]| {
            let h = hash(std::array::from_fn(|a| c[a] ^ seed));
            let empty = c[0] / 8 + c[1] / 8 + c[2] / 8 < 3 * background;
            (!empty).then_some(h >> 7 & ((1 << bits) - 1))
        };
        match t {
            0 => (Grid::from_fn(e, |c| value(c).unwrap_or(3) as u8).unwrap(), 3.0),
            1 => (Grid::from_fn(e, |c| value(c).unwrap_or(500) as u16).unwrap(), 500.0),
            2 => (Grid::from_fn(e, |c| value(c).unwrap_or(0) as u16 as i16).unwrap(), 0.0),
            _ => {
                (Grid::from_fn(e, |c| value(c).map_or([0; 3], |v| [v as u8, (v >> 4) as u8, c[0] as u8])).unwrap(), 0.0)
            }
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test] // spec: ZBT-12, ZBT-33
    fn any_volume_comes_back((mut grid, null_value) in any_grid(), ppm in prop_oneof![0..=KEEP_ALL, 0..60_000u32, Just(KEEP_ALL)],
        flags in 0u32..16, region in prop_oneof![Just(None), (1u32..3).prop_map(Some)], zstd in any::<bool>(),
    ) {
        let zerobit = ZerobitOptions {
            stream: if flags & 1 == 0 { Stream::New } else { Stream::Old },
            threshold: if flags & 2 == 0 { Threshold::Adaptive } else { Threshold::Global },
            norm: if flags & 4 == 0 { Norm::Energy } else { Norm::Plain },
            training: if flags & 8 == 0 { Training::MedianCut } else { Training::Refined },
            codebook_region: region,
        };
        let options = EncodeOptions { zerobit, null_value, zstd, levels: 0, brick: Some(16), ..keep(ppm) };
        let (bytes, volume, _) = checked(&mut grid, &options);
        for lod in 0..volume.info().lod_count {
            read_every_way(&volume, lod);
        }
        prop_assert_eq!(volume.info().codecs[0].stream_version, zerobit.stream as u16);
        // The other stream decodes to the same voxels (K-57).
        let stream = if flags & 1 == 0 { Stream::Old } else { Stream::New };
        let other = encode(&mut grid, &EncodeOptions { zerobit: ZerobitOptions { stream, ..zerobit }, ..options }).0;
        prop_assert!(verify(&other).is_empty() && other != bytes || volume.codebooks().unwrap().is_empty());
        let (own, other) = (volume.read(At::default()).unwrap(), open(other).read(At::default()).unwrap());
        prop_assert!(own.bytes() == other.bytes());
    }
}
