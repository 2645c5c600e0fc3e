//! What of a volume can be seen, for a camera that frames it: by the index alone, no brick is read.

use super::visible::{BrickMask, LevelBounds};
use crate::geometry::Coord;
use crate::gpu::{Projection, Traversal};
use crate::render::camera::from_middle;
use crate::render::scene::{Scene, SceneVolume};
use crate::volume::{At, Volume};

/// Bricks of a level that are looked at, at most: 128 KiB of index pages.
const MOST: u64 = 1 << 12;

/// Corners of the outermost bricks that hold something to see, in world units from the volume's middle. None where the
/// picture shows all values or the scene says itself where its camera is, where nothing is seen, and where the index is
/// damaged: then it is all of the volume that matters.
///
/// The same for all samplers and levels of the scene, and for all settings of a codec that keep the values' bounds.
pub(in crate::render) fn seen(scene: &Scene, shown: &SceneVolume, volume: &Volume) -> Vec<[f64; 3]> {
    let composed = matches!(scene.projection, Projection::Composite | Projection::Iso);
    if !scene.camera.is_auto() || !composed || scene.traversal == Traversal::CutPlane {
        return Vec::new();
    }
    let levels = &volume.head().octree.levels;
    let few = |l: &&u8| levels[usize::from(**l)].bricks.voxels() <= MOST;
    let all: Vec<u8> = (0..volume.info().lod_count).collect();
    let Some(&lod) = all.iter().find(few) else { return Vec::new() };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked against the time steps")]
    let at = At { time: shown.time as u32, channel: shown.channel, lod };
    let Ok(bounds) = LevelBounds::of(volume, at) else { return Vec::new() };
    let mask = BrickMask::choose(bounds.bricks, |brick| {
        let (lo, hi) = (f64::from(bounds.alone(brick).min), f64::from(bounds.alone(brick).max));
        match scene.iso {
            Some(iso) => lo <= iso && iso <= hi,
            None => shown.transfer.max_alpha(lo, hi) > 0.0,
        }
    });
    corners(&mask, volume, lod)
}

/// Corners of the first and the last brick of each row: their hull is that of all.
fn corners(mask: &BrickMask, volume: &Volume, lod: u8) -> Vec<[f64; 3]> {
    let info = volume.info();
    let (edge, n) = (u64::from(info.brick_log2) + u64::from(lod), info.dims.to_array().map(f64::from));
    let of_brick = |brick: Coord| {
        (0..8).map(move |i| {
            let index: [f64; 3] = std::array::from_fn(|a| {
                let plane = (u64::from(brick[a]) + (i >> a & 1)) << edge;
                (plane as f64).min(n[a]) - 0.5
            });
            from_middle(&info.placement, info.dims, index)
        })
    };
    let [nx, ny, nz] = mask.size();
    let rows = (0..nz).flat_map(|z| (0..ny).map(move |y| (y, z)));
    let ends = rows.flat_map(|(y, z)| {
        let mut row = (0..nx).map(move |x| [x, y, z]).filter(|&b| mask.has(b));
        let first = row.next();
        [first, row.next_back()].into_iter().flatten()
    });
    ends.flat_map(of_brick).collect()
}
