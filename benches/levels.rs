//! Encoding with all levels of detail against encoding without, and two threads against one: 384³ voxels, bricks of 64³.
//!
//! `cargo bench --bench levels [-- WORD...]`: only rows whose name holds one of the words. `VUG_BENCH_EDGE` sets the edge.

mod support;

use std::io::Cursor;
use support::{Contestant, interleave, volume, wanted};
use vug::geometry::Extent;
use vug::grid::Grid;
use vug::volume::{CodecChoice, EncodeOptions, Quality, encode};

fn run(grid: &mut Grid, options: &EncodeOptions, file: &mut Vec<u8>) {
    file.clear();
    let mut out = Cursor::new(std::mem::take(file));
    encode(grid, &mut out, options, &mut |_, _| {}).expect("synthetic samples are finite");
    *file = out.into_inner();
}

fn row(name: &str, grid: &mut Grid, options: &EncodeOptions) {
    if !wanted(name) {
        return;
    }
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
    let (one, two) = (pool(1), pool(2));
    let (flat, full) = (EncodeOptions { levels: 1, ..options.clone() }, EncodeOptions { levels: 0, ..options.clone() });
    let voxels = grid.extent().voxels() as f64;
    let (grid, file) = (std::cell::RefCell::new(grid), std::cell::RefCell::new(Vec::new()));
    let on = |pool: &rayon::ThreadPool, options: &EncodeOptions| {
        let (mut grid, mut file) = (grid.borrow_mut(), file.borrow_mut());
        let (grid, file): (&mut Grid, &mut Vec<u8>) = (&mut grid, &mut file);
        pool.install(|| run(grid, options, file));
    };
    let mut contestants: Vec<Contestant<'_>> = vec![
        ("1 level, 2 threads".into(), Box::new(|| on(&two, &flat))),
        ("all levels, 2 threads".into(), Box::new(|| on(&two, &full))),
        ("all levels, 1 thread".into(), Box::new(|| on(&one, &full))),
    ];
    let times = interleave(7, &mut contestants);
    let speed = voxels / times[1].median.as_secs_f64() / 1e6;
    let (levels, best) = times[1].ratio_to(&times[0]);
    let (threads, best_threads) = times[1].ratio_to(&times[2]);
    println!("{name:<22} {levels:>6.2} {best:>6.2} {threads:>8.2} {best_threads:>6.2} {speed:>9.1} Mvoxel/s");
}

fn main() {
    let edge = std::env::var("VUG_BENCH_EDGE").ok().and_then(|v| v.parse().ok()).unwrap_or(384);
    println!(
        "encode with all levels, times its speed with one level; 2 threads, times 1 thread ({edge}³, bricks of 64³)"
    );
    println!("{:<22} {:>6} {:>6} {:>8} {:>6}", "row", "levels", "best", "threads", "best");
    let explicit = Quality::Explicit { index_bits: 4, block: Extent::cube(4) };
    let options = |codec, zstd, quality| EncodeOptions { codec, zstd, quality, ..EncodeOptions::default() };
    let mut bytes = volume(edge, |v| (v * 255.0) as u8);
    let mut words = volume(edge, |v| (v * 60_000.0) as u16);
    let mut floats = volume(edge, |v| v);
    for (t, grid) in [("u8", &mut bytes), ("u16", &mut words), ("f32", &mut floats)] {
        row(&format!("{t} raw, no zstd"), grid, &options(CodecChoice::Raw, false, explicit));
        row(&format!("{t} raw"), grid, &options(CodecChoice::Raw, true, explicit));
        row(&format!("{t} s3dc, no zstd"), grid, &options(CodecChoice::S3dc, false, explicit));
        row(&format!("{t} s3dc"), grid, &options(CodecChoice::S3dc, true, explicit));
        if t != "f32" {
            row(&format!("{t} zerobit"), grid, &options(CodecChoice::Zerobit, true, Quality::Keep(30_000)));
        }
    }
}
