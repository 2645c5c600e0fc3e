//! Passes over bricks before any is encoded: surveys, norms, and the coefficients that codebooks are made of (§2.3 and
//! §2.4 of the paper).

use super::Zerobit;
use super::book::{Book, MAX_WORDS, Word, ranges};
use super::layout::Layout;
use super::params::Training;
use super::plan::Cut;
use super::select::{Digits, Kept, RankSearch, Survey, keep};
use super::transform::{CellCoefficients, Component, Number, UnitCoefficients};
use crate::error::Result;
use crate::grid::View;
use crate::haar;
use crate::quantise::{Histogram, Tally, Vector, median_cut, refine};
use crate::voxel::{SampleType, SampleValue};

/// Rounds of k-means at most; it mostly stops moving before.
const REFINE_ROUNDS: usize = 24;

/// Runs `$body` with the Rust type `$S` of a component and the number `$C` of components of a sample type that zerobit holds.
macro_rules! with_component {
    ($t:expr, $S:ident, $C:ident => $body:expr) => {
        match $t {
            SampleType::U8 => {
                type $S = u8;
                const $C: usize = 1;
                $body
            }
            SampleType::U16 => {
                type $S = u16;
                const $C: usize = 1;
                $body
            }
            SampleType::I16 => {
                type $S = i16;
                const $C: usize = 1;
                $body
            }
            SampleType::Rgb8 => {
                type $S = u8;
                const $C: usize = 3;
                $body
            }
            SampleType::F32 => unreachable!("refused by Codec::supports"),
        }
    };
}
pub(super) use with_component;

/// Coefficients of a brick that are kept, rounded, with how often each occurs.
#[derive(Clone, Debug, Default)]
pub struct Survivors {
    average: Histogram,
    detail: Histogram,
}

/// Survivors of all bricks of a codebook's region. The order in which they come does not matter.
#[derive(Clone, Debug, Default)]
pub struct Trainer {
    average: Tally,
    detail: Tally,
}

impl Trainer {
    /// A trainer that tells at most `distinct` vectors apart: bounds its memory to some 100 bytes for each.
    #[must_use]
    pub fn within(distinct: usize) -> Trainer {
        Trainer { average: Tally::within(distinct), detail: Tally::within(distinct) }
    }

    /// Adds those of one brick.
    pub fn take(&mut self, survivors: &Survivors) {
        for (tally, histogram) in [(&mut self.average, &survivors.average), (&mut self.detail, &survivors.detail)] {
            histogram.entries().iter().for_each(|e| tally.add_counted(e.vector, e.count));
        }
    }

    /// A codebook for all of them: median cut, refined where `training` says so.
    ///
    /// # Errors
    /// None for survivors of samples of type `t`.
    pub fn train(self, training: Training, t: SampleType) -> Result<Book> {
        let words = |tally: Tally| {
            let histogram = &tally.finish();
            if histogram.is_empty() {
                return Vec::new();
            }
            let book = median_cut(histogram, MAX_WORDS);
            match training {
                Training::MedianCut => book,
                Training::Refined => refine(histogram, &book, REFINE_ROUNDS),
            }
        };
        let (average, detail) = rayon::join(|| words(self.average), || words(self.detail));
        Book::new(t, average, detail)
    }
}

impl Zerobit {
    /// Counts what a level has before thresholds are set.
    #[must_use]
    pub fn survey(&self, src: View<'_>) -> Survey {
        with_component!(src.sample_type, S, C => {
            let mut survey = Survey { voxels: src.extent.voxels(), ..Survey::default() };
            self.each_unit_unweighed::<S, C>(src, |_, unit| survey.nonzero += unit.nonzero);
            survey
        })
    }

    /// Counts norms for a [`RankSearch`].
    #[must_use]
    pub fn count_norms(&self, src: View<'_>, search: &RankSearch) -> Digits {
        let mut digits = search.digits();
        with_component!(src.sample_type, S, C => {
            self.each_unit::<S, C>(src, |_, unit| search.count(unit, &mut digits));
        });
        digits
    }

