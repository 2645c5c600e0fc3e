//! Books of known contents, ties, huge counts, and the search against brute force.

use super::*;
use proptest::prelude::*;

fn histogram(vectors: &[Vector]) -> Histogram {
    vectors.iter().copied().collect()
}

fn counted(entries: &[(Vector, u64)]) -> Histogram {
    let mut tally = Tally::new();
    entries.iter().for_each(|&(v, n)| tally.add_counted(v, n));
    tally.finish()
}

/// Numbers below `below` from a seed (splitmix).
fn noise(mut seed: u64) -> impl FnMut(u64) -> u64 {
    move |below| {
        seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (seed ^ seed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ z >> 31) % below
    }
}

fn colours(n: usize, seed: u64) -> Vec<Vector> {
    let mut next = noise(seed);
    (0..n).map(|_| std::array::from_fn(|_| next(256) as i32)).collect()
}

fn in_order(book: &[Vector]) -> bool {
    let mut sorted = book.to_vec();
    sort_book(&mut sorted);
    sorted == book
}

#[test]
fn histograms_do_not_depend_on_order() {
    let mut vectors = colours(200_000, 1);
    vectors.iter_mut().step_by(3).for_each(|v| *v = [7, 7, v[2] & 15]);
    let all = histogram(&vectors);
    assert_eq!(all.total(), 200_000);
    assert!(all.entries().is_sorted_by(|a, b| a.vector < b.vector), "ascending and distinct");
    for e in all.entries().iter().step_by(997) {
        assert_eq!(e.count, vectors.iter().filter(|&&v| v == e.vector).count() as u64);
    }
    let parts: Vec<Histogram> = vectors.chunks(30_001).map(histogram).collect();
    assert_eq!(parts.iter().cloned().fold(Histogram::default(), Histogram::merge), all);
    assert_eq!(parts.into_iter().rev().fold(Histogram::default(), Histogram::merge), all);
    vectors.reverse();
    assert_eq!(histogram(&vectors), all);
    assert!(histogram(&[]).is_empty() && counted(&[([1; 3], 0)]).is_empty());
}

// K-43
#[test]
fn few_distinct_colours_are_kept_as_they_are() {
    for n in [0usize, 1, 2, 255, 256] {
        let vectors: Vec<Vector> = (0..n as i32).map(|k| [k * 37 % 256, k, 255 - k]).collect();
        let mut exact = vectors.clone();
        sort_book(&mut exact);
        let book = median_cut(&histogram(&vectors), 256);
        assert_eq!(book, exact, "{n} colours");
        assert_eq!(refine(&histogram(&vectors), &book, 5), exact);
    }
    let vectors: Vec<Vector> = (0..257).map(|k| [k, 0, 0]).collect();
    let book = median_cut(&histogram(&vectors), 256);
    assert_eq!(book.len(), 256);
    // The one box of two, 0 and 1 or others, stands for both: the mean with halves up.
    assert_eq!(squared_error(&histogram(&vectors), &book), 1);
    assert_eq!(median_cut(&histogram(&vectors), 0), [[0; 3]; 0]);
    assert_eq!(median_cut(&histogram(&vectors), 1), [[128, 0, 0]]);
}

// K-44
#[test]
fn equal_samples_make_one_word() {
    let all = histogram(&vec![[12, -7, 90]; 300_000]);
    assert_eq!((all.len(), all.total()), (1, 300_000));
    assert_eq!(median_cut(&all, 256), [[12, -7, 90]]);
    assert_eq!(refine(&all, &[[0; 3]; 256], 3), [[12, -7, 90]]);
}

// K-45: sums far beyond 32 bits; means of negatives round halves up as well.
#[test]
fn huge_populations() {
    let n = 1 << 40;
    let all = counted(&[([65_535, -32_768, -1], n), ([65_534, -32_767, -2], n), ([0, 0, 0], 1)]);
    assert_eq!(all.total(), 2 * n + 1);
    assert_eq!(median_cut(&all, 1), [[65_534, -32_767, -1]]);
    assert_eq!(median_cut(&all, 2), [[65_534, -32_767, -2], [65_535, -32_768, -1]]);
    assert_eq!(median_cut(&counted(&[([-1, 1, -3], n), ([-2, 2, -4], n)]), 1), [[-1, 2, -3]]);
    let most = counted(&[([5, 0, 0], u64::MAX), ([5, 0, 0], 9), ([9, 0, 0], u64::MAX)]);
    assert_eq!((most.total(), most.entries()[0].count), (u64::MAX, u64::MAX));
    assert_eq!(median_cut(&most, 1), [[7, 0, 0]]);
    assert_eq!(refine(&most, &[[7, 0, 0]], 4), [[7, 0, 0]]);
}

