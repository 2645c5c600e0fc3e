//! The picture by a GPU: what the plan names, made once, and one dispatch per band of rows.

use super::camera::View;
use super::image::Image;
use super::mirror;
use super::plan::{Plan, PlannedLevel, band_rows};
use super::scene::Scene;
use super::setup::{Lies, frame, frame_bytes, overrides};
use super::{PassTime, Progress};
use crate::error::{Code, Error, Result};
use crate::gpu::key::Form;
use crate::gpu::layout;
use crate::gpu::level::Filled;
use crate::gpu::pass::decode::DecodePass;
use crate::gpu::pass::slice::SliceTarget;
use crate::gpu::pipeline::{Compiled, Pipeline, Pipelines};
use crate::gpu::shader::{BindingKind, PAGE_BINDING};
use crate::gpu::{Gpu, GpuLevel, PipelineKey};
use crate::volume::Volume;
use std::sync::Arc;
use std::time::Instant;

/// A scene in the memory of a GPU.
pub struct GpuScene {
    gpu: Arc<Gpu>,
    pipelines: Arc<Pipelines>,
    levels: Vec<Resident>,
    /// What was run once when the scene was loaded.
    pub loading: Vec<PassTime>,
}

/// A level, and what belongs to it.
struct Resident {
    level: GpuLevel,
    decoded: Option<DecodePass>,
    params: wgpu::Buffer,
    visible: Option<wgpu::Texture>,
}

impl GpuScene {
    /// Uploads what a plan names.
    ///
    /// # Errors
    /// Those of [`GpuLevel::upload`].
    pub fn load(
        gpu: &Arc<Gpu>,
        pipelines: &Arc<Pipelines>,
        plan: &Plan,
        volumes: &[Arc<Volume>],
        progress: Progress<'_>,
    ) -> Result<GpuScene> {
        // Mesa's llvmpipe (22.3) crashes in shaders with four bind groups.
        if gpu.is_software() && plan.levels.len() > 2 {
            let message = "software adapters take two volumes at most; render three with --adapter cpu, or on a GPU";
            return Err(Error::new(Code::Unsupported, "volume", message));
        }
        let mut loading = Vec::new();
        let mut levels = Vec::new();
        for planned in &plan.levels {
            let wanted = |brick| planned.wanted.has(brick);
            let started = Instant::now();
            let mut told = |done, of| progress("upload", done, of);
            let level = GpuLevel::upload(gpu, &volumes[planned.volume], planned.layout.clone(), &wanted, &mut told)?;
            loading.push(PassTime::wall("upload", started));
            let decoded = match planned.layout.decoded {
                Some(_) => {
                    let started = Instant::now();
                    let pass = DecodePass::new(gpu, &level)?;
                    pass.run(gpu)?;
                    loading.push(PassTime::wall("decode", started));
                    Some(pass)
                }
                None => None,
            };
            let params = buffer(gpu, size_of::<layout::VolumeParams>(), wgpu::BufferUsages::UNIFORM);
            levels.push(Resident { level, decoded, params, visible: None });
        }
        let mut scene = GpuScene { gpu: gpu.clone(), pipelines: pipelines.clone(), levels, loading };
        scene.show(plan)?;
        Ok(scene)
    }

    /// Takes over which bricks can be seen.
    ///
    /// # Errors
    /// `E_LIMIT`, `E_SOURCE` of the device.
    pub fn show(&mut self, plan: &Plan) -> Result<()> {
        let skips = plan.key.bindings().iter().any(|b| b.name == "visible");
        for (resident, planned) in self.levels.iter_mut().zip(&plan.levels) {
            resident.visible = if skips { Some(visible(&self.gpu, planned)?) } else { None };
        }
        Ok(())
    }

    /// What was written to the device.
    #[must_use]
    pub fn filled(&self) -> Vec<Filled> {
        self.levels.iter().map(|l| l.level.filled).collect()
    }

    /// Uploads the bricks of level `i` that the plan wants and that are not there.
    ///
    /// # Errors
    /// Those of [`GpuLevel::upload`].
    pub fn add(&mut self, i: usize, planned: &PlannedLevel, volume: &Volume, progress: Progress<'_>) -> Result<()> {
        let gpu = self.gpu.clone();
        let resident = &mut self.levels[i];
        let started = Instant::now();
        let wanted = |brick| planned.wanted.has(brick);
        let more = resident.level.add(&gpu, volume, &wanted, &mut |done, of| progress("upload", done, of))?;
        if more.bytes() == 0 {
            return Ok(());
        }
        self.loading.push(PassTime::wall("upload", started));
        if resident.decoded.is_some() {
            let pass = DecodePass::new(&gpu, &resident.level)?;
            pass.run(&gpu)?;
            resident.decoded = Some(pass);
        }
        Ok(())
    }

