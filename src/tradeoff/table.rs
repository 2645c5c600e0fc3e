//! Rows as text: one list of columns for CSV, JSON and pages.

use super::Row;
use crate::metrics::ErrorClass;
use serde_json::{Map, Value, json};

/// A value of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A name.
    Text(String),
    /// A number; may be infinite.
    Number(f64),
    /// A whole number.
    Count(u64),
    /// Yes or no.
    Flag(bool),
    /// Not known, or without meaning.
    Nothing,
}

/// A column: its name, what it means, and how to find it.
#[derive(Clone, Copy)]
pub struct Column {
    /// Name in CSV and JSON.
    pub name: &'static str,
    /// What it is, with its unit.
    pub meaning: &'static str,
    /// Its value.
    pub cell: fn(&Row) -> Cell,
}

fn maybe(v: Option<f64>) -> Cell {
    v.map_or(Cell::Nothing, Cell::Number)
}

fn class(row: &Row, class: ErrorClass) -> Cell {
    Cell::Count(row.error.classes[class as usize])
}

macro_rules! columns {
    ($($name:ident: $meaning:literal => $cell:expr;)*) => {
        &[$(Column { name: stringify!($name), meaning: $meaning, cell: $cell },)*]
    };
}

/// All columns.
pub const COLUMNS: &[Column] = columns! {
    setting: "what the volume is stored as" => |r| Cell::Text(r.encoded.setting.name());
    index_bits: "bits per index" => |r| r.encoded.setting.index_bits().map_or(Cell::Nothing, |v| Cell::Count(v.into()));
    block: "longest edge of a block in voxels" => |r| r.encoded.setting.block().map_or(Cell::Nothing, |v| Cell::Count(v.into()));
    sampler: "how a value between voxels is found" => |r| Cell::Text(r.shot.sampler.to_string());
    source: "what is sampled: payload bytes (direct), a decoded texture (deferred)" => |r| Cell::Text(r.shot.source.to_string());
    step: "distance of samples in units of the smallest spacing" => |r| Cell::Number(r.shot.step);
    ratio_formula: "original bytes / bytes by the paper's formula" => |r| Cell::Number(r.encoded.ratio_formula);
    ratio_payload: "original bytes / payload bytes; bricks of one value take none" => |r| Cell::Number(r.encoded.ratio_payload);
    bits_per_voxel: "bits of payload per voxel" => |r| Cell::Number(r.encoded.bits_per_voxel);
    volume_max_error: "largest error of a voxel, in sample units" => |r| Cell::Number(r.encoded.max_error);
    volume_rmse: "root mean squared error of voxels, in sample units" => |r| Cell::Number(r.encoded.rmse);
    volume_psnr: "PSNR of voxels in dB, peak = range of the volume" => |r| maybe(r.encoded.psnr);
    error_gradient_correlation: "correlation of voxel error and gradient length" => |r| maybe(r.encoded.concentration);
    fetches_per_sample: "texture fetches per sample" => |r| maybe(r.fetches_per_sample);
    ms: "median time of a frame in milliseconds" => |r| Cell::Number(r.seconds[0] * 1e3);
    ms_min: "shortest frame in milliseconds" => |r| Cell::Number(r.seconds[1] * 1e3);
    ms_max: "longest frame in milliseconds" => |r| Cell::Number(r.seconds[2] * 1e3);
    frames: "how many frames were timed" => |r| Cell::Count(r.frames as u64);
    mse_per_channel: "picture: squared error / (pixels × 3)" => |r| Cell::Number(r.error.errors.mse());
    mse_per_pixel: "picture: squared error / pixels, as the paper words it" => |r| Cell::Number(r.error.errors.mse_per_pixel());
    psnr: "picture: PSNR in dB of the MSE per channel, peak 255; inf: equal" => |r| Cell::Number(r.error.psnr);
    psnr_per_pixel: "picture: PSNR in dB of the MSE per pixel; inf: equal" => |r| Cell::Number(r.error.psnr_per_pixel);
    max_error: "picture: largest channel error, of 255" => |r| Cell::Count(r.error.errors.max.into());
    ssim: "picture: SSIM, mean of R, G, B" => |r| Cell::Number(r.error.ssim.mean);
    ssim_geometric: "picture: SSIM, geometric mean of R, G, B" => |r| Cell::Number(r.error.ssim.geometric);
    ms_ssim: "picture: MS-SSIM, mean of R, G, B" => |r| Cell::Number(r.error.ms_ssim.mean);
    ms_ssim_scales: "scales that MS-SSIM took, of 5" => |r| Cell::Count(r.error.ms_ssim_scales as u64);
    flip: "picture: mean FLIP error, 0 to 1" => |r| maybe(r.flip);
    pixels_exact: "pixels without error" => |r| class(r, ErrorClass::Exact);
    pixels_below_5: "pixels with an error below 5 %" => |r| class(r, ErrorClass::Small);
    pixels_5_to_10: "pixels with an error from 5 to below 10 %" => |r| class(r, ErrorClass::Medium);
    pixels_10_to_15: "pixels with an error from 10 to below 15 %" => |r| class(r, ErrorClass::Large);
    pixels_from_15: "pixels with an error of 15 % and more" => |r| class(r, ErrorClass::Bad);
    identical: "whether the picture equals the reference" => |r| Cell::Flag(r.error.identical());
    pareto: "whether no other row is faster and closer (ms, mse_per_channel)" => |r| Cell::Flag(r.pareto);
};

impl Cell {
    /// As a field of CSV (RFC 4180): text with commas or quotes in quotes, infinity as `inf`, nothing as nothing.
    #[must_use]
    pub fn csv(&self) -> String {
        match self {
            Cell::Text(t) if t.contains([',', '"', '\n', '\r']) => format!("\"{}\"", t.replace('"', "\"\"")),
            Cell::Text(t) => t.clone(),
            Cell::Number(v) => v.to_string(),
            Cell::Count(v) => v.to_string(),
            Cell::Flag(v) => v.to_string(),
            Cell::Nothing => String::new(),
        }
    }

    /// As JSON; numbers that JSON does not have are null.
    #[must_use]
    pub fn json(&self) -> Value {
        match self {
            Cell::Text(t) => json!(t),
            Cell::Number(v) => serde_json::Number::from_f64(*v).map_or(Value::Null, Value::Number),
            Cell::Count(v) => json!(v),
            Cell::Flag(v) => json!(v),
            Cell::Nothing => Value::Null,
        }
    }
}

/// Rows as CSV, with a line of names.
#[must_use]
pub fn csv(rows: &[Row]) -> String {
    let line = |fields: Vec<String>| fields.join(",") + "\r\n";
    let mut out = line(COLUMNS.iter().map(|c| c.name.to_owned()).collect());
    rows.iter().for_each(|r| out.push_str(&line(COLUMNS.iter().map(|c| (c.cell)(r).csv()).collect())));
    out
}

/// Rows as a JSON array of objects.
#[must_use]
pub fn json(rows: &[Row]) -> Value {
    let object = |r: &Row| COLUMNS.iter().map(|c| (c.name.to_owned(), (c.cell)(r).json())).collect::<Map<_, _>>();
    rows.iter().map(object).map(Value::Object).collect()
}
