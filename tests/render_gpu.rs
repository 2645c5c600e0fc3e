//! The GPU's pictures are the mirror's: the same fetches, the same numbers in the same order.
#![cfg(feature = "gpu")]

mod render_support;

use render_support::*;
use vug::gpu::key::Gradient;
use vug::gpu::{Projection, Sampler, Source};
use vug::render::Backend;
use vug::render::scene::Scene;
use vug::render::transfer::TransferFunction;
use vug::{Extent, Grid};

/// What f32 in another order of exp, pow and contraction may change of a picture; most pixels are equal to the bit.
const CLOSE: f32 = 2.0 / 255.0;

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn s3dc_and_raw_by_every_sampler_projection_and_lens() {
    let gpu = Backend::Gpu(gpu(), None);
    let extent = Extent::new(40, 33, 37);
    let u8s = hill_u8(extent);
    let u16s = Grid::from_fn(extent, |c| (hill(extent, c) * 100.0) as u16).unwrap();
    let i16s = Grid::from_fn(extent, |c| (hill(extent, c) * 100.0) as i16 - 9000).unwrap();
    let f32s = Grid::from_fn(extent, |c| hill(extent, c) as f32 / 7.0).unwrap();
    for (name, mut grid, scale, shift) in
        [("u8", u8s, 1.0, 0.0), ("u16", u16s, 100.0, 0.0), ("i16", i16s, 100.0, -9000.0), ("f32", f32s, 1.0 / 7.0, 0.0)]
    {
        for (codec, what) in [(raw(), "raw"), (s3dc(4, [4, 4, 4]), "s3dc")] {
            let volume = encoded(&mut grid, codec);
            let points = fog().points().iter().map(|p| point(p.value * scale + shift, p.color, p.alpha)).collect();
            let base = plain(&volume, TransferFunction::new(points).unwrap(), [48, 40]);
            for sampler in [Sampler::Nearest, Sampler::Linear, Sampler::LinearOpt] {
                for lens in LENSES {
                    for projection in PROJECTIONS {
                        let mut scene = base.clone();
                        (scene.sampler, scene.camera.lens, scene.projection) = (sampler, lens, projection);
                        scene.iso = (projection == Projection::Iso).then_some(120.0 * scale + shift);
                        if matches!(projection, Projection::Iso | Projection::Composite) {
                            scene = lit(&scene, if lens == LENSES[0] { Gradient::Reuse } else { Gradient::Naive });
                        }
                        if matches!(projection, Projection::Minimum | Projection::Mean) {
                            // Everything is seen: rays end where nothing is.
                            let ends = [(shift, 0.3), (220.0 * scale + shift, 0.9)];
                            let ramp = ends.map(|(v, a)| point(v, [a, 1.0 - a, 0.5], a)).to_vec();
                            scene.volumes[0].transfer = TransferFunction::new(ramp).unwrap();
                        }
                        let what = format!("{name} {what} {sampler} {lens} {projection}");
                        let on_gpu = picture(&scene, &volume, &gpu);
                        let mirror = picture(&scene, &volume, &Backend::CpuF32);
                        assert_seen(&mirror, &what);
                        assert_close(&on_gpu, &mirror, CLOSE, &what);
                        let same = on_gpu.pixels.iter().zip(&mirror.pixels).filter(|(a, b)| a == b).count();
                        println!("{what}: {same} of {} pixels equal to the bit", mirror.pixels.len());
                    }
                }
            }
        }
    }
}

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn decoded_on_the_way_or_before_it_is_the_same_volume() {
    let gpu = Backend::Gpu(gpu(), None);
    let extent = Extent::new(40, 33, 37);
    let volume = encoded(&mut hill_u8(extent), s3dc(4, [4, 4, 4]));
    let base = lit(&plain(&volume, fog(), [64, 64]), Gradient::Naive);
    let direct = picture(&base, &volume, &gpu);
    assert_seen(&direct, "direct");
    for source in [Source::Deferred, Source::Decoded] {
        let mut scene = base.clone();
        scene.source = source;
        assert_close(&picture(&scene, &volume, &gpu), &direct, 0.0, source.name());
        scene.sampler = Sampler::HwLinear;
        // hard case: R-29. 8-bit fractions: off by range/256 per axis at most.
        let filtered = picture(&scene, &volume, &gpu);
        let off = filtered.max_difference(&direct).unwrap();
        println!("{source}, hardware trilinear: off by {off}");
        assert!(off < 0.2, "{source}: {off}");
    }
}

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn light_from_blocks_of_every_kind_and_many_control_points() {
    let gpu = Backend::Gpu(gpu(), None);
    let mut grid = hill_u8(Extent::new(40, 33, 37));
    // One to eight points are looked at in turn, more by halving.
    let ramp = |n: u32| {
        let at = |i: u32| f64::from(i) / f64::from(n - 1);
        let all =
            (0..n).map(|i| point(20.0 + 180.0 * at(i), [at(i) as f32, (i % 3) as f32 / 2.0, 0.5], 0.3 * at(i) as f32));
        TransferFunction::new(all.collect()).unwrap()
    };
    for (bits, block, points) in [(4, [16; 3], 2), (8, [3, 5, 4], 8), (2, [2, 2, 2], 9), (1, [4, 8, 16], 20)] {
        let volume = encoded(&mut grid, s3dc(bits, block));
        let mut scene = lit(&plain(&volume, ramp(points), [48, 40]), Gradient::Reuse);
        scene.sampler = Sampler::LinearOpt;
        let what = format!("{bits} bits, {block:?}, {points} points");
        let (on_gpu, mirror) = (picture(&scene, &volume, &gpu), picture(&scene, &volume, &Backend::CpuF32));
        assert_seen(&mirror, &what);
        assert_close(&on_gpu, &mirror, CLOSE, &what);
        // The same image without saving fetches.
        let naive = lit(&scene, Gradient::Naive);
        assert_eq!(
            picture(&Scene { sampler: Sampler::Linear, ..naive }, &volume, &Backend::CpuF32).pixels,
            mirror.pixels
        );
    }
}
