//! Whole files: prefixes, flips, identity (chapter 9).

use super::support::*;
use crate::container::*;
use crate::limits::Limits;
use std::io::Cursor;

#[test] // spec: VAL-13, HDR-9; C-01
fn every_proper_prefix_is_refused() {
    let file = small();
    for len in 0..file.len() {
        let e = open(&file[..len]).map(|_| ()).expect_err("a prefix");
        assert!(e.offset().is_some_and(|o| o <= len as u64), "{len}: {e}");
        assert_eq!(e.code(), crate::Code::Truncated, "{len}: {e}");
        // What is left can be looked at, as soon as the tables are there.
        let salvage = HeadParser::salvage(len as u64, &Limits::default());
        let opened = open_parser(salvage, &file[..len]);
        let tables = open(&file).unwrap().section(*b"VOLD").unwrap().end();
        assert_eq!(opened.is_ok(), len as u64 >= tables, "{len}: {:?}", opened.map(|_| ()));
    }
}

#[test] // spec: VAL-13; C-02
fn every_flip_of_a_byte_is_detected() {
    for file in [tiny(), small()] {
        for i in 0..file.len() {
            for flip in [0x01, 0x80, 0xFF] {
                let mut bad = file.clone();
                bad[i] ^= flip;
                assert!(!strict(&bad).is_empty(), "byte {i} ^ {flip:#x}");
            }
        }
    }
}

#[test] // spec: VAL-11, GEN-8, GEN-1; C-16, C-20
fn what_is_taken_apart_is_written_the_same() {
    for file in [small(), tiny(), small_with(FinishOptions { file_id: Some([3; 16]), ..FinishOptions::default() })] {
        let copy = rewrite(file.len() as u64, &Limits::default(), &mut reader(&file), Cursor::new(Vec::new())).unwrap();
        assert_eq!(copy.0.into_inner(), file);
        assert_eq!(copy.1.len, file.len() as u64);
    }
}

#[test]
fn what_was_written_is_told() {
    let mut d = descriptor([40, 20, 17], 3);
    let mut w = FileWriter::new(Cursor::new(Vec::new()), &d).unwrap();
    put(&mut w, &mut d, (0, 0, [0, 0, 0]), 0, NodeFlags::default(), &payload(1, 77));
    let node = Node::new_constant(crate::voxel::SampleValue::U8(3), NodeFlags::default(), None);
    w.put_constant(0, 1, [1, 0, 0], &node).unwrap();
    let (file, s) = w.finish(&d, FinishOptions::default()).unwrap();
    let head = open(file.get_ref()).unwrap();
    assert_eq!((s.len, s.file_id), (file.get_ref().len() as u64, head.superblock.file_id));
    assert_eq!((s.stored, s.constant, s.empty, s.pages, s.stored_bytes), (1, 1, 12 + 2 + 1 - 2, 3, 77));
    assert_eq!(head.descriptor, d);
}

#[test] // spec: VAL-11, IDX-1, IDX-12, IDX-13, BRK-3; C-20
fn random_volumes_are_strictly_valid_and_written_the_same() {
    let mut random = Random(0xD1B5_4A32_D192_ED03);
    for round in 0..150 {
        let dims = [1 + random.next(300), 1 + random.next(200), 1 + random.next(150)].map(|n| n as u32);
        let mut d = descriptor(dims, 1 + random.next(6) as u8);
        (d.time_steps, d.channels) = (1 + random.next(2) as u32, 1 + random.next(3) as u32);
        d.null_value[0] = random.next(256) as u32;
        let mut w = FileWriter::new(Cursor::new(Vec::new()), &d).unwrap();
        let (trees, levels) = (w.octree().trees() as usize, w.octree().levels.clone());
        let mut taken = std::collections::BTreeSet::new();
        for _ in 0..random.next(80) {
            let (tree, level) = (random.next(trees) as u32, random.next(levels.len()));
            let brick = levels[level].bricks.to_array().map(|n| random.next(n as usize) as u32);
            if !taken.insert((tree, level, brick)) {
                continue;
            }
            let at = (tree, level as u8, brick);
            let (codec, seed) = (random.next(2) as u8, random.next(256) as u8);
            match random.next(4) {
                0 => {
                    let value = crate::voxel::SampleValue::U8(seed);
                    w.put_constant(tree, at.1, brick, &Node::new_constant(value, NodeFlags::LOSSLESS, Some(0.0)))
                        .unwrap();
                }
                1 => put(&mut w, &mut d, at, codec, NodeFlags::ZSTD, &[seed; ZSTD_LEN]),
                _ => put(&mut w, &mut d, at, codec, NodeFlags::default(), &payload(seed, 1 + random.next(500))),
            }
        }
        let file = w.finish(&d, FinishOptions::default()).unwrap().0.into_inner();
        assert!(strict(&file).is_empty(), "round {round}, {dims:?}: {:?}", strict(&file));
        let copy = rewrite(file.len() as u64, &Limits::default(), &mut reader(&file), Cursor::new(Vec::new())).unwrap();
        assert!(copy.0.into_inner() == file, "round {round}, {dims:?}");
    }
}
