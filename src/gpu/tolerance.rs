//! How far a shader's numbers may be from the CPU's. Decoded integers are never off; this is for f32.

/// Most that a voxel of f32 decoded by a shader differs from the CPU's, which computes in f64 and rounds once: 8 units in the
/// last place of the larger end point's magnitude, and the smallest normal number.
///
/// A shader computes `(1 − a)·min + a·max` in f32 with `a = index / q`. WGSL promises a quotient to 2.5 units in the last place
/// (of `a`, below 1: 2^−24), so `a·max − a·min` is off by at most 2.5·2^−24·2·m, 5 units of the magnitude m at most; each of the four
/// other operations by half a unit, likewise the CPU's rounding: 7.5. Subnormal numbers may be taken for 0.
#[must_use]
pub fn decoded(min: f32, max: f32) -> f32 {
    let magnitude = min.abs().max(max.abs());
    8.0 * (magnitude.next_up() - magnitude) + f32::MIN_POSITIVE
}

#[cfg(test)]
mod tests {
    use super::decoded;

    #[test]
    fn the_tolerance_is_that_of_the_larger_end_point() {
        assert_eq!(decoded(-1.0, 0.5), 8.0 * f32::EPSILON + f32::MIN_POSITIVE);
        assert_eq!(decoded(0.0, 0.0), 8.0 * f32::from_bits(1) + f32::MIN_POSITIVE);
    }
}
