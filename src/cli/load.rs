//! Any readable file as a grid: `.vug` by its first bytes, everything else by its name.

use super::args;
use super::open::open_volume;
use crate::affine::Placement;
use crate::container::MAGIC;
use crate::convert::{self, Format, ImportOptions, Stored};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::grid::Grid;
use crate::volume::{At, Axis};
use std::io::Read;
use std::path::Path;

/// A volume in memory and where it lies.
pub(super) struct Loaded {
    pub(super) grid: Grid,
    pub(super) placement: Placement,
}

/// Whether the file starts as a `.vug` file does.
pub(super) fn is_vug(path: &Path) -> Result<bool> {
    if path.is_dir() {
        return Ok(false); // slices of a stack
    }
    let mut start = Vec::new();
    let file = std::fs::File::open(path).map_err(|e| Error::io(path.display(), e))?;
    file.take(MAGIC.len() as u64).read_to_end(&mut start).map_err(|e| Error::io(path.display(), e))?;
    // The first four bytes are enough: a damaged magic is then reported as such.
    Ok(start.starts_with(&MAGIC[..4]) || path.extension().is_some_and(|e| e == "vug"))
}

/// Refuses `--shape` and `--dtype` where no file of `paths` would heed them.
///
/// # Errors
/// `E_PARAM`.
pub(super) fn check_import(paths: &[&Path], import: &args::Import) -> Result<()> {
    if import.shape.is_some() && paths.iter().all(|p| Format::of_path(p) != Some(Format::Raw)) {
        return Err(Error::param("shape", "only raw files need a shape; this one knows its own"));
    }
    if import.dtype.is_some() && paths.iter().all(|p| Format::of_path(p).is_none()) {
        return Err(Error::param("dtype", "a .vug file knows its own type"));
    }
    Ok(())
}

/// What the arguments say of the file at `path`.
///
/// # Errors
/// `E_PARAM` where samples are to be converted to what is not a sample type.
pub(super) fn import_options(path: &Path, import: &args::Import) -> Result<ImportOptions> {
    let mut options = ImportOptions { shape: import.shape, ..ImportOptions::default() };
    match import.dtype {
        // A raw file does not say what it stores: the type is that, and narrowed like any other file's.
        Some(stored) if Format::of_path(path) == Some(Format::Raw) => options.raw_dtype = Some(stored),
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

/// Reads a whole volume.
pub(super) fn load(path: &Path, import: &args::Import) -> Result<Loaded> {
    if is_vug(path)? {
        let volume = open_volume(path)?;
        let placement = volume.info().placement.clone();
        return Ok(Loaded { grid: volume.read(At::default())?, placement });
    }
    let mut source = convert::import(path, &import_options(path, import)?)?;
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
    lod: u8,
    axis: Axis,
    index: Option<u32>,
) -> Result<(LoadedPlane, u32)> {
    let middle = |extent: Extent| index.unwrap_or(extent.to_array()[axis as usize] / 2);
    if is_vug(path)? {
        let volume = open_volume(path)?;
        let info = volume.info();
        let levels = volume.levels().len();
        let Some(extent) = volume.levels().nth(usize::from(lod)) else {
            return Err(Error::param("level", format!("the file has levels 0 to {}, not {lod}", levels - 1)));
        };
        let index = middle(extent);
        check_index(extent, axis, index)?;
        let plane = volume.plane(At::lod(lod), axis, index)?;
        let (placement, volume_range) = (info.placement.clone(), info.source_range);
        return Ok((LoadedPlane { plane, placement, volume_range }, index));
    }
    if lod != 0 {
        return Err(Error::param("level", format!("{} has no levels of detail", path.display())));
    }
    let Loaded { grid, placement } = load(path, import)?;
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
    Err(Error::new(crate::error::Code::Range, "index", format!("{index} is outside: {name} has 0 to {}", n - 1)))
}

/// Plane `index` across `axis` of a grid.
pub(super) fn cut(grid: &Grid, axis: Axis, index: u32) -> Result<Grid> {
    let mut region = crate::geometry::Region::whole(grid.extent());
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
