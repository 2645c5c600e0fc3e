//! A level in this machine's memory, byte for byte as a GPU holds it: what the CPU renderer samples.

use super::{Filled, LevelLayout, LevelTarget, Resident, TextureLayout, fill, readable};
use crate::error::{Code, Error, Result};
use crate::geometry::Coord;
use crate::volume::Volume;

/// A level in memory.
///
/// Of zerobit levels, [`HostLevel::table`] has four words per brick (x fastest): 0 or 1 and, in the fourth, the raw value of
/// every voxel; or 2 + page, first word in the page, bytes of the payload, number of its codebook. Four more behind them are
/// those of an EMPTY brick: the value of null cells. [`HostLevel::books`] has 512 words per codebook: 256 averages, then 256 details; of scalars as i32, of rgb8 three bytes from the lowest on.
#[derive(Clone, Debug)]
pub struct HostLevel {
    /// How it lies.
    pub layout: LevelLayout,
    /// Texels of each texture, x fastest, then y, then z; little-endian.
    pub textures: Vec<Vec<u8>>,
    /// Pages of streams: payloads at whole words, little-endian.
    pub pages: Vec<Vec<u32>>,
    /// The brick table of zerobit.
    pub table: Vec<u32>,
    /// The codebooks of zerobit.
    pub books: Vec<u32>,
    /// What was written.
    pub filled: Filled,
    /// Which bricks are there.
    pub resident: Resident,
}

impl HostLevel {
    /// Loads the `wanted` bricks (position in bricks) of a level.
    ///
    /// # Errors
    /// `E_LIMIT` where there is not that much memory; those of [`fill`].
    pub fn load(
        volume: &Volume,
        layout: LevelLayout,
        wanted: &dyn Fn(Coord) -> bool,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<Self> {
        let textures = layout.textures.iter().map(zeros).collect::<Result<_>>()?;
        let (pages, table, books, filled) = (Vec::new(), Vec::new(), Vec::new(), Filled::default());
        let mut level = HostLevel { layout, textures, pages, table, books, filled, resident: Resident::default() };
        level.add(volume, wanted, progress)?;
        Ok(level)
    }

    /// Loads those `wanted` bricks that are not there yet. After an error the level is not to be used.
    ///
    /// # Errors
    /// As [`HostLevel::load`].
    pub fn add(
        &mut self,
        volume: &Volume,
        wanted: &dyn Fn(Coord) -> bool,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<Filled> {
        let HostLevel { layout, textures, pages, table, books, resident, .. } = self;
        let mut store = Memory { layout, textures, pages, table, books };
        let filled = fill(volume, layout, resident, wanted, &mut store, progress)?;
        self.filled = self.filled.plus(&filled);
        self.filled.skipped = self.resident.missing();
        Ok(filled)
    }

    /// Texel `at` of texture `texture`, each channel as its 32 bits in a shader; 0 outside.
    #[must_use]
    #[inline]
    pub fn texel(&self, texture: usize, at: [u32; 3]) -> [u32; 4] {
        let t = &self.layout.textures[texture];
        match offset(t, at) {
            Some(from) => t.format.read(&self.textures[texture][from..]),
            None => [0; 4],
        }
    }
}

/// Where a texel lies; `None` outside.
#[inline]
fn offset(t: &TextureLayout, at: [u32; 3]) -> Option<usize> {
    let inside = (0..3).all(|a| at[a] < t.size[a]);
    let [x, y, z] = at.map(|v| v as usize);
    inside.then(|| (x + t.size[0] as usize * (y + t.size[1] as usize * z)) * t.format.bytes() as usize)
}

/// Copies rows of `row` bytes that lie side by side in `from` to where they lie `pitch` bytes apart.
pub(crate) fn copy_rows(to: &mut [u8], pitch: usize, from: &[u8], row: usize) {
    // A row of a brick is often so short that a call to copy it would take longer than its bytes.
    fn short<const N: usize>(to: &mut [u8], pitch: usize, from: &[u8]) {
        for (to, from) in to.chunks_mut(pitch).zip(from.as_chunks::<N>().0) {
            to[..N].copy_from_slice(from);
        }
    }
    match row {
        16 => short::<16>(to, pitch, from),
        32 => short::<32>(to, pitch, from),
        64 => short::<64>(to, pitch, from),
        _ => to.chunks_mut(pitch).zip(from.chunks_exact(row)).for_each(|(to, from)| to[..row].copy_from_slice(from)),
    }
}

fn zeros(t: &TextureLayout) -> Result<Vec<u8>> {
    let too_much = || {
        let message = format!("{} are more than this machine has; use a coarser level", readable(t.bytes()));
        Error::new(Code::Limit, "memory", message)
    };
    let len = usize::try_from(t.bytes()).ok().filter(|&n| isize::try_from(n).is_ok()).ok_or_else(too_much)?;
    // Asked for first, so that what cannot be had is an error; then taken as zeros, which costs nothing until it is used.
    Vec::<u8>::new().try_reserve_exact(len).map_err(|_| too_much())?;
    Ok(vec![0; len])
}

/// The target.
struct Memory<'a> {
    layout: &'a LevelLayout,
    textures: &'a mut [Vec<u8>],
    pages: &'a mut Vec<Vec<u32>>,
    table: &'a mut Vec<u32>,
    books: &'a mut Vec<u32>,
}

impl LevelTarget for Memory<'_> {
    fn write(&mut self, texture: usize, origin: [u32; 3], size: [u32; 3], bytes: &[u8]) -> Result<()> {
        let t = &self.layout.textures[texture];
        let texel = t.format.bytes() as usize;
        let (row, pitch) = (size[0] as usize * texel, t.size[0] as usize * texel);
        for (z, slice) in (0..size[2]).zip(bytes.chunks_exact(row * size[1] as usize)) {
            if let Some(from) = offset(t, [origin[0], origin[1], origin[2] + z]) {
                copy_rows(&mut self.textures[texture][from..], pitch, slice, row);
            }
        }
        Ok(())
    }

    fn page(&mut self, words: Vec<u32>) -> Result<()> {
        self.pages.push(words);
        Ok(())
    }

    fn append(&mut self, _there: usize, words: Vec<u32>) -> Result<()> {
        if let Some(page) = self.pages.last_mut() {
            page.extend(words);
        }
        Ok(())
    }

    fn tables(&mut self, bricks: &[u32], books: &[u32]) -> Result<()> {
        (*self.table, *self.books) = (bricks.to_vec(), books.to_vec());
        Ok(())
    }
}
