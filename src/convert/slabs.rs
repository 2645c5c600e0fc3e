//! The slab reader over the samples of a foreign file: any order of axes, any stored type.

use super::layout::Layout;
use super::narrow;
use super::payload::Bytes;
use super::stored::Stored;
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::grid::{SlabReader, View};
use crate::voxel::SampleType;
use std::ops::Range;

/// Bytes of samples that are converted or picked out in one go.
const CHUNK_BYTES: usize = 256 << 10;

/// Reverses the bytes of each sample where the file's order is not the machine's.
pub(super) fn to_native(stored: Stored, bytes: &mut [u8]) {
    fn reverse<const N: usize>(bytes: &mut [u8]) {
        bytes.as_chunks_mut::<N>().0.iter_mut().for_each(|sample| sample.reverse());
    }
    match stored.kind.bytes() {
        2 if stored.swapped() => reverse::<2>(bytes),
        4 if stored.swapped() => reverse::<4>(bytes),
        8 if stored.swapped() => reverse::<8>(bytes),
        // Single bytes and colours have no order.
        _ => {}
    }
}

/// Moves every `step`th sample of `size` bytes to the front, where they lie together.
fn pick(bytes: &mut [u8], size: usize, step: usize, samples: usize) {
    fn each<const N: usize>(bytes: &mut [u8], step: usize, samples: usize) {
        for i in 1..samples {
            let mut sample = [0; N];
            sample.copy_from_slice(&bytes[i * step * N..][..N]);
            bytes[i * N..][..N].copy_from_slice(&sample);
        }
    }
    match size {
        1 => each::<1>(bytes, step, samples),
        2 => each::<2>(bytes, step, samples),
        3 => each::<3>(bytes, step, samples),
        4 => each::<4>(bytes, step, samples),
        _ => each::<8>(bytes, step, samples),
    }
}

/// Rows of samples read and converted as they are asked for.
pub(super) struct Slabs {
    bytes: Bytes,
    stored: Stored,
    layout: Layout,
    target: SampleType,
    /// First sample of the volume that is being read.
    first: u64,
    buffer: Vec<u8>,
}

impl Slabs {
    /// A reader that starts at the first volume. `target` is what [`narrow::choose`] has accepted.
    pub(super) fn new(bytes: Bytes, stored: Stored, layout: Layout, target: SampleType) -> Self {
        Slabs { bytes, stored, layout, target, first: 0, buffer: Vec::new() }
    }

    fn is_native(&self) -> bool {
        self.stored.kind.native() == Some(self.target)
    }

    /// Samples along x from `sample` on; rows and planes that follow without a gap are part of the run.
    fn read_run(&mut self, sample: u64, out: &mut [u8]) -> Result<()> {
        let (from, to) = (self.stored.kind.bytes(), self.target.bytes());
        let step = self.layout.space[0];
        let mut offset = sample * from as u64;
        if step == 1 && self.is_native() {
            self.bytes.read_at(offset, out)?;
            to_native(self.stored, out);
            return Ok(());
        }
        // Never longer than what lies between the first and the last sample: the file may end there.
        let step_bytes = usize::try_from(step).ok().and_then(|s| s.checked_mul(from));
        let at_once = (CHUNK_BYTES / step_bytes.unwrap_or(usize::MAX)).max(1);
        for part in out.chunks_mut(at_once * to) {
            let samples = part.len() / to;
            // One sample, or less than a chunk: neither overflows.
            let span = (samples - 1) * step as usize * from + from;
            self.buffer.resize(span, 0);
            self.bytes.read_at(offset, &mut self.buffer)?;
            if step > 1 {
                pick(&mut self.buffer, from, step as usize, samples);
            }
            let packed = &mut self.buffer[..samples * from];
            if self.stored.kind.native() == Some(self.target) {
                to_native(self.stored, packed);
                part.copy_from_slice(packed);
            } else {
                narrow::convert(self.stored, packed, self.target, part);
            }
            offset += samples as u64 * step * from as u64;
        }
        Ok(())
    }
}

impl SlabReader for Slabs {
    fn extent(&self) -> Extent {
        self.layout.extent
    }

    fn sample_type(&self) -> SampleType {
        self.target
    }

    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        self.read_rows(z, 0..self.layout.extent.y, out)
    }

    fn read_rows(&mut self, z: Range<u32>, y: Range<u32>, out: &mut [u8]) -> Result<()> {
        let e = self.layout.extent;
        let (rows, planes) = (y.end.saturating_sub(y.start), z.end.saturating_sub(z.start));
        let samples = u64::from(e.x) * u64::from(rows) * u64::from(planes);
        if z.end > e.z || y.end > e.y || out.len() as u64 != samples * self.target.bytes() as u64 {
            let message = format!("rows {y:?} of planes {z:?} of {e} into {} bytes", out.len());
            return Err(Error::new(Code::Range, "z", message));
        }
        if samples == 0 {
            return Ok(());
        }
        let [sx, sy, sz] = self.layout.space;
        // How many rows and planes each read takes, and by how much the next one starts later.
        let (run_rows, run_planes) = match sy == sx * u64::from(e.x) {
            true if rows == e.y && sz == sy * u64::from(e.y) => (rows, planes),
            true => (rows, 1),
            false => (1, 1),
        };
        let len = (e.x as usize * self.target.bytes()) * run_rows as usize * run_planes as usize;
        let mut runs = out.chunks_exact_mut(len);
        for dz in (0..planes).step_by(run_planes as usize) {
            for dy in (0..rows).step_by(run_rows as usize) {
                let sample = self.first + u64::from(z.start + dz) * sz + u64::from(y.start + dy) * sy;
                self.read_run(sample, runs.next().expect("as many runs"))?;
            }
        }
        Ok(())
    }

    fn as_view(&self) -> Option<View<'_>> {
        match &self.bytes {
            Bytes::Memory(memory) if self.is_native() && !self.stored.swapped() && self.layout.is_dense() => {
                let size = self.target.bytes() as u64;
                let range = self.first * size..(self.first + self.layout.extent.voxels()) * size;
                let bytes = memory.as_slice().get(range.start as usize..range.end as usize)?;
                Some(View::dense(bytes, self.layout.extent, self.target))
            }
            _ => None,
        }
    }

    fn series(&self) -> (u32, u32) {
        (self.layout.time_steps, self.layout.channels)
    }

    fn turn_to(&mut self, time: u32, channel: u32) -> Result<()> {
        check_turn(self.series(), time, channel)?;
        self.first = u64::from(time) * self.layout.time + u64::from(channel) * self.layout.channel;
        Ok(())
    }
}

/// Whether a series has this volume.
///
/// # Errors
/// `E_RANGE`.
pub(super) fn check_turn((steps, channels): (u32, u32), time: u32, channel: u32) -> Result<()> {
    if time < steps && channel < channels {
        return Ok(());
    }
    let message = format!("time step {time}, channel {channel} of {steps} and {channels}; the first is 0");
    Err(Error::new(Code::Range, "time", message))
}
