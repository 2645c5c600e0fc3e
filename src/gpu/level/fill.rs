//! Filling textures and pages with the payloads of a level, brick by brick, unchanged.

use super::pages::Pager;
use super::{LevelLayout, Role, Store, TexelFormat, TextureLayout};
use crate::codec::{Codec, s3dc};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::Grid;
use crate::volume::{BrickPayload, Volume};
use crate::voxel::{SampleType, SampleValue};
use rayon::prelude::*;
use serde::Serialize;

/// Where the bytes of a level go.
pub trait LevelTarget {
    /// Writes texels, tightly packed, x fastest, then y, then z.
    ///
    /// # Errors
    /// What the target finds.
    fn write(&mut self, texture: usize, origin: [u32; 3], size: [u32; 3], bytes: &[u8]) -> Result<()>;

    /// Takes the next page of streams; never longer than the layout's.
    ///
    /// # Errors
    /// What the target finds.
    fn page(&mut self, words: Vec<u32>) -> Result<()>;

    /// Takes what follows the first `there` words of the last page, which are all that it has.
    ///
    /// # Errors
    /// What the target finds.
    fn append(&mut self, there: usize, words: Vec<u32>) -> Result<()>;

    /// Takes the brick table and the codebooks, behind the last page; again where more bricks were added.
    ///
    /// # Errors
    /// What the target finds.
    fn tables(&mut self, bricks: &[u32], books: &[u32]) -> Result<()>;
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Filled {
    /// Bytes of payloads that were written as they are.
    pub payload_bytes: u64,
    /// Bytes that were decoded or laid out anew before they were written.
    pub repacked_bytes: u64,
    /// Bytes of texels of CONSTANT and EMPTY bricks; texels of 0 are there from the start.
    pub filled_bytes: u64,
    /// Bytes besides: brick table, codebooks, and what aligns payloads in pages.
    pub table_bytes: u64,
    /// Stored bricks that were written.
    pub bricks: u64,
    /// Bricks that nobody wanted, or that were there.
    pub skipped: u64,
}

impl Filled {
    /// The sum of both.
    #[must_use]
    pub const fn plus(self, more: &Filled) -> Filled {
        Filled {
            payload_bytes: self.payload_bytes + more.payload_bytes,
            repacked_bytes: self.repacked_bytes + more.repacked_bytes,
            filled_bytes: self.filled_bytes + more.filled_bytes,
            table_bytes: self.table_bytes + more.table_bytes,
            bricks: self.bricks + more.bricks,
            skipped: self.skipped + more.skipped,
        }
    }

    /// All bytes that were written.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.payload_bytes + self.repacked_bytes + self.filled_bytes + self.table_bytes
    }
}

/// Which bricks of a level are there, and where in pages.
#[derive(Clone, Debug, Default)]
pub struct Resident {
    /// Bricks that are there, x fastest; empty before the first is.
    bricks: Vec<bool>,
    /// The brick table of zerobit.
    pub(super) table: Vec<u32>,
    /// Pages that have been handed over.
    pub(super) pages: u32,
    /// Words of the last of them.
    pub(super) last_words: usize,
}

impl Resident {
    /// Whether a brick (position in bricks) is there.
    #[must_use]
    pub fn has(&self, layout: &LevelLayout, brick: Coord) -> bool {
        self.bricks.get(layout.brick_index(brick)).copied().unwrap_or(false)
    }

    /// Bricks that are not there.
    #[must_use]
    pub fn missing(&self) -> u64 {
        self.bricks.iter().filter(|there| !**there).count() as u64
    }
}

