//! The head: ellipsoids painted over each other, in the order of the table. Values are CT-like, in 12 bits.

use super::noise::smooth;

/// Air: nothing is stored for it.
pub(super) const AIR: f64 = 0.0;
pub(super) const FAT: f64 = 700.0;
pub(super) const FLUID: f64 = 900.0;
pub(super) const MUSCLE: f64 = 1060.0;
pub(super) const WHITE: f64 = 1120.0;
pub(super) const GREY: f64 = 1400.0;
const VESSEL: f64 = 1950.0;
pub(super) const SPONGY: f64 = 1750.0;
pub(super) const BONE: f64 = 2500.0;
pub(super) const TOOTH: f64 = 3100.0;
pub(super) const METAL: f64 = 4095.0;

/// What an ellipsoid is filled with.
#[derive(Clone, Copy)]
pub(super) enum Paint {
    /// One value.
    Flat(f64),
    /// Bone with marrow in its pores.
    Spongy,
    /// Folded cortex around white matter, split in two halves.
    Brain,
    /// Thin leaves of grey and white matter.
    Leaves,
    /// Bone with air-filled cells.
    Cells,
}
use Paint::{Brain, Cells, Flat, Leaves};

/// Centre, radii, lean (how far x shifts per unit of y) and filling, in the unit cube −1..1 (x left, y back, z up).
/// A radius whose centre is off the middle is there twice, left and right.
pub(super) type Part = ([f64; 3], [f64; 3], f64, Paint);

