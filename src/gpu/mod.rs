//! Volumes on the GPU: levels as textures or buffers, shaders that hold what a scene asks for and nothing else, and the device.

pub mod device;
pub mod key;
pub mod level;
pub mod upload;

pub use device::{AdapterChoice, Gpu};
pub use key::{Effect, Effects, Lens, Projection, Sampler, Source, Traversal};
pub use upload::GpuLevel;
