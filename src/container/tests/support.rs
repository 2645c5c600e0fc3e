//! Small files with made-up payloads, a strict runner for them, and a way to seal bytes again after a change.

use crate::affine::Placement;
use crate::checksum::crc32;
use crate::container::strict::Strict;
use crate::container::*;
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent};
use crate::limits::Limits;
use crate::supercompression;
use crate::time::{TimeUnit, Times};
use crate::voxel::{SampleType, SampleValue};
use std::io::Cursor;

/// A small generator, so that the tests are the same everywhere.
pub(super) struct Random(pub(super) u64);

impl Random {
    /// A number below `below`.
    pub(super) fn next(&mut self, below: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % below as u64) as usize
    }
}

/// Length of every made-up payload that is compressed.
pub(super) const ZSTD_LEN: usize = 1000;

pub(super) fn descriptor(dims: [u32; 3], lod_count: u8) -> VolumeDescriptor {
    let entry = |id| CodecEntry { id, stream_version: 1, params: [0; 28] };
    VolumeDescriptor {
        dims: Extent::from(dims),
        time_steps: 1,
        channels: 1,
        sample_type: SampleType::U8,
        lod_count,
        brick_log2: 4,
        downsample: Downsample::default(),
        codecs: vec![entry(CODEC_RAW), entry(CODEC_S3DC)],
        placement: Placement::from_spacing([0.5, 0.5, 2.0], [1.0, -2.0, 3.0]),
        null_value: [7, 0, 0, 0],
        value_map: crate::affine::ValueMap::default(),
        source_range: (0.0, 255.0),
        achieved: Some(Achieved { max_error: 1.5, rmse: 0.25, mean_error: 0.125 }),
        payload_bytes: 0,
        replaced: 0,
    }
}

/// Bytes that stand for a payload; their own minimum and maximum are taken for those of the decoded voxels.
pub(super) fn payload(seed: u8, len: usize) -> Vec<u8> {
    (0..len).map(|i| seed.wrapping_add((i * i % 23) as u8) % 100 + 20).collect()
}

pub(super) fn range_of(payload: &[u8]) -> (f64, f64) {
    let (min, max) = payload.iter().fold((255, 0), |(lo, hi): (u8, u8), &b| (lo.min(b), hi.max(b)));
    (f64::from(min), f64::from(max))
}

/// Puts a stored brick; with ZSTD in `flags`, the payload is compressed.
pub(super) fn put(
    w: &mut impl BrickSink,
    d: &mut VolumeDescriptor,
    at: (u32, u8, Coord),
    codec: u8,
    flags: NodeFlags,
    payload: &[u8],
) {
    let node = Node::new_stored(codec, flags, range_of(payload), Some(0.5));
    d.payload_bytes += payload.len() as u64;
    if flags.contains(NodeFlags::ZSTD) {
        assert_eq!(payload.len(), ZSTD_LEN);
        let frame = supercompression::compress(payload).unwrap().expect("compressible");
        w.put_stored(at.0, at.1, at.2, &node, &frame).unwrap();
    } else {
        w.put_stored(at.0, at.1, at.2, &node, payload).unwrap();
    }
}

