//! Plots of several series as inline SVG: linear or logarithmic axes, joined or single marks, a Pareto front.

use super::chart::Axis;
use super::html::escape;
use std::fmt::Write;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 400.0;
const LEFT: f64 = 66.0;
const RIGHT: f64 = WIDTH - 20.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = HEIGHT - 52.0;
/// How many colours the style sheet has for series.
const COLORS: usize = 8;

/// How numbers lie along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithm, ticks at 1, 2 and 5 times powers of ten.
    Log,
    /// By their logarithm, ticks at powers of two.
    Doubling,
}

/// One mark.
#[derive(Clone, Debug)]
pub(crate) struct Mark {
    pub(crate) x: f64,
    /// Infinite values are drawn at the plot's edge, as are values ≤ 0 on a logarithmic axis.
    pub(crate) y: f64,
    /// What a pointer on the mark shows.
    pub(crate) title: String,
    /// Whether the mark belongs to the Pareto front.
    pub(crate) front: bool,
}

/// Marks of one colour.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) marks: Vec<Mark>,
    /// Whether a line joins the marks in the order of x.
    pub(crate) joined: bool,
}

/// A plot with its axes.
#[derive(Clone, Debug)]
pub(crate) struct Plot {
    /// Above the plot.
    pub(crate) title: String,
    /// Name and scale of the x axis.
    pub(crate) x: (String, Scale),
    /// Name and scale of the y axis.
    pub(crate) y: (String, Scale),
    pub(crate) series: Vec<Series>,
}

/// An axis that knows its ticks and where a value lies between its ends, from 0 to 1.
struct Ruler {
    scale: Scale,
    from: f64,
    to: f64,
    ticks: Vec<(f64, String)>,
}

impl Ruler {
    /// Covers the drawable ones of `values`; a unit interval where there are none.
    fn covering(values: impl Iterator<Item = f64>, scale: Scale) -> Self {
        let drawable = |v: &f64| v.is_finite() && (scale == Scale::Linear || *v > 0.0);
        let (lo, hi) =
            values.filter(drawable).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let (lo, hi) = if lo <= hi { (lo, hi) } else { (1.0, 2.0) };
        match scale {
            Scale::Linear => {
                let room = ((hi - lo) * 0.04).max(hi.abs().max(1e-6) * 1e-3);
                let axis = Axis::covering(lo - room, hi + room);
                let ticks: Vec<_> = axis.values().map(|v| (v, axis.label(v))).collect();
                Ruler { scale, from: axis.values().next().unwrap_or(0.0), to: axis.to(), ticks }
            }
            Scale::Log => {
                let (from, to) = ((lo * 0.9).log10(), (hi * 1.1).log10());
                let many = to - from > 3.0;
                let powers = (from.floor() as i32)..=(to.ceil() as i32);
                let steps: &[f64] = if many { &[1.0] } else { &[1.0, 2.0, 5.0] };
                let ticks = powers.flat_map(|p| steps.iter().map(move |m| m * 10f64.powi(p)));
                let inside = ticks.filter(|v| (from..=to).contains(&v.log10()));
                Ruler { scale, from, to, ticks: inside.map(|v| (v, plain(v))).collect() }
            }
            Scale::Doubling => {
                let (from, to) = (lo.log2() - 0.2, hi.log2() + 0.2);
                let ticks =
                    (from.ceil() as i32..=to.floor() as i32).map(|p| (2f64.powi(p), plain(2f64.powi(p)))).collect();
                Ruler { scale, from, to, ticks }
            }
        }
    }

    /// Where `v` lies, 0 to 1. What cannot be drawn lies at an end.
    fn place(&self, v: f64) -> f64 {
        let v = match self.scale {
            Scale::Linear => v,
            Scale::Log => v.max(0.0).log10(),
            Scale::Doubling => v.max(0.0).log2(),
        };
        ((v - self.from) / (self.to - self.from)).clamp(0.0, 1.0)
    }

    fn drawable(&self, v: f64) -> bool {
        v.is_finite() && (self.scale == Scale::Linear || v > 0.0)
    }
}

/// A tick's number without a tail of zeros.
fn plain(v: f64) -> String {
    if (1e-3..1e6).contains(&v) { format!("{}", (v * 1e6).round() / 1e6) } else { format!("{v:.0e}") }
}

