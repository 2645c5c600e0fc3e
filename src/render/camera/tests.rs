use super::matrix::dot;
use super::*;
use crate::error::Code;

fn placement() -> Placement {
    Placement::from_spacing([0.5, 0.5, 2.0], [10.0, -20.0, 30.0])
}

const EXTENT: Extent = Extent::new(100, 80, 40);

fn is_frame(v: &View) {
    for (a, b, want) in [
        (v.right, v.right, 1.0),
        (v.up, v.up, 1.0),
        (v.forward, v.forward, 1.0),
        (v.right, v.up, 0.0),
        (v.right, v.forward, 0.0),
        (v.up, v.forward, 0.0),
    ] {
        assert!((dot(a, b) - want).abs() < 1e-12, "{v:?}");
    }
}

/// Pixel coordinates of a world point, by the formula of the film.
fn on_film(v: &View, p: [f64; 3]) -> [f64; 2] {
    let d = sub(p, v.eye);
    let depth = if v.lens == Lens::Perspective { dot(d, v.forward) } else { 1.0 };
    let [w, h] = v.size.map(f64::from);
    [dot(d, v.right) / depth / v.pixel + w / 2.0 - 0.5, h / 2.0 - 0.5 - dot(d, v.up) / depth / v.pixel]
}

#[test]
fn all_of_the_volume_is_seen_from_everywhere() {
    let p = placement();
    for lens in [Lens::Perspective, Lens::Orthographic] {
        for size in [[100, 100], [300, 100], [90, 270], [1, 1]] {
            for (azimuth, elevation) in [(0.0, 0.0), (30.0, 15.0), (123.0, 90.0), (-70.0, -90.0), (360.0, 45.0)] {
                let spec = CameraSpec { lens, azimuth, elevation, ..CameraSpec::default() };
                let view = spec.resolve(&p, EXTENT, size).unwrap();
                is_frame(&view);
                let mut fullest = 0.0f64;
                for turn in 0..12 {
                    let view = view.turned(f64::from(turn) * std::f64::consts::TAU / 12.0);
                    for i in 0..8 {
                        let corner: [f64; 3] = std::array::from_fn(|a| {
                            let n = f64::from(EXTENT.to_array()[a]);
                            p.matrix[a][3] + p.matrix[a][a] * if i >> a & 1 == 1 { n - 0.5 } else { -0.5 }
                        });
                        let [x, y] = on_film(&view, corner);
                        let [w, h] = size.map(f64::from);
                        let (x, y) = ((x + 0.5) / w, (y + 0.5) / h);
                        assert!(x > 0.0 && y > 0.0 && x < 1.0 && y < 1.0, "{lens} {size:?} {x} {y}");
                        fullest = fullest.max(x).max(1.0 - x).max(y).max(1.0 - y);
                    }
                }
                assert!(fullest > 0.94, "and no smaller than need be: {fullest}");
            }
        }
    }
}

#[test]
fn front_left_and_up() {
    for (space, front, left) in [
        (Space::Lps, [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]),
        (Space::Ras, [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]),
        (Space::Las, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]),
        (Space::Unknown, [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]),
    ] {
        let p = Placement { space, ..placement() };
        let spec = CameraSpec { azimuth: 0.0, elevation: 0.0, ..CameraSpec::default() };
        let view = spec.resolve(&p, EXTENT, [10, 10]).unwrap();
        assert_eq!(view.forward, scaled(front, -1.0), "{space:?}");
        assert!(dot(view.right, left) > 0.999, "{space:?}: who is seen from the front has the left on the right");
        assert_eq!(view.up, [0.0, 0.0, 1.0]);
        let side = CameraSpec { azimuth: 90.0, ..spec }.resolve(&p, EXTENT, [10, 10]).unwrap();
        assert!(dot(side.forward, left) < -0.999, "{space:?}: 90 degrees look from the left");
    }
}

