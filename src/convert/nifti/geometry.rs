//! Placement from sform, qform or pixdim (nifti1.h: methods 3, 2 and 1), and back.

use super::header::Header;
use crate::affine::{Placement, Space, Unit};
use crate::convert::fault;
use crate::error::Result;
use std::path::Path;

/// Bits of `xyzt_units` that hold the unit of space; the others hold that of time.
pub(super) const SPACE_UNIT_BITS: i32 = 7;

/// Where the image lies: sform before qform before pixdim.
///
/// A `pixdim` of 0 (or NaN) means that the spacing is unknown. With neither sform nor qform, nobody has said which way the
/// axes point: the space is unknown, too.
///
/// # Errors
/// `E_FOREIGN` where the matrix is singular or not finite.
pub(super) fn read(path: &Path, header: &Header) -> Result<Placement> {
    let unit = unit_of(header.xyzt_units);
    let axes = usize::try_from(header.dim[0]).unwrap_or(3).min(3);
    let pixdim: [f64; 3] = std::array::from_fn(|i| if i < axes { header.pixdim[i + 1].abs() } else { 1.0 });
    let unknown = pixdim.iter().any(|p| !p.is_normal());
    let (matrix, field, space, spacing_unknown) = if header.sform_code > 0 {
        (header.srow, "srow", Space::Ras, false)
    } else if header.qform_code > 0 {
        let steps = if unknown { [1.0; 3] } else { pixdim };
        (quaternion_matrix(header, steps), "quatern", Space::Ras, unknown)
    } else {
        let steps = if unknown { [1.0; 3] } else { pixdim };
        (Placement::from_spacing(steps, [0.0; 3]).matrix, "pixdim", Space::Unknown, unknown)
    };
    let placement = Placement { matrix, space, unit, spacing_unknown };
    placement.check().map_err(|e| fault::relabel(path, field, &e))?;
    Ok(placement)
}

/// Unit of `xyzt_units`.
fn unit_of(code: i32) -> Unit {
    match code & SPACE_UNIT_BITS {
        1 => Unit::Metre,
        2 => Unit::Millimetre,
        3 => Unit::Micrometre,
        _ => Unit::Unknown,
    }
}

/// Code of a unit, and the factor that brings the matrix to it: NIfTI has nothing below the micrometre.
pub(super) const fn unit_code(unit: Unit) -> (i32, f64) {
    match unit {
        Unit::Unknown => (0, 1.0),
        Unit::Metre => (1, 1.0),
        Unit::Millimetre => (2, 1.0),
        Unit::Micrometre => (3, 1.0),
        Unit::Nanometre => (3, 1e-3),
        Unit::Angstrom => (3, 1e-4),
        Unit::Bohr => (3, 5.291_772_109_03e-5),
    }
}

/// Method 2 of nifti1.h: rotation from the quaternion, steps from pixdim, handedness from pixdim[0].
fn quaternion_matrix(header: &Header, steps: [f64; 3]) -> [[f64; 4]; 3] {
    let [mut b, mut c, mut d] = header.quatern;
    let rest = 1.0 - (b * b + c * c + d * d);
    let a = if rest < 1e-7 {
        // Rounding has pushed it past a rotation by 180°: bring it back to length 1.
        let length = (b * b + c * c + d * d).sqrt();
        (b, c, d) = (b / length, c / length, d / length);
        0.0
    } else {
        rest.sqrt()
    };
    let rotation = [
        [a * a + b * b - c * c - d * d, 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
        [2.0 * (b * c + a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d - a * b)],
        [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), a * a + d * d - c * c - b * b],
    ];
    let handed = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
    let steps = [steps[0], steps[1], steps[2] * handed];
    std::array::from_fn(|row| {
        std::array::from_fn(|column| match column {
            3 => header.qoffset[row],
            _ => rotation[row][column] * steps[column],
        })
    })
}