/// Writes the bricks of a level that are `wanted` (position in bricks) and not yet there to `target`, whose other texels are 0.
/// `progress` is told how many bricks are done, of how many. After an error the target is not to be used.
///
/// # Errors
/// Those of reading bricks, and of the target; `E_LIMIT` where streams take more pages than the layout has.
pub fn fill(
    volume: &Volume,
    layout: &LevelLayout,
    resident: &mut Resident,
    wanted: &dyn Fn(Coord) -> bool,
    target: &mut dyn LevelTarget,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Filled> {
    let [nx, ny, nz] = layout.bricks;
    let bricks = (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
    let total = u64::from(nx) * u64::from(ny) * u64::from(nz);
    resident.bricks.resize(usize::try_from(total).unwrap_or(usize::MAX), false);
    let chosen: Vec<Coord> = bricks.filter(|&b| wanted(b) && !resident.has(layout, b)).collect();
    let mut writer = Writer { volume, layout, target, filled: Filled::default(), scratch: Vec::new() };
    writer.filled.skipped = total - chosen.len() as u64;
    let mut pager = layout.pages.map(|pages| Pager::new(layout, pages, volume.info().null_sample(), resident));
    let mut done = 0;
    let of = chosen.len() as u64;
    volume.brick_payloads(layout.at, chosen.iter().copied(), |group| {
        done += group.len() as u64;
        match &mut pager {
            Some(pager) => group.iter().try_for_each(|(brick, payload)| pager.add(&mut writer, *brick, payload))?,
            None => writer.group(&group)?,
        }
        progress(done, of);
        Ok(())
    })?;
    if let Some(pager) = pager {
        pager.finish(&mut writer, resident)?;
    }
    for brick in chosen {
        resident.bricks[layout.brick_index(brick)] = true;
    }
    Ok(writer.filled)
}

/// What is between bricks and target.
pub(super) struct Writer<'a> {
    pub(super) volume: &'a Volume,
    pub(super) layout: &'a LevelLayout,
    pub(super) target: &'a mut dyn LevelTarget,
    pub(super) filled: Filled,
    scratch: Vec<u8>,
}

impl Writer<'_> {
    fn group(&mut self, group: &[(Coord, BrickPayload<'_>)]) -> Result<()> {
        // Decoding is work for all cores; little enough of it at a time that the result fits the caches.
        for some in group.chunks(4 * rayon::current_num_threads()) {
            let layout = self.layout;
            let repacked = some.par_iter().map(|(_, p)| repacked(layout, p)).collect::<Result<Vec<_>>>()?;
            for ((brick, payload), repacked) in some.iter().zip(repacked) {
                self.brick(*brick, payload, repacked.as_deref())?;
            }
        }
        Ok(())
    }

    fn brick(&mut self, brick: Coord, payload: &BrickPayload<'_>, repacked: Option<&[u8]>) -> Result<()> {
        let extent = self.volume.head().octree.brick_extent(self.layout.at.lod, brick);
        for (i, texture) in self.layout.textures.iter().enumerate() {
            let place = self.layout.fold.place(brick);
            let origin = std::array::from_fn(|a| place[a] * texture.per_brick[a]);
            let size = texture.texels(extent);
            let (count, bytes) = match (payload, repacked) {
                (_, Some(bytes)) => (&mut self.filled.repacked_bytes, bytes),
                (BrickPayload::Stored { codec, bytes, .. }, None) => {
                    let part = match (codec, texture.role) {
                        (Codec::S3dc(params), role) => {
                            let lies = s3dc::Layout::new(params, self.layout.store.sample(), extent);
                            if role == Role::Minmax { 0..lies.mmv_bytes() } else { lies.iv_start()..lies.payload_len() }
                        }
                        (_, _) => 0..bytes.len(),
                    };
                    (&mut self.filled.payload_bytes, &bytes[part])
                }
                (BrickPayload::Constant(value), None) => {
                    (&mut self.filled.filled_bytes, constant(texture, size, *value, &mut self.scratch))
                }
                (BrickPayload::Empty, None) => {
                    let null = self.volume.info().null_sample();
                    (&mut self.filled.filled_bytes, constant(texture, size, null, &mut self.scratch))
                }
            };
            if !bytes.is_empty() {
                *count += bytes.len() as u64;
                self.target.write(i, origin, size, bytes)?;
            }
        }
        self.filled.bricks += u64::from(matches!(payload, BrickPayload::Stored { .. }));
        Ok(())
    }
}

/// The texels of a stored brick of samples, where they are not the bytes of its payload.
fn repacked(layout: &LevelLayout, payload: &BrickPayload<'_>) -> Result<Option<Vec<u8>>> {
    let (Store::Raw { sample }, BrickPayload::Stored { codec, extent, bytes }) = (layout.store, payload) else {
        return Ok(None);
    };
    let format = layout.textures[0].format;
    if **codec == Codec::Raw {
        return Ok(turn(sample, format, bytes));
    }
    let mut grid = Grid::zeros(*extent, sample)?;
    codec.decode(bytes, *extent, &Region::whole(*extent), grid.view_mut())?;
    Ok(Some(turn(sample, format, grid.bytes()).unwrap_or_else(|| grid.bytes().to_vec())))
}

/// Samples as texels of `format`; `None` where they are the same bytes.
fn turn(sample: SampleType, format: TexelFormat, bytes: &[u8]) -> Option<Vec<u8>> {
    let f32_of = |b: [u8; 2]| match sample {
        SampleType::I16 => f32::from(i16::from_le_bytes(b)),
        _ => f32::from(u16::from_le_bytes(b)),
    };
    match (sample, format) {
        (SampleType::Rgb8, _) => Some(bytes.chunks_exact(3).flat_map(|c| [c[0], c[1], c[2], 0]).collect()),
        (SampleType::U16 | SampleType::I16, TexelFormat::R32Float) => {
            Some(bytes.chunks_exact(2).flat_map(|b| f32_of([b[0], b[1]]).to_le_bytes()).collect())
        }
        _ => None,
    }
}

/// Texels of a brick all of whose voxels are `value`; none where they are all 0.
fn constant<'s>(texture: &TextureLayout, size: [u32; 3], value: SampleValue, scratch: &'s mut Vec<u8>) -> &'s [u8] {
    scratch.clear();
    let t = value.sample_type();
    let one = &value.to_raw().to_le_bytes()[..t.bytes()];
    let texel = match texture.role {
        Role::Index => return scratch, // every index 0: the lower end point
        Role::Minmax => [one, one].concat(),
        Role::Raw => turn(t, texture.format, one).unwrap_or_else(|| one.to_vec()),
    };
    if texel.iter().any(|&b| b != 0) {
        let texels = size.iter().map(|&v| v as usize).product();
        scratch.reserve(texels * texel.len());
        (0..texels).for_each(|_| scratch.extend(&texel));
    }
    scratch
}

/// A level that turns out to be larger than its index says.
pub(super) fn too_many_pages(layout: &LevelLayout, pages: u32) -> Error {
    let message = format!(
        "the streams of level {} take more than {pages} pages of {}: use a coarser level, or source decoded",
        layout.at.lod,
        super::readable(layout.pages.map_or(0, |p| p.page_bytes))
    );
    Error::new(Code::Limit, "gpu-mem", message)
}

/// Bytes of a payload's longest possible form that a page must hold.
pub(super) fn too_long(layout: &LevelLayout, extent: Extent, bytes: usize) -> Error {
    let message =
        format!("a brick of {extent} voxels in level {} takes {bytes} bytes, more than a page", layout.at.lod);
    Error::new(Code::Limit, "gpu-mem", message)
}
