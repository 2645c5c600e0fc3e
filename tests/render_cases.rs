//! Hard cases of rays: where the numbers of a renderer break. All on the CPU: no adapter is needed (hard case: R-30).
#![cfg(feature = "gpu")]

mod render_support;

use render_support::*;
use std::sync::Arc;
use vug::gpu::key::Gradient;
use vug::gpu::{Lens, Projection, Sampler};
use vug::render::mirror::{self, clip_ray};
use vug::render::scene::{Scene, Shading};
use vug::render::transfer::TransferFunction;
use vug::render::{Backend, Image};
use vug::volume::Volume;
use vug::{Code, Extent, Grid};

fn constant(extent: Extent, value: u8, spacing: [f64; 3]) -> Arc<Volume> {
    let mut options = s3dc(4, [4, 4, 4]);
    options.placement = spaced(spacing, [0.0; 3]);
    encoded(&mut Grid::from_fn(extent, |_| value).unwrap(), options)
}

/// Every value has this opacity.
fn veil(alpha: f32) -> TransferFunction {
    TransferFunction::new(vec![point(0.0, [1.0, 0.5, 0.25], alpha)]).unwrap()
}

/// Straight onto a face: rays parallel to an axis, one unit of the world apart.
fn onto(mut scene: Scene, azimuth: f64, elevation: f64) -> Scene {
    scene.camera.lens = Lens::Orthographic;
    (scene.camera.azimuth, scene.camera.elevation) = (azimuth, elevation);
    scene
}

fn middle(image: &Image) -> [f32; 4] {
    image.pixels[(image.height / 2 * image.width + image.width / 2) as usize]
}

fn finite(image: &Image, what: &str) {
    assert!(image.pixels.iter().flatten().all(|v| v.is_finite() && (0.0..=1.000_001).contains(v)), "{what}");
}

const CPUS: [Backend; 2] = [Backend::Cpu, Backend::CpuF32];

#[test] // hard case: R-01; the closed form of a constant field, M-08
fn rays_along_axes_through_a_constant_field_are_its_closed_form() {
    let volume = constant(Extent::new(24, 20, 28), 77, [1.0, 2.0, 0.5]);
    // Seen along y, x and z; the length of the way through it, in reference lengths of 0.5.
    for (azimuth, elevation, length) in [
        (0.0, 0.0, 40.0),
        (90.0, 0.0, 24.0),
        (180.0, 0.0, 40.0),
        (270.0, 0.0, 24.0),
        (0.0, 90.0, 14.0),
        (0.0, -90.0, 14.0),
    ] {
        for step in [0.1, 0.5, 1.0, 0.77, 3.0, 1000.0] {
            for alpha in [0.01f32, 0.2, 1e-6, 1.0] {
                let mut scene = onto(plain(&volume, veil(alpha), [5, 5]), azimuth, elevation);
                scene.step = step;
                let exact = if alpha == 1.0 { 1.0 } else { -f64::exp_m1(length / 0.5 * f64::ln_1p(-f64::from(alpha))) };
                for backend in &CPUS {
                    let image = picture(&scene, &volume, backend);
                    finite(&image, "constant");
                    let found = f64::from(middle(&image)[3]);
                    assert!(
                        (found - exact).abs() <= 2e-4 * exact + 1e-9,
                        "{backend:?} {azimuth} {elevation} step {step} α {alpha}: {found} {exact}"
                    );
                }
            }
        }
    }
    // Directions that are zero of either sign: inside at the lower face, outside at the upper one.
    for zero in [0.0f64, -0.0] {
        let within = |o: f64| clip_ray([o, 0.5, -5.0], [zero, zero, 1.0], [0.0; 3], [1.0; 3], [0.0, 1e9]);
        assert_eq!((within(0.0), within(0.5)), ([5.0, 6.0], [5.0, 6.0]));
        for o in [1.0, -0.1, 2.0] {
            let [a, b] = within(o);
            assert!(a > b, "{o}");
        }
    }
}

