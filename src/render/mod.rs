//! Pictures of volumes: a scene becomes a plan, the plan a picture, by a GPU or by the CPU.
//!
//! ```no_run
//! use std::sync::Arc;
//! use vug::render::{Backend, Renderer, scene::Scene};
//! use vug::volume::Volume;
//! let volume = Arc::new(Volume::open_path("head.vug")?);
//! let scene = Scene::of(&volume)?;                     // one volume, seen as well as can be said without being asked
//! let renderer = Renderer::new(scene, vec![volume], Backend::Cpu, &|_, _, _| {})?;
//! let picture = renderer.picture(&|_, _, _| {})?.image; // premultiplied RGBA in f32, rows from the top
//! # Ok::<(), vug::Error>(())
//! ```

pub mod camera;
pub mod fidelity;
mod gpu;
pub mod image;
pub mod mirror;
pub mod plan;
pub mod reference;
pub mod scene;
pub mod setup;
pub mod transfer;

pub use image::Image;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::level::{Filled, Fit, HostLevel};
use crate::gpu::pipeline::Pipelines;
use crate::volume::Volume;
use camera::View;
use mirror::{Real, Work};
use plan::Plan;
use scene::Scene;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;
use transfer::TransferFunction;

/// Told what is being done, how much of it is done, of how much.
pub type Progress<'a> = &'a (dyn Fn(&str, u64, u64) + Sync);

/// Who computes the picture.
#[derive(Clone, Debug)]
pub enum Backend {
    /// The CPU in f64: the truth.
    Cpu,
    /// The CPU in f32, operation by operation what the GPU does.
    CpuF32,
    /// A GPU, of whose memory the volumes may take so many bytes.
    Gpu(Arc<Gpu>, Option<u64>),
}

impl Backend {
    /// What it can hold.
    #[must_use]
    pub fn fit(&self) -> Fit {
        match self {
            Backend::Cpu | Backend::CpuF32 => Fit::host(None),
            Backend::Gpu(gpu, budget) => gpu.fit(*budget),
        }
    }

    /// Name and driver, for reports.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            Backend::Cpu => "cpu (f64 reference)".to_owned(),
            Backend::CpuF32 => "cpu (f32 mirror)".to_owned(),
            Backend::Gpu(gpu, _) => crate::gpu::device::describe(&gpu.adapter_info),
        }
    }
}

/// How long a pass took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassTime {
    /// The pass.
    pub name: String,
    /// Milliseconds.
    pub milliseconds: f64,
    /// Whether the device's own clock measured it; else it is wall time with all that goes with it.
    pub by_device: bool,
}

impl PassTime {
    fn wall(name: &str, started: Instant) -> PassTime {
        PassTime { name: name.to_owned(), milliseconds: started.elapsed().as_secs_f64() * 1e3, by_device: false }
    }
}

/// A picture and what it took.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The picture.
    pub image: Image,
    /// Work of the CPU renderer, counted; none from a GPU.
    pub work: Option<Work>,
    /// Passes of this picture.
    pub passes: Vec<PassTime>,
}

/// A scene that is loaded, and can be seen from many sides.
pub struct Renderer {
    scene: Scene,
    volumes: Vec<Arc<Volume>>,
    backend: Backend,
    views: Vec<View>,
    plan: Plan,
    loaded: Loaded,
    pipelines: Arc<Pipelines>,
    loading: Vec<PassTime>,
}

enum Loaded {
    Host(Vec<HostLevel>),
    Gpu(gpu::GpuScene),
}

impl Renderer {
    /// Plans a scene of these volumes and loads what it needs.
    ///
    /// # Errors
    /// Those of [`Plan::new`] and of reading bricks; `E_LIMIT`, `E_SOURCE` of the device.
    pub fn new(scene: Scene, volumes: Vec<Arc<Volume>>, backend: Backend, progress: Progress<'_>) -> Result<Renderer> {
        Renderer::for_views(scene, volumes, backend, Vec::new(), progress)
    }

