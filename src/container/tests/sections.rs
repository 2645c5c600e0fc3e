//! Chapter 3: the section table, METADATA and layout flags.

use super::support::*;
use crate::container::scene_section;
use crate::container::*;
use crate::error::Code;

#[test]
fn entries_read_what_they_write() {
    for entry in open(&small()).unwrap().sections {
        let bytes = entry.write_to();
        assert_eq!(bytes.len(), 64);
        assert_eq!(SectionEntry::read_from(&bytes, 0).unwrap(), entry);
    }
}

#[test] // spec: SEC-8; C-03
fn crcs() {
    let file = small();
    let p = Places::of(&file);
    for i in 0..p.head.sections.len() * 64 {
        let mut bad = file.clone();
        bad[256 + i] ^= 0x40;
        refused(&bad, Code::SectionCrc, 256);
    }
    for fourcc in [*b"VOLD", *b"PDIR", *b"FNAM"] {
        let at = p.section(fourcc);
        let mut bad = file.clone();
        bad[at as usize + 3] ^= 1;
        refused(&bad, Code::SectionCrc, at);
    }
    // Opening reads neither of these.
    for fourcc in [*b"META", *b"CBOK"] {
        let mut bad = file.clone();
        bad[p.section(fourcc) as usize] ^= 1;
        strictly_refused(&bad, Code::SectionCrc, p.section(fourcc));
    }
    for fourcc in [*b"PAGE", *b"BRIK"] {
        let at = p.entry(fourcc) + 36;
        refused(&changed(&file, at, &[1]), Code::Reserved, at);
    }
    // An all-EMPTY volume: PDIR, PAGE and BRIK are empty, and the CRC of nothing is 0.
    let d = descriptor([20, 20, 20], 2);
    let w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
    let empty = w.finish(&d, FinishOptions::default()).unwrap().0.into_inner();
    assert!(strict(&empty).is_empty(), "{:?}", strict(&empty));
    let head = open(&empty).unwrap();
    assert_eq!((head.section(*b"PDIR").unwrap().crc, head.section(*b"PDIR").unwrap().stored_len), (0, 0));
}

#[test] // spec: SEC-1, SEC-2; C-04
fn order_and_duplicates() {
    let file = small();
    let count = open(&file).unwrap().sections.len();
    for i in 1..count {
        let (a, b) = (256 + 64 * (i - 1), 256 + 64 * i);
        let mut swapped = file.clone();
        swapped.copy_within(b..b + 64, a);
        swapped[b..b + 64].copy_from_slice(&file[a..a + 64]);
        reseal(&mut swapped);
        refused(&swapped, Code::Order, b as u64);
        let mut twice = file.clone();
        twice.copy_within(a..a + 64, b);
        reseal(&mut twice);
        refused(&twice, Code::Dup, b as u64);
    }
}

#[test] // spec: SEC-5, SEC-6, GEN-2; C-04
fn ranges_and_overlaps() {
    let file = small();
    let p = Places::of(&file);
    let brik = p.entry(*b"BRIK");
    let lens = |len: u64| [len.to_le_bytes(), len.to_le_bytes()].concat();
    refused(
        &changed(&file, brik + 8, &(file.len() as u64).next_multiple_of(16).to_le_bytes()),
        Code::SectionRange,
        brik + 8,
    );
    refused(&changed(&file, brik + 8, &(u64::MAX - 15).to_le_bytes()), Code::SectionRange, brik + 8);
    refused(&changed(&file, brik + 16, &lens(u64::MAX)), Code::SectionRange, brik + 8);
    refused(&changed(&file, brik + 16, &lens(file.len() as u64)), Code::SectionRange, brik + 8);
    let page = p.entry(*b"PAGE");
    let vold = p.section(*b"VOLD");
    refused(&changed(&file, page + 8, &vold.to_le_bytes()), Code::SectionOverlap, page + 8);
    for inside in [0u64, 256] {
        refused(&changed(&file, page + 8, &inside.to_le_bytes()), Code::SectionOverlap, page + 8);
    }
}

