//! Files whose checksums are all right and whose content lies: no panic, no amplified memory, no wrong answer.

mod support;

use support::{encode, explicit, verify};
use vug::checksum::crc32;
use vug::limits::Limits;
use vug::source::{FileSource, MemorySource};
use vug::volume::{At, EncodeOptions, Volume};
use vug::{Code, Extent, Grid};

fn u64_at(b: &[u8], o: usize) -> usize {
    usize::try_from(u64::from_le_bytes(b[o..o + 8].try_into().unwrap())).unwrap()
}

fn u16_at(b: &[u8], o: usize) -> usize {
    usize::from(u16::from_le_bytes(b[o..o + 2].try_into().unwrap()))
}

/// Entry, offset and length of a section.
fn section(b: &[u8], name: &[u8; 4]) -> (usize, usize, usize) {
    let entry = (0..usize::from(b[76])).map(|i| 256 + 64 * i).find(|&e| &b[e..e + 4] == name).unwrap();
    (entry, u64_at(b, entry + 8), u64_at(b, entry + 16))
}

fn put_crc(b: &mut [u8], at: usize, of: std::ops::Range<usize>) {
    let crc = crc32(&b[of]);
    b[at..at + 4].copy_from_slice(&crc.to_le_bytes());
}

/// Makes the checksums of sections, section table and superblock right again.
fn seal(b: &mut [u8]) {
    for name in [b"PDIR", b"VOLD"] {
        let (entry, start, len) = section(b, name);
        put_crc(b, entry + 36, start..start + len);
    }
    put_crc(b, 88, 256..256 + 64 * usize::from(b[76]));
    b[20..24].fill(0);
    put_crc(b, 20, 0..256);
}

/// The same for the first chunk and its first page.
fn seal_index(b: &mut [u8]) {
    let (page, directory) = (section(b, b"PAGE").1, section(b, b"PDIR").1);
    let chunk = u64_at(b, directory + 8);
    put_crc(b, chunk + 8, page..page + 32 * u16_at(b, chunk + 12));
    put_crc(b, directory + 16, chunk..chunk + 16 * u16_at(b, directory + 20));
    seal(b);
}

fn small(extent: Extent, block: u32) -> Vec<u8> {
    let mut grid = Grid::from_fn(extent, |[x, y, z]| (x * 7 + y * 3 + z * 5) as u8).unwrap();
    encode(&mut grid, &EncodeOptions { brick: Some(16), zstd: false, ..explicit(4, block) }).0
}

#[test] // spec: VAL-2
fn wrong_codec_parameters_are_refused_with_their_place() {
    let mut b = small(Extent::cube(16), 4);
    let vold = section(&b, b"VOLD").1;
    b[vold + 256 + 4] = 3; // three bits per index
    seal(&mut b);
    let error = Volume::open(MemorySource(b.clone()), Limits::default()).unwrap_err();
    assert_eq!((error.code(), error.offset()), (Code::Param, Some(vold as u64 + 256)), "{error}");
    assert!(error.field().starts_with("VOLD.codec"), "{error}");
    assert_eq!(verify(&b)[0].code(), Code::Param, "what does not open is not valid");
}

#[test] // spec: SAF-6, BRK-6
fn two_bricks_at_one_offset_do_not_share_what_was_read() {
    let mut b = small(Extent::new(24, 16, 16), 1);
    let page = section(&b, b"PAGE").1;
    let first = u64_at(&b, page);
    let second_len = u32::from_le_bytes(b[page + 40..page + 44].try_into().unwrap()) as usize;
    b.copy_within(page..page + 8, page + 32);
    put_crc(&mut b, page + 44, first..first + second_len);
    seal_index(&mut b);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.vug"), &b).unwrap();
    let open = || Volume::open(FileSource::open(folder.path().join("a.vug")).unwrap(), Limits::default()).unwrap();
    for coords in [[[20, 1, 1], [1, 1, 1]], [[1, 1, 1], [20, 1, 1]]] {
        let volume = open();
        for c in coords {
            volume.voxel(At::default(), c).unwrap();
        }
        volume.blocks_overlapping(At::default(), 0.0, 255.0).unwrap();
    }
    assert!(verify(&b).iter().any(|e| e.code() == Code::SectionOverlap));
}

#[test] // spec: SAF-1, VAL-8
fn an_index_that_names_one_page_a_thousand_times_is_refused_before_it_is_loaded() {
    let mut b = small(Extent::cube(16), 4);
    let vold = section(&b, b"VOLD").1;
    for (i, n) in [1u32 << 21, 1 << 13, 1 << 13].into_iter().enumerate() {
        b[vold + 4 * i..vold + 4 * i + 4].copy_from_slice(&n.to_le_bytes());
    }
    b[74] = 3;
    let (entry, directory, _) = section(&b, b"PDIR");
    let page_entry = b[u64_at(&b, directory + 8)..][..16].to_vec();
    b.resize(b.len().next_multiple_of(16), 0);
    let chunk = b.len();
    (0..1024).for_each(|_| b.extend(&page_entry));
    let crc = crc32(&b[chunk..]);
    for (refs, opens) in [(1u64, true), (8, false)] {
        let mut b = b.clone();
        let directory = b.len() as u64;
        for i in 0..refs {
            b.extend([i.to_le_bytes(), (chunk as u64).to_le_bytes()].concat());
            b.extend([&crc.to_le_bytes()[..], &1024u16.to_le_bytes(), &[0, 0]].concat());
        }
        b[entry + 8..entry + 16].copy_from_slice(&directory.to_le_bytes());
        for o in [16, 24] {
            b[entry + o..entry + o + 8].copy_from_slice(&(refs * 24).to_le_bytes());
        }
        b[entry + 40..entry + 48].copy_from_slice(&refs.to_le_bytes());
        let len = b.len() as u64;
        b[40..48].copy_from_slice(&len.to_le_bytes());
        seal(&mut b);
        assert!(verify(&b).iter().any(|e| e.code() == Code::SectionOverlap), "{:?}", verify(&b));
        match Volume::open(MemorySource(b), Limits::default()) {
            Ok(volume) => {
                assert!(opens);
                assert_eq!(volume.brick_counts().unwrap_err().code(), Code::SectionOverlap);
            }
            Err(e) => assert!(!opens && e.code() == Code::SectionOverlap, "{e}"),
        }
    }
}

#[test] // spec: BRK-7
fn a_payload_of_the_wrong_length_is_refused() {
    let mut b = small(Extent::cube(16), 4);
    let page = section(&b, b"PAGE").1;
    let (offset, len) = (u64_at(&b, page), u32::from_le_bytes(b[page + 8..page + 12].try_into().unwrap()) - 16);
    b[page + 8..page + 12].copy_from_slice(&len.to_le_bytes());
    put_crc(&mut b, page + 12, offset..offset + len as usize);
    seal_index(&mut b);
    let volume = Volume::open(MemorySource(b.clone()), Limits::default()).unwrap();
    let error = volume.voxel(At::default(), [0; 3]).unwrap_err();
    assert_eq!((error.code(), error.offset()), (Code::Size, Some(offset as u64)));
    assert!(!verify(&b).is_empty());
}
