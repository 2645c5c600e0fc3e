//! Strict validation of logs: every record, what lives among them, and nothing else (chapter 15).

use super::support::*;
use crate::container::log::{CommitParts, RECORD_BYTES};
use crate::container::*;
use crate::error::Code;

/// A log with one more commit, which says something else than the last one. `padding` bytes lie before it.
fn recommitted(log: &[u8], padding: usize, f: impl FnOnce(&mut Head, &mut Vec<SectionEntry>)) -> Vec<u8> {
    let mut head = open(log).unwrap();
    let own = [*b"VOLD", *b"PDIR", *b"FNAM", *b"PAGE", *b"BRIK"];
    let mut sections: Vec<_> = head.sections.iter().filter(|s| !own.contains(&s.fourcc)).cloned().collect();
    f(&mut head, &mut sections);
    let at = (log.len() + padding) as u64;
    let count = |name| head.section(name).unwrap().item_count;
    let parts = CommitParts {
        superblock: head.superblock.clone(),
        descriptor: &head.descriptor,
        names: &head.feature_names,
        refs: &head.directory,
        pages: count(*b"PAGE"),
        stored: count(*b"BRIK"),
        sections: &sections,
    };
    let mut log = log.to_vec();
    log.resize(at as usize, 0);
    log.extend(parts.write_to(at, head.commit.unwrap().generation + 1));
    log
}

fn codes(log: &[u8]) -> Vec<Code> {
    strict(log).iter().map(|e| e.code()).collect()
}

#[test] // spec: LOG-2, LOG-3, LOG-4, LOG-5, LOG-6, LOG-7, VAL-11
fn logs_are_strictly_valid() {
    let log = small_log();
    for commit in commits(&log) {
        let errors = strict(&log[..commit.end as usize]);
        assert!(errors.is_empty(), "{}: {errors:?}", commit.generation);
    }
    let again = recommitted(&log, 0, |_, _| ());
    assert!(strict(&again).is_empty(), "{:?}", strict(&again));
    // A log written as a head file has the same content, and an id that follows from it.
    let (file, summary) =
        rewrite(log.len() as u64, &Default::default(), &mut reader(&log), std::io::Cursor::new(vec![])).unwrap();
    let file = file.into_inner();
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    assert_eq!((summary.stored, summary.constant), (4, 1));
    assert_ne!(summary.file_id, open(&log).unwrap().superblock.file_id);
    assert_eq!(open(&file).unwrap().descriptor, open(&log).unwrap().descriptor);
}

#[test] // spec: VAL-13, LOG-2, LOG-4; C-02
fn every_flip_of_a_byte_of_a_log_is_detected() {
    let log = small_log();
    for at in 0..log.len() {
        let mut bad = log.clone();
        bad[at] ^= 1 << (at % 8);
        assert!(!strict(&bad).is_empty(), "byte {at}");
    }
}

#[test] // spec: LOG-9, VAL-13; C-01
fn what_was_not_finished_is_an_error_with_a_number() {
    let log = small_log();
    let all = commits(&log);
    for len in (all[1].end + 1..all[2].end).step_by(7) {
        let errors = strict(&log[..len as usize]);
        assert_eq!(errors.iter().map(told).collect::<Vec<_>>(), [(Code::Commit, Some(all[1].end))]);
        let message = errors[0].message();
        assert!(message.starts_with(&format!("{} bytes", len - all[1].end)), "{message}");
        assert!(message.contains("2 stored bricks live") && message.contains("vug recover"), "{message}");
    }
}

