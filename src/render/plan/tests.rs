use super::*;
use crate::gpu::key::Form;
use crate::gpu::{Source, Traversal};
use crate::grid::Grid;
use crate::limits::Limits;
use crate::render::scene::SceneFile;
use crate::render::transfer::{Point, TransferFunction};
use crate::source::MemorySource;
use crate::volume::{self, EncodeOptions};
use std::path::Path;

/// A small bright ball in one corner of a dark volume: bricks of 16³.
fn ball(levels: u8) -> Volume {
    let mut grid = Grid::from_fn(Extent::new(96, 80, 64), |c| {
        let r2: i32 = c.iter().map(|&v| (v as i32 - 24).pow(2)).sum();
        if r2 < 36 { 200u8 } else { 10 }
    })
    .unwrap();
    encoded(&mut grid, levels)
}

fn encoded(grid: &mut Grid, levels: u8) -> Volume {
    let mut file = std::io::Cursor::new(Vec::new());
    let options = EncodeOptions { brick: Some(16), levels, ..EncodeOptions::default() };
    volume::encode(grid, &mut file, &options, &mut |_, _| {}).unwrap();
    Volume::open(MemorySource(file.into_inner()), Limits::default()).unwrap()
}

fn scene(volume: &Volume, text: &str) -> Scene {
    let mut scene = SceneFile::parse(text).unwrap().resolve(&[volume], Path::new("")).unwrap();
    let p = |value, alpha| Point { value, color: [1.0; 3], alpha };
    scene.volumes[0].transfer = TransferFunction::new(vec![p(100.0, 0.0), p(150.0, 1.0)]).unwrap();
    scene
}

fn plan(volume: &Volume, scene: &Scene) -> Plan {
    Plan::new(scene, &[volume], &Fit::host(None)).unwrap()
}

#[test]
fn only_bricks_with_something_to_see() {
    let v = ball(1);
    let s = scene(&v, "level = 0\nsampler = \"nearest\"");
    let p = plan(&v, &s);
    let level = &p.levels[0];
    // The ball reaches from 18 to 30: one brick of 6×5×4, and nothing beyond it is sampled.
    assert_eq!((level.visible.count(), level.wanted.count(), level.visible.bits().len()), (1, 1, 120));
    assert!(level.visible.has([1, 1, 1]) && !level.visible.has([9, 9, 9]));
    // Linear samples beside it see it too, and those in it need their neighbours.
    let p = plan(&v, &scene(&v, "level = 0"));
    assert_eq!((p.levels[0].visible.count(), p.levels[0].wanted.count()), (27, 64));
    // Without culling everything is there, and rays skip all the same.
    let p = plan(&v, &scene(&v, "effects = [\"empty_skip\"]"));
    assert_eq!((p.levels[0].visible.count(), p.levels[0].wanted.count()), (27, 120));
    // An iso-surface: where both sides of it are.
    let p = plan(&v, &scene(&v, "level = 0\nprojection = \"iso\"\niso_surface = { value = 100 }"));
    assert_eq!(p.levels[0].visible.count(), 27);
    let none = plan(&v, &scene(&v, "level = 0\nprojection = \"iso\"\niso_surface = { value = 250 }"));
    assert_eq!(none.levels[0].wanted.count(), 0);
    // The other projections look at every value.
    let p = plan(&v, &scene(&v, "projection = \"maximum\""));
    assert_eq!(p.levels[0].wanted.count(), p.levels[0].wanted.bits().len());
}

#[test] // hard case: R-19
fn a_brick_that_touches_a_peak_at_one_point_is_seen() {
    let v = ball(1);
    let mut s = scene(&v, "level = 0\nsampler = \"nearest\"");
    let p = |value, alpha| Point { value, color: [1.0; 3], alpha };
    // The ball's own value, 200 exactly: found where the brick's maximum touches it.
    s.volumes[0].transfer = TransferFunction::new(vec![p(199.0, 0.0), p(200.0, 0.5), p(201.0, 0.0)]).unwrap();
    assert_eq!(plan(&v, &s).levels[0].visible.count(), 1);
    // Constant bricks at the foot of a ramp show nothing: no slack where there is nothing to round.
    s.volumes[0].transfer = TransferFunction::new(vec![p(10.0, 0.0), p(255.0, 1.0)]).unwrap();
    assert_eq!(plan(&v, &s).levels[0].visible.count(), 1);
}

