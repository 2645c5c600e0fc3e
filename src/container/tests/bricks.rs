//! Chapter 6, as far as no codec is needed.

use super::support::*;
use crate::checksum::crc32_seeded;
use crate::container::*;
use crate::error::Code;

/// The stored nodes of a file in file order.
fn stored(file: &[u8]) -> Vec<Node> {
    let mut nodes: Vec<Node> = read_index(file).unwrap().into_iter().filter(|n| n.kind == NodeKind::Stored).collect();
    nodes.sort_by_key(|n| n.offset);
    nodes
}

#[test] // spec: BRK-2, BRK-3, BRK-4, SEC-16
fn places() {
    let file = small();
    let brik = open(&file).unwrap().section(*b"BRIK").unwrap().clone();
    let mut cursor = brik.offset;
    for node in stored(&file) {
        let direct = node.codec == 1 && !node.flags.contains(NodeFlags::ZSTD);
        let align = if direct { 256 } else { 16 };
        assert_eq!(node.offset, (cursor + 32).next_multiple_of(align));
        let padding = &file[cursor as usize..node.offset as usize - 32];
        let end = node.offset + u64::from(node.stored_len);
        let guard = &file[end as usize..end as usize + 16];
        assert!(padding.iter().chain(guard).all(|&b| b == 0));
        for at in (cursor..node.offset - 32).chain(end..end + 16) {
            strictly_refused(&changed(&file, at, &[1]), Code::Padding, at);
        }
        cursor = end + 16;
    }
    assert_eq!(cursor, brik.end());
}

#[test] // spec: BRK-5, GEN-5
fn leaders() {
    let file = small();
    let head = open(&file).unwrap();
    let id = head.superblock.file_id;
    for node in stored(&file) {
        let at = node.offset as usize - 32;
        let leader = Leader::read_from(&file[at..at + 32], at as u64, &id).unwrap();
        assert_eq!(leader.write_to(&id)[..], file[at..at + 32]);
        assert_eq!((leader.stored_len, leader.crc, leader.codec), (node.stored_len, node.crc, node.codec));
        assert_eq!(file[at + 28..at + 32], crc32_seeded(&id, &file[at..at + 28]).to_le_bytes());
        for i in 0..32 {
            let mut bad = file.clone();
            bad[at + i] ^= 4;
            let errors = strict(&bad);
            assert!(errors.iter().any(|e| e.code() == Code::Leader), "byte {i}: {errors:?}");
        }
        // Whole, but of another brick.
        let other = Leader { brick: [1, 1, 1], ..leader };
        let mut bad = file.clone();
        set(&mut bad, at as u64, &other.write_to(&id));
        strictly_refused(&bad, Code::Leader, at as u64);
        // Whole, but of another file.
        set(&mut bad, at as u64, &leader.write_to(&[1; 16]));
        strictly_refused(&bad, Code::Leader, at as u64 + 28);
    }
}

#[test] // spec: BRK-5, GEN-5; C-14
fn a_scan_finds_every_leader_of_this_file_and_no_other() {
    let file = small();
    let id = open(&file).unwrap().superblock.file_id;
    let offsets: Vec<u64> = stored(&file).iter().map(|n| n.offset - 32).collect();
    let found = |from: usize, to: usize| -> Vec<u64> {
        find_leaders(&file[from..to], from as u64, &id).iter().map(|f| f.0).collect()
    };
    assert_eq!(found(0, file.len()), offsets);
    assert_eq!(found(offsets[1] as usize, file.len()), offsets[1..]);
    assert_eq!(found(offsets[1] as usize + 1, file.len()), offsets[2..]);
    assert!(found(0, offsets[0] as usize + 31).is_empty());
    assert!(find_leaders(&file, 0, &[7; 16]).is_empty());
    assert_eq!(find_leaders(&file, 0, &id)[1].1.brick, [2, 1, 1]);
    let far = Leader { brick: [(1 << 21) - 1, 5, 1 << 20], ..find_leaders(&file, 0, &id)[0].1 };
    assert_eq!(Leader::read_from(&far.write_to(&id), 0, &id).unwrap(), far);
}

#[test] // spec: BRK-6
fn payload_crcs() {
    let file = small();
    for node in stored(&file) {
        let mut bad = file.clone();
        bad[node.offset as usize + 5] ^= 1;
        assert!(read_index(&bad).is_ok(), "nobody has touched the brick");
        strictly_refused(&bad, Code::BrickCrc, node.offset);
        let payload = &file[node.offset as usize..][..node.stored_len as usize];
        node.check_payload(payload).unwrap();
        assert_eq!(node.check_payload(&payload[1..]).unwrap_err().code(), Code::Size);
    }
}

