//! What a payload is made of: null nodes, kept coefficients, bytes per stream, and what the other stream would take
//! (Bajaj et al. 2001, Fig. 5 and §3.1; spec chapter 14, §4 to §7).

use super::bits::{self, Popcount};
use super::layout::{Cell, Layout, NEW_RECORD, OLD_RECORD, OldCell, PREFIX_BYTES, byte, unit};
use super::params::Stream;
use super::{UNIT_CELLS, Zerobit};
use crate::geometry::Extent;
use std::ops::AddAssign;

/// Bytes of payloads by part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StreamBytes {
    /// Prefixes of payloads.
    pub prefix: u64,
    /// Directories, which hold NNNC.
    pub directory: u64,
    /// Cell Bit Flag Tables.
    pub cbft: u64,
    /// Records of stored cells: offsets and average indices (CIA); in the old stream offsets alone.
    pub records: u64,
    /// Which coefficients are there: zerobits and maps (ZSMS); in the old stream 64 flags per stored cell.
    pub significance: u64,
    /// Indices of details (DIS); in the old stream of averages and details.
    pub indices: u64,
    /// Zeros behind unit blocks.
    pub padding: u64,
}

impl StreamBytes {
    /// All bytes.
    #[must_use]
    pub const fn total(&self) -> u64 {
        self.prefix + self.directory + self.paper_unit_blocks() + self.padding
    }

    /// As the paper counts them: one byte of NNNC per unit block, of which there are `unit_blocks`; neither prefixes,
    /// nor a directory, nor padding.
    #[must_use]
    pub const fn as_in_the_paper(&self, unit_blocks: u64) -> u64 {
        unit_blocks + self.paper_unit_blocks()
    }

    const fn paper_unit_blocks(&self) -> u64 {
        self.cbft + self.records + self.significance + self.indices
    }
}

impl AddAssign for StreamBytes {
    fn add_assign(&mut self, other: StreamBytes) {
        self.prefix += other.prefix;
        self.directory += other.directory;
        self.cbft += other.cbft;
        self.records += other.records;
        self.significance += other.significance;
        self.indices += other.indices;
        self.padding += other.padding;
    }
}

/// What payloads hold. Sums: those of several bricks can be added in any order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Payloads.
    pub payloads: u64,
    /// Bytes of the payloads before any supercompression.
    pub payload_bytes: u64,
    /// Unit blocks of 16³ voxels.
    pub unit_blocks: u64,
    /// Unit blocks whose cells are all null.
    pub void_unit_blocks: u64,
    /// Cells of 4³ voxels that are stored.
    pub stored_cells: u64,
    /// Level-0 nodes (one per stored cell) that have details.
    pub nodes_0: u64,
    /// Level-1 nodes (eight per stored cell) that have details.
    pub nodes_1: u64,
    /// Averages that are stored: those of all stored cells in the new stream.
    pub averages: u64,
    /// Details that are stored, of both levels.
    pub details: u64,
    /// Bytes in the new stream, as stored or as it would be.
    pub new: StreamBytes,
    /// Bytes in the old stream, as stored or as it would be.
    pub old: StreamBytes,
}

impl Stats {
    /// Coefficients that are stored (the paper's λ times the number of voxels).
    #[must_use]
    pub const fn coefficients(&self) -> u64 {
        self.averages + self.details
    }

    /// γ0: the share of `cells` whose level-0 node is null. The paper does not say of which cells; both the stored ones
    /// and all of the volume are a reading. `None` of no cells.
    #[must_use]
    pub fn gamma_0(&self, cells: u64) -> Option<f64> {
        (cells > 0).then(|| 1.0 - self.nodes_0 as f64 / cells as f64)
    }

    /// γ1: the share of null level-1 nodes of `cells`, which have eight each.
    #[must_use]
    pub fn gamma_1(&self, cells: u64) -> Option<f64> {
        (cells > 0).then(|| 1.0 - self.nodes_1 as f64 / (8.0 * cells as f64))
    }

