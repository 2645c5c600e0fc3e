//! What a scene does not ask for costs nothing: it is in no key, no text, no binding, no memory, no work and no byte read.
#![cfg(feature = "gpu")]

mod render_support;

use render_support::*;
use std::sync::Arc;
use vug::gpu::compose::{Choice, compose};
use vug::gpu::key::{Form, Gradient, Texel};
use vug::gpu::shader::FILES;
use vug::gpu::{Effect, Effects, Lens, PipelineKey, Projection, Sampler, Traversal, VolumeKey};
use vug::render::scene::{ClipBox, Scene};
use vug::render::{Backend, Renderer};
use vug::volume::Volume;
use vug::{Extent, Grid};

/// Effects that shaders know, and words that are in their text only where they are asked for.
const MARKERS: [(Effect, &[&str]); 5] = [
    (Effect::GradientShading, &["shade", "gradient", "slope_", "world_0("]),
    (Effect::EmptySkip, &["visible", "next"]),
    (Effect::EarlyOut, &["frame.enough"]),
    (Effect::ClipBox, &["frame.clip"]),
    (Effect::TimeInterp, &["frame.time", "_1"]),
];

fn key(effects: Effects) -> PipelineKey {
    let volume = VolumeKey { form: Form::S3dc(Texel::Uint), colour: false, folded: false };
    PipelineKey {
        traversal: Traversal::Raycast,
        projection: Projection::Composite,
        lens: Lens::Perspective,
        sampler: Sampler::LinearOpt,
        gradient: Gradient::Reuse,
        effects,
        volumes: vec![volume; 1 + usize::from(effects.has(Effect::TimeInterp))],
    }
}

#[test]
fn texts_and_bindings_hold_what_is_asked_for_and_nothing_else() {
    let mut texts = std::collections::BTreeMap::new();
    for effects in Effects::all_sets() {
        let key = key(effects);
        key.check().unwrap();
        let text = key.wgsl();
        // Field names of structures are no code.
        let code = &text[text.find("@group").unwrap()..];
        for (effect, words) in MARKERS {
            for word in words {
                assert_eq!(code.contains(word), effects.has(effect), "{word} in the text of {effects:?}");
            }
        }
        let names: Vec<_> = key.bindings().iter().map(|b| b.name).collect();
        assert_eq!(names.contains(&"visible"), effects.has(Effect::EmptySkip));
        assert!(!names.contains(&"filter") && !names.contains(&"raw"));
        let expected = 2 + key.volumes.len() * (3 + usize::from(effects.has(Effect::EmptySkip)));
        assert_eq!(names.len(), expected, "{effects:?}");
        // What only the CPU does is in no text: equal shaders, one pipeline.
        let shader = effects.without(Effect::TfCull).without(Effect::Lod);
        let same = texts.entry(shader).or_insert_with(|| text.clone());
        assert_eq!(*same, text);
    }
    let distinct: std::collections::BTreeSet<_> = texts.values().collect();
    assert_eq!((texts.len(), distinct.len()), (32, 32));
}

/// A shader file as it would be if nobody had ever written this effect: of its `//+if` blocks only the lines behind `//+else`.
fn never_written(text: &str, effect: &str) -> String {
    let mut out = String::new();
    // Of each open directive: whether it is the effect's, and whether its lines are dropped.
    let mut open: Vec<(bool, bool)> = Vec::new();
    for line in text.lines() {
        let directive = line.trim();
        let own = match directive {
            "//+else" => {
                let (own, dropped) = open.last_mut().unwrap();
                *dropped = *own && !*dropped;
                *own
            }
            "//+end" => open.pop().unwrap().0,
            _ if directive.starts_with("//+") => {
                let own = directive == format!("//+if {effect}");
                open.push((own, own));
                own
            }
            _ => false,
        };
        if !own && !open.iter().any(|(_, dropped)| *dropped) {
            out.push_str(line);
            out.push('\n');
        }
    }
    out
}

