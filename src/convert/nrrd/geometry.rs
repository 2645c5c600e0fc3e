//! Placement from `space`, `space directions`, `space origin`, `spacings`, `axis mins` and the units.

use super::axes::Axes;
use super::fields;
use super::header::Header;
use crate::affine::{Placement, Space, Unit};
use crate::convert::fault;
use crate::error::Result;
use std::path::Path;

/// Where the volume lies. What the header leaves out (or states as NaN) is unknown, never guessed.
///
/// # Errors
/// `E_FOREIGN` for malformed fields, a spacing of zero, or directions that are not independent; `E_UNSUPPORTED` for a
/// space of more than three dimensions.
pub(super) fn read(path: &Path, header: &Header, axes: &Axes) -> Result<Placement> {
    let mut placement =
        Placement { space: space(path, header)?, unit: unit(path, header, axes)?, ..Placement::default() };
    let field = if header.get("spacedirections").is_some() { "space directions" } else { "spacings" };
    if let Some(text) = header.get("spacedirections") {
        directions(path, text, axes, &mut placement)?;
    } else if let Some(text) = header.get("spacings") {
        spacings(path, text, axes, &mut placement)?;
    }
    origin(path, header, axes, &mut placement)?;
    placement.check().map_err(|e| fault::relabel(path, field, &e))?;
    Ok(placement)
}

fn space(path: &Path, header: &Header) -> Result<Space> {
    let dims = match header.get("spacedimension") {
        None => 3,
        Some(text) => {
            text.parse().map_err(|_| fault::foreign(path, "space dimension", format!("{text:.20?} is not a number")))?
        }
    };
    let (space, dims) = match header.get("space") {
        None => (Space::Unknown, dims),
        Some(name) => fields::space_of(name)
            .ok_or_else(|| fault::foreign(path, "space", format!("{name:.40?} is not a space of NRRD")))?,
    };
    if dims > 3 {
        let message =
            format!("a space of {dims} dimensions comes in a later version; write the file with a space of 3");
        return Err(fault::unsupported(path, "space", message));
    }
    Ok(space)
}

/// The unit that all axes share.
fn unit(path: &Path, header: &Header, axes: &Axes) -> Result<Unit> {
    let list = |id: &'static str| {
        let text = header.get(id)?;
        let parsed = fields::quoted(text);
        Some(parsed.ok_or_else(|| fault::foreign(path, id, format!("{text:.60?} is not a list of quoted units"))))
    };
    let units: Vec<Unit> = if let Some(list) = list("spaceunits") {
        list?.iter().map(|t| fields::unit_of(t)).collect()
    } else if let Some(list) = list("units") {
        let list = list?;
        axes.domain.iter().map(|a| list.get(*a).map_or(Unit::Unknown, |t| fields::unit_of(t))).collect()
    } else {
        Vec::new()
    };
    let first = units.first().copied().unwrap_or_default();
    // Axes in different units have no common one; the texts are kept with the header.
    Ok(if units.iter().all(|u| *u == first) { first } else { Unit::Unknown })
}

fn spacings(path: &Path, text: &str, axes: &Axes, placement: &mut Placement) -> Result<()> {
    let all = fields::numbers(text)
        .filter(|n| n.len() == axes.dimension)
        .ok_or_else(|| fault::foreign(path, "spacings", format!("{text:.80?} are not {} numbers", axes.dimension)))?;
    let steps: Vec<f64> = axes.domain.iter().map(|a| all[*a]).collect();
    if steps.iter().any(|s| s.is_nan()) {
        return Ok(());
    }
    for (axis, step) in steps.into_iter().enumerate() {
        placement.matrix[axis][axis] = step;
    }
    placement.spacing_unknown = false;
    Ok(())
}