    /// Adds a unit block that is not void.
    fn add_unit(&mut self, cells: &[CellStats]) {
        let stored = cells.len() as u64;
        let sum = |f: fn(&CellStats) -> u32| cells.iter().map(|c| u64::from(f(c))).sum::<u64>();
        let (averages, nodes_0, nodes_1, details) =
            (sum(|c| c.averages), sum(|c| c.nodes_0), sum(|c| c.nodes_1), sum(|c| c.details));
        self.stored_cells += stored;
        self.averages += averages;
        self.nodes_0 += nodes_0;
        self.nodes_1 += nodes_1;
        self.details += details;
        let new = StreamBytes {
            cbft: 8,
            records: NEW_RECORD as u64 * stored,
            significance: stored + nodes_0 + nodes_1,
            indices: details,
            ..StreamBytes::default()
        };
        let old = StreamBytes {
            cbft: 8,
            records: (OLD_RECORD as u64 - 8) * stored,
            significance: 8 * stored,
            indices: averages + details,
            ..StreamBytes::default()
        };
        self.new += padded(new);
        self.old += padded(old);
    }
}

fn padded(unit: StreamBytes) -> StreamBytes {
    let len = unit.total();
    StreamBytes { padding: len.next_multiple_of(4) - len, ..unit }
}

impl AddAssign for Stats {
    fn add_assign(&mut self, other: Stats) {
        self.payloads += other.payloads;
        self.payload_bytes += other.payload_bytes;
        self.unit_blocks += other.unit_blocks;
        self.void_unit_blocks += other.void_unit_blocks;
        self.stored_cells += other.stored_cells;
        self.nodes_0 += other.nodes_0;
        self.nodes_1 += other.nodes_1;
        self.averages += other.averages;
        self.details += other.details;
        self.new += other.new;
        self.old += other.old;
    }
}

/// What one stored cell has.
struct CellStats {
    averages: u32,
    nodes_0: u32,
    nodes_1: u32,
    details: u32,
}

impl CellStats {
    fn of_new(cell: &Cell<'_>) -> Self {
        let z = &cell.zerobits;
        let maps = (0..z.count()).map(|k| byte(cell.payload, z.maps + k as usize));
        CellStats {
            averages: 1,
            nodes_0: u32::from(z.level_0),
            nodes_1: z.level_1.count_ones(),
            details: maps.map(|map| bits::details(map).count_ones()).sum(),
        }
    }

    // Bit p = 7i + j of the flags: seven bits per node, behind that of the average.
    fn of_old(cell: &OldCell<'_>) -> Self {
        let node = |i: u32| u32::from(cell.flags >> (7 * i + 1) & 0x7F != 0);
        let averages = (cell.flags & 1) as u32;
        CellStats {
            averages,
            nodes_0: node(0),
            nodes_1: (1..9).map(node).sum(),
            details: cell.flags.count_ones() - averages,
        }
    }
}

impl Zerobit {
    /// What the payload of a brick of this extent holds. Any bytes give some numbers; those of a canonical payload add up to
    /// its length.
    #[must_use]
    pub fn stats(&self, payload: &[u8], brick: Extent) -> Stats {
        let unit_blocks = Layout::new(brick).units.voxels();
        let frame = StreamBytes { prefix: PREFIX_BYTES as u64, directory: 4 * unit_blocks, ..StreamBytes::default() };
        let mut stats = Stats {
            payloads: 1,
            payload_bytes: payload.len() as u64,
            unit_blocks,
            new: frame,
            old: frame,
            ..Stats::default()
        };
        for index in 0..unit_blocks as usize {
            let Some(unit) = unit(payload, index) else {
                stats.void_unit_blocks += 1;
                continue;
            };
            let cells = (0..UNIT_CELLS).filter_map(|n| match self.stream() {
                Stream::New => unit.cell(n, Popcount).map(|cell| CellStats::of_new(&cell)),
                Stream::Old => unit.old_cell(n, Popcount).map(|cell| CellStats::of_old(&cell)),
            });
            stats.add_unit(&cells.collect::<Vec<_>>());
        }
        stats
    }
}
