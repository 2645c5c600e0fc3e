//! What a sample costs: texels fetched, on average over all positions within a brick.

use crate::gpu::key::Gradient;
use crate::gpu::level::{LevelLayout, Role, Store};
use crate::gpu::{Projection, Sampler};
use crate::render::scene::Scene;

/// Texels fetched for one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fetches {
    /// For the value.
    pub value: f64,
    /// For the value and the gradient, where a sample is lit.
    pub lit: Option<f64>,
    /// Bytes of those for the value.
    pub value_bytes: f64,
}

/// Offsets of the voxels that a linear sample needs.
const CUBE: [i64; 2] = [0, 1];

/// What a sample of this level costs in this scene. `None` for zerobit, whose cost depends on the data.
#[must_use]
pub fn fetches(scene: &Scene, layout: &LevelLayout) -> Option<Fetches> {
    let lit = scene.shading.filter(|_| matches!(scene.projection, Projection::Composite | Projection::Iso));
    let linear = scene.sampler != Sampler::Nearest;
    let s3dc = match (layout.decoded, layout.store) {
        (None, Store::S3dc { index_bits, block, .. }) => Some((16 / index_bits, block)),
        (None, Store::Zerobit { .. }) => return None,
        _ => None,
    };
    let Some((per_word, block)) = s3dc else {
        let value = if linear && scene.sampler != Sampler::HwLinear { 8.0 } else { 1.0 };
        let bytes = layout.decoded.or(layout.textures.first().copied()).map_or(4, |t| t.format.bytes());
        return Some(Fetches { value, lit: lit.map(|_| value * 7.0), value_bytes: value * f64::from(bytes) });
    };
    let of = |role| layout.textures.iter().find(|t| t.role == role).map_or(0.0, |t| f64::from(t.format.bytes()));
    let (word, pair) = (of(Role::Index), of(Role::Minmax));
    let (words, pairs) = match scene.sampler {
        Sampler::Nearest => (1.0, 1.0),
        Sampler::LinearOpt => distinct(&cube(), per_word, block),
        _ => (8.0, 8.0),
    };
    let naive = 7.0 * if linear { 16.0 } else { 2.0 };
    let lit = lit.map(|s| match (s.gradient, linear) {
        (Gradient::Reuse, true) => {
            // The value is looked up first: only what is seen is lit.
            let (own_words, own_pairs) = (words, pairs);
            let (words, pairs) = distinct(&cross(), per_word, block);
            own_words + own_pairs + words + pairs
        }
        (Gradient::Naive, true) if scene.sampler == Sampler::LinearOpt => 7.0 * (words + pairs),
        _ => naive,
    });
    Some(Fetches { value: words + pairs, lit, value_bytes: words * word + pairs * pair })
}

/// The 8 voxels around a sample.
fn cube() -> Vec<[i64; 3]> {
    let mut all = Vec::new();
    for z in CUBE {
        for y in CUBE {
            all.extend(CUBE.map(|x| [x, y, z]));
        }
    }
    all
}

/// The 32 voxels that a linear sample and its central differences need: the cube, and its four neighbours on each face.
fn cross() -> Vec<[i64; 3]> {
    let mut all = cube();
    for axis in 0..3 {
        for outer in [-1, 2] {
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let mut c = [0; 3];
                (c[axis], c[(axis + 1) % 3], c[(axis + 2) % 3]) = (outer, i, j);
                all.push(c);
            }
        }
    }
    all
}

/// Index words and pairs of end points that these voxels lie in, each counted once: the mean over all positions in a block.
fn distinct(voxels: &[[i64; 3]], per_word: u32, block: [u32; 3]) -> (f64, f64) {
    (mean(voxels, [per_word, 1, 1]), mean(voxels, block))
}

/// Boxes of `size` voxels that the voxels touch, averaged over all ways in which the boxes may lie.
fn mean(voxels: &[[i64; 3]], size: [u32; 3]) -> f64 {
    // Along an axis only these borders matter: none between the voxels, or one at a place; positions that give the same
    // parts are counted once, with their number.
    let axis = |n: u32| -> Vec<([i64; 4], f64)> {
        let n = i64::from(n);
        let mut ways: Vec<([i64; 4], f64)> = Vec::new();
        for shift in 0..n {
            let first = (shift - 1).div_euclid(n);
            let parts = [-1, 0, 1, 2].map(|o| (shift + o).div_euclid(n) - first);
            match ways.iter_mut().find(|(p, _)| *p == parts) {
                Some((_, count)) => *count += 1.0 / n as f64,
                None => ways.push((parts, 1.0 / n as f64)),
            }
        }
        ways
    };
    let ways = size.map(axis);
    let mut sum = 0.0;
    for (x, px) in &ways[0] {
        for (y, py) in &ways[1] {
            for (z, pz) in &ways[2] {
                let part = |p: &[i64; 4], o: i64| p[usize::try_from(o + 1).unwrap_or(0)];
                let mut seen: Vec<[i64; 3]> =
                    voxels.iter().map(|v| [part(x, v[0]), part(y, v[1]), part(z, v[2])]).collect();
                seen.sort_unstable();
                seen.dedup();
                sum += px * py * pz * seen.len() as f64;
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test] // V24: expected fetches of optimised linear sampling, and of value and gradient together
    fn as_the_closed_form_says() {
        let both = |(a, b): (f64, f64)| a + b;
        for (bits, n) in [(1, 16), (2, 8), (4, 4), (8, 2)] {
            for b in [2u32, 4, 8, 16, 64] {
                let got = both(distinct(&cube(), n, [b; 3]));
                let closed = 4.0 * (1.0 + 1.0 / f64::from(n)) + (1.0 + 1.0 / f64::from(b)).powi(3);
                assert!((got - closed).abs() < 1e-9, "{bits} bits, block {b}: {got} {closed}");
            }
            assert_eq!(cross().len(), 32);
            let words = distinct(&cross(), n, [16; 3]).0;
            // Of 12 rows along x four hold 4 voxels in sequence and eight hold 2.
            let rows = 12.0 + 20.0 / f64::from(n);
            if n >= 4 {
                assert!((words - rows).abs() < 1e-9, "{words} {rows}");
            }
        }
        let table = [(16, 14.9), (8, 16.12), (4, 18.6), (2, 23.6)];
        for (n, want) in table {
            let got = both(distinct(&cross(), n, [16; 3]));
            assert!((got - want).abs() < 0.06, "{n} indices a word: {got} {want}");
        }
    }
}
