//! How a scene names a transfer function: by a word, over a range, in a file, or by its points.

use super::named::{FromWord, exact_or_none};
use crate::error::{Error, Result};
use crate::render::transfer::{Point, Preset, TransferFunction, ValueStats};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::path::Path;

/// A transfer function as a scene says it.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum TransferSpec {
    /// What suits the values.
    #[default]
    Auto,
    /// A preset, over the volume's usual values or over a given range.
    Preset(Preset, Option<[f64; 2]>),
    /// A JSON file, by its name: relative to the scene's folder.
    File(String),
    /// Points.
    Points(TransferFunction),
}

#[derive(Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct Table {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    preset: Option<String>,
    #[serde(default, deserialize_with = "exact_or_none", skip_serializing_if = "Option::is_none")]
    range: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    points: Option<Vec<Point>>,
}

impl TransferSpec {
    /// The function for values as `stats` tells them; files are looked for in `folder`.
    ///
    /// # Errors
    /// Those of presets, JSON files and points.
    pub fn resolve(&self, folder: &Path, stats: impl FnOnce() -> Result<ValueStats>) -> Result<TransferFunction> {
        match self {
            TransferSpec::Auto => {
                let stats = stats()?;
                Preset::guess(&stats).of(&stats)
            }
            TransferSpec::Preset(preset, Some([lo, hi])) => preset.over(*lo, *hi),
            TransferSpec::Preset(preset, None) => preset.of(&stats()?),
            TransferSpec::Points(function) => Ok(function.clone()),
            TransferSpec::File(name) => {
                let path = folder.join(name);
                let text = std::fs::read_to_string(&path).map_err(|e| Error::io(path.display(), e))?;
                TransferFunction::from_json(&text)
            }
        }
    }
}

impl FromWord for TransferSpec {
    const WORDS: &'static str = "auto, the name of a preset,";
    fn from_word(word: &str) -> Result<Self> {
        if word == "auto" { Ok(TransferSpec::Auto) } else { Ok(TransferSpec::Preset(word.parse()?, None)) }
    }
}

impl TryFrom<Table> for TransferSpec {
    type Error = Error;
    fn try_from(table: Table) -> Result<Self> {
        match table {
            Table { preset: Some(word), range, file: None, points: None } => match (Self::from_word(&word)?, range) {
                (TransferSpec::Preset(preset, _), range) => Ok(TransferSpec::Preset(preset, range)),
                (_, Some(_)) => Err(Error::param("transfer", "auto has no range; name a preset")),
                (auto, None) => Ok(auto),
            },
            Table { preset: None, range: None, file: Some(name), points: None } => Ok(TransferSpec::File(name)),
            Table { preset: None, range: None, file: None, points: Some(points) } => {
                Ok(TransferSpec::Points(TransferFunction::new(points)?))
            }
            _ => Err(Error::param("transfer", "give one of preset (perhaps with range), file, points")),
        }
    }
}

impl<'de> Deserialize<'de> for TransferSpec {
    fn deserialize<D: Deserializer<'de>>(d: D) -> std::result::Result<Self, D::Error> {
        TransferSpec::try_from(Table::deserialize(d)?).map_err(|e| serde::de::Error::custom(e.message()))
    }
}

impl Serialize for TransferSpec {
    fn serialize<S: Serializer>(&self, s: S) -> std::result::Result<S::Ok, S::Error> {
        let table = match self {
            TransferSpec::Auto => return s.serialize_str("auto"),
            TransferSpec::Preset(preset, None) => return s.serialize_str(preset.name()),
            TransferSpec::Preset(preset, range) => {
                Table { preset: Some(preset.name().into()), range: *range, ..Table::default() }
            }
            TransferSpec::File(name) => Table { file: Some(name.clone()), ..Table::default() },
            TransferSpec::Points(f) => Table { points: Some(f.points().to_vec()), ..Table::default() },
        };
        table.serialize(s)
    }
}
