//! Parameters of the zerobit codec and their bytes in the codec table (spec chapter 14, §2).
//!
//! No decoder needs them: they say how the encoder chose what to keep.

use crate::codec::PARAM_BYTES;
use crate::error::{Code, Error, Result};

/// Which layout the unit blocks have; the stream version of the codec table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
#[repr(u16)]
pub enum Stream {
    /// Zerobits and significance maps (Bajaj et al. 2001, §3.2).
    #[default]
    New = 1,
    /// 64 flags per cell, the scheme that the paper compares with (§3.1).
    Old = 2,
}

impl Stream {
    /// The stream of a codec table entry.
    #[must_use]
    pub const fn from_wire(version: u16) -> Option<Stream> {
        match version {
            1 => Some(Stream::New),
            2 => Some(Stream::Old),
            _ => None,
        }
    }

    /// The name used on the command line and in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Stream::New => "new",
            Stream::Old => "old",
        }
    }
}

/// How thresholds follow from the ratio of coefficients to keep (§2.3 of the paper).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
#[repr(u8)]
pub enum Threshold {
    /// Each unit block gets its share, by the number of its coefficients that are not 0.
    #[default]
    Adaptive = 0,
    /// One threshold for the whole level.
    Global = 1,
}

impl Threshold {
    /// The name used on the command line and in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Threshold::Adaptive => "adaptive",
            Threshold::Global => "global",
        }
    }
}

/// What makes one coefficient larger than another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
#[repr(u8)]
pub enum Norm {
    /// What it adds to the squared error of the voxels: its square times 8 on level 1, times 64 on level 0 and for averages.
    #[default]
    Energy = 0,
    /// Its plain square, as the paper prints it.
    Plain = 1,
}

impl Norm {
    /// The name used on the command line and in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Norm::Energy => "energy",
            Norm::Plain => "plain",
        }
    }
}

/// How the codebooks were trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
#[repr(u8)]
pub enum Training {
    /// Median cut (§2.4 of the paper).
    #[default]
    MedianCut = 0,
    /// Median cut, then k-means.
    Refined = 1,
}

impl Training {
    /// The name used on the command line and in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Training::MedianCut => "median-cut",
            Training::Refined => "refined",
        }
    }
}

/// All coefficients: the largest ratio, in millionths.
pub const KEEP_ALL: u32 = 1_000_000;

/// Parameters of the codec: always within their legal sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Params {
    keep_ppm: u32,
    /// How thresholds were found.
    pub threshold: Threshold,
    /// What they were compared with.
    pub norm: Norm,
    /// How codebooks were trained.
    pub training: Training,
    /// Voxels of level 0 that the ratio refers to, where a selection was encoded; 0: all.
    pub selected: u64,
}

impl Params {
    /// Parameters that keep `keep_ppm` millionths of all coefficients, with defaults for the rest.
    ///
    /// # Errors
    /// `E_PARAM` above 1,000,000.
    pub fn new(keep_ppm: u32) -> Result<Params> {
        // spec: ZBT-2
        if keep_ppm > KEEP_ALL {
            return Err(Error::param("keep", format!("{keep_ppm} millionths are more than all coefficients")));
        }
        Ok(Params { keep_ppm, ..Params::default() })
    }

    /// Ratio of coefficients that the encoder was to keep (the paper's target ratio), in millionths.
    #[must_use]
    pub const fn keep_ppm(&self) -> u32 {
        self.keep_ppm
    }

    /// The parameters of a codec table entry.
    ///
    /// # Errors
    /// `E_RESERVED` for reserved bytes that are not 0, `E_PARAM` for a value outside its set.
    pub fn from_wire(bytes: &[u8; PARAM_BYTES]) -> Result<Params> {
        // spec: ZBT-2, ZBT-3
        if bytes[7] != 0 || bytes[16..].iter().any(|&b| b != 0) {
            return Err(Error::new(
                Code::Reserved,
                "codec.params",
                "a reserved byte of the zerobit parameters is not 0",
            ));
        }
        let unknown = |field, v: u8| Error::param(field, format!("{v} is neither 0 nor 1"));
        let keep_ppm = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        Ok(Params {
            threshold: match bytes[4] {
                0 => Threshold::Adaptive,
                1 => Threshold::Global,
                v => return Err(unknown("threshold", v)),
            },
            norm: match bytes[5] {
                0 => Norm::Energy,
                1 => Norm::Plain,
                v => return Err(unknown("norm", v)),
            },
            training: match bytes[6] {
                0 => Training::MedianCut,
                1 => Training::Refined,
                v => return Err(unknown("training", v)),
            },
            selected: u64::from_le_bytes(std::array::from_fn(|i| bytes[8 + i])),
            ..Params::new(keep_ppm)?
        })
    }

    /// The bytes of a codec table entry.
    #[must_use]
    pub fn to_wire(&self) -> [u8; PARAM_BYTES] {
        let mut bytes = [0; PARAM_BYTES];
        bytes[..4].copy_from_slice(&self.keep_ppm.to_le_bytes());
        bytes[4] = self.threshold as u8;
        bytes[5] = self.norm as u8;
        bytes[6] = self.training as u8;
        bytes[8..16].copy_from_slice(&self.selected.to_le_bytes());
        bytes
    }
}
