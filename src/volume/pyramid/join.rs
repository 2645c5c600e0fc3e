//! Means, minima and maxima: pairs along x are joined, then pairs of those along y, then along z (spec: VOL-12).

use super::{Block, Pyramid, Rows};
use crate::container::Downsample;
use crate::grid::View;
use crate::voxel::{SampleType, SampleValue};
use bytemuck::Pod;

/// A sum or an extreme on its way up, whatever its type: the bits of an `i64` or `f64`.
pub(super) type Joined = u64;

/// Sums and extremes in a type that holds any number of samples: exactly for integers, in f64 for floats.
trait Lane: Copy + Send + Sync {
    fn join<const OP: u8>(self, other: Self) -> Self;
    fn to_bits(self) -> Joined;
    fn of_bits(bits: Joined) -> Self;
}

const MEAN: u8 = Downsample::Mean as u8;
const MIN: u8 = Downsample::Min as u8;
const MAX: u8 = Downsample::Max as u8;

impl Lane for i64 {
    #[inline(always)]
    fn join<const OP: u8>(self, other: i64) -> i64 {
        match OP {
            MEAN => self + other,
            MIN => self.min(other),
            _ => self.max(other),
        }
    }
    fn to_bits(self) -> Joined {
        self.cast_unsigned()
    }
    fn of_bits(bits: Joined) -> i64 {
        bits.cast_signed()
    }
}

impl Lane for f64 {
    #[inline(always)]
    fn join<const OP: u8>(self, other: f64) -> f64 {
        // −0 is smaller than +0, so that no order of joining shows.
        match OP {
            MEAN => self + other,
            MIN => {
                if self.total_cmp(&other).is_le() {
                    self
                } else {
                    other
                }
            }
            _ => {
                if self.total_cmp(&other).is_ge() {
                    self
                } else {
                    other
                }
            }
        }
    }
    fn to_bits(self) -> Joined {
        f64::to_bits(self)
    }
    fn of_bits(bits: Joined) -> f64 {
        f64::from_bits(bits)
    }
}

/// One component of a sample.
trait Component: Pod + Send + Sync {
    type Lane: Lane;
    /// As a lane; NaN and infinities become `null`.
    fn lane(self, null: Self) -> Self::Lane;
    /// A lane that is one of the samples.
    fn exact(lane: Self::Lane) -> Self;
    /// A sum divided by the number of its terms, rounded once.
    fn mean(sum: Self::Lane, count: u64) -> Self;
}

/// `sum / count` rounded half up: floor((2·sum + count) / (2·count)).
#[inline(always)]
fn rdiv(sum: i64, count: u64) -> i64 {
    let twice = 2 * sum + count.cast_signed();
    // Mostly a coarse voxel is whole, and the count a power of two: floor division is a shift.
    if count.is_power_of_two() {
        twice >> (count.trailing_zeros() + 1)
    } else {
        twice.div_euclid(2 * count.cast_signed())
    }
}

macro_rules! integer {
    ($($t:ty),*) => {$(
        #[allow(clippy::cast_possible_truncation, reason = "means and extremes lie between the samples they are made of")]
        impl Component for $t {
            type Lane = i64;
            #[inline(always)]
            fn lane(self, _: Self) -> i64 {
                i64::from(self)
            }
            #[inline(always)]
            fn exact(lane: i64) -> Self {
                lane as $t
            }
            #[inline(always)]
            fn mean(sum: i64, count: u64) -> Self {
                rdiv(sum, count) as $t
            }
        }
    )*};
}
integer!(u8, u16, i16);

#[allow(clippy::cast_possible_truncation, reason = "the one rounding that is meant")]
impl Component for f32 {
    type Lane = f64;
    #[inline(always)]
    fn lane(self, null: f32) -> f64 {
        f64::from(if self.is_finite() { self } else { null })
    }
    #[inline(always)]
    fn exact(lane: f64) -> Self {
        lane as f32
    }
    #[inline(always)]
    fn mean(sum: f64, count: u64) -> Self {
        (sum / count as f64) as f32
    }
}

