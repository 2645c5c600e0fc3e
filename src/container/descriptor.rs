//! The volume descriptor, section `VOLD`: what the volume is and how its bricks are coded (spec chapter 4).
//!
//! 256 bytes, then 32 bytes per entry of the codec table. The byte table is in the spec and in `Wire` below.

use super::downsample::Downsample;
use super::wire;
use crate::affine::{Placement, Space, Unit, ValueMap};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::limits;
use crate::voxel::{SampleType, SampleValue};
use binrw::binrw;

/// Bytes of the fixed part.
pub const FIXED_BYTES: usize = 256;
/// Bytes of one codec entry.
pub const CODEC_BYTES: usize = 32;
/// Codec id of `raw` (spec chapter 7).
pub const CODEC_RAW: u16 = 1;
/// Codec id of `s3dc` (spec chapter 8).
pub const CODEC_S3DC: u16 = 2;

const SPACING_UNKNOWN: u8 = 1;
const ACHIEVED_KNOWN: u8 = 2;

/// One entry of the codec table. An unknown id is data: only decoding a brick that uses it fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CodecEntry {
    /// Which codec.
    pub id: u16,
    /// Version of its stream.
    pub stream_version: u16,
    /// Its parameters; the codec's chapter says what they mean.
    pub params: [u8; 28],
}

impl CodecEntry {
    /// Alignment of a payload as log2: 256 bytes for s3dc as it goes to the GPU, else 16 (spec: BRK-2).
    #[must_use]
    pub fn payload_align_log2(&self, zstd: bool) -> u8 {
        if self.id == CODEC_S3DC && !zstd { 8 } else { 4 }
    }
}

/// What the writer measured: |decoded − source| at level 0, over all trees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Achieved {
    /// Largest error.
    pub max_error: f64,
    /// Root of the mean square error.
    pub rmse: f64,
    /// Mean error.
    pub mean_error: f64,
}

/// What the volume is.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeDescriptor {
    /// Voxels per axis at level 0.
    pub dims: Extent,
    /// Time steps, at least 1.
    pub time_steps: u32,
    /// Channels, at least 1. One tree per time step and channel.
    pub channels: u32,
    /// Type of a voxel.
    pub sample_type: SampleType,
    /// Levels of detail, level 0 included.
    pub lod_count: u8,
    /// Brick edge as log2.
    pub brick_log2: u8,
    /// How coarser levels were made; without meaning where there is one level.
    pub downsample: Downsample,
    /// Codecs that stored bricks refer to.
    pub codecs: Vec<CodecEntry>,
    /// Where the voxels lie in the world.
    pub placement: Placement,
    /// Value of EMPTY bricks: raw little-endian bytes of each component, unused components 0.
    pub null_value: [u32; 4],
    /// What the stored numbers mean.
    pub value_map: ValueMap,
    /// Smallest and largest sample of the source, all trees.
    pub source_range: (f64, f64),
    /// What was measured, if it was.
    pub achieved: Option<Achieved>,
    /// Bytes of all payloads before zstd, all levels.
    pub payload_bytes: u64,
    /// Samples of the source that were NaN or infinite and became the null value.
    pub replaced: u64,
}

#[binrw]
#[brw(little)]
struct Wire {
    dims: [u32; 3],
    time_steps: u32,
    channels: u32,
    sample_type: u8,
    lod_count: u8,
    brick_log2: u8,
    codec_count: u8,
    space: u8,
    unit: u8,
    flags: u8,
    downsample: u8,
    rounding: u8,
    reserved_a: [u8; 3],
    null_value: [u32; 4],
    value_map: [f64; 2],
    source_range: [f64; 2],
    affine: [[f64; 4]; 3],
    achieved: [f64; 3],
    payload_bytes: u64,
    replaced: u64,
    reserved_b: [u8; 40],
}

#[binrw]
#[brw(little)]
struct WireCodec {
    id: u16,
    stream_version: u16,
    params: [u8; 28],
}

