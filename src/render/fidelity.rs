//! How true a picture is to its source: which level is shown, how far values can be off, what was read and what is missing.

use super::plan::{Plan, PlannedLevel};
use super::scene::Scene;
use super::setup::overrides;
use crate::volume::Volume;
use serde_json::{Value, json};

/// What rendered a picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Device {
    /// Name of the adapter; `cpu` for the reference renderer.
    pub adapter: String,
    /// What kind of device it is.
    pub kind: String,
    /// Driver, with its version.
    pub driver: String,
    /// Interface it is reached by.
    pub backend: String,
}

/// Times of one pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTimes {
    /// Its name.
    pub name: String,
    /// Milliseconds, of each time it ran.
    pub ms: Vec<f64>,
    /// Whether the device's own clock measured them; else it is wall time.
    pub by_device: bool,
}

impl PassTimes {
    /// The median; `None` where it never ran.
    #[must_use]
    pub fn median(&self) -> Option<f64> {
        let mut ms = self.ms.clone();
        ms.sort_by(f64::total_cmp);
        let n = ms.len();
        (n > 0).then(|| (ms[(n - 1) / 2] + ms[n / 2]) / 2.0)
    }
}

/// Bytes that a picture took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bytes {
    /// Read from the files.
    pub read: u64,
    /// Written to textures and buffers.
    pub uploaded: u64,
}

/// How far the values that a level shows can be from those of the source's finest level at the same place, in sample units:
/// the worst over all bricks with something to see in the views that the plan was made for. `None` where a brick does not say what its error is.
///
/// At level 0 it is the bricks' largest error. A coarser voxel and the voxels that it stands for lie between minimum and
/// maximum of its brick (and of the next ones, for interpolation), and these are off by the brick's largest error: so the
/// bound is max − min + max error. Where a texture unit filters, [`filter_error`] comes on top.
#[must_use]
pub fn error_bound(level: &PlannedLevel) -> Option<f64> {
    let mut worst = 0.0f64;
    let [nx, ny, nz] = level.in_view.size();
    for brick in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z]))) {
        if !level.in_view.has(brick) {
            continue;
        }
        let b = level.bounds.with_neighbours(brick);
        let range = f64::from(b.max) - f64::from(b.min);
        let spread = if level.at.lod == 0 { 0.0 } else { range };
        let error = f64::from(b.max_error?);
        worst = worst.max(spread + error + filter_share(level) * (range + 2.0 * error));
    }
    Some(worst)
}

/// What a texture unit may be off by, of the range of the values that it filters between: its fractions have 8 bits on much
/// hardware, so 1/256 for each of three axes. 0 where shaders interpolate.
fn filter_share(level: &PlannedLevel) -> f64 {
    if level.layout.filtered { 3.0 / 256.0 } else { 0.0 }
}

/// The part of [`error_bound`] that is the texture unit's, at most: 3/256 of the range of values around a brick in view.
#[must_use]
pub fn filter_error(level: &PlannedLevel) -> f64 {
    let [nx, ny, nz] = level.in_view.size();
    let all = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
    let range = |brick| {
        let b = level.bounds.with_neighbours(brick);
        f64::from(b.max) - f64::from(b.min) + 2.0 * f64::from(b.max_error.unwrap_or(0.0))
    };
    filter_share(level) * all.filter(|&b| level.in_view.has(b)).map(range).fold(0.0, f64::max)
}

