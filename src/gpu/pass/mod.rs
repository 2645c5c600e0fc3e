//! Passes: work on the GPU that a scene asks for by name.

pub mod decode;
pub mod slice;
