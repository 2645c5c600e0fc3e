//! Where the bytes lie must not matter: unaligned slices, maps, files that are replaced or cut while they are open.

mod support;

use std::path::PathBuf;
use std::sync::Arc;
use support::{encode, explicit, hash, open};
use vug::limits::Limits;
use vug::source::{AtomicFile, ByteSource, FileSource, MemorySource, MmapSource};
use vug::volume::{At, CodecChoice, EncodeOptions, Volume};
use vug::voxel::Sample;
use vug::{Code, Extent, Grid};

/// A file of 16-bit or float payloads that are not compressed: what a careless reader would cast in place.
fn file<T: Sample>(codec: CodecChoice, f: impl Fn(u32) -> T) -> (Grid, Vec<u8>) {
    let mut grid = support::noise(Extent::new(70, 40, 33), &f);
    let options = EncodeOptions { codec, zstd: false, brick: Some(16), levels: 2, ..explicit(4, 4) };
    let bytes = encode(&mut grid, &options).0;
    (grid, bytes)
}

/// The bytes of a buffer from its `1`st on, so that nothing is aligned.
struct Shifted(Arc<Vec<u8>>, usize);

impl AsRef<[u8]> for Shifted {
    fn as_ref(&self) -> &[u8] {
        &self.0[self.1..]
    }
}

fn everything<T: Sample + PartialEq + std::fmt::Debug>(volume: &Volume, expected: &Volume) {
    for lod in 0..2 {
        let at = At::lod(lod);
        let whole = expected.read(at).unwrap();
        assert_eq!(volume.read(at).unwrap().bytes(), whole.bytes());
        let e = whole.extent();
        let coords: Vec<[u32; 3]> =
            (0..500).map(|i| [hash([i, 0, 0]) % e.x, hash([i, 1, 0]) % e.y, hash([i, 2, 0]) % e.z]).collect();
        // Twice: what is learnt the first time is a shortcut the second time.
        for _ in 0..2 {
            let mut values: Vec<T> =
                expected.sampler::<T>(at).and_then(|s| coords.iter().map(|&c| s.get(c)).collect()).unwrap();
            let sampler = volume.sampler::<T>(at).unwrap();
            for (&c, v) in coords.iter().zip(&values) {
                assert_eq!(sampler.get(c).unwrap(), *v);
                assert_eq!(volume.get::<T>(at, c).unwrap(), *v);
            }
            let all = values.clone();
            volume.voxels(at, &coords, &mut values).unwrap();
            assert_eq!(values, all);
        }
        let (region, block) = volume.block(at, [e.x - 1, e.y - 1, e.z - 1]).unwrap();
        assert_eq!(block.bytes(), expected.read_region(at, region).unwrap().bytes());
        assert_eq!(
            volume.blocks_overlapping(at, 10.0, 30_000.0).unwrap(),
            expected.blocks_overlapping(at, 10.0, 30_000.0).unwrap()
        );
    }
}

fn at_any_address<T: Sample + PartialEq + std::fmt::Debug>(bytes: &[u8]) {
    let expected = open(bytes.to_vec());
    for shift in 0..9 {
        let mut buffer = vec![0xEE; shift];
        buffer.extend_from_slice(bytes);
        let buffer = Arc::new(buffer);
        let source = MemorySource(Shifted(buffer.clone(), shift));
        everything::<T>(&Volume::open(source, Limits::default()).unwrap(), &expected);
        let errors = vug::volume::verify(&MemorySource(&buffer[shift..]), &Limits::default(), &mut |_, _| {}).errors;
        assert!(errors.is_empty(), "{shift}: {errors:?}");
    }
}

#[test] // C-17; spec: SAF-5
fn a_slice_may_start_anywhere() {
    for codec in [CodecChoice::S3dc, CodecChoice::Raw] {
        at_any_address::<u16>(&file(codec, |h| h as u16).1);
        at_any_address::<i16>(&file(codec, |h| h as i16).1);
        at_any_address::<f32>(&file(codec, |h| h as f32 * 1e-3).1);
        at_any_address::<u8>(&file(codec, |h| h as u8).1);
    }
}

