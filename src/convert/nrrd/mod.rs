//! NRRD ("nearly raw raster data", Teem; magic NRRD0001 to NRRD0005), attached and detached headers.
//!
//! No crate reads it, so this is a small reader of our own. It takes what volumes need (raw, gzip, bzip2 and text
//! encodings, line and byte skip, both byte orders, spacings and space directions, axes of time and channels) and refuses the
//! rest by name: hex encoding, lists of data files, blocks, light fields.

mod axes;
mod data;
mod fields;
mod geometry;
mod header;
mod order;
mod text;
mod times;
mod write;

pub(super) use write::{write_attached, write_data, write_header};

use super::stored::Kind;
use super::{Format, Import, ImportOptions, Probe, fault, payload};
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
    let opened = data::locate(path, &header, &axes, len, options)?.open(path, options.dtype)?;
    Ok(Import {
        placement,
        times: times::read(&header, &axes),
        labels: is_labels(&header, axes.kind),
        value_map,
        ..Import::plain(opened, Format::Nrrd, kept(&header))
    })
}

/// What the header says of the samples.
pub(super) fn probe(path: &Path, options: &ImportOptions) -> Result<Probe> {
    let (file, len) = payload::open(path)?;
    let header = header::read(path, file, len)?;
    let axes = axes::read(path, &header, options.dtype)?;
    Ok(Probe { kind: axes.kind, layout: axes.layout, value_map: value_map(path, &header)? })
}

/// Whether this is a segmentation of 3D Slicer: integers that number segments. Its fractional ones are shares.
fn is_labels(header: &Header, kind: Kind) -> bool {
    let pair = |key: &str| header.key_values.iter().find(|(k, _)| k == key).map_or("", |(_, value)| value.as_str());
    let segmentation = header.key_values.iter().any(|(k, _)| k.starts_with("Segmentation_"));
    let fractional = ["Segmentation_SourceRepresentation", "Segmentation_MasterRepresentation"]
        .iter()
        .any(|key| pair(key).starts_with("Fractional"));
    let integers = !matches!(kind, Kind::F32 | Kind::F64 | Kind::Rgb8);
    integers && (segmentation && !fractional || pair("DataNodeClassName") == "vtkMRMLLabelMapVolumeNode")
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
