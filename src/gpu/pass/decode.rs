//! The decode pass: a level's voxels into a texture of their own, which samplers then read instead (source = deferred).

use super::super::compose::{Choice, compose};
use super::super::device::Gpu;
use super::super::key::{Form, Texel, VolumeKey};
use super::super::layout::DecodeParams;
use super::super::level::{LevelLayout, Role, Store, TexelFormat};
use super::super::shader::{PAGE_BINDING, file};
use super::super::upload::{GpuLevel, texture};
use crate::error::{Error, Result};
use crate::voxel::SampleType;
use wgpu::util::DeviceExt;

/// Invocations of a workgroup, per axis.
const GROUP: [u32; 3] = [16, 4, 4];
/// Workgroups that a dispatch may have per axis, on every device.
const MOST_GROUPS: u32 = 65_535;

/// What a level's voxels are to a shader.
#[must_use]
pub fn volume_key(layout: &LevelLayout, pages: u32) -> VolumeKey {
    let sample = layout.store.sample();
    let texel = |format: TexelFormat| match format {
        TexelFormat::R16Sint | TexelFormat::Rg16Sint => Texel::Sint,
        TexelFormat::R32Float | TexelFormat::Rg32Float => Texel::Float,
        TexelFormat::R8Unorm | TexelFormat::R16Unorm | TexelFormat::Rgba8Unorm => Texel::Float,
        _ => Texel::Uint,
    };
    let format = |role| layout.texture_of(role).map_or(TexelFormat::R8Uint, |t| layout.textures[t].format);
    let form = match layout.store {
        Store::Raw { .. } => Form::Raw(texel(format(Role::Raw))),
        Store::S3dc { .. } => Form::S3dc(texel(format(Role::Minmax))),
        Store::Zerobit { new_stream, .. } => Form::Zerobit {
            pages,
            new: new_stream,
            wide: matches!(sample, SampleType::U16 | SampleType::I16),
            signed: sample == SampleType::I16,
        },
    };
    VolumeKey { form, colour: sample == SampleType::Rgb8, folded: !layout.fold.is_flat() }
}

/// The `override` constants of a level's source, for volume `i` of a shader.
#[must_use]
pub fn source_constants(layout: &LevelLayout, i: usize) -> Vec<(String, f64)> {
    let mut all = Vec::new();
    if let Store::S3dc { index_bits, block, .. } = layout.store {
        all.push((format!("INDEX_BITS_{i}"), f64::from(index_bits)));
        all.push((format!("WORD_LOG2_{i}"), f64::from((16 / index_bits).trailing_zeros())));
        for (axis, edge) in ["X", "Y", "Z"].iter().zip(block) {
            all.push((format!("BLOCK_{axis}_{i}"), f64::from(edge)));
        }
        all.push((format!("ALIGNED_{i}"), f64::from(u8::from(layout.is_aligned(block)))));
    }
    all
}

/// Where decoded voxels go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Out {
    /// Into a texture of this format.
    Texture(TexelFormat),
    /// As bits into a buffer.
    Words,
}

/// The text of the pass: the level's source, as in pictures, and `decode.wgsl`.
fn wgsl(key: &VolumeKey, out: Out) -> Result<String> {
    let (source, s3dc) = match key.form {
        Form::Raw(_) => {
            return Err(Error::param("source", "samples of a raw level are there already: nothing to decode"));
        }
        Form::S3dc(_) => ("source_s3dc", true),
        Form::Zerobit { .. } => ("source_zerobit", false),
    };
    let mut choice = Choice { volumes: vec![key.choice(0)], ..Choice::default() };
    let filtered = out == Out::Texture(TexelFormat::Rgba8Unorm);
    let float = key.form == Form::S3dc(Texel::Float);
    let flags = [
        ("s3dc", s3dc),
        ("words", out == Out::Words),
        ("colour", key.colour),
        ("float", float),
        ("folded", key.folded),
        ("filtered", filtered),
    ];
    choice.flags = flags.into_iter().filter(|(_, set)| *set).map(|(name, _)| name).collect();
    choice.words = vec![("DECODED", if key.colour { "vec3f" } else { "f32" }.to_owned())];
    let mut text = DecodeParams::WGSL.to_owned();
    text.push_str("@group(1) @binding(0) var<uniform> volume_0: DecodeParams;\n");
    text.push_str("override BRICK_LOG2_0: u32 = 5u;\n");
    if key.folded {
        text.push_str(&compose("fold", file("fold"), &choice, Some(0))?);
    }
    text.push_str(&compose(source, file(source), &choice, Some(0))?);
    text.push_str(&compose("decode", file("decode"), &choice, None)?);
    Ok(text)
}

