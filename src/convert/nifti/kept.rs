//! The header as an object for META, and the parts of it that go back into a file.

use super::geometry;
use super::header::Header;
use crate::affine::Placement;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Everything but shape, type and storage. Empty and zero fields are left out.
pub(super) fn to_json(h: &Header) -> Value {
    let mut o = Map::new();
    o.insert("format".into(), json!(format!("nifti-{}", h.version)));
    for (key, text) in [
        ("descrip", &h.descrip),
        ("aux_file", &h.aux_file),
        ("intent_name", &h.intent_name),
        ("db_name", &h.db_name),
        ("data_type", &h.data_type),
    ] {
        if !text.is_empty() {
            o.insert(key.into(), json!(text));
        }
    }
    for (key, number) in [
        ("qform_code", i64::from(h.qform_code)),
        ("sform_code", i64::from(h.sform_code)),
        ("xyzt_units", i64::from(h.xyzt_units)),
        ("intent_code", i64::from(h.intent_code)),
        ("dim_info", i64::from(h.dim_info)),
        ("slice_code", i64::from(h.slice_code)),
        ("slice_start", h.slice_start),
        ("slice_end", h.slice_end),
    ] {
        if number != 0 {
            o.insert(key.into(), json!(number));
        }
    }
    // NaN has no place in JSON; such a field says nothing anyway.
    let mut numbers = |key: &str, values: &[f64]| {
        if values.iter().any(|v| *v != 0.0) && values.iter().all(|v| v.is_finite()) {
            o.insert(key.into(), if let [v] = values { json!(v) } else { json!(values) });
        }
    };
    numbers("cal_max", &[h.cal_max]);
    numbers("cal_min", &[h.cal_min]);
    numbers("slice_duration", &[h.slice_duration]);
    numbers("toffset", &[h.toffset]);
    numbers("intent_p", &h.intent_p);
    if h.qform_code > 0 || h.sform_code > 0 {
        numbers("pixdim", &h.pixdim[..4]);
        numbers("quatern", &h.quatern);
        numbers("qoffset", &h.qoffset);
        numbers("srow", h.srow.as_flattened());
    }
    Value::Object(o)
}

/// Puts back what the object of an earlier import says. Text of a NRRD file fits in part.
pub(super) fn restore(h: &mut Header, kept: &Value) {
    let text = |key: &str| kept.get(key).and_then(Value::as_str).unwrap_or("").to_owned();
    let integer = |key: &str| kept.get(key).and_then(Value::as_i64).and_then(|v| i32::try_from(v).ok()).unwrap_or(0);
    let number = |key: &str| kept.get(key).and_then(Value::as_f64).unwrap_or(0.0);
    h.descrip = text("descrip");
    if h.descrip.is_empty() {
        let content = kept.get("fields").and_then(|f| f.get("content")).and_then(Value::as_str);
        h.descrip = content.unwrap_or("").to_owned();
    }
    h.aux_file = text("aux_file");
    h.intent_name = text("intent_name");
    h.db_name = text("db_name");
    h.data_type = text("data_type");
    h.qform_code = integer("qform_code").clamp(0, 5);
    h.sform_code = integer("sform_code").clamp(0, 5);
    h.xyzt_units = integer("xyzt_units") & 0x3f;
    h.intent_code = i32::from(i16::try_from(integer("intent_code")).unwrap_or(0));
    h.dim_info = u8::try_from(integer("dim_info")).unwrap_or(0);
    h.slice_code = integer("slice_code").clamp(0, 255);
    h.slice_start = i64::from(i16::try_from(integer("slice_start")).unwrap_or(0));
    h.slice_end = i64::from(i16::try_from(integer("slice_end")).unwrap_or(0));
    h.cal_max = number("cal_max");
    h.cal_min = number("cal_min");
    h.slice_duration = number("slice_duration");
    h.toffset = number("toffset");
    h.intent_p = numbers(kept, "intent_p").unwrap_or_default();
}

fn numbers<const N: usize>(kept: &Value, key: &str) -> Option<[f64; N]> {
    let list: Vec<f64> = kept.get(key)?.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    list.try_into().ok()
}

/// The original sform, qform and pixdim, where they still place the volume: computed anew from the matrix, a qform would
/// move it by a rounding.
///
/// `header` holds all other fields already. Returns whether they were put back.
pub(super) fn restore_forms(header: &mut Header, kept: &Value, placement: &Placement) -> bool {
    let Some(pixdim) = numbers::<4>(kept, "pixdim") else { return false };
    let (ras, unit) = geometry::in_ras(placement);
    let mut candidate = header.clone();
    candidate.pixdim[..4].copy_from_slice(&pixdim);
    candidate.quatern = numbers(kept, "quatern").unwrap_or_default();
    candidate.qoffset = numbers(kept, "qoffset").unwrap_or_default();
    let srow = numbers::<12>(kept, "srow").unwrap_or_default();
    candidate.srow.as_flattened_mut().copy_from_slice(&srow);
    candidate.xyzt_units = candidate.xyzt_units & !geometry::SPACE_UNIT_BITS | unit;
    if !geometry::read(Path::new(""), &candidate).is_ok_and(|original| original.matrix == ras.matrix) {
        return false;
    }
    *header = candidate;
    true
}