#[test] // hard case: R-14
fn degenerate_cameras() {
    let p = placement();
    let ok = CameraSpec::default();
    let refused = |spec: CameraSpec, size, code| {
        let e = spec.resolve(&p, EXTENT, size).unwrap_err();
        assert_eq!(e.code(), code, "{spec:?}: {e}");
    };
    for fov in [0.0, -10.0, 180.0, 360.0, f64::NAN, f64::INFINITY, 1e-310] {
        refused(CameraSpec { fov, ..ok.clone() }, [8, 8], Code::Param);
    }
    for (size, code) in [([0, 0], Code::Param), ([8, 0], Code::Param), ([MAX_SIDE + 1, 8], Code::Limit)] {
        refused(ok.clone(), size, code);
    }
    let eye = Some([35.0, -100.0, 69.0]);
    let target = Some([35.0, 0.0, 69.0]);
    refused(CameraSpec { eye, target, up: Some([0.0, 3.0, 0.0]), ..ok.clone() }, [8, 8], Code::Param); // up ∥ view
    refused(CameraSpec { eye, target: eye, ..ok.clone() }, [8, 8], Code::Param);
    refused(CameraSpec { up: Some([0.0; 3]), ..ok.clone() }, [8, 8], Code::Param);
    refused(CameraSpec { eye: Some([f64::NAN, 0.0, 0.0]), ..ok.clone() }, [8, 8], Code::Param);
    refused(CameraSpec { zoom: 0.0, ..ok.clone() }, [8, 8], Code::Param);
    refused(CameraSpec { elevation: 91.0, ..ok.clone() }, [8, 8], Code::Param);
    refused(CameraSpec { height: Some(10.0), ..ok.clone() }, [8, 8], Code::Param);
    refused(CameraSpec { height: Some(0.0), lens: Lens::Orthographic, ..ok.clone() }, [8, 8], Code::Param);
    let broken = Placement { matrix: [[f64::NAN; 4]; 3], ..placement() };
    assert_eq!(ok.resolve(&broken, EXTENT, [8, 8]).unwrap_err().code(), Code::Param);
    // A picture of one pixel, and views straight down, are fine.
    is_frame(&ok.resolve(&p, EXTENT, [1, 1]).unwrap());
    let above = CameraSpec { eye: Some([34.0, -4.0, 500.0]), target: Some([34.0, -4.0, 0.0]), ..ok };
    is_frame(&above.resolve(&p, EXTENT, [8, 8]).unwrap());
}

#[test] // hard case: R-04
fn cameras_infinitely_far() {
    let p = placement();
    for far in [1e12, 1e100, 1e300] {
        let spec = CameraSpec { eye: Some([0.0, -far, 0.0]), target: Some([0.0; 3]), ..CameraSpec::default() };
        let view = spec.resolve(&p, EXTENT, [64, 64]).unwrap();
        is_frame(&view);
        let level = level_for(&view, &p, EXTENT, 4, 1.0).unwrap();
        assert_eq!(level.lod, 3, "{far}");
        assert!(view.rays_in(&p, EXTENT, 0).unwrap().focus.iter().all(|v| v.is_finite()), "{far}");
    }
    // Orthographic: by the height of the view, wherever the camera is.
    for far in [1.0, 1e300] {
        for (height, lod) in [(64.0 * 2.0, 0), (64.0 * 4.0, 1), (64.0 * 8.1, 2), (1e200, 3)] {
            let (eye, lens) = (Some([0.0, -far, 0.0]), Lens::Orthographic);
            let spec = CameraSpec { lens, eye, target: Some([0.0; 3]), height: Some(height), ..CameraSpec::default() };
            let view = spec.resolve(&p, EXTENT, [64, 64]).unwrap();
            let level = level_for(&view, &p, EXTENT, 4, 1.0).unwrap();
            assert_eq!(level.lod, lod, "{far} {height}: {}", level.reason);
        }
    }
}

