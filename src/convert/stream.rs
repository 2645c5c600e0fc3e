//! The samples of a series in the order that a format wants, a few planes at a time.

use super::layout::Role;
use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::{AlignedBytes, SlabReader, View};
use crate::voxel::SampleType;
use std::io::{self, Write};
use std::ops::Range;

/// Bytes that are written in one go, or one plane.
const CHUNK_BYTES: usize = 4 << 20;
/// The same where several volumes are woven into one another: each has to be turned to for every chunk.
const WOVEN_BYTES: usize = 64 << 20;

/// x, y, z, then the channels of each time step: the order of raw files and arrays.
pub(super) const CHANNELS_THEN_TIME: [Role; 5] =
    [Role::Space(0), Role::Space(1), Role::Space(2), Role::Channel, Role::Time];
/// x, y, z, then time, then channels: the order of NIfTI.
pub(super) const TIME_THEN_CHANNELS: [Role; 5] =
    [Role::Space(0), Role::Space(1), Role::Space(2), Role::Time, Role::Channel];

/// An error of the source on its way through those of the target.
pub(super) fn pass(error: Error) -> io::Error {
    io::Error::other(error)
}

/// Reverses the bytes of each sample on machines that are not little endian.
fn to_little_endian(sample_type: SampleType, bytes: &mut [u8]) {
    if cfg!(target_endian = "big") && sample_type.components() == 1 {
        bytes.chunks_exact_mut(sample_type.bytes()).for_each(<[u8]>::reverse);
    }
}

/// Writes all samples, little endian, in this order of axes, the fastest first. x, y and z follow one another; roles that
/// are missing have one sample.
pub(super) fn write_samples(out: &mut dyn Write, source: &mut dyn SlabReader, order: &[Role]) -> io::Result<()> {
    let (steps, channels) = source.series();
    let sizes = |role: &Role| match role {
        Role::Time => steps,
        Role::Channel => channels,
        Role::Space(_) | Role::Nothing => 1,
    };
    let x = order.iter().position(|r| *r == Role::Space(0)).unwrap_or(0);
    let (woven, behind) = order.split_at(x);
    let count = |roles: &[Role]| roles.iter().map(|r| u64::from(sizes(r))).product::<u64>();
    let place = |mut number: u64, roles: &[Role], at: &mut (u32, u32)| {
        for role in roles {
            let size = u64::from(sizes(role));
            let index = (number % size) as u32;
            number /= size;
            match role {
                Role::Time => at.0 = index,
                Role::Channel => at.1 = index,
                Role::Space(_) | Role::Nothing => {}
            }
        }
    };
    let threads = count(woven) as usize;
    let mut loom = Loom::new(source, threads).map_err(pass)?;
    for volume in 0..count(behind) {
        let mut at = (0, 0);
        place(volume, behind, &mut at);
        for z in loom.chunks(source.extent()) {
            if threads == 1 {
                source.turn_to(at.0, at.1).map_err(pass)?;
                loom.plain(source, z, out)?;
                continue;
            }
            for thread in 0..threads {
                place(thread as u64, woven, &mut at);
                source.turn_to(at.0, at.1).map_err(pass)?;
                loom.take(source, z.clone(), thread).map_err(pass)?;
            }
            loom.write(source, z, out)?;
        }
    }
    Ok(())
}

/// Buffers for a few planes of one volume, or of several that lie in one another.
struct Loom {
    planes: u32,
    plane: usize,
    size: usize,
    threads: usize,
    part: AlignedBytes,
    woven: AlignedBytes,
}

impl Loom {
    fn new(source: &dyn SlabReader, threads: usize) -> Result<Self> {
        let (e, size) = (source.extent(), source.sample_type().bytes());
        let plane = crate::grid::dense_len(Extent { z: 1, ..e }, source.sample_type())?;
        let room = if threads == 1 { CHUNK_BYTES } else { WOVEN_BYTES };
        let all = plane.checked_mul(threads).ok_or_else(|| {
            Error::param("target", format!("{threads} values per voxel are too many for this machine's memory"))
        })?;
        let planes = u32::try_from(room / all).unwrap_or(u32::MAX).clamp(1, e.z);
        let part = AlignedBytes::zeroed(plane * planes as usize)?;
        let woven = AlignedBytes::zeroed(if threads == 1 { 0 } else { all * planes as usize })?;
        Ok(Loom { planes, plane, size, threads, part, woven })
    }

    fn chunks(&self, extent: Extent) -> impl Iterator<Item = Range<u32>> + use<> {
        let planes = self.planes;
        (0..extent.z).step_by(planes as usize).map(move |z| z..z.saturating_add(planes).min(extent.z))
    }

    /// Planes of one volume, as they are.
    fn plain(&mut self, source: &mut dyn SlabReader, z: Range<u32>, out: &mut dyn Write) -> io::Result<()> {
        if let Some(view) = source.as_view().filter(|_| cfg!(target_endian = "little")) {
            return write_planes(out, &view, z);
        }
        let sample_type = source.sample_type();
        let part = &mut self.part.as_mut_slice()[..z.len() * self.plane];
        source.read_slab(z, part).map_err(pass)?;
        to_little_endian(sample_type, part);
        out.write_all(part)
    }

    /// Planes of one of several volumes, to be sample number `thread` of each voxel.
    fn take(&mut self, source: &mut dyn SlabReader, z: Range<u32>, thread: usize) -> Result<()> {
        let part = &mut self.part.as_mut_slice()[..z.len() * self.plane];
        source.read_slab(z, part)?;
        let size = self.size;
        let voxels = self.woven.as_mut_slice().chunks_exact_mut(size * self.threads);
        for (voxel, sample) in voxels.zip(part.chunks_exact(size)) {
            voxel[thread * size..][..size].copy_from_slice(sample);
        }
        Ok(())
    }

    fn write(&mut self, source: &dyn SlabReader, z: Range<u32>, out: &mut dyn Write) -> io::Result<()> {
        let woven = &mut self.woven.as_mut_slice()[..z.len() * self.plane * self.threads];
        to_little_endian(source.sample_type(), woven);
        out.write_all(woven)
    }
}

/// Planes of a box, whose rows may lie apart.
fn write_planes(out: &mut dyn Write, view: &View<'_>, z: Range<u32>) -> io::Result<()> {
    let e = view.extent;
    let view = view.sub(&Region { start: [0, 0, z.start], end: [e.x, e.y, z.end] });
    let row = e.x as usize * view.sample_type.bytes();
    if view.row_pitch == row && view.slice_pitch == row * e.y as usize {
        return out.write_all(&view.bytes[..z.len() * view.slice_pitch]);
    }
    for z in 0..z.len() {
        for y in 0..e.y as usize {
            out.write_all(&view.bytes[z * view.slice_pitch + y * view.row_pitch..][..row])?;
        }
    }
    Ok(())
}
