//! Pictures of volumes.

pub mod camera;
pub mod plan;
pub mod scene;
pub mod transfer;