#[test] // hard case: R-32
fn levels_near_within_and_without_numbers() {
    let p = placement();
    let spec = CameraSpec::default();
    let view = spec.resolve(&p, EXTENT, [64, 64]).unwrap();
    let radius = radius(&p, EXTENT);
    let at = |distance: f64| View { from_center: scaled(view.forward, -distance), ..view.clone() };
    // d = 0 on the sphere, d < 0 within, and a camera that is nowhere.
    for distance in [radius, radius / 2.0, 0.0, f64::NAN] {
        assert_eq!(level_for(&at(distance), &p, EXTENT, 8, 1.0).unwrap().lod, 0, "{distance}");
    }
    // Beyond, a level more for each doubling: of the pixel, and of the tolerance.
    let one = 2.0 / view.pixel; // where a pixel is as large as the largest voxel edge
    for (lod, factor) in [(0, 0.99), (0, 1.01), (1, 2.01), (2, 4.01), (2, 7.99), (7, 1e9)] {
        let level = level_for(&at(radius + one * factor), &p, EXTENT, 8, 1.0).unwrap();
        assert_eq!(level.lod, lod, "{factor}: {}", level.reason);
        let strict = level_for(&at(radius + one * factor), &p, EXTENT, 8, 0.25).unwrap();
        assert_eq!(strict.lod, if lod == 7 { 7 } else { lod.saturating_sub(2) });
    }
    for tolerance in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(level_for(&view, &p, EXTENT, 8, tolerance).unwrap_err().code(), Code::Param);
    }
    let broken = Placement { matrix: [[f64::NAN; 4]; 3], ..placement() };
    assert_eq!(level_for(&view, &broken, EXTENT, 8, 1.0).unwrap_err().code(), Code::Param);
}

#[test] // hard case: D-57
fn a_tiny_volume_far_from_the_origin() {
    let extent = Extent::cube(256);
    let near = Placement::from_spacing([1e-6; 3], [0.0; 3]);
    let far = Placement::from_spacing([1e-6; 3], [1e9, -1e9, 1e9]);
    let spec = CameraSpec::default();
    let rays = |p: &Placement, turn: f64| {
        let view = spec.resolve(p, extent, [100, 100]).unwrap().turned(turn);
        (view.rays_in(p, extent, 0).unwrap(), view)
    };
    for turn in [0.0, 0.7, 3.0] {
        let ((a, av), (b, bv)) = (rays(&near, turn), rays(&far, turn));
        for (x, y) in [(0.0, 0.0), (50.0, 50.0), (99.0, 3.0)] {
            let (ao, ad) = a.ray(av.film(x, y));
            let (bo, bd) = b.ray(bv.film(x, y));
            for c in 0..3 {
                assert!((ao[c] - bo[c]).abs() < 1e-6 && (ad[c] / bd[c] - 1.0).abs() < 1e-9, "{ao:?} {bo:?}");
            }
        }
    }
}

#[test]
fn rays_meet_what_they_point_at() {
    // Sheared, mirrored, anisotropic.
    let mut p = placement();
    p.matrix = [[-0.5, 0.1, 0.0, 12.0], [0.0, 0.7, 0.3, -3.0], [0.05, 0.0, 2.0, 100.0]];
    let inverse = inverse(&p).unwrap();
    let index_of = |w: [f64; 3]| apply(&inverse, std::array::from_fn(|r| w[r] - p.matrix[r][3]));
    for lens in [Lens::Perspective, Lens::Orthographic] {
        let spec = CameraSpec { lens, azimuth: 200.0, elevation: -20.0, ..CameraSpec::default() };
        let view = spec.resolve(&p, EXTENT, [64, 48]).unwrap();
        for lod in 0..3 {
            let rays = view.rays_in(&p, EXTENT, lod).unwrap();
            let [u, v] = view.film(40.0, 7.0);
            let (origin, dir) = rays.ray([u, v]);
            let t = 37.5;
            // The same point by way of the world.
            let sideways = add(scaled(view.right, u), scaled(view.up, v));
            let world = match lens {
                Lens::Perspective => add(view.eye, scaled(unit(add(view.forward, sideways)), t)),
                Lens::Orthographic => add(add(view.eye, sideways), scaled(view.forward, t)),
            };
            let want = to_level(index_of(world), lod);
            for c in 0..3 {
                assert!((origin[c] + t * dir[c] - want[c]).abs() < 1e-9, "{lens} level {lod}");
                // The point ahead of the eye lies on the middle ray.
                assert!((rays.focus[c] - (rays.origin[c] + rays.forward[c] * rays.depth)).abs() < 1e-9);
            }
        }
    }
    // A level's voxel lies between those that it covers.
    assert_eq!(to_level([0.5, 2.5, 6.5], 1), [0.0, 1.0, 3.0]);
}

