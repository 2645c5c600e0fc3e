//! From a plan to the numbers that shaders and mirror compute with: cameras in index coordinates, steps, control points. In f64,
//! rounded at the end.

use super::camera::{View, inverse, to_level};
use super::mirror::{self, Point, Real, V3, real::vec};
use super::plan::{Plan, PlannedLevel};
use super::scene::Scene;
use super::transfer::TransferFunction;
use crate::error::Result;
use crate::gpu::layout;
use crate::gpu::pass::decode::source_constants;
use crate::gpu::{Lens, Traversal};

/// Distance ahead of the eye at which rays are said to start: that of the view's centre.
fn ahead(view: &View) -> f64 {
    -dot(view.from_center, view.forward)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn along(a: [f64; 3], t: f64, b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + t * b[i])
}

/// What a film coordinate moves the start of a ray by, of what it moves its direction by.
fn spread(view: &View) -> f64 {
    match view.lens {
        Lens::Perspective => ahead(view),
        Lens::Orthographic => 1.0,
    }
}

/// The frame of a picture; `lies` are the plan's levels, seen from there.
#[must_use]
pub fn frame<R: Real>(plan: &Plan, scene: &Scene, view: &View, lies: &[Lies]) -> mirror::Frame<R> {
    let r = R::of;
    let (nearest, samples) = match plan.key.traversal {
        Traversal::Slice => slabs(plan, view, lies),
        Traversal::Raycast | Traversal::CutPlane => (-ahead(view), plan.samples),
    };
    let (depth, spread) = (ahead(view), spread(view));
    let from_centre = |p: [f64; 3]| along(p, -1.0, view.center);
    let shading = scene.shading.unwrap_or_default();
    let clip = scene.clip.map(|c| [from_centre(c.min), from_centre(c.max)]).unwrap_or_default();
    let plane = scene.plane.map_or([0.0; 4], |p| {
        // By the largest component first: normals of any length.
        let most = p.normal.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let n = p.normal.map(|v| v / most);
        let n = n.map(|v| v / dot(n, n).sqrt());
        [n[0], n[1], n[2], dot(n, from_centre(p.point))]
    });
    mirror::Frame {
        lens: view.lens,
        traversal: plan.key.traversal,
        projection: plan.key.projection,
        sampler: plan.key.sampler,
        gradient: plan.key.gradient,
        effects: plan.key.effects,
        width: view.size[0],
        height: view.size[1],
        samples,
        film: view.film(0.0, 0.0).map(r),
        pixel: r(view.pixel),
        nearest: r(nearest),
        step: r(plan.step),
        enough: r(1.0 - scene.early_out.unwrap_or(0.0)),
        iso: r(scene.iso.unwrap_or(0.0)),
        ambient: r(shading.ambient),
        diffuse: r(shading.diffuse),
        specular: r(shading.specular),
        shininess: r(shading.shininess),
        time: r(scene.volumes[0].time.fract()),
        base: vec(along(view.from_center, depth, view.forward)),
        right_at: vec(view.right.map(|v| v * spread)),
        up_at: vec(view.up.map(|v| v * spread)),
        forward: vec(view.forward),
        right: vec(view.right),
        up: vec(view.up),
        clip_lo: vec(clip[0]),
        clip_hi: vec(clip[1]),
        plane: plane.map(r),
    }
}

/// Where the first slab of slices begins (t of the ray of the middle of the film), and how many it takes to the far end of all
/// volumes.
fn slabs(plan: &Plan, view: &View, lies: &[Lies]) -> (f64, u32) {
    let (near, far) = lies
        .iter()
        .map(Lies::depths)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |all, [near, far]| (all.0.min(near), all.1.max(far)));
    let near = near.max(-ahead(view));
    // Rounding may put the far end behind the last slab.
    let count = ((far - near) / plan.step + 1e-6).ceil();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturating is what is meant")]
    (near, (count as u32).min(plan.samples.saturating_add(1)))
}

