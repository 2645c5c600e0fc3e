//! What the zerobit bricks of a volume are made of (spec chapter 14; Bajaj et al. 2001, Fig. 5 and 10).

use super::open::Volume;
use crate::codec::Codec;
use crate::codec::zerobit::{CELL_EDGE, Params, Stats, Stream};
use crate::container::NodeKind;
use crate::error::Result;
use crate::geometry::{Coord, Extent, unmorton8};
use rayon::prelude::*;

/// Zerobit bricks of one level, or of all levels, of all trees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LevelStats {
    /// Sums over the payloads.
    pub stats: Stats,
    /// Bytes of the payloads as they are in the file: compressed, where that is smaller.
    pub stored_bytes: u64,
    /// Voxels of the level, whatever its bricks are.
    pub voxels: u64,
    /// Cells of 4³ voxels of the level, whatever its bricks are.
    pub cells: u64,
}

impl LevelStats {
    /// Cells that are not stored, those of CONSTANT and EMPTY bricks included.
    #[must_use]
    pub const fn null_cells(&self) -> u64 {
        self.cells.saturating_sub(self.stats.stored_cells)
    }

    fn add(mut self, other: &LevelStats) -> LevelStats {
        self.stats += other.stats;
        self.stored_bytes += other.stored_bytes;
        self.voxels += other.voxels;
        self.cells += other.cells;
        self
    }
}

/// What the zerobit bricks of a volume are made of.
#[derive(Clone, Debug, PartialEq)]
pub struct CodecStats {
    /// Layout of the unit blocks.
    pub stream: Stream,
    /// How the encoder chose.
    pub params: Params,
    /// Level 0.
    pub finest: LevelStats,
    /// All levels.
    pub all: LevelStats,
    /// Codebooks.
    pub codebooks: u64,
    /// Their bytes in the file.
    pub codebook_bytes: u64,
    /// Bytes of their words alone, as the paper counts them.
    pub codebook_words: u64,
}

impl CodecStats {
    /// Voxels of level 0 that the ratio to keep refers to: the selected ones, where there was a selection.
    #[must_use]
    pub const fn reference_voxels(&self) -> u64 {
        if self.params.selected > 0 { self.params.selected } else { self.finest.voxels }
    }

    /// The ratio of coefficients of level 0 that are stored (the paper's actual λ).
    #[must_use]
    pub fn kept(&self) -> f64 {
        self.finest.stats.coefficients() as f64 / self.reference_voxels().max(1) as f64
    }
}

/// A stored brick's place.
struct Place {
    tree: u32,
    lod: u8,
    brick: Coord,
}

impl Volume {
    /// Looks into every zerobit brick; `None` where the codec table has no zerobit entry. Runs on the current rayon pool.
    ///
    /// Where a table has several zerobit entries, stream and parameters are those of the first.
    ///
    /// # Errors
    /// Those of damaged pages, codebooks and bricks.
    pub fn codec_stats(&self) -> Result<Option<CodecStats>> {
        let d = self.info();
        let codecs = (0..d.codecs.len()).map(|i| self.codecs.get(u8::try_from(i).expect("at most 255 entries")));
        let first = codecs.flatten().find_map(|entry| match entry.codec() {
            Codec::Zerobit(z) => Some((z.stream(), *z.params())),
            _ => None,
        });
        let Some((stream, params)) = first else { return Ok(None) };
        let levels = &self.head.octree.levels;
        let trees = u64::from(d.trees());
        let empty = levels.iter().map(|level| LevelStats {
            voxels: level.extent.voxels() * trees,
            cells: level.extent.div_ceil(Extent::cube(CELL_EDGE)).voxels() * trees,
            ..LevelStats::default()
        });
        let empty: Vec<LevelStats> = empty.collect();
        let none = || vec![LevelStats::default(); levels.len()];
        let add = |a: Vec<LevelStats>, b: Vec<LevelStats>| a.iter().zip(&b).map(|(a, b)| a.add(b)).collect();
        let found: Vec<LevelStats> = self
            .stored_places()?
            .par_iter()
            .map(|place| {
                let mut levels = none();
                levels[usize::from(place.lod)] = self.brick_stats(place)?;
                Ok(levels)
            })
            .try_reduce(none, |a, b| Ok(add(a, b)))?;
        let levels = add(empty, found);
        let books = self.codebooks()?;
        let words: usize = books.iter().map(|b| b.averages().len() + b.details().len()).sum();
        Ok(Some(CodecStats {
            stream,
            params,
            finest: levels[0],
            all: levels.iter().fold(LevelStats::default(), LevelStats::add),
            codebooks: books.len() as u64,
            codebook_bytes: self.head.section(*b"CBOK").map_or(0, |s| s.stored_len),
            codebook_words: (words * d.sample_type.bytes()) as u64,
        }))
    }

    /// All stored bricks of all trees and levels.
    fn stored_places(&self) -> Result<Vec<Place>> {
        let mut places = Vec::new();
        let visited = self.pages.each_present(&self.head, &self.source, |ordinal, page| {
            let (tree, lod, position) = self.head.octree.page_position(ordinal);
            for (slot, _) in page.nodes().iter().enumerate().filter(|(_, n)| n.kind == NodeKind::Stored) {
                let local = unmorton8(slot);
                let brick = std::array::from_fn(|a| position[a] * 8 + local[a]);
                // A hostile page may name bricks that do not exist.
                if self.head.octree.levels[usize::from(lod)].bricks.contains(brick) {
                    places.push(Place { tree, lod, brick });
                }
            }
            Ok(())
        });
        visited.map_err(|e| self.replaced_or(e))?;
        Ok(places)
    }

    fn brick_stats(&self, &Place { tree, lod, brick }: &Place) -> Result<LevelStats> {
        let found = self.find(tree, lod, brick)?;
        let (entry, layout) = self.codec_of(found.node(), lod, brick)?;
        let Codec::Zerobit(z) = entry.codec() else { return Ok(LevelStats::default()) };
        let payload = self.payload(&found, layout)?;
        let stats = z.stats(&payload, self.codecs.layout(layout).extent);
        let stored_bytes = u64::from(found.node().stored_len);
        Ok(LevelStats { stats, stored_bytes, ..LevelStats::default() })
    }
}
