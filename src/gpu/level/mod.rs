//! How a level lies in textures or buffers, whoever holds them: a GPU or this machine's memory. Nothing here knows a GPU.
//!
//! Texel of voxel `c` in a texture: `b = c >> log2`, `r = c & (2^log2 − 1)`;
//! `fold.place(b) · per_brick + r / step`, where `step` is (n, 1, 1) voxels for index words that hold n indices, the block for
//! pairs of end points (blocks start anew in each brick), and 1 for samples. The textures hold payload bytes as they are
//! (S3Dc §4.2: two 3D textures, of pairs and of 16-bit words).

mod fill;
mod fit;
mod fold;
mod host;
mod pages;
#[cfg(test)]
mod tests;
mod texel;

pub use fill::{Filled, LevelTarget, Resident, fill};
pub(crate) use fit::readable;
pub use fit::{Fit, PAGE_BYTES};
pub use fold::Fold;
pub use host::HostLevel;
pub(crate) use host::copy_rows;
pub use texel::TexelFormat;

use crate::codec::{Codec, zerobit};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent};
use crate::gpu::key::Source;
use crate::volume::{At, LevelCodec, Volume};
use crate::voxel::SampleType;

/// Most bricks of a level that is laid out at all.
const MAX_BRICKS: u64 = 1 << 24;
/// Words of a codebook on the GPU: 256 averages, then 256 details.
pub const BOOK_WORDS: u32 = 512;
/// Words of a brick in the brick table of zerobit.
pub const TABLE_WORDS: u32 = 4;
/// First word of a brick in the brick table: every voxel has the value in the fourth word.
pub const TABLE_EMPTY: u32 = 0;
/// The same for CONSTANT bricks.
pub const TABLE_CONSTANT: u32 = 1;
/// First word of a stored brick less its page.
pub const TABLE_STORED: u32 = 2;

/// What the texels mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Store {
    /// One texture of samples.
    Raw {
        /// Type of the samples.
        sample: SampleType,
    },
    /// A texture of pairs of end points and one of index words.
    S3dc {
        /// Type of the samples.
        sample: SampleType,
        /// Bits of an index.
        index_bits: u32,
        /// Voxels of a block, per axis.
        block: [u32; 3],
    },
    /// Pages of payloads, a table of bricks, and codebooks; see [`HostLevel`].
    Zerobit {
        /// Type of the samples.
        sample: SampleType,
        /// Whether unit blocks are laid out with zerobits; else with the flags of the scheme before.
        new_stream: bool,
    },
}

impl Store {
    /// Type of the samples.
    #[must_use]
    pub const fn sample(self) -> SampleType {
        match self {
            Store::Raw { sample } | Store::S3dc { sample, .. } | Store::Zerobit { sample, .. } => sample,
        }
    }
}

/// What a texture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// Samples.
    Raw,
    /// Index words (IV).
    Index,
    /// Pairs of end points (MMV).
    Minmax,
}

impl Role {
    /// The name in shaders and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Role::Raw => "raw",
            Role::Index => "index",
            Role::Minmax => "minmax",
        }
    }
}

/// One 3D texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureLayout {
    /// What it holds.
    pub role: Role,
    /// Format of a texel.
    pub format: TexelFormat,
    /// Voxels of a texel, per axis, counted from the brick's first voxel.
    pub step: [u32; 3],
    /// Texels of a whole brick, per axis; of a brick that is no longer than the level.
    pub per_brick: [u32; 3],
    /// Texels, per axis.
    pub size: [u32; 3],
}

impl TextureLayout {
    /// Bytes of all texels; saturates.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.size.iter().fold(u64::from(self.format.bytes()), |n, &v| n.saturating_mul(u64::from(v)))
    }

    /// Texels of a brick of `extent` voxels, per axis.
    #[must_use]
    pub fn texels(&self, extent: Extent) -> [u32; 3] {
        let e = extent.to_array();
        std::array::from_fn(|a| e[a].div_ceil(self.step[a]))
    }
}