/// The camera, box and gradient of a volume in index coordinates of a level.
#[derive(Clone, Copy, Debug)]
pub struct Lies {
    base: [f64; 3],
    right_at: [f64; 3],
    up_at: [f64; 3],
    forward: [f64; 3],
    right: [f64; 3],
    up: [f64; 3],
    box_hi: [f64; 3],
    world: [[f64; 3]; 3],
    ratio: f64,
    last: [i32; 3],
}

impl Lies {
    /// Of all levels of a plan.
    ///
    /// # Errors
    /// Those of [`Lies::of`].
    pub fn all(plan: &Plan, view: &View) -> Result<Vec<Lies>> {
        plan.levels.iter().map(|level| Lies::of(level, view, plan.step)).collect()
    }

    /// Between which depths the box lies: world lengths along the viewing direction, from where rays start.
    fn depths(&self) -> [f64; 2] {
        // The part of a corner along `forward`, of forward, right and up.
        let sideways = cross(self.right, self.up);
        let unit = dot(self.forward, sideways);
        let corners = (0..8u32).map(|i| {
            let corner = std::array::from_fn(|a| if i >> a & 1 == 1 { self.box_hi[a] } else { -0.5 });
            dot(along(corner, -1.0, self.base), sideways) / unit
        });
        corners.fold([f64::INFINITY, f64::NEG_INFINITY], |[near, far], z| [near.min(z), far.max(z)])
    }

    /// Of a level seen from `view`, with samples `step` world units apart.
    ///
    /// # Errors
    /// Those of [`crate::affine::Placement::check`].
    pub fn of(level: &PlannedLevel, view: &View, step: f64) -> Result<Lies> {
        let lod = level.at.lod;
        let rays = view.rays_in(&level.placement, level.extent, lod)?;
        // Volumes side by side have their middles at different depths; all rays start at that of the view's centre.
        let base = along(rays.focus, ahead(view) - rays.depth, rays.forward);
        let per_level = f64::from(1u32 << lod);
        Ok(Lies {
            base,
            right_at: rays.right.map(|v| v * spread(view)),
            up_at: rays.up.map(|v| v * spread(view)),
            forward: rays.forward,
            right: rays.right,
            up: rays.up,
            box_hi: to_level(level.extent.to_array().map(|n| f64::from(n) - 0.5), lod),
            world: inverse(&level.placement)?.map(|row| row.map(|v| v / per_level)),
            ratio: step / level.reference,
            last: level.layout.extent.to_array().map(|n| i32::try_from(n).unwrap_or(i32::MAX) - 1),
        })
    }

    /// For the mirror.
    #[must_use]
    pub fn volume<'a, R: Real>(
        &self,
        level: &'a crate::gpu::level::HostLevel,
        visible: &'a [u8],
        transfer: &TransferFunction,
    ) -> mirror::Volume<'a, R> {
        let points = points(transfer).into_iter().map(|p| Point {
            color: p.color.map(R::of),
            slope: p.slope.map(R::of),
            value: R::of(p.value),
            per_value: R::of(p.per_value),
        });
        let v = |v: [f64; 3]| -> V3<R> { vec(v) };
        mirror::Volume {
            level,
            visible,
            base: v(self.base),
            ratio: R::of(self.ratio),
            right_at: v(self.right_at),
            up_at: v(self.up_at),
            forward: v(self.forward),
            right: v(self.right),
            up: v(self.up),
            box_lo: v([-0.5; 3]),
            box_hi: v(self.box_hi),
            world_x: v(self.world[0]),
            world_y: v(self.world[1]),
            world_z: v(self.world[2]),
            last: self.last,
            points: points.collect(),
        }
    }

    /// For the GPU.
    #[must_use]
    pub fn params(&self, level: &PlannedLevel, transfer: &TransferFunction) -> layout::VolumeParams {
        let v = narrow;
        let mut params: layout::VolumeParams = bytemuck::Zeroable::zeroed();
        let fold = level.layout.fold;
        let texture = level.layout.decoded.or(level.layout.textures.first().copied());
        params.base = v(self.base);
        params.ratio = f32::of(self.ratio);
        params.right_at = v(self.right_at);
        params.full_scale = texture.map_or(1.0, |t| t.format.scale());
        params.up_at = v(self.up_at);
        params.forward = v(self.forward);
        params.right = v(self.right);
        params.up = v(self.up);
        params.box_lo = [-0.5; 3];
        params.box_hi = v(self.box_hi);
        params.world_x = v(self.world[0]);
        params.world_y = v(self.world[1]);
        params.world_z = v(self.world[2]);
        params.last = self.last;
        params.fold_tile = fold.tile;
        params.fold_tiles = fold.tiles;
        params.fold_grid = fold.grid;
        params.brick = level.layout.extent.to_array().map(|n| n.min(1 << level.layout.brick_log2));
        params.bricks = level.layout.bricks;
        for (to, p) in params.points.iter_mut().zip(points(transfer)) {
            to.color = p.color.map(f32::of);
            to.slope = p.slope.map(f32::of);
            to.value = f32::of(p.value);
            to.per_value = f32::of(p.per_value);
        }
        params
    }
}

