//! The page of a sweep: error against time, the table, the pictures of the front.

use crate::cli::picture::{Picture, legend, stacked};
use crate::cli::report::{Mark, Piece, Plot, Scale, Series, Table};
use crate::error::Result;
use crate::gpu::key::Sampler;
use crate::metrics::ErrorClass;
use crate::metrics::image::{RgbImage, difference};
use crate::tradeoff::{COLUMNS, Outcome, Row};

/// Most rows of the front whose pictures are on the page; all are in the folder.
const MOST_SHOWN: usize = 12;

/// The sections of a sweep.
pub(super) fn sections(o: &Outcome) -> Result<Vec<(String, Vec<Piece>)>> {
    let mut sections = vec![
        ("Error against time".to_owned(), vec![Piece::Plots(plots(&o.rows))]),
        ("Figures".to_owned(), vec![Piece::Text(TABLE.into()), Piece::Table(table(&o.rows)), left_out(o)]),
        ("Pictures of the Pareto front".to_owned(), pictures(o)?),
        ("Words".to_owned(), vec![Piece::Terms(terms())]),
    ];
    sections.retain(|(_, pieces)| !pieces.is_empty());
    Ok(sections)
}

const TABLE: &str =
    "Rows that stand out are on the Pareto front: nothing else here is both faster and closer to the reference.";

/// One colour for each sampler; `f` is the height of a mark.
fn by_sampler(rows: &[Row], x: impl Fn(&Row) -> f64, y: impl Fn(&Row) -> Option<f64>, front: bool) -> Vec<Series> {
    let of = |sampler: Sampler| Series {
        name: sampler.to_string(),
        joined: false,
        marks: rows
            .iter()
            .filter(|r| r.shot.sampler == sampler)
            .filter_map(|r| {
                let (x, y) = (x(r), y(r)?);
                let title = format!("{}: {:.2} ms, PSNR {:.2} dB", r.name(), r.seconds[0] * 1e3, r.error.psnr);
                Some(Mark { x, y, title, front: front && r.pareto })
            })
            .collect(),
    };
    Sampler::ALL.iter().map(|&s| of(s)).filter(|s| !s.marks.is_empty()).collect()
}

fn plots(rows: &[Row]) -> Vec<Plot> {
    let ms = |r: &Row| r.seconds[0] * 1e3;
    let rmse = |r: &Row| Some(r.error.errors.mse().sqrt());
    let time = || ("median frame time in ms".to_owned(), Scale::Log);
    let plot = |title: &str, x, y: (&str, Scale), series| Plot { title: title.into(), x, y: (y.0.into(), y.1), series };
    let mut plots = vec![
        plot(
            "RMSE of the picture over time",
            time(),
            ("RMSE per channel, of 255", Scale::Log),
            by_sampler(rows, ms, rmse, true),
        ),
        plot(
            "1 − SSIM over time",
            time(),
            ("1 − SSIM", Scale::Log),
            by_sampler(rows, ms, |r| Some(1.0 - r.error.ssim.mean), false),
        ),
        plot("FLIP over time", time(), ("mean FLIP error", Scale::Log), by_sampler(rows, ms, |r| r.flip, false)),
        plot(
            "RMSE of the picture over bits per voxel",
            ("payload bits per voxel".to_owned(), Scale::Log),
            ("RMSE per channel, of 255", Scale::Log),
            by_sampler(rows, |r| r.encoded.bits_per_voxel, rmse, false),
        ),
    ];
    plots.retain(|p| !p.series.is_empty());
    plots
}

/// The figures that people compare; the CSV has all.
fn table(rows: &[Row]) -> Table {
    type Field = fn(&Row) -> String;
    let columns: [(&str, Field); 14] = [
        ("setting", |r| r.name()),
        ("ms", |r| format!("{:.2}", r.seconds[0] * 1e3)),
        ("fps", |r| format!("{:.1}", 1.0 / r.seconds[0])),
        ("fetches_per_sample", |r| r.fetches_per_sample.map_or("–".into(), |v| format!("{v:.2}"))),
        ("ratio_formula", |r| format!("{:.3}", r.encoded.ratio_formula)),
        ("ratio_payload", |r| format!("{:.3}", r.encoded.ratio_payload)),
        ("bits_per_voxel", |r| format!("{:.2}", r.encoded.bits_per_voxel)),
        ("volume_psnr", |r| r.encoded.psnr.map_or("–".into(), |v| format!("{v:.2}"))),
        ("psnr", |r| format!("{:.2}", r.error.psnr)),
        ("psnr_per_pixel", |r| format!("{:.2}", r.error.psnr_per_pixel)),
        ("ssim", |r| format!("{:.5}", r.error.ssim.mean)),
        ("ms_ssim", |r| format!("{:.5}", r.error.ms_ssim.mean)),
        ("flip", |r| r.flip.map_or("–".into(), |v| format!("{v:.4}"))),
        ("pixels_from_15", |r| r.error.classes[ErrorClass::Bad as usize].to_string()),
    ];
    let meaning = |name: &str| match COLUMNS.iter().find(|c| c.name == name) {
        Some(c) => c.meaning.to_owned(),
        None => "frames per second, of the median".to_owned(),
    };
    Table {
        columns: columns.iter().map(|(name, _)| (name.replace('_', " "), meaning(name))).collect(),
        rows: rows.iter().map(|r| (columns.iter().map(|(_, f)| f(r)).collect(), r.pareto)).collect(),
    }
}

fn left_out(o: &Outcome) -> Piece {
    Piece::Terms(o.left_out.iter().map(|(name, why)| (name.clone(), format!("left out: {why}"))).collect())
}

fn pictures(o: &Outcome) -> Result<Vec<Piece>> {
    let mut front: Vec<&Row> = o.rows.iter().filter(|r| r.pareto).collect();
    front.sort_by(|a, b| a.seconds[0].total_cmp(&b.seconds[0]));
    let mut pieces = vec![Piece::Pictures(
        2,
        vec![(
            format!("reference: uncompressed, linear, step {}", o.reference_shot.step),
            Picture::from(o.reference.clone()),
        )],
    )];
    if front.len() > MOST_SHOWN {
        pieces.push(Piece::Text(format!("The {MOST_SHOWN} fastest of {}; the others are in the folder.", front.len())));
    }
    let mut shown = Vec::new();
    for row in front.into_iter().take(MOST_SHOWN) {
        shown.push((caption(row), Picture::from(row.image.clone())));
        shown.push((format!("{}: difference", row.name()), difference_picture(&o.reference, &row.image)?));
    }
    pieces.push(Piece::Pictures(2, shown));
    Ok(pieces)
}

/// A row in one line.
pub(super) fn caption(r: &Row) -> String {
    let (ms, e) = (r.seconds[0] * 1e3, &r.error);
    format!("{}: {ms:.2} ms, PSNR {:.2} dB, SSIM {:.4}", r.name(), e.psnr, e.ssim.mean)
}

/// Where two pictures differ, with the legend below.
pub(super) fn difference_picture(a: &RgbImage, b: &RgbImage) -> Result<Picture> {
    stacked(&[Picture::from(difference(a, b)?), legend(a.width)?], 0, [255; 3])
}

fn terms() -> Vec<(String, String)> {
    COLUMNS.iter().map(|c| (c.name.replace('_', " "), c.meaning.to_owned())).collect()
}
