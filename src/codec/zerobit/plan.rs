//! What an encoder has decided before it meets a brick: thresholds and codebook (spec chapter 14, §12).

use super::book::Book;
use crate::quantise::Nearest;
use std::sync::Arc;

/// Which coefficients of a level are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Of every unit block its share: as many of its largest coefficients as `budget` times its part of `nonzero`.
    Share {
        /// Coefficients to keep in the whole level.
        budget: u64,
        /// Coefficients of the whole level that are not 0.
        nonzero: u64,
    },
    /// Those whose norm is at least this.
    Least(u64),
}

/// Everything that encoding a brick needs besides its samples.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Index of the codebook in the file.
    pub book: u32,
    /// Search trees over its words.
    pub coder: Arc<Coder>,
    /// Which coefficients are kept.
    pub cut: Cut,
}

impl PartialEq for Plan {
    /// Plans with the same codebook number have the same codebook.
    fn eq(&self, other: &Plan) -> bool {
        self.book == other.book && self.cut == other.cut
    }
}

/// Finds the words of a codebook.
#[derive(Debug)]
pub struct Coder {
    pub(super) average: Nearest,
    pub(super) detail: Nearest,
}

impl Coder {
    /// Search trees over the words of `book`.
    #[must_use]
    pub fn new(book: &Book) -> Self {
        let (average, detail) = rayon::join(|| Nearest::new(book.averages()), || Nearest::new(book.details()));
        Coder { average, detail }
    }
}
