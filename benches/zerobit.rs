//! What does a voxel, a plane, a cell of a colour volume cost out of zerobit streams, against the same voxels of a raw array?
//!
//! The rows of Fig. 13 of the paper: voxel mode 1 (random voxels), voxel mode 2 (cutting planes), plane mode, cell mode;
//! uncompressed, NEW and OLD stream; two shares of background; several ratios of coefficients kept. One million operations
//! each, the same for all contestants, rounds interleaved. Ratio: time of the volume / time of the array; lower is better.
//!
//! `cargo bench --bench zerobit [-- WORD...]`: only parts whose name holds one of the words: `voxel`, `chain`, `plane`,
//! `planes cached`, `cell`, `whole`, `paper`, `encode`.

#[path = "zerobit/encode.rs"]
mod encode;
#[path = "zerobit/paper.rs"]
mod paper;
mod support;

use std::hint::black_box;
use std::io::Cursor;
use support::{Contestant, Timing, interleave, rounds, wanted};
use vug::codec::zerobit::Stream;
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{self, At, Axis, CodecChoice, EncodeOptions, Quality, Volume, ZerobitOptions};
use vug::{Extent, Grid, Region};

type Rgb = [u8; 3];
const OPERATIONS: usize = 1 << 20;

/// A synthetic colour volume: tissue with a little grain inside a body, black around it. `background`: about that share.
fn colour(edge: u32, background: f32) -> Grid {
    // A body that fills the rest of the cube: an elliptic cylinder.
    let radius = ((1.0 - background) / std::f32::consts::PI).sqrt();
    Grid::from_fn(Extent::cube(edge), |[x, y, z]| {
        let p = [x, y, z].map(|v| (v as f32 + 0.5) / edge as f32 - 0.5);
        if (p[0] * p[0] + p[1] * p[1]).sqrt() > radius {
            return [0; 3];
        }
        let v = support::synthetic(edge, [x, y, z].map(|v| v / 2 + edge / 4));
        let wave = 0.5 + 0.5 * (p[0] * 9.0 + (p[1] * 7.0 + p[2] * 11.0).sin()).sin();
        let grain = (support::synthetic(edge, [x, y, z]) * 97.0).fract() * 10.0;
        [
            40.0 + 150.0 * v + 60.0 * wave + grain,
            20.0 + 120.0 * v + 70.0 * wave + grain,
            30.0 + 90.0 * v + 20.0 * wave + grain,
        ]
        .map(|v| v as u8)
    })
    .expect("memory for the bench's volume")
}

fn encoded(grid: &mut Grid, percent: f64, stream: Stream) -> Volume {
    let options = EncodeOptions {
        codec: CodecChoice::Zerobit,
        quality: Quality::Keep((percent * 1e4) as u32),
        zerobit: ZerobitOptions { stream, ..ZerobitOptions::default() },
        zstd: false,
        ..EncodeOptions::default()
    };
    let mut file = Cursor::new(Vec::new());
    let report = volume::encode(grid, &mut file, &options, &mut |_, _| {}).expect("encodes");
    if stream == Stream::New {
        println!(
            "  {percent} %: {:.3} bits per voxel, {:.1} dB",
            report.bits_per_voxel,
            report.psnr.unwrap_or(f64::INFINITY)
        );
    }
    Volume::open(MemorySource(file.into_inner()), Limits::default()).expect("opens")
}

/// A stream of pseudo-random numbers.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (((self.0 >> 32) * u64::from(n)) >> 32) as u32
    }

    fn coord(&mut self, edge: u32) -> [u32; 3] {
        [self.below(edge), self.below(edge), self.below(edge)]
    }
}