/// Calls `$f::<component, components, OP>` for a pyramid.
macro_rules! dispatch {
    ($p:expr, $f:ident($($arg:expr),*)) => {
        match $p.null {
            SampleValue::U8(_) => dispatch!(@op $p, $f, u8, 1, ($($arg),*)),
            SampleValue::U16(_) => dispatch!(@op $p, $f, u16, 1, ($($arg),*)),
            SampleValue::I16(_) => dispatch!(@op $p, $f, i16, 1, ($($arg),*)),
            SampleValue::F32(_) => dispatch!(@op $p, $f, f32, 1, ($($arg),*)),
            SampleValue::Rgb8(_) => dispatch!(@op $p, $f, u8, 3, ($($arg),*)),
        }
    };
    (@op $p:expr, $f:ident, $S:ty, $C:literal, ($($arg:expr),*)) => {
        match $p.downsample {
            Downsample::Min => $f::<$S, $C, MIN>($($arg),*),
            Downsample::Max => $f::<$S, $C, MAX>($($arg),*),
            Downsample::Mean | Downsample::Nearest => $f::<$S, $C, MEAN>($($arg),*),
        }
    };
}

/// Levels 1 to the last whose voxels lie inside a brick, of one row of bricks.
pub(super) fn block(p: &Pyramid, view: &View<'_>, y: u32, z: u32) -> Block {
    dispatch!(p, typed_block(p, view, y, z))
}

fn typed_block<S: Component, const C: usize, const OP: u8>(p: &Pyramid, view: &View<'_>, y: u32, z: u32) -> Block {
    // Replaces non-finite floats; of other types there is nothing to replace.
    let null: S = match p.null {
        SampleValue::F32(v) => bytemuck::cast_slice(&[v])[0],
        _ => S::zeroed(),
    };
    let row = |y: u32, z: u32| -> &[S] {
        let start = y as usize * view.row_pitch + z as usize * view.slice_pitch;
        bytemuck::cast_slice(&view.bytes[start..start + view.extent.x as usize * C * size_of::<S>()])
    };
    let mut rows = Vec::new();
    let mut size = [view.extent.x, view.extent.y, view.extent.z];
    let mut lanes: Vec<S::Lane> = Vec::new();
    for level in 1..=p.inner() {
        lanes = if level == 1 {
            halve::<_, _, C, OP>(size, row, |s: S| s.lane(null))
        } else {
            let below = &lanes;
            let len = size[0] as usize * C;
            let row = |y: u32, z: u32| &below[(z * size[1] + y) as usize * len..][..len];
            halve::<_, _, C, OP>(size, row, |lane| lane)
        };
        size = size.map(|n| n.div_ceil(2));
        let (y, z) = (y >> level, z >> level);
        let bytes = samples::<S, C, OP>(p, level, &lanes, [size[1], size[2]], [y, z]);
        let row_bytes = size[0] as usize * C * size_of::<S>();
        rows.push(Rows { level, y, z, rows: size[1], row_bytes, bytes });
    }
    let top = if p.coarsest > p.brick_log2 { lanes.into_iter().map(Lane::to_bits).collect() } else { Vec::new() };
    Block { rows, top }
}

/// Joins eight neighbours each; at the far ends those that exist. `row` gives rows of `size` voxels.
fn halve<'a, V: Copy + 'a, L: Lane, const C: usize, const OP: u8>(
    size: [u32; 3],
    row: impl Fn(u32, u32) -> &'a [V],
    lane: impl Fn(V) -> L + Copy,
) -> Vec<L> {
    let [w, h, d] = size.map(|n| n.div_ceil(2));
    let len = w as usize * C;
    let mut out = Vec::with_capacity(len * h as usize * d as usize);
    let mut other = Vec::with_capacity(len);
    for z in 0..d {
        for y in 0..h {
            let first = out.len();
            pairs::<_, _, C, OP>(row(2 * y, 2 * z), lane, &mut out);
            let more_y = 2 * y + 1 < size[1];
            if more_y {
                other.clear();
                pairs::<_, _, C, OP>(row(2 * y + 1, 2 * z), lane, &mut other);
                join_rows::<_, OP>(&mut out[first..], &other);
            }
            if 2 * z + 1 < size[2] {
                let second = out.len();
                pairs::<_, _, C, OP>(row(2 * y, 2 * z + 1), lane, &mut out);
                if more_y {
                    other.clear();
                    pairs::<_, _, C, OP>(row(2 * y + 1, 2 * z + 1), lane, &mut other);
                    join_rows::<_, OP>(&mut out[second..], &other);
                }
                let (below, above) = out[first..].split_at_mut(len);
                join_rows::<_, OP>(below, above);
                out.truncate(second);
            }
        }
    }
    out
}