#[test] // spec: SEC-4; C-04
fn alignment() {
    let file = small();
    let p = Places::of(&file);
    let page = p.entry(*b"PAGE");
    let offset = p.section(*b"PAGE");
    refused(&changed(&file, page + 8, &(offset + 8).to_le_bytes()), Code::Align, page + 8);
    for log2 in [0, 3, 21, 64, 255] {
        refused(&changed(&file, page + 32, &[log2]), Code::Param, page + 32);
    }
    let vold = p.entry(*b"VOLD");
    if p.section(*b"VOLD").is_multiple_of(32) {
        strictly_refused(&changed(&file, vold + 32, &[5]), Code::Canon, vold + 32);
    } else {
        refused(&changed(&file, vold + 32, &[5]), Code::Align, vold + 8);
    }
}

#[test] // spec: SEC-3, SEC-7, SEC-17, GEN-6; C-09
fn fields_of_an_entry() {
    let file = small();
    let p = Places::of(&file);
    let (vold, meta, pdir, page) = (p.entry(*b"VOLD"), p.entry(*b"META"), p.entry(*b"PDIR"), p.entry(*b"PAGE"));
    for at in [34, 35, 56, 63] {
        refused(&changed(&file, vold + at, &[1]), Code::Reserved, vold + at);
    }
    refused(&changed(&file, vold + 6, &[0x11]), Code::Reserved, vold + 6);
    refused(&changed(&file, vold + 6, &[0]), Code::Param, vold + 6);
    strictly_refused(&changed(&file, vold + 6, &[3]), Code::Canon, vold + 6);
    strictly_refused(&changed(&file, meta + 6, &[0]), Code::Canon, meta + 6);
    strictly_refused(&changed(&file, meta + 6, &[6]), Code::Canon, meta + 6);
    refused(&changed(&file, vold + 33, &[2]), Code::Param, vold + 33);
    refused(&changed(&file, vold + 33, &[1]), Code::Param, vold + 33);
    refused(&changed(&file, vold + 24, &[0]), Code::Size, vold + 24);
    refused(&changed(&file, vold + 52, &[1]), Code::Reserved, vold + 52);
    refused(&changed(&file, vold + 48, &[31]), Code::Size, vold + 48);
    refused(&changed(&file, pdir + 40, &[2]), Code::Size, pdir + 16);
    refused(&changed(&file, pdir + 40, &u64::MAX.to_le_bytes()), Code::Size, pdir + 16);
    strictly_refused(&changed(&file, page + 40, &[9]), Code::Canon, page);
}

#[test] // spec: SEC-9
fn mandatory_sections_and_versions() {
    let file = small();
    let count = open(&file).unwrap().sections.len();
    for (i, section) in open(&file).unwrap().sections.iter().enumerate() {
        let at = 256 + 64 * i as u64;
        if !matches!(&section.fourcc, b"META" | b"FNAM" | b"CBOK") {
            let mut without = file.clone();
            without.copy_within(at as usize + 64..256 + 64 * count, at as usize);
            set(&mut without, 76, &(count as u32 - 1).to_le_bytes());
            reseal(&mut without);
            let e = open(&without).unwrap_err();
            assert_eq!(told(&e), (Code::SectionUnknown, Some(256)), "{e}");
            assert!(e.message().contains(std::str::from_utf8(&section.fourcc).unwrap()), "{e}");
        }
        refused(&changed(&file, at + 4, &[2]), Code::Version, at + 4);
    }
}

fn extra(fourcc: FourCc, flags: u16) -> ExtraSection {
    let bytes = b"whatever this means".to_vec();
    let entry = SectionEntry {
        fourcc,
        version: 77,
        flags: SectionFlags(flags),
        offset: 0,
        stored_len: bytes.len() as u64,
        decoded_len: bytes.len() as u64,
        align_log2: 6,
        supercompression: 0,
        crc: crate::checksum::crc32(&bytes),
        item_count: 5,
        item_size: 3,
        owner: 1234,
    };
    ExtraSection { entry, bytes }
}

