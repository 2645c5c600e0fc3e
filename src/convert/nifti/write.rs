//! Writes NIfTI-1, or NIfTI-2 where an axis is longer than i16 can say or a coordinate larger than f32.

use super::header::{self, Header};
use super::{geometry, kept, times};
use crate::affine::ValueMap;
use crate::convert::export::ExportInfo;
use crate::convert::stream::{TIME_THEN_CHANNELS, write_samples};
use crate::grid::SlabReader;
use crate::voxel::SampleType;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::{self, Write};

/// Which bytes of a volume go into a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum Part {
    /// Header, then data: `.nii`.
    Whole,
    /// `.hdr`.
    Header,
    /// `.img`.
    Data,
}

/// Writes one file, packed where `gzip`.
pub(in super::super) fn write(
    out: &mut dyn Write,
    source: &mut dyn SlabReader,
    info: &ExportInfo<'_>,
    part: Part,
    gzip: bool,
) -> io::Result<()> {
    if gzip {
        let mut packed = GzEncoder::new(out, Compression::fast());
        write_plain(&mut packed, source, info, part)?;
        packed.finish()?;
        return Ok(());
    }
    write_plain(out, source, info, part)
}

fn write_plain(out: &mut dyn Write, source: &mut dyn SlabReader, info: &ExportInfo<'_>, part: Part) -> io::Result<()> {
    if part != Part::Data {
        header::write(out, &build(source, info, part == Part::Whole))?;
        // No extensions follow.
        out.write_all(&[0; 4])?;
    }
    if part == Part::Header { Ok(()) } else { write_samples(out, source, &TIME_THEN_CHANNELS) }
}

/// The header of a volume.
fn build(source: &dyn SlabReader, info: &ExportInfo<'_>, single: bool) -> Header {
    let axes = source.extent().to_array();
    let (steps, channels) = source.series();
    let (ras, _) = geometry::in_ras(info.placement);
    let small = ras.matrix.as_flattened().iter().all(|v| (*v as f32).is_finite())
        && ras.spacing().iter().all(|s| (*s as f32).is_normal());
    let version =
        if small && axes.iter().chain([&steps, &channels]).all(|a| i16::try_from(*a).is_ok()) { 1 } else { 2 };
    let (datatype, bitpix) = match source.sample_type() {
        SampleType::U8 => (2, 8),
        SampleType::U16 => (512, 16),
        SampleType::I16 => (4, 16),
        SampleType::F32 => (16, 32),
        SampleType::Rgb8 => (128, 24),
    };
    let mut h = Header { version, single, datatype, bitpix, pixdim: [1.0; 8], ..Header::default() };
    let dimensions = if channels > 1 { 5 } else { 3 + i64::from(steps > 1) };
    h.dim = [dimensions, axes[0].into(), axes[1].into(), axes[2].into(), steps.into(), channels.into(), 1, 1];
    h.vox_offset = if single { (h.bytes() + 4) as f64 } else { 0.0 };
    if info.value_map != ValueMap::default() {
        (h.scl_slope, h.scl_inter) = (info.value_map.scale, info.value_map.offset);
    }
    let restored = info.header.is_some_and(|source| {
        kept::restore(&mut h, source);
        kept::restore_forms(&mut h, source, info.placement)
    });
    if !restored {
        geometry::write(&mut h, info.placement);
    }
    times::write(&mut h, info.times, steps);
    h
}