impl VolumeDescriptor {
    /// Reads the section, whose bytes lie at `at`, checking in field order (spec: VOL-1).
    ///
    /// # Errors
    /// `E_TRUNCATED`, `E_SIZE`, `E_PARAM`, `E_LIMIT`, `E_RESERVED`, `E_NONFINITE`, `E_MINMAX_ORDER`, `E_DUP`, with the
    /// offset of the field.
    pub fn read_from(bytes: &[u8], at: u64) -> Result<Self> {
        let w: Wire = wire::read(bytes, at, "VOLD")?;
        let table = bytes.get(FIXED_BYTES..).unwrap_or_default();
        let codecs = read_codecs(table, w.codec_count, at)?;
        let d = w.check(at, codecs)?;
        d.check().map_err(|e| place(e, at))?;
        Ok(d)
    }

    /// The bytes of the section.
    #[must_use]
    pub fn write_to(&self) -> Vec<u8> {
        let achieved = self.achieved.unwrap_or(Achieved { max_error: 0.0, rmse: 0.0, mean_error: 0.0 });
        let flags = [(self.placement.spacing_unknown, SPACING_UNKNOWN), (self.achieved.is_some(), ACHIEVED_KNOWN)];
        let fixed: [u8; FIXED_BYTES] = wire::write(&Wire {
            dims: self.dims.to_array(),
            time_steps: self.time_steps,
            channels: self.channels,
            sample_type: self.sample_type as u8,
            lod_count: self.lod_count,
            brick_log2: self.brick_log2,
            codec_count: u8::try_from(self.codecs.len()).expect("checked: at most 255 codecs"),
            space: self.placement.space as u8,
            unit: self.placement.unit as u8,
            flags: flags.into_iter().filter(|f| f.0).fold(0, |all, f| all | f.1),
            downsample: if self.lod_count > 1 { self.downsample as u8 } else { 0 },
            rounding: 0,
            reserved_a: [0; 3],
            null_value: self.null_value,
            value_map: [self.value_map.scale, self.value_map.offset],
            source_range: [self.source_range.0, self.source_range.1],
            affine: self.placement.matrix,
            achieved: [achieved.max_error, achieved.rmse, achieved.mean_error],
            payload_bytes: self.payload_bytes,
            replaced: self.replaced,
            reserved_b: [0; 40],
        });
        let mut bytes = fixed.to_vec();
        for c in &self.codecs {
            let entry: [u8; CODEC_BYTES] =
                wire::write(&WireCodec { id: c.id, stream_version: c.stream_version, params: c.params });
            bytes.extend(entry);
        }
        bytes
    }

    /// The null value as a sample.
    #[must_use]
    pub fn null_sample(&self) -> SampleValue {
        let raw = match self.sample_type {
            SampleType::Rgb8 => {
                let [r, g, b, _] = self.null_value;
                (r & 255) | (g & 255) << 8 | (b & 255) << 16
            }
            t => self.null_value[0] & (u32::MAX >> (32 - 8 * t.bytes())),
        };
        SampleValue::from_raw(self.sample_type, raw).expect("masked to the type's width")
    }

    /// The `null_value` field for a sample.
    #[must_use]
    pub fn null_field(value: SampleValue) -> [u32; 4] {
        match value {
            SampleValue::Rgb8([r, g, b]) => [u32::from(r), u32::from(g), u32::from(b), 0],
            v => [v.to_raw(), 0, 0, 0],
        }
    }

    /// Number of trees; within `u32` for a checked descriptor.
    #[must_use]
    pub fn trees(&self) -> u32 {
        self.time_steps.saturating_mul(self.channels)
    }

    /// The lowest resource level whose limits the volume keeps (spec: VAL-5).
    #[must_use]
    pub fn resource_level(&self) -> u8 {
        let axis = self.dims.to_array().into_iter().max().unwrap_or(0);
        let edge = 1u32 << self.brick_log2;
        let brick = self.dims.min(Extent::cube(edge)).voxels() * self.sample_type.bytes() as u64;
        match (axis, brick) {
            (..=2048, ..=0x10_0000) => 1,
            (..=16384, ..=0x100_0000) => 2,
            _ => 3,
        }
    }

