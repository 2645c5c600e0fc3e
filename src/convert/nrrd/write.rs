//! Writes NRRD0005 headers, and attached files with gzip.

use super::super::export::ExportInfo;
use super::super::layout::Role;
use super::super::stored::Kind;
use super::super::stream::write_samples;
use super::axes::role_of;
use super::order::{Axes, Axis};
use super::times::index_key;
use super::{VALUE_OFFSET, VALUE_SCALE, fields};
use crate::affine::{Placement, Space, Unit, ValueMap};
use crate::grid::SlabReader;
use crate::time::{TimeUnit, Times};
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
pub(in super::super) fn write_attached(
    out: &mut dyn Write,
    source: &mut dyn SlabReader,
    info: &ExportInfo<'_>,
) -> io::Result<()> {
    header(out, source, info, "gzip")?;
    writeln!(out)?;
    let mut packed = GzEncoder::new(out, Compression::fast());
    write_data(&mut packed, source, info)?;
    packed.finish()?;
    Ok(())
}

/// The samples alone.
pub(in super::super) fn write_data(
    out: &mut dyn Write,
    source: &mut dyn SlabReader,
    info: &ExportInfo<'_>,
) -> io::Result<()> {
    let axes = axes(source, info);
    write_samples(out, source, &axes.roles())
}

/// The header of a pair; `data` is the name of the raw file beside it.
pub(in super::super) fn write_header(
    out: &mut dyn Write,
    source: &dyn SlabReader,
    info: &ExportInfo<'_>,
    data: &str,
) -> io::Result<()> {
    header(out, source, info, "raw")?;
    writeln!(out, "data file: {data}")
}

fn axes(source: &dyn SlabReader, info: &ExportInfo<'_>) -> Axes {
    Axes::new(source.sample_type(), source.series(), Source(info.header).field("kinds"), info.times.is_some())
}

fn header(out: &mut dyn Write, source: &dyn SlabReader, info: &ExportInfo<'_>, encoding: &str) -> io::Result<()> {
    let kind = Kind::from(source.sample_type());
    let (extent, (steps, channels)) = (source.extent().to_array(), source.series());
    let axes = axes(source, info);
    let source = Source(info.header);
    writeln!(out, "NRRD0005")?;
    for comment in source.comments() {
        writeln!(out, "# {}", one_line(comment))?;
    }
    writeln!(out, "type: {}", fields::type_name(kind))?;
    writeln!(out, "dimension: {}", axes.list.len())?;
    let place = Place { placement: info.placement, times: info.times, axes: &axes, source };
    place.write_space(out)?;
    let size = |axis: &Axis| match axis.role {
        Role::Space(i) => extent[i],
        Role::Time => steps,
        Role::Channel => channels,
        Role::Nothing => 3,
    };
    writeln!(out, "sizes: {}", axes.line(|a| size(a).to_string()))?;
    place.write_axes(out)?;
    writeln!(out, "kinds: {}", axes.line(|a| a.kind.clone()))?;
    if kind.bytes() > 1 && kind != Kind::Rgb8 {
        writeln!(out, "endian: little")?;
    }
    writeln!(out, "encoding: {encoding}")?;
    if let Some(content) = source.content() {
        writeln!(out, "content: {}", one_line(content))?;
    }
    for (name, value) in source.fields() {
        let id = name.to_ascii_lowercase();
        let same_axes = || axes.original && fields::quoted(value).is_some_and(|v| v.len() == axes.list.len());
        // A frame without a space to stand in is an error in NRRD.
        let framed = info.placement.space != Space::Unknown || !id.starts_with("measurement");
        let fits = RESTORED.contains(&id.as_str()) && framed;
        if fits || RESTORED_PER_AXIS.contains(&id.as_str()) && same_axes() {
            writeln!(out, "{name}: {}", one_line(value))?;
        }
    }
    for (key, value) in source.key_values().filter(|(key, _)| !is_index(key)) {
        writeln!(out, "{}:={}", one_line(key), one_line(value))?;
    }
    place.write_index(out)?;
    if info.value_map != ValueMap::default() {
        writeln!(out, "{VALUE_SCALE}:={:?}", info.value_map.scale)?;
        writeln!(out, "{VALUE_OFFSET}:={:?}", info.value_map.offset)?;
    }
    Ok(())
}

/// Whether a pair says what the items of a list are: it is written anew, for the items that there are.
fn is_index(key: &str) -> bool {
    key.strip_prefix("axis ").is_some_and(|k| k.ends_with(" index values") || k.ends_with(" index type"))
}

/// The shortest text that reads back as the same number.
fn number(v: f64) -> String {
    if v.is_nan() { "nan".to_owned() } else { format!("{v:?}") }
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

/// Placement and times as header lines.
struct Place<'a> {
    placement: &'a Placement,
    times: Option<&'a Times>,
    axes: &'a Axes,
    source: Source<'a>,
}

