//! Table 1 of S3Dc (2008): its settings, its printed figures, and its layout filled with rows of a sweep.
//!
//! Only the ratios can be asserted: they follow from the extent and the bits. Times, PSNR and SSIM belong to a volume, a
//! transfer function and a card that are not at hand; tables name the data that they were made with.

use super::{Outcome, Row, Setting, Sweep};
use crate::error::Result;
use crate::geometry::Extent;
use crate::gpu::key::Sampler;
use std::fmt::Write;

/// Extent of the paper's volume, of 16 bits per sample.
pub const EXTENT: Extent = Extent::new(512, 512, 486);

/// Edges of the paper's picture, in pixels.
pub const PICTURE: [u32; 2] = [768, 768];

/// A row as printed. Frame rates in Hz, PSNR in dB, SSIM in per cent; nearest, then linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// Bits per index.
    pub index_bits: u8,
    /// Edge of the blocks.
    pub block: u32,
    /// Compression ratio.
    pub ratio: f64,
    /// Frames per second.
    pub frame_rate: [f64; 2],
    /// PSNR in dB.
    pub psnr: [f64; 2],
    /// SSIM in per cent.
    pub ssim: [f64; 2],
}

const fn printed(index_bits: u8, block: u32, ratio: f64, rates: [f64; 2], psnr: [f64; 2], ssim: [f64; 2]) -> Printed {
    Printed { index_bits, block, ratio, frame_rate: rates, psnr, ssim }
}

/// Table 1.
pub const TABLE_1: [Printed; 14] = [
    printed(2, 2, 2.667, [16.095, 4.57], [38.76, 40.9], [95.75, 97.88]),
    printed(2, 4, 6.395, [16.65, 4.57], [34.95, 34.23], [95.44, 96.44]),
    printed(2, 8, 7.757, [16.53, 4.85], [31.52, 30.27], [95.42, 95.76]),
    printed(2, 16, 7.968, [16.30, 5.05], [29.18, 28.30], [94.86, 95.04]),
    printed(2, 32, 7.996, [16.07, 5.01], [28.32, 27.49], [94.77, 94.82]),
    printed(2, 64, 7.999, [15.73, 4.66], [28.20, 27.31], [94.79, 94.83]),
    printed(2, 128, 8.000, [14.91, 4.12], [28.21, 27.33], [94.72, 94.79]),
    printed(4, 2, 2.000, [16.07, 4.41], [39.48, 46.19], [96.13, 99.25]),
    printed(4, 4, 3.554, [16.52, 4.38], [39.61, 44.08], [96.34, 99.11]),
    printed(4, 8, 3.938, [16.44, 4.72], [39.48, 41.04], [96.36, 98.92]),
    printed(4, 16, 3.992, [16.15, 4.87], [38.62, 38.77], [96.33, 98.68]),
    printed(4, 32, 3.999, [15.90, 4.77], [37.77, 37.32], [96.30, 98.51]),
    printed(4, 64, 4.000, [15.60, 4.49], [37.30, 36.67], [96.21, 98.36]),
    printed(4, 128, 4.000, [15.03, 3.95], [36.93, 36.35], [96.10, 98.22]),
];

/// Samplers of the table: the paper's two, and the one it describes in words.
pub const SAMPLERS: [Sampler; 3] = [Sampler::Nearest, Sampler::Linear, Sampler::LinearOpt];

/// The table's sweep at one step, which is the reference's as well: what is left is the error of the codec and the sampler.
///
/// # Errors
/// None that can happen; the settings are checked like any others.
pub fn sweep_of_table_1(step: f64) -> Result<Sweep> {
    let settings = TABLE_1.iter().map(|p| Setting::s3dc(p.index_bits, p.block)).collect::<Result<_>>()?;
    Ok(Sweep { settings, samplers: SAMPLERS.to_vec(), steps: vec![step], reference_step: step })
}

/// A row of the table: what was printed and what was found.
#[derive(Clone, Copy, Debug)]
pub struct TableRow<'a> {
    /// The printed figures.
    pub printed: Printed,
    /// Nearest, linear, optimised linear, where they could be pictured.
    pub found: [Option<&'a Row>; 3],
}

impl TableRow<'_> {
    /// The ratio of this volume by the paper's formula.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        self.found.iter().flatten().next().map(|r| r.encoded.ratio_formula)
    }
}

/// The table of a sweep.
#[must_use]
pub fn table_1(outcome: &Outcome) -> Vec<TableRow<'_>> {
    let of = |p: &Printed, sampler| {
        outcome.rows.iter().find(|r| {
            let s = &r.encoded.setting;
            (s.index_bits(), s.block(), r.shot.sampler) == (Some(p.index_bits), Some(p.block), sampler)
        })
    };
    TABLE_1.iter().map(|p| TableRow { printed: *p, found: SAMPLERS.map(|s| of(p, s)) }).collect()
}

/// The table as CSV. `data` names the volume in every line, so that no line can be taken for the paper's.
#[must_use]
pub fn csv(table: &[TableRow<'_>], data: &str) -> String {
    let mut out = String::from("data,index_bits,block,ratio,ratio_printed");
    for sampler in SAMPLERS {
        for name in ["ms", "fps", "psnr", "psnr_per_pixel", "ssim_percent", "ms_ssim", "flip"] {
            // Writing to a String cannot fail.
            let _ = write!(out, ",{sampler}_{name}");
        }
    }
    for sampler in &SAMPLERS[..2] {
        let _ = write!(out, ",{sampler}_fps_printed,{sampler}_psnr_printed,{sampler}_ssim_percent_printed");
    }
    out.push_str("\r\n");
    let text = |v: Option<f64>, decimals: usize| v.map_or(String::new(), |v| format!("{v:.decimals$}"));
    let data = super::Cell::Text(data.to_owned()).csv();
    for row in table {
        let p = &row.printed;
        let _ = write!(out, "{data},{},{},{},{:.3}", p.index_bits, p.block, text(row.ratio(), 3), p.ratio);
        for found in row.found {
            let of = |f: fn(&Row) -> f64| found.map(f);
            let cells = [
                text(of(|r| r.seconds[0] * 1e3), 3),
                text(of(|r| 1.0 / r.seconds[0]), 3),
                text(of(|r| r.error.psnr), 2),
                text(of(|r| r.error.psnr_per_pixel), 2),
                text(of(|r| r.error.ssim.mean * 100.0), 2),
                text(of(|r| r.error.ms_ssim.mean), 5),
                text(found.and_then(|r| r.flip), 5),
            ];
            let _ = write!(out, ",{}", cells.join(","));
        }
        for k in 0..2 {
            let _ = write!(out, ",{},{},{}", p.frame_rate[k], p.psnr[k], p.ssim[k]);
        }
        out.push_str("\r\n");
    }
    out
}
