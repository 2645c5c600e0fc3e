//! The device: adapters there are, the one that is chosen, and reading back what it holds.

use super::level::Fit;
use crate::error::{Code, Error, Result};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Optional features that are used where the adapter has them. Nothing depends on one.
const WELCOME: wgpu::Features = wgpu::Features::FLOAT32_FILTERABLE
    .union(wgpu::Features::FLOAT32_BLENDABLE)
    .union(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM)
    .union(wgpu::Features::TIMESTAMP_QUERY);

/// Which adapter is wanted. The default is the first in the order discrete, integrated, virtual, other, software.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AdapterChoice {
    /// A part of its name, in any case.
    pub name: Option<String>,
    /// Only one that runs on the CPU (lavapipe, WARP).
    pub software: bool,
    /// Only the limits that WebGPU promises of every device, and no optional feature.
    pub portable: bool,
}

impl AdapterChoice {
    /// A software adapter: the same pictures wherever it is of the same version.
    #[must_use]
    pub fn software() -> Self {
        AdapterChoice { software: true, ..AdapterChoice::default() }
    }

    fn takes(&self, info: &wgpu::AdapterInfo) -> bool {
        let named = self.name.as_ref().is_none_or(|name| info.name.to_lowercase().contains(&name.to_lowercase()));
        named && (!self.software || info.device_type == wgpu::DeviceType::Cpu)
    }
}

/// A device and its queue.
pub struct Gpu {
    /// Name, driver and kind of the adapter.
    pub adapter_info: wgpu::AdapterInfo,
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Optional features that are there.
    pub features: wgpu::Features,
    /// What the device can hold and bind.
    pub limits: wgpu::Limits,
    /// Nanoseconds of a tick of timestamp queries; `None` where there are none.
    pub timestamp_period: Option<f32>,
    /// The first error that no scope caught.
    stray: Arc<Mutex<Option<String>>>,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Gpu({})", describe(&self.adapter_info))
    }
}

impl Gpu {
    /// The adapters of this machine that can do what is needed, best first.
    #[must_use]
    pub fn list() -> Vec<wgpu::AdapterInfo> {
        adapters().iter().map(wgpu::Adapter::get_info).collect()
    }

    /// Opens the chosen adapter with all its limits.
    ///
    /// # Errors
    /// `E_SOURCE` where there is no such adapter, with those there are, or where it does not open.
    pub fn open(choice: &AdapterChoice) -> Result<Gpu> {
        let all = adapters();
        let Some(adapter) = all.iter().find(|a| choice.takes(&a.get_info())) else {
            let names: Vec<_> = all.iter().map(|a| describe(&a.get_info())).collect();
            let message = match names.len() {
                0 => "no GPU adapter found: install a driver, or Mesa's software Vulkan (package mesa-vulkan-drivers), or render with --adapter cpu".to_owned(),
                _ => format!("no such adapter; there are: {}; or render with --adapter cpu", names.join("; ")),
            };
            return Err(Error::new(Code::Source, "adapter", message));
        };
        Gpu::of(adapter, choice.portable)
    }

    /// A device that does nothing, with the limits that WebGPU promises: for counting what is made.
    ///
    /// # Errors
    /// `E_SOURCE` where it does not open.
    pub fn noop() -> Result<Gpu> {
        let all = pollster::block_on(instance(wgpu::Backends::NOOP).enumerate_adapters(wgpu::Backends::NOOP));
        match all.first() {
            Some(adapter) => Gpu::of(adapter, true),
            None => Err(Error::new(Code::Source, "adapter", "this build has no noop adapter")),
        }
    }

