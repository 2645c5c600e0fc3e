//! Where everything lies (section 3.4), and files too large to be compact.

use super::support::*;
use crate::container::*;
use crate::error::Code;
use crate::limits::HEAD_BYTES;
use std::io::Cursor;

/// One level, bricks of `len` bytes each.
fn row(bricks: u32, len: usize, meta: usize) -> Vec<u8> {
    let mut d = descriptor([16 * bricks, 16, 16], 1);
    let mut w = FileWriter::new(Cursor::new(Vec::new()), &d).unwrap();
    let bytes = payload(5, len);
    for x in 0..bricks {
        put(&mut w, &mut d, (0, 0, [x, 0, 0]), u8::from(x % 3 == 0), NodeFlags::default(), &bytes);
    }
    // Metadata that does not compress well, to fill the head.
    let mut state = 1u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        char::from(b'a' + (state >> 60) as u8)
    };
    let text: String = (0..meta).map(|_| noise()).collect();
    let meta = (meta > 0).then(|| format!("{{\"text\":\"{text}\"}}").into_bytes());
    w.finish(&d, FinishOptions { meta, ..FinishOptions::default() }).unwrap().0.into_inner()
}

#[test] // spec: SEC-15, SEC-16
fn small_files_are_compact() {
    let file = small();
    let head = open(&file).unwrap();
    let at = |f: &[u8; 4]| head.section(*f).unwrap().offset;
    let [vold, fnam, pdir] = [at(b"VOLD"), at(b"FNAM"), at(b"PDIR")];
    let order = [vold, fnam, pdir, head.directory[0].offset, at(b"CBOK"), at(b"META"), at(b"PAGE"), at(b"BRIK")];
    assert!(order.is_sorted(), "{order:?}");
    assert_eq!(order[0], 256 + 64 * head.sections.len() as u64);
    assert_eq!(order[7], head.section(*b"PAGE").unwrap().end().next_multiple_of(16));
    assert!(file.len() < HEAD_BYTES as usize);
}

#[test] // spec: SEC-15, SEC-16, VAL-11; C-16, C-20
fn above_4_mib_the_head_is_reserved() {
    let len = 64 << 10;
    let compact = row(64, len, 0);
    let reserved = row(65, len, 0);
    assert!(open(&compact).unwrap().section(*b"BRIK").unwrap().offset < HEAD_BYTES);
    let head = open(&reserved).unwrap();
    assert_eq!(head.section(*b"BRIK").unwrap().offset, HEAD_BYTES);
    for file in [&compact, &reserved] {
        assert!(strict(file).is_empty(), "{:?}", strict(file));
        let copy = rewrite(file.len() as u64, &Default::default(), &mut reader(file), Cursor::new(vec![])).unwrap();
        assert_eq!(copy.0.into_inner().len(), file.len());
    }
    assert_eq!(reserved, row(65, len, 0));
    let copy =
        rewrite(reserved.len() as u64, &Default::default(), &mut reader(&reserved), Cursor::new(vec![])).unwrap();
    assert!(copy.0.into_inner() == reserved);
    assert_eq!((copy.1.stored, copy.1.stored_bytes, copy.1.len), (65, 65 * len as u64, reserved.len() as u64));
    // What the head does not use is padding.
    strictly_refused(&changed(&reserved, HEAD_BYTES - 1, &[1]), Code::Padding, HEAD_BYTES - 1);
}

#[test] // spec: SEC-15
fn what_does_not_fit_the_head_follows_the_bricks() {
    // 30 KiB of metadata: it goes behind, the pages stay.
    let file = row(4, 100, 60_000);
    let head = open(&file).unwrap();
    let (meta, page, brik) =
        (head.section(*b"META").unwrap(), head.section(*b"PAGE").unwrap(), head.section(*b"BRIK").unwrap());
    assert!(meta.stored_len > HEAD_BYTES, "{}", meta.stored_len);
    assert!(page.end() <= HEAD_BYTES && meta.offset == brik.end().next_multiple_of(16));
    assert_eq!(file.len() as u64, meta.end());
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    // Too many pages: they go behind, the chunk stays.
    let file = row(1000, 10, 0);
    let head = open(&file).unwrap();
    let (page, brik) = (head.section(*b"PAGE").unwrap(), head.section(*b"BRIK").unwrap());
    assert!(page.offset == brik.end().next_multiple_of(16) && head.directory[0].offset < HEAD_BYTES);
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
}

#[test] // spec: SEC-15, BRK-3, VAL-11
fn other_places_are_readable_but_not_canonical() {
    // META moved behind the bricks, where it need not be.
    let file = small();
    let p = Places::of(&file);
    let meta = p.head.section(*b"META").unwrap();
    let mut moved = file.clone();
    moved.resize(file.len().next_multiple_of(16), 0);
    let at = moved.len() as u64;
    moved.extend_from_slice(&file[meta.offset as usize..meta.end() as usize]);
    set(&mut moved, meta.offset, &vec![0; meta.stored_len as usize]);
    set(&mut moved, p.entry(*b"META") + 8, &at.to_le_bytes());
    let len = moved.len() as u64;
    set(&mut moved, 40, &len.to_le_bytes());
    reseal(&mut moved);
    assert_eq!(read_index(&moved).unwrap(), read_index(&file).unwrap());
    let errors = strict(&moved);
    assert!(errors.iter().all(|e| e.code() == Code::Canon) && !errors.is_empty(), "{errors:?}");
    // A rewrite puts everything into its place.
    let copy = rewrite(len, &Default::default(), &mut reader(&moved), Cursor::new(vec![])).unwrap().0.into_inner();
    assert_eq!(copy, file);
}
