//! Unusual shapes through the whole chain: encode, strict check, every way of reading back.

mod support;

use std::io::Cursor;
use support::{encode, explicit, hash, open, verify};
use vug::codec::Codec;
use vug::codec::s3dc::{Endpoints, Params, formula_ratio, integer_error_bound, padded_ratio};
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{At, Axis, CodecChoice, EncodeOptions, Quality, Shape, Volume, VolumeWriter};
use vug::{Code, Extent, Grid, Region, SampleType};

fn with_block(index_bits: u8, block: Extent) -> EncodeOptions {
    EncodeOptions { quality: Quality::Explicit { index_bits, block }, brick: Some(16), ..EncodeOptions::default() }
}

/// Encodes, checks strictly, and compares whole, planes, blocks and single voxels with each other and with the source.
fn chain(grid: &mut Grid, options: &EncodeOptions) -> Volume {
    let extent = grid.extent();
    let (bytes, report) = encode(grid, options);
    assert!(verify(&bytes).is_empty(), "{extent} {options:?}: {:?}", verify(&bytes));
    let volume = open(bytes);
    let whole = volume.read(At::default()).unwrap();
    assert_eq!(whole.extent(), extent);
    let mut worst = 0f64;
    for z in 0..extent.z {
        for y in 0..extent.y {
            for x in 0..extent.x {
                let c = [x, y, z];
                let (decoded, source) = (whole.value(c).unwrap(), grid.value(c).unwrap());
                assert_eq!(volume.voxel(At::default(), c).unwrap(), decoded, "{extent} {c:?}");
                worst = worst.max((decoded.component(0) - source.component(0)).abs());
            }
        }
    }
    assert_eq!(worst, report.max_error, "{extent}");
    for (axis, n) in [(Axis::X, extent.x), (Axis::Y, extent.y), (Axis::Z, extent.z)] {
        let plane = volume.plane(At::default(), axis, n - 1).unwrap();
        let mut region = Region::whole(extent);
        region.start[axis as usize] = n - 1;
        assert_eq!(plane.extent(), region.extent());
        assert_eq!(plane.value([0; 3]).unwrap(), whole.value(region.start).unwrap());
    }
    let last = [extent.x - 1, extent.y - 1, extent.z - 1];
    let (region, block) = volume.block(At::default(), last).unwrap();
    assert_eq!(region.end, extent.to_array(), "the last block ends with the volume");
    assert_eq!(block.value([0; 3]).unwrap(), whole.value(region.start).unwrap());
    volume
}

#[test] // K-18, K-16: one voxel, one row along each axis, thin sheets; all index bits, all types, raw as well
fn thin_volumes() {
    for dims in [[1, 1, 1], [1, 37, 1], [37, 1, 1], [1, 1, 37], [2, 1, 33], [33, 17, 1], [1, 18, 19], [3, 3, 3]] {
        let e = Extent::from(dims);
        for bits in [1, 2, 4, 8] {
            for block in [Extent::cube(4), Extent::new(5, 3, 7), Extent::cube(1)] {
                let options = with_block(bits, block);
                chain(&mut support::noise(e, |h| (h >> 24) as u8), &options);
                chain(&mut support::noise(e, |h| (h >> 16) as u16), &options);
                chain(&mut support::noise(e, |h| (h >> 16) as u16 as i16), &options);
                chain(&mut support::noise(e, |h| h as f32 * 1e-3 - 7.0), &options);
            }
        }
        let raw = EncodeOptions { codec: CodecChoice::Raw, ..with_block(4, Extent::cube(4)) };
        let mut colours = support::noise(e, |h| [h as u8, (h >> 8) as u8, (h >> 16) as u8]);
        let volume = chain(&mut colours, &raw);
        assert_eq!(volume.read(At::default()).unwrap().bytes(), colours.bytes());
    }
}

