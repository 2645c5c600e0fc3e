//! The printed signs, the axes, exactness, and the number of operations.

use super::*;
use proptest::prelude::*;
use std::cell::Cell;

/// Fig. 2 of the paper, row by row: signs of c_000, c_001, ... c_111 in llh, lhl, lhh, hll, hlh, hhl, hhh, after lll.
const FIG_2: [&str; 8] =
    ["++++++++", "++++----", "++--++--", "++----++", "+-+-+-+-", "+-+--+-+", "+--++--+", "+--+-++-"];

fn printed(j: usize, sub: usize) -> i32 {
    if FIG_2[j].as_bytes()[sub] == b'+' { 1 } else { -1 }
}

fn cell(f: impl Fn([usize; 3]) -> i32) -> [i32; CELL] {
    std::array::from_fn(|n| f([n & 3, n >> 2 & 3, n >> 4]))
}

/// Coefficients by their definition: a signed sum over all voxels that they cover.
fn plain(cell: &[i32; CELL]) -> [i32; CELL] {
    std::array::from_fn(|p| {
        let (part, j) = if p < 8 { (None, p) } else { (Some((p - 1) / 7 - 1), (p - 1) % 7 + 1) };
        let term = |n: usize| {
            let [x, y, z] = [n & 3, n >> 2 & 3, n >> 4];
            let own = (x >> 1) + 2 * (y >> 1) + 4 * (z >> 1);
            match part {
                None => printed(j, own) * cell[n],
                Some(part) if part == own => printed(j, (x & 1) + 2 * (y & 1) + 4 * (z & 1)) * cell[n],
                Some(_) => 0,
            }
        };
        (0..CELL).map(term).sum()
    })
}

// V7: the signs of Fig. 2, and those of Fig. 3 which are the same.
#[test]
fn signs_are_the_printed_ones() {
    for j in 0..8 {
        for sub in 0..8 {
            assert_eq!(sign(j, sub), printed(j, sub), "detail {j} at {sub}");
        }
        // A group that is one basis pattern has that coefficient only.
        let one = inverse_group(std::array::from_fn(|k| i32::from(k == j)));
        assert_eq!(one, std::array::from_fn(|sub| printed(j, sub)));
    }
}

// V7: all patterns of both levels.
#[test]
fn a_basis_pattern_is_one_coefficient() {
    for p in 0..CELL {
        let mut numerators = [0; CELL];
        numerators[p] = 64;
        let cell = inverse(&numerators);
        assert_eq!(forward(&cell), numerators, "position {p}");
        assert_eq!(cell.iter().filter(|&&v| v != 0).count(), if p < 8 { 64 } else { 8 });
    }
}

// K-35, V8: a step along an axis is seen by the detail of that axis alone, on the level that it belongs to.
#[test]
fn steps_confirm_the_axes() {
    for (axis, j) in [(0, 4), (1, 2), (2, 1)] {
        let only = |cell: &[i32; CELL], at: &[usize], n: i32| {
            let found = forward(cell);
            (1..CELL).for_each(|p| assert_eq!(found[p], if at.contains(&p) { n } else { 0 }, "axis {axis}, {p}"));
        };
        only(&cell(|c| if c[axis] < 2 { 200 } else { 0 }), &[j], 64 * 100);
        let parts: Vec<usize> = (1..9).map(|i| 7 * i + j).collect();
        only(&cell(|c| if c[axis] % 2 == 0 { 200 } else { 0 }), &parts, 8 * 100);
    }
}

// K-34: ±127.5 rounds to 128 and −127; clamped to a signed byte the voxels come back within one.
#[test]
fn checkerboard() {
    for odd in [0, 1] {
        let board = cell(|c| if (c[0] + c[1] + c[2]) % 2 == odd { 255 } else { 0 });
        let numerators = forward(&board);
        assert_eq!(numerators[0], 64 * 255 / 2);
        for (p, &numerator) in numerators.iter().enumerate().skip(1) {
            let hhh = if p >= 8 && (p - 1) % 7 == 6 { 8 * 255 / 2 } else { 0 };
            assert_eq!(numerator, if odd == 0 { hhh } else { -hhh });
        }
        let words: [i32; CELL] = std::array::from_fn(|p| quantised(p, numerators[p]));
        assert_eq!((words[0], words[14]), (128, if odd == 0 { 128 } else { -127 }));
        for (n, &sample) in board.iter().enumerate() {
            let [x, y, z] = [n & 3, n >> 2 & 3, n >> 4];
            let detail = words[14].min(127) * sign(7, (x & 1) + 2 * (y & 1) + 4 * (z & 1));
            assert!(((words[0] + detail).clamp(0, 255) - sample).abs() <= 1);
        }
    }
}

