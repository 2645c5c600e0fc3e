//! Namesake of `shaders/source_zerobit.wgsl`: voxels out of zerobit streams as they are stored, by whole numbers alone.

use super::counter::Counter;
use crate::gpu::level::{BOOK_WORDS, HostLevel, Store, TABLE_STORED, TABLE_WORDS};
use crate::voxel::SampleType;

/// A voxel, or what is added to one: a number per component, of scalars the first.
type Int = [i32; 3];

/// Where a payload lies, and what its samples are.
struct Payload<'a> {
    level: &'a HostLevel,
    sample: SampleType,
    new_stream: bool,
    page: usize,
    first: u32,
    words: u32,
    book: u32,
}

/// Voxel `c` of a zerobit level: its components, of scalars the first. 0 where the level is none, or `c` outside.
pub fn voxel(level: &HostLevel, c: [u32; 3], n: &mut impl Counter) -> Int {
    let Store::Zerobit { sample, new_stream } = level.layout.store else { return [0; 3] };
    let log2 = level.layout.brick_log2;
    let brick = c.map(|v| v >> log2);
    let e = entry(level, level.layout.brick_index(brick), n);
    if e[0] < TABLE_STORED {
        return raw_value(sample, e[3]);
    }
    let page = (e[0] - TABLE_STORED) as usize;
    let s = Payload { level, sample, new_stream, page, first: e[1], words: e[2].div_ceil(4), book: BOOK_WORDS * e[3] };
    let r: [u32; 3] = std::array::from_fn(|a| c[a] - (brick[a] << log2));
    // The last bricks of a level have fewer unit blocks.
    let extent = level.layout.extent.to_array();
    let units: [u32; 3] = std::array::from_fn(|a| (1u32 << log2).min(extent[a] - (brick[a] << log2)).div_ceil(16));
    let u = r.map(|v| v >> 4);
    let unit = word(&s, 4 + u[0] + units[0] * (u[1] + units[1] * u[2]), n);
    let cell = r.map(|v| v >> 2 & 3);
    let flag = cell[0] + 4 * cell[1] + 16 * cell[2];
    let base = unit >> 8;
    let cells = [word(&s, base, n), word(&s, base + 1, n)];
    if unit & 0xFF == 0 || seven(cells, flag) & 1 == 0 {
        let null = level.table.len() / TABLE_WORDS as usize - 1;
        return raw_value(sample, entry(level, null, n)[3]);
    }
    let rank = below(cells, flag);
    let at = r.map(|v| v & 3);
    let value = match s.new_stream {
        true => new_cell(&s, base, unit & 0xFF, rank, at, n),
        false => old_cell(&s, base, unit & 0xFF, rank, at, n),
    };
    let [least, most] = match sample {
        SampleType::I16 => [-32768, 32767],
        SampleType::U16 => [0, 65535],
        _ => [0, 255],
    };
    value.map(|v| v.clamp(least, most))
}

/// Voxel `at` of the stored cell that `rank` others of `cells` precede, in the unit block that begins with word `base`.
fn new_cell(s: &Payload<'_>, base: u32, cells: u32, rank: u32, at: [u32; 3], n: &mut impl Counter) -> Int {
    let own = word(s, base + 2 + rank, n);
    let last = word(s, base + 1 + cells, n);
    // Zerobits and maps; behind those of the last cell, details.
    let zsms = 4 * base + 8 + 5 * cells;
    let end = zsms + (last >> 16 & 0x7FFF);
    let details = end + 1 + (last >> 31) + byte(s, end, n).count_ones() + (own & 0xFFFF);
    let zerobits = zsms + (own >> 16 & 0x7FFF);
    let level_0 = own >> 31;
    let level_1 = byte(s, zerobits, n);
    let group = at.map(|v| v >> 1);
    let index = byte(s, 4 * base + 8 + 4 * cells + rank, n);
    let mut value = average(s, index, n);
    if level_0 == 1 {
        let map = byte(s, zerobits + 1, n);
        value = add(value, node(s, map, details, group, n));
    }
    let node_1 = group[0] + 2 * group[1] + 4 * group[2];
    if level_1 >> (7 - node_1) & 1 == 1 {
        let before = level_0 + (level_1 >> (8 - node_1)).count_ones();
        let earlier: u32 = (0..before).map(|k| (byte(s, zerobits + 1 + k, n) & 0x7F).count_ones()).sum();
        let map = byte(s, zerobits + 1 + before, n);
        value = add(value, node(s, map, details + earlier, at.map(|v| v & 1), n));
    }
    value
}

