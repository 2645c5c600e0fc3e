//! One brick: from samples to a node and a payload, with what the codec has done to them measured.

use super::options::NonFinite;
use crate::codec::{Codec, first_non_finite};
use crate::container::{Node, NodeFlags, NodeKind};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::{AlignedBytes, Grid, View, ViewMut};
use crate::metrics::{ErrorStats, error_stats, value_range};
use crate::supercompression;
use crate::voxel::{Sample, SampleType, SampleValue};
use crate::with_sample;
use std::cell::RefCell;

/// Encodes bricks, on any number of threads.
#[derive(Clone)]
pub(super) struct BrickEncoder {
    pub(super) codec: Codec,
    pub(super) zstd: bool,
    pub(super) non_finite: NonFinite,
    pub(super) null: SampleValue,
    /// Whether to learn how long the brick would be without loss.
    pub(super) weigh_lossless: bool,
}

/// A brick that is ready to be written.
pub struct EncodedBrick {
    pub(super) node: Node,
    pub(super) payload: Vec<u8>,
    pub(super) stats: BrickStats,
}

impl EncodedBrick {
    /// What was measured.
    pub(super) fn stats(&self) -> &BrickStats {
        &self.stats
    }
}

/// What was measured on one brick or on many.
#[derive(Clone, Debug, Default)]
pub(super) struct BrickStats {
    /// Decoded against source.
    pub(super) error: ErrorStats,
    /// Range of the source's components.
    pub(super) source: Option<(f64, f64)>,
    /// Payload bytes before zstd.
    pub(super) payload: u64,
    /// Bytes of the stored payload.
    pub(super) stored: u64,
    /// Bytes that the same brick would take without loss, as it would be stored.
    pub(super) lossless: u64,
    /// NaN and infinities that were replaced.
    pub(super) replaced: u64,
}

impl BrickStats {
    pub(super) fn merge(&mut self, other: &BrickStats) {
        self.error.merge(&other.error);
        self.source = match (self.source, other.source) {
            (Some((a, b)), Some((c, d))) => Some((a.min(c), b.max(d))),
            (a, b) => a.or(b),
        };
        self.payload += other.payload;
        self.stored += other.stored;
        self.lossless += other.lossless;
        self.replaced += other.replaced;
    }
}

thread_local! {
    static SCRATCH: RefCell<Option<AlignedBytes>> = const { RefCell::new(None) };
}

