//! Table 1 of the S3Dc paper as a section of the page, with its figures 5, 9, 10, 11 and the panels of 12 and 13.

use super::page::{caption, difference_picture};
use crate::cli::picture::Picture;
use crate::cli::report::{Mark, Piece, Plot, Scale, Series, Table};
use crate::codec::s3dc::{Endpoints, Params, formula_ratio};
use crate::error::Result;
use crate::geometry::Extent;
use crate::tradeoff::paper::{SAMPLERS, TABLE_1, TableRow, table_1};
use crate::tradeoff::{Outcome, Row};
use std::fmt::Write;

/// Bits per index of the lines of Fig. 5.
const FIGURE_5_BITS: [u8; 4] = [1, 2, 4, 8];
/// Block edges of the table and the figures.
const BLOCKS: [u32; 7] = [2, 4, 8, 16, 32, 64, 128];

/// Everything of the paper that can be made of one volume. `data` says which.
pub(super) fn pieces(o: &Outcome, extent: Extent, sample_bits: u32, data: &str) -> Result<Vec<Piece>> {
    let table = table_1(o);
    let printed = "Times, PSNR and SSIM depend on volume, transfer function, camera and card; the paper's are not at hand. The columns \
                   in brackets are the paper's printed figures, for orientation only. PSNR is that of the MSE per pixel, as the paper words it.";
    Ok(vec![
        Piece::Text(format!("Data: {data}. {printed}")),
        Piece::Table(figures(&table)),
        Piece::Plots(vec![
            figure_5(extent, sample_bits),
            by_block("Fig. 9: frame rate", "frames per second", &table, 3, |r| 1.0 / r.seconds[0]),
            // The optimised sampler makes the same picture as the plain one.
            by_block("Fig. 10: SSIM", "SSIM in %", &table, 2, |r| r.error.ssim.mean * 100.0),
            by_block("Fig. 11: PSNR", "PSNR in dB (MSE per pixel)", &table, 2, |r| r.error.psnr_per_pixel),
        ]),
        Piece::Text("Fig. 12: uncompressed, 4 bits with 16³, 2 bits with 2³ and with 64³, and how they differ.".into()),
        Piece::Pictures(2, figure_12(o, &table)?),
        Piece::Text("Fig. 13: 4 bits with 16³, nearest and linear, and how they differ.".into()),
        Piece::Pictures(2, figure_13(o, &table)?),
    ])
}

fn figures(table: &[TableRow<'_>]) -> Table {
    let mut columns: Vec<(String, String)> = vec![
        ("index bits, block".into(), "setting of s3dc".into()),
        ("ratio".into(), "of this volume, by the paper's formula".into()),
        ("(ratio)".into(), "as printed, for 512×512×486 samples of 16 bits".into()),
    ];
    type Field = fn(&Row) -> String;
    let of: [(&str, Field); 4] = [
        ("ms", |r| format!("{:.2}", r.seconds[0] * 1e3)),
        ("fps", |r| format!("{:.2}", 1.0 / r.seconds[0])),
        ("PSNR", |r| format!("{:.2}", r.error.psnr_per_pixel)),
        ("SSIM %", |r| format!("{:.2}", r.error.ssim.mean * 100.0)),
    ];
    for sampler in SAMPLERS {
        columns.extend(of.iter().map(|(name, _)| (format!("{sampler} {name}"), "median time; PSNR in dB".to_owned())));
    }
    for sampler in &SAMPLERS[..2] {
        columns.extend(["fps", "PSNR", "SSIM %"].map(|name| (format!("({sampler} {name})"), "as printed".to_owned())));
    }
    let row = |t: &TableRow<'_>| {
        let p = &t.printed;
        let mut fields = vec![format!("{} bit, {}³", p.index_bits, p.block)];
        fields.push(t.ratio().map_or("–".into(), |v| format!("{v:.3}")));
        fields.push(format!("({:.3})", p.ratio));
        for found in t.found {
            fields.extend(of.iter().map(|(_, f)| found.map_or("–".into(), f)));
        }
        for k in 0..2 {
            fields.extend([p.frame_rate[k], p.psnr[k], p.ssim[k]].map(|v| format!("({v:.2})")));
        }
        (fields, (p.index_bits, p.block) == (4, 16))
    };
    Table { columns, rows: table.iter().map(row).collect() }
}

