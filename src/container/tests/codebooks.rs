//! Section `CBOK`: kept, checked and found, but not understood (chapters 3 and 14).

use super::support::*;
use crate::container::strict::Strict;
use crate::container::*;
use crate::error::Code;
use crate::limits::Limits;
use std::io::Cursor;

#[test] // spec: ZBT-34, SEC-3
fn fields_of_the_entry() {
    let file = small();
    let p = Places::of(&file);
    let (entry, head) = (p.entry(*b"CBOK"), &p.head);
    let s = head.section(*b"CBOK").unwrap();
    assert_eq!((s.version, s.flags, s.item_count, s.item_size), (1, SectionFlags::CRITICAL, 2, 0));
    assert_eq!((s.align_log2, s.supercompression, s.stored_len), (4, 0, BOOKS.len() as u64));
    refused(&changed(&file, entry + 6, &[0]), Code::Param, entry + 6);
    refused(&changed(&file, entry + 6, &[2]), Code::Param, entry + 6);
    strictly_refused(&changed(&file, entry + 6, &[3]), Code::Canon, entry + 6);
    refused(&changed(&file, entry + 33, &[1]), Code::Param, entry + 33);
    refused(&changed(&file, entry + 48, &[4]), Code::Size, entry + 48);
    refused(&changed(&file, entry + 52, &[1]), Code::Reserved, entry + 52);
}

#[test] // spec: ZBT-34
fn a_section_of_no_codebooks_is_not_canonical() {
    let file = small();
    let entry = Places::of(&file).entry(*b"CBOK");
    strictly_refused(&changed(&file, entry + 40, &[0]), Code::Canon, entry + 40);
    let mut none = changed(&file, entry + 16, &[0; 16]);
    set(&mut none, entry + 40, &[0; 8]);
    set(&mut none, Places::of(&file).section(*b"CBOK"), &[0; 28]);
    reseal(&mut none);
    strictly_refused(&none, Code::Canon, entry + 40);
    // The writer does not write such a one.
    let d = descriptor([4, 4, 4], 1);
    for (codebooks, code) in [((BOOKS.to_vec(), 0), Code::Param), ((BOOKS.to_vec(), 4097), Code::Limit)] {
        let w = FileWriter::new(Cursor::new(Vec::new()), &d).unwrap();
        let options = FinishOptions { codebooks: Some(codebooks), ..FinishOptions::default() };
        assert_eq!(w.finish(&d, options).map(|_| ()).unwrap_err().code(), code);
    }
}

#[test] // spec: ZBT-34, VAL-11, HDR-13
fn codebooks_are_handed_out_and_kept() {
    let file = small();
    let strict = Strict::open(file.len() as u64, &Limits::default(), &mut reader(&file)).unwrap();
    let section = strict.codebooks().unwrap();
    assert_eq!((&section.bytes[..], section.entry.item_count), (BOOKS, 2));
    let copy = rewrite(file.len() as u64, &Limits::default(), &mut reader(&file), Cursor::new(vec![])).unwrap();
    assert!(copy.0.into_inner() == file);
    let plain = tiny();
    let strict = Strict::open(plain.len() as u64, &Limits::default(), &mut reader(&plain)).unwrap();
    assert!(strict.codebooks().is_none());
    // Other codebooks, another file: payloads do not cover them.
    let other = |books: &[u8]| {
        let options = FinishOptions { codebooks: Some((books.to_vec(), 2)), ..FinishOptions::default() };
        open(&small_with(options)).unwrap().superblock.file_id
    };
    assert_ne!(other(b"one"), other(b"two"));
    // Another number of them, of the same bytes, is for the codec to tell: to the container both are right.
    let entry = Places::of(&file).entry(*b"CBOK");
    assert!(self::strict(&changed(&file, entry + 40, &[7])).is_empty());
}

#[test] // spec: SEC-15
fn codebooks_too_long_for_the_head_follow_the_bricks() {
    let books = vec![7; 20_000];
    let file = small_with(FinishOptions {
        meta: Some(br#"{"a":1}"#.to_vec()),
        codebooks: Some((books, 9)),
        ..FinishOptions::default()
    });
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    let head = open(&file).unwrap();
    let [cbok, brik, meta] = [*b"CBOK", *b"BRIK", *b"META"].map(|f| head.section(f).unwrap().clone());
    assert!(cbok.offset >= brik.end() && meta.end() <= brik.offset);
    let copy = rewrite(file.len() as u64, &Limits::default(), &mut reader(&file), Cursor::new(vec![])).unwrap();
    assert!(copy.0.into_inner() == file);
}
