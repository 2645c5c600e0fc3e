//! How coarser levels are made (spec chapter 4).

/// How the voxels of a level are made of those of level 0 (spec: VOL-12).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Downsample {
    /// The mean of the voxels that a coarse one covers.
    #[default]
    Mean = 1,
    /// The smallest of them.
    Min = 2,
    /// The largest of them.
    Max = 3,
    /// The one in their middle: for labels, of which no mean may be taken.
    Nearest = 4,
}

impl Downsample {
    /// All operators.
    pub const ALL: [Downsample; 4] = [Downsample::Mean, Downsample::Min, Downsample::Max, Downsample::Nearest];

    /// The name used on the command line and in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Downsample::Mean => "mean",
            Downsample::Min => "min",
            Downsample::Max => "max",
            Downsample::Nearest => "nearest",
        }
    }
}