    /// Renders.
    ///
    /// # Errors
    /// `E_LIMIT`, `E_SOURCE` of the device.
    pub fn picture(
        &self,
        plan: &Plan,
        scene: &Scene,
        view: &View,
        progress: Progress<'_>,
    ) -> Result<(Image, Vec<PassTime>)> {
        let gpu = &*self.gpu;
        let key = self.key(plan);
        let compiled = self.pipelines.get(gpu, &key, &overrides(plan, scene))?;
        let lies = Lies::all(plan, view)?;
        let frame: mirror::Frame<f32> = frame(plan, scene, view, &lies);
        for ((resident, planned), lies) in self.levels.iter().zip(&plan.levels).zip(&lies) {
            let params = lies.params(planned, &scene.volumes[planned.volume].transfer);
            gpu.queue.write_buffer(&resident.params, 0, bytemuck::bytes_of(&params));
        }
        let [width, height] = view.size;
        let rows = band_rows(view.size, &gpu.fit(None));
        let uniform = buffer(gpu, size_of::<layout::Frame>(), wgpu::BufferUsages::UNIFORM);
        let target = match compiled.pipeline {
            Pipeline::Compute(_) => {
                Target::Buffer(buffer(gpu, width as usize * rows as usize * 16, wgpu::BufferUsages::STORAGE))
            }
            Pipeline::Slices(_) => Target::Slices(SliceTarget::new(gpu, width, rows)?),
        };
        let groups = self.groups(&key, &compiled, &uniform, target.buffer())?;
        let timer = Timer::new(gpu);
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        let mut time = PassTime { name: key.entry().to_owned(), milliseconds: 0.0, by_device: timer.is_some() };
        for first in (0..height).step_by(rows as usize) {
            let count = rows.min(height - first);
            gpu.queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&frame_bytes(&frame, first, count)));
            let started = Instant::now();
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            match (&compiled.pipeline, &target) {
                (Pipeline::Slices(pipeline), Target::Slices(target)) => {
                    let writes = timer.as_ref().map(Timer::render_writes);
                    target.record(&mut encoder, pipeline, &groups, frame.samples, writes);
                }
                (Pipeline::Compute(pipeline), _) => {
                    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                        label: Some(key.entry()),
                        timestamp_writes: timer.as_ref().map(Timer::writes),
                    });
                    pass.set_pipeline(pipeline);
                    for (i, group) in groups.iter().enumerate() {
                        pass.set_bind_group(i as u32, group, &[]);
                    }
                    pass.dispatch_workgroups(width.div_ceil(8), count.div_ceil(8), 1);
                }
                (Pipeline::Slices(_), Target::Buffer(_)) => unreachable!("slices have a target of their own"),
            }
            if let Some(timer) = &timer {
                timer.resolve(&mut encoder);
            }
            gpu.queue.submit([encoder.finish()]);
            gpu.wait()?;
            time.milliseconds += match &timer {
                Some(timer) => timer.milliseconds(gpu)?,
                None => started.elapsed().as_secs_f64() * 1e3,
            };
            let band = match &target {
                Target::Buffer(buffer) => bytemuck::pod_collect_to_vec(&gpu.read_buffer(buffer)?),
                Target::Slices(target) => target.read(gpu)?,
            };
            pixels.extend_from_slice(&band[..width as usize * count as usize]);
            progress("render", (first + count).into(), height.into());
        }
        Ok((Image { width, height, pixels }, vec![time]))
    }

    /// The plan's key for what there is: streams may take fewer pages than planned.
    fn key(&self, plan: &Plan) -> PipelineKey {
        let mut key = plan.key.clone();
        for (v, resident) in key.volumes.iter_mut().zip(&self.levels) {
            if let Form::Zerobit { pages, .. } = &mut v.form {
                *pages = u32::try_from(resident.level.pages.len()).unwrap_or(u32::MAX);
            }
        }
        key
    }

    fn groups(
        &self,
        key: &PipelineKey,
        compiled: &Compiled,
        frame: &wgpu::Buffer,
        picture: Option<&wgpu::Buffer>,
    ) -> Result<Vec<wgpu::BindGroup>> {
        let gpu = &*self.gpu;
        let bindings = key.bindings();
        let filter = bindings.iter().any(|b| b.kind == BindingKind::Sampler).then(|| sampler(gpu));
        let made = compiled.groups.iter().enumerate().map(|(g, layout)| {
            let own: Vec<_> = bindings.iter().filter(|b| b.group as usize == g).collect();
            let resident = g.checked_sub(1).map(|v| &self.levels[v]);
            let views: Vec<Option<wgpu::TextureView>> = own
                .iter()
                .map(|b| Some(resident?.texture(b.name)?.create_view(&wgpu::TextureViewDescriptor::default())))
                .collect();
            let entries: Vec<_> = own
                .iter()
                .zip(&views)
                .map(|(b, view)| wgpu::BindGroupEntry {
                    binding: b.binding,
                    resource: match (b.name, view, resident) {
                        (_, Some(view), _) => wgpu::BindingResource::TextureView(view),
                        ("frame", ..) => frame.as_entire_binding(),
                        ("picture", ..) => picture.expect("slices have no such binding").as_entire_binding(),
                        ("filter", ..) => wgpu::BindingResource::Sampler(filter.as_ref().expect("made above")),
                        (name, _, Some(resident)) => resident.buffer(name, b.binding).as_entire_binding(),
                        (name, ..) => unreachable!("no binding {name} in the frame's group"),
                    },
                })
                .collect();
            let wanted = wgpu::BindGroupDescriptor { label: Some("group"), layout, entries: &entries };
            gpu.checked(|| gpu.device.create_bind_group(&wanted))
        });
        made.collect()
    }
}

