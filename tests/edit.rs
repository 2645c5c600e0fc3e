//! Files made of other files: excerpts, other orders, with and without zstd. Payloads stay what they were.

mod support;

use std::io::Cursor;
use support::{ball, encode, explicit, hash, noise, open, verify};
use vug::codec::{Codec, s3dc};
use vug::limits::Limits;
use vug::source::{ByteSource, MemorySource};
use vug::volume::{
    At, BrickOrder, CodecChoice, CopyOptions, EncodeOptions, Quality, Shape, Volume, VolumeWriter, ZstdPolicy,
};
use vug::{Code, Extent, Grid, Region, SampleType};

fn copy(bytes: &[u8], options: &CopyOptions) -> Vec<u8> {
    let volume = open(bytes.to_vec());
    let excerpt = volume.excerpt(options).unwrap();
    let (out, report) = excerpt.write_head(Cursor::new(Vec::new()), &mut |_, _| {}).unwrap();
    let out = out.into_inner();
    assert_eq!(report.file.len, out.len() as u64);
    let errors = verify(&out);
    assert!(errors.is_empty(), "{options:?}: {errors:?}");
    out
}

/// Every voxel of every level and tree of the excerpt is that of the original.
fn assert_part(original: &[u8], options: &CopyOptions) -> Volume {
    let part = open(copy(original, options));
    let whole = open(original.to_vec());
    let excerpt = whole.excerpt(options).unwrap();
    let (levels, times, channels) = (excerpt.levels(), excerpt.times(), excerpt.channels());
    let (d, region) = (part.info(), excerpt.region());
    assert_eq!(d.dims, region.extent());
    assert_eq!(
        (d.lod_count, d.time_steps, d.channels),
        (levels.len() as u8, times.len() as u32, channels.len() as u32)
    );
    for lod in 0..d.lod_count {
        for time in 0..d.time_steps {
            for channel in 0..d.channels {
                let here = At { time, channel, lod };
                let there = At { time: times.start + time, channel: channels.start + channel, lod: levels.start + lod };
                let region =
                    Region { start: region.start.map(|v| v >> lod), end: region.end.map(|v| v.div_ceil(1 << lod)) };
                let found = part.read(here).unwrap();
                assert_eq!(found.bytes(), whole.read_region(there, region).unwrap().bytes(), "{options:?} {here:?}");
            }
        }
    }
    part
}

