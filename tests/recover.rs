//! What is saved of damaged and unfinished files: exactly the bricks that are whole, in a strictly valid file.

mod support;

use std::collections::BTreeSet;
use std::io::Cursor;
use support::{encode, explicit, hash, open, verify};
use vug::container::{BrickSink, FileSummary, FinishOptions, LogWriter, Node, Octree, VolumeDescriptor};
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{self, At, BrickOrder, CodecChoice, CopyOptions, EncodeOptions, Quality, Recovered, Volume};
use vug::{Code, Extent, Grid, Region};

fn recover(bytes: &[u8]) -> vug::Result<(Vec<u8>, Recovered)> {
    let out = Cursor::new(Vec::new());
    let (out, found) = volume::recover(MemorySource(bytes.to_vec()), Limits::default(), out, &mut |_, _| {})?;
    let out = out.into_inner();
    let errors = verify(&out);
    assert!(errors.is_empty(), "{errors:?}");
    Ok((out, found))
}

/// Noise in two thirds, one CONSTANT brick, the rest EMPTY; 16³ bricks, 2 levels.
fn head(codec: CodecChoice) -> Vec<u8> {
    let mut grid = Grid::from_fn(Extent::new(60, 40, 33), |c| match c {
        [0..16, 0..16, 0..16] => 7,
        [x, ..] if x >= 40 => 0,
        _ => (hash(c) >> 25) as u8,
    })
    .unwrap();
    let quality = if codec == CodecChoice::Zerobit { Quality::Keep(100_000) } else { explicit(4, 4).quality };
    let options = EncodeOptions { codec, quality, brick: Some(16), levels: 2, ..EncodeOptions::default() };
    encode(&mut grid, &options).0
}

/// Commits after every fifth brick.
struct Often {
    log: LogWriter<Vec<u8>>,
    descriptor: VolumeDescriptor,
    options: FinishOptions,
    count: u32,
}

impl Often {
    fn next(&mut self) -> vug::Result<()> {
        self.count += 1;
        if self.count.is_multiple_of(5) { self.log.checkpoint(&self.descriptor, &self.options) } else { Ok(()) }
    }
}

impl BrickSink for Often {
    type Out = Vec<u8>;
    fn octree(&self) -> &Octree {
        self.log.octree()
    }
    fn put_stored(&mut self, tree: u32, level: u8, brick: [u32; 3], node: &Node, payload: &[u8]) -> vug::Result<()> {
        self.log.put_stored(tree, level, brick, node, payload)?;
        self.next()
    }
    fn put_constant(&mut self, tree: u32, level: u8, brick: [u32; 3], node: &Node) -> vug::Result<()> {
        self.log.put_constant(tree, level, brick, node)?;
        self.next()
    }
    fn finish(self, d: &VolumeDescriptor, options: FinishOptions) -> vug::Result<(Vec<u8>, FileSummary)> {
        self.log.finish(d, options)
    }
}

fn log(head: &[u8]) -> Vec<u8> {
    let volume = open(head.to_vec());
    let excerpt = volume.excerpt(&CopyOptions::default()).unwrap();
    let (descriptor, options) = (excerpt.descriptor().clone(), excerpt.finish_options().unwrap());
    let log = LogWriter::create(Vec::new(), &descriptor, &options).unwrap();
    let often = Often { log, descriptor, options: options.clone(), count: 0 };
    excerpt.copy(often, options, &mut |_, _| {}).unwrap().0
}

fn pack(bytes: &[u8]) -> Vec<u8> {
    let volume = open(bytes.to_vec());
    let excerpt = volume.excerpt(&CopyOptions::default()).unwrap();
    excerpt.write_head(Cursor::new(Vec::new()), &mut |_, _| {}).unwrap().0.into_inner()
}

