//! Rows of words and samples for the kernels: bounds are checked once for many rows, not per row.
//!
//! A row of a brick of 64 `u8` voxels is decoded in about five cycles; two bounds checks per row would show.
#![allow(unsafe_code, reason = "rows are cut out of two slices whose bounds were checked for all of them at once")]

use std::marker::PhantomData;

/// Rows in memory: length of each, and distance from one to the next along y and z, in bytes.
#[derive(Clone, Copy)]
pub struct Grid2 {
    /// Bytes of a row.
    pub len: usize,
    /// Bytes from a row to the next one along y and along z.
    pub pitch: [usize; 2],
}

impl Grid2 {
    /// Bytes from the start of the first row to the end of the last one, or `None` where that overflows.
    fn span(&self, count: [usize; 2]) -> Option<usize> {
        let [y, z] = [0, 1].map(|a| count[a].checked_sub(1)?.checked_mul(self.pitch[a]));
        y?.checked_add(z?)?.checked_add(self.len)
    }
}

/// Iterator over rows, y fastest: the words and the samples of each.
pub struct Rows<'a> {
    /// Where the next row lies.
    words: *const u8,
    out: *mut u8,
    words_grid: Grid2,
    out_grid: Grid2,
    /// Rows of this slice, and slices, that are still to come.
    left: [usize; 2],
    per_slice: usize,
    _borrow: PhantomData<(&'a [u8], &'a mut [u8])>,
}

impl<'a> Rows<'a> {
    /// `count` rows along y and z that start with `words` and `out`.
    ///
    /// # Panics
    /// Where a row does not lie inside its slice, or rows of samples overlap.
    #[inline]
    pub fn new(
        (words, words_grid): (&'a [u8], Grid2),
        (out, out_grid): (&'a mut [u8], Grid2),
        count: [usize; 2],
    ) -> Self {
        let inside = |grid: &Grid2, len| grid.span(count).is_some_and(|span| span <= len);
        assert!(inside(&words_grid, words.len()) && inside(&out_grid, out.len()), "rows lie inside their slices");
        let slice_len = (count[0] - 1) * out_grid.pitch[0] + out_grid.len;
        let disjoint =
            (count[0] == 1 || out_grid.pitch[0] >= out_grid.len) && (count[1] == 1 || out_grid.pitch[1] >= slice_len);
        assert!(disjoint, "rows of samples do not overlap");
        Rows {
            words: words.as_ptr(),
            out: out.as_mut_ptr(),
            words_grid,
            out_grid,
            left: [count[0], count[1] - 1],
            per_slice: count[0],
            _borrow: PhantomData,
        }
    }

    /// Bytes of words in a row.
    #[inline]
    pub fn words_len(&self) -> usize {
        self.words_grid.len
    }
}

impl<'a> Iterator for Rows<'a> {
    type Item = (&'a [u8], &'a mut [u8]);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        if self.left[0] == 0 {
            if self.left[1] == 0 {
                return None;
            }
            self.left = [self.per_slice, self.left[1] - 1];
            // From behind the last row of a slice to the first one of the next slice.
            let behind = |grid: &Grid2| grid.pitch[1].wrapping_sub(self.per_slice.wrapping_mul(grid.pitch[0]));
            self.words = self.words.wrapping_add(behind(&self.words_grid));
            self.out = self.out.wrapping_add(behind(&self.out_grid));
        }
        // SAFETY: this is row y of slice z with y < count[0] and z < count[1]: `new` checked that all of them lie inside
        // the borrowed slices and that the rows of samples do not overlap; each is handed out once.
        let row = unsafe {
            (
                std::slice::from_raw_parts(self.words, self.words_grid.len),
                std::slice::from_raw_parts_mut(self.out, self.out_grid.len),
            )
        };
        self.left[0] -= 1;
        self.words = self.words.wrapping_add(self.words_grid.pitch[0]);
        self.out = self.out.wrapping_add(self.out_grid.pitch[0]);
        Some(row)
    }
}
