//! The shader of a picture: structures, then for each volume source, sampler and what the scene asks for, then the traversal.

use super::compose::{Choice, compose};
use super::key::{Effect, Form, Gradient, Lens, PipelineKey, Projection, Sampler, Texel, Traversal, VolumeKey};
use super::layout::{Frame, Point, VolumeParams};
use crate::error::{Error, Result};

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        /// All shader files by name, and their text.
        pub const FILES: &[(&str, &str)] = &[$(($name, include_str!(concat!("../../shaders/", $name, ".wgsl")))),*];
    };
}

files! {
    "camera", "cut_plane", "decode", "fold", "gradient", "gradient_reuse", "iso", "opacity", "raycast", "sample_hw_linear",
    "sample_linear", "sample_linear_opt", "sample_nearest", "shade", "skip", "slice", "source_raw", "source_s3dc",
    "source_zerobit", "transfer",
}

/// The text of a file of [`FILES`].
pub(super) fn file(name: &str) -> &'static str {
    FILES.iter().find(|(n, _)| *n == name).map_or_else(|| panic!("no shader {name}"), |(_, text)| text)
}

/// What a texture or buffer is to a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// Uniform buffer.
    Uniform,
    /// Storage buffer that is written.
    Written,
    /// Storage buffer that is read.
    Read,
    /// 3D texture, loaded texel by texel.
    Texture(Texel),
    /// 3D texture of floats, filtered.
    Filtered,
    /// Sampler.
    Sampler,
}

/// A binding of a picture's shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Bind group: 0 the frame, 1 + v volume v.
    pub group: u32,
    /// Number in the group.
    pub binding: u32,
    /// The variable, without the volume's suffix.
    pub name: &'static str,
    /// What it is.
    pub kind: BindingKind,
}

/// First binding of zerobit streams.
pub const PAGE_BINDING: u32 = 5;

/// Variables of zerobit streams: as many buffers as a level can have.
const PAGES: [&str; 16] = [
    "page0", "page1", "page2", "page3", "page4", "page5", "page6", "page7", "page8", "page9", "page10", "page11",
    "page12", "page13", "page14", "page15",
];

/// Most storage buffers of streams of a level.
pub const MAX_PAGES: u32 = PAGES.len() as u32;

