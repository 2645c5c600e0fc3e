//! The volumes that are swept: the user's, and the phantom.

use crate::affine::{Placement, ValueMap};
use crate::cli::args::{self, Tradeoff};
use crate::cli::fetch;
use crate::cli::load::{import_options, is_vug};
use crate::cli::open::open_volume;
use crate::cli::output::bytes_text;
use crate::cli::phantom;
use crate::error::{Code, Error, Result};
use crate::grid::Grid;
use crate::tradeoff::paper;
use crate::volume::{At, EncodeOptions};
use crate::voxel::SampleType;
use std::path::Path;

/// A volume that is swept.
pub(super) struct Subject {
    /// For files and headings: `head`.
    pub(super) stem: String,
    /// What the data is, for people.
    pub(super) data: String,
    pub(super) grid: Grid,
    /// Where it lies and what its numbers mean.
    pub(super) base: EncodeOptions,
}

/// Which volume. They are opened one after the other, as two of them may not fit in memory.
pub(super) enum Which<'a> {
    File(&'a Path),
    Phantom,
}

/// The user's volume, if there is one, and the phantom, if it is wanted.
pub(super) fn subjects(args: &Tradeoff) -> Vec<Which<'_>> {
    let file = args.source.as_deref().map(Which::File);
    file.into_iter().chain(args.paper_table_1.then_some(Which::Phantom)).collect()
}

impl Which<'_> {
    pub(super) fn open(&self, args: &Tradeoff) -> Result<Subject> {
        let (stem, what, grid, placement, value_map) = match self {
            Which::File(path) => {
                let name = path.file_name().map_or_else(|| "volume".into(), |n| n.to_string_lossy().into_owned());
                let stem: String = name.split('.').next().unwrap_or_default().chars().map(file_letter).collect();
                let stem = if stem.is_empty() || stem == "phantom" { "volume".into() } else { stem };
                let (grid, placement, value_map) = open_file(path, &args.import)?;
                (stem, name, grid, placement, value_map)
            }
            Which::Phantom => {
                let grid = phantom::phantom(args.phantom.unwrap_or(paper::EXTENT), SampleType::U16)?;
                let what = "a synthetic head, computed; no patient".to_owned();
                ("phantom".into(), what, grid, phantom::placement(), ValueMap::default())
            }
        };
        let size = bytes_text(grid.bytes().len() as u64);
        let data = format!("{what}, {} voxels (x, y, z), {}, {size}", grid.extent(), grid.sample_type());
        let base = EncodeOptions { placement, value_map, ..EncodeOptions::default() };
        Ok(Subject { stem, data, grid, base })
    }
}

/// A letter that every file system takes.
fn file_letter(c: char) -> char {
    if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '-' }
}

/// The only volume of a file, and what it says of place and values.
fn open_file(path: &Path, import: &args::Import) -> Result<(Grid, Placement, ValueMap)> {
    let single = |series: (u32, u32)| match series {
        (1, 1) => Ok(()),
        (steps, channels) => {
            let message = format!(
                "{}: {steps} time steps and {channels} channels; take one of them (vug decode --time, --channel)",
                path.display()
            );
            Err(Error::new(Code::Unsupported, "series", message))
        }
    };
    if is_vug(path)? {
        let volume = open_volume(path)?;
        let info = volume.info();
        single((info.time_steps, info.channels))?;
        return Ok((volume.read(At::default())?, info.placement.clone(), info.value_map));
    }
    let mut source = fetch::import(path, &import_options(path, import)?)?;
    single(source.reader.series())?;
    let mut grid = Grid::zeros(source.reader.extent(), source.reader.sample_type())?;
    let planes = 0..grid.extent().z;
    source.reader.read_slab(planes, grid.bytes_mut())?;
    Ok((grid, source.placement, source.value_map))
}
