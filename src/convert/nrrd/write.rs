//! Writes NRRD0005 headers, and attached files with gzip.

use super::super::export::{ExportInfo, write_samples};
use super::super::stored::Kind;
use super::{VALUE_OFFSET, VALUE_SCALE, fields};
use crate::affine::{Placement, Space, Unit, ValueMap};
use crate::geometry::Extent;
use crate::grid::Grid;
use crate::voxel::SampleType;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::Value;
use std::io::{self, Write};

/// Fields that mean the same in any file of the same number of axes, and are put back as they were.
const RESTORED: [&str; 6] =
    ["sample units", "sampleunits", "measurement frame", "measurementframe", "old min", "old max"];
/// The same, one word or quoted text per axis: put back where the number of axes is the same.
const RESTORED_PER_AXIS: [&str; 4] = ["labels", "centers", "centerings", "thicknesses"];

/// One file: header, empty line, samples in gzip.
pub(in super::super) fn write_attached(out: &mut dyn Write, grid: &Grid, info: &ExportInfo<'_>) -> io::Result<()> {
    header(out, grid, info, "gzip")?;
    writeln!(out)?;
    let mut packed = GzEncoder::new(out, Compression::fast());
    write_samples(&mut packed, grid)?;
    packed.finish()?;
    Ok(())
}

/// The header of a pair; `data` is the name of the raw file beside it.
pub(in super::super) fn write_header(
    out: &mut dyn Write,
    grid: &Grid,
    info: &ExportInfo<'_>,
    data: &str,
) -> io::Result<()> {
    header(out, grid, info, "raw")?;
    writeln!(out, "data file: {data}")
}

fn header(out: &mut dyn Write, grid: &Grid, info: &ExportInfo<'_>, encoding: &str) -> io::Result<()> {
    let kind = Kind::from(grid.sample_type());
    let rgb = grid.sample_type() == SampleType::Rgb8;
    let Extent { x, y, z } = grid.extent();
    let source = Source(info.header);
    writeln!(out, "NRRD0005")?;
    for comment in source.comments() {
        writeln!(out, "# {}", one_line(comment))?;
    }
    writeln!(out, "type: {}", fields::type_name(kind))?;
    writeln!(out, "dimension: {}", if rgb { 4 } else { 3 })?;
    let (per_axis, kinds) = if rgb { ("3 ", "RGB-color ") } else { ("", "") };
    let place = Place { placement: info.placement, rgb, source };
    place.write_space(out)?;
    writeln!(out, "sizes: {per_axis}{x} {y} {z}")?;
    place.write_axes(out)?;
    writeln!(out, "kinds: {kinds}domain domain domain")?;
    if kind.bytes() > 1 && !rgb {
        writeln!(out, "endian: little")?;
    }
    writeln!(out, "encoding: {encoding}")?;
    if let Some(content) = source.content() {
        writeln!(out, "content: {}", one_line(content))?;
    }
    for (name, value) in source.fields() {
        let id = name.to_ascii_lowercase();
        let same_axes = || fields::quoted(value).is_some_and(|v| v.len() == if rgb { 4 } else { 3 });
        // A frame without a space to stand in is an error in NRRD.
        let framed = info.placement.space != Space::Unknown || !id.starts_with("measurement");
        let fits = RESTORED.contains(&id.as_str()) && framed;
        if fits || RESTORED_PER_AXIS.contains(&id.as_str()) && same_axes() {
            writeln!(out, "{name}: {}", one_line(value))?;
        }
    }
    for (key, value) in source.key_values() {
        writeln!(out, "{}:={}", one_line(key), one_line(value))?;
    }
    if info.value_map != ValueMap::default() {
        writeln!(out, "{VALUE_SCALE}:={:?}", info.value_map.scale)?;
        writeln!(out, "{VALUE_OFFSET}:={:?}", info.value_map.offset)?;
    }
    Ok(())
}

/// A header line must stay one.
fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

/// The header object of the import.
#[derive(Clone, Copy)]
struct Source<'a>(Option<&'a Value>);