#[test] // K-17, S-02: every axis of the block counts on its own; blocks of one voxel; blocks larger than the volume
fn anisotropic_blocks() {
    let e = Extent::new(37, 29, 23);
    let source = |c| (hash(c) >> 16) as u16;
    for block in [[4, 8, 2], [5, 3, 7], [1, 1, 7], [7, 1, 1], [16, 1, 16], [13, 11, 9]].map(Extent::from) {
        for bits in [1, 2, 4, 8] {
            let mut grid = Grid::from_fn(e, source).unwrap();
            let volume = chain(&mut grid, &with_block(bits, block));
            let whole = volume.read(At::default()).unwrap();
            // The block of a voxel starts at a multiple of the block from its brick, and its error is bounded by its own
            // range: a decoder or encoder that mixed up two axes would miss it.
            let q = (1u32 << bits) - 1;
            for c in [[0, 0, 0], [15, 15, 15], [16, 16, 16], [21, 19, 18], [36, 28, 22]] {
                let (region, _) = volume.block(At::default(), c).unwrap();
                let b = block.to_array();
                let start: [u32; 3] = std::array::from_fn(|a| c[a] / 16 * 16 + c[a] % 16 / b[a] * b[a]);
                assert_eq!(region.start, start, "{block} {c:?}");
                let (mut min, mut max, mut error) = (u16::MAX, 0, 0);
                for z in region.start[2]..region.end[2] {
                    for y in region.start[1]..region.end[1] {
                        for x in region.start[0]..region.end[0] {
                            let v = source([x, y, z]);
                            (min, max) = (min.min(v), max.max(v));
                            let back = whole.samples::<u16>()[e.index([x, y, z]) as usize];
                            error = error.max(u32::from(back.abs_diff(v)));
                        }
                    }
                }
                assert!(error <= integer_error_bound(u32::from(max - min), q), "{block} {c:?}: {error}");
            }
        }
    }
    // One voxel per block is lossless, larger than the source, and the report says so.
    let mut grid = Grid::from_fn(e, source).unwrap();
    let options = EncodeOptions { zstd: false, ..with_block(1, Extent::cube(1)) };
    let report = encode(&mut grid, &options).1;
    assert_eq!(report.max_error, 0.0);
    assert!(report.ratio_formula.unwrap() < 0.5 && report.ratio_payload < 0.5 && report.ratio_file < 0.5, "{report:?}");
    // A block of 128 needs a brick of 128, and covers the whole of this volume.
    let volume = chain(&mut grid, &explicit(4, 128));
    assert_eq!(volume.info().brick_log2, 7);
    assert_eq!(volume.block(At::default(), [9, 9, 9]).unwrap().0, Region::whole(e));
}

#[test] // K-20, S-20, S-11: powers of two are never stored; the ratio that they would give is lower
fn nothing_is_padded() {
    for dims in [[65, 40, 33], [17, 17, 17], [64, 64, 63]] {
        let e = Extent::from(dims);
        let mut grid = support::noise(e, |h| h as u16);
        let options = EncodeOptions { zstd: false, ..explicit(4, 4) };
        let report = encode(&mut grid, &options).1;
        let params = Params::new(4, Extent::cube(4), Endpoints::MinMax).unwrap();
        let padded = padded_ratio(e, 16, &params);
        assert_eq!(report.ratio_formula.unwrap(), formula_ratio(e, 16, &params));
        assert!(padded < report.ratio_formula.unwrap(), "{e}: {padded} < {:?}", report.ratio_formula);
        if dims[0] == 65 {
            // 128×64×64 instead of 65×40×33: payload and file stay clear of that.
            assert!(report.ratio_payload > 2.0 * padded && report.ratio_file > 2.0 * padded, "{report:?}");
        }
    }
}

#[test] // S-40: a picture is a volume of one slice
fn pictures() {
    let e = Extent::new(75, 50, 1);
    let mut grid = support::ball(e);
    for block in [Extent::cube(4), Extent::new(8, 8, 1)] {
        let volume = chain(&mut grid, &with_block(4, block));
        assert_eq!(volume.plane(At::default(), Axis::Z, 0).unwrap().extent(), e);
    }
    let volume = chain(&mut grid, &EncodeOptions { levels: 0, ..with_block(4, Extent::cube(4)) });
    assert_eq!(volume.levels().last(), Some(Extent::new(10, 7, 1)), "levels halve x and y, z stays");
}

#[test] // D-40: bricks of the null value cost nothing, uniform ones a node
fn empty_and_uniform_bricks_are_not_stored() {
    let e = Extent::cube(64);
    let one = Grid::from_fn(e, |c| if c == [33, 1, 1] { 9u8 } else { 0 });
    let report = encode(&mut one.unwrap(), &with_block(4, Extent::cube(4))).1;
    assert_eq!(report.bricks, [1, 0, 63]);
    let options = EncodeOptions { null_value: 7.0, ..with_block(4, Extent::cube(4)) };
    let mut halves = Grid::from_fn(e, |[x, ..]| if x < 32 { 7u8 } else { 8 }).unwrap();
    let (bytes, report) = encode(&mut halves, &options);
    assert_eq!((report.bricks, report.stored_bytes), ([0, 32, 32], 0));
    let volume = open(bytes);
    volume.reset_cost();
    assert_eq!(volume.read(At::default()).unwrap().bytes(), halves.bytes());
    assert_eq!(volume.cost().reads, 0, "all of it is in the index, which lies in the head");
}

