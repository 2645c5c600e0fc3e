//! The picture by the CPU: the mirror over all pixels, rows side by side.

use super::image::Image;
use super::mirror::{Counter, Frame, Real, Volume, Work, pixel, ray_of};
use rayon::prelude::*;

/// Renders all pixels; the result does not depend on the number of threads. `progress` is told rows done, of how many.
pub fn picture<R: Real, C: Counter + Into<Work>>(
    frame: &Frame<R>,
    volumes: &[&[Volume<'_, R>]],
    progress: &(dyn Fn(u64, u64) + Sync),
) -> (Image, Work) {
    let done = std::sync::atomic::AtomicU64::new(0);
    let rows: Vec<(Vec<[f32; 4]>, Work)> = (0..frame.height)
        .into_par_iter()
        .map(|y| {
            let mut n = C::default();
            #[allow(clippy::cast_possible_truncation, reason = "pictures are kept in f32")]
            let row = (0..frame.width)
                .map(|x| pixel(frame, volumes, &ray_of(frame, x, y), &mut n).map(|v| v.to_f64() as f32));
            let row = row.collect();
            progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1, frame.height.into());
            (row, n.into())
        })
        .collect();
    let work = rows.iter().fold(Work::default(), |w, (_, n)| w.plus(*n));
    let pixels = rows.into_iter().flat_map(|(row, _)| row).collect();
    (Image { width: frame.width, height: frame.height, pixels }, work)
}
