//! The Pareto front: what nothing else beats in both respects.

/// Which points are on the front: no other point is at most as large in both coordinates and smaller in one. A point with
/// a coordinate that is NaN is on no front; equal points share their fate.
#[must_use]
pub fn pareto(points: &[(f64, f64)]) -> Vec<bool> {
    let beats = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
    let known = |p: &(f64, f64)| !p.0.is_nan() && !p.1.is_nan();
    points.iter().map(|p| known(p) && !points.iter().any(|q| beats(q, p))).collect()
}
