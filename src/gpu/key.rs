//! The vocabulary of pictures: what a scene can ask for, and what decides about shader text and pipelines. A closed list:
//! an unknown name is an error, never ignored.

use crate::error::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// An enum whose values have names in scene files and on the command line.
macro_rules! named {
    ($(#[$doc:meta])* $name:ident ($field:literal) { $($(#[$vdoc:meta])* $value:ident = $text:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum $name { $($(#[$vdoc])* $value,)* }

        impl $name {
            /// All of them.
            pub const ALL: &'static [$name] = &[$($name::$value,)*];

            /// The name used in scenes, on the command line and in JSON.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $($name::$value => $text,)* }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())
            }
        }

        impl FromStr for $name {
            type Err = Error;
            fn from_str(s: &str) -> Result<Self> {
                $name::ALL.iter().copied().find(|v| v.name() == s).ok_or_else(|| {
                    let known: Vec<_> = $name::ALL.iter().map(|v| v.name()).collect();
                    Error::param($field, format!("{s:?} is not one of {}", known.join(", ")))
                })
            }
        }
    };
}

named! {
    /// How a value between voxels is found.
    Sampler("sampler") {
        /// The nearest voxel: 2 fetches from s3dc textures.
        Nearest = "nearest",
        /// Trilinear between 8 voxels, each decoded by itself: 16 fetches.
        Linear = "linear",
        /// The same image as `linear`, with each index word and each pair of end points fetched once.
        LinearOpt = "linear_opt",
        /// The texture unit's trilinear filter, on uncompressed or decoded textures; fractions of 8 bits on much hardware.
        HwLinear = "hw_linear",
    }
}

named! {
    /// What the samples are taken from.
    Source("source") {
        /// The payload's bytes as they are: raw, s3dc or zerobit.
        Direct = "direct",
        /// Decoded by a compute pass into a texture of f32.
        Deferred = "deferred",
        /// Decoded by the CPU and uploaded uncompressed: the reference.
        Decoded = "decoded",
    }
}

named! {
    /// How samples are laid through the volume.
    Traversal("traversal") {
        /// Rays from the camera, one per pixel.
        Raycast = "raycast",
        /// Planes parallel to the picture, blended front to back.
        Slice = "slice",
        /// One plane, cut through the volume in any orientation.
        CutPlane = "cut_plane",
    }
}

named! {
    /// What becomes of the samples of a ray.
    Projection("projection") {
        /// Colour and opacity, front to back.
        Composite = "composite",
        /// The largest value.
        Maximum = "maximum",
        /// The smallest value.
        Minimum = "minimum",
        /// The mean value.
        Mean = "mean",
        /// The first place where the value reaches that of an iso-surface.
        Iso = "iso",
    }
}

named! {
    /// The camera's projection.
    Lens("lens") {
        /// Rays from one point.
        Perspective = "perspective",
        /// Parallel rays.
        Orthographic = "orthographic",
    }
}

named! {
    /// What a scene may ask for beyond sampling and projection. What it does not name costs nothing: it is in no shader.
    Effect("effects") {
        /// Lighting by the gradient, found at each visible sample.
        GradientShading = "gradient_shading",
        /// Bricks that cannot be seen are jumped over.
        EmptySkip = "empty_skip",
        /// Bricks that cannot be seen are not uploaded.
        TfCull = "tf_cull",
        /// The level of detail follows the size of a voxel on the screen.
        Lod = "lod",
        /// Rays end where hardly anything can be seen behind.
        EarlyOut = "early_out",
        /// Nothing outside of a box is shown.
        ClipBox = "clip_box",
        /// Values between two time steps.
        TimeInterp = "time_interp",
    }
}

/// A set of effects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Effects(u32);

impl Effects {
    /// No effect.
    pub const NONE: Effects = Effects(0);

    /// Whether `e` is in the set.
    #[must_use]
    pub const fn has(self, e: Effect) -> bool {
        self.0 >> e as u32 & 1 == 1
    }

    /// The set with `e`.
    #[must_use]
    pub const fn with(self, e: Effect) -> Effects {
        Effects(self.0 | 1 << e as u32)
    }

    /// The set without `e`.
    #[must_use]
    pub const fn without(self, e: Effect) -> Effects {
        Effects(self.0 & !(1 << e as u32))
    }

    /// The effects, in the order of [`Effect::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Effect> {
        Effect::ALL.iter().copied().filter(move |e| self.has(*e))
    }

    /// All sets there are.
    pub fn all_sets() -> impl Iterator<Item = Effects> {
        (0..1u32 << Effect::ALL.len()).map(Effects)
    }
}

impl FromIterator<Effect> for Effects {
    fn from_iter<I: IntoIterator<Item = Effect>>(effects: I) -> Self {
        effects.into_iter().fold(Effects::NONE, Effects::with)
    }
}

/// Scalars that a texture is loaded as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Texel {
    /// Unsigned integers.
    Uint,
    /// Signed integers.
    Sint,
    /// Floats.
    Float,
}

impl Texel {
    /// The name in WGSL.
    #[must_use]
    pub const fn wgsl(self) -> &'static str {
        match self {
            Texel::Uint => "u32",
            Texel::Sint => "i32",
            Texel::Float => "f32",
        }
    }
}

/// In what form the voxels of a volume lie on the GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Form {
    /// One texture, one texel per voxel.
    Raw(Texel),
    /// Index words and end points of s3dc.
    S3dc(Texel),
    /// Zerobit streams in storage buffers: how many there are, and whether they are of the new form.
    Zerobit {
        /// Storage buffers.
        pages: u32,
        /// Stream version 1.
        new: bool,
        /// Width of a codebook's component is 16 bits.
        wide: bool,
        /// Signed samples (i16).
        signed: bool,
    },
}

/// What of a volume decides about shader text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VolumeKey {
    /// In what form its voxels lie on the GPU.
    pub form: Form,
    /// Whether voxels have three components.
    pub colour: bool,
    /// Whether the level is longer than a texture may be, and lies in it in tiles.
    pub folded: bool,
}

impl VolumeKey {
    /// Pages of streams.
    #[must_use]
    pub const fn pages(&self) -> u32 {
        match self.form {
            Form::Zerobit { pages, .. } => pages,
            Form::Raw(_) | Form::S3dc(_) => 0,
        }
    }

    /// The same, with so many pages of streams where it has any: all else of two steps of a series is alike, their lengths are not.
    #[must_use]
    pub const fn with_pages(mut self, n: u32) -> VolumeKey {
        if let Form::Zerobit { pages, .. } = &mut self.form {
            *pages = n;
        }
        self
    }
}

/// How gradients are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub enum Gradient {
    /// Six more samples.
    Naive,
    /// From the 32 voxels that the six samples need together, each word and each pair of end points fetched once. The value itself is
    /// sampled before: only what is seen is lit.
    #[default]
    Reuse,
}

/// Everything that decides about the text of the picture's shader: equal keys, equal text.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PipelineKey {
    /// How samples are laid.
    pub traversal: Traversal,
    /// What becomes of them.
    pub projection: Projection,
    /// Lens of the camera.
    pub lens: Lens,
    /// How a value between voxels is found.
    pub sampler: Sampler,
    /// How gradients are found, where shading asks for them.
    pub gradient: Gradient,
    /// Effects beyond that.
    pub effects: Effects,
    /// The volumes, in the order in which they are blended at one place.
    pub volumes: Vec<VolumeKey>,
}

/// Most volumes of a scene: one bind group each, and one for the frame.
pub const MAX_VOLUMES: usize = 3;
