//! Half and quarter resolution of a level from the means that its bricks hold (spec chapter 14, §9).
//!
//! These are not levels of the octree: they cost no bytes, and only codecs that hold means have them.

use super::At;
use super::fetch::{Content, Part};
use super::open::Volume;
use super::region::fill;
use crate::codec::zerobit::check_steps;
use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::{Grid, ViewMut, dense_len};
use crate::limits;
use rayon::prelude::*;

/// Planes of a level that one task decodes: a unit block.
const BAND: u32 = 16;

impl Volume {
    /// Extent of a level whose axes are halved `steps` times (1 or 2): ⌈extent / 2^`steps`⌉.
    ///
    /// # Errors
    /// `E_RANGE` where there is no such level, `E_PARAM` for other numbers of steps.
    pub fn reduced_extent(&self, at: At, steps: u8) -> Result<Extent> {
        check_steps(steps)?;
        Ok(self.extent_at(at)?.div_ceil(Extent::cube(1 << steps)))
    }

    /// Reads a box of a level whose axes are halved `steps` times (1 or 2), straight from the stream; `region` is in
    /// voxels of the result.
    ///
    /// A voxel is the mean that its brick holds for 2³ or 4³ voxels, as far as the encoder kept details of it; the value
    /// of a CONSTANT brick, the null value of an EMPTY one and of null cells.
    ///
    /// # Errors
    /// As [`Volume::read_region`]; `E_PARAM` where a brick's codec holds no means (only zerobit does).
    // spec: ZBT-25
    pub fn read_reduced(&self, at: At, steps: u8, region: Region) -> Result<Grid> {
        let whole = self.reduced_extent(at, steps)?;
        region.check(whole)?;
        let sample_type = self.info().sample_type;
        limits::check("region", dense_len(region.extent(), sample_type)? as u64, self.limits.result_bytes)?;
        let mut grid = Grid::zeros(region.extent(), sample_type)?;
        let fine = Region { start: region.start.map(|v| v << steps), end: region.end.map(|v| v << steps) };
        let fine = fine.intersect(&Region::whole(self.extent_at(at)?));
        let mut rest = grid.view_mut();
        let mut z = fine.start[2];
        while z < fine.end[2] {
            let stage = self.stage(at, &fine, z)?;
            let end = stage.end;
            // Bricks end at multiples of 16: only the level's end can lie inside a group.
            let (now, later) = rest.split_at_z(end.div_ceil(1 << steps) - (z >> steps));
            decode_parts(
                &stage.parts,
                steps,
                now,
                &Region { start: [region.start[0], region.start[1], z >> steps], ..region },
            )?;
            if let Some(e) = stage.error {
                return Err(e);
            }
            (rest, z) = (later, end);
        }
        Ok(grid)
    }
}

/// Decodes all parts into `dst`, whose first voxel is that of `region`; several threads share the planes.
fn decode_parts(parts: &[Part<'_>], steps: u8, dst: ViewMut<'_>, region: &Region) -> Result<()> {
    let mut bands = Vec::new();
    let (mut rest, mut z) = (dst, region.start[2]);
    while rest.extent.z > 0 {
        let band = BAND >> steps;
        let height = (band - z % band).min(rest.extent.z);
        let (now, later) = rest.split_at_z(height);
        bands.push((z, now));
        (rest, z) = (later, z + height);
    }
    bands.into_par_iter().try_for_each(|(z, mut dst)| {
        let origin = [region.start[0], region.start[1], z];
        let band = Region::at(origin, dst.extent);
        for part in parts {
            let wanted = Region {
                start: part.region.start.map(|v| v >> steps),
                end: part.region.end.map(|v| v.div_ceil(1 << steps)),
            };
            let wanted = wanted.intersect(&band);
            if wanted.is_empty() {
                continue;
            }
            let place = Region::at(std::array::from_fn(|a| wanted.start[a] - origin[a]), wanted.extent());
            let mut dst = dst.sub(&place);
            match &part.content {
                Content::Constant(value) => fill(&mut dst, *value),
                Content::Stored { entry, extent, payload: Some(payload), .. } => {
                    let start = std::array::from_fn(|a| wanted.start[a] - (part.origin[a] >> steps));
                    let wanted = Region::at(start, wanted.extent());
                    entry.codec().decode_reduced(payload, *extent, steps, &wanted, dst)?;
                }
                Content::Stored { .. } => return Err(Error::param("brick", "its payload was not fetched")),
            }
        }
        Ok(())
    })
}
