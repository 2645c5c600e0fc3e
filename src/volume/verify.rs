//! Strict validation of a whole file: every byte, every structure, every payload (spec chapter 9).

use super::brick_encoder::with_scratch;
use super::codecs::check_codecs;
use crate::codec::Codec;
use crate::codec::zerobit::Book;
use crate::container::NodeFlags;
use crate::container::strict::{Read, StoredBrick, Strict};
use crate::error::{Error, Result};
use crate::geometry::Region;
use crate::limits::{self, Limits};
use crate::metrics::value_range;
use crate::source::ByteSource;
use crate::supercompression;
use rayon::prelude::*;
use std::sync::Arc;

/// Bricks that are read and decoded at a time, per thread: bounds the memory.
const PER_THREAD: usize = 4;
/// More of them, as long as they take no more bytes than this in the file …
const SHORT_BYTES: u64 = 4 << 20;
/// … and are not more than this.
const MOST_BRICKS: usize = 1024;
/// Padding between neighbours that is read along.
const MERGE_GAP: u64 = 512;

/// What [`verify`] has found.
#[derive(Debug)]
pub struct VerifyReport {
    /// All violations, those of the structure first; at most 1,000.
    pub errors: Vec<Error>,
    /// Stored bricks that were decoded and found right.
    pub bricks: u64,
    /// Length of the file.
    pub bytes: u64,
}

impl VerifyReport {
    /// Whether the file is strictly valid.
    #[must_use]
    pub fn is_ok(&self) -> bool {
        self.errors.is_empty()
    }
}

/// Checks every byte of a file against the spec. Runs on the current rayon pool; `progress` gets bytes done and in all.
///
/// A file whose head is damaged yields that one error; otherwise all errors are collected.
pub fn verify(source: &dyn ByteSource, limits: &Limits, progress: &mut dyn FnMut(u64, u64)) -> VerifyReport {
    let bytes = source.len();
    let mut read = |offset: u64, len: usize| {
        let mut out = Vec::new();
        out.try_reserve_exact(len)
            .map_err(|_| Error::at(crate::Code::Limit, offset, "memory", format!("{len} bytes cannot be allocated")))?;
        out.resize(len, 0);
        source.read_at(offset, &mut out).map(|()| out)
    };
    let mut strict = match Strict::open(bytes, limits, &mut read) {
        Ok(strict) => strict,
        Err(e) => return VerifyReport { errors: vec![e], bricks: 0, bytes },
    };
    let null = strict.head().descriptor.null_sample();
    let (books, books_lost) = match read_books(&strict) {
        Ok(books) => (books, false),
        Err(e) => {
            strict.report(e);
            (Arc::default(), true)
        }
    };
    let codecs: Vec<Result<Codec>> = strict
        .head()
        .descriptor
        .codecs
        .iter()
        .map(|c| Codec::from_wire(c.id, c.stream_version, &c.params, null).map(|codec| codec.with_books(&books)))
        .collect();
    // An unknown codec is data until a brick uses it; a known one with wrong parameters never opens.
    let (descriptor, at) = (&strict.head().descriptor, strict.head().section_range(*b"VOLD").start);
    let wrong = check_codecs(descriptor, at).err();
    if let Some(e) = wrong {
        strict.report(e);
    }
    let mut good = 0;
    let all: Vec<StoredBrick> = strict.bricks().to_vec();
    let mut index = 0;
    let mut rest = &all[..];
    while !rest.is_empty() {
        let (group, later) = rest.split_at(group_len(rest, PER_THREAD * rayon::current_num_threads()));
        rest = later;
        // Reading is left to one thread: a source may be a disk.
        let windows = read_windows(group, &mut read);
        let found: Vec<Result<Checked>> = group
            .par_iter()
            .zip(windows)
            .map(|(brick, window)| check_brick(&strict, &codecs, limits, brick, &window?))
            .collect();
        for result in found {
            match result {
                Ok((len, range)) => {
                    good += 1;
                    strict.set_payload_len(index, len);
                    if let Some((min, max)) = range {
                        strict.set_bounds(index, min, max);
                    }
                }
                // That codebooks are lost has been said once.
                Err(e) if books_lost && e.code() == crate::Code::Ref && e.field() == "zerobit.codebook" => {}
                Err(e) => strict.report(e),
            }
            index += 1;
        }
        progress(group.last().map_or(0, |b| b.window().end), bytes);
    }
    progress(bytes, bytes);
    VerifyReport { errors: strict.finish(&mut read), bricks: good, bytes }
}

