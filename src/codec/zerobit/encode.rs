//! Encoding a brick by a plan: coefficients to indices, indices to the streams of unit blocks (spec chapter 14, §4 to §7;
//! §3.2 of the paper).

use super::Zerobit;
use super::bits;
use super::book::{Book, Word};
use super::layout::{Layout, PREFIX_BYTES};
use super::params::Stream;
use super::plan::Plan;
use super::select::keep;
use super::train::{average_of, detail_of, each_detail, each_stored, with_component};
use super::transform::{CellCoefficients, Number};
use crate::error::{Error, Result};
use crate::grid::View;
use crate::limits;
use crate::voxel::SampleType;

/// A stored cell: index of the average, and of the details by position.
struct CellCode {
    average: u8,
    /// Bit p: the detail at position p is stored.
    flags: u64,
    /// Indices of details, by ascending position.
    details: Vec<u8>,
}

impl Zerobit {
    /// Appends the payload of a brick to `out`; the same brick and plan give the same bytes.
    ///
    /// # Errors
    /// `E_LIMIT` for views of more than 4,096 unit blocks, `E_PARAM` where there is no plan, `E_REF` where its codebook is missing.
    pub(in crate::codec) fn encode(&self, src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
        let plan = self.plan().ok_or_else(|| {
            Error::param("codec", "zerobit encodes by a plan: survey the level, train a codebook, then use `planned`")
        })?;
        let start = out.len();
        let units = Layout::new(src.extent).units.voxels();
        // As many as a brick of 256³ has: offsets then fit their 24 bits.
        limits::check("zerobit.unit_blocks", units, 4096)?;
        let units = units as usize;
        out.extend(plan.book.to_le_bytes());
        let book = self.book(&out[start..])?;
        out.extend(u32::try_from(units).expect("at most 4096").to_le_bytes());
        out.resize(start + PREFIX_BYTES + 4 * units, 0);
        let t = src.sample_type;
        with_component!(t, S, C => {
            let null = self.null_components::<C>();
            let mut scratch = Vec::new();
            let mut codes: Vec<CellCode> = Vec::new();
            self.each_unit::<S, C>(src, |index, unit| {
                let kept = keep(unit, plan.cut, &mut scratch);
                let (mut cbft, mut stored) = (0u64, 0);
                each_stored(unit, &kept, |n, cell, bits| {
                    if stored == codes.len() {
                        codes.push(CellCode { average: 0, flags: 0, details: Vec::with_capacity(63) });
                    }
                    code(&cell, bits, null, t, book, plan, &mut codes[stored]);
                    stored += 1;
                    cbft |= 1 << n;
                });
                if stored == 0 {
                    return;
                }
                // spec: ZBT-9, ZBT-11, ZBT-28
                let base = out.len() - start;
                let entry = u32::try_from(base / 4).expect("5,004 bytes per unit block at most") << 8 | stored as u32;
                let at = start + PREFIX_BYTES + 4 * index;
                out[at..at + 4].copy_from_slice(&entry.to_le_bytes());
                match self.stream() {
                    Stream::New => write_new(cbft, &codes[..stored], out),
                    Stream::Old => write_old(cbft, &codes[..stored], out),
                }
                out.resize(start + (out.len() - start).next_multiple_of(4), 0);
            });
        });
        Ok(())
    }
}

/// Finds the words of a cell.
fn code<N: Number, const C: usize>(
    cell: &CellCoefficients<'_, N, C>,
    bits: u64,
    null: [i32; C],
    t: SampleType,
    book: &Book,
    plan: &Plan,
    code: &mut CellCode,
) {
    code.average = plan.coder.average.find(average_of(cell, null));
    code.flags = 0;
    code.details.clear();
    each_detail(bits, |p| {
        let word = detail_of(cell, p, t);
        if word == Word::default() {
            return; // rounded to nothing: to be null gives the same voxels for fewer bytes
        }
        let index = plan.coder.detail.find(word);
        if book.detail(index) != Word::default() {
            code.flags |= 1 << p;
            code.details.push(index);
        }
    });
}

/// Node and detail of a position.
const fn node_and_detail(p: u32) -> (u32, u32) {
    ((p - 1) / 7, (p - 1) % 7 + 1)
}

// spec: ZBT-14, ZBT-15, ZBT-16, ZBT-17, ZBT-18, ZBT-19, ZBT-20, ZBT-21
fn write_new(cbft: u64, codes: &[CellCode], out: &mut Vec<u8>) {
    out.extend(cbft.to_le_bytes());
    let mut zsms = Vec::with_capacity(640);
    let mut detail_offset = 0;
    for code in codes {
        let mut maps = [0u8; 9];
        each_detail(code.flags, |p| {
            let (i, j) = node_and_detail(p);
            maps[i as usize] |= bits::detail_bit(j);
        });
        let level_0 = maps[0] != 0;
        let offsets = detail_offset | (zsms.len() as u32) << 16 | u32::from(level_0) << 31;
        out.extend(offsets.to_le_bytes());
        zsms.push((1..=8).filter(|&i| maps[i as usize] != 0).fold(0, |all, i| all | bits::node_bit(i)));
        maps[0] |= if level_0 { bits::LEVEL_0 } else { 0 };
        zsms.extend(maps.into_iter().filter(|&map| map != 0));
        detail_offset += code.details.len() as u32;
    }
    out.extend(codes.iter().map(|code| code.average));
    out.extend(zsms);
    codes.iter().for_each(|code| out.extend(&code.details));
}

// spec: ZBT-30, ZBT-31
fn write_old(cbft: u64, codes: &[CellCode], out: &mut Vec<u8>) {
    out.extend(cbft.to_le_bytes());
    codes.iter().for_each(|code| out.extend((code.flags | 1).to_le_bytes()));
    let mut offset = 0u16;
    for code in codes {
        out.extend(offset.to_le_bytes());
        offset += 1 + code.details.len() as u16;
    }
    for code in codes {
        out.push(code.average);
        out.extend(&code.details);
    }
}
