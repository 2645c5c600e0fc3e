//! A level on the GPU: payload bytes go to textures and buffers as they are.

use super::device::Gpu;
use super::level::{
    Filled, HostLevel, LevelLayout, LevelTarget, Resident, TexelFormat, TextureLayout, copy_rows, fill,
};
use crate::error::{Code, Result};
use crate::geometry::Coord;
use crate::volume::Volume;

/// Most bytes of a texture that are gathered before they are written: rows of a single brick are so short that copying each costs
/// more than its bytes, and a texture that is written at once need not be cleared before.
const SLAB_BYTES: u64 = 64 << 20;
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
    /// Bytes that went to the device: more than were written where gathered bricks had gaps, which are 0.
    pub sent: u64,
    /// Which bricks are there.
    pub resident: Resident,
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
        let (filled, resident) = (Filled::default(), Resident::default());
        let mut level = GpuLevel { layout, textures, pages: Vec::new(), tables: None, filled, sent: 0, resident };
        level.write(gpu, volume, wanted, true, progress)?;
        Ok(level)
    }

    /// Uploads those `wanted` bricks that are not there yet; what is there is not sent again. After an error the level is not to be
    /// used.
    ///
    /// # Errors
    /// As [`GpuLevel::upload`].
    pub fn add(
        &mut self,
        gpu: &Gpu,
        volume: &Volume,
        wanted: &dyn Fn(Coord) -> bool,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<Filled> {
        self.write(gpu, volume, wanted, false, progress)
    }

    fn write(
        &mut self,
        gpu: &Gpu,
        volume: &Volume,
        wanted: &dyn Fn(Coord) -> bool,
        fresh: bool,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<Filled> {
        let mut store = Uploading::of(gpu, &self.layout, &self.textures, &mut self.pages, &mut self.tables, fresh);
        let filled = fill(volume, &self.layout, &mut self.resident, wanted, &mut store, progress)?;
        store.flush_all()?;
        store.submit()?;
        self.sent += store.sent;
        self.filled = self.filled.plus(&filled);
        self.filled.skipped = self.resident.missing();
        Ok(filled)
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
        let textures: Vec<wgpu::Texture> = gpu.checked(make)?;
        let (mut pages, mut tables) = (Vec::new(), None);
        let mut store = Uploading::of(gpu, layout, &textures, &mut pages, &mut tables, true);
        for (i, texels) in host.textures.iter().enumerate() {
            let t = &layout.textures[i];
            // Slice by slice: the whole may be more than can wait.
            let slice = texels.len() / t.size[2] as usize;
            for (z, texels) in (0..).zip(texels.chunks_exact(slice)) {
                store.send(i, [0, 0, z], [t.size[0], t.size[1], 1], texels, [t.size[0], t.size[1]])?;
            }
        }
        for page in &host.pages {
            store.page(page.clone())?;
        }
        if layout.pages.is_some() {
            store.tables(&host.table, &host.books)?;
        }
        store.submit()?;
        let (sent, filled, resident) = (store.sent, host.filled, host.resident.clone());
        Ok(GpuLevel { layout: layout.clone(), textures, pages, tables, filled, sent, resident })
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
    textures: &'a [wgpu::Texture],
    pages: &'a mut Vec<wgpu::Buffer>,
    tables: &'a mut Option<[wgpu::Buffer; 2]>,
    /// Whether all texels that have not been written are 0.
    fresh: bool,
    /// What is gathered of some textures.
    slabs: Vec<Slab>,
    /// Bytes sent since the last submission.
    waiting: u64,
    sent: u64,
}

/// Slices of a texture, gathered from bricks.
struct Slab {
    texture: usize,
    /// First slice.
    z: u32,
    /// Texels, per axis.
    size: [u32; 3],
    texels: Vec<u8>,
    /// Origin (in the texture) and size of what has been written.
    parts: Vec<([u32; 3], [u32; 3])>,
    written: usize,
}

impl Slab {
    fn take(&mut self, t: &TextureLayout, origin: [u32; 3], size: [u32; 3], bytes: &[u8]) {
        let texel = t.format.bytes() as usize;
        let row = size[0] as usize * texel;
        let pitch = self.size[0] as usize * texel;
        for (z, slice) in (origin[2] - self.z..).zip(bytes.chunks_exact(row * size[1] as usize)) {
            let first = (origin[1] as usize + self.size[1] as usize * z as usize) * pitch + origin[0] as usize * texel;
            copy_rows(&mut self.texels[first..], pitch, slice, row);
        }
        self.parts.push((origin, size));
        self.written += bytes.len();
    }
}

impl<'a> Uploading<'a> {
    fn of(
        gpu: &'a Gpu,
        layout: &'a LevelLayout,
        textures: &'a [wgpu::Texture],
        pages: &'a mut Vec<wgpu::Buffer>,
        tables: &'a mut Option<[wgpu::Buffer; 2]>,
        fresh: bool,
    ) -> Self {
        Uploading { gpu, layout, textures, pages, tables, fresh, slabs: Vec::new(), waiting: 0, sent: 0 }
    }

    fn submit(&mut self) -> Result<()> {
        self.gpu.queue.submit([]);
        self.waiting = 0;
        self.gpu.wait()
    }

    /// The slab of `texture` that holds slice `z`, where bricks of this texture are gathered at all.
    fn slab(&mut self, texture: usize, z: u32) -> Result<Option<&mut Slab>> {
        let t = &self.layout.textures[texture];
        let slice = t.bytes() / u64::from(t.size[2]);
        let depth = if t.bytes() <= SLAB_BYTES { t.size[2] } else { t.per_brick[2] };
        // Bricks of levels in tiles do not come in the order of slices.
        if !self.layout.fold.is_flat() || slice * u64::from(depth) > 4 * SLAB_BYTES {
            return Ok(None);
        }
        let first = z / depth * depth;
        let found = match self.slabs.iter().position(|s| s.texture == texture) {
            Some(i) if self.slabs[i].z == first => i,
            Some(i) => {
                let slab = self.slabs.swap_remove(i);
                self.flush(&slab)?;
                let (texels, parts) = (slab.texels, slab.parts);
                self.begin(texture, first, depth, texels, parts)
            }
            None => self.begin(texture, first, depth, Vec::new(), Vec::new()),
        };
        Ok(self.slabs.get_mut(found))
    }

    /// Begins a slab in the memory of the one before.
    fn begin(
        &mut self,
        texture: usize,
        z: u32,
        depth: u32,
        mut texels: Vec<u8>,
        mut parts: Vec<([u32; 3], [u32; 3])>,
    ) -> usize {
        let t = &self.layout.textures[texture];
        let size = [t.size[0], t.size[1], depth.min(t.size[2] - z)];
        let len = size.iter().fold(t.format.bytes() as usize, |n, &v| n * v as usize);
        texels.clear();
        texels.resize(len, 0);
        parts.clear();
        self.slabs.push(Slab { texture, z, size, texels, parts, written: 0 });
        self.slabs.len() - 1
    }

    fn flush(&mut self, slab: &Slab) -> Result<()> {
        let rows = [slab.size[0], slab.size[1]];
        // Where most is missing, only what is there is sent.
        if slab.written == slab.texels.len() || self.fresh && slab.written * 2 >= slab.texels.len() {
            return self.send(slab.texture, [0, 0, slab.z], slab.size, &slab.texels, rows);
        }
        let texel = self.layout.textures[slab.texture].format.bytes() as usize;
        for (origin, size) in &slab.parts {
            let [x, y, z] = [origin[0], origin[1], origin[2] - slab.z].map(|v| v as usize);
            let from = (x + rows[0] as usize * (y + rows[1] as usize * z)) * texel;
            self.send(slab.texture, *origin, *size, &slab.texels[from..], rows)?;
        }
        Ok(())
    }

    fn flush_all(&mut self) -> Result<()> {
        while let Some(slab) = self.slabs.pop() {
            self.flush(&slab)?;
        }
        Ok(())
    }

    /// Writes a box of texels that lie in `bytes` in rows of `rows[0]` texels, `rows[1]` rows a slice.
    fn send(&mut self, texture: usize, origin: [u32; 3], size: [u32; 3], bytes: &[u8], rows: [u32; 2]) -> Result<()> {
        let [x, y, z] = origin;
        let [width, height, depth_or_array_layers] = size;
        let texel = self.layout.textures[texture].format.bytes();
        self.gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo { origin: wgpu::Origin3d { x, y, z }, ..self.textures[texture].as_image_copy() },
            bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(rows[0] * texel),
                rows_per_image: Some(rows[1]),
            },
            wgpu::Extent3d { width, height, depth_or_array_layers },
        );
        self.wrote(size.iter().map(|&v| v as usize).product::<usize>() * texel as usize)
    }

    fn wrote(&mut self, bytes: usize) -> Result<()> {
        self.sent += bytes as u64;
        self.waiting += bytes as u64;
        if self.waiting < BATCH_BYTES { Ok(()) } else { self.submit() }
    }

    /// A buffer that begins with `room` bytes of something else, then `words`.
    fn buffer(&mut self, label: &str, room: u64, words: &[u32]) -> Result<wgpu::Buffer> {
        let gpu = self.gpu;
        let bytes: &[u8] = bytemuck::cast_slice(words);
        // A binding is never empty.
        let size = (room + bytes.len() as u64).max(16);
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let wanted = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        let buffer = gpu.checked(|| gpu.device.create_buffer(&wanted))?;
        gpu.queue.write_buffer(&buffer, room, bytes);
        self.wrote(bytes.len())?;
        Ok(buffer)
    }
}