impl PipelineKey {
    /// Checks that the parts go together.
    ///
    /// # Errors
    /// `E_PARAM`, naming what does not.
    pub fn check(&self) -> Result<()> {
        let bad = |field, message: &str| Err(Error::param(field, message.to_owned()));
        if self.volumes.is_empty() || self.volumes.len() > super::key::MAX_VOLUMES {
            return bad("volumes", "a scene has one to three volumes");
        }
        if self.projection == Projection::Iso && (self.volumes.len() > 1 || self.traversal != Traversal::Raycast) {
            return bad("projection", "iso-surfaces are found by rays through one volume");
        }
        if self.traversal == Traversal::Slice && self.projection != Projection::Composite {
            return bad("traversal", "slices are blended: their projection is composite");
        }
        if self.traversal == Traversal::CutPlane && self.projection != Projection::Composite {
            return bad("traversal", "a cutting plane has one sample per pixel: its projection is composite");
        }
        let alike = |a: &VolumeKey, b: &VolumeKey| a.with_pages(0) == b.with_pages(0);
        if self.effects.has(Effect::TimeInterp)
            && (self.volumes.len() != 2 || !alike(&self.volumes[0], &self.volumes[1]))
        {
            return bad("time", "between time steps there is one volume, at two steps");
        }
        for v in &self.volumes {
            if matches!(v.form, Form::Zerobit { pages, .. } if pages > MAX_PAGES) {
                return bad(
                    "source",
                    "the streams of this level take too many buffers: take a coarser level, or source = \"decoded\"",
                );
            }
            match self.sampler {
                Sampler::HwLinear if !matches!(v.form, Form::Raw(Texel::Float)) => {
                    return bad(
                        "sampler",
                        "hw_linear filters textures of numbers that the texture unit knows: add source = \"deferred\" or \"decoded\"",
                    );
                }
                Sampler::HwLinear if v.folded => {
                    return bad(
                        "sampler",
                        "hw_linear does not go with a level in tiles: take linear, or a coarser level",
                    );
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// The sampler's file for a volume: `linear_opt` saves fetches of s3dc only; elsewhere it is `linear`.
    fn sampler_file(&self, v: &VolumeKey) -> &'static str {
        match (self.sampler, v.form) {
            (Sampler::Nearest, _) => "sample_nearest",
            (Sampler::LinearOpt, Form::S3dc(_)) => "sample_linear_opt",
            (Sampler::Linear | Sampler::LinearOpt, _) => "sample_linear",
            (Sampler::HwLinear, _) => "sample_hw_linear",
        }
    }

    fn gradient_file(&self, v: &VolumeKey) -> &'static str {
        match (self.gradient, self.sampler, v.form) {
            (Gradient::Reuse, Sampler::Linear | Sampler::LinearOpt, Form::S3dc(_)) => "gradient_reuse",
            _ => "gradient",
        }
    }

    /// Volumes that are seen: of two time steps, what lies between them is one.
    #[must_use]
    pub fn shown(&self) -> usize {
        if self.effects.has(Effect::TimeInterp) { 1 } else { self.volumes.len() }
    }

    /// What a volume is at a place, and its gradient there: for two time steps, between them.
    fn values(&self) -> String {
        let mut text = String::new();
        for (i, v) in self.volumes.iter().take(self.shown()).enumerate() {
            let value = if v.colour { "vec3f" } else { "f32" };
            let mut function = |name: &str, of: &str, result: &str| {
                let body = match self.effects.has(Effect::TimeInterp) {
                    true => format!("let before = {of}_0(p);\n    return before + ({of}_1(p) - before) * frame.time;"),
                    false => format!("return {of}_{i}(p);"),
                };
                text.push_str(&format!("fn {name}_{i}(p: vec3f) -> {result} {{\n    {body}\n}}\n"));
            };
            function("value", "sample", value);
            if self.shades() {
                function("slope", "gradient", "vec3f");
            }
        }
        text
    }

    fn shades(&self) -> bool {
        self.effects.has(Effect::GradientShading)
            && self.traversal != Traversal::CutPlane
            && matches!(self.projection, Projection::Composite | Projection::Iso)
    }

    fn skips(&self) -> bool {
        self.effects.has(Effect::EmptySkip)
            && self.traversal == Traversal::Raycast
            && matches!(self.projection, Projection::Composite | Projection::Iso)
    }

    /// Files that each volume has for itself, in the order of the text.
    fn volume_files(&self, v: &VolumeKey) -> Vec<&'static str> {
        let mut files = Vec::new();
        if v.folded {
            files.push("fold");
        }
        match v.form {
            Form::Raw(_) if self.sampler == Sampler::HwLinear => {}
            Form::Raw(_) => files.push("source_raw"),
            Form::S3dc(_) => files.push("source_s3dc"),
            Form::Zerobit { .. } => files.push("source_zerobit"),
        }
        files.push(self.sampler_file(v));
        files.push("transfer");
        if self.shades() {
            files.push(self.gradient_file(v));
        }
        if self.skips() {
            files.push("skip");
        }
        files
    }

    /// The names of the files that the text is made of.
    #[must_use]
    pub fn files(&self) -> Vec<&'static str> {
        let mut files = vec!["camera"];
        for v in &self.volumes {
            for file in self.volume_files(v) {
                if !files.contains(&file) {
                    files.push(file);
                }
            }
        }
        if self.shades() {
            files.push("shade");
        }
        if self.projection == Projection::Composite && self.traversal != Traversal::CutPlane {
            files.push("opacity");
        }
        match self.traversal {
            Traversal::Raycast => files.push("raycast"),
            Traversal::Slice => files.push("slice"),
            Traversal::CutPlane => files.push("cut_plane"),
        }
        if self.projection == Projection::Iso {
            files.push("iso");
        }
        files
    }

