//! The header of NIfTI-2: 540 bytes, i64 and f64.

use super::header::{BYTES_2, Header, put_text, text};
use crate::convert::fault;
use crate::error::Result;
use std::path::Path;

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

/// Parses the 540 bytes, whose first four have told the byte order.
pub(super) fn parse(path: &Path, head: &[u8], big_endian: bool) -> Result<Header> {
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

/// The 540 bytes, little endian.
pub(super) fn bytes(h: &Header) -> Vec<u8> {
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
