//! Slices: one quad per slab of the view, blended by the device from the front to the back.

use super::super::device::Gpu;
use crate::error::Result;

/// Name of the vertex entry point of `shaders/slice.wgsl`.
const CORNER: &str = "corner";
/// Corners of a quad.
const CORNERS: u32 = 4;

/// Format that slices are blended in: f32 where the device can, else f16, whose 11 bits lose faint slices.
#[must_use]
pub fn format(gpu: &Gpu) -> wgpu::TextureFormat {
    match gpu.features.contains(wgpu::Features::FLOAT32_BLENDABLE) {
        true => wgpu::TextureFormat::Rgba32Float,
        false => wgpu::TextureFormat::Rgba16Float,
    }
}

/// C + (1 − A)·c and A + (1 − A)·a: what lies behind is seen through what lies in front.
fn under() -> wgpu::BlendState {
    let component = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::OneMinusDstAlpha,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::BlendState { color: component, alpha: component }
}

/// The pipeline of a picture made of slices; what the device finds wrong is for [`Gpu::checked`].
pub fn pipeline(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    layout: &wgpu::PipelineLayout,
    entry: &str,
    constants: &[(&str, f64)],
) -> wgpu::RenderPipeline {
    let compilation_options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(entry),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(CORNER),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::TriangleStrip, ..Default::default() },
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(entry),
            compilation_options,
            targets: &[Some(wgpu::ColorTargetState {
                format: format(gpu),
                blend: Some(under()),
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// What slices are blended into: some rows of a picture.
#[derive(Debug)]
pub struct SliceTarget {
    texture: wgpu::Texture,
}

impl SliceTarget {
    /// For `width` × `rows` pixels.
    ///
    /// # Errors
    /// `E_LIMIT` where memory runs out, `E_SOURCE` where the device has no texture of that size.
    pub fn new(gpu: &Gpu, width: u32, rows: u32) -> Result<SliceTarget> {
        let texture = gpu.checked(|| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("slices"),
                size: wgpu::Extent3d { width, height: rows, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: format(gpu),
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        })?;
        Ok(SliceTarget { texture })
    }

    /// Records the pass: all slabs, in front of nothing.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &wgpu::RenderPipeline,
        groups: &[wgpu::BindGroup],
        slabs: u32,
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        let view = self.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("slice"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: None,
            timestamp_writes,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_pipeline(pipeline);
        for (group, i) in groups.iter().zip(0..) {
            pass.set_bind_group(i, group, &[]);
        }
        pass.draw(0..CORNERS, 0..slabs);
    }

    /// The pixels: premultiplied red, green, blue, opacity, rows from the top.
    ///
    /// # Errors
    /// As [`Gpu::wait`].
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<[f32; 4]>> {
        let bytes = gpu.read_texture(&self.texture)?;
        if self.texture.format() == wgpu::TextureFormat::Rgba32Float {
            let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
            return Ok(bytes.chunks_exact(16).map(|p| std::array::from_fn(|c| float(&p[4 * c..]))).collect());
        }
        let half = |b: &[u8]| of_half(u16::from_le_bytes([b[0], b[1]]));
        Ok(bytes.chunks_exact(8).map(|p| std::array::from_fn(|c| half(&p[2 * c..]))).collect())
    }
}

/// The number that an f16 stands for; pictures hold no NaN and no infinities.
fn of_half(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, mantissa) = (i32::from(bits >> 10 & 0x1F), f32::from(bits & 0x3FF));
    match exponent {
        0 => sign * mantissa * 2f32.powi(-24),
        _ => sign * (mantissa + 1024.0) * 2f32.powi(exponent - 25),
    }
}

#[cfg(test)]
mod tests {
    use super::of_half;

    #[test]
    fn halves_are_read() {
        let due =
            [(0, 0.0), (0x3C00, 1.0), (0x3800, 0.5), (0x3555, 0.333_251_95), (0x0001, 5.960_464_5e-8), (0xC000, -2.0)];
        for (bits, value) in due {
            assert_eq!(of_half(bits), value, "{bits:x}");
        }
        assert_eq!(of_half(0x7BFF), 65504.0);
    }
}