/// 40×20×17 voxels, three levels: bricks of all kinds on two levels, an EMPTY one with children on the third, both
/// alignments, a compressed payload, metadata, codebooks, and a feature of each known kind.
pub(super) fn small() -> Vec<u8> {
    small_with(FinishOptions {
        meta: Some(br#"{"a":1}"#.to_vec()),
        codebooks: Some((BOOKS.to_vec(), 2)),
        ..FinishOptions::default()
    })
}

/// What stands for two codebooks: the container does not look into them.
pub(super) const BOOKS: &[u8] = b"two codebooks in 28 bytes...";

pub(super) fn small_with(options: FinishOptions) -> Vec<u8> {
    let mut d = descriptor([40, 20, 17], 3);
    let mut w = FileWriter::new(Cursor::new(Vec::new()), &d).unwrap();
    let none = NodeFlags::default();
    put(&mut w, &mut d, (0, 0, [0, 0, 0]), 0, none, &payload(1, 77));
    put(&mut w, &mut d, (0, 0, [2, 1, 1]), 1, NodeFlags::NAN_REPLACED, &payload(2, 300));
    put(&mut w, &mut d, (0, 0, [1, 0, 0]), 1, NodeFlags::ZSTD, &[42; ZSTD_LEN]);
    put(&mut w, &mut d, (0, 1, [0, 0, 0]), 0, none, &payload(3, 64));
    let constant = Node::new_constant(SampleValue::U8(200), NodeFlags::LOSSLESS, Some(0.0));
    w.put_constant(0, 0, [0, 1, 0], &constant).unwrap();
    d.replaced = 3;
    w.finish(&d, options).unwrap().0.into_inner()
}

/// A log of two time steps of the volume of [`small`], each committed, the second one appended later: both records and
/// commits of all kinds, dead pages, a dead chunk and a dead section.
pub(super) fn small_log() -> Vec<u8> {
    let (mut d, mut options) = (descriptor([40, 20, 17], 3), small_options());
    let mut w = LogWriter::create(Vec::new(), &d, &options).unwrap();
    let none = NodeFlags::default();
    put(&mut w, &mut d, (0, 0, [0, 0, 0]), 0, none, &payload(1, 77));
    put(&mut w, &mut d, (0, 0, [2, 1, 1]), 1, NodeFlags::NAN_REPLACED, &payload(2, 300));
    d.replaced = 3;
    w.checkpoint(&d, &options).unwrap();
    let constant = Node::new_constant(SampleValue::U8(200), NodeFlags::LOSSLESS, Some(0.0));
    w.put_constant(0, 0, [0, 1, 0], &constant).unwrap();
    put(&mut w, &mut d, (0, 1, [0, 0, 0]), 0, none, &payload(3, 64));
    let log = w.finish(&d, options.clone()).unwrap().0;

    let head = open(&log).unwrap();
    d.time_steps = 2;
    let mut w = LogWriter::resume(log.clone(), &head, &d, &mut reader(&log)).unwrap();
    put(&mut w, &mut d, (1, 0, [1, 0, 0]), 1, NodeFlags::ZSTD, &[42; ZSTD_LEN]);
    options.times = Some(Times::regular(TimeUnit::Second, 0.0, 0.5, 2));
    w.finish(&d, options).unwrap().0
}

pub(super) fn small_options() -> FinishOptions {
    FinishOptions {
        meta: Some(br#"{"a":1}"#.to_vec()),
        codebooks: Some((BOOKS.to_vec(), 2)),
        times: Some(Times::regular(TimeUnit::Second, 0.0, 0.5, 1)),
        ..FinishOptions::default()
    }
}

/// One stored brick of one level, no metadata, no features.
pub(super) fn tiny() -> Vec<u8> {
    let mut d = descriptor([5, 4, 3], 1);
    let mut w = FileWriter::new(Cursor::new(Vec::new()), &d).unwrap();
    put(&mut w, &mut d, (0, 0, [0, 0, 0]), 0, NodeFlags::default(), &payload(9, 60));
    w.finish(&d, FinishOptions::default()).unwrap().0.into_inner()
}

pub(super) fn reader(bytes: &[u8]) -> impl FnMut(u64, usize) -> Result<Vec<u8>> + '_ {
    |offset, len| {
        let start = usize::try_from(offset).unwrap();
        let end = start.checked_add(len).filter(|&end| end <= bytes.len());
        let end = end.ok_or_else(|| Error::at(Code::Truncated, bytes.len() as u64, "file", "behind the end"))?;
        Ok(bytes[start..end].to_vec())
    }
}

/// Opens fast, as a reader does.
pub(super) fn open(bytes: &[u8]) -> Result<Head> {
    open_parser(HeadParser::new(bytes.len() as u64, &Limits::default()), bytes).map(|(head, _)| head)
}

/// The head, and the ranges that were asked for.
pub(super) fn open_parser(mut parser: HeadParser, bytes: &[u8]) -> Result<(Head, Vec<(u64, usize)>)> {
    let mut asked = Vec::new();
    loop {
        match parser.next()? {
            Step::Done(head) => return Ok((*head, asked)),
            Step::Need { offset, len } => {
                asked.push((offset, len));
                let most = if bytes.get(72) == Some(&1) { 1000 } else { 4 };
                assert!(asked.len() <= most, "at most one wish per table: {asked:?}");
                parser.supply(offset, reader(bytes)(offset, len)?);
            }
        }
    }
}

/// Strict validation, with the made-up payloads "decoded".
pub(super) fn strict(bytes: &[u8]) -> Vec<Error> {
    let mut read = reader(bytes);
    let mut s = match Strict::open(bytes.len() as u64, &Limits::default(), &mut read) {
        Ok(s) => s,
        Err(e) => return vec![e],
    };
    for (i, brick) in s.bricks().to_vec().into_iter().enumerate() {
        let window = brick.window();
        let checked = read(window.start, (window.end - window.start) as usize).and_then(|bytes| {
            let stored = s.check_brick(&brick, &bytes)?;
            if brick.node.flags.contains(NodeFlags::ZSTD) {
                return supercompression::inflate(
                    stored,
                    ZSTD_LEN as u64..=ZSTD_LEN as u64,
                    brick.node.offset,
                    "brick.payload",
                );
            }
            Ok(stored.to_vec())
        });
        match checked {
            Ok(payload) => {
                let (min, max) = range_of(&payload);
                s.set_bounds(i, min, max);
                s.set_payload_len(i, payload.len() as u64);
            }
            Err(e) => s.report(e),
        }
    }
    s.finish(&mut read)
}

/// Reads every chunk and page, as a reader would who touches all of them.
pub(super) fn read_index(bytes: &[u8]) -> Result<Vec<Node>> {
    let head = open(bytes)?;
    let mut nodes = Vec::new();
    for chunk in &head.directory {
        let entries = parse_chunk(&reader(bytes)(chunk.offset, chunk.byte_len())?, chunk, &head)?;
        for (ordinal, entry) in (chunk.ordinal * CHUNK_PAGES..).zip(entries).filter(|(_, e)| !e.is_empty()) {
            nodes.extend(parse_page(&reader(bytes)(entry.offset, entry.byte_len())?, &entry, ordinal, &head)?);
        }
    }
    Ok(nodes)
}

pub(super) fn set(bytes: &mut [u8], offset: u64, value: &[u8]) {
    let at = usize::try_from(offset).unwrap();
    bytes[at..at + value.len()].copy_from_slice(value);
}

fn int(bytes: &[u8], at: usize, len: usize) -> usize {
    bytes[at..at + len].iter().rev().fold(0, |n, &b| n << 8 | usize::from(b))
}

fn seal(bytes: &mut [u8], from: usize, len: usize, crc_at: usize) {
    if let Some(part) = from.checked_add(len).and_then(|end| bytes.get(from..end)) {
        let crc = crc32(part);
        set(bytes, crc_at as u64, &crc.to_le_bytes());
    }
}

/// Makes all CRCs of the tables right again, so that a change is seen for what it is.
pub(super) fn reseal(bytes: &mut [u8]) {
    let (table, count) = (int(bytes, 80, 8), int(bytes, 76, 4));
    for i in 0..count.min(64) {
        let Some(at) = table.checked_add(i * 64).filter(|at| at.saturating_add(64) <= bytes.len()) else { break };
        let (start, len) = (int(bytes, at + 8, 8), int(bytes, at + 16, 8));
        if &bytes[at..at + 4] == b"PDIR" && start.checked_add(len).is_some_and(|end| end <= bytes.len()) {
            for chunk in (start..start + len / 24 * 24).step_by(24) {
                let (first, pages) = (int(bytes, chunk + 8, 8), int(bytes, chunk + 20, 2));
                for entry in (0..pages).map(|i| first.saturating_add(i * 16)) {
                    if entry.saturating_add(16) <= bytes.len() && int(bytes, entry + 12, 2) > 0 {
                        seal(bytes, int(bytes, entry, 8), int(bytes, entry + 12, 2) * 32, entry + 8);
                    }
                }
                seal(bytes, first, pages * 16, chunk + 16);
            }
        }
        if !matches!(&bytes[at..at + 4], b"PAGE" | b"BRIK") {
            seal(bytes, start, len, at + 36);
        }
    }
    seal(bytes, table, count.min(64) * 64, 88);
    set(bytes, 20, &[0; 4]);
    seal(bytes, 0, 256, 20);
}

/// A copy with `value` at `offset` and all CRCs right.
pub(super) fn changed(bytes: &[u8], offset: u64, value: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    set(&mut bytes, offset, value);
    reseal(&mut bytes);
    bytes
}

/// Where things lie in a valid file.
pub(super) struct Places {
    pub(super) head: Head,
    pub(super) chunk: u64,
    /// Offsets of the pages of the first chunk.
    pub(super) pages: Vec<u64>,
}

impl Places {
    pub(super) fn of(bytes: &[u8]) -> Self {
        let head = open(bytes).unwrap();
        let Some(chunk) = head.directory.first().copied() else {
            return Places { head, chunk: 0, pages: Vec::new() };
        };
        let entries = parse_chunk(&reader(bytes)(chunk.offset, chunk.byte_len()).unwrap(), &chunk, &head).unwrap();
        let pages = entries.iter().map(|e| e.offset).collect();
        Places { chunk: chunk.offset, pages, head }
    }

    /// Offset of a section's entry.
    pub(super) fn entry(&self, fourcc: FourCc) -> u64 {
        256 + 64 * self.head.sections.iter().position(|s| s.fourcc == fourcc).unwrap() as u64
    }

    pub(super) fn section(&self, fourcc: FourCc) -> u64 {
        self.head.section(fourcc).unwrap().offset
    }
}

/// What an error says that tests hold it to.
pub(super) fn told(e: &Error) -> (Code, Option<u64>) {
    (e.code(), e.offset())
}

/// Expects fast opening to fail with code and offset.
pub(super) fn refused(bytes: &[u8], code: Code, offset: u64) {
    let e = open(bytes).map(|_| ()).unwrap_err();
    assert_eq!(told(&e), (code, Some(offset)), "{e}");
    assert!(!e.field().is_empty() && !e.message().is_empty(), "{e}");
    assert_eq!(strict(bytes).iter().map(told).collect::<Vec<_>>(), [(code, Some(offset))]);
}

/// Expects opening to work, and strict validation to name code and offset first.
pub(super) fn strictly_refused(bytes: &[u8], code: Code, offset: u64) {
    open(bytes).unwrap();
    let errors = strict(bytes);
    assert!(errors.iter().any(|e| told(e) == (code, Some(offset))), "{code} at {offset} expected: {errors:?}");
}

/// One past each commit of a log, by following the chain of prefixes back.
pub(super) fn commits(log: &[u8]) -> Vec<Commit> {
    let mut found = Vec::new();
    let mut len = log.len();
    while let Ok(head) = open(&log[..len]) {
        let commit = head.commit.unwrap();
        len = commit.offset as usize;
        found.insert(0, commit);
    }
    found
}

fn seal_seeded(bytes: &mut [u8], at: usize, id: &[u8; 16]) {
    let crc = crate::checksum::crc32_seeded(id, &bytes[at..at + 28]);
    set(bytes, at as u64 + 28, &crc.to_le_bytes());
}

/// Makes the CRCs of a commit right again, of all that lies in it, and of its trailer.
pub(super) fn reseal_commit(bytes: &mut [u8], commit: &Commit) {
    let id: [u8; 16] = bytes[24..40].try_into().unwrap();
    let (at, end) = (commit.offset as usize, commit.end as usize);
    let superblock = at + 32;
    let count = int(bytes, superblock + 76, 4).min(64);
    for entry in (0..count).map(|i| superblock + 256 + i * 64).filter(|entry| entry + 64 <= end) {
        let (start, len) = (int(bytes, entry + 8, 8), int(bytes, entry + 16, 8));
        if start >= at && start.checked_add(len).is_some_and(|last| last <= end) && &bytes[entry..entry + 4] != b"PAGE"
        {
            seal(bytes, start, len, entry + 36);
        }
    }
    seal(bytes, superblock + 256, count * 64, superblock + 88);
    set(bytes, superblock as u64 + 20, &[0; 4]);
    seal(bytes, superblock, 256, superblock + 20);
    seal_seeded(bytes, end - 32, &id);
    seal(bytes, at + 32, end - at - 32, at + 24);
    seal_seeded(bytes, at, &id);
}
