//! What each access costs over memory maps, files and the web: the same logical reads, within the budgets of spec chapter 9.
#![cfg(feature = "http")]

#[path = "support/server.rs"]
mod server;
mod support;

use server::{Content, OnDisk, Server};
use std::collections::BTreeMap;
use std::io::{self, Seek, SeekFrom, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use support::{encode, explicit};
use vug::codec::Codec;
use vug::container::{BrickSink, CodecEntry, FileWriter, FinishOptions, Node, NodeFlags, VolumeDescriptor};
use vug::limits::Limits;
use vug::source::{FileSource, HttpOptions, HttpSource, MmapSource};
use vug::volume::{
    At, Axis, CodecChoice, CopyOptions, Cost, EncodeOptions, Quality, Shape, Volume, VolumeWriter, ZerobitOptions,
};
use vug::{Extent, Region, SampleType};

fn over_http(server: &Server) -> Volume {
    let options = HttpOptions { backoff: Duration::from_millis(1), ..HttpOptions::default() };
    Volume::open(HttpSource::open(&server.url("a.vug"), options).unwrap(), Limits::default()).unwrap()
}

#[allow(unsafe_code, reason = "maps a file of this test's own")]
fn over_map(path: &Path) -> Volume {
    // SAFETY: nobody else touches the file.
    Volume::open(unsafe { MmapSource::open(path) }.unwrap(), Limits::default()).unwrap()
}

type Access<'a> = (&'a str, u64, Box<dyn Fn(&Volume)>);

#[test] // spec: VAL-7
fn every_transport_costs_the_same() {
    // 18×17×16 bricks of 16³, three levels: the pages of level 0 do not fit in the head.
    let mut grid = support::noise(Extent::new(288, 272, 256), |h| (h >> 24) as u8);
    let options = EncodeOptions { zstd: false, brick: Some(16), levels: 3, ..explicit(4, 4) };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vug");
    std::fs::write(&path, encode(&mut grid, &options).0).unwrap();
    let server = Server::of(OnDisk(path.clone()));
    let region = Region { start: [100, 90, 80], end: [200, 170, 130] };
    let at = At::default();
    // The most reads: open, index pages (3×3×2 of 8³ bricks), runs of payloads.
    let accesses: [Access<'_>; 9] = [
        ("open", 1, Box::new(|_| {})),
        ("first voxel", 3, Box::new(move |v| assert!(v.voxel(at, [150, 150, 150]).unwrap().component(0) >= 0.0))),
        ("first block", 3, Box::new(move |v| drop(v.block(at, [150, 150, 150]).unwrap()))),
        ("first brick", 3, Box::new(move |v| drop(v.read_brick(at, [9, 9, 9]).unwrap()))),
        ("bounds of a region", 1 + 8, Box::new(move |v| assert!(v.bounds(at, region).unwrap().max > 200.0))),
        // Bricks lie in the order of z, y, x: one run for each row of bricks at most.
        ("plane across z", 1 + 9 + 17, Box::new(move |v| drop(v.plane(at, Axis::Z, 100).unwrap()))),
        ("plane across x", 1 + 6 + 17 * 16, Box::new(move |v| drop(v.plane(at, Axis::X, 100).unwrap()))),
        ("region 100×80×50", 1 + 8 + 6 * 4, Box::new(move |v| drop(v.read_region(at, region).unwrap()))),
        // Levels are written as they become complete: one run for each layer of bricks, but for files that are clustered.
        ("level 2, whole", 2 + 4, Box::new(|v| drop(v.read(At::lod(2)).unwrap()))),
    ];
    println!("{:20} {:>22} {:>22} {:>22} {:>22}", "reads / bytes", "map", "file", "HTTP", "of these requests");
    for (name, most, access) in accesses {
        let costs = [over_map(&path), Volume::open_path(&path).unwrap(), over_http(&server)].map(|volume| {
            access(&volume);
            volume.cost()
        });
        let (requests, bytes) = server.cost();
        let shown = costs.map(|c| format!("{} / {}", c.reads, c.bytes));
        println!(
            "{name:20} {:>22} {:>22} {:>22} {:>22}",
            shown[0],
            shown[1],
            shown[2],
            format!("{requests} / {bytes}")
        );
        assert_eq!((costs[0], costs[1]), (costs[1], costs[2]), "{name}");
        assert!(costs[0].reads <= most, "{name}: {} reads, {most} at most", costs[0].reads);
        assert_eq!(Cost { reads: requests, bytes }, costs[2], "{name}: a read is a request");
    }
}