impl<'a> Source<'a> {
    fn get(self, key: &str) -> Option<&'a Value> {
        self.0?.get(key)
    }

    fn pairs(self, key: &str) -> impl Iterator<Item = (&'a str, &'a str)> {
        let object = self.get(key).and_then(Value::as_object);
        object.into_iter().flatten().filter_map(|(k, v)| Some((k.as_str(), v.as_str()?)))
    }

    fn comments(self) -> impl Iterator<Item = &'a str> {
        self.get("comments").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str)
    }

    fn fields(self) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.pairs("fields")
    }

    fn field(self, id: &str) -> Option<&'a str> {
        self.fields().find(|(name, _)| name.to_ascii_lowercase().replace(' ', "") == id).map(|(_, value)| value)
    }

    fn key_values(self) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.pairs("key_values").filter(|(key, _)| !key.contains(":=") && !key.contains(": ") && !key.starts_with('#'))
    }

    /// NRRD's own, or NIfTI's description.
    fn content(self) -> Option<&'a str> {
        self.field("content").or_else(|| self.get("descrip").and_then(Value::as_str)).filter(|t| !t.trim().is_empty())
    }
}

/// A placement as header lines.
struct Place<'a> {
    placement: &'a Placement,
    rgb: bool,
    source: Source<'a>,
}

impl Place<'_> {
    /// Whether spacings alone say all that is known.
    fn plain(&self) -> bool {
        let m = &self.placement.matrix;
        let off_axis = (0..3).flat_map(|r| (0..4).map(move |c| (r, c))).filter(|(r, c)| r != c);
        self.placement.space == Space::Unknown && off_axis.into_iter().all(|(r, c)| m[r][c] == 0.0)
    }

    /// Whether the matrix says nothing.
    fn unplaced(&self) -> bool {
        let identity = Placement::default().matrix;
        self.placement.spacing_unknown && (0..3).all(|r| self.placement.matrix[r][..3] == identity[r][..3])
    }

    fn write_space(&self, out: &mut dyn Write) -> io::Result<()> {
        if self.plain() {
            return Ok(());
        }
        let space = self.placement.space;
        // The name as it was, where it still means the same ("LPS", "3D-left-handed").
        let original = self.source.field("space").filter(|t| fields::space_of(t) == Some((space, 3)));
        match original.or(fields::space_name(space)) {
            Some(name) => writeln!(out, "space: {name}"),
            None => writeln!(out, "space dimension: 3"),
        }
    }

    fn write_axes(&self, out: &mut dyn Write) -> io::Result<()> {
        let p = self.placement;
        // Debug prints the shortest text that reads back as the same number.
        let vector = |v: [f64; 3]| format!("({:?},{:?},{:?})", v[0], v[1], v[2]);
        if self.plain() {
            if !p.spacing_unknown {
                let m = &p.matrix;
                let first = if self.rgb { "nan " } else { "" };
                writeln!(out, "spacings: {first}{:?} {:?} {:?}", m[0][0], m[1][1], m[2][2])?;
            }
        } else {
            let first = if self.rgb { "none " } else { "" };
            if self.unplaced() {
                writeln!(out, "space directions: {first}none none none")?;
            } else {
                let [a, b, c] = [0, 1, 2].map(|axis| vector(p.direction(axis)));
                writeln!(out, "space directions: {first}{a} {b} {c}")?;
            }
            writeln!(out, "space origin: {}", vector(p.origin()))?;
        }
        self.write_unit(out)
    }

    fn write_unit(&self, out: &mut dyn Write) -> io::Result<()> {
        let unit = self.placement.unit;
        let original = ["spaceunits", "units"].into_iter().find_map(|id| {
            let list = fields::quoted(self.source.field(id)?)?;
            // Of per-axis units, the last three are those of space.
            let spatial = list.get(list.len().checked_sub(3)?..)?.to_vec();
            let known = spatial.iter().all(|t| fields::unit_of(t) == unit);
            // Units that Vug has no code for (or mixed ones) are texts alone; a known unit has replaced them.
            let mixed = spatial.iter().any(|t| fields::unit_of(t) == Unit::Unknown || *t != spatial[0]);
            (known || unit == Unit::Unknown && mixed).then_some(spatial)
        });
        let texts = match (original, unit) {
            (Some(texts), _) => texts,
            (None, Unit::Unknown) => return Ok(()),
            (None, unit) => vec![unit.name().to_owned(); 3],
        };
        let list = texts.iter().map(|t| format!("\"{}\"", one_line(t).replace('"', ""))).collect::<Vec<_>>().join(" ");
        match (self.plain(), self.rgb) {
            (false, _) => writeln!(out, "space units: {list}"),
            (true, true) => writeln!(out, "units: \"\" {list}"),
            (true, false) => writeln!(out, "units: {list}"),
        }
    }
}
