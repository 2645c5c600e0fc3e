//! Half and quarter resolution straight from a payload: the means that it holds anyway (Bajaj et al. 2001, §2.2; spec
//! chapter 14, §9).
//!
//! A cell holds its own mean and, with the details of its level-0 node, those of its eight 2³ groups. Nothing of level 1
//! is looked at.

use super::bits::Popcount;
use super::book::Word;
use super::decode::{Coefficients, Context};
use super::layout::{CELL_EDGE, Layout, unit};
use super::params::Stream;
use super::tally::{Case, Tally};
use super::{Zerobit, value_of};
use crate::codec::{Codec, check_view};
use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::ViewMut;
use crate::voxel::Sample;
use crate::with_sample;

/// Most halvings: a cell is then one voxel.
pub const MAX_STEPS: u8 = 2;

impl Codec {
    /// Decodes the part `region` of a brick whose axes are halved `steps` times (1 or 2) into `dst`.
    ///
    /// Voxel (x, y, z) is the mean that the payload holds for the group of 2³ or 4³ voxels from (x, y, z) · 2^`steps` on;
    /// the brick has ⌈extent / 2^`steps`⌉ of them. `brick` is in voxels, `region` in groups.
    ///
    /// # Errors
    /// As [`Codec::decode`]; `E_PARAM` also where the codec holds no means, and for other numbers of steps.
    pub fn decode_reduced(
        &self,
        payload: &[u8],
        brick: Extent,
        steps: u8,
        region: &Region,
        dst: ViewMut<'_>,
    ) -> Result<()> {
        let Codec::Zerobit(z) = self else {
            let message = format!("a {} brick holds no means of its voxels; zerobit bricks do", self.name());
            return Err(Error::param("reduce", message));
        };
        check_steps(steps)?;
        self.supports(dst.sample_type)?;
        self.check_len(payload, dst.sample_type, brick)?;
        region.check(brick.div_ceil(Extent::cube(1 << steps)))?;
        if dst.extent != region.extent() {
            let message = format!("the destination holds {}, the region {}", dst.extent, region.extent());
            return Err(Error::param("dst", message));
        }
        check_view(dst.bytes.len(), dst.extent, dst.sample_type, dst.row_pitch, dst.slice_pitch)?;
        with_sample!(dst.sample_type, T => z.decode_reduced::<T>(payload, brick, steps, region, dst, &mut ()))
    }
}

/// Checks a number of halvings.
///
/// # Errors
/// `E_PARAM`.
pub fn check_steps(steps: u8) -> Result<()> {
    if (1..=MAX_STEPS).contains(&steps) {
        return Ok(());
    }
    Err(Error::param("reduce", format!("{steps} halvings; a brick can be halved once or twice")))
}

