//! Pages of zerobit streams: payloads one after the other, each whole in one page, at multiples of 4 bytes.

use super::fill::{Resident, Writer, too_long, too_many_pages};
use super::{BOOK_WORDS, LevelLayout, PageLayout, TABLE_CONSTANT, TABLE_EMPTY, TABLE_STORED, TABLE_WORDS};
use crate::codec::Codec;
use crate::codec::zerobit::{Book, Word};
use crate::error::Result;
use crate::geometry::Coord;
use crate::volume::BrickPayload;
use crate::voxel::{SampleType, SampleValue};

/// Collects payloads into pages, and notes where they are.
pub(super) struct Pager {
    pages: PageLayout,
    /// What is still to be handed over of the present page.
    page: Vec<u32>,
    /// Words of the present page that are there from before.
    there: usize,
    /// Pages before the present one.
    written: u32,
    table: Vec<u32>,
}

impl Pager {
    /// Goes on in the last page that is there: each change of a transfer function adds few bricks, and pages are few.
    pub(super) fn new(layout: &LevelLayout, pages: PageLayout, null: SampleValue, resident: &Resident) -> Pager {
        let bricks: usize = layout.bricks.iter().map(|&n| n as usize).product();
        let table = match resident.table.is_empty() {
            false => resident.table.clone(),
            // Bricks that nobody wants read as EMPTY; null cells of all others as the entry behind the last.
            true => [TABLE_EMPTY, 0, 0, null.to_raw()].repeat(bricks + 1),
        };
        let there = if resident.pages > 0 { resident.last_words } else { 0 };
        let written = resident.pages - u32::from(there > 0);
        Pager { pages, page: Vec::new(), there, written, table }
    }

    pub(super) fn add(&mut self, writer: &mut Writer<'_>, brick: Coord, payload: &BrickPayload<'_>) -> Result<()> {
        let entry = match payload {
            BrickPayload::Empty => return Ok(()),
            BrickPayload::Constant(value) => [TABLE_CONSTANT, 0, 0, value.to_raw()],
            BrickPayload::Stored { codec, extent, bytes } => {
                if let Codec::Zerobit(z) = codec {
                    z.book(bytes)?; // shaders look no further than there are codebooks
                }
                let len = bytes.len().div_ceil(4);
                let most = (self.pages.page_bytes / 4) as usize;
                if len > most {
                    return Err(too_long(writer.layout, *extent, bytes.len()));
                }
                if self.words() + len > most {
                    self.turn(writer)?;
                }
                let at = self.words();
                self.page.extend(bytes.chunks(4).map(|b| {
                    let mut word = [0; 4];
                    word[..b.len()].copy_from_slice(b);
                    u32::from_le_bytes(word)
                }));
                writer.filled.payload_bytes += bytes.len() as u64;
                writer.filled.table_bytes += (4 * len - bytes.len()) as u64;
                writer.filled.bricks += 1;
                let book = bytes.first_chunk().map_or(0, |b| u32::from_le_bytes(*b));
                // No overflow: a page has at most 2^25 words.
                [TABLE_STORED + self.written, at as u32, bytes.len() as u32, book]
            }
        };
        let at = writer.layout.brick_index(brick) * TABLE_WORDS as usize;
        self.table[at..at + TABLE_WORDS as usize].copy_from_slice(&entry);
        Ok(())
    }

    /// Words of the present page.
    fn words(&self) -> usize {
        self.there + self.page.len()
    }

    /// Hands the page over and begins the next.
    fn turn(&mut self, writer: &mut Writer<'_>) -> Result<()> {
        if self.written >= self.pages.pages {
            return Err(too_many_pages(writer.layout, self.pages.pages));
        }
        self.written += 1;
        let (there, words) = (std::mem::take(&mut self.there), std::mem::take(&mut self.page));
        match there {
            0 => writer.target.page(words),
            _ if words.is_empty() => Ok(()),
            there => writer.target.append(there, words),
        }
    }

    pub(super) fn finish(mut self, writer: &mut Writer<'_>, resident: &mut Resident) -> Result<()> {
        let last_words = self.words();
        if last_words > 0 {
            self.turn(writer)?;
        }
        let books: Vec<u32> =
            writer.volume.codebooks()?.iter().flat_map(|b| book_words(b, writer.layout.store.sample())).collect();
        writer.filled.table_bytes += 4 * (self.table.len() + books.len()) as u64;
        writer.target.tables(&self.table, &books)?;
        (resident.table, resident.pages, resident.last_words) = (self.table, self.written, last_words);
        Ok(())
    }
}

/// A codebook in [`BOOK_WORDS`] words: 256 averages, 256 details; 0 behind the last of each. Of scalars a word is the number
/// as i32, of rgb8 its three components in the low bytes (details in two's complement).
fn book_words(book: &Book, t: SampleType) -> Vec<u32> {
    let packed = |w: &Word| match t {
        SampleType::Rgb8 => u32::from_le_bytes([w[0] as u8, w[1] as u8, w[2] as u8, 0]),
        _ => w[0].cast_unsigned(),
    };
    let mut words: Vec<u32> = book.averages().iter().map(packed).collect();
    words.resize(BOOK_WORDS as usize / 2, 0);
    words.extend(book.details().iter().map(packed));
    words.resize(BOOK_WORDS as usize, 0);
    words
}
