//! Rows of part `encode`: the whole pipeline from samples in memory to a file in memory, in Mvoxel/s.

use std::io::Cursor;
use std::time::{Duration, Instant};
use vug::Grid;
use vug::codec::zerobit::Stream;
use vug::volume::{self, CodecChoice, EncodeOptions, Quality, ZerobitOptions};

const ROUNDS: usize = 5;

/// When each of the three looks at the source was over: survey, survivors, encoding (with the training before it).
fn run(grid: &mut Grid, options: &EncodeOptions) -> ([Duration; 3], Vec<u8>) {
    let mut file = Cursor::new(Vec::new());
    let start = Instant::now();
    let mut ends = [Duration::ZERO; 3];
    volume::encode(grid, &mut file, options, &mut |done, total| {
        if let Some(end) = ends.get_mut(((3 * done).div_ceil(total) as usize).max(1) - 1) {
            *end = start.elapsed();
        }
    })
    .expect("encodes");
    ends[2] = start.elapsed();
    (ends, file.into_inner())
}

/// NEW at `percent`, with and without zstd, one thread and two.
pub fn rows(grid: &mut Grid, percent: f64) {
    let mega = grid.extent().voxels() as f64 / 1e6;
    for (zstd, name) in [(false, "plain"), (true, "zstd")] {
        let options = EncodeOptions {
            codec: CodecChoice::Zerobit,
            quality: Quality::Keep((percent * 1e4) as u32),
            zerobit: ZerobitOptions { stream: Stream::New, ..ZerobitOptions::default() },
            zstd,
            ..EncodeOptions::default()
        };
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let mut found: Vec<_> = (0..ROUNDS).map(|_| pool.install(|| run(grid, &options))).collect();
            found.sort_by_key(|(ends, _)| ends[2]);
            let (ends, file) = &found[ROUNDS / 2];
            let [survey, survivors, all] = ends.map(|d| d.as_secs_f64() * 1e3);
            println!(
                "  encode {percent} % {name:<5} {threads} thread(s): {:>6.1} Mvoxel/s, best {:>6.1} \
                 (ms: survey {survey:.0}, survivors {:.0}, training and encoding {:.0}), {} bytes, crc {:08x}",
                mega * 1e3 / all,
                mega / found[0].0[2].as_secs_f64(),
                survivors - survey,
                all - survivors,
                file.len(),
                crc32fast::hash(file),
            );
        }
    }
}
