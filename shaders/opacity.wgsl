// Opacity of a step that is `r` reference lengths long: 1 − (1 − α)^r, without losing small opacities (hard cases R-05, R-06).

fn correct(alpha: f32, r: f32) -> f32 {
    if (r == 1.0 || alpha <= 0.0) {
        return alpha;
    }
    if (alpha >= 1.0) {
        return select(0.0, 1.0, r > 0.0);
    }
    return -expm1(r * log1m(alpha));
}

// ln(1 − a) for 0 < a < 1.
fn log1m(a: f32) -> f32 {
    if (a < 0.125) {
        return -a * (1.0 + a * (1.0 / 2.0 + a * (1.0 / 3.0 + a * (1.0 / 4.0 + a * (1.0 / 5.0 + a * (1.0 / 6.0 + a * (1.0 / 7.0 + a / 8.0)))))));
    }
    return log(1.0 - a);
}

// e^x − 1 for x ≤ 0.
fn expm1(x: f32) -> f32 {
    if (x > -0.5) {
        return x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0 * (1.0 + x / 7.0))))));
    }
    return exp(x) - 1.0;
}
