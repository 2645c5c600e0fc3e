//! Encoding levels with zerobit: it looks at a level before it encodes a brick, since thresholds and codebooks are shared
//! (spec chapter 14, §12).

use super::brick_encoder::{BrickEncoder, EncodedBrick};
use super::selection::Selection;
use super::slabs::{Place, Source, Walk};
use crate::codec::Codec;
use crate::codec::zerobit::{Book, Coder, Cut, Plan, RankSearch, Survey, Threshold, Trainer, Zerobit};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::grid::View;
use crate::limits;
use crate::voxel::SampleType;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// How the levels of one volume are encoded.
pub(super) struct Encoding<'a> {
    /// Codec without codebooks.
    pub(super) codec: &'a Zerobit,
    /// What else is done to a brick; its codec is not used.
    pub(super) encoder: &'a BrickEncoder,
    pub(super) brick_log2: u8,
    /// Bricks per axis that share a codebook; `None`: all of a level.
    pub(super) region: Option<u32>,
    pub(super) selection: Option<&'a Selection>,
}

/// Distinct averages or details that are told apart at a time, of all codebooks of a level that are trained together.
const MOST_DISTINCT: usize = 1 << 20;

/// Takes encoded bricks, in the order of the walk, and the codebooks there are so far.
type Take<'a> = dyn FnMut(&[Book], Place, EncodedBrick) -> Result<()> + 'a;

