//! What takes bricks: a head file or a log.

use super::{FileSummary, FinishOptions, Node, Octree, VolumeDescriptor};
use crate::error::Result;
use crate::geometry::Coord;

/// A file that is being written brick by brick, in whatever layout.
pub trait BrickSink {
    /// What is left when the file is complete.
    type Out;

    /// The octree that bricks are put into.
    fn octree(&self) -> &Octree;

    /// Adds a STORED brick. `node` gives codec, flags and the brick's own bounds ([`Node::new_stored`]); the sink fills in
    /// offset, length and CRC.
    ///
    /// # Errors
    /// `E_RANGE`, `E_DUP`, `E_REF` (codec), `E_PARAM`, `E_LIMIT` (64 MiB), `E_NONFINITE`, `E_MINMAX_ORDER`, `E_SOURCE`.
    fn put_stored(&mut self, tree: u32, level: u8, brick: Coord, node: &Node, payload: &[u8]) -> Result<()>;

    /// Adds a CONSTANT brick ([`Node::new_constant`]). Bricks that are never added are EMPTY.
    ///
    /// # Errors
    /// `E_RANGE`, `E_DUP`, `E_PARAM`, `E_CANON`, `E_NONFINITE`.
    fn put_constant(&mut self, tree: u32, level: u8, brick: Coord, node: &Node) -> Result<()>;

    /// Makes all that was put so far readable, where the layout can. A head file cannot: it appears whole.
    ///
    /// # Errors
    /// As [`BrickSink::finish`].
    fn checkpoint(&mut self, descriptor: &VolumeDescriptor, options: &FinishOptions) -> Result<()> {
        let _ = (descriptor, options);
        Ok(())
    }

    /// Bytes of index and tables that the last checkpoint went through, changed or not: what the next one costs at least.
    fn checkpoint_cost(&self) -> u64 {
        0
    }

    /// Whether it is time for a checkpoint, where `pending` bytes of payload follow the last one: from `least` on, and four
    /// times what a checkpoint costs, so that all checkpoints together cost less than what is written.
    fn checkpoint_due(&self, pending: u64, least: u64) -> bool {
        pending >= least.max(self.checkpoint_cost().saturating_mul(4))
    }

    /// Writes what is left to write. `descriptor` may say more than the one given first (what was achieved, ranges,
    /// placement), but octree, sample type and codecs must be the same.
    ///
    /// # Errors
    /// Those of [`VolumeDescriptor::check`]; `E_PARAM` where the descriptor has another octree; `E_UTF8`, `E_DUP`,
    /// `E_LIMIT` for metadata; `E_SOURCE`.
    fn finish(self, descriptor: &VolumeDescriptor, options: FinishOptions) -> Result<(Self::Out, FileSummary)>;
}
