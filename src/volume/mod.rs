//! The joined house: container, codecs and sources become volumes that can be read at any voxel and written brick by brick.
//!
//! ```no_run
//! use vug::{Region, volume::{At, Volume}};
//! let volume = Volume::open_path("head.vug")?;
//! let one = volume.voxel(At::default(), [100, 120, 40])?;          // x, y, z
//! let part = volume.read_region(At::default(), Region { start: [0, 0, 0], end: [64, 64, 16] })?;
//! println!("{one}, {} voxels, {:?}", part.extent(), volume.cost());
//! # Ok::<(), vug::Error>(())
//! ```

mod books;
mod bounds;
mod brick_encoder;
mod bricks;
mod cells;
mod census;
mod choose;
mod choose_keep;
mod codec_stats;
mod codecs;
mod counted;
mod encode;
mod lod;
mod open;
mod options;
mod pages;
mod plane_cache;
mod reduced;
mod region;
mod salvage;
mod selection;
mod shortcut;
mod slabs;
mod verify;
mod voxels;
mod writer;
mod zerobit;

pub use bounds::Bounds;
pub use census::BrickCounts;
pub use codec_stats::{CodecStats, LevelStats};
pub use counted::Cost;
pub use encode::{Progress, encode};
pub use open::Volume;
pub use options::{Bound, CodecChoice, EncodeOptions, NonFinite, Quality, ZerobitOptions};
pub use plane_cache::PlaneSampler;
pub use salvage::{LostBrick, Salvaged};
pub use selection::Selection;
pub use verify::{VerifyReport, verify};
pub use voxels::Sampler;
pub use writer::{EncodeReport, Shape, VolumeWriter};

/// Which tree and level of detail is meant: time step, channel and LOD. The default is the first of each, the finest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct At {
    /// Time step, from 0.
    pub time: u32,
    /// Channel, from 0.
    pub channel: u32,
    /// Level of detail; 0 is the finest.
    pub lod: u8,
}

impl At {
    /// The first time step and channel at level of detail `lod`.
    #[must_use]
    pub const fn lod(lod: u8) -> Self {
        At { time: 0, channel: 0, lod }
    }
}

/// An axis to cut across.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Planes of constant x (y × z voxels).
    X = 0,
    /// Planes of constant y (x × z voxels).
    Y = 1,
    /// Planes of constant z (x × y voxels).
    Z = 2,
}

impl std::str::FromStr for Axis {
    type Err = crate::Error;
    fn from_str(s: &str) -> crate::Result<Self> {
        match s {
            "x" => Ok(Axis::X),
            "y" => Ok(Axis::Y),
            "z" => Ok(Axis::Z),
            _ => Err(crate::Error::param("axis", format!("{s:?} is not one of x, y, z"))),
        }
    }
}