/// Voxels of planes of any position and orientation, row by row.
fn cutting_planes(edge: u32) -> Vec<[u32; 3]> {
    let mut numbers = Numbers(0x9E37_79B9_7F4A_7C15);
    let mut out = Vec::with_capacity(OPERATIONS);
    let mut unit = || -> [f32; 3] {
        let v = [0; 3].map(|_| numbers.below(2001) as f32 - 1000.0);
        let length = v.iter().map(|v| v * v).sum::<f32>().sqrt().max(1.0);
        v.map(|v| v / length)
    };
    while out.len() < OPERATIONS {
        let (u, n) = (unit(), unit());
        let v = [u[1] * n[2] - u[2] * n[1], u[2] * n[0] - u[0] * n[2], u[0] * n[1] - u[1] * n[0]];
        let centre = unit().map(|c| edge as f32 * (0.5 + 0.2 * c));
        let half = edge as i32 / 2;
        for j in -half..half {
            for i in -half..half {
                let p: [f32; 3] = std::array::from_fn(|a| centre[a] + i as f32 * u[a] + j as f32 * v[a]);
                if p.iter().all(|&c| c >= 0.0 && c < edge as f32) && out.len() < OPERATIONS {
                    out.push(p.map(|c| c as u32));
                }
            }
        }
    }
    out
}

fn per_operation(t: &Timing) -> f64 {
    t.median.as_secs_f64() * 1e9 / OPERATIONS as f64
}

fn print_row(name: &str, times: &[Timing]) {
    let raw = per_operation(&times[0]);
    print!("  {name:<26} raw {raw:>6.1} ns");
    for t in &times[1..] {
        print!(" | {} {:.1} ({:.2}×)", t.name, per_operation(t), per_operation(t) / raw);
    }
    println!();
}

struct Case<'a> {
    grid: &'a Grid,
    edge: u32,
    volumes: Vec<(String, Volume)>,
}

