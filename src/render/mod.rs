//! Pictures of volumes.

pub mod camera;
pub mod scene;
pub mod transfer;
