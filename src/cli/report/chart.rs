//! PSNR over bits per voxel as inline SVG.

use super::Row;
use super::html::escape;
use std::fmt::Write;

const WIDTH: f64 = 660.0;
const HEIGHT: f64 = 400.0;
const LEFT: f64 = 58.0;
const RIGHT: f64 = WIDTH - 24.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = HEIGHT - 52.0;
/// Size of a label's letter, for keeping labels apart.
const LETTER: (f64, f64) = (6.3, 13.0);

/// A linear axis with round numbers at its ticks.
pub(super) struct Axis {
    from: f64,
    step: f64,
    ticks: u32,
}

impl Axis {
    /// Covers `lo..=hi` with four to ten steps.
    pub(super) fn covering(lo: f64, hi: f64) -> Self {
        let span = (hi - lo).max(1e-9);
        let power = 10f64.powf((span / 5.0).log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| span / s <= 7.0).unwrap_or(power * 10.0);
        let from = (lo / step).floor() * step;
        Axis { from, step, ticks: (((hi - from) / step).ceil() as u32).max(1) }
    }

    pub(super) fn to(&self) -> f64 {
        self.from + self.step * f64::from(self.ticks)
    }

    pub(super) fn values(&self) -> impl Iterator<Item = f64> {
        (0..=self.ticks).map(|i| self.from + self.step * f64::from(i))
    }

    /// Position of `v` between the pixels `a` and `b`.
    fn place(&self, v: f64, a: f64, b: f64) -> f64 {
        a + (b - a) * (v - self.from) / (self.to() - self.from)
    }

    pub(super) fn label(&self, v: f64) -> String {
        // As many as the step has: 0.2 has one, 0.05 two.
        let decimals = (-self.step.log10().floor()).clamp(0.0, 9.0) as usize;
        format!("{v:.decimals$}")
    }
}

/// A box that a label or a mark takes up: left, top, right, bottom.
type Taken = [f64; 4];

fn free(b: &Taken, taken: &[Taken]) -> bool {
    let inside = b[0] >= LEFT && b[2] <= WIDTH && b[1] >= TOP - 12.0 && b[3] <= BOTTOM - 2.0;
    inside && taken.iter().all(|t| b[0] >= t[2] || b[2] <= t[0] || b[1] >= t[3] || b[3] <= t[1])
}

/// The chart, or nothing where there are no rows.
pub(super) fn svg(rows: &[Row]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let most = |f: &dyn Fn(&Row) -> f64| rows.iter().map(f).fold(0.0, f64::max);
    let x = Axis::covering(0.0, most(&|r| r.bits_per_voxel));
    let known = || rows.iter().filter_map(|r| r.psnr);
    let (lo, hi) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    let y = if lo <= hi { Axis::covering(lo - 1.0, hi + 1.0) } else { Axis::covering(0.0, 60.0) };
    let mut families: Vec<&str> = Vec::new();
    for row in rows {
        if !families.contains(&row.family.as_str()) {
            families.push(&row.family);
        }
    }

    let mut out = String::new();
    let o = &mut out;
    // Writing to a String cannot fail.
    let _ = writeln!(
        o,
        "<svg class=\"chart\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" \
         aria-label=\"PSNR in decibels over bits per voxel of the file, one mark for each setting\">"
    );
    for v in y.values() {
        let at = y.place(v, BOTTOM, TOP);
        let _ = writeln!(
            o,
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{RIGHT}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
             <text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT - 8.0,
            at + 4.0,
            y.label(v)
        );
    }
    for v in x.values() {
        let at = x.place(v, LEFT, RIGHT);
        let _ = writeln!(
            o,
            "<line class=\"notch\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{BOTTOM}\" y2=\"{:.1}\"/>\
             <text class=\"tick\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            BOTTOM + 5.0,
            BOTTOM + 20.0,
            x.label(v)
        );
    }
    let _ = writeln!(
        o,
        "<line class=\"axis\" x1=\"{LEFT}\" x2=\"{RIGHT}\" y1=\"{BOTTOM}\" y2=\"{BOTTOM}\"/>\
         <text class=\"name\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">file size in bits per voxel</text>\
         <text class=\"name\" x=\"16\" y=\"{:.1}\" text-anchor=\"middle\" transform=\"rotate(-90 16 {:.1})\">PSNR in dB</text>",
        (LEFT + RIGHT) / 2.0,
        BOTTOM + 42.0,
        (TOP + BOTTOM) / 2.0,
        (TOP + BOTTOM) / 2.0
    );

    let place = |r: &Row| {
        let px = x.place(r.bits_per_voxel, LEFT, RIGHT);
        (px, r.psnr.map_or(TOP - 8.0, |db| y.place(db, BOTTOM, TOP)))
    };
    let mut taken: Vec<Taken> = rows.iter().map(place).map(|(x, y)| [x - 6.0, y - 6.0, x + 6.0, y + 6.0]).collect();
    for (i, family) in families.iter().enumerate() {
        let _ = writeln!(o, "<g class=\"f{}\">", i % 4);
        let mut members: Vec<&Row> = rows.iter().filter(|r| r.family == *family).collect();
        members.sort_by(|a, b| a.bits_per_voxel.total_cmp(&b.bits_per_voxel));
        for row in members {
            mark(o, row, place(row), &mut taken);
        }
        let _ = writeln!(o, "</g>");
    }
    out.push_str("</svg>\n<p class=\"key\">");
    for (i, family) in families.iter().enumerate() {
        let _ = write!(out, "<span><i class=\"dot f{}\"></i>{}</span> ", i % 4, escape(family));
    }
    if rows.iter().any(|r| r.psnr.is_none()) {
        out.push_str("<span>▲ no error: infinite PSNR</span>");
    }
    out.push_str("</p>\n");
    out
}

/// One mark with its label, where the label finds room.
fn mark(o: &mut String, row: &Row, (x, y): (f64, f64), taken: &mut Vec<Taken>) {
    let quality = row.psnr.map_or("no error".to_owned(), |db| format!("{db:.2} dB"));
    let title = format!("{}: {:.2} bits per voxel, {quality}", row.name, row.bits_per_voxel);
    let shape = if row.psnr.is_some() {
        format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\">")
    } else {
        format!("<path d=\"M{:.1} {:.1}h12l-6 -11z\">", x - 6.0, y + 5.0)
    };
    let close = if row.psnr.is_some() { "</circle>" } else { "</path>" };
    let _ = writeln!(o, "{shape}<title>{}</title>{close}", escape(&title));
    let width = row.short.chars().count() as f64 * LETTER.0;
    // Right, left, above, below; then further away above and below.
    let places =
        [(9.0, 0.0), (-9.0 - width, 0.0), (-width / 2.0, -15.0), (-width / 2.0, 15.0), (9.0, -12.0), (9.0, 12.0)];
    let boxes = places.map(|(dx, dy)| {
        let (left, middle) = (x + dx, y + dy);
        [left, middle - LETTER.1 / 2.0, left + width, middle + LETTER.1 / 2.0]
    });
    // A label without room is left to the mark's title.
    if let Some(b) = boxes.into_iter().find(|b| free(b, taken)) {
        let _ = writeln!(
            o,
            "<text class=\"label\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            b[0],
            b[3] - 2.5,
            escape(&row.short)
        );
        taken.push(b);
    }
}