/// The buffers of a zerobit level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PageLayout {
    /// Most bytes of a page: every payload lies whole in one.
    pub page_bytes: u64,
    /// Most pages.
    pub pages: u32,
    /// Bytes of all payloads, as far as the index tells: exact where no brick is compressed once more by zstd.
    pub stream_bytes: u64,
    /// Bytes of the brick table, [`TABLE_WORDS`] words per brick and as many behind them for null cells.
    pub table_bytes: u64,
    /// Bytes of the codebooks, [`BOOK_WORDS`] words each.
    pub book_bytes: u64,
}

/// How one level of a volume lies in textures or buffers.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelLayout {
    /// The level.
    pub at: At,
    /// Its voxels.
    pub extent: Extent,
    /// Edge of a brick, as log2 of voxels.
    pub brick_log2: u8,
    /// Bricks, per axis.
    pub bricks: [u32; 3],
    /// What was asked for.
    pub source: Source,
    /// Whether a texture unit is to filter the samples.
    pub filtered: bool,
    /// What the texels mean.
    pub store: Store,
    /// Where bricks lie.
    pub fold: Fold,
    /// The textures: end points and indices of s3dc, samples of raw, or none for zerobit.
    pub textures: Vec<TextureLayout>,
    /// The texture that a compute pass decodes into ([`Source::Deferred`]); none for raw volumes, whose samples are there.
    pub decoded: Option<TextureLayout>,
    /// The buffers of a zerobit level.
    pub pages: Option<PageLayout>,
}

/// What is asked for.
#[derive(Clone, Copy)]
struct Wish {
    at: At,
    source: Source,
    filtered: bool,
}

impl LevelLayout {
    /// Whether the grid of blocks of this size goes through: they divide bricks, or there is but one brick along an axis.
    #[must_use]
    pub fn is_aligned(&self, block: [u32; 3]) -> bool {
        (0..3).all(|a| self.bricks[a] == 1 || (1u32 << self.brick_log2).is_multiple_of(block[a]))
    }

    /// The layout of a level for shaders that read texels. Reads the level's index pages, no brick.
    ///
    /// # Errors
    /// `E_LIMIT` where `fit` does not hold the level, with what would fit; `E_UNSUPPORTED` for source direct or deferred of a
    /// level whose bricks have several codecs; `E_RANGE` and those of damaged pages.
    pub fn new(volume: &Volume, at: At, source: Source, fit: &Fit) -> Result<Self> {
        LevelLayout::checked(volume, Wish { at, source, filtered: false }, fit)
    }

    /// The layout of a level whose samples a texture unit filters: one unfolded texture of normalised integers or f32.
    ///
    /// # Errors
    /// As [`LevelLayout::new`]; `E_PARAM` for source direct of compressed volumes: filtered end points and indices are no
    /// samples; `E_UNSUPPORTED` where f32 is needed and the device does not filter it.
    pub fn new_filtered(volume: &Volume, at: At, source: Source, fit: &Fit) -> Result<Self> {
        LevelLayout::checked(volume, Wish { at, source, filtered: true }, fit)
    }

    fn checked(volume: &Volume, wish: Wish, fit: &Fit) -> Result<Self> {
        let Some(layout) = LevelLayout::lay(volume, wish, fit)? else {
            let why = match wish.filtered {
                true => format!(
                    "is longer than a texture of {} texels, and the texture unit cannot filter across tiles",
                    fit.max_3d
                ),
                false => format!("does not fit textures of {} texels per axis", fit.max_3d),
            };
            return Err(fit::too_much(volume, wish, fit, &why));
        };
        match fit.budget {
            Some(most) if layout.bytes() > most => {
                let (bytes, most) = (readable(layout.bytes()), readable(most));
                let why = format!("takes {bytes} as source {}, of {most} allowed", wish.source);
                Err(fit::too_much(volume, wish, fit, &why))
            }
            _ => Ok(layout),
        }
    }