    /// The same for someone who will look from these sides only: what none of them shows is not loaded, unless the scene does
    /// without `tf_cull`.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn for_views(
        scene: Scene,
        volumes: Vec<Arc<Volume>>,
        backend: Backend,
        views: Vec<View>,
        progress: Progress<'_>,
    ) -> Result<Renderer> {
        let plan = plan_for(&scene, &volumes, &backend, &views)?;
        let pipelines = Arc::new(Pipelines::default());
        let (loaded, loading) = load(&plan, &volumes, &backend, &pipelines, progress)?;
        Ok(Renderer { scene, volumes, backend, views, plan, loaded, pipelines, loading })
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The volumes.
    #[must_use]
    pub fn volumes(&self) -> &[Arc<Volume>] {
        &self.volumes
    }

    /// What was loaded, level by level.
    #[must_use]
    pub fn filled(&self) -> Vec<Filled> {
        match &self.loaded {
            Loaded::Host(levels) => levels.iter().map(|l| l.filled).collect(),
            Loaded::Gpu(scene) => scene.filled(),
        }
    }

    /// What was run when the scene was loaded.
    #[must_use]
    pub fn loading(&self) -> &[PassTime] {
        &self.loading
    }

    /// Pipelines that were made so far.
    #[must_use]
    pub fn pipelines(&self) -> usize {
        self.pipelines.len()
    }

    /// The picture from where the scene says.
    ///
    /// # Errors
    /// `E_LIMIT`, `E_SOURCE` of the device.
    pub fn picture(&self, progress: Progress<'_>) -> Result<Rendered> {
        self.picture_from(&self.plan.view, progress)
    }

    /// The picture from another side.
    ///
    /// # Errors
    /// `E_LIMIT`, `E_SOURCE` of the device.
    pub fn picture_from(&self, view: &View, progress: Progress<'_>) -> Result<Rendered> {
        match (&self.loaded, &self.backend) {
            (Loaded::Gpu(loaded), _) => {
                let (image, passes) = loaded.picture(&self.plan, &self.scene, view, progress)?;
                Ok(Rendered { image, work: None, passes })
            }
            (Loaded::Host(levels), Backend::CpuF32) => self.by_cpu::<f32>(levels, view, progress),
            (Loaded::Host(levels), _) => self.by_cpu::<f64>(levels, view, progress),
        }
    }

    fn by_cpu<R: Real>(&self, levels: &[HostLevel], view: &View, progress: Progress<'_>) -> Result<Rendered> {
        let started = Instant::now();
        let lies = setup::Lies::all(&self.plan, view)?;
        let frame = setup::frame::<R>(&self.plan, &self.scene, view, &lies);
        let skips = self.plan.key.bindings().iter().any(|b| b.name == "visible");
        let masks: Vec<Vec<u8>> = self
            .plan
            .levels
            .iter()
            .map(|l| if skips { l.visible.bits().iter().map(|&b| u8::from(b)).collect() } else { Vec::new() })
            .collect();
        let volumes = self
            .plan
            .levels
            .iter()
            .zip(levels)
            .zip(&masks)
            .zip(&lies)
            .map(|(((planned, level), mask), lies)| {
                lies.volume::<R>(level, mask, &self.scene.volumes[planned.volume].transfer)
            })
            .collect::<Vec<_>>();
        let groups: Vec<&[mirror::Volume<'_, R>]> = match self.plan.key.shown() == volumes.len() {
            true => volumes.chunks(1).collect(),
            false => vec![&volumes],
        };
        let (image, work) = reference::picture::<R, Work>(&frame, &groups, &|done, of| progress("render", done, of));
        let passes = vec![PassTime::wall(self.plan.key.entry(), started)];
        Ok(Rendered { image, work: Some(work), passes })
    }

    /// Takes another transfer function for a volume of the scene. What lies in memory stays there: only bricks that become
    /// visible are loaded (Marton et al. 2014, §6).
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn set_transfer(&mut self, volume: usize, transfer: TransferFunction, progress: Progress<'_>) -> Result<()> {
        let mut scene = self.scene.clone();
        scene.volumes[volume].transfer = transfer;
        let plan = plan_for(&scene, &self.volumes, &self.backend, &self.views)?;
        for (i, planned) in plan.levels.iter().enumerate() {
            let volume = &self.volumes[planned.volume];
            match &mut self.loaded {
                Loaded::Gpu(scene) => scene.add(i, planned, volume, progress)?,
                Loaded::Host(levels) => {
                    let wanted = |brick| planned.wanted.has(brick);
                    levels[i].add(volume, &wanted, &mut |done, of| progress("load", done, of))?;
                }
            }
        }
        if let Loaded::Gpu(loaded) = &mut self.loaded {
            loaded.show(&plan)?;
        }
        (self.scene, self.plan) = (scene, plan);
        Ok(())
    }
}

fn plan_for(scene: &Scene, volumes: &[Arc<Volume>], backend: &Backend, views: &[View]) -> Result<Plan> {
    let refs: Vec<&Volume> = volumes.iter().map(|v| &**v).collect();
    let mut plan = Plan::new(scene, &refs, &backend.fit())?;
    plan.cull_to(scene, views)?;
    Ok(plan)
}

fn load(
    plan: &Plan,
    volumes: &[Arc<Volume>],
    backend: &Backend,
    pipelines: &Arc<Pipelines>,
    progress: Progress<'_>,
) -> Result<(Loaded, Vec<PassTime>)> {
    if let Backend::Gpu(gpu, _) = backend {
        let scene = gpu::GpuScene::load(gpu, pipelines, plan, volumes, progress)?;
        let loading = scene.loading.clone();
        return Ok((Loaded::Gpu(scene), loading));
    }
    let mut loading = Vec::new();
    let mut levels = Vec::new();
    for planned in &plan.levels {
        let started = Instant::now();
        let wanted = |brick| planned.wanted.has(brick);
        let mut told = |done, of| progress("load", done, of);
        levels.push(HostLevel::load(&volumes[planned.volume], planned.layout.clone(), &wanted, &mut told)?);
        loading.push(PassTime::wall("load", started));
    }
    Ok((Loaded::Host(levels), loading))
}
