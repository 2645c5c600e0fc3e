//! Encodes a volume with one setting, reads it back, and measures both.

use rayon::prelude::*;
use std::io::Cursor;
use vug::codec::zerobit::{CELL_EDGE, Norm, Stats, Stream, Threshold, Training};
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{self, At, CodecChoice, EncodeOptions, Quality, Volume, ZerobitOptions};
use vug::{Extent, Grid, Region, SampleType, metrics};

/// How an encoder chooses.
#[derive(Clone, Copy)]
pub struct Variant {
    pub name: &'static str,
    pub norm: Norm,
    pub threshold: Threshold,
    pub training: Training,
}

impl Variant {
    /// The default first.
    pub const ALL: [Variant; 5] = {
        use {Norm::*, Threshold::*, Training::*};
        [
            Variant { name: "default", norm: Energy, threshold: Adaptive, training: MedianCut },
            Variant { name: "plain norm", norm: Plain, threshold: Adaptive, training: MedianCut },
            Variant { name: "global", norm: Energy, threshold: Global, training: MedianCut },
            Variant { name: "refined", norm: Energy, threshold: Adaptive, training: Refined },
            Variant { name: "global, refined", norm: Energy, threshold: Global, training: Refined },
        ]
    };
}

/// Voxels that count for PSNR: all, every n-th slice, those of a box.
#[derive(Clone, Copy)]
pub struct Part {
    pub stride: u32,
    pub crop: Option<Region>,
}

impl Default for Part {
    fn default() -> Self {
        Part { stride: 1, crop: None }
    }
}

impl Part {
    pub fn is_whole(&self) -> bool {
        self.stride == 1 && self.crop.is_none()
    }
}

/// What came of one setting.
#[derive(Clone)]
pub struct Point {
    pub kept: f64,
    pub voxels: u64,
    /// Level 0, stream NEW.
    pub stats: Stats,
    /// Cells of 4³ voxels.
    pub cells: u64,
    /// Payloads and codebooks before zstd.
    pub bytes: u64,
    pub file_bytes: u64,
    /// The same of stream OLD: payloads and codebooks, file.
    pub old: Option<(u64, u64)>,
    /// In dB; infinite without an error.
    pub psnr: f64,
    pub psnr_non_empty: f64,
    /// That of every tenth slice, and that of the middle half along each axis.
    pub psnr_of_parts: [f64; 2],
    pub original: u64,
}

impl Point {
    pub fn bits_per_voxel(&self) -> f64 {
        self.bytes as f64 * 8.0 / self.voxels as f64
    }
}

/// A volume, and which of its cells hold anything.
pub struct Source<'a> {
    grid: &'a mut Grid,
    part: Part,
    pub range: (f64, f64),
    /// Cells with a voxel that is not 0, x fastest.
    non_empty: Vec<bool>,
    cells: Extent,
}

impl<'a> Source<'a> {
    pub fn new(grid: &'a mut Grid, part: Part) -> vug::Result<Self> {
        if let Some(crop) = part.crop {
            crop.check(grid.extent())?;
        }
        let extent = grid.extent();
        let cells = extent.div_ceil(Extent::cube(CELL_EDGE));
        let mut non_empty = vec![false; cells.voxels() as usize];
        let bytes = grid.sample_type().bytes();
        for (i, _) in grid.bytes().chunks_exact(bytes).enumerate().filter(|(_, s)| s.iter().any(|&b| b != 0)) {
            non_empty[cells.index(coord(extent, i as u64).map(|v| v / CELL_EDGE)) as usize] = true;
        }
        let range = grid.range().unwrap_or_default();
        Ok(Source { grid, part, range, non_empty, cells })
    }

    pub fn non_empty_share(&self) -> f64 {
        self.non_empty.iter().filter(|&&v| v).count() as f64 / self.non_empty.len() as f64
    }

    /// With the default stream, and what the old one takes.
    pub fn both_streams(&mut self, keep: u32, variant: Variant) -> vug::Result<Point> {
        let (mut point, new) = self.encode(keep, variant, Stream::New)?;
        let (old_point, old) = self.encode(keep, variant, Stream::Old)?;
        assert_eq!(new.bytes(), old.bytes(), "both streams decode to the same voxels");
        point.old = Some((old_point.bytes, old_point.file_bytes));
        Ok(point)
    }

    pub fn point(&mut self, keep: u32, variant: Variant) -> vug::Result<Point> {
        Ok(self.encode(keep, variant, Stream::New)?.0)
    }

