//! One property: every transport gives the same bytes and the same errors for every file, whole or damaged.
#![cfg(feature = "http")]

#[path = "support/server.rs"]
mod server;
mod support;

use server::{Mode, Server};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use support::{ball, explicit, hash, noise};
use vug::codec::{Codec, s3dc};
use vug::limits::Limits;
use vug::source::{ByteSource, FileSource, HttpOptions, HttpSource, MemorySource, MmapSource};
use vug::time::{TimeUnit, Times};
use vug::volume::{
    self, At, Axis, BrickOrder, CodecChoice, CopyOptions, EncodeOptions, Quality, Shape, Volume, VolumeWriter,
};
use vug::{Error, Extent, Grid, Region, SampleType};

fn short(e: &Error) -> String {
    format!("{} at {:?} ({})", e.code(), e.offset(), e.field())
}

fn said<T>(result: Result<T, Error>, show: impl FnOnce(T) -> String) -> String {
    result.map_or_else(|e| short(&e), show)
}

fn sum(grid: Grid) -> String {
    format!("{} {} {:08x}", grid.extent(), grid.sample_type(), vug::checksum::crc32(grid.bytes()))
}

type Opener<'a> = (&'a str, Box<dyn Fn() -> Box<dyn ByteSource> + 'a>);

/// All that can be learnt of a file, in words.
fn outcome(open: &dyn Fn() -> Box<dyn ByteSource>) -> String {
    let mut out = String::new();
    let mut line = |text: String| writeln!(out, "{text}").unwrap();
    match Volume::open(open(), Limits::default()) {
        Err(e) => line(format!("open: {}", short(&e))),
        Ok(v) => {
            line(format!("{:?} {:?}", v.info(), v.file_len()));
            line(said(v.meta(), |m| format!("{m:?}")));
            line(said(v.brick_counts(), |c| format!("{c:?}")));
            let d = v.info();
            line(format!("{:?} {:?}", v.head().commit, v.head().unfinished()));
            line(said(v.times(), |t| format!("{t:?}")));
            let trees = (0..d.time_steps).flat_map(|time| (0..d.channels).map(move |channel| (time, channel)));
            let levels = v.levels().len() as u8;
            for at in trees.flat_map(|(time, channel)| (0..levels).map(move |lod| At { time, channel, lod })) {
                let lod = at.lod;
                line(format!("{at:?}"));
                let e = v.levels().nth(usize::from(lod)).unwrap();
                let last = e.to_array().map(|n| n - 1);
                line(said(v.read(at), sum));
                for axis in [Axis::X, Axis::Y, Axis::Z] {
                    line(said(v.plane(at, axis, last[axis as usize] / 2), sum));
                }
                let region = Region { start: last.map(|n| n / 3), end: last.map(|n| n - n / 4 + 1) };
                line(said(v.read_region(at, region), sum));
                line(said(v.bounds(at, region), |b| format!("{b:?}")));
                line(said(v.blocks_overlapping(at, 100.0, 120.0), |b| format!("{b:?}")));
                line(said(v.block(at, last), |(r, g)| format!("{r:?} {}", sum(g))));
                line(said(v.read_reduced(at, 1, Region::at([0; 3], Extent::cube(1))), sum));
                for i in 0..6 {
                    let c = std::array::from_fn(|a| hash([i, a as u32, 7]) % (last[a] + 1));
                    line(said(v.voxel(at, c), |value| value.to_string()));
                }
            }
        }
    }
    match Volume::open_salvage(open(), Limits::default()) {
        Err(e) => line(format!("salvage: {}", short(&e))),
        Ok(v) => {
            let whole = Region::whole(v.info().dims);
            let last = At { time: v.info().time_steps - 1, channel: v.info().channels - 1, lod: 0 };
            line(said(v.salvage(last, whole), |s| {
                let lost: Vec<_> = s.lost.iter().map(|l| (l.brick, short(&l.error))).collect();
                format!("{} {} {lost:?}", sum(s.grid), s.found_by_leader)
            }));
        }
    }
    let report = volume::verify(&*open(), &Limits::default(), &mut |_, _| {});
    line(format!("{} {} {:?}", report.bricks, report.bytes, report.errors.iter().map(short).collect::<Vec<_>>()));
    out
}