/// Neighbours along x, joined; a last one without a neighbour as it is.
#[inline(always)]
fn pairs<V: Copy, L: Lane, const C: usize, const OP: u8>(row: &[V], lane: impl Fn(V) -> L, out: &mut Vec<L>) {
    if C == 1 {
        let (pairs, rest) = row.as_chunks::<2>();
        out.extend(pairs.iter().map(|&[a, b]| lane(a).join::<OP>(lane(b))));
        out.extend(rest.iter().map(|&v| lane(v)));
        return;
    }
    for pair in row.chunks(2 * C) {
        for c in 0..C {
            let first = lane(pair[c]);
            out.push(pair.get(C + c).map_or(first, |&second| first.join::<OP>(lane(second))));
        }
    }
}

#[inline(always)]
fn join_rows<L: Lane, const OP: u8>(to: &mut [L], other: &[L]) {
    for (to, &other) in to.iter_mut().zip(other) {
        *to = to.join::<OP>(other);
    }
}

/// Voxels of level 0 along an axis of `n` that voxel `c` of `level` covers.
fn covered(c: u32, level: u8, n: u32) -> u64 {
    u64::from(((u64::from(c) + 1) << level).min(u64::from(n)) as u32 - (c << level))
}

/// The samples of `level` that lanes stand for: `size` rows and planes from `start` on.
fn samples<S: Component, const C: usize, const OP: u8>(
    p: &Pyramid,
    level: u8,
    lanes: &[S::Lane],
    size: [u32; 2],
    start: [u32; 2],
) -> Vec<u8> {
    let width = p.extent(level).x;
    let len = width as usize * C;
    let mut bytes = vec![0u8; lanes.len() * size_of::<S>()];
    let mut rows = bytes.chunks_exact_mut(len * size_of::<S>()).zip(lanes.chunks_exact(len));
    let mut buffer = vec![S::zeroed(); len];
    for z in 0..size[1] {
        for y in 0..size[0] {
            let (to, lanes) = rows.next().expect("as many rows as lanes");
            if OP == MEAN {
                let count = covered(start[0] + y, level, p.fine.y) * covered(start[1] + z, level, p.fine.z);
                // All but the last of a row cover as much as they can.
                let (whole, last) = (count << level, count * covered(width - 1, level, p.fine.x));
                let (inner, end) = lanes.split_at(len - C);
                for (to, &sum) in buffer.iter_mut().zip(inner) {
                    *to = S::mean(sum, whole);
                }
                for (to, &sum) in buffer[len - C..].iter_mut().zip(end) {
                    *to = S::mean(sum, last);
                }
            } else {
                for (to, &lane) in buffer.iter_mut().zip(lanes) {
                    *to = S::exact(lane);
                }
            }
            to.copy_from_slice(bytemuck::cast_slice(&buffer));
        }
    }
    bytes
}

/// Plane `z` of `level` from one or two planes of the level below it: its lanes, and its samples.
pub(super) fn planes(p: &Pyramid, level: u8, z: u32, a: &[Joined], b: Option<&[Joined]>) -> (Vec<Joined>, Vec<u8>) {
    dispatch!(p, typed_planes(p, level, z, a, b))
}

fn typed_planes<S: Component, const C: usize, const OP: u8>(
    p: &Pyramid,
    level: u8,
    z: u32,
    a: &[Joined],
    b: Option<&[Joined]>,
) -> (Vec<Joined>, Vec<u8>) {
    let below = p.extent(level - 1);
    let size = [below.x, below.y, if b.is_some() { 2 } else { 1 }];
    let len = below.x as usize * C;
    let row = |y: u32, z: u32| &(if z == 0 { a } else { b.unwrap_or(a) })[y as usize * len..][..len];
    let lanes: Vec<S::Lane> = halve::<_, _, C, OP>(size, row, S::Lane::of_bits);
    let bytes = samples::<S, C, OP>(p, level, &lanes, [p.extent(level).y, 1], [0, z]);
    (lanes.into_iter().map(Lane::to_bits).collect(), bytes)
}

/// Bytes of working memory for one row of bricks of `x` voxels, `edge` high and deep, at most.
pub(in crate::volume) fn working_bytes(x: u32, edge: u32, t: SampleType) -> u64 {
    let lanes = u64::from(x.div_ceil(2)) * u64::from(edge / 2).pow(2) * t.components() as u64;
    // Lanes of level 1 and those of level 2 that are made of them; samples of all levels.
    lanes * 9 + lanes * 4 * 2 / 7
}
