//! Colour maps by name.

use super::Rgb;
use crate::error::{Error, Result};

/// Names and gradients; the first one is the default.
const MAPS: &[(&str, Option<colorous::Gradient>)] = &[
    ("grey", None),
    ("viridis", Some(colorous::VIRIDIS)),
    ("magma", Some(colorous::MAGMA)),
    ("inferno", Some(colorous::INFERNO)),
    ("plasma", Some(colorous::PLASMA)),
    ("cividis", Some(colorous::CIVIDIS)),
    ("turbo", Some(colorous::TURBO)),
    ("cubehelix", Some(colorous::CUBEHELIX)),
    ("warm", Some(colorous::WARM)),
    ("cool", Some(colorous::COOL)),
    ("rainbow", Some(colorous::RAINBOW)),
    ("spectral", Some(colorous::SPECTRAL)),
    ("red-blue", Some(colorous::RED_BLUE)),
    ("purple-green", Some(colorous::PURPLE_GREEN)),
    ("blues", Some(colorous::BLUES)),
    ("greens", Some(colorous::GREENS)),
    ("reds", Some(colorous::REDS)),
];

/// A colour for every number from 0 to 1, in 256 steps.
#[derive(Clone)]
pub(crate) struct ColorMap(Box<[Rgb; 256]>);

impl Default for ColorMap {
    /// Black to white.
    fn default() -> Self {
        ColorMap::build(None)
    }
}

impl ColorMap {
    fn build(gradient: Option<colorous::Gradient>) -> Self {
        ColorMap(Box::new(std::array::from_fn(|i| match gradient {
            None => [i as u8; 3],
            Some(g) => g.eval_rational(i, 256).as_array(),
        })))
    }

    /// Names that `from_str` knows.
    pub(crate) fn names() -> String {
        MAPS.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
    }

    /// The colour at `t`; below 0 and above 1 those of the ends.
    pub(crate) fn color(&self, t: f64) -> Rgb {
        // A cast of a float saturates.
        self.0[usize::from((t * 255.0).round() as u8)]
    }
}

impl std::str::FromStr for ColorMap {
    type Err = Error;
    fn from_str(s: &str) -> Result<Self> {
        let wanted = if s == "gray" { "grey" } else { s };
        match MAPS.iter().find(|(name, _)| *name == wanted) {
            Some(&(_, gradient)) => Ok(ColorMap::build(gradient)),
            None => Err(Error::param("colormap", format!("{s:?} is not one of {}", ColorMap::names()))),
        }
    }
}
