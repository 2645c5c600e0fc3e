//! From what a scene says to numbers: what is not said gets its default, what is said in vain is an error.

use super::file::{EarlyOut, LodPixels};
use super::{EARLY_OUT, Lod, MAX_VOLUMES, Scene, SceneFile, SceneVolume, VolumeSpec};
use crate::error::{Error, Result};
use crate::gpu::{Effect, Projection, Traversal};
use crate::render::plan;
use crate::render::transfer::ValueStats;
use crate::volume::Volume;
use std::path::Path;

impl SceneFile {
    /// The effects of a scene that names none: what makes such a picture faster, detail as fine as can be seen, and light
    /// on iso-surfaces, which show nothing without.
    #[must_use]
    pub fn default_effects(traversal: Traversal, projection: Projection) -> Vec<Effect> {
        let wanted = [Effect::EmptySkip, Effect::TfCull, Effect::Lod, Effect::EarlyOut];
        let light = (projection == Projection::Iso).then_some(Effect::GradientShading);
        wanted.into_iter().chain(light).filter(|e| Scene::applies(*e, traversal, projection)).collect()
    }

    /// The effects of this scene: those it names, else the default ones and those whose parameters it gives.
    #[must_use]
    pub fn effects(&self) -> Vec<Effect> {
        if let Some(effects) = &self.effects {
            return effects.clone();
        }
        let mut effects = SceneFile::default_effects(self.traversal, self.projection);
        if self.level.is_some() {
            effects.retain(|e| *e != Effect::Lod);
        }
        for (effect, given) in self.parameters() {
            if given && !effects.contains(&effect) {
                effects.push(effect);
            }
        }
        if self.volume.iter().any(|v| v.time.fract() != 0.0) {
            effects.push(Effect::TimeInterp);
        }
        effects
    }

    /// Effects that have parameters, and whether these are given.
    fn parameters(&self) -> [(Effect, bool); 4] {
        [
            (Effect::GradientShading, self.shading.is_some()),
            (Effect::EarlyOut, self.early_out.is_some()),
            (Effect::Lod, self.lod.is_some()),
            (Effect::ClipBox, self.clip_box.is_some()),
        ]
    }

    /// The scene of these volumes, in the order in which it names them. A scene without volumes shows all of them.
    ///
    /// Names of files are relative to `folder`.
    ///
    /// # Errors
    /// `E_PARAM` for what contradicts itself (see [`Scene::check`]), among it effects that do nothing and parameters
    /// of effects that are not named; `E_RANGE` for channels and times that a volume does not have; those of reading values
    /// for presets.
    pub fn resolve(&self, volumes: &[&Volume], folder: &Path) -> Result<Scene> {
        let default = VolumeSpec::default();
        let specs: Vec<&VolumeSpec> = if self.volume.is_empty() {
            volumes.iter().map(|_| &default).collect()
        } else {
            self.volume.iter().collect()
        };
        if specs.is_empty() || specs.len() > MAX_VOLUMES || specs.len() != volumes.len() {
            let message =
                format!("{} volumes, {} of them open; a scene has 1 to {MAX_VOLUMES}", specs.len(), volumes.len());
            return Err(Error::param("volume", message));
        }
        let effects = self.effects();
        let has = |effect| effects.contains(&effect);
        if let Some(i) = (1..effects.len()).find(|&i| effects[..i].contains(&effects[i])) {
            return Err(Error::param("effects", format!("{} is named twice", effects[i])));
        }
        for (effect, given) in self.parameters() {
            if given && !has(effect) {
                let message = format!("there are parameters of {effect}, which the effects do not name");
                return Err(Error::param("effects", message));
            }
        }
        if has(Effect::ClipBox) && self.clip_box.is_none() {
            return Err(Error::param("clip_box", "which box? Give its min and max"));
        }
        let lod = match (has(Effect::Lod), self.level) {
            (true, Some(_)) => return Err(Error::param("level", "the effect lod chooses it; leave one of both out")),
            (true, None) => Lod::Auto { pixels: self.lod.unwrap_or(LodPixels { pixels: 1.0 }).pixels },
            (false, level) => Lod::Level(level.unwrap_or(0)),
        };
        let early_out =
            has(Effect::EarlyOut).then(|| self.early_out.unwrap_or(EarlyOut { remaining: EARLY_OUT }).remaining);
        let shown = specs.iter().zip(volumes).map(|(spec, volume)| volume_of(spec, volume, folder));
        let mut scene = Scene {
            volumes: shown.collect::<Result<_>>()?,
            camera: self.camera.clone(),
            size: self.size,
            step: self.step,
            sampler: self.sampler,
            source: self.source,
            traversal: self.traversal,
            projection: self.projection,
            background: self.background,
            early_out,
            empty_skip: has(Effect::EmptySkip),
            tf_cull: has(Effect::TfCull),
            shading: has(Effect::GradientShading).then(|| self.shading.unwrap_or_default()),
            lod,
            clip: self.clip_box,
            plane: self.cut_plane,
            iso: self.iso_surface.map(|s| s.value),
            time_interp: has(Effect::TimeInterp),
        };
        scene.check()?;
        let seen: Vec<_> = scene.volumes.iter().zip(volumes).map(|(s, volume)| plan::seen(&scene, s, volume)).collect();
        scene.volumes.iter_mut().zip(seen).for_each(|(shown, seen)| shown.seen = seen);
        Ok(scene)
    }
}

impl Scene {
    /// The scene that shows one volume, as well as can be said without being asked.
    ///
    /// # Errors
    /// As [`SceneFile::resolve`].
    pub fn of(volume: &Volume) -> Result<Scene> {
        SceneFile::default().resolve(&[volume], Path::new(""))
    }
}

fn volume_of(spec: &VolumeSpec, volume: &Volume, folder: &Path) -> Result<SceneVolume> {
    let info = volume.info();
    let out = |what: &str, given: f64, count: u32| {
        let message = format!("{what} {given} of {count}; they count from 0");
        Err(Error::new(crate::Code::Range, "volume", message))
    };
    if spec.channel >= info.channels {
        return out("channel", f64::from(spec.channel), info.channels);
    }
    // hard case R-27: the last step has none behind it
    if !(spec.time >= 0.0 && spec.time <= f64::from(info.time_steps - 1)) {
        return out("time step", spec.time, info.time_steps);
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
    let step = spec.time as u32;
    let transfer = spec.transfer.resolve(folder, || ValueStats::of(volume, step, spec.channel))?;
    Ok(SceneVolume { path: spec.path.clone(), channel: spec.channel, time: spec.time, transfer, seen: Vec::new() })
}