#[test] // hard case: R-07
fn steps_too_fine_are_refused_before_anything_is_rendered() {
    let v = ball(1);
    for (step, ok) in [(1e-3, true), (1e-4, false), (1e-300, false), (1e300, true)] {
        let s = Scene { step, ..scene(&v, "") };
        match Plan::new(&s, &[&v], &Fit::host(None)) {
            Ok(p) => assert!(ok && p.samples <= MAX_SAMPLES && p.samples >= 2, "{step}: {}", p.samples),
            Err(e) => {
                assert!(!ok && e.code() == Code::Limit && e.field() == "step", "{step}: {e}");
            }
        }
    }
}

#[test]
fn levels_follow_the_size_of_a_pixel_and_fit_what_there_is() {
    let v = ball(3);
    let lod = |text: &str| plan(&v, &scene(&v, text)).levels[0].at.lod;
    // From outside of the volume's sphere; a camera within it shows the finest level.
    let away = "camera = { eye = [47, -400, 31], target = [47, 39, 31] }";
    assert_eq!(lod(&format!("size = [1000, 1000]\n{away}")), 0);
    assert_eq!(lod(&format!("size = [20, 20]\n{away}")), 2);
    assert_eq!(lod(&format!("size = [20, 20]\neffects = []\n{away}")), 0);
    assert_eq!(lod("level = 1"), 1);
    let e = Plan::new(&scene(&v, "level = 3"), &[&v], &Fit::host(None)).unwrap_err();
    assert_eq!(e.code(), Code::Range);
    // Too much for the device: the error says what fits.
    let e = Plan::new(&scene(&v, "level = 0"), &[&v], &Fit::host(Some(60_000))).unwrap_err();
    assert!(e.code() == Code::Limit && e.message().contains("level 1"), "{e}");
}

#[test]
fn a_plan_holds_what_the_scene_asks_for_and_says_what_it_leaves_out() {
    let v = ball(1);
    let p = plan(&v, &scene(&v, "effects = []"));
    assert_eq!((p.passes.len(), p.left_out.len()), (1, Effect::ALL.len()));
    assert!(matches!(p.key.volumes[0].form, Form::S3dc(Texel::Uint)));
    let pass = &p.passes[0];
    let names: Vec<_> = pass.bindings.iter().map(|b| b.name).collect();
    assert_eq!(names, ["frame", "picture", "volume", "index", "minmax"]);
    // Index words and pairs of end points, as many as the payloads hold.
    let textures: u64 = pass.bindings[3..].iter().map(|b| b.bytes).sum();
    assert_eq!(textures, p.levels[0].layout.bytes());
    assert_eq!(pass.bindings[1].bytes, 768 * 768 * 16);
    assert!(pass.fetches[0].lit.is_none() && (pass.fetches[0].value - 6.953_125).abs() < 1e-9);

    let all =
        plan(&v, &scene(&v, "effects = [\"gradient_shading\", \"empty_skip\", \"early_out\"]\nsource = \"deferred\""));
    let names: Vec<_> = all.passes.iter().map(|p| (p.name, p.once)).collect();
    assert_eq!(names, [("decode_s3dc", true), ("raycast", false)]);
    assert!(matches!(all.key.volumes[0].form, Form::Raw(Texel::Float)));
    let text = all.explain();
    for word in [
        "effects     gradient_shading, empty_skip, early_out",
        "decode_s3dc (once)",
        "56.00 where it is lit",
        "left out    lod",
        "tf_cull: not asked for",
        "visible",
    ] {
        assert!(text.contains(word), "{word} in\n{text}");
    }
    let json = all.to_json();
    assert_eq!(json["passes"][1]["bindings"][3]["bytes"], 96 * 80 * 64 * 4);
    assert_eq!(json["levels"][0]["bricks_needed"], 120);

    let cut = "traversal = \"cut_plane\"\ncut_plane = { point = [48, 40, 32], normal = [0, 0, 1] }";
    let cut = plan(&v, &scene(&v, cut));
    assert_eq!((cut.key.traversal, cut.passes[0].name), (Traversal::CutPlane, "cut_plane"));
    assert!(cut.explain().contains("empty_skip: does nothing with cut_plane"));
}

