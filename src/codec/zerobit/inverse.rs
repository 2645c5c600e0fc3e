//! The inverse Haar transform of a 2³ group, whole or for one plane or voxel of it (spec chapter 14, §8).
//!
//! Coefficients are in the order j = 4·hx + 2·hy + hz, the average first; voxels in the order 4·z + 2·y + x. The last
//! letter is undone first, as in §2.2 of the paper: from that follow the costs of its Fig. 8.

use super::book::Word;
use super::tally::Tally;

/// An average and seven details.
pub(super) type Group = [Word; 8];

fn add(a: Word, b: Word, tally: &mut impl Tally) -> Word {
    tally.vector_op();
    std::array::from_fn(|c| a[c] + b[c])
}

fn sub(a: Word, b: Word, tally: &mut impl Tally) -> Word {
    tally.vector_op();
    std::array::from_fn(|c| a[c] - b[c])
}

/// Undoes one letter at position `at` (0 or 1) of its axis.
fn undo(low: Word, high: Word, at: u32, tally: &mut impl Tally) -> Word {
    if at == 0 { add(low, high, tally) } else { sub(low, high, tally) }
}

/// The voxel at `sub` (x, y, z): 7 operations. // spec: ZBT-22
pub(super) fn one(group: &Group, [x, y, z]: [u32; 3], tally: &mut impl Tally) -> Word {
    let mut value = group[0];
    for (j, &detail) in (0u32..).zip(group).skip(1) {
        let odd = (j >> 2 & x) ^ (j >> 1 & y) ^ (j & z) & 1;
        value = undo(value, detail, odd & 1, tally);
    }
    value
}

/// The four voxels whose coordinate along `axis` (0 x, 1 y, 2 z) is `at`, the lower of the other axes fastest:
/// 20, 16, 12 operations.
pub(super) fn half(group: &Group, axis: usize, at: u32, tally: &mut impl Tally) -> [Word; 4] {
    // Positions to be made along each axis.
    let [xs, ys, zs] = std::array::from_fn(|a| if a == axis { at..at + 1 } else { 0..2 });
    let mut out = [Word::default(); 4];
    let mut next = out.iter_mut();
    for z in zs {
        let after_z: [Word; 4] = std::array::from_fn(|j| undo(group[2 * j], group[2 * j + 1], z, tally));
        for y in ys.clone() {
            let after_y: [Word; 2] = std::array::from_fn(|j| undo(after_z[2 * j], after_z[2 * j + 1], y, tally));
            for x in xs.clone() {
                *next.next().expect("four voxels") = undo(after_y[0], after_y[1], x, tally);
            }
        }
    }
    out
}

/// All eight voxels: 24 operations.
pub(super) fn all(group: &Group, tally: &mut impl Tally) -> [Word; 8] {
    let [below, above] = [0, 1].map(|z| half(group, 2, z, tally));
    std::array::from_fn(|i| if i < 4 { below[i] } else { above[i - 4] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::zerobit::tally::Counts;

    fn group() -> Group {
        std::array::from_fn(|j| [(j * j * 7) as i32 - 20, 3 - j as i32 * 5, 1 << j])
    }

    #[test]
    fn costs_are_those_of_figure_8() {
        // spec: ZBT-22
        let ops = |f: &dyn Fn(&mut Counts)| {
            let mut counts = Counts::default();
            f(&mut counts);
            counts.vector_ops
        };
        assert_eq!(ops(&|c| _ = one(&group(), [1, 0, 1], c)), 7);
        assert_eq!([0, 1, 2].map(|axis| ops(&|c| _ = half(&group(), axis, 1, c))), [20, 16, 12]);
        assert_eq!(ops(&|c| _ = all(&group(), c)), 24);
    }

    #[test]
    fn voxel_plane_and_group_agree() {
        let all = all(&group(), &mut ());
        for (i, value) in (0u32..).zip(all) {
            let sub = [i & 1, i >> 1 & 1, i >> 2];
            assert_eq!(one(&group(), sub, &mut ()), value);
            for axis in 0..3 {
                let half = half(&group(), axis, sub[axis], &mut ());
                let rest: Vec<u32> = (0..3).filter(|&a| a != axis).map(|a| sub[a]).collect();
                assert_eq!(half[(rest[0] + 2 * rest[1]) as usize], value, "axis {axis}, voxel {sub:?}");
            }
        }
    }

    #[test]
    fn signs_are_those_of_figure_2() {
        // V7: the first letter belongs to x, the last to z.
        for (j, letters) in (1..8).zip(["llh", "lhl", "lhh", "hll", "hlh", "hhl", "hhh"]) {
            let mut group = Group::default();
            group[j] = [1; 3];
            for (i, value) in (0u32..).zip(all(&group, &mut ())) {
                let sub = [i & 1, i >> 1 & 1, i >> 2];
                let odd = letters.chars().zip(sub).filter(|&(letter, at)| letter == 'h' && at == 1).count() % 2;
                assert_eq!(value, [1 - 2 * odd as i32; 3], "{letters} at {sub:?}");
            }
        }
    }
}