/// What an access costs on each transport: the same.
fn cold(path: &Path, server: &Server, access: &dyn Fn(&Volume)) -> Cost {
    let costs = [over_map(path), Volume::open_path(path).unwrap(), over_http(server)].map(|volume| {
        access(&volume);
        volume.cost()
    });
    assert_eq!((costs[0], costs[1]), (costs[1], costs[2]));
    costs[0]
}

#[test] // spec: VAL-7
fn rows_of_the_table_that_depend_on_where_things_lie() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vug");
    let reads = |bytes: &[u8], access: &dyn Fn(&Volume)| {
        std::fs::write(&path, bytes).unwrap();
        cold(&path, &Server::of(OnDisk(path.clone())), access).reads
    };
    // The page in the head; the payload of the last brick is not.
    let mut grid = support::noise(Extent::new(64, 64, 64), |h| (h >> 24) as u8);
    let options = EncodeOptions { zstd: false, brick: Some(16), codec: CodecChoice::Raw, ..EncodeOptions::default() };
    let small = encode(&mut grid, &options).0;
    let last = |v: &Volume| assert!(v.voxel(At::default(), [63; 3]).unwrap().component(0) >= 0.0);
    assert_eq!((reads(&small, &|_| {}), reads(&small, &last)), (1, 2), "2 where the page lies in the head");
    // A log of it: the head, and the end with the last commit.
    let volume = support::open(small);
    let log = volume.excerpt(&CopyOptions::default()).unwrap().write_log(Vec::new(), &mut |_, _| {}).unwrap().0;
    assert_eq!(reads(&log, &|_| {}), 2, "opening a log");
    // 2,200 pages of one CONSTANT or stored brick: their chunks do not lie in the head, nor do the pages.
    let dims = Extent::new(128 * 2200, 16, 16);
    let shape = Shape::single(dims, SampleType::U8);
    let mut writer = VolumeWriter::create(io::Cursor::new(Vec::new()), shape, Codec::Raw, 4, &options).unwrap();
    let brick = support::noise(Extent::cube(16), |h| (h >> 24) as u8);
    for page in 0..2200 {
        writer.write_brick(At::default(), [page * 8, 0, 0], brick.view()).unwrap();
    }
    let long = writer.finish().unwrap().0.into_inner();
    let far = |v: &Volume| assert!(v.voxel(At::default(), [128 * 2100 + 3, 4, 5]).unwrap().component(0) >= 0.0);
    assert_eq!(reads(&long, &far), 3 + 1, "the directory is not resident: one more");
    // 216 codebooks do not lie in the head.
    let quality = Quality::Keep(60_000);
    let zerobit = ZerobitOptions { codebook_region: Some(1), ..ZerobitOptions::default() };
    let options = EncodeOptions { codec: CodecChoice::Zerobit, quality, zerobit, brick: Some(16), ..options };
    let mut grid = support::noise(Extent::cube(96), |h| (h >> 24) as u8);
    let books = encode(&mut grid, &options).0;
    let section = support::open(books.clone()).head().section(*b"CBOK").unwrap().clone();
    assert!(section.offset + section.stored_len > 16_384, "{} bytes at {}", section.stored_len, section.offset);
    let twice = |v: &Volume| {
        last(v);
        let first = v.cost().reads;
        v.voxel(At::default(), [40, 50, 60]).unwrap();
        assert_eq!(v.cost().reads, first + 1, "the codebooks stay");
    };
    let plain = reads(&books, &|v| {
        v.bounds(At::default(), Region::at([95; 3], Extent::cube(1))).unwrap();
    });
    assert_eq!(reads(&books, &last), plain + 1 + 1, "payload, and the first use of a codebook: one more");
    assert_eq!(reads(&books, &twice), plain + 1 + 1 + 1);
}

