//! Where the error lies: S3Dc (2008), §5.1, finds it in blocks with large gradients.

use crate::error::{Error, Result};
use crate::grid::{Grid, View};
use crate::voxel::Sample;
use crate::with_sample;
use rayon::prelude::*;

/// Sums for a correlation coefficient of x = |error| and y = |gradient|.
#[derive(Clone, Copy, Default)]
struct Sums {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    yy: f64,
    xy: f64,
}

impl Sums {
    fn add(&mut self, x: f64, y: f64) {
        self.merge(Sums { n: 1.0, x, y, xx: x * x, yy: y * y, xy: x * y });
    }

    fn merge(&mut self, o: Sums) {
        self.n += o.n;
        self.x += o.x;
        self.y += o.y;
        self.xx += o.xx;
        self.yy += o.yy;
        self.xy += o.xy;
    }

    fn correlation(&self) -> Option<f64> {
        let (vx, vy) = (self.n * self.xx - self.x * self.x, self.n * self.yy - self.y * self.y);
        let r = (self.n * self.xy - self.x * self.y) / (vx * vy).sqrt();
        (vx > 0.0 && vy > 0.0 && r.is_finite()).then(|| r.clamp(-1.0, 1.0))
    }
}

/// Pearson's correlation of a voxel's error |a − b| with the length of the gradient of `a` (central differences, per
/// voxel, clamped at the edges). `None` where one of them is the same everywhere, or a sample is not finite.
///
/// # Errors
/// `E_PARAM` where extent or type differ.
pub fn gradient_correlation(a: &Grid, b: &Grid) -> Result<Option<f64>> {
    if (a.extent(), a.sample_type()) != (b.extent(), b.sample_type()) {
        return Err(Error::param("dims", "volumes of different extent or type cannot be compared"));
    }
    let (a, b) = (a.view(), b.view());
    // Planes are added in order: the result does not depend on the number of threads.
    let planes: Vec<Sums> = with_sample!(a.sample_type, T =>
        (0..a.extent.z).into_par_iter().map(|z| plane::<T>(&a, &b, z)).collect());
    let mut all = Sums::default();
    planes.into_iter().for_each(|s| all.merge(s));
    Ok(all.correlation())
}

fn plane<T: Sample>(a: &View<'_>, b: &View<'_>, z: u32) -> Sums {
    let (e, mut sums) = (a.extent, Sums::default());
    let around = |i: u32, n: u32| (i.saturating_sub(1), (i + 1).min(n - 1));
    let half = |p: T, q: T, c: usize| (q.component(c) - p.component(c)) / 2.0;
    for y in 0..e.y {
        let ((y0, y1), (z0, z1)) = (around(y, e.y), around(z, e.z));
        let (row, other) = (a.row::<T>(y, z), b.row::<T>(y, z));
        let [up, down, front, back] = [(y0, z), (y1, z), (y, z0), (y, z1)].map(|(y, z)| a.row::<T>(y, z));
        for x in 0..e.x as usize {
            let (x0, x1) = (x.saturating_sub(1), (x + 1).min(e.x as usize - 1));
            for c in 0..T::TYPE.components() {
                let g = [half(row[x0], row[x1], c), half(up[x], down[x], c), half(front[x], back[x], c)];
                let error = (row[x].component(c) - other[x].component(c)).abs();
                sums.add(error, g[0].hypot(g[1]).hypot(g[2]));
            }
        }
    }
    sums
}
