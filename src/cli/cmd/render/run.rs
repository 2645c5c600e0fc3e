//! A scene on a device: opened by what the command line says, loaded when the first picture is wanted.

use crate::cli::args::Render;
use crate::cli::output::progress;
use crate::error::{Error, Result};
use crate::gpu::device::{AdapterChoice, Gpu};
use crate::gpu::{Effect, key};
use crate::render::camera::View;
use crate::render::fidelity::{Bytes, Device, PassTimes};
use crate::render::image::Image;
use crate::render::plan::Plan;
use crate::render::scene::Scene;
use crate::render::{Backend, PassTime, Renderer};
use crate::volume::Volume;
use indicatif::ProgressBar;
use std::sync::Arc;

/// A scene, its volumes, and what renders it.
pub(super) struct Session {
    scene: Scene,
    volumes: Vec<Arc<Volume>>,
    backend: Backend,
    device: Device,
    renderer: Option<Renderer>,
    views: Vec<View>,
    times: Vec<PassTimes>,
    notes: Vec<String>,
    bar: ProgressBar,
    last_ms: Option<f64>,
}

impl Session {
    /// Chooses the device. Nothing is loaded yet.
    pub(super) fn new(args: &Render, scene: Scene, volumes: Vec<Arc<Volume>>) -> Result<Self> {
        let (backend, notes) = backend(args, &scene)?;
        let device = describe(&backend);
        let bar = progress(args.common.quiet || args.common.json, "rendering");
        let (times, renderer, last_ms) = (Vec::new(), None, None);
        let mut session =
            Session { scene, volumes, backend, device, renderer, views: Vec::new(), times, notes, bar, last_ms };
        // All that will be looked at: what none of it shows is not loaded.
        let (start, of) = (session.view()?, args.turntable.unwrap_or(1));
        let frames = args.frames.clone().unwrap_or(0..of);
        session.views = frames.map(|i| turned(&start, i, of)).collect();
        Ok(session)
    }

    /// The same, without one effect.
    pub(super) fn without(&self, effect: Effect) -> Result<Session> {
        Ok(Session {
            scene: self.scene.without(effect),
            volumes: self.volumes.clone(),
            backend: self.backend.clone(),
            device: self.device.clone(),
            renderer: None,
            views: self.views.clone(),
            times: Vec::new(),
            notes: Vec::new(),
            bar: ProgressBar::hidden(),
            last_ms: None,
        })
    }

    pub(super) fn scene(&self) -> &Scene {
        &self.scene
    }

    pub(super) fn volumes(&self) -> Vec<&Volume> {
        self.volumes.iter().map(|v| &**v).collect()
    }

    pub(super) fn device(&self) -> &Device {
        &self.device
    }

    pub(super) fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Times of the passes so far.
    pub(super) fn times(&self) -> &[PassTimes] {
        &self.times
    }

    /// What the last picture took on the device.
    pub(super) fn last_ms(&self) -> Option<f64> {
        self.last_ms
    }

    /// The plan; made without loading anything, where nothing is loaded.
    pub(super) fn plan(&self) -> Result<Plan> {
        match &self.renderer {
            Some(renderer) => Ok(renderer.plan().clone()),
            None => {
                let mut plan = Plan::new(&self.scene, &self.volumes(), &self.backend.fit())?;
                plan.cull_to(&self.scene, &self.views)?;
                Ok(plan)
            }
        }
    }

    /// Where the scene is seen from.
    pub(super) fn view(&self) -> Result<View> {
        Ok(self.plan()?.view)
    }

    /// What is looked at: one view, or those of the turntable.
    pub(super) fn views(&self) -> Vec<View> {
        self.views.clone()
    }

    /// Bytes read from files and written to the device.
    pub(super) fn bytes(&self) -> Bytes {
        let read = self.volumes.iter().map(|v| v.cost().bytes).sum();
        let filled = self.renderer.iter().flat_map(Renderer::filled);
        Bytes { read, uploaded: filled.map(|f| f.bytes()).sum() }
    }

    /// Renders.
    pub(super) fn frame(&mut self, view: &View) -> Result<Image> {
        let bar = self.bar.clone();
        let told = move |what: &str, done: u64, of: u64| {
            bar.set_message(what.to_owned());
            bar.set_length(of);
            bar.set_position(done);
        };
        if self.renderer.is_none() {
            let (scene, volumes) = (self.scene.clone(), self.volumes.clone());
            let renderer = Renderer::for_views(scene, volumes, self.backend.clone(), self.views.clone(), &told)?;
            renderer.loading().iter().for_each(|pass| add(&mut self.times, pass));
            self.renderer = Some(renderer);
        }
        let Some(renderer) = &self.renderer else { return Err(Error::param("scene", "it is not loaded")) };
        let rendered = renderer.picture_from(view, &told)?;
        self.last_ms = Some(rendered.passes.iter().map(|p| p.milliseconds).sum());
        rendered.passes.iter().for_each(|pass| add(&mut self.times, pass));
        Ok(rendered.image)
    }

    /// Takes the bar away.
    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn add(times: &mut Vec<PassTimes>, pass: &PassTime) {
    match times.iter_mut().find(|t| t.name == pass.name && t.by_device == pass.by_device) {
        Some(times) => times.ms.push(pass.milliseconds),
        None => {
            let (name, by_device) = (pass.name.clone(), pass.by_device);
            times.push(PassTimes { name, ms: vec![pass.milliseconds], by_device });
        }
    }
}

/// The view of picture `i` of a turntable of `of`.
fn turned(start: &View, i: u32, of: u32) -> View {
    match i {
        0 => start.clone(),
        _ => start.turned(std::f64::consts::TAU * f64::from(i) / f64::from(of)),
    }
}

/// The device that is asked for; without a wish the best adapter there is, else the CPU.
fn backend(args: &Render, scene: &Scene) -> Result<(Backend, Vec<String>)> {
    let wish = args.adapter.as_deref();
    if wish == Some("cpu") {
        if args.gpu_mem.is_some() {
            return Err(Error::param("gpu-mem", "it is for GPUs; the CPU has all of this machine's memory"));
        }
        return Ok((Backend::Cpu, Vec::new()));
    }
    let choice = match wish {
        None => AdapterChoice::default(),
        Some("software") => AdapterChoice::software(),
        Some(name) => AdapterChoice { name: Some(name.to_owned()), ..AdapterChoice::default() },
    };
    match Gpu::open(&choice) {
        Ok(gpu) => {
            let software = wish.is_none() && gpu.is_software();
            let note = software.then(|| "there is no GPU: a software adapter renders, slowly".to_owned());
            Ok((Backend::Gpu(Arc::new(gpu), args.gpu_mem), note.into_iter().collect()))
        }
        // Whoever asked for nothing gets a picture all the same.
        Err(e) if wish.is_none() => {
            if args.gpu_mem.is_some() || scene.sampler == key::Sampler::HwLinear {
                return Err(e);
            }
            let note = format!("{}: the CPU renders, slowly", e.message());
            Ok((Backend::Cpu, vec![note]))
        }
        Err(e) => Err(e),
    }
}

fn describe(backend: &Backend) -> Device {
    match backend {
        Backend::Gpu(gpu, _) => {
            let info = &gpu.adapter_info;
            Device {
                adapter: info.name.clone(),
                kind: format!("{:?}", info.device_type).to_lowercase(),
                driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
                backend: info.backend.to_string(),
            }
        }
        cpu => Device { adapter: cpu.describe(), kind: "cpu".into(), ..Device::default() },
    }
}