/// The same in the scheme before: 64 flags per cell.
fn old_cell(s: &Payload<'_>, base: u32, cells: u32, rank: u32, at: [u32; 3], n: &mut impl Counter) -> Int {
    let flags = [word(s, base + 2 + 2 * rank, n), word(s, base + 3 + 2 * rank, n)];
    let offset = word(s, base + 2 + 2 * cells + (rank >> 1), n) >> (16 * (rank & 1)) & 0xFFFF;
    let indices = 4 * base + 8 + 10 * cells + offset;
    let mut value = Int::default();
    if flags[0] & 1 == 1 {
        let index = byte(s, indices, n);
        value = average(s, index, n);
    }
    let group = at.map(|v| v >> 1);
    let node_1 = 8 + 7 * (group[0] + 2 * group[1] + 4 * group[2]);
    // Maps have their flags the other way round.
    let map = |p| seven(flags, p).reverse_bits() >> 25;
    value = add(value, node(s, map(1), indices + (flags[0] & 1), group, n));
    add(value, node(s, map(node_1), indices + below(flags, node_1), at.map(|v| v & 1), n))
}

/// What the seven details of a node add to the voxel (or group) `odd` of it; their indices begin at byte `at`.
fn node(s: &Payload<'_>, map: u32, at: u32, odd: [u32; 3], n: &mut impl Counter) -> Int {
    let letters = 4 * odd[0] + 2 * odd[1] + odd[2];
    let mut place = at;
    let mut sum = Int::default();
    for j in 1..8u32 {
        if map >> (7 - j) & 1 == 1 {
            let index = byte(s, place, n);
            let detail = detail(s, index, n);
            sum = add(sum, if (j & letters).count_ones() & 1 == 1 { detail.map(|v| -v) } else { detail });
            place += 1;
        }
    }
    sum
}

/// Of 64 flags, the seven from `p` on.
const fn seven(flags: [u32; 2], p: u32) -> u32 {
    ((flags[0] as u64 | (flags[1] as u64) << 32) >> p) as u32 & 0x7F
}

/// Of 64 flags, how many are set before `p`.
const fn below(flags: [u32; 2], p: u32) -> u32 {
    ((flags[0] as u64 | (flags[1] as u64) << 32) & ((1 << p) - 1)).count_ones()
}

fn byte(s: &Payload<'_>, at: u32, n: &mut impl Counter) -> u32 {
    word(s, at >> 2, n) >> (8 * (at & 3)) & 0xFF
}

fn word(s: &Payload<'_>, at: u32, n: &mut impl Counter) -> u32 {
    if at >= s.words {
        return 0;
    }
    n.count(|w| w.stream_fetches += 1);
    s.level.pages[s.page][(s.first + at) as usize]
}

fn average(s: &Payload<'_>, index: u32, n: &mut impl Counter) -> Int {
    n.count(|w| w.stream_fetches += 1);
    let w = s.level.books[(s.book + index) as usize];
    match s.sample {
        SampleType::Rgb8 => [w, w >> 8, w >> 16].map(|v| (v & 0xFF).cast_signed()),
        _ => [w.cast_signed(), 0, 0],
    }
}

fn detail(s: &Payload<'_>, index: u32, n: &mut impl Counter) -> Int {
    n.count(|w| w.stream_fetches += 1);
    let w = s.level.books[(s.book + 256 + index) as usize];
    match s.sample {
        SampleType::Rgb8 => [w << 24, w << 16, w << 8].map(|v| v.cast_signed() >> 24),
        _ => [w.cast_signed(), 0, 0],
    }
}

/// A sample of the volume, from its bytes.
const fn raw_value(sample: SampleType, w: u32) -> Int {
    match sample {
        SampleType::Rgb8 => [(w & 0xFF) as i32, (w >> 8 & 0xFF) as i32, (w >> 16 & 0xFF) as i32],
        SampleType::I16 => [(w << 16) as i32 >> 16, 0, 0],
        _ => [w as i32, 0, 0],
    }
}

/// What the brick table says about a brick.
fn entry(level: &HostLevel, brick: usize, n: &mut impl Counter) -> [u32; 4] {
    n.count(|w| w.stream_fetches += 1);
    let at = brick * TABLE_WORDS as usize;
    std::array::from_fn(|i| level.table[at + i])
}

fn add(a: Int, b: Int) -> Int {
    std::array::from_fn(|c| a[c] + b[c])
}

#[cfg(test)]
mod tests;
