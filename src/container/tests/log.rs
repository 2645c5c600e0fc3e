//! Logs: what is written, how it opens, what is left of it when its writer is stopped (chapter 15).

use super::support::*;
use crate::container::*;
use crate::error::{Code, Error};
use crate::limits::{HEAD_BYTES, Limits};
use crate::voxel::SampleValue;

#[test] // spec: LOG-1, LOG-5, LOG-6, LOG-7, LOG-8
fn the_last_commit_says_what_is_in_a_log() {
    let log = small_log();
    let head = open(&log).unwrap();
    let commit = head.commit.unwrap();
    assert_eq!((commit.end, commit.generation, head.unfinished()), (log.len() as u64, 3, 0));
    assert_eq!(commits(&log).iter().map(|c| c.generation).collect::<Vec<_>>(), [0, 1, 2, 3]);
    assert_eq!((head.descriptor.time_steps, head.superblock.required, head.superblock.optional), (2, 1, 1));
    let count = |name: &[u8; 4]| head.section(*name).unwrap().item_count;
    assert_eq!((count(b"PAGE"), count(b"BRIK"), count(b"CBOK"), count(b"TIME")), (6, 4, 2, 2));
    assert_eq!(head.section_range(*b"BRIK"), 256..commit.offset);
    assert_eq!(read_index(&log).unwrap().iter().filter(|n| n.kind == NodeKind::Constant).count(), 1);
    // The first 256 bytes say that this is a log, and nothing that changes.
    let first = Superblock::read_from(&log).unwrap();
    assert_eq!((first.layout, first.file_len, first.section_count), (FileLayout::Log, 0, 0));
    assert_eq!(first.file_id, head.superblock.file_id);
    for (at, code) in [(40, Code::Reserved), (48, Code::Reserved), (73, Code::Reserved), (76, Code::Reserved)] {
        let mut bad = log.clone();
        bad[at] = 1;
        reseal(&mut bad[..256]);
        assert_eq!(told(&open(&bad).unwrap_err()), (code, Some(at as u64)));
    }
}

#[test] // spec: LOG-3, LOG-10, IDX-13
fn a_log_has_the_same_nodes_as_a_head_file() {
    let (mut d, none) = (descriptor([300, 20, 17], 3), NodeFlags::default());
    let (mut head, mut log) = (
        FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap(),
        LogWriter::create(Vec::new(), &d, &FinishOptions::default()).unwrap(),
    );
    let constant = Node::new_constant(SampleValue::U8(9), none, None);
    for x in 0..15 {
        let bytes = payload(x as u8, 100);
        put(&mut head, &mut d.clone(), (0, 0, [x, 1, 0]), 0, none, &bytes);
        put(&mut log, &mut d, (0, 0, [x, 1, 0]), 0, none, &bytes);
        head.put_constant(0, 0, [x, 0, 1], &constant).unwrap();
        log.put_constant(0, 0, [x, 0, 1], &constant).unwrap();
        // A commit in between must not leave its mark on bounds.
        log.checkpoint(&d, &FinishOptions::default()).unwrap();
    }
    let head = head.finish(&d, FinishOptions::default()).unwrap().0.into_inner();
    let (log, summary) = log.finish(&d, FinishOptions::default()).unwrap();
    assert_eq!((summary.stored, summary.constant, summary.len), (15, 15, log.len() as u64));
    let nodes = |file: &[u8]| -> Vec<Node> {
        let all = read_index(file).unwrap().into_iter();
        all.map(|n| if n.kind == NodeKind::Stored { Node { offset: 0, ..n } } else { n }).collect()
    };
    assert_eq!(nodes(&head), nodes(&log));
    let id = open(&log).unwrap().superblock.file_id;
    let leaders = find_leaders(&log, 0, &id);
    assert_eq!(leaders.iter().filter(|(_, l)| l.kind == NodeKind::Constant && l.crc == 9).count(), 15);
    for (at, leader) in leaders.iter().filter(|(_, l)| l.kind == NodeKind::Stored) {
        let node = leader.node(*at);
        let start = node.offset as usize;
        node.check_payload(&log[start..start + node.stored_len as usize]).unwrap();
    }
}

