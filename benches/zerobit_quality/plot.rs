//! PSNR over bits per voxel as a picture of its own: one line per volume, its name at its end.

use crate::{KEEP, Results};
use std::fmt::Write;

const SIZE: (f64, f64) = (760.0, 460.0);
/// Left, top, right, bottom of the field.
const FIELD: [f64; 4] = [56.0, 16.0, 590.0, 410.0];
/// Distinct for most eyes, also in grey.
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#a8497d", "#7a5c00", "#444444"];

/// Round numbers from below `lo` to above `hi`.
fn ticks(lo: f64, hi: f64) -> Vec<f64> {
    let power = 10f64.powf(((hi - lo) / 6.0).log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| (hi - lo) / s <= 8.0).unwrap_or(hi - lo);
    let (first, last) = ((lo / step).floor() as i64, (hi / step).ceil() as i64);
    (first..=last).map(|i| i as f64 * step).collect()
}

pub fn svg(results: &[Results]) -> String {
    let points = || results.iter().flat_map(|r| &r.points).filter(|p| p.psnr.is_finite());
    let most = points().map(|p| p.bits_per_voxel()).fold(0.0, f64::max);
    let (lo, hi) = points().fold((f64::INFINITY, 0.0f64), |(lo, hi), p| (lo.min(p.psnr), hi.max(p.psnr)));
    let (xs, ys) = (ticks(0.0, most), ticks(lo, hi));
    let [left, top, right, bottom] = FIELD;
    let place = |v: f64, t: &[f64], a: f64, b: f64| a + (b - a) * (v - t[0]) / (t[t.len() - 1] - t[0]);
    let x = |v: f64| place(v, &xs, left, right);
    let y = |v: f64| place(v, &ys, bottom, top);

    let mut out = String::new();
    let o = &mut out;
    // Writing to a String cannot fail.
    let (width, height) = SIZE;
    let _ = writeln!(
        o,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>"
    );
    for &v in &ys {
        let at = y(v);
        let _ = writeln!(
            o,
            "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#555\">{v}</text>",
            left - 8.0,
            at + 4.5
        );
    }
    for &v in &xs {
        let _ = writeln!(
            o,
            "<path d=\"M{0:.1} {bottom}v5\" stroke=\"#555\"/><text x=\"{0:.1}\" y=\"{1}\" text-anchor=\"middle\" fill=\"#555\">{2:.1}</text>",
            x(v),
            bottom + 20.0,
            v
        );
    }
    let _ = writeln!(
        o,
        "<path d=\"M{left} {bottom}H{right}\" stroke=\"#555\"/>\n\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">bits per voxel, codebooks counted, before zstd</text>\n\
         <text transform=\"translate(16 {}) rotate(-90)\" text-anchor=\"middle\">PSNR in dB</text>",
        (left + right) / 2.0,
        bottom + 42.0,
        (top + bottom) / 2.0
    );
    let mut ends = Vec::new();
    for (r, colour) in results.iter().zip(COLOURS.iter().cycle()) {
        let known: Vec<_> = KEEP.iter().zip(&r.points).filter(|(_, p)| p.psnr.is_finite()).collect();
        let at: Vec<_> = known.iter().map(|(_, p)| (x(p.bits_per_voxel()), y(p.psnr))).collect();
        let Some(&(end_x, end_y)) = at.last() else { continue };
        let path: Vec<String> = at.iter().map(|(x, y)| format!("{x:.1} {y:.1}")).collect();
        let _ = writeln!(o, "<path d=\"M{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>", path.join("L"));
        for ((keep, p), (px, py)) in known.iter().zip(&at) {
            let _ = writeln!(
                o,
                "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"3.5\" fill=\"{colour}\"><title>{}, λ = {keep} %: {:.2} dB, {:.3} bits per \
                 voxel</title></circle>",
                r.case.title,
                p.psnr,
                p.bits_per_voxel()
            );
        }
        ends.push((end_x, end_y, r.case.title, colour));
    }
    // Names on the right, in the order of their lines' ends, a line of text apart.
    ends.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut free = top;
    for (px, py, title, colour) in ends {
        let at = py.max(free);
        free = at + 17.0;
        let _ = writeln!(
            o,
            "<path d=\"M{:.1} {py:.1}L{} {at:.1}\" stroke=\"{colour}\" stroke-width=\"0.8\" stroke-dasharray=\"2 3\"/>\
             <text x=\"{}\" y=\"{:.1}\" fill=\"{colour}\">{title}</text>",
            px + 5.0,
            right + 12.0,
            right + 16.0,
            at + 4.5
        );
    }
    out.push_str("</svg>\n");
    out
}
