//! One volume of a source, walked once: slabs of bricks of all levels, in memory or, where they do not fit, in files.

use super::At;
use super::pyramid::{Block, Pyramid, Rows, Tower, working_bytes};
use super::slabs::{Place, Source, Walk, bricks, bricks_per_thread};
use super::spool::SlabBuffer;
use crate::error::{Code, Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::{AlignedBytes, SlabReader, View, dense_len};
use rayon::prelude::*;
use std::ops::Range;

/// A slab of bricks of a coarser level, growing.
struct Slab {
    extent: Extent,
    /// The layer of bricks that is being filled.
    layer: u32,
    buffer: SlabBuffer,
}

/// One volume, walked once: what is held meanwhile.
pub(super) struct Pass {
    at: At,
    pyramid: Pyramid,
    edge: u32,
    /// By level from 1 on; `None` for levels that are not visited.
    slabs: Vec<Option<Slab>>,
    tower: Option<Tower>,
    /// Rows of bricks of level 0 that are held at a time.
    rows_at_a_time: u32,
    /// Rows of bricks of level 0, unless the source lends them.
    strip: Option<AlignedBytes>,
    /// One slab of level 0, where it comes once and is too large for memory.
    spool: Option<SlabBuffer>,
}

impl Pass {
    pub(super) fn new(source: &mut Source<'_>, walk: &Walk, at: At) -> Result<Self> {
        let (fine, t) = (source.extent(), source.sample_type());
        let edge = 1u32 << walk.brick_log2;
        let coarsest = walk.levels.end - 1;
        let pyramid =
            Pyramid { fine, downsample: source.downsample, null: source.null, brick_log2: walk.brick_log2, coarsest };
        let visited = |level: u8| level > 0 && walk.levels.contains(&level);
        let slab_bytes = |level: u8| dense_len(slab_extent(fine.at_lod(level), edge), t);
        let coarse: u64 =
            (1..=coarsest).filter(|&l| visited(l)).map(|l| Ok(slab_bytes(l)? as u64)).sum::<Result<u64>>()?;
        let budget = Budget::new(source, edge, coarse, coarsest)?;
        let mut left = if budget.fits { u64::MAX } else { budget.memory / COARSE_SHARE };
        let mut slabs = Vec::new();
        // The smallest stay in memory.
        for level in (1..=coarsest).rev() {
            if !visited(level) {
                slabs.push(None);
                continue;
            }
            let bytes = slab_bytes(level)?;
            let in_memory = bytes as u64 <= left;
            left -= if in_memory { bytes as u64 } else { 0 };
            source.spooled |= !in_memory;
            let buffer = SlabBuffer::new(bytes, in_memory, source.temp_dir.as_deref())?;
            let layer = walk.layers.as_ref().map_or(0, |l| l.start);
            slabs.push(Some(Slab { extent: fine.at_lod(level), layer, buffer }));
        }
        slabs.reverse();
        let mut spool = None;
        if budget.is_split && source.reader.is_sequential() {
            source.spooled = true;
            spool = Some(SlabBuffer::new(slab_bytes(0)?, false, source.temp_dir.as_deref())?);
        }
        let strip = match budget.strip_bytes {
            0 => None,
            bytes => Some(AlignedBytes::zeroed(bytes)?),
        };
        let tower = pyramid.tower();
        Ok(Pass { at, pyramid, edge, slabs, tower, rows_at_a_time: budget.rows, strip, spool })
    }

    pub(super) fn run<R: Send>(
        mut self,
        source: &mut Source<'_>,
        walk: &Walk,
        work: &(impl Fn(Place, View<'_>) -> Result<R> + Sync),
        take: &mut impl FnMut(Place, R) -> Result<()>,
    ) -> Result<()> {
        let (fine, edge, memory) = (self.pyramid.fine, self.edge, source.memory);
        let (layers, brick_rows) = (fine.z.div_ceil(edge), fine.y.div_ceil(edge));
        // Only the layers of level 0 that the wanted ones are made of.
        let wanted = walk.layers.clone().map_or(0..layers, |l| {
            let level = walk.levels.start;
            (l.start << level)..(l.end << level).min(layers)
        });
        for bz in wanted {
            let z = bz * edge..((bz + 1) * edge).min(fine.z);
            if let Some(spool) = &mut self.spool {
                fill(spool, source.reader, z.clone())?;
            }
            let mut plane = Vec::new();
            for first in (0..brick_rows).step_by(self.rows_at_a_time as usize) {
                let y = first * edge..(first.saturating_add(self.rows_at_a_time).saturating_mul(edge)).min(fine.y);
                let view = read(source, self.strip.as_mut(), self.spool.as_mut(), z.clone(), y.clone())?;
                if walk.levels.contains(&0) {
                    bricks(self.at, edge, memory, &view, [y.start, z.start], work, take)?;
                }
                if self.pyramid.coarsest > 0 {
                    let blocks = blocks(&self.pyramid, edge, &view, [y.start, z.start]);
                    for block in blocks {
                        block.rows.iter().try_for_each(|rows| keep(&mut self.slabs, edge, rows))?;
                        plane.extend(block.top);
                    }
                }
            }
            if let Some(tower) = &mut self.tower {
                tower.take(plane, bz).iter().try_for_each(|rows| keep(&mut self.slabs, edge, rows))?;
            }
            for level in 1..=self.pyramid.coarsest {
                let end = if z.end == fine.z { u32::MAX } else { z.end >> level };
                if let Some(slab) = &mut self.slabs[usize::from(level) - 1] {
                    let at = At { lod: level, ..self.at };
                    slab.visit(at, edge, end, walk.layers.as_ref().map(|l| l.end), source, work, take)?;
                }
            }
        }
        Ok(())
    }
}

/// What the program and its writers hold whatever the volume; a fifth of the memory at most is set apart for it.
const FIXED_BYTES: u64 = 24 << 20;
/// Where not everything fits, one part in this many is for slabs of coarser levels.
const COARSE_SHARE: u64 = 4;

/// How much of level 0 is held at a time.
struct Budget {
    /// Bytes for slabs: what may be used, less what bricks in work take.
    memory: u64,
    /// Whether everything fits in memory.
    fits: bool,
    /// Rows of bricks.
    rows: u32,
    /// Whether that is less than a slab.
    is_split: bool,
    strip_bytes: usize,
}

impl Budget {
    /// Where not everything fits, a part of the memory is for coarser levels, the rest for rows of level 0.
    fn new(source: &Source<'_>, edge: u32, coarse: u64, coarsest: u8) -> Result<Budget> {
        let (fine, t) = (source.extent(), source.sample_type());
        let brick_rows = fine.y.div_ceil(edge);
        // Bricks that are worked on: their samples, payloads, decoded copies; and what does not depend on any size.
        let threads = rayon::current_num_threads() as u64;
        let brick = dense_len(Extent::cube(edge).min(fine), t)?;
        let in_work = threads * (2 * bricks_per_thread(brick, source.memory) + 2) as u64 * brick as u64;
        let fixed = FIXED_BYTES.min(source.memory / 5);
        let memory = source.memory.saturating_sub(in_work + fixed).max(source.memory / 4);
        if source.reader.as_view().is_some() {
            // The source itself is in memory: what is added is small beside it.
            return Ok(Budget { memory, fits: coarse <= memory, rows: brick_rows, is_split: false, strip_bytes: 0 });
        }
        let row = dense_len(Extent { y: edge.min(fine.y), ..slab_extent(fine, edge) }, t)?;
        let whole = dense_len(slab_extent(fine, edge), t)?;
        // Samples of coarser levels on their way to their slabs, and the sums they are made of, by the threads that are busy.
        let held = |rows: u32| {
            let strip = (row as u64).saturating_mul(u64::from(rows)).min(whole as u64);
            let sums = threads.min(u64::from(rows)) * working_bytes(fine.x, edge, t);
            if coarsest > 0 { strip + strip / 7 + sums } else { strip }
        };
        if held(brick_rows) + coarse <= memory {
            return Ok(Budget { memory, fits: true, rows: brick_rows, is_split: false, strip_bytes: whole });
        }
        let share = memory - memory / COARSE_SHARE;
        // Held bytes grow with the rows: a few steps find the most that fit.
        let (mut rows, mut too_many) = (0, brick_rows + 1);
        while too_many - rows > 1 {
            let middle = rows + (too_many - rows) / 2;
            *if held(middle) <= share { &mut rows } else { &mut too_many } = middle;
        }
        if rows == 0 {
            let message = format!(
                "a row of bricks takes {} bytes, more than there is for it of the {} that may be used; allow more memory (--memory {}M will do) or take smaller bricks (--brick)",
                held(1),
                source.memory,
                ((2 * (held(1) + in_work)) >> 20) + 1
            );
            return Err(Error::new(Code::Limit, "memory", message));
        }
        let strip_bytes = whole.min(row.saturating_mul(rows as usize));
        Ok(Budget { memory, fits: false, rows, is_split: rows < brick_rows, strip_bytes })
    }
}

impl Slab {
    /// Visits the layers of bricks that are complete, now that all planes before `end` are there.
    #[allow(clippy::too_many_arguments, reason = "one call, and a struct would only rename them")]
    fn visit<R: Send>(
        &mut self,
        at: At,
        edge: u32,
        end: u32,
        last_layer: Option<u32>,
        source: &Source<'_>,
        work: &(impl Fn(Place, View<'_>) -> Result<R> + Sync),
        take: &mut impl FnMut(Place, R) -> Result<()>,
    ) -> Result<()> {
        let (e, t) = (self.extent, source.sample_type());
        loop {
            let z = self.layer * edge..((self.layer + 1) * edge).min(e.z);
            if z.is_empty() || z.end > end || last_layer.is_some_and(|last| self.layer >= last) {
                return Ok(());
            }
            let depth = z.end - z.start;
            match &mut self.buffer {
                SlabBuffer::Memory(memory) => {
                    let extent = Extent { z: depth, ..e };
                    let view = View::dense(&memory.as_slice()[..dense_len(extent, t)?], extent, t);
                    bricks(at, edge, source.memory, &view, [0, z.start], work, take)?;
                }
                file @ SlabBuffer::File(_) => {
                    let row = e.x as usize * t.bytes();
                    for y in (0..e.y).step_by(edge as usize) {
                        let extent = Extent { y: edge.min(e.y - y), z: depth, ..e };
                        let mut strip = AlignedBytes::zeroed(dense_len(extent, t)?)?;
                        let planes = strip.as_mut_slice().chunks_exact_mut(row * extent.y as usize);
                        for (dz, out) in planes.enumerate() {
                            file.read((dz * e.y as usize + y as usize) * row, out)?;
                        }
                        bricks(
                            at,
                            edge,
                            source.memory,
                            &View::dense(strip.as_slice(), extent, t),
                            [y, z.start],
                            work,
                            take,
                        )?;
                    }
                }
            }
            self.layer += 1;
        }
    }
}

/// The first slab of bricks of a level.
fn slab_extent(e: Extent, edge: u32) -> Extent {
    Extent { z: edge.min(e.z), ..e }
}

/// Brings planes `z` of a source that gives them once into a temporary file.
fn fill(spool: &mut SlabBuffer, reader: &mut dyn SlabReader, z: Range<u32>) -> Result<()> {
    let (e, t) = (reader.extent(), reader.sample_type());
    let row = dense_len(Extent { y: 1, z: 1, ..e }, t)?;
    let rows = u32::try_from((8 << 20) / row).unwrap_or(u32::MAX).clamp(1, e.y);
    let mut buffer = vec![0; rows as usize * row];
    for (dz, z) in z.enumerate() {
        for y in (0..e.y).step_by(rows as usize) {
            let y = y..(y + rows).min(e.y);
            let piece = &mut buffer[..y.len() * row];
            reader.read_rows(z..z + 1, y.clone(), piece)?;
            spool.write((dz * e.y as usize + y.start as usize) * row, piece)?;
        }
    }
    Ok(())
}

/// Rows `y` of planes `z` of level 0.
fn read<'b>(
    source: &'b mut Source<'_>,
    strip: Option<&'b mut AlignedBytes>,
    spool: Option<&mut SlabBuffer>,
    z: Range<u32>,
    y: Range<u32>,
) -> Result<View<'b>> {
    let (fine, t) = (source.extent(), source.sample_type());
    let Some(strip) = strip else {
        let region = Region { start: [0, y.start, z.start], end: [fine.x, y.end, z.end] };
        return Ok(source.reader.as_view().expect("asked at the start").sub(&region));
    };
    let extent = Extent { y: y.end - y.start, z: z.end - z.start, ..fine };
    let bytes = &mut strip.as_mut_slice()[..dense_len(extent, t)?];
    match spool {
        None => source.reader.read_rows(z, y, bytes)?,
        Some(spool) => {
            let row = fine.x as usize * t.bytes();
            for (dz, out) in bytes.chunks_exact_mut(row * extent.y as usize).enumerate() {
                spool.read((dz * fine.y as usize + y.start as usize) * row, out)?;
            }
        }
    }
    Ok(View::dense(bytes, extent, t))
}

/// What rows of bricks give to the levels above them, in order. `view` starts at row `start[0]` and plane `start[1]`.
fn blocks(pyramid: &Pyramid, edge: u32, view: &View<'_>, start: [u32; 2]) -> Vec<Block> {
    let rows: Vec<u32> = (0..view.extent.y).step_by(edge as usize).collect();
    rows.into_par_iter()
        .map(|y| {
            let e = view.extent;
            let region = Region { start: [0, y, 0], end: [e.x, (y + edge).min(e.y), e.z] };
            pyramid.block(&view.sub(&region), start[0] + y, start[1])
        })
        .collect()
}

/// Puts rows of a coarser level into its slab.
fn keep(slabs: &mut [Option<Slab>], edge: u32, rows: &Rows) -> Result<()> {
    let Some(slab) = &mut slabs[usize::from(rows.level) - 1] else { return Ok(()) };
    let first = rows.z - slab.layer * edge;
    let planes = rows.bytes.len() / rows.row_bytes / rows.rows as usize;
    for (dz, plane) in rows.bytes.chunks_exact(rows.bytes.len() / planes).enumerate() {
        let row = (first as usize + dz) * slab.extent.y as usize + rows.y as usize;
        slab.buffer.write(row * rows.row_bytes, plane)?;
    }
    Ok(())
}
