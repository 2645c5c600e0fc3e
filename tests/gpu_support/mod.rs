//! Helpers of the tests on a GPU. They need an adapter: software will do (Mesa's lavapipe).
#![allow(dead_code, reason = "each test binary uses its own part")]

use std::io::Cursor;
use std::sync::OnceLock;
use vug::gpu::level::{HostLevel, LevelLayout};
use vug::gpu::{AdapterChoice, Gpu, GpuLevel};
use vug::limits::Limits;
use vug::source::MemorySource;
use vug::volume::{self, CodecChoice, EncodeOptions, Quality, Volume};
use vug::voxel::Sample;
use vug::{Extent, Grid};

/// The adapter that there is.
pub fn gpu() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| {
        let gpu =
            Gpu::open(&AdapterChoice::default()).expect("a GPU adapter; build with skip-gpu-tests where there is none");
        println!("{gpu:?}");
        gpu
    })
}

/// Bricks of 16³, all levels.
pub fn options(codec: CodecChoice, index_bits: u8, block: [u32; 3]) -> EncodeOptions {
    let quality = match codec {
        CodecChoice::S3dc => Quality::Explicit { index_bits, block: block.into() },
        CodecChoice::Zerobit => Quality::Keep(400_000),
        _ => EncodeOptions::default().quality,
    };
    EncodeOptions { codec, quality, brick: Some(16), levels: 0, ..EncodeOptions::default() }
}

pub fn encoded<T: Sample>(extent: Extent, options: &EncodeOptions, f: impl FnMut([u32; 3]) -> T) -> Volume {
    let mut file = Cursor::new(Vec::new());
    volume::encode(&mut Grid::from_fn(extent, f).unwrap(), &mut file, options, &mut |_, _| {}).unwrap();
    Volume::open(MemorySource(file.into_inner()), Limits::default()).unwrap()
}

/// Noise for 40 planes, a constant up to plane 64, nothing behind: STORED, CONSTANT and EMPTY bricks.
pub fn part(c: [u32; 3], noise: impl Fn(u32) -> f32) -> f32 {
    match c[2] {
        0..40 => noise(super::support::hash(c)),
        40..64 => 7.0,
        _ => 0.0,
    }
}

/// The same scene in all scalar types.
pub fn of_all_types(extent: Extent, o: &EncodeOptions) -> [Volume; 4] {
    [
        encoded(extent, o, |c| part(c, |h| (h % 256) as f32) as u8),
        encoded(extent, o, |c| part(c, |h| (h % 65536) as f32) as u16),
        encoded(extent, o, |c| part(c, |h| (h % 65536) as f32 - 32768.0) as i16),
        encoded(extent, o, |c| part(c, |h| h as f32 / 3e9 - 0.5)),
    ]
}

pub fn host(volume: &Volume, layout: LevelLayout) -> HostLevel {
    HostLevel::load(volume, layout, &|_| true, &mut |_, _| {}).unwrap()
}

pub fn upload(volume: &Volume, layout: LevelLayout) -> GpuLevel {
    GpuLevel::upload(gpu(), volume, layout, &|_| true, &mut |_, _| {}).unwrap()
}
