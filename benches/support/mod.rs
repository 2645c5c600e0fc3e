//! Shared by the benches: interleaved timing, a synthetic volume, tables.
//!
//! Rounds interleave all contestants, so that what else the machine does hits all alike; ratios of medians within one
//! run are the only figures worth comparing.
#![allow(dead_code, reason = "each bench uses its own part")]

use std::time::{Duration, Instant};
use vug::geometry::Extent;
use vug::grid::Grid;
use vug::voxel::Sample;

/// A contestant: a name and what to time.
pub type Contestant<'a> = (String, Box<dyn FnMut() + 'a>);

/// What a contestant needed.
#[derive(Clone, Debug)]
pub struct Timing {
    /// Its name.
    pub name: String,
    /// Median over the rounds.
    pub median: Duration,
    /// Best round.
    pub min: Duration,
}

impl Timing {
    /// How many times faster than `other`, by medians and by best rounds.
    pub fn ratio_to(&self, other: &Timing) -> (f64, f64) {
        (other.median.as_secs_f64() / self.median.as_secs_f64(), other.min.as_secs_f64() / self.min.as_secs_f64())
    }
}

/// Runs every contestant once per round, in turn, after one round to warm up.
pub fn interleave(rounds: usize, contestants: &mut [Contestant<'_>]) -> Vec<Timing> {
    let mut times = vec![Vec::with_capacity(rounds); contestants.len()];
    for round in 0..=rounds {
        for (times, (_, run)) in times.iter_mut().zip(contestants.iter_mut()) {
            let start = Instant::now();
            run();
            if round > 0 {
                times.push(start.elapsed());
            }
        }
    }
    let summary = |mut times: Vec<Duration>, name: &str| {
        times.sort();
        Timing { name: name.to_string(), median: times[times.len() / 2], min: times[0] }
    };
    times.into_iter().zip(contestants).map(|(times, (name, _))| summary(times, name)).collect()
}

/// Words on the command line that are no options: only rows whose name holds one of them are run; all if there is none.
pub fn wanted(name: &str) -> bool {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    words.is_empty() || words.iter().any(|w| name.contains(w.as_str()))
}

/// Rounds per row: `VUG_BENCH_ROUNDS`, else as many as fit a fair time for this many bytes.
pub fn rounds(bytes: usize) -> usize {
    match std::env::var("VUG_BENCH_ROUNDS").ok().and_then(|v| v.parse().ok()) {
        Some(n) => n,
        None => ((4usize << 30) / bytes.max(1)).clamp(7, 101) | 1,
    }
}

/// A synthetic volume in 0..=1: a few soft shells and bands, with a little noise, and air around. No real data.
pub fn synthetic(edge: u32, [x, y, z]: [u32; 3]) -> f32 {
    let p = [x, y, z].map(|v| (v as f32 + 0.5) / edge as f32 - 0.5);
    let r = (p[0] * p[0] + p[1] * p[1] * 1.4 + p[2] * p[2] * 0.8).sqrt();
    let seed = (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ z.wrapping_mul(0xC2B2_AE3D))
        .wrapping_mul(0x27D4_EB2F);
    let noise = ((seed ^ seed >> 15) & 0xffff) as f32 / 65_535.0 - 0.5;
    if r > 0.48 {
        return 0.0;
    }
    let shell = if (0.38..0.42).contains(&r) { 0.5 } else { 0.0 };
    (0.25 + 0.2 * (p[0] * 23.0).sin() * (p[1] * 17.0).cos() + shell + noise * 0.03).clamp(0.0, 1.0)
}

/// A cube of synthetic samples, `scale` being the largest.
pub fn volume<T: Sample>(edge: u32, convert: impl Fn(f32) -> T) -> Grid {
    Grid::from_fn(Extent::cube(edge), |c| convert(synthetic(edge, c))).expect("memory for the bench's volume")
}

/// Prints what every bench should say first.
pub fn header(what: &str) {
    println!("{what}");
    println!(
        "volume: synthetic (shells and bands with noise); one run, rounds interleaved; ratio > 1 = faster than memcpy"
    );
    println!("threads of this machine: {}", std::thread::available_parallelism().map_or(1, usize::from));
}

/// Copies `from` to `to` on `threads` threads.
pub fn copy(from: &[u8], to: &mut [u8], threads: usize) {
    if threads == 1 {
        to.copy_from_slice(from);
        return;
    }
    let part = from.len().div_ceil(threads).next_multiple_of(4096);
    std::thread::scope(|s| {
        for (from, to) in from.chunks(part).zip(to.chunks_mut(part)) {
            s.spawn(|| to.copy_from_slice(from));
        }
    });
}
