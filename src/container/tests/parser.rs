//! Opening, sans I/O: which bytes are asked for, and in which order things are checked (chapter 9).

use super::support::*;
use crate::container::*;
use crate::error::Code;
use crate::limits::{HEAD_BYTES, Limits};

#[test] // spec: VAL-7
fn one_read_where_the_tables_are_in_the_head() {
    for file in [small(), tiny()] {
        let (head, asked) = open_parser(HeadParser::new(file.len() as u64, &Limits::default()), &file).unwrap();
        assert_eq!(asked, [(0, file.len().min(HEAD_BYTES as usize))]);
        assert!(head.directory.iter().all(|c| head.resident(c.offset, c.byte_len() as u64).is_some()));
        assert_eq!(head.resident(head.source_len - 1, 2), None);
        assert_eq!(head.resident(u64::MAX, 2), None);
    }
}

#[test] // spec: VAL-7
fn one_more_for_each_table_beyond() {
    // Many chunks: the root directory does not fit the head.
    let pages = 1024 * 700;
    let d = descriptor([16 * 8 * 2048, 16, 16], 1);
    let d = VolumeDescriptor { time_steps: pages / 2048, ..d };
    let mut w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
    let node = Node::new_constant(crate::voxel::SampleValue::U8(1), NodeFlags::default(), None);
    for chunk in 0..700 {
        w.put_constant(chunk / 2, 0, [chunk % 2 * 8 * 1024, 0, 0], &node).unwrap();
    }
    let file = w.finish(&d, FinishOptions::default()).unwrap().0.into_inner();
    let (head, asked) = open_parser(HeadParser::new(file.len() as u64, &Limits::default()), &file).unwrap();
    assert_eq!(head.directory.len(), 700);
    assert_eq!(asked, [(0, HEAD_BYTES as usize), (head.section(*b"PDIR").unwrap().offset, 700 * 24)]);
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
}

#[test] // spec: VAL-7, GEN-2
fn a_source_that_delivers_less_than_asked_ends_in_an_error() {
    let file = small();
    let mut parser = HeadParser::new(file.len() as u64, &Limits::default());
    assert!(matches!(parser.next(), Ok(Step::Need { offset: 0, .. })));
    parser.supply(0, file[..300].to_vec());
    // The table is asked for; nothing comes.
    let Ok(Step::Need { offset: 256, len }) = parser.next() else { panic!("the section table is missing") };
    parser.supply(256, vec![0; len - 1]);
    assert_eq!(parser.next().unwrap_err().code(), Code::Truncated);
    let mut empty = HeadParser::new(0, &Limits::default());
    assert_eq!(told(&empty.next().unwrap_err()), (Code::Truncated, Some(0)));
}

#[test] // spec: VAL-1
fn the_first_violation_wins() {
    // Violations from last to first in the order of checks: each one added hides those before it.
    let file = small();
    let p = Places::of(&file);
    let mut bad = file.clone();
    let mut step = |at: u64, value: &[u8], code: Code, sealed: bool| {
        set(&mut bad, at, value);
        if sealed {
            reseal(&mut bad);
        }
        assert_eq!(open(&bad).unwrap_err().code(), code, "{:?}", open(&bad));
    };
    step(p.section(*b"FNAM"), &[7], Code::Param, true);
    step(p.section(*b"PDIR") + 22, &[1], Code::Reserved, true);
    step(p.section(*b"VOLD") + 80, &[0; 8], Code::Param, true);
    step(p.section(*b"VOLD") + 64, &1e9f64.to_le_bytes(), Code::MinmaxOrder, true);
    step(p.section(*b"VOLD"), &[0; 4], Code::Param, true);
    step(p.section(*b"VOLD") + 216, &[1], Code::Reserved, true);
    step(p.entry(*b"PAGE") + 8, &p.section(*b"PDIR").to_le_bytes(), Code::SectionOverlap, true);
    step(p.entry(*b"PAGE") + 4, &[2], Code::Version, true);
    step(p.entry(*b"BRIK") + 36, &[1], Code::Reserved, true);
    step(p.entry(*b"BRIK") + 33, &[9], Code::Param, true);
    step(p.entry(*b"BRIK") + 34, &[9], Code::Reserved, true);
    step(76, &70u32.to_le_bytes(), Code::Limit, true);
    step(40, &1u64.to_le_bytes(), Code::Size, true);
    step(75, &[1], Code::Reserved, true);
    step(72, &[5], Code::Param, true);
    step(48, &[0xFF], Code::Feature, true);
    step(100, &[3], Code::HeaderCrc, false);
    step(16, &[1], Code::Size, false);
    step(12, &[9], Code::Version, false);
    step(3, &[0], Code::Magic, false);
}

#[test] // spec: VAL-4
fn a_reader_may_set_lower_limits() {
    let file = small();
    let vold = Places::of(&file).section(*b"VOLD");
    let open = |limits: Limits| open_parser(HeadParser::new(file.len() as u64, &limits), &file).map(|_| ());
    let voxels = 40 * 20 * 17;
    open(Limits { voxels, ..Limits::default() }).unwrap();
    let refused = |limits, offset| assert_eq!(told(&open(limits).unwrap_err()), (Code::Limit, Some(offset)));
    refused(Limits { voxels: voxels - 1, ..Limits::default() }, vold);
    refused(Limits { brick_bytes: 4095, ..Limits::default() }, vold + 22);
    refused(Limits { table_bytes: 319, ..Limits::default() }, vold);
    // All trees count.
    let many = changed(&file, vold + 12, &(1u32 << 20).to_le_bytes());
    let limits = Limits { voxels: voxels << 19, ..Limits::default() };
    let e = open_parser(HeadParser::new(many.len() as u64, &limits), &many).map(|_| ()).unwrap_err();
    assert_eq!(e.code(), Code::Limit);
}

#[test] // spec: VAL-2
fn the_codes_of_the_spec_are_those_of_the_code() {
    let spec = include_str!("../../../spec/09-validation.md");
    for code in Code::ALL {
        assert!(spec.contains(&format!("| `{code}` |")), "{code} is not in the table of chapter 9");
    }
    let rows = spec.lines().filter(|l| l.starts_with("| `E_")).count();
    assert_eq!(rows, Code::ALL.len());
}
