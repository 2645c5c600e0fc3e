//! How many bricks of which kind a file holds.

use super::open::Volume;
use crate::container::{NodeFlags, NodeKind};
use crate::error::Result;

/// Bricks of all trees and levels by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BrickCounts {
    /// All bricks of the grid.
    pub total: u64,
    /// With a payload.
    pub stored: u64,
    /// One value each, kept in the index.
    pub constant: u64,
    /// Full of the null value; kept nowhere.
    pub empty: u64,
    /// Stored ones whose payload is compressed with zstd.
    pub zstd: u64,
}

impl Volume {
    /// Counts bricks by kind. Reads every present page of the index, and no brick.
    ///
    /// # Errors
    /// Those of damaged pages.
    pub fn brick_counts(&self) -> Result<BrickCounts> {
        let octree = &self.head.octree;
        let mut counts = BrickCounts { total: octree.brick_count(), ..BrickCounts::default() };
        let counted = self.pages.each_present(&self.head, &self.source, |_, page| {
            for node in page.nodes() {
                match node.kind {
                    NodeKind::Stored => {
                        counts.stored += 1;
                        counts.zstd += u64::from(node.flags.contains(NodeFlags::ZSTD));
                    }
                    NodeKind::Constant => counts.constant += 1,
                    NodeKind::Empty => {}
                }
            }
            Ok(())
        });
        counted.map_err(|e| self.replaced_or(e))?;
        counts.empty = counts.total.saturating_sub(counts.stored + counts.constant);
        Ok(counts)
    }
}