fn narrow(v: [f64; 3]) -> [f32; 3] {
    vec(v)
}

/// The control points of a transfer function, and the ways between them.
fn points(transfer: &TransferFunction) -> Vec<Point<f64>> {
    let all = transfer.points();
    let rgba = |i: usize| {
        let p = &all[i];
        [p.color[0], p.color[1], p.color[2], p.alpha].map(f64::from)
    };
    let way = |i: usize| {
        let to = all.get(i + 1).filter(|n| n.value > all[i].value)?;
        // Finite for the closest of f32: 0 · ∞ would be no number.
        let per_value = (1.0 / (to.value - all[i].value)).min(f64::from(f32::MAX));
        let (a, b) = (rgba(i), rgba(i + 1));
        Some((std::array::from_fn(|c| b[c] - a[c]), per_value))
    };
    (0..all.len())
        .map(|i| {
            let (slope, per_value) = way(i).unwrap_or(([0.0; 4], 0.0));
            Point { color: rgba(i), slope, value: all[i].value, per_value }
        })
        .collect()
}

/// The frame as bytes for the GPU; rows `first_row` and `rows` on are those of one dispatch.
#[must_use]
pub fn frame_bytes(frame: &mirror::Frame<f32>, first_row: u32, rows: u32) -> layout::Frame {
    let mut out: layout::Frame = bytemuck::Zeroable::zeroed();
    out.width = frame.width;
    out.rows = rows;
    out.first_row = first_row;
    out.samples = frame.samples;
    out.film = frame.film;
    out.pixel = frame.pixel;
    out.nearest = frame.nearest;
    out.step = frame.step;
    out.enough = frame.enough;
    out.iso = frame.iso;
    out.ambient = frame.ambient;
    out.diffuse = frame.diffuse;
    out.specular = frame.specular;
    out.shininess = frame.shininess;
    out.time = frame.time;
    out.base = frame.base;
    out.right_at = frame.right_at;
    out.up_at = frame.up_at;
    out.forward = frame.forward;
    out.right = frame.right;
    out.up = frame.up;
    out.clip_lo = frame.clip_lo;
    out.clip_hi = frame.clip_hi;
    out.plane = frame.plane;
    out
}

/// Values of the `override` constants of a plan's shader.
#[must_use]
pub fn overrides(plan: &Plan, scene: &Scene) -> Vec<(String, f64)> {
    let mut all = Vec::new();
    for (i, level) in plan.levels.iter().enumerate() {
        all.push((format!("BRICK_LOG2_{i}"), level.layout.brick_log2.into()));
        let points = scene.volumes[level.volume].transfer.points().len();
        all.push((format!("POINTS_{i}"), points as f64));
        all.push((format!("POINTS_TOP_{i}"), mirror::points_top(points) as f64));
        if level.layout.decoded.is_none() {
            all.extend(source_constants(&level.layout, i));
        }
    }
    all
}
