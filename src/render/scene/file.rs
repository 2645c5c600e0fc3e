//! Scenes as text (TOML).

use super::named::{self, FromWord, word_or_table};
use super::{ClipBox, Plane, Shading, TransferSpec};
use crate::error::{Error, Result};
use crate::gpu::{Effect, Projection, Sampler, Source, Traversal};
use crate::limits;
use crate::render::camera::CameraSpec;
use serde::{Deserialize, Serialize};

/// A scene as it is written: volumes by their names, transfer functions by presets, and only what differs from the defaults.
///
/// ```
/// use vug::render::scene::SceneFile;
/// let scene = SceneFile::parse(r#"
///     size = [640, 480]
///     sampler = "linear"
///     effects = ["gradient_shading", "empty_skip"]   # these, and no others
///     camera = { azimuth = 120, elevation = 10 }
///     [[volume]]
///     path = "head.vug"
///     transfer = "ct-bone"
/// "#)?;
/// assert_eq!(SceneFile::parse(&scene.to_toml())?, scene);
/// # Ok::<(), vug::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneFile {
    /// Width and height of the picture, in pixels.
    #[serde(deserialize_with = "named::exact")]
    pub size: [u32; 2],
    /// Colour behind the volume: red, green, blue, 0 to 1.
    #[serde(deserialize_with = "named::exact")]
    pub background: [f32; 3],
    /// Distance of samples, in units of the smallest spacing of level 0.
    pub step: f64,
    /// `nearest`, `linear`, `linear_opt`, `hw_linear`.
    #[serde(with = "named")]
    pub sampler: Sampler,
    /// `direct`, `deferred`, `decoded`.
    #[serde(with = "named")]
    pub source: Source,
    /// `raycast`, `slice`, `cut_plane`.
    #[serde(with = "named")]
    pub traversal: Traversal,
    /// `composite`, `maximum`, `minimum`, `mean`, `iso`.
    #[serde(with = "named")]
    pub projection: Projection,
    /// The effects, all of them; without this those of [`SceneFile::default_effects`].
    #[serde(with = "effect_names", skip_serializing_if = "Option::is_none")]
    pub effects: Option<Vec<Effect>>,
    /// The level of detail that is shown, without the effect `lod`; 0 is the finest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level: Option<u8>,
    /// `auto`, or what differs from it.
    #[serde(deserialize_with = "word_or_table")]
    pub camera: CameraSpec,
    /// Of the effect `gradient_shading`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shading: Option<Shading>,
    /// Of the effect `early_out`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub early_out: Option<EarlyOut>,
    /// Of the effect `lod`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lod: Option<LodPixels>,
    /// Of the effect `clip_box`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clip_box: Option<ClipBox>,
    /// Of the traversal `cut_plane`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut_plane: Option<Plane>,
    /// Of the projection `iso`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iso_surface: Option<IsoSurface>,
    /// The volumes; without this, those that are at hand.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub volume: Vec<VolumeSpec>,
}

/// Parameters of `early_out`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EarlyOut {
    /// Rays end where less than this is left of what lies behind.
    pub remaining: f64,
}

/// Parameters of `lod`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LodPixels {
    /// Size of a voxel on the screen, at most.
    pub pixels: f64,
}

/// Parameters of the projection `iso`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IsoSurface {
    /// Value of the surface, in sample units.
    pub value: f64,
}

/// One volume of a scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VolumeSpec {
    /// File or address, relative to the scene's folder; without it the file that holds the scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// Channel, from 0.
    pub channel: u32,
    /// Time step, from 0; a fraction with the effect `time_interp`.
    pub time: f64,
    /// `auto`, a preset, or a table.
    #[serde(deserialize_with = "word_or_table")]
    pub transfer: TransferSpec,
}

impl Default for SceneFile {
    fn default() -> Self {
        SceneFile {
            size: [768, 768],
            background: [0.0; 3],
            step: 0.5,
            sampler: Sampler::LinearOpt,
            source: Source::Direct,
            traversal: Traversal::Raycast,
            projection: Projection::Composite,
            effects: None,
            level: None,
            camera: CameraSpec::default(),
            shading: None,
            early_out: None,
            lod: None,
            clip_box: None,
            cut_plane: None,
            iso_surface: None,
            volume: Vec::new(),
        }
    }
}

impl FromWord for CameraSpec {
    const WORDS: &'static str = "auto";
    fn from_word(word: &str) -> Result<Self> {
        if word == "auto" {
            return Ok(CameraSpec::default());
        }
        Err(Error::param("camera", format!("{word:?} is not auto; give a table of what differs from it")))
    }
}

impl SceneFile {
    /// Reads a scene.
    ///
    /// # Errors
    /// `E_PARAM` for text that is no scene, with line and column; an unknown name lists the known ones. `E_LIMIT` above
    /// 1 MiB.
    pub fn parse(text: &str) -> Result<Self> {
        limits::check("scene", text.len() as u64, limits::MAX_SCENE_BYTES)?;
        toml::from_str(text).map_err(|e| Error::param("scene", e.to_string().trim_end().to_owned()))
    }

    /// Reads a scene that came inside a volume's file: it must not lead anywhere else (spec: SAF-14).
    ///
    /// # Errors
    /// As [`SceneFile::parse`]; `E_PARAM` where it names other files, or several volumes.
    pub fn parse_stored(text: &str) -> Result<Self> {
        let scene = SceneFile::parse(text)?;
        scene.check_stored()?;
        Ok(scene)
    }

    /// Whether the scene can be stored in a volume's file: it shows that volume and names no file.
    ///
    /// # Errors
    /// `E_PARAM`.
    pub fn check_stored(&self) -> Result<()> {
        let leads_away = |v: &VolumeSpec| v.path.is_some() || matches!(v.transfer, TransferSpec::File(_));
        if self.volume.len() > 1 || self.volume.iter().any(leads_away) {
            let message = "a scene inside a file shows the volume of that file, and names no others";
            return Err(Error::param("scene", message));
        }
        Ok(())
    }

    /// As text.
    ///
    /// # Panics
    /// Never: all of it can be written.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("numbers, words and tables")
    }
}

mod effect_names {
    use crate::gpu::Effect;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(effects: &Option<Vec<Effect>>, s: S) -> Result<S::Ok, S::Error> {
        effects.as_ref().map(|e| e.iter().map(|e| e.name()).collect::<Vec<_>>()).serialize(s)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Option<Vec<Effect>>, D::Error> {
        let names = Vec::<String>::deserialize(d)?;
        let known: crate::Result<Vec<Effect>> = names.iter().map(|n| n.parse()).collect();
        known.map(Some).map_err(|e| serde::de::Error::custom(e.message()))
    }
}