/// From the outside to the inside: later ones cover earlier ones.
pub(super) const PARTS: &[Part] = &[
    // Neck, face, nose, ears, scalp.
    ([0.0, 0.08, -1.0], [0.40, 0.42, 0.62], 0.0, Flat(MUSCLE)),
    ([0.0, -0.56, -0.46], [0.43, 0.34, 0.48], 0.0, Flat(MUSCLE)),
    ([0.0, -0.81, -0.30], [0.09, 0.13, 0.17], 0.0, Flat(MUSCLE)),
    ([0.67, -0.02, -0.22], [0.05, 0.12, 0.17], 0.0, Flat(MUSCLE)),
    ([0.0, -0.08, 0.08], [0.655, 0.79, 0.80], 0.0, Flat(MUSCLE)),
    ([0.0, -0.08, 0.08], [0.635, 0.77, 0.78], 0.0, Flat(FAT)),
    // Throat and spine.
    ([0.0, -0.22, -0.95], [0.10, 0.09, 0.55], 0.0, Flat(AIR)),
    ([0.0, 0.10, -0.92], [0.17, 0.13, 0.42], 0.0, Flat(BONE)),
    ([0.0, 0.10, -0.92], [0.14, 0.10, 0.40], 0.0, Paint::Spongy),
    ([0.0, 0.30, -0.92], [0.14, 0.15, 0.42], 0.0, Flat(BONE)),
    ([0.0, 0.29, -0.90], [0.09, 0.10, 0.52], 0.0, Flat(FLUID)),
    ([0.0, 0.29, -0.90], [0.055, 0.055, 0.55], 0.0, Flat(GREY)),
    // Skull: two tables of dense bone with marrow between them.
    ([0.0, -0.08, 0.08], [0.59, 0.73, 0.735], 0.0, Flat(BONE)),
    ([0.0, -0.08, 0.08], [0.57, 0.71, 0.715], 0.0, Paint::Spongy),
    ([0.0, -0.08, 0.08], [0.54, 0.68, 0.685], 0.0, Flat(BONE)),
    ([0.0, -0.08, 0.08], [0.52, 0.66, 0.665], 0.0, Flat(FLUID)),
    ([0.0, -0.08, 0.10], [0.50, 0.64, 0.635], 0.0, Brain),
    // Below the brain: base of the skull, cerebellum, brain stem.
    ([0.0, -0.42, -0.34], [0.40, 0.26, 0.15], 0.0, Flat(BONE)),
    ([0.40, 0.02, -0.36], [0.16, 0.17, 0.12], 0.0, Cells),
    ([0.0, 0.30, -0.36], [0.40, 0.26, 0.22], 0.0, Flat(FLUID)),
    ([0.0, 0.30, -0.36], [0.37, 0.235, 0.195], 0.0, Leaves),
    ([0.0, 0.06, -0.42], [0.13, 0.14, 0.30], 0.0, Flat(FLUID)),
    ([0.0, 0.08, -0.42], [0.095, 0.10, 0.34], 0.0, Flat(WHITE)),
    // Deep grey matter and the ventricles.
    ([0.17, -0.16, 0.06], [0.075, 0.17, 0.12], 0.35, Flat(GREY)),
    ([0.10, 0.02, 0.06], [0.065, 0.11, 0.09], -0.3, Flat(GREY)),
    ([0.085, -0.20, 0.17], [0.05, 0.17, 0.085], 0.30, Flat(FLUID)),
    ([0.15, 0.16, 0.12], [0.05, 0.16, 0.075], -0.45, Flat(FLUID)),
    ([0.0, -0.04, 0.07], [0.016, 0.11, 0.09], 0.0, Flat(FLUID)),
    // Eyes, nose, sinuses.
    ([0.25, -0.55, -0.14], [0.17, 0.20, 0.16], 0.0, Flat(BONE)),
    ([0.25, -0.58, -0.14], [0.15, 0.19, 0.14], 0.0, Flat(FAT)),
    ([0.25, -0.63, -0.14], [0.115, 0.115, 0.115], 0.0, Flat(MUSCLE)),
    ([0.25, -0.63, -0.14], [0.10, 0.10, 0.10], 0.0, Flat(FLUID)),
    ([0.25, -0.715, -0.14], [0.045, 0.022, 0.045], 0.0, Flat(1500.0)),
    ([0.23, -0.45, -0.14], [0.016, 0.14, 0.016], -0.5, Flat(GREY)),
    ([0.09, -0.70, 0.14], [0.08, 0.05, 0.09], 0.0, Flat(AIR)),
    ([0.055, -0.62, -0.36], [0.045, 0.22, 0.15], 0.0, Flat(AIR)),
    ([0.24, -0.54, -0.42], [0.12, 0.15, 0.13], 0.0, Flat(BONE)),
    ([0.24, -0.54, -0.42], [0.10, 0.13, 0.11], 0.0, Flat(AIR)),
    // Jaws, teeth, one of them filled with metal.
    ([0.0, -0.50, -0.66], [0.33, 0.32, 0.085], 0.0, Flat(BONE)),
    ([0.0, -0.44, -0.66], [0.25, 0.26, 0.12], 0.0, Flat(MUSCLE)),
    ([0.05, -0.79, -0.66], [0.036, 0.03, 0.075], 0.0, Flat(TOOTH)),
    ([0.13, -0.76, -0.66], [0.036, 0.03, 0.075], 0.0, Flat(TOOTH)),
    ([0.20, -0.71, -0.66], [0.036, 0.033, 0.075], 0.0, Flat(TOOTH)),
    ([0.25, -0.64, -0.66], [0.036, 0.036, 0.075], 0.0, Flat(TOOTH)),
    ([0.285, -0.56, -0.66], [0.036, 0.036, 0.075], 0.0, Flat(TOOTH)),
];

/// Parts that are on one side only.
pub(super) const SINGLE: &[Part] = &[
    ([0.285, -0.56, -0.63], [0.026, 0.026, 0.03], 0.0, Flat(METAL)),
    // A lesion: a bright rim around a dark core, in a soft halo.
    ([0.27, 0.22, 0.24], [0.15, 0.16, 0.14], 0.2, Flat(985.0)),
    ([0.27, 0.22, 0.24], [0.095, 0.105, 0.10], 0.2, Flat(1800.0)),
    ([0.275, 0.215, 0.24], [0.07, 0.075, 0.075], 0.2, Flat(930.0)),
    ([-0.30, 0.10, 0.42], [0.012, 0.012, 0.012], 0.0, Flat(2300.0)),
    ([-0.24, 0.18, 0.40], [0.010, 0.010, 0.010], 0.0, Flat(2300.0)),
];

