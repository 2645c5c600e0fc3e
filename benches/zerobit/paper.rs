//! Rows of part `paper`: the plain decoder, which goes coefficient by coefficient as §3.3 of the paper does, on NEW and on
//! OLD streams.
//!
//! Both sides skip a node without details at the first sight of it: NEW by its zerobit, OLD by seven flags at once. `flags`
//! is OLD without that, every flag looked at by itself and every sum made, which is how we read the paper.
//!
//! The plain decoder is compiled for the oldest machine of its kind, where counting bits takes a dozen instructions. For the
//! machine's own instruction: `RUSTFLAGS="-C target-cpu=native" cargo bench --bench zerobit -- paper`.

use crate::support::{Contestant, interleave};
use std::hint::black_box;
use std::sync::Arc;
use vug::codec::Codec;
use vug::codec::zerobit::bits::{BitCount, CountTable, Popcount};
use vug::codec::zerobit::{
    Book, Case, Coder, Context, Cut, Layout, Params, Plan, Stream, Survey, Tally, Trainer, Training, Word, Zerobit,
    unit,
};
use vug::voxel::{SampleType, SampleValue};
use vug::{Extent, Grid, Region};

const BRICK: u32 = 64;

/// Looks at everything, and forgets it.
struct Patient;

impl Tally for Patient {
    #[inline(always)]
    fn case(&mut self, _: Case) {}
    #[inline(always)]
    fn vector_op(&mut self) {}
}

/// A volume as payloads of bricks, x fastest.
struct Payloads {
    stream: Stream,
    bricks: u32,
    layout: Layout,
    payloads: Vec<Vec<u8>>,
    book: Book,
}

impl Payloads {
    fn new(grid: &Grid, percent: f64, stream: Stream) -> Payloads {
        let keep = (percent * 1e4) as u32;
        let zerobit = Zerobit::new(stream, Params::new(keep).expect("a ratio"), SampleValue::Rgb8([0; 3]));
        let bricks = grid.extent().x / BRICK;
        let regions: Vec<Region> = (0..bricks.pow(3))
            .map(|i| [i % bricks, i / bricks % bricks, i / (bricks * bricks)].map(|v| v * BRICK))
            .map(|origin| Region::at(origin, Extent::cube(BRICK)))
            .collect();
        let mut survey = Survey::default();
        regions.iter().for_each(|r| survey.merge(zerobit.survey(grid.view().sub(r))));
        let cut = Cut::Share { budget: survey.budget(keep), nonzero: survey.nonzero };
        let mut trainer = Trainer::default();
        regions.iter().for_each(|r| trainer.take(&zerobit.survivors(grid.view().sub(r), cut)));
        let book = trainer.train(Training::MedianCut, SampleType::Rgb8).expect("a book");
        let coder = Arc::new(Coder::new(&book));
        let codec = Codec::Zerobit(zerobit.with_books([book.clone()].into()).planned(Plan { book: 0, coder, cut }));
        let encode = |r: &Region| {
            let mut out = Vec::new();
            codec.encode(grid.view().sub(r), &mut out).expect("encodes");
            out
        };
        let payloads = regions.iter().map(encode).collect();
        Payloads { stream, bricks, layout: Layout::new(Extent::cube(BRICK)), payloads, book }
    }

    fn context<C: BitCount>(&self, count: C) -> Context<'_, C> {
        Context { book: &self.book, sample_type: SampleType::Rgb8, count }
    }

    /// Sum of the components of all voxels of the list.
    #[inline(always)]
    fn voxels<C: BitCount>(&self, coords: &[[u32; 3]], count: C, mut tally: impl Tally) -> i32 {
        let context = self.context(count);
        let mut sum = 0;
        for &c in coords {
            let (payload, local) = self.brick(c);
            let (index, n) = self.layout.locate(local);
            let at = local.map(|v| v & 3);
            let word: Option<Word> = unit(payload, index).and_then(|unit| match self.stream {
                Stream::New => unit.cell(n, count).map(|cell| context.voxel(&cell, at, &mut tally)),
                Stream::Old => unit.old_cell(n, count).map(|cell| context.voxel(&cell, at, &mut tally)),
            });
            let word = word.unwrap_or_default();
            sum += word[0] + word[1] + word[2];
        }
        sum
    }

    #[inline(always)]
    fn cells<C: BitCount>(&self, coords: &[[u32; 3]], count: C, mut tally: impl Tally) {
        let context = self.context(count);
        for &c in coords {
            let (payload, local) = self.brick(c);
            let (index, n) = self.layout.locate(local);
            let words: Option<[Word; 64]> = unit(payload, index).and_then(|unit| match self.stream {
                Stream::New => unit.cell(n, count).map(|cell| context.cell(&cell, &mut tally)),
                Stream::Old => unit.old_cell(n, count).map(|cell| context.cell(&cell, &mut tally)),
            });
            black_box(words.unwrap_or([[0; 3]; 64]));
        }
    }

    fn brick(&self, c: [u32; 3]) -> (&[u8], [u32; 3]) {
        let [x, y, z] = c.map(|v| v / BRICK);
        (&self.payloads[(x + self.bricks * (y + self.bricks * z)) as usize], c.map(|v| v % BRICK))
    }
}

/// Voxel and cell mode of both streams at `percent`, counting by the machine and by the paper's table.
pub fn rows(grid: &Grid, percent: f64, coords: &[[u32; 3]]) {
    let [new, old] = [Stream::New, Stream::Old].map(|stream| Payloads::new(grid, percent, stream));
    let entries = CountTable::entries();
    let table = CountTable::new(&entries);
    for cells in [false, true] {
        let coords = if cells { &coords[..coords.len() / 8] } else { coords };
        macro_rules! run {
            ($of:ident, $count:expr, $tally:expr) => {
                Box::new(|| {
                    if cells {
                        $of.cells(coords, $count, $tally)
                    } else {
                        _ = black_box($of.voxels(coords, $count, $tally))
                    }
                })
            };
        }
        let mut contestants: Vec<Contestant<'_>> = vec![
            ("NEW popcount".into(), run!(new, Popcount, ())),
            ("OLD popcount".into(), run!(old, Popcount, ())),
            ("OLD popcount flags".into(), run!(old, Popcount, Patient)),
            ("NEW table".into(), run!(new, table, ())),
            ("OLD table".into(), run!(old, table, ())),
            ("OLD table flags".into(), run!(old, table, Patient)),
        ];
        let times = interleave(5, &mut contestants);
        let ns = |i: usize| times[i].median.as_secs_f64() * 1e9 / coords.len() as f64;
        let mode = if cells { "cell" } else { "voxel" };
        print!("  paper {percent} % {mode:<5}");
        for (name, at) in [("popcount", 0), ("table", 3)] {
            let [new, old, flags] = [ns(at), ns(at + 1), ns(at + 2)];
            print!(
                " | {name}: NEW {new:.1} ns, OLD {old:.1} ({:.2}×), flag by flag {flags:.1} ({:.2}×)",
                old / new,
                flags / new
            );
        }
        println!();
    }
}
