//! Volumes on the GPU: levels as textures or buffers, shaders that hold what a scene asks for and nothing else, and the device.

pub mod compose;
pub mod device;
pub mod key;
pub mod layout;
pub mod level;
pub mod pass;
pub mod pipeline;
pub mod shader;
pub mod tolerance;
pub mod upload;

pub use device::{AdapterChoice, Gpu};
pub use key::{Effect, Effects, Lens, PipelineKey, Projection, Sampler, Source, Traversal, VolumeKey};
pub use upload::GpuLevel;
