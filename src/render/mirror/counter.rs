//! What a picture costs, counted.

use serde::Serialize;

/// Takes note of work. [`Free`] does nothing, and the compiler leaves nothing of it.
pub trait Counter: Default + Send {
    /// Does one more of something.
    fn count(&mut self, what: impl FnOnce(&mut Work));
}

/// Counts nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Free;

impl Counter for Free {
    #[inline(always)]
    fn count(&mut self, _: impl FnOnce(&mut Work)) {}
}

/// Work done for a picture by the CPU; a GPU does the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Work {
    /// Rays that met a volume.
    pub rays: u64,
    /// Values sampled, for pictures and gradients.
    pub samples: u64,
    /// Gradients.
    pub gradients: u64,
    /// Index words fetched (s3dc).
    pub index_fetches: u64,
    /// Pairs of end points fetched (s3dc).
    pub minmax_fetches: u64,
    /// Texels of uncompressed textures fetched.
    pub raw_fetches: u64,
    /// Words of streams, tables and codebooks fetched (zerobit).
    pub stream_fetches: u64,
    /// Looks at the table of visible bricks.
    pub brick_fetches: u64,
    /// Values looked up in a transfer function.
    pub lookups: u64,
    /// Samples that were lit.
    pub lit: u64,
    /// Opacities corrected for the length of a step.
    pub corrections: u64,
}

impl Counter for Work {
    #[inline]
    fn count(&mut self, what: impl FnOnce(&mut Work)) {
        what(self);
    }
}

impl Work {
    /// Fetches of voxel data.
    #[must_use]
    pub const fn fetches(&self) -> u64 {
        self.index_fetches + self.minmax_fetches + self.raw_fetches + self.stream_fetches
    }

    /// The work of both.
    #[must_use]
    pub const fn plus(self, o: Work) -> Work {
        Work {
            rays: self.rays + o.rays,
            samples: self.samples + o.samples,
            gradients: self.gradients + o.gradients,
            index_fetches: self.index_fetches + o.index_fetches,
            minmax_fetches: self.minmax_fetches + o.minmax_fetches,
            raw_fetches: self.raw_fetches + o.raw_fetches,
            stream_fetches: self.stream_fetches + o.stream_fetches,
            brick_fetches: self.brick_fetches + o.brick_fetches,
            lookups: self.lookups + o.lookups,
            lit: self.lit + o.lit,
            corrections: self.corrections + o.corrections,
        }
    }
}

impl From<Free> for Work {
    fn from(_: Free) -> Work {
        Work::default()
    }
}