#[test]
fn cuts_follow_the_rules() {
    // The longest axis is y: cut where half the population is reached, behind the second of the three.
    let all = counted(&[([0, 0, 0], 2), ([1, 10, 0], 3), ([2, 30, 0], 5)]);
    assert_eq!(median_cut(&all, 2), [[1, 6, 0], [2, 30, 0]]);
    // Equal sides: axis 0 first. Equal boxes: the earlier one first.
    let corners: Vec<Vector> = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|b| b * 10)).collect();
    assert_eq!(median_cut(&histogram(&corners), 2), [[0, 5, 5], [10, 5, 5]]);
    assert_eq!(median_cut(&histogram(&corners), 3), [[0, 0, 5], [0, 10, 5], [10, 5, 5]]);
    // A heavy last vector leaves the other half non-empty.
    assert_eq!(median_cut(&counted(&[([0; 3], 1), ([1; 3], 1), ([2; 3], 99)]), 2), [[1, 1, 1], [2, 2, 2]]);
    // Words that become equal are one.
    let near = counted(&[([0, 0, 0], 1), ([1, 0, 0], 9), ([1, 1, 0], 9), ([1, 1, 1], 9), ([0, 1, 0], 1)]);
    assert!(in_order(&median_cut(&near, 3)));
}

#[test]
fn order_of_a_book() {
    let mut book = vec![[3, 0, 0], [0, 0, 3], [-3, 0, 0], [0, 0, 0], [3, 0, 0], [1, 1, 1]];
    sort_book(&mut book);
    assert_eq!(book, [[0, 0, 0], [1, 1, 1], [-3, 0, 0], [0, 0, 3], [3, 0, 0]]);
}

#[test]
fn refining_lessens_the_error() {
    let mut next = noise(5);
    let clusters = colours(40, 3);
    let spread = |c: Vector, next: &mut dyn FnMut(u64) -> u64| c.map(|v| v + next(9) as i32 - 4);
    let vectors: Vec<Vector> = (0..60_000).map(|k| spread(clusters[k % 40], &mut next)).collect();
    let all = histogram(&vectors);
    let cut = median_cut(&all, 40);
    let mut last = squared_error(&all, &cut);
    for rounds in 1..6 {
        let book = refine(&all, &cut, rounds);
        let error = squared_error(&all, &book);
        assert!(error <= last && in_order(&book) && book.len() <= 40);
        last = error;
    }
    assert!(last < squared_error(&all, &cut), "a round gains something here");
    assert_eq!(refine(&all, &cut, 0), cut);
}

#[test]
fn words_without_vectors_move_to_the_worst() {
    let all = counted(&[([0, 0, 0], 100), ([50, 0, 0], 4), ([90, 0, 0], 1)]);
    // Everything is nearest to the first word: 50² · 4 is more than 90² · 1.
    assert_eq!(refine(&all, &[[0, 0, 0], [500, 0, 0]], 1), [[3, 0, 0], [50, 0, 0]]);
    // A word that is there twice is one more to place.
    assert_eq!(refine(&all, &[[0; 3]; 3], 9), [[0, 0, 0], [50, 0, 0], [90, 0, 0]]);
    assert_eq!(refine(&all, &[], 3), [[0; 3]; 0]);
    assert_eq!(squared_error(&all, &[]), 0);
}

#[test]
fn ties_go_to_the_lowest_index() {
    let cases: [(&[Vector], Vector, u8); 6] = [
        (&[[10, 0, 0], [0, 0, 0]], [5, 0, 0], 0),
        (&[[0, 0, 0], [10, 0, 0]], [5, 0, 0], 0),
        (&[[-3, 0, 0], [0, 0, 0]], [-2, 0, 0], 0),
        (&[[1, 1, 1], [1, 1, 1]], [9, 9, 9], 0),
        (&[[0, 0, 9], [0, 9, 0], [9, 0, 0]], [0, 0, 0], 0),
        (&[], [1, 2, 3], 0),
    ];
    for (book, v, want) in cases {
        assert_eq!(nearest_plain(book, v), want, "{book:?}");
        assert_eq!(Nearest::new(book).find(v), want, "{book:?}");
    }
    // Many words equally near to the centre.
    let ball: Vec<Vector> = (0..1331)
        .map(|k| [k % 11 - 5, k / 11 % 11 - 5, k / 121 - 5])
        .filter(|&v| squared_distance(v, [0; 3]) == 41 || squared_distance(v, [0; 3]) == 38)
        .map(|v| v.map(|c| 100 * c))
        .collect();
    let nearest = Nearest::new(&ball);
    for v in (-300..=300).step_by(25).flat_map(|x| [[x, 0, 0], [x, x, 0], [x, -x, x], [0, x, 1]]) {
        assert_eq!(nearest.find(v), nearest_plain(&ball, v), "{v:?}");
    }
}