impl LevelTarget for Uploading<'_> {
    fn write(&mut self, texture: usize, origin: [u32; 3], size: [u32; 3], bytes: &[u8]) -> Result<()> {
        let layout = self.layout;
        match self.slab(texture, origin[2])? {
            Some(slab) => {
                slab.take(&layout.textures[texture], origin, size, bytes);
                Ok(())
            }
            None => self.send(texture, origin, size, bytes, [size[0], size[1]]),
        }
    }

    fn page(&mut self, words: Vec<u32>) -> Result<()> {
        let page = self.buffer("page", 0, &words)?;
        self.pages.push(page);
        Ok(())
    }

    /// Buffers do not grow: a longer one takes over what is on the device, and only the new words are sent.
    fn append(&mut self, there: usize, words: Vec<u32>) -> Result<()> {
        let Some(old) = self.pages.pop() else { return self.page(words) };
        let room = there as u64 * 4;
        let page = self.buffer("page", room, &words)?;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&old, 0, &page, 0, room);
        self.gpu.queue.submit([encoder.finish()]);
        self.pages.push(page);
        Ok(())
    }

    fn tables(&mut self, bricks: &[u32], books: &[u32]) -> Result<()> {
        if let Some([table, _]) = &*self.tables {
            self.gpu.queue.write_buffer(table, 0, bytemuck::cast_slice(bricks));
            return self.wrote(bricks.len() * 4);
        }
        *self.tables = Some([self.buffer("bricks", 0, bricks)?, self.buffer("codebooks", 0, books)?]);
        Ok(())
    }
}
