//! Codec `s3dc`: two end points per block, and an index of `i_bits` per voxel (spec chapter 8).
//!
//! After "S3Dc: A 3Dc-based Volume Compression Algorithm" (Yela, Navazo, Vázquez 2008), §3 and §4.2. The volume of end
//! points is the paper's MinMax Volume (MMV), the volume of indices its Index Volume (IV). Where the paper is ambiguous,
//! the spec chapter decides; decoding is defined in integers, so that every reader gives the same samples.
//!
//! | file | owns |
//! |---|---|
//! | `params` | the parameters and their 28 bytes |
//! | `layout` | where MMV pairs and IV words lie; single voxels |
//! | `scalar` | the formulas, per sample type |
//! | `decode`, `encode` | the plain scalar coder, which defines the result |
//! | `fitted` | end points by least squares |
//! | `check` | strict validation |
//! | `ratio` | ratios and error bounds of the paper |
//! | `fast*` | the same results with vector instructions |

mod check;
mod decode;
mod encode;
mod fast;
#[cfg(target_arch = "x86_64")]
mod fast_avx2;
#[cfg(target_arch = "x86_64")]
mod fast_avx2_float;
#[cfg(target_arch = "x86_64")]
mod fast_avx512;
mod fast_rows;
mod fast_tables;
mod layout;
mod params;
mod point;
mod ratio;
mod scalar;

pub use fast::Isa;
pub use layout::Layout;
pub use params::{Endpoints, IndexCurve, Params};
pub use point::{Point, PowerLayout};
pub use ratio::{closed_form_ratio, eq6_max_error, formula_ratio, integer_error_bound, padded_ratio};
pub use scalar::Scalar;

pub(super) use check::check;
pub use decode::decode_on;
pub(super) use decode::{decode, decode_plain, pieces};
pub(super) use encode::encode;

/// Number of the codec in the codec table.
pub const ID: u16 = 2;
/// Version of the payload's layout.
pub const STREAM_VERSION: u16 = 1;

/// Runs `$body` with `$T` bound to the Rust type of a scalar `SampleType`; `$otherwise` for the rest.
macro_rules! with_scalar {
    ($sample_type:expr, $T:ident => $body:expr, else $otherwise:expr) => {
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
            $crate::voxel::SampleType::Rgb8 => $otherwise,
        }
    };
}
use with_scalar;
