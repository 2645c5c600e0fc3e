//! Transfer functions by name: for CT in Hounsfield units where the volume has them, else relative to its range of values.

use super::{Point, TransferFunction};
use crate::affine::ValueMap;
use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::Grid;
use crate::volume::{At, Volume};
use crate::voxel::{Sample, SampleType};
use crate::with_sample;
use std::str::FromStr;

/// One point of a preset: where it lies, red, green, blue, opacity.
type Row = (f64, [f32; 3], f32);

/// A named transfer function, before it is laid over a range of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// From black and clear to white and opaque.
    Grey,
    /// CT: bones, and nothing else.
    CtBone,
    /// CT: skin and flesh as a veil around the bones.
    CtSoft,
    /// CT: vessels and airways of the lung, ribs.
    CtChest,
    /// Magnetic resonance: bright tissue, background clear.
    Mri,
    /// Densities around zero, as of cryo-electron microscopy: what rises from the noise.
    Density,
    /// Magnitudes, as of turbulence: from red to white.
    Heat,
}

/// Hounsfield units that presets of CT map to the ends of a range that is not in such units.
/// The lower one is where all of them are clear.
const HU_ENDS: (f64, f64) = (-850.0, 900.0);

const GREY: &[Row] = &[(0.0, [0.0; 3], 0.0), (1.0, [1.0; 3], 0.8)];
const CT_BONE: &[Row] = &[
    (150.0, [0.60, 0.38, 0.26], 0.0),
    (260.0, [0.80, 0.62, 0.44], 0.25),
    (500.0, [0.96, 0.90, 0.78], 0.80),
    (1500.0, [1.0, 1.0, 0.97], 0.95),
];
const CT_SOFT: &[Row] = &[
    (-350.0, [0.80, 0.55, 0.45], 0.0),
    (-200.0, [0.88, 0.62, 0.50], 0.03),
    (0.0, [0.80, 0.36, 0.28], 0.05),
    (100.0, [0.82, 0.40, 0.30], 0.08),
    (180.0, [0.90, 0.72, 0.56], 0.10),
    (350.0, [0.97, 0.92, 0.80], 0.60),
    (1200.0, [1.0, 1.0, 0.97], 0.95),
];
const CT_CHEST: &[Row] = &[
    (-850.0, [0.30, 0.42, 0.70], 0.0),
    (-650.0, [0.38, 0.52, 0.80], 0.008),
    (-450.0, [0.80, 0.48, 0.42], 0.02),
    (-150.0, [0.86, 0.44, 0.36], 0.04),
    (80.0, [0.88, 0.36, 0.28], 0.12),
    (220.0, [0.98, 0.80, 0.62], 0.40),
    (600.0, [1.0, 0.97, 0.90], 0.85),
];
const MRI: &[Row] = &[
    (0.22, [0.30, 0.18, 0.16], 0.0),
    (0.40, [0.52, 0.32, 0.28], 0.03),
    (0.62, [0.78, 0.60, 0.54], 0.18),
    (0.82, [0.94, 0.88, 0.82], 0.45),
    (1.0, [1.0, 1.0, 1.0], 0.70),
];
const DENSITY: &[Row] = &[
    (0.28, [0.12, 0.22, 0.50], 0.0),
    (0.42, [0.20, 0.45, 0.78], 0.15),
    (0.65, [0.45, 0.80, 0.82], 0.50),
    (1.0, [1.0, 0.90, 0.55], 0.90),
];
const HEAT: &[Row] = &[
    (0.15, [0.25, 0.03, 0.10], 0.0),
    (0.32, [0.70, 0.10, 0.12], 0.03),
    (0.55, [0.96, 0.48, 0.12], 0.18),
    (0.80, [1.0, 0.85, 0.35], 0.50),
    (1.0, [1.0, 1.0, 0.92], 0.85),
];

impl Preset {
    /// All of them.
    pub const ALL: &'static [Preset] =
        &[Preset::Grey, Preset::CtBone, Preset::CtSoft, Preset::CtChest, Preset::Mri, Preset::Density, Preset::Heat];

    /// The name used in scenes and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Preset::Grey => "grey",
            Preset::CtBone => "ct-bone",
            Preset::CtSoft => "ct-soft",
            Preset::CtChest => "ct-chest",
            Preset::Mri => "mri",
            Preset::Density => "density",
            Preset::Heat => "heat",
        }
    }

    fn rows(self) -> (&'static [Row], bool) {
        match self {
            Preset::Grey => (GREY, false),
            Preset::CtBone => (CT_BONE, true),
            Preset::CtSoft => (CT_SOFT, true),
            Preset::CtChest => (CT_CHEST, true),
            Preset::Mri => (MRI, false),
            Preset::Density => (DENSITY, false),
            Preset::Heat => (HEAT, false),
        }
    }

    /// The preset laid over the values `lo` to `hi`. Where both are the same, a step there.
    ///
    /// # Errors
    /// `E_PARAM` where `lo` is above `hi`, or one is not finite.
    pub fn over(self, lo: f64, hi: f64) -> Result<TransferFunction> {
        if !(lo.is_finite() && hi.is_finite() && lo <= hi) {
            return Err(Error::param("transfer.range", format!("{lo} to {hi} is not an ascending range of numbers")));
        }
        let (rows, in_hu) = self.rows();
        let (first, last) = if in_hu { HU_ENDS } else { (0.0, 1.0) };
        laid(rows, |v| lo + (v - first) / (last - first) * (hi - lo))
    }

    /// The preset for a volume: CT presets in Hounsfield units where its values are such, else over its usual range.
    ///
    /// # Errors
    /// As [`Preset::over`], for volumes with values that are no numbers.
    pub fn of(self, stats: &ValueStats) -> Result<TransferFunction> {
        let (rows, in_hu) = self.rows();
        if in_hu && stats.is_hounsfield() {
            let ValueMap { scale, offset } = stats.value_map;
            return laid(rows, |hu| (hu - offset) / scale);
        }
        self.over(stats.range.0, stats.range.1)
    }

    /// The preset that shows most volumes of such values well.
    #[must_use]
    pub fn guess(stats: &ValueStats) -> Preset {
        let (lo, hi) = stats.range;
        // Most of the volume lies near the bottom: there is a background.
        let has_background = stats.median <= lo + (hi - lo) * 0.2;
        match stats.sample_type {
            SampleType::F32 if has_background && stats.extremes.0 < 0.0 => Preset::Density,
            SampleType::F32 => Preset::Heat,
            SampleType::Rgb8 => Preset::Grey,
            _ if stats.is_hounsfield() => Preset::CtSoft,
            _ => Preset::Mri,
        }
    }
}

