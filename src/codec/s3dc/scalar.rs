//! The formulas of the codec, per sample type (spec chapter 8, §4 and §5).
//!
//! Integers are exact: no floating point takes part. Floats are computed in f64 and rounded once; the expression is
//! normative as written, so it must never be contracted into fused multiply-adds.

use crate::voxel::Sample;

/// A scalar sample that the codec can hold: `u8`, `u16`, `i16`, `f32`.
pub trait Scalar: Sample + PartialOrd + Default {
    /// Bytes of a sample.
    const BYTES: usize;
    /// The sample in the first [`Scalar::BYTES`] little-endian bytes.
    fn from_le(bytes: &[u8]) -> Self;
    /// Appends the little-endian bytes.
    fn push_le(self, out: &mut Vec<u8>);
    /// A stored end point as decoders see it: −0.0 counts as +0.0.
    #[must_use]
    fn stored(self) -> Self;
    /// Whether the sample may be stored.
    fn is_storable(self) -> bool;
    /// The sample of index `idx` in 0..=q between two end points. `min` where they are equal or out of order.
    fn reconstruct(min: Self, max: Self, idx: u32, q: u32) -> Self;
    /// The index of a sample between two end points of which it lies, clamped to 0..=q. 0 where they are equal.
    fn index(self, min: Self, max: Self, q: u32) -> u32;
    /// Most that |sample − decoded| can be in a block whose end points are its minimum and maximum.
    fn error_bound(min: Self, max: Self, q: u32) -> f64;
}

macro_rules! integer {
    ($($t:ty),*) => {$(
        impl Scalar for $t {
            const BYTES: usize = size_of::<$t>();

            #[inline]
            fn from_le(bytes: &[u8]) -> Self {
                let mut b = [0; Self::BYTES];
                b.copy_from_slice(&bytes[..Self::BYTES]);
                <$t>::from_le_bytes(b)
            }

            #[inline]
            fn push_le(self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }

            #[inline]
            fn stored(self) -> Self {
                self
            }

            #[inline]
            fn is_storable(self) -> bool {
                true
            }

            // spec: S3D-10, S3D-12: R fits 16 bits and R·idx 24 bits, for every pair of end points.
            #[inline]
            fn reconstruct(min: Self, max: Self, idx: u32, q: u32) -> Self {
                // No branch: on random voxels it would be mispredicted, and no load would overlap another one. A range of
                // 0, also that of end points out of order, gives step 0.
                let r = (i32::from(max) - i32::from(min)).max(0).cast_unsigned();
                let step = (2 * r * idx + q) / (2 * q);
                // min + step lies between min and max for idx <= q, so the low bits are the value.
                (i32::from(min) + step.cast_signed()) as $t
            }

            // spec: S3D-20
            #[inline]
            fn index(self, min: Self, max: Self, q: u32) -> u32 {
                if min >= max || self <= min {
                    return 0;
                }
                if self >= max {
                    return q;
                }
                let r = (i32::from(max) - i32::from(min)).cast_unsigned();
                let d = (i32::from(self) - i32::from(min)).cast_unsigned();
                (2 * d * q + r) / (2 * r)
            }

            #[inline]
            fn error_bound(min: Self, max: Self, q: u32) -> f64 {
                let r = i32::from(max).saturating_sub(i32::from(min)).max(0).cast_unsigned();
                f64::from(super::integer_error_bound(r, q))
            }
        }
    )*};
}
integer!(u8, u16, i16);

impl Scalar for f32 {
    const BYTES: usize = 4;

    #[inline]
    fn from_le(bytes: &[u8]) -> Self {
        f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
    }

    #[inline]
    fn push_le(self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.to_le_bytes());
    }

    // spec: S3D-13
    #[inline]
    fn stored(self) -> Self {
        if self == 0.0 { 0.0 } else { self }
    }

    #[inline]
    fn is_storable(self) -> bool {
        self.is_finite()
    }

    // spec: S3D-11, S3D-12: the range of two finite f32 is finite in f64; NaN and infinity fail the comparison.
    #[inline]
    fn reconstruct(min: Self, max: Self, idx: u32, q: u32) -> Self {
        let (lo, hi) = (f64::from(min), f64::from(max));
        let range = hi - lo;
        let orderly = range > 0.0 && range < f64::INFINITY;
        let a = f64::from(idx) / f64::from(q);
        let between = ((1.0 - a) * lo + a * hi) as f32;
        // Selected, not branched on: see the integers.
        let upper = if idx == q { max } else { between };
        if orderly & (idx != 0) { upper } else { min }
    }

    // spec: S3D-21
    #[inline]
    fn index(self, min: Self, max: Self, q: u32) -> u32 {
        let (lo, hi) = (f64::from(min), f64::from(max));
        if lo >= hi {
            return 0;
        }
        let scale = f64::from(q) / (hi - lo);
        // `as` saturates: below 0 gives 0.
        (((f64::from(self) - lo) * scale + 0.5) as u32).min(q)
    }

    // Half a step, and half a unit in the last place of the rounding to f32; the f64 roundings drown in the margin.
    #[inline]
    fn error_bound(min: Self, max: Self, q: u32) -> f64 {
        let (lo, hi) = (f64::from(min), f64::from(max));
        if lo >= hi {
            return 0.0;
        }
        let magnitude = lo.abs().max(hi.abs());
        (hi - lo) / (2.0 * f64::from(q)) * (1.0 + 1e-12) + magnitude * (0.5 * f64::from(f32::EPSILON)) + 1e-45
    }
}
