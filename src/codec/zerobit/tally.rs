//! Counting what decoding costs, in the paper's units (Bajaj et al. 2001, Fig. 7 and 8).

/// How a coefficient was decoded: the cases of the paper's Fig. 7, and the two before a cell is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Case {
    /// Case 1: the unit block is void.
    Void,
    /// Case 2: the cell is null.
    NullCell,
    /// Case 3a: the average.
    Average,
    /// Case 3b: the node is null.
    NullNode,
    /// Case 3c: the coefficient is null.
    NullDetail,
    /// Case 3d: a stored detail.
    Detail,
}

/// Takes notes while a plain decoder runs. `()` takes none and costs nothing.
pub trait Tally {
    /// Whether notes are wanted. Without them a decoder need not look at coefficients that are known to be null.
    const COUNTS: bool = true;
    /// A coefficient was decoded, or a void unit block or null cell met.
    fn case(&mut self, case: Case);
    /// An addition or subtraction of two vectors was carried out.
    fn vector_op(&mut self);
}

impl Tally for () {
    const COUNTS: bool = false;
    #[inline(always)]
    fn case(&mut self, _: Case) {}
    #[inline(always)]
    fn vector_op(&mut self) {}
}

/// Counts of everything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// By [`Case`].
    pub cases: [u64; 6],
    /// Additions and subtractions of vectors.
    pub vector_ops: u64,
}

impl Counts {
    /// Times that this case was met.
    #[must_use]
    pub fn of(&self, case: Case) -> u64 {
        self.cases[case as usize]
    }

    /// Coefficients that were decoded, null ones included: cases 3a to 3d.
    #[must_use]
    pub fn decodes(&self) -> u64 {
        self.cases[Case::Average as usize..].iter().sum()
    }
}

impl Tally for Counts {
    fn case(&mut self, case: Case) {
        self.cases[case as usize] += 1;
    }
    fn vector_op(&mut self) {
        self.vector_ops += 1;
    }
}