#[test] // D-59: axes beyond 16 bits are legal
fn an_axis_of_70000_voxels() {
    for dims in [[70_000, 2, 2], [2, 70_000, 2], [2, 2, 70_000]] {
        let e = Extent::from(dims);
        let axis = dims.iter().position(|&d| d == 70_000).unwrap();
        let value = |c: [u32; 3]| (c[axis] % 65_521) as u16 ^ (c[(axis + 1) % 3] as u16) << 3;
        let mut grid = Grid::from_fn(e, value).unwrap();
        let options = EncodeOptions { codec: CodecChoice::Raw, ..EncodeOptions::default() };
        for options in [options, EncodeOptions { levels: 2, ..explicit(8, 2) }] {
            let (bytes, report) = encode(&mut grid, &options);
            assert!(verify(&bytes).is_empty(), "{:?}", verify(&bytes));
            let volume = open(bytes);
            for at in [0, 1, 65_534, 65_535, 65_536, 65_537, 69_999] {
                let mut c = [1; 3];
                c[axis] = at;
                let back = f64::from(volume.get::<u16>(At::default(), c).unwrap());
                assert!((back - f64::from(value(c))).abs() <= report.max_error, "{c:?}");
                if report.codec == "raw" {
                    assert_eq!(back, f64::from(value(c)), "{c:?}");
                }
            }
            let mut outside = [0; 3];
            outside[axis] = 70_000;
            assert_eq!(volume.voxel(At::default(), outside).unwrap_err().code(), Code::Range);
        }
    }
}

/// A volume of `extent` u16 voxels that is empty but for its first, one middle and its last brick.
fn sparse(extent: Extent) -> (Vec<u8>, [u32; 3]) {
    let params = Params::new(8, Extent::cube(4), Endpoints::MinMax).unwrap();
    let options = EncodeOptions::default();
    let shape = Shape::single(extent, SampleType::U16);
    let mut writer = VolumeWriter::create(Cursor::new(Vec::new()), shape, Codec::S3dc(params), 6, &options).unwrap();
    let last = extent.to_array().map(|n| (n - 1) / 64);
    let edge =
        |b: [u32; 3]| Extent::from(std::array::from_fn::<u32, 3, _>(|a| (extent.to_array()[a] - b[a] * 64).min(64)));
    for brick in [[0; 3], last.map(|b| b / 2), last] {
        let samples = Grid::from_fn(edge(brick), |c| 500 + (c[0] + c[1] + c[2]) as u16).unwrap();
        writer.write_brick(At::default(), brick, samples.view()).unwrap();
    }
    let outside = writer.write_brick(
        At::default(),
        [last[0] + 1, 0, 0],
        Grid::zeros(edge([0; 3]), SampleType::U16).unwrap().view(),
    );
    assert_eq!(outside.unwrap_err().code(), Code::Range);
    let (file, report) = writer.finish().unwrap();
    let file = file.into_inner();
    let voxels = extent.voxels() as f64;
    assert!((report.bits_per_voxel - file.len() as f64 * 8.0 / voxels).abs() < 1e-12);
    (file, last)
}

#[test] // D-60: more than 2^32 voxels, up to the cap of 2^48; SAF: memory follows the bricks, not the dims
fn more_voxels_than_32_bits_count() {
    for dims in [[1 << 21, 64, 64], [1 << 21, 1 << 11, 1 << 16], [64, 64, 1 << 21], [1 << 16, 1 << 16, 1 << 16]] {
        let extent = Extent::from(dims);
        assert!(extent.voxels() > 1 << 32);
        let (bytes, last) = sparse(extent);
        assert!(bytes.len() < 1 << 20, "{extent}: {} bytes", bytes.len());
        let volume = open(bytes);
        let far = extent.to_array().map(|n| n - 1);
        assert!(extent.index(far) == extent.voxels() - 1 && extent.index(far) > u64::from(u32::MAX));
        let value = |c: [u32; 3]| (500 + c.iter().map(|v| v % 64).sum::<u32>()) as u16;
        let middle = last.map(|b| b / 2 * 64 + 31);
        let coords = [[0, 0, 0], [63, 62, 61], middle, far, far.map(|v| v - 5)];
        let mut many = [0u16; 5];
        volume.voxels(At::default(), &coords, &mut many).unwrap();
        for (&c, many) in coords.iter().zip(many) {
            assert_eq!((volume.get::<u16>(At::default(), c).unwrap(), many), (value(c), value(c)), "{extent} {c:?}");
        }
        let near_far = Region { start: far.map(|v| v - 20), end: extent.to_array() };
        let corner = volume.read_region(At::default(), near_far).unwrap();
        for (c, at) in [([20, 20, 20], far), ([0, 3, 7], [far[0] - 20, far[1] - 17, far[2] - 13])] {
            assert_eq!(corner.value(c).unwrap().component(0), f64::from(value(at)), "{extent}");
        }
        let longest = (0..3).max_by_key(|&a| dims[a]).unwrap();
        let mut between = [0; 3];
        between[longest] = far[longest] / 4;
        assert_eq!(volume.get::<u16>(At::default(), between).unwrap(), 0, "nothing is stored there");
        let all = volume.bounds(At::default(), near_far).unwrap();
        assert_eq!((all.min, all.max), (500.0, 500.0 + 63.0 * 3.0));
        assert_eq!(volume.brick_counts().unwrap().stored, 3);
        // Nobody asked for so much memory.
        if extent.voxels() > 1 << 40 {
            assert_eq!(volume.read(At::default()).unwrap_err().code(), Code::Limit);
        }
    }
}

