//! A synthetic head in a scanner: what `vug demo` encodes, so that it needs no file. No patient was involved.
//!
//! It has what makes block compression sweat: hard edges of bone and metal, fine line pairs, folded soft tissue of low
//! contrast, smooth ramps, noise, and a large background of exactly 0.

mod anatomy;
mod insert;
mod noise;
mod photograph;
#[cfg(test)]
mod tests;

use crate::affine::{Placement, Space, Unit};
use crate::error::Result;
use crate::geometry::{Coord, Extent};
use crate::grid::Grid;
use crate::voxel::{Sample, SampleType};
use anatomy::{AIR, BLOOD, PARTS, Paint, SINGLE, VESSELS, edge};
use rayon::prelude::*;

/// The size that the details were drawn for.
pub(crate) const DEFAULT_EXTENT: Extent = Extent::new(192, 192, 160);

/// How far the head lies in front of the middle, in the unit cube: room for the plate behind it.
const RAISED: f64 = 0.05;

/// Where the phantom lies: x left, y back, z up, in millimetres, its slices a little thicker than its pixels.
pub(crate) fn placement() -> Placement {
    let mut placement = Placement::from_spacing([1.0, 1.0, 1.2], [-95.5, -95.5, -95.4]);
    (placement.space, placement.unit) = (Space::Lps, Unit::Millimetre);
    placement
}

/// The phantom: u16 in 12 bits (0 air, about 1000 water, 2500 bone, 4095 metal), i16 the same less 1000, u8 the upper
/// eight of the 12 bits, f32 as a fraction of 4095, rgb8 the same head as photographs of its cut surfaces. The same on
/// every machine.
///
/// # Errors
/// `E_PARAM` or `E_LIMIT` for extents outside the caps.
pub(crate) fn phantom(extent: Extent, sample_type: SampleType) -> Result<Grid> {
    let scene = Scene::new(extent);
    match sample_type {
        SampleType::U8 => scene.fill(|v| (v / 16.0) as u8),
        SampleType::U16 => scene.fill(|v| v as u16),
        SampleType::I16 => scene.fill(|v| v as i16 - 1000),
        SampleType::F32 => scene.fill(|v| (v / 4095.0) as f32),
        SampleType::Rgb8 => scene.fill_with(Scene::color),
    }
}

/// A voxel: its coordinates, its centre in voxels, and its centre in the unit cube.
#[derive(Clone, Copy)]
struct Place {
    c: Coord,
    p: [f64; 3],
    u: [f64; 3],
}

/// A vessel where it crosses a plane, in voxels.
struct Vein {
    center: [f64; 2],
    radius: f64,
}

/// An ellipsoid in voxels.
struct Body {
    center: [f64; 3],
    radius: [f64; 3],
    lean: f64,
    paint: Paint,
}

struct Scene {
    extent: Extent,
    /// Half the extent, in voxels: one unit of the anatomy's cube.
    half: [f64; 3],
    /// Size of the finest details, in voxels; 1 for the default extent.
    voxel: f64,
    bodies: Vec<Body>,
}

impl Scene {
    fn new(extent: Extent) -> Self {
        let half = extent.to_array().map(|n| f64::from(n) / 2.0);
        let voxel = half.into_iter().fold(f64::INFINITY, f64::min) / 80.0;
        let mut scene = Scene { extent, half, voxel, bodies: Vec::new() };
        for &(center, radius, lean, paint) in PARTS {
            scene.add(center, radius, lean, paint);
            if center[0] != 0.0 {
                scene.add([-center[0], center[1], center[2]], radius, -lean, paint);
            }
        }
        SINGLE.iter().for_each(|&(center, radius, lean, paint)| scene.add(center, radius, lean, paint));
        scene
    }

    fn add(&mut self, center: [f64; 3], radius: [f64; 3], lean: f64, paint: Paint) {
        let half = self.half;
        let center = [center[0], center[1] - RAISED, center[2]];
        let center = std::array::from_fn(|a| (center[a] + 1.0) * half[a]);
        let radius = std::array::from_fn(|a| (radius[a] * half[a]).max(0.6));
        self.bodies.push(Body { center, radius, lean: lean * half[0] / half[1], paint });
    }

    fn fill<T: Sample>(&self, sample: impl Fn(f64) -> T + Sync) -> Result<Grid> {
        self.fill_with(|scene, at, bodies, vessels| sample(scene.value(at, bodies, vessels)))
    }

