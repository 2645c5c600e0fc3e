//! The header in one form for both versions: 348 bytes with i16 and f32, or 540 bytes with i64 and f64.

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
fn text(bytes: &[u8]) -> String {
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
    if version == 1 { parse_1(path, head, big_endian) } else { parse_2(path, head, big_endian) }
}

fn parse_1(path: &Path, head: &[u8], big_endian: bool) -> Result<Header> {
    let single = match &head[344..348] {
        b"n+1\0" => true,
        b"ni1\0" => false,
        [0, 0, 0, 0] => {
            let message =
                "no NIfTI magic: an Analyze 7.5 header does not say which way the axes point; convert to NIfTI";
            return Err(fault::unsupported(path, "magic", message));
        }
        other => {
            let message = format!("\"{}\" is neither n+1 nor ni1", other.escape_ascii());
            return Err(fault::foreign(path, "magic", message));
        }
    };
    let h = nifti::NiftiHeader::from_reader(head).map_err(|e| fault::foreign(path, "header", e))?;
    // The crate takes the byte order from dim[0]; where that is out of its range, the two disagree.
    if (h.endianness == nifti::Endianness::Big) != big_endian {
        return Err(fault::foreign(path, "dim[0]", "is not from 1 to 7 in the header's own byte order"));
    }
    let wide = f64::from;
    Ok(Header {
        version: 1,
        big_endian,
        single,
        // The crate reads the axes as u16; the standard has i16.
        dim: h.dim.map(|d| i64::from(d.cast_signed())),
        datatype: h.datatype,
        bitpix: h.bitpix,
        pixdim: h.pixdim.map(wide),
        vox_offset: wide(h.vox_offset),
        scl_slope: wide(h.scl_slope),
        scl_inter: wide(h.scl_inter),
        cal_max: wide(h.cal_max),
        cal_min: wide(h.cal_min),
        slice_duration: wide(h.slice_duration),
        toffset: wide(h.toffset),
        slice_start: h.slice_start.into(),
        slice_end: h.slice_end.into(),
        slice_code: h.slice_code.into(),
        dim_info: h.dim_info,
        xyzt_units: h.xyzt_units.into(),
        intent_code: h.intent_code.into(),
        intent_p: [h.intent_p1, h.intent_p2, h.intent_p3].map(wide),
        intent_name: text(&h.intent_name),
        descrip: text(&h.descrip),
        aux_file: text(&h.aux_file),
        db_name: text(&h.db_name),
        data_type: text(&h.data_type),
        qform_code: h.qform_code.into(),
        sform_code: h.sform_code.into(),
        quatern: [h.quatern_b, h.quatern_c, h.quatern_d].map(wide),
        qoffset: [h.quatern_x, h.quatern_y, h.quatern_z].map(wide),
        srow: [h.srow_x, h.srow_y, h.srow_z].map(|r| r.map(wide)),
    })
}

/// Fields of a NIfTI-2 header at their offsets.
struct Fields<'a> {
    head: &'a [u8; BYTES_2],
    big_endian: bool,
}

impl Fields<'_> {
    fn raw<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut raw = [0; N];
        raw.copy_from_slice(&self.head[at..at + N]);
        if self.big_endian {
            raw.reverse();
        }
        raw
    }

    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.raw(at))
    }

    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.raw(at))
    }

    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.raw(at))
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.raw(at))
    }

    fn f64s<const N: usize>(&self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| self.f64(at + 8 * i))
    }
}

fn parse_2(path: &Path, head: &[u8], big_endian: bool) -> Result<Header> {
    let short = |_| fault::foreign(path, "header", "too short");
    let head: &[u8; BYTES_2] = head.try_into().map_err(short)?;
    let single = match &head[4..12] {
        b"n+2\0\r\n\x1a\n" => true,
        b"ni2\0\r\n\x1a\n" => false,
        other => {
            let message = format!("\"{}\" is neither n+2 nor ni2 with its line ends intact", other.escape_ascii());
            return Err(fault::foreign(path, "magic", message));
        }
    };
    let f = Fields { head, big_endian };
    Ok(Header {
        version: 2,
        big_endian,
        single,
        datatype: f.i16(12),
        bitpix: f.i16(14),
        dim: std::array::from_fn(|i| f.i64(16 + 8 * i)),
        intent_p: f.f64s(80),
        pixdim: f.f64s(104),
        vox_offset: f.i64(168) as f64,
        scl_slope: f.f64(176),
        scl_inter: f.f64(184),
        cal_max: f.f64(192),
        cal_min: f.f64(200),
        slice_duration: f.f64(208),
        toffset: f.f64(216),
        slice_start: f.i64(224),
        slice_end: f.i64(232),
        descrip: text(&head[240..320]),
        aux_file: text(&head[320..344]),
        qform_code: f.i32(344),
        sform_code: f.i32(348),
        quatern: f.f64s(352),
        qoffset: f.f64s(376),
        srow: [f.f64s(400), f.f64s(432), f.f64s(464)],
        slice_code: f.i32(496),
        xyzt_units: f.i32(500),
        intent_code: f.i32(504),
        intent_name: text(&head[508..524]),
        dim_info: head[524],
        db_name: String::new(),
        data_type: String::new(),
    })
}