#[test] // spec: SEC-10, SEC-11, VER-5; C-07
fn unknown_sections() {
    for fourcc in [*b"zzZZ", *b"LFLD", *b"SOLT", *b"MIPT"] {
        let options = FinishOptions { extra: vec![extra(fourcc, 2), extra(*b"aaaa", 4)], ..FinishOptions::default() };
        let file = small_with(options);
        assert!(strict(&file).is_empty(), "{:?}", strict(&file));
        let (copy, _) =
            rewrite(file.len() as u64, &Default::default(), &mut reader(&file), std::io::Cursor::new(vec![])).unwrap();
        let copy = copy.into_inner();
        assert!(strict(&copy).is_empty(), "{:?}", strict(&copy));
        let kept = open(&copy).unwrap();
        let entry = kept.section(fourcc).expect("COPY_SAFE");
        let before = open(&file).unwrap().section(fourcc).unwrap().clone();
        assert_eq!(*entry, SectionEntry { offset: entry.offset, ..before });
        assert!(kept.section(*b"aaaa").is_none(), "not COPY_SAFE");
        let at = Places::of(&file).entry(fourcc);
        refused(&changed(&file, at + 6, &[1]), Code::SectionUnknown, at);
        let at = Places::of(&file).section(fourcc);
        let mut damaged = file.clone();
        damaged[at as usize] ^= 1;
        strictly_refused(&damaged, Code::SectionCrc, at);
    }
    let mut wrong_crc = extra(*b"abcd", 2);
    wrong_crc.entry.crc ^= 1;
    let mut wrong_alignment = extra(*b"abcd", 2);
    wrong_alignment.entry.align_log2 = 30;
    let w = || FileWriter::new(std::io::Cursor::new(Vec::new()), &descriptor([4, 4, 4], 1)).unwrap();
    for (sections, code) in [
        (vec![extra(*b"abcd", 1)], Code::Param),
        (vec![extra(*b"VOLD", 2)], Code::Param),
        (vec![extra(*b"CBOK", 2)], Code::Param),
        (vec![extra(*b"TIME", 2)], Code::Param),
        (vec![wrong_crc], Code::SectionCrc),
        (vec![wrong_alignment], Code::Param),
        (vec![extra(*b"abcd", 2), extra(*b"abcd", 2)], Code::Dup),
    ] {
        let options = FinishOptions { extra: sections, ..FinishOptions::default() };
        assert_eq!(w().finish(&descriptor([4, 4, 4], 1), options).map(|_| ()).unwrap_err().code(), code);
    }
}

#[test] // spec: SEC-19
fn scenes() {
    let with = |text: &[u8]| {
        let d = descriptor([4, 4, 4], 1);
        let w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
        let mut section = scene_section(String::new());
        section.bytes = text.to_vec();
        section.entry.crc = crate::checksum::crc32(text);
        (section.entry.stored_len, section.entry.decoded_len) = (text.len() as u64, text.len() as u64);
        w.finish(&d, FinishOptions { extra: vec![section], ..FinishOptions::default() }).map(|(f, _)| f.into_inner())
    };
    for text in ["", "sampler = \"linear\"  # größer", &"x".repeat(1 << 20)] {
        let file = with(text.as_bytes()).unwrap();
        assert!(strict(&file).is_empty(), "{:?}", strict(&file));
        // An editor keeps it.
        let (copy, _) =
            rewrite(file.len() as u64, &Default::default(), &mut reader(&file), std::io::Cursor::new(vec![])).unwrap();
        assert_eq!(copy.into_inner(), file);
    }
    assert_eq!(with(&vec![b'x'; (1 << 20) + 1]).unwrap_err().code(), Code::Limit);
    assert_eq!(with(b"a\xFFb").unwrap_err().code(), Code::Utf8);
    let file = with(b"step = 1.0").unwrap();
    let (entry, at) = (Places::of(&file).entry(*b"SCNE"), Places::of(&file).section(*b"SCNE"));
    strictly_refused(&changed(&file, at + 3, b"\xFF"), Code::Utf8, at);
    // A known section: version, flags and lengths are those of the table.
    refused(&changed(&file, entry + 4, &[2]), Code::Version, entry + 4);
    refused(&changed(&file, entry + 6, &[3]), Code::Param, entry + 6);
    refused(&changed(&file, entry + 33, &[1]), Code::Param, entry + 33);
    refused(&changed(&file, entry + 48, &[1]), Code::Size, entry + 48);
    strictly_refused(&changed(&file, entry + 6, &[0]), Code::Canon, entry + 6);
    let long = ((1u64 << 20) + 1).to_le_bytes();
    let bytes = changed(&changed(&file, entry + 16, &long), entry + 24, &long);
    let longer = [bytes, vec![0; 2 << 20]].concat();
    assert!(matches!(open(&longer).map(|_| ()).unwrap_err().code(), Code::Limit | Code::Size));
}

