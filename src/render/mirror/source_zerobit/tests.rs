//! Streams read as a shader reads them, against the codec.

use super::*;
use crate::codec::zerobit::Stream;
use crate::geometry::{Coord, Extent, Region};
use crate::gpu::Source;
use crate::gpu::level::{Fit, LevelLayout};
use crate::grid::Grid;
use crate::limits::Limits;
use crate::render::mirror::counter::{Free, Work};
use crate::source::MemorySource;
use crate::volume::{self, At, BrickPayload, CodecChoice, EncodeOptions, Quality, Volume, ZerobitOptions};
use crate::voxel::{Sample, SampleValue};
use std::io::Cursor;

fn hash(c: Coord) -> u32 {
    let h = c[0].wrapping_mul(0x9E37_79B1) ^ c[1].wrapping_mul(0x85EB_CA77) ^ c[2].wrapping_mul(0xC2B2_AE3D);
    let h = (h ^ h >> 15).wrapping_mul(0x2C1B_3C6D);
    (h ^ h >> 12).wrapping_mul(0x297A_2D39)
}

/// Noise on a wave, a plane of one value, and nothing: STORED, CONSTANT and EMPTY bricks, and null cells in stored ones.
fn field(c: Coord) -> Option<u32> {
    match c[0] {
        0..40 => (c[1] % 13 > 3 || c[2] > 20).then(|| 90 * c[0] % 250 + hash(c) % 40),
        40..64 => Some(7),
        _ => None,
    }
}

fn level<T: Sample>(extent: Extent, stream: Stream, fit: &Fit, f: impl FnMut(Coord) -> T) -> (Volume, HostLevel) {
    let options = EncodeOptions {
        codec: CodecChoice::Zerobit,
        quality: Quality::Keep(300_000),
        zerobit: ZerobitOptions { stream, codebook_region: Some(1), ..ZerobitOptions::default() },
        brick: Some(32),
        null_value: 5.0,
        ..EncodeOptions::default()
    };
    let mut file = Cursor::new(Vec::new());
    volume::encode(&mut Grid::from_fn(extent, f).unwrap(), &mut file, &options, &mut |_, _| {}).unwrap();
    let volume = Volume::open(MemorySource(file.into_inner()), Limits::default()).unwrap();
    let layout = LevelLayout::new(&volume, At::default(), Source::Direct, fit).unwrap();
    let level = HostLevel::load(&volume, layout, &|_| true, &mut |_, _| {}).unwrap();
    (volume, level)
}

fn value(t: SampleType, [r, g, b]: Int) -> SampleValue {
    match t {
        SampleType::U8 => SampleValue::U8(u8::try_from(r).unwrap()),
        SampleType::U16 => SampleValue::U16(u16::try_from(r).unwrap()),
        SampleType::I16 => SampleValue::I16(i16::try_from(r).unwrap()),
        _ => SampleValue::Rgb8([r, g, b].map(|v| u8::try_from(v).unwrap())),
    }
}

fn coords(e: Extent) -> impl Iterator<Item = Coord> {
    (0..e.z).flat_map(move |z| (0..e.y).flat_map(move |y| (0..e.x).map(move |x| [x, y, z])))
}

/// Every voxel as stored, then with noise for streams.
fn agree<T: Sample>(f: impl Fn(u32) -> T + Copy) {
    let null = f(5);
    let small = Fit { max_binding: 48_000, storage_buffers: 20, ..Fit::portable() };
    for stream in [Stream::New, Stream::Old] {
        for fit in [Fit::host(None), small] {
            let extent = Extent::new(98, 37, 35);
            let (volume, mut level) = level(extent, stream, &fit, |c| field(c).map_or(null, f));
            let t = volume.info().sample_type;
            assert!(level.pages.len() > 1 || fit != small, "{} pages", level.pages.len());
            assert!(level.books.len() > 512, "one codebook is no test");
            let grid = volume.read(At::default()).unwrap();
            for c in coords(extent) {
                let due = grid.samples::<T>()[extent.index(c) as usize].value();
                assert_eq!(value(t, voxel(&level, c, &mut Free)), due, "{c:?} {t} {stream:?}");
            }
            // Anything may stand in a stream: the same must come out, whatever it says.
            for (i, w) in (0u32..).zip(level.pages.iter_mut().flatten()) {
                if hash([i, 1, 2]).is_multiple_of(3) {
                    *w = hash([i, 3, 4]);
                }
            }
            compare_damaged::<T>(&volume, &mut level);
        }
    }
}

fn compare_damaged<T: Sample>(volume: &Volume, level: &mut HostLevel) {
    let at = At::default();
    for brick in coords(Extent::from(level.layout.bricks)) {
        let BrickPayload::Stored { codec, extent, bytes } = volume.brick_payload(at, brick).unwrap() else { continue };
        let entry = 4 * level.layout.brick_index(brick);
        let [page, first, len] = [level.table[entry] - 2, level.table[entry + 1], level.table[entry + 2]];
        let words = &mut level.pages[page as usize][first as usize..][..len.div_ceil(4) as usize];
        // The number of the codebook is not read from the stream; unit blocks begin somewhere inside.
        words[0] = u32::from_le_bytes(bytes[..4].try_into().unwrap());
        for w in &mut words[4..12.min(len as usize / 4)] {
            *w = (*w & 0xFF) | (((*w >> 8) % (len / 3)) << 8);
        }
        if len % 4 != 0 {
            let last = words.len() - 1;
            words[last] &= (1 << (len % 4 * 8)) - 1;
        }
        let damaged: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).take(len as usize).collect();
        let mut due = Grid::zeros(extent, T::TYPE).unwrap();
        codec.decode(&damaged, extent, &Region::whole(extent), due.view_mut()).unwrap();
        for r in coords(extent) {
            let c = std::array::from_fn(|a| (brick[a] << level.layout.brick_log2) + r[a]);
            let found = value(T::TYPE, voxel(level, c, &mut Free));
            assert_eq!(found, due.samples::<T>()[extent.index(r) as usize].value(), "{c:?} {}", T::TYPE);
        }
    }
}

#[test] // spec: ZBT-9, ZBT-11, ZBT-12
fn voxels_are_those_of_the_codec() {
    agree::<u8>(|v| v as u8);
    agree::<u16>(|v| (v * 223) as u16);
    agree::<i16>(|v| (v as i32 * 117 - 585 - 12000) as i16);
    agree::<[u8; 3]>(|v| [v as u8, (v / 2) as u8, 255 - v as u8]);
}

#[test]
fn a_voxel_costs_few_words() {
    let (_, level) = level(Extent::new(98, 37, 35), Stream::New, &Fit::host(None), |c| field(c).unwrap_or(5) as u8);
    let cost = |c: Coord| {
        let mut work = Work::default();
        voxel(&level, c, &mut work);
        work.fetches()
    };
    // The brick table; for null cells also directory, flags and the value behind the table.
    assert_eq!((cost([97, 3, 3]), cost([70, 3, 3])), (1, 1));
    assert_eq!(cost([1, 1, 1]), 5);
    // Besides, 6 words of the cell, 15 indices and codebook entries, 10 maps at most.
    let most = coords(Extent::new(32, 37, 35)).map(cost).max().unwrap();
    assert!((10..=1 + 3 + 6 + 30 + 10).contains(&most), "{most}");
}
