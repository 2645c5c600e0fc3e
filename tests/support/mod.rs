//! What several test files share: synthetic volumes, encoding to memory, the folder of real volumes.
#![allow(dead_code, reason = "every test binary uses its own part")]

use std::io::Cursor;
use std::path::PathBuf;
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{self, EncodeOptions, EncodeReport, Quality, Volume};
use vug::voxel::Sample;
use vug::{Extent, Grid};

/// A 32-bit hash of a position: deterministic noise.
pub fn hash(c: [u32; 3]) -> u32 {
    let mut h = c[0].wrapping_mul(0x9E37_79B1) ^ c[1].wrapping_mul(0x85EB_CA77) ^ c[2].wrapping_mul(0xC2B2_AE3D);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2C1B_3C6D);
    h ^= h >> 12;
    h.wrapping_mul(0x297A_2D39) ^ (h >> 15)
}

/// Synthetic: a ball with noise in an empty background, values 0 to 255.
pub fn ball(extent: Extent) -> Grid {
    Grid::from_fn(extent, |c| ball_at(extent, c)).unwrap()
}

pub fn ball_at(extent: Extent, c: [u32; 3]) -> u8 {
    let e = extent.to_array();
    let r2: f64 = (0..3).map(|a| ((f64::from(c[a]) + 0.5) / f64::from(e[a]) - 0.5).powi(2)).sum();
    if r2 > 0.16 { 0 } else { (60.0 + r2 * 900.0) as u8 + (hash(c) % 40) as u8 }
}

/// Synthetic: noise of any scalar type.
pub fn noise<T: Sample>(extent: Extent, mut f: impl FnMut(u32) -> T) -> Grid {
    Grid::from_fn(extent, |c| f(hash(c))).unwrap()
}

pub fn explicit(index_bits: u8, block: u32) -> EncodeOptions {
    EncodeOptions { quality: Quality::Explicit { index_bits, block: Extent::cube(block) }, ..EncodeOptions::default() }
}

pub fn encode(grid: &mut Grid, options: &EncodeOptions) -> (Vec<u8>, EncodeReport) {
    let mut file = Cursor::new(Vec::new());
    let report = volume::encode(grid, &mut file, options, &mut |_, _| {}).unwrap();
    (file.into_inner(), report)
}

pub fn open(bytes: Vec<u8>) -> Volume {
    Volume::open(MemorySource(bytes), Limits::default()).unwrap()
}

/// All errors of the strict validator.
pub fn verify(bytes: &[u8]) -> Vec<vug::Error> {
    volume::verify(&MemorySource(bytes), &Limits::default(), &mut |_, _| {}).errors
}

/// Folder of real volumes: `VUG_DATA`, else `../shared/data`; says so where there is none.
pub fn data() -> Option<PathBuf> {
    let dir = std::env::var_os("VUG_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    if dir.is_dir() {
        return Some(dir);
    }
    println!("skipped: no real volumes in {} (set VUG_DATA)", dir.display());
    None
}
