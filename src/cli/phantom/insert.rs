//! The test plate below the head: line pairs, a ramp, steps, and single voxels; hard edges throughout.

use super::anatomy::{AIR, edge};

/// The plate in the unit cube: x, y, z from and to.
const PLATE: [[f64; 2]; 3] = [[-0.84, 0.84], [0.69, 0.93], [-0.45, 0.45]];
const ACRYLIC: f64 = 1130.0;
const LINE: f64 = 3200.0;
/// Voxels per line pair, group by group.
const PAIRS: [u32; 6] = [2, 3, 4, 6, 8, 12];

/// The shell of the table: two thin curved sheets with foam between them.
pub(super) fn table(u: [f64; 3], voxel: f64) -> f64 {
    // The sheets bend up at the sides; distances in voxels of a phantom of 192.
    let below = (u[1] - 0.985 + 0.06 * u[0] * u[0]) * 96.0 * voxel;
    if u[0].abs() > 0.95 || below.abs() > 12.0 {
        return AIR;
    }
    1350.0 * edge(0.8 - below.abs(), 0.6)
}

/// What the plate shows at a place.
pub(super) enum Mark {
    Ground,
    Line,
    /// Share of the way along the ramp, 0 to 1.
    Ramp(f64),
    /// Step 0 to 15.
    Step(f64),
}

/// Value of the plate at voxel `c`, `None` outside the plate.
pub(super) fn plate(c: [u32; 3], u: [f64; 3]) -> Option<f64> {
    mark(c, u).map(|mark| match mark {
        Mark::Ground => ACRYLIC,
        Mark::Line => LINE,
        Mark::Ramp(share) => 4095.0 * share,
        Mark::Step(step) => step * 273.0,
    })
}

/// The plate's mark at voxel `c`, `None` outside the plate.
pub(super) fn mark(c: [u32; 3], u: [f64; 3]) -> Option<Mark> {
    if (0..3).any(|a| u[a] < PLATE[a][0] || u[a] > PLATE[a][1]) {
        return None;
    }
    let share = |a: usize| (u[a] - PLATE[a][0]) / (PLATE[a][1] - PLATE[a][0]);
    let (across, down) = (share(0), share(1));
    // Four strips, one below the other: pairs along x, pairs along z, the ramp, the steps.
    let group = ((across * PAIRS.len() as f64) as usize).min(PAIRS.len() - 1);
    let inside = across * PAIRS.len() as f64 - group as f64;
    let period = PAIRS[group];
    let bars = |v: u32| if v % period < period.div_ceil(2) { Mark::Line } else { Mark::Ground };
    let bar_group = (0.12..0.88).contains(&inside);
    Some(match down {
        0.06..0.36 if bar_group => bars(c[0]),
        0.42..0.60 if bar_group => bars(c[2]),
        0.66..0.80 => Mark::Ramp(across),
        0.82..0.96 => Mark::Step((across * 16.0).floor()),
        _ => Mark::Ground,
    })
}
