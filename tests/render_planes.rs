//! Slices and cutting planes against rays, closed forms and the voxels themselves; on the GPU against the CPU.
#![cfg(feature = "gpu")]

mod render_support;

use render_support::*;
use vug::codec::zerobit::Stream;
use vug::error::Code;
use vug::gpu::key::Gradient;
use vug::gpu::{Lens, Sampler, Source, Traversal};
use vug::render::camera::CameraSpec;
use vug::render::scene::{ClipBox, Plane, Scene};
use vug::render::transfer::TransferFunction;
use vug::render::{Backend, Image, Renderer};
use vug::volume::{CodecChoice, EncodeOptions, Quality, Volume, ZerobitOptions};
use vug::{Extent, Grid};

/// Bricks of 16³ voxels.
fn zerobit(stream: Stream) -> EncodeOptions {
    EncodeOptions {
        codec: CodecChoice::Zerobit,
        quality: Quality::Keep(500_000),
        zerobit: ZerobitOptions { stream, ..Default::default() },
        brick: Some(16),
        ..Default::default()
    }
}

/// Peak signal to noise in front of black, components from 0 to 1.
fn psnr(a: &Image, b: &Image) -> f64 {
    let pairs = a.colours([0.0; 3]).flatten().zip(b.colours([0.0; 3]).flatten());
    let (sum, n) = pairs.fold((0.0, 0.0), |(s, n), (a, b)| (s + f64::from(a - b).powi(2), n + 1.0));
    -10.0 * (sum / n).log10()
}

/// From the front, a voxel of spacing 1 per pixel: pixel centres are voxel centres.
fn facing(axis: usize, extent: Extent) -> (CameraSpec, [u32; 2]) {
    let n = extent.to_array();
    let middle = n.map(|n| (f64::from(n) - 1.0) / 2.0);
    let (across, upward) = ([1, 0, 0][axis], [2, 2, 1][axis]);
    let mut eye = middle;
    eye[axis] -= 100.0;
    let mut up = [0.0; 3];
    up[upward] = 1.0;
    let camera = CameraSpec {
        lens: Lens::Orthographic,
        height: Some(n[upward].into()),
        eye: Some(eye),
        target: Some(middle),
        up: Some(up),
        ..Default::default()
    };
    (camera, [n[across], n[upward]])
}

/// Grey of a value from 0 to 255, opaque.
fn grey() -> TransferFunction {
    TransferFunction::new(vec![point(0.0, [0.0; 3], 1.0), point(255.0, [1.0; 3], 1.0)]).unwrap()
}

fn cut(volume: &Volume, transfer: TransferFunction, size: [u32; 2], plane: Plane) -> Scene {
    Scene { traversal: Traversal::CutPlane, plane: Some(plane), ..plain(volume, transfer, size) }
}

#[test] // hard case: R-22; S-22
fn slices_and_rays_make_the_same_picture() {
    let extent = Extent::new(40, 33, 37);
    let volume = encoded(&mut hill_u8(extent), s3dc(4, [4, 4, 4]));
    for lens in LENSES {
        for (what, change) in [("plain", None), ("lit", Some(0)), ("clipped", Some(1))] {
            let mut rays = plain(&volume, fog(), [64, 56]);
            rays.camera.lens = lens;
            match change {
                Some(0) => rays = lit(&rays, Gradient::Reuse),
                Some(_) => rays.clip = Some(ClipBox { min: [5.3, -1.0, 9.0], max: [31.0, 20.2, 60.0] }),
                None => {}
            }
            let slices = Scene { traversal: Traversal::Slice, ..rays.clone() };
            let (of_rays, of_slices) =
                (picture(&rays, &volume, &Backend::Cpu), picture(&slices, &volume, &Backend::Cpu));
            assert_seen(&of_rays, what);
            let found = psnr(&of_rays, &of_slices);
            println!("{lens}, {what}: {found:.1} dB");
            assert!(found >= 45.0, "{lens}, {what}: {found} dB");
            // The mirror in f32 is the same but for rounding.
            assert_close(&picture(&slices, &volume, &Backend::CpuF32), &of_slices, 2.0 / 255.0, what);
        }
    }
}