/// A file in memory without the parts that are zero.
#[derive(Default)]
struct Sparse {
    pages: BTreeMap<u64, Box<[u8; 4096]>>,
    at: u64,
    len: u64,
}

impl Write for Sparse {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        let within = (self.at % 4096) as usize;
        let n = buf.len().min(4096 - within);
        if buf[..n].iter().any(|&b| b != 0) {
            let page = self.pages.entry(self.at / 4096).or_insert_with(|| Box::new([0; 4096]));
            page[within..within + n].copy_from_slice(&buf[..n]);
        }
        self.at += n as u64;
        self.len = self.len.max(self.at);
        Ok(n)
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Sparse {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let SeekFrom::Start(at) = to else { return Err(io::ErrorKind::Unsupported.into()) };
        self.at = at;
        Ok(at)
    }
}

impl Content for Sparse {
    fn len(&self) -> u64 {
        self.len
    }
    fn send(&self, offset: u64, len: u64, out: &mut TcpStream) -> io::Result<()> {
        let (mut at, end) = (offset, offset + len);
        while at < end {
            let within = (at % 4096) as usize;
            let n = (4096 - within).min((end - at) as usize);
            match self.pages.get(&(at / 4096)) {
                Some(page) => out.write_all(&page[within..within + n])?,
                None => out.write_all(&[0; 4096][..n])?,
            }
            at += n as u64;
        }
        Ok(())
    }
}

/// 1024³ voxels of 8 bits, lossless, with all levels down to one brick of 64³; only that one is not zero.
fn one_gib() -> Sparse {
    let (id, stream_version, params) = Codec::Raw.to_wire();
    let descriptor = VolumeDescriptor {
        dims: Extent::cube(1024),
        time_steps: 1,
        channels: 1,
        sample_type: SampleType::U8,
        lod_count: 5,
        brick_log2: 6,
        downsample: Default::default(),
        codecs: vec![CodecEntry { id, stream_version, params }],
        placement: Default::default(),
        null_value: [0; 4],
        value_map: Default::default(),
        source_range: (0.0, 255.0),
        achieved: None,
        payload_bytes: (16u64.pow(3) + 512 + 64 + 8 + 1) << 18,
        replaced: 0,
    };
    let mut writer = FileWriter::new(Sparse::default(), &descriptor).unwrap();
    let node = Node::new_stored(0, NodeFlags::LOSSLESS, (0.0, 255.0), Some(0.0));
    let (nothing, overview) = (vec![0u8; 1 << 18], (0..1 << 18).map(|i| (i % 251) as u8).collect::<Vec<_>>());
    for level in 0..5 {
        let edge = 16u32 >> level;
        for i in 0..edge.pow(3) {
            let payload = if level == 4 { &overview } else { &nothing };
            writer.put_stored(0, level, [i % edge, i / edge % edge, i / edge / edge], &node, payload).unwrap();
        }
    }
    writer.finish(&descriptor, FinishOptions::default()).unwrap().0
}

#[test]
fn the_first_overview_of_a_gibibyte_takes_three_requests() {
    let file = one_gib();
    assert!(Content::len(&file) > 1 << 30);
    let server = Server::of(file);
    let volume = over_http(&server);
    let level = (0u8..).zip(volume.levels()).find(|(_, e)| e.to_array().iter().all(|&v| v <= 64)).unwrap();
    let overview = volume.read(At::lod(level.0)).unwrap();
    assert!(overview.bytes().iter().enumerate().all(|(i, &v)| v == (i % 251) as u8));
    let (requests, bytes) = server.cost();
    println!("overview of {} of {} bytes: {requests} requests, {bytes} bytes", level.1, volume.file_len());
    assert!(requests <= 3 && bytes <= 1_000_000, "{requests} requests, {bytes} bytes");
    // One connection did it all: no time is lost on making others.
    assert_eq!(server.connections(), 1);
}

