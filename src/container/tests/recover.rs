//! What is saved of damaged and unfinished files (chapters 6 and 15).

use super::support::*;
use crate::container::*;
use crate::error::Code;
use crate::limits::Limits;

fn recovered(file: &[u8]) -> Recovery {
    recover(file.len() as u64, &Limits::default(), &mut reader(file)).unwrap()
}

/// Every brick that is said to live has the payload it had.
fn check_payloads(file: &[u8], found: &Recovery) {
    for b in found.bricks.iter().filter(|b| b.node.kind == NodeKind::Stored) {
        let start = b.node.offset as usize;
        b.node.check_payload(&file[start..start + b.node.stored_len as usize]).unwrap();
    }
}

#[test] // spec: LOG-11
fn whole_files_lose_nothing() {
    for file in [small(), small_log()] {
        let found = recovered(&file);
        assert_eq!((found.bricks.len(), found.lost.len(), found.damage.len(), found.beyond), (5, 0, 0, 0));
        assert!(found.bricks.iter().all(|b| b.indexed));
        assert_eq!(found.options.codebooks.as_ref().unwrap().0, BOOKS);
        assert_eq!(found.options.meta.as_deref(), Some(&br#"{"a":1}"#[..]));
        check_payloads(&file, &found);
    }
}

#[test] // spec: LOG-11; C-14
fn bricks_behind_the_last_commit_are_found_by_their_leaders() {
    let log = small_log();
    let all = commits(&log);
    let mut most = 0;
    for len in all[0].end..log.len() as u64 {
        let cut = &log[..len as usize];
        let found = recovered(cut);
        let commit = found.head.commit.unwrap();
        assert_eq!(found.head.unfinished(), len - commit.end);
        check_payloads(cut, &found);
        // Never fewer than a shorter prefix gives: the second time step counts as beyond until it is committed.
        let there = found.bricks.len() as u64 + found.beyond;
        assert!(there >= most, "{there} bricks of {len} bytes, {most} before");
        most = there;
        let by_leader = found.bricks.iter().filter(|b| !b.indexed).count();
        assert!(by_leader == 0 || len > commit.end);
        assert!(found.damage.is_empty());
    }
    assert_eq!(most, 5);
    let before = recovered(&log[..all[1].offset as usize]);
    assert_eq!((before.bricks.len(), before.lost.len()), (2, 0));
    let before = recovered(&log[..all[2].offset as usize]);
    assert!(
        before.bricks.iter().any(|b| b.node.kind == NodeKind::Constant && !b.indexed && b.place == (0, 0, [0, 1, 0]))
    );
    // Cut inside a payload: that brick is known to be lost.
    let payload = before.bricks.iter().find(|b| b.place == (0, 1, [0, 0, 0])).unwrap().node.offset;
    let torn = recovered(&log[..payload as usize + 10]);
    assert_eq!(
        torn.lost.iter().map(|l| (l.place, l.error.code())).collect::<Vec<_>>(),
        [((0, 1, [0, 0, 0]), Code::Truncated)]
    );
}

#[test] // spec: LOG-11; C-02
fn one_damaged_byte_costs_one_brick_at_most() {
    let log = small_log();
    for at in 256..log.len() {
        let mut bad = log.clone();
        bad[at] ^= 0x20;
        let found = recovered(&bad);
        check_payloads(&bad, &found);
        let there = found.bricks.len() as u64 + found.beyond;
        assert!(there >= 4, "byte {at}: {found:?}");
        assert!(found.lost.len() <= 1);
        if there == 5 {
            continue;
        }
        // Only a leader that is damaged with nothing of the index naming its brick is lost without a trace: not here.
        assert_eq!(found.lost.len(), 1, "byte {at}: {found:?}");
        assert_eq!(found.lost[0].error.code(), Code::BrickCrc);
    }
}

#[test] // spec: LOG-11, BRK-5
fn a_damaged_index_costs_no_stored_brick() {
    for file in [small(), small_log()] {
        let log = file[72] == 1;
        let head = open(&file).unwrap();
        let chunk = head.directory[0];
        let pages = parse_chunk(&file[chunk.offset as usize..][..chunk.byte_len()], &chunk, &head).unwrap();
        for at in [chunk.offset, pages[0].offset] {
            let mut bad = file.clone();
            bad[at as usize + 1] ^= 1;
            let found = recovered(&bad);
            check_payloads(&bad, &found);
            // A CONSTANT brick has a leader in logs only.
            assert_eq!(found.bricks.len(), if log { 5 } else { 4 }, "{found:?}");
            assert!(found.bricks.iter().any(|b| !b.indexed));
            let codes: Vec<Code> = found.damage.iter().map(|e| e.code()).collect();
            assert_eq!(codes, [if at == chunk.offset { Code::DirCrc } else { Code::PageCrc }]);
        }
    }
    // The directory of a head file, metadata, codebooks.
    for (name, left) in [(b"PDIR", 4), (b"META", 5), (b"CBOK", 5)] {
        let mut bad = small();
        let at = Places::of(&bad).section(*name);
        bad[at as usize] ^= 1;
        let found = recovered(&bad);
        assert_eq!((found.bricks.len(), found.damage.len()), (left, 1), "{found:?}");
        assert_eq!(found.options.codebooks.is_none(), name == b"CBOK");
    }
}

#[test] // spec: LOG-11
fn commits_out_of_a_readers_reach_are_found() {
    // Only the second commit is whole, and the last bytes are none of the file's.
    let mut log = small_log();
    let all = commits(&log);
    for c in &all[2..] {
        log[c.end as usize - 1] ^= 1;
    }
    log[all[0].offset as usize + 40] ^= 1;
    log.resize(log.len() + 5000, 0xEE);
    let found = recovered(&log);
    assert_eq!(found.head.commit, Some(all[1]));
    assert_eq!((found.bricks.len(), found.beyond), (4, 1));
    // None at all: said, not guessed.
    for c in &all[..2] {
        log[c.offset as usize + 24] ^= 1;
    }
    let e = recover(log.len() as u64, &Limits::default(), &mut reader(&log)).unwrap_err();
    assert_eq!(e.code(), Code::Commit);
    let e = recover(100, &Limits::default(), &mut reader(&log[..100])).unwrap_err();
    assert_eq!(e.code(), Code::Truncated);
}

#[test] // spec: LOG-11
fn pages_that_overlap_are_not_believed() {
    // 8 pages, two of which have nodes: CONSTANT ones, which need no byte but that of the index.
    let mut d = descriptor([256; 3], 1);
    d.payload_bytes = 0;
    let mut w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
    let constant = Node::new_constant(crate::voxel::SampleValue::U8(9), NodeFlags::LOSSLESS, Some(0.0));
    for brick in (0..512).map(crate::geometry::unmorton8).chain([[8; 3]]) {
        w.put_constant(0, 0, brick, &constant).unwrap();
    }
    let file = w.finish(&d, FinishOptions::default()).unwrap().0.into_inner();
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    assert_eq!(recovered(&file).bricks.len(), 513);
    let places = Places::of(&file);
    let (chunk, pages) = (places.chunk as usize, places.head.section_range(*b"PAGE"));
    let mut bad = file.clone();
    for entry in 1..8 {
        bad.copy_within(chunk..chunk + 16, chunk + entry * 16);
    }
    reseal(&mut bad);
    let found = recovered(&bad);
    assert_eq!(found.damage.iter().map(told).collect::<Vec<_>>(), [(Code::SectionOverlap, Some(pages.start))]);
    assert_eq!((found.bricks.len(), found.lost.len()), (512, 0), "no more than the section has nodes for");
    // Nor where file and section are said to be longer than the bytes that there are.
    let entry = places.entry(*b"PAGE");
    set(&mut bad, entry + 16, &(1u64 << 40).to_le_bytes());
    set(&mut bad, entry + 24, &(1u64 << 40).to_le_bytes());
    set(&mut bad, 40, &(1u64 << 41).to_le_bytes());
    reseal(&mut bad);
    let most = bad.len() / 32;
    assert!(recovered(&bad).bricks.len() <= most, "a node has 32 bytes of its own");
}

#[test] // spec: LOG-11
fn bad_sectors_take_no_neighbours_along() {
    let log = small_log();
    let commit = *commits(&log).last().unwrap();
    let cut = &log[..commit.offset as usize];
    let whole = recovered(cut);
    // Reads of more than a sector fail.
    let mut read = |offset: u64, len: usize| {
        if len > 16 << 10 {
            return Err(crate::Error::new(Code::Source, "", "bad sector"));
        }
        reader(cut)(offset, len)
    };
    let found = recover(cut.len() as u64, &Limits::default(), &mut read).unwrap();
    assert_eq!((found.bricks.len(), found.beyond), (whole.bricks.len(), whole.beyond));
}
