//! What do whole volumes cost through the library: open, checksum, inflate, decode; and encode, measure, write?
//!
//! Against memcpy of the decoded volume, rounds interleaved. `checked`: payloads have passed their checksum before.
//! `first`: a fresh `Volume`, so that every payload is checked. Ratio: memcpy's time / the row's; higher is better.

mod support;

use std::hint::black_box;
use std::io::Cursor;
use vug::grid::Grid;
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{self, At, EncodeOptions, Volume};
use vug::voxel::Sample;
use vug::{Extent, Region};

fn main() {
    support::header("Whole volumes through the library, s3dc i=4 b=4, bricks of 64³ (u8, f32)");
    for edge in [256, 512] {
        rows::<u8>(edge, |v| (v * 255.0) as u8);
        rows::<f32>(edge, |v| v * 1e3);
    }
}

fn encoded(grid: &mut Grid, zstd: bool) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let options = EncodeOptions { zstd, ..EncodeOptions::default() };
    volume::encode(grid, &mut file, &options, &mut |_, _| {}).expect("encodes");
    file.into_inner()
}

fn rows<T: Sample>(edge: u32, convert: impl Fn(f32) -> T) {
    let what = format!("{} {edge}³", T::TYPE);
    if !support::wanted(&what) || (edge == 512 && T::TYPE == vug::SampleType::F32) {
        return;
    }
    let mut grid = support::volume::<T>(edge, convert);
    let bytes = grid.bytes().len();
    let whole = Region::whole(Extent::cube(edge));
    let (plain, zstd): (&'static [u8], &'static [u8]) =
        (encoded(&mut grid, false).leak(), encoded(&mut grid, true).leak());
    let open = |bytes| Volume::open(MemorySource(bytes), Limits::default()).expect("opens");
    let source = grid.bytes().to_vec();
    let grid = std::sync::Mutex::new(grid);
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let (mut copy, mut out) = (vec![0u8; bytes], Grid::zeros(Extent::cube(edge), T::TYPE).expect("memory"));
            let mut second = Grid::zeros(Extent::cube(edge), T::TYPE).expect("memory");
            let mut third = Grid::zeros(Extent::cube(edge), T::TYPE).expect("memory");
            let checked = open(plain);
            checked.read_region_into(At::default(), whole, out.view_mut()).expect("decodes");
            let mut contestants: Vec<support::Contestant<'_>> = vec![
                ("memcpy".into(), Box::new(|| support::copy(black_box(&source), &mut copy, threads))),
                (
                    "decode, checked".into(),
                    Box::new(|| checked.read_region_into(At::default(), whole, out.view_mut()).expect("decodes")),
                ),
                (
                    "decode, first (CRC)".into(),
                    Box::new(|| {
                        open(plain).read_region_into(At::default(), whole, second.view_mut()).expect("decodes")
                    }),
                ),
                (
                    "decode, first, zstd".into(),
                    Box::new(|| open(zstd).read_region_into(At::default(), whole, third.view_mut()).expect("decodes")),
                ),
                (
                    "encode + measure + write".into(),
                    Box::new(|| _ = black_box(encoded(&mut grid.lock().expect("one user"), false))),
                ),
                (
                    "the same, zstd".into(),
                    Box::new(|| _ = black_box(encoded(&mut grid.lock().expect("one user"), true))),
                ),
            ];
            let timings = support::interleave(5, &mut contestants);
            println!(
                "\n{what}, {threads} thread(s): memcpy {:.1} GB/s",
                bytes as f64 / timings[0].median.as_secs_f64() / 1e9
            );
            for t in &timings[1..] {
                let rate = f64::from(edge).powi(3) / t.median.as_secs_f64() / 1e6;
                println!("  {:<26} {:>7.2} × memcpy {:>9.0} Mvoxel/s", t.name, t.ratio_to(&timings[0]).0, rate);
            }
        });
    }
}
