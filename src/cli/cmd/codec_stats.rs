//! `vug info --codec-stats`: null nodes, kept coefficients and bytes per stream of zerobit bricks, as JSON and as text.

use crate::cli::output::number;
use crate::codec::zerobit::{Stats, Stream, StreamBytes};
use crate::volume::{CodecStats, LevelStats};
use serde_json::{Value, json};

/// All of it.
pub(super) fn describe(s: &CodecStats) -> Value {
    json!({
        "stream": s.stream.name(),
        "lambda_asked": f64::from(s.params.keep_ppm()) / 1e6,
        "reference_voxels": s.reference_voxels(),
        "codebooks": s.codebooks,
        "codebook_bytes": s.codebook_bytes,
        "codebook_word_bytes": s.codebook_words,
        "level_0": level(s, &s.finest, s.reference_voxels()),
        // A selection is known of level 0 alone.
        "all_levels": level(s, &s.all, if s.params.selected > 0 { 0 } else { s.all.voxels }),
    })
}

/// `reference`: the voxels that λ refers to; 0 where they are not known.
fn level(s: &CodecStats, level: &LevelStats, reference: u64) -> Value {
    let stats = &level.stats;
    let optional = |v: Option<f64>| v.map_or(Value::Null, number);
    let lambda = (reference > 0).then(|| stats.coefficients() as f64 / reference as f64);
    json!({
        "voxels": level.voxels,
        "lambda": optional(lambda),
        "averages": stats.averages,
        "details": stats.details,
        "gamma_0": { "stored_cells": optional(stats.gamma_0(stats.stored_cells)), "all_cells": optional(stats.gamma_0(level.cells)) },
        "gamma_1": { "stored_cells": optional(stats.gamma_1(stats.stored_cells)), "all_cells": optional(stats.gamma_1(level.cells)) },
        "bricks": stats.payloads,
        "unit_blocks": stats.unit_blocks,
        "void_unit_blocks": stats.void_unit_blocks,
        "cells": level.cells,
        "stored_cells": stats.stored_cells,
        "null_cells": level.null_cells(),
        "payload_bytes": stats.payload_bytes,
        "stored_bytes": level.stored_bytes,
        "bytes": bytes(s.stream, stats),
        "other_stream": bytes(other(s.stream), stats),
        "as_in_the_paper": {
            "new": stats.new.as_in_the_paper(stats.unit_blocks),
            "old": stats.old.as_in_the_paper(stats.unit_blocks),
        },
    })
}

fn other(stream: Stream) -> Stream {
    if stream == Stream::New { Stream::Old } else { Stream::New }
}

/// Bytes by part; the parts of the old stream have other names.
fn bytes(stream: Stream, stats: &Stats) -> Value {
    let (b, names) = match stream {
        Stream::New => (&stats.new, ["cia", "zsms", "dis"]),
        Stream::Old => (&stats.old, ["offsets", "flags", "indices"]),
    };
    let StreamBytes { prefix, directory, cbft, records, significance, indices, padding } = *b;
    json!({
        "stream": stream.name(), "prefix": prefix, "directory": directory, "cbft": cbft,
        names[0]: records, names[1]: significance, names[2]: indices, "padding": padding, "total": b.total(),
    })
}

/// Two columns: level 0, and all levels.
pub(super) fn text(j: &Value) -> String {
    if j.is_null() {
        return "codec stats none: the volume has no zerobit bricks, and other codecs have no such numbers\n".into();
    }
    let percent = |v: &Value| v.as_f64().map_or_else(|| "-".into(), |v| format!("{:.3} %", 100.0 * v));
    let gamma = |v: &Value| {
        let share = |v: &Value| v.as_f64().map_or_else(|| "-".into(), |v| format!("{v:.3}"));
        format!("{} / {}", share(&v["stored_cells"]), share(&v["all_cells"]))
    };
    let columns = [&j["level_0"], &j["all_levels"]];
    let mut out = format!("codec stats zerobit, stream {}\n", j["stream"].as_str().unwrap_or(""));
    let mut row = |name: &str, f: &dyn Fn(&Value) -> String| {
        out += &format!("  {name:<34}{:>18}{:>18}\n", f(columns[0]), f(columns[1]));
    };
    let plain = |key: &'static str| move |v: &Value| v[key].to_string();
    row("", &|v| if std::ptr::eq(v, columns[0]) { "level 0".into() } else { "all levels".into() });
    row("kept coefficients asked", &|_| percent(&j["lambda_asked"]));
    row("kept coefficients", &|v| percent(&v["lambda"]));
    row("averages", &plain("averages"));
    row("details", &plain("details"));
    row("γ0 (null nodes), stored/all cells", &|v| gamma(&v["gamma_0"]));
    row("γ1 (null nodes), stored/all cells", &|v| gamma(&v["gamma_1"]));
    row("unit blocks, void", &|v| format!("{}, {}", v["unit_blocks"], v["void_unit_blocks"]));
    row("cells, null", &|v| format!("{}, {}", v["cells"], v["null_cells"]));
    let parts: &[(&str, &'static str)] = if j["stream"] == "new" {
        &[("CIA", "cia"), ("ZSMS", "zsms"), ("DIS", "dis")]
    } else {
        &[("offsets", "offsets"), ("flags", "flags"), ("indices", "indices")]
    };
    let frame = [("prefixes", "prefix"), ("directories (NNNC)", "directory"), ("CBFT", "cbft")];
    for &(name, key) in frame.iter().chain(parts).chain(&[("padding", "padding"), ("payloads", "total")]) {
        row(&format!("bytes: {name}"), &|v| v["bytes"][key].to_string());
    }
    row("bytes: payloads in the file", &plain("stored_bytes"));
    let unused = j["level_0"]["other_stream"]["stream"].as_str().unwrap_or("");
    row(&format!("bytes: payloads, {unused} stream"), &|v| v["other_stream"]["total"].to_string());
    row("bytes as the paper counts, new", &|v| v["as_in_the_paper"]["new"].to_string());
    row("bytes as the paper counts, old", &|v| v["as_in_the_paper"]["old"].to_string());
    out += &format!("  codebooks: {}, {} bytes\n", j["codebooks"], j["codebook_bytes"]);
    out
}
