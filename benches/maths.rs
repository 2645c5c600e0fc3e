//! The parts of layer 1, in nanoseconds: the Haar transform of a cell, counting vectors, making books, nearest words.
//!
//! `cargo bench --bench maths`

mod support;

use std::hint::black_box;
use support::{Contestant, interleave, rounds, synthetic};
use vug::haar::{CELL, forward, forward_components, inverse, quantised};
use vug::quantise::{Histogram, Nearest, Tally, Vector, median_cut, nearest_plain, refine, squared_error};

const EDGE: u32 = 64;

type Colours = [[i32; 3]; CELL];

/// Cells of a synthetic colour volume.
fn cells() -> Vec<Colours> {
    let colour = |c: [u32; 3]| {
        let v = synthetic(EDGE, c);
        let tint = synthetic(EDGE, [c[2], c[0], c[1]]);
        [v, 0.6 * v + 0.4 * tint, v * tint].map(|v| (v * 255.0) as i32)
    };
    let cell = |n: u32| {
        let corner = [n % 16, n / 16 % 16, n / 256];
        std::array::from_fn(|k| {
            let inside = [k & 3, k >> 2 & 3, k >> 4];
            colour(std::array::from_fn(|a| 4 * corner[a] + inside[a] as u32))
        })
    };
    (0..EDGE.pow(3) / 64).map(cell).collect()
}

fn noise(n: usize) -> Vec<Vector> {
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 56) as i32
    };
    (0..n).map(|_| [next(), next(), next()]).collect()
}

fn histogram(vectors: &[Vector]) -> Histogram {
    let mut tally = Tally::new();
    vectors.iter().for_each(|&v| tally.add(v));
    tally.finish()
}

/// Contestants, and how many things each does.
struct Rows<'a>(Vec<(usize, Contestant<'a>)>);

impl<'a> Rows<'a> {
    fn add(&mut self, per: usize, name: String, run: Box<dyn FnMut() + 'a>) {
        self.0.push((per, (name, run)));
    }
}

fn main() {
    let cells = cells();
    let numerators: Vec<Colours> = cells.iter().map(forward_components).collect();
    let grey: Vec<[i32; CELL]> = cells.iter().map(|c| c.map(|v| v[0])).collect();
    let word = |p: usize, n: Vector| n.map(|s| quantised(p, s));
    let averages: Vec<Vector> = numerators.iter().flat_map(|n| (0..8).map(|p| word(p, n[p]))).collect();
    let details: Vec<Vector> = numerators.iter().flat_map(|n| (8..CELL).map(|p| word(p, n[p]))).collect();
    let noise = noise(1 << 15);
    let sets = [("averages", &averages), ("details", &details), ("noise", &noise)];
    let books: Vec<(Vec<Vector>, Histogram)> = sets
        .map(|(_, set)| {
            let all = histogram(set);
            (median_cut(&all, 256), all)
        })
        .into();

    let mut rows = Rows(Vec::new());
    let (cells, grey, numerators) = (&cells, &grey, &numerators);
    rows.add(
        cells.len(),
        "forward RGB, per cell".into(),
        Box::new(move || {
            cells.iter().for_each(|c| {
                black_box(forward_components(black_box(c)));
            });
        }),
    );
    rows.add(
        grey.len(),
        "forward grey, per cell".into(),
        Box::new(move || {
            grey.iter().for_each(|c| {
                black_box(forward(black_box(c)));
            });
        }),
    );
    let flat: Vec<[i32; CELL]> = numerators.iter().map(|c| c.map(|v| v[0])).collect();
    rows.add(
        grey.len(),
        "inverse grey, per cell".into(),
        Box::new(move || {
            flat.iter().for_each(|c| {
                black_box(inverse(black_box(c)));
            });
        }),
    );
    for ((name, set), (book, all)) in sets.into_iter().zip(&books) {
        let n = set.len();
        println!(
            "{name}: {n} vectors, {} distinct, {} words, squared error {} -> {} after 10 rounds",
            all.len(),
            book.len(),
            squared_error(all, book),
            squared_error(all, &refine(all, book, 10))
        );
        let nearest = Nearest::new(book);
        assert!(set.iter().all(|&v| nearest.find(v) == nearest_plain(book, v)));
        rows.add(
            n,
            format!("find {name}, per vector"),
            Box::new(move || {
                set.iter().for_each(|&v| {
                    black_box(nearest.find(black_box(v)));
                });
            }),
        );
        rows.add(
            n.min(4096),
            format!("find {name} plain, per vector"),
            Box::new(move || {
                set.iter().take(4096).for_each(|&v| {
                    black_box(nearest_plain(book, black_box(v)));
                });
            }),
        );
        rows.add(
            n,
            format!("count {name}, per vector"),
            Box::new(move || {
                black_box(histogram(set));
            }),
        );
        rows.add(
            1,
            format!("median cut of {name}"),
            Box::new(move || {
                black_box(median_cut(all, 256));
            }),
        );
        rows.add(
            1,
            format!("prepare the search in {name}"),
            Box::new(move || {
                black_box(Nearest::new(book));
            }),
        );
        rows.add(
            1,
            format!("one round of k-means on {name}"),
            Box::new(move || {
                black_box(refine(all, book, 1));
            }),
        );
    }
    let (per, mut contestants): (Vec<usize>, Vec<Contestant<'_>>) = rows.0.into_iter().unzip();
    let timings = interleave(rounds(64 << 20), &mut contestants);
    for (per, t) in per.into_iter().zip(timings) {
        let ns = |d: std::time::Duration| d.as_nanos() as f64 / per as f64;
        println!("{:<40} median {:>12.1} ns   best {:>12.1} ns", t.name, ns(t.median), ns(t.min));
    }
}