#[test]
fn turntables_come_back() {
    let view = CameraSpec::default().resolve(&placement(), EXTENT, [64, 64]).unwrap();
    let back = (0..36).fold(view.clone(), |v, _| v.turned(std::f64::consts::TAU / 36.0));
    is_frame(&back);
    for c in 0..3 {
        assert!((back.eye[c] - view.eye[c]).abs() < 1e-9 && (back.up[c] - view.up[c]).abs() < 1e-12);
    }
    let half = view.turned(std::f64::consts::PI);
    assert!((half.from_center[0] + view.from_center[0]).abs() < 1e-9);
    assert!((half.eye[2] - view.eye[2]).abs() < 1e-9, "around the vertical axis");
}

#[test]
fn several_volumes_are_seen_together() {
    let (a, b) = (placement(), Placement::from_spacing([1.0; 3], [100.0, 0.0, 0.0]));
    let both = [(&a, EXTENT), (&b, Extent::cube(10))];
    let view = CameraSpec::default().resolve_all(&both, [64, 64]).unwrap();
    for p in [[10.0, -20.0, 30.0], [109.0, 9.0, 9.0]] {
        let [x, y] = on_film(&view, p);
        assert!((0.0..64.0).contains(&x) && (0.0..64.0).contains(&y));
    }
    assert_eq!(CameraSpec::default().resolve_all(&[], [64, 64]).unwrap_err().code(), Code::Param);
}

#[test]
fn what_is_seen_is_framed() {
    let p = placement();
    // A box of 10×10×4 voxels far from the middle: 5×5×8 world units.
    let corner = |i: usize| -> [f64; 3] {
        std::array::from_fn(|a| [70.0, 50.0, 30.0][a] + if i >> a & 1 == 1 { [10.0, 10.0, 4.0][a] } else { 0.0 })
    };
    let seen: Vec<_> = (0..8).map(|i| from_middle(&p, EXTENT, corner(i))).collect();
    for lens in [Lens::Perspective, Lens::Orthographic] {
        let spec = CameraSpec { lens, elevation: 0.0, ..CameraSpec::default() };
        let start = spec.resolve_seen(&[(&p, EXTENT)], &[&seen], [60, 60]).unwrap();
        let (mut lowest, mut highest) = (60.0f64, 0.0f64);
        for turn in 0..12 {
            let view = start.turned(f64::from(turn) * std::f64::consts::TAU / 12.0);
            for i in 0..8 {
                let world = std::array::from_fn(|a| p.matrix[a][3] + p.matrix[a][a] * corner(i)[a]);
                let [x, y] = on_film(&view, world);
                assert!(x > -0.5 && y > -0.5 && x < 59.5 && y < 59.5, "{lens} {turn} {x} {y}");
                (lowest, highest) = (lowest.min(y), highest.max(y));
            }
        }
        assert!(lowest < 4.0 && highest > 55.0, "and fills the picture: {lowest} to {highest}");
        // Who says where the camera looks is not talked out of it.
        let told = CameraSpec { target: Some([20.0, 0.0, 60.0]), ..spec };
        let (a, b) = (told.resolve_seen(&[(&p, EXTENT)], &[&seen], [60, 60]), told.resolve(&p, EXTENT, [60, 60]));
        assert_eq!(a.unwrap(), b.unwrap());
    }
    let (whole, none) = (CameraSpec::default().resolve(&p, EXTENT, [8, 8]), &[][..]);
    let empty = CameraSpec::default().resolve_seen(&[(&p, EXTENT)], &[none], [8, 8]).unwrap();
    assert_eq!((&empty, empty.pivot), (&whole.unwrap(), [0.0; 3]));
}
