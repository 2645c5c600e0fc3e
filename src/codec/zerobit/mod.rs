//! Codec `zerobit`: Haar wavelets on cells of 4³ voxels, vector-quantised, in streams with random access (Bajaj, Ihm,
//! Park 2001: *3D RGB image compression for interactive applications*; spec chapter 14).
//!
//! A brick is cut into unit blocks of 16³ voxels, those into 64 cells. A payload is
//! `prefix | directory | unit blocks`, a unit block `CBFT | offsets | averages | ZSMS | DIS`:
//!
//! | part | holds |
//! |---|---|
//! | prefix | index of the codebook, number of unit blocks |
//! | directory | per unit block: NNNC, and where it starts; 0 where all its cells are null |
//! | CBFT | which of the 64 cells are stored |
//! | offsets, averages | per stored cell: where its parts of DIS and ZSMS start, its average's index (the paper's CIA) |
//! | ZSMS | per stored cell: which of its nine nodes have details, and per such node which of seven |
//! | DIS | indices of details |

pub mod bits;
mod book;
mod decode;
mod inverse;
mod layout;
mod params;
mod tally;

pub use book::{Book, MAX_WORDS, Word};
pub use decode::{Coefficients, Context};
pub use layout::{CELL_EDGE, Cell, Layout, OldCell, UNIT_CELLS, UNIT_EDGE, Unit, unit};
pub use params::{KEEP_ALL, Norm, Params, Stream, Threshold, Training};
pub use tally::{Case, Counts, Tally};

/// Number of the codec in the codec table.
pub const ID: u16 = 3;
