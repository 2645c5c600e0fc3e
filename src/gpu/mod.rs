//! Volumes on the GPU: levels as textures or buffers, shaders that hold what a scene asks for and nothing else, and the device.

pub mod key;
pub mod level;

pub use key::{Effect, Effects, Lens, Projection, Sampler, Source, Traversal};