    fn encode(&mut self, keep: u32, variant: Variant, stream: Stream) -> vug::Result<(Point, Grid)> {
        let Variant { norm, threshold, training, .. } = variant;
        let options = EncodeOptions {
            codec: CodecChoice::Zerobit,
            quality: Quality::Keep(keep * 10_000),
            zerobit: ZerobitOptions { stream, norm, threshold, training, ..ZerobitOptions::default() },
            ..EncodeOptions::default()
        };
        let mut file = Cursor::new(Vec::new());
        let report = volume::encode(self.grid, &mut file, &options, &mut |_, _| {})?;
        let volume = Volume::open(MemorySource(file.into_inner()), Limits::default())?;
        let stats = volume.codec_stats()?.expect("a zerobit volume");
        let decoded = volume.read(At::default())?;
        let (psnr, psnr_non_empty) = self.psnr(&decoded, &self.part);
        let extent = self.grid.extent().to_array();
        let middle = Region { start: extent.map(|v| v / 4), end: extent.map(|v| v - v / 4) };
        let parts = [Part { stride: 10, crop: None }, Part { stride: 1, crop: Some(middle) }];
        let point = Point {
            kept: stats.kept(),
            voxels: self.grid.extent().voxels(),
            stats: stats.finest.stats,
            cells: stats.finest.cells,
            bytes: stats.finest.stats.payload_bytes + stats.codebook_bytes,
            file_bytes: report.bytes,
            old: None,
            psnr,
            psnr_non_empty,
            psnr_of_parts: parts.map(|part| self.psnr(&decoded, &part).0),
            original: self.grid.bytes().len() as u64,
        };
        Ok((point, decoded))
    }

    /// Over all voxels that count, and over those of cells that are not empty.
    fn psnr(&self, decoded: &Grid, part: &Part) -> (f64, f64) {
        let [all, non_empty] = match self.grid.sample_type() {
            SampleType::I16 => self.squares(self.grid.samples::<i16>(), decoded.samples::<i16>(), 1, part),
            SampleType::U16 => self.squares(self.grid.samples::<u16>(), decoded.samples::<u16>(), 1, part),
            t => self.squares(self.grid.bytes(), decoded.bytes(), t.components(), part),
        };
        let peak = self.range.1 - self.range.0;
        let db = |s: Squares| {
            let rmse = (s.sum as f64 / s.count.max(1) as f64).sqrt();
            metrics::psnr(peak, rmse).unwrap_or(f64::INFINITY)
        };
        (db(all), db(non_empty))
    }

    fn squares<T: Copy + Into<i64> + Sync>(&self, a: &[T], b: &[T], components: usize, part: &Part) -> [Squares; 2] {
        let extent = self.grid.extent();
        let crop = part.crop.unwrap_or(Region::whole(extent));
        let planes: Vec<u32> = (crop.start[2]..crop.end[2]).step_by(part.stride as usize).collect();
        let of_plane = |&z: &u32| {
            let mut sums = [Squares::default(); 2];
            for y in crop.start[1]..crop.end[1] {
                for x in crop.start[0]..crop.end[0] {
                    let at = extent.index([x, y, z]) as usize * components;
                    let pairs = a[at..at + components].iter().zip(&b[at..at + components]);
                    let square: i64 = pairs.map(|(&a, &b)| (a.into() - b.into()).pow(2)).sum();
                    let full = self.non_empty[self.cells.index([x, y, z].map(|v| v / CELL_EDGE)) as usize];
                    for s in &mut sums[..1 + usize::from(full)] {
                        s.sum += square as u64;
                        s.count += components as u64;
                    }
                }
            }
            sums
        };
        let add = |a: [Squares; 2], b: [Squares; 2]| [a[0].plus(b[0]), a[1].plus(b[1])];
        planes.par_iter().map(of_plane).reduce(Default::default, add)
    }
}

/// A sum of squared errors, exact.
#[derive(Clone, Copy, Default)]
struct Squares {
    sum: u64,
    count: u64,
}

impl Squares {
    fn plus(self, other: Squares) -> Squares {
        Squares { sum: self.sum + other.sum, count: self.count + other.count }
    }
}

fn coord(extent: Extent, i: u64) -> [u32; 3] {
    let (x, y) = (u64::from(extent.x), u64::from(extent.y));
    [(i % x) as u32, (i / x % y) as u32, (i / x / y) as u32]
}