impl FromStr for Preset {
    type Err = Error;
    fn from_str(s: &str) -> Result<Self> {
        Preset::ALL.iter().copied().find(|p| p.name() == s).ok_or_else(|| {
            let known: Vec<_> = Preset::ALL.iter().map(|p| p.name()).collect();
            Error::param("transfer", format!("{s:?} is not one of auto, {}", known.join(", ")))
        })
    }
}

/// The rows at their places; of several that fall on one value the outer two stay.
fn laid(rows: &[Row], place: impl Fn(f64) -> f64) -> Result<TransferFunction> {
    let mut points: Vec<Point> = Vec::new();
    for &(v, color, alpha) in rows {
        #[allow(clippy::cast_possible_truncation, reason = "values are looked up in f32")]
        let value = f64::from(place(v) as f32);
        if matches!(points[..], [.., a, b] if a.value == value && b.value == value) {
            points.pop();
        }
        points.push(Point { value, color, alpha });
    }
    // A negative scale turns the order around.
    if points.first().zip(points.last()).is_some_and(|(a, b)| a.value > b.value) {
        points.reverse();
    }
    TransferFunction::new(points)
}

/// What a volume's values are like: what presets are laid over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueStats {
    /// Type of the samples.
    pub sample_type: SampleType,
    /// Smallest and largest value of the source, as stored.
    pub extremes: (f64, f64),
    /// Between them lie all but one sample in a thousand at each end.
    pub range: (f64, f64),
    /// Half of the samples are smaller.
    pub median: f64,
    /// What the stored numbers mean.
    pub value_map: ValueMap,
}

/// Most voxels that are looked at.
const SEEN: u64 = 1 << 21;
/// Planes that are looked at where no level is as small as that.
const PLANES: u32 = 8;

impl ValueStats {
    /// Looks at the coarsest level that still has many voxels, or at some planes where there is no small one.
    ///
    /// # Errors
    /// Those of reading.
    pub fn of(volume: &Volume, time: u32, channel: u32) -> Result<Self> {
        let small = volume.levels().position(|e| e.voxels() <= SEEN);
        let mut values = Vec::new();
        if let Some(lod) = small {
            #[allow(clippy::cast_possible_truncation, reason = "at most 22 levels")]
            collect(&volume.read(At { time, channel, lod: lod as u8 })?, &mut values);
        } else {
            let lod = volume.info().lod_count - 1;
            let extent = volume.levels().last().unwrap_or(volume.info().dims);
            for i in 0..PLANES.min(extent.z) {
                let z = (2 * u64::from(i) + 1) * u64::from(extent.z) / (2 * u64::from(PLANES.min(extent.z)));
                #[allow(clippy::cast_possible_truncation, reason = "below extent.z")]
                let plane = Region::at([0, 0, z as u32], Extent { z: 1, ..extent });
                collect(&volume.read_region(At { time, channel, lod }, plane)?, &mut values);
            }
        }
        let info = volume.info();
        let last = values.len() - 1;
        let mut quantile = |per_mille: usize| {
            let (_, v, _) = values.select_nth_unstable_by(last * per_mille / 1000, f32::total_cmp);
            f64::from(*v)
        };
        Ok(ValueStats {
            sample_type: info.sample_type,
            extremes: info.source_range,
            range: (quantile(1), quantile(999)),
            median: quantile(500),
            value_map: info.value_map,
        })
    }

    /// Whether the values, scaled as the volume says, look like Hounsfield units: air at −1000, bone far above.
    #[must_use]
    pub fn is_hounsfield(&self) -> bool {
        let ValueMap { scale, offset } = self.value_map;
        let (a, b) = (self.extremes.0 * scale + offset, self.extremes.1 * scale + offset);
        let (lo, hi) = (a.min(b), a.max(b));
        let is_integer = matches!(self.sample_type, SampleType::U16 | SampleType::I16);
        is_integer && (-4096.0..=-500.0).contains(&lo) && (300.0..40_000.0).contains(&hi)
    }
}

/// The largest component of each voxel: what decides about the opacity of coloured ones.
fn collect(grid: &Grid, out: &mut Vec<f32>) {
    fn typed<T: Sample>(grid: &Grid, out: &mut Vec<f32>) {
        let n = T::TYPE.components();
        #[allow(clippy::cast_possible_truncation, reason = "samples have at most 24 significant bits")]
        out.extend(grid.samples::<T>().iter().map(|s| (0..n).map(|c| s.component(c)).fold(f64::MIN, f64::max) as f32));
    }
    with_sample!(grid.sample_type(), T => typed::<T>(grid, out));
}
