//! The volumes of a `.vug` file as a source of slabs: layers of bricks are decoded as they are asked for, one at a time.

use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::{Grid, SlabReader, dense_len};
use crate::volume::{At, LostBrick, Volume};
use crate::voxel::SampleType;
use indicatif::ProgressBar;
use std::collections::HashSet;
use std::ops::Range;

/// Bytes that are decoded in one go, or one layer of bricks.
const LAYER_BYTES: usize = 64 << 20;

/// Which volumes of a file are decoded, and what of them.
#[derive(Clone)]
pub(super) struct Part {
    pub(super) times: Range<u32>,
    pub(super) channels: Range<u32>,
    pub(super) lod: u8,
    /// How often the level is halved from the means that its bricks hold.
    pub(super) steps: u8,
    /// In voxels of the halved level.
    pub(super) region: Region,
    /// Whether lost bricks are filled.
    pub(super) salvage: bool,
}

/// Decoded volumes.
pub(super) struct Decoded<'a> {
    volume: &'a Volume,
    part: Part,
    bar: &'a ProgressBar,
    at: At,
    /// Planes of the region that are decoded.
    layer: Option<(Range<u32>, Grid)>,
    salvaged: HashSet<(u32, u32)>,
    /// Bricks that could not be read, and of which time step and channel they are.
    pub(super) lost: Vec<(At, LostBrick)>,
    /// Bricks that were found without the index.
    pub(super) found_by_leader: u64,
}

impl<'a> Decoded<'a> {
    pub(super) fn new(volume: &'a Volume, part: Part, bar: &'a ProgressBar) -> Self {
        let at = At { time: part.times.start, channel: part.channels.start, lod: part.lod };
        bar.set_length(u64::from(part.region.extent().z) * (part.times.len() * part.channels.len()) as u64);
        let (lost, salvaged) = (Vec::new(), HashSet::new());
        Decoded { volume, part, bar, at, layer: None, salvaged, lost, found_by_leader: 0 }
    }

    /// The layer of bricks that plane `z` of the region lies in, and as many behind it as are worth one go.
    fn layer_around(&self, z: u32) -> Result<Range<u32>> {
        let (e, first) = (self.part.region.extent(), self.part.region.start[2]);
        if self.part.salvage {
            return Ok(0..e.z);
        }
        let edge = (1u32 << self.volume.info().brick_log2) >> self.part.steps;
        let bytes = dense_len(Extent { z: edge.min(e.z), ..e }, self.sample_type())?;
        let step = edge.saturating_mul(u32::try_from(LAYER_BYTES / bytes).unwrap_or(u32::MAX).max(1));
        let start = (first + z) / step * step;
        Ok(start.max(first) - first..start.saturating_add(step).min(first + e.z) - first)
    }

    fn decode(&mut self, planes: Range<u32>) -> Result<Grid> {
        let Part { region, lod: _, steps, salvage, .. } = self.part;
        let (mut start, mut end) = (region.start, region.end);
        (start[2], end[2]) = (region.start[2] + planes.start, region.start[2] + planes.end);
        let region = Region { start, end };
        if !salvage {
            return match steps {
                0 => self.volume.read_region(self.at, region),
                steps => self.volume.read_reduced(self.at, steps, region),
            };
        }
        let salvaged = self.volume.salvage(self.at, region)?;
        // What is read again is not lost again.
        if self.salvaged.insert((self.at.time, self.at.channel)) {
            self.found_by_leader += salvaged.found_by_leader;
            self.lost.extend(salvaged.lost.into_iter().map(|l| (self.at, l)));
        }
        Ok(salvaged.grid)
    }
}

impl SlabReader for Decoded<'_> {
    fn extent(&self) -> Extent {
        self.part.region.extent()
    }

    fn sample_type(&self) -> SampleType {
        self.volume.info().sample_type
    }

    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        let plane = dense_len(Extent { z: 1, ..self.extent() }, self.sample_type())?;
        for (z, out) in z.zip(out.chunks_exact_mut(plane)) {
            if !self.layer.as_ref().is_some_and(|(planes, _)| planes.contains(&z)) {
                self.layer = None; // its memory goes before more is taken
                let planes = self.layer_around(z)?;
                let grid = self.decode(planes.clone())?;
                self.bar.inc(planes.len() as u64);
                self.layer = Some((planes, grid));
            }
            if let Some((planes, grid)) = &self.layer {
                out.copy_from_slice(&grid.bytes()[(z - planes.start) as usize * plane..][..plane]);
            }
        }
        Ok(())
    }

    fn series(&self) -> (u32, u32) {
        (self.part.times.len() as u32, self.part.channels.len() as u32)
    }

    fn turn_to(&mut self, time: u32, channel: u32) -> Result<()> {
        let (time, channel) = (self.part.times.start + time, self.part.channels.start + channel);
        if !self.part.times.contains(&time) || !self.part.channels.contains(&channel) {
            let message =
                format!("time step {time}, channel {channel} of {:?}, {:?}", self.part.times, self.part.channels);
            return Err(Error::new(crate::error::Code::Range, "time", message));
        }
        if (time, channel) != (self.at.time, self.at.channel) {
            self.layer = None;
            (self.at.time, self.at.channel) = (time, channel);
        }
        Ok(())
    }
}