#[test] // spec: BRK-8, BRK-10, VER-4
fn flags_that_follow_from_the_bricks() {
    let file = small();
    let p = Places::of(&file);
    // ZSTD is set and there is a compressed payload; the other way round:
    let plain = tiny();
    let fnam_less = changed(&plain, 48, &[1]);
    strictly_refused(&fnam_less, Code::Canon, 48);
    assert!(!p.head.section(*b"BRIK").unwrap().flags.contains(SectionFlags::GPU_DIRECT));
    let direct = Places::of(&plain);
    let brik = direct.head.section(*b"BRIK").unwrap();
    assert!(brik.flags.contains(SectionFlags(1 | 8)));
    strictly_refused(&changed(&plain, direct.entry(*b"BRIK") + 6, &[1]), Code::Canon, direct.entry(*b"BRIK"));
    strictly_refused(&changed(&file, p.entry(*b"BRIK") + 6, &[9]), Code::Canon, p.entry(*b"BRIK"));
    // Two codec entries on one level are not direct, on two levels they are.
    for (level, wanted) in [(0, false), (1, true)] {
        let mut d = descriptor([32, 16, 16], 2);
        let mut w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
        put(&mut w, &mut d, (0, 0, [1, 0, 0]), 0, NodeFlags::default(), &payload(1, 9));
        put(&mut w, &mut d, (0, level, [0, 0, 0]), 1, NodeFlags::default(), &payload(1, 9));
        let file = w.finish(&d, FinishOptions::default()).unwrap().0.into_inner();
        let flags = open(&file).unwrap().section(*b"BRIK").unwrap().flags;
        assert_eq!(flags.contains(SectionFlags::GPU_DIRECT), wanted);
        assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    }
}

#[test] // spec: BRK-8; C-06
fn a_frame_that_is_not_smaller_is_not_canonical() {
    let mut d = descriptor([4, 4, 4], 1);
    let mut w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
    let frame = zstd::bulk::compress(&[42; ZSTD_LEN], 1).unwrap();
    let node = Node::new_stored(0, NodeFlags::ZSTD, (42.0, 42.0), Some(0.0));
    w.put_stored(0, 0, [0; 3], &node, &frame).unwrap();
    d.payload_bytes = 10;
    let file = w.finish(&d, FinishOptions::default()).unwrap().0.into_inner();
    let mut s = strict::Strict::open(file.len() as u64, &Default::default(), &mut reader(&file)).unwrap();
    s.set_payload_len(0, 10);
    let errors = s.finish(&mut reader(&file));
    assert_eq!(errors.iter().map(|e| e.code()).collect::<Vec<_>>(), [Code::Canon]);
    assert!(errors[0].message().contains("not smaller"), "{errors:?}");
}

#[test] // spec: HDR-7
fn clustered_is_seen() {
    let build = |order: &[(u8, [u32; 3])]| {
        let mut d = descriptor([64, 64, 64], 2);
        let mut w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
        for &(level, brick) in order {
            put(&mut w, &mut d, (0, level, brick), 0, NodeFlags::default(), &payload(4, 20));
        }
        let file = w.finish(&d, FinishOptions::default()).unwrap().0.into_inner();
        assert!(strict(&file).is_empty(), "{:?}", strict(&file));
        open(&file).unwrap().superblock.clustered
    };
    assert!(build(&[]) && build(&[(0, [0; 3])]));
    assert!(build(&[(1, [0; 3]), (1, [1, 0, 0]), (0, [1, 0, 0]), (0, [0, 1, 0]), (0, [2, 0, 0])]));
    assert!(!build(&[(0, [1, 0, 0]), (1, [0; 3])]));
    assert!(!build(&[(0, [2, 0, 0]), (0, [0, 1, 0])]));
}

#[test]
fn what_the_writer_refuses() {
    let d = descriptor([16, 16, 16], 1);
    let mut w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
    let good = Node::new_stored(0, NodeFlags::default(), (1.0, 2.0), None);
    let mut code = |at: (u32, u8, [u32; 3]), node: &Node, payload: &[u8]| {
        w.put_stored(at.0, at.1, at.2, node, payload).map_err(|e| e.code())
    };
    for at in [(1, 0, [0; 3]), (0, 1, [0; 3]), (0, 0, [1, 0, 0])] {
        assert_eq!(code(at, &good, &[1]), Err(Code::Range));
    }
    let at = (0, 0, [0; 3]);
    assert_eq!(code(at, &Node { codec: 2, ..good }, &[1]), Err(Code::Ref));
    assert_eq!(code(at, &Node { max: 0.0, ..good }, &[1]), Err(Code::MinmaxOrder));
    assert_eq!(code(at, &Node { min: f32::NAN, ..good }, &[1]), Err(Code::NonFinite));
    assert_eq!(code(at, &Node { kind: NodeKind::Constant, ..good }, &[1]), Err(Code::Param));
    assert_eq!(code(at, &good, &[]), Err(Code::Size));
    assert_eq!(code(at, &good, &vec![0; (64 << 20) + 1]), Err(Code::Limit));
    assert_eq!(code(at, &good, &[1]), Ok(()));
    assert_eq!(code(at, &good, &[1]), Err(Code::Dup));
    let other = descriptor([16, 16, 17], 1);
    assert_eq!(w.finish(&other, FinishOptions::default()).map(|_| ()).unwrap_err().code(), Code::Param);
}
