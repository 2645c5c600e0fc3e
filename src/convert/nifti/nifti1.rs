//! The header of NIfTI-1: 348 bytes, i16 and f32. Parsed by the crate `nifti`, which cannot write one alone.

use super::header::{BYTES_1, Header, put_text, text};
use crate::convert::fault;
use crate::error::Result;
use std::path::Path;

/// Parses the 348 bytes, whose first four have told the byte order.
pub(super) fn parse(path: &Path, head: &[u8], big_endian: bool) -> Result<Header> {
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

/// The 348 bytes, little endian.
pub(super) fn bytes(h: &Header) -> Vec<u8> {
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