#[test]
fn pages_of_a_large_region_are_read_together() {
    let server = Server::start(server::Mode { content: Arc::new(one_gib()), ..server::Mode::new(vec![]) });
    let volume = over_http(&server);
    server.take();
    // 16×16 bricks in 2×2 pages, 4 of which are one run of bytes; 256 bricks, all neighbours: 64 MiB in ranges of
    // at most 2 MiB.
    volume.plane(At::default(), Axis::Z, 5).unwrap();
    let seen = server.take();
    let (pages, bricks): (Vec<_>, Vec<_>) = seen.iter().partition(|s| s.bytes < 1 << 18);
    assert_eq!((pages.len(), volume.cost().reads), (1, 1 + 1 + bricks.len() as u64));
    assert!((32..=40).contains(&bricks.len()), "{}", bricks.len());
    let (requests, _) = {
        volume.bounds(At::default(), Region::whole(Extent::cube(1024))).unwrap();
        server.cost()
    };
    assert_eq!(requests, 1, "the other four pages");
}

#[test] // issue 4: threads share the cache
fn what_several_threads_want_is_fetched_once() {
    let mut grid = support::noise(Extent::cube(160), |h| (h >> 24) as u8);
    for zstd in [false, true] {
        let options = EncodeOptions { zstd, brick: Some(16), codec: CodecChoice::Raw, ..EncodeOptions::default() };
        let file = encode(&mut grid, &options).0;
        let whole = support::open(file.clone());
        let bricks = whole.head().section(*b"BRIK").unwrap();
        let bricks = bricks.offset..bricks.offset + bricks.stored_len;
        let server = Server::of(file);
        server.change(|mode| mode.delay = Duration::from_millis(2));
        let volume = over_http(&server);
        std::thread::scope(|scope| {
            for thread in 0..6u32 {
                let (volume, whole, grid) = (&volume, &whole, &grid);
                scope.spawn(move || {
                    let region = Region { start: [thread * 5, 0, 8 * thread], end: [100 + thread * 9, 120, 160] };
                    let expected = whole.read_region(At::default(), region).unwrap();
                    for i in 0..20 {
                        let c = [i * 8, (i * 40 + thread) % 160, i * 3];
                        let value = volume.get::<u8>(At::default(), c).unwrap();
                        assert_eq!(value, grid.samples::<u8>()[Extent::cube(160).index(c) as usize]);
                    }
                    let found = volume.read_region(At::default(), region).unwrap();
                    assert!(found.bytes() == expected.bytes());
                });
            }
        });
        let mut ranges: Vec<_> = server.take().iter().filter_map(|s| s.range).collect();
        ranges.retain(|r| bricks.contains(&r.0) && r.0 >= 16_384);
        ranges.sort_unstable();
        assert!(ranges.len() > 10);
        for pair in ranges.windows(2) {
            assert!(pair[0].1 < pair[1].0, "{pair:?}: some bytes came twice");
        }
    }
}

#[test]
fn reading_ahead_ends_with_the_reader() {
    // 1 GiB is wanted, and the first group of bricks is damaged: little more than that group is asked for.
    let mut file = one_gib();
    let brick = file.pages.range(4..).next().map(|(&page, _)| page).unwrap();
    file.pages.get_mut(&brick).unwrap()[4095] ^= 1;
    let server = Server::of(file);
    let volume = over_http(&server);
    let error = volume.read(At::default()).unwrap_err();
    assert_eq!(error.code(), vug::Code::BrickCrc, "{error}");
    let (_, bytes) = server.cost();
    assert!(bytes < 3 * (24 << 20), "{bytes} bytes");
}

#[test]
fn a_file_that_is_cut_is_no_other_matter_over_http() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vug");
    let mut grid = support::noise(Extent::cube(100), |h| (h >> 24) as u8);
    std::fs::write(&path, encode(&mut grid, &EncodeOptions { zstd: false, ..explicit(8, 4) }).0).unwrap();
    let server = Server::of(OnDisk(path.clone()));
    let volumes = [over_http(&server), Volume::open(FileSource::open(&path).unwrap(), Limits::default()).unwrap()];
    std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(200_000).unwrap();
    let codes = volumes.map(|volume| volume.read(At::default()).unwrap_err().code());
    assert_eq!(codes, [vug::Code::Replaced, vug::Code::Truncated]);
}
