//! Levels in memory against the volume itself.

use super::*;
use crate::codec::s3dc::Scalar;
use crate::grid::Grid;
use crate::limits::Limits;
use crate::source::MemorySource;
use crate::volume::{self, CodecChoice, EncodeOptions, Quality};
use crate::voxel::{Sample, SampleValue};
use std::io::Cursor;

fn hash(c: Coord) -> u32 {
    let h = c[0].wrapping_mul(0x9E37_79B1) ^ c[1].wrapping_mul(0x85EB_CA77) ^ c[2].wrapping_mul(0xC2B2_AE3D);
    let h = (h ^ h >> 15).wrapping_mul(0x2C1B_3C6D);
    (h ^ h >> 12).wrapping_mul(0x297A_2D39)
}

fn options(codec: CodecChoice, index_bits: u8, block: [u32; 3]) -> EncodeOptions {
    let quality = match codec {
        CodecChoice::S3dc => Quality::Explicit { index_bits, block: block.into() },
        CodecChoice::Zerobit => Quality::Keep(400_000),
        _ => EncodeOptions::default().quality,
    };
    EncodeOptions { codec, quality, brick: Some(16), levels: 0, ..EncodeOptions::default() }
}

fn volume<T: Sample>(extent: Extent, options: &EncodeOptions, limits: Limits, f: impl FnMut(Coord) -> T) -> Volume {
    let mut file = Cursor::new(Vec::new());
    volume::encode(&mut Grid::from_fn(extent, f).unwrap(), &mut file, options, &mut |_, _| {}).unwrap();
    Volume::open(MemorySource(file.into_inner()), limits).unwrap()
}

fn load(volume: &Volume, layout: LevelLayout) -> HostLevel {
    HostLevel::load(volume, layout, &|_| true, &mut |_, _| {}).unwrap()
}

/// What a shader reads of voxel `c`.
fn sample(level: &HostLevel, c: Coord) -> SampleValue {
    let read = |t: usize| level.texel(t, level.layout.texel(&level.layout.textures[t], c));
    let Store::S3dc { sample, index_bits, .. } = level.layout.store else {
        let [r, g, b, _] = read(0);
        return match level.layout.store.sample() {
            SampleType::Rgb8 => SampleValue::Rgb8([r as u8, g as u8, b as u8]),
            SampleType::I16 => SampleValue::I16(r.cast_signed() as i16),
            t => SampleValue::from_raw(t, r).unwrap(),
        };
    };
    let ([lo, hi, ..], [word, ..], q) = (read(0), read(1), (1 << index_bits) - 1);
    let in_brick = c[0] & ((1 << level.layout.brick_log2) - 1);
    let index = word >> (in_brick % (16 / index_bits) * index_bits) & q;
    match sample {
        SampleType::U8 => u8::reconstruct(lo as u8, hi as u8, index, q).value(),
        SampleType::U16 => u16::reconstruct(lo as u16, hi as u16, index, q).value(),
        SampleType::I16 => i16::reconstruct(lo.cast_signed() as i16, hi.cast_signed() as i16, index, q).value(),
        _ => f32::reconstruct(f32::from_bits(lo).stored(), f32::from_bits(hi).stored(), index, q).value(),
    }
}

fn check_all(volume: &Volume, level: &HostLevel) {
    let at = level.layout.at;
    let e = level.layout.extent;
    for c in (0..e.z).flat_map(|z| (0..e.y).flat_map(move |y| (0..e.x).map(move |x| [x, y, z]))) {
        assert_eq!(sample(level, c), volume.voxel(at, c).unwrap(), "{c:?} of {:?}", level.layout);
    }
}

/// Limits under which a level of a few bricks is cut into tiles.
fn tight() -> Fit {
    Fit { max_3d: 64, ..Fit::portable() }
}

/// Noise left of a plane, one value behind, nothing at the end: STORED, CONSTANT and EMPTY bricks.
fn part(c: Coord, noise: impl Fn(u32) -> f32) -> f32 {
    match c[2] {
        0..40 => noise(hash(c)),
        40..64 => 7.0,
        _ => 0.0,
    }
}