#[test] // spec: LOG-2, LOG-3, LOG-4, LOG-7, LOG-8
fn what_a_commit_must_not_say() {
    let log = small_log();
    let end = log.len() as u64;
    // A record later than it could be.
    assert_eq!(codes(&recommitted(&log, 16, |_, _| ())), [Code::Canon]);
    // Section META in bytes that are no record of that name.
    let moved = recommitted(&log, 0, |_, sections| {
        let books = sections.iter().position(|s| s.fourcc == *b"CBOK").unwrap();
        let meta = sections.iter().position(|s| s.fourcc == *b"META").unwrap();
        let (offset, len) = (sections[books].offset + 16, 12);
        let crc = crate::checksum::crc32(&log[offset as usize..][..len]);
        (sections[meta].offset, sections[meta].crc) = (offset, crc);
        (sections[meta].stored_len, sections[meta].decoded_len) = (len as u64, len as u64);
    });
    assert_eq!(open(&moved).map(|_| ()).unwrap_err().code(), Code::SectionOverlap);
    let elsewhere = recommitted(&log, 0, |_, sections| {
        let meta = sections.iter().position(|s| s.fourcc == *b"META").unwrap();
        // The last byte of the text is not in it.
        sections[meta].stored_len -= 1;
        sections[meta].decoded_len -= 1;
        let range = sections[meta].offset as usize..sections[meta].end() as usize;
        sections[meta].crc = crate::checksum::crc32(&log[range]);
    });
    assert!(codes(&elsewhere).contains(&Code::Leader), "{:?}", strict(&elsewhere));
    // A chunk that no record holds: what lies there is another one.
    let chunk = recommitted(&log, 0, |head, _| head.directory.clear());
    assert!(codes(&chunk).contains(&Code::Canon), "{:?}", strict(&chunk));
    // Features and levels.
    for f in [(|s| s.optional = 2) as fn(&mut Superblock), |s| s.required = 0, |s| s.resource_level = 3] {
        let bad = recommitted(&log, 0, |head, _| f(&mut head.superblock));
        assert!(!strict(&bad).is_empty());
    }
    // Opening refuses a commit of another file, or one that does not say where it ends.
    for f in [(|s| s.file_id[0] ^= 1) as fn(&mut Superblock), |s| s.required |= 1 << 9] {
        let mut bad = recommitted(&log, 0, |_, _| ());
        let commit = Commit { offset: end, end: bad.len() as u64, generation: 4 };
        let at = end as usize + RECORD_BYTES;
        let mut s = open(&bad).unwrap().superblock;
        f(&mut s);
        bad[at..at + 256].copy_from_slice(&s.write_to());
        reseal_commit(&mut bad, &commit);
        let e = open(&bad).map(|_| ()).unwrap_err();
        assert!([Code::Commit, Code::Feature].contains(&e.code()) && e.offset() > Some(end), "{e}");
    }
}

#[test] // spec: LOG-5, LOG-8, VAL-1
fn fields_of_a_commit_are_checked_where_they_lie() {
    let log = small_log();
    let commit = *commits(&log).last().unwrap();
    let at = commit.offset + 32;
    let told = |offset: u64, value: &[u8]| {
        let mut bad = log.clone();
        set(&mut bad, at + offset, value);
        reseal_commit(&mut bad, &commit);
        open(&bad).map(|_| ()).map_err(|e| told(&e)).unwrap_err()
    };
    assert_eq!(told(12, &[9]), (Code::Version, Some(at + 12)));
    assert_eq!(told(40, &[9]), (Code::Commit, Some(at + 40)));
    assert_eq!(told(72, &[0]), (Code::Commit, Some(at + 24)));
    assert_eq!(told(73, &[1]), (Code::Commit, Some(at + 40)));
    assert_eq!(told(74, &[9]), (Code::Param, Some(at + 74)));
    assert_eq!(told(76, &[65]), (Code::Limit, Some(at + 76)));
    assert_eq!(told(80, &[0; 8]), (Code::SectionRange, Some(at + 80)));
    let table = open(&log).unwrap().superblock.section_table_offset;
    let place = |name: [u8; 4]| open(&log).unwrap().sections.iter().position(|s| s.fourcc == name).unwrap() as u64;
    // VOLD outside of its commit, metadata behind the records.
    assert_eq!(told(256 + place(*b"VOLD") * 64 + 8, &[0, 1, 0, 0, 0, 0, 0, 0]).0, Code::SectionOverlap);
    let meta = table + place(*b"META") * 64 + 8;
    let mut bad = log.clone();
    set(&mut bad, meta, &(commit.end - 32).to_le_bytes());
    reseal_commit(&mut bad, &commit);
    assert_eq!(super::support::told(&open(&bad).map(|_| ()).unwrap_err()), (Code::Commit, Some(meta)));
}