#[test] // spec: LOG-10
fn what_is_written_already_is_not_written_again() {
    let (mut d, options) = (descriptor([40, 20, 17], 3), small_options());
    let mut w = LogWriter::create(Vec::new(), &d, &options).unwrap();
    put(&mut w, &mut d, (0, 0, [0, 0, 0]), 0, NodeFlags::default(), &payload(1, 77));
    w.checkpoint(&d, &options).unwrap();
    let len = w.len();
    w.checkpoint(&d, &options).unwrap();
    assert_eq!(w.len(), len, "nothing new, no commit");
    w.prepare(&d, &options).unwrap();
    assert_eq!(w.len(), len, "nothing new, no record");
    let other = FinishOptions { meta: Some(b"{}".to_vec()), ..options };
    w.checkpoint(&d, &other).unwrap();
    let log = w.get_mut().clone();
    let sections = |log: &[u8]| open(log).unwrap().sections;
    let (before, after) = (sections(&log[..len as usize]), sections(&log));
    let offset = |all: &[SectionEntry], name: &[u8; 4]| all.iter().find(|s| s.fourcc == *name).unwrap().offset;
    assert_eq!(offset(&before, b"CBOK"), offset(&after, b"CBOK"));
    assert!(offset(&before, b"META") < offset(&after, b"META"));
    let chunks = |log: &[u8]| open(log).unwrap().directory;
    assert_eq!(chunks(&log[..len as usize]), chunks(&log));
}

#[test] // spec: VAL-7, LOG-9; C-01, C-14
fn every_prefix_is_cut_back_to_its_last_commit() {
    let log = small_log();
    let commits = commits(&log);
    for len in 0..log.len() {
        let whole = commits.iter().rfind(|c| c.end <= len as u64);
        match (open(&log[..len]), whole) {
            (Ok(head), Some(commit)) => {
                assert_eq!(head.commit, Some(*commit));
                assert_eq!(head.unfinished(), len as u64 - commit.end);
                read_index(&log[..len]).unwrap();
            }
            (Err(e), None) => {
                assert_eq!(e.code(), if len < 256 { Code::Truncated } else { Code::Commit }, "{len}: {e}");
                assert!(len < 256 || e.message().contains("vug recover"), "{e}");
            }
            (opened, whole) => panic!("{len}: {opened:?} where {whole:?} is whole"),
        }
    }
}

#[test] // spec: VAL-7, LOG-9
fn reads_of_opening() {
    let (mut d, options) = (descriptor([2000, 200, 17], 1), FinishOptions::default());
    let mut w = LogWriter::create(Vec::new(), &d, &options).unwrap();
    for i in 0..1000 {
        put(&mut w, &mut d, (0, 0, [i % 125, i / 125, 0]), 0, NodeFlags::default(), &payload(i as u8, 4000));
    }
    let (log, _) = w.finish(&d, options).unwrap();
    let asked = |log: &[u8]| {
        let parser = HeadParser::new(log.len() as u64, &Limits::default());
        open_parser(parser, log).map(|(head, asked)| (head.commit.unwrap(), asked))
    };
    let (commit, reads) = asked(&log).unwrap();
    let tail = log.len() as u64 - HEAD_BYTES;
    assert_eq!(reads, [(0, HEAD_BYTES as usize), (tail, HEAD_BYTES as usize)]);
    // Cut short, the search goes backwards in windows; what it has read of the head it does not read again.
    for cut in [1, 16, 300, 40_000] {
        let torn = &log[..commit.offset as usize - cut];
        let (first, reads) = asked(torn).unwrap();
        assert_eq!(first.generation, 0);
        let behind: usize = reads[1..].iter().map(|r| r.1).sum();
        assert!(reads[1..].iter().all(|r| r.0 >= HEAD_BYTES && r.1 <= 1 << 20), "{reads:?}");
        assert!(reads.len() <= 7 && behind <= torn.len() + 16 * reads.len(), "{reads:?}");
    }
}

