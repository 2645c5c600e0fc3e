//! What does a random voxel cost, against the same voxel of a raw array in memory?
//!
//! Same coordinates, same run, rounds interleaved. `single`: one call per voxel. `batch`: one call for all, which asks
//! memory ahead. Ratio: time of the volume / time of the array; lower is better.

mod support;

use std::hint::black_box;
use std::io::Cursor;
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{self, At, EncodeOptions, Volume};
use vug::{Extent, Grid};

const VOXELS: usize = 1 << 20;

fn main() {
    println!("Random voxels of an s3dc volume (u8, i=4, b=4, --no-zstd, payloads checked) against a raw u8 array");
    println!("synthetic volume; {VOXELS} coordinates; medians of interleaved rounds");
    println!("{:>6} {:>10} {:>16} {:>16}", "edge", "raw ns", "single ns (×)", "batch ns (×)");
    for edge in [256, 512, 1024] {
        if support::wanted(&edge.to_string()) {
            row(edge);
        }
    }
}

fn row(edge: u32) {
    let mut grid = support::volume::<u8>(edge, |v| (v * 255.0) as u8);
    let mut file = Cursor::new(Vec::new());
    let options = EncodeOptions { zstd: false, ..EncodeOptions::default() };
    volume::encode(&mut grid, &mut file, &options, &mut |_, _| {}).expect("encodes");
    let volume = Volume::open(MemorySource(file.into_inner()), Limits::default()).expect("opens");
    let mut state = 0x2545_F491_4F6C_DD1Du64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u32 % edge
    };
    let coords: Vec<[u32; 3]> = (0..VOXELS).map(|_| [next(), next(), next()]).collect();
    check_all(&volume, edge);
    let mut out = vec![0u8; VOXELS];
    let raw = |grid: &Grid| {
        let (samples, e) = (grid.samples::<u8>(), grid.extent());
        coords.iter().map(|&c| u64::from(samples[e.index(c) as usize])).sum::<u64>()
    };
    let sampler = volume.sampler::<u8>(At::default()).expect("a u8 volume");
    let single = || coords.iter().map(|&c| u64::from(sampler.get(c).expect("inside"))).sum::<u64>();
    let mut contestants: Vec<support::Contestant<'_>> = vec![
        ("raw".into(), Box::new(|| _ = black_box(raw(&grid)))),
        ("single".into(), Box::new(|| _ = black_box(single()))),
        ("batch".into(), Box::new(|| volume.voxels(At::default(), &coords, black_box(&mut out)).expect("inside"))),
    ];
    let t = support::interleave(15, &mut contestants);
    let ns = |i: usize| t[i].median.as_secs_f64() * 1e9 / VOXELS as f64;
    let column = |i: usize| format!("{:.1} ({:.2}×)", ns(i), ns(i) / ns(0));
    println!("{edge:>6} {:>10.1} {:>16} {:>16}", ns(0), column(1), column(2));
}

/// Touches every brick once, so that pages are read and checksums done.
fn check_all(volume: &Volume, edge: u32) {
    for z in (0..edge).step_by(64) {
        for y in (0..edge).step_by(64) {
            for x in (0..edge).step_by(64) {
                volume.get::<u8>(At::default(), [x, y, z]).expect("inside");
            }
        }
    }
    assert_eq!(volume.info().dims, Extent::cube(edge));
}
