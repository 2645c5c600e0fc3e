//! Sample types and single sample values.

use crate::error::{Error, Result};
use std::fmt;

/// Type of one voxel. The numbers are those of the file (spec: VOL-4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum SampleType {
    /// Unsigned 8 bit.
    U8 = 1,
    /// Unsigned 16 bit.
    U16 = 2,
    /// Signed 16 bit.
    I16 = 3,
    /// IEEE 754 binary32.
    F32 = 4,
    /// Three unsigned 8-bit components: red, green, blue.
    Rgb8 = 5,
}

impl SampleType {
    /// All types, in file order.
    pub const ALL: [SampleType; 5] =
        [SampleType::U8, SampleType::U16, SampleType::I16, SampleType::F32, SampleType::Rgb8];

    /// Bytes of one voxel.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            SampleType::U8 => 1,
            SampleType::U16 | SampleType::I16 => 2,
            SampleType::Rgb8 => 3,
            SampleType::F32 => 4,
        }
    }

    /// Components of one voxel.
    #[must_use]
    pub const fn components(self) -> usize {
        if matches!(self, SampleType::Rgb8) { 3 } else { 1 }
    }

    /// The name used on the command line and in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            SampleType::U8 => "u8",
            SampleType::U16 => "u16",
            SampleType::I16 => "i16",
            SampleType::F32 => "f32",
            SampleType::Rgb8 => "rgb8",
        }
    }

    /// The type of a file's number.
    #[must_use]
    pub fn from_wire(value: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|t| *t as u8 == value)
    }
}

impl fmt::Display for SampleType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for SampleType {
    type Err = Error;
    fn from_str(s: &str) -> Result<Self> {
        Self::ALL
            .into_iter()
            .find(|t| t.name() == s)
            .ok_or_else(|| Error::param("dtype", format!("{s:?} is not one of u8, u16, i16, f32, rgb8")))
    }
}

/// A voxel as it lies in memory. Implemented for `u8`, `u16`, `i16`, `f32` and `[u8; 3]`.
pub trait Sample: bytemuck::Pod + PartialEq + Send + Sync + fmt::Debug {
    /// The type that a file stores for it.
    const TYPE: SampleType;
    /// Component `c` as f64, exactly.
    fn component(self, c: usize) -> f64;
    /// As a value whose type is known at run time.
    fn value(self) -> SampleValue;
}

macro_rules! scalar {
    ($($t:ty => $v:ident),*) => {$(
        impl Sample for $t {
            const TYPE: SampleType = SampleType::$v;
            #[inline]
            fn component(self, _: usize) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn value(self) -> SampleValue {
                SampleValue::$v(self)
            }
        }
    )*};
}
scalar!(u8 => U8, u16 => U16, i16 => I16, f32 => F32);

impl Sample for [u8; 3] {
    const TYPE: SampleType = SampleType::Rgb8;
    #[inline]
    fn component(self, c: usize) -> f64 {
        f64::from(self[c])
    }
    #[inline]
    fn value(self) -> SampleValue {
        SampleValue::Rgb8(self)
    }
}

/// One voxel's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SampleValue {
    /// Unsigned 8 bit.
    U8(u8),
    /// Unsigned 16 bit.
    U16(u16),
    /// Signed 16 bit.
    I16(i16),
    /// 32-bit float.
    F32(f32),
    /// Red, green, blue.
    Rgb8([u8; 3]),
}

impl SampleValue {
    /// Component `c` as f64, exactly.
    #[must_use]
    pub fn component(self, c: usize) -> f64 {
        match self {
            SampleValue::U8(v) => v.component(c),
            SampleValue::U16(v) => v.component(c),
            SampleValue::I16(v) => v.component(c),
            SampleValue::F32(v) => v.component(c),
            SampleValue::Rgb8(v) => v.component(c),
        }
    }

    /// Its type.
    #[must_use]
    pub const fn sample_type(self) -> SampleType {
        match self {
            SampleValue::U8(_) => SampleType::U8,
            SampleValue::U16(_) => SampleType::U16,
            SampleValue::I16(_) => SampleType::I16,
            SampleValue::F32(_) => SampleType::F32,
            SampleValue::Rgb8(_) => SampleType::Rgb8,
        }
    }

    /// The raw little-endian bytes, in the low bytes of a `u32` (spec: IDX-8).
    #[must_use]
    pub fn to_raw(self) -> u32 {
        match self {
            SampleValue::U8(v) => u32::from(v),
            SampleValue::U16(v) => u32::from(v),
            SampleValue::I16(v) => u32::from(v.cast_unsigned()),
            SampleValue::F32(v) => v.to_bits(),
            SampleValue::Rgb8([r, g, b]) => u32::from_le_bytes([r, g, b, 0]),
        }
    }

    /// The value as the Rust type that it has.
    ///
    /// # Panics
    /// Where it has another type.
    #[must_use]
    pub fn typed<T: Sample>(self) -> T {
        match self {
            SampleValue::U8(v) => same(v),
            SampleValue::U16(v) => same(v),
            SampleValue::I16(v) => same(v),
            SampleValue::F32(v) => same(v),
            SampleValue::Rgb8(v) => same(v),
        }
    }

    /// The value of raw bytes, or `None` where bits above the type's width are set.
    #[must_use]
    pub fn from_raw(t: SampleType, raw: u32) -> Option<Self> {
        let b = raw.to_le_bytes();
        let value = match t {
            SampleType::U8 => SampleValue::U8(b[0]),
            SampleType::U16 => SampleValue::U16(u16::from_le_bytes([b[0], b[1]])),
            SampleType::I16 => SampleValue::I16(i16::from_le_bytes([b[0], b[1]])),
            SampleType::F32 => SampleValue::F32(f32::from_bits(raw)),
            SampleType::Rgb8 => SampleValue::Rgb8([b[0], b[1], b[2]]),
        };
        (value.to_raw() == raw).then_some(value)
    }
}

/// `v` itself, where `A` and `B` are one type under two names.
#[inline]
#[must_use]
pub(crate) fn same<A: Sample, B: Sample>(v: A) -> B {
    assert!(A::TYPE == B::TYPE, "a value of another type");
    bytemuck::cast_slice(&[v])[0]
}

impl fmt::Display for SampleValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SampleValue::U8(v) => write!(f, "{v}"),
            SampleValue::U16(v) => write!(f, "{v}"),
            SampleValue::I16(v) => write!(f, "{v}"),
            SampleValue::F32(v) => write!(f, "{v}"),
            SampleValue::Rgb8([r, g, b]) => write!(f, "{r},{g},{b}"),
        }
    }
}

/// Runs `$body` with `$T` bound to the Rust type of a `SampleType`.
#[macro_export]
macro_rules! with_sample {
    ($sample_type:expr, $T:ident => $body:expr) => {
        match $sample_type {
            $crate::voxel::SampleType::U8 => {
                type $T = u8;
                $body
            }
            $crate::voxel::SampleType::U16 => {
                type $T = u16;
                $body
            }
            $crate::voxel::SampleType::I16 => {
                type $T = i16;
                $body
            }
            $crate::voxel::SampleType::F32 => {
                type $T = f32;
                $body
            }
            $crate::voxel::SampleType::Rgb8 => {
                type $T = [u8; 3];
                $body
            }
        }
    };
}