    /// Checks what writer and reader both have to keep (spec: VOL-2, VOL-3, VOL-5, VOL-6, VOL-7, VOL-13, VAL-3).
    ///
    /// # Errors
    /// As [`VolumeDescriptor::read_from`], without offsets.
    pub fn check(&self) -> Result<()> {
        self.dims.check()?;
        if self.time_steps == 0 {
            return Err(Error::param("time_steps", "0 time steps; a volume has at least 1"));
        }
        if self.channels == 0 {
            return Err(Error::param("channels", "0 channels; a volume has at least 1"));
        }
        limits::check("channels", u64::from(self.time_steps) * u64::from(self.channels), limits::MAX_TREES)?;
        if self.lod_count == 0 {
            return Err(Error::param("lod_count", "0 levels; a volume has at least level 0"));
        }
        limits::check("lod_count", u64::from(self.lod_count), u64::from(limits::MAX_LODS))?;
        if !limits::BRICK_LOG2.contains(&self.brick_log2) {
            let n = self.brick_log2;
            return Err(Error::param("brick_log2", format!("brick edge 2^{n} is not one of 16, 32, 64, 128, 256")));
        }
        limits::check("codec_count", self.codecs.len() as u64, limits::MAX_CODECS as u64)?;
        for (i, c) in self.codecs.iter().enumerate() {
            if c.id == 0 {
                return Err(Error::param("codec", format!("entry {i} has codec id 0, which is not assigned")));
            }
            if self.codecs[..i].contains(c) {
                return Err(Error::new(Code::Dup, "codec", format!("entry {i} repeats an earlier one")));
            }
        }
        self.check_values()?;
        self.placement.check()
    }

    /// spec: VOL-10, VOL-11, VOL-14
    fn check_values(&self) -> Result<()> {
        if VolumeDescriptor::null_field(self.null_sample()) != self.null_value {
            return Err(Error::new(Code::Reserved, "null_value", "bits above the sample's width are set"));
        }
        let null = self.null_sample().component(0);
        let (lo, hi) = self.source_range;
        let mut numbers = vec![
            ("null_value", null),
            ("value_scale", self.value_map.scale),
            ("value_offset", self.value_map.offset),
            ("source_min", lo),
            ("source_max", hi),
        ];
        if let Some(a) = self.achieved {
            numbers.extend([("achieved", a.max_error), ("achieved", a.rmse), ("achieved", a.mean_error)]);
            if numbers[5..].iter().any(|n| n.1 < 0.0) {
                return Err(Error::param("achieved", "an error is negative"));
            }
        }
        if let Some((field, v)) = numbers.into_iter().find(|n| !n.1.is_finite()) {
            return Err(Error::new(Code::NonFinite, field, format!("{v} is not a finite number")));
        }
        if self.value_map.scale == 0.0 {
            return Err(Error::param("value_scale", "a scale of 0 gives every voxel the same value; use 1"));
        }
        if lo > hi {
            return Err(Error::new(Code::MinmaxOrder, "source_min", format!("{lo} is larger than {hi}")));
        }
        Ok(())
    }
}