#[test] // hard case: R-27
fn two_time_steps_where_the_picture_lies_between_them() {
    let v = ball(1);
    let s = scene(&v, "effects = [\"time_interp\", \"empty_skip\", \"tf_cull\"]");
    let p = plan(&v, &s);
    // The last step has none behind it: it is mixed with itself, and nothing beyond is read.
    assert_eq!(p.levels.iter().map(|l| l.at.time).collect::<Vec<_>>(), [0, 0]);
    assert_eq!(p.key.volumes.len(), 2);
    assert!(p.key.effects.has(Effect::TimeInterp) && !p.key.effects.has(Effect::TfCull));
}

#[test]
fn sources_and_samplers_that_do_not_go_together() {
    let v = ball(1);
    let of = |text: &str| Plan::new(&scene(&v, text), &[&v], &Fit::host(None)).map(|p| p.key.volumes[0].form);
    assert_eq!(of("sampler = \"hw_linear\"").unwrap_err().code(), Code::Param);
    assert!(matches!(of("sampler = \"hw_linear\"\nsource = \"deferred\""), Ok(Form::Raw(Texel::Float))));
    assert!(matches!(of("sampler = \"hw_linear\"\nsource = \"decoded\""), Ok(Form::Raw(Texel::Float))));
    assert!(matches!(of("sampler = \"linear\"\nsource = \"decoded\""), Ok(Form::Raw(Texel::Uint))));
    assert_eq!(SceneFile::default().source, Source::Direct);
}

#[test]
fn bricks_that_no_view_shows_are_not_loaded() {
    use crate::render::{Backend, Renderer};
    use std::sync::Arc;
    // Noise: there is something to see everywhere.
    let noise =
        |c: [u32; 3]| (c[0].wrapping_mul(7919) ^ c[1].wrapping_mul(104_729) ^ c[2].wrapping_mul(1_299_709)) as u8;
    let mut grid = Grid::from_fn(Extent::new(80, 80, 80), noise).unwrap();
    let v = Arc::new(encoded(&mut grid, 1));
    for text in [
        "size = [24, 24]\nlevel = 0\ncamera = { zoom = 6, target = [20, 20, 20] }",
        "size = [24, 24]\nlevel = 0\ncamera = { eye = [40, 40, 40], target = [80, 40, 40] }",
        "size = [24, 24]\nlevel = 0\ncamera = { lens = \"orthographic\", height = 20 }",
        "size = [24, 24]\nlevel = 0\nclip_box = { min = [5, 5, 5], max = [20, 30, 20] }",
    ] {
        let s = scene(&v, text);
        let load = |views| Renderer::for_views(s.clone(), vec![v.clone()], Backend::Cpu, views, &|_, _, _| {}).unwrap();
        let all = Renderer::new(s.without(Effect::TfCull), vec![v.clone()], Backend::Cpu, &|_, _, _| {}).unwrap();
        let view = all.plan().view.clone();
        let culled = load(vec![view.clone()]);
        let (few, bricks) = (culled.plan().levels[0].wanted.count(), all.plan().levels[0].wanted.count());
        assert!(few > 0 && few < bricks * 3 / 4, "{text}: {few} of {bricks}");
        let (a, b) = (culled.picture(&|_, _, _| {}).unwrap(), all.picture(&|_, _, _| {}).unwrap());
        assert!(a.image == b.image && a.image.pixels.iter().any(|p| p[3] > 0.1), "{text}");
        // From all sides of a turntable more is needed than from one.
        let turn = (0..4).map(|i| view.turned(f64::from(i) * 1.57)).collect();
        assert!(load(turn).plan().levels[0].wanted.count() >= few);
    }
    // However far the camera is.
    let far = scene(&v, "camera = { eye = [40, -1e300, 40], target = [40, 40, 40], fov = 1 }");
    let mut plan = plan(&v, &far);
    plan.cull_to(&far, &[plan.view.clone()]).unwrap();
    assert_eq!(plan.levels[0].wanted.count(), 125, "one pixel holds all of it");
}

