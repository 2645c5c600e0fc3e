//! Noise that is a fixed function of the place: the same on every machine, since it uses only correctly rounded arithmetic.

/// A number from −1 to 1 for every lattice point.
fn lattice(x: i32, y: i32, z: i32, seed: u32) -> f64 {
    let mut h = seed.wrapping_mul(0x9E37_79B1);
    for v in [x, y, z] {
        h = (h ^ v.cast_unsigned()).wrapping_mul(0x85EB_CA6B);
        h ^= h >> 15;
    }
    h = h.wrapping_mul(0xC2B2_AE35);
    h ^= h >> 16;
    f64::from(h) * (2.0 / 4_294_967_295.0) - 1.0
}

/// Smooth noise from −1 to 1 whose bumps are about `scale` apart.
pub(super) fn smooth(p: [f64; 3], scale: f64, seed: u32) -> f64 {
    let cell = p.map(|v| (v / scale).floor());
    let [x, y, z] = cell.map(|v| v as i32);
    let t: [f64; 3] = std::array::from_fn(|a| {
        let t = p[a] / scale - cell[a];
        t * t * (3.0 - 2.0 * t)
    });
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |y, z| mix(lattice(x, y, z, seed), lattice(x + 1, y, z, seed), t[0]);
    let sheet = |z| mix(row(y, z), row(y + 1, z), t[1]);
    mix(sheet(z), sheet(z + 1), t[2])
}
