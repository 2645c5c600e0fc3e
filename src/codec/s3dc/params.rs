//! Parameters of the s3dc codec and their bytes in the codec table (spec chapter 8, §1).

use crate::codec::PARAM_BYTES;
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;

/// How indices are spread between the two end points. Only the paper's even spacing exists so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum IndexCurve {
    /// Evenly, as in the paper.
    #[default]
    Linear = 0,
}

/// What the two end points of a block are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Endpoints {
    /// Minimum and maximum of the block's samples, as in the paper: bounds the source, and bounds the error.
    #[default]
    MinMax = 0,
    /// Chosen by the encoder for a small squared error: bounds the decoded samples only.
    Fitted = 1,
}

impl Endpoints {
    /// The name used on the command line and in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Endpoints::MinMax => "minmax",
            Endpoints::Fitted => "fitted",
        }
    }
}

/// Parameters of the codec: always within their legal sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Params {
    i_bits: u8,
    block: [u8; 3],
    endpoints: Endpoints,
}

/// Largest block edge, in voxels.
pub const MAX_BLOCK: u32 = 128;

impl Params {
    /// Parameters with `i_bits` per index and blocks of `block` voxels (x, y, z).
    ///
    /// # Errors
    /// `E_PARAM` where `i_bits` is not 1, 2, 4 or 8 or a block edge not in 1..=128.
    pub fn new(i_bits: u8, block: Extent, endpoints: Endpoints) -> Result<Params> {
        // spec: S3D-3
        if !matches!(i_bits, 1 | 2 | 4 | 8) {
            return Err(Error::param("i_bits", format!("{i_bits} is not one of 1, 2, 4, 8")));
        }
        // spec: S3D-4
        let mut edges = [0; 3];
        for (edge, (axis, v)) in edges.iter_mut().zip(["bx", "by", "bz"].into_iter().zip(block.to_array())) {
            *edge = u8::try_from(v)
                .ok()
                .filter(|&v| (1..=MAX_BLOCK).contains(&u32::from(v)))
                .ok_or_else(|| Error::param(axis, format!("block edge {v} is not in 1..={MAX_BLOCK}")))?;
        }
        Ok(Params { i_bits, block: edges, endpoints })
    }

    /// Bits per index: 1, 2, 4 or 8.
    #[must_use]
    pub const fn i_bits(&self) -> u8 {
        self.i_bits
    }

    /// Largest index, `2^i_bits − 1`; the paper's number of intervals.
    #[must_use]
    pub const fn q(&self) -> u32 {
        (1 << self.i_bits) - 1
    }

    /// Voxels of a block, per axis.
    #[must_use]
    pub const fn block(&self) -> Extent {
        Extent::new(self.block[0] as u32, self.block[1] as u32, self.block[2] as u32)
    }

    /// What the end points are.
    #[must_use]
    pub const fn endpoints(&self) -> Endpoints {
        self.endpoints
    }

    /// How indices are spread.
    #[must_use]
    pub const fn index_curve(&self) -> IndexCurve {
        IndexCurve::Linear
    }

    /// The parameters of a codec table entry.
    ///
    /// # Errors
    /// `E_RESERVED` for reserved bytes that are not 0, `E_PARAM` for a value outside its set.
    pub fn from_wire(bytes: &[u8; PARAM_BYTES]) -> Result<Params> {
        // spec: S3D-6
        if bytes[3] != 0 || bytes[7..].iter().any(|&b| b != 0) {
            return Err(Error::new(Code::Reserved, "codec.params", "a reserved byte of the s3dc parameters is not 0"));
        }
        if bytes[1] != IndexCurve::Linear as u8 {
            return Err(Error::param("index_curve", format!("{} is not known; only 0 (linear) is", bytes[1])));
        }
        let endpoints = match bytes[2] {
            0 => Endpoints::MinMax,
            1 => Endpoints::Fitted,
            v => return Err(Error::param("endpoints", format!("{v} is neither 0 (minmax) nor 1 (fitted)"))),
        };
        let [bx, by, bz] = [bytes[4], bytes[5], bytes[6]].map(u32::from);
        Params::new(bytes[0], Extent::new(bx, by, bz), endpoints)
    }

    /// The bytes of a codec table entry.
    #[must_use]
    pub fn to_wire(&self) -> [u8; PARAM_BYTES] {
        let mut bytes = [0; PARAM_BYTES];
        bytes[0] = self.i_bits;
        bytes[1] = self.index_curve() as u8;
        bytes[2] = self.endpoints as u8;
        bytes[4..7].copy_from_slice(&self.block);
        bytes
    }
}
