//! Encoding levels with zerobit: it looks at a level before it encodes a brick, since thresholds and codebooks are shared
//! (spec chapter 14, §12).

use super::brick_encoder::{BrickEncoder, EncodedBrick};
use super::selection::Selection;
use super::slabs::for_each_brick_in;
use crate::codec::Codec;
use crate::codec::zerobit::{Book, Coder, Cut, Plan, RankSearch, Survey, Threshold, Trainer, Zerobit};
use crate::error::{Error, Result};
use crate::geometry::{Coord, Extent};
use crate::grid::{SlabReader, View};
use crate::limits;
use crate::voxel::SampleType;
use rayon::prelude::*;
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

/// Encoded bricks, in order: z, y, x, x fastest.
type Take<'a> = dyn FnMut(Coord, EncodedBrick) -> Result<()> + 'a;

impl Encoding<'_> {
    /// Looks at level `lod` once.
    pub(super) fn survey(&self, reader: &mut dyn SlabReader, lod: u8, progress: &mut dyn FnMut(u64)) -> Result<Survey> {
        let mut total = Survey::default();
        let work = |_, view: View<'_>| {
            let voxels = view.extent.voxels();
            // Constant bricks take no coefficients: what they would have is left to the others.
            let constant = self.encoder.constant(view).is_some();
            Ok(if constant { Survey { voxels, ..Survey::default() } } else { self.codec.survey(view) })
        };
        self.each(reader, lod, None, work, |_, survey| {
            progress(survey.voxels);
            total.merge(survey);
            Ok(())
        })?;
        if let Some(selection) = self.selection {
            total.voxels = selection.voxels(lod);
        }
        Ok(total)
    }

    /// What to keep of level `lod`; a global threshold takes two or three more looks.
    pub(super) fn cut(&self, reader: &mut dyn SlabReader, lod: u8, survey: &Survey) -> Result<Cut> {
        let keep = self.codec.params().keep_ppm();
        if self.codec.params().threshold == Threshold::Adaptive {
            return Ok(Cut::Share { budget: survey.budget(keep), nonzero: survey.nonzero });
        }
        let budget = survey.budget(keep);
        let mut search = RankSearch::new(budget, is_wide(reader.sample_type()));
        while !search.is_done() {
            let mut total = search.digits();
            let work = |_, view: View<'_>| {
                let constant = self.encoder.constant(view).is_some();
                Ok((!constant).then(|| self.codec.count_norms(view, &search)))
            };
            self.each(reader, lod, None, work, |_, digits| {
                for (total, count) in total.iter_mut().zip(digits.into_iter().flatten()) {
                    *total += count;
                }
                Ok(())
            })?;
            search.take(&total);
        }
        Ok(search.cut())
    }

    /// Trains codebooks for level `lod` and encodes its bricks. Codebooks are numbered from `books.len()` on, and added.
    pub(super) fn level(
        &self,
        reader: &mut dyn SlabReader,
        lod: u8,
        cut: Cut,
        books: &mut Vec<Book>,
        progress: &mut dyn FnMut(u64),
        take: &mut Take<'_>,
    ) -> Result<()> {
        let bricks = reader.extent().at_lod(lod).div_ceil(Extent::cube(1 << self.brick_log2));
        let edge = self.region.unwrap_or(u32::MAX).min(bricks.x.max(bricks.y).max(bricks.z));
        for z in (0..bricks.z).step_by(edge as usize) {
            let layers = z..z.saturating_add(edge).min(bricks.z);
            let regions = bricks.div_ceil(Extent::cube(edge));
            let region_of = |brick: Coord| (brick[0] / edge + regions.x * (brick[1] / edge)) as usize;
            let codecs = {
                let count = (regions.x * regions.y) as usize;
                let mut trainers: Vec<Option<Trainer>> = (0..count).map(|_| None).collect();
                let work = |_, view: View<'_>| {
                    let constant = self.encoder.constant(view).is_some();
                    Ok((view.extent.voxels(), (!constant).then(|| self.codec.survivors(view, cut))))
                };
                self.each(reader, lod, Some(layers.clone()), work, |brick, (voxels, survivors)| {
                    progress(voxels);
                    if let Some(survivors) = survivors {
                        trainers[region_of(brick)].get_or_insert_default().take(&survivors);
                    }
                    Ok(())
                })?;
                self.train(trainers, cut, reader.sample_type(), books)?
            };
            let work = |brick, view: View<'_>| {
                let codec = codecs[region_of(brick)].clone().unwrap_or_else(|| Codec::Zerobit(self.codec.clone()));
                let encoder = BrickEncoder { codec, ..self.encoder.clone() };
                Ok((view.extent.voxels(), encoder.encode(view)?))
            };
            self.each(reader, lod, Some(layers), work, |brick, (voxels, encoded)| {
                progress(voxels);
                take(brick, encoded)
            })?;
        }
        Ok(())
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

    fn each<R: Send>(
        &self,
        reader: &mut dyn SlabReader,
        lod: u8,
        layers: Option<std::ops::Range<u32>>,
        work: impl Fn(Coord, View<'_>) -> Result<R> + Sync,
        take: impl FnMut(Coord, R) -> Result<()>,
    ) -> Result<()> {
        for_each_brick_in(reader, lod, self.brick_log2, self.encoder.null, layers, work, take)
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
