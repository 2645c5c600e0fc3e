//! `vug info`: what a file holds.

use super::codec_stats;
use crate::cli::args::Info;
use crate::cli::open::open_volume;
use crate::cli::output::{Verdict, bytes_text, number, small_text};
use crate::codec::{Codec, s3dc};
use crate::error::Result;
use crate::metrics::psnr;
use crate::volume::{BrickCounts, Volume};
use serde_json::{Value, json};

pub(super) fn run(args: &Info) -> Result<Verdict> {
    let volume = open_volume(&args.file)?;
    let bricks = volume.brick_counts()?;
    let mut json = describe(&volume, &bricks)?;
    if args.codec_stats {
        json["codec_stats"] = volume.codec_stats()?.as_ref().map_or(Value::Null, codec_stats::describe);
    }
    if args.common.json {
        println!("{json:#}");
    } else {
        print!("{}", text(&json));
        if args.codec_stats {
            print!("{}", codec_stats::text(&json["codec_stats"]));
        }
    }
    Ok(Verdict::Ok)
}

fn describe(volume: &Volume, bricks: &BrickCounts) -> Result<Value> {
    let d = volume.info();
    let voxels = d.dims.voxels() as f64 * f64::from(d.time_steps) * f64::from(d.channels);
    let original = voxels * d.sample_type.bytes() as f64;
    let bytes = volume.file_len();
    // As the encoder reports it: payloads are nothing without their codebooks.
    let section = volume.head().section(*b"CBOK");
    let books = section.map_or(0, |s| s.stored_len);
    let mut names = Vec::new();
    let (mut formula, mut padded) = (Value::Null, Value::Null);
    let mut parameters = Vec::new();
    for entry in &d.codecs {
        match Codec::from_wire(entry.id, entry.stream_version, &entry.params, d.null_sample()) {
            Ok(Codec::Raw) => {
                names.push("raw".to_owned());
                formula = json!(1.0);
                parameters.push(json!({ "codec": "raw" }));
            }
            Ok(Codec::S3dc(p)) => {
                names.push("s3dc".to_owned());
                let s_bits = 8 * d.sample_type.bytes() as u32;
                formula = number(s3dc::formula_ratio(d.dims, s_bits, &p));
                padded = number(s3dc::padded_ratio(d.dims, s_bits, &p));
                parameters.push(json!({
                    "codec": "s3dc", "index_bits": p.i_bits(), "block": p.block().to_array(),
                    "endpoints": p.endpoints().name(),
                }));
            }
            Ok(Codec::Zerobit(z)) => {
                let p = z.params();
                names.push("zerobit".to_owned());
                parameters.push(json!({
                    "codec": "zerobit", "stream": z.stream().name(), "keep": f64::from(p.keep_ppm()) / 1e6,
                    "threshold": p.threshold.name(), "norm": p.norm.name(), "training": p.training.name(),
                    "selected_voxels": (p.selected > 0).then_some(p.selected),
                }));
            }
            Err(e) => {
                names.push(format!("unknown {}", entry.id));
                parameters
                    .push(json!({ "codec": entry.id, "stream_version": entry.stream_version, "error": e.to_string() }));
            }
        }
    }
    if names.len() > 1 {
        (formula, padded) = (Value::Null, Value::Null); // one formula cannot speak for several codecs
    }
    let p = &d.placement;
    let psnr = d.achieved.and_then(|a| psnr(d.source_range.1 - d.source_range.0, a.rmse));
    Ok(json!({
        "dims": d.dims.to_array(),
        "sample_type": d.sample_type.name(),
        "channels": d.channels,
        "time_steps": d.time_steps,
        "times": volume.times()?.map(|t| json!({ "unit": t.unit.name(), "interval": t.interval(), "steps": t.steps })),
        "layout": if volume.head().commit.is_some() { "log" } else { "head" },
        "unfinished_bytes": volume.head().unfinished(),
        "codec": names.join("+"),
        "codecs": parameters,
        "codebooks": section.map_or(0, |s| s.item_count),
        "levels": d.lod_count,
        "downsample": if d.lod_count > 1 { json!(d.downsample.name()) } else { Value::Null },
        "level_dims": volume.levels().map(|e| e.to_array()).collect::<Vec<_>>(),
        "spacing": if p.spacing_unknown { Value::Null } else { json!(p.spacing()) },
        "unit": p.unit.name(),
        "origin": p.origin(),
        "affine": p.matrix,
        "space": p.space.name(),
        "value_scale": d.value_map.scale,
        "value_offset": d.value_map.offset,
        "null_value": d.null_sample().to_string(),
        "range": [d.source_range.0, d.source_range.1],
        "brick": 1u32 << d.brick_log2,
        "bricks": { "total": bricks.total, "stored": bricks.stored, "constant": bricks.constant, "empty": bricks.empty },
        "bytes": bytes,
        "bits_per_voxel": number(bytes as f64 * 8.0 / voxels),
        "ratio": { "formula": formula, "padded": padded, "payload": number(original / (d.payload_bytes + books) as f64), "file": number(original / bytes as f64) },
        "max_error": d.achieved.map(|a| a.max_error),
        "mean_error": d.achieved.map(|a| a.mean_error),
        "rmse": d.achieved.map(|a| a.rmse),
        "psnr": psnr.map(number),
        "replaced": d.replaced,
        "zstd": bricks.zstd > 0,
        "file_id": format!("{:032x}", u128::from_be_bytes(volume.head().superblock.file_id)),
        "scene": volume.scene()?,
        "meta": volume.meta()?.map(|t| serde_json::from_str::<Value>(&t).unwrap_or(Value::String(t))),
    }))
}

