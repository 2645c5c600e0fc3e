//! The shaders in Rust: same files, same functions, same order of operations, in f32 as on the GPU or in f64 as the truth, and
//! every fetch counted. What `shaders/*.wgsl` do to textures, this does to the same bytes in memory.

mod camera;
pub mod counter;
mod cut_plane;
mod gradient;
mod gradient_reuse;
mod iso;
pub mod opacity;
mod raycast;
pub mod real;
mod sample;
mod shade;
mod skip;
mod slice;
mod source_raw;
mod source_s3dc;
pub mod source_zerobit;
mod transfer;

pub use camera::{Ray, clip_ray, direction_of, origin_of, ray_of};
pub use counter::{Counter, Free, Work};
pub use cut_plane::cut;
pub use raycast::trace;
pub use real::{Real, V3};
pub use sample::{base_of, lerp, sample};
pub use slice::slices;
pub use transfer::{Point, classify, grey, points_top};

use crate::gpu::level::HostLevel;
use crate::gpu::{Effects, Lens, Projection, Sampler, Traversal, key::Gradient};

/// What a picture is made with: `Frame` of the shaders, and what is constant in them.
#[derive(Clone, Debug)]
#[allow(missing_docs, reason = "told in gpu::layout::Frame and gpu::PipelineKey")]
pub struct Frame<R> {
    pub lens: Lens,
    pub traversal: Traversal,
    pub projection: Projection,
    pub sampler: Sampler,
    pub gradient: Gradient,
    pub effects: Effects,
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub film: [R; 2],
    pub pixel: R,
    pub nearest: R,
    pub step: R,
    pub enough: R,
    pub iso: R,
    pub ambient: R,
    pub diffuse: R,
    pub specular: R,
    pub shininess: R,
    pub time: R,
    pub base: V3<R>,
    pub right_at: V3<R>,
    pub up_at: V3<R>,
    pub forward: V3<R>,
    pub right: V3<R>,
    pub up: V3<R>,
    pub clip_lo: V3<R>,
    pub clip_hi: V3<R>,
    pub plane: [R; 4],
}

/// A volume: its level in memory, and `VolumeParams` of the shaders.
#[derive(Clone, Debug)]
#[allow(missing_docs, reason = "told in gpu::layout::VolumeParams")]
pub struct Volume<'a, R> {
    pub level: &'a HostLevel,
    /// Visible bricks, x fastest; empty where nothing is skipped.
    pub visible: &'a [u8],
    pub base: V3<R>,
    pub ratio: R,
    pub right_at: V3<R>,
    pub up_at: V3<R>,
    pub forward: V3<R>,
    pub right: V3<R>,
    pub up: V3<R>,
    pub box_lo: V3<R>,
    pub box_hi: V3<R>,
    pub world_x: V3<R>,
    pub world_y: V3<R>,
    pub world_z: V3<R>,
    pub last: [i32; 3],
    pub points: Vec<Point<R>>,
}

/// A value of a volume: a scalar, or red, green and blue from 0 to 255.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<R> {
    /// One number.
    Scalar(R),
    /// Three.
    Colour(V3<R>),
}

impl<R: Real> Value<R> {
    /// a + (b − a)·t: constant fields stay constant.
    #[must_use]
    pub fn mix(self, b: Self, t: R) -> Self {
        self.zip(b, |a, b| a + (b - a) * t)
    }

    /// A function of each component of both.
    #[must_use]
    pub fn zip(self, b: Self, f: impl Fn(R, R) -> R) -> Self {
        match (self, b) {
            (Value::Scalar(a), Value::Scalar(b)) => Value::Scalar(f(a, b)),
            (Value::Colour(a), Value::Colour(b)) => Value::Colour(std::array::from_fn(|i| f(a[i], b[i]))),
            (a, _) => a,
        }
    }
}

/// A whole number that a shader turns into i32: saturates.
#[allow(clippy::cast_possible_truncation, reason = "saturating is what is meant")]
fn index<R: Real>(v: R) -> i32 {
    v.to_f64() as i32
}

/// The colour of a pixel: premultiplied red, green, blue, opacity. `volumes` are those that are seen, each one volume or a volume at
/// two time steps.
pub fn pixel<R: Real>(frame: &Frame<R>, volumes: &[&[Volume<'_, R>]], ray: &Ray<R>, n: &mut impl Counter) -> [R; 4] {
    match frame.traversal {
        Traversal::Raycast => trace(frame, volumes, ray, n),
        Traversal::Slice => slices(frame, volumes, ray, n),
        Traversal::CutPlane => cut(frame, volumes, ray, n),
    }
}

/// Voxel `c` of the level, which lies inside.
pub fn voxel<R: Real>(v: &Volume<'_, R>, c: [u32; 3], n: &mut impl Counter) -> Value<R> {
    use crate::gpu::level::Store;
    use crate::voxel::SampleType;
    match v.level.layout.store {
        Store::Raw { .. } => source_raw::voxel(v, c, n),
        Store::S3dc { .. } => source_s3dc::voxel(v, c, n),
        Store::Zerobit { sample, .. } => {
            let [r, g, b] = source_zerobit::voxel(v.level, c, n).map(|v| R::of(v.into()));
            if sample == SampleType::Rgb8 { Value::Colour([r, g, b]) } else { Value::Scalar(r) }
        }
    }
}

/// What the volume is at a place: of two time steps, between them.
pub fn value<R: Real>(frame: &Frame<R>, v: &[Volume<'_, R>], p: V3<R>, n: &mut impl Counter) -> Value<R> {
    let before = sample(frame, &v[0], p, n);
    match v {
        [_, after] => before.mix(sample(frame, after, p, n), frame.time),
        _ => before,
    }
}

/// The gradient there, per voxel.
pub fn slope<R: Real>(frame: &Frame<R>, v: &[Volume<'_, R>], p: V3<R>, n: &mut impl Counter) -> V3<R> {
    let before = gradient::gradient(frame, &v[0], p, n);
    match v {
        [_, after] => {
            let after = gradient::gradient(frame, after, p, n);
            std::array::from_fn(|a| before[a] + (after[a] - before[a]) * frame.time)
        }
        _ => before,
    }
}
