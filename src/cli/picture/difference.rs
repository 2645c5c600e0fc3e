//! Differences in five classes of colour, and their legend.

use super::slice::Layout;
use super::{Picture, font};
use crate::error::Result;
use crate::grid::View;
use crate::metrics::ErrorClass;
use crate::metrics::difference::for_each_class;
use crate::volume::Axis;

/// How plane `b` differs from plane `a`: every voxel in the colour of its class, as a fraction of `range`.
///
/// # Errors
/// `E_PARAM` where the views are not one plane across `axis` each, of the same size and comparable types.
pub(crate) fn difference(a: &View<'_>, b: &View<'_>, axis: Axis, range: f64) -> Result<Picture> {
    let layout = Layout::of(a.extent, axis)?;
    let mut picture = Picture::filled(layout.width, layout.height, [0; 3])?;
    for_each_class(a, b, range, |at, class| {
        let (x, y) = layout.pixel(at);
        picture.set(x, y, class.color());
    })?;
    Ok(picture)
}

/// Text of the legend; the font knows these letters.
const LABELS: [&str; 5] = ["0", "<5%", "<10%", "<15%", ">=15%"];
/// Edge of a colour sample and space around things, in pixels.
const SAMPLE: u32 = 9;
const GAP: u32 = 3;

/// The classes in one strip, at least `width` pixels wide: a square of each colour and its limit.
///
/// # Errors
/// `E_LIMIT` for a width beyond all screens.
pub(crate) fn legend(width: u32) -> Result<Picture> {
    let entry = |label: &str| SAMPLE + GAP + font::width(label) + 2 * GAP;
    let needed: u32 = GAP + LABELS.iter().map(|l| entry(l)).sum::<u32>();
    let mut strip = Picture::filled(width.max(needed), SAMPLE + 2 * GAP, [255; 3])?;
    let mut x = GAP;
    for (class, label) in ErrorClass::ALL.into_iter().zip(LABELS) {
        for (dx, dy) in (0..SAMPLE).flat_map(|dy| (0..SAMPLE).map(move |dx| (dx, dy))) {
            strip.set(x + dx, GAP + dy, class.color());
        }
        font::draw(&mut strip, x + SAMPLE + GAP, GAP + 1, label, [32; 3]);
        x += entry(label);
    }
    Ok(strip)
}
