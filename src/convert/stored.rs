//! Sample types as foreign files store them: eleven kinds, either byte order.

use crate::error::{Error, Result};
use crate::voxel::SampleType;
use std::fmt;
use std::str::FromStr;

/// Type of one stored sample. Five of them are Vug's own; the others have to be narrowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Unsigned 8 bit.
    U8,
    /// Signed 8 bit.
    I8,
    /// Unsigned 16 bit.
    U16,
    /// Signed 16 bit.
    I16,
    /// Unsigned 32 bit.
    U32,
    /// Signed 32 bit.
    I32,
    /// Unsigned 64 bit.
    U64,
    /// Signed 64 bit.
    I64,
    /// IEEE 754 binary32.
    F32,
    /// IEEE 754 binary64.
    F64,
    /// Red, green, blue, 8 bit each.
    Rgb8,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 11] = [
        Kind::U8,
        Kind::I8,
        Kind::U16,
        Kind::I16,
        Kind::U32,
        Kind::I32,
        Kind::U64,
        Kind::I64,
        Kind::F32,
        Kind::F64,
        Kind::Rgb8,
    ];

    /// Bytes of one sample.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Kind::U8 | Kind::I8 => 1,
            Kind::U16 | Kind::I16 => 2,
            Kind::Rgb8 => 3,
            Kind::U32 | Kind::I32 | Kind::F32 => 4,
            Kind::U64 | Kind::I64 | Kind::F64 => 8,
        }
    }

    /// The name used on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Kind::U8 => "u8",
            Kind::I8 => "i8",
            Kind::U16 => "u16",
            Kind::I16 => "i16",
            Kind::U32 => "u32",
            Kind::I32 => "i32",
            Kind::U64 => "u64",
            Kind::I64 => "i64",
            Kind::F32 => "f32",
            Kind::F64 => "f64",
            Kind::Rgb8 => "rgb8",
        }
    }

    /// The same type of Vug, where there is one.
    #[must_use]
    pub const fn native(self) -> Option<SampleType> {
        match self {
            Kind::U8 => Some(SampleType::U8),
            Kind::U16 => Some(SampleType::U16),
            Kind::I16 => Some(SampleType::I16),
            Kind::F32 => Some(SampleType::F32),
            Kind::Rgb8 => Some(SampleType::Rgb8),
            Kind::I8 | Kind::U32 | Kind::I32 | Kind::U64 | Kind::I64 | Kind::F64 => None,
        }
    }
}

