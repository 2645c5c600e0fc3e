//! Codec `zerobit`: Haar wavelets on cells of 4³ voxels, vector-quantised, in streams with random access (Bajaj, Ihm,
//! Park 2001: *3D RGB image compression for interactive applications*; spec chapter 14).
//!
//! A brick is cut into unit blocks of 16³ voxels, those into 64 cells. A payload is
//! `prefix | directory | unit blocks`, a unit block `CBFT | offsets | averages | ZSMS | DIS`:
//!
//! | part | holds |
//! |---|---|
//! | prefix | index of the codebook, number of unit blocks |
//! | directory | per unit block: NNNC, and where it starts; 0 where all its cells are null |
//! | CBFT | which of the 64 cells are stored |
//! | offsets, averages | per stored cell: where its parts of DIS and ZSMS start, its average's index (the paper's CIA) |
//! | ZSMS | per stored cell: which of its nine nodes have details, and per such node which of seven |
//! | DIS | indices of details |

pub mod bits;
mod book;
mod check;
mod decode;
mod encode;
mod fast;
#[cfg(target_arch = "x86_64")]
mod fast_avx2;
mod fast_cell;
mod fast_group;
mod fast_region;
#[cfg(target_arch = "x86_64")]
mod fast_v3;
mod inverse;
mod layout;
mod params;
mod plan;
mod reduced;
mod select;
mod stats;
mod tables;
mod tally;
mod train;
mod transform;

pub use book::{Book, MAX_WORDS, Word};
pub use decode::{Coefficients, Context};
pub use fast::{AHEAD, BrickFrame, BrickReader};
pub use layout::{CELL_EDGE, Cell, Layout, OldCell, UNIT_CELLS, UNIT_EDGE, Unit, unit};
pub use params::{KEEP_ALL, Norm, Params, Stream, Threshold, Training};
pub use plan::{Coder, Cut, Plan};
pub use reduced::{MAX_STEPS, check_steps};
pub use select::{Digits, RankSearch, Survey};
pub use stats::{Stats, StreamBytes};
pub use tally::{Case, Counts, Tally};
pub use train::{Survivors, Trainer};

use crate::codec::{BrickPart, Stores};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent};
use crate::grid::ViewMut;
use crate::voxel::{Sample, SampleType, SampleValue};
use crate::with_sample;
use bits::Popcount;
use std::sync::Arc;

/// Number of the codec in the codec table.
pub const ID: u16 = 3;

/// The codec: an entry of the codec table, the volume's null value, and the codebooks once they are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Zerobit {
    stream: Stream,
    params: Params,
    null: SampleValue,
    books: Arc<[Book]>,
    /// Number of the first of them in the file; an encoder has the books of one region only.
    first_book: u32,
    plan: Option<Plan>,
}

impl Zerobit {
    /// A codec without codebooks: it can be described, but neither encodes nor decodes. `null` is the value of null cells.
    #[must_use]
    pub fn new(stream: Stream, params: Params, null: SampleValue) -> Self {
        Zerobit { stream, params, null, books: Arc::default(), first_book: 0, plan: None }
    }

    /// The same codec with the codebooks that payloads refer to.
    #[must_use]
    pub fn with_books(&self, books: Arc<[Book]>) -> Self {
        Zerobit { books, ..self.clone() }
    }

    /// The same codec with some codebooks of the file, the first of which has this number.
    #[must_use]
    pub fn with_books_from(&self, first_book: u32, books: Arc<[Book]>) -> Self {
        Zerobit { books, first_book, ..self.clone() }
    }

    /// The same codec, able to encode by this plan with its codebooks.
    #[must_use]
    pub fn planned(&self, plan: Plan) -> Self {
        Zerobit { plan: Some(plan), ..self.clone() }
    }

    /// How bricks are encoded, where that has been decided.
    #[must_use]
    pub const fn plan(&self) -> Option<&Plan> {
        self.plan.as_ref()
    }

