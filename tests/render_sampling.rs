//! Values between voxels: what is fetched, exactly, and that nothing is lost at borders.
#![cfg(feature = "gpu")]

mod render_support;

use render_support::*;
use std::sync::Arc;
use vug::gpu::key::Gradient;
use vug::gpu::level::{Fit, HostLevel};
use vug::gpu::{Effect, Sampler};
use vug::render::mirror::{self, Real, Value, Work, grey};
use vug::render::plan::Plan;
use vug::render::scene::Scene;
use vug::render::setup::{Lies, frame};
use vug::volume::{At, EncodeOptions, Volume};
use vug::{Extent, Grid};

/// A level in memory and what the mirror needs to sample it.
struct Sampled {
    scene: Scene,
    plan: Plan,
    level: HostLevel,
}

impl Sampled {
    fn of(volume: &Arc<Volume>, sampler: Sampler, gradient: Gradient) -> Sampled {
        Sampled::within(volume, sampler, gradient, &Fit::host(None))
    }

    fn within(volume: &Arc<Volume>, sampler: Sampler, gradient: Gradient, fit: &Fit) -> Sampled {
        let mut scene = lit(&plain(volume, fog(), [8, 8]), gradient);
        scene.sampler = sampler;
        let plan = Plan::new(&scene, &[volume], fit).unwrap();
        let level = HostLevel::load(volume, plan.levels[0].layout.clone(), &|_| true, &mut |_, _| {}).unwrap();
        Sampled { scene, plan, level }
    }

