//! The page's HTML.

use super::{Part, Report, Row, base64, chart};
use crate::cli::picture::Picture;
use crate::error::Result;
use crate::metrics::ErrorClass;
use std::fmt::Write;

const STYLE: &str = include_str!("style.css");

/// Text with the letters replaced that HTML gives a meaning to.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

/// A picture as an address that holds it.
fn data_url(picture: &Picture) -> Result<String> {
    Ok(format!("data:image/png;base64,{}", base64::encode(&picture.to_png()?)))
}

pub(super) fn image(picture: &Picture, alt: &str) -> Result<String> {
    let (w, h) = picture.size();
    Ok(format!("<img width=\"{w}\" height=\"{h}\" alt=\"{}\" src=\"{}\">", escape(alt), data_url(picture)?))
}

/// The page down to the heading's sentences; `css` is added to the style sheet. Writing to a String cannot fail, hence
/// the ignored results here and below.
pub(super) fn open(o: &mut String, title: &str, label: &str, intro: &str, css: &str) {
    let title = escape(title);
    let _ = write!(
        o,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{title}</title>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">\n\
         <style>\n{STYLE}{css}"
    );
    for class in ErrorClass::ALL {
        let [r, g, b] = class.color();
        let _ = writeln!(o, ".c{}{{background:rgb({r},{g},{b})}}", class as usize);
    }
    let _ = write!(
        o,
        "</style>\n</head>\n<body>\n<header>\n<h1>{title} <span class=\"badge\">{}</span></h1>\n<p class=\"intro\">{}</p>\n",
        escape(label),
        escape(intro)
    );
}

/// The page's end.
pub(super) fn close(o: &mut String) {
    let _ = writeln!(
        o,
        "</main>\n<footer>Made by vug {}. This page is one file and fetches nothing.</footer>\n</body>\n</html>",
        env!("CARGO_PKG_VERSION")
    );
}

/// The whole page.
pub(super) fn page(report: &Report) -> Result<String> {
    let mut o = String::new();
    // Originals appear once for every setting, but are stored once: as backgrounds.
    let mut css = String::new();
    for (k, part) in report.parts.iter().enumerate() {
        for (v, (_, picture)) in part.views.iter().enumerate() {
            let _ = writeln!(css, ".o{k}-{v}{{background-image:url({})}}", data_url(picture)?);
        }
    }
    open(&mut o, &report.title, &report.label, &report.intro, &css);
    if report.parts.len() > 1 {
        o.push_str("<p class=\"jump\">");
        for (k, part) in report.parts.iter().enumerate() {
            let _ = write!(o, "<a href=\"#part{k}\">{}</a> ", escape(&part.name));
        }
        #[cfg(feature = "gpu")]
        for (k, (name, _)) in report.sections.iter().enumerate() {
            let _ = write!(o, "<a href=\"#section{k}\">{}</a> ", escape(name));
        }
        o.push_str("</p>\n");
    }
    o.push_str("</header>\n<main>\n");
    for (k, part) in report.parts.iter().enumerate() {
        one_part(&mut o, part, k)?;
    }
    #[cfg(feature = "gpu")]
    for (k, (name, pieces)) in report.sections.iter().enumerate() {
        super::page::section(&mut o, &format!("section{k}"), name, pieces)?;
    }
    o.push_str("<section id=\"commands\">\n<h2>Again, by hand</h2>\n");
    commands(&mut o, &report.commands);
    o.push_str("</section>\n");
    close(&mut o);
    Ok(o)
}

