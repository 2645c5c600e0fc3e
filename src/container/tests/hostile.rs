//! Files made to hurt: huge counts, random bytes under right checksums (chapter 10).

use super::support::*;
use crate::container::*;
use crate::error::Code;
use crate::limits::Limits;

#[test] // spec: SAF-1, SAF-4, VAL-3, VAL-8; C-13, D-60, D-61
fn hostile_counts_allocate_nothing() {
    let file = small();
    let p = Places::of(&file);
    let huge = u64::MAX.to_le_bytes();
    // The parser never asks for bytes that the source does not have, whatever the file says.
    for at in (40..92).chain(p.entry(*b"BRIK")..p.entry(*b"VOLD") + 64).step_by(4) {
        for len in [4, 8] {
            let bad = changed(&file, at, &huge[..len]);
            for salvage in [false, true] {
                let n = bad.len() as u64;
                let limits = Limits::default();
                let mut parser = if salvage { HeadParser::salvage(n, &limits) } else { HeadParser::new(n, &limits) };
                while let Ok(Step::Need { offset, len }) = parser.next() {
                    assert!(offset + len as u64 <= n, "{len} bytes at {offset} of {n}");
                    parser.supply(offset, reader(&bad)(offset, len).unwrap());
                }
            }
        }
    }
    // A volume of 2^48 voxels and 2^24 trees opens from a few hundred bytes, and costs a few hundred bytes.
    let vold = p.section(*b"VOLD");
    let dims = [1u32 << 21, 1 << 21, 1 << 6].map(u32::to_le_bytes).concat();
    let mut monster = changed(&file, vold, &dims);
    set(&mut monster, vold + 12, &(1u32 << 24).to_le_bytes());
    set(&mut monster, 74, &[3]);
    reseal(&mut monster);
    assert_eq!(open(&monster).unwrap_err().code(), Code::Limit, "2^72 voxels in all");
    set(&mut monster, vold + 12, &1u32.to_le_bytes());
    reseal(&mut monster);
    let head = open(&monster).unwrap();
    assert!(head.octree.page_count() > 1 << 27 && head.directory.len() == 1);
    assert!(!strict(&monster).is_empty());
}

#[test] // spec: SAF-6, SAF-4, VAL-8
fn random_changes_under_right_checksums_never_panic() {
    let file = small();
    let interesting = [0u8, 1, 2, 7, 0x7F, 0x80, 0xFE, 0xFF];
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let tables = open(&file).unwrap().section(*b"BRIK").unwrap().offset as usize;
    let (mut opened, mut valid) = (0, 0);
    for _ in 0..4000 {
        let mut bad = file.clone();
        for _ in 0..=random.next(3) {
            let at = 24 + random.next(tables - 24);
            for i in 0..=random.next(8) {
                bad[(at + i).min(file.len() - 1)] = interesting[random.next(8)];
            }
        }
        reseal(&mut bad);
        opened += u32::from(open(&bad).is_ok());
        let _ = read_index(&bad);
        valid += u32::from(strict(&bad).is_empty());
        let _ = rewrite(bad.len() as u64, &Limits::default(), &mut reader(&bad), std::io::Cursor::new(vec![]));
    }
    assert!(opened > 100 && valid < opened, "{opened} opened, {valid} strictly valid");
}

#[test] // spec: SAF-5; C-17
fn bytes_may_start_at_any_address() {
    let file = small();
    for shift in 0..16 {
        let mut buffer = vec![0; shift];
        buffer.extend_from_slice(&file);
        assert_eq!(open(&buffer[shift..]).unwrap().superblock, open(&file).unwrap().superblock);
        let nodes = read_index(&buffer[shift..]).unwrap();
        assert_eq!(nodes, read_index(&file).unwrap());
    }
}

#[test] // spec: SAF-2, BRK-9; C-05
fn a_bomb_in_the_metadata_is_not_inflated() {
    let text = format!("{{\"a\":\"{}\"}}", "b".repeat(900_000));
    let file = small_with(FinishOptions { meta: Some(text.into_bytes()), ..FinishOptions::default() });
    let meta = Places::of(&file).head.section(*b"META").unwrap().clone();
    assert!(meta.supercompression == 1 && meta.stored_len < 1000);
    // The entry declares less than the frame holds.
    let at = Places::of(&file).entry(*b"META") + 24;
    strictly_refused(&changed(&file, at, &2000u64.to_le_bytes()), Code::Zstd, meta.offset);
}