    /// The layout, whatever its size; `None` where textures are too small for it.
    fn lay(volume: &Volume, wish: Wish, fit: &Fit) -> Result<Option<Self>> {
        let levels = &volume.head().octree.levels;
        let bricks = levels.get(usize::from(wish.at.lod)).map_or(0, |l| l.bricks.voxels());
        if bricks > MAX_BRICKS {
            let message = format!("level {} has {bricks} bricks, of 2^24 at most; use a coarser level", wish.at.lod);
            return Err(Error::new(Code::Limit, "lod", message));
        }
        let known = volume.level_bricks(wish.at)?;
        LevelLayout::lay_as(volume, wish, known.codec, known.stored_bytes, fit)
    }

    /// The same, as if all stored bricks had this codec.
    fn lay_as(volume: &Volume, wish: Wish, codec: LevelCodec<'_>, stored: u64, fit: &Fit) -> Result<Option<Self>> {
        let Wish { at, source, filtered } = wish;
        let d = volume.info();
        let level = &volume.head().octree.levels[usize::from(at.lod)];
        let sample = d.sample_type;
        let store = match (source, codec) {
            (Source::Decoded, _) | (_, LevelCodec::None | LevelCodec::One(Codec::Raw)) => Store::Raw { sample },
            (_, LevelCodec::One(Codec::S3dc(p))) => {
                Store::S3dc { sample, index_bits: p.i_bits().into(), block: p.block().to_array() }
            }
            (_, LevelCodec::One(Codec::Zerobit(z))) => {
                Store::Zerobit { sample, new_stream: z.stream() == zerobit::Stream::New }
            }
            (_, LevelCodec::Mixed) => {
                let message = "bricks of this level have several codecs; use source decoded, or repack the volume";
                return Err(Error::new(Code::Unsupported, "source", message));
            }
        };
        let compressed = !matches!(store, Store::Raw { .. });
        if filtered && compressed && source == Source::Direct {
            let message =
                "a texture unit cannot filter end points and indices; use sampler linear_opt, or source deferred";
            return Err(Error::param("source", message));
        }
        let edge = 1 << d.brick_log2;
        let brick = Extent::cube(edge).min(level.extent);
        let raw = |deferred: bool| {
            let format = match (deferred && sample != SampleType::Rgb8, filtered) {
                (true, _) => TexelFormat::R32Float,
                (false, true) => TexelFormat::of_filtered(sample, fit.norm16),
                (false, false) => TexelFormat::of_samples(sample),
            };
            texture(Role::Raw, format, [1; 3], brick)
        };
        let textures = match store {
            Store::Raw { .. } => vec![raw(false)],
            Store::S3dc { index_bits, block, .. } => vec![
                texture(Role::Minmax, TexelFormat::of_pairs(sample), block, brick),
                texture(Role::Index, TexelFormat::R16Uint, [16 / index_bits, 1, 1], brick),
            ],
            Store::Zerobit { .. } => Vec::new(),
        };
        let decoded = (compressed && source == Source::Deferred).then(|| raw(true));
        let mut all = textures.iter().chain(&decoded);
        if filtered && !fit.filter_f32 && all.any(|t| t.role == Role::Raw && t.format == TexelFormat::R32Float) {
            let message = "this device does not filter f32; use sampler linear, which needs no texture unit";
            return Err(Error::new(Code::Unsupported, "sampler", message));
        }
        let bricks = level.bricks.to_array();
        let mut all: Vec<TextureLayout> = textures.into_iter().chain(decoded).collect();
        let most = |a| all.iter().map(|t| fit.max_3d / t.per_brick[a]).min().unwrap_or(u32::MAX);
        let fold = Fold::new(bricks, std::array::from_fn(most));
        let Some(fold) = fold.filter(|fold| fold.is_flat() || !filtered) else { return Ok(None) };
        let last = volume.head().octree.brick_extent(at.lod, bricks.map(|n| n - 1));
        for t in &mut all {
            let (rest, n) = (t.texels(last), fold.bricks());
            // The last bricks are as small as they are, where nothing lies behind them.
            let rest = if fold.is_flat() { rest } else { t.per_brick };
            t.size = std::array::from_fn(|a| (n[a] - 1) * t.per_brick[a] + rest[a]);
        }
        let decoded = decoded.and_then(|_| all.pop());
        let textures = all;
        let pages = match store {
            Store::Zerobit { .. } => Some(PageLayout {
                page_bytes: fit.page_bytes(),
                pages: fit.pages(),
                stream_bytes: stored,
                table_bytes: (level.bricks.voxels() + 1) * u64::from(TABLE_WORDS) * 4,
                book_bytes: volume.codebooks()?.len() as u64 * u64::from(BOOK_WORDS) * 4,
            }),
            _ => None,
        };
        let (extent, brick_log2) = (level.extent, d.brick_log2);
        Ok(Some(LevelLayout {
            at,
            extent,
            brick_log2,
            bricks,
            source,
            filtered,
            store,
            fold,
            textures,
            decoded,
            pages,
        }))
    }