impl Encoding<'_> {
    /// Looks at `levels` once, of all time steps and channels.
    pub(super) fn survey(
        &self,
        source: &mut Source<'_>,
        levels: Range<u8>,
        progress: &mut dyn FnMut(u64),
    ) -> Result<Vec<Survey>> {
        let mut totals = vec![Survey::default(); levels.len()];
        let work = |_, view: View<'_>| {
            let voxels = view.extent.voxels();
            // Constant bricks take no coefficients: what they would have is left to the others.
            let constant = self.encoder.constant(view).is_some();
            Ok(if constant { Survey { voxels, ..Survey::default() } } else { self.codec.survey(view) })
        };
        source.for_each_brick(&Walk::levels(self.brick_log2, levels.clone()), work, |place, survey| {
            if place.at.lod == 0 {
                progress(survey.voxels);
            }
            totals[usize::from(place.at.lod - levels.start)].merge(survey);
            Ok(())
        })?;
        if let Some(selection) = self.selection {
            for (level, total) in levels.zip(&mut totals) {
                total.voxels = selection.voxels(level) * u64::from(source.trees());
            }
        }
        Ok(totals)
    }

    /// What to keep of each of `levels`; a global threshold takes two or three more looks.
    pub(super) fn cuts(&self, source: &mut Source<'_>, levels: Range<u8>, surveys: &[Survey]) -> Result<Vec<Cut>> {
        let keep = self.codec.params().keep_ppm();
        if self.codec.params().threshold == Threshold::Adaptive {
            let share = |s: &Survey| Cut::Share { budget: s.budget(keep), nonzero: s.nonzero };
            return Ok(surveys.iter().map(share).collect());
        }
        let wide = is_wide(source.sample_type());
        let mut searches: Vec<RankSearch> = surveys.iter().map(|s| RankSearch::new(s.budget(keep), wide)).collect();
        while searches.iter().any(|s| !s.is_done()) {
            let mut totals: Vec<_> = searches.iter().map(RankSearch::digits).collect();
            let search_of = |place: Place| &searches[usize::from(place.at.lod - levels.start)];
            let work = |place: Place, view: View<'_>| {
                let idle = search_of(place).is_done() || self.encoder.constant(view).is_some();
                Ok((!idle).then(|| self.codec.count_norms(view, search_of(place))))
            };
            source.for_each_brick(&Walk::levels(self.brick_log2, levels.clone()), work, |place, digits| {
                let total = &mut totals[usize::from(place.at.lod - levels.start)];
                for (total, count) in total.iter_mut().zip(digits.into_iter().flatten()) {
                    *total += count;
                }
                Ok(())
            })?;
            for (search, total) in searches.iter_mut().zip(&totals).filter(|(search, _)| !search.is_done()) {
                search.take(total);
            }
        }
        Ok(searches.iter().map(RankSearch::cut).collect())
    }

    /// Trains codebooks for `levels` and encodes their bricks. Time steps and channels share codebooks. They are numbered
    /// from `books.len()` on, and added.
    pub(super) fn encode(
        &self,
        source: &mut Source<'_>,
        levels: Range<u8>,
        cuts: &[Cut],
        books: &mut Vec<Book>,
        progress: &mut dyn FnMut(u64),
        take: &mut Take<'_>,
    ) -> Result<()> {
        if self.region.is_none() {
            return self.part(source, &Walk::levels(self.brick_log2, levels), cuts, books, progress, take);
        }
        // One layer of regions at a time: the histograms of all of them would not fit.
        for (level, cut) in levels.zip(cuts) {
            let bricks = self.bricks(source, level);
            let edge = self.region_edge(bricks);
            for z in (0..bricks.z).step_by(edge as usize) {
                let layers = Some(z..z.saturating_add(edge).min(bricks.z));
                let walk = Walk { brick_log2: self.brick_log2, levels: level..level + 1, layers };
                self.part(source, &walk, &[*cut], books, progress, take)?;
            }
        }
        Ok(())
    }

    fn bricks(&self, source: &Source<'_>, level: u8) -> Extent {
        source.extent().at_lod(level).div_ceil(Extent::cube(1 << self.brick_log2))
    }

    /// Bricks per axis that share a codebook.
    fn region_edge(&self, bricks: Extent) -> u32 {
        self.region.unwrap_or(u32::MAX).min(bricks.x.max(bricks.y).max(bricks.z))
    }

    /// Codebooks and bricks of a part whose regions are one layer thick.
    fn part(
        &self,
        source: &mut Source<'_>,
        walk: &Walk,
        cuts: &[Cut],
        books: &mut Vec<Book>,
        progress: &mut dyn FnMut(u64),
        take: &mut Take<'_>,
    ) -> Result<()> {
        let first = walk.levels.start;
        // Regions of each level, and how many bricks they take.
        let grids: Vec<(Extent, u32)> = walk
            .levels
            .clone()
            .map(|level| {
                let bricks = self.bricks(source, level);
                let edge = self.region_edge(bricks);
                (bricks.div_ceil(Extent::cube(edge)), edge)
            })
            .collect();
        let index = |place: Place| usize::from(place.at.lod - first);
        let region_of = |place: Place| {
            let (regions, edge) = grids[index(place)];
            (place.brick[0] / edge + regions.x * (place.brick[1] / edge)) as usize
        };
        let mut trainers: Vec<Vec<Option<Trainer>>> =
            grids.iter().map(|(regions, _)| (0..regions.x * regions.y).map(|_| None).collect()).collect();
        let distinct = MOST_DISTINCT / trainers.iter().map(Vec::len).max().unwrap_or(1).clamp(1, 64);
        let work = |place: Place, view: View<'_>| {
            let constant = self.encoder.constant(view).is_some();
            Ok((view.extent.voxels(), (!constant).then(|| self.codec.survivors(view, cuts[index(place)]))))
        };
        let mut count = |place: Place, voxels| {
            if place.at.lod == 0 {
                progress(voxels);
            }
        };
        source.for_each_brick(walk, work, |place, (voxels, survivors)| {
            count(place, voxels);
            if let Some(survivors) = survivors {
                let trainer = &mut trainers[index(place)][region_of(place)];
                trainer.get_or_insert_with(|| Trainer::within(distinct)).take(&survivors);
            }
            Ok(())
        })?;
        let t = source.sample_type();
        let codecs: Vec<Vec<Option<Codec>>> = trainers
            .into_iter()
            .zip(cuts)
            .map(|(trainers, cut)| self.train(trainers, *cut, t, books))
            .collect::<Result<_>>()?;
        let work = |place: Place, view: View<'_>| {
            let codec = codecs[index(place)][region_of(place)].clone();
            let codec = codec.unwrap_or_else(|| Codec::Zerobit(self.codec.clone()));
            let encoder = BrickEncoder { codec, ..self.encoder.clone() };
            Ok((view.extent.voxels(), encoder.encode(view)?))
        };
        source.for_each_brick(walk, work, |place, (voxels, encoded)| {
            count(place, voxels);
            take(books, place, encoded)
        })
    }

    /// Codecs by region; none, where no brick of the region is stored.
    fn train(
        &self,
        trainers: Vec<Option<Trainer>>,
        cut: Cut,
        t: SampleType,
        books: &mut Vec<Book>,
    ) -> Result<Vec<Option<Codec>>> {
        let training = self.codec.params().training;
        let first = u32::try_from(books.len()).expect("below the cap");
        let trained: Vec<Option<Result<Book>>> =
            trainers.into_par_iter().map(|trainer| trainer.map(|trainer| trainer.train(training, t))).collect();
        let mut numbers = Vec::with_capacity(trained.len());
        for book in trained {
            let number = u32::try_from(books.len()).expect("below the cap");
            numbers.push(book.is_some().then_some(number));
            books.extend(book.transpose()?);
        }
        limits::check("codebook-region", books.len() as u64, limits::MAX_CODEBOOKS).map_err(|_| {
            let most = limits::MAX_CODEBOOKS;
            Error::param("codebook-region", format!("more than {most} codebooks; use larger regions"))
        })?;
        let shared: Arc<[Book]> = books[first as usize..].into();
        let with_plan = |book: u32| {
            let coder = Arc::new(Coder::new(&shared[(book - first) as usize]));
            Codec::Zerobit(self.codec.with_books_from(first, shared.clone()).planned(Plan { book, coder, cut }))
        };
        Ok(numbers.into_iter().map(|number| number.map(with_plan)).collect())
    }
}

/// A codec for one brick alone: its own thresholds, and its own codebook, which gets the number `number`.
pub(super) fn for_one_brick(codec: &Zerobit, src: View<'_>, number: u32) -> Result<(Zerobit, Book)> {
    let survey = codec.survey(src);
    let budget = survey.budget(codec.params().keep_ppm());
    let cut = match codec.params().threshold {
        Threshold::Adaptive => Cut::Share { budget, nonzero: survey.nonzero },
        Threshold::Global => {
            let mut search = RankSearch::new(budget, is_wide(src.sample_type));
            while !search.is_done() {
                let digits = codec.count_norms(src, &search);
                search.take(&digits);
            }
            search.cut()
        }
    };
    let mut trainer = Trainer::default();
    trainer.take(&codec.survivors(src, cut));
    let book = trainer.train(codec.params().training, src.sample_type)?;
    let plan = Plan { book: number, coder: Arc::new(Coder::new(&book)), cut };
    Ok((codec.with_books_from(number, [book.clone()].into()).planned(plan), book))
}

fn is_wide(t: SampleType) -> bool {
    !matches!(t, SampleType::U8 | SampleType::Rgb8)
}