#[test] // D-60, D-61, C-18: refused before anything is allocated or written
fn impossible_shapes_are_errors() {
    let create = |extent, time_steps, channels| {
        let shape = Shape { extent, sample_type: SampleType::U8, time_steps, channels };
        let options = EncodeOptions::default();
        VolumeWriter::create(Cursor::new(Vec::new()), shape, Codec::Raw, 6, &options).map(|_| ()).map_err(|e| e.code())
    };
    let small = Extent::cube(4);
    assert_eq!(create(small, 1, 1), Ok(()));
    assert_eq!(create(small, 0, 1), Err(Code::Param));
    assert_eq!(create(small, 1, 0), Err(Code::Param));
    assert_eq!(create(small, 1 << 24, 2), Err(Code::Limit));
    assert_eq!(create(small, u32::MAX, u32::MAX), Err(Code::Limit));
    assert_eq!(create(Extent::new(0, 4, 4), 1, 1), Err(Code::Param));
    assert_eq!(create(Extent::new(4, 4, (1 << 21) + 1), 1, 1), Err(Code::Limit));
    assert_eq!(create(Extent::cube(u32::MAX), 1, 1), Err(Code::Limit), "2^96 does not fit in 64 bits");
    assert_eq!(create(Extent::cube(1 << 21), 1, 1), Err(Code::Limit), "2^63 does, but is above the cap");
    // What one reader is not willing to open, another one is.
    let bytes = sparse(Extent::new(1 << 21, 64, 64)).0;
    let limits = Limits { voxels: 1 << 32, ..Limits::default() };
    let error = Volume::open(MemorySource(bytes), limits).unwrap_err();
    assert_eq!(error.code(), Code::Limit);
}

#[test]
fn a_writer_takes_only_bricks_that_fit() {
    use vug::codec::Codec;
    use vug::volume::{Shape, VolumeWriter};
    let shape = Shape::single(Extent::new(70, 64, 64), SampleType::U8);
    let mut writer =
        VolumeWriter::create(std::io::Cursor::new(Vec::new()), shape, Codec::Raw, 6, &EncodeOptions::default())
            .unwrap();
    let small = Grid::zeros(Extent::cube(20), SampleType::U8).unwrap();
    let float = Grid::from_samples(Extent::cube(64), &vec![f32::NAN; 64 * 64 * 64]).unwrap();
    let right = Grid::zeros(Extent::cube(64), SampleType::U8).unwrap();
    let code = |r: vug::Result<()>| r.unwrap_err().code();
    assert_eq!(code(writer.write_brick(At::default(), [0; 3], small.view())), Code::Param);
    assert_eq!(code(writer.write_brick(At::default(), [0; 3], float.view())), Code::Param);
    assert_eq!(code(writer.write_brick(At::default(), [1, 0, 0], right.view())), Code::Param);
    assert_eq!(code(writer.write_brick(At::default(), [2, 0, 0], right.view())), Code::Range);
    writer.write_brick(At::default(), [0; 3], right.view()).unwrap();
    // A brick that could never be stored is refused before the first one.
    let options = EncodeOptions { brick: Some(256), ..support::explicit(4, 1) };
    let mut file = std::io::Cursor::new(Vec::new());
    let mut grid = support::noise(Extent::cube(256), |h| h as f32);
    let error = vug::volume::encode(&mut grid, &mut file, &options, &mut |_, _| {}).unwrap_err();
    assert_eq!((error.code(), error.field()), (Code::Param, "brick"));
}
