//! Taking the pictures: one scene, one transfer function, one camera for all settings.

use crate::cli::args::Tradeoff;
use crate::error::{Error, Result};
use crate::gpu::{AdapterChoice, Gpu};
use crate::limits;
use crate::metrics::image::RgbImage;
use crate::render::scene::{Scene, SceneFile};
use crate::render::{Backend, Renderer};
use crate::tradeoff::{Shot, Taken, paper};
use crate::volume::Volume;
use std::path::PathBuf;
use std::sync::Arc;

/// Picture size unless one is given.
const SIZE: [u32; 2] = [512, 512];

/// Scene, device and how often.
pub(super) struct Photographer {
    scene: SceneFile,
    /// Where names in the scene start from.
    folder: PathBuf,
    backend: Backend,
    frames: u32,
}

impl Photographer {
    pub(super) fn new(args: &Tradeoff) -> Result<Self> {
        let (mut scene, folder) = match &args.scene {
            None => (SceneFile::default(), PathBuf::new()),
            Some(path) => {
                let bytes = std::fs::metadata(path).map_err(|e| Error::io(path.display(), e))?.len();
                limits::check("scene", bytes, limits::MAX_SCENE_BYTES)?;
                let text = std::fs::read_to_string(path).map_err(|e| Error::io(path.display(), e))?;
                (SceneFile::parse(&text)?, path.parent().map(PathBuf::from).unwrap_or_default())
            }
        };
        if scene.volume.len() > 1 {
            return Err(Error::param("scene", "it shows several volumes; a sweep encodes one"));
        }
        match (args.size, &args.scene) {
            (Some(size), _) => scene.size = size,
            (None, Some(_)) => {}
            (None, None) => scene.size = if args.paper_table_1 { paper::PICTURE } else { SIZE },
        }
        Ok(Photographer { scene, folder, backend: backend(args.adapter.as_deref())?, frames: args.frames })
    }

    /// The adapter, for people.
    pub(super) fn adapter(&self) -> String {
        self.backend.describe()
    }

    /// What all pictures share, for people.
    pub(super) fn facts(&self) -> Vec<(String, String)> {
        let [w, h] = self.scene.size;
        vec![
            ("adapter".into(), self.adapter()),
            ("picture".into(), format!("{w}×{h} pixels")),
            ("frames".into(), format!("{} for each picture, after one to warm up", self.frames)),
            ("threads".into(), rayon::current_num_threads().to_string()),
        ]
    }

    /// Takes pictures of one volume in its encodings. The first one decides about the transfer function, where the scene
    /// leaves that open: it is the uncompressed one.
    pub(super) fn of_one_volume(&self) -> impl FnMut(&Arc<Volume>, &Shot) -> Result<Taken> + '_ {
        let mut resolved: Option<Scene> = None;
        move |volume, shot| {
            let template = match &resolved {
                Some(scene) => scene,
                None => resolved.insert(self.scene.resolve(&[volume], &self.folder)?),
            };
            let mut scene = template.clone();
            (scene.source, scene.sampler, scene.step) = (shot.source, shot.sampler, shot.step);
            self.take(scene, volume)
        }
    }

    fn take(&self, scene: Scene, volume: &Arc<Volume>) -> Result<Taken> {
        let background = scene.background;
        let renderer = Renderer::new(scene, vec![volume.clone()], self.backend.clone(), &|_, _, _| {})?;
        let fetches = renderer.plan().passes.last().and_then(|p| p.fetches.first()).map(|f| f.value);
        let mut seconds = Vec::new();
        let mut rendered = renderer.picture(&|_, _, _| {})?; // pipelines are made now
        for _ in 0..self.frames {
            rendered = renderer.picture(&|_, _, _| {})?;
            seconds.push(rendered.passes.iter().map(|p| p.milliseconds).sum::<f64>() / 1e3);
        }
        let image = &rendered.image;
        let image = RgbImage::new(image.width, image.height, image.over(background))?;
        Ok(Taken { image, seconds, fetches_per_sample: fetches })
    }
}

/// The device that an argument names.
fn backend(adapter: Option<&str>) -> Result<Backend> {
    let choice = match adapter {
        Some("cpu") => return Ok(Backend::Cpu),
        Some("software") => AdapterChoice::software(),
        Some(name) => AdapterChoice { name: Some(name.to_owned()), ..AdapterChoice::default() },
        None => AdapterChoice::default(),
    };
    match Gpu::open(&choice) {
        Ok(gpu) => Ok(Backend::Gpu(Arc::new(gpu), None)),
        // Nobody asked for a GPU.
        Err(_) if adapter.is_none() => Ok(Backend::Cpu),
        Err(e) => Err(e),
    }
}