#[test]
fn without_an_effect_the_text_is_as_if_it_had_never_been_written() {
    let mut removed = 0;
    for (effect, _) in MARKERS {
        for (name, text) in FILES {
            let stripped = never_written(text, effect.name());
            removed += usize::from(stripped.lines().count() < text.lines().count());
            for flags in [vec!["composite", "perspective"], vec!["composite", "many"], vec!["extreme"], vec![]] {
                let choice =
                    Choice { flags: flags.into_iter().collect(), volumes: vec![Default::default()], words: vec![] };
                let own = text.contains("_V") && !text.contains("//+each");
                let volume = own.then_some(0);
                assert_eq!(
                    compose(name, text, &choice, volume).unwrap(),
                    compose(name, &stripped, &choice, volume).unwrap(),
                    "{name} {effect}"
                );
            }
        }
    }
    assert!(removed >= 5, "{removed} files have lines of an effect");
}

/// A hill in one corner; most of the volume is a haze that nothing shows.
fn corner(c: [u32; 3]) -> u8 {
    let haze = (c[0] * 7 + c[1] * 13 + c[2] * 29) % 15;
    if c.iter().all(|&v| v < 30) { hill(Extent::cube(30), c) as u8 } else { haze as u8 }
}

/// A scene's volume.
fn volume() -> Arc<Volume> {
    encoded(&mut Grid::from_fn(Extent::cube(64), corner).unwrap(), s3dc(4, [4, 4, 4]))
}

fn with(scene: &Scene, effect: Effect) -> Scene {
    let mut scene = scene.clone();
    match effect {
        Effect::GradientShading => scene = lit(&scene, Gradient::Reuse),
        Effect::EmptySkip => scene.empty_skip = true,
        Effect::TfCull => (scene.tf_cull, scene.empty_skip) = (true, true),
        Effect::EarlyOut => scene.early_out = Some(1.0 / 1024.0),
        Effect::ClipBox => scene.clip = Some(ClipBox { min: [-1e3; 3], max: [1e3; 3] }),
        Effect::Lod | Effect::TimeInterp => {}
    }
    scene
}

#[test]
fn work_is_that_of_the_effects_asked_for() {
    let volume = volume();
    let base = plain(&volume, fog(), [40, 40]);
    let work = |scene: &Scene| rendered(scene, std::slice::from_ref(&volume), &Backend::Cpu).work.unwrap();
    let bare = work(&base);
    assert_eq!((bare.gradients, bare.lit, bare.brick_fetches), (0, 0, 0));
    assert_eq!((bare.fetches(), bare.lookups), (16 * bare.samples, bare.samples));
    // All asked for and each taken away again: nothing of it is left, and the others are.
    let all = [Effect::GradientShading, Effect::EmptySkip, Effect::EarlyOut, Effect::ClipBox]
        .iter()
        .fold(base.clone(), |s, e| with(&s, *e));
    assert_eq!(work(&all.without(Effect::GradientShading)).lit, 0);
    assert_eq!(work(&all.without(Effect::EmptySkip)).brick_fetches, 0);
    assert!(work(&all.without(Effect::EarlyOut)).samples > work(&all).samples);
    // Neutral is not absent: a light that changes nothing costs what light costs.
    let mut neutral = with(&base, Effect::GradientShading);
    let shading = neutral.shading.as_mut().unwrap();
    (shading.ambient, shading.diffuse, shading.specular) = (1.0, 0.0, 0.0);
    let lit = work(&neutral);
    assert!(lit.gradients > 0 && lit.fetches() > bare.fetches());
    assert_eq!((lit.samples - bare.samples, lit.lookups), (0, bare.lookups));
    assert_close(
        &picture(&neutral, &volume, &Backend::Cpu),
        &picture(&base, &volume, &Backend::Cpu),
        0.0,
        "a light of 1",
    );
    // No step of a reference length is corrected, but the last of each ray.
    let mut whole = base.clone();
    whole.step = 1.0;
    assert!(work(&whole).corrections <= bare.rays && bare.corrections > bare.rays);
    // Skipping looks at bricks, and saves samples.
    let skipping = work(&with(&base, Effect::EmptySkip));
    assert!(skipping.brick_fetches > 0 && skipping.samples < bare.samples);
}

