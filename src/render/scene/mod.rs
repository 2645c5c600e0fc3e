//! Scenes: what is to be seen, from where, and how. All that a scene does not name is not there, and costs nothing.

mod file;
pub(in crate::render) mod named;
mod resolve;
#[cfg(test)]
mod tests;
mod transfer_spec;

pub use file::{EarlyOut, IsoSurface, LodPixels, SceneFile, VolumeSpec};
pub use transfer_spec::TransferSpec;

use super::camera::CameraSpec;
use super::transfer::TransferFunction;
use crate::error::{Error, Result};
use crate::gpu::key::Gradient;
pub use crate::gpu::key::MAX_VOLUMES;
use crate::gpu::{Effect, Effects, Projection, Sampler, Source, Traversal};
use serde::{Deserialize, Serialize};

/// Most samples along a ray: a finer step is refused, so that no picture takes for ever.
pub const MAX_SAMPLES: u32 = 1 << 20;
/// Opacity that is left open where rays end early, unless a scene says otherwise.
pub const EARLY_OUT: f64 = 1.0 / 1024.0;

/// A scene whose volumes are open: everything in it is a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// One to three volumes, all in one world.
    pub volumes: Vec<SceneVolume>,
    /// Where it is seen from.
    pub camera: CameraSpec,
    /// Width and height of the picture, in pixels.
    pub size: [u32; 2],
    /// Distance of samples along a ray, in units of the smallest spacing of level 0.
    pub step: f64,
    /// How values between voxels are found.
    pub sampler: Sampler,
    /// What they are taken from.
    pub source: Source,
    /// How samples are laid through the volume.
    pub traversal: Traversal,
    /// What becomes of the samples of a ray.
    pub projection: Projection,
    /// Colour behind the volume: red, green, blue, 0 to 1.
    pub background: [f32; 3],
    /// Rays end where less than this is left of what lies behind.
    pub early_out: Option<f64>,
    /// Whether bricks that cannot be seen are jumped over.
    pub empty_skip: bool,
    /// Whether bricks that cannot be seen are not uploaded (their texels stay 0); only together with `empty_skip`.
    pub tf_cull: bool,
    /// Lighting.
    pub shading: Option<Shading>,
    /// Level of detail.
    pub lod: Lod,
    /// The part that is shown: smallest and largest corner, in world units.
    pub clip: Option<ClipBox>,
    /// The plane of [`Traversal::CutPlane`].
    pub plane: Option<Plane>,
    /// The value of [`Projection::Iso`], in sample units.
    pub iso: Option<f64>,
    /// Whether values between two time steps are mixed; else times are whole steps.
    pub time_interp: bool,
}

/// One volume of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneVolume {
    /// Where it was read from, if it has a name.
    pub path: Option<String>,
    /// Channel, from 0.
    pub channel: u32,
    /// Time step, from 0; a fraction lies between two of them.
    pub time: f64,
    /// Colour and opacity of its values.
    pub transfer: TransferFunction,
    /// Corners of what was there to be seen when the scene was resolved, in world units from the volume's middle: what a
    /// camera frames that is not told where to stand. Of none, it frames the volume's box.
    pub seen: Vec<[f64; 3]>,
}

/// Which level of detail is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lod {
    /// The coarsest whose voxels are no larger than this many pixels.
    Auto {
        /// Size of a voxel on the screen, at most.
        pixels: f64,
    },
    /// This one; 0 is the finest.
    Level(u8),
}

/// Lighting from the camera (Blinn and Phong), by the gradient of the values in world units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Shading {
    /// Share of the colour that is seen without light.
    pub ambient: f64,
    /// Share that grows with the light's incidence.
    pub diffuse: f64,
    /// Strength of the highlight, which is white.
    pub specular: f64,
    /// Sharpness of the highlight.
    pub shininess: f64,
    /// How gradients are fetched: `naive` or `reuse`, which is the same image.
    #[serde(with = "named::gradient")]
    pub gradient: Gradient,
}

impl Default for Shading {
    fn default() -> Self {
        Shading { ambient: 0.3, diffuse: 0.7, specular: 0.2, shininess: 20.0, gradient: Gradient::Reuse }
    }
}

/// A box in world units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClipBox {
    /// Smallest corner.
    #[serde(deserialize_with = "named::exact")]
    pub min: [f64; 3],
    /// Largest corner.
    #[serde(deserialize_with = "named::exact")]
    pub max: [f64; 3],
}

/// A plane in world units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A point in it.
    #[serde(deserialize_with = "named::exact")]
    pub point: [f64; 3],
    /// What is perpendicular to it, of any length but 0.
    #[serde(deserialize_with = "named::exact")]
    pub normal: [f64; 3],
}

impl Scene {
    /// The effects that the scene asks for.
    #[must_use]
    pub fn effects(&self) -> Effects {
        [
            (Effect::GradientShading, self.shading.is_some()),
            (Effect::EmptySkip, self.empty_skip),
            (Effect::TfCull, self.tf_cull),
            (Effect::Lod, matches!(self.lod, Lod::Auto { .. })),
            (Effect::EarlyOut, self.early_out.is_some()),
            (Effect::ClipBox, self.clip.is_some()),
            (Effect::TimeInterp, self.time_interp),
        ]
        .into_iter()
        .filter_map(|(effect, on)| on.then_some(effect))
        .collect()
    }