#[test] // S-15, S-16, S-17, S-44; hard case: D-59
fn every_voxel_is_read_from_flat_and_folded_textures() {
    let extent = Extent::new(35, 18, 85);
    for (bits, block) in [(1, [2, 2, 2]), (2, [3, 5, 7]), (4, [4, 4, 4]), (8, [16, 1, 8])] {
        let o = options(CodecChoice::S3dc, bits, block);
        let some: [Volume; 4] = [
            volume(extent, &o, Limits::default(), |c| part(c, |h| (h % 256) as f32) as u8),
            volume(extent, &o, Limits::default(), |c| part(c, |h| (h % 65536) as f32) as u16),
            volume(extent, &o, Limits::default(), |c| part(c, |h| (h % 65536) as f32 - 32768.0) as i16),
            volume(extent, &o, Limits::default(), |c| part(c, |h| h as f32 / 3e9 - 0.5)),
        ];
        for volume in &some {
            for lod in 0..volume.info().lod_count {
                for (fit, source) in
                    [(Fit::host(None), Source::Direct), (tight(), Source::Direct), (tight(), Source::Decoded)]
                {
                    let layout = LevelLayout::new(volume, At::lod(lod), source, &fit).unwrap();
                    assert!(layout.textures.iter().all(|t| t.size.iter().all(|&n| n <= fit.max_3d)));
                    let level = load(volume, layout);
                    check_all(volume, &level);
                    assert_eq!(level.layout.fold.is_flat(), fit.max_3d > 64 || lod > 0, "{:?}", level.layout.fold);
                }
            }
        }
    }
}

#[test]
fn raw_payloads_are_texels() {
    let o = options(CodecChoice::Raw, 4, [4; 3]);
    let grey = volume(Extent::new(35, 18, 85), &o, Limits::default(), |c| part(c, |h| (h % 65536) as f32) as u16);
    let colour = volume(Extent::new(30, 18, 85), &o, Limits::default(), |c| {
        <[u8; 3]>::try_from(&hash(c).to_le_bytes()[..3]).unwrap()
    });
    for (volume, repacked) in [(&grey, false), (&colour, true)] {
        for fit in [Fit::host(None), tight()] {
            let level = load(volume, LevelLayout::new(volume, At::default(), Source::Direct, &fit).unwrap());
            check_all(volume, &level);
            assert_eq!((level.filled.repacked_bytes > 0, level.filled.payload_bytes > 0), (repacked, !repacked));
        }
    }
}

#[test] // S-44: what is written is what is stored
fn bytes_written_are_payload_bytes() {
    let o = options(CodecChoice::S3dc, 4, [4; 3]);
    let volume = volume(Extent::new(35, 18, 85), &o, Limits::default(), |c| part(c, |h| (h % 256) as f32) as u8);
    let layout = LevelLayout::new(&volume, At::default(), Source::Direct, &Fit::host(None)).unwrap();
    let (mut bytes, mut bricks) = (0, 0);
    let all = (0..6).flat_map(|z| (0..2).flat_map(move |y| (0..3).map(move |x| [x, y, z])));
    let mut kinds = [0; 3];
    volume
        .brick_payloads(At::default(), all, |group| {
            for (brick, payload) in group {
                match payload {
                    crate::volume::BrickPayload::Stored { codec: Codec::S3dc(p), extent, bytes: b } => {
                        let lies = crate::codec::s3dc::Layout::new(p, SampleType::U8, extent);
                        bytes += b.len() - (lies.iv_start() - lies.mmv_bytes());
                        (bricks, kinds[0]) = (bricks + 1, kinds[0] + 1);
                    }
                    crate::volume::BrickPayload::Constant(v) => {
                        assert_eq!(v, SampleValue::U8(7), "{brick:?}");
                        kinds[1] += 1;
                    }
                    _ => kinds[2] += 1,
                }
            }
            Ok(())
        })
        .unwrap();
    assert!(kinds.iter().all(|&n| n > 0), "{kinds:?}");
    let level = load(&volume, layout.clone());
    assert_eq!(
        (level.filled.payload_bytes, level.filled.bricks, level.filled.repacked_bytes),
        (bytes as u64, bricks, 0)
    );
    // Bricks that nobody wants are neither read nor written.
    volume.reset_cost();
    let none = HostLevel::load(&volume, layout, &|b| b == [0, 0, 0], &mut |_, _| {}).unwrap();
    assert_eq!((none.filled.bricks, none.filled.skipped, none.filled.filled_bytes), (1, 35, 0));
    assert_eq!(sample(&none, [3, 3, 3]), volume.voxel(At::default(), [3, 3, 3]).unwrap());
    assert_eq!(sample(&none, [20, 3, 3]), SampleValue::U8(0));
}

