//! Levels of detail: what they hold, that one pass makes them all, and that neither memory nor the kind of source shows.

mod support;

use std::ops::Range;
use support::{encode, hash, open, verify};
use vug::container::Downsample;
use vug::grid::SlabReader;
use vug::volume::{At, CodecChoice, EncodeOptions, Quality, Volume};
use vug::voxel::Sample;
use vug::{Code, Extent, Grid, Region, SampleType};

/// A grid as a file would give it: no view, rows one by one; or as a pipe would: once, in order.
struct Source {
    grid: Grid,
    sequential: bool,
    next: usize,
    /// Largest number of bytes that were asked for at once.
    most: usize,
}

impl Source {
    fn new(grid: Grid, sequential: bool) -> Self {
        Source { grid, sequential, next: 0, most: 0 }
    }
}

impl SlabReader for Source {
    fn extent(&self) -> Extent {
        self.grid.extent()
    }
    fn sample_type(&self) -> SampleType {
        self.grid.sample_type()
    }
    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> vug::Result<()> {
        self.read_rows(z, 0..self.grid.extent().y, out)
    }
    fn read_rows(&mut self, z: Range<u32>, y: Range<u32>, out: &mut [u8]) -> vug::Result<()> {
        self.most = self.most.max(out.len());
        let e = self.grid.extent();
        let row = e.x as usize * self.grid.sample_type().bytes();
        let mut rows = out.chunks_exact_mut(row);
        for z in z {
            for y in y.clone() {
                let at = e.index([0, y, z]) as usize * self.grid.sample_type().bytes();
                assert!(!self.sequential || at == self.next, "a pipe was asked for {at} at {}", self.next);
                self.next = at + row;
                rows.next().unwrap().copy_from_slice(&self.grid.bytes()[at..at + row]);
            }
        }
        Ok(())
    }
    fn is_sequential(&self) -> bool {
        self.sequential
    }
}

fn grid<T: Sample>(f: impl Fn([u32; 3]) -> T) -> Grid {
    Grid::from_fn(Extent::new(100, 90, 70), f).unwrap()
}

fn blobs([x, y, z]: [u32; 3]) -> u8 {
    if (x / 30 + y / 25 + z / 40) % 2 == 0 { 0 } else { 40 + (hash([x, y, z]) % 100) as u8 }
}

fn options(codec: CodecChoice, downsample: Downsample) -> EncodeOptions {
    let quality = match codec {
        CodecChoice::Zerobit => Quality::Keep(50_000),
        _ => Quality::Explicit { index_bits: 4, block: Extent::cube(4) },
    };
    EncodeOptions { codec, quality, brick: Some(16), levels: 0, downsample, ..EncodeOptions::default() }
}

fn encoded(source: &mut dyn SlabReader, options: &EncodeOptions) -> (Vec<u8>, Vec<String>) {
    let mut file = std::io::Cursor::new(Vec::new());
    let report = vug::volume::encode(source, &mut file, options, &mut |_, _| {}).unwrap();
    (file.into_inner(), report.notes)
}

/// One coarse voxel from the voxels of level 0, as the spec says it.
fn expected(fine: &Grid, downsample: Downsample, level: u8, c: [u32; 3]) -> f64 {
    let e = fine.extent().to_array();
    if downsample == Downsample::Nearest {
        let at = std::array::from_fn(|a| ((c[a] << level) + (1 << (level - 1))).min(e[a] - 1));
        return fine.value(at).unwrap().component(0);
    }
    let axis = |a: usize| (c[a] << level)..((c[a] + 1) << level).min(e[a]);
    let (mut sum, mut n, mut lo, mut hi) = (0u64, 0u64, u8::MAX, 0);
    for z in axis(2) {
        for y in axis(1) {
            for x in axis(0) {
                let v = fine.samples::<u8>()[fine.extent().index([x, y, z]) as usize];
                (sum, n, lo, hi) = (sum + u64::from(v), n + 1, lo.min(v), hi.max(v));
            }
        }
    }
    match downsample {
        Downsample::Min => f64::from(lo),
        Downsample::Max => f64::from(hi),
        _ => ((2 * sum + n) / (2 * n)) as f64,
    }
}

#[test] // spec: VOL-12; D-52, D-53; D-01
fn every_level_of_every_operator_is_exact() {
    for downsample in Downsample::ALL {
        let mut fine = grid(blobs);
        let volume = open(encode(&mut fine, &options(CodecChoice::Raw, downsample)).0);
        assert_eq!(volume.info().downsample, downsample);
        let extents: Vec<Extent> = volume.levels().collect();
        assert_eq!(extents.len(), 4);
        assert_eq!(extents[3], Extent::new(13, 12, 9), "down to one brick");
        for (level, extent) in (1u8..).zip(&extents[1..]) {
            let coarse = volume.read(At::lod(level)).unwrap();
            for i in 0..3000 {
                let c = [hash([i, 0, 1]) % extent.x, hash([i, 1, 1]) % extent.y, hash([i, 2, 1]) % extent.z];
                let found = coarse.value(c).unwrap().component(0);
                assert_eq!(found, expected(&fine, downsample, level, c), "{downsample:?} level {level} {c:?}");
            }
        }
    }
}