    /// Bytes that the level takes in memory: all textures, of sources that are decoded there also the decoded one.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let textures = self.textures.iter().chain(&self.decoded).map(TextureLayout::bytes);
        let pages = self.pages.iter().flat_map(|p| [p.stream_bytes, p.table_bytes, p.book_bytes]);
        textures.chain(pages).fold(0, u64::saturating_add)
    }

    /// The error of a device that does not hold the level after all, because `why`: it says what `fit` would hold.
    #[must_use]
    pub fn refused(&self, volume: &Volume, fit: &Fit, why: &str) -> Error {
        fit::too_much(volume, Wish { at: self.at, source: self.source, filtered: self.filtered }, fit, why)
    }

    /// Number of the texture with this role.
    #[must_use]
    pub fn texture_of(&self, role: Role) -> Option<usize> {
        self.textures.iter().position(|t| t.role == role)
    }

    /// The texel of `texture` that holds what concerns voxel `c`.
    #[must_use]
    pub fn texel(&self, texture: &TextureLayout, c: Coord) -> [u32; 3] {
        let mask = (1 << self.brick_log2) - 1;
        let place = self.fold.place(c.map(|v| v >> self.brick_log2));
        std::array::from_fn(|a| place[a] * texture.per_brick[a] + (c[a] & mask) / texture.step[a])
    }

    /// Room of a brick in the textures, in voxels: that of a whole brick, but none longer than the level.
    #[must_use]
    pub fn brick_voxels(&self) -> [u32; 3] {
        self.extent.to_array().map(|n| n.min(1 << self.brick_log2))
    }

    /// Number of a brick in tables and masks: x fastest.
    #[must_use]
    pub const fn brick_index(&self, brick: Coord) -> usize {
        (brick[0] as usize)
            + self.bricks[0] as usize * (brick[1] as usize + self.bricks[1] as usize * brick[2] as usize)
    }

    /// The layout of the texture that a compute pass decodes into, as a level of its own; `None` where there is no such pass.
    #[must_use]
    pub fn deferred(&self) -> Option<LevelLayout> {
        let texture = self.decoded?;
        let sample = if texture.format == TexelFormat::R32Float { SampleType::F32 } else { self.store.sample() };
        let store = Store::Raw { sample };
        Some(LevelLayout { store, textures: vec![texture], decoded: None, pages: None, ..self.clone() })
    }
}

/// A texture whose size is not yet known.
fn texture(role: Role, format: TexelFormat, step: [u32; 3], brick: Extent) -> TextureLayout {
    let e = brick.to_array();
    TextureLayout { role, format, step, per_brick: std::array::from_fn(|a| e[a].div_ceil(step[a])), size: [0; 3] }
}