fn text(j: &Value) -> String {
    let list = |v: &Value| v.as_array().map_or_else(|| "unknown".into(), |a| join(a, " × "));
    let num = |v: &Value| v.as_f64().map_or_else(|| "-".to_owned(), |x| format!("{x:.3}"));
    let name = |v: &Value| v.as_str().unwrap_or("").to_owned();
    let codec = j["codecs"].as_array().into_iter().flatten().map(|c| {
        if let Some(bits) = c["index_bits"].as_u64() {
            format!("s3dc, {bits} bits, blocks of {}, {}", list(&c["block"]), name(&c["endpoints"]))
        } else if let Some(keep) = c["keep"].as_f64() {
            let selected = c["selected_voxels"].as_u64().map_or(String::new(), |n| format!(" of {n} selected voxels"));
            let [stream, threshold, norm, training] =
                ["stream", "threshold", "norm", "training"].map(|key| name(&c[key]));
            format!(
                "zerobit, {} % kept{selected}, stream {stream}, threshold {threshold}, norm {norm}, training {training}, \
                 {} codebook(s)",
                (keep * 1e6).round() / 1e4,
                j["codebooks"]
            )
        } else {
            c["codec"].to_string().replace('"', "")
        }
    });
    let codec: Vec<String> = codec.collect();
    let b = &j["bricks"];
    let error = match j["max_error"].as_f64() {
        Some(e) => {
            let small = |v: &Value| v.as_f64().map_or("unknown".into(), small_text);
            format!("max {e}, mean {}, RMSE {}, PSNR {}", small(&j["mean_error"]), small(&j["rmse"]), psnr_of(j))
        }
        None => "unknown".into(),
    };
    format!(
        "volume      {} {} (x, y, z), {} channel(s), {} time step(s){}\n\
         values      {} … {}, null {}, × {} + {}\n\
         spacing     {} {} (x, y, z), space {}\n\
         origin      {}\n\
         codec       {}{}\n\
         levels      {}{}\n\
         bricks      {} of {}³: {} stored, {} constant, {} empty\n\
         layout      {}\n\
         size        {} ({} bits per voxel)\n\
         ratio       {} formula, {} payload, {} file\n\
         error       {error}\n\
         scene       {}\n\
         file id     {}\n",
        list(&j["dims"]),
        j["sample_type"].as_str().unwrap_or(""),
        j["channels"],
        j["time_steps"],
        times_text(&j["times"]),
        j["range"][0],
        j["range"][1],
        j["null_value"].as_str().unwrap_or(""),
        j["value_scale"],
        j["value_offset"],
        list(&j["spacing"]),
        j["unit"].as_str().unwrap_or(""),
        j["space"].as_str().unwrap_or(""),
        j["origin"].as_array().map_or_else(String::new, |a| join(a, ", ")),
        codec.join("; "),
        if j["zstd"] == true { ", zstd" } else { "" },
        j["levels"],
        j["downsample"].as_str().map_or(String::new(), |operator| format!(", by {operator}")),
        b["total"],
        j["brick"],
        b["stored"],
        b["constant"],
        b["empty"],
        match j["unfinished_bytes"].as_u64() {
            Some(behind @ 1..) => format!("log, unfinished: {behind} bytes follow the last commit"),
            _ => j["layout"].as_str().unwrap_or("").to_owned(),
        },
        bytes_text(j["bytes"].as_u64().unwrap_or(0)),
        num(&j["bits_per_voxel"]),
        num(&j["ratio"]["formula"]),
        num(&j["ratio"]["payload"]),
        num(&j["ratio"]["file"]),
        j["scene"]
            .as_str()
            .map_or("none stored".into(), |t| format!("stored, {} lines: vug render shows it", t.lines().count())),
        j["file_id"].as_str().unwrap_or(""),
    )
}

/// From when to when, and how far apart.
fn times_text(times: &Value) -> String {
    let Some([first, .., last]) = times["steps"].as_array().map(Vec::as_slice) else { return String::new() };
    let unit = times["unit"].as_str().unwrap_or("");
    let apart = times["interval"].as_f64().map_or(String::new(), |interval| format!(", {interval} {unit} apart"));
    format!(": {first} … {last} {unit}{apart}")
}

fn join(values: &[Value], separator: &str) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join(separator)
}

fn psnr_of(j: &Value) -> String {
    match (j["psnr"].as_f64(), j["max_error"].as_f64()) {
        (Some(db), _) => format!("{db:.2} dB"),
        (None, Some(0.0)) => "inf (lossless)".into(),
        _ => "undefined".into(),
    }
}