/// The text for a level that is decoded into `format`, for those who check shaders without a device.
///
/// # Errors
/// `E_PARAM` for raw levels.
pub fn shader(key: &VolumeKey, format: TexelFormat) -> Result<String> {
    wgsl(key, Out::Texture(format))
}

/// A pass that is ready to run.
#[derive(Debug)]
pub struct DecodePass {
    pipeline: wgpu::ComputePipeline,
    groups: Vec<[wgpu::BindGroup; 2]>,
    dispatches: Vec<[u32; 3]>,
    /// What is decoded into; none for a pass into a buffer.
    pub output: Option<wgpu::Texture>,
    words: Option<wgpu::Buffer>,
}

impl DecodePass {
    /// The pass that decodes `level` into a texture as its layout says ([`LevelLayout::deferred`]).
    ///
    /// # Errors
    /// `E_PARAM` where the layout is not of source deferred; `E_LIMIT` where memory runs out; `E_SOURCE` where the device does not
    /// take the shader.
    pub fn new(gpu: &Gpu, level: &GpuLevel) -> Result<DecodePass> {
        let Some(wanted) = level.layout.decoded else {
            return Err(Error::param("source", "this level is not laid out to be decoded on the device"));
        };
        let output = gpu.checked(|| texture(gpu, &wanted, wgpu::TextureUsages::STORAGE_BINDING))?;
        DecodePass::into(gpu, level, Out::Texture(wanted.format), Some(output))
    }

    fn into(gpu: &Gpu, level: &GpuLevel, out: Out, output: Option<wgpu::Texture>) -> Result<DecodePass> {
        let layout = &level.layout;
        let key = volume_key(layout, u32::try_from(level.pages.len()).unwrap_or(u32::MAX));
        let text = wgsl(&key, out)?;
        let words = (out == Out::Words).then(|| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("decoded"),
                size: layout.extent.voxels() * 4,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        });
        gpu.checked(|| {
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("decode"),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            });
            let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty,
                count: None,
            };
            let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
            let written = match out {
                Out::Words => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
                Out::Texture(format) => wgpu::BindingType::StorageTexture {
                    access: wgpu::StorageTextureAccess::WriteOnly,
                    format: format.wgpu(),
                    view_dimension: wgpu::TextureViewDimension::D3,
                },
            };
            let mut read = vec![entry(0, buffer(wgpu::BufferBindingType::Uniform))];
            let views = sources(level);
            for (binding, source) in &views {
                let ty = match source {
                    Bound::Texture(_, sample_type) => wgpu::BindingType::Texture {
                        sample_type: *sample_type,
                        view_dimension: wgpu::TextureViewDimension::D3,
                        multisampled: false,
                    },
                    Bound::Buffer(_) => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
                };
                read.push(entry(*binding, ty));
            }
            let make = |entries: &[_]| {
                let label = Some("decode");
                gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries })
            };
            let layouts = [make(&[entry(0, written)]), make(&read)];
            let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("decode"),
                bind_group_layouts: &[Some(&layouts[0]), Some(&layouts[1])],
                immediate_size: 0,
            });
            let mut constants = source_constants(layout, 0);
            constants.push(("BRICK_LOG2_0".to_owned(), f64::from(layout.brick_log2)));
            let constants: Vec<(&str, f64)> = constants.iter().map(|(n, v)| (n.as_str(), *v)).collect();
            let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("decode"),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("decode"),
                compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
                cache: None,
            });
            let (mut groups, mut dispatches) = (Vec::new(), Vec::new());
            for (first, count) in parts(layout) {
                let params = params(layout, first);
                let uniform = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                    label: Some("decode"),
                    contents: bytemuck::bytes_of(&params),
                    usage: wgpu::BufferUsages::UNIFORM,
                });
                let out_view = output.as_ref().map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()));
                let resource = match (&words, &out_view) {
                    (Some(words), _) => words.as_entire_binding(),
                    (None, Some(view)) => wgpu::BindingResource::TextureView(view),
                    (None, None) => unreachable!("a pass has one of both"),
                };
                let bind = |layout: &wgpu::BindGroupLayout, entries: &[wgpu::BindGroupEntry<'_>]| {
                    let label = Some("decode");
                    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries })
                };
                let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }];
                entries.extend(views.iter().map(|(binding, source)| wgpu::BindGroupEntry {
                    binding: *binding,
                    resource: match source {
                        Bound::Texture(view, _) => wgpu::BindingResource::TextureView(view),
                        Bound::Buffer(buffer) => buffer.as_entire_binding(),
                    },
                }));
                groups.push([
                    bind(&layouts[0], &[wgpu::BindGroupEntry { binding: 0, resource }]),
                    bind(&layouts[1], &entries),
                ]);
                dispatches.push(count);
            }
            DecodePass { pipeline, groups, dispatches, output, words }
        })
    }

    /// Records the pass.
    pub fn record(&self, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_pipeline(&self.pipeline);
        for (groups, [x, y, z]) in self.groups.iter().zip(&self.dispatches) {
            pass.set_bind_group(0, &groups[0], &[]);
            pass.set_bind_group(1, &groups[1], &[]);
            pass.dispatch_workgroups(*x, *y, *z);
        }
    }

    /// Runs the pass by itself, and waits for it.
    ///
    /// # Errors
    /// `E_SOURCE` where the device finds something wrong.
    pub fn run(&self, gpu: &Gpu) -> Result<()> {
        gpu.checked(|| {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.record(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
            gpu.queue.submit([encoder.finish()]);
        })?;
        gpu.wait()
    }
}

