//! What pictures cost, as ratios of frame times on one adapter in one run: samplers, light, skipping, against uncompressed textures.
//!
//! `cargo bench --bench render` renders the CT head of `VUG_DATA` (or `../shared/data`), else a synthetic phantom, 512×512 pixels, one
//! sample every half voxel. `VUG_ADAPTER` names an adapter; `VUG_PIXELS` another width.

use std::path::PathBuf;
use std::sync::Arc;
use vug::gpu::key::Gradient;
use vug::gpu::{AdapterChoice, Gpu, Sampler, Source};
use vug::grid::SlabReader;
use vug::render::scene::{Lod, Scene, Shading};
use vug::render::transfer::{Point, TransferFunction};
use vug::render::{Backend, Renderer};
use vug::source::MemorySource;
use vug::volume::{self, CodecChoice, EncodeOptions, Quality, Volume};
use vug::{Extent, Grid};

fn head() -> (Box<dyn SlabReader>, &'static str) {
    let dir = std::env::var_os("VUG_DATA").map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
    let file = dir.join("ct_visiblehuman_head_u8.nrrd");
    #[cfg(feature = "convert")]
    if let Ok(import) = vug::convert::import(&file, &vug::convert::ImportOptions::default()) {
        return (import.reader, "CT head of the Visible Human, u8");
    }
    let n = 256;
    let ball = |c: [u32; 3]| c.iter().map(|&v| (f64::from(v) - 127.5).powi(2)).sum::<f64>().sqrt();
    let skull = |c| match ball(c) {
        r if r < 70.0 => 90.0 + (r * 0.7).sin() * 20.0,
        r if r < 80.0 => 200.0,
        r if r < 85.0 => 110.0,
        _ => 4.0,
    };
    (Box::new(Grid::from_fn(Extent::cube(n), |c| skull(c) as u8).expect("a phantom")), "synthetic phantom of balls, u8")
}

fn encoded(brick: u32, codec: CodecChoice) -> Arc<Volume> {
    let quality = Quality::Explicit { index_bits: 4, block: Extent::cube(16) };
    let options = EncodeOptions { codec, quality, brick: Some(brick), ..Default::default() };
    let mut file = std::io::Cursor::new(Vec::new());
    volume::encode(&mut *head().0, &mut file, &options, &mut |_, _| {}).expect("encodes");
    Arc::new(Volume::open(MemorySource(file.into_inner()), Default::default()).expect("opens"))
}