/// Runs `f` with a dense buffer for one decoded brick; its old content is left in it.
pub(super) fn with_scratch<R>(extent: Extent, t: SampleType, f: impl FnOnce(ViewMut<'_>) -> Result<R>) -> Result<R> {
    let len = crate::grid::dense_len(extent, t)?;
    let mut buffer = match SCRATCH.take() {
        Some(buffer) if buffer.as_slice().len() >= len => buffer,
        _ => AlignedBytes::zeroed(len)?,
    };
    let result = f(ViewMut::dense(&mut buffer.as_mut_slice()[..len], extent, t));
    SCRATCH.set(Some(buffer));
    result
}

impl BrickEncoder {
    /// Encodes one brick.
    ///
    /// # Errors
    /// `E_NONFINITE` with the position inside the brick, if non-finite samples are rejected.
    pub(super) fn encode(&self, src: View<'_>) -> Result<EncodedBrick> {
        let (cleaned, replaced) = self.replace_non_finite(src)?;
        let src = cleaned.as_ref().map_or(src, Grid::view);
        let mut brick = match self.constant(src) {
            Some(value) => self.encode_constant(src, value),
            None => self.encode_stored(src)?,
        };
        brick.stats.source = brick.stats.source.or_else(|| value_range(&src));
        if replaced > 0 {
            brick.stats.replaced = replaced;
            if brick.node.kind != NodeKind::Empty {
                brick.node.flags = brick.node.flags | NodeFlags::NAN_REPLACED;
            }
        }
        Ok(brick)
    }

    /// A clean copy and the number of replaced samples, where there are any.
    fn replace_non_finite(&self, src: View<'_>) -> Result<(Option<Grid>, u64)> {
        let Some(first) = first_non_finite(&src) else { return Ok((None, 0)) };
        let SampleValue::F32(null) = self.null else { unreachable!("only f32 has non-finite samples") };
        if self.non_finite == NonFinite::Reject {
            return Err(non_finite_error(src.row::<f32>(first[1], first[2])[first[0] as usize], first));
        }
        let mut clean = Grid::zeros(src.extent, SampleType::F32)?;
        let mut replaced = 0;
        let mut view = clean.view_mut();
        for z in 0..src.extent.z {
            for y in 0..src.extent.y {
                for (to, &from) in view.row_mut::<f32>(y, z).iter_mut().zip(src.row::<f32>(y, z)) {
                    *to = if from.is_finite() { from } else { null };
                    replaced += u64::from(!from.is_finite());
                }
            }
        }
        Ok((Some(clean), replaced))
    }

    /// The value of a brick all of whose voxels decode to the same.
    pub(super) fn constant(&self, src: View<'_>) -> Option<SampleValue> {
        // Lossless means every bit; S3Dc stores −0.0 as +0.0 (spec: S3D-13), so that both zeros are one value there.
        let by_value = !matches!(self.codec, Codec::Raw);
        with_sample!(src.sample_type, T => {
            let first = src.row::<T>(0, 0)[0];
            let same = |s: &T| if by_value { *s == first } else { bytemuck::bytes_of(s) == bytemuck::bytes_of(&first) };
            for z in 0..src.extent.z {
                for y in 0..src.extent.y {
                    if !src.row::<T>(y, z).iter().all(same) {
                        return None;
                    }
                }
            }
            Some(match first.value() {
                SampleValue::F32(v) if by_value && v == 0.0 => SampleValue::F32(0.0),
                value => value,
            })
        })
    }

    fn encode_constant(&self, src: View<'_>, value: SampleValue) -> EncodedBrick {
        let components = value.sample_type().components();
        let values = (0..components).map(|c| value.component(c));
        let (min, max) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        let error = ErrorStats { count: src.extent.voxels() * components as u64, min, max, ..ErrorStats::default() };
        let node = if value.to_raw() == self.null.to_raw() {
            Node::EMPTY
        } else {
            Node::new_constant(value, NodeFlags::LOSSLESS, Some(0.0))
        };
        let stats = BrickStats { error, source: Some((min, max)), ..BrickStats::default() };
        EncodedBrick { node, payload: Vec::new(), stats }
    }

    fn encode_stored(&self, src: View<'_>) -> Result<EncodedBrick> {
        let mut payload = Vec::new();
        self.codec.encode(src, &mut payload)?;
        let error = measure(&self.codec, &payload, src)?;
        let mut stats = BrickStats { payload: payload.len() as u64, ..BrickStats::default() };
        let mut flags = if error.max_abs == 0.0 { NodeFlags::LOSSLESS } else { NodeFlags::default() };
        if self.zstd
            && let Some(smaller) = supercompression::compress(&payload)?
        {
            payload = smaller;
            flags = flags | NodeFlags::ZSTD;
        }
        stats.stored = payload.len() as u64;
        stats.lossless = if self.weigh_lossless { self.lossless_len(src)? } else { 0 };
        let node = Node::new_stored(0, flags, (error.min, error.max), Some(error.max_abs));
        stats.error = error;
        Ok(EncodedBrick { node, payload, stats })
    }

    /// Bytes that `raw` would store for this brick.
    fn lossless_len(&self, src: View<'_>) -> Result<u64> {
        let mut raw = Vec::new();
        Codec::Raw.encode(src, &mut raw)?;
        let smaller = if self.zstd { supercompression::compress(&raw)? } else { None };
        Ok(smaller.as_ref().map_or(raw.len(), Vec::len) as u64)
    }
}

/// Decodes a payload again and compares it with its source.
pub(super) fn measure(codec: &Codec, payload: &[u8], src: View<'_>) -> Result<ErrorStats> {
    with_scratch(src.extent, src.sample_type, |mut decoded| {
        let whole = Region::whole(src.extent);
        codec.decode(payload, src.extent, &whole, decoded.sub(&whole))?;
        error_stats(&src, &decoded.as_view())
    })
}

pub(super) fn non_finite_error(value: f32, at: Coord) -> Error {
    let [x, y, z] = at;
    Error::new(
        Code::NonFinite,
        "samples",
        format!(
            "{value} at voxel {x},{y},{z} (x,y,z); clean the data, or replace such voxels by the null value (--nan null)"
        ),
    )
}