impl Case<'_> {
    fn voxels(&self, name: &str, coords: &[[u32; 3]]) {
        let samples = self.grid.samples::<Rgb>();
        let extent = self.grid.extent();
        let sum = |v: Rgb| u64::from(v[0]) + u64::from(v[1]) + u64::from(v[2]);
        let raw = || coords.iter().map(|&c| sum(samples[extent.index(c) as usize])).sum::<u64>();
        let samplers: Vec<_> =
            self.volumes.iter().map(|(_, v)| v.sampler::<Rgb>(At::default()).expect("colours")).collect();
        let mut out = vec![[0; 3]; OPERATIONS];
        let out = std::cell::RefCell::new(&mut out);
        let mut contestants: Vec<Contestant<'_>> = vec![("raw".into(), Box::new(|| _ = black_box(raw())))];
        for ((name, _), sampler) in self.volumes.iter().zip(&samplers) {
            let single = || coords.iter().map(|&c| sum(sampler.get(c).expect("inside"))).sum::<u64>();
            contestants.push((format!("{name} single"), Box::new(move || _ = black_box(single()))));
            let out = &out;
            contestants.push((
                format!("{name} batch"),
                Box::new(move || sampler.get_many(coords, black_box(&mut out.borrow_mut())).expect("inside")),
            ));
        }
        print_row(name, &interleave(11, &mut contestants));
    }

    /// Cutting planes through a cache of 4×4 planes, against the raw array and the sampler without one.
    fn planes_cached(&self, coords: &[[u32; 3]]) {
        let samples = self.grid.samples::<Rgb>();
        let extent = self.grid.extent();
        let sum = |v: Rgb| u64::from(v[0]) + u64::from(v[1]) + u64::from(v[2]);
        let raw = || coords.iter().map(|&c| sum(samples[extent.index(c) as usize])).sum::<u64>();
        let mut contestants: Vec<Contestant<'_>> = vec![("raw".into(), Box::new(|| _ = black_box(raw())))];
        let mut hits = Vec::new();
        for (name, volume) in &self.volumes {
            let sampler = volume.sampler::<Rgb>(At::default()).expect("colours");
            let single = move || coords.iter().map(|&c| sum(sampler.get(c).expect("inside"))).sum::<u64>();
            contestants.push((format!("{name} single"), Box::new(move || _ = black_box(single()))));
            let cached = || volume.plane_sampler::<Rgb>(At::default(), Axis::Z).expect("colours");
            let mut once = cached();
            coords.iter().for_each(|&c| _ = once.get(c).expect("inside"));
            hits.push(format!("{name} {:.1} %", 100.0 * once.hits() as f64 / coords.len() as f64));
            let mut cached = cached();
            let mut run = move || coords.iter().map(|&c| sum(cached.get(c).expect("inside"))).sum::<u64>();
            contestants.push((format!("{name} cached"), Box::new(move || _ = black_box(run()))));
        }
        print_row("planes cached", &interleave(7, &mut contestants));
        println!("    hits: {}", hits.join(", "));
    }

    /// Each voxel says where the next one lies: nothing can be asked for ahead.
    fn chain(&self) {
        let samples = self.grid.samples::<Rgb>();
        let (extent, edge) = (self.grid.extent(), self.edge);
        let steps = OPERATIONS / 4;
        let next = move |c: [u32; 3], v: Rgb, i: usize| {
            let h =
                (i as u32).wrapping_mul(0x9E37_79B1) ^ u32::from(v[0]) ^ u32::from(v[1]) << 8 ^ u32::from(v[2]) << 16;
            let h = h.wrapping_mul(0x85EB_CA77);
            [(c[0] + (h >> 7)) % edge, (c[1] + (h >> 13)) % edge, (c[2] + (h >> 19)) % edge]
        };
        let raw = || (0..steps).fold([1; 3], |c, i| next(c, samples[extent.index(c) as usize], i));
        let samplers: Vec<_> =
            self.volumes.iter().map(|(_, v)| v.sampler::<Rgb>(At::default()).expect("colours")).collect();
        let mut contestants: Vec<Contestant<'_>> = vec![("raw".into(), Box::new(|| _ = black_box(raw())))];
        for ((name, _), sampler) in self.volumes.iter().zip(&samplers) {
            let run = move || (0..steps).fold([1; 3], |c, i| next(c, sampler.get(c).expect("inside"), i));
            contestants.push((name.clone(), Box::new(move || _ = black_box(run()))));
        }
        let mut times = interleave(7, &mut contestants);
        times.iter_mut().for_each(|t| t.median *= 4);
        print_row("dependent chain", &times);
    }

    fn planes(&self, name: &str, coords: &[[u32; 3]]) {
        let samples = self.grid.samples::<Rgb>();
        let extent = self.grid.extent();
        for axis in [Axis::X, Axis::Y, Axis::Z] {
            let a = axis as usize;
            let raw = move |c: [u32; 3]| {
                let mut out = [[0; 3]; 16];
                let first = c.map(|v| v & !3);
                for i in 0..16 {
                    let mut at = c;
                    for (axis, step) in (0..3).filter(|&o| o != a).zip([i & 3, i >> 2]) {
                        at[axis] = first[axis] + step;
                    }
                    out[i as usize] = samples[extent.index(at) as usize];
                }
                out
            };
            let all = || coords.iter().for_each(|&c| _ = black_box(raw(c)));
            let samplers: Vec<_> =
                self.volumes.iter().map(|(_, v)| v.sampler::<Rgb>(At::default()).expect("colours")).collect();
            let mut contestants: Vec<Contestant<'_>> = vec![("raw".into(), Box::new(all))];
            for ((name, _), sampler) in self.volumes.iter().zip(&samplers) {
                let run = move || {
                    let mut out = [[0; 3]; 16];
                    for &c in coords {
                        sampler.plane(axis, c, &mut out).expect("inside");
                        black_box(&out);
                    }
                };
                contestants.push((name.clone(), Box::new(run)));
            }
            print_row(&format!("{name}, planes across {}", ["x", "y", "z"][a]), &interleave(5, &mut contestants));
        }
    }

    fn cells(&self, name: &str, coords: &[[u32; 3]]) {
        let samples = self.grid.samples::<Rgb>();
        let extent = self.grid.extent();
        let raw = move |c: [u32; 3]| {
            let mut out = [[0; 3]; 64];
            let [x, y, z] = c.map(|v| v & !3);
            for (i, row) in (0..).zip(out.chunks_exact_mut(4)) {
                let at = extent.index([x, y + (i & 3), z + (i >> 2)]) as usize;
                row.copy_from_slice(&samples[at..at + 4]);
            }
            out
        };
        let all = || coords.iter().for_each(|&c| _ = black_box(raw(c)));
        let samplers: Vec<_> =
            self.volumes.iter().map(|(_, v)| v.sampler::<Rgb>(At::default()).expect("colours")).collect();
        let mut contestants: Vec<Contestant<'_>> = vec![("raw".into(), Box::new(all))];
        for ((name, _), sampler) in self.volumes.iter().zip(&samplers) {
            let run = move || {
                let mut out = [[0; 3]; 64];
                for &c in coords {
                    sampler.cell(c, &mut out).expect("inside");
                    black_box(&out);
                }
            };
            contestants.push((name.clone(), Box::new(run)));
        }
        print_row(name, &interleave(5, &mut contestants));
    }

    fn whole(&self) {
        let bytes = self.grid.bytes();
        let mut to = Grid::zeros(self.grid.extent(), self.grid.sample_type()).expect("memory");
        let to = std::cell::RefCell::new(&mut to);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        let mut contestants: Vec<Contestant<'_>> =
            vec![("memcpy".into(), Box::new(|| to.borrow_mut().bytes_mut().copy_from_slice(black_box(bytes))))];
        for (name, volume) in &self.volumes {
            let (to, one) = (&to, &one);
            let run = move || {
                let region = Region::whole(volume.info().dims);
                let view = &mut *to.borrow_mut();
                one.install(|| volume.read_region_into(At::default(), region, view.view_mut())).expect("decodes");
            };
            contestants.push((name.clone(), Box::new(run)));
        }
        let times = interleave(rounds(bytes.len()).min(15), &mut contestants);
        let gb = |t: &Timing| bytes.len() as f64 / t.median.as_secs_f64() / 1e9;
        print!("  whole, 1 thread            memcpy {:.1} GB/s", gb(&times[0]));
        for t in &times[1..] {
            print!(" | {} {:.1} GB/s ({:.2} of memcpy)", t.name, gb(t), gb(t) / gb(&times[0]));
        }
        println!();
    }
}

