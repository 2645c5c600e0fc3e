//! Namesake of `shaders/skip.wgsl`.

use super::counter::Counter;
use super::real::{Real, V3};
use super::{Frame, Volume};

/// The number of the next sample that may be seen: `k` itself, or one not behind the end of the brick around `p`.
pub fn next<R: Real>(
    frame: &Frame<R>,
    v: &Volume<'_, R>,
    p: V3<R>,
    direction: V3<R>,
    k: u32,
    n: &mut impl Counter,
) -> u32 {
    let last = v.last;
    let half = R::of(0.5);
    let c: [u32; 3] = std::array::from_fn(|a| super::index((p[a] + half).floor()).clamp(0, last[a]).cast_unsigned());
    let brick = c.map(|c| c >> v.level.layout.brick_log2);
    n.count(|w| w.brick_fetches += 1);
    if v.visible[v.level.layout.brick_index(brick)] != 0 {
        return k;
    }
    let most = R::of(frame.samples.into());
    let mut way = most;
    for a in 0..3 {
        if direction[a] != R::of(0.0) {
            let lo = R::of(f64::from(brick[a] << v.level.layout.brick_log2)) - half;
            let hi = lo + R::of(f64::from(1u32 << v.level.layout.brick_log2));
            let face = if direction[a] > R::of(0.0) { hi } else { lo };
            way = way.min(((face - p[a]) / direction[a]).max(R::of(0.0)) / frame.step);
        }
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "way lies from 0 to the number of samples"
    )]
    let whole = way.min(most).to_f64() as u32;
    k + whole.max(2) - 1
}