/// A volume: what it is, its figures, its pictures. Part `k` of the page.
fn one_part(o: &mut String, part: &Part, k: usize) -> Result<()> {
    let name = escape(&part.name);
    let _ = writeln!(o, "<section id=\"part{k}\">\n<h2>{name}</h2>\n<p class=\"intro\">{}</p>", escape(&part.intro));
    o.push_str("<dl class=\"facts\">");
    for (name, value) in &part.facts {
        let _ = write!(o, "<div><dt>{}</dt><dd>{}</dd></div>", escape(name), escape(value));
    }
    o.push_str("</dl>\n</section>\n");
    gallery(o, part)?;
    let _ = writeln!(o, "<section id=\"figures{k}\">\n<h2>{name}: what it costs</h2>");
    table(o, part, k);
    o.push_str("<div class=\"two\"><figure>\n");
    o.push_str(&chart::svg(&part.rows));
    o.push_str("</figure>\n");
    explain(o, part);
    let _ = write!(
        o,
        "</div>\n</section>\n<section id=\"pictures{k}\">\n<h2>{name}: what it looks like</h2>\n\
         <p>Original, decoded and error, voxel by voxel. Rest the pointer on a decoded picture to blink to the original.</p>\n\
         <label class=\"switch\"><input type=\"checkbox\" class=\"large\"> large pictures</label>\n",
    );
    for (i, row) in part.rows.iter().enumerate() {
        setting(o, part, (k, i), row)?;
    }
    o.push_str("</section>\n");
    Ok(())
}

fn gallery(o: &mut String, part: &Part) -> Result<()> {
    if part.gallery.is_empty() {
        return Ok(());
    }
    o.push_str("<section class=\"gallery\">\n");
    for (caption, picture) in &part.gallery {
        let img = image(picture, &format!("original, {caption}"))?;
        let _ = writeln!(o, "<figure>{img}<figcaption>{}</figcaption></figure>", escape(caption));
    }
    o.push_str("</section>\n");
    Ok(())
}

/// The table of figures.
fn table(o: &mut String, part: &Part, k: usize) {
    o.push_str(
        "<div class=\"scroll\"><table>\n<thead><tr><th rowspan=\"2\">setting</th><th colspan=\"3\">ratio</th>\
         <th rowspan=\"2\">bits / voxel</th><th colspan=\"2\">max error</th><th rowspan=\"2\">RMSE</th>\
         <th rowspan=\"2\">PSNR<br>dB</th><th rowspan=\"2\">SSIM</th><th colspan=\"2\">time in ms</th></tr>\n\
         <tr><th>formula</th><th>payload</th><th>file</th><th>value</th><th>% of range</th><th>encode</th><th>decode</th></tr>\
         </thead>\n<tbody>\n",
    );
    for (i, r) in part.rows.iter().enumerate() {
        let formula = r.ratio_formula.map_or("–".to_owned(), |v| format!("{v:.2}"));
        let psnr = r.psnr.map_or("∞".to_owned(), |v| format!("{v:.2}"));
        let cells = [
            formula,
            format!("{:.2}", r.ratio_payload),
            format!("<b>{:.2}</b>", r.ratio_file),
            format!("{:.2}", r.bits_per_voxel),
            amount(r.max_error),
            format!("{:.2}", percent(r)),
            amount(r.rmse),
            format!("<b>{psnr}</b>"),
            similarity(r.ssim),
            format!("{:.0}", r.encode_s * 1e3),
            format!("{:.0}", r.decode_s * 1e3),
        ];
        let cells: String = cells.iter().map(|c| format!("<td>{c}</td>")).collect();
        let _ = writeln!(o, "<tr><th scope=\"row\"><a href=\"#s{k}-{i}\">{}</a></th>{cells}</tr>", escape(&r.name));
    }
    o.push_str("</tbody></table></div>\n");
}

/// What the columns and colours mean.
fn explain(o: &mut String, part: &Part) {
    o.push_str(
        "<div class=\"notes\"><dl>\n\
         <dt>ratio</dt><dd>bytes of the original over: the bytes that the codec's formula promises; the stored bricks before \
         zstd; the file with everything in it</dd>\n\
         <dt>PSNR</dt><dd>20 log<sub>10</sub>(range / RMSE); the range is the original's maximum minus its minimum</dd>\n\
         <dt>SSIM</dt><dd>structural similarity, mean over all z slices; 1 is equal</dd>\n\
         <dt>time</dt><dd>wall time on this machine, whole volume, once, with files</dd>\n",
    );
    for (term, text) in &part.terms {
        let _ = writeln!(o, "<dt>{}</dt><dd>{}</dd>", escape(term), escape(text));
    }
    o.push_str("</dl>\n<p>Error of a voxel, as a part of the range:</p>\n<ul class=\"legend\">");
    for class in ErrorClass::ALL {
        let _ = write!(o, "<li><i class=\"c{}\"></i>{}</li>", class as usize, class.label());
    }
    o.push_str("</ul></div>\n");
}

