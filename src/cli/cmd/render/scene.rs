//! The scene of a command line: a scene file, a volume's own scene, or none; then what options say.

use crate::cli::args::Render;
use crate::cli::fetch;
use crate::cli::load::{check_import, import_options, is_vug};
use crate::cli::open::open_volume;
use crate::error::{Error, Result};
use crate::gpu::{Effect, Projection, Traversal};
use crate::limits::{self, Limits};
use crate::render::scene::{IsoSurface, LodPixels, SceneFile, TransferSpec, VolumeSpec};
use crate::source::{MemorySource, is_url};
use crate::volume::{self, CodecChoice, EncodeOptions, Volume};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A scene and its volumes.
pub(super) struct Opened {
    pub(super) scene: SceneFile,
    pub(super) volumes: Vec<Arc<Volume>>,
    /// Where names in the scene start from.
    pub(super) folder: PathBuf,
    /// The .vug file that is shown, where there is just one.
    pub(super) file: Option<PathBuf>,
}

/// Opens everything that the command line names.
pub(super) fn open(args: &Render) -> Result<Opened> {
    if !is_scene(&args.source) {
        let (volume, file) = open_one(&args.source, args)?;
        let stored = volume.scene()?;
        let mut scene = stored.as_deref().map(SceneFile::parse_stored).transpose()?.unwrap_or_default();
        over(&mut scene, args)?;
        return Ok(Opened { scene, volumes: vec![Arc::new(volume)], folder: PathBuf::new(), file });
    }
    check_import(&[], &args.import)?;
    let bytes = std::fs::metadata(&args.source).map_err(|e| Error::io(args.source.display(), e))?.len();
    limits::check("scene", bytes, limits::MAX_SCENE_BYTES)?;
    let text = std::fs::read_to_string(&args.source).map_err(|e| Error::io(args.source.display(), e))?;
    let mut scene = SceneFile::parse(&text)?;
    let folder = args.source.parent().unwrap_or(Path::new("")).to_owned();
    if scene.volume.is_empty() {
        return Err(Error::param("volume", "the scene names no volume; add [[volume]] with path = \"…\""));
    }
    over(&mut scene, args)?;
    let (mut volumes, mut files) = (Vec::new(), Vec::new());
    for spec in &scene.volume {
        let Some(name) = &spec.path else {
            return Err(Error::param("volume.path", "the scene is a file of its own: each volume needs a path"));
        };
        let path = if is_url(name) { PathBuf::from(name) } else { folder.join(name) };
        let (volume, file) = open_one(&path, args)?;
        volumes.push(Arc::new(volume));
        files.extend(file);
    }
    let file = if let [file] = &files[..] { Some(file.clone()) } else { None };
    Ok(Opened { scene, volumes, folder, file })
}

fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// A volume, and its name if it is a .vug file. Others are held in memory, uncompressed.
fn open_one(path: &Path, args: &Render) -> Result<(Volume, Option<PathBuf>)> {
    check_import(&[path], &args.import)?;
    if is_vug(path)? {
        return Ok((open_volume(path)?, Some(path.to_owned())));
    }
    let mut source = fetch::import(path, &import_options(path, &args.import)?)?;
    let options = EncodeOptions {
        codec: CodecChoice::Raw,
        zstd: false,
        levels: 0,
        placement: source.placement.clone(),
        value_map: source.value_map,
        times: source.times.clone(),
        ..EncodeOptions::default()
    };
    let mut file = std::io::Cursor::new(Vec::new());
    volume::encode(&mut *source.reader, &mut file, &options, &mut |_, _| {})?;
    Ok((Volume::open(MemorySource(file.into_inner()), Limits::default())?, None))
}