/// The bits of every voxel of a level as the device decodes it, x fastest, then y, then z: one word each, of rgb8 in the low
/// bytes. For comparing decoders.
///
/// # Errors
/// As [`DecodePass::new`]; `E_LIMIT` where the words do not fit one binding.
pub fn decode_words(gpu: &Gpu, level: &GpuLevel) -> Result<Vec<u32>> {
    let bytes = level.layout.extent.voxels().saturating_mul(4);
    crate::limits::check("gpu-mem", bytes, gpu.limits.max_storage_buffer_binding_size)?;
    let pass = DecodePass::into(gpu, level, Out::Words, None)?;
    pass.run(gpu)?;
    let bytes = pass.words.as_ref().map(|words| gpu.read_buffer(words)).transpose()?.unwrap_or_default();
    Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}

/// What a source is bound to.
enum Bound<'a> {
    Texture(wgpu::TextureView, wgpu::TextureSampleType),
    Buffer(&'a wgpu::Buffer),
}

/// The bindings of a level's source, as pictures have them.
fn sources(level: &GpuLevel) -> Vec<(u32, Bound<'_>)> {
    let mut all = Vec::new();
    for (binding, role) in [(1, Role::Index), (2, Role::Minmax)] {
        if let Some(t) = level.layout.texture_of(role) {
            let sample_type = match level.layout.textures[t].format {
                TexelFormat::Rg16Sint => wgpu::TextureSampleType::Sint,
                TexelFormat::Rg32Float => wgpu::TextureSampleType::Float { filterable: false },
                _ => wgpu::TextureSampleType::Uint,
            };
            let view = level.textures[t].create_view(&wgpu::TextureViewDescriptor::default());
            all.push((binding, Bound::Texture(view, sample_type)));
        }
    }
    if let Some([table, books]) = &level.tables {
        all.extend([(1, Bound::Buffer(table)), (2, Bound::Buffer(books))]);
        all.extend((PAGE_BINDING..).zip(level.pages.iter().map(Bound::Buffer)));
    }
    all
}

/// Invocations that the level takes, per axis: of s3dc one per word along x.
fn invocations(layout: &LevelLayout) -> [u32; 3] {
    let per_word = match layout.store {
        Store::S3dc { index_bits, .. } => 16 / index_bits,
        _ => 1,
    };
    let e = layout.extent;
    [e.x.div_ceil(per_word), e.y, e.z]
}

/// The dispatches: first invocation and workgroups of each.
fn parts(layout: &LevelLayout) -> Vec<([u32; 3], [u32; 3])> {
    let n = invocations(layout);
    let groups: [u32; 3] = std::array::from_fn(|a| n[a].div_ceil(GROUP[a]));
    let starts = |a: usize| (0..groups[a]).step_by(MOST_GROUPS as usize);
    let mut all = Vec::new();
    for z in starts(2) {
        for y in starts(1) {
            for x in starts(0) {
                let from = [x, y, z];
                let count = std::array::from_fn(|a| (groups[a] - from[a]).min(MOST_GROUPS));
                all.push((std::array::from_fn(|a| from[a] * GROUP[a]), count));
            }
        }
    }
    all
}

fn params(layout: &LevelLayout, first: [u32; 3]) -> DecodeParams {
    DecodeParams {
        extent: layout.extent.to_array(),
        first,
        last: layout.extent.to_array().map(|n| i32::try_from(n).unwrap_or(i32::MAX) - 1),
        fold_tile: layout.fold.tile,
        fold_tiles: layout.fold.tiles,
        fold_grid: layout.fold.grid,
        brick: layout.brick_voxels(),
        bricks: layout.bricks,
        ..bytemuck::Zeroable::zeroed()
    }
}
