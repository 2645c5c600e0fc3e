//! NIfTI-1 and NIfTI-2: `.nii`, `.nii.gz`, and pairs of `.hdr` and `.img` (either of them packed).
//!
//! The crate `nifti` parses NIfTI-1 headers. It knows no NIfTI-2, reads volumes whole, and writes only from whole arrays of
//! another crate; those parts are our own. Its volumes judge our files in the tests.

mod geometry;
mod header;
mod kept;
mod nifti1;
mod nifti2;
mod times;
mod write;

pub(super) use write::{Part, write};

use super::inflate::{Packed, Packing, Skip};
use super::layout::{Layout, Role};
use super::payload::{self, Bytes, Payload};
use super::stored::{Kind, Stored};
use super::{Format, Import, ImportOptions, Probe, fault};
use crate::affine::ValueMap;
use crate::error::Result;
use header::Header;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// `intent_code` of images whose numbers are an index into a list of labels (nifti1.h).
const INTENT_LABEL: i32 = 1002;
/// The same, for a list of names of the brain's parts.
const INTENT_NEURONAME: i32 = 1005;

/// Opens a NIfTI file, or a pair by the name of either half.
pub(super) fn import(path: &Path, options: &ImportOptions) -> Result<Import> {
    let (header, header_path, data_path) = find(path)?;
    let path = header_path.as_path();
    let Probe { kind, layout, value_map } = understand(path, &header)?;
    let stored = Stored { kind, big_endian: header.big_endian };
    let placement = geometry::read(path, &header)?;
    let expected = layout.bytes(kind);
    let start = data_start(path, &header)?;

    let data_path = data_path.as_path();
    let (mut file, len) = payload::open(data_path)?;
    let bytes = if is_gzip(data_path, &mut file)? {
        let packed = Packed { path: data_path, file, len, start: 0, packing: Packing::Gzip };
        packed.unpack(Skip::First(start), expected, options)?
    } else {
        let found = len.saturating_sub(start);
        if found != expected {
            let message = format!("dim needs {expected} bytes of samples from byte {start} on, the file has {found}");
            return Err(fault::foreign(data_path, "dim", message));
        }
        Bytes::File { file, path: data_path.to_owned(), start, spooled: 0 }
    };
    let opened = Payload { bytes, stored, layout }.open(data_path, options.dtype)?;
    Ok(Import {
        placement,
        times: times::read(&header, layout.time_steps),
        labels: matches!(header.intent_code, INTENT_LABEL | INTENT_NEURONAME),
        value_map,
        ..Import::plain(opened, Format::Nifti, kept::to_json(&header))
    })
}

/// What the header says of the samples.
pub(super) fn probe(path: &Path) -> Result<Probe> {
    let (header, path, _) = find(path)?;
    understand(&path, &header)
}

/// The header, and the files that it and the data lie in, which are there.
fn find(path: &Path) -> Result<(Header, PathBuf, PathBuf)> {
    let (header_path, data_path) = halves(path)?;
    let header = header::parse(&header_path, &head(&header_path)?)?;
    let path = header_path.as_path();
    let data_path = if header.single { path } else { data_path.as_deref().unwrap_or(path) };
    if !header.single && data_path == path {
        let message = "the header is that of a pair, but the file is not called .hdr or .img; rename it";
        return Err(fault::foreign(path, "magic", message));
    }
    if !data_path.is_file() {
        let message = format!("the image {} that this header describes is not there", data_path.display());
        return Err(fault::foreign(path, "data", message));
    }
    let data_path = data_path.to_owned();
    Ok((header, header_path, data_path))
}

/// Shape, type and value map.
fn understand(path: &Path, header: &Header) -> Result<Probe> {
    let axes = axes(path, header)?;
    let kind = kind(path, header)?;
    Ok(Probe { kind, layout: Layout::new(path, "dim", &axes, kind)?, value_map: value_map(path, header, kind)? })
}

/// The files that hold header and data; the second is `None` where one file holds both.
fn halves(path: &Path) -> Result<(PathBuf, Option<PathBuf>)> {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let lower = name.to_ascii_lowercase();
    let plain = lower.strip_suffix(".gz").unwrap_or(&lower);
    let other = match plain.rfind('.').map(|dot| (dot, &plain[dot..])) {
        Some((dot, ".hdr")) => (dot, "img"),
        Some((dot, ".img")) => (dot, "hdr"),
        _ => return Ok((path.to_owned(), None)),
    };
    // Upper-case names have upper-case partners.
    let (dot, ending) = other;
    let upper = name[dot + 1..].starts_with(|c: char| c.is_ascii_uppercase());
    let candidates = [ending.to_owned(), format!("{ending}.gz")]
        .map(|e| if upper { e.to_ascii_uppercase() } else { e })
        .map(|e| path.with_file_name(format!("{}.{e}", &name[..dot])));
    let partner = candidates.iter().find(|p| p.is_file()).cloned();
    if ending == "hdr" {
        let header = partner.ok_or_else(|| {
            let message = format!("the header {} is not there", candidates[0].display());
            fault::foreign(path, "header", message)
        })?;
        return Ok((header, Some(path.to_owned())));
    }
    // A header that says "single" needs no partner; `import` looks at it before it misses one.
    Ok((path.to_owned(), Some(partner.unwrap_or_else(|| candidates[0].clone()))))
}

