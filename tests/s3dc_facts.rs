//! Numbers of the paper that the codec must reproduce: ratios of Table 1, maximum errors of eq. 6, widths, texture views.

use vug::codec::s3dc::{
    Endpoints, Params, Scalar, closed_form_ratio, eq6_max_error, formula_ratio, integer_error_bound, padded_ratio,
};
use vug::geometry::Extent;

fn params(i_bits: u8, edge: u32) -> Params {
    Params::new(i_bits, Extent::cube(edge), Endpoints::MinMax).unwrap()
}

#[test] // V1: all 14 compression ratios of Table 1, to the printed digits
fn ratios_of_table_1() {
    let volume = Extent::new(512, 512, 486);
    let printed = [
        (2, [2.667, 6.395, 7.757, 7.968, 7.996, 7.999, 8.000]),
        (4, [2.000, 3.554, 3.938, 3.992, 3.999, 4.000, 4.000]),
    ];
    let mut closed_form_differs = 0;
    for (i_bits, row) in printed {
        for (edge, printed) in [2, 4, 8, 16, 32, 64, 128].into_iter().zip(row) {
            let p = params(i_bits, edge);
            let text = |v: f64| format!("{v:.3}");
            assert_eq!(text(formula_ratio(volume, 16, &p)), text(printed), "{i_bits} bits, block {edge}");
            closed_form_differs += i32::from(text(closed_form_ratio(16, &p)) != text(printed));
            assert!(padded_ratio(volume, 16, &p) < formula_ratio(volume, 16, &p)); // K-20
        }
    }
    assert_eq!(closed_form_differs, 5);
    let cube = Extent::cube(512);
    assert_eq!(padded_ratio(cube, 16, &params(4, 16)), formula_ratio(cube, 16, &params(4, 16)));
}

#[test] // V2: eq. 6 as printed, and what integers really reach; spec: S3D-22
fn maximum_errors_of_equation_6() {
    assert_eq!([1, 2, 4, 8].map(|i| eq6_max_error(8, i)), [128, 43, 9, 1]);
    assert_eq!([1, 2, 4, 8].map(|i| eq6_max_error(16, i)), [32_768, 10_923, 2185, 129]);
    assert_eq!([1, 3, 15, 255].map(|q| integer_error_bound(255, q)), [127, 42, 8, 0]);
    assert_eq!([1, 3, 15, 255].map(|q| integer_error_bound(65_535, q)), [32_767, 10_922, 2184, 128]);
    // Every pair of 8-bit end points and every sample between them; monotone as well.
    for (q, worst_of_all) in [(1, 127), (3, 42), (15, 8), (255, 0)] {
        let mut worst_seen = 0;
        for min in 0..=255u8 {
            for max in min..=255 {
                let mut last = min;
                let mut worst = 0;
                for v in min..=max {
                    let back = u8::reconstruct(min, max, v.index(min, max, q), q);
                    assert!(back >= last && back <= max);
                    last = back;
                    worst = worst.max(u32::from(v.abs_diff(back)));
                }
                assert!(worst <= integer_error_bound(u32::from(max - min), q));
                worst_seen = worst_seen.max(worst);
            }
        }
        assert_eq!(worst_seen, worst_of_all);
    }
}

#[test] // V4, V5: widths, and f32 as `(R·idx)/q` with rounding half up equals the integer formula
fn widths_and_the_float_form() {
    for q in [1u32, 3, 15, 255] {
        for r in (0..=65_535u32).step_by(7).chain([65_535]) {
            for idx in (0..=q).step_by(if q > 15 { 5 } else { 1 }) {
                assert!(2 * r * idx + q <= 33_423_105 && r * idx < 1 << 24);
                let exact = (2 * r * idx + q) / (2 * q);
                assert_eq!(((r * idx) as f32 / q as f32 + 0.5).floor() as u32, exact, "R {r}, idx {idx}, q {q}");
                let direct = u32::from(u16::reconstruct(0, r as u16, idx, q));
                assert_eq!(direct, if r == 0 { 0 } else { exact });
            }
        }
    }
}

#[test] // V6: the paper's normalised 16-bit textures lose nothing if the shader rounds
fn sixteen_bit_values_survive_a_normalised_texture() {
    for v in 0..=65_535u16 {
        let texel = f32::from(v) / 65_535.0;
        assert_eq!((texel * 65_535.0).round() as u16, v);
    }
}

#[test] // V25; spec: S3D-11
fn the_float_formula_is_exact_at_equal_and_outer_points() {
    for m in [0.1f32, 1e-45, 3e38, -7.25, 1.0 / 3.0] {
        for q in [1u32, 3, 15, 255] {
            for idx in 0..=q {
                assert_eq!(f32::reconstruct(m, m, idx, q), m);
                // The same without the special case: vector code relies on it.
                let a = f64::from(idx) / f64::from(q);
                assert_eq!(((1.0 - a) * f64::from(m) + a * f64::from(m)) as f32, m);
            }
        }
    }
}