/// What the options say, over what the scene says.
fn over(scene: &mut SceneFile, args: &Render) -> Result<()> {
    fn set<T: Clone>(place: &mut T, given: &Option<T>) {
        if let Some(v) = given {
            *place = v.clone();
        }
    }
    set(&mut scene.size, &args.size);
    set(&mut scene.sampler, &args.sampler);
    set(&mut scene.source, &args.from);
    set(&mut scene.step, &args.step);
    set(&mut scene.background, &args.background);
    set(&mut scene.traversal, &args.traversal);
    set(&mut scene.projection, &args.projection);
    let camera = &mut scene.camera;
    set(&mut camera.lens, &args.lens);
    set(&mut camera.fov, &args.fov);
    set(&mut camera.azimuth, &args.azimuth);
    set(&mut camera.elevation, &args.elevation);
    set(&mut camera.zoom, &args.zoom);
    camera.height = args.height.or(camera.height);
    camera.eye = args.eye.or(camera.eye);
    camera.target = args.target.or(camera.target);
    camera.up = args.up.or(camera.up);
    if let Some(value) = args.iso {
        (scene.projection, scene.iso_surface) = (Projection::Iso, Some(IsoSurface { value }));
    } else if args.projection.is_some_and(|p| p != Projection::Iso) {
        scene.iso_surface = None;
    }
    if let Some(plane) = args.plane {
        (scene.traversal, scene.cut_plane) = (Traversal::CutPlane, Some(plane));
    } else if args.traversal.is_some_and(|t| t != Traversal::CutPlane) {
        scene.cut_plane = None;
    }
    over_effects(scene, args)?;
    if args.transfer.is_none() && args.transfer_range.is_some() {
        return Err(Error::param("transfer-range", "it is for a preset; name one with --transfer"));
    }
    if args.transfer.is_some() || args.time.is_some() || args.channel.is_some() {
        if scene.volume.is_empty() {
            scene.volume.push(VolumeSpec::default());
        }
        for v in &mut scene.volume {
            if let Some(name) = &args.transfer {
                v.transfer = transfer(name, args.transfer_range)?;
            }
            set(&mut v.time, &args.time);
            set(&mut v.channel, &args.channel);
        }
    }
    Ok(())
}

/// Effects and their parameters.
fn over_effects(scene: &mut SceneFile, args: &Render) -> Result<()> {
    if let Some(effects) = &args.effects {
        scene.effects = Some(effects.clone());
        // Parameters of what is not wanted any more.
        let has = |e| effects.contains(&e);
        scene.shading = scene.shading.filter(|_| has(Effect::GradientShading));
        scene.early_out = scene.early_out.filter(|_| has(Effect::EarlyOut));
        scene.lod = scene.lod.filter(|_| has(Effect::Lod));
        scene.clip_box = scene.clip_box.filter(|_| has(Effect::ClipBox));
    }
    let ask = |scene: &mut SceneFile, effect| {
        let mut effects = scene.effects();
        if !effects.contains(&effect) {
            effects.push(effect);
        }
        scene.effects = Some(effects);
    };
    let leave = |scene: &mut SceneFile, effect| {
        let mut effects = scene.effects();
        effects.retain(|e| *e != effect);
        scene.effects = Some(effects);
    };
    if let Some(level) = args.level {
        scene.lod = None;
        leave(scene, Effect::Lod);
        scene.level = Some(level);
    }
    if let Some(pixels) = args.lod_pixels {
        scene.level = None;
        scene.lod = Some(LodPixels { pixels });
        ask(scene, Effect::Lod);
    }
    if args.shading {
        ask(scene, Effect::GradientShading);
    }
    if let Some(clip) = args.clip {
        scene.clip_box = Some(clip);
        ask(scene, Effect::ClipBox);
    }
    if args.time.is_some_and(|t| t.fract() != 0.0) {
        ask(scene, Effect::TimeInterp);
    }
    for effect in &args.without {
        if !scene.effects().contains(effect) {
            return Err(Error::param("without", format!("{effect} is not among the effects of this scene")));
        }
        match effect {
            Effect::GradientShading => scene.shading = None,
            Effect::EarlyOut => scene.early_out = None,
            Effect::Lod => scene.lod = None,
            Effect::ClipBox => scene.clip_box = None,
            // What is not in memory must be jumped over.
            Effect::EmptySkip => leave(scene, Effect::TfCull),
            _ => {}
        }
        leave(scene, *effect);
    }
    Ok(())
}

/// A transfer function by the name of a preset or of a file, which is read now: relative to where the program runs.
fn transfer(name: &str, range: Option<(f64, f64)>) -> Result<TransferSpec> {
    use crate::render::transfer::TransferFunction;
    let is_file = name.contains(['.', '/', '\\']);
    match (is_file, range) {
        (true, Some(_)) => Err(Error::param("transfer-range", "a file has its own values; leave the range out")),
        (true, None) => {
            let text = std::fs::read_to_string(name).map_err(|e| Error::io(name, e))?;
            Ok(TransferSpec::Points(TransferFunction::from_json(&text)?))
        }
        (false, None) if name == "auto" => Ok(TransferSpec::Auto),
        (false, Some(_)) if name == "auto" => Err(Error::param("transfer-range", "auto has no range; name a preset")),
        (false, range) => Ok(TransferSpec::Preset(name.parse()?, range.map(|(lo, hi)| [lo, hi]))),
    }
}
