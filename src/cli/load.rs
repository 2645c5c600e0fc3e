//! Any readable file as a grid: `.vug` by its first bytes, everything else by its name.

use super::args;
use super::fetch::{self, name_in_url};
use super::open::{open_source, open_volume};
use crate::affine::Placement;
use crate::container::MAGIC;
use crate::convert::{Format, Import, ImportOptions, Stored};
use crate::error::{Code, Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::{Grid, ViewMut, dense_len};
use crate::volume::{At, Axis};
use crate::voxel::SampleType;
use std::io::Read;
use std::path::Path;

/// A volume in memory and where it lies.
pub(super) struct Loaded {
    pub(super) grid: Grid,
    pub(super) placement: Placement,
}

/// Whether the file starts as a `.vug` file does.
pub(super) fn is_vug(path: &Path) -> Result<bool> {
    let is_named = |name: &Path| name.extension().is_some_and(|e| e == "vug");
    if let Some(name) = name_in_url(path) {
        if is_named(name) || Format::of_path(name).is_some() {
            return Ok(is_named(name));
        }
        let source = open_source(path)?;
        let mut start = [0; 4];
        let n = source.len().min(4) as usize;
        source.read_at(0, &mut start[..n])?;
        return Ok(start == MAGIC[..4]);
    }
    if path.is_dir() || format_of(path).is_some_and(|f| f == Format::Raw && !path.is_file()) {
        return Ok(false); // slices of a stack, steps of a series; a pipe must not be looked into
    }
    if !path.exists() && is_pattern(path) {
        return Ok(false);
    }
    let mut start = Vec::new();
    let file = std::fs::File::open(path).map_err(|e| Error::io(path.display(), e))?;
    file.take(MAGIC.len() as u64).read_to_end(&mut start).map_err(|e| Error::io(path.display(), e))?;
    // The first four bytes are enough: a damaged magic is then reported as such.
    Ok(start.starts_with(&MAGIC[..4]) || is_named(path))
}

/// Whether the name stands for several files (`step_####.nrrd`).
fn is_pattern(path: &Path) -> bool {
    path.file_name().is_some_and(|n| n.as_encoded_bytes().contains(&b'#')) && Format::of_path(path).is_some()
}

/// The format of a file, or of what lies at an address.
fn format_of(path: &Path) -> Option<Format> {
    Format::of_path(name_in_url(path).unwrap_or(path))
}

/// Refuses `--shape`, `--dtype`, `--time-steps` and `--channels` where no file of `paths` would heed them.
///
/// # Errors
/// `E_PARAM`.
pub(super) fn check_import(paths: &[&Path], import: &args::Import) -> Result<()> {
    let no_raw = paths.iter().all(|p| format_of(p) != Some(Format::Raw));
    for (field, given) in [
        ("shape", import.shape.is_some()),
        ("time-steps", import.time_steps.is_some()),
        ("channels", import.channels.is_some()),
    ] {
        if given && no_raw {
            return Err(Error::param(field, format!("only raw files need --{field}; this one knows its own")));
        }
    }
    if import.dtype.is_some() && paths.iter().all(|p| format_of(p).is_none()) {
        return Err(Error::param("dtype", "a .vug file knows its own type"));
    }
    Ok(())
}

/// What the arguments say of the file at `path`.
///
/// # Errors
/// `E_PARAM` where samples are to be converted to what is not a sample type.
pub(super) fn import_options(path: &Path, import: &args::Import) -> Result<ImportOptions> {
    let args::Import { shape, dtype: _, time_steps, channels } = *import;
    let mut options = ImportOptions { shape, time_steps, channels, ..ImportOptions::default() };
    match import.dtype {
        // A raw file does not say what it stores: the type is that, and narrowed like any other file's.
        Some(stored) if format_of(path) == Some(Format::Raw) => options.raw_dtype = Some(stored),
        Some(stored) => {
            let native = stored.kind.native().filter(|_| stored == Stored::from(stored.kind));
            options.dtype = Some(native.ok_or_else(|| {
                Error::param(
                    "dtype",
                    "samples can be converted to u8, u16, i16, f32 or rgb8; other types describe raw files",
                )
            })?);
        }
        None => {}
    }
    Ok(options)
}

/// Reads a whole volume: the only one of its file.
///
/// # Errors
/// `E_UNSUPPORTED` for a series; those of the file.
pub(super) fn load(path: &Path, import: &args::Import) -> Result<Loaded> {
    let Series { grid, placement, extent: _, series } = load_series(path, import)?;
    if series == (1, 1) {
        return Ok(Loaded { grid, placement });
    }
    let (steps, channels) = series;
    let message =
        format!("{}: {steps} time steps and {channels} channels where a single volume is wanted", path.display());
    Err(Error::new(Code::Unsupported, "series", message))
}

/// All volumes of a file, one upon the other: channel by channel, time step by time step, along z.
pub(super) struct Series {
    pub(super) grid: Grid,
    pub(super) placement: Placement,
    /// Of one of them.
    pub(super) extent: Extent,
    /// Time steps and channels.
    pub(super) series: (u32, u32),
}

/// Reads all volumes of a file.
pub(super) fn load_series(path: &Path, import: &args::Import) -> Result<Series> {
    if is_vug(path)? {
        let volume = open_volume(path)?;
        let info = volume.info();
        let (extent, series) = (info.dims, (info.time_steps, info.channels));
        let grid = stacked(extent, info.sample_type, series, |time, channel, out| {
            let out = ViewMut::dense(out, extent, info.sample_type);
            volume.read_region_into(At { time, channel, lod: 0 }, Region::whole(extent), out)
        })?;
        return Ok(Series { grid, placement: info.placement.clone(), extent, series });
    }
    let Import { mut reader, placement, .. } = fetch::import(path, &import_options(path, import)?)?;
    let (extent, series) = (reader.extent(), reader.series());
    let grid = stacked(extent, reader.sample_type(), series, |time, channel, out| {
        reader.turn_to(time, channel)?;
        reader.read_slab(0..extent.z, out)
    })?;
    Ok(Series { grid, placement, extent, series })
}

/// Volumes of a series, one upon the other.
fn stacked(
    extent: Extent,
    t: SampleType,
    (steps, channels): (u32, u32),
    mut read: impl FnMut(u32, u32, &mut [u8]) -> Result<()>,
) -> Result<Grid> {
    let planes = u64::from(extent.z) * u64::from(steps) * u64::from(channels);
    let z = u32::try_from(planes).map_err(|_| {
        Error::new(Code::Limit, "series", format!("{planes} planes in all are too many; take some of the time steps"))
    })?;
    let mut grid = Grid::zeros(Extent { z, ..extent }, t)?;
    let len = dense_len(extent, t)?;
    for (volume, out) in (0..steps * channels).zip(grid.bytes_mut().chunks_exact_mut(len)) {
        read(volume / channels, volume % channels, out)?;
    }
    Ok(grid)
}

/// Reads one volume of a foreign file.
fn load_one(path: &Path, import: &args::Import, time: u32, channel: u32) -> Result<Loaded> {
    let mut source = fetch::import(path, &import_options(path, import)?)?;
    source.reader.turn_to(time, channel)?;
    let mut grid = Grid::zeros(source.reader.extent(), source.reader.sample_type())?;
    let planes = 0..grid.extent().z;
    source.reader.read_slab(planes, grid.bytes_mut())?;
    Ok(Loaded { grid, placement: source.placement })
}

/// One plane of a volume, and what is known of the whole.
pub(super) struct LoadedPlane {
    pub(super) plane: Grid,
    pub(super) placement: Placement,
    /// Smallest and largest value of the whole volume; of a `.vug` file those of its source.
    pub(super) volume_range: (f64, f64),
}

/// Reads one plane, and its position; of a `.vug` file only the bricks that it cuts. `index` None is the middle.
pub(super) fn load_plane(
    path: &Path,
    import: &args::Import,
    at: At,
    axis: Axis,
    index: Option<u32>,
) -> Result<(LoadedPlane, u32)> {
    let middle = |extent: Extent| index.unwrap_or(extent.to_array()[axis as usize] / 2);
    if is_vug(path)? {
        let volume = open_volume(path)?;
        let info = volume.info();
        let levels = volume.levels().len();
        let Some(extent) = volume.levels().nth(usize::from(at.lod)) else {
            return Err(Error::param("level", format!("the file has levels 0 to {}, not {}", levels - 1, at.lod)));
        };
        let index = middle(extent);
        check_index(extent, axis, index)?;
        let plane = volume.plane(at, axis, index)?;
        let (placement, volume_range) = (info.placement.clone(), info.source_range);
        return Ok((LoadedPlane { plane, placement, volume_range }, index));
    }
    if at.lod != 0 {
        return Err(Error::param("level", format!("{} has no levels of detail", path.display())));
    }
    let Loaded { grid, placement } = load_one(path, import, at.time, at.channel)?;
    let index = middle(grid.extent());
    check_index(grid.extent(), axis, index)?;
    let (plane, volume_range) = (cut(&grid, axis, index)?, grid.range().unwrap_or_default());
    Ok((LoadedPlane { plane, placement, volume_range }, index))
}

fn check_index(extent: Extent, axis: Axis, index: u32) -> Result<()> {
    let n = extent.to_array()[axis as usize];
    if index < n {
        return Ok(());
    }
    let name = ["x", "y", "z"][axis as usize];
    Err(Error::new(Code::Range, "index", format!("{index} is outside: {name} has 0 to {}", n - 1)))
}

/// Plane `index` across `axis` of a grid.
pub(super) fn cut(grid: &Grid, axis: Axis, index: u32) -> Result<Grid> {
    let mut region = Region::whole(grid.extent());
    region.start[axis as usize] = index;
    region.end[axis as usize] = index.saturating_add(1);
    region.check(grid.extent())?;
    let view = grid.view().sub(&region);
    let mut plane = Grid::zeros(view.extent, view.sample_type)?;
    let row = view.extent.x as usize * view.sample_type.bytes();
    let mut rows = plane.bytes_mut().chunks_exact_mut(row);
    for z in 0..view.extent.z as usize {
        for y in 0..view.extent.y as usize {
            let start = y * view.row_pitch + z * view.slice_pitch;
            rows.next().expect("as many rows").copy_from_slice(&view.bytes[start..start + row]);
        }
    }
    Ok(plane)
}