    /// Collects what codebooks are to be made of.
    #[must_use]
    pub fn survivors(&self, src: View<'_>, cut: Cut) -> Survivors {
        let (mut average, mut detail) = (Tally::new(), Tally::new());
        let t = src.sample_type;
        with_component!(t, S, C => {
            let mut scratch = Vec::new();
            let null = self.null_components::<C>();
            self.each_unit::<S, C>(src, |_, unit| {
                let kept = keep(unit, cut, &mut scratch);
                each_stored(unit, &kept, |_, cell, bits| {
                    average.add(average_of(&cell, null));
                    each_detail(bits, |p| {
                        let word = detail_of(&cell, p, t);
                        if word != Word::default() {
                            detail.add(word);
                        }
                    });
                });
            });
        });
        Survivors { average: average.finish(), detail: detail.finish() }
    }

    /// Visits the unit blocks of a brick that have a coefficient, transformed, with norms. The visitor gets their number,
    /// too.
    pub(super) fn each_unit<S: Component, const C: usize>(
        &self,
        src: View<'_>,
        mut visit: impl FnMut(usize, &UnitCoefficients<S, C>),
    ) {
        let norm = self.params().norm;
        self.each_unit_unweighed::<S, C>(src, |index, unit| {
            unit.weigh(norm);
            visit(index, unit);
        });
    }

    fn each_unit_unweighed<S: Component, const C: usize>(
        &self,
        src: View<'_>,
        mut visit: impl FnMut(usize, &mut UnitCoefficients<S, C>),
    ) {
        let units = Layout::new(src.extent).units;
        let null = self.null_components::<C>();
        let mut unit = UnitCoefficients::<S, C>::new(null);
        let mut index = 0;
        for z in 0..units.z {
            for y in 0..units.y {
                for x in 0..units.x {
                    unit.load(&src, [x, y, z]);
                    if unit.present != 0 {
                        visit(index, &mut unit);
                    }
                    index += 1;
                }
            }
        }
    }

    pub(super) fn null_components<const C: usize>(&self) -> [i32; C] {
        std::array::from_fn(|c| match self.null() {
            SampleValue::U8(v) => v.into(),
            SampleValue::U16(v) => v.into(),
            SampleValue::I16(v) => v.into(),
            SampleValue::Rgb8(v) => v[c].into(),
            SampleValue::F32(_) => 0,
        })
    }
}

/// Visits the cells of which something is kept, in order.
pub(super) fn each_stored<S: Component, const C: usize>(
    unit: &UnitCoefficients<S, C>,
    kept: &Kept,
    mut visit: impl FnMut(u32, CellCoefficients<'_, S::Number, C>, u64),
) {
    for (n, &bits) in (0..).zip(kept).filter(|&(_, &bits)| bits != 0) {
        visit(n, unit.cell(n), bits);
    }
}

/// Visits the positions of kept details, ascending.
pub(super) fn each_detail(bits: u64, mut visit: impl FnMut(u32)) {
    let mut rest = bits & !1;
    while rest != 0 {
        visit(rest.trailing_zeros());
        rest &= rest - 1;
    }
}

/// The average of a cell, rounded; within the range of the samples.
pub(super) fn average_of<N: Number, const C: usize>(cell: &CellCoefficients<'_, N, C>, null: [i32; C]) -> Vector {
    let numerator = cell.numerator(0);
    std::array::from_fn(|c| if c < C { haar::quantised(0, numerator[c]) + null[c] } else { 0 })
}

/// A detail, rounded, within the range that a codebook holds: only the upper end can be passed, by one half.
pub(super) fn detail_of<N: Number, const C: usize>(cell: &CellCoefficients<'_, N, C>, p: u32, t: SampleType) -> Vector {
    let [lo, hi] = ranges(t).1;
    let p = p as usize;
    let numerator = cell.numerator(p);
    std::array::from_fn(|c| if c < C { haar::quantised(p, numerator[c]).clamp(lo, hi) } else { 0 })
}
