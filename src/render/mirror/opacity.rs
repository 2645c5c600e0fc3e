//! Namesake of `shaders/opacity.wgsl`: hard cases.

use super::real::Real;

/// Opacity of a step that is `r` reference lengths long: 1 − (1 − α)^r, without losing small opacities.
pub fn correct<R: Real>(alpha: R, r: R) -> R {
    let (zero, one) = (R::of(0.0), R::of(1.0));
    if r == one || alpha <= zero {
        return alpha;
    }
    if alpha >= one {
        return if r > zero { one } else { zero };
    }
    -expm1(r * log1m(alpha))
}

/// Σ of a series whose coefficients are 1/n in front of powers from the first to the eighth.
fn log1m<R: Real>(a: R) -> R {
    if a.to_f64() < 0.125 {
        let n = |v: f64| R::of(1.0) / R::of(v);
        return -a
            * (n(1.0)
                + a * (n(2.0)
                    + a * (n(3.0) + a * (n(4.0) + a * (n(5.0) + a * (n(6.0) + a * (n(7.0) + a / R::of(8.0))))))));
    }
    (R::of(1.0) - a).ln()
}

/// e^x − 1 for x ≤ 0.
fn expm1<R: Real>(x: R) -> R {
    if x.to_f64() > -0.5 {
        let mut sum = R::of(1.0) + x / R::of(7.0);
        for n in [6.0, 5.0, 4.0, 3.0, 2.0] {
            sum = R::of(1.0) + x / R::of(n) * sum;
        }
        return x * sum;
    }
    x.exp() - R::of(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test] // hard case; V26
    fn small_opacities_are_kept() {
        for &alpha in &[1e-8, 1e-7, 1e-5, 1e-3, 0.01, 0.1249, 0.125, 0.3, 0.9, 0.999] {
            for &r in &[1e-3, 0.1, 0.5, 1.0, 2.0, 16.0, 64.0] {
                let exact = -f64::exp_m1(r * f64::ln_1p(-alpha));
                let wide = correct(alpha, r);
                assert!((wide - exact).abs() <= 1e-7 * exact, "f64: {alpha} {r}: {wide} {exact}");
                // The exact value of the f32 that goes in, not of the decimal above.
                #[allow(clippy::cast_possible_truncation, reason = "the f32 side")]
                let (a, p) = (alpha as f32, r as f32);
                let exact = -f64::exp_m1(f64::from(p) * f64::ln_1p(-f64::from(a)));
                let narrow = f64::from(correct(a, p));
                assert!((narrow - exact).abs() <= 1e-5 * exact, "f32: {alpha} {r}: {narrow} {exact}");
            }
        }
        assert_eq!((correct(1.0f32, 0.0), correct(1.0f32, 0.5), correct(0.0f32, 3.0)), (0.0, 1.0, 0.0));
        assert_eq!(correct(0.5f32, 0.0), 0.0);
    }
}