/// The device's own counters; the noop device has none.
#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn memory_is_that_of_the_effects_asked_for() {
    let gpu = gpu();
    let volume = volume();
    let base = plain(&volume, fog(), [40, 40]);
    let memory = |scene: &Scene| {
        let backend = Backend::Gpu(gpu.clone(), None);
        let before = gpu.device.get_internal_counters().hal.texture_memory.read();
        let renderer = Renderer::new(scene.clone(), vec![volume.clone()], backend, &|_, _, _| {}).unwrap();
        let after = gpu.device.get_internal_counters().hal.texture_memory.read();
        ((after - before) as u64, renderer.plan().level_bytes())
    };
    let (bytes, layouts) = memory(&base);
    assert_eq!(layouts, 16 * 64 * 64 * 2 + 16 * 16 * 16 * 2, "index words and end points");
    // The device aligns what it allocates, and may count a texture and the memory behind it.
    assert!((layouts..2 * layouts + (1 << 17)).contains(&bytes), "{bytes} of {layouts}");
    // Allocations differ by their alignment; any further texture of the level's size would show.
    for effect in [Effect::GradientShading, Effect::EarlyOut, Effect::ClipBox, Effect::TfCull, Effect::EmptySkip] {
        let (with, same) = memory(&with(&base, effect));
        assert!(with.abs_diff(bytes) < 16 << 10 && same == layouts, "{effect}: {with} bytes, {bytes} without");
    }
}

#[test]
fn bytes_are_read_for_the_effects_asked_for() {
    let read = |scene: &Scene| {
        let volume = series();
        let opened = volume.cost().bytes;
        Renderer::new(scene.clone(), vec![volume.clone()], Backend::Cpu, &|_, _, _| {}).unwrap();
        volume.cost().bytes - opened
    };
    let mut base = plain(&series(), fog(), [16, 16]);
    let whole = read(&base);
    (base.tf_cull, base.empty_skip) = (true, true);
    let culled = read(&base);
    assert!(culled < whole, "{culled} of {whole} bytes");
    (base.tf_cull, base.empty_skip) = (false, false);
    (base.time_interp, base.volumes[0].time) = (true, 0.5);
    let both = read(&base);
    base.time_interp = false;
    base.volumes[0].time = 0.0;
    // The second step is read only where the picture lies between two.
    assert!(both > whole && read(&base) <= whole, "{both} {whole}");
}

/// Two steps of a hill that sinks, most of the volume empty.
fn series() -> Arc<Volume> {
    series_of(Extent::cube(112), 2, |c, t| corner(c) / (1 + t as u8))
}

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn pipelines_are_made_for_what_is_asked_for() {
    let gpu = Backend::Gpu(gpu(), None);
    let volume = volume();
    let base = plain(&volume, fog(), [24, 24]);
    let mut all = base.clone();
    let mut seen = Vec::new();
    let effects = [Effect::GradientShading, Effect::EmptySkip, Effect::TfCull, Effect::EarlyOut, Effect::ClipBox];
    let mut sets: Vec<Vec<Effect>> = effects.iter().map(|e| vec![*e]).collect();
    for (i, a) in effects.iter().enumerate() {
        sets.extend(effects[i + 1..].iter().map(|b| vec![*a, *b]));
    }
    sets.push(effects.to_vec());
    for set in sets {
        let scene = set.iter().fold(base.clone(), |s, e| with(&s, *e));
        let renderer = Renderer::new(scene.clone(), vec![volume.clone()], gpu.clone(), &|_, _, _| {}).unwrap();
        let on_gpu = renderer.picture(&|_, _, _| {}).unwrap();
        assert_eq!((renderer.pipelines(), on_gpu.passes.len()), (1, 1), "one pass, one pipeline: {set:?}");
        assert_eq!(on_gpu.passes[0].name, "raycast");
        assert_close(&on_gpu.image, &picture(&scene, &volume, &Backend::CpuF32), 2.0 / 255.0, &format!("{set:?}"));
        // What shows nothing new shows exactly what there was.
        if !set.contains(&Effect::GradientShading) && !set.contains(&Effect::EarlyOut) {
            assert_close(&on_gpu.image, &picture(&base, &volume, &gpu), 0.0, &format!("{set:?}"));
        }
        seen.push(renderer.plan().key.clone());
        all = scene;
    }
    seen.dedup();
    assert!(seen.len() > 8);
    let together = picture(&all, &volume, &gpu);
    assert!(together.pixels.iter().filter(|p| p[3] > 0.1).count() > 10, "all effects together");
}
