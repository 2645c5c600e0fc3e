//! Which bricks hold something to be seen, from the bounds that the index has of them: no brick is read (Marton et al. 2014,
//! §3: culling by the transfer function).

use crate::affine::Placement;
use crate::error::{Error, Result};
use crate::geometry::Coord;
use crate::gpu::{Projection, Sampler};
use crate::render::scene::Scene;
use crate::render::transfer::TransferFunction;
use crate::volume::{At, Bounds, Volume};

/// A set of bricks of one level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BrickMask {
    bricks: [u32; 3],
    bits: Vec<bool>,
}

impl BrickMask {
    /// All bricks of a level of so many.
    #[must_use]
    pub fn all(bricks: [u32; 3]) -> Self {
        BrickMask { bricks, bits: vec![true; count(bricks)] }
    }

    /// Those that `f` chooses.
    pub fn choose(bricks: [u32; 3], mut f: impl FnMut(Coord) -> bool) -> Self {
        BrickMask { bricks, bits: each(bricks).map(&mut f).collect() }
    }

    /// Whether a brick is in the set; none outside of the level is.
    #[must_use]
    pub fn has(&self, brick: Coord) -> bool {
        (0..3).all(|a| brick[a] < self.bricks[a]) && self.bits[index(self.bricks, brick)]
    }

    /// Bricks of the level, per axis.
    #[must_use]
    pub fn size(&self) -> [u32; 3] {
        self.bricks
    }

    /// By number, x fastest.
    #[must_use]
    pub fn bits(&self) -> &[bool] {
        &self.bits
    }

    /// Bricks in the set.
    #[must_use]
    pub fn count(&self) -> usize {
        self.bits.iter().filter(|b| **b).count()
    }

    /// The set and all neighbours of its bricks.
    #[must_use]
    pub fn grown(&self) -> Self {
        let near = |b: Coord| around(self.bricks, b).any(|n| self.bits[index(self.bricks, n)]);
        BrickMask::choose(self.bricks, near)
    }
}

/// Value and error bounds of all bricks of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelBounds {
    /// Bricks, per axis.
    pub bricks: [u32; 3],
    /// Edge of a brick, in voxels.
    pub edge: u32,
    /// By number, x fastest.
    pub bounds: Vec<Bounds>,
}

impl LevelBounds {
    /// Reads the level's index pages.
    ///
    /// # Errors
    /// Those of damaged pages.
    pub fn of(volume: &Volume, at: At) -> Result<Self> {
        let level = volume.head().octree.levels.get(usize::from(at.lod));
        let Some(level) = level else { return Err(Error::param("level", format!("there is no level {}", at.lod))) };
        let bricks = level.bricks.to_array();
        let bounds = each(bricks).map(|brick| volume.brick_bounds(at, brick)).collect::<Result<_>>()?;
        Ok(LevelBounds { bricks, edge: 1 << volume.info().brick_log2, bounds })
    }

    /// The bounds of both, brick by brick.
    pub(super) fn joined(self, other: &LevelBounds) -> Result<LevelBounds> {
        let bounds = self.bounds.iter().zip(&other.bounds).map(|(a, b)| join(*a, *b)).collect();
        Ok(LevelBounds { bounds, ..self })
    }

    /// Bounds of a brick and its neighbours: of all that a sample in it can be interpolated from.
    #[must_use]
    pub fn with_neighbours(&self, brick: Coord) -> Bounds {
        let own = self.bounds[index(self.bricks, brick)];
        around(self.bricks, brick).map(|n| self.bounds[index(self.bricks, n)]).fold(own, join)
    }

    /// Bounds of a brick alone.
    #[must_use]
    pub fn alone(&self, brick: Coord) -> Bounds {
        self.bounds[index(self.bricks, brick)]
    }
}

/// The bricks in which a sample can be visible.
///
/// Conservative: a brick whose bounds, joined with its neighbours', only touch a peak at one point is visible.
// hard case: R-19, B-111
pub(super) fn visible(
    scene: &Scene,
    transfer: &TransferFunction,
    bounds: &LevelBounds,
    step: f64,
    level: &Placement,
) -> BrickMask {
    let reach = |brick| match scene.sampler {
        Sampler::Nearest => bounds.alone(brick),
        _ => bounds.with_neighbours(brick),
    };
    match (scene.projection, scene.iso) {
        (Projection::Composite, _) => BrickMask::choose(bounds.bricks, |brick| {
            let (lo, hi) = widened(reach(brick));
            transfer.max_alpha(lo, hi) > 0.0
        }),
        (Projection::Iso, Some(iso)) => {
            // A surface is found between two samples. They lie in one brick or in neighbours, unless steps are longer.
            let smallest = level.spacing().into_iter().fold(f64::INFINITY, f64::min);
            if step > smallest * f64::from(bounds.edge - 1) {
                return BrickMask::all(bounds.bricks);
            }
            // Jumped over is only what lies outside: a ray may enter the volume in a brick that is inside altogether.
            BrickMask::choose(bounds.bricks, |brick| widened(bounds.with_neighbours(brick)).1 >= iso)
        }
        _ => BrickMask::all(bounds.bricks),
    }
}

/// The bricks that are needed in memory for these to be seen right: their neighbours too, where samples reach there.
///
/// A sample reaches one voxel (interpolation), a gradient one more; a brick has at least 16.
pub(super) fn wanted(scene: &Scene, visible: &BrickMask) -> BrickMask {
    if scene.sampler == Sampler::Nearest && scene.shading.is_none() && scene.projection != Projection::Iso {
        return visible.clone();
    }
    visible.grown()
}

/// The range, as far as rounding in f32 may carry an interpolated value beyond it: nowhere where all values are the same.
fn widened(b: Bounds) -> (f64, f64) {
    let (lo, hi) = (f64::from(b.min), f64::from(b.max));
    if lo == hi {
        return (lo, hi);
    }
    let slack = lo.abs().max(hi.abs()) * f64::from(f32::EPSILON) * 4.0;
    (lo - slack, hi + slack)
}

fn join(a: Bounds, b: Bounds) -> Bounds {
    Bounds {
        min: a.min.min(b.min),
        max: a.max.max(b.max),
        max_error: a.max_error.zip(b.max_error).map(|(a, b)| a.max(b)),
    }
}

fn count(bricks: [u32; 3]) -> usize {
    bricks.iter().map(|&n| n as usize).product()
}

fn index(bricks: [u32; 3], b: Coord) -> usize {
    b[0] as usize + bricks[0] as usize * (b[1] as usize + bricks[1] as usize * b[2] as usize)
}

/// All positions, x fastest.
pub(super) fn each([nx, ny, nz]: [u32; 3]) -> impl Iterator<Item = Coord> {
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
}

/// A brick and those around it, as far as there are any.
fn around(bricks: [u32; 3], b: Coord) -> impl Iterator<Item = Coord> {
    let lo = b.map(|v| v.saturating_sub(1));
    let n: [u32; 3] = std::array::from_fn(|a| (b[a] + 1).min(bricks[a] - 1) - lo[a] + 1);
    each(n).map(move |d| std::array::from_fn(|a| lo[a] + d[a]))
}