#[test] // hard case: R-31
fn memory_for_one_brick_or_none_is_enough_to_load() {
    let o = options(CodecChoice::S3dc, 4, [4; 3]);
    for cache_bytes in [0, 3000] {
        let limits = Limits { cache_bytes, ..Limits::default() };
        let volume = volume(Extent::new(160, 16, 16), &o, limits, |c| (hash(c) % 256) as u8);
        assert_eq!(volume.head().octree.levels[0].bricks.voxels(), 10);
        let level = load(&volume, LevelLayout::new(&volume, At::default(), Source::Direct, &Fit::host(None)).unwrap());
        assert_eq!(level.filled.bricks, 10);
        check_all(&volume, &level);
        let none = LevelLayout::new(&volume, At::default(), Source::Direct, &Fit::host(Some(0))).unwrap_err();
        assert_eq!((none.code(), none.field()), (Code::Limit, "gpu-mem"));
    }
}

#[test]
fn too_much_says_what_fits() {
    let o = options(CodecChoice::S3dc, 8, [4; 3]);
    let volume = volume(Extent::cube(64), &o, Limits::default(), |c| (hash(c) % 60000) as u16);
    // 262144 voxels: pairs 16384 B, indices of 8 bits 262144 B.
    let layout = LevelLayout::new(&volume, At::default(), Source::Direct, &Fit::host(None)).unwrap();
    assert_eq!(layout.bytes(), 16_384 + 262_144);
    let fails = |source, most| {
        LevelLayout::new(&volume, At::default(), source, &Fit::host(Some(most))).unwrap_err().message().to_owned()
    };
    let message = fails(Source::Direct, 200_000);
    assert!(message.contains("takes 272.0 KiB as source direct, of 195.3 KiB allowed"), "{message}");
    assert!(
        message.contains("what fits: level 1 (34.0 KiB), or the volume encoded with 4 index bits (144.0 KiB)"),
        "{message}"
    );
    let message = fails(Source::Decoded, 300_000);
    assert!(message.contains("source direct at this level (272.0 KiB)"), "{message}");
    assert!(fails(Source::Direct, 100).contains("no coarser level fits"), "{}", fails(Source::Direct, 100));
    LevelLayout::new(&volume, At::default(), Source::Direct, &Fit::host(Some(278_528))).unwrap();
    // Folded textures have a limit as well; what a texture unit filters must not be folded.
    let small = Fit { max_3d: 32, filter_f32: true, ..Fit::portable() };
    assert!(
        LevelLayout::new(&volume, At::default(), Source::Decoded, &small).unwrap_err().message().contains("level 1")
    );
    let long = LevelLayout::new_filtered(&volume, At::default(), Source::Decoded, &tight()).unwrap_err();
    assert!(long.code() == Code::Unsupported || long.message().contains("cannot filter across tiles"), "{long}");
}

#[test]
fn filtered_samples_are_the_same_numbers() {
    let o = options(CodecChoice::S3dc, 4, [4; 3]);
    let volume = volume(Extent::new(20, 17, 3), &o, Limits::default(), |c| (hash(c) % 65536) as i32 as u16);
    let fits =
        [(Fit::host(None), TexelFormat::R16Unorm), (Fit { norm16: false, ..Fit::host(None) }, TexelFormat::R32Float)];
    for (fit, format) in fits {
        let layout = LevelLayout::new_filtered(&volume, At::default(), Source::Decoded, &fit).unwrap();
        assert_eq!((layout.textures[0].format, layout.textures[0].size), (format, [20, 17, 3]));
        let level = load(&volume, layout);
        for c in [[0, 0, 0], [19, 16, 2], [7, 8, 1]] {
            let [v, ..] = level.texel(0, c);
            let v = if format == TexelFormat::R32Float { f32::from_bits(v) } else { v as f32 };
            assert_eq!(f64::from(v), volume.voxel(At::default(), c).unwrap().component(0));
        }
    }
    let direct = LevelLayout::new_filtered(&volume, At::default(), Source::Direct, &Fit::host(None)).unwrap_err();
    assert_eq!(direct.code(), Code::Param);
    let no_filter = Fit { filter_f32: false, ..Fit::host(None) };
    let deferred = LevelLayout::new_filtered(&volume, At::default(), Source::Deferred, &no_filter).unwrap_err();
    assert_eq!(deferred.code(), Code::Unsupported);
    let deferred = LevelLayout::new(&volume, At::default(), Source::Deferred, &no_filter).unwrap();
    assert_eq!(deferred.bytes(), deferred.textures.iter().map(TextureLayout::bytes).sum::<u64>() + 4 * 20 * 17 * 3);
    assert_eq!(deferred.deferred().unwrap().textures[0].format, TexelFormat::R32Float);
}

