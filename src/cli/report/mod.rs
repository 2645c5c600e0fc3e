//! One self-contained page of numbers and pictures: everything inside one file, no scripts, nothing fetched.

mod base64;
mod chart;
mod html;
#[cfg(feature = "gpu")]
mod page;
#[cfg(feature = "gpu")]
mod plot;
#[cfg(test)]
mod tests;

#[cfg(feature = "gpu")]
pub(crate) use page::{Page, Piece, Table};
#[cfg(feature = "gpu")]
pub(crate) use plot::{Mark, Plot, Scale, Series};

use crate::cli::picture::Picture;
use crate::error::Result;

/// What the page shows, from top to bottom.
pub(crate) struct Report {
    /// Heading of the page.
    pub(crate) title: String,
    /// What kind of data this is, shown as a badge: "synthetic phantom".
    pub(crate) label: String,
    /// A few sentences under the heading.
    pub(crate) intro: String,
    /// The volumes.
    pub(crate) parts: Vec<Part>,
    /// Headings and what follows them, after the volumes.
    #[cfg(feature = "gpu")]
    pub(crate) sections: Vec<(String, Vec<Piece>)>,
    /// Command lines that make what all rows share, and the page itself.
    pub(crate) commands: Vec<String>,
}

/// One volume, and what became of it.
pub(crate) struct Part {
    /// A word for headings: "Grey".
    pub(crate) name: String,
    /// A few sentences.
    pub(crate) intro: String,
    /// Name and value: extent, type, range, machine.
    pub(crate) facts: Vec<(String, String)>,
    /// Pictures of the original at the top, with captions.
    pub(crate) gallery: Vec<(String, Picture)>,
    /// The planes (or parts of them) that every row shows decoded: captions and originals.
    pub(crate) views: Vec<(String, Picture)>,
    /// Words of this part's settings, and what they mean.
    pub(crate) terms: Vec<(String, String)>,
    /// One for each setting.
    pub(crate) rows: Vec<Row>,
}

/// One setting of the encoder, and what came of it.
pub(crate) struct Row {
    /// The setting in full: `s3dc, 4 bits, block 4×4×4, minmax`.
    pub(crate) name: String,
    /// The setting in a few letters, for the chart: `4 bit, 4³`.
    pub(crate) short: String,
    /// Rows of one family share a colour in the chart: `s3dc minmax`.
    pub(crate) family: String,
    /// Original bytes / bytes by the formula of the codec's paper, where it has one.
    pub(crate) ratio_formula: Option<f64>,
    /// Original bytes / payload bytes before zstd.
    pub(crate) ratio_payload: f64,
    /// Original bytes / bytes of the file.
    pub(crate) ratio_file: f64,
    /// Bits of the file per voxel.
    pub(crate) bits_per_voxel: f64,
    /// Largest absolute error.
    pub(crate) max_error: f64,
    /// Range of the original, the 100 % of every percentage and the peak of PSNR.
    pub(crate) range: f64,
    /// Root mean squared error.
    pub(crate) rmse: f64,
    /// In dB; `None` where there is no error.
    pub(crate) psnr: Option<f64>,
    /// Mean SSIM of the z slices.
    pub(crate) ssim: f64,
    /// Wall time in seconds.
    pub(crate) encode_s: f64,
    /// Wall time in seconds.
    pub(crate) decode_s: f64,
    /// Voxels of the whole volume per [`crate::metrics::ErrorClass`].
    pub(crate) classes: [u64; 5],
    /// For every one of the part's views: decoded, and the difference in classes.
    pub(crate) pictures: Vec<(Picture, Picture)>,
    /// Command lines to reproduce the row.
    pub(crate) commands: Vec<String>,
}

impl Report {
    /// The page.
    ///
    /// # Errors
    /// Those of [`Picture::to_png`].
    pub(crate) fn to_html(&self) -> Result<String> {
        html::page(self)
    }
}
