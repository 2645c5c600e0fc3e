//! Feature bits and their names (chapters 3 and 11).

use super::support::*;
use crate::container::*;
use crate::error::Code;

fn named(mask: u8, bit: u8, name: &str) -> FeatureName {
    FeatureName { mask, bit, name: name.into() }
}

fn with_unknown_optional() -> Vec<u8> {
    small_with(FinishOptions {
        optional: 1 << 9,
        feature_names: vec![named(2, 9, "WAVELETS")],
        ..FinishOptions::default()
    })
}

#[test] // spec: SEC-14, VER-4, VER-6
fn names_of_the_bits_that_are_set() {
    let head = open(&small()).unwrap();
    assert_eq!((head.superblock.required, head.superblock.optional), (REQUIRED_ZSTD, OPTIONAL_NAN_REPLACED));
    assert_eq!(head.feature_names, [named(0, 0, "ZSTD"), named(2, 0, "NAN_REPLACED")]);
    let plain = open(&tiny()).unwrap();
    assert!(plain.section(*b"FNAM").is_none() && plain.feature_names.is_empty());
}

#[test] // spec: VER-2, VER-3; C-07
fn unknown_optional_bits_are_ignored_and_kept() {
    let file = with_unknown_optional();
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    let limits = Default::default();
    let copy = rewrite(file.len() as u64, &limits, &mut reader(&file), std::io::Cursor::new(vec![])).unwrap().0;
    assert_eq!(copy.into_inner(), file);
    // A bit that is optional to read: read on, but do not edit.
    let mut edited = changed(&file, 56, &4u64.to_le_bytes());
    let fnam = Places::of(&file).section(*b"FNAM");
    assert_eq!(&edited[fnam as usize..][..2], [0, 0]);
    assert!(open(&edited).is_ok());
    strictly_refused(&edited, Code::Canon, fnam);
    // Name it: ZSTD | bit 2 of mask 1 | NAN_REPLACED, WAVELETS. The entry for WAVELETS becomes it.
    edited = changed(&file, 56, &(1u64 << 9).to_le_bytes());
    set(&mut edited, 64, &1u64.to_le_bytes());
    let entries = &file[fnam as usize..][..8 + 16 + 12];
    let sorted = [&entries[..8], &[1], &entries[25..36], &entries[8..24]].concat();
    edited = changed(&edited, fnam, &sorted);
    assert!(strict(&edited).is_empty(), "{:?}", strict(&edited));
    let e = rewrite(edited.len() as u64, &limits, &mut reader(&edited), std::io::Cursor::new(vec![])).unwrap_err();
    assert_eq!(told(&e), (Code::Feature, Some(56)));
}

#[test] // spec: HDR-5, VER-2; C-07
fn unknown_required_bits_are_refused_by_name() {
    let file = with_unknown_optional();
    let anonymous = changed(&file, 48, &(1u64 << 63 | 1).to_le_bytes());
    refused(&anonymous, Code::Feature, 48);
    assert!(open(&anonymous).unwrap_err().message().contains("bit 63"));
    let fnam = Places::of(&file).section(*b"FNAM");
    let named = changed(&changed(&file, 48, &(1u64 << 9).to_le_bytes()), fnam + 24, &[0]);
    // Out of order now: the name is not trusted, the refusal stands.
    refused(&named, Code::Feature, 48);
    assert!(!open(&named).unwrap_err().message().contains("WAVELETS"));
    let entries = &file[fnam as usize..][..36];
    let sorted = [&entries[..8], &[0], &entries[25..36], &entries[8..24]].concat();
    let named = changed(&named, fnam, &sorted);
    refused(&named, Code::Feature, 48);
    let e = open(&named).unwrap_err();
    assert!(e.message().contains("WAVELETS") && e.message().contains("bit 9"), "{e}");
}

#[test] // spec: SEC-14; C-15
fn the_form_of_the_section() {
    let file = with_unknown_optional();
    let fnam = Places::of(&file).section(*b"FNAM");
    for (at, value, code, error_at) in [
        (0, &[3u8][..], Code::Param, 0),
        (1, &[64], Code::Param, 0),
        (2, &[0, 0], Code::Param, 0),
        (2, &[65, 0], Code::Param, 0),
        (34, &[0xFF], Code::Utf8, 24),
        (26, &[64, 0], Code::Truncated, 24),
        (26, &[5, 0], Code::Truncated, 33),
        (0, &[2], Code::Dup, 8),
        (0, &[2, 5], Code::Order, 8),
        (25, &[0], Code::Dup, 24),
    ] {
        refused(&changed(&file, fnam + at, value), code, fnam + error_at);
    }
    for name in [String::new(), "x".repeat(65)] {
        let d = descriptor([4, 4, 4], 1);
        let w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
        let options =
            FinishOptions { optional: 2, feature_names: vec![named(2, 1, &name)], ..FinishOptions::default() };
        assert_eq!(w.finish(&d, options).map(|_| ()).unwrap_err().code(), Code::Param);
    }
    strictly_refused(&changed(&file, fnam + 4, b"LZMA"), Code::Canon, fnam);
    strictly_refused(&changed(&file, fnam + 25, &[8]), Code::Canon, fnam);
}
