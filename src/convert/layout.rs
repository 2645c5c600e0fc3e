//! Where each sample of a series lies in an array of up to five axes: x, y, z, time and channel, in whatever order.

use super::fault;
use super::stored::Kind;
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent};
use crate::limits;
use std::path::Path;

/// What an axis of an array stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Along x (0), y (1) or z (2).
    Space(usize),
    /// From one time step to the next.
    Time,
    /// From one channel to the next.
    Channel,
    /// Nothing: one sample, or the parts of a colour, which are one sample.
    Nothing,
}

/// The shape of a series, and how many samples lie between neighbours along each of its axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// Voxels per axis of each volume.
    pub extent: Extent,
    /// Volumes in time.
    pub time_steps: u32,
    /// Volumes at each time.
    pub channels: u32,
    /// Samples from one voxel to the next, along x, y, z.
    pub space: [u64; 3],
    /// Samples from one time step to the next.
    pub time: u64,
    /// Samples from one channel to the next.
    pub channel: u64,
}

impl Layout {
    /// One volume, x fastest.
    ///
    /// # Errors
    /// As [`Layout::new`].
    pub(super) fn single(path: &Path, field: &'static str, extent: Extent, kind: Kind) -> Result<Self> {
        Layout::series(path, field, extent, (1, 1), kind)
    }

    /// Volumes one behind the other, the channels of a time step together.
    ///
    /// # Errors
    /// As [`Layout::new`].
    pub(super) fn series(
        path: &Path,
        field: &'static str,
        extent: Extent,
        (time_steps, channels): (u32, u32),
        kind: Kind,
    ) -> Result<Self> {
        let [x, y, z] = extent.to_array().map(u64::from);
        let axes = [
            (Role::Space(0), x),
            (Role::Space(1), y),
            (Role::Space(2), z),
            (Role::Channel, channels.into()),
            (Role::Time, time_steps.into()),
        ];
        Layout::new(path, field, &axes, kind)
    }

    /// An array of these axes, the fastest first. Roles that are missing have one sample; none may occur twice.
    ///
    /// # Errors
    /// `E_FOREIGN` for an empty axis, `E_LIMIT` above the caps, or where the bytes of all samples overflow 64 bits.
    pub(super) fn new(path: &Path, field: &'static str, axes: &[(Role, u64)], kind: Kind) -> Result<Self> {
        let at = |role| axes.iter().position(|(r, _)| *r == role);
        let size = |role| at(role).map_or(1, |i| axes[i].1);
        let count = |role| {
            u32::try_from(size(role)).map_err(|_| {
                let message = format!("{}: an axis of {} samples is above the cap", path.display(), size(role));
                Error::new(Code::Limit, field, message)
            })
        };
        let extent = Extent::new(count(Role::Space(0))?, count(Role::Space(1))?, count(Role::Space(2))?);
        let (time_steps, channels) = (count(Role::Time)?, count(Role::Channel)?);
        extent.check().map_err(|e| fault::relabel(path, field, &e))?;
        let trees = u64::from(time_steps) * u64::from(channels);
        if trees == 0 {
            return Err(fault::foreign(path, field, "an axis of time or channels is empty"));
        }
        limits::check(field, trees, limits::MAX_TREES).map_err(|e| fault::relabel(path, field, &e))?;
        let bytes = extent.voxels().checked_mul(trees).and_then(|n| n.checked_mul(kind.bytes() as u64));
        if bytes.is_none() {
            let message = format!("{}: {trees} volumes of {extent} overflow 64 bits", path.display());
            return Err(Error::new(Code::Limit, field, message));
        }
        // None of these overflows: each is a divisor of the number of samples.
        let step = |role| at(role).map(|i| axes[..i].iter().map(|(_, n)| n).product::<u64>());
        let x = step(Role::Space(0)).unwrap_or(1);
        let y = step(Role::Space(1)).unwrap_or(x * u64::from(extent.x));
        let z = step(Role::Space(2)).unwrap_or(y * u64::from(extent.y));
        let (time, channel) = (step(Role::Time).unwrap_or(0), step(Role::Channel).unwrap_or(0));
        Ok(Layout { extent, time_steps, channels, space: [x, y, z], time, channel })
    }

