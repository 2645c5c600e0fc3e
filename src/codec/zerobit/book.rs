//! Codebooks: what average and detail indices stand for, and their bytes in section `CBOK` (spec chapter 14, §3).

use super::tables::Tables;
use crate::error::{Code, Error, Result};
use crate::limits;
use crate::voxel::SampleType;

/// A voxel value or a coefficient: one number per component; scalars use the first and leave the others 0.
pub type Word = [i32; 3];

/// Most words of one kind.
pub const MAX_WORDS: usize = limits::MAX_CODEBOOK_WORDS as usize;
/// Bytes before the words of a codebook.
const HEADER_BYTES: usize = 8;
/// Kind of a codebook with average and detail words of zerobit.
const KIND_ZEROBIT: u8 = 1;

/// Averages and details, at most 256 each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Book {
    average: Vec<Word>,
    detail: Vec<Word>,
    pub(super) tables: Tables,
}

/// Smallest and largest value of a component of an average, and of a detail. // spec: ZBT-5
pub(super) const fn ranges(t: SampleType) -> ([i32; 2], [i32; 2]) {
    match t {
        SampleType::U8 | SampleType::Rgb8 => ([0, 255], [-128, 127]),
        SampleType::U16 => ([0, 65535], [-32768, 32767]),
        SampleType::I16 | SampleType::F32 => ([-32768, 32767], [-32768, 32767]),
    }
}

impl Book {
    /// A codebook for samples of type `t`.
    ///
    /// # Errors
    /// `E_LIMIT` for more than 256 words of a kind, `E_PARAM` for a word outside its range.
    pub fn new(t: SampleType, average: Vec<Word>, detail: Vec<Word>) -> Result<Self> {
        let (averages, details) = ranges(t);
        for (field, words, range) in [("average", &average, averages), ("detail", &detail, details)] {
            limits::check(field, words.len() as u64, MAX_WORDS as u64)?;
            let inside = |w: &Word| {
                let (used, rest) = w.split_at(t.components());
                used.iter().all(|v| (range[0]..=range[1]).contains(v)) && rest.iter().all(|&v| v == 0)
            };
            if let Some(word) = words.iter().find(|w| !inside(w)) {
                return Err(Error::param(field, format!("word {word:?} is outside {range:?} of {t}")));
            }
        }
        Ok(Book::of_words(average, detail))
    }

    fn of_words(average: Vec<Word>, detail: Vec<Word>) -> Self {
        let tables = Tables::new(&average, &detail);
        Book { average, detail, tables }
    }

    /// Words for averages.
    #[must_use]
    pub fn averages(&self) -> &[Word] {
        &self.average
    }

    /// Words for details.
    #[must_use]
    pub fn details(&self) -> &[Word] {
        &self.detail
    }

    /// What an average index stands for; 0 behind the last word. // spec: ZBT-7
    #[inline(always)]
    #[must_use]
    pub fn average(&self, index: u8) -> Word {
        self.average.get(usize::from(index)).copied().unwrap_or_default()
    }

    /// What a detail index stands for; 0 behind the last word.
    #[inline(always)]
    #[must_use]
    pub fn detail(&self, index: u8) -> Word {
        self.detail.get(usize::from(index)).copied().unwrap_or_default()
    }

    /// Appends the codebook as section `CBOK` holds it. // spec: ZBT-4
    pub fn write_to(&self, t: SampleType, out: &mut Vec<u8>) {
        let count = |words: &[Word]| u16::try_from(words.len()).expect("at most 256").to_le_bytes();
        out.extend([KIND_ZEROBIT, 0]);
        out.extend(count(&self.average));
        out.extend(count(&self.detail));
        out.extend([0, 0]);
        let width = component_bytes(t);
        for word in self.average.iter().chain(&self.detail) {
            word[..t.components()].iter().for_each(|v| out.extend(&v.to_le_bytes()[..width]));
        }
        out.resize(out.len().next_multiple_of(4), 0);
    }

