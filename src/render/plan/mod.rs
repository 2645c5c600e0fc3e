//! Plans: a scene and its volumes become exactly the levels, uploads, bindings and passes that the picture needs.

mod cull;
mod device;
mod explain;
mod fetches;
mod passes;
mod seen;
#[cfg(test)]
mod tests;
mod visible;

pub use fetches::{Fetches, fetches};
pub(super) use passes::band_rows;
pub use passes::{PlannedBinding, PlannedPass};
pub(super) use seen::seen;
pub use visible::{BrickMask, LevelBounds};

use super::camera::{View, level_for, radius, spacing_ends};
use super::scene::{Lod, MAX_SAMPLES, Scene};
use crate::affine::Placement;
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::gpu::key::{Form, Texel};
use crate::gpu::level::{Fit, LevelLayout, TexelFormat};
use crate::gpu::pass::decode;
use crate::gpu::{Effect, Effects, PipelineKey, Projection, Sampler, VolumeKey};
use crate::volume::{At, Volume};

/// What it takes to render one scene.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What decides about shader text, pipeline and bindings.
    pub key: PipelineKey,
    /// Where the scene is seen from.
    pub view: View,
    /// Distance of samples along a ray, in world units.
    pub step: f64,
    /// Most samples of a ray.
    pub samples: u32,
    /// The levels that are needed; between two time steps both of them, one after the other.
    pub levels: Vec<PlannedLevel>,
    /// What is run for each picture, in order; first what is run once.
    pub passes: Vec<PlannedPass>,
    /// Effects that are there, also those that no shader has: what is loaded, and of which level.
    pub effects: Effects,
    /// Effects that are not there, and why.
    pub left_out: Vec<(Effect, String)>,
}

/// One level of one volume.
#[derive(Clone, Debug)]
pub struct PlannedLevel {
    /// Which of the scene's volumes it belongs to.
    pub volume: usize,
    /// Time step, channel and level of detail.
    pub at: At,
    /// Where the volume lies; of level 0.
    pub placement: Placement,
    /// Voxels of level 0.
    pub extent: Extent,
    /// Reference length of opacity: the smallest spacing of level 0, in world units.
    pub reference: f64,
    /// How the level lies in textures or buffers.
    pub layout: LevelLayout,
    /// What the shader sees of it.
    pub key: VolumeKey,
    /// Value and error bounds of each brick.
    pub bounds: LevelBounds,
    /// Bricks that hold something to be seen: what the rays visit, where they skip.
    pub visible: BrickMask,
    /// Those of them that the views show for which the plan was made; all, as long as it is made for all sides.
    pub in_view: BrickMask,
    /// Bricks that are needed in memory.
    pub wanted: BrickMask,
    /// Why this level.
    pub reason: String,
}

impl Plan {
    /// Plans a scene for a device that holds what `fit` says. Index pages are read, no bricks.
    ///
    /// # Errors
    /// Those of [`Scene::check`], of cameras, and of [`LevelLayout::new`] (`E_LIMIT` says what would fit); `E_LIMIT` for a
    /// step so fine that a ray would have more than [`MAX_SAMPLES`] samples, and where all levels together are too much for
    /// the device's memory or for one shader.
    pub fn new(scene: &Scene, volumes: &[&Volume], fit: &Fit) -> Result<Plan> {
        scene.check()?;
        if volumes.len() != scene.volumes.len() {
            let message = format!("{} are open, the scene has {}", volumes.len(), scene.volumes.len());
            return Err(Error::param("volume", message));
        }
        let boxes: Vec<(&Placement, Extent)> = volumes.iter().map(|v| (&v.info().placement, v.info().dims)).collect();
        let seen: Vec<&[[f64; 3]]> = scene.volumes.iter().map(|v| &v.seen[..]).collect();
        let view = scene.camera.resolve_seen(&boxes, &seen, scene.size)?;
        let finest = boxes.iter().map(|(p, _)| spacing_ends(p).1).fold(f64::INFINITY, f64::min);
        let step = scene.step * finest;
        let (samples, longest) = samples(&boxes, step)?;
        // A longer step is one sample all the same, and may be more than f32 holds.
        let step = step.min(longest);
        let mut levels = Vec::new();
        for (i, volume) in volumes.iter().enumerate() {
            levels.extend(planned_levels(scene, i, volume, &view, step, fit)?);
        }
        let key = PipelineKey {
            traversal: scene.traversal,
            projection: scene.projection,
            lens: view.lens,
            sampler: scene.sampler,
            gradient: scene.shading.map(|s| s.gradient).unwrap_or_default(),
            // What the CPU does is in no shader.
            effects: scene.effects().without(Effect::TfCull).without(Effect::Lod),
            volumes: levels.iter().map(|l| l.key).collect(),
        };
        key.check()?;
        device::check(scene, volumes, fit, &key, &mut levels)?;
        let passes = passes::passes(&key, scene, &levels, fit);
        let left_out = left_out(scene);
        Ok(Plan { key, view, step, samples, levels, passes, effects: scene.effects(), left_out })
    }

    /// Bytes of all textures and buffers of the levels.
    #[must_use]
    pub fn level_bytes(&self) -> u64 {
        self.levels.iter().map(|l| l.layout.bytes()).fold(0, u64::saturating_add)
    }
}

