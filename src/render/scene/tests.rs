use super::*;
use crate::error::Code;
use crate::geometry::Extent;
use crate::gpu::Lens;
use crate::grid::Grid;
use crate::limits::Limits;
use crate::render::transfer::Preset;
use crate::source::MemorySource;
use crate::volume::{self, EncodeOptions, Volume};
use std::path::Path;

fn small() -> Volume {
    let mut grid = Grid::from_fn(Extent::new(40, 20, 10), |c| (c[0] * 6) as u8).unwrap();
    let mut file = std::io::Cursor::new(Vec::new());
    volume::encode(&mut grid, &mut file, &EncodeOptions::default(), &mut |_, _| {}).unwrap();
    Volume::open(MemorySource(file.into_inner()), Limits::default()).unwrap()
}

fn resolved(text: &str) -> Result<Scene> {
    SceneFile::parse(text)?.resolve(&[&small()], Path::new(""))
}

#[track_caller]
fn refused(text: &str, words: &[&str]) {
    let e = resolved(text).unwrap_err();
    assert_eq!(e.code(), Code::Param, "{e}");
    for word in words {
        assert!(e.to_string().contains(word), "{text}: {e} does not say {word}");
    }
}

#[test]
fn an_empty_scene_shows_what_is_there() {
    let scene = resolved("").unwrap();
    assert_eq!(scene, Scene::of(&small()).unwrap());
    let named: Effects = [Effect::EmptySkip, Effect::TfCull, Effect::Lod, Effect::EarlyOut].into_iter().collect();
    assert_eq!(scene.effects(), named);
    assert_eq!((scene.step, scene.early_out, scene.lod), (0.5, Some(EARLY_OUT), Lod::Auto { pixels: 1.0 }));
    assert!(scene.volumes[0].transfer.max_alpha(0.0, 255.0) > 0.0, "something is seen");
}

#[test]
fn everything_can_be_said_and_said_again() {
    let text = r#"
        size = [320, 200]
        background = [1.0, 1.0, 0.5]
        step = 0.25
        sampler = "nearest"
        source = "deferred"
        traversal = "raycast"
        projection = "composite"
        effects = ["gradient_shading", "early_out", "lod", "clip_box", "time_interp", "empty_skip", "tf_cull"]
        [camera]
        lens = "orthographic"
        height = 12.5
        eye = [1.0, 2.0, 3.0]
        target = [0.0, 0.0, 0.0]
        up = [0.0, 1.0, 0.0]
        [shading]
        ambient = 0.1
        gradient = "naive"
        [early_out]
        remaining = 0.01
        [lod]
        pixels = 2.0
        [clip_box]
        min = [0, 0, 0]
        max = [5, 5, 5]
        [[volume]]
        path = "a.vug"
        transfer = { preset = "ct-bone", range = [1, 2] }
    "#;
    let file = SceneFile::parse(text).unwrap();
    assert_eq!(SceneFile::parse(&file.to_toml()).unwrap(), file, "{}", file.to_toml());
    let scene = file.resolve(&[&small()], Path::new("")).unwrap();
    assert_eq!(scene.effects(), Effect::ALL.iter().copied().collect());
    assert_eq!((scene.camera.lens, scene.camera.height, scene.size), (Lens::Orthographic, Some(12.5), [320, 200]));
    let shading = Shading { ambient: 0.1, gradient: Gradient::Naive, ..Shading::default() };
    assert_eq!((scene.shading, scene.early_out), (Some(shading), Some(0.01)));
    assert_eq!(scene.clip, Some(ClipBox { min: [0.0; 3], max: [5.0; 3] }));
    assert_eq!(scene.volumes[0].path.as_deref(), Some("a.vug"));
    assert_eq!(scene.volumes[0].transfer, Preset::CtBone.over(1.0, 2.0).unwrap());
    // Each effect can be left out alone.
    for e in Effect::ALL {
        let mut rest = scene.effects().without(*e);
        if *e == Effect::EmptySkip {
            rest = rest.without(Effect::TfCull);
        }
        assert_eq!(scene.without(*e).effects(), rest, "{e}");
    }

    let cut = SceneFile::parse(
        "traversal = \"cut_plane\"\ncut_plane = { point = [0, 0, 0], normal = [0, 1, 1] }\n[[volume]]\ntransfer = { points = [{ value = 1, color = [1, 0, 0], alpha = 1 }] }",
    )
    .unwrap();
    assert_eq!(SceneFile::parse(&cut.to_toml()).unwrap(), cut);
    assert_eq!(cut.resolve(&[&small()], Path::new("")).unwrap().plane.unwrap().normal, [0.0, 1.0, 1.0]);
    let iso = resolved("projection = \"iso\"\niso_surface = { value = 90 }\nlevel = 0").unwrap();
    assert!((iso.iso, iso.lod) == (Some(90.0), Lod::Level(0)) && iso.shading.is_some() && iso.early_out.is_none());
}