/// The report beside a picture.
#[must_use]
pub fn report(
    plan: &Plan,
    scene: &Scene,
    volumes: &[&Volume],
    device: &Device,
    passes: &[PassTimes],
    bytes: Bytes,
) -> Value {
    let missing: u64 = volumes.iter().map(|v| v.head().unfinished()).sum();
    let levels = plan.levels.iter().map(|l| {
        json!({
            "volume": l.volume,
            "time": l.at.time,
            "channel": l.at.channel,
            "level": l.at.lod,
            "coarsest_level": volumes[l.volume].info().lod_count - 1,
            "why": l.reason,
            "error_bound": error_bound(l),
            "filter_error": filter_error(l),
            "bricks_in_view": l.in_view.count(),
            "bricks_needed": l.wanted.count(),
            "bricks_visible": l.visible.count(),
        })
    });
    let times =
        passes.iter().map(|p| json!({ "name": p.name, "median_ms": p.median(), "ms": p.ms, "by_device": p.by_device }));
    let constants: serde_json::Map<String, Value> =
        overrides(plan, scene).into_iter().map(|(name, value)| (name, json!(value))).collect();
    let files: Vec<_> = plan.passes.iter().flat_map(|p| p.files.iter()).collect();
    json!({
        "levels": levels.collect::<Vec<_>>(),
        // Nothing better is to come: the finest level is shown, and all of it is there.
        "is_final": missing == 0 && plan.levels.iter().all(|l| l.at.lod == 0),
        "bytes": { "read": bytes.read, "uploaded": bytes.uploaded, "missing": missing },
        "device": {
            "adapter": device.adapter,
            "kind": device.kind,
            "driver": device.driver,
            "backend": device.backend,
        },
        "sampler": plan.key.sampler.name(),
        "step": plan.step,
        "effects": plan.effects.iter().map(|e| e.name()).collect::<Vec<_>>(),
        "shaders": files,
        "constants": constants,
        "passes": times.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Extent;
    use crate::gpu::level::Fit;
    use crate::grid::Grid;
    use crate::limits::Limits;
    use crate::render::scene::SceneFile;
    use crate::source::MemorySource;
    use crate::volume::{self, At, EncodeOptions, Quality};
    use std::path::Path;

    #[test]
    fn medians() {
        let of = |ms: &[f64]| PassTimes { name: String::new(), ms: ms.to_vec(), by_device: false }.median();
        assert_eq!(
            (of(&[]), of(&[3.0]), of(&[9.0, 1.0, 4.0]), of(&[1.0, 2.0])),
            (None, Some(3.0), Some(4.0), Some(1.5))
        );
    }

    #[test] // true errors stay below the reported bound, at coarse levels too
    fn the_bound_holds() {
        let value = |c: [u32; 3]| {
            let wave = (f64::from(c[0]) * 0.21).sin() * (f64::from(c[1]) * 0.13).cos() + (f64::from(c[2]) * 0.3).sin();
            (1000.0 + 400.0 * wave + f64::from((c[0] * 7 + c[1] * 13 + c[2] * 31) % 17)) as u16
        };
        let extent = Extent::new(70, 50, 40);
        let mut grid = Grid::from_fn(extent, value).unwrap();
        let options = EncodeOptions {
            brick: Some(16),
            levels: 3,
            quality: Quality::Explicit { index_bits: 2, block: Extent::cube(4) },
            ..EncodeOptions::default()
        };
        let mut file = std::io::Cursor::new(Vec::new());
        volume::encode(&mut grid, &mut file, &options, &mut |_, _| {}).unwrap();
        let v = Volume::open(MemorySource(file.into_inner()), Limits::default()).unwrap();
        let mut bounds = Vec::new();
        for lod in 0..3u8 {
            // Every value is looked at.
            let text = format!("projection = \"maximum\"\nlevel = {lod}");
            let scene = SceneFile::parse(&text).unwrap().resolve(&[&v], Path::new("")).unwrap();
            let plan = Plan::new(&scene, &[&v], &Fit::host(None)).unwrap();
            let bound = error_bound(&plan.levels[0]).unwrap();
            let shown = v.read(At::lod(lod)).unwrap();
            let mut worst = 0.0f64;
            for z in 0..extent.z {
                for y in 0..extent.y {
                    for x in 0..extent.x {
                        let c = [x, y, z];
                        let got = shown.value(c.map(|n| n >> lod)).unwrap().component(0);
                        worst = worst.max((got - f64::from(value(c))).abs());
                    }
                }
            }
            assert!(worst <= bound && worst > 0.0, "level {lod}: {worst} of {bound}");
            bounds.push(bound);
            let json = report(&plan, &scene, &[&v], &Device::default(), &[], Bytes { read: 7, uploaded: 8 });
            assert_eq!((&json["levels"][0]["error_bound"], &json["is_final"]), (&json!(bound), &json!(lod == 0)));
            assert_eq!(json["bytes"], json!({ "read": 7, "uploaded": 8, "missing": 0 }));
            assert_eq!(json["effects"], json!([]));
            let plain = SceneFile::parse("").unwrap().resolve(&[&v], Path::new("")).unwrap();
            let of = Plan::new(&plain, &[&v], &Fit::host(None)).unwrap();
            let effects = report(&of, &plain, &[&v], &Device::default(), &[], Bytes::default())["effects"].clone();
            let names: Vec<_> = plain.effects().iter().map(|e| e.name()).collect();
            assert!(effects == json!(names) && names.contains(&"tf_cull") && names.contains(&"lod"), "{effects}");
            assert_eq!(
                (&json["constants"]["BRICK_LOG2_0"], &json["constants"]["POINTS_1"]),
                (&json!(4.0), &json!(null))
            );
            let times = [("decode", false), ("raycast", true)];
            let times = times.map(|(name, by_device)| PassTimes { name: name.into(), ms: vec![1.0], by_device });
            let json = report(&plan, &scene, &[&v], &Device::default(), &times, Bytes::default());
            assert_eq!(
                (&json["passes"][0]["by_device"], &json["passes"][1]["by_device"]),
                (&json!(false), &json!(true))
            );
        }
        assert!(bounds[0] < bounds[1], "a coarser level is not held to be as good: {bounds:?}");
    }

    fn volume(options: &EncodeOptions, value: impl Fn([u32; 3]) -> u8) -> Volume {
        let mut grid = Grid::from_fn(Extent::new(96, 32, 32), value).unwrap();
        let mut file = std::io::Cursor::new(Vec::new());
        let options = EncodeOptions { brick: Some(16), ..options.clone() };
        volume::encode(&mut grid, &mut file, &options, &mut |_, _| {}).unwrap();
        Volume::open(MemorySource(file.into_inner()), Limits::default()).unwrap()
    }

    #[test]
    fn the_bound_is_that_of_what_is_in_view() {
        let noise = |c: [u32; 3]| (c[0].wrapping_mul(7919) ^ c[1].wrapping_mul(104_729) ^ c[2].wrapping_mul(31)) as u8;
        let v = volume(&EncodeOptions::default(), |c| if c[0] < 48 { 100 + (c[0] / 16) as u8 } else { noise(c) });
        let text = "level = 0\nprojection = \"maximum\"\nclip_box = { min = [0, 0, 0], max = [15, 31, 31] }";
        let scene = SceneFile::parse(text).unwrap().resolve(&[&v], Path::new("")).unwrap();
        for scene in [scene.clone(), scene.without(crate::gpu::Effect::TfCull)] {
            let mut plan = Plan::new(&scene, &[&v], &Fit::host(None)).unwrap();
            let all = error_bound(&plan.levels[0]).unwrap();
            plan.cull_to(&scene, &[plan.view.clone()]).unwrap();
            let level = &plan.levels[0];
            assert!(level.in_view.count() > 0 && level.in_view.count() <= 8, "{}", level.in_view.count());
            assert_eq!(level.wanted.count() == 24, !scene.tf_cull);
            let bound = error_bound(level).unwrap();
            assert!(bound < all && bound < 1.0, "{bound} of {all}");
        }
    }

    #[test]
    fn texture_units_are_not_held_to_be_exact() {
        let raw = EncodeOptions { codec: volume::CodecChoice::Raw, ..EncodeOptions::default() };
        let v = volume(&raw, |c| (c[0] * 2) as u8);
        let of = |text: &str| {
            let scene = SceneFile::parse(text).unwrap().resolve(&[&v], Path::new("")).unwrap();
            let plan = Plan::new(&scene, &[&v], &Fit::host(None)).unwrap();
            (error_bound(&plan.levels[0]).unwrap(), filter_error(&plan.levels[0]))
        };
        let all = "level = 0\nprojection = \"maximum\"\n";
        assert_eq!(of(&format!("{all}sampler = \"linear\"")), (0.0, 0.0));
        // A brick and its neighbours: 48 voxels, two values apart.
        let due = 3.0 / 256.0 * 94.0;
        assert_eq!(of(&format!("{all}sampler = \"hw_linear\"")), (due, due));
    }
}
