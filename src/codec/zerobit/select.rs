//! Which coefficients are kept: thresholds of unit blocks and of whole levels (spec chapter 14, §12; §2.3 of the paper).

use super::params::KEEP_ALL;
use super::plan::Cut;
use super::transform::{Component, UnitCoefficients};

/// What one pass over bricks tells about a level before thresholds are set. Sums do not depend on the order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Survey {
    /// Coefficients that are not 0.
    pub nonzero: u64,
    /// Voxels: what the ratio to keep refers to, unless a selection is smaller.
    pub voxels: u64,
}

impl Survey {
    /// Adds what another part of the level has.
    pub fn merge(&mut self, other: Survey) {
        self.nonzero += other.nonzero;
        self.voxels += other.voxels;
    }

    /// Coefficients to keep: `keep_ppm` millionths of as many as there are voxels; all of them for [`KEEP_ALL`].
    #[must_use]
    pub fn budget(&self, keep_ppm: u32) -> u64 {
        if keep_ppm == KEEP_ALL {
            return self.voxels.max(self.nonzero); // cells that the extent cuts have more coefficients than voxels
        }
        let kept = u128::from(self.voxels) * u128::from(keep_ppm) / u128::from(KEEP_ALL);
        u64::try_from(kept).expect("no more than there are voxels")
    }
}

/// Coefficients of a unit block that are kept, by cell: bit p is position p.
pub(super) type Kept = [u64; 64];

/// Applies a cut to a unit block. What equals the threshold is kept, so that somewhat more may be kept than asked for.
pub(super) fn keep<S: Component, const C: usize>(
    unit: &UnitCoefficients<S, C>,
    cut: Cut,
    scratch: &mut Vec<S::Key>,
) -> Kept {
    let mut kept = [0; 64];
    if let Some(least) = threshold(unit, cut, scratch) {
        unit.each_at_least(least, |n, p| kept[n] |= 1 << p);
    }
    kept
}

/// The smallest norm that is kept, at least 1; `None` where nothing is.
fn threshold<S: Component, const C: usize>(
    unit: &UnitCoefficients<S, C>,
    cut: Cut,
    scratch: &mut Vec<S::Key>,
) -> Option<S::Key> {
    let (budget, nonzero) = match cut {
        // No norm reaches one that a key cannot hold.
        Cut::Least(norm) => return S::Key::try_from(norm.max(1)).ok(),
        Cut::Share { budget, nonzero } => (budget, nonzero),
    };
    if nonzero == 0 {
        return None;
    }
    let share = u128::from(unit.nonzero) * u128::from(budget) / u128::from(nonzero);
    let share = usize::try_from(share).unwrap_or(usize::MAX);
    if share == 0 {
        return None;
    }
    if share as u64 >= unit.nonzero {
        return S::Key::try_from(1).ok();
    }
    scratch.clear();
    unit.each_key(|key| scratch.push(key));
    let (_, least, _) = scratch.select_nth_unstable_by(share - 1, |a, b| b.cmp(a));
    Some(*least)
}

/// Finds the norm of the `rank`-th largest coefficient of a level in a few passes over it, 15 bits each.
#[derive(Clone, Debug)]
pub struct RankSearch {
    /// How many larger or equal ones are wanted among those that start with `prefix`.
    rank: u64,
    prefix: u64,
    shift: u32,
    done: bool,
}

const DIGIT_BITS: u32 = 15;

/// Counts of norms by their next digit.
pub type Digits = Vec<u64>;

impl RankSearch {
    /// Looks for the norm that `rank` coefficients reach. `wide`: samples have 16 bits, norms thus 45 and not 30.
    #[must_use]
    pub fn new(rank: u64, wide: bool) -> Self {
        let digits = if wide { 3 } else { 2 };
        RankSearch { rank, prefix: 0, shift: (digits - 1) * DIGIT_BITS, done: rank == 0 }
    }

    /// Whether another pass is needed.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        self.done
    }

    /// Zero counts, to be filled by [`super::Zerobit::count_norms`] and added up.
    #[must_use]
    pub fn digits(&self) -> Digits {
        vec![0; 1 << DIGIT_BITS]
    }

    pub(super) fn count<S: Component, const C: usize>(&self, unit: &UnitCoefficients<S, C>, digits: &mut Digits) {
        unit.each_key(|key| {
            let key: u64 = key.into();
            if key >> self.shift >> DIGIT_BITS == self.prefix {
                digits[(key >> self.shift & ((1 << DIGIT_BITS) - 1)) as usize] += 1;
            }
        });
    }

    /// Takes the counts of a whole pass.
    pub fn take(&mut self, digits: &Digits) {
        let mut rest = self.rank;
        let found = digits.iter().enumerate().rev().find(|&(_, &count)| {
            let here = rest <= count;
            if !here {
                rest -= count;
            }
            here
        });
        match found {
            Some((digit, _)) => {
                self.prefix = self.prefix << DIGIT_BITS | digit as u64;
                self.rank = rest;
                self.done = self.shift == 0;
                self.shift = self.shift.saturating_sub(DIGIT_BITS);
            }
            // Fewer coefficients than wanted: all that are not 0.
            None => (self.prefix, self.done) = (1, true),
        }
    }

    /// The cut that has been found.
    #[must_use]
    pub fn cut(&self) -> Cut {
        // Nothing is kept where nothing is to be.
        Cut::Least(if self.rank == 0 && self.prefix == 0 { u64::MAX } else { self.prefix })
    }
}