#[test]
fn slices_of_a_constant_field_are_the_closed_form() {
    let extent = Extent::new(24, 18, 15);
    let volume = encoded(&mut Grid::from_fn(extent, |_| 100u8).unwrap(), raw());
    let alpha = 0.04f32;
    let even = TransferFunction::new(vec![point(0.0, [0.3, 0.6, 0.9], alpha)]).unwrap();
    for step in [0.5, 0.7, 1.0, 3.1] {
        let mut scene = plain(&volume, even.clone(), [1, 1]);
        (scene.camera, scene.size) = facing(2, extent);
        (scene.step, scene.traversal) = (step, Traversal::Slice);
        let due = 1.0 - (1.0 - f64::from(alpha)).powi(15);
        for p in picture(&scene, &volume, &Backend::Cpu).pixels {
            assert!((f64::from(p[3]) - due).abs() < 1e-6, "step {step}: {} for {due}", p[3]);
            assert!((f64::from(p[0]) - 0.3 * due).abs() < 1e-6, "step {step}");
        }
    }
}

#[test] // hard case: R-24
fn planes_through_voxel_centres_show_the_voxels() {
    let extent = Extent::new(21, 14, 18);
    let noise = |c: [u32; 3]| (c[0] * 71 + c[1] * 113 + c[2] * 53 + c[0] * c[1] * c[2] * 7) as u8;
    let volume = encoded(&mut Grid::from_fn(extent, noise).unwrap(), raw());
    for axis in 0..3 {
        let (camera, size) = facing(axis, extent);
        for sampler in [Sampler::Nearest, Sampler::Linear] {
            for at in [0, 7, extent.to_array()[axis] - 1] {
                let mut point = [3.0; 3];
                point[axis] = at.into();
                let mut normal = [0.0; 3];
                normal[axis] = -2.5;
                let scene =
                    Scene { camera: camera.clone(), sampler, ..cut(&volume, grey(), size, Plane { point, normal }) };
                let renderer = Renderer::new(scene, vec![volume.clone()], Backend::Cpu, &|_, _, _| {}).unwrap();
                let image = renderer.picture(&|_, _, _| {}).unwrap().image;
                let (right, up) = (renderer.plan().view.right, renderer.plan().view.up);
                for y in 0..size[1] {
                    for x in 0..size[0] {
                        let film =
                            [f64::from(x) - f64::from(size[0] - 1) / 2.0, f64::from(size[1] - 1) / 2.0 - f64::from(y)];
                        let c: [u32; 3] = std::array::from_fn(|a| {
                            let middle = f64::from(extent.to_array()[a] - 1) / 2.0;
                            if a == axis { at } else { (middle + film[0] * right[a] + film[1] * up[a]) as u32 }
                        });
                        let found = image.pixels[(x + y * size[0]) as usize];
                        let due = (f64::from(noise(c)) * (1.0 / 255.0)) as f32;
                        assert_eq!(found, [due, due, due, 1.0], "axis {axis}, {sampler}, {c:?}");
                    }
                }
            }
        }
    }
}

#[test] // hard case: R-24
fn planes_that_miss_show_nothing_and_no_plane_is_an_error() {
    let extent = Extent::new(21, 14, 18);
    let volume = encoded(&mut hill_u8(extent), raw());
    let (camera, size) = facing(2, extent);
    let scene = |point: [f64; 3], normal: [f64; 3]| Scene {
        camera: camera.clone(),
        ..cut(&volume, grey(), size, Plane { point, normal })
    };
    // Beyond the volume, behind the eye, along the rays.
    for (point, normal) in
        [([0.0, 0.0, 18.0], [0.0, 0.0, 1.0]), ([0.0, 0.0, -500.0], [0.0, 0.1, 1.0]), ([5.0, 5.0, 5.0], [0.0, 1.0, 0.0])]
    {
        for backend in [Backend::Cpu, Backend::CpuF32] {
            let image = picture(&scene(point, normal), &volume, &backend);
            assert!(image.pixels.iter().all(|p| *p == [0.0; 4]), "{point:?} {normal:?}");
        }
    }
    let none = Renderer::new(scene([0.0; 3], [0.0; 3]), vec![volume.clone()], Backend::Cpu, &|_, _, _| {});
    assert_eq!(none.err().map(|e| e.code()), Some(Code::Param));
}