    /// Layout of the unit blocks.
    #[must_use]
    pub const fn stream(&self) -> Stream {
        self.stream
    }

    /// How the encoder chose.
    #[must_use]
    pub const fn params(&self) -> &Params {
        &self.params
    }

    /// Value of null cells.
    #[must_use]
    pub const fn null(&self) -> SampleValue {
        self.null
    }

    /// The codebooks.
    #[must_use]
    pub fn books(&self) -> &[Book] {
        &self.books
    }

    /// The codebook that a payload refers to.
    ///
    /// # Errors
    /// `E_REF` where there is no such codebook.
    pub fn book(&self, payload: &[u8]) -> Result<&Book> {
        book_of(payload, self.first_book, &self.books)
    }

    /// Strict validation of a payload whose length is possible; offsets are relative to it.
    pub(super) fn check(&self, payload: &[u8], brick: Extent) -> Result<()> {
        check::check(self.stream, &Layout::new(brick), payload, self.book(payload)?)
    }

    /// What readers of single voxels, planes and cells of a brick with this payload need besides it.
    ///
    /// # Errors
    /// `E_REF` where the codebook is missing.
    pub fn frame(&self, payload: &[u8], brick: Extent) -> Result<BrickFrame<'_>> {
        let null = tables::pack(self.null_components::<3>());
        Ok(BrickFrame::new(&self.book(payload)?.tables, Layout::new(brick).units, self.stream, null))
    }

    /// One voxel, the fast way. Length and coordinate have been checked.
    pub(super) fn voxel(&self, payload: &[u8], t: SampleType, brick: Extent, c: Coord) -> Result<SampleValue> {
        let frame = self.frame(payload, brick)?;
        let reader = frame.reader(payload);
        Ok(with_sample!(t, T => Sample::value(reader.voxel::<T>(c))))
    }

    /// Decodes parts of bricks that lie side by side, by the fastest way.
    pub(super) fn decode(&self, parts: &[BrickPart<'_>], dst: ViewMut<'_>, stores: Stores) -> Result<()> {
        fast_region::decode(self, parts, dst, stores)
    }

    /// Decodes a part of a brick cell by cell; the reference for every faster way. // spec: ZBT-26
    pub(super) fn decode_plain(&self, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
        let context = Context { book: self.book(part.payload)?, sample_type: dst.sample_type, count: Popcount };
        with_sample!(dst.sample_type, T => {
            decode::region::<T>(part, dst, self.null.typed(), |unit, n| match self.stream {
                Stream::New => unit.cell(n, Popcount).map(|cell| context.cell(&cell, &mut ())),
                Stream::Old => unit.old_cell(n, Popcount).map(|cell| context.cell(&cell, &mut ())),
            });
        });
        Ok(())
    }
}

fn book_of<'a>(payload: &[u8], first: u32, books: &'a [Book]) -> Result<&'a Book> {
    // spec: ZBT-10, ZBT-34
    let index = layout::codebook(payload);
    let found = index.checked_sub(first).and_then(|i| books.get(i as usize));
    found.ok_or_else(|| {
        let message = format!("codebook {index} of {} is wanted; the file or its writer is damaged", books.len());
        Error::at(Code::Ref, 0, "zerobit.codebook", message)
    })
}

/// A decoded word, within the range of its type, as a sample.
fn value_of(word: Word, t: SampleType) -> SampleValue {
    match t {
        SampleType::U8 => SampleValue::U8(word[0] as u8),
        SampleType::U16 => SampleValue::U16(word[0] as u16),
        SampleType::I16 => SampleValue::I16(word[0] as i16),
        SampleType::F32 => SampleValue::F32(word[0] as f32),
        SampleType::Rgb8 => SampleValue::Rgb8(word.map(|v| v as u8)),
    }
}

#[cfg(test)]
mod tests;
