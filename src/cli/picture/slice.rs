//! One plane of a volume as a picture.

use super::{ColorMap, Picture, Rgb};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::grid::View;
use crate::volume::Axis;
use crate::voxel::{Sample, SampleType};
use crate::with_sample;

/// Colour of samples that are not a number: one that no colour map has.
pub(super) const NAN_COLOR: Rgb = [255, 0, 255];

/// The volume axes that run right and along the rows' order in a slice, and whether the latter runs upwards.
const fn screen(axis: Axis) -> (usize, usize, bool) {
    match axis {
        Axis::X => (1, 2, true),
        Axis::Y => (0, 2, true),
        Axis::Z => (0, 1, false),
    }
}

/// Width and height of a pixel of such a slice, from the spacing along x, y, z.
pub(crate) fn spacing_on_screen(axis: Axis, spacing: [f64; 3]) -> (f64, f64) {
    let (right, along, _) = screen(axis);
    (spacing[right], spacing[along])
}

/// Where the voxels of a plane lie on the screen.
pub(super) struct Layout {
    pub(super) width: u32,
    pub(super) height: u32,
    right: usize,
    along: usize,
    up: bool,
}

impl Layout {
    /// # Errors
    /// `E_PARAM` where the box is more than one voxel thick along `axis`.
    pub(super) fn of(extent: Extent, axis: Axis) -> Result<Self> {
        let size = extent.to_array();
        if size[axis as usize] != 1 {
            return Err(Error::param("slice", format!("{extent} voxels are not one plane across axis {axis:?}")));
        }
        let (right, along, up) = screen(axis);
        Ok(Layout { width: size[right], height: size[along], right, along, up })
    }

    /// Column and row of voxel `c` of the plane.
    pub(super) fn pixel(&self, c: [u32; 3]) -> (u32, u32) {
        let row = c[self.along];
        (c[self.right], if self.up { self.height - 1 - row } else { row })
    }
}

/// A plane as a picture: `window` = (lo, hi) become the ends of the colour map, NaN magenta.
///
/// Where lo = hi, smaller values take the low end, larger ones the high end, and that value the middle. RGB volumes are
/// shown as they are.
///
/// # Errors
/// `E_PARAM` where the view is not one plane across `axis`.
pub(crate) fn slice(plane: &View<'_>, axis: Axis, window: (f64, f64), map: &ColorMap) -> Result<Picture> {
    let layout = Layout::of(plane.extent, axis)?;
    let mut picture = Picture::filled(layout.width, layout.height, [0; 3])?;
    let rgb = plane.sample_type == SampleType::Rgb8;
    with_sample!(plane.sample_type, T => for z in 0..plane.extent.z {
        for y in 0..plane.extent.y {
            for (x, sample) in (0..).zip(plane.row::<T>(y, z)) {
                let color = if rgb {
                    std::array::from_fn(|c| sample.component(c) as u8)
                } else {
                    color(sample.component(0), window, map)
                };
                let (column, row) = layout.pixel([x, y, z]);
                picture.set(column, row, color);
            }
        }
    });
    Ok(picture)
}

fn color(value: f64, (lo, hi): (f64, f64), map: &ColorMap) -> Rgb {
    if value.is_nan() {
        return NAN_COLOR;
    }
    let t = if lo == hi {
        0.5 + if value < lo { -1.0 } else { f64::from(u8::from(value > hi)) }
    } else {
        // Halves, because the difference of large floats could overflow.
        (value / 2.0 - lo / 2.0) / (hi / 2.0 - lo / 2.0)
    };
    map.color(t)
}