/// Levels, odd dims, EMPTY, CONSTANT and STORED bricks.
fn levels_of(options: EncodeOptions) -> Vec<u8> {
    let mut grid = ball(Extent::new(150, 93, 61));
    // A CONSTANT brick.
    let samples = grid.samples_mut::<u8>();
    for z in 0..16 {
        for y in 0..16 {
            for x in 0..16 {
                samples[x + 150 * (y + 93 * z)] = 9;
            }
        }
    }
    let options = EncodeOptions { brick: Some(16), levels: 4, meta: Some(r#"{"a":[1,2]}"#.into()), ..options };
    encode(&mut grid, &options).0
}

fn files() -> Vec<(&'static str, Vec<u8>)> {
    let raw = EncodeOptions { codec: CodecChoice::Raw, ..EncodeOptions::default() };
    let zerobit =
        EncodeOptions { codec: CodecChoice::Zerobit, quality: Quality::Keep(60_000), ..EncodeOptions::default() };
    vec![
        ("s3dc", levels_of(explicit(4, 4))),
        ("s3dc, no zstd", levels_of(EncodeOptions { zstd: false, ..explicit(2, 8) })),
        ("raw", levels_of(raw)),
        ("zerobit", levels_of(zerobit)),
        ("series", series()),
    ]
}

/// 5 time steps, 2 channels, 2 levels; some bricks of some trees are EMPTY or CONSTANT.
fn series() -> Vec<u8> {
    let extent = Extent::new(40, 35, 20);
    let shape = Shape { extent, sample_type: SampleType::U16, time_steps: 5, channels: 2 };
    let codec = Codec::S3dc(s3dc::Params::new(4, Extent::cube(4), Default::default()).unwrap());
    let options = EncodeOptions { levels: 2, ..EncodeOptions::default() };
    let mut writer = VolumeWriter::create(Cursor::new(Vec::new()), shape, codec, 4, &options).unwrap();
    for time in 0..5 {
        for channel in 0..2 {
            for lod in 0..2 {
                let e = extent.at_lod(lod);
                let bricks = e.div_ceil(Extent::cube(16));
                for (i, brick) in (0..bricks.z)
                    .flat_map(|z| (0..bricks.y).flat_map(move |y| (0..bricks.x).map(move |x| [x, y, z])))
                    .enumerate()
                {
                    let start = brick.map(|v| v * 16);
                    let size = Region::at(start, Extent::cube(16)).intersect(&Region::whole(e)).extent();
                    let seed = time * 10 + channel * 3 + u32::from(lod);
                    let grid = match (i as u32 + time) % 4 {
                        0 => continue,
                        1 => Grid::from_fn(size, |_| (seed + 1) as u16).unwrap(),
                        _ => noise(size, |h| (h >> 20) as u16 ^ (seed * 100) as u16),
                    };
                    writer.write_brick(At { time, channel, lod }, brick, grid.view()).unwrap();
                }
            }
        }
    }
    writer.finish().unwrap().0.into_inner()
}

#[test] // spec: HDR-7
fn packing_changes_nothing_but_the_order() {
    for (name, file) in files() {
        assert_eq!(copy(&file, &CopyOptions::default()), file, "{name}: a head file packed is the same file");
        let clustered = CopyOptions { order: BrickOrder::Clustered, ..CopyOptions::default() };
        let web = copy(&file, &clustered);
        assert!(open(web.clone()).head().superblock.clustered, "{name}");
        assert_eq!(copy(&web, &clustered), web, "{name}: twice");
        assert_eq!(copy(&web, &CopyOptions::default()), web, "{name}: the order of the file is kept");
        assert_part(&file, &clustered);
        assert_eq!(open(web.clone()).meta().unwrap(), open(file.clone()).meta().unwrap(), "{name}");
        assert_eq!(open(web).info(), open(file).info(), "{name}: achieved, ranges and all");
    }
}

#[test] // spec: BRK-8
fn zstd_comes_and_goes_and_payloads_stay() {
    for (name, file) in files() {
        let plain = copy(&file, &CopyOptions { zstd: ZstdPolicy::Inflate, ..CopyOptions::default() });
        let small = copy(&file, &CopyOptions { zstd: ZstdPolicy::Compress, ..CopyOptions::default() });
        assert_eq!(open(plain.clone()).brick_counts().unwrap().zstd, 0, "{name}");
        assert!(open(small.clone()).brick_counts().unwrap().zstd > 0, "{name}");
        assert!(small.len() < plain.len(), "{name}");
        // The same encoder compresses the same bytes to the same frames: there and back is where we were.
        assert_eq!(copy(&small, &CopyOptions { zstd: ZstdPolicy::Inflate, ..CopyOptions::default() }), plain, "{name}");
        assert_eq!(
            copy(&plain, &CopyOptions { zstd: ZstdPolicy::Compress, ..CopyOptions::default() }),
            small,
            "{name}"
        );
        let (a, b) = (open(plain), open(small));
        assert_eq!(a.info().payload_bytes, b.info().payload_bytes, "{name}");
        assert_eq!(a.info(), open(file).info(), "{name}");
        for lod in 0..a.info().lod_count {
            assert_eq!(a.read(At::lod(lod)).unwrap().bytes(), b.read(At::lod(lod)).unwrap().bytes(), "{name}");
        }
    }
}

#[test]
fn boxes_levels_times_and_channels() {
    for (name, file) in files() {
        let d = open(file.clone()).info().clone();
        let n = d.lod_count;
        let e = d.dims.to_array();
        let boxes = [
            [[0; 3], e],
            [[0; 3], [1; 3]],
            [[17, 18, 19], [35, 34, 20]],
            [e.map(|v| v - 1), e],
            [[e[0] / 2, 0, 0], [e[0] / 2 + 1, e[1], 1]],
        ];
        for [start, end] in boxes {
            let region = Some(Region { start, end });
            assert_part(&file, &CopyOptions { region, ..CopyOptions::default() });
            assert_part(&file, &CopyOptions { region, levels: Some(0..n), ..CopyOptions::default() });
            assert_part(&file, &CopyOptions { region, levels: Some(0..1), ..CopyOptions::default() });
        }
        for a in 0..n {
            for b in a + 1..=n {
                let part = assert_part(&file, &CopyOptions { levels: Some(a..b), ..CopyOptions::default() });
                assert_eq!(part.info().achieved.is_some(), a == 0 && d.achieved.is_some(), "{name} {a}:{b}");
                let extent = d.dims.at_lod(a);
                let corner = Region { start: [extent.x / 2, 0, 0], end: extent.to_array() };
                let options = CopyOptions { levels: Some(a..b), region: Some(corner), ..CopyOptions::default() };
                assert_part(&file, &options);
            }
        }
        for times in [0..1, d.time_steps - 1..d.time_steps, 0..d.time_steps] {
            for channels in [0..1, d.channels - 1..d.channels] {
                let (times, channels) = (Some(times.clone()), Some(channels));
                let options = CopyOptions { times, channels, ..CopyOptions::default() };
                assert_part(&file, &options);
                let small = CopyOptions { region: Some(Region { start: [1; 3], end: [8; 3] }), ..options };
                assert_part(&file, &CopyOptions { levels: Some(n - 1..n), ..small });
            }
        }
    }
}

#[test]
fn an_excerpt_of_an_excerpt_is_the_excerpt() {
    let file = levels_of(explicit(4, 4));
    let region = Region { start: [32, 32, 0], end: [96, 64, 32] };
    let first = copy(&file, &CopyOptions { region: Some(region), ..CopyOptions::default() });
    assert_eq!(open(first.clone()).info().lod_count, 2, "32, 64 and 96 are multiples of 2 · 16, not of 4 · 16");
    let within = Region { start: [32, 0, 0], end: [64, 32, 32] };
    let second = copy(&first, &CopyOptions { region: Some(within), ..CopyOptions::default() });
    let direct = Region { start: [64, 32, 0], end: [96, 64, 32] };
    assert_eq!(second, copy(&file, &CopyOptions { region: Some(direct), ..CopyOptions::default() }));
}

#[test] // B-03
fn an_excerpt_stays_where_it_is() {
    let file = levels_of(EncodeOptions {
        placement: vug::affine::Placement::from_spacing([1.0, 2.0, 4.0], [100.0, 200.0, 300.0]),
        ..explicit(4, 4)
    });
    let region = Some(Region { start: [16, 32, 0], end: [32, 48, 16] });
    let part = open(copy(&file, &CopyOptions { region, ..CopyOptions::default() }));
    assert_eq!(part.info().placement.origin(), [116.0, 264.0, 300.0]);
    let part = open(copy(&file, &CopyOptions { levels: Some(1..3), ..CopyOptions::default() }));
    assert_eq!(part.info().placement.origin(), [100.5, 201.0, 302.0]);
    assert_eq!(part.info().placement.spacing(), [2.0, 4.0, 8.0]);
}

#[test] // spec: IDX-13
fn bounds_lose_what_is_no_longer_there() {
    // One bright voxel: its mean is dark, but the bounds of all levels include it.
    let mut grid =
        Grid::from_fn(Extent::cube(64), |c| if c == [3, 3, 3] { 255u8 } else { (hash(c) % 3) as u8 }).unwrap();
    let options = EncodeOptions { brick: Some(16), levels: 3, codec: CodecChoice::Raw, ..EncodeOptions::default() };
    let file = encode(&mut grid, &options).0;
    let whole = Region::whole(Extent::cube(16));
    assert_eq!(open(file.clone()).bounds(At::lod(2), whole).unwrap().max, 255.0);
    let part = assert_part(&file, &CopyOptions { levels: Some(2..3), ..CopyOptions::default() });
    let bounds = part.bounds(At::default(), whole).unwrap();
    assert!(bounds.max < 16.0 && bounds.max_error == Some(0.0), "{bounds:?}");
    // Errors of lossy bricks stay bounds, though nobody measures them again.
    let lossy = levels_of(explicit(1, 8));
    let (a, b) =
        (open(lossy.clone()), assert_part(&lossy, &CopyOptions { levels: Some(1..4), ..CopyOptions::default() }));
    for lod in 0..3 {
        let all = |v: &Volume, lod| v.bounds(At::lod(lod), Region::whole(v.levels().nth(lod.into()).unwrap())).unwrap();
        let (before, after) = (all(&a, lod + 1).max_error.unwrap(), all(&b, lod).max_error.unwrap());
        assert!(0.0 < after && after <= before, "{after} {before}");
    }
}

#[test] // spec: IDX-15
fn a_level_without_loss_above_one_with_loss_becomes_the_finest() {
    let shape = Shape::single(Extent::cube(32), SampleType::U8);
    let codec = Codec::S3dc(s3dc::Params::new(1, Extent::cube(4), Default::default()).unwrap());
    let options = EncodeOptions { levels: 2, ..EncodeOptions::default() };
    let mut writer = VolumeWriter::create(Cursor::new(Vec::new()), shape, codec, 4, &options).unwrap();
    let two = Grid::from_fn(Extent::cube(16), |c| (hash(c) % 2) as u8 * 7).unwrap();
    writer.write_brick(At::lod(1), [0; 3], two.view()).unwrap();
    for i in 0..8 {
        let noise = noise(Extent::cube(16), |h| (h >> 24) as u8);
        writer.write_brick(At::default(), [i & 1, i >> 1 & 1, i >> 2], noise.view()).unwrap();
    }
    let file = writer.finish().unwrap().0.into_inner();
    let part = assert_part(&file, &CopyOptions { levels: Some(1..2), ..CopyOptions::default() });
    assert_eq!(part.bounds(At::default(), Region::whole(Extent::cube(16))).unwrap().max_error, Some(0.0));
}

#[test]
fn what_does_not_exist_is_refused() {
    let volume = open(series());
    let none = CopyOptions::default();
    let bad = [
        CopyOptions { levels: Some(0..3), ..none.clone() },
        CopyOptions { levels: Some(1..1), ..none.clone() },
        CopyOptions { times: Some(5..6), ..none.clone() },
        CopyOptions { channels: Some(0..3), ..none.clone() },
        CopyOptions { region: Some(Region { start: [0; 3], end: [41, 1, 1] }), ..none.clone() },
        CopyOptions { levels: Some(1..2), region: Some(Region { start: [20, 0, 0], end: [21, 1, 1] }), ..none },
    ];
    for options in bad {
        assert_eq!(volume.excerpt(&options).unwrap_err().code(), Code::Range, "{options:?}");
    }
}

#[test]
fn a_damaged_brick_is_not_copied_and_others_are() {
    let file = levels_of(explicit(4, 4));
    let volume = open(file.clone());
    let mut bad = file.clone();
    let at = volume.head().section(*b"BRIK").unwrap().offset as usize + 40;
    bad[at] ^= 1;
    let damaged = open(bad);
    let all = damaged.excerpt(&CopyOptions::default()).unwrap();
    let e = all.write_head(Cursor::new(Vec::new()), &mut |_, _| {}).unwrap_err();
    assert_eq!(e.code(), Code::BrickCrc);
    let top = damaged.excerpt(&CopyOptions { levels: Some(1..4), ..CopyOptions::default() }).unwrap();
    let out = top.write_head(Cursor::new(Vec::new()), &mut |_, _| {}).unwrap().0.into_inner();
    assert_eq!(out, copy(&file, &CopyOptions { levels: Some(1..4), ..CopyOptions::default() }));
}

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

#[test]
fn an_excerpt_reads_only_what_it_keeps() {
    // 20 × 20 × 20 bricks of 16³: 27 pages of 512 bricks.
    let mut grid = noise(Extent::cube(320), |h| (h >> 24) as u8);
    let file = encode(&mut grid, &EncodeOptions { zstd: false, brick: Some(16), ..explicit(4, 4) }).0;
    let volume = Volume::open(Remote(file.clone()), Limits::default()).unwrap();
    let opened = volume.cost();
    let region = Some(Region { start: [0; 3], end: [64, 16, 16] });
    let excerpt = volume.excerpt(&CopyOptions { region, ..CopyOptions::default() }).unwrap();
    assert_eq!(volume.cost(), opened, "nothing is read to choose");
    let (out, report) = excerpt.write_head(Cursor::new(Vec::new()), &mut |_, _| {}).unwrap();
    let cost = volume.cost();
    assert_eq!(cost.reads - opened.reads, 2, "one page, one run of four neighbouring bricks");
    assert!(cost.bytes - opened.bytes < 512 * 32 + report.file.stored_bytes + 4 * 512, "{cost:?}");
    assert_eq!(out.into_inner(), copy(&file, &CopyOptions { region, ..CopyOptions::default() }));
}
