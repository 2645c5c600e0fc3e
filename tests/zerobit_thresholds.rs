//! What the zerobit encoder keeps, computed a second time by brute force: thresholds, words, indices, ties.

mod support;
mod zerobit_coding;

use std::collections::BTreeMap;
use support::{ball, hash, noise};
use vug::codec::zerobit::bits::Popcount;
use vug::codec::zerobit::{Coefficients, Norm, Stream, Threshold, Training, Word, unit};
use vug::quantise::{Tally, median_cut};
use vug::{Extent, Grid, SampleType, haar};
use zerobit_coding::{Coded, How, cell_of, cells, code, nearest, numerators, size};

/// Cells by first voxel: numerators of each component, and which coefficients are kept (bit p). Null cells are not there.
type Kept = BTreeMap<[u32; 3], (Vec<[i32; 64]>, u64)>;

/// The rules of the encoder, as they are written (14.12): sort everything, count.
fn expected(grid: &Grid, how: How) -> Kept {
    let units = grid.extent().div_ceil(Extent::cube(16));
    let place = |i: u64| {
        [
            i % u64::from(units.x),
            i / u64::from(units.x) % u64::from(units.y),
            i / u64::from(units.x) / u64::from(units.y),
        ]
        .map(|v| v as u32)
    };
    let blocks: Vec<_> = (0..units.voxels()).map(|i| (place(i), numerators(grid, place(i), how.null))).collect();
    let sizes = |cells: &[Option<Vec<[i32; 64]>>]| -> Vec<u64> {
        let mut all: Vec<u64> = cells.iter().flatten().flat_map(|c| (0..64).map(|p| size(c, p, how.norm))).collect();
        all.retain(|&s| s != 0);
        all.sort_unstable_by(|a, b| b.cmp(a));
        all
    };
    let budget = match how.keep {
        1_000_000 => u128::MAX >> 64, // everything, even where cut cells have more coefficients than voxels
        keep => u128::from(grid.extent().voxels()) * u128::from(keep) / 1_000_000,
    };
    let by_block: Vec<Vec<u64>> = blocks.iter().map(|(_, cells)| sizes(cells)).collect();
    let mut whole: Vec<u64> = by_block.concat();
    whole.sort_unstable_by(|a, b| b.cmp(a));
    let mut kept = Kept::new();
    for ((at, cells), sizes) in blocks.iter().zip(&by_block) {
        let (ranked, rank) = match how.threshold {
            Threshold::Global => (&whole, budget),
            Threshold::Adaptive if whole.is_empty() => continue,
            Threshold::Adaptive => (sizes, sizes.len() as u128 * budget / whole.len() as u128),
        };
        if rank == 0 || ranked.is_empty() {
            continue;
        }
        let least = ranked[ranked.len().min(rank as usize) - 1];
        for (n, cell) in (0u32..).zip(cells) {
            let Some(cell) = cell else { continue };
            let keeps = |p| {
                let s = size(cell, p, how.norm);
                s != 0 && s >= least
            };
            let bits = (0..64).filter(|&p| keeps(p)).fold(0u64, |all, p| all | 1 << p);
            if bits != 0 {
                let inside = [n & 3, n >> 2 & 3, n >> 4];
                kept.insert(std::array::from_fn(|a| at[a] * 16 + inside[a] * 4), (cell.clone(), bits));
            }
        }
    }
    kept
}

/// Coefficient p as a whole number, within the range of a word.
fn rounded(cell: &[[i32; 64]], p: usize, how: How, t: SampleType) -> Word {
    let most = if matches!(t, SampleType::U8 | SampleType::Rgb8) { 127 } else { 32_767 };
    std::array::from_fn(|c| match cell.get(c) {
        None => 0,
        Some(s) if p == 0 => haar::rdiv(s[0].into(), 64) as i32 + how.null,
        Some(s) => haar::rdiv(s[p].into(), if p < 8 { 64 } else { 8 }).min(most) as i32,
    })
}

/// Compares payloads and codebook with the rules; returns them, and the number of coefficients that the rules keep.
fn check(grid: &Grid, how: How) -> (Coded, u64) {
    let (kept, t) = (expected(grid, how), grid.sample_type());
    let coded = code(grid, how);
    let (mut averages, mut details, mut count) = (Tally::new(), Tally::new(), 0);
    for (cell, bits) in kept.values() {
        averages.add(rounded(cell, 0, how, t));
        for p in (1..64).filter(|p| bits >> p & 1 == 1) {
            let word = rounded(cell, p, how, t);
            if word != [0; 3] {
                details.add(word);
            }
        }
        count += u64::from(bits.count_ones());
    }
    if how.training == Training::MedianCut {
        let words = |tally: Tally| {
            let histogram = tally.finish();
            if histogram.is_empty() { Vec::new() } else { median_cut(&histogram, 256) }
        };
        assert_eq!(coded.book().averages(), words(averages));
        assert_eq!(coded.book().details(), words(details));
    }
    let mut stored = 0;
    coded.each_cell(|payload, index, n, origin| {
        let cell = unit(payload, index).and_then(|u| match how.stream {
            Stream::New => u.cell(n, Popcount).map(|c| found(&c)),
            Stream::Old => u.old_cell(n, Popcount).map(|c| found(&c)),
        });
        assert_eq!(cell.is_some(), kept.contains_key(&origin), "cell at {origin:?}, {how:?}");
        let (Some(cell), Some((numerators, bits))) = (cell, kept.get(&origin)) else { return };
        stored += 1;
        let average = nearest(coded.book().averages(), rounded(numerators, 0, how, t));
        assert_eq!(cell[0], Some(average as u8), "the average of a stored cell is stored");
        for (p, &index) in cell.iter().enumerate().skip(1) {
            let word = rounded(numerators, p, how, t);
            let wanted = (bits >> p & 1 == 1 && word != [0; 3]).then(|| nearest(coded.book().details(), word));
            let wanted = wanted.filter(|&i| coded.book().details()[i] != [0; 3]);
            assert_eq!(index.map(usize::from), wanted, "p = {p} of the cell at {origin:?}, {how:?}");
        }
    });
    assert_eq!(stored, kept.len());
    (coded, count)
}