/// Where pixels go.
enum Target {
    Buffer(wgpu::Buffer),
    Slices(SliceTarget),
}

impl Target {
    const fn buffer(&self) -> Option<&wgpu::Buffer> {
        match self {
            Target::Buffer(buffer) => Some(buffer),
            Target::Slices(_) => None,
        }
    }
}

impl Resident {
    fn texture(&self, name: &str) -> Option<&wgpu::Texture> {
        use crate::gpu::level::Role;
        let role = match name {
            "raw" => match &self.decoded {
                Some(pass) => return pass.output.as_ref(),
                None => Role::Raw,
            },
            "index" => Role::Index,
            "minmax" => Role::Minmax,
            "visible" => return self.visible.as_ref(),
            _ => return None,
        };
        let at = self.level.layout.textures.iter().position(|t| t.role == role)?;
        self.level.textures.get(at)
    }

    fn buffer(&self, name: &str, binding: u32) -> &wgpu::Buffer {
        match (name, &self.level.tables) {
            ("table", Some([table, _])) => table,
            ("books", Some([_, books])) => books,
            (name, _) if name.starts_with("page") => &self.level.pages[(binding - PAGE_BINDING) as usize],
            _ => &self.params,
        }
    }
}

/// One texel per brick: 1 where it can be seen.
fn visible(gpu: &Gpu, planned: &PlannedLevel) -> Result<wgpu::Texture> {
    // In tiles, as the level itself.
    let fold = planned.layout.fold;
    let [width, height, depth_or_array_layers] = fold.bricks();
    let size = wgpu::Extent3d { width, height, depth_or_array_layers };
    let texture = gpu.checked(|| {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("visible"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format: wgpu::TextureFormat::R8Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        })
    })?;
    let mut bytes = vec![0u8; width as usize * height as usize * depth_or_array_layers as usize];
    let [nx, ny, nz] = planned.layout.bricks;
    for brick in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z]))) {
        let [x, y, z] = fold.place(brick).map(|v| v as usize);
        bytes[x + width as usize * (y + height as usize * z)] = u8::from(planned.visible.has(brick));
    }
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width), rows_per_image: Some(height) };
    gpu.queue.write_texture(texture.as_image_copy(), &bytes, layout, size);
    Ok(texture)
}

fn buffer(gpu: &Gpu, bytes: usize, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: bytes as u64,
        usage: usage | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

fn sampler(gpu: &Gpu) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("trilinear"),
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    })
}

/// Two timestamps around a pass.
struct Timer {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    period: f32,
}

impl Timer {
    fn new(gpu: &Gpu) -> Option<Timer> {
        let period = gpu.timestamp_period?;
        let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("timestamps"),
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        let resolved = buffer(gpu, 16, wgpu::BufferUsages::QUERY_RESOLVE);
        Some(Timer { set, resolved, period })
    }

    fn writes(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    fn render_writes(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.set, 0..2, &self.resolved, 0);
    }

    fn milliseconds(&self, gpu: &Gpu) -> Result<f64> {
        let bytes = gpu.read_buffer(&self.resolved)?;
        let ticks: &[u64] = bytemuck::cast_slice(&bytes);
        Ok(ticks[1].saturating_sub(ticks[0]) as f64 * f64::from(self.period) / 1e6)
    }
}