/// A vessel: position in x and y as a parabola of z, and its radius, in the unit cube.
pub(super) type Vessel = ([f64; 3], [f64; 3], [f64; 2], f64);

/// x = a + b·z + c·z², y likewise, from z0 to z1.
pub(super) const VESSELS: &[Vessel] = &[
    ([0.09, -0.20, 0.10], [-0.06, 0.25, -0.5], [-1.0, -0.2], 0.022),
    ([-0.09, 0.20, -0.10], [-0.06, 0.25, -0.5], [-1.0, -0.2], 0.022),
    ([0.10, 0.55, 0.20], [-0.20, -0.10, 0.55], [-0.22, 0.45], 0.016),
    ([-0.10, -0.55, -0.20], [-0.20, -0.10, 0.55], [-0.22, 0.45], 0.016),
    ([0.012, 0.05, 0.0], [-0.34, -0.50, 0.95], [-0.2, 0.62], 0.014),
    ([-0.012, -0.05, 0.0], [-0.34, -0.50, 0.95], [-0.2, 0.62], 0.014),
    ([0.0, 0.0, 0.0], [0.52, -0.10, -0.45], [-0.3, 0.6], 0.026),
];

/// Value of a vessel's contents.
pub(super) const BLOOD: f64 = VESSEL;

/// Materials over each other: the lowest one, and what covers it by which share.
pub(super) struct Blend {
    pub(super) ground: f64,
    pub(super) over: [(f64, f64); 2],
}

impl Blend {
    fn flat(ground: f64) -> Self {
        Blend { ground, over: [(ground, 0.0); 2] }
    }

    pub(super) fn value(&self) -> f64 {
        self.over.iter().fold(self.ground, |v, (over, share)| v + (over - v) * share)
    }
}

/// Filling at `p` (voxels), `u` (unit cube) and `depth` (voxels below the surface of the ellipsoid). `voxel` is the size
/// of the phantom's finest details.
pub(super) fn filling(paint: Paint, p: [f64; 3], u: [f64; 3], depth: f64, voxel: f64) -> Blend {
    let n = |scale: f64, seed| smooth(p, scale * voxel, seed);
    match paint {
        Flat(value) => Blend::flat(value),
        Paint::Spongy => Blend::flat(SPONGY + 420.0 * n(2.6, 1)),
        Cells => Blend { ground: BONE, over: [(AIR + 60.0, edge(n(4.5, 2) + 0.12, 0.16)), (BONE, 0.0)] },
        Leaves => {
            // Concentric leaves, bent a little: a triangle wave of the depth.
            let t = (depth / voxel + 2.5 * n(9.0, 3)) / 5.0;
            let wave = (t - t.floor() - 0.5).abs() * 2.0;
            Blend { ground: WHITE, over: [(GREY, edge(wave - 0.45, 0.4)), (WHITE, 0.0)] }
        }
        Brain => {
            // Folds: where the noise crosses zero, a furrow of fluid reaches in, with grey matter along it.
            let fold = (0.75 * n(11.0, 4) + 0.35 * n(5.5, 5)).abs();
            let d = depth / voxel;
            let furrow = edge(0.10 - fold - d / 90.0, 0.05);
            let ribbon = edge(0.30 - fold - d / 60.0, 0.08).max(edge(3.2 - d, 1.2));
            let split = edge(1.6 * voxel - (u[0] * 96.0 * voxel).abs() + 1.5 * n(14.0, 6), voxel) * edge(26.0 - d, 3.0);
            Blend { ground: WHITE, over: [(GREY, ribbon), (FLUID, furrow.max(split))] }
        }
    }
}

/// 0 below, 1 above, linear over `width` around 0.
pub(super) fn edge(v: f64, width: f64) -> f64 {
    (v / width + 0.5).clamp(0.0, 1.0)
}