    /// Every voxel from its place, the bodies near its row and the vessels that cross its plane.
    fn fill_with<T: Sample>(&self, sample: impl Fn(&Self, Place, &[&Body], &[Vein]) -> T + Sync) -> Result<Grid> {
        let mut grid = Grid::zeros(self.extent, T::TYPE)?;
        let plane = self.extent.x as usize * self.extent.y as usize;
        grid.samples_mut::<T>()
            .par_chunks_mut(plane)
            .enumerate()
            .for_each(|(z, out)| self.plane(z as u32, out, &sample));
        Ok(grid)
    }

    /// One z plane. Bodies that miss it, or a row, are left out early.
    fn plane<T>(&self, z: u32, out: &mut [T], sample: impl Fn(&Self, Place, &[&Body], &[Vein]) -> T) {
        let near = |v: f64, b: &Body, a: usize| (v - b.center[a]).abs() < b.radius[a] + 1.0;
        let pz = f64::from(z) + 0.5;
        let in_plane: Vec<&Body> = self.bodies.iter().filter(|b| near(pz, b, 2)).collect();
        let vessels = self.vessels(pz);
        for (y, row) in (0..).zip(out.chunks_exact_mut(self.extent.x as usize)) {
            let py = f64::from(y) + 0.5;
            let in_row: Vec<&Body> = in_plane.iter().copied().filter(|b| near(py, b, 1)).collect();
            for (x, out) in (0..).zip(row) {
                *out = sample(self, self.place([x, y, z], [f64::from(x) + 0.5, py, pz]), &in_row, &vessels);
            }
        }
    }

    /// Centres and radii of the vessels that cross a plane, in voxels.
    fn vessels(&self, pz: f64) -> Vec<Vein> {
        let w = pz / self.half[2] - 1.0;
        let crossing = VESSELS.iter().filter(|(.., [from, to], _)| (*from..=*to).contains(&w));
        crossing
            .map(|(x, y, _, r)| {
                let at = |k: &[f64; 3], a: usize| (k[0] + k[1] * w + k[2] * w * w + 1.0) * self.half[a];
                Vein { center: [at(x, 0), at(y, 1) - RAISED * self.half[1]], radius: r * self.half[0] }
            })
            .collect()
    }

    fn place(&self, c: Coord, p: [f64; 3]) -> Place {
        Place { c, p, u: std::array::from_fn(|a| p[a] / self.half[a] - 1.0) }
    }

    /// Value of a voxel, a whole number from 0 to 4095.
    fn value(&self, Place { c, p, u }: Place, bodies: &[&Body], vessels: &[Vein]) -> f64 {
        if let Some(hard) = insert::plate(c, u) {
            return hard.round();
        }
        let mut value = insert::table(u, self.voxel);
        for body in bodies {
            let depth = body.depth(p);
            // Blurred over one voxel, as a scanner does.
            let cover = edge(depth, 1.0);
            if cover > 0.0 {
                value += (anatomy::filling(body.paint, p, u, depth, self.voxel).value() - value) * cover;
            }
        }
        for vein in vessels {
            value += (BLOOD - value) * vein.cover(p);
        }
        if value == AIR {
            return AIR;
        }
        // Grain of a reconstruction: two octaves, finest two voxels wide.
        let grain = 16.0 * noise::smooth(p, 2.0, 7) + 8.0 * noise::smooth(p, 3.7, 8);
        (value + grain).round().clamp(0.0, 4095.0)
    }
}

impl Vein {
    /// Share of the voxel at `p` that it covers.
    fn cover(&self, p: [f64; 3]) -> f64 {
        let Vein { center: [x, y], radius } = *self;
        let distance = ((p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y)).sqrt();
        edge(radius - distance, 1.0)
    }
}

impl Body {
    /// About how far `p` lies below the surface, in voxels; negative outside.
    fn depth(&self, p: [f64; 3]) -> f64 {
        let mut d: [f64; 3] = std::array::from_fn(|a| p[a] - self.center[a]);
        d[0] -= self.lean * d[1];
        let (mut q, mut g) = (0.0, 0.0);
        for (d, r) in d.into_iter().zip(self.radius) {
            q += (d / r) * (d / r);
            g += (d / (r * r)) * (d / (r * r));
        }
        // First-order distance to the surface q = 1; at the centre the smallest radius.
        if g == 0.0 { self.radius.into_iter().fold(f64::INFINITY, f64::min) } else { (1.0 - q.sqrt()) * (q / g).sqrt() }
    }
}
