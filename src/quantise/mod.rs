//! Owns code books: histograms of vectors, books by median cut and k-means, nearest code words (zerobit paper §2.4).
//!
//! Everything is integers and depends on the set of counted vectors alone: not on their order, not on threads.
//!
//! Components are expected within ±2^30, so that squared distances fit 64 bits. Scalars use component 0; the others
//! are 0.

mod histogram;
mod median_cut;
mod nearest;
mod refine;

pub use histogram::{Entry, Histogram, Tally};
pub use median_cut::median_cut;
pub use nearest::{Nearest, nearest_plain};
pub use refine::{refine, squared_error};

/// Most entries of a book: an index is one byte.
pub const MAX_BOOK: usize = 256;

/// A vector of three components, colours in the order R, G, B.
pub type Vector = [i32; 3];

/// Squared Euclidean distance.
#[inline(always)]
#[must_use]
pub fn squared_distance(a: Vector, b: Vector) -> u64 {
    let square = |c: usize| {
        let d = i64::from(a[c]) - i64::from(b[c]);
        (d * d) as u64
    };
    square(0) + square(1) + square(2)
}

/// Puts a book into its order, by sum of squares and then by components, and drops what is there twice.
pub fn sort_book(book: &mut Vec<Vector>) {
    book.sort_unstable_by_key(|&v| (squared_distance(v, [0; 3]), v));
    book.dedup();
}

/// `sum / count` to the nearest whole number per component, halves up; `count` must be above 0.
fn mean(sum: [i128; 3], count: u128) -> Vector {
    let count = count as i128;
    // The mean of i32 is an i32.
    sum.map(|s| (2 * s + count).div_euclid(2 * count) as i32)
}

#[cfg(test)]
mod tests;
