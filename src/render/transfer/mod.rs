//! Transfer functions: from a sample's value to colour and opacity.

mod json;
mod presets;
#[cfg(test)]
mod tests;

pub use crate::gpu::layout::MAX_POINTS;
pub use presets::{Preset, ValueStats};

use crate::error::{Error, Result};
use crate::limits;
use serde::{Deserialize, Serialize};

/// One control point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Where it lies, in sample units as stored.
    pub value: f64,
    /// Red, green, blue, 0 to 1, not multiplied by the opacity.
    #[serde(deserialize_with = "super::scene::named::exact")]
    pub color: [f32; 3],
    /// Opacity of one reference length (the smallest spacing of level 0), 0 to 1.
    pub alpha: f32,
}

/// A piecewise linear function of a sample's value: colour and opacity between control points, constant outside of them.
///
/// Two points at one value make a step; at that value itself the right one holds. Volumes of three components have their own
/// colour: for them only the opacity is taken, at the largest of the three.
///
/// ```
/// use vug::render::transfer::{Point, TransferFunction};
/// let grey = |value, v: f32| Point { value, color: [v; 3], alpha: v };
/// let ramp = TransferFunction::new(vec![grey(0.0, 0.0), grey(100.0, 1.0)])?;
/// assert_eq!(ramp.eval(25.0), [0.25; 4]);
/// assert_eq!(ramp.max_alpha(-5.0, 50.0), 0.5);
/// # Ok::<(), vug::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    points: Vec<Point>,
}

impl TransferFunction {
    /// A function through these points, in ascending order of their values.
    ///
    /// Values are rounded to f32, in which samples are looked up: so a value decides alike everywhere on which side of a
    /// point it lies.
    ///
    /// # Errors
    /// `E_PARAM` for no point, values in descending order, three at one value, colours or opacities outside of 0 to 1, NaN;
    /// `E_LIMIT` above [`MAX_POINTS`].
    pub fn new(mut points: Vec<Point>) -> Result<Self> {
        let bad = |message: String| Err(Error::param("transfer", message));
        limits::check("transfer.points", points.len() as u64, MAX_POINTS as u64)?;
        if points.is_empty() {
            return bad("it has no points; give at least one".into());
        }
        for (i, p) in points.iter_mut().enumerate() {
            #[allow(clippy::cast_possible_truncation, reason = "rounding to f32 is what is meant")]
            let value = p.value as f32;
            if !value.is_finite() {
                return bad(format!("point {i}: value {} is no finite number of 32 bits", p.value));
            }
            // Also turns −0 into +0.
            p.value = f64::from(value) + 0.0;
            if !p.color.iter().chain([&p.alpha]).all(|v| (0.0..=1.0).contains(v)) {
                return bad(format!("point {i}: colour {:?} and alpha {} must lie in 0 to 1", p.color, p.alpha));
            }
        }
        if let Some(i) = points.windows(2).position(|w| w[1].value < w[0].value) {
            let (a, b) = (points[i].value, points[i + 1].value);
            return bad(format!("point {} at {b} comes behind one at {a}; sort the points by value", i + 1));
        }
        if let Some(w) = points.windows(3).find(|w| w[0].value == w[2].value) {
            return bad(format!(
                "three points lie at {}; a step has two, and the middle one is never seen",
                w[0].value
            ));
        }
        Ok(TransferFunction { points })
    }

    /// The control points, ascending.
    #[must_use]
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Red, green, blue (not multiplied by the opacity) and opacity of one reference length at `value`.
    ///
    /// NaN is taken for a value below all points.
    #[must_use]
    pub fn eval(&self, value: f64) -> [f64; 4] {
        let right = self.points.partition_point(|p| p.value <= value);
        let rgba = |p: &Point| [p.color[0], p.color[1], p.color[2], p.alpha].map(f64::from);
        if right == 0 {
            return rgba(&self.points[0]);
        }
        let a = &self.points[right - 1];
        let Some(b) = self.points.get(right) else { return rgba(a) };
        let t = (value - a.value) / (b.value - a.value);
        let (a, b) = (rgba(a), rgba(b));
        std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
    }

    /// The largest opacity over the closed range, rounded up: 0 exactly where nothing in the range can be seen.
    ///
    /// What a step approaches from the left counts as soon as the range reaches there. A range without order (NaN, or `hi`
    /// below `lo`) is taken for all values.
    #[must_use]
    pub fn max_alpha(&self, lo: f64, hi: f64) -> f32 {
        if lo.is_nan() || hi.is_nan() || hi < lo {
            return self.points.iter().map(|p| p.alpha).fold(0.0, f32::max);
        }
        let first = self.points.partition_point(|p| p.value <= lo);
        let end = self.points.partition_point(|p| p.value <= hi);
        let ends = rounded_up(self.eval(lo)[3]).max(rounded_up(self.eval(hi)[3]));
        self.points[first..end].iter().map(|p| p.alpha).fold(ends, f32::max)
    }
}

/// The smallest f32 that is not below `v` (of 0 to 1).
fn rounded_up(v: f64) -> f32 {
    #[allow(clippy::cast_possible_truncation, reason = "mended in the next line")]
    let near = v as f32;
    if f64::from(near) < v { near.next_up() } else { near }
}
