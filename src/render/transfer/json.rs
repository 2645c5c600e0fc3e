//! Transfer functions as JSON, and as a part of scenes: `{"points": [{"value": 0, "color": [0, 0, 0], "alpha": 0}, …]}`.

use super::{Point, TransferFunction};
use crate::error::{Error, Result};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What is written, before it is checked.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    points: Vec<Point>,
}

impl TransferFunction {
    /// Reads what [`TransferFunction::to_json`] has written.
    ///
    /// # Errors
    /// `E_PARAM` for text that is no such JSON, and those of [`TransferFunction::new`].
    pub fn from_json(text: &str) -> Result<Self> {
        let written: Written = serde_json::from_str(text).map_err(|e| {
            Error::param("transfer", format!("{e}; expected {{\"points\": [{{\"value\", \"color\", \"alpha\"}}, …]}}"))
        })?;
        TransferFunction::new(written.points)
    }

    /// As JSON, exactly.
    ///
    /// # Panics
    /// Never: the numbers are finite.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(&Written { points: self.points.clone() }).expect("finite numbers")
    }
}

impl Serialize for TransferFunction {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        Written { points: self.points.clone() }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for TransferFunction {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        TransferFunction::new(Written::deserialize(deserializer)?.points).map_err(serde::de::Error::custom)
    }
}