#[test] // hard case; brick layout and threads do not change the image
fn faces_edges_and_corners_of_bricks_are_not_seen() {
    let extent = Extent::new(64, 64, 64);
    let images = |bricks: u32, azimuth: f64, elevation: f64, lens: Lens| {
        let options = vug::volume::EncodeOptions { brick: Some(bricks), ..s3dc(4, [4, 4, 4]) };
        let volume = encoded(&mut hill_u8(extent), options);
        let mut scene = onto(lit(&plain(&volume, fog(), [33, 33]), Gradient::Reuse), azimuth, elevation);
        (scene.camera.lens, scene.empty_skip, scene.tf_cull) = (lens, true, true);
        picture(&scene, &volume, &Backend::Cpu)
    };
    for (azimuth, elevation) in [(0.0, 0.0), (45.0, 0.0), (45.0, 35.264_389_682_754_654), (90.0, 45.0)] {
        for lens in LENSES {
            let one = images(64, azimuth, elevation, lens);
            assert_seen(&one, "hill");
            for bricks in [16, 32] {
                assert_close(
                    &images(bricks, azimuth, elevation, lens),
                    &one,
                    0.0,
                    &format!("bricks of {bricks}, {azimuth} {elevation}"),
                );
            }
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            assert_close(&pool.install(|| images(16, azimuth, elevation, lens)), &one, 0.0, "one thread");
            // Turned by almost nothing, almost nothing changes.
            let beside = images(16, azimuth + 1e-7, elevation - 1e-7, lens);
            assert_close(&beside, &one, 1e-3, &format!("turned, {azimuth} {elevation} {lens}"));
        }
    }
}

#[test] // hard case: R-03
fn a_camera_inside_sees_what_is_before_it() {
    let volume = constant(Extent::cube(33), 100, [1.0; 3]);
    for eye in [[16.0, 16.0, 16.0], [16.5, 16.5, 16.5], [-0.5, 16.0, 16.0], [32.0, 0.0, 32.0]] {
        let mut scene = plain(&volume, veil(0.05), [9, 9]);
        (scene.camera.eye, scene.camera.target) = (Some(eye), Some([40.0, 16.25, 16.125]));
        for backend in &CPUS {
            let image = picture(&scene, &volume, backend);
            finite(&image, "inside");
            assert!(middle(&image)[3] > 0.0, "{eye:?}");
        }
        // Straight ahead from the middle: half of the volume.
        if eye == [16.0, 16.0, 16.0] {
            scene.camera.target = Some([40.0, 16.0, 16.0]);
            let exact = -f64::exp_m1(16.5 * f64::ln_1p(-f64::from(0.05f32)));
            let found = f64::from(middle(&picture(&scene, &volume, &Backend::Cpu))[3]);
            assert!((found - exact).abs() < 1e-5, "{found} {exact}");
        }
    }
}

#[test] // hard case: R-05; a sample that hides all ends the ray with exactly 1
fn opaque_samples_hide_all() {
    let volume = constant(Extent::cube(16), 100, [1.0; 3]);
    for backend in &CPUS {
        assert_eq!(middle(&picture(&plain(&volume, veil(1.0), [3, 3]), &volume, backend))[3], 1.0);
        assert_eq!(middle(&picture(&plain(&volume, veil(0.0), [3, 3]), &volume, backend)), [0.0; 4]);
    }
}

#[test] // hard case: R-07
fn steps_that_cannot_be_are_refused() {
    let volume = constant(Extent::cube(16), 100, [1.0; 3]);
    let plan = |step: f64| {
        let mut scene = plain(&volume, veil(0.1), [3, 3]);
        scene.step = step;
        vug::render::plan::Plan::new(&scene, &[&volume], &vug::gpu::level::Fit::host(None))
            .map(|p| p.samples)
            .map_err(|e| e.code())
    };
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(plan(step), Err(Code::Param), "{step}");
    }
    assert_eq!(plan(1e-7), Err(Code::Limit));
    assert!(plan(1e6).unwrap() <= 2 && plan(1e300).unwrap() <= 2);
    // Longer than f32 holds: one sample all the same.
    for backend in &CPUS {
        let mut scene = plain(&volume, veil(0.5), [3, 3]);
        scene.step = 1e39;
        assert!(middle(&picture(&scene, &volume, backend))[3] > 0.99);
    }
}

#[test] // hard case: R-08
fn finer_steps_converge() {
    let volume = encoded(&mut hill_u8(Extent::cube(40)), raw());
    let image = |step: f64| {
        let mut scene = plain(&volume, fog(), [24, 24]);
        scene.step = step;
        picture(&scene, &volume, &Backend::Cpu)
    };
    let fine = image(0.01);
    let errors: Vec<f64> = [0.8, 0.4, 0.2]
        .map(|h| {
            let other = image(h);
            let squares =
                fine.pixels.iter().flatten().zip(other.pixels.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2));
            squares.sum::<f64>().sqrt()
        })
        .to_vec();
    println!("errors at steps of 0.8, 0.4 and 0.2 voxels: {errors:?}");
    assert!(errors[1] <= 0.6 * errors[0] && errors[2] <= 0.6 * errors[1], "{errors:?}");
}