/// A row of bricks is 100×16×16 voxels; six of them are a slab. Its bytes, and memory that does not hold a slab.
fn little(t: SampleType) -> (usize, usize) {
    let row = 100 * 16 * 16 * t.bytes();
    // Bricks in work come on top: four times their samples for each of two threads.
    (row, row * 6 + 2 * 4 * 16 * 16 * 16 * t.bytes())
}

/// What is held depends on the number of threads: two on any machine.
fn by_two<R: Send>(f: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap().install(f)
}

/// The same bytes from memory, from a file and from a pipe, with memory and without.
fn nothing_shows(make: impl Fn() -> Grid, codec: CodecChoice, downsample: Downsample) {
    let options = options(codec, downsample);
    let (bytes, notes) = encoded(&mut make(), &options);
    assert!(notes.iter().all(|n| !n.contains("temporary")), "{notes:?}");
    let errors = verify(&bytes);
    assert!(errors.is_empty(), "{codec:?} {downsample:?}: {errors:?}");
    let (row, little) = little(make().sample_type());
    for (sequential, memory) in [(false, 1 << 30), (true, 1 << 30), (false, little), (true, little)] {
        let options = EncodeOptions { memory: memory as u64, ..options.clone() };
        let mut source = Source::new(make(), sequential);
        let (same, notes) = by_two(|| encoded(&mut source, &options));
        assert!(same == bytes, "{codec:?} {downsample:?}: sequential {sequential}, memory {memory}");
        let told = notes.iter().any(|n| n.contains("temporary"));
        assert_eq!(told, memory < 1 << 30 || (sequential && codec == CodecChoice::Zerobit), "{notes:?}");
        if memory < 1 << 30 && !sequential {
            assert!(source.most < row * 4, "a few rows of bricks at a time, not all six: {}", source.most);
        }
    }
}

#[test]
fn neither_memory_nor_the_kind_of_source_shows() {
    for downsample in Downsample::ALL {
        nothing_shows(|| grid(blobs), CodecChoice::S3dc, downsample);
        nothing_shows(|| grid(|c| blobs(c) as f32 * 1.7 - 60.0), CodecChoice::S3dc, downsample);
        nothing_shows(|| grid(|c| [blobs(c), 1, blobs([c[1], c[0], c[2]])]), CodecChoice::Raw, downsample);
    }
    nothing_shows(|| grid(blobs), CodecChoice::Zerobit, Downsample::Mean);
    nothing_shows(|| grid(|c| i16::from(blobs(c)) - 90), CodecChoice::Raw, Downsample::Mean);
}

#[test]
fn neither_do_threads() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| encoded(&mut grid(blobs), &options(CodecChoice::S3dc, Downsample::Mean)).0)
    };
    assert!(run(1) == run(3));
}

#[test]
fn memory_that_does_not_hold_a_row_of_bricks_is_an_error_that_says_so() {
    let options = EncodeOptions { memory: 10_000, ..options(CodecChoice::Raw, Downsample::Mean) };
    let mut file = std::io::Cursor::new(Vec::new());
    let error =
        vug::volume::encode(&mut Source::new(grid(blobs), false), &mut file, &options, &mut |_, _| {}).unwrap_err();
    assert_eq!(error.code(), Code::Limit);
    assert!(error.message().contains("--memory") && error.message().contains("--brick"), "{error}");
}

#[test]
fn a_folder_that_is_not_there_is_an_error_that_names_it() {
    let temp_dir = Some("/nowhere/at/all".into());
    let options = EncodeOptions {
        memory: little(SampleType::U8).1 as u64,
        temp_dir,
        ..options(CodecChoice::Raw, Downsample::Mean)
    };
    let mut file = std::io::Cursor::new(Vec::new());
    let mut source = Source::new(grid(blobs), false);
    let error = by_two(|| vug::volume::encode(&mut source, &mut file, &options, &mut |_, _| {})).unwrap_err();
    assert_eq!(error.code(), Code::Source);
    assert!(error.message().contains("/nowhere/at/all"), "{error}");
}

/// A series: the volume of time step t and channel c is `f([x, y, z], t, c)`.
struct Series<F>(Extent, (u32, u32), F, (u32, u32));

