//! The passes of a plan: what runs, what it is bound to, what a sample costs in it.

use super::PlannedLevel;
use super::fetches::{Fetches, fetches};
use crate::gpu::key::Form;
use crate::gpu::layout::{Frame, VolumeParams};
use crate::gpu::level::{Fit, Role, Store};
use crate::gpu::shader::{Binding, BindingKind};
use crate::gpu::{PipelineKey, Sampler, Traversal};
use crate::render::scene::Scene;

/// One pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedPass {
    /// Its name: also that of its entry point.
    pub name: &'static str,
    /// The shader files that its text is made of.
    pub files: Vec<&'static str>,
    /// Whether it runs once, not for each picture.
    pub once: bool,
    /// What is bound, and how many bytes each binding holds.
    pub bindings: Vec<PlannedBinding>,
    /// Texels that a sample fetches, by volume; empty where that depends on the data, or there are no samples.
    pub fetches: Vec<Fetches>,
}

/// A texture, buffer or sampler of a pass.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlannedBinding {
    /// Bind group.
    pub group: u32,
    /// Number in the group.
    pub binding: u32,
    /// Variable of the shader.
    pub name: &'static str,
    /// Bytes; 0 for samplers.
    pub bytes: u64,
}

/// Pixels of a band: enough for a device to be busy, few enough that progress can be told.
const BAND_PIXELS: u32 = 1 << 20;

/// Rows of the picture that are rendered at a time: 16 bytes of a pixel are one binding, and slices one texture.
pub(in crate::render) fn band_rows([width, height]: [u32; 2], fit: &Fit) -> u32 {
    let most = u32::try_from(fit.max_binding / (16 * u64::from(width.max(1)))).unwrap_or(u32::MAX);
    (BAND_PIXELS / width.max(1)).max(8).min(most.max(1)).min(fit.max_2d).min(height)
}

/// All passes of a scene, in order.
pub(super) fn passes(key: &PipelineKey, scene: &Scene, levels: &[PlannedLevel], fit: &Fit) -> Vec<PlannedPass> {
    let mut passes: Vec<PlannedPass> = levels.iter().filter_map(decode).collect();
    let rows = band_rows(scene.size, fit);
    let pixels = u64::from(scene.size[0]) * u64::from(rows);
    let bindings = key.bindings().iter().map(|b| planned(b, pixels, levels)).collect();
    passes.push(PlannedPass {
        name: key.entry(),
        files: key.files(),
        once: false,
        bindings,
        fetches: levels.iter().filter_map(|l| fetches(scene, &l.layout)).collect(),
    });
    passes
}

/// The pass that decodes a level on the device.
fn decode(level: &PlannedLevel) -> Option<PlannedPass> {
    let decoded = level.layout.decoded?;
    let name = match level.layout.store {
        Store::S3dc { .. } => "decode_s3dc",
        _ => "decode_zerobit",
    };
    let mut bindings: Vec<PlannedBinding> = Vec::new();
    let mut add = |name, bytes| {
        let binding = bindings.len() as u32;
        bindings.push(PlannedBinding { group: 0, binding, name, bytes });
    };
    for t in &level.layout.textures {
        add(if t.role == Role::Index { "index" } else { "minmax" }, t.bytes());
    }
    if let Some(pages) = level.layout.pages {
        add("table", pages.table_bytes);
        add("books", pages.book_bytes);
        add("pages", pages.stream_bytes);
    }
    add("decoded", decoded.bytes());
    Some(PlannedPass { name, files: vec![name], once: true, bindings, fetches: Vec::new() })
}

fn planned(b: &Binding, pixels: u64, levels: &[PlannedLevel]) -> PlannedBinding {
    let level = b.group.checked_sub(1).and_then(|v| levels.get(v as usize));
    let bytes = match (b.name, level) {
        ("frame", _) => size_of::<Frame>() as u64,
        ("picture", _) => pixels * 16,
        ("volume", _) => size_of::<VolumeParams>() as u64,
        ("visible", Some(level)) => level.visible.bits().len() as u64,
        (name, Some(PlannedLevel { layout, .. })) => {
            let role = match name {
                "index" => Role::Index,
                "minmax" => Role::Minmax,
                _ => Role::Raw,
            };
            let texture = layout.decoded.iter().chain(&layout.textures).find(|t| t.role == role);
            match (layout.pages.filter(|_| layout.decoded.is_none()), name) {
                (Some(pages), "table") => pages.table_bytes,
                (Some(pages), "books") => pages.book_bytes,
                (Some(pages), name) if name.starts_with("page") => pages.stream_bytes.min(pages.page_bytes),
                _ if b.kind == BindingKind::Sampler => 0,
                _ => texture.map_or(0, |t| t.bytes()),
            }
        }
        _ => 0,
    };
    PlannedBinding { group: b.group, binding: b.binding, name: b.name, bytes }
}

impl PlannedPass {
    /// Bytes of all bindings.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bindings.iter().map(|b| b.bytes).sum()
    }
}

/// What pays for a sampler, in words.
pub(super) fn sampler_text(key: &PipelineKey) -> String {
    let forms: Vec<&str> = key
        .volumes
        .iter()
        .map(|v| match v.form {
            Form::Raw(_) => "uncompressed texels",
            Form::S3dc(_) => "s3dc texels as stored",
            Form::Zerobit { .. } => "zerobit streams as stored",
        })
        .collect();
    let how = match (key.sampler, key.traversal) {
        (_, Traversal::CutPlane) => "one sample per pixel",
        (Sampler::HwLinear, _) => "filtered by the texture unit",
        _ => "texel by texel",
    };
    format!("{} on {}, {how}", key.sampler, forms.join(" and "))
}
