//! What only the strict validator sees (chapter 9).

use super::support::*;
use crate::container::strict::Coverage;
use crate::container::*;
use crate::error::Code;

#[test] // spec: VAL-11, VAL-12, VAL-13
fn valid_files_are_valid() {
    for file in [small(), tiny()] {
        assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    }
}

#[test] // spec: VAL-9, VAL-10; C-04
fn coverage() {
    let mut c = Coverage::default();
    c.add(10..20, "a");
    c.add(30..40, "b");
    c.add(25..25, "nothing");
    assert!(c.overlaps().is_empty());
    assert_eq!(c.gaps(50), [0..10, 20..30, 40..50]);
    c.add(12..14, "inside");
    c.add(18..31, "across");
    assert_eq!(c.overlaps(), [(12, "a", "inside"), (18, "a", "across"), (30, "across", "b")]);
    assert_eq!(c.gaps(35), vec![0..10; 1]);
}

#[test] // spec: VAL-9; C-04
fn overlaps_of_items() {
    let file = small();
    let p = Places::of(&file);
    // Two nodes share one payload; two page entries share one page.
    let node = p.pages[0] as usize;
    let shared = changed(&file, p.pages[0] + 14 * 32, &file[node..node + 16]);
    let offset = u64::from_le_bytes(file[node..node + 8].try_into().unwrap());
    strictly_refused(&shared, Code::SectionOverlap, offset - 32);
    let shared = changed(&file, p.chunk + 16, &p.pages[0].to_le_bytes());
    strictly_refused(&shared, Code::SectionOverlap, p.pages[0]);
    // A chunk inside a section: VOLD's codec parameters happen to be zero page entries.
    let pdir = p.section(*b"PDIR");
    let inside = changed(&file, pdir + 8, &(p.section(*b"VOLD") + 256 + 16).to_le_bytes());
    let errors = strict(&inside);
    assert!(errors.iter().any(|e| e.code() == Code::SectionOverlap || e.code() == Code::Canon), "{errors:?}");
}

#[test] // spec: IDX-5, IDX-6, IDX-14
fn trailing_and_outside_nodes() {
    let file = small();
    let p = Places::of(&file);
    // The last node of page 0 made EMPTY: it should not be stored.
    let last = p.pages[0] + 14 * 32;
    strictly_refused(&changed(&file, last, &[0; 32]), Code::Canon, last);
    // A node outside the volume: slot 9 is brick (3, 0, 0) of 3 along x.
    let constant = &file[p.pages[0] as usize + 64..][..32];
    let outside = p.pages[0] + 9 * 32;
    strictly_refused(&changed(&file, outside, constant), Code::Canon, outside);
    // The last page entry made zero: it should not be stored.
    strictly_refused(&changed(&file, p.chunk + 32, &[0; 16]), Code::Canon, p.chunk);
}

#[test] // spec: IDX-12, IDX-13, IDX-15, VAL-12; D-54
fn bounds_and_masks() {
    let file = small();
    let p = Places::of(&file);
    let f = |v: f32| v.to_le_bytes();
    for page in [p.pages[1], p.pages[2]] {
        strictly_refused(&changed(&file, page + 18, &[1]), Code::Canon, page + 18);
        strictly_refused(&changed(&file, page + 20, &f(6.0)), Code::Canon, page + 20);
        strictly_refused(&changed(&file, page + 20, &f(8.0)), Code::Canon, page + 20);
        strictly_refused(&changed(&file, page + 24, &f(201.0)), Code::Canon, page + 20);
        strictly_refused(&changed(&file, page + 24, &f(199.0)), Code::Canon, page + 20);
        strictly_refused(&changed(&file, page + 28, &f(0.25)), Code::Canon, page + 20);
    }
    // Level 0: against the decoded voxels, and against the value.
    let (stored, constant) = (p.pages[0], p.pages[0] + 64);
    strictly_refused(&changed(&file, stored + 20, &f(0.0)), Code::Canon, stored + 20);
    strictly_refused(&changed(&file, constant + 24, &f(200.5)), Code::Canon, constant + 20);
    // −0 is not canonical, and LOSSLESS means no error.
    strictly_refused(&changed(&file, constant + 28, &f(0.5)), Code::Canon, constant + 20);
    let minus = changed(&file, p.section(*b"VOLD") + 32, &[0]);
    assert!(strict(&minus).iter().any(|e| e.code() == Code::Canon), "EMPTY bricks are now 0");
}

#[test] // spec: VAL-10, GEN-6; C-09
fn padding_everywhere() {
    let file = small();
    let mut covered = Coverage::default();
    let p = Places::of(&file);
    covered.add(0..256 + 64 * p.head.sections.len() as u64, "tables");
    for s in &p.head.sections {
        covered.add(s.offset..s.end(), "section");
    }
    let chunk = &p.head.directory[0];
    covered.add(chunk.offset..chunk.offset + chunk.byte_len() as u64, "chunk");
    let gaps = covered.gaps(file.len() as u64);
    assert!(!gaps.is_empty());
    for at in gaps.into_iter().flatten() {
        strictly_refused(&changed(&file, at, &[1]), Code::Padding, at);
    }
}

#[test]
fn errors_are_collected() {
    let file = small();
    let p = Places::of(&file);
    let mut bad = file.clone();
    for node in read_index(&file).unwrap().iter().filter(|n| n.kind == NodeKind::Stored) {
        bad[node.offset as usize] ^= 1;
    }
    bad[p.section(*b"META") as usize] ^= 1;
    let codes: Vec<Code> = strict(&bad).iter().map(|e| e.code()).collect();
    assert_eq!(codes.iter().filter(|c| **c == Code::BrickCrc).count(), 4);
    assert!(codes.contains(&Code::SectionCrc));
}