    fn of(adapter: &wgpu::Adapter, portable: bool) -> Result<Gpu> {
        let (features, limits) = match portable {
            true => (wgpu::Features::empty(), wgpu::Limits::default()),
            false => (adapter.features() & WELCOME, adapter.limits()),
        };
        let adapter_info = adapter.get_info();
        let wanted = wgpu::DeviceDescriptor {
            label: Some("vug"),
            required_features: features,
            required_limits: limits.clone(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&wanted)).map_err(|e| {
            let message = format!("{} does not open: {e}; choose another with --adapter", describe(&adapter_info));
            Error::new(Code::Source, "adapter", message)
        })?;
        let stray: Arc<Mutex<Option<String>>> = Arc::default();
        let keep = stray.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            keep.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| e.to_string());
        }));
        let timed = features.contains(wgpu::Features::TIMESTAMP_QUERY);
        let timestamp_period = Some(queue.get_timestamp_period()).filter(|&p| timed && p > 0.0);
        Ok(Gpu { adapter_info, device, queue, features, limits, timestamp_period, stray })
    }

    /// What the device can hold, where a level may take `budget` bytes.
    #[must_use]
    pub fn fit(&self, budget: Option<u64>) -> Fit {
        Fit {
            max_3d: self.limits.max_texture_dimension_3d,
            max_buffer: self.limits.max_buffer_size,
            max_binding: self.limits.max_storage_buffer_binding_size,
            storage_buffers: self.limits.max_storage_buffers_per_shader_stage,
            filter_f32: self.features.contains(wgpu::Features::FLOAT32_FILTERABLE),
            norm16: self.features.contains(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM),
            budget,
        }
    }

    /// Whether the adapter runs on the CPU.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.adapter_info.device_type == wgpu::DeviceType::Cpu
    }

    /// Runs `make`, and turns what the device finds wrong meanwhile into an error.
    ///
    /// # Errors
    /// `E_LIMIT` (gpu-mem) where memory ran out, `E_SOURCE` (gpu) for all else.
    pub fn checked<T>(&self, make: impl FnOnce() -> T) -> Result<T> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        let found = [validation.pop(), internal.pop(), memory.pop()].map(pollster::block_on);
        match found.into_iter().flatten().next() {
            None => Ok(made),
            Some(wgpu::Error::OutOfMemory { .. }) => {
                let message = format!("{} has no more memory", self.adapter_info.name);
                Err(Error::new(Code::Limit, "gpu-mem", message))
            }
            Some(e) => Err(Error::new(Code::Source, "gpu", format!("{}: {e}", self.adapter_info.name))),
        }
    }

    /// Waits until everything submitted is done.
    ///
    /// # Errors
    /// `E_SOURCE` where the device is lost, or found something wrong since the last call that [`Gpu::checked`] did not see.
    pub fn wait(&self) -> Result<()> {
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|e| Error::new(Code::Source, "gpu", format!("{}: {e}", self.adapter_info.name)))?;
        match self.stray.lock().unwrap_or_else(PoisonError::into_inner).take() {
            None => Ok(()),
            Some(e) => Err(Error::new(Code::Source, "gpu", format!("{}: {e}", self.adapter_info.name))),
        }
    }

    /// The bytes of a buffer with usage `COPY_SRC`.
    ///
    /// # Errors
    /// As [`Gpu::wait`].
    pub fn read_buffer(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>> {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let staging = self.staging(buffer.size());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
        self.queue.submit([encoder.finish()]);
        self.mapped(&staging, <[u8]>::to_vec)
    }

    /// The texels of a texture with usage `COPY_SRC`, tightly packed, x fastest, then y, then z (or layers).
    ///
    /// # Errors
    /// As [`Gpu::wait`]; `E_LIMIT` where one slice does not fit a buffer.
    pub fn read_texture(&self, texture: &wgpu::Texture) -> Result<Vec<u8>> {
        let texel = u64::from(texture.format().block_copy_size(None).unwrap_or(1));
        let wgpu::Extent3d { width, height, depth_or_array_layers: depth } = texture.size();
        let row = u64::from(width) * texel;
        let pitch = row.next_multiple_of(u64::from(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT));
        crate::limits::check("gpu-mem", pitch * u64::from(height), self.limits.max_buffer_size)?;
        // A few slices at a time: the whole may be longer than a buffer can be.
        let most = (64 << 20) / (pitch * u64::from(height));
        let slices = u32::try_from(most.clamp(1, u64::from(depth))).unwrap_or(1);
        let mut out = Vec::new();
        for z in (0..depth).step_by(slices as usize) {
            let count = slices.min(depth - z);
            let staging = self.staging(pitch * u64::from(height) * u64::from(count));
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_texture_to_buffer(
                wgpu::TexelCopyTextureInfo { origin: wgpu::Origin3d { x: 0, y: 0, z }, ..texture.as_image_copy() },
                wgpu::TexelCopyBufferInfo {
                    buffer: &staging,
                    layout: wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: u32::try_from(pitch).ok(),
                        rows_per_image: Some(height),
                    },
                },
                wgpu::Extent3d { width, height, depth_or_array_layers: count },
            );
            self.queue.submit([encoder.finish()]);
            self.mapped(&staging, |bytes| {
                bytes.chunks_exact(pitch as usize).for_each(|line| out.extend_from_slice(&line[..row as usize]));
            })?;
        }
        Ok(out)
    }

    fn staging(&self, size: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        })
    }

    fn mapped<T>(&self, staging: &wgpu::Buffer, look: impl FnOnce(&[u8]) -> T) -> Result<T> {
        let slice = staging.slice(..);
        slice.map_async(wgpu::MapMode::Read, |_| {});
        self.wait()?;
        let bytes = slice
            .get_mapped_range()
            .map_err(|e| Error::new(Code::Source, "gpu", format!("{}: {e}", self.adapter_info.name)))?;
        let found = look(&bytes);
        drop(bytes);
        staging.unmap();
        Ok(found)
    }
}

fn instance(backends: wgpu::Backends) -> wgpu::Instance {
    let mut wanted = wgpu::InstanceDescriptor::new_without_display_handle();
    wanted.backends = backends;
    wanted.backend_options.noop.enable = backends == wgpu::Backends::NOOP;
    wgpu::Instance::new(wanted)
}

/// Adapters that run compute shaders, best first. OpenGL is only asked where nothing else is: it is the same hardware once more,
/// and its libraries complain about machines without a screen.
fn adapters() -> Vec<wgpu::Adapter> {
    let of = |backends| pollster::block_on(instance(backends).enumerate_adapters(backends));
    let mut all = of(wgpu::Backends::PRIMARY);
    if all.is_empty() {
        all = of(wgpu::Backends::GL);
    }
    all.retain(|a| a.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS));
    all.sort_by_key(|a| {
        let info = a.get_info();
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        (kind, info.backend == wgpu::Backend::Gl)
    });
    all
}

/// Name, kind and driver of an adapter in a line.
#[must_use]
pub fn describe(info: &wgpu::AdapterInfo) -> String {
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Other => "other",
        wgpu::DeviceType::Cpu => "software",
    };
    format!("{} ({kind}, {}, {})", info.name, info.backend, info.driver_info)
}
