//! How far away a camera stands for all corners to be seen, from whatever side a turntable shows them.

use super::matrix::{add, cross, dot, scaled};

/// Room around.
const MARGIN: f64 = 1.03;
/// Sides that are looked at.
const SIDES: u32 = 72;

/// The corners, turned around `axis`: how far each lies along right, up and forward.
fn all_around(corners: &[[f64; 3]], axis: [f64; 3], frame: [[f64; 3]; 3]) -> impl Iterator<Item = [f64; 3]> + '_ {
    let sides = (0..SIDES).map(|i| (std::f64::consts::TAU * f64::from(i) / f64::from(SIDES)).sin_cos());
    sides.flat_map(move |(s, c)| {
        corners.iter().map(move |&p| {
            let turned = add(add(scaled(p, c), scaled(cross(axis, p), s)), scaled(axis, dot(axis, p) * (1.0 - c)));
            frame.map(|direction| dot(turned, direction))
        })
    })
}

/// Distance from which a perspective camera sees all corners; `half` is the film's half width and height at distance 1.
pub(super) fn distance(corners: &[[f64; 3]], axis: [f64; 3], frame: [[f64; 3]; 3], half: [f64; 2]) -> f64 {
    let far = all_around(corners, axis, frame).flat_map(|[right, up, forward]| {
        [right.abs() * MARGIN / half[0] - forward, up.abs() * MARGIN / half[1] - forward]
    });
    far.fold(0.0, f64::max)
}

/// Height of the view of an orthographic camera that sees all corners.
pub(super) fn height(corners: &[[f64; 3]], axis: [f64; 3], frame: [[f64; 3]; 3], aspect: f64) -> f64 {
    let high = all_around(corners, axis, frame).flat_map(|[right, up, _]| [2.0 * right.abs() / aspect, 2.0 * up.abs()]);
    high.fold(0.0, f64::max) * MARGIN
}