#[test] // hard case: R-09
fn ending_rays_early_changes_nothing_that_eight_bits_show() {
    let volume = encoded(&mut hill_u8(Extent::cube(40)), s3dc(4, [4, 4, 4]));
    let whole = plain(&volume, fog(), [48, 48]);
    let mut early = whole.clone();
    early.early_out = Some(1.0 / 1024.0);
    for backend in &CPUS {
        let (a, b) = (
            rendered(&whole, std::slice::from_ref(&volume), backend),
            rendered(&early, std::slice::from_ref(&volume), backend),
        );
        let (x, y) = (a.image.over([1.0; 3]), b.image.over([1.0; 3]));
        assert!(x.iter().flatten().zip(y.iter().flatten()).all(|(a, b)| a.abs_diff(*b) <= 1));
        assert!(b.work.unwrap().samples < a.work.unwrap().samples);
    }
    finite(&picture(&early, &volume, &Backend::CpuF32), "early");
}

#[test] // hard case: R-10
fn a_hundred_thousand_faint_samples_add_up() {
    let volume = constant(Extent::new(10, 10, 10), 9, [1.0; 3]);
    let mut scene = onto(plain(&volume, veil(0.01), [1, 1]), 0.0, 0.0);
    scene.step = 1e-4;
    let exact = 1.0 - (1.0f64 - f64::from(0.01f32)).powi(10);
    for backend in &CPUS {
        let done = rendered(&scene, std::slice::from_ref(&volume), backend);
        assert!(done.work.unwrap().samples >= 100_000);
        let found = f64::from(middle(&done.image)[3]);
        assert!((found / exact - 1.0).abs() < 1e-3, "{backend:?}: {found} {exact}");
    }
}

#[test] // hard case: R-11
fn sample_a_million_lies_where_it_should() {
    // A wall of one voxel at the far end of a long ray, and a step that f32 cannot hold: places that drift miss it.
    let wall = |c: [u32; 3]| if c[1] == 0 { 200u8 } else { 0 };
    let mut grid = Grid::from_fn(Extent::new(4, 4000, 4), wall).unwrap();
    let volume = encoded(&mut grid, raw());
    let ramp = TransferFunction::new(vec![point(0.0, [0.0; 3], 0.0), point(200.0, [1.0; 3], 0.004)]).unwrap();
    // From the side where the wall is last, with a million samples.
    let found: Vec<f64> = CPUS
        .iter()
        .map(|backend| {
            let mut scene = onto(plain(&volume, ramp.clone(), [1, 1]), 0.0, 0.0);
            (scene.step, scene.sampler) = (0.004, Sampler::Nearest);
            let there = middle(&picture(&scene, &volume, backend))[3];
            scene.camera.azimuth = 180.0;
            let back = middle(&picture(&scene, &volume, backend))[3];
            assert!((there - back).abs() < 2e-3 * there, "{backend:?}: {there} from one side, {back} from the other");
            f64::from(there)
        })
        .collect();
    // One voxel thick, 250 samples of a 250th of a reference length.
    assert!(found.iter().all(|f| (f / 0.004 - 1.0).abs() < 0.02), "{found:?}");
}

#[test] // hard case: R-12
fn without_a_gradient_there_is_no_light() {
    let volume = constant(Extent::cube(16), 100, [1.0; 3]);
    let scene = plain(&volume, veil(0.2), [9, 9]);
    for gradient in [Gradient::Naive, Gradient::Reuse] {
        for backend in &CPUS {
            assert_close(
                &picture(&lit(&scene, gradient), &volume, backend),
                &picture(&scene, &volume, backend),
                0.0,
                "flat",
            );
        }
    }
}