/// Writes text into a field of `N` bytes, cut at a character, zeros behind it.
fn put_text<const N: usize>(out: &mut Vec<u8>, text: &str) {
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
    let bytes = if h.version == 1 { bytes_1(h) } else { bytes_2(h) };
    debug_assert_eq!(bytes.len(), h.bytes());
    out.write_all(&bytes)
}

fn bytes_1(h: &Header) -> Vec<u8> {
    let mut b = Vec::with_capacity(BYTES_1);
    fn i16s(b: &mut Vec<u8>, values: &[i64]) {
        values.iter().for_each(|v| b.extend((*v as i16).to_le_bytes()));
    }
    fn f32s(b: &mut Vec<u8>, values: &[f64]) {
        values.iter().for_each(|v| b.extend((*v as f32).to_le_bytes()));
    }
    b.extend((BYTES_1 as i32).to_le_bytes());
    put_text::<10>(&mut b, &h.data_type);
    put_text::<18>(&mut b, &h.db_name);
    // extents, session_error; `regular` is 'r' in every file.
    b.extend([0, 0, 0, 0, 0, 0, b'r', h.dim_info]);
    i16s(&mut b, &h.dim);
    f32s(&mut b, &h.intent_p);
    i16s(&mut b, &[h.intent_code.into(), h.datatype.into(), h.bitpix.into(), h.slice_start]);
    f32s(&mut b, &h.pixdim);
    f32s(&mut b, &[h.vox_offset, h.scl_slope, h.scl_inter]);
    i16s(&mut b, &[h.slice_end]);
    b.extend([h.slice_code as u8, h.xyzt_units as u8]);
    f32s(&mut b, &[h.cal_max, h.cal_min, h.slice_duration, h.toffset]);
    b.extend([0; 8]);
    put_text::<80>(&mut b, &h.descrip);
    put_text::<24>(&mut b, &h.aux_file);
    i16s(&mut b, &[h.qform_code.into(), h.sform_code.into()]);
    f32s(&mut b, &h.quatern);
    f32s(&mut b, &h.qoffset);
    f32s(&mut b, h.srow.as_flattened());
    put_text::<16>(&mut b, &h.intent_name);
    b.extend(if h.single { b"n+1\0" } else { b"ni1\0" });
    b
}

fn bytes_2(h: &Header) -> Vec<u8> {
    let mut b = Vec::with_capacity(BYTES_2);
    fn i64s(b: &mut Vec<u8>, values: &[i64]) {
        values.iter().for_each(|v| b.extend(v.to_le_bytes()));
    }
    fn f64s(b: &mut Vec<u8>, values: &[f64]) {
        values.iter().for_each(|v| b.extend(v.to_le_bytes()));
    }
    b.extend((BYTES_2 as i32).to_le_bytes());
    b.extend(if h.single { b"n+2\0\r\n\x1a\n" } else { b"ni2\0\r\n\x1a\n" });
    b.extend(h.datatype.to_le_bytes());
    b.extend(h.bitpix.to_le_bytes());
    i64s(&mut b, &h.dim);
    f64s(&mut b, &h.intent_p);
    f64s(&mut b, &h.pixdim);
    i64s(&mut b, &[h.vox_offset as i64]);
    f64s(&mut b, &[h.scl_slope, h.scl_inter, h.cal_max, h.cal_min, h.slice_duration, h.toffset]);
    i64s(&mut b, &[h.slice_start, h.slice_end]);
    put_text::<80>(&mut b, &h.descrip);
    put_text::<24>(&mut b, &h.aux_file);
    b.extend(h.qform_code.to_le_bytes());
    b.extend(h.sform_code.to_le_bytes());
    f64s(&mut b, &h.quatern);
    f64s(&mut b, &h.qoffset);
    f64s(&mut b, h.srow.as_flattened());
    for v in [h.slice_code, h.xyzt_units, h.intent_code] {
        b.extend(v.to_le_bytes());
    }
    put_text::<16>(&mut b, &h.intent_name);
    b.push(h.dim_info);
    b.extend([0; 15]);
    b
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
        let mut bytes = bytes_2(&header);
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
        let mut analyze = bytes_1(&full(1));
        analyze[344..].fill(0);
        assert_eq!(parse(Path::new("f"), &analyze).unwrap_err().code(), Code::Unsupported);
        let mut other = bytes_1(&full(1));
        other[344] = b'x';
        assert_eq!(parse(Path::new("f"), &other).unwrap_err().code(), Code::Foreign);
        let mut order = bytes_1(&full(1));
        order[40..42].copy_from_slice(&[0, 9]);
        assert!(parse(Path::new("f"), &order).unwrap_err().field().contains("dim[0]"));
        let mut newline = bytes_2(&full(2));
        newline[8] = b'\n';
        assert_eq!(parse(Path::new("f"), &newline).unwrap_err().field(), "magic");
    }
}
