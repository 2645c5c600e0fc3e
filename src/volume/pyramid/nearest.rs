//! Levels of labels: the voxel in the middle stands for all (spec: VOL-12).

use super::{Pyramid, Rows};
use crate::grid::View;

/// The voxel of level 0 that stands for voxel `c` of `level` along an axis of `n`.
pub(super) const fn representative(c: u32, level: u8, n: u32) -> u32 {
    let middle = (c << level) + (1 << (level - 1));
    if middle < n { middle } else { n - 1 }
}

/// Rows whose representatives lie in `view`, which starts at row `y` and plane `z` of level 0.
pub(super) fn rows(p: &Pyramid, view: &View<'_>, y: u32, z: u32) -> Vec<Rows> {
    let bytes = view.sample_type.bytes();
    let mut found = Vec::new();
    for level in 1..=p.coarsest {
        let coarse = p.extent(level);
        // Coarse positions whose representative lies in `start..start + len`: those that start there, or a few around.
        let inside = |start: u32, len: u32, n: u32, coarse: u32| {
            let (first, last) = (start >> level, ((start + len) >> level).min(coarse - 1));
            (first..=last).filter(move |&c| (start..start + len).contains(&representative(c, level, n)))
        };
        for cz in inside(z, view.extent.z, p.fine.z, coarse.z) {
            for cy in inside(y, view.extent.y, p.fine.y, coarse.y) {
                let fz = (representative(cz, level, p.fine.z) - z) as usize;
                let fy = (representative(cy, level, p.fine.y) - y) as usize;
                let row = &view.bytes[fz * view.slice_pitch + fy * view.row_pitch..][..p.fine.x as usize * bytes];
                let mut out = Vec::with_capacity(coarse.x as usize * bytes);
                for cx in 0..coarse.x {
                    let at = representative(cx, level, p.fine.x) as usize * bytes;
                    out.extend_from_slice(&row[at..at + bytes]);
                }
                found.push(Rows { level, y: cy, z: cz, rows: 1, row_bytes: out.len(), bytes: out });
            }
        }
    }
    found
}
