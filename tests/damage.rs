//! Damaged files: every prefix and every flipped byte is detected, and what is whole can be saved.

mod support;

use support::{ball, encode, explicit, open, verify};
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{At, EncodeOptions, Quality, Volume};
use vug::{Code, Extent, Grid, Region};

/// A file of every kind of brick: stored, constant, empty; partial blocks and bricks; metadata; two levels.
fn small(zstd: bool) -> (Grid, Vec<u8>) {
    let extent = Extent::new(37, 18, 20);
    let mut grid = Grid::from_fn(extent, |[x, y, z]| {
        if x < 16 {
            (x * 7 + y * 3 + z) as u16
        } else if x < 32 {
            500
        } else {
            0
        }
    })
    .unwrap();
    let options = EncodeOptions {
        quality: Quality::Explicit { index_bits: 2, block: Extent::new(5, 3, 7) },
        brick: Some(16),
        levels: 2,
        zstd,
        meta: Some(r#"{"generator":"test"}"#.into()),
        ..EncodeOptions::default()
    };
    let bytes = encode(&mut grid, &options).0;
    (grid, bytes)
}

/// The first error that a reader of everything meets.
fn read_all(bytes: &[u8]) -> vug::Result<()> {
    let volume = Volume::open(MemorySource(bytes.to_vec()), Limits::default())?;
    volume.meta()?;
    for lod in 0..volume.info().lod_count {
        volume.read(At::lod(lod))?;
    }
    Ok(())
}

#[test]
fn the_small_file_is_valid_and_small() {
    for zstd in [true, false] {
        let (_, bytes) = small(zstd);
        assert!(verify(&bytes).is_empty(), "{:?}", verify(&bytes));
        assert!(bytes.len() < 12_000, "{}", bytes.len());
        let counts = open(bytes).brick_counts().unwrap();
        assert!(counts.stored > 0 && counts.constant > 0 && counts.empty > 0, "{counts:?}");
    }
}

#[test] // C-01; spec: VAL-2
fn every_proper_prefix_is_an_error() {
    for zstd in [true, false] {
        let (_, bytes) = small(zstd);
        for end in 0..bytes.len() {
            let error = Volume::open(MemorySource(bytes[..end].to_vec()), Limits::default()).unwrap_err();
            assert!(matches!(error.code(), Code::Truncated | Code::Magic), "{end}: {error}");
            assert!(error.offset().is_some_and(|o| o <= end as u64), "{end}: {error}");
            assert!(!verify(&bytes[..end]).is_empty());
        }
    }
}

#[test] // C-02
fn every_flipped_byte_is_found_by_verify() {
    for zstd in [true, false] {
        let (_, mut bytes) = small(zstd);
        for i in 0..bytes.len() {
            for mask in [0x01, 0x80, 0xFF] {
                bytes[i] ^= mask;
                let errors = verify(&bytes);
                assert!(!errors.is_empty(), "byte {i} ^ {mask:#04x} goes unnoticed");
                assert!(errors[0].offset().is_some(), "byte {i}: {}", errors[0]);
                bytes[i] ^= mask;
            }
        }
    }
}

#[test]
fn flipped_bytes_never_panic_a_reader_and_never_change_a_voxel_unnoticed() {
    let (_, mut bytes) = small(true);
    let whole = open(bytes.clone()).read(At::default()).unwrap();
    for i in 0..bytes.len() {
        bytes[i] ^= 0x55;
        if read_all(&bytes).is_ok() {
            // Padding, guards and leaders are not on the fast path: what was read is right all the same.
            let volume = Volume::open(MemorySource(bytes.clone()), Limits::default()).unwrap();
            assert_eq!(volume.read(At::default()).unwrap().bytes(), whole.bytes(), "byte {i}");
        }
        bytes[i] ^= 0x55;
    }
}

#[test]
fn one_byte_more_is_an_error() {
    let (_, mut bytes) = small(true);
    bytes.push(0);
    assert_eq!(Volume::open(MemorySource(bytes), Limits::default()).unwrap_err().code(), Code::Size);
}

#[test]
fn salvage_gives_what_is_whole() {
    let extent = Extent::new(70, 66, 65);
    let mut grid = ball(extent);
    let options = EncodeOptions { brick: Some(32), ..explicit(4, 4) };
    let (bytes, _) = encode(&mut grid, &options);
    let volume = open(bytes.clone());
    let whole = volume.read(At::default()).unwrap();
    let region = Region::whole(extent);

    // A hole in the middle of the payloads.
    let mut damaged = bytes.clone();
    let at = damaged.len() / 2;
    damaged[at..at + 100].fill(0xAA);
    let volume = Volume::open_salvage(MemorySource(damaged.clone()), Limits::default()).unwrap();
    assert_eq!(volume.read(At::default()).unwrap_err().code(), Code::BrickCrc);
    let saved = volume.salvage(At::default(), region).unwrap();
    assert!(!saved.lost.is_empty() && saved.lost.len() <= 2, "{}", saved.lost.len());
    assert!(saved.lost.iter().all(|l| l.error.code() == Code::BrickCrc));
    let lost =
        |c: [u32; 3]| saved.lost.iter().any(|l| (0..3).all(|a| (l.region.start[a]..l.region.end[a]).contains(&c[a])));
    for z in 0..extent.z {
        for y in 0..extent.y {
            for x in 0..extent.x {
                let expected = if lost([x, y, z]) { 0.0 } else { whole.value([x, y, z]).unwrap().component(0) };
                assert_eq!(saved.grid.value([x, y, z]).unwrap().component(0), expected);
            }
        }
    }

    // A cut-off tail: everything before it is there.
    let cut = &bytes[..bytes.len() * 3 / 4];
    assert_eq!(Volume::open(MemorySource(cut.to_vec()), Limits::default()).unwrap_err().code(), Code::Truncated);
    let volume = Volume::open_salvage(MemorySource(cut.to_vec()), Limits::default()).unwrap();
    let saved = volume.salvage(At::default(), region).unwrap();
    assert!(!saved.lost.is_empty() && saved.lost.len() < 27);
    assert!(saved.lost.iter().all(|l| l.error.code() == Code::Truncated));
}

#[test] // spec: BRK-5
fn salvage_finds_bricks_by_their_leaders_when_the_index_is_gone() {
    let extent = Extent::cube(64);
    let mut grid = support::noise(extent, |h| (h >> 24) as u8);
    let options = EncodeOptions { brick: Some(32), ..explicit(4, 4) };
    let (mut bytes, _) = encode(&mut grid, &options);
    let whole = open(bytes.clone()).read(At::default()).unwrap();
    let page = open(bytes.clone()).head().section(*b"PAGE").unwrap().offset as usize;
    bytes[page + 3] ^= 1;
    let volume = Volume::open_salvage(MemorySource(bytes), Limits::default()).unwrap();
    assert_eq!(volume.read(At::default()).unwrap_err().code(), Code::PageCrc);
    let saved = volume.salvage(At::default(), Region::whole(extent)).unwrap();
    assert_eq!((saved.lost.len(), saved.found_by_leader), (0, 8));
    assert_eq!(saved.grid.bytes(), whole.bytes());
}

#[test]
fn salvage_needs_neither_the_directory_nor_the_right_length() {
    let extent = Extent::cube(64);
    let mut grid = support::noise(extent, |h| (h >> 24) as u8);
    let (bytes, _) = encode(&mut grid, &EncodeOptions { brick: Some(32), ..explicit(4, 4) });
    let whole = open(bytes.clone()).read(At::default()).unwrap();
    let directory = open(bytes.clone()).head().section(*b"PDIR").unwrap().offset as usize;
    let mut flipped = bytes.clone();
    flipped[directory + 9] ^= 0x10;
    let longer = [&bytes[..], &[1, 2, 3]].concat();
    for (damaged, code, by_leader) in [(flipped, Code::SectionCrc, 8), (longer, Code::Size, 0)] {
        let error = Volume::open(MemorySource(damaged.clone()), Limits::default()).unwrap_err();
        assert_eq!(error.code(), code);
        let volume = Volume::open_salvage(MemorySource(damaged), Limits::default()).unwrap();
        let saved = volume.salvage(At::default(), Region::whole(extent)).unwrap();
        assert_eq!((saved.lost.len(), saved.found_by_leader), (0, by_leader));
        assert!(saved.grid.bytes() == whole.bytes());
    }
    // What a reader is willing to hold is a limit here, too.
    let limits = Limits { result_bytes: 1000, ..Limits::default() };
    let volume = Volume::open_salvage(MemorySource(bytes), limits).unwrap();
    assert_eq!(volume.salvage(At::default(), Region::whole(extent)).err().unwrap().code(), Code::Limit);
}

#[test] // spec: VAL-6
fn a_replaced_file_is_told_from_a_damaged_one() {
    use std::sync::{Arc, Mutex};
    struct Swapped(Arc<Mutex<Vec<u8>>>);
    impl vug::source::ByteSource for Swapped {
        fn len(&self) -> u64 {
            self.0.lock().unwrap().len() as u64
        }
        fn read_at(&self, offset: u64, out: &mut [u8]) -> vug::Result<()> {
            MemorySource(&self.0.lock().unwrap()[..]).read_at(offset, out)
        }
    }
    let extent = Extent::new(200, 200, 200);
    let options = EncodeOptions { zstd: false, ..explicit(4, 4) };
    let one = encode(&mut support::noise(extent, |h| (h >> 24) as u8), &options).0;
    let two = encode(&mut support::noise(extent, |h| (h >> 20) as u8), &options).0;
    let shared = Arc::new(Mutex::new(one.clone()));
    let volume = Volume::open(Swapped(shared.clone()), Limits::default()).unwrap();
    *shared.lock().unwrap() = two;
    assert_eq!(volume.voxel(At::default(), [1, 2, 3]).unwrap_err().code(), Code::Replaced);
    let mut damaged = one;
    let end = damaged.len() - 1000;
    damaged[20_000..end].fill(9);
    *shared.lock().unwrap() = damaged;
    assert_eq!(volume.voxel(At::default(), [1, 2, 3]).unwrap_err().code(), Code::BrickCrc);
}

#[test] // spec: VAL-6, HDR-13
fn a_log_that_another_one_replaces_is_told_from_damage() {
    use std::sync::{Arc, Mutex};
    struct Swapped(Arc<Mutex<Vec<u8>>>, u64);
    impl vug::source::ByteSource for Swapped {
        fn len(&self) -> u64 {
            self.1
        }
        fn read_at(&self, offset: u64, out: &mut [u8]) -> vug::Result<()> {
            MemorySource(&self.0.lock().unwrap()[..]).read_at(offset, out)
        }
    }
    // Begun alike: the same shape, codec and length; other voxels.
    let log = |shift: u32| {
        let options = EncodeOptions { codec: vug::volume::CodecChoice::Raw, zstd: false, ..EncodeOptions::default() };
        let mut grid = support::noise(Extent::new(100, 100, 100), |h| (h >> shift) as u8);
        let mut log = Vec::new();
        vug::volume::encode_log(&mut grid, &mut log, &options, &mut |_, _| {}).unwrap();
        log
    };
    let (one, two) = (log(24), log(20));
    assert!(one[..256] == two[..256] && one.len() == two.len() && one != two);
    let shared = Arc::new(Mutex::new(one.clone()));
    let open = || Volume::open(Swapped(shared.clone(), one.len() as u64), Limits::default()).unwrap();
    let read = |v: &Volume| v.voxel(At::default(), [1, 2, 3]).map(|_| ()).unwrap_err().code();
    let mut damaged = one.clone();
    damaged[20_000..900_000].fill(9);
    let volume = open();
    *shared.lock().unwrap() = damaged;
    assert_eq!(read(&volume), Code::BrickCrc);
    *shared.lock().unwrap() = two.clone();
    assert_eq!(read(&volume), Code::Replaced);
    *shared.lock().unwrap() = one.clone();
    let volume = open();
    // One that is shorter is another one, too: a log only grows.
    let mut shorter = two[..500_000].to_vec();
    shorter[300..].fill(9);
    *shared.lock().unwrap() = shorter;
    assert_eq!(read(&volume), Code::Replaced);
}