impl Wire {
    /// Enumerations and reserved bits: what the typed descriptor cannot even represent (spec: VOL-4, VOL-8, VOL-9).
    /// Reserved bytes are zero (spec: VOL-16, VOL-14).
    fn check(self, at: u64, codecs: Vec<CodecEntry>) -> Result<VolumeDescriptor> {
        let param = |field, value: u8| {
            place(Error::param(field, format!("{value} is not a value of this version; use a newer reader")), at)
        };
        let sample_type = SampleType::from_wire(self.sample_type).ok_or(param("sample_type", self.sample_type))?;
        let space = Space::from_wire(self.space).ok_or(param("space", self.space))?;
        let unit = Unit::from_wire(self.unit).ok_or(param("unit", self.unit))?;
        if self.flags & !(SPACING_UNKNOWN | ACHIEVED_KNOWN) != 0 {
            return Err(place(Error::new(Code::Reserved, "flags", "reserved flag bits are set"), at));
        }
        let known = Downsample::ALL.into_iter().find(|d| *d as u8 == self.downsample);
        let downsample = match known {
            Some(operator) if self.lod_count > 1 => operator,
            None if self.lod_count <= 1 && self.downsample == 0 => Downsample::default(),
            _ => return Err(param("downsample", self.downsample)),
        };
        if self.rounding != 0 {
            return Err(param("rounding", self.rounding));
        }
        wire::check_zero(&self.reserved_a, at + 29, "VOLD.reserved")?;
        wire::check_zero(&self.reserved_b, at + 216, "VOLD.reserved")?;
        let [max_error, rmse, mean_error] = self.achieved;
        let known = self.flags & ACHIEVED_KNOWN != 0;
        if !known && self.achieved.iter().any(|v| v.to_bits() != 0) {
            return Err(place(Error::new(Code::Canon, "achieved", "set, though flagged as not known"), at));
        }
        Ok(VolumeDescriptor {
            dims: Extent::from(self.dims),
            time_steps: self.time_steps,
            channels: self.channels,
            sample_type,
            lod_count: self.lod_count,
            brick_log2: self.brick_log2,
            downsample,
            codecs,
            placement: Placement {
                matrix: self.affine,
                space,
                unit,
                spacing_unknown: self.flags & SPACING_UNKNOWN != 0,
            },
            null_value: self.null_value,
            value_map: ValueMap { scale: self.value_map[0], offset: self.value_map[1] },
            source_range: (self.source_range[0], self.source_range[1]),
            achieved: known.then_some(Achieved { max_error, rmse, mean_error }),
            payload_bytes: self.payload_bytes,
            replaced: self.replaced,
        })
    }
}

fn read_codecs(table: &[u8], count: u8, at: u64) -> Result<Vec<CodecEntry>> {
    if table.len() != usize::from(count) * CODEC_BYTES {
        return Err(Error::at(
            Code::Size,
            at + 23,
            "VOLD.codec_count",
            format!("{count} codecs declared, {} bytes of codec table stored", table.len()),
        ));
    }
    let at = at + FIXED_BYTES as u64;
    let entries = table.chunks_exact(CODEC_BYTES).zip((at..).step_by(CODEC_BYTES));
    entries
        .map(|(bytes, at)| {
            let w: WireCodec = wire::read(bytes, at, "VOLD.codec")?;
            Ok(CodecEntry { id: w.id, stream_version: w.stream_version, params: w.params })
        })
        .collect()
}

/// Gives an error of a field its absolute offset.
fn place(e: Error, at: u64) -> Error {
    let (offset, name) = match e.field() {
        "dims" => (0, "VOLD.dims"),
        "time_steps" => (12, "VOLD.time_steps"),
        "channels" => (16, "VOLD.channels"),
        "sample_type" => (20, "VOLD.sample_type"),
        "lod_count" => (21, "VOLD.lod_count"),
        "brick_log2" => (22, "VOLD.brick_log2"),
        "codec_count" => (23, "VOLD.codec_count"),
        "space" => (24, "VOLD.space"),
        "unit" => (25, "VOLD.unit"),
        "flags" => (26, "VOLD.flags"),
        "downsample" => (27, "VOLD.downsample"),
        "rounding" => (28, "VOLD.rounding"),
        "null_value" => (32, "VOLD.null_value"),
        "value_scale" => (48, "VOLD.value_scale"),
        "value_offset" => (56, "VOLD.value_offset"),
        "source_min" => (64, "VOLD.source_min"),
        "source_max" => (72, "VOLD.source_max"),
        "affine" => (80, "VOLD.affine"),
        "achieved" => (176, "VOLD.achieved"),
        "codec" => (FIXED_BYTES as u64, "VOLD.codec"),
        _ => (0, "VOLD"),
    };
    Error::at(e.code(), at + offset, name, e.message().to_owned())
}