#[test]
fn cameras_frame_the_bricks_with_something_to_see() {
    let v = ball(3);
    let transfer = r#"[{ value = 100, color = [1, 1, 1], alpha = 0 }, { value = 150, color = [1, 1, 1], alpha = 1 }]"#;
    let resolved = |more: &str| {
        let text = format!("{more}\n[[volume]]\ntransfer = {{ points = {transfer} }}");
        SceneFile::parse(&text).unwrap().resolve(&[&v], Path::new("")).unwrap()
    };
    let scene = resolved("");
    // The ball lies in the brick from 16 to 32; the volume's middle is at (47.5, 39.5, 31.5).
    let first = [15.5 - 47.5, 15.5 - 39.5, 15.5 - 31.5];
    assert_eq!((scene.volumes[0].seen.len(), scene.volumes[0].seen[0]), (8, first));
    let view = |scene: &Scene| plan(&v, scene).view;
    assert_eq!(view(&scene).pivot, first.map(|c| c + 8.0));
    // Whatever the level, and when other values are shown later, it stays where it is.
    assert_eq!(view(&resolved("level = 2")), view(&scene));
    let mut other = scene.clone();
    other.volumes[0].transfer = TransferFunction::new(vec![Point { value: 0.0, color: [1.0; 3], alpha: 1.0 }]).unwrap();
    assert_eq!(view(&other), view(&scene));
    // Nothing to see, all values to see, or a camera that is told where to stand: the box.
    for more in [
        "projection = \"iso\"\niso_surface = { value = 250 }",
        "projection = \"maximum\"",
        "[camera]\ntarget = [0, 0, 0]",
    ] {
        assert!(resolved(more).volumes[0].seen.is_empty(), "{more}");
    }
}

#[test]
fn what_only_the_cpu_does_is_explained_too_and_a_band_is_what_it_takes() {
    let v = ball(2);
    let p = plan(&v, &scene(&v, "size = [2048, 2048]"));
    assert!(p.effects.has(Effect::TfCull) && p.effects.has(Effect::Lod));
    assert!(!p.key.effects.has(Effect::TfCull) && !p.key.effects.has(Effect::Lod));
    let text = p.explain();
    let line = text.lines().find(|l| l.starts_with("effects")).unwrap();
    assert!(line.contains("tf_cull") && line.contains("lod"), "{text}");
    assert!(p.to_json()["effects"].as_array().unwrap().iter().any(|e| e == "tf_cull"));
    // 2^20 pixels at a time, of 2^22.
    let picture = p.passes[0].bindings.iter().find(|b| b.name == "picture").unwrap();
    assert_eq!(picture.bytes, 16 << 20);
    assert_eq!([[1, 9], [2048, 2048], [1 << 20, 99]].map(|size| band_rows(size, &Fit::portable())), [9, 512, 8]);
}

/// What a scene with this volume so many times is refused for.
fn refused(v: &Volume, scene: &Scene, times: usize, fit: &Fit) -> Error {
    let scene = Scene { volumes: vec![scene.volumes[0].clone(); times], ..scene.clone() };
    let e = Plan::new(&scene, &vec![v; times], fit).unwrap_err();
    assert_eq!(e.code(), Code::Limit, "{e}");
    e
}

