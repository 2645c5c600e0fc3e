//! What a device can hold, and what to say where a level is too much for it.

use super::{LevelLayout, Wish};
use crate::codec::{Codec, s3dc};
use crate::error::{Code, Error, Result};
use crate::gpu::key::Source;
use crate::gpu::shader::MAX_PAGES;
use crate::volume::{At, LevelCodec, Volume};

/// Largest page of zerobit streams, in bytes: what every WebGPU device can bind.
pub const PAGE_BYTES: u64 = 128 << 20;

/// What a device can hold. [`Fit::host`] is this machine's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fit {
    /// Longest axis of a 3D texture, in texels.
    pub max_3d: u32,
    /// Largest buffer, in bytes.
    pub max_buffer: u64,
    /// Largest binding of a storage buffer, in bytes.
    pub max_binding: u64,
    /// Storage buffers that a shader can have.
    pub storage_buffers: u32,
    /// Whether the texture unit filters f32.
    pub filter_f32: bool,
    /// Whether there are textures of normalised 16-bit integers.
    pub norm16: bool,
    /// Longest axis of a 2D texture, in texels: what slices are blended into.
    pub max_2d: u32,
    /// Bytes that all levels of a scene may take (`--gpu-mem`).
    pub budget: Option<u64>,
}

impl Fit {
    /// This machine's memory, where nothing is limited but by `budget`.
    #[must_use]
    pub const fn host(budget: Option<u64>) -> Fit {
        Fit {
            max_3d: u32::MAX,
            max_buffer: u64::MAX,
            max_binding: u64::MAX,
            storage_buffers: u32::MAX,
            filter_f32: true,
            norm16: true,
            max_2d: u32::MAX,
            budget,
        }
    }

    /// What WebGPU promises of every device, without optional features.
    #[must_use]
    pub const fn portable() -> Fit {
        Fit {
            max_3d: 2048,
            max_buffer: 256 << 20,
            max_binding: 128 << 20,
            storage_buffers: 8,
            filter_f32: false,
            norm16: false,
            max_2d: 8192,
            budget: None,
        }
    }

    /// Largest page of streams, in whole words, as bytes.
    #[must_use]
    pub fn page_bytes(&self) -> u64 {
        PAGE_BYTES.min(self.max_binding).min(self.max_buffer) & !3
    }

    /// Most pages of streams: a shader needs buffers for the brick table, the codebooks and two of its own besides.
    #[must_use]
    pub const fn pages(&self) -> u32 {
        let most = self.storage_buffers.saturating_sub(4);
        if most > MAX_PAGES { MAX_PAGES } else { most }
    }
}

/// Bytes for people.
pub(crate) fn readable(bytes: u64) -> String {
    #[allow(clippy::cast_precision_loss, reason = "three digits are shown")]
    let b = bytes as f64;
    match bytes {
        0..1024 => format!("{bytes} bytes"),
        1024..1_048_576 => format!("{:.1} KiB", b / 1024.0),
        1_048_576..1_073_741_824 => format!("{:.1} MiB", b / 1_048_576.0),
        _ => format!("{:.1} GiB", b / 1_073_741_824.0),
    }
}

/// A level that a device cannot hold: the error says what it could.
pub(super) fn too_much(volume: &Volume, wish: Wish, fit: &Fit, why: &str) -> Error {
    let fits = |layout: Result<Option<LevelLayout>>| {
        let bytes = layout.ok().flatten()?.bytes();
        fit.budget.is_none_or(|most| bytes <= most).then_some(bytes)
    };
    let mut ways = Vec::new();
    for lod in wish.at.lod + 1..volume.info().lod_count {
        let at = At { lod, ..wish.at };
        if let Some(bytes) = fits(LevelLayout::lay(volume, Wish { at, ..wish }, fit)) {
            ways.push(format!("level {lod} ({})", readable(bytes)));
            break;
        }
    }
    if wish.source != Source::Direct && !wish.filtered {
        let direct = Wish { source: Source::Direct, ..wish };
        if let Some(bytes) = fits(LevelLayout::lay(volume, direct, fit)) {
            ways.push(format!("source direct at this level ({})", readable(bytes)));
        }
    }
    if let Ok(LevelCodec::One(Codec::S3dc(params))) = volume.level_codec(wish.at)
        && wish.source != Source::Decoded
    {
        let fewer = [4, 2, 1].into_iter().filter(|&bits| bits < params.i_bits()).find_map(|bits| {
            let codec = Codec::S3dc(s3dc::Params::new(bits, params.block(), params.endpoints()).ok()?);
            fits(LevelLayout::lay_as(volume, wish, LevelCodec::One(&codec), 0, fit)).map(|bytes| (bits, bytes))
        });
        if let Some((bits, bytes)) = fewer {
            ways.push(format!("the volume encoded with {bits} index bits ({})", readable(bytes)));
        }
    }
    let what = match ways.len() {
        0 => "no coarser level fits either: allow more, or encode with more levels or larger blocks".to_owned(),
        _ => format!("what fits: {}", ways.join(", or ")),
    };
    Error::new(Code::Limit, "gpu-mem", format!("level {} {why}; {what}", wish.at.lod))
}