/// All bricks that are not EMPTY.
fn bricks(volume: &Volume) -> Vec<(At, [u32; 3])> {
    let mut found = Vec::new();
    for lod in 0..volume.info().lod_count {
        let grid = volume.levels().nth(lod.into()).unwrap().div_ceil(Extent::cube(16));
        for z in 0..grid.z {
            for y in 0..grid.y {
                for x in 0..grid.x {
                    let brick = volume.read_brick(At::lod(lod), [x, y, z]).unwrap();
                    if brick.bytes().iter().any(|&b| b != 0) {
                        found.push((At::lod(lod), [x, y, z]));
                    }
                }
            }
        }
    }
    found
}

/// Bricks that live are those of the original, all others are EMPTY.
fn assert_saved(original: &Volume, out: &[u8], found: &Recovered, what: &str) {
    let saved = open(out.to_vec());
    assert_eq!(bricks(&saved), found.live, "{what}: exactly these live");
    for &(at, brick) in &found.live {
        let (a, b) = (saved.read_brick(at, brick).unwrap(), original.read_brick(at, brick).unwrap());
        assert!(a.bytes() == b.bytes(), "{what}: {at:?} {brick:?}");
    }
    let stored = found.file.stored + found.file.constant;
    assert_eq!(stored, found.live.len() as u64, "{what}");
}

#[test]
fn what_is_whole_is_packed() {
    for codec in [CodecChoice::S3dc, CodecChoice::Raw, CodecChoice::Zerobit] {
        let file = head(codec);
        let (out, found) = recover(&file).unwrap();
        assert!(out == file && found.is_whole() && found.by_leader == 0 && found.commit.is_none(), "{found:?}");
        let log = log(&file);
        let (out, found) = recover(&log).unwrap();
        assert!(out == pack(&log) && found.is_whole() && found.commit.unwrap().generation > 3, "{found:?}");
        assert!(out == file, "{codec:?}");
        // Whatever the order of its bricks.
        let volume = open(file.clone());
        let clustered = CopyOptions { order: BrickOrder::Clustered, ..CopyOptions::default() };
        let excerpt = volume.excerpt(&clustered).unwrap();
        let web = excerpt.write_head(Cursor::new(Vec::new()), &mut |_, _| {}).unwrap().0.into_inner();
        assert!(web != file && recover(&web).unwrap().0 == web, "{codec:?}, clustered");
    }
}

#[test]
fn every_prefix_of_a_log_gives_its_committed_bricks_and_more() {
    for codec in [CodecChoice::S3dc, CodecChoice::Zerobit] {
        let file = head(codec);
        let (original, log) = (open(file.clone()), log(&file));
        let (mut last, mut by_leader, mut failed) = (0, 0, 0);
        for len in (0..log.len()).step_by(211).chain([log.len() - 1]) {
            let cut = &log[..len];
            let (out, found) = match recover(cut) {
                Ok(found) => found,
                Err(e) => {
                    assert!(last == 0 && matches!(e.code(), Code::Truncated | Code::Commit), "{len}: {e}");
                    failed += 1;
                    continue;
                }
            };
            assert_saved(&original, &out, &found, &format!("{codec:?}, {len} bytes"));
            let committed: BTreeSet<_> = bricks(&open(cut.to_vec())).into_iter().map(|(at, b)| (at.lod, b)).collect();
            let live: BTreeSet<_> = found.live.iter().map(|&(at, b)| (at.lod, b)).collect();
            assert!(committed.is_subset(&live), "{len}: what was committed lives");
            assert!(found.live.len() >= last, "{len}: more bytes, more bricks");
            last = found.live.len();
            by_leader = by_leader.max(found.by_leader);
        }
        assert!(last == bricks(&original).len() && by_leader >= 4 && failed > 0, "{last} {by_leader} {failed}");
    }
}