#[test]
fn all_levels_together_are_held_against_the_budget() {
    let v = ball(3);
    let s = scene(&v, "level = 0");
    let one = plan(&v, &s).level_bytes();
    let fit = |bytes| Fit::host(Some(bytes));
    let two = Scene { volumes: vec![s.volumes[0].clone(); 2], ..s.clone() };
    assert!(Plan::new(&two, &[&v, &v], &fit(2 * one)).is_ok());
    let e = refused(&v, &s, 2, &fit(2 * one - 1));
    assert_eq!(e.field(), "gpu-mem");
    for part in ["volume 1 at step 0, level 0", "level 1 of all", "one volume fewer"] {
        assert!(e.message().contains(part), "{part} in {e}");
    }
    // Both steps of a series in between count.
    let s = scene(&v, "level = 0\neffects = [\"time_interp\"]");
    let e = refused(&v, &s, 1, &fit(2 * one - 1));
    assert!(e.message().contains("a whole time step"), "{e}");
}

#[test]
fn all_storage_buffers_of_a_shader_are_counted() {
    let mut grid = Grid::from_fn(Extent::cube(40), |c| ((c[0] * 5) ^ (c[1] * 3) ^ c[2]) as u8).unwrap();
    let mut file = std::io::Cursor::new(Vec::new());
    let options = EncodeOptions {
        brick: Some(16),
        codec: volume::CodecChoice::Zerobit,
        quality: volume::Quality::Keep(500_000),
        ..EncodeOptions::default()
    };
    volume::encode(&mut grid, &mut file, &options, &mut |_, _| {}).unwrap();
    let v = Volume::open(MemorySource(file.into_inner()), Limits::default()).unwrap();
    let s = scene(&v, "level = 0\neffects = []");
    let two = Scene { volumes: vec![s.volumes[0].clone(); 2], ..s.clone() };
    // Picture, and of each a table, codebooks and one page; one more page would not be had by both.
    let p = Plan::new(&two, &[&v, &v], &Fit::portable()).unwrap();
    assert_eq!((p.key.storage_buffers(), p.levels[1].layout.pages.unwrap().pages), (7, 1));
    let e = refused(&v, &s, 3, &Fit::portable());
    assert!(e.message().contains("10 storage buffers, of 8") && e.message().contains("2 of the volumes"), "{e}");
    let decoded = Scene { volumes: vec![s.volumes[0].clone(); 3], source: Source::Decoded, ..s.clone() };
    assert!(Plan::new(&decoded, &[&v, &v, &v], &Fit::portable()).is_ok());
    // Two time steps, of two pages each.
    let between = scene(&v, "level = 0\neffects = [\"time_interp\"]");
    let bytes = p.levels[0].layout.pages.unwrap().stream_bytes;
    let small = Fit { max_binding: bytes * 2 / 3 / 4 * 4, ..Fit::portable() };
    let e = refused(&v, &between, 1, &small);
    assert!(e.message().contains("9 storage buffers") && e.message().contains("a whole time step"), "{e}");
    // Steps need not be equally long.
    let mut key = Plan::new(&between, &[&v], &Fit::portable()).unwrap().key;
    key.volumes[1] = key.volumes[1].with_pages(3);
    key.check().unwrap();
    let text = key.wgsl();
    assert!(text.contains("page2_1") && !text.contains("page1_0"), "{text}");
    key.volumes[1].colour = true;
    assert_eq!(key.check().unwrap_err().code(), Code::Param);
}

#[test]
fn slices_are_no_wider_than_textures() {
    let v = ball(1);
    let s = scene(&v, "traversal = \"slice\"\nsize = [8193, 4]");
    let e = refused(&v, &s, 1, &Fit::portable());
    assert!(e.field() == "size" && e.message().contains("8192 at most"), "{e}");
    assert!(Plan::new(&Scene { size: [8192, 4], ..s }, &[&v], &Fit::portable()).is_ok());
}