/// How many bricks at the front are worked on at a time: `least`, or as many as are short.
fn group_len(bricks: &[StoredBrick], least: usize) -> usize {
    let mut bytes = 0;
    let short = bricks.iter().take_while(|b| {
        bytes += u64::from(b.node.stored_len);
        bytes <= SHORT_BYTES
    });
    short.take(MOST_BRICKS).count().max(least).min(bricks.len())
}

/// Leader, payload and guard of bricks, those of neighbours by one read; where that fails, each alone, so that each has
/// its own error.
fn read_windows(group: &[StoredBrick], read: &mut Read<'_>) -> Vec<Result<Vec<u8>>> {
    let mut windows = Vec::with_capacity(group.len());
    for run in group.chunk_by(|a, b| b.window().start.saturating_sub(a.window().end) <= MERGE_GAP) {
        let start = run[0].window().start;
        let len = run[run.len() - 1].window().end.saturating_sub(start);
        let merged = match usize::try_from(len) {
            Ok(len) if run.len() > 1 && len as u64 <= 2 * SHORT_BYTES => read(start, len).ok(),
            _ => None,
        };
        for brick in run {
            let window = brick.window();
            let len = usize::try_from(window.end - window.start).unwrap_or(usize::MAX);
            let within = merged.as_ref().and_then(|bytes| {
                let from = usize::try_from(window.start.checked_sub(start)?).ok()?;
                bytes.get(from..from.checked_add(len)?)
            });
            windows.push(match within {
                Some(bytes) => Ok(bytes.to_vec()),
                None => limits::check("node.stored_len", len as u64, limits::MAX_BRICK_BYTES + 64)
                    .and_then(|()| read(window.start, len)),
            });
        }
    }
    windows
}

/// The codebooks of section `CBOK`, none where there is no such section. // spec: ZBT-6, ZBT-34
fn read_books(strict: &Strict) -> Result<Arc<[Book]>> {
    let Some(section) = strict.codebooks() else { return Ok(Arc::default()) };
    let (count, at) = (section.entry.item_count, section.entry.offset);
    let t = strict.head().descriptor.sample_type;
    Book::read_all(&section.bytes, count, t, at).map(Arc::from)
}

/// Length of a payload before zstd, and the range of its decoded voxels.
type Checked = (u64, Option<(f64, f64)>);

/// Checks and decodes one brick.
fn check_brick(
    strict: &Strict,
    codecs: &[Result<Codec>],
    limits: &Limits,
    brick: &StoredBrick,
    window: &[u8],
) -> Result<Checked> {
    let stored = strict.check_brick(brick, window)?;
    let t = strict.head().descriptor.sample_type;
    let extent = strict.head().octree.brick_extent(brick.level, brick.brick);
    let offset = brick.node.offset;
    let codec = match codecs.get(usize::from(brick.node.codec)) {
        Some(Ok(codec)) => codec,
        Some(Err(e)) => return Err(Error::at(e.code(), offset, e.field().to_owned(), e.message())),
        None => return Err(Error::at(crate::Code::Ref, offset, "node.codec", "not in the codec table")),
    };
    let lens = codec.payload_lens(t, extent);
    limits::check("brick", *lens.start(), limits.brick_bytes)?;
    let inflated;
    let payload = if brick.node.flags.contains(NodeFlags::ZSTD) {
        inflated = supercompression::inflate(
            stored,
            *lens.start()..=(*lens.end()).min(limits.brick_bytes),
            offset,
            "brick.payload",
        )?;
        &inflated
    } else {
        stored
    };
    codec.check(payload, t, extent, offset)?;
    with_scratch(extent, t, |mut decoded| {
        let whole = Region::whole(extent);
        codec.decode(payload, extent, &whole, decoded.sub(&whole))?;
        Ok((payload.len() as u64, value_range(&decoded.as_view())))
    })
}
