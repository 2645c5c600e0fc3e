//! Chapter 2.

use super::support::*;
use crate::container::*;
use crate::error::Code;
use crate::limits::Limits;

#[test]
fn reads_what_it_writes() {
    let head = open(&small()).unwrap();
    let bytes = head.superblock.write_to();
    assert_eq!(bytes.len(), SUPERBLOCK_BYTES);
    assert_eq!(Superblock::read_from(&bytes).unwrap(), head.superblock);
    assert_eq!(bytes, small()[..256]);
}

#[test] // spec: HDR-1
fn magic_and_what_damages_it() {
    let file = small();
    for i in 0..12 {
        let mut bad = file.clone();
        bad[i] ^= 1;
        refused(&bad, Code::Magic, i as u64);
    }
    assert_eq!(&file[..12], b"\xABVUG 10\xBB\r\n\x1A\n");
    let seven_bit: Vec<u8> = file.iter().map(|b| b & 0x7F).collect();
    let unix = [&file[..8], b"\n\x1A\n", &file[12..]].concat();
    for damaged in [seven_bit, unix] {
        let e = open(&damaged).unwrap_err();
        assert!(e.code() == Code::Magic && e.message().contains("text mode"), "{e}");
    }
    assert!(!open(b"\x93NUMPY\x01\x00v\x00{'descr'").unwrap_err().message().contains("text mode"));
}

#[test] // spec: HDR-2, VER-1; C-08
fn any_minor_no_other_major() {
    let file = small();
    for (minor, major) in [(1u16, 1u16), (999, 1)] {
        let newer = changed(&file, 12, &[major.to_le_bytes(), minor.to_le_bytes()].concat());
        assert_eq!(open(&newer).unwrap().superblock.minor, minor);
        assert!(strict(&newer).is_empty());
    }
    refused(&changed(&file, 12, &2u16.to_le_bytes()), Code::Version, 12);
    refused(&changed(&file, 12, &0u16.to_le_bytes()), Code::Version, 12);
}

#[test] // spec: HDR-3, HDR-4
fn header_crc_and_length() {
    let file = small();
    for i in (14..16).chain(20..256) {
        let mut bad = file.clone();
        bad[i] ^= 0x10;
        refused(&bad, Code::HeaderCrc, 20);
    }
    refused(&changed(&file, 16, &255u32.to_le_bytes()), Code::Size, 16);
    refused(&changed(&file, 16, &512u32.to_le_bytes()), Code::Size, 16);
}

#[test] // spec: HDR-6, HDR-7, HDR-8, HDR-12, GEN-6; C-09
fn small_fields() {
    let file = small();
    // A log says nothing of this in its superblock.
    refused(&changed(&file, 72, &[1]), Code::Reserved, 40);
    refused(&changed(&file, 72, &[2]), Code::Param, 72);
    refused(&changed(&file, 73, &[2]), Code::Param, 73);
    refused(&changed(&file, 74, &[0]), Code::Param, 74);
    refused(&changed(&file, 74, &[4]), Code::Param, 74);
    for at in [75, 92, 200, 255] {
        refused(&changed(&file, at, &[1]), Code::Reserved, at);
    }
    // The bricks of the small file come finest first.
    assert!(!open(&file).unwrap().superblock.clustered);
    strictly_refused(&changed(&file, 73, &[1]), Code::Canon, 73);
}

#[test] // spec: HDR-9
fn file_length() {
    let file = small();
    let len = file.len() as u64;
    refused(&[&file[..], &[0]].concat(), Code::Size, 40);
    refused(&file[..file.len() - 1], Code::Truncated, len - 1);
    refused(&changed(&file, 40, &0u64.to_le_bytes()), Code::Size, 40);
    refused(&changed(&file, 40, &u64::MAX.to_le_bytes()), Code::Truncated, len);
    let cut = &file[..file.len() - 40];
    let salvaged = open_parser(HeadParser::salvage(cut.len() as u64, &Limits::default()), cut).unwrap().0;
    assert_eq!((salvaged.superblock.file_len, salvaged.source_len), (len, len - 40));
}

#[test] // spec: HDR-10, HDR-11
fn place_of_the_section_table() {
    let file = small();
    refused(&changed(&file, 76, &65u32.to_le_bytes()), Code::Limit, 76);
    refused(&changed(&file, 76, &u32::MAX.to_le_bytes()), Code::Limit, 76);
    for offset in [0, 255, file.len() as u64 - 16, u64::MAX - 15] {
        refused(&changed(&file, 80, &offset.to_le_bytes()), Code::SectionRange, 80);
    }
    refused(&changed(&file, 80, &264u64.to_le_bytes()), Code::Align, 80);
    // Moved to the end, a reader finds it; but it has one canonical place.
    let (table, count) = (256, open(&file).unwrap().sections.len());
    let mut moved = file.clone();
    moved.resize(file.len().next_multiple_of(16), 0);
    let at = moved.len() as u64;
    moved.extend_from_slice(&file[table..table + count * 64]);
    moved[table..table + count * 64].fill(0);
    set(&mut moved, 80, &at.to_le_bytes());
    let len = moved.len() as u64;
    set(&mut moved, 40, &len.to_le_bytes());
    reseal(&mut moved);
    open(&moved).unwrap();
    assert!(strict(&moved).iter().any(|e| e.code() == Code::Canon));
}

#[test] // spec: HDR-13, GEN-8; C-16
fn the_id_follows_from_the_content_or_is_given() {
    let file = small();
    let head = open(&file).unwrap();
    let part = |f| head.resident(head.section(f).unwrap().offset, head.section(f).unwrap().stored_len).unwrap();
    let hash = blake3::hash(&[part(*b"VOLD"), part(*b"PDIR"), part(*b"CBOK")].concat());
    assert_eq!(head.superblock.file_id, hash.as_bytes()[..16]);
    let tiny = open(&tiny()).unwrap();
    let part = |f| tiny.resident(tiny.section(f).unwrap().offset, tiny.section(f).unwrap().stored_len).unwrap();
    let hash = blake3::hash(&[part(*b"VOLD"), part(*b"PDIR")].concat());
    assert_eq!(tiny.superblock.file_id, hash.as_bytes()[..16]);
    assert_eq!(file, small(), "two writers, one input");
    let given = small_with(FinishOptions { file_id: Some([9; 16]), ..FinishOptions::default() });
    assert_eq!(open(&given).unwrap().superblock.file_id, [9; 16]);
    assert!(strict(&given).is_empty());
}

#[test] // spec: VAL-5, HDR-8
fn resource_levels() {
    let level = |dims, log2, sample_type| {
        VolumeDescriptor { brick_log2: log2, sample_type, ..descriptor(dims, 1) }.resource_level()
    };
    use crate::voxel::SampleType::{F32, U8};
    assert_eq!(level([2048, 10, 10], 6, F32), 1);
    assert_eq!(level([2049, 10, 10], 6, F32), 2);
    assert_eq!(level([200, 200, 200], 7, U8), 2);
    assert_eq!(level([200, 200, 200], 8, F32), 3);
    assert_eq!(level([20_000, 1, 1], 4, U8), 3);
    let file = small();
    strictly_refused(&changed(&file, 74, &[3]), Code::Canon, 74);
    let dims = Places::of(&file).section(*b"VOLD");
    // One axis longer than level 1 allows.
    refused(&changed(&file, dims, &4000u32.to_le_bytes()), Code::Limit, 74);
}