fn on_disk(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vug");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

#[test] // D-35: out of core, by a map
#[allow(unsafe_code, reason = "maps a file of this test's own")]
fn a_map_gives_the_same_voxels() {
    for codec in [CodecChoice::S3dc, CodecChoice::Raw] {
        let (_, bytes) = file(codec, |h| h as u16);
        let (_folder, path) = on_disk(&bytes);
        // SAFETY: nobody else knows this file.
        let map = unsafe { MmapSource::open(&path) }.unwrap();
        assert_eq!(map.as_slice().unwrap(), bytes);
        let volume = Volume::open(map, Limits::default()).unwrap();
        everything::<u16>(&volume, &open(bytes));
    }
}

#[test] // C-12: the documented hazard is a file cut in place; Vug's own writer replaces the name and leaves the map whole
#[allow(unsafe_code, reason = "maps a file of this test's own")]
fn replacing_a_mapped_file_leaves_the_map_whole() {
    let (grid, bytes) = file(CodecChoice::Raw, |h| h as u16);
    let (_folder, path) = on_disk(&bytes);
    // SAFETY: the file is only ever replaced by renaming, which is what this test is about.
    let volume = Volume::open(unsafe { MmapSource::open(&path) }.unwrap(), Limits::default()).unwrap();
    let by_file = Volume::open_path(&path).unwrap();
    let mut other = support::ball(Extent::cube(20));
    let mut out = AtomicFile::create(&path, true).unwrap();
    vug::volume::encode(&mut other, &mut out, &EncodeOptions::default(), &mut |_, _| {}).unwrap();
    out.commit().unwrap();
    assert!(std::fs::metadata(&path).unwrap().len() < bytes.len() as u64);
    for volume in [volume, by_file] {
        assert_eq!(volume.read(At::default()).unwrap().bytes(), grid.bytes(), "the old volume, to its last voxel");
    }
    assert_eq!(Volume::open_path(&path).unwrap().info().dims, Extent::cube(20));
}

#[test] // C-12: the safe default answers with an error where a map would end the program
fn a_file_cut_while_it_is_open_is_an_error() {
    let (grid, bytes) = file(CodecChoice::Raw, |h| h as u16);
    let (_folder, path) = on_disk(&bytes);
    let volume = Volume::open(FileSource::open(&path).unwrap(), Limits::default()).unwrap();
    let first = volume.get::<u16>(At::default(), [0; 3]).unwrap();
    assert_eq!(first, grid.samples::<u16>()[0]);
    std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(bytes.len() as u64 / 2).unwrap();
    let error = volume.read(At::default()).unwrap_err();
    assert_eq!(error.code(), Code::Truncated, "{error}");
    assert!(error.offset().is_some() && error.message().contains("shorter"), "{error}");
    assert_eq!(volume.get::<u16>(At::default(), [0; 3]).unwrap(), first, "what was read before is still there");
    assert_eq!(Volume::open_path(&path).unwrap_err().code(), Code::Truncated);
}

#[test] // C-13: offsets beyond any address of a 32-bit machine are errors of the source, never wrapped
fn a_source_that_claims_more_than_fits_an_address() {
    /// Serves a small file, but says that it is 2^60 bytes long.
    struct Boaster(Vec<u8>);
    impl ByteSource for Boaster {
        fn len(&self) -> u64 {
            1 << 60
        }
        fn read_at(&self, offset: u64, out: &mut [u8]) -> vug::Result<()> {
            MemorySource(&self.0[..]).read_at(offset, out)
        }
    }
    let (_, bytes) = file(CodecChoice::S3dc, |h| h as u16);
    let error = Volume::open(Boaster(bytes.clone()), Limits::default()).unwrap_err();
    assert_eq!(error.code(), Code::Size, "{error}");
    // The same from an honest source whose superblock lies: 2^32 more than it is.
    for more in [1u64 << 32, 1 << 63] {
        let mut bad = bytes.clone();
        let at = bad.windows(8).position(|w| w == (bytes.len() as u64).to_le_bytes()).unwrap();
        bad[at..at + 8].copy_from_slice(&(bytes.len() as u64).wrapping_add(more).to_le_bytes());
        let error = Volume::open(MemorySource(bad), Limits::default()).unwrap_err();
        assert!(matches!(error.code(), Code::HeaderCrc | Code::Truncated), "{error}");
    }
}
