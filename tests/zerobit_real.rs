//! Zerobit on real volumes, as a report (`--nocapture`): what refining codebooks, the norm of energy and adaptive
//! thresholds gain. Skipped where there are none.
#![cfg(feature = "convert")]

mod support;
mod zerobit_coding;

use vug::codec::zerobit::bits::Popcount;
use vug::codec::zerobit::{Coefficients, Cut, Norm, Threshold, Training, Word, unit};
use vug::metrics::{compare, error_stats};
use vug::quantise::{Histogram, Tally, squared_error};
use vug::{Extent, Grid, SampleType, haar};
use zerobit_coding::{Coded, How, REAL, code, load, numerators, size};

const DEPTH: u32 = 32;

/// Kept coefficients of a volume, rounded: averages and details. With a global threshold they are told by their size.
fn survivors(grid: &Grid, how: How, cut: Cut) -> [Histogram; 2] {
    let Cut::Least(least) = cut else { panic!("global thresholds only") };
    let most = if matches!(grid.sample_type(), SampleType::U8 | SampleType::Rgb8) { 127 } else { 32_767 };
    let (mut averages, mut details) = (Tally::new(), Tally::new());
    let units = grid.extent().div_ceil(Extent::cube(16));
    for z in 0..units.z {
        for y in 0..units.y {
            for x in 0..units.x {
                for cell in numerators(grid, [x, y, z], how.null).into_iter().flatten() {
                    let kept = |p: usize| size(&cell, p, how.norm) >= least.max(1);
                    if !(0..64).any(kept) {
                        continue;
                    }
                    let word = |p: usize| -> Word {
                        std::array::from_fn(|c| {
                            cell.get(c).map_or(0, |s| haar::quantised(p, s[p]).min(if p > 0 { most } else { i32::MAX }))
                        })
                    };
                    averages.add(word(0));
                    (1..64).filter(|&p| kept(p) && word(p) != [0; 3]).for_each(|p| details.add(word(p)));
                }
            }
        }
    }
    [averages.finish(), details.finish()]
}

fn psnr(grid: &Grid, coded: &Coded) -> f64 {
    compare(&grid.view(), &coded.decode().view()).unwrap().psnr.unwrap_or(f64::INFINITY)
}

/// Stored coefficients as a part of the voxels.
fn ratio(coded: &Coded) -> f64 {
    let mut stored = 0u64;
    coded.each_cell(|payload, index, n, _| {
        let Some(cell) = unit(payload, index).and_then(|u| u.cell(n, Popcount)) else { return };
        let details = (1..64u32).filter(|p| cell.detail((p - 1) / 7, (p - 1) % 7 + 1, Popcount, &mut ()).is_some());
        stored += 1 + details.count() as u64;
    });
    stored as f64 / coded.survey.voxels as f64
}

#[test]
fn refined_codebooks_are_never_worse() {
    let Some(dir) = support::data() else { return };
    for name in REAL {
        let grid = load(&dir, name, DEPTH);
        for keep in [10_000, 30_000, 100_000] {
            let how = How { threshold: Threshold::Global, ..How::keep(keep) };
            let plain = code(&grid, how);
            let refined = code(&grid, How { training: Training::Refined, ..how });
            assert_eq!(plain.cut, refined.cut);
            let [averages, details] = survivors(&grid, how, plain.cut);
            let error = |coded: &Coded| {
                [squared_error(&averages, coded.book().averages()), squared_error(&details, coded.book().details())]
            };
            let (before, after) = (error(&plain), error(&refined));
            assert!(after[0] <= before[0] && after[1] <= before[1], "{name}: {before:?} {after:?}");
            let (a, b) = (psnr(&grid, &plain), psnr(&grid, &refined));
            println!(
                "{name} λ {:.0} %: median cut {a:.2} dB, refined {b:.2} dB, gain {:+.2} dB",
                f64::from(keep) / 1e4,
                b - a
            );
        }
    }
}

#[test]
fn energy_against_plain_norm() {
    let Some(dir) = support::data() else { return };
    for name in REAL {
        let grid = load(&dir, name, DEPTH);
        let how = How { training: Training::Refined, ..How::keep(30_000) };
        let [a, b] = [Norm::Plain, Norm::Energy].map(|norm| psnr(&grid, &code(&grid, How { norm, ..how })));
        println!("{name} λ 3 %: plain {a:.2} dB, energy {b:.2} dB, gain {:+.2} dB", b - a);
        assert!(b > a - 0.1, "{name}");
    }
}

/// Mean |jump of the error| across the borders of unit blocks, and across those of cells inside them.
fn jumps(grid: &Grid, back: &Grid) -> [f64; 2] {
    let e = grid.extent();
    let components = grid.sample_type().components();
    let error = |c: [u32; 3], k: usize| back.value(c).unwrap().component(k) - grid.value(c).unwrap().component(k);
    let (mut sum, mut count) = ([0.0; 2], [0u64; 2]);
    for axis in 0..3 {
        for z in 0..e.z {
            for y in 0..e.y {
                for x in 0..e.x {
                    let c = [x, y, z];
                    if c[axis] == 0 || c[axis] % 4 != 0 {
                        continue;
                    }
                    let mut before = c;
                    before[axis] -= 1;
                    let kind = usize::from(c[axis] % 16 != 0);
                    for k in 0..components {
                        sum[kind] += (error(c, k) - error(before, k)).abs();
                        count[kind] += 1;
                    }
                }
            }
        }
    }
    [0, 1].map(|k| sum[k] / count[k].max(1) as f64)
}

#[test] // Z-11: what thresholds by unit block do to their borders
fn blockiness() {
    let Some(dir) = support::data() else { return };
    for name in REAL {
        let grid = load(&dir, name, DEPTH);
        for threshold in [Threshold::Adaptive, Threshold::Global] {
            let coded = code(&grid, How { threshold, training: Training::Refined, ..How::keep(30_000) });
            let back = coded.decode();
            let [unit, cell] = jumps(&grid, &back);
            let found = ratio(&coded);
            println!(
                "{name} {}: λ asked 3 %, got {:.2} %; jump of the error at borders of unit blocks {unit:.3}, of cells {cell:.3}, ratio {:.3}; {:.2} dB",
                threshold.name(),
                found * 100.0,
                unit / cell,
                psnr(&grid, &coded)
            );
            assert!((0.015..0.06).contains(&found), "{name}: {found}");
        }
    }
}

#[test] // more coefficients in the same 256 words: with codebooks this small the error may grow again
fn error_by_ratio() {
    let Some(dir) = support::data() else { return };
    for name in &REAL[..3] {
        let grid = load(&dir, name, DEPTH);
        for training in [Training::MedianCut, Training::Refined] {
            let line = [10_000, 30_000, 100_000, 200_000, 400_000, 700_000, 1_000_000].map(|keep| {
                let coded = code(&grid, How { training, ..How::keep(keep) });
                let max = error_stats(&grid.view(), &coded.decode().view()).unwrap().max_abs;
                format!("{:.2} dB (max {max})", psnr(&grid, &coded))
            });
            println!("{name} {}, λ 1, 3, 10, 20, 40, 70, 100 %: {}", training.name(), line.join(", "));
        }
    }
}
