//! A level on the GPU: payload bytes go to textures and buffers as they are.

use super::device::Gpu;
use super::level::{Filled, HostLevel, LevelLayout, LevelTarget, TexelFormat, TextureLayout, fill};
use crate::error::{Code, Result};
use crate::geometry::Coord;
use crate::volume::Volume;

/// Bytes that are written between submissions: what has been written waits in memory until then.
const BATCH_BYTES: u64 = 64 << 20;

impl TexelFormat {
    /// The format of the texture.
    #[must_use]
    pub const fn wgpu(self) -> wgpu::TextureFormat {
        match self {
            TexelFormat::R8Uint => wgpu::TextureFormat::R8Uint,
            TexelFormat::R16Uint => wgpu::TextureFormat::R16Uint,
            TexelFormat::R16Sint => wgpu::TextureFormat::R16Sint,
            TexelFormat::R32Float => wgpu::TextureFormat::R32Float,
            TexelFormat::Rg8Uint => wgpu::TextureFormat::Rg8Uint,
            TexelFormat::Rg16Uint => wgpu::TextureFormat::Rg16Uint,
            TexelFormat::Rg16Sint => wgpu::TextureFormat::Rg16Sint,
            TexelFormat::Rg32Float => wgpu::TextureFormat::Rg32Float,
            TexelFormat::Rgba8Uint => wgpu::TextureFormat::Rgba8Uint,
            TexelFormat::R8Unorm => wgpu::TextureFormat::R8Unorm,
            TexelFormat::R16Unorm => wgpu::TextureFormat::R16Unorm,
            TexelFormat::Rgba8Unorm => wgpu::TextureFormat::Rgba8Unorm,
        }
    }
}

/// A level in the memory of a GPU.
#[derive(Debug)]
pub struct GpuLevel {
    /// How it lies.
    pub layout: LevelLayout,
    /// One texture for each of the layout's.
    pub textures: Vec<wgpu::Texture>,
    /// Pages of zerobit streams.
    pub pages: Vec<wgpu::Buffer>,
    /// Brick table and codebooks of zerobit, as in [`super::level::HostLevel`].
    pub tables: Option<[wgpu::Buffer; 2]>,
    /// What was written.
    pub filled: Filled,
}

impl GpuLevel {
    /// Uploads the `wanted` bricks (position in bricks) of a level. `progress` is told how many bricks are done, of how many.
    ///
    /// # Errors
    /// `E_LIMIT` where the device has not enough memory, with what would fit; those of [`fill`].
    pub fn upload(
        gpu: &Gpu,
        volume: &Volume,
        layout: LevelLayout,
        wanted: &dyn Fn(Coord) -> bool,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<GpuLevel> {
        let make = || layout.textures.iter().map(|t| texture(gpu, t, wgpu::TextureUsages::COPY_DST)).collect();
        let textures = gpu.checked(make).map_err(|e| match e.code() {
            Code::Limit => {
                let why = format!("does not fit the memory of {}", gpu.adapter_info.name);
                layout.refused(volume, &gpu.fit(Some(layout.bytes().saturating_sub(1))), &why)
            }
            _ => e,
        })?;
        let mut store = Uploading { gpu, layout: &layout, textures, pages: Vec::new(), tables: None, waiting: 0 };
        let filled = fill(volume, &layout, wanted, &mut store, progress)?;
        store.submit()?;
        let Uploading { textures, pages, tables, .. } = store;
        Ok(GpuLevel { layout, textures, pages, tables, filled })
    }
}

impl GpuLevel {
    /// A level in memory, as it is, whatever is in it.
    ///
    /// # Errors
    /// `E_LIMIT` where the device has not enough memory, `E_SOURCE` where it does not take a texture.
    pub fn of_host(gpu: &Gpu, host: &HostLevel) -> Result<GpuLevel> {
        let layout = &host.layout;
        let make = || layout.textures.iter().map(|t| texture(gpu, t, wgpu::TextureUsages::COPY_DST)).collect();
        let textures = gpu.checked(make)?;
        let mut store = Uploading { gpu, layout, textures, pages: Vec::new(), tables: None, waiting: 0 };
        for (i, texels) in host.textures.iter().enumerate() {
            let t = &layout.textures[i];
            // Slice by slice: the whole may be more than can wait.
            let slice = texels.len() / t.size[2] as usize;
            for (z, texels) in (0..).zip(texels.chunks_exact(slice)) {
                store.write(i, [0, 0, z], [t.size[0], t.size[1], 1], texels)?;
            }
        }
        for page in &host.pages {
            store.page(page.clone())?;
        }
        if layout.pages.is_some() {
            store.tables(host.table.clone(), host.books.clone())?;
        }
        store.submit()?;
        let Uploading { textures, pages, tables, .. } = store;
        Ok(GpuLevel { layout: layout.clone(), textures, pages, tables, filled: host.filled })
    }
}

/// A texture of this layout that shaders can read and that can be read back.
#[must_use]
pub fn texture(gpu: &Gpu, t: &TextureLayout, more: wgpu::TextureUsages) -> wgpu::Texture {
    let [width, height, depth_or_array_layers] = t.size;
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(t.role.name()),
        size: wgpu::Extent3d { width, height, depth_or_array_layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format: t.format.wgpu(),
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC | more,
        view_formats: &[],
    })
}

/// The target.
struct Uploading<'a> {
    gpu: &'a Gpu,
    layout: &'a LevelLayout,
    textures: Vec<wgpu::Texture>,
    pages: Vec<wgpu::Buffer>,
    tables: Option<[wgpu::Buffer; 2]>,
    /// Bytes written since the last submission.
    waiting: u64,
}

impl Uploading<'_> {
    fn submit(&mut self) -> Result<()> {
        self.gpu.queue.submit([]);
        self.waiting = 0;
        self.gpu.wait()
    }

    fn wrote(&mut self, bytes: usize) -> Result<()> {
        self.waiting += bytes as u64;
        if self.waiting < BATCH_BYTES { Ok(()) } else { self.submit() }
    }

    fn buffer(&mut self, label: &str, words: &[u32]) -> Result<wgpu::Buffer> {
        let gpu = self.gpu;
        let bytes: &[u8] = bytemuck::cast_slice(words);
        // A binding is never empty.
        let size = bytes.len().max(16) as u64;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let wanted = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        let buffer = gpu.checked(|| gpu.device.create_buffer(&wanted))?;
        gpu.queue.write_buffer(&buffer, 0, bytes);
        self.wrote(bytes.len())?;
        Ok(buffer)
    }
}

impl LevelTarget for Uploading<'_> {
    fn write(&mut self, texture: usize, origin: [u32; 3], size: [u32; 3], bytes: &[u8]) -> Result<()> {
        let [x, y, z] = origin;
        let [width, height, depth_or_array_layers] = size;
        self.gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo { origin: wgpu::Origin3d { x, y, z }, ..self.textures[texture].as_image_copy() },
            bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(width * self.layout.textures[texture].format.bytes()),
                rows_per_image: Some(height),
            },
            wgpu::Extent3d { width, height, depth_or_array_layers },
        );
        self.wrote(bytes.len())
    }

    fn page(&mut self, words: Vec<u32>) -> Result<()> {
        let page = self.buffer("page", &words)?;
        self.pages.push(page);
        Ok(())
    }

    fn tables(&mut self, bricks: Vec<u32>, books: Vec<u32>) -> Result<()> {
        self.tables = Some([self.buffer("bricks", &bricks)?, self.buffer("codebooks", &books)?]);
        Ok(())
    }
}