#[test]
fn unknown_and_idle_words_are_errors() {
    refused("effects = [\"shadows\"]", &["shadows", "gradient_shading", "early_out", "clip_box"]);
    refused("sampler = \"cubic\"", &["cubic", "linear_opt"]);
    refused("colour = 1", &["colour", "line 1"]);
    refused("[camera]\nfoo = 1", &["foo", "line 2"]);
    refused("camera = \"manual\"", &["manual", "auto"]);
    refused("[[volume]]\ntransfer = \"bone\"", &["bone", "ct-bone"]);
    refused("[[volume]]\ntransfer = { preset = \"mri\", file = \"a\" }", &["one of"]);
    refused("[[volume]]\ntransfer = { preset = \"auto\", range = [0, 1] }", &["range"]);
    refused("size = [1, 2, 3]", &["line 1"]);
    refused("not toml", &["line 1"]);
    // Parameters of what is not there, and what does nothing.
    refused("effects = []\n[shading]\nambient = 1", &["gradient_shading"]);
    refused("effects = [\"lod\"]\nlevel = 1", &["lod"]);
    refused("effects = [\"clip_box\"]", &["min"]);
    refused("effects = [\"lod\", \"lod\"]", &["twice"]);
    refused("projection = \"maximum\"\neffects = [\"gradient_shading\"]", &["gradient_shading", "maximum"]);
    refused("projection = \"maximum\"\niso_surface = { value = 1 }", &["iso"]);
    refused("projection = \"iso\"", &["iso_surface"]);
    refused("traversal = \"cut_plane\"", &["point"]);
    refused("cut_plane = { point = [0,0,0], normal = [0,0,1] }", &["cut_plane"]);
    refused("traversal = \"cut_plane\"\ncut_plane = { point = [0,0,0], normal = [0,0,0] }", &["normal"]); // R-24
    refused("clip_box = { min = [1,0,0], max = [1,1,1] }", &["clip_box"]);
    refused("background = [0, 0, 2]", &["background"]);
    refused("early_out = { remaining = 1 }", &["early_out"]);
    refused("[[volume]]\n[[volume]]", &["2 volumes"]);
    let huge = format!("# {}", "x".repeat(1 << 20));
    assert_eq!(SceneFile::parse(&huge).unwrap_err().code(), Code::Limit);
}

#[test] // hard case: R-07 (how many samples a step would mean is for the plan)
fn steps_that_lead_nowhere() {
    for step in ["0", "-0.5", "nan", "inf", "-inf"] {
        refused(&format!("step = {step}"), &["step"]);
    }
    // Longer than the volume: one sample on each ray.
    assert_eq!(resolved("step = 1e6").unwrap().step, 1e6);
}

#[test] // hard case: R-27
fn times_and_channels_that_are_there() {
    for text in ["[[volume]]\nchannel = 1", "[[volume]]\ntime = 1", "[[volume]]\ntime = 0.5", "[[volume]]\ntime = -1"] {
        assert_eq!(resolved(text).unwrap_err().code(), Code::Range, "{text}");
    }
    let between = SceneFile { volume: vec![VolumeSpec { time: 0.5, ..VolumeSpec::default() }], ..SceneFile::default() };
    assert!(between.effects().contains(&Effect::TimeInterp), "asked for by the time");
    let mut scene = Scene::of(&small()).unwrap();
    scene.volumes[0].time = 0.5;
    assert!(scene.check().unwrap_err().message().contains("time_interp"));
}

#[test] // spec: SAF-14
fn scenes_inside_files_lead_nowhere() {
    for text in
        ["[[volume]]\npath = \"b.vug\"", "[[volume]]\ntransfer = { file = \"/etc/tf.json\" }", "[[volume]]\n[[volume]]"]
    {
        assert!(SceneFile::parse(text).is_ok());
        assert_eq!(SceneFile::parse_stored(text).unwrap_err().code(), Code::Param, "{text}");
    }
    SceneFile::parse_stored("step = 1.0\n[[volume]]\ntransfer = \"mri\"").unwrap();
}

#[test]
fn transfer_functions_in_files() {
    let folder = tempfile::tempdir().unwrap();
    let function = Preset::Heat.over(0.0, 9.0).unwrap();
    std::fs::write(folder.path().join("tf.json"), function.to_json()).unwrap();
    let scene = SceneFile::parse("[[volume]]\ntransfer = { file = \"tf.json\" }").unwrap();
    assert_eq!(scene.resolve(&[&small()], folder.path()).unwrap().volumes[0].transfer, function);
    assert_eq!(scene.resolve(&[&small()], Path::new("/no/where")).unwrap_err().code(), Code::Source);
}
