//! The header in one form for both versions: 348 bytes with i16 and f32, or 540 bytes with i64 and f64.

use super::{nifti1, nifti2};
use crate::convert::fault;
use crate::error::Result;
use std::io::{self, Write};
use std::path::Path;

/// Bytes of a NIfTI-1 header.
pub(super) const BYTES_1: usize = 348;
/// Bytes of a NIfTI-2 header.
pub(super) const BYTES_2: usize = 540;

/// What both versions hold. Numbers are wide enough for either; text ends at its first zero byte.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Header {
    /// 1 or 2.
    pub version: u8,
    pub big_endian: bool,
    /// Header and data in one file.
    pub single: bool,
    pub dim: [i64; 8],
    pub datatype: i16,
    pub bitpix: i16,
    pub pixdim: [f64; 8],
    pub vox_offset: f64,
    pub scl_slope: f64,
    pub scl_inter: f64,
    pub cal_max: f64,
    pub cal_min: f64,
    pub slice_duration: f64,
    pub toffset: f64,
    pub slice_start: i64,
    pub slice_end: i64,
    pub slice_code: i32,
    pub dim_info: u8,
    pub xyzt_units: i32,
    pub intent_code: i32,
    pub intent_p: [f64; 3],
    pub intent_name: String,
    pub descrip: String,
    pub aux_file: String,
    /// NIfTI-1 only.
    pub db_name: String,
    /// NIfTI-1 only.
    pub data_type: String,
    pub qform_code: i32,
    pub sform_code: i32,
    /// b, c, d.
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub srow: [[f64; 4]; 3],
}

impl Header {
    /// Bytes of this version's header.
    pub const fn bytes(&self) -> usize {
        if self.version == 1 { BYTES_1 } else { BYTES_2 }
    }
}

/// Text up to its first zero byte.
pub(super) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).trim_end().to_owned()
}

/// Parses the first bytes of a file.
///
/// # Errors
/// `E_FOREIGN` for anything that is no NIfTI header, `E_UNSUPPORTED` for Analyze 7.5, whose orientation is not defined.
pub(super) fn parse(path: &Path, head: &[u8]) -> Result<Header> {
    let size = head.get(..4).map(|b| [b[0], b[1], b[2], b[3]]).unwrap_or_default();
    let (le, be) = (i32::from_le_bytes(size), i32::from_be_bytes(size));
    let (version, big_endian) = match (le, be) {
        (348, _) => (1, false),
        (_, 348) => (1, true),
        (540, _) => (2, false),
        (_, 540) => (2, true),
        _ => {
            let message = format!("{le} is neither 348 (NIfTI-1) nor 540 (NIfTI-2), in either byte order");
            return Err(fault::foreign(path, "sizeof_hdr", message));
        }
    };
    let needed = if version == 1 { BYTES_1 } else { BYTES_2 };
    let Some(head) = head.get(..needed) else {
        let message = format!("{} bytes are too short for a header of {needed}", head.len());
        return Err(fault::foreign(path, "header", message));
    };
    if version == 1 { nifti1::parse(path, head, big_endian) } else { nifti2::parse(path, head, big_endian) }
}

/// Writes text into a field of `N` bytes, cut at a character, zeros behind it.
pub(super) fn put_text<const N: usize>(out: &mut Vec<u8>, text: &str) {
    // One zero at the end at least: most readers expect it.
    let mut end = text.len().min(N - 1);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let start = out.len();
    out.extend_from_slice(&text.as_bytes()[..end]);
    out.resize(start + N, 0);
}

/// Writes the header, little endian, without the four extension bytes behind it.
pub(super) fn write(out: &mut dyn Write, h: &Header) -> io::Result<()> {
    let bytes = if h.version == 1 { nifti1::bytes(h) } else { nifti2::bytes(h) };
    debug_assert_eq!(bytes.len(), h.bytes());
    out.write_all(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Code;

    /// A header with a different value in every field.
    fn full(version: u8) -> Header {
        let mut n = 0.0;
        let mut next = || {
            n += 0.5;
            n
        };
        Header {
            version,
            big_endian: false,
            single: version == 1,
            dim: [3, 4, 5, 6, 1, 1, 1, 1],
            datatype: 512,
            bitpix: 16,
            pixdim: std::array::from_fn(|_| next()),
            vox_offset: 352.0,
            scl_slope: next(),
            scl_inter: next(),
            cal_max: next(),
            cal_min: next(),
            slice_duration: next(),
            toffset: next(),
            slice_start: 21,
            slice_end: 22,
            slice_code: 3,
            dim_info: 57,
            xyzt_units: 10,
            intent_code: 1007,
            intent_p: std::array::from_fn(|_| next()),
            intent_name: "intent".into(),
            descrip: "a description".into(),
            aux_file: "aux".into(),
            db_name: if version == 1 { "db".into() } else { String::new() },
            data_type: if version == 1 { "type".into() } else { String::new() },
            qform_code: 1,
            sform_code: 2,
            quatern: std::array::from_fn(|_| next()),
            qoffset: std::array::from_fn(|_| next()),
            srow: std::array::from_fn(|_| std::array::from_fn(|_| next())),
        }
    }

    #[test]
    fn every_field_comes_back() {
        for version in [1, 2] {
            let header = full(version);
            let mut bytes = Vec::new();
            write(&mut bytes, &header).unwrap();
            assert_eq!(bytes.len(), header.bytes());
            assert_eq!(parse(Path::new("f"), &bytes).unwrap(), header);
            for cut in [0, 3, 4, 200, bytes.len() - 1] {
                assert_eq!(parse(Path::new("f"), &bytes[..cut]).unwrap_err().code(), Code::Foreign, "{cut}");
            }
        }
    }

    #[test]
    fn big_endian_is_told_by_the_size() {
        let mut header = full(2);
        let mut bytes = nifti2::bytes(&header);
        // Reverse every field by its width.
        let widths = [(0, 4, 1), (12, 2, 2), (16, 8, 28), (344, 4, 2), (352, 8, 18), (496, 4, 3)];
        for (at, width, count) in widths {
            bytes[at..at + width * count].chunks_exact_mut(width).for_each(<[u8]>::reverse);
        }
        header.big_endian = true;
        assert_eq!(parse(Path::new("f"), &bytes).unwrap(), header);
    }

    #[test]
    fn long_text_is_cut_at_a_character() {
        let header = Header { aux_file: "é".repeat(40), ..full(1) };
        let mut bytes = Vec::new();
        write(&mut bytes, &header).unwrap();
        assert_eq!(parse(Path::new("f"), &bytes).unwrap().aux_file, "é".repeat(11));
    }

    #[test]
    fn no_nifti() {
        let mut analyze = nifti1::bytes(&full(1));
        analyze[344..].fill(0);
        assert_eq!(parse(Path::new("f"), &analyze).unwrap_err().code(), Code::Unsupported);
        let mut other = nifti1::bytes(&full(1));
        other[344] = b'x';
        assert_eq!(parse(Path::new("f"), &other).unwrap_err().code(), Code::Foreign);
        let mut order = nifti1::bytes(&full(1));
        order[40..42].copy_from_slice(&[0, 9]);
        assert!(parse(Path::new("f"), &order).unwrap_err().field().contains("dim[0]"));
        let mut newline = nifti2::bytes(&full(2));
        newline[8] = b'\n';
        assert_eq!(parse(Path::new("f"), &newline).unwrap_err().field(), "magic");
    }
}