#[test] // hard case: R-13
fn normals_are_those_of_the_world() {
    for (spacing, low) in [([1.0f64, 1.0, 10.0], 20.0f64), ([1.0, 1.0, 1e6], 1.0), ([1e-3, 1e-3, 1e-3], 20.0)] {
        // A ramp along x and z together, as steep in the world along both.
        let rise = |c: [u32; 3]| {
            low + f64::from(c[0]) * spacing[0].min(1.0) / spacing[0]
                + f64::from(c[2]) * (spacing[2] / spacing[0]).min(10.0)
        };
        let mut grid = Grid::from_fn(Extent::new(24, 24, 8), |c| rise(c) as f32).unwrap();
        let mut options = raw();
        options.placement = spaced(spacing, [0.0; 3]);
        let volume = encoded(&mut grid, options);
        let mut scene = onto(plain(&volume, veil(1.0), [7, 7]), 0.0, 90.0);
        scene.shading =
            Some(Shading { ambient: 0.0, diffuse: 1.0, specular: 0.0, shininess: 1.0, gradient: Gradient::Naive });
        scene.step = if spacing[2] > 1e3 { 100.0 } else { 0.5 };
        // The gradient in the world, inside of the volume; the camera looks along z.
        let g = [rise([9, 0, 3]) - rise([8, 0, 3]), rise([8, 0, 4]) - rise([8, 0, 3])];
        let world = [g[0] / spacing[0], g[1] / spacing[2]];
        let facing = world[1] / world[0].hypot(world[1]);
        // A slab in the middle is the first that is seen: the clipping box cuts the outer voxels off.
        let (lo, hi) = (spacing[2] * 2.0, spacing[2] * 5.0);
        scene.clip = Some(vug::render::scene::ClipBox { min: [-1e9, -1e9, lo], max: [1e9, 1e9, hi] });
        for backend in &CPUS {
            let found = f64::from(middle(&picture(&scene, &volume, backend))[0]);
            assert!((found - facing).abs() < 2e-3, "{spacing:?} {backend:?}: {found} {facing}");
        }
    }
}

/// A hill in one corner: most bricks are empty.
fn sparse() -> Arc<Volume> {
    let inner = Extent::cube(30);
    let corner = |c: [u32; 3]| if c.iter().all(|&v| v < 30) { hill(inner, c) as u8 } else { 0 };
    encoded(&mut Grid::from_fn(Extent::new(96, 80, 64), corner).unwrap(), s3dc(4, [4, 4, 4]))
}

#[test] // hard case: R-17
fn skipping_and_culling_change_no_bit() {
    let volume = sparse();
    for projection in [Projection::Composite, Projection::Iso] {
        for sampler in [Sampler::Nearest, Sampler::Linear, Sampler::LinearOpt] {
            for (azimuth, elevation, step) in
                [(30.0, 15.0, 0.5), (0.0, 0.0, 0.3), (225.0, -60.0, 2.5), (90.0, 90.0, 7.0), (17.0, 3.0, 21.0)]
            {
                let mut scene = lit(&plain(&volume, fog(), [40, 40]), Gradient::Reuse);
                (scene.camera.azimuth, scene.camera.elevation, scene.step) = (azimuth, elevation, step);
                (scene.projection, scene.sampler) = (projection, sampler);
                scene.iso = (projection == Projection::Iso).then_some(90.0);
                let mut fast = scene.clone();
                (fast.empty_skip, fast.tf_cull) = (true, true);
                for backend in &CPUS {
                    let (a, b) = (
                        rendered(&scene, std::slice::from_ref(&volume), backend),
                        rendered(&fast, std::slice::from_ref(&volume), backend),
                    );
                    assert_close(&a.image, &b.image, 0.0, &format!("{projection} {sampler} {azimuth} step {step}"));
                    let (a, b) = (a.work.unwrap(), b.work.unwrap());
                    assert!(b.samples * 3 < a.samples * 2 || step > 5.0, "{} of {} samples", b.samples, a.samples);
                }
            }
        }
    }
}

