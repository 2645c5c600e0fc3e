//! Pipelines of pictures, made when they are first needed, and the few last used ones kept.

use super::device::Gpu;
use super::key::{PipelineKey, Texel, Traversal};
use super::pass::slice;
use super::shader::{Binding, BindingKind};
use crate::error::Result;
use std::sync::{Arc, Mutex, PoisonError};

/// Pipelines that are kept.
const KEPT: usize = 32;

/// A pipeline.
#[derive(Debug)]
pub enum Pipeline {
    /// Of rays and cutting planes.
    Compute(wgpu::ComputePipeline),
    /// Of slices.
    Slices(wgpu::RenderPipeline),
}

/// A pipeline and the layouts of its bind groups.
#[derive(Debug)]
pub struct Compiled {
    /// The pipeline.
    pub pipeline: Pipeline,
    /// Layouts of the bind groups, in order.
    pub groups: Vec<wgpu::BindGroupLayout>,
}

type Entry = ((PipelineKey, Vec<(String, u64)>), Arc<Compiled>);

/// Pipelines by key and values of constants; the last used one is the last.
#[derive(Debug, Default)]
pub struct Pipelines(Mutex<Vec<Entry>>);

impl Pipelines {
    /// The pipeline of a picture.
    ///
    /// # Errors
    /// `E_SOURCE` where the device refuses it.
    pub fn get(&self, gpu: &Gpu, key: &PipelineKey, constants: &[(String, f64)]) -> Result<Arc<Compiled>> {
        let wanted = (key.clone(), constants.iter().map(|(n, v)| (n.clone(), v.to_bits())).collect::<Vec<_>>());
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let made = match kept.iter().position(|(k, _)| *k == wanted) {
            Some(at) => kept.remove(at),
            None => (wanted, Arc::new(compile(gpu, key, constants)?)),
        };
        let found = made.1.clone();
        kept.push(made);
        let many = kept.len().saturating_sub(KEPT);
        kept.drain(..many);
        Ok(found)
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Layouts of the bind groups of `bindings`.
#[must_use]
pub fn group_layouts(gpu: &Gpu, bindings: &[Binding], stages: wgpu::ShaderStages) -> Vec<wgpu::BindGroupLayout> {
    let groups = bindings.iter().map(|b| b.group).max().map_or(0, |g| g + 1);
    (0..groups)
        .map(|group| {
            let entries: Vec<_> = bindings
                .iter()
                .filter(|b| b.group == group)
                .map(|b| wgpu::BindGroupLayoutEntry {
                    binding: b.binding,
                    visibility: stages,
                    ty: kind(b.kind),
                    count: None,
                })
                .collect();
            gpu.device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("group"), entries: &entries })
        })
        .collect()
}

fn kind(kind: BindingKind) -> wgpu::BindingType {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let texture = |sample_type| wgpu::BindingType::Texture {
        sample_type,
        view_dimension: wgpu::TextureViewDimension::D3,
        multisampled: false,
    };
    match kind {
        BindingKind::Uniform => buffer(wgpu::BufferBindingType::Uniform),
        BindingKind::Written => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
        BindingKind::Read => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
        BindingKind::Texture(Texel::Uint) => texture(wgpu::TextureSampleType::Uint),
        BindingKind::Texture(Texel::Sint) => texture(wgpu::TextureSampleType::Sint),
        BindingKind::Texture(Texel::Float) => texture(wgpu::TextureSampleType::Float { filterable: false }),
        BindingKind::Filtered => texture(wgpu::TextureSampleType::Float { filterable: true }),
        BindingKind::Sampler => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
    }
}

fn compile(gpu: &Gpu, key: &PipelineKey, constants: &[(String, f64)]) -> Result<Compiled> {
    let text = key.wgsl();
    let stages = match key.traversal {
        Traversal::Slice => wgpu::ShaderStages::FRAGMENT,
        Traversal::Raycast | Traversal::CutPlane => wgpu::ShaderStages::COMPUTE,
    };
    let groups = group_layouts(gpu, &key.bindings(), stages);
    let constants: Vec<(&str, f64)> = constants.iter().map(|(n, v)| (n.as_str(), *v)).collect();
    let pipeline = gpu.checked(|| {
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(key.entry()),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(key.entry()),
            bind_group_layouts: &groups.iter().map(Some).collect::<Vec<_>>(),
            immediate_size: 0,
        });
        if key.traversal == Traversal::Slice {
            return Pipeline::Slices(slice::pipeline(gpu, &module, &layout, key.entry(), &constants));
        }
        Pipeline::Compute(gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(key.entry()),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(key.entry()),
            compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
            cache: None,
        }))
    })?;
    Ok(Compiled { pipeline, groups })
}