#[test] // spec: SEC-12
fn fourccs_are_printable() {
    let file = small_with(FinishOptions { extra: vec![extra(*b"zzzz", 2)], ..FinishOptions::default() });
    let at = Places::of(&file).entry(*b"zzzz");
    strictly_refused(&changed(&file, at + 3, &[0x7F]), Code::Param, at);
}

#[test] // spec: SEC-13, VAL-3; C-15
fn metadata() {
    let with = |text: &[u8]| {
        let d = descriptor([4, 4, 4], 1);
        let w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
        let options = FinishOptions { meta: Some(text.to_vec()), ..FinishOptions::default() };
        w.finish(&d, options).map(|(file, _)| file.into_inner())
    };
    let big = |n: usize| format!("{{\"a\":\"{}\"}}", "x".repeat(n - 8)).into_bytes();
    for (text, code) in [
        (&b""[..], Code::Utf8),
        (b"\xFF\xFE", Code::Utf8),
        (b"{\"a\":\"\xC3\x28\"}", Code::Utf8),
        (b"not json", Code::Utf8),
        (b"[1,2]", Code::Utf8),
        (b"{\"a\":1}{}", Code::Utf8),
        (b"{\"a\":1,\"a\":2}", Code::Dup),
        (b"{\"b\":[{\"c\":1,\"\\u0063\":2}]}", Code::Dup),
        (&big((1 << 20) + 1), Code::Limit),
    ] {
        assert_eq!(with(text).unwrap_err().code(), code, "{:?}", &text[..text.len().min(40)]);
    }
    let deep = [vec![b'['; 1 << 17], vec![b']'; 1 << 17]].concat();
    assert_eq!(check_meta(&deep, 5).map_err(|e| told(&e)), Err((Code::Utf8, Some(5))));
    for text in [&b"{}"[..], br#"{"a":{"a":[true,null,-1.5,"a"]},"b":2}"#, &big(1 << 20)] {
        let file = with(text).unwrap();
        assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    }
    // A reader checks the declared size before anything is inflated.
    let file = with(&big(100_000)).unwrap();
    let p = Places::of(&file);
    let meta = p.entry(*b"META");
    assert_eq!(p.head.section(*b"META").unwrap().supercompression, 1);
    refused(&changed(&file, meta + 24, &((1u64 << 20) + 1).to_le_bytes()), Code::Limit, meta + 24);
    strictly_refused(&changed(&file, meta + 24, &99_999u64.to_le_bytes()), Code::Zstd, p.section(*b"META"));
    // Text that is not smaller compressed is stored as it is.
    let plain = open(&with(b"{}").unwrap()).unwrap();
    assert_eq!(plain.section(*b"META").unwrap().supercompression, 0);
    // Text in the file that no writer of ours would write.
    let file = with(br#"{"a":1,"b":2}"#).unwrap();
    let at = Places::of(&file).section(*b"META");
    strictly_refused(&changed(&file, at + 8, b"a"), Code::Dup, at);
    strictly_refused(&changed(&file, at + 1, b"\xFF"), Code::Utf8, at);
}