    fn choice(&self) -> Choice {
        let mut choice = Choice::default();
        let mut flag = |name: &'static str, set: bool| {
            if set {
                choice.flags.insert(name);
            }
        };
        flag("perspective", self.lens == Lens::Perspective);
        flag("composite", self.projection == Projection::Composite);
        flag("extreme", matches!(self.projection, Projection::Maximum | Projection::Minimum));
        flag("maximum", self.projection == Projection::Maximum);
        flag("mean", self.projection == Projection::Mean);
        flag("many", self.shown() > 1);
        flag("gradient_shading", self.shades());
        flag("empty_skip", self.skips());
        flag("early_out", self.effects.has(Effect::EarlyOut) && self.projection == Projection::Composite);
        flag("clip_box", self.effects.has(Effect::ClipBox));
        let each = |f: fn(usize) -> String| (0..self.shown()).map(f).collect::<Vec<_>>().join(", ");
        choice.words = vec![
            ("ARGUMENTS", each(|v| format!("origin_{v}, direction_{v}, span_{v}"))),
            ("PARAMETERS", each(|v| format!("origin_{v}: vec3f, direction_{v}: vec3f, span_{v}: vec2f"))),
        ];
        choice.volumes = self.volumes.iter().enumerate().map(|(i, v)| v.choice(i)).take(self.shown()).collect();
        choice
    }

    /// The shader's text.
    ///
    /// # Panics
    /// Where a file of `shaders/` has directives that do not pair up, which a test excludes.
    #[must_use]
    pub fn wgsl(&self) -> String {
        let choice = self.choice();
        let mut each = choice.clone();
        each.volumes = self.volumes.iter().enumerate().map(|(i, v)| v.choice(i)).collect();
        let take_own = |name: &str, i| compose(name, file(name), &each, Some(i)).expect("directives pair up");
        let take = |name: &str| compose(name, file(name), &choice, None).expect("directives pair up");
        let mut text = [Frame::WGSL, Point::WGSL, VolumeParams::WGSL].concat();
        text.push_str("@group(0) @binding(0) var<uniform> frame: Frame;\n");
        if self.traversal != Traversal::Slice {
            text.push_str("@group(0) @binding(1) var<storage, read_write> picture: array<vec4f>;\n");
        }
        for (i, v) in self.volumes.iter().enumerate() {
            text.push_str(&format!("@group({}) @binding(0) var<uniform> volume_{i}: VolumeParams;\n", i + 1));
            text.push_str(&format!("override BRICK_LOG2_{i}: u32 = 5u;\n"));
            for name in self.volume_files(v) {
                text.push_str(&take_own(name, i));
            }
        }
        text.push_str(&self.values());
        let own: Vec<&str> = self.volumes.iter().flat_map(|v| self.volume_files(v)).collect();
        for name in self.files() {
            if !own.contains(&name) {
                text.push_str(&take(name));
            }
        }
        text
    }

    /// The bindings of the text, in order.
    #[must_use]
    pub fn bindings(&self) -> Vec<Binding> {
        let mut all = vec![Binding { group: 0, binding: 0, name: "frame", kind: BindingKind::Uniform }];
        if self.traversal != Traversal::Slice {
            all.push(Binding { group: 0, binding: 1, name: "picture", kind: BindingKind::Written });
        }
        for (i, v) in self.volumes.iter().enumerate() {
            let mut add = |binding, name, kind| all.push(Binding { group: i as u32 + 1, binding, name, kind });
            add(0, "volume", BindingKind::Uniform);
            match v.form {
                Form::Raw(_) if self.sampler == Sampler::HwLinear => {
                    add(1, "raw", BindingKind::Filtered);
                    add(3, "filter", BindingKind::Sampler);
                }
                Form::Raw(texel) => add(1, "raw", BindingKind::Texture(texel)),
                Form::S3dc(texel) => {
                    add(1, "index", BindingKind::Texture(Texel::Uint));
                    add(2, "minmax", BindingKind::Texture(texel));
                }
                Form::Zerobit { pages, .. } => {
                    add(1, "table", BindingKind::Read);
                    add(2, "books", BindingKind::Read);
                    for (binding, page) in (PAGE_BINDING..).zip(PAGES).take(pages as usize) {
                        add(binding, page, BindingKind::Read);
                    }
                }
            }
            if self.skips() {
                add(4, "visible", BindingKind::Texture(Texel::Uint));
            }
        }
        all.sort_by_key(|b| (b.group, b.binding));
        all
    }

    /// Storage buffers of the picture's shader.
    #[must_use]
    pub fn storage_buffers(&self) -> u32 {
        let storage = |b: &Binding| matches!(b.kind, BindingKind::Read | BindingKind::Written);
        self.bindings().iter().map(|b| u32::from(storage(b))).sum()
    }

    /// Name of the compute entry point, or of the fragment's for slices.
    #[must_use]
    pub const fn entry(&self) -> &'static str {
        match self.traversal {
            Traversal::Raycast => "raycast",
            Traversal::Slice => "slice",
            Traversal::CutPlane => "cut_plane",
        }
    }
}

