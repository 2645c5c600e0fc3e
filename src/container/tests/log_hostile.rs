//! Logs from strangers: no bytes make a reader, validator or recovery panic or work without bound.

use super::support::*;
use crate::container::*;
use crate::error::Code;
use crate::limits::Limits;
use std::io::Cursor;

#[test] // spec: SAF-1, SAF-3, VAL-13, LOG-9; C-02, C-14
fn every_flip_of_a_byte_is_detected_or_cut_back() {
    let log = small_log();
    let (whole, id) = (commits(&log), open(&log).unwrap().superblock.file_id);
    for at in 0..log.len() {
        for bit in [0, 5, 7] {
            let mut bad = log.clone();
            bad[at] ^= 1 << bit;
            let _ = read_index(&bad);
            let head = match open(&bad) {
                Ok(head) => head,
                Err(e) => {
                    assert!(at < 256, "byte {at}: {e}");
                    continue;
                }
            };
            let commit = head.commit.unwrap();
            assert!(whole.contains(&commit) && head.superblock.file_id == id, "byte {at}");
            // The last commit that the change has not touched, or one that it does not reach.
            let due = whole.iter().rfind(|c| !(c.offset..c.end).contains(&(at as u64))).unwrap();
            assert_eq!(commit, *due, "byte {at}");
        }
    }
}

#[test] // spec: SAF-1, SAF-2, SAF-4, VAL-3, VAL-8
fn random_changes_under_right_checksums_never_panic() {
    let log = small_log();
    let commit = *commits(&log).last().unwrap();
    let mut random = Random(7);
    let interesting = [0u8, 1, 2, 7, 64, 127, 128, 255];
    let (mut opened, mut valid) = (0, 0);
    for _ in 0..3000 {
        let mut bad = log.clone();
        for _ in 0..=random.next(3) {
            let at = commit.offset as usize + random.next((commit.end - commit.offset) as usize);
            for i in 0..=random.next(8) {
                let last = bad.len() - 1;
                bad[(at + i).min(last)] = interesting[random.next(8)];
            }
        }
        reseal_commit(&mut bad, &commit);
        let limits = Limits::default();
        opened += u32::from(open(&bad).is_ok_and(|head| head.commit == Some(commit)));
        let _ = read_index(&bad);
        valid += u32::from(strict(&bad).is_empty());
        let _ = recover(bad.len() as u64, &limits, &mut reader(&bad));
        let _ = rewrite(bad.len() as u64, &limits, &mut reader(&bad), Cursor::new(vec![]));
        if let Ok(head) = open(&bad) {
            let _ = LogWriter::resume(Vec::new(), &head, &head.descriptor, &mut reader(&bad)).map(|_| ());
        }
    }
    assert!(opened > 50 && valid < opened, "{opened} opened, {valid} strictly valid");
}

/// A reader that counts bytes.
fn counted<'a>(bytes: &'a [u8], spent: &'a mut u64) -> impl FnMut(u64, usize) -> crate::Result<Vec<u8>> + 'a {
    move |offset, len| {
        *spent += len as u64;
        reader(bytes)(offset, len)
    }
}

#[test] // spec: LOG-9, SAF-1
fn trailers_that_point_anywhere_cost_a_bounded_search() {
    // Everything behind the first commit is trailers with right checksums, all of which name the same big commit.
    let log = small_log();
    let id = open(&log).unwrap().superblock.file_id;
    let first = commits(&log)[0];
    let mut bad = log[..first.end as usize].to_vec();
    let record = [&b"VREC\x04\0\0\0"[..], &9u64.to_le_bytes(), &(1u64 << 20).to_le_bytes(), &[0; 4]].concat();
    let crc = crate::checksum::crc32_seeded(&id, &record);
    bad.extend([&record[..], &crc.to_le_bytes()].concat());
    for i in 0..70_000u64 {
        let commit = if i % 2 == 0 { first.end } else { 256 + i % 1000 * 16 };
        let body = [&b"VEND\0\0\0\0"[..], &commit.to_le_bytes(), &9u64.to_le_bytes(), &[0; 4]].concat();
        bad.extend(&body);
        bad.extend(crate::checksum::crc32_seeded(&id, &body).to_le_bytes());
    }
    let mut parser = HeadParser::new(bad.len() as u64, &Limits::default());
    let (mut wishes, mut bytes) = (0u64, 0u64);
    loop {
        match parser.next() {
            Ok(Step::Done(head)) => {
                assert_eq!(head.commit.unwrap(), first);
                break;
            }
            Ok(Step::Need { offset, len }) => {
                (wishes, bytes) = (wishes + 1, bytes + len as u64);
                assert!(bytes < 1 << 30, "{wishes} wishes for {bytes} bytes");
                parser.supply(offset, reader(&bad)(offset, len).unwrap());
            }
            Err(e) => {
                // The search gives up before it has looked at everything over and over.
                assert_eq!(e.code(), Code::Commit);
                assert!(bytes <= crate::limits::LOG_SEARCH_BYTES + (3 << 20), "{bytes}");
                break;
            }
        }
    }
}

#[test] // spec: LOG-11, SAF-1
fn leaders_in_each_others_payloads_cost_a_bounded_search() {
    let log = small_log();
    let id = open(&log).unwrap().superblock.file_id;
    let mut bad = log.clone();
    for i in 0..20_000u32 {
        let leader = Leader {
            level: 0,
            kind: NodeKind::Stored,
            codec: 0,
            flags: NodeFlags::default(),
            brick: [i % 3, 0, 0],
            tree: i % 2,
            stored_len: 500_000,
            crc: 1,
        };
        bad.extend(leader.write_to(&id));
    }
    let mut spent = 0;
    let found = recover(bad.len() as u64, &Limits::default(), &mut counted(&bad, &mut spent)).unwrap();
    assert_eq!(found.bricks.len(), 5);
    assert!(spent < 200 << 20, "{spent} bytes read of {}", bad.len());
}
