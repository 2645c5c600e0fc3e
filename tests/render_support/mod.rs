//! Volumes in memory and scenes of them, for tests of pictures. All data is synthetic.
#![allow(dead_code, reason = "each test file uses its part")]

use std::io::Cursor;
use std::sync::Arc;
use vug::affine::Placement;
use vug::gpu::key::Gradient;
use vug::gpu::{AdapterChoice, Gpu, Lens, Projection, Sampler};
use vug::render::scene::{Lod, Scene, Shading};
use vug::render::transfer::{Point, TransferFunction};
use vug::render::{Backend, Image, Rendered, Renderer};
use vug::source::MemorySource;
use vug::volume::{self, CodecChoice, EncodeOptions, Quality, Volume};
use vug::{Extent, Grid};

pub fn raw() -> EncodeOptions {
    EncodeOptions { codec: CodecChoice::Raw, brick: Some(16), ..Default::default() }
}

/// Bricks of 16³ voxels.
pub fn s3dc(index_bits: u8, block: [u32; 3]) -> EncodeOptions {
    let block = Extent::new(block[0], block[1], block[2]);
    EncodeOptions {
        codec: CodecChoice::S3dc,
        quality: Quality::Explicit { index_bits, block },
        brick: Some(16),
        ..Default::default()
    }
}

pub fn encoded(grid: &mut Grid, options: EncodeOptions) -> Arc<Volume> {
    let mut file = Cursor::new(Vec::new());
    volume::encode(grid, &mut file, &options, &mut |_, _| {}).unwrap();
    Arc::new(Volume::open(MemorySource(file.into_inner()), Default::default()).unwrap())
}

/// A smooth hill with a ripple, from 0 to about 220; part of the volume is exactly 0.
pub fn hill(extent: Extent, c: [u32; 3]) -> f64 {
    let n = extent.to_array().map(|n| f64::from(n.max(2)) - 1.0);
    let p: [f64; 3] = std::array::from_fn(|a| 2.0 * f64::from(c[a]) / n[a] - 1.0);
    let r2 = p.iter().map(|v| v * v).sum::<f64>();
    if r2 > 0.8 {
        0.0
    } else {
        200.0 * (1.0 - r2 / 0.8) + 10.0 * (1.0 + (9.0 * p[0]).sin() * (7.0 * p[1] + p[2]).cos())
    }
}

pub fn hill_u8(extent: Extent) -> Grid {
    Grid::from_fn(extent, |c| hill(extent, c) as u8).unwrap()
}

pub fn point(value: f64, color: [f32; 3], alpha: f32) -> Point {
    Point { value, color, alpha }
}

/// Nothing below 20, then coloured fog, then an opaque core.
pub fn fog() -> TransferFunction {
    TransferFunction::new(vec![
        point(20.0, [0.1, 0.2, 0.9], 0.0),
        point(100.0, [0.2, 0.8, 0.3], 0.05),
        point(180.0, [0.9, 0.4, 0.1], 0.3),
        point(220.0, [1.0, 0.9, 0.8], 0.9),
    ])
    .unwrap()
}

/// A scene of one volume with no effect at all: linear sampling of level 0, rays through every step.
pub fn plain(volume: &Volume, transfer: TransferFunction, size: [u32; 2]) -> Scene {
    let mut scene = Scene::of(volume).unwrap();
    scene.volumes[0].transfer = transfer;
    // The same camera for all codecs and brick layouts: it frames the box.
    scene.volumes[0].seen.clear();
    scene.size = size;
    scene.sampler = Sampler::Linear;
    scene.early_out = None;
    scene.empty_skip = false;
    scene.tf_cull = false;
    scene.shading = None;
    scene.lod = Lod::Level(0);
    scene
}

pub fn lit(scene: &Scene, gradient: Gradient) -> Scene {
    Scene { shading: Some(Shading { gradient, ..Default::default() }), ..scene.clone() }
}

pub fn rendered(scene: &Scene, volumes: &[Arc<Volume>], backend: &Backend) -> Rendered {
    let renderer = Renderer::new(scene.clone(), volumes.to_vec(), backend.clone(), &|_, _, _| {}).unwrap();
    renderer.picture(&|_, _, _| {}).unwrap()
}

pub fn picture(scene: &Scene, volume: &Arc<Volume>, backend: &Backend) -> Image {
    rendered(scene, std::slice::from_ref(volume), backend).image
}

/// The software adapter that golden numbers hold for; any adapter where `VUG_ADAPTER` names one.
pub fn gpu() -> Arc<Gpu> {
    let choice = match std::env::var("VUG_ADAPTER") {
        Ok(name) => AdapterChoice { name: Some(name), ..Default::default() },
        Err(_) => AdapterChoice::default(),
    };
    Arc::new(Gpu::open(&choice).unwrap_or_else(|e| {
        panic!("{e}; without any adapter run the tests with --features skip-gpu-tests, which shows them as ignored")
    }))
}

pub fn assert_close(a: &Image, b: &Image, most: f32, what: &str) {
    let difference = a.max_difference(b).unwrap();
    assert!(difference <= most, "{what}: {difference} > {most}");
}

/// Whether anything is to be seen at all: a test of equal black pictures shows nothing.
pub fn assert_seen(image: &Image, what: &str) {
    let seen = image.pixels.iter().filter(|p| p[3] > 0.1).count();
    assert!(seen * 20 > image.pixels.len(), "{what}: {seen} of {} pixels", image.pixels.len());
}

pub fn spaced(spacing: [f64; 3], origin: [f64; 3]) -> Placement {
    Placement::from_spacing(spacing, origin)
}

pub const LENSES: [Lens; 2] = [Lens::Perspective, Lens::Orthographic];
pub const PROJECTIONS: [Projection; 5] =
    [Projection::Composite, Projection::Maximum, Projection::Minimum, Projection::Mean, Projection::Iso];

/// A series of `steps` volumes of u8 in bricks of 16³, s3dc.
pub fn series_of(extent: Extent, steps: u32, f: impl Fn([u32; 3], u32) -> u8) -> Arc<Volume> {
    use vug::codec::{
        Codec,
        s3dc::{Endpoints, Params},
    };
    use vug::volume::{At, Shape, VolumeWriter};
    let codec = Codec::S3dc(Params::new(4, Extent::cube(4), Endpoints::MinMax).unwrap());
    let shape = Shape { time_steps: steps, ..Shape::single(extent, vug::SampleType::U8) };
    let mut file = Cursor::new(Vec::new());
    let mut writer = VolumeWriter::create(&mut file, shape, codec, 4, &EncodeOptions::default()).unwrap();
    for time in 0..steps {
        let grid = Grid::from_fn(extent, |c| f(c, time)).unwrap();
        for z in 0..extent.z.div_ceil(16) {
            for y in 0..extent.y.div_ceil(16) {
                for x in 0..extent.x.div_ceil(16) {
                    let start = [x, y, z].map(|v| v * 16);
                    let region = vug::Region::at(start, Extent::cube(16)).intersect(&vug::Region::whole(extent));
                    writer.write_brick(At { time, ..At::default() }, [x, y, z], grid.view().sub(&region)).unwrap();
                }
            }
        }
    }
    writer.finish().unwrap();
    Arc::new(Volume::open(MemorySource(file.into_inner()), Default::default()).unwrap())
}