impl Place<'_> {
    /// Whether spacings alone say all that is known of space.
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

    fn time_axis(&self) -> Option<usize> {
        self.axes.list.iter().position(|a| a.role == Role::Time)
    }

    /// First time and interval that give exactly these times.
    fn regular(&self) -> Option<(f64, f64)> {
        let axis = self.time_axis()?;
        let times = self.times.filter(|t| t.steps.len() > 1)?;
        let centers = self.source.field("centers").or_else(|| self.source.field("centerings"));
        let cell = centers.and_then(|c| c.split_whitespace().nth(axis)).is_some_and(|c| c.eq_ignore_ascii_case("cell"));
        if cell && self.axes.original && times.steps[0] != 0.0 {
            // The minimum of such an axis lies half an interval before its first sample, which rounds.
            return None;
        }
        let (first, steps) = (times.steps[0], times.steps.len() as u32);
        let candidates = [Some(times.steps[1] - first), times.interval()];
        let exact = |i: &f64| *i > 0.0 && Times::regular(times.unit, first, *i, steps) == *times;
        candidates.into_iter().flatten().find(exact).map(|interval| (first, interval))
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
        let spaced = self.plain() && !p.spacing_unknown;
        let regular = self.regular();
        if spaced || regular.is_some() {
            let spacing = |a: &Axis| match (a.role, regular) {
                (Role::Space(i), _) if spaced => p.matrix[i][i],
                (Role::Time, Some((_, interval))) => interval,
                _ => f64::NAN,
            };
            // Between channels there is no distance: whatever was written there has no meaning.
            let equal = |a: f64, axis: &Axis| {
                let b = spacing(axis);
                a == b || a.is_nan() && b.is_nan() || matches!(axis.role, Role::Channel | Role::Nothing)
            };
            let same = |text: &&str| {
                let known = fields::numbers(text).unwrap_or_default();
                known.len() == self.axes.list.len()
                    && known.iter().zip(&self.axes.list).all(|(n, axis)| equal(*n, axis))
            };
            match self.source.field("spacings").filter(same) {
                // As it was written down.
                Some(text) => writeln!(out, "spacings: {}", one_line(text))?,
                None => writeln!(out, "spacings: {}", self.axes.line(|a| number(spacing(a))))?,
            }
        }
        if let Some((first, _)) = regular.filter(|(first, _)| *first != 0.0) {
            let min = |a: &Axis| if a.role == Role::Time { format!("{first:?}") } else { "nan".to_owned() };
            writeln!(out, "axis mins: {}", self.axes.line(min))?;
        }
        let vector = |v: [f64; 3]| format!("({:?},{:?},{:?})", v[0], v[1], v[2]);
        if !self.plain() {
            let direction = |a: &Axis| match a.role {
                Role::Space(i) if !self.unplaced() => vector(p.direction(i)),
                _ => "none".to_owned(),
            };
            writeln!(out, "space directions: {}", self.axes.line(direction))?;
            writeln!(out, "space origin: {}", vector(p.origin()))?;
        }
        self.write_units(out)
    }

    fn write_units(&self, out: &mut dyn Write) -> io::Result<()> {
        let quoted = |text: &str| format!("\"{}\"", one_line(text).replace('"', ""));
        let space = self.space_units();
        let time = self.times.map(|t| t.unit).filter(|u| *u != TimeUnit::Unknown && self.time_axis().is_some());
        if let Some(texts) = space.as_ref().filter(|_| !self.plain()) {
            let list = texts.iter().map(|t| quoted(t)).collect::<Vec<_>>().join(" ");
            writeln!(out, "space units: {list}")?;
        }
        let per_axis = space.filter(|_| self.plain());
        if per_axis.is_none() && time.is_none() {
            return Ok(());
        }
        let unit = |a: &Axis| match a.role {
            Role::Space(i) => quoted(per_axis.as_ref().map_or("", |texts| &texts[i])),
            Role::Time => quoted(time.map_or("", TimeUnit::name)),
            Role::Channel | Role::Nothing => quoted(""),
        };
        writeln!(out, "units: {}", self.axes.line(unit))
    }

    /// The units of x, y, z, as texts.
    fn space_units(&self) -> Option<Vec<String>> {
        let unit = self.placement.unit;
        let original = ["spaceunits", "units"].into_iter().find_map(|id| {
            let list = fields::quoted(self.source.field(id)?)?;
            // Of the units of all axes, those of space; where kinds do not say which they are, the last three.
            let kinds: Vec<&str> = self.source.field("kinds").unwrap_or("").split_whitespace().collect();
            let is_space = |kind: &str| matches!(role_of(kind), Some(Role::Space(_)));
            let spatial: Vec<String> = match kinds.iter().filter(|k| is_space(k)).count() {
                3 if kinds.len() == list.len() => {
                    kinds.iter().zip(&list).filter(|(k, _)| is_space(k)).map(|(_, text)| text.clone()).collect()
                }
                _ => list.get(list.len().checked_sub(3)?..)?.to_vec(),
            };
            let known = spatial.iter().all(|t| fields::unit_of(t) == unit);
            // Units that Vug has no code for (or mixed ones) are texts alone; a known unit has replaced them.
            let mixed = spatial.iter().any(|t| fields::unit_of(t) == Unit::Unknown || *t != spatial[0]);
            (known || unit == Unit::Unknown && mixed).then_some(spatial)
        });
        match (original, unit) {
            (Some(texts), _) => Some(texts),
            (None, Unit::Unknown) => None,
            (None, unit) => Some(vec![unit.name().to_owned(); 3]),
        }
    }

    /// Times that are not evenly apart, as Slicer lists them.
    fn write_index(&self, out: &mut dyn Write) -> io::Result<()> {
        let (Some(times), Some(axis)) = (self.times, self.time_axis()) else { return Ok(()) };
        // Slicer's own lists stay lists, so that it finds them again.
        if self.regular().is_some() && self.axes.list[axis].kind != "list" {
            return Ok(());
        }
        let values = times.steps.iter().map(|t| format!("{t:?}")).collect::<Vec<_>>().join(" ");
        writeln!(out, "axis {axis} index type:=numeric")?;
        writeln!(out, "{}:={values}", index_key(axis))
    }
}
