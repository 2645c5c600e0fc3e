//! The demo's volumes, and the ways each is encoded.

use crate::cli::phantom::placement;
use crate::codec::s3dc::Endpoints;
use crate::codec::zerobit::{Threshold, Training};
use crate::geometry::Extent;
use crate::volume::{Bound, CodecChoice, EncodeOptions, Quality, ZerobitOptions};
use crate::voxel::SampleType;

/// A volume, and what is done to it.
pub(super) struct Subject {
    /// A word for headings.
    pub(super) name: &'static str,
    pub(super) intro: &'static str,
    /// Name of its file.
    pub(super) source: &'static str,
    pub(super) sample_type: SampleType,
    /// Words of its settings, and what they mean.
    pub(super) terms: &'static [(&'static str, &'static str)],
    pub(super) settings: Vec<Setting>,
}

/// One way to encode.
pub(super) struct Setting {
    /// Stem of its files.
    pub(super) stem: &'static str,
    /// The same on the command line.
    pub(super) arguments: &'static str,
    pub(super) options: EncodeOptions,
}

pub(super) fn subjects() -> [Subject; 2] {
    [grey(), colour()]
}

fn grey() -> Subject {
    let s3dc = |stem, arguments, index_bits, block, endpoints| {
        let quality = Quality::Explicit { index_bits, block: Extent::cube(block) };
        let options = EncodeOptions { codec: CodecChoice::S3dc, quality, endpoints, ..options() };
        Setting { stem, arguments, options }
    };
    use Endpoints::{Fitted, MinMax};
    let bounded =
        EncodeOptions { codec: CodecChoice::Auto, quality: Quality::MaxError(Bound::Percent(1.0)), ..options() };
    Subject {
        name: "Grey",
        intro: "As a scanner sees it. It has what block compression finds hard: bone and metal with hard edges, folded soft tissue \
                of low contrast, a plate with line pairs, steps and a ramp, grain, and a large background of exactly 0.",
        source: "phantom.nrrd",
        sample_type: SampleType::U16,
        terms: &[(
            "s3dc",
            "two end points per block, and an index per voxel between them; for grey volumes of all types",
        )],
        settings: vec![
            s3dc("1bit-4", "--index-bits 1", 1, 4, MinMax),
            s3dc("1bit-4-fitted", "--index-bits 1 --endpoints fitted", 1, 4, Fitted),
            s3dc("2bit-4", "--index-bits 2", 2, 4, MinMax),
            s3dc("2bit-4-fitted", "--index-bits 2 --endpoints fitted", 2, 4, Fitted),
            s3dc("4bit-16", "--index-bits 4 --block 16", 4, 16, MinMax),
            s3dc("4bit-4", "--index-bits 4 --block 4", 4, 4, MinMax),
            s3dc("4bit-4-fitted", "--index-bits 4 --endpoints fitted", 4, 4, Fitted),
            s3dc("8bit-8", "--index-bits 8 --block 8", 8, 8, MinMax),
            Setting { stem: "within-1-percent", arguments: "--max-error 1%", options: bounded },
            Setting { stem: "lossless", arguments: "--codec raw", options: raw() },
        ],
    }
}

fn colour() -> Subject {
    let zerobit = |stem, arguments, percent: u32, threshold, training| {
        let options = EncodeOptions {
            codec: CodecChoice::Zerobit,
            quality: Quality::Keep(percent * 10_000),
            zerobit: ZerobitOptions { threshold, training, ..ZerobitOptions::default() },
            ..options()
        };
        Setting { stem, arguments, options }
    };
    use {Threshold::*, Training::*};
    Subject {
        name: "Colour",
        intro: "The same head as photographs of its cut surfaces would show it, three components per voxel. Whatever is not needed \
                is null and takes no bytes: the background, and the details of smooth places.",
        source: "colour.nrrd",
        sample_type: SampleType::Rgb8,
        terms: &[
            (
                "zerobit",
                "Haar wavelets on cells of 4³ voxels; each kept coefficient is a byte that points into a codebook",
            ),
            ("kept", "coefficients that are stored, as a part of the number of voxels"),
            ("global", "one threshold for the volume instead of a share for each 16³ voxels"),
            ("refined", "codebooks trained longer; the same stream"),
        ],
        settings: vec![
            zerobit("colour-1", "--keep 1%", 1, Adaptive, MedianCut),
            zerobit("colour-3", "--keep 3%", 3, Adaptive, MedianCut),
            zerobit("colour-3-best", "--keep 3% --threshold global --training refined", 3, Global, Refined),
            zerobit("colour-10", "--keep 10%", 10, Adaptive, MedianCut),
            zerobit("colour-10-best", "--keep 10% --threshold global --training refined", 10, Global, Refined),
            Setting { stem: "colour-lossless", arguments: "--codec raw", options: raw() },
        ],
    }
}

fn options() -> EncodeOptions {
    EncodeOptions { placement: placement(), ..EncodeOptions::default() }
}

fn raw() -> EncodeOptions {
    EncodeOptions { codec: CodecChoice::Raw, ..options() }
}
