//! NRRD ("nearly raw raster data", Teem; magic NRRD0001 to NRRD0005), attached and detached headers.
//!
//! No crate reads it, so this is a small reader of our own. It takes what volumes need (raw, gzip, bzip2 and text
//! encodings, line and byte skip, both byte orders, spacings and space directions) and refuses the rest by name: hex
//! encoding, lists of data files, blocks, time, vectors, light fields.

mod axes;
mod data;
mod fields;
mod geometry;
mod header;
mod text;
mod write;

pub(super) use write::{write_attached, write_header};

use super::{Format, Import, ImportOptions, fault, payload};
use crate::affine::ValueMap;
use crate::error::Result;
use header::Header;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Key/value pairs that carry a value map: NRRD has no field for it.
const VALUE_SCALE: &str = "vug value scale";
const VALUE_OFFSET: &str = "vug value offset";

/// Fields that say how the samples are stored and where the volume lies. They go into the volume itself; all others are
/// kept as text.
const STORAGE: [&str; 13] = [
    "type",
    "dimension",
    "sizes",
    "encoding",
    "endian",
    "datafile",
    "byteskip",
    "lineskip",
    "number",
    "blocksize",
    "spacedimension",
    "spacedirections",
    "spaceorigin",
];

/// Opens a NRRD file; what lies in a detached data file is looked for beside the header.
pub(super) fn import(path: &Path, options: &ImportOptions) -> Result<Import> {
    let (file, len) = payload::open(path)?;
    let header = header::read(path, file, len)?;
    let axes = axes::read(path, &header, options.dtype)?;
    let placement = geometry::read(path, &header, &axes)?;
    let value_map = value_map(path, &header)?;
    let payload = data::locate(path, &header, &axes, len, options.max_bytes)?;
    let (reader, streamed) = payload.open(path, options.dtype)?;
    Ok(Import {
        reader,
        placement,
        times: None,
        labels: false,
        value_map,
        header: kept(&header),
        format: Format::Nrrd,
        streamed,
    })
}

fn value_map(path: &Path, header: &Header) -> Result<ValueMap> {
    let number = |key: &'static str, default: f64| match header.key_values.iter().find(|(k, _)| k == key) {
        None => Ok(default),
        Some((_, text)) => match text.trim().parse::<f64>() {
            Ok(v) if v.is_finite() => Ok(v),
            _ => Err(fault::foreign(path, key, format!("{text:?} is not a finite number"))),
        },
    };
    Ok(ValueMap { scale: number(VALUE_SCALE, 1.0)?, offset: number(VALUE_OFFSET, 0.0)? })
}

/// What META keeps of the header.
fn kept(header: &Header) -> Value {
    let mut source = Map::new();
    source.insert("format".into(), json!("nrrd"));
    if !header.comments.is_empty() {
        source.insert("comments".into(), json!(header.comments));
    }
    let mut fields: Map<String, Value> = Map::new();
    for field in header.fields.iter().filter(|f| !STORAGE.contains(&f.id.as_str())) {
        fields.insert(field.name.clone(), json!(field.value));
    }
    if !fields.is_empty() {
        source.insert("fields".into(), Value::Object(fields));
    }
    let mut pairs: Map<String, Value> = Map::new();
    for (key, value) in header.key_values.iter().filter(|(k, _)| k != VALUE_SCALE && k != VALUE_OFFSET) {
        pairs.insert(key.clone(), json!(value));
    }
    if !pairs.is_empty() {
        source.insert("key_values".into(), Value::Object(pairs));
    }
    Value::Object(source)
}
