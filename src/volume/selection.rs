//! Selective compression: only the cells that somebody needs are stored (zerobit paper, §1 and §4.3).

use crate::codec::zerobit::CELL_EDGE;
use crate::error::{Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::{SlabReader, ViewMut, dense_len};
use crate::voxel::{SampleType, SampleValue};
use crate::with_sample;
use std::ops::Range;
use std::sync::Arc;

/// Cells of 4³ voxels that are wanted; every other voxel becomes the null value before anything is encoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Voxels of the volume.
    extent: Extent,
    /// Cells per axis.
    cells: Extent,
    /// A bit per cell, x fastest.
    bits: Arc<[u64]>,
}

impl Selection {
    /// The cells that hold a voxel at which `mask` is not 0. Memory: a bit per cell, and four planes of the mask.
    ///
    /// # Errors
    /// `E_PARAM` for a mask that selects nothing; those of the reader.
    pub fn from_mask(mask: &mut dyn SlabReader) -> Result<Selection> {
        let (extent, t) = (mask.extent(), mask.sample_type());
        let plane_bytes = dense_len(Extent { z: 1, ..extent }, t)?;
        let row_bytes = extent.x as usize * t.bytes();
        let mut slab = vec![0; plane_bytes * CELL_EDGE.min(extent.z) as usize];
        let cells = extent.div_ceil(Extent::cube(CELL_EDGE));
        let mut bits = vec![0u64; cells.voxels().div_ceil(64) as usize];
        for cz in 0..cells.z {
            let planes = cz * CELL_EDGE..((cz + 1) * CELL_EDGE).min(extent.z);
            let bytes = &mut slab[..plane_bytes * planes.len()];
            mask.read_slab(planes, bytes)?;
            for plane in bytes.chunks_exact(plane_bytes) {
                for (y, row) in (0..).zip(plane.chunks_exact(row_bytes)) {
                    for (cx, voxels) in (0..).zip(row.chunks(t.bytes() * CELL_EDGE as usize)) {
                        if voxels.iter().any(|&b| b != 0) {
                            set(&mut bits, cells.index([cx, y / CELL_EDGE, cz]));
                        }
                    }
                }
            }
        }
        if bits.iter().all(|&b| b == 0) {
            return Err(Error::param("selection", "the mask is 0 everywhere: nothing would be stored"));
        }
        Ok(Selection { extent, cells, bits: bits.into() })
    }

    /// Voxels of the volume that the selection is for.
    #[must_use]
    pub const fn extent(&self) -> Extent {
        self.extent
    }

    /// Whether cell `cell` (position in cells) is wanted.
    #[must_use]
    pub fn contains(&self, cell: Coord) -> bool {
        let i = self.cells.index(cell);
        self.cells.contains(cell) && self.bits[(i / 64) as usize] >> (i % 64) & 1 == 1
    }

    /// Voxels in wanted cells of level `lod`, where a cell is wanted if one below it is.
    #[must_use]
    pub(super) fn voxels(&self, lod: u8) -> u64 {
        let mut level = self.clone();
        for _ in 0..lod {
            level = level.halved();
        }
        let whole = Region::whole(level.extent);
        let wanted = level.each_cell().filter(|&c| level.contains(c));
        wanted.map(|c| cell_region(c).intersect(&whole).extent().voxels()).sum()
    }

    fn halved(&self) -> Selection {
        let extent = self.extent.at_lod(1);
        let cells = extent.div_ceil(Extent::cube(CELL_EDGE));
        let mut bits = vec![0u64; cells.voxels().div_ceil(64) as usize];
        for cell in self.each_cell().filter(|&c| self.contains(c)) {
            set(&mut bits, cells.index(cell.map(|v| v / 2)));
        }
        Selection { extent, cells, bits: bits.into() }
    }

    fn each_cell(&self) -> impl Iterator<Item = Coord> + use<> {
        let Extent { x, y, z } = self.cells;
        (0..z).flat_map(move |z| (0..y).flat_map(move |y| (0..x).map(move |x| [x, y, z])))
    }
}

fn cell_region(cell: Coord) -> Region {
    Region::at(cell.map(|c| c * CELL_EDGE), Extent::cube(CELL_EDGE))
}

fn set(bits: &mut [u64], i: u64) {
    bits[(i / 64) as usize] |= 1 << (i % 64);
}

/// A source of which only a selection is looked at.
pub(super) struct Selected<'a> {
    inner: &'a mut dyn SlabReader,
    selection: &'a Selection,
    null: SampleValue,
}

impl<'a> Selected<'a> {
    /// # Errors
    /// `E_PARAM` where the selection is for another extent.
    pub(super) fn new(inner: &'a mut dyn SlabReader, selection: &'a Selection, null: SampleValue) -> Result<Self> {
        let (extent, own) = (inner.extent(), selection.extent());
        if extent != own {
            return Err(Error::param(
                "selection",
                format!("the mask (--select) has {own} voxels, the volume {extent} (x, y, z)"),
            ));
        }
        Ok(Selected { inner, selection, null })
    }
}

impl SlabReader for Selected<'_> {
    fn extent(&self) -> Extent {
        self.inner.extent()
    }

    fn sample_type(&self) -> SampleType {
        self.inner.sample_type()
    }

    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        self.read_rows(z, 0..self.extent().y, out)
    }

    fn read_rows(&mut self, z: Range<u32>, y: Range<u32>, out: &mut [u8]) -> Result<()> {
        self.inner.read_rows(z.clone(), y.clone(), out)?;
        let extent = Extent { y: y.end - y.start, z: z.end - z.start, ..self.extent() };
        let mut view = ViewMut::dense(out, extent, self.sample_type());
        let slab = Region { start: [0, y.start, z.start], end: [extent.x, y.end, z.end] };
        let rows = y.start / CELL_EDGE..y.end.div_ceil(CELL_EDGE);
        let cells = self.selection.cells;
        for cz in z.start / CELL_EDGE..z.end.div_ceil(CELL_EDGE) {
            for cell in rows.clone().flat_map(|y| (0..cells.x).map(move |x| [x, y, cz])) {
                if self.selection.contains(cell) {
                    continue;
                }
                let mut part = cell_region(cell).intersect(&slab);
                for (axis, origin) in [(1, y.start), (2, z.start)] {
                    (part.start[axis], part.end[axis]) = (part.start[axis] - origin, part.end[axis] - origin);
                }
                with_sample!(self.null.sample_type(), T => view.sub(&part).fill::<T>(self.null.typed()));
            }
        }
        Ok(())
    }

    fn series(&self) -> (u32, u32) {
        self.inner.series()
    }

    fn turn_to(&mut self, time: u32, channel: u32) -> Result<()> {
        self.inner.turn_to(time, channel)
    }

    fn is_sequential(&self) -> bool {
        self.inner.is_sequential()
    }
}