fn found(cell: &impl Coefficients) -> [Option<u8>; 64] {
    std::array::from_fn(|p| match p as u32 {
        0 => cell.average(&mut ()),
        p => cell.detail((p - 1) / 7, (p - 1) % 7 + 1, Popcount, &mut ()),
    })
}

#[test] // K-33, K-64; spec: ZBT-7, ZBT-20, ZBT-21: what is kept, and as which word
fn what_is_kept_is_what_the_rules_say() {
    let e = Extent::new(70, 37, 21);
    let colours = |c: [u32; 3]| {
        let h = hash(c).to_le_bytes();
        if c[1] > 30 { [9; 3] } else { [c[0] as u8 * 2 + h[0] / 8, h[1] / 3, 200 - (c[2] * 5) as u8] }
    };
    let grids = [
        (ball(e), 0),
        (Grid::from_fn(e, colours).unwrap(), 9),
        (Grid::from_fn(e, |c| (hash(c) >> 19) as i16 - 20 * c[0] as i16).unwrap(), -1000),
        (noise(e, |h| (h >> 16) as u16), 40_000),
    ];
    for (grid, null) in &grids {
        for threshold in [Threshold::Adaptive, Threshold::Global] {
            for norm in [Norm::Energy, Norm::Plain] {
                for keep in [30, 4_000, 50_000, 700_000, 1_000_000] {
                    let how = How { null: *null, threshold, norm, ..How::keep(keep) };
                    let (coded, count) = check(grid, how);
                    // The ratio that was asked for: without ties the global rank is met to the coefficient, and the
                    // shares of unit blocks are rounded down.
                    let budget = (e.voxels() * u64::from(keep) / 1_000_000).min(coded.survey.nonzero);
                    let units = e.div_ceil(Extent::cube(16)).voxels();
                    let ties = count.saturating_sub(budget);
                    assert!(count + units >= budget, "{how:?}: {count} of {budget}");
                    assert!(threshold == Threshold::Adaptive || count >= budget);
                    assert!(keep == 1_000_000 || ties * 4 <= budget + 4 * 64, "{how:?}: {count} of {budget}");
                }
            }
        }
        let old = How { null: *null, stream: Stream::Old, training: Training::Refined, ..How::keep(60_000) };
        check(grid, old);
    }
}

#[test] // K-39: where all are equal all are kept, far more than asked for
fn ties_are_kept() {
    let grid = cells(Extent::cube(16), |_| {
        cell_of(&std::array::from_fn(|p| if p >= 8 && (p - 1) % 7 == 3 { 8 } else { 0 })).map(|v| v as i16)
    });
    for threshold in [Threshold::Adaptive, Threshold::Global] {
        let (coded, count) = check(&grid, How { threshold, ..How::keep(10_000) });
        assert_eq!((coded.survey.budget(10_000), coded.survey.nonzero, count), (40, 512, 512));
        assert_eq!(coded.decode().bytes(), grid.bytes());
    }
}

#[test] // K-40: nothing, a millionth, everything
fn the_ends_of_the_ratio() {
    let e = Extent::new(128, 128, 128);
    // 2 of 2 Mi coefficients: the largest two, which are in one unit block; elsewhere the share is below 1.
    let grid = Grid::from_fn(e, |c| match c {
        [20, 20, 20] => 255,
        [31, 20, 20] => 200,
        [x, y, z] => (x + y + z) as u8 % 3,
    })
    .unwrap();
    for threshold in [Threshold::Adaptive, Threshold::Global] {
        let nothing = check(&grid, How { threshold, ..How::keep(0) });
        assert_eq!(nothing.1, 0);
        assert!(nothing.0.bricks.iter().all(|(_, p)| p.len() == 16 + 64 * 4));
        assert!(nothing.0.decode().bytes().iter().all(|&b| b == 0));
    }
    let (coded, count) = check(&grid, How { threshold: Threshold::Global, ..How::keep(1) });
    assert_eq!(coded.survey.budget(1), 2);
    assert!((2..=14).contains(&count), "seven details of a single voxel are equal: {count}");
    let (_, count) = check(&grid, How::keep(1));
    assert_eq!(count, 0, "no unit block has a share of 1");
    let lonely = Grid::from_fn(e, |c| if c == [20, 20, 20] { 255u8 } else { 0 }).unwrap();
    assert_eq!(
        check(&lonely, How::keep(1)).1,
        7,
        "all of what there is lies in one unit block: the largest two and their like"
    );
    let (coded, count) = check(&grid, How::all());
    assert_eq!(count, coded.survey.nonzero);
}