fn main() {
    let choice = AdapterChoice { name: std::env::var("VUG_ADAPTER").ok(), ..Default::default() };
    let gpu = match Gpu::open(&choice) {
        Ok(gpu) => Arc::new(gpu),
        Err(e) => return println!("nothing measured: {e}"),
    };
    let pixels = std::env::var("VUG_PIXELS").ok().and_then(|v| v.parse().ok()).unwrap_or(512);
    let data = head().1;
    let s3dc = encoded(64, CodecChoice::S3dc);
    let fine = encoded(16, CodecChoice::S3dc);
    println!(
        "{data}, {}; {pixels}×{pixels} pixels on {}",
        s3dc.info().dims,
        vug::gpu::device::describe(&gpu.adapter_info)
    );
    let point = |value, v: f32, alpha| Point { value, color: [v, v * 0.9, v * 0.8], alpha };
    let bone = TransferFunction::new(vec![point(100.0, 0.7, 0.0), point(150.0, 0.9, 0.4), point(255.0, 1.0, 0.9)])
        .expect("ascends");
    let fog = TransferFunction::new(vec![point(0.0, 0.2, 0.002), point(80.0, 0.6, 0.01), point(255.0, 1.0, 0.05)])
        .expect("ascends");
    let base = |volume: &Volume, transfer: &TransferFunction| {
        let mut scene = Scene::of(volume).expect("a scene");
        scene.volumes[0].transfer = transfer.clone();
        scene.volumes[0].seen.clear(); // the same camera for all
        scene.size = [pixels; 2];
        scene.camera.zoom = 1.8;
        (scene.lod, scene.shading, scene.empty_skip, scene.tf_cull, scene.early_out) =
            (Lod::Level(0), None, false, false, None);
        scene
    };
    let sampled = |sampler, source| Scene { sampler, source, ..base(&s3dc, &fog) };
    let lit = |scene: Scene, gradient| Scene { shading: Some(Shading { gradient, ..Default::default() }), ..scene };
    let bones = |skip| Scene { empty_skip: skip, tf_cull: skip, ..base(&fine, &bone) };
    let linear_opt = || sampled(Sampler::LinearOpt, Source::Direct);
    let rungs: Vec<(&str, Scene, &Arc<Volume>)> = vec![
        ("s3dc nearest", sampled(Sampler::Nearest, Source::Direct), &s3dc),
        ("s3dc linear", sampled(Sampler::Linear, Source::Direct), &s3dc),
        ("s3dc linear_opt", linear_opt(), &s3dc),
        ("raw nearest", sampled(Sampler::Nearest, Source::Decoded), &s3dc),
        ("raw linear", sampled(Sampler::Linear, Source::Decoded), &s3dc),
        ("raw hw_linear", sampled(Sampler::HwLinear, Source::Decoded), &s3dc),
        ("deferred hw_linear", sampled(Sampler::HwLinear, Source::Deferred), &s3dc),
        ("s3dc linear_opt, lit naive", lit(linear_opt(), Gradient::Naive), &s3dc),
        ("s3dc linear_opt, lit reuse", lit(linear_opt(), Gradient::Reuse), &s3dc),
        ("bone, every sample", bones(false), &fine),
        ("bone, empty space skipped", bones(true), &fine),
    ];
    let renderers: Vec<_> = rungs
        .into_iter()
        .filter_map(|(name, scene, volume)| {
            match Renderer::new(scene, vec![volume.clone()], Backend::Gpu(gpu.clone(), None), &|_, _, _| {}) {
                Ok(renderer) => Some((name, renderer)),
                Err(e) => {
                    println!("{name}: left out, {e}");
                    None
                }
            }
        })
        .collect();
    // Interleaved rounds: what else the machine does falls on all alike.
    let rounds = std::env::var("VUG_ROUNDS").ok().and_then(|v| v.parse().ok()).unwrap_or(5);
    let mut times = vec![Vec::new(); renderers.len()];
    for round in 0..=rounds {
        for ((_, renderer), times) in renderers.iter().zip(&mut times) {
            let frame = renderer.picture(&|_, _, _| {}).expect("renders");
            if round > 0 {
                times.push(frame.passes.iter().map(|p| p.milliseconds).sum::<f64>());
            }
        }
    }
    let mut medians = std::collections::BTreeMap::new();
    for ((name, _), times) in renderers.iter().zip(&mut times) {
        times.sort_by(f64::total_cmp);
        let median = times[times.len() / 2];
        println!("{name:<28} {median:>10.2} ms");
        medians.insert(*name, median);
    }
    for (what, slow, fast, goal) in [
        ("linear / linear_opt", "s3dc linear", "s3dc linear_opt", "≥ 1.8"),
        ("s3dc nearest / raw nearest", "s3dc nearest", "raw nearest", "≤ 1.5"),
        ("lit (reuse) / not lit", "s3dc linear_opt, lit reuse", "s3dc linear_opt", "≥ 3"),
        ("lit naive / lit reuse", "s3dc linear_opt, lit naive", "s3dc linear_opt, lit reuse", ""),
        ("every sample / skipped", "bone, every sample", "bone, empty space skipped", "≥ 2"),
        ("linear_opt / raw hw_linear", "s3dc linear_opt", "raw hw_linear", "≤ 3 on a real GPU"),
    ] {
        if let (Some(slow), Some(fast)) = (medians.get(slow), medians.get(fast)) {
            println!("{what:<28} {:>10.2}    {goal}", slow / fast);
        }
    }
}