#[test] // spec: LOG-10
fn appending_leaves_what_was_there() {
    let log = small_log();
    let head = open(&log).unwrap();
    let mut d = VolumeDescriptor { time_steps: 4, ..head.descriptor.clone() };
    let kept = kept_options(&head, &Limits::default(), &mut reader(&log)).unwrap();
    assert_eq!((kept.meta.as_deref(), kept.codebooks.as_ref().unwrap().1), (Some(&br#"{"a":1}"#[..]), 2));
    let resume = |d: &VolumeDescriptor| LogWriter::resume(log.clone(), &head, d, &mut reader(&log));
    let mut w = resume(&d).unwrap();
    let node = Node::new_constant(SampleValue::U8(1), NodeFlags::default(), None);
    assert_eq!(w.put_constant(1, 0, [0, 0, 0], &node).unwrap_err().code(), Code::Param);
    put(&mut w, &mut d, (3, 0, [0, 0, 0]), 0, NodeFlags::default(), &payload(5, 50));
    // Times of two steps do not do for four.
    assert_eq!(w.checkpoint(&d, &kept).unwrap_err().code(), Code::Size);
    let kept = FinishOptions { times: None, ..kept };
    w.prepare(&d, &kept).unwrap();
    let ready = w.get_mut().clone();
    assert_eq!(open(&ready).unwrap().commit, head.commit, "ready, but not committed");
    let (longer, _) = w.finish(&d, kept).unwrap();
    let commit = open(&longer).unwrap().commit.unwrap();
    assert!(longer.starts_with(&ready) && commit.offset == (ready.len() as u64).next_multiple_of(16));
    assert!(longer.starts_with(&log));
    let now = open(&longer).unwrap();
    assert_eq!((now.commit.unwrap().generation, now.descriptor.time_steps), (4, 4));
    for name in [b"CBOK", b"META"] {
        assert_eq!(now.section(*name).unwrap().offset, head.section(*name).unwrap().offset);
    }
    assert_eq!(now.section(*b"BRIK").unwrap().item_count, 5);
    assert_eq!(read_index(&longer).unwrap()[..].iter().filter(|n| n.kind == NodeKind::Stored).count(), 5);
    let other = |f: fn(&mut VolumeDescriptor)| {
        let mut d = d.clone();
        f(&mut d);
        resume(&d).map(|_| ()).unwrap_err().code()
    };
    assert_eq!(other(|d| d.dims.x += 1), Code::Param);
    assert_eq!(other(|d| d.time_steps = 1), Code::Param);
    assert_eq!(other(|d| d.codecs.remove(0).id = 0), Code::Param);
    let file = small();
    let e = LogWriter::resume(vec![], &open(&file).unwrap(), &d, &mut reader(&file)).map(|_| ()).unwrap_err();
    assert!(e.code() == Code::Param && e.message().contains("vug pack --log"));
}

#[test] // spec: LOG-10, LOG-9; C-14
fn appending_to_what_a_stopped_writer_left() {
    let log = small_log();
    for len in (commits(&log)[0].end..log.len() as u64).step_by(97) {
        let torn = &log[..len as usize];
        let head = open(torn).unwrap();
        let kept = kept_options(&head, &Limits::default(), &mut reader(torn)).unwrap();
        let mut d = VolumeDescriptor { time_steps: head.descriptor.time_steps + 1, ..head.descriptor.clone() };
        // What was not finished is cut off first.
        let whole = torn[..head.commit.unwrap().end as usize].to_vec();
        let mut w = LogWriter::resume(whole, &head, &d, &mut reader(torn)).unwrap();
        let tree = head.descriptor.time_steps;
        put(&mut w, &mut d, (tree, 2, [0, 0, 0]), 0, NodeFlags::default(), &payload(5, 50));
        let (longer, _) = w.finish(&d, FinishOptions { times: None, ..kept }).unwrap();
        assert!(strict(&longer).is_empty(), "{len}: {:?}", strict(&longer));
        assert_eq!(open(&longer).unwrap().commit.unwrap().generation, head.commit.unwrap().generation + 1);
    }
}

#[test] // spec: LOG-10; C-14
fn a_commit_is_never_far_from_the_end() {
    let (mut d, options) = (descriptor([400, 20, 17], 3), small_options());
    let mut w = LogWriter::create(Vec::new(), &d, &options).unwrap();
    w.commit_every(2000);
    let none = NodeFlags::default();
    put(&mut w, &mut d, (0, 0, [0, 0, 0]), 0, none, &payload(1, 77));
    w.checkpoint(&d, &options).unwrap();
    let before = open(w.get_mut()).unwrap();
    for x in 1..25 {
        put(&mut w, &mut d, (0, 0, [x, 0, 0]), 0, none, &payload(2, 300));
        let node = Node::new_constant(SampleValue::U8(x as u8), none, None);
        w.put_constant(0, 0, [x, 1, 0], &node).unwrap();
    }
    let (log, _) = w.finish(&d, options).unwrap();
    let all = commits(&log);
    // The index comes last, and some of its pages are longer than that.
    let near = |w: &[Commit], most: u64| w[1].offset - w[0].end <= most;
    assert!(all.len() > 8 && all[1..6].windows(2).all(|w| near(w, 2100)), "{all:?}");
    assert!(all[1..].windows(2).all(|w| near(w, 4000)), "{all:?}");
    let errors = strict(&log);
    assert!(errors.is_empty(), "{errors:?}");
    // Between the checkpoint and the end, all of them say what the checkpoint said.
    for commit in &all[2..all.len() - 1] {
        let cut = &log[..commit.end as usize];
        let head = open(cut).unwrap();
        assert_eq!((&head.descriptor, &head.directory), (&before.descriptor, &before.directory));
        assert!(strict(cut).is_empty());
        // Bricks that are written, but of which no commit speaks yet, are not lost.
        let found = recover(cut.len() as u64, &Limits::default(), &mut reader(cut)).unwrap();
        let written = find_leaders(cut, 0, &head.superblock.file_id).len();
        assert!(written > 4 && found.lost.is_empty());
        assert_eq!(found.bricks.len(), written, "{commit:?}");
    }
    assert_eq!(read_index(&log).unwrap().iter().filter(|n| n.kind == NodeKind::Stored).count(), 25);
}

/// A log of a hundred bricks of 4,000 bytes behind its second commit.
fn long_log() -> (Vec<u8>, Vec<Commit>) {
    let (mut d, options) = (descriptor([2000, 20, 17], 1), FinishOptions::default());
    let mut w = LogWriter::create(Vec::new(), &d, &options).unwrap();
    put(&mut w, &mut d, (0, 0, [100, 1, 1]), 0, NodeFlags::default(), &payload(7, 100));
    w.checkpoint(&d, &options).unwrap();
    for x in 0..100 {
        put(&mut w, &mut d, (0, 0, [x, 0, 0]), 0, NodeFlags::default(), &payload(x as u8, 4000));
    }
    let log = w.finish(&d, options).unwrap().0;
    let all = commits(&log);
    (log, all)
}

#[test] // spec: LOG-9, VAL-7
fn a_commit_out_of_reach_is_found_from_the_front() {
    let (log, all) = long_log();
    let limits = Limits { log_search_bytes: 20_000, ..Limits::default() };
    let asked = |bytes: &[u8]| open_parser(HeadParser::new(bytes.len() as u64, &limits), bytes);
    for cut in [1, 16, 40, 300, 4_000, 100_000] {
        let torn = &log[..all[2].offset as usize - cut];
        let (head, reads) = asked(torn).unwrap();
        assert_eq!(head.commit, Some(all[1]), "{cut}");
        assert!(reads.len() < 130 && reads[1..].iter().all(|r| r.0 >= HEAD_BYTES), "{reads:?}");
        // Windows of 4 KiB go forward, each byte once but for those of a leader.
        let walked: Vec<_> = reads[1..].iter().filter(|r| r.1 <= 4 << 10).collect();
        assert!(walked.len() > 20 && walked.windows(2).all(|w| w[0].0 + w[0].1 as u64 <= w[1].0 + 32), "{walked:?}");
        // Who recovers does not trust leaders: damage would end the walk.
        let e = open_parser(HeadParser::salvage(torn.len() as u64, &limits), torn).unwrap_err();
        assert_eq!(e.code(), Code::Commit);
    }
    // Remains of something else behind it, zeros behind it: there is no record to go to.
    for fill in [0xEE, 0] {
        let mut torn = log[..all[2].offset as usize - 40].to_vec();
        torn.resize(torn.len() + 2_000_000, fill);
        assert_eq!(asked(&torn).unwrap().0.commit, Some(all[1]));
    }
    // A damaged commit is passed over; without any, there is none.
    let mut torn = log[..all[2].offset as usize].to_vec();
    torn[all[1].offset as usize + 50] ^= 1;
    assert_eq!(asked(&torn).unwrap().0.commit, Some(all[0]));
    torn[all[0].offset as usize + 50] ^= 1;
    let e = asked(&torn).unwrap_err();
    assert!(e.code() == Code::Commit && e.message().contains("vug recover"), "{e}");
}

#[test]
fn checkpoints_cost_less_than_what_is_written() {
    let (mut d, options) = (descriptor([512, 512, 512], 1), FinishOptions::default());
    let mut w = LogWriter::create(Vec::new(), &d, &options).unwrap();
    let (mut pending, mut cost, mut made) = (0, 0, 0);
    for i in 0..16_384u32 {
        let brick = [i % 32, i / 32 % 32, i / 1024];
        put(&mut w, &mut d, (0, 0, brick), 0, NodeFlags::default(), &payload(i as u8, 256));
        pending += 256;
        if w.checkpoint_due(pending, 4096) {
            w.checkpoint(&d, &options).unwrap();
            (pending, made) = (0, made + 1);
            cost += w.checkpoint_cost();
        }
    }
    let written = d.payload_bytes;
    assert!(made >= 3, "{made}");
    assert!(cost <= 2 * written, "{made} checkpoints went through {cost} bytes for {written} bytes of payload");
}

/// Takes `room` bytes, then fails.
struct Full {
    room: usize,
}

impl std::io::Write for Full {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.room == 0 {
            return Err(std::io::Error::other("disk full"));
        }
        let taken = bytes.len().min(self.room);
        self.room -= taken;
        Ok(taken)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test] // spec: LOG-10
fn a_write_that_fails_ends_the_writer() {
    let options = FinishOptions::default();
    let failed = |room: usize| -> (Error, Option<Error>) {
        let mut d = descriptor([400, 20, 17], 1);
        let mut w = match LogWriter::create(Full { room }, &d, &options) {
            Ok(w) => w,
            Err(e) => return (e, None),
        };
        for x in 0..25 {
            let node = Node::new_stored(0, NodeFlags::default(), (20.0, 119.0), None);
            if let Err(e) = w.put_stored(0, 0, [x, 0, 0], &node, &payload(1, 4000)) {
                return (e, w.checkpoint(&d, &options).err());
            }
            d.payload_bytes += 4000;
        }
        let e = w.checkpoint(&d, &options).unwrap_err();
        (e, w.checkpoint(&d, &options).err())
    };
    for room in [0, 100, 5000, 50_000, 101_000] {
        let (e, later) = failed(room);
        assert_eq!(e.code(), Code::Source, "{e}");
        assert!(later.is_none_or(|e| e.code() == Code::Param), "a broken writer takes no more");
    }
}