impl From<SampleType> for Kind {
    fn from(t: SampleType) -> Self {
        match t {
            SampleType::U8 => Kind::U8,
            SampleType::U16 => Kind::U16,
            SampleType::I16 => Kind::I16,
            SampleType::F32 => Kind::F32,
            SampleType::Rgb8 => Kind::Rgb8,
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A kind and its byte order, written `u16`, `u16le` or `u16be`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stored {
    /// Type of one sample.
    pub kind: Kind,
    /// Whether the most significant byte comes first.
    pub big_endian: bool,
}

impl Stored {
    /// Whether the bytes have to be reversed on this machine.
    pub(super) const fn swapped(self) -> bool {
        self.big_endian != cfg!(target_endian = "big") && !matches!(self.kind, Kind::U8 | Kind::I8 | Kind::Rgb8)
    }
}

impl From<Kind> for Stored {
    fn from(kind: Kind) -> Self {
        Stored { kind, big_endian: false }
    }
}

impl FromStr for Stored {
    type Err = Error;

    fn from_str(s: &str) -> Result<Self> {
        let (name, big_endian) = match (s.strip_suffix("be"), s.strip_suffix("le")) {
            (Some(name), _) => (name, true),
            (None, Some(name)) => (name, false),
            (None, None) => (s, false),
        };
        let kind = Kind::ALL.into_iter().find(|k| k.name() == name).ok_or_else(|| {
            let names = Kind::ALL.map(Kind::name).join(", ");
            Error::param("dtype", format!("{s:?} is not one of {names}, with \"be\" behind it for big endian"))
        })?;
        Ok(Stored { kind, big_endian })
    }
}

/// A stored number. `Rgb8` is none: it is copied, never converted.
pub(super) trait Scalar: Copy + fmt::Display {
    /// From its bytes in memory order of this machine, or reversed.
    fn read(bytes: &[u8], swapped: bool) -> Self;
    /// As f64: exact but for integers above 2^53.
    fn to_f64(self) -> f64;
    /// The nearest f32.
    fn to_f32(self) -> f32;
    /// Whether `to_f32` loses nothing (NaN stays NaN).
    fn is_f32(self) -> bool;
}

macro_rules! scalar {
    ($($t:ty: $exact:expr;)*) => {$(
        impl Scalar for $t {
            #[inline]
            fn read(bytes: &[u8], swapped: bool) -> Self {
                let mut raw = [0; size_of::<$t>()];
                raw.copy_from_slice(bytes);
                if swapped {
                    raw.reverse();
                }
                Self::from_ne_bytes(raw)
            }
            #[inline]
            fn to_f64(self) -> f64 {
                self as f64
            }
            #[inline]
            fn to_f32(self) -> f32 {
                self as f32
            }
            #[inline]
            fn is_f32(self) -> bool {
                let exact: fn($t) -> bool = $exact;
                exact(self)
            }
        }
    )*};
}
scalar! {
    u8: |_| true;
    i8: |_| true;
    u16: |_| true;
    i16: |_| true;
    u32: |v| (v as f32) as i128 == i128::from(v);
    i32: |v| (v as f32) as i128 == i128::from(v);
    u64: |v| (v as f32) as i128 == i128::from(v);
    i64: |v| (v as f32) as i128 == i128::from(v);
    f32: |_| true;
    f64: |v| v.is_nan() || f64::from(v as f32) == v;
}

/// Runs `$body` with `$S` bound to the Rust type of a `Kind`; `$other` for `Rgb8`.
macro_rules! with_scalar {
    ($kind:expr, $S:ident => $body:expr, $other:expr) => {
        match $kind {
            Kind::U8 => {
                type $S = u8;
                $body
            }
            Kind::I8 => {
                type $S = i8;
                $body
            }
            Kind::U16 => {
                type $S = u16;
                $body
            }
            Kind::I16 => {
                type $S = i16;
                $body
            }
            Kind::U32 => {
                type $S = u32;
                $body
            }
            Kind::I32 => {
                type $S = i32;
                $body
            }
            Kind::U64 => {
                type $S = u64;
                $body
            }
            Kind::I64 => {
                type $S = i64;
                $body
            }
            Kind::F32 => {
                type $S = f32;
                $body
            }
            Kind::F64 => {
                type $S = f64;
                $body
            }
            Kind::Rgb8 => $other,
        }
    };
}
pub(super) use with_scalar;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_byte_order() {
        for kind in Kind::ALL {
            assert_eq!(kind.name().parse::<Stored>().unwrap(), Stored { kind, big_endian: false });
            assert_eq!(format!("{kind}be").parse::<Stored>().unwrap(), Stored { kind, big_endian: true });
            if let Some(t) = kind.native() {
                assert_eq!((Kind::from(t), t.bytes()), (kind, kind.bytes()));
            }
        }
        assert!("u128".parse::<Stored>().unwrap_err().to_string().contains("u128"));
        assert!("be".parse::<Stored>().is_err());
    }

    #[test]
    fn exactness_in_f32() {
        assert!((1u32 << 24).is_f32() && !((1u32 << 24) + 1).is_f32());
        assert!(!u64::MAX.is_f32() && (1u64 << 63).is_f32());
        assert!(i64::MIN.is_f32() && !i64::MAX.is_f32());
        assert!(0.5f64.is_f32() && !0.1f64.is_f32() && f64::NAN.is_f32() && f64::INFINITY.is_f32());
        assert!(!1e300f64.is_f32());
    }
}