    /// The same scene without one of its effects. Without `empty_skip` there is no `tf_cull`: what is not in memory must be jumped
    /// over. Without `lod` it shows level 0; without `time_interp` the step before.
    #[must_use]
    pub fn without(&self, effect: Effect) -> Scene {
        let mut scene = self.clone();
        match effect {
            Effect::GradientShading => scene.shading = None,
            Effect::EmptySkip => (scene.empty_skip, scene.tf_cull) = (false, false),
            Effect::TfCull => scene.tf_cull = false,
            Effect::Lod => scene.lod = Lod::Level(0),
            Effect::EarlyOut => scene.early_out = None,
            Effect::ClipBox => scene.clip = None,
            Effect::TimeInterp => {
                scene.time_interp = false;
                scene.volumes.iter_mut().for_each(|v| v.time = v.time.floor());
            }
        }
        scene
    }

    /// Whether an effect changes anything in such a picture; what does not is refused where it is asked for by name.
    #[must_use]
    pub fn applies(effect: Effect, traversal: Traversal, projection: Projection) -> bool {
        let in_depth = traversal != Traversal::CutPlane;
        let by_opacity = in_depth && matches!(projection, Projection::Composite | Projection::Iso);
        match effect {
            Effect::GradientShading => by_opacity,
            Effect::EmptySkip | Effect::TfCull => by_opacity && traversal == Traversal::Raycast,
            Effect::EarlyOut => traversal == Traversal::Raycast && projection == Projection::Composite,
            Effect::ClipBox | Effect::Lod | Effect::TimeInterp => true,
        }
    }

    /// Checks every number that needs no volume.
    ///
    /// # Errors
    /// `E_PARAM` naming the field, and those of [`CameraSpec::check`].
    pub fn check(&self) -> Result<()> {
        let bad = |field: &'static str, message: String| Err(Error::param(field, message));
        self.camera.check(self.size)?;
        if self.volumes.is_empty() || self.volumes.len() > MAX_VOLUMES {
            return bad("volume", format!("{} volumes; a scene has 1 to {MAX_VOLUMES}", self.volumes.len()));
        }
        // hard case R-07; how many samples there would be is known to the plan
        if !(self.step > 0.0 && self.step.is_finite()) {
            return bad("step", format!("{}; it must be a positive number of voxels", self.step));
        }
        if !self.background.iter().all(|v| (0.0..=1.0).contains(v)) {
            return bad("background", format!("{:?}; red, green and blue must lie in 0 to 1", self.background));
        }
        if self.early_out.is_some_and(|rest| !(rest > 0.0 && rest < 1.0)) {
            return bad("early_out.remaining", "it must lie between 0 and 1".into());
        }
        if let Some(s) = self.shading {
            let all = [s.ambient, s.diffuse, s.specular, s.shininess];
            if !all.iter().all(|v| (0.0..=1000.0).contains(v)) {
                return bad("shading", format!("{all:?}; factors and shininess must lie in 0 to 1000"));
            }
        }
        if matches!(self.lod, Lod::Auto { pixels } if !(pixels > 0.0 && pixels.is_finite())) {
            return bad("lod.pixels", "it must be a positive number".into());
        }
        if let Some(ClipBox { min, max }) = self.clip
            && !(0..3).all(|a| min[a] < max[a] && min[a].is_finite() && max[a].is_finite())
        {
            return bad("clip_box", format!("from {min:?} to {max:?} there is nothing; min must be below max"));
        }
        match (self.traversal, self.plane) {
            (Traversal::CutPlane, None) => return bad("cut_plane", "which plane? Give its point and normal".into()),
            (Traversal::CutPlane, Some(p)) => {
                let finite = p.point.iter().chain(&p.normal).all(|v| v.is_finite());
                if !finite || p.normal.iter().all(|v| *v == 0.0) {
                    return bad("cut_plane.normal", format!("{p:?} is no plane: its normal has no direction"));
                }
            }
            (_, Some(_)) => return bad("cut_plane", "it is for traversal = \"cut_plane\" only".into()),
            (_, None) => {}
        }
        match (self.projection, self.iso) {
            (Projection::Iso, None) => {
                return bad("iso_surface", "which value? Give iso_surface = { value = … }".into());
            }
            (Projection::Iso, Some(v)) if !v.is_finite() => {
                return bad("iso_surface.value", format!("{v} is no number"));
            }
            (Projection::Iso, Some(_)) | (_, None) => {}
            (_, Some(_)) => return bad("iso_surface", "it is for projection = \"iso\" only".into()),
        }
        if self.time_interp && self.volumes.len() > 1 {
            let message = "between two time steps a scene has one volume; show the others at whole steps, in a picture of their own";
            return bad("time_interp", message.into());
        }
        if self.tf_cull && !self.empty_skip {
            let message =
                "tf_cull goes with empty_skip: what is not in memory must be jumped over; name both or neither";
            return bad("effects", message.into());
        }
        for effect in self.effects().iter() {
            if !Scene::applies(effect, self.traversal, self.projection) {
                let (traversal, projection) = (self.traversal, self.projection);
                return bad(
                    "effects",
                    format!("{effect} does nothing with {traversal} and {projection}; leave it out"),
                );
            }
        }
        for v in &self.volumes {
            if !(v.time >= 0.0 && v.time.is_finite()) {
                return bad("volume.time", format!("{} is no time step; they count from 0", v.time));
            }
            if v.time.fract() != 0.0 && !self.time_interp {
                let message = format!("{} lies between two steps; name the effect time_interp to mix them", v.time);
                return bad("volume.time", message);
            }
        }
        Ok(())
    }
}