impl VolumeKey {
    /// Flags and words of volume `i`.
    pub(super) fn choice(&self, i: usize) -> (std::collections::BTreeSet<&'static str>, Vec<(&'static str, String)>) {
        let mut flags = std::collections::BTreeSet::new();
        let mut flag = |name: &'static str, set: bool| {
            if set {
                flags.insert(name);
            }
        };
        flag("folded", self.folded);
        flag("colour", self.colour);
        let (texel, float) = match self.form {
            Form::Raw(texel) | Form::S3dc(texel) => (texel, texel == Texel::Float),
            Form::Zerobit { new, signed, .. } => {
                flag("zerobit", true);
                flag("new_stream", new);
                flag("signed", signed);
                (Texel::Uint, false)
            }
        };
        let (pages, least, most) = match self.form {
            Form::Zerobit { pages, signed: true, .. } => (pages, "-32768", "32767"),
            Form::Zerobit { pages, wide: true, .. } => (pages, "0", "65535"),
            Form::Zerobit { pages, .. } => (pages, "0", "255"),
            _ => (0, "0", "255"),
        };
        let int = if self.colour { "vec3i" } else { "i32" };
        flag("float", float);
        let words = vec![
            ("STREAMS_V", streams(pages)),
            ("PAGE_WORD_V", page_word(pages)),
            ("INT_V", int.to_owned()),
            ("LEAST_V", format!("{int}({least})")),
            ("MOST_V", format!("{int}({most})")),
            ("VALUE_V", if self.colour { "vec3f" } else { "f32" }.to_owned()),
            ("TEXEL_V", texel.wgsl().to_owned()),
            ("SWIZZLE_V", if self.colour { "xyz" } else { "x" }.to_owned()),
            ("GROUP_V", (i + 1).to_string()),
        ];
        (flags, words)
    }
}

/// Declares the storage buffers of zerobit streams.
fn streams(pages: u32) -> String {
    let one = |(binding, name): (u32, &str)| {
        format!("@group(GROUP_V) @binding({binding}) var<storage, read> {name}_V: array<u32>;\n")
    };
    (PAGE_BINDING..).zip(PAGES).take(pages as usize).map(one).collect()
}

/// Reads word `w` of the page of payload `s`: buffers cannot be numbered in WGSL.
fn page_word(pages: u32) -> String {
    let read = |name: &str| format!("return {name}_V[w];");
    if pages < 2 {
        return PAGES.iter().take(pages as usize).map(|name| read(name)).next().unwrap_or_else(|| "return 0u;".into());
    }
    let case = |(page, name): (u32, &&str)| format!("case {page}u: {{ {} }}\n", read(name));
    let cases: String = (0..).zip(&PAGES[..pages as usize]).map(case).collect();
    format!("switch s.page {{\n{cases}default: {{ return 0u; }}\n}}\nreturn 0u;")
}