fn directions(path: &Path, text: &str, axes: &Axes, placement: &mut Placement) -> Result<()> {
    let all = fields::vectors(text).filter(|v| v.len() == axes.dimension).ok_or_else(|| {
        let message = format!("{text:.80?} are not {} vectors or \"none\"", axes.dimension);
        fault::foreign(path, "space directions", message)
    })?;
    let mut columns = Vec::new();
    for axis in &axes.domain {
        // `none`, or NaN in older files: this axis has no place in space.
        let Some(vector) = all[*axis].as_ref().filter(|v| !v.iter().any(|c| c.is_nan())) else { return Ok(()) };
        if vector.is_empty() || vector.len() > 3 {
            let message = format!("a vector of {} numbers; one to three are expected", vector.len());
            return Err(fault::foreign(path, "space directions", message));
        }
        columns.push(std::array::from_fn(|i| vector.get(i).copied().unwrap_or(0.0)));
    }
    for (axis, column) in complete(columns).into_iter().enumerate() {
        for (row, value) in column.into_iter().enumerate() {
            placement.matrix[row][axis] = value;
        }
    }
    placement.spacing_unknown = false;
    Ok(())
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit_length(v: [f64; 3]) -> [f64; 3] {
    let length = v[0].hypot(v[1]).hypot(v[2]);
    v.map(|c| c / length)
}

/// Adds directions of length 1, perpendicular to those given, for axes that the array does not have.
fn complete(mut columns: Vec<[f64; 3]>) -> [[f64; 3]; 3] {
    if columns.is_empty() {
        columns.push([1.0, 0.0, 0.0]);
    }
    if columns.len() == 1 {
        let a = unit_length(columns[0]);
        // The world axis that is furthest from `a`, less its part along `a`.
        let axis = (0..3).min_by(|i, j| a[*i].abs().total_cmp(&a[*j].abs())).unwrap_or(1);
        columns.push(unit_length(std::array::from_fn(|i| f64::from(u8::from(i == axis)) - a[axis] * a[i])));
    }
    if columns.len() == 2 {
        columns.push(unit_length(cross(columns[0], columns[1])));
    }
    [columns[0], columns[1], columns[2]]
}

fn origin(path: &Path, header: &Header, axes: &Axes, placement: &mut Placement) -> Result<()> {
    let mut origin = [0.0; 3];
    if let Some(text) = header.get("spaceorigin") {
        let list = fields::vectors(text).filter(|v| v.len() == 1);
        let list =
            list.ok_or_else(|| fault::foreign(path, "space origin", format!("{text:.60?} is not one vector")))?;
        for (slot, value) in origin.iter_mut().zip(list.into_iter().flatten().flatten()) {
            // NaN: not known.
            *slot = if value.is_nan() { 0.0 } else { value };
        }
    } else if let Some(text) = header.get("axismins").filter(|_| header.get("spacedirections").is_none()) {
        let mins = fields::numbers(text).filter(|n| n.len() == axes.dimension);
        let mins = mins.ok_or_else(|| fault::foreign(path, "axis mins", format!("{text:.60?} are not numbers")))?;
        let centers: Vec<&str> = header.get("centers").unwrap_or("").split_whitespace().collect();
        for (i, axis) in axes.domain.iter().enumerate().filter(|(_, a)| !mins[**a].is_nan()) {
            // The minimum of a cell-centred axis is the border of its first sample, half a step before its centre.
            let cell = centers.get(*axis).is_some_and(|c| c.eq_ignore_ascii_case("cell"));
            origin[i] = mins[*axis] + if cell { placement.matrix[i][i] / 2.0 } else { 0.0 };
        }
    }
    for (row, value) in origin.into_iter().enumerate() {
        placement.matrix[row][3] = value;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::header::Field;
    use super::*;
    use crate::convert::layout::Layout;
    use crate::convert::stored::Kind;
    use crate::error::Code;
    use crate::geometry::Extent;

    fn placement(domain: &[usize], dimension: usize, lines: &[(&str, &str)]) -> Result<Placement> {
        let mut header = Header::default();
        for (id, value) in lines {
            header.fields.push(Field { id: (*id).into(), name: (*id).into(), value: (*value).into() });
        }
        let layout = Layout::single(Path::new("f.nrrd"), "sizes", Extent::cube(2), Kind::U8)?;
        let axes = Axes { kind: Kind::U8, layout, domain: domain.to_vec(), time: None, dimension };
        read(Path::new("f.nrrd"), &header, &axes)
    }

    #[test]
    fn spacing_and_origin() {
        let p =
            placement(&[1, 2, 3], 4, &[("spacings", "nan 1 2 -3"), ("units", "\"\" \"um\" \"um\" \"um\"")]).unwrap();
        assert_eq!((p.matrix[0][0], p.matrix[1][1], p.matrix[2][2]), (1.0, 2.0, -3.0));
        assert_eq!((p.unit, p.space, p.spacing_unknown), (Unit::Micrometre, Space::Unknown, false));
        let p = placement(
            &[0, 1, 2],
            3,
            &[
                ("space", "LPS"),
                ("spacedirections", "(0,2,0) (-1,0,0) (0,0,0.5)"),
                ("spaceorigin", "(10,-20,30.5)"),
                ("spaceunits", "\"mm\" \"mm\" \"mm\""),
            ],
        )
        .unwrap();
        assert_eq!(p.matrix, [[0.0, -1.0, 0.0, 10.0], [2.0, 0.0, 0.0, -20.0], [0.0, 0.0, 0.5, 30.5]]);
        assert_eq!((p.unit, p.space), (Unit::Millimetre, Space::Lps));
        let lines = [("spacings", "1 1 2"), ("axismins", "5 nan 5"), ("centers", "node cell cell")];
        assert_eq!(placement(&[0, 1, 2], 3, &lines).unwrap().origin(), [5.0, 0.0, 6.0]);
    }

    #[test] // D-56, D-58: NaN means unknown; zero and singular are errors; left-handed is legal
    fn degenerate() {
        assert!(placement(&[0, 1, 2], 3, &[]).unwrap().spacing_unknown);
        let p = placement(&[0, 1, 2], 3, &[("spacings", "1 NaN 2")]).unwrap();
        assert_eq!(p, Placement::default());
        let p = placement(&[0, 1, 2], 3, &[("spacedirections", "none (0,1,0) (0,0,1)")]).unwrap();
        assert!(p.spacing_unknown);
        placement(&[0, 1, 2], 3, &[("spacedirections", "(-1,0,0) (0,1,0) (0,0,1)")]).unwrap();
        for bad in [
            ("spacings", "1 0 1"),
            ("spacings", "1 inf 1"),
            ("spacings", "1 1e-310 1"),
            ("spacings", "1 1"),
            ("spacedirections", "(1,0,0) (2,0,0) (0,0,1)"),
            ("spacedirections", "(1,0,0) (0,0,0) (0,0,1)"),
            ("spacedirections", "(1,0,0) (0,1,0)"),
            ("spacedirections", "(1,0,0,0) (0,1,0,0) (0,0,1,0)"),
            ("spaceorigin", "1 2 3"),
            ("spaceorigin", "(inf,0,0)"),
            ("space", "nowhere"),
            ("spaceunits", "\"mm"),
        ] {
            let e = placement(&[0, 1, 2], 3, &[bad]).unwrap_err();
            assert_eq!(e.code(), Code::Foreign, "{bad:?}");
        }
        assert_eq!(placement(&[0], 1, &[("space", "RAST")]).unwrap_err().code(), Code::Unsupported);
    }

    #[test]
    fn fewer_axes_than_space_has() {
        let p = placement(&[0, 1], 2, &[("spacedirections", "(0,0,2) (0,3,0)")]).unwrap();
        assert_eq!(p.direction(2), [-1.0, 0.0, 0.0]);
        let p = placement(&[0], 1, &[("spacedirections", "(4,0,0)")]).unwrap();
        assert_eq!(p.spacing(), [4.0, 1.0, 1.0]);
        let p = placement(&[0], 1, &[("spacings", "1.5")]).unwrap();
        assert_eq!(p.spacing(), [1.5, 1.0, 1.0]);
        assert!(placement(&[0, 1], 2, &[("spacedirections", "(0,0,2) (0,0,1)")]).is_err());
    }
}