// K-48: the largest and smallest sums of 16-bit samples.
#[test]
fn full_range_of_16_bits() {
    assert_eq!(forward(&[65_535; CELL])[0], 4_194_240);
    for sample in [65_535, -32_768] {
        for p in 0..CELL {
            let numerators: [i32; CELL] = std::array::from_fn(|k| if k == p { 64 * 64 } else { 0 });
            let loud = inverse(&numerators).map(|v| if v > 0 { sample } else { 0 });
            let found = forward(&loud);
            assert_eq!(inverse(&found), loud);
            let word = quantised(p, found[p]);
            assert!((-32_768..=65_535).contains(&word), "position {p}: {word}");
            assert!(p == 0 || word.abs() <= 32_768);
        }
    }
}

#[test]
fn division_rounds_halves_up() {
    let cases =
        [(5, 10, 1), (4, 10, 0), (-5, 10, 0), (-6, 10, -1), (-15, 10, -1), (15, 10, 2), (-1, 3, 0), (-2, 3, -1)];
    for (n, d, want) in cases {
        assert_eq!(rdiv(n, d), want, "{n}/{d}");
    }
    for n in -1000i32..1000 {
        assert_eq!(i64::from(quantised(7, n)), rdiv(n.into(), 64));
        assert_eq!(i64::from(quantised(8, n)), rdiv(n.into(), 8));
        assert_eq!(rdiv(n.into(), 7), (2 * i64::from(n) + 7).div_euclid(14));
    }
    assert_eq!((rdiv(i64::MAX, 1), rdiv(i64::MIN, 2), rdiv(i64::MAX, i64::MAX)), (i64::MAX, i64::MIN / 2, 1));
}

/// A number that counts what is done with it.
#[derive(Clone, Copy)]
struct Counted<'a>(i32, &'a Cell<u32>);

impl<'a> Add for Counted<'a> {
    type Output = Counted<'a>;
    fn add(self, other: Self) -> Self {
        self.1.set(self.1.get() + 1);
        Counted(self.0 + other.0, self.1)
    }
}

impl<'a> Sub for Counted<'a> {
    type Output = Counted<'a>;
    fn sub(self, other: Self) -> Self {
        self.1.set(self.1.get() + 1);
        Counted(self.0 - other.0, self.1)
    }
}

#[test]
fn a_group_takes_24_operations() {
    let count = Cell::new(0);
    let c = [100, -3, 5, 7, 11, -13, 17, 19];
    let group = inverse_group(c.map(|v| Counted(v, &count)));
    assert_eq!(count.get(), 24);
    for (sub, voxel) in group.iter().enumerate() {
        assert_eq!(voxel.0, (0..8).map(|j| sign(j, sub) * c[j]).sum::<i32>());
    }
}

proptest! {
    // K-46
    #[test]
    fn numerators_lose_nothing(cell in proptest::array::uniform32([-32_768i32..=65_535, -32_768..=65_535])) {
        let cell: [i32; CELL] = std::array::from_fn(|n| cell[n / 2][n % 2]);
        let numerators = forward(&cell);
        prop_assert_eq!(numerators, plain(&cell));
        prop_assert_eq!(inverse(&numerators), cell);
    }

    #[test]
    fn components_do_not_mix(cell in proptest::array::uniform32([any::<[i16; 3]>(), any::<[i16; 3]>()])) {
        let cell: [[i32; 3]; CELL] = std::array::from_fn(|n| cell[n / 2][n % 2].map(i32::from));
        let found = forward_components(&cell);
        for c in 0..3 {
            prop_assert_eq!(found.map(|v| v[c]), forward(&cell.map(|v| v[c])));
        }
        // More components than are added at once.
        let wide = forward_components(&cell.map(|[a, b, c]| [a, b, c, a, b]));
        prop_assert_eq!(wide, found.map(|[a, b, c]| [a, b, c, a, b]));
        prop_assert_eq!(forward_components(&cell.map(|v| [v[2]])), found.map(|v| [v[2]]));
    }
}