#[test]
fn a_damaged_payload_is_lost_alone() {
    let file = head(CodecChoice::S3dc);
    let original = open(file.clone());
    for bytes in [file.clone(), log(&file)] {
        let mut bad = bytes.clone();
        // The payload of the last stored brick.
        let (at, leader) =
            vug::container::find_leaders(&bytes, 0, &open(bytes.clone()).head().superblock.file_id).pop().unwrap();
        bad[at as usize + 40] ^= 4;
        let (out, found) = recover(&bad).unwrap();
        assert_saved(&original, &out, &found, "damaged payload");
        let lost: Vec<_> = found.lost.iter().map(|(at, brick, e)| (at.lod, *brick, e.code())).collect();
        assert_eq!(lost, [(leader.level, leader.brick, Code::BrickCrc)]);
        assert_eq!(found.live.len() + 1, bricks(&original).len());
        assert!(!found.is_whole() && found.descriptor.achieved.is_none());
    }
}

#[test]
fn a_damaged_index_costs_nothing_that_has_a_leader() {
    for codec in [CodecChoice::S3dc, CodecChoice::Zerobit] {
        let file = head(codec);
        let original = open(file.clone());
        let all = bricks(&original).len();
        // Pages of a head file: CONSTANT bricks are in them only.
        let mut bad = file.clone();
        for byte in &mut bad[original.head().section_range(*b"PAGE").start as usize..][..40] {
            *byte ^= 0x55;
        }
        let (out, found) = recover(&bad).unwrap();
        assert_saved(&original, &out, &found, "damaged page");
        assert!(found.by_leader > 0 && found.damage.len() == 1 && found.live.len() == all - 1, "{found:?}");
        // In a log they have leaders: its last pages, which lie before its last commit.
        let mut bad = log(&file);
        let commit = open(bad.clone()).head().commit.unwrap();
        for byte in &mut bad[commit.offset as usize - 100..commit.offset as usize - 60] {
            *byte ^= 0x55;
        }
        let (out, found) = recover(&bad).unwrap();
        assert_saved(&original, &out, &found, "damaged page of a log");
        assert!(found.live.len() == all && found.by_leader > 0, "{found:?}");
    }
}

#[test]
fn a_head_file_that_ends_too_early_keeps_its_first_bricks() {
    let file = head(CodecChoice::Raw);
    let original = open(file.clone());
    let brik = original.head().section_range(*b"BRIK");
    for len in (brik.start..brik.end).step_by(3001) {
        let (out, found) = recover(&file[..len as usize]).unwrap();
        assert_saved(&original, &out, &found, "short");
        assert_eq!(found.live.len() + found.lost.len(), bricks(&original).len(), "{len}: each is saved or listed");
    }
}

#[test]
fn without_codebooks_zerobit_bricks_are_lost_and_named() {
    let file = head(CodecChoice::Zerobit);
    let original = open(file.clone());
    let mut bad = file.clone();
    bad[original.head().section_range(*b"CBOK").start as usize + 20] ^= 1;
    let (out, found) = recover(&bad).unwrap();
    assert_saved(&original, &out, &found, "no codebooks");
    assert_eq!(found.live, [(At::default(), [0, 0, 0])], "the CONSTANT brick needs none");
    assert_eq!(found.live.len() + found.lost.len(), bricks(&original).len());
    assert!(found.damage.iter().any(|e| e.code() == Code::SectionCrc), "{:?}", found.damage);
}

#[test]
fn what_is_saved_has_bounds_of_its_own() {
    let file = head(CodecChoice::Raw);
    let log = log(&file);
    let (out, found) = recover(&log[..log.len() / 2]).unwrap();
    assert!(!found.live.is_empty());
    let saved = open(out);
    let all = saved.bounds(At::default(), Region::whole(saved.info().dims)).unwrap();
    let (min, max) = saved.read(At::default()).unwrap().range().unwrap();
    assert_eq!((f64::from(all.min), f64::from(all.max)), (min, max));
    assert!(saved.info().source_range.0 <= min && saved.info().source_range.1 >= max);
}
