//! Block-compressed 3D volumes with random access: the `.vug` file format and its reference implementation.
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod affine;
pub mod checksum;
pub mod error;
pub mod geometry;
pub mod grid;
pub mod limits;
pub mod supercompression;
pub mod time;
pub mod voxel;

pub mod haar;
pub mod quantise;

pub mod codec;
pub mod container;
#[cfg(feature = "convert")]
pub mod convert;
pub mod metrics;
pub mod source;

pub mod volume;

#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(feature = "gpu")]
pub mod render;

#[cfg(feature = "gpu")]
pub mod tradeoff;

#[cfg(feature = "cli")]
pub mod cli;

pub use error::{Code, Error, Result};
pub use geometry::{Extent, Region};
pub use grid::Grid;
pub use voxel::SampleType;

/// The examples of the README, compiled and run with the doc tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