/// One setting: figures, pictures, shares of the error classes, command lines.
fn setting(o: &mut String, part: &Part, (k, i): (usize, usize), r: &Row) -> Result<()> {
    let psnr = r.psnr.map_or("no error".to_owned(), |v| format!("{v:.2} dB"));
    let _ = writeln!(
        o,
        "<article id=\"s{k}-{i}\">\n<h3>{}</h3>\n<p class=\"sum\"><b>{psnr}</b> at <b>{:.2} bits</b> per voxel, {:.2} : 1 · \
         largest error {} ({:.2} % of the range) · SSIM {}</p>",
        escape(&r.name),
        r.bits_per_voxel,
        r.ratio_file,
        amount(r.max_error),
        percent(r),
        similarity(r.ssim)
    );
    o.push_str("<div class=\"panels\">\n");
    for (v, ((caption, original), (decoded, difference))) in part.views.iter().zip(&r.pictures).enumerate() {
        let (w, h) = original.size();
        let caption = escape(caption);
        let _ = writeln!(
            o,
            "<figure><div class=\"px o{k}-{v}\" style=\"aspect-ratio:{w}/{h}\" role=\"img\" aria-label=\"original, {caption}\"></div>\
             <figcaption>{caption}: original</figcaption></figure>\n\
             <figure><div class=\"px o{k}-{v} blink\" style=\"aspect-ratio:{w}/{h}\">{}</div><figcaption>decoded</figcaption></figure>\n\
             <figure><div class=\"px\">{}</div><figcaption>error</figcaption></figure>",
            image(decoded, &format!("decoded, {caption}"))?,
            image(difference, &format!("error in classes, {caption}"))?
        );
    }
    o.push_str("</div>\n");
    shares(o, &r.classes);
    commands(o, &r.commands);
    o.push_str("</article>\n");
    Ok(())
}

/// Shares of the error classes as one bar and in words.
fn shares(o: &mut String, classes: &[u64; 5]) {
    let total = classes.iter().sum::<u64>().max(1) as f64;
    let parts = || ErrorClass::ALL.into_iter().zip(classes).filter(|(_, n)| **n > 0);
    o.push_str("<div class=\"bar\" aria-hidden=\"true\">");
    for (class, &n) in parts() {
        let _ = write!(o, "<i class=\"c{}\" style=\"flex:{:.6}\"></i>", class as usize, n as f64 / total);
    }
    o.push_str("</div>\n<ul class=\"legend\">");
    for (class, &n) in parts() {
        let share = 100.0 * n as f64 / total;
        // A class that is there is never shown as 0 %.
        let share = if share < 0.01 { format!("{n} voxels") } else { format!("{share:.2} %") };
        let _ = write!(o, "<li><i class=\"c{}\"></i>{} <b>{share}</b></li>", class as usize, class.label());
    }
    o.push_str("</ul>\n");
}

pub(super) fn commands(o: &mut String, lines: &[String]) {
    if !lines.is_empty() {
        let _ = writeln!(o, "<pre><code>{}</code></pre>", escape(&lines.join("\n")));
    }
}

fn percent(r: &Row) -> f64 {
    if r.max_error == 0.0 { 0.0 } else { 100.0 * r.max_error / r.range }
}

/// SSIM to four digits; what is not equal is not shown as 1.
fn similarity(v: f64) -> String {
    if v < 1.0 && v > 0.99995 { "&gt; 0.9999".into() } else { format!("{v:.4}") }
}

/// A number in sample units: whole where it is, else four digits.
fn amount(v: f64) -> String {
    if v == v.round() && v.abs() < 1e9 {
        return format!("{v:.0}");
    }
    let decimals = (3 - v.abs().log10().floor() as i32).clamp(0, 3) as usize;
    if v.abs() < 1e-3 { format!("{v:.2e}") } else { format!("{v:.decimals$}") }
}