    /// All codebooks of a section whose first byte lies at `at`.
    ///
    /// # Errors
    /// `E_TRUNCATED`, `E_PARAM`, `E_LIMIT`, `E_RESERVED`, `E_PADDING`, `E_SIZE`, with absolute offsets.
    pub fn read_all(section: &[u8], count: u64, t: SampleType, at: u64) -> Result<Vec<Book>> {
        // spec: ZBT-6
        if t == SampleType::F32 {
            return Err(Error::at(
                Code::Param,
                at,
                "CBOK",
                "a volume of f32 has no codebooks: zerobit stores integers",
            ));
        }
        limits::check("CBOK.item_count", count, limits::MAX_CODEBOOKS)?;
        let mut books = Vec::new();
        let mut from = 0;
        for _ in 0..count {
            let (book, len) = Book::read_from(&section[from..], t, at + from as u64)?;
            books.push(book);
            from += len;
        }
        if from != section.len() {
            let message = format!("{count} codebooks end at byte {from} of a section of {}", section.len());
            return Err(Error::at(Code::Size, at + from as u64, "CBOK", message));
        }
        Ok(books)
    }

    // spec: ZBT-4, ZBT-6
    fn read_from(bytes: &[u8], t: SampleType, at: u64) -> Result<(Book, usize)> {
        let short = || Error::at(Code::Truncated, at, "codebook", "the section ends inside the codebook");
        let header: [u8; HEADER_BYTES] = bytes.get(..HEADER_BYTES).ok_or_else(short)?.try_into().expect("8 bytes");
        if header[0] != KIND_ZEROBIT {
            let message = format!("{} is not a kind of this version; use a newer reader", header[0]);
            return Err(Error::at(Code::Param, at, "codebook.kind", message));
        }
        if [header[1], header[6], header[7]] != [0; 3] {
            return Err(Error::at(Code::Reserved, at + 1, "codebook.reserved", "a reserved byte is not 0"));
        }
        let counts = [[header[2], header[3]], [header[4], header[5]]].map(|b| usize::from(u16::from_le_bytes(b)));
        for (field, n, offset) in [("codebook.averages", counts[0], 2), ("codebook.details", counts[1], 4)] {
            limits::check(field, n as u64, MAX_WORDS as u64)
                .map_err(|e| Error::at(e.code(), at + offset, field, e.message().to_owned()))?;
        }
        let width = component_bytes(t);
        let word_bytes = width * t.components();
        let end = HEADER_BYTES + word_bytes * (counts[0] + counts[1]);
        let padded = end.next_multiple_of(4);
        let pad = bytes.get(end..padded).ok_or_else(short)?;
        if pad.iter().any(|&b| b != 0) {
            return Err(Error::at(Code::Padding, at + end as u64, "codebook.padding", "a byte of padding is not 0"));
        }
        let signed_average = t == SampleType::I16;
        let words = bytes[HEADER_BYTES..end].chunks_exact(word_bytes.max(1)).enumerate().map(|(i, word)| {
            let signed = i >= counts[0] || signed_average;
            let mut out = Word::default();
            for (v, b) in out.iter_mut().zip(word.chunks_exact(width)) {
                *v = match (b, signed) {
                    (&[b], true) => i32::from(b.cast_signed()),
                    (&[b], false) => i32::from(b),
                    (b, true) => i32::from(i16::from_le_bytes([b[0], b[1]])),
                    (b, false) => i32::from(u16::from_le_bytes([b[0], b[1]])),
                };
            }
            out
        });
        let mut average: Vec<Word> = words.collect();
        let detail = average.split_off(counts[0]);
        Ok((Book::of_words(average, detail), padded))
    }
}

/// Bytes of one component of a word.
const fn component_bytes(t: SampleType) -> usize {
    t.bytes() / t.components()
}