/// Most samples of a ray, through all volumes, corner to corner; and a length that no ray reaches. // hard case R-07
fn samples(boxes: &[(&Placement, Extent)], step: f64) -> Result<(u32, f64)> {
    // The camera's sphere holds the common box; a ray is no longer than its diameter.
    let longest = match boxes {
        [(placement, extent)] => 2.0 * radius(placement, *extent),
        _ => 2.0 * super::camera::radius_of_all(boxes),
    };
    let samples = (longest / step).ceil() + 1.0;
    if samples > f64::from(MAX_SAMPLES) {
        let message = format!(
            "a ray would have {samples:.0} samples, of {MAX_SAMPLES} at most; take a step of {:.3e} or more of the present one",
            samples / f64::from(MAX_SAMPLES)
        );
        return Err(Error::new(Code::Limit, "step", message));
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
    Ok((samples as u32, 2.0 * longest))
}

/// The level of one volume of the scene; two where the picture lies between two time steps.
fn planned_levels(
    scene: &Scene,
    i: usize,
    volume: &Volume,
    view: &View,
    step: f64,
    fit: &Fit,
) -> Result<Vec<PlannedLevel>> {
    let (info, shown) = (volume.info(), &scene.volumes[i]);
    let (lod, reason) = match scene.lod {
        Lod::Level(lod) if lod >= info.lod_count => {
            let message = format!("level {lod}: the volume has levels 0 to {}", info.lod_count - 1);
            return Err(Error::new(Code::Range, "level", message));
        }
        Lod::Level(lod) => (lod, "the scene says so".to_owned()),
        Lod::Auto { pixels } => {
            let choice = level_for(view, &info.placement, info.dims, info.lod_count, pixels)?;
            (choice.lod, choice.reason)
        }
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked against the time steps")]
    let first = shown.time as u32;
    if shown.time > f64::from(info.time_steps - 1) || shown.channel >= info.channels {
        let message =
            format!("time {} of {}, channel {} of {}", shown.time, info.time_steps, shown.channel, info.channels);
        return Err(Error::new(Code::Range, "volume", message));
    }
    // At the last step there is none behind it to be read (hard case R-27): it is mixed with itself.
    let second = (first + 1).min(info.time_steps - 1);
    let times = if scene.time_interp { vec![first, second] } else { vec![first] };
    let bounds = times.iter().map(|&time| LevelBounds::of(volume, At { time, channel: shown.channel, lod }));
    let bounds = bounds.collect::<Result<Vec<_>>>()?;
    // What is seen in either of two time steps, or between them, is seen in both.
    let both = bounds.iter().skip(1).try_fold(bounds[0].clone(), |a, b| a.joined(b))?;
    let visible = visible::visible(scene, &shown.transfer, &both, step, &info.placement.moved(lod, [0; 3]));
    let wanted = if scene.tf_cull { visible::wanted(scene, &visible) } else { BrickMask::all(both.bricks) };
    let layouts = times.into_iter().map(|time| {
        let at = At { time, channel: shown.channel, lod };
        match scene.sampler {
            Sampler::HwLinear => LevelLayout::new_filtered(volume, at, scene.source, fit),
            _ => LevelLayout::new(volume, at, scene.source, fit),
        }
    });
    let planned = layouts.zip(bounds).map(|(layout, bounds)| {
        let layout = layout?;
        Ok(PlannedLevel {
            volume: i,
            at: layout.at,
            placement: info.placement.clone(),
            extent: info.dims,
            reference: spacing_ends(&info.placement).1,
            key: volume_key(&layout),
            layout,
            bounds,
            visible: visible.clone(),
            in_view: visible.clone(),
            wanted: wanted.clone(),
            reason: reason.clone(),
        })
    });
    planned.collect()
}

/// What of a layout decides about shader text.
#[must_use]
pub fn volume_key(layout: &LevelLayout) -> VolumeKey {
    let pages = layout.pages.map_or(1, |p| p.stream_bytes.div_ceil(p.page_bytes.max(1)).max(1) as u32);
    let key = decode::volume_key(layout, pages);
    match layout.decoded {
        // The decode pass has written floats, or the components of colours.
        Some(decoded) => {
            let texel = if decoded.format == TexelFormat::Rgba8Uint { Texel::Uint } else { Texel::Float };
            VolumeKey { form: Form::Raw(texel), ..key }
        }
        None => key,
    }
}

/// The effects that are not there, and why.
fn left_out(scene: &Scene) -> Vec<(Effect, String)> {
    let effects = scene.effects();
    let why = |e: Effect| match e {
        e if !Scene::applies(e, scene.traversal, scene.projection) => {
            format!("does nothing with {} and {}", scene.traversal, scene.projection)
        }
        Effect::Lod => "the scene names its level".to_owned(),
        Effect::TimeInterp => "every volume is shown at a whole time step".to_owned(),
        Effect::EmptySkip if scene.projection == Projection::Composite => {
            "not asked for: every sample is taken".to_owned()
        }
        _ => "not asked for".to_owned(),
    };
    Effect::ALL.iter().filter(|e| !effects.has(**e)).map(|e| (*e, why(*e))).collect()
}