/// Quaternion (b, c, d) and handedness of a matrix whose axes are perpendicular; `None` where they are not, which a
/// qform cannot say.
fn quaternion_of(placement: &Placement) -> Option<([f64; 3], f64)> {
    let spacing = placement.spacing();
    let mut r: [[f64; 3]; 3] =
        std::array::from_fn(|row| std::array::from_fn(|column| placement.matrix[row][column] / spacing[column]));
    let dot = |i: usize, j: usize| (0..3).map(|row| r[row][i] * r[row][j]).sum::<f64>().abs();
    if [dot(0, 1), dot(0, 2), dot(1, 2)].iter().any(|d| *d > 1e-5) {
        return None;
    }
    let handed = if placement.determinant() < 0.0 { -1.0 } else { 1.0 };
    for row in &mut r {
        row[2] *= handed;
    }
    let trace = r[0][0] + r[1][1] + r[2][2] + 1.0;
    let quaternion = if trace > 0.5 {
        let a = 0.5 * trace.sqrt();
        [(r[2][1] - r[1][2]) / (4.0 * a), (r[0][2] - r[2][0]) / (4.0 * a), (r[1][0] - r[0][1]) / (4.0 * a)]
    } else {
        // The largest of the three squares is at least 1/4 of their sum.
        let squares =
            [1.0 + r[0][0] - r[1][1] - r[2][2], 1.0 + r[1][1] - r[0][0] - r[2][2], 1.0 + r[2][2] - r[0][0] - r[1][1]];
        let i = (0..3).max_by(|i, j| squares[*i].total_cmp(&squares[*j])).unwrap_or(0);
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let largest = 0.5 * squares[i].sqrt();
        let mut q = [0.0; 3];
        q[i] = largest;
        q[j] = 0.25 * (r[i][j] + r[j][i]) / largest;
        q[k] = 0.25 * (r[i][k] + r[k][i]) / largest;
        // The sign that makes the scalar part positive.
        let a = 0.25 * (r[k][j] - r[j][k]) / largest;
        if a < 0.0 { q.map(|v| -v) } else { q }
    };
    Some((quaternion, handed))
}

/// The matrix in RAS and in a unit that NIfTI knows, and that unit's code.
pub(super) fn in_ras(placement: &Placement) -> (Placement, i32) {
    let (code, factor) = unit_code(placement.unit);
    let signs = match placement.space {
        Space::Lps => [-1.0, -1.0, 1.0],
        Space::Las => [-1.0, 1.0, 1.0],
        Space::Ras | Space::Scanner | Space::Unknown => [1.0; 3],
    };
    let mut ras = placement.clone();
    for (row, sign) in ras.matrix.iter_mut().zip(signs) {
        // + 0.0 makes the -0 of a flipped 0 a plain 0.
        row.iter_mut().for_each(|v| *v = *v * sign * factor + 0.0);
    }
    (ras, code)
}