impl Plot {
    /// The plot, with a key where there are several series.
    pub(crate) fn svg(&self) -> String {
        let marks = || self.series.iter().flat_map(|s| &s.marks).filter(|m| m.x.is_finite() && !m.y.is_nan());
        let x = Ruler::covering(marks().map(|m| m.x), self.x.1);
        let y = Ruler::covering(marks().map(|m| m.y), self.y.1);
        let place = |m: &Mark| (LEFT + (RIGHT - LEFT) * x.place(m.x), BOTTOM - (BOTTOM - TOP) * y.place(m.y));
        let mut out = String::new();
        let o = &mut out;
        // Writing to a String cannot fail, hence the ignored results.
        let _ = writeln!(
            o,
            "<figure><svg class=\"chart\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{0}\">\
             <text class=\"title\" x=\"{LEFT}\" y=\"20\">{0}</text>",
            escape(&self.title)
        );
        self.axes(o, &x, &y);
        for (i, series) in self.series.iter().enumerate() {
            let _ = writeln!(o, "<g class=\"f{}\">", i % COLORS);
            let mut shown: Vec<&Mark> = series.marks.iter().filter(|m| m.x.is_finite() && !m.y.is_nan()).collect();
            shown.sort_by(|a, b| a.x.total_cmp(&b.x));
            if series.joined {
                polyline(o, "join", shown.iter().map(|m| place(m)));
            }
            for m in shown {
                mark(o, m, place(m), y.drawable(m.y));
            }
            let _ = writeln!(o, "</g>");
        }
        let mut front: Vec<&Mark> = marks().filter(|m| m.front).collect();
        front.sort_by(|a, b| a.x.total_cmp(&b.x).then(b.y.total_cmp(&a.y)));
        polyline(o, "front", front.iter().map(|m| place(m)));
        out.push_str("</svg>\n<p class=\"key\">");
        for (i, series) in self.series.iter().enumerate() {
            let _ = write!(out, "<span><i class=\"dot f{}\"></i>{}</span> ", i % COLORS, escape(&series.name));
        }
        if !front.is_empty() {
            out.push_str("<span>◯ Pareto front</span> ");
        }
        if marks().any(|m| !y.drawable(m.y)) {
            out.push_str("<span>▲ at the edge: no error</span>");
        }
        out.push_str("</p></figure>\n");
        out
    }

    fn axes(&self, o: &mut String, x: &Ruler, y: &Ruler) {
        for (v, label) in &y.ticks {
            let at = BOTTOM - (BOTTOM - TOP) * y.place(*v);
            let _ = writeln!(
                o,
                "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{RIGHT}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
                 <text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                LEFT - 8.0,
                at + 4.0
            );
        }
        for (v, label) in &x.ticks {
            let at = LEFT + (RIGHT - LEFT) * x.place(*v);
            let _ = writeln!(
                o,
                "<line class=\"notch\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{BOTTOM}\" y2=\"{:.1}\"/>\
                 <text class=\"tick\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                BOTTOM + 5.0,
                BOTTOM + 20.0
            );
        }
        let (across, down) = ((LEFT + RIGHT) / 2.0, (TOP + BOTTOM) / 2.0);
        let _ = writeln!(
            o,
            "<line class=\"axis\" x1=\"{LEFT}\" x2=\"{RIGHT}\" y1=\"{BOTTOM}\" y2=\"{BOTTOM}\"/>\
             <text class=\"name\" x=\"{across:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text class=\"name\" x=\"16\" y=\"{down:.1}\" text-anchor=\"middle\" transform=\"rotate(-90 16 {down:.1})\">{}</text>",
            BOTTOM + 42.0,
            escape(&self.x.0),
            escape(&self.y.0)
        );
    }
}

fn polyline(o: &mut String, class: &str, places: impl Iterator<Item = (f64, f64)>) {
    let points: Vec<String> = places.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    if points.len() > 1 {
        let _ = writeln!(o, "<polyline class=\"{class}\" points=\"{}\"/>", points.join(" "));
    }
}

fn mark(o: &mut String, m: &Mark, (x, y): (f64, f64), drawable: bool) {
    let title = escape(&m.title);
    if drawable {
        let _ = writeln!(o, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4.5\"><title>{title}</title></circle>");
    } else {
        let _ = writeln!(o, "<path d=\"M{:.1} {:.1}h12l-6 -11z\"><title>{title}</title></path>", x - 6.0, y + 5.0);
    }
    if m.front {
        let _ = writeln!(o, "<circle class=\"ring\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"8\"/>");
    }
}