#[test]
fn far_words_and_far_vectors_are_found() {
    let far = 1 << 30;
    for book in [vec![[far, -far, 0], [-far, far, 1], [0, 0, far]], vec![[1, 2, 3], [1, 2, 4]], vec![[far, 0, 0]]] {
        let nearest = Nearest::new(&book);
        for v in [[0; 3], [far; 3], [-far; 3], [far, 0, -far], [-far, far, 0]] {
            assert_eq!(nearest.find(v), nearest_plain(&book, v), "{book:?} {v:?}");
        }
    }
    // Words behind the 256th do not count.
    let mut long = colours(256, 9);
    long.push([1000; 3]);
    assert_eq!(Nearest::new(&long).find([1000; 3]), nearest_plain(&long[..256], [1000; 3]));
}

/// A component: bytes, details, or 16 bits, in clusters or not.
fn vectors(most: usize) -> impl Strategy<Value = Vec<Vector>> {
    let component = || prop_oneof![4 => 0i32..256, 4 => -128i32..128, 2 => -4i32..5, 1 => -32_768i32..65_536];
    let one = prop_oneof![
        5 => [component(), component(), component()],
        1 => component().prop_map(|v| [v, 0, 0]),
        1 => (-4i32..5, -4i32..5).prop_map(|(a, b)| [128 + a, 128 + b, 128]),
    ];
    let mixed = proptest::collection::vec(one, 1..most);
    let scalars = proptest::collection::vec(component().prop_map(|v| [v, 0, 0]), 1..most);
    let tight = proptest::collection::vec([-6i32..7, -6..7, -6..7], 1..most);
    prop_oneof![3 => mixed, 1 => scalars, 1 => tight]
}

proptest! {
    #[test]
    fn the_search_equals_brute_force(book in vectors(257), asked in vectors(400)) {
        let nearest = Nearest::new(&book);
        for v in asked.into_iter().chain(book.iter().copied()) {
            prop_assert_eq!(nearest.find(v), nearest_plain(&book, v));
        }
        // Points half way between words are where ties are.
        for pair in book.windows(2) {
            let v = std::array::from_fn(|c| (pair[0][c] + pair[1][c]) / 2);
            prop_assert_eq!(nearest.find(v), nearest_plain(&book, v));
        }
    }

    #[test]
    fn books_depend_on_the_counts_alone(mut vectors in vectors(600), most in 1usize..40, seed: u64) {
        let all = histogram(&vectors);
        let book = median_cut(&all, most);
        prop_assert!(book.len() <= most && in_order(&book));
        let better = refine(&all, &book, 4);
        prop_assert!(better.len() <= most && in_order(&better));
        prop_assert!(squared_error(&all, &better) <= squared_error(&all, &book));
        let plain: u128 = vectors
            .iter()
            .map(|&v| u128::from(squared_distance(v, book[usize::from(nearest_plain(&book, v))])))
            .sum();
        prop_assert_eq!(squared_error(&all, &book), plain);

        let mut next = noise(seed);
        (1..vectors.len()).for_each(|k| vectors.swap(k, next(k as u64 + 1) as usize));
        let cut = next(vectors.len() as u64 + 1) as usize;
        let other = histogram(&vectors[cut..]).merge(histogram(&vectors[..cut]));
        prop_assert_eq!(&other, &all);
        prop_assert_eq!(median_cut(&other, most), book.clone());
        prop_assert_eq!(refine(&other, &book, 4), better);
    }
}

#[test] // memory follows what is allowed, not what is counted, and the order of counting does not show
fn a_tally_keeps_within_its_bound() {
    let vectors: Vec<Vector> = (0..50_000i32).map(|i| [i * 7 % 613 - 300, i * 31 % 257 - 128, i % 97]).collect();
    let tally = |vectors: &mut dyn Iterator<Item = &Vector>, most| {
        let mut tally = Tally::within(most);
        vectors.for_each(|v| tally.add(*v));
        tally.finish()
    };
    let all = tally(&mut vectors.iter(), usize::MAX);
    assert!(all.len() > 40_000);
    for most in [1, 10, 1000, 30_000] {
        let few = tally(&mut vectors.iter(), most);
        assert!(few.len() <= most.max(8), "{} for {most}", few.len());
        assert_eq!(few.total(), all.total());
        assert_eq!(few, tally(&mut vectors.iter().rev(), most), "the order shows");
        // The middle of what was dropped stands for it.
        let mean = |h: &Histogram| h.entries().iter().map(|e| f64::from(e.vector[0]) * e.count as f64).sum::<f64>();
        let off = (mean(&few) - mean(&all)).abs() / all.total() as f64;
        assert!(most < 1000 || off < 20.0, "{off} for {most}");
    }
    assert_eq!(tally(&mut vectors.iter(), all.len()), all, "as many as there are: nothing is dropped");
}