/// Whether the file starts like gzip. The content decides: names are not to be relied on. Leaves the file at its start.
fn is_gzip(path: &Path, file: &mut File) -> Result<bool> {
    let mut magic = Vec::new();
    file.by_ref().take(2).read_to_end(&mut magic).map_err(|e| fault::io(path, e))?;
    file.seek(SeekFrom::Start(0)).map_err(|e| fault::io(path, e))?;
    Ok(magic == [0x1f, 0x8b])
}

/// The first bytes of a file, enough for either header, or fewer where it ends.
fn head(path: &Path) -> Result<Vec<u8>> {
    let (mut file, _) = payload::open(path)?;
    let gzip = is_gzip(path, &mut file)?;
    let mut stream: Box<dyn Read> = if gzip { Packing::Gzip.reader(file) } else { Box::new(file) };
    let mut head = Vec::new();
    stream.by_ref().take(header::BYTES_2 as u64).read_to_end(&mut head).map_err(|e| {
        if e.raw_os_error().is_some() {
            fault::io(path, e)
        } else {
            fault::foreign(path, "header", format!("the gzip stream is damaged or cut short ({e})"))
        }
    })?;
    Ok(head)
}

/// The axes of `dim`: x, y, z, time, and the values of a voxel, which are channels.
fn axes(path: &Path, header: &Header) -> Result<Vec<(Role, u64)>> {
    const ROLES: [Role; 5] = [Role::Space(0), Role::Space(1), Role::Space(2), Role::Time, Role::Channel];
    let n = header.dim[0];
    let n = usize::try_from(n).ok().filter(|n| (1..=7).contains(n));
    let n = n.ok_or_else(|| fault::foreign(path, "dim[0]", format!("{} is not from 1 to 7", header.dim[0])))?;
    let mut sizes = Vec::new();
    for (i, size) in header.dim[1..=n].iter().enumerate() {
        let positive = u64::try_from(*size).ok().filter(|s| *s > 0);
        let message = || format!("{size} voxels; every axis needs at least one");
        sizes.push(positive.ok_or_else(|| fault::foreign(path, format!("dim[{}]", i + 1), message()))?);
    }
    if sizes.iter().skip(ROLES.len()).any(|s| *s > 1) {
        let text = sizes.iter().map(u64::to_string).collect::<Vec<_>>().join("×");
        let message = format!("{text}: arrays of more than space, time and one axis of values come in a later version");
        return Err(fault::unsupported(path, "dim", message));
    }
    Ok(ROLES.into_iter().zip(sizes).collect())
}

/// The sample type that `datatype` stands for.
fn kind(path: &Path, header: &Header) -> Result<Kind> {
    let unsupported = |what: &str| {
        let message =
            format!("{} ({what}) comes in a later version; convert the image to a scalar type", header.datatype);
        Err(fault::unsupported(path, "datatype", message))
    };
    let kind = match header.datatype {
        2 => Kind::U8,
        4 => Kind::I16,
        8 => Kind::I32,
        16 => Kind::F32,
        64 => Kind::F64,
        128 => Kind::Rgb8,
        256 => Kind::I8,
        512 => Kind::U16,
        768 => Kind::U32,
        1024 => Kind::I64,
        1280 => Kind::U64,
        1 => return unsupported("one bit per voxel"),
        32 => return unsupported("complex numbers of two f32"),
        1536 => return unsupported("128-bit float"),
        1792 => return unsupported("complex numbers of two f64"),
        2048 => return unsupported("complex numbers of two f128"),
        2304 => return unsupported("RGBA"),
        other => return Err(fault::foreign(path, "datatype", format!("{other} is not a type of NIfTI"))),
    };
    // Some writers leave bitpix at 0.
    if header.bitpix != 0 && i64::from(header.bitpix) != kind.bytes() as i64 * 8 {
        let message = format!("{} contradicts datatype {} ({kind})", header.bitpix, header.datatype);
        return Err(fault::foreign(path, "bitpix", message));
    }
    Ok(kind)
}

/// Byte where the samples start in the data file.
fn data_start(path: &Path, header: &Header) -> Result<u64> {
    let offset = header.vox_offset;
    // f32 holds whole numbers exactly up to 2^24; beyond, the offset of a NIfTI-1 file is rounded, and still whole.
    let whole = offset.is_finite() && offset >= 0.0 && offset.fract() == 0.0 && offset < 9e15;
    let least = if header.single { header.bytes() as f64 + 4.0 } else { 0.0 };
    match offset {
        _ if whole && offset >= least => Ok(offset as u64),
        // Single files with offset 0 are old and common; the data follow the header.
        0.0 => Ok(least as u64),
        _ => {
            let message = format!("{offset} is not a whole number of bytes from {least} on");
            Err(fault::foreign(path, "vox_offset", message))
        }
    }
}

/// Slope and intercept. A slope of 0 (or NaN, as some writers have it) means none; colours have none.
fn value_map(path: &Path, header: &Header, kind: Kind) -> Result<ValueMap> {
    if header.scl_slope == 0.0 || !header.scl_slope.is_finite() || kind == Kind::Rgb8 {
        return Ok(ValueMap::default());
    }
    if !header.scl_inter.is_finite() {
        let message = format!("{} is not finite, but scl_slope is {}", header.scl_inter, header.scl_slope);
        return Err(fault::foreign(path, "scl_inter", message));
    }
    Ok(ValueMap { scale: header.scl_slope, offset: header.scl_inter })
}
