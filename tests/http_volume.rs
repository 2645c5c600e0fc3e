//! Volumes on web servers that fail, slow down and replace the file: the right voxels or an error, never wrong ones.
#![cfg(feature = "http")]

#[path = "support/server.rs"]
mod server;
mod support;

use server::{Mode, Server};
use std::sync::Arc;
use std::time::Duration;
use support::{encode, noise};
use vug::limits::Limits;
use vug::source::{HttpOptions, HttpSource};
use vug::volume::{At, Axis, CodecChoice, EncodeOptions, Volume};
use vug::{Code, Error, Extent, Grid, Region};

fn open(server: &Server) -> Result<Volume, Error> {
    let options = HttpOptions { backoff: Duration::from_millis(1), ..HttpOptions::default() };
    Volume::open(HttpSource::open(&server.url("a.vug"), options)?, Limits::default())
}

/// Two files of one length, with other voxels everywhere; pages and payloads lie behind the head.
fn two_files() -> [(Grid, Vec<u8>); 2] {
    [0, 1].map(|seed| {
        let mut grid = noise(Extent::new(330, 50, 34), |h| (h.rotate_left(seed * 9) >> 24) as u8);
        let options =
            EncodeOptions { codec: CodecChoice::Raw, zstd: false, brick: Some(16), ..EncodeOptions::default() };
        let bytes = encode(&mut grid, &options).0;
        (grid, bytes)
    })
}

/// Several accesses; the voxels must be those of `grid`.
fn look(volume: &Volume, grid: &Grid) -> Result<(), Error> {
    let at = At::default();
    let region = Region { start: [7, 3, 5], end: [300, 40, 30] };
    let part = |region: Region| {
        let mut part = Grid::zeros(region.extent(), grid.sample_type()).unwrap();
        let from = grid.view().sub(&region);
        let mut rows = part.bytes_mut().chunks_exact_mut(region.extent().x as usize);
        for z in 0..region.extent().z as usize {
            for y in 0..region.extent().y as usize {
                let start = y * from.row_pitch + z * from.slice_pitch;
                rows.next().unwrap().copy_from_slice(&from.bytes[start..start + region.extent().x as usize]);
            }
        }
        part
    };
    let c = [200, 20, 20];
    assert_eq!(volume.get::<u8>(at, c)?, grid.samples::<u8>()[grid.extent().index(c) as usize]);
    assert_eq!(volume.read_region(at, region)?.bytes(), part(region).bytes());
    let plane = Region { start: [0, 0, 33], end: [330, 50, 34] };
    assert_eq!(volume.plane(at, Axis::Z, 33)?.bytes(), part(plane).bytes());
    assert_eq!(volume.read(at)?.bytes(), grid.bytes());
    Ok(())
}

#[test] // C-12; spec: VAL-6, SAF-8
fn a_file_that_is_replaced_at_any_moment_is_an_error_and_never_wrong_voxels() {
    let [(grid, old), (_, new)] = two_files();
    assert_eq!(old.len(), new.len());
    let server = Server::of(old.clone());
    look(&open(&server).unwrap(), &grid).unwrap();
    let requests = server.cost().0;
    assert!(requests > 6, "{requests}");
    let same_tag = Mode::new(new.clone());
    let no_tag = Mode { etag: None, modified: None, ..Mode::new(new.clone()) };
    let another_tag = Mode { etag: Some("\"two\"".into()), ..Mode::new(new.clone()) };
    let shorter = Mode { etag: None, modified: None, ..Mode::new(new[..new.len() - 5000].to_vec()) };
    for (name, mode) in [("same tag", same_tag), ("no tag", no_tag), ("another tag", another_tag), ("shorter", shorter)]
    {
        for after in 1..requests {
            server.change(|m| *m = Mode { then: Some((after, Box::new(mode.clone()))), ..Mode::new(old.clone()) });
            let volume = open(&server).unwrap();
            let error = look(&volume, &grid).unwrap_err();
            assert_eq!(error.code(), Code::Replaced, "{name} after {after} of {requests} requests: {error}");
            // It stays so; what was read before is not confused with it.
            assert_eq!(look(&volume, &grid).unwrap_err().code(), Code::Replaced);
        }
    }
}

#[test]
fn bricks_that_are_fetched_again_are_checked_again() {
    let [(grid, old), (_, new)] = two_files();
    let server = Server::of(old.clone());
    let source = HttpSource::open(&server.url("a.vug"), HttpOptions::default()).unwrap();
    let volume = Volume::open(source, Limits { cache_bytes: 0, ..Limits::default() }).unwrap();
    look(&volume, &grid).unwrap();
    // The same length, tag and date: only the payloads tell, and all of them were right the first time.
    server.change(|mode| mode.content = Arc::new(new));
    assert_eq!(volume.read(At::default()).unwrap_err().code(), Code::Replaced);
    assert_eq!(volume.get::<u8>(At::default(), [200, 20, 20]).unwrap_err().code(), Code::Replaced);
}