    fn with<R: Real, T>(&self, f: impl FnOnce(&mirror::Frame<R>, &mirror::Volume<'_, R>) -> T) -> T {
        let lies = Lies::of(&self.plan.levels[0], &self.plan.view, self.plan.step).unwrap();
        let frame = frame(&self.plan, &self.scene, &self.plan.view, &[lies]);
        f(&frame, &lies.volume(&self.level, &[], &self.scene.volumes[0].transfer))
    }

    fn value<R: Real>(&self, p: [R; 3]) -> (R, Work) {
        self.with(|frame, v| {
            let mut n = Work::default();
            (grey(mirror::sample(frame, v, p, &mut n)), n)
        })
    }
}

/// Places inside of a volume, spread evenly and off all grids.
fn places(extent: Extent, count: u32) -> impl Iterator<Item = [f64; 3]> {
    let n = extent.to_array().map(f64::from);
    (0..count).map(move |i| {
        let r = |k: f64| (f64::from(i) * k).fract();
        [
            2.0 + r(0.754_877_666) * (n[0] - 6.0),
            2.0 + r(0.569_840_290) * (n[1] - 6.0),
            2.0 + r(0.438_447_187) * (n[2] - 6.0),
        ]
    })
}

fn noise(extent: Extent) -> Grid {
    let hash =
        |c: [u32; 3]| c[0].wrapping_mul(2_654_435_761) ^ c[1].wrapping_mul(40_503) ^ c[2].wrapping_mul(2_246_822_519);
    Grid::from_fn(extent, |c| (hash(c) >> 13) as u16).unwrap()
}

fn encoded_noise(extent: Extent, options: EncodeOptions) -> Arc<Volume> {
    encoded(&mut noise(extent), options)
}

#[test] // hard case: K-21
fn voxels_are_met_exactly_at_their_centres_and_continued_outside() {
    let extent = Extent::new(19, 17, 21);
    for options in [raw(), s3dc(4, [4, 4, 4]), s3dc(2, [3, 5, 2])] {
        let volume = encoded_noise(extent, options);
        for sampler in [Sampler::Nearest, Sampler::Linear, Sampler::LinearOpt] {
            let sampled = Sampled::of(&volume, sampler, Gradient::Naive);
            for z in [0, 7, 15, 16, 20] {
                for y in [0, 3, 4, 16] {
                    for x in 0..19u32 {
                        let exact = volume.voxel(At::default(), [x, y, z]).unwrap().component(0);
                        let p = [x, y, z].map(f64::from);
                        assert_eq!(sampled.value::<f64>(p).0, exact, "{sampler} {p:?}");
                        let p = [x, y, z].map(|v| v as f32);
                        assert_eq!(f64::from(sampled.value::<f32>(p).0), exact);
                        // One unit in the last place beside: no jump.
                        for beside in [p.map(f32::next_up), p.map(f32::next_down)] {
                            assert!((f64::from(sampled.value(beside).0) - exact).abs() < 1.0, "{sampler} {beside:?}");
                        }
                    }
                }
            }
            for (outside, inside) in
                [([-3.0, -0.5, 400.0], [0, 0, 20]), ([18.5, 16.5, 20.5], [18, 16, 20]), ([1e9, -1e9, 7.0], [18, 0, 7])]
            {
                let exact = volume.voxel(At::default(), inside).unwrap().component(0);
                assert_eq!(sampled.value::<f64>(outside).0, exact, "{sampler} {outside:?}");
            }
        }
    }
}

#[test] // hard case: K-22
fn across_a_border_of_blocks_a_value_lies_between_its_corners() {
    // Blocks of two: all of one block small, all of the next large.
    let mut grid = Grid::from_fn(
        Extent::cube(16),
        |c| if (c[0] / 2 + c[1] / 2 + c[2] / 2) % 2 == 0 { 10 + c[0] } else { 60_000 + c[1] } as u16,
    )
    .unwrap();
    let volume = encoded(&mut grid, s3dc(4, [2, 2, 2]));
    let sampled = Sampled::of(&volume, Sampler::LinearOpt, Gradient::Naive);
    for p in places(Extent::cube(16), 500) {
        let corners: Vec<f64> = (0..8)
            .map(|i| {
                let c = std::array::from_fn(|a| p[a].floor() as u32 + (i >> a & 1));
                volume.voxel(At::default(), c).unwrap().component(0)
            })
            .collect();
        let (lo, hi) = corners.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        let wide = sampled.value::<f64>(p).0;
        let narrow = f64::from(sampled.value::<f32>(p.map(|v| v as f32)).0);
        assert!((lo..=hi).contains(&wide) && (lo..=hi).contains(&narrow), "{p:?}: {wide} {narrow} of {lo} to {hi}");
    }
}

#[test] // S-24, S-25, S-27
fn plain_samples_and_gradients_fetch_what_the_paper_says() {
    let volume = encoded_noise(Extent::cube(32), s3dc(4, [4, 4, 4]));
    for (sampler, value, gradient) in [(Sampler::Nearest, 2, 12), (Sampler::Linear, 16, 96)] {
        let sampled = Sampled::of(&volume, sampler, Gradient::Naive);
        for p in places(Extent::cube(32), 50) {
            assert_eq!(sampled.value::<f32>(p.map(|v| v as f32)).1.fetches(), value);
            let n = sampled.with::<f64, _>(|frame, v| {
                let mut n = Work::default();
                mirror::slope(frame, std::slice::from_ref(v), p, &mut n);
                n
            });
            assert_eq!((n.fetches(), n.samples, n.gradients), (gradient, 6, 1), "{sampler}");
        }
    }
}

#[test] // hard case: K-23; V24
fn saving_fetches_changes_no_bit() {
    let extent = Extent::new(80, 72, 76);
    for (bits, block, due) in [(4, 16, 6.2), (4, 4, 6.95), (4, 2, 8.38), (2, 8, 5.92), (1, 4, 6.2), (8, 16, 7.2)] {
        let volume = encoded_noise(extent, s3dc(bits, [block; 3]));
        let linear = Sampled::of(&volume, Sampler::Linear, Gradient::Naive);
        let opt = Sampled::of(&volume, Sampler::LinearOpt, Gradient::Reuse);
        let (mut sum, mut squares, count) = (0.0, 0.0, 4000);
        let (mut fetched, mut most) = (0.0, 0);
        for p in places(extent, count) {
            let narrow = p.map(|v| v as f32);
            let ((a, _), (b, n)) = (linear.value(narrow), opt.value(narrow));
            assert_eq!(a.to_bits(), b.to_bits(), "{bits} bits, block {block}, {p:?}");
            assert_eq!(linear.value(p).0.to_bits(), opt.value(p).0.to_bits());
            assert!((5..=16).contains(&n.fetches()));
            sum += n.fetches() as f64;
            squares += (n.fetches() as f64).powi(2);
            let slope = |s: &Sampled| {
                s.with::<f32, _>(|frame, v| {
                    let mut n = Work::default();
                    (mirror::slope(frame, std::slice::from_ref(v), narrow, &mut n), n.fetches())
                })
            };
            let ((g, plain), (h, reused)) = (slope(&linear), slope(&opt));
            assert_eq!(g.map(f32::to_bits), h.map(f32::to_bits), "gradient, {bits} bits, block {block}, {p:?}");
            assert_eq!(plain, 96);
            fetched += reused as f64;
            most = most.max(reused);
        }
        let mean = sum / f64::from(count);
        let deviation = ((squares / f64::from(count) - mean * mean) / f64::from(count)).sqrt();
        println!(
            "{bits} bits, block {block}³: {mean:.2} fetches a sample ({due} expected), {:.1} a gradient, {most} at most",
            fetched / f64::from(count)
        );
        assert!((mean - due).abs() <= 3.0 * deviation + 0.01, "{mean} ± {deviation}, {due} expected");
        assert!(most <= 64, "{most}");
        let gradient = [(4, 16, 18.6), (8, 16, 23.6)].iter().find(|g| (g.0, g.1) == (bits, block));
        assert!(gradient.is_none_or(|g| (fetched / f64::from(count) - g.2).abs() < 0.5));
    }
}

#[test] // hard case: D-59
fn in_levels_laid_in_tiles_too() {
    let extent = Extent::new(70, 20, 90);
    // Textures of 64 texels a side: bricks beside one another may lie one above the other.
    let fit = Fit { max_3d: 64, ..Fit::host(None) };
    for (bits, block) in [(4, [4, 4, 4]), (4, [16; 3]), (2, [3, 5, 2]), (4, [2, 2, 2])] {
        let volume = encoded_noise(extent, s3dc(bits, block));
        let linear = Sampled::of(&volume, Sampler::Linear, Gradient::Naive);
        let opt = Sampled::within(&volume, Sampler::LinearOpt, Gradient::Reuse, &fit);
        assert!(!opt.plan.levels[0].layout.fold.is_flat());
        for p in places(extent, 3000) {
            let p = p.map(|v| v as f32);
            assert_eq!(linear.value(p).0.to_bits(), opt.value(p).0.to_bits(), "{bits} bits, {block:?}, {p:?}");
            let slope = |s: &Sampled| {
                s.with::<f32, _>(|frame, v| mirror::slope(frame, std::slice::from_ref(v), p, &mut Work::default()))
            };
            assert_eq!(slope(&linear).map(f32::to_bits), slope(&opt).map(f32::to_bits));
        }
    }
}

#[test] // fetches at a place outside of any scene's default: effects are in no sample
fn uncompressed_volumes_fetch_one_texel_a_voxel() {
    let volume = encoded_noise(Extent::cube(20), raw());
    for (sampler, due) in [(Sampler::Nearest, 1), (Sampler::Linear, 8), (Sampler::LinearOpt, 8)] {
        let sampled = Sampled::of(&volume, sampler, Gradient::Naive);
        let (value, n) = sampled.value::<f64>([3.25, 4.5, 5.75]);
        assert_eq!((n.raw_fetches, n.fetches()), (due, due));
        assert!(matches!(Value::Scalar(value), Value::Scalar(v) if v.is_finite()));
        assert!(sampled.plan.key.effects.has(Effect::GradientShading));
    }
}