#[test] // S-22: streams lie whole in pages, at whole words
fn zerobit_payloads_lie_in_pages() {
    let o = options(CodecChoice::Zerobit, 4, [4; 3]);
    let volume = volume(Extent::new(35, 18, 85), &o, Limits::default(), |c| part(c, |h| (h % 256) as f32) as u8);
    let small = Fit { max_binding: 6000, storage_buffers: 64, ..Fit::portable() };
    for fit in [Fit::host(None), small] {
        let level = load(&volume, LevelLayout::new(&volume, At::default(), Source::Direct, &fit).unwrap());
        let pages = level.layout.pages.unwrap();
        assert!(level.pages.iter().all(|p| p.len() as u64 * 4 <= pages.page_bytes));
        assert_eq!(level.pages.len() > 1, fit == small);
        let (mut total, mut stored) = (0, 0);
        let bricks = level.layout.bricks.iter().product::<u32>();
        assert_eq!(level.table[4 * bricks as usize..], [TABLE_EMPTY, 0, 0, 0]);
        for (i, entry) in (0..bricks).zip(level.table.chunks_exact(TABLE_WORDS as usize)) {
            let [nx, ny, _] = level.layout.bricks;
            let brick = [i % nx, i / nx % ny, i / nx / ny];
            match volume.brick_payload(At::default(), brick).unwrap() {
                crate::volume::BrickPayload::Stored { bytes, .. } => {
                    let page = &level.pages[(entry[0] - TABLE_STORED) as usize];
                    let words = &page[entry[1] as usize..][..entry[2].div_ceil(4) as usize];
                    let found: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
                    assert_eq!(found[..entry[2] as usize], *bytes);
                    assert_eq!(entry[3], u32::from_le_bytes(bytes[..4].try_into().unwrap()));
                    (total, stored) = (total + bytes.len() as u64, stored + 1);
                }
                crate::volume::BrickPayload::Constant(v) => assert_eq!(*entry, [TABLE_CONSTANT, 0, 0, v.to_raw()]),
                crate::volume::BrickPayload::Empty => assert_eq!(*entry, [TABLE_EMPTY, 0, 0, 0]),
            }
        }
        assert_eq!((level.filled.payload_bytes, level.filled.bricks), (total, stored));
        let books = volume.codebooks().unwrap();
        assert_eq!(level.books.len(), books.len() * BOOK_WORDS as usize);
        assert_eq!(level.books[1].cast_signed(), books[0].average(1)[0]);
        assert_eq!(level.books[257].cast_signed(), books[0].detail(1)[0]);
        assert!(pages.stream_bytes >= total || volume.level_bricks(At::default()).unwrap().zstd);
        // Layer by layer it becomes the same: each goes on in the page where the last one ended.
        let mut slowly = HostLevel::load(&volume, level.layout.clone(), &|_| false, &mut |_, _| {}).unwrap();
        for z in 0..level.layout.bricks[2] {
            slowly.add(&volume, &|b| b[2] == z, &mut |_, _| {}).unwrap();
        }
        assert!(slowly.pages == level.pages && slowly.table == level.table);
    }
    let few = Fit { storage_buffers: 5, ..small };
    let layout = LevelLayout::new(&volume, At::default(), Source::Direct, &few).unwrap();
    let error = HostLevel::load(&volume, layout, &|_| true, &mut |_, _| {}).unwrap_err();
    assert_eq!((error.code(), error.field()), (Code::Limit, "gpu-mem"), "{error}");
}