fn main() {
    println!(
        "zerobit against a raw array of colours; synthetic volumes; {OPERATIONS} operations; medians of interleaved rounds"
    );
    let edge: u32 = std::env::var("VUG_BENCH_EDGE").ok().and_then(|v| v.parse().ok()).unwrap_or(256);
    let percents: Vec<f64> = match std::env::var("VUG_BENCH_KEEP") {
        Ok(list) => list.split(',').filter_map(|v| v.parse().ok()).collect(),
        Err(_) => vec![1.0, 2.0, 3.0, 4.0, 5.0],
    };
    for background in [0.434, 0.211] {
        let mut grid = colour(edge, background);
        println!("{edge}³ rgb8, {:.1} % background", 100.0 * background);
        if wanted("encode") {
            encode::rows(&mut grid, 3.0);
        }
        if !["voxel", "chain", "plane", "planes cached", "cell", "whole", "paper"].iter().any(|part| wanted(part)) {
            continue;
        }
        let mut numbers = Numbers(0x2545_F491_4F6C_DD1D);
        let random: Vec<[u32; 3]> = (0..OPERATIONS).map(|_| numbers.coord(edge)).collect();
        let planes = cutting_planes(edge);
        if wanted("paper") {
            // Fig. 13 has no row for 1 %.
            percents.iter().filter(|&&p| p > 1.0).for_each(|&percent| paper::rows(&grid, percent, &random));
        }
        if !["voxel", "chain", "plane", "planes cached", "cell", "whole"].iter().any(|part| wanted(part)) {
            continue;
        }
        for &percent in &percents {
            let volumes = [("NEW", Stream::New), ("OLD", Stream::Old)]
                .map(|(name, stream)| (name.to_string(), encoded(&mut grid, percent, stream)));
            let case = Case { grid: &grid, edge, volumes: volumes.into() };
            if wanted("voxel") {
                case.voxels("voxel mode 1", &random);
                case.voxels("voxel mode 2", &planes);
            }
            if wanted("chain") {
                case.chain();
            }
            if wanted("plane") {
                case.planes("plane mode", &random);
            }
            if wanted("planes cached") {
                case.planes_cached(&planes);
            }
            if wanted("cell") {
                case.cells("cell mode", &random);
            }
            if wanted("whole") {
                case.whole();
            }
        }
    }
}