impl<F: Fn([u32; 3], u32, u32) -> u16 + Send> SlabReader for Series<F> {
    fn extent(&self) -> Extent {
        self.0
    }
    fn sample_type(&self) -> SampleType {
        SampleType::U16
    }
    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> vug::Result<()> {
        let mut at = out.chunks_exact_mut(2);
        for z in z {
            for y in 0..self.0.y {
                for x in 0..self.0.x {
                    let v = (self.2)([x, y, z], self.3.0, self.3.1);
                    at.next().unwrap().copy_from_slice(&v.to_ne_bytes());
                }
            }
        }
        Ok(())
    }
    fn series(&self) -> (u32, u32) {
        self.1
    }
    fn turn_to(&mut self, time: u32, channel: u32) -> vug::Result<()> {
        assert!(time < self.1.0 && channel < self.1.1);
        self.3 = (time, channel);
        Ok(())
    }
}

fn value([x, y, z]: [u32; 3], t: u32, c: u32) -> u16 {
    ((x * 3 + y * 5 + z * 7) % 200 + 1000 * t + 300 * c) as u16
}

fn series() -> Series<impl Fn([u32; 3], u32, u32) -> u16 + Send> {
    Series(Extent::new(40, 33, 20), (5, 2), value, (0, 0))
}

fn whole(volume: &Volume, time: u32, channel: u32) -> Grid {
    volume.read(At { time, channel, lod: 0 }).unwrap()
}

#[test] // D-27: every step and channel is a tree of its own; levels too
fn series_are_read_step_by_step() {
    for codec in [CodecChoice::Raw, CodecChoice::S3dc, CodecChoice::Zerobit] {
        let (bytes, _) = encoded(&mut series(), &options(codec, Downsample::Mean));
        let errors = verify(&bytes);
        assert!(errors.is_empty(), "{codec:?}: {errors:?}");
        let volume = open(bytes);
        assert_eq!((volume.info().time_steps, volume.info().channels), (5, 2));
        let achieved = volume.info().achieved.unwrap();
        assert_eq!(achieved.max_error == 0.0, codec == CodecChoice::Raw);
        let mut worst = 0f64;
        for (t, c) in (0..5).flat_map(|t| (0..2).map(move |c| (t, c))) {
            let decoded = whole(&volume, t, c);
            let e = decoded.extent();
            for (i, v) in decoded.samples::<u16>().iter().enumerate() {
                let i = i as u32;
                let source = value([i % e.x, i / e.x % e.y, i / e.x / e.y], t, c);
                worst = worst.max((f64::from(*v) - f64::from(source)).abs());
            }
            let coarse = volume.read(At { time: t, channel: c, lod: 1 }).unwrap();
            let mean = coarse.samples::<u16>().iter().map(|&v| f64::from(v)).sum::<f64>() / 3400.0;
            let near = f64::from(1000 * t + 300 * c) + 100.0;
            assert!((mean - near).abs() < 30.0, "{codec:?} {t} {c}: {mean} for {near}");
        }
        assert_eq!(worst, achieved.max_error, "over all steps and channels");
        if codec == CodecChoice::Zerobit {
            let books = volume.codebooks().unwrap().len();
            assert_eq!(books, volume.levels().len(), "steps and channels share a codebook per level");
        }
    }
}

#[test]
fn one_step_reads_its_own_bricks_only() {
    let options = EncodeOptions { zstd: false, ..options(CodecChoice::Raw, Downsample::Mean) };
    let (bytes, _) = encoded(&mut series(), &options);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vug");
    std::fs::write(&path, bytes).unwrap();
    let volume = Volume::open_path(&path).unwrap();
    volume.reset_cost();
    let at = At { time: 3, channel: 1, lod: 0 };
    let part = volume.read_region(at, Region { start: [0; 3], end: [40, 33, 20] }).unwrap();
    assert_eq!(part.samples::<u16>()[0], value([0; 3], 3, 1));
    let payload = 40 * 33 * 20 * 2;
    let cost = volume.cost();
    assert!(cost.bytes < payload * 3 / 2, "{cost:?} for {payload} bytes of one step; ten are {}", payload * 10);
}

#[test] // D-57: far from the origin and finely spaced: nothing is lost in the file, and levels and parts move by what they should
fn a_tiny_volume_far_away_stays_where_it_is() {
    let placement = vug::affine::Placement::from_spacing([1e-6; 3], [1e9, -1e9, 1e9]);
    let options = EncodeOptions { placement: placement.clone(), ..options(CodecChoice::Raw, Downsample::Mean) };
    let volume = open(encode(&mut grid(blobs), &options).0);
    assert_eq!(
        volume.info().placement.matrix.map(|r| r.map(f64::to_bits)),
        placement.matrix.map(|r| r.map(f64::to_bits))
    );
    let step = 1e9f64.next_up() - 1e9;
    let coarse = volume.info().placement.moved(3, [4, 0, 0]);
    assert!((coarse.origin()[0] - 1e9 - 35.5e-6).abs() <= step && coarse.spacing()[0] == 8e-6, "{:?}", coarse.origin());
    assert!(step < 0.2e-6, "a fifth of a voxel: what f64 leaves of it; f32 would leave none");
}