impl Zerobit {
    /// The part `region` of a halved brick; all arguments have been checked. // spec: ZBT-25
    fn decode_reduced<T: Sample>(
        &self,
        payload: &[u8],
        brick: Extent,
        steps: u8,
        region: &Region,
        dst: ViewMut<'_>,
        tally: &mut impl Tally,
    ) -> Result<()> {
        let context = Context { book: self.book(payload)?, sample_type: T::TYPE, count: Popcount };
        let layout = Layout::new(brick);
        let edge = CELL_EDGE >> steps;
        let cells = |a: usize| region.start[a] / edge..region.end[a].div_ceil(edge);
        for cz in cells(2) {
            for cy in cells(1) {
                for cx in cells(0) {
                    let (index, n) = layout.locate([cx, cy, cz].map(|c| c * CELL_EDGE));
                    let means = match unit(payload, index) {
                        None => {
                            tally.case(Case::Void);
                            None
                        }
                        Some(unit) => match self.stream() {
                            Stream::New => unit.cell(n, Popcount).map(|cell| means(&context, &cell, steps, tally)),
                            Stream::Old => unit.old_cell(n, Popcount).map(|cell| means(&context, &cell, steps, tally)),
                        }
                        .or_else(|| {
                            tally.case(Case::NullCell);
                            None
                        }),
                    };
                    let wanted = Region::at([cx, cy, cz].map(|c| c * edge), Extent::cube(edge)).intersect(region);
                    for z in wanted.start[2]..wanted.end[2] {
                        for y in wanted.start[1]..wanted.end[1] {
                            for x in wanted.start[0]..wanted.end[0] {
                                let at = x % edge + y % edge * 2 + z % edge * 4;
                                // spec: ZBT-26
                                let value = means.map_or(self.null(), |m| value_of(m[at as usize], T::TYPE));
                                let to = (x - region.start[0]) as usize * size_of::<T>()
                                    + (y - region.start[1]) as usize * dst.row_pitch
                                    + (z - region.start[2]) as usize * dst.slice_pitch;
                                let value: T = value.typed();
                                dst.bytes[to..to + size_of::<T>()].copy_from_slice(bytemuck::bytes_of(&value));
                            }
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

/// The means of a cell's groups, x fastest; after two steps the first one is that of all 64 voxels.
fn means(context: &Context<'_, Popcount>, cell: &impl Coefficients, steps: u8, tally: &mut impl Tally) -> [Word; 8] {
    if steps == 1 { context.means(cell, tally) } else { [context.mean_of_all(cell, tally); 8] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::zerobit::tally::Counts;
    use crate::codec::zerobit::{Book, Params};
    use crate::voxel::{SampleType, SampleValue};
    use std::sync::Arc;

    /// Two unit blocks along x: three cells in the first, with one level-0 detail each, the second void.
    fn payload() -> Vec<u8> {
        let mut p = vec![0; 16];
        p[4] = 2;
        p.extend([3, 6, 0, 0, 0, 0, 0, 0]); // the first at byte 4 · 6
        p.extend(0x8000_0000_0000_0003u64.to_le_bytes());
        for rank in 0..3u32 {
            p.extend((rank | (0x8000 | (2 * rank)) << 16).to_le_bytes());
        }
        p.extend([0, 1, 2]);
        p.extend([0, 0xC0, 0, 0xC0, 0, 0xC0]); // detail 1: along z
        p.extend([0, 0, 0]);
        p
    }

    fn codec() -> Codec {
        let words = |v: &[i32]| v.iter().map(|&v| [v, 0, 0]).collect();
        let book = Book::new(SampleType::U8, words(&[10, 20, 250]), words(&[7])).unwrap();
        let z = Zerobit::new(Stream::New, Params::default(), SampleValue::U8(99));
        Codec::Zerobit(z).with_books(&Arc::from([book]))
    }

    fn counted(steps: u8) -> (Counts, Vec<u8>) {
        let (brick, codec) = (Extent::new(32, 16, 16), codec());
        let Codec::Zerobit(z) = &codec else { unreachable!() };
        let extent = brick.div_ceil(Extent::cube(1 << steps));
        let mut out = vec![0; extent.voxels() as usize];
        let mut counts = Counts::default();
        let dst = ViewMut::dense(&mut out, extent, SampleType::U8);
        z.decode_reduced::<u8>(&payload(), brick, steps, &Region::whole(extent), dst, &mut counts).unwrap();
        (counts, out)
    }

    #[test] // spec: ZBT-25, ZBT-26
    fn a_quarter_costs_one_decode_per_cell_and_a_half_eight() {
        let (counts, out) = counted(2);
        assert_eq!((counts.decodes(), counts.vector_ops), (3, 0));
        assert_eq!((counts.of(Case::Void), counts.of(Case::NullCell)), (64, 61));
        assert_eq!((&out[..3], out[8 * 4 * 4 - 5]), (&[10, 20, 99][..], 250));
        let (counts, out) = counted(1);
        assert_eq!((counts.decodes(), counts.vector_ops), (3 * 8, 3 * 24));
        let at = |x: usize, y: usize, z: usize| out[x + 16 * (y + 8 * z)];
        // 250 + 7 is over the range: one clamp, of a copy.
        assert_eq!([at(0, 0, 0), at(1, 1, 1), at(2, 0, 0), at(3, 1, 1)], [17, 3, 27, 13]);
        assert_eq!([at(6, 6, 6), at(7, 7, 7), at(15, 7, 7), at(4, 0, 0)], [255, 243, 99, 99]);
    }

    #[test]
    fn parts_are_cut_from_the_whole_and_wrong_arguments_are_refused() {
        let (brick, codec, payload) = (Extent::new(30, 16, 15), codec(), payload());
        for steps in 1..=2 {
            let extent = brick.div_ceil(Extent::cube(1 << steps));
            let mut whole = vec![0; extent.voxels() as usize];
            let dst = ViewMut::dense(&mut whole, extent, SampleType::U8);
            codec.decode_reduced(&payload, brick, steps, &Region::whole(extent), dst).unwrap();
            let region = Region { start: [1, 0, 1], end: [4, 3, 3] };
            let mut part = vec![0; region.extent().voxels() as usize];
            let dst = ViewMut::dense(&mut part, region.extent(), SampleType::U8);
            codec.decode_reduced(&payload, brick, steps, &region, dst).unwrap();
            for (i, v) in (0..).zip(&part) {
                let [x, y, z] = [i % 3 + 1, i / 3 % 3, i / 9 + 1];
                assert_eq!(*v, whole[extent.index([x, y, z]) as usize], "{steps}, {x} {y} {z}");
            }
        }
        let refused = |codec: &Codec, steps, extent: Extent, len: usize| {
            let mut out = vec![0; extent.voxels() as usize];
            let region = Region::whole(extent);
            let dst = ViewMut::dense(&mut out, extent, SampleType::U8);
            codec.decode_reduced(&payload[..len], brick, steps, &region, dst).unwrap_err()
        };
        use crate::error::Code;
        let full = payload.len();
        assert_eq!(refused(&codec, 0, Extent::cube(1), full).code(), Code::Param);
        assert_eq!(refused(&codec, 3, Extent::cube(1), full).code(), Code::Param);
        assert_eq!(refused(&codec, 1, Extent::new(16, 8, 8), full).code(), Code::Range);
        assert_eq!(refused(&codec, 1, Extent::cube(1), 20).code(), Code::Size);
        let raw = refused(&Codec::Raw, 1, Extent::cube(1), full);
        assert!(raw.code() == Code::Param && raw.message().contains("zerobit"), "{raw}");
    }
}