#[test] // K-41: a constant volume has averages alone
fn constants() {
    for (keep, cells) in [(1_000_000, 27), (700, 27), (500, 0)] {
        let grid = noise(Extent::cube(12), |_| 77u8);
        let (coded, count) = check(&grid, How::keep(keep));
        assert_eq!((coded.survey.nonzero, count), (27, cells));
        assert_eq!(coded.book().averages().len(), usize::from(cells > 0));
        assert!(coded.decode().bytes().iter().all(|&b| b == if cells > 0 { 77 } else { 0 }));
    }
}

#[test] // K-43, K-44, K-45: up to 256 different values stay what they are
fn few_colours() {
    let e = Extent::new(16, 16, 68);
    let colour = |k: u32| [k as u8, (k >> 4) as u8 * 3, 255 - (k as u8 ^ 0x5A) / 2];
    for n in [1, 2, 255, 256, 257] {
        let cell = |c: [u32; 3]| c[0] + 4 * c[1] + 16 * c[2];
        let grid = cells(e, |c| [colour(cell(c) % n); 64]);
        let (coded, _) = check(&grid, How::all());
        assert_eq!((coded.book().averages().len(), coded.book().details().len()), (n.min(256) as usize, 0));
        assert_eq!(coded.decode().bytes() == grid.bytes(), n <= 256, "{n}");
        // Details by themselves: the average is the same everywhere.
        let steps = cells(e, |c| {
            let d = (cell(c) % n + 1) as i64;
            cell_of(&std::array::from_fn(|p| if p == 4 { d } else { 0 })).map(|v| v as i16)
        });
        let (coded, _) = check(&steps, How::all());
        assert_eq!((coded.book().averages(), coded.book().details().len()), (&[[0; 3]][..], n.min(256) as usize));
        assert_eq!(coded.decode().bytes() == steps.bytes(), n <= 256, "{n}");
    }
}

#[test] // K-47, V14: with a word for each coefficient only rounding is left, 15 halves of it
fn rounding_alone_is_off_by_at_most_seven() {
    let e = Extent::cube(64);
    let worst = |grid: &Grid| {
        let back = code(grid, How::all()).decode();
        let off = |(a, b): (&u8, &u8)| a.abs_diff(*b);
        grid.bytes().iter().zip(back.bytes()).map(off).max().unwrap()
    };
    // 8 bits have 256 averages and 255 details that are not 0: no training can lose anything.
    let random = worst(&noise(e, |h| (h >> 13) as u8));
    let checker = worst(&Grid::from_fn(e, |[x, y, z]| if (x + y + z) % 2 == 0 { 255u8 } else { 0 }).unwrap());
    let sparse = worst(&noise(e, |h| if h % 9 == 0 { (h >> 11) as u8 } else { 0 }));
    println!("largest errors: random {random}, checkerboard {checker}, sparse {sparse}");
    assert!(random <= 5 && sparse <= 7 && checker == 1);
}

#[test] // K-56; spec: ZBT-8: noise is larger than its samples, but within the bound
fn white_noise() {
    for (bytes, coded) in [
        (64 * 64 * 64, code(&noise(Extent::cube(64), |h| (h >> 8) as u8), How::all())),
        (2 * 64 * 64 * 64, code(&noise(Extent::cube(64), |h| (h >> 8) as u16), How::all())),
        (3 * 64 * 64 * 64, code(&noise(Extent::cube(64), |h| [h as u8, (h >> 8) as u8, (h >> 16) as u8]), How::all())),
    ] {
        let len = coded.payload().len();
        println!("{} noise: {bytes} bytes of samples, {len} of payload", coded.sample_type);
        assert!(len <= 16 + 5_004 * 64 && len > 4_700 * 64);
    }
}

#[test] // the norm of energy leaves the smaller error for the same number of coefficients
fn energy_and_plain_norm() {
    let e = Extent::cube(64);
    let smooth = |c: [u32; 3]| {
        let wave = |v: u32, s: f64| (f64::from(v) / s).sin();
        (120.0 + 60.0 * wave(c[0], 9.0) + 40.0 * wave(c[1] + c[2], 5.0) + f64::from(hash(c) % 17)) as u8
    };
    let grid = Grid::from_fn(e, smooth).unwrap();
    let error = |norm| {
        let how = How { norm, threshold: Threshold::Global, ..How::keep(40_000) };
        let back = check(&grid, how).0.decode();
        vug::metrics::error_stats(&grid.view(), &back.view()).unwrap().rmse()
    };
    assert!(error(Norm::Energy) < error(Norm::Plain));
}