#[test]
fn planes_of_any_orientation_lie_where_they_should() {
    // A linear field is what trilinear sampling gives exactly: f = 3x + 5y + 2z of voxel indices.
    let extent = Extent::new(24, 18, 15);
    let mut grid = Grid::from_fn(extent, |c| (3 * c[0] + 5 * c[1] + 2 * c[2]) as f32).unwrap();
    let (spacing, origin) = ([1.0, 0.5, 2.0], [100.0, -20.0, 7.0]);
    let options = EncodeOptions { placement: spaced(spacing, origin), ..raw() };
    let volume = encoded(&mut grid, options);
    let plane = Plane { point: [112.0, -16.0, 21.0], normal: [0.3, -1.0, 0.7] };
    for lens in LENSES {
        let mut scene = cut(&volume, grey(), [40, 30], plane);
        scene.camera.lens = lens;
        let renderer = Renderer::new(scene, vec![volume.clone()], Backend::Cpu, &|_, _, _| {}).unwrap();
        let image = renderer.picture(&|_, _, _| {}).unwrap().image;
        assert_seen(&image, lens.name());
        let view = &renderer.plan().view;
        for (i, pixel) in image.pixels.iter().enumerate().filter(|(_, p)| p[3] > 0.0) {
            let [u, v] = view.film((i % 40) as f64, (i / 40) as f64);
            let turn = |f: f64| -> [f64; 3] {
                std::array::from_fn(|a| f * view.forward[a] + u * view.right[a] + v * view.up[a])
            };
            let (from, toward) = match lens {
                Lens::Perspective => (view.eye, turn(1.0)),
                Lens::Orthographic => (std::array::from_fn(|a| view.eye[a] + turn(0.0)[a]), view.forward),
            };
            let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let t = (dot(plane.normal, plane.point) - dot(plane.normal, from)) / dot(plane.normal, toward);
            let index: [f64; 3] = std::array::from_fn(|a| {
                let last = f64::from(extent.to_array()[a] - 1);
                ((from[a] + t * toward[a] - origin[a]) / spacing[a]).clamp(0.0, last)
            });
            let due = dot(index, [3.0, 5.0, 2.0]) / 255.0;
            assert!((f64::from(pixel[1]) - due).abs() < 1e-5, "{lens}, pixel {i}: {} for {due}", pixel[1]);
        }
    }
}

#[test] // S-22
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn the_gpu_slices_and_cuts_as_the_cpu_does() {
    let gpu = Backend::Gpu(gpu(), None);
    let extent = Extent::new(40, 33, 37);
    let plane = Plane { point: [20.0, 16.0, 18.0], normal: [0.3, -1.0, 0.7] };
    for (options, what) in [(raw(), "raw"), (s3dc(4, [4, 4, 4]), "s3dc"), (zerobit(Stream::New), "zerobit")] {
        let volume = encoded(&mut hill_u8(extent), options);
        for lens in LENSES {
            let mut scene = lit(&plain(&volume, fog(), [56, 48]), Gradient::Naive);
            scene.camera.lens = lens;
            scene.clip = Some(ClipBox { min: [5.3, -1.0, 9.0], max: [31.0, 30.2, 60.0] });
            scene.traversal = Traversal::Slice;
            let mut cuts = cut(&volume, fog(), [56, 48], plane);
            cuts.camera.lens = lens;
            for scene in [scene, cuts] {
                let what = format!("{what} {lens} {}", scene.traversal);
                let mirror = picture(&scene, &volume, &Backend::CpuF32);
                assert_seen(&mirror, &what);
                assert_close(&picture(&scene, &volume, &gpu), &mirror, 2.0 / 255.0, &what);
            }
        }
    }
}

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn rays_through_zerobit_streams_are_rays_through_their_voxels() {
    let gpu = Backend::Gpu(gpu(), None);
    let extent = Extent::new(40, 33, 37);
    let colours = Grid::from_fn(extent, |c| {
        let v = hill(extent, c) as u8;
        [v, 255 - v, (c[0] * 5) as u8]
    });
    for (what, mut grid) in [("u8", hill_u8(extent)), ("rgb8", colours.unwrap())] {
        for stream in [Stream::New, Stream::Old] {
            let volume = encoded(&mut grid, zerobit(stream));
            for sampler in [Sampler::Nearest, Sampler::Linear] {
                let mut scene = plain(&volume, fog(), [48, 40]);
                scene.sampler = sampler;
                let what = format!("{what} {} {sampler}", stream.name());
                let streams = picture(&scene, &volume, &gpu);
                assert_seen(&streams, &what);
                assert_close(&streams, &picture(&scene, &volume, &Backend::CpuF32), 2.0 / 255.0, &what);
                for source in [Source::Decoded, Source::Deferred] {
                    let scene = Scene { source, ..scene.clone() };
                    assert_close(&streams, &picture(&scene, &volume, &gpu), 1e-5, &format!("{what} {source}"));
                }
            }
        }
    }
}