#[allow(unsafe_code, reason = "maps files of this test's own")]
fn map(path: &Path) -> MmapSource {
    // SAFETY: written before, and by nobody while it is open.
    unsafe { MmapSource::open(path) }.unwrap()
}

struct Transports {
    folder: tempfile::TempDir,
    server: Server,
    files: u32,
}

impl Transports {
    fn new() -> Self {
        Transports { folder: tempfile::tempdir().unwrap(), server: Server::of(vec![]), files: 0 }
    }

    fn check(&mut self, name: &str, bytes: Vec<u8>) {
        // A new name for each: nobody truncates a file that is mapped.
        self.files += 1;
        let path = self.folder.path().join(format!("{}.vug", self.files));
        std::fs::write(&path, &bytes).unwrap();
        let tag = format!("\"{}\"", self.files);
        self.server.change(|mode| *mode = Mode { etag: Some(tag), ..Mode::new(bytes.clone()) });
        let url = self.server.url("a.vug");
        let quick = HttpOptions { backoff: Duration::from_millis(1), ..HttpOptions::default() };
        let bytes: Arc<[u8]> = bytes.into();
        let mut transports: Vec<Opener<'_>> = vec![
            ("file", Box::new(|| Box::new(FileSource::open(&path).unwrap()))),
            ("HTTP", Box::new(|| Box::new(HttpSource::open(&url, quick.clone()).unwrap()))),
        ];
        if !bytes.is_empty() {
            transports.push(("map", Box::new(|| Box::new(map(&path)))));
        }
        #[cfg(feature = "cloud")]
        transports.push(("cloud", Box::new(|| vug::source::open_url("s3://bucket/a.vug").unwrap())));
        let expected = outcome(&|| Box::new(MemorySource(bytes.clone())));
        for (transport, open) in &transports {
            let found = outcome(&**open);
            if found != expected {
                let differ = expected.lines().zip(found.lines()).find(|(a, b)| a != b);
                panic!("{name} over {transport}: memory and it say {differ:#?}");
            }
        }
        std::fs::remove_file(&path).unwrap();
    }
}

/// Small volumes of every codec and type, with and without levels and zstd.
fn files() -> Vec<(String, Vec<u8>)> {
    let e = Extent::new(75, 50, 41);
    let colours = Grid::from_fn(e, |c| {
        let v = support::ball_at(e, c);
        [v, v / 2, 255 - v]
    });
    let mut grids = [
        ("ball u8", ball(e)),
        ("u16", noise(e, |h| (h >> 20) as u16)),
        ("i16", noise(e, |h| (h >> 22) as i16 - 400)),
        ("f32", noise(e, |h| h as f32 * 1e-3)),
        ("rgb8", colours.unwrap()),
    ];
    let mut files = Vec::new();
    for (name, grid) in &mut grids {
        for codec in [CodecChoice::S3dc, CodecChoice::Raw, CodecChoice::Zerobit] {
            let quality = match codec {
                CodecChoice::S3dc => explicit(4, 4).quality,
                CodecChoice::Zerobit => Quality::Keep(60_000),
                _ => EncodeOptions::default().quality,
            };
            for (zstd, levels) in [(false, 1), (true, 1), (false, 2)] {
                let options =
                    EncodeOptions { codec, quality, zstd, levels, brick: Some(16), ..EncodeOptions::default() };
                let mut file = std::io::Cursor::new(Vec::new());
                // Not every codec takes every type.
                if volume::encode(grid, &mut file, &options, &mut |_, _| {}).is_ok() {
                    files.push((format!("{name}, {codec:?}, zstd {zstd}, {levels} levels"), file.into_inner()));
                }
            }
        }
    }
    assert!(files.len() >= 24, "{}", files.len());
    files
}