/// What is not in memory reads as 0; here 0 would be opaque.
#[test] // hard case: R-17
fn bricks_that_are_not_there_are_never_sampled() {
    let inner = Extent::cube(30);
    let corner = |c: [u32; 3]| if c.iter().all(|&v| v < 30) { 100 + (hill(inner, c) / 2.0) as u8 } else { 40 };
    let make = |origin: [f64; 3]| {
        let options = vug::volume::EncodeOptions { placement: spaced([1.0; 3], origin), ..s3dc(4, [4, 4, 4]) };
        encoded(&mut Grid::from_fn(Extent::new(112, 96, 80), corner).unwrap(), options)
    };
    let volumes = [make([0.0; 3]), make([20.0, -30.0, 10.0])];
    let ends = [(0.0, 1.0), (20.0, 1.0), (30.0, 0.0), (60.0, 0.0), (120.0, 0.05), (200.0, 0.6)];
    let transfer = TransferFunction::new(ends.map(|(v, a)| point(v, [1.0, a, v as f32 / 200.0], a)).to_vec()).unwrap();
    for count in [1, 2] {
        for shading in [None, Some(Shading::default())] {
            for (projection, iso) in
                [(Projection::Composite, None), (Projection::Iso, Some(150.0)), (Projection::Iso, Some(-3.0))]
            {
                if iso.is_some() && count > 1 {
                    continue;
                }
                let mut scene = plain(&volumes[0], transfer.clone(), [40, 40]);
                (scene.shading, scene.projection, scene.iso) = (shading, projection, iso);
                scene.volumes.resize(count, scene.volumes[0].clone());
                let mut fast = scene.clone();
                (fast.empty_skip, fast.tf_cull) = (true, true);
                for backend in &CPUS {
                    let (a, b) =
                        (rendered(&scene, &volumes[..count], backend), rendered(&fast, &volumes[..count], backend));
                    assert!(a.image.pixels.iter().any(|p| p[3] > 0.1));
                    assert_close(
                        &b.image,
                        &a.image,
                        0.0,
                        &format!("{count} volumes, {projection} {iso:?}, lit: {}", shading.is_some()),
                    );
                }
            }
        }
    }
    // A solid that begins where rays enter has a lid, cut by the box or by the clipping box.
    let solid = constant(Extent::cube(64), 100, [1.0; 3]);
    for clip in [None, Some(vug::render::scene::ClipBox { min: [20.0; 3], max: [50.0; 3] })] {
        let mut scene = plain(&solid, veil(0.5), [9, 9]);
        (scene.projection, scene.iso, scene.clip) = (Projection::Iso, Some(50.0), clip);
        (scene.empty_skip, scene.tf_cull) = (true, true);
        assert_eq!(middle(&picture(&scene, &solid, &Backend::Cpu))[3], 1.0);
    }
    // Without skipping there is no culling, and slices do not skip.
    let mut scene = plain(&solid, veil(0.5), [9, 9]);
    scene.tf_cull = true;
    assert_eq!(scene.check().unwrap_err().code(), Code::Param);
    (scene.empty_skip, scene.traversal) = (true, vug::gpu::Traversal::Slice);
    assert_eq!(scene.check().unwrap_err().code(), Code::Param);
}

#[test] // hard case: R-19
fn a_peak_that_a_brick_only_touches_is_seen() {
    // 100 is the largest value of one brick, and all that the transfer function shows.
    let mut grid = Grid::from_fn(Extent::cube(48), |c| if c == [20, 21, 22] { 100u8 } else { 3 }).unwrap();
    let volume = encoded(&mut grid, raw());
    let peak = TransferFunction::new(vec![
        point(99.0, [1.0; 3], 0.0),
        point(100.0, [1.0; 3], 1.0),
        point(101.0, [1.0; 3], 0.0),
    ])
    .unwrap();
    let mut scene = plain(&volume, peak, [97, 97]);
    (scene.sampler, scene.step) = (Sampler::Nearest, 0.2);
    let all = picture(&scene, &volume, &Backend::Cpu);
    (scene.empty_skip, scene.tf_cull) = (true, true);
    let fast = rendered(&scene, std::slice::from_ref(&volume), &Backend::Cpu);
    assert!(all.pixels.iter().any(|p| p[3] > 0.5));
    assert_close(&fast.image, &all, 0.0, "peak");
}

#[test] // hard case: R-23
fn surfaces_at_voxels_on_plateaus_and_in_passing() {
    // A plateau of exactly 100 behind a slope from 0; seen along x.
    let mut grid = Grid::from_fn(Extent::new(32, 16, 16), |c| (c[0] * 10).min(100) as u8).unwrap();
    let volume = encoded(&mut grid, raw());
    let show = |iso: f64, elevation: f64, backend: &Backend| {
        let mut scene = onto(plain(&volume, veil(0.5), [9, 9]), 270.0, elevation);
        (scene.projection, scene.iso, scene.step) = (Projection::Iso, Some(iso), 0.37);
        middle(&picture(&scene, &volume, backend))
    };
    for backend in &CPUS {
        // At the plateau's own value it is met; just above there is nothing; far below it is met where the ray enters.
        for elevation in [0.0, 30.0] {
            assert_eq!(show(100.0, elevation, backend)[3], 1.0);
            assert_eq!(show(100.000_1, elevation, backend)[3], 0.0);
            assert_eq!(show(-1.0, elevation, backend)[3], 1.0);
        }
    }
    // Where: the colour tells the value at the place that was found.
    let ramp = TransferFunction::new(vec![point(0.0, [0.0; 3], 1.0), point(100.0, [1.0; 3], 1.0)]).unwrap();
    let mut scene = onto(plain(&volume, ramp, [9, 9]), 270.0, 0.0);
    (scene.projection, scene.iso, scene.step) = (Projection::Iso, Some(40.0), 0.9);
    let found = middle(&picture(&scene, &volume, &Backend::Cpu))[0];
    // Eight halvings of a step of 0.9 voxels, along which the value rises by 9.
    assert!((found - 0.4).abs() < 0.09 / 256.0 + 1e-6 && found >= 0.4, "{found}");
}

