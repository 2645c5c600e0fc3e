//! Fast decoding of one cell, or of one of its planes (cell mode and plane mode of §3.3.2 of the paper). Its judge is `decode`.

use super::bits;
use super::fast::BrickReader;
use super::fast_cell::{ALL_NODES, Coded, Colour, Decoded, Grey, Lane, Words, decode};
use super::fast_region::{Pack, PlainColour, PlainGrey, ROW};
use super::layout::Unit;
use super::params::Stream;
use super::tables::unpack;
use crate::geometry::Coord;
use crate::voxel::{Sample, SampleType};

/// The level-1 nodes that a plane `half` (0 or 1) of nodes across `axis` consists of, node 1 in the highest bit.
const fn nodes_of(axis: usize, half: u32) -> u8 {
    let mut nodes = 0;
    let mut i = 0;
    while i < 8 {
        if i >> axis & 1 == half {
            nodes |= bits::node_bit(i + 1);
        }
        i += 1;
    }
    nodes
}

impl BrickReader<'_> {
    /// The 64 voxels of the cell that holds voxel `c` of the brick, x fastest, then y, then z. Voxels behind the end of the
    /// brick are what the stream makes of them.
    #[inline(always)]
    pub fn cell<T: Sample>(&self, c: Coord, out: &mut [T; 64]) {
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = self.v3 {
            return super::fast_v3::cell(token, self, c, out);
        }
        self.cell_portable(c, PlainColour, out);
    }

    /// The 16 voxels of the cell that holds voxel `c` of the brick whose coordinate along `axis` (0 x, 1 y, 2 z) is that of
    /// `c`; the lower of the other axes fastest.
    #[inline(always)]
    pub fn plane<T: Sample>(&self, axis: usize, c: Coord, out: &mut [T; 16]) {
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = self.v3 {
            return super::fast_v3::plane(token, self, axis, c, out);
        }
        self.plane_portable(axis, c, PlainColour, out);
    }

    #[inline(always)]
    pub(super) fn cell_portable<T: Sample>(&self, c: Coord, colour: impl Pack<i16, 16>, out: &mut [T; 64]) {
        let bytes = bytemuck::cast_slice_mut(out);
        if T::TYPE == SampleType::Rgb8 {
            self.rows::<T, _, _, 4, 16>(c, ALL_NODES, &Colour(self.tables), colour, 0..16, bytes);
        } else {
            self.rows::<T, _, _, 1, 4>(c, ALL_NODES, &Grey(self.tables), PlainGrey(T::TYPE), 0..16, bytes);
        }
    }

    #[inline(always)]
    pub(super) fn plane_portable<T: Sample>(
        &self,
        axis: usize,
        c: Coord,
        colour: impl Pack<i16, 16>,
        out: &mut [T; 16],
    ) {
        let at = c[axis & 3] & 3;
        let nodes = nodes_of(axis, at >> 1);
        let at = at as usize;
        // A plane across z is four rows that follow each other. For the others all rows are made and picked from.
        let mut all = [out[0]; 64];
        let rows = if axis == 2 { 4 * at..4 * at + 4 } else { 0..16 };
        let to: &mut [u8] = if axis == 2 { bytemuck::cast_slice_mut(out) } else { bytemuck::cast_slice_mut(&mut all) };
        if T::TYPE == SampleType::Rgb8 {
            self.rows::<T, _, _, 4, 16>(c, nodes, &Colour(self.tables), colour, rows, to);
        } else {
            self.rows::<T, _, _, 1, 4>(c, nodes, &Grey(self.tables), PlainGrey(T::TYPE), rows, to);
        }
        match axis {
            0 => out.iter_mut().zip(all.iter().skip(at).step_by(4)).for_each(|(to, from)| *to = *from),
            1 => {
                for (z, to) in out.chunks_exact_mut(4).enumerate() {
                    to.copy_from_slice(&all[16 * z + 4 * at..][..4]);
                }
            }
            _ => {}
        }
    }

    /// Decodes rows (y, z), by their numbers y + 4z, of the cell that holds `c`.
    #[inline(always)]
    fn rows<S: Sample, T: Lane, W: Words<T, L>, const L: usize, const R: usize>(
        &self,
        c: Coord,
        nodes: u8,
        words: &W,
        pack: impl Pack<T, R>,
        rows: std::ops::Range<usize>,
        out: &mut [u8],
    ) {
        let size = 4 * size_of::<S>();
        match self.coded(c) {
            None => {
                let null = unpack(self.null);
                let lane = |i: usize| if L == 1 { null[0] } else { [null[0], null[1], null[2], 0][i % 4] };
                let row: [T; R] = std::array::from_fn(|i| T::from_i32(lane(i)));
                let row = pack.pack(&row);
                put(rows, size, out, |_| row);
            }
            Some(coded) => match decode::<T, W, L, R>(&coded, words, nodes) {
                Decoded::Rows(all) => put(rows, size, out, |i| pack.pack(&all[i])),
                Decoded::Quarters(quarters) => {
                    let packed = quarters.map(|row| pack.pack(&row));
                    put(rows, size, out, |i| packed[i >> 1 & 1 | i >> 3 << 1]);
                }
            },
        }
    }

    /// The stored cell that holds `c`, `None` where it is null.
    #[inline(always)]
    fn coded(&self, c: Coord) -> Option<Coded<'_>> {
        let entry = self.entry(c);
        let cells = (entry & 0xFF) as usize;
        if cells == 0 {
            return None;
        }
        let unit = Unit { payload: self.payload, base: 4 * (entry >> 8) as usize, cells };
        let cbft = unit.cbft();
        let [x, y, z] = c;
        let n = x >> 2 & 3 | y & 12 | (z & 12) << 2;
        if !bits::has_cell(cbft, n) {
            return None;
        }
        let rank = bits::cells_before(cbft, n).count_ones() as usize;
        Some(match self.stream {
            Stream::New => Coded::new(&unit.cell_of_rank(rank)),
            Stream::Old => Coded::old(&unit.old_cell_of_rank(rank)),
        })
    }
}

/// Writes rows of `size` bytes one after the other, whole vectors where another row follows.
#[inline(always)]
fn put(rows: std::ops::Range<usize>, size: usize, out: &mut [u8], row: impl Fn(usize) -> [u8; ROW]) {
    for (k, i) in rows.enumerate() {
        let (to, row) = (k * size, row(i));
        if to + ROW <= out.len() {
            out[to..to + ROW].copy_from_slice(&row);
        } else {
            out[to..to + size].copy_from_slice(&row[..size]);
        }
    }
}