/// Series of two channels and levels, logs of several commits, and files in the order of their levels.
fn further_files() -> Vec<(String, Vec<u8>)> {
    let extent = Extent::new(40, 35, 20);
    let shape = Shape { extent, sample_type: SampleType::U16, time_steps: 3, channels: 2 };
    let codec = Codec::S3dc(s3dc::Params::new(4, Extent::cube(4), Default::default()).unwrap());
    let times = Some(Times::regular(TimeUnit::Second, 0.0, 0.5, 3));
    let options = EncodeOptions { levels: 2, times, ..EncodeOptions::default() };
    let mut writer = VolumeWriter::create(std::io::Cursor::new(Vec::new()), shape, codec, 4, &options).unwrap();
    for (time, channel, lod) in (0..12).map(|i| (i / 4, i / 2 % 2, (i % 2) as u8)) {
        let e = extent.at_lod(lod);
        let bricks = e.div_ceil(Extent::cube(16));
        for i in 0..bricks.voxels() as u32 {
            let brick = [i % bricks.x, i / bricks.x % bricks.y, i / bricks.x / bricks.y];
            let part = Region::at(brick.map(|v| v * 16), Extent::cube(16)).intersect(&Region::whole(e)).extent();
            let grid = match (i + time) % 4 {
                0 => continue,
                1 => Grid::from_fn(part, |_| (time * 10 + channel + 1) as u16).unwrap(),
                _ => noise(part, |h| (h >> 20) as u16 ^ (time * 100 + channel * 10) as u16),
            };
            writer.write_brick(At { time, channel, lod }, brick, grid.view()).unwrap();
        }
    }
    let series = writer.finish().unwrap().0.into_inner();
    let volume = support::open(series.clone());
    let clustered = CopyOptions { order: BrickOrder::Clustered, ..CopyOptions::default() };
    let excerpt = volume.excerpt(&clustered).unwrap();
    let clustered = excerpt.write_head(std::io::Cursor::new(Vec::new()), &mut |_, _| {}).unwrap().0.into_inner();
    let as_log = volume.excerpt(&CopyOptions::default()).unwrap().write_log(Vec::new(), &mut |_, _| {}).unwrap().0;
    let mut log = Vec::new();
    let small = EncodeOptions { brick: Some(16), levels: 2, ..explicit(4, 4) };
    volume::encode_log(&mut ball(Extent::new(75, 50, 41)), &mut log, &small, &mut |_, _| {}).unwrap();
    vec![
        ("series".into(), series),
        ("clustered series".into(), clustered),
        ("log of a series".into(), as_log),
        ("encoded log".into(), log),
    ]
}

#[test]
#[allow(unsafe_code, reason = "sets environment variables before there is a second thread that reads them")]
fn every_transport_gives_the_same_bytes_and_errors() {
    let mut transports = Transports::new();
    for (name, value) in [
        ("AWS_ENDPOINT", format!("http://{}", transports.server.address())),
        ("AWS_ALLOW_HTTP", "true".into()),
        ("AWS_REGION", "nowhere-1".into()),
        ("AWS_ACCESS_KEY_ID", "nobody".into()),
        ("AWS_SECRET_ACCESS_KEY", "nothing".into()),
    ] {
        // SAFETY: the only test of this program; the server's thread reads no environment.
        unsafe { std::env::set_var(name, value) };
    }
    transports.check("nothing", vec![]);
    for (f, (name, bytes)) in files().into_iter().chain(further_files()).enumerate() {
        transports.check(&name, bytes.clone());
        let mut damaged = Vec::new();
        for i in 0..6u32 {
            // Several bits at once: what is reported first must not depend on who reads.
            let mut flipped = bytes.clone();
            let places: Vec<usize> =
                (0..=i * 3).map(|k| hash([i, k, f as u32]) as usize % (bytes.len() << (i & 1)) % bytes.len()).collect();
            places.iter().for_each(|&p| flipped[p] ^= 1 << (p % 8));
            damaged.push((format!("{name}, flipped {places:?}"), flipped));
        }
        // The head stays whole: pages and payloads are what is damaged, each in many places.
        let mut flipped = bytes.clone();
        (2000..bytes.len()).step_by(4001).for_each(|p| flipped[p] ^= 0x10);
        damaged.push((format!("{name}, flipped everywhere"), flipped));
        for keep in [1, 255, 256, 3000, bytes.len() / 2, bytes.len() - 1] {
            damaged.push((format!("{name}, cut to {keep}"), bytes[..keep.min(bytes.len())].to_vec()));
        }
        if bytes[72] == 1 {
            // Logs whose writer was killed, at many moments.
            for keep in (1..20).map(|i| bytes.len() * i / 20) {
                damaged.push((format!("{name}, torn at {keep}"), bytes[..keep].to_vec()));
            }
        }
        let longer = [&bytes[..], &[0; 16]].concat();
        damaged.push((format!("{name}, 16 bytes longer"), longer));
        for (name, bytes) in damaged {
            transports.check(&name, bytes);
        }
    }
    println!("{} files", transports.files);
}