#[test] // hard case: R-27
fn between_two_steps_of_time() {
    let volume = series_of(Extent::cube(24), 3, |_, t| 50 + 60 * t as u8);
    let ramp = TransferFunction::new(vec![point(0.0, [0.0; 3], 1.0), point(200.0, [1.0; 3], 1.0)]).unwrap();
    let at = |time: f64, interpolated: bool| {
        let mut scene = plain(&volume, ramp.clone(), [5, 5]);
        (scene.volumes[0].time, scene.time_interp) = (time, interpolated);
        CPUS.map(|b| middle(&picture(&scene, &volume, &b))[0])
    };
    for t in 0..3 {
        assert_eq!(at(f64::from(t), true), at(f64::from(t), false));
    }
    for found in at(1.25, true) {
        assert!((f64::from(found) - (110.0 + 15.0) / 200.0).abs() < 1e-6, "{found}");
    }
    let mut scene = plain(&volume, ramp, [5, 5]);
    (scene.volumes[0].time, scene.time_interp) = (2.5, true);
    let plan = vug::render::plan::Plan::new(&scene, &[&volume], &vug::gpu::level::Fit::host(None));
    assert_eq!(plan.unwrap_err().code(), Code::Range, "there is no step behind the last");
}

#[test] // many volumes in one world: the order of samples is that of depth, not of the scene
fn volumes_side_by_side() {
    let one = constant(Extent::cube(16), 100, [1.0; 3]);
    let mut options = s3dc(4, [4, 4, 4]);
    options.placement = spaced([1.0; 3], [0.0, 40.0, 0.0]);
    let two = encoded(&mut Grid::from_fn(Extent::cube(16), |_| 100u8).unwrap(), options);
    let red = TransferFunction::new(vec![point(0.0, [1.0, 0.0, 0.0], 0.3)]).unwrap();
    let blue = TransferFunction::new(vec![point(0.0, [0.0, 0.0, 1.0], 1.0)]).unwrap();
    let show = |azimuth: f64| {
        let mut scene = onto(plain(&one, red.clone(), [9, 9]), azimuth, 0.0);
        let mut second = scene.volumes[0].clone();
        second.transfer = blue.clone();
        scene.volumes.push(second);
        CPUS.map(|b| middle(&rendered(&scene, &[one.clone(), two.clone()], &b).image))
    };
    let through = 1.0 - 0.7f32.powi(16);
    // Nothing is known of the space: the front looks along −y, so that from 0° the volume at y = 0 is before the one at y = 40.
    for (near, far) in show(0.0).into_iter().zip(show(180.0)) {
        assert!((near[0] - through).abs() < 1e-3 && (near[2] - (1.0 - through)).abs() < 1e-3, "{near:?}");
        assert_eq!(far[..3], [0.0, 0.0, 1.0], "the opaque one in front hides the other");
    }
}

#[test] // hard case: D-57
fn far_from_the_origin_nothing_shakes() {
    let mut options = s3dc(4, [4, 4, 4]);
    options.placement = spaced([1e-6; 3], [1e9, -1e9, 1e9]);
    let far = encoded(&mut hill_u8(Extent::cube(32)), options);
    let near = encoded(&mut hill_u8(Extent::cube(32)), s3dc(4, [4, 4, 4]));
    let show = |v: &Arc<Volume>| picture(&plain(v, fog(), [48, 48]), v, &Backend::CpuF32);
    let (a, b) = (show(&far), show(&near));
    assert_seen(&b, "near");
    assert_close(&a, &b, 0.02, "far");
    assert!(mirror::points_top(5) == 4 && mirror::points_top(1) == 0);
}
