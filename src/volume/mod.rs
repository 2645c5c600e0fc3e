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
//!
//! A zerobit volume gives voxels, planes and cells of 4³ voxels straight from its streams (modes of Bajaj et al. 2001,
//! §3.2), and half and quarter resolution from the means in them:
//!
//! ```
//! use vug::volume::{self, At, Axis, CodecChoice, EncodeOptions, Quality, Volume};
//! use vug::{Extent, Grid, Region, source::MemorySource};
//! // A red ball in the dark; 5 % of the coefficients are kept.
//! let mut grid = Grid::from_fn(Extent::cube(48), |c| {
//!     let r2: i32 = c.iter().map(|&v| (v as i32 - 24).pow(2)).sum();
//!     if r2 < 300 { [200u8, (r2 / 3) as u8, 20] } else { [0; 3] }
//! })?;
//! let options = EncodeOptions { codec: CodecChoice::Zerobit, quality: Quality::Keep(50_000), ..Default::default() };
//! let mut file = std::io::Cursor::new(Vec::new());
//! volume::encode(&mut grid, &mut file, &options, &mut |_, _| {})?;
//!
//! let volume = Volume::open(MemorySource(file.into_inner()), Default::default())?;
//! let sampler = volume.sampler::<[u8; 3]>(At::default())?;       // bricks are found once; for one thread
//! let one = sampler.get([24, 25, 26])?;                           // voxel mode
//! let mut some = [[0; 3]; 3];
//! sampler.get_many(&[[24, 25, 26], [0, 0, 0], [30, 20, 20]], &mut some)?; // memory is asked ahead
//! assert_eq!((some[0], some[1]), (one, [0, 0, 0]));
//! let mut cell = [[0; 3]; 64];
//! sampler.cell([24, 25, 26], &mut cell)?;                         // the 4×4×4 voxels around it, from [24, 24, 24]
//! assert_eq!(cell[0 + 4 * 1 + 16 * 2], one);
//! let mut plane = [[0; 3]; 16];
//! sampler.plane(Axis::Z, [24, 25, 26], &mut plane)?;              // those of them with z = 26
//! assert_eq!(plane[0 + 4 * 1], one);
//!
//! let (region, same) = volume.cell(At::default(), [24, 25, 26])?; // the cell as a grid; cropped at the volume's faces
//! assert_eq!((region.start, same.samples::<[u8; 3]>()), ([24, 24, 24], &cell[..]));
//! let half = volume.reduced_extent(At::default(), 1)?;            // 24×24×24 means of 2×2×2 voxels
//! let small = volume.read_reduced(At::default(), 1, Region::whole(half))?;
//! assert_eq!(small.extent(), half);
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
mod edit;
mod encode;
mod fetch;
mod open;
mod options;
mod pages;
mod pass;
mod payloads;
mod plane_cache;
mod pyramid;
mod reduced;
mod region;
mod report;
mod salvage;
mod selection;
mod shortcut;
mod slabs;
mod spool;
mod times;
mod verify;
mod voxels;
mod writer;
mod zerobit;

pub use bounds::Bounds;
pub use census::BrickCounts;
pub use codec_stats::{CodecStats, LevelStats};
pub use counted::Cost;
pub use edit::{Appender, BrickOrder, CopyOptions, CopyReport, Excerpt, Recovered, ZstdPolicy, recover};
pub use encode::{Progress, encode, encode_log};
pub use open::Volume;
pub use options::{Bound, CodecChoice, EncodeOptions, NonFinite, Quality, ZerobitOptions};
pub use payloads::{BrickPayload, LevelBricks, LevelCodec, PayloadBytes};
pub use plane_cache::PlaneSampler;
pub use report::EncodeReport;
pub use salvage::{LostBrick, Salvaged};
pub use selection::Selection;
pub use verify::{VerifyReport, verify};
pub use voxels::Sampler;
pub use writer::{Shape, VolumeWriter};

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
