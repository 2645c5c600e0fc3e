//! Plans for people and as JSON.

use super::passes::sampler_text;
use super::{Plan, PlannedLevel, PlannedPass};
use crate::gpu::level::readable;
use serde_json::{Value, json};
use std::fmt::Write;

impl Plan {
    /// What is done, what it costs and what is left out, as text.
    #[must_use]
    pub fn explain(&self) -> String {
        let mut text = String::new();
        let [w, h] = self.view.size;
        let mut line = |label: &str, what: String| {
            let _ = writeln!(text, "{label:<11} {what}");
        };
        line("picture", format!("{w}×{h}, {}, {} by {}", self.key.lens, self.key.projection, self.key.traversal));
        line("sampler", sampler_text(&self.key));
        line("step", format!("{} world units, at most {} samples a ray", self.step, self.samples));
        let effects: Vec<_> = self.effects.iter().map(|e| e.name()).collect();
        line("effects", if effects.is_empty() { "none".into() } else { effects.join(", ") });
        for l in &self.levels {
            line("level", level_text(l));
        }
        for pass in &self.passes {
            line("pass", pass_text(pass));
            for b in &pass.bindings {
                line("", format!("  @group({}) @binding({}) {}: {}", b.group, b.binding, b.name, readable(b.bytes)));
            }
        }
        for (effect, why) in &self.left_out {
            line("left out", format!("{effect}: {why}"));
        }
        text
    }

    /// The same as JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "size": self.view.size,
            "lens": self.key.lens.name(),
            "projection": self.key.projection.name(),
            "traversal": self.key.traversal.name(),
            "sampler": self.key.sampler.name(),
            "step": self.step,
            "samples_per_ray": self.samples,
            "effects": self.effects.iter().map(|e| e.name()).collect::<Vec<_>>(),
            "levels": self.levels.iter().map(level_json).collect::<Vec<_>>(),
            "passes": self.passes.iter().map(pass_json).collect::<Vec<_>>(),
            "left_out": self.left_out.iter().map(|(e, why)| json!({ "effect": e.name(), "why": why })).collect::<Vec<_>>(),
        })
    }
}

fn level_text(l: &PlannedLevel) -> String {
    let all = l.wanted.bits().len();
    format!(
        "{} of volume {} ({}): {}; {}; {} of {all} bricks needed, {} with something to see",
        l.at.lod,
        l.volume,
        l.layout.extent,
        l.reason,
        readable(l.layout.bytes()),
        l.wanted.count(),
        l.visible.count(),
    )
}

fn pass_text(pass: &PlannedPass) -> String {
    let mut text = format!("{}{}: {}", pass.name, if pass.once { " (once)" } else { "" }, pass.files.join(" + "));
    for (i, f) in pass.fetches.iter().enumerate() {
        let _ = write!(text, "; volume {i}: {:.2} fetches ({:.1} bytes) a sample", f.value, f.value_bytes);
        if let Some(lit) = f.lit {
            let _ = write!(text, ", {lit:.2} where it is lit");
        }
    }
    text
}

fn level_json(l: &PlannedLevel) -> Value {
    json!({
        "volume": l.volume,
        "time": l.at.time,
        "channel": l.at.channel,
        "lod": l.at.lod,
        "dims": l.layout.extent.to_array(),
        "reason": l.reason,
        "bytes": l.layout.bytes(),
        "bricks": l.wanted.bits().len(),
        "bricks_needed": l.wanted.count(),
        "bricks_visible": l.visible.count(),
        "folded": l.key.folded,
    })
}

fn pass_json(pass: &PlannedPass) -> Value {
    let bindings = pass.bindings.iter();
    let fetches = pass.fetches.iter();
    json!({
        "name": pass.name,
        "files": pass.files,
        "once": pass.once,
        "bytes": pass.bytes(),
        "bindings": bindings
            .map(|b| json!({ "group": b.group, "binding": b.binding, "name": b.name, "bytes": b.bytes }))
            .collect::<Vec<_>>(),
        "fetches_per_sample": fetches
            .map(|f| json!({ "value": f.value, "lit": f.lit, "value_bytes": f.value_bytes }))
            .collect::<Vec<_>>(),
    })
}