#[test]
fn damage_on_the_server_is_no_replacement() {
    let [(grid, mut bytes), _] = two_files();
    let at = bytes.len() / 2;
    bytes[at] ^= 1;
    let server = Server::of(bytes.clone());
    let error = look(&open(&server).unwrap(), &grid).unwrap_err();
    assert_eq!(error.code(), Code::BrickCrc, "{error}");
    let fresh = server.take().iter().filter(|s| s.range == Some((0, 255))).count();
    assert_eq!(fresh, 1, "the superblock was read again from the server, not from what was kept");
    assert_eq!(support::open(bytes).read(At::default()).unwrap_err().offset(), error.offset());
}

#[test]
fn a_server_that_keeps_failing_delivers_in_the_end() {
    let [(grid, bytes), _] = two_files();
    let server = Server::of(bytes);
    let cuts = [0, 100, 70_000, 1, 65_536, 5000, 3, 80_000, 12];
    server.change(|mode| {
        mode.cut = cuts.into();
        mode.fail = [(503, None), (500, None), (429, None)].into();
        mode.drop = 2;
    });
    let patient = HttpOptions { retries: 15, backoff: Duration::from_millis(1), ..HttpOptions::default() };
    let source = HttpSource::open(&server.url("a.vug"), patient).unwrap();
    look(&Volume::open(source, Limits::default()).unwrap(), &grid).unwrap();
    let statuses: Vec<_> = server.take().iter().map(|s| s.status).collect();
    assert!([0, 429, 500, 503].iter().all(|s| statuses.contains(s)), "{statuses:?}");
    server.change(|mode| assert!(mode.cut.is_empty() && mode.fail.is_empty() && mode.drop == 0));
}

#[test]
fn a_failure_that_lasts_is_an_error_of_the_source_and_passes_with_it() {
    let [(grid, bytes), _] = two_files();
    let server = Server::of(bytes);
    let volume = open(&server).unwrap();
    server.change(|mode| mode.fail = vec![(503, None); 1000].into());
    assert_eq!(look(&volume, &grid).unwrap_err().code(), Code::Source);
    server.change(|mode| mode.fail.clear());
    look(&volume, &grid).unwrap();
}

#[test]
fn regions_of_many_groups_are_the_same_kept_or_not() {
    let e = Extent::new(320, 320, 330);
    let mut grid = Grid::from_fn(e, |c| support::hash(c.map(|v| v & !3)).to_le_bytes()[3]).unwrap();
    for zstd in [false, true] {
        let options = EncodeOptions { codec: CodecChoice::Raw, zstd, ..EncodeOptions::default() };
        let file = encode(&mut grid, &options).0;
        let stored = file.len();
        let server = Server::of(file);
        for cache_bytes in [0, 20 << 20, 256 << 20] {
            let source = HttpSource::open(&server.url("a.vug"), HttpOptions::default()).unwrap();
            let limits = Limits { cache_bytes, ..Limits::default() };
            let volume = Volume::open(source, limits).unwrap();
            server.take();
            assert!(volume.read(At::default()).unwrap().bytes() == grid.bytes());
            let bytes = server.cost().1 as usize;
            assert!(bytes < stored, "each byte at most once: {bytes} of {stored}");
            assert!(volume.read(At::default()).unwrap().bytes() == grid.bytes());
            let again = server.cost().0;
            assert_eq!(again == 0, cache_bytes == 256 << 20, "kept where it leaves room: {again} requests");
        }
    }
}

#[test]
fn a_server_without_ranges_serves_what_is_short() {
    let [(grid, bytes), _] = two_files();
    let server = Server::of(bytes.clone());
    server.change(|mode| mode.ranges = false);
    look(&open(&server).unwrap(), &grid).unwrap();
    assert_eq!(server.cost(), (1, bytes.len() as u64));
}

#[test]
fn threads_that_fail_together_do_not_wait_for_each_other() {
    let [(grid, mut bytes), _] = two_files();
    let len = bytes.len();
    (20_000..len).step_by(3000).for_each(|p| bytes[p] ^= 1);
    let server = Server::of(bytes.clone());
    let volume = open(&server).unwrap();
    let expected = support::open(bytes).read(At::default()).unwrap_err();
    std::thread::scope(|scope| {
        for _ in 0..6 {
            scope.spawn(|| {
                for _ in 0..3 {
                    let error = volume.read(At::default()).unwrap_err();
                    assert_eq!((error.code(), error.offset()), (expected.code(), expected.offset()));
                    assert!(look(&volume, &grid).is_err());
                }
            });
        }
    });
}

#[test]
#[cfg(feature = "cli")]
fn commands_take_addresses() {
    let [(_, bytes), _] = two_files();
    let server = Server::of(bytes.clone());
    let vug = |args: &[&str]| {
        let out = assert_cmd::Command::cargo_bin("vug").unwrap().args(args).output().unwrap();
        (
            out.status.success(),
            String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr),
        )
    };
    let url = server.url("a.vug");
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.npy");
    for args in [vec!["info", &url], vec!["verify", &url], vec!["decode", &url, out.to_str().unwrap()]] {
        let (good, said) = vug(&args);
        assert!(good, "{args:?}: {said}");
    }
    assert!(out.is_file());
    server.change(|mode| mode.content = Arc::new(b"something else".to_vec()));
    let (good, said) = vug(&["info", &url]);
    assert!(!good && said.contains("E_MAGIC"), "{said}");
    server.change(|mode| mode.fail = [(404, None)].into());
    let (good, said) = vug(&["info", &url]);
    assert!(!good && said.contains("404"), "{said}");
}
