//! Volumes on the GPU: levels as textures or buffers, shaders that hold what a scene asks for and nothing else, and the device.

pub mod compose;
pub mod key;
pub mod layout;
pub mod level;
pub mod shader;

pub use key::{Effect, Effects, Lens, PipelineKey, Projection, Sampler, Source, Traversal, VolumeKey};