/// Sets pixdim, qform, sform and unit of `header` from `placement`.
pub(super) fn write(header: &mut Header, placement: &Placement) {
    let (ras, unit) = in_ras(placement);
    header.xyzt_units = header.xyzt_units & !SPACE_UNIT_BITS | unit;
    let spacing = ras.spacing();
    header.pixdim[0] = 1.0;
    header.pixdim[1..4].copy_from_slice(&spacing);
    let positive_diagonal = ras.matrix == Placement::from_spacing(spacing, [0.0; 3]).matrix;
    if placement.space == Space::Unknown && positive_diagonal {
        // pixdim alone says all that is known; a code would claim more.
        (header.qform_code, header.sform_code) = (0, 0);
        return;
    }
    // Code 1: the scanner's or the file's own coordinates; other codes come from the source.
    header.sform_code = header.sform_code.max(1);
    header.srow = ras.matrix;
    header.qoffset = ras.origin();
    match quaternion_of(&ras) {
        Some((quatern, handed)) => {
            header.qform_code = if header.qform_code > 0 { header.qform_code } else { header.sform_code };
            header.quatern = quatern;
            header.pixdim[0] = handed;
        }
        None => header.qform_code = 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Code;

    fn header() -> Header {
        Header { version: 2, dim: [3, 2, 2, 2, 0, 0, 0, 0], pixdim: [1.0; 8], ..Header::default() }
    }

    fn placed(h: &Header) -> Result<Placement> {
        read(Path::new("f.nii"), h)
    }

    #[test]
    fn sform_before_qform_before_pixdim() {
        let mut h = header();
        h.pixdim[1..4].copy_from_slice(&[1.0, 2.0, 3.0]);
        h.xyzt_units = 3 | 8;
        let p = placed(&h).unwrap();
        assert_eq!((p.spacing(), p.space, p.unit), ([1.0, 2.0, 3.0], Space::Unknown, Unit::Micrometre));
        h.qform_code = 1;
        h.qoffset = [7.0, 8.0, 9.0];
        h.quatern = [0.0, 0.0, 1.0];
        h.pixdim[0] = -1.0;
        let p = placed(&h).unwrap();
        assert_eq!(p.matrix, [[-1.0, 0.0, 0.0, 7.0], [0.0, -2.0, 0.0, 8.0], [0.0, 0.0, -3.0, 9.0]]);
        h.sform_code = 4;
        h.srow = [[0.0, 5.0, 0.0, 1.0], [5.0, 0.0, 0.0, 2.0], [0.0, 0.0, 5.0, 3.0]];
        let p = placed(&h).unwrap();
        assert_eq!((p.matrix, p.space, p.spacing_unknown), (h.srow, Space::Ras, false));
    }

    #[test] // D-56, D-58
    fn degenerate() {
        for bad in [0.0, f64::NAN, f64::INFINITY, 1e-310] {
            let mut h = header();
            h.pixdim[2] = bad;
            assert!(placed(&h).unwrap().spacing_unknown, "{bad}");
            h.qform_code = 1;
            assert!(placed(&h).unwrap().spacing_unknown, "{bad}");
        }
        let mut h = header();
        h.pixdim[2] = -2.0;
        assert_eq!(placed(&h).unwrap().spacing(), [1.0, 2.0, 1.0]);
        h.sform_code = 1;
        assert_eq!(placed(&h).unwrap_err().code(), Code::Foreign);
        h.sform_code = 0;
        h.qform_code = 1;
        h.quatern = [f64::NAN, 0.0, 0.0];
        assert_eq!(placed(&h).unwrap_err().field(), "quatern");
    }

    #[test]
    fn quaternions_there_and_back() {
        // All 24 turns of the axes, both hands, and some oblique ones.
        let mut cases = Vec::new();
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            for signs in 0..8 {
                let sign = |bit: i32| if signs >> bit & 1 == 0 { 1.0 } else { -1.0 };
                let mut m = [[0.0; 4]; 3];
                (m[i][0], m[j][1], m[3 - i - j][2]) = (sign(0), 2.0 * sign(1), 3.0 * sign(2));
                cases.push(m);
            }
        }
        cases.push([[0.6, -0.8, 0.0, 1.0], [0.8, 0.6, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]]);
        cases.push([[-0.96, 0.0, 0.28, 1.0], [0.0, 1.0, 0.0, 2.0], [-0.28, 0.0, -0.96, 3.0]]);
        for matrix in cases {
            let p = Placement { matrix, space: Space::Ras, ..Placement::default() };
            let mut h = header();
            write(&mut h, &p);
            assert_eq!((h.sform_code, h.qform_code), (1, 1));
            h.sform_code = 0;
            let back = placed(&h).unwrap();
            for (got, want) in back.matrix.as_flattened().iter().zip(matrix.as_flattened()) {
                assert!((got - want).abs() < 1e-12, "{matrix:?} {:?}", back.matrix);
            }
        }
        let sheared = [[1.0, 0.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let mut h = header();
        write(&mut h, &Placement { matrix: sheared, space: Space::Ras, ..Placement::default() });
        assert_eq!((h.sform_code, h.qform_code, h.srow), (1, 0, sheared));
    }

    #[test]
    fn other_spaces_and_units_become_ras_and_micrometres() {
        let mut p = Placement::from_spacing([1.0, 2.0, 4.0], [10.0, 20.0, 30.0]);
        (p.space, p.unit) = (Space::Lps, Unit::Nanometre);
        let mut h = header();
        h.xyzt_units = 8;
        write(&mut h, &p);
        assert_eq!(h.xyzt_units, 8 | 3);
        assert_eq!(h.srow[0], [-1e-3, 0.0, 0.0, -10.0 * 1e-3]);
        assert_eq!(h.srow[2], [0.0, 0.0, 4e-3, 30.0 * 1e-3]);
        p.space = Space::Las;
        write(&mut h, &p);
        assert!(h.srow[0][0] < 0.0 && h.srow[1][1] > 0.0 && h.pixdim[0] < 0.0);
    }
}