/// Ratio over block edge, one line for each number of index bits.
fn figure_5(extent: Extent, sample_bits: u32) -> Plot {
    let series = FIGURE_5_BITS.map(|bits| Series {
        name: format!("{bits} bit"),
        joined: true,
        marks: ratios(extent, sample_bits, bits)
            .map(|(b, y)| Mark { x: f64::from(b), y, title: format!("{bits} bit, {b}³: {y:.3}"), front: false })
            .collect(),
    });
    Plot {
        title: format!("Fig. 5: compression ratio, {sample_bits} bits per sample"),
        x: block_axis(),
        y: ("compression ratio".into(), Scale::Linear),
        series: series.into(),
    }
}

fn ratios(extent: Extent, sample_bits: u32, bits: u8) -> impl Iterator<Item = (u32, f64)> {
    BLOCKS.into_iter().filter_map(move |b| {
        let params = Params::new(bits, Extent::cube(b), Endpoints::MinMax).ok()?;
        Some((b, formula_ratio(extent, sample_bits, &params)))
    })
}

/// Fig. 5 as CSV.
pub(super) fn figure_5_csv(extent: Extent, sample_bits: u32) -> String {
    let mut out = String::from("index_bits,block,ratio\r\n");
    for bits in FIGURE_5_BITS {
        for (block, ratio) in ratios(extent, sample_bits, bits) {
            let _ = write!(out, "{bits},{block},{ratio:.6}\r\n"); // writing to a String cannot fail
        }
    }
    out
}

fn block_axis() -> (String, Scale) {
    ("edge of a block in voxels".into(), Scale::Doubling)
}

/// A figure of rows over block edge, one line for each number of bits and each of the first samplers.
fn by_block(title: &str, y: &str, table: &[TableRow<'_>], samplers: usize, value: fn(&Row) -> f64) -> Plot {
    let mut series = Vec::new();
    for bits in [2, 4] {
        for (k, sampler) in SAMPLERS[..samplers].iter().enumerate() {
            let rows = table.iter().filter(|t| t.printed.index_bits == bits);
            let marks: Vec<Mark> = rows
                .filter_map(|t| {
                    let y = value(t.found[k]?);
                    let title = format!("{bits} bit, {}³, {sampler}: {y:.3}", t.printed.block);
                    Some(Mark { x: f64::from(t.printed.block), y, title, front: false })
                })
                .collect();
            if !marks.is_empty() {
                series.push(Series { name: format!("{bits} bit, {sampler}"), marks, joined: true });
            }
        }
    }
    Plot { title: title.into(), x: block_axis(), y: (y.into(), Scale::Linear), series }
}

/// Row of the table with this setting, sampled nearest (0) or linearly (1).
fn found<'a>(table: &[TableRow<'a>], bits: u8, block: u32, sampler: usize) -> Option<&'a Row> {
    let at = TABLE_1.iter().position(|p| (p.index_bits, p.block) == (bits, block))?;
    table.get(at)?.found[sampler]
}

/// Panels of Fig. 12, and the differences of its three settings.
fn figure_12(o: &Outcome, table: &[TableRow<'_>]) -> Result<Vec<(String, Picture)>> {
    let settings = [(4, 16), (2, 2), (2, 64)];
    let rows: Vec<&Row> = settings.iter().filter_map(|&(i, b)| found(table, i, b, 1)).collect();
    let mut out = vec![("uncompressed, linear".to_owned(), Picture::from(o.reference.clone()))];
    out.extend(rows.iter().map(|r| (caption(r), Picture::from(r.image.clone()))));
    for r in rows {
        out.push((format!("{}: difference", r.name()), difference_picture(&o.reference, &r.image)?));
    }
    Ok(out)
}

/// Panels of Fig. 13: the best setting overall with both samplers, and their differences below.
fn figure_13(o: &Outcome, table: &[TableRow<'_>]) -> Result<Vec<(String, Picture)>> {
    let rows: Vec<&Row> = [0, 1].into_iter().filter_map(|s| found(table, 4, 16, s)).collect();
    let mut out: Vec<_> = rows.iter().map(|r| (caption(r), Picture::from(r.image.clone()))).collect();
    for r in rows {
        out.push((format!("{}: difference", r.name()), difference_picture(&o.reference, &r.image)?));
    }
    Ok(out)
}