    /// Samples of all volumes.
    pub(super) fn samples(&self) -> u64 {
        self.extent.voxels() * u64::from(self.time_steps) * u64::from(self.channels)
    }

    /// Bytes of all samples.
    pub(super) fn bytes(&self, kind: Kind) -> u64 {
        self.samples() * kind.bytes() as u64
    }

    /// Whether there is but one volume.
    pub(super) fn is_single(&self) -> bool {
        self.time_steps == 1 && self.channels == 1
    }

    /// Whether the samples of a volume lie together, x fastest.
    pub(super) fn is_dense(&self) -> bool {
        let [x, y, _] = self.extent.to_array().map(u64::from);
        self.space == [1, x, x * y]
    }

    /// Voxel, time step and channel of a sample.
    pub(super) fn place_of(&self, sample: u64) -> (Coord, u32, u32) {
        // Each axis counts from 0 again where the next slower one steps on.
        let along = |step: u64, count: u32| (sample / step.max(1) % u64::from(count)) as u32;
        let e = self.extent.to_array();
        let voxel = std::array::from_fn(|axis| along(self.space[axis], e[axis]));
        (voxel, along(self.time, self.time_steps), along(self.channel, self.channels))
    }

    /// Sizes and number of volumes, for messages.
    pub(super) fn text(&self) -> String {
        match (self.time_steps, self.channels) {
            (1, 1) => self.extent.to_string(),
            (t, 1) => format!("{} × {t} time steps", self.extent),
            (1, c) => format!("{} × {c} channels", self.extent),
            (t, c) => format!("{} × {t} time steps × {c} channels", self.extent),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Role::{Channel, Nothing, Space, Time};

    fn layout(axes: &[(Role, u64)]) -> Result<Layout> {
        Layout::new(Path::new("f"), "sizes", axes, Kind::U16)
    }

    #[test]
    fn steps_follow_the_order_of_axes() {
        let l = layout(&[(Channel, 3), (Space(0), 4), (Space(1), 5), (Time, 7), (Space(2), 6)]).unwrap();
        assert_eq!((l.extent, l.time_steps, l.channels), (Extent::new(4, 5, 6), 7, 3));
        assert_eq!((l.space, l.time, l.channel), ([3, 12, 420], 60, 1));
        assert_eq!((l.samples(), l.bytes(Kind::U16)), (2520, 5040));
        assert!(!l.is_dense() && !l.is_single());
        for (voxel, time, channel) in [([0, 0, 0], 0, 0), ([3, 4, 5], 6, 2), ([1, 0, 2], 3, 1)] {
            let at: u64 = (0..3).map(|a| u64::from(voxel[a]) * l.space[a]).sum();
            let at = at + u64::from(time) * l.time + u64::from(channel) * l.channel;
            assert_eq!(l.place_of(at), (voxel, time, channel));
        }
        let l = layout(&[(Space(0), 4), (Nothing, 1), (Space(1), 5)]).unwrap();
        assert!(l.is_dense() && l.is_single());
        assert_eq!(l.text(), "4×5×1");
    }

    #[test] // D-60, D-61
    fn hostile_sizes() {
        let huge = u64::from(u32::MAX);
        for (axes, code) in [
            (vec![(Space(0), 1 << 40)], Code::Limit),
            (vec![(Space(0), 0)], Code::Foreign),
            (vec![(Space(0), 2), (Time, 0)], Code::Foreign),
            (vec![(Space(0), 2), (Time, huge)], Code::Limit),
            (vec![(Space(0), 2), (Time, 1 << 20), (Channel, 1 << 20)], Code::Limit),
            (vec![(Space(0), 1 << 21), (Space(1), 1 << 21), (Space(2), 1 << 6), (Time, 1 << 24)], Code::Limit),
        ] {
            assert_eq!(layout(&axes).unwrap_err().code(), code, "{axes:?}");
        }
    }
}
