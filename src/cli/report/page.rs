//! Pages put together from pieces: text, plots, tables, pictures.

use super::html::{close, commands, escape, image, open};
use super::plot::Plot;
use crate::cli::picture::Picture;
use crate::error::Result;
use std::fmt::Write;

/// A page: heading, facts, sections.
pub(crate) struct Page {
    /// Heading of the page.
    pub(crate) title: String,
    /// What kind of data this is, shown as a badge.
    pub(crate) label: String,
    /// A few sentences under the heading.
    pub(crate) intro: String,
    /// Name and value.
    pub(crate) facts: Vec<(String, String)>,
    /// Headings and what follows them.
    pub(crate) sections: Vec<(String, Vec<Piece>)>,
}

/// A part of a section.
pub(crate) enum Piece {
    /// A paragraph.
    Text(String),
    /// Plots, two in a row.
    Plots(Vec<Plot>),
    /// Figures.
    Table(Table),
    /// Pictures with captions, so many in a row.
    Pictures(u32, Vec<(String, Picture)>),
    /// Words and what they mean.
    Terms(Vec<(String, String)>),
    /// Command lines.
    Commands(Vec<String>),
}

/// A table; its first column names the row.
pub(crate) struct Table {
    /// Name of a column, and what a pointer on it shows.
    pub(crate) columns: Vec<(String, String)>,
    /// Fields, and whether the row is set off.
    pub(crate) rows: Vec<(Vec<String>, bool)>,
}

impl Page {
    /// The page as HTML: everything inside one file, no scripts, nothing fetched.
    ///
    /// # Errors
    /// Those of [`Picture::to_png`].
    pub(crate) fn to_html(&self) -> Result<String> {
        let mut o = String::new();
        open(&mut o, &self.title, &self.label, &self.intro, "");
        if self.sections.len() > 1 {
            o.push_str("<p class=\"jump\">");
            for (k, (name, _)) in self.sections.iter().enumerate() {
                let _ = write!(o, "<a href=\"#part{k}\">{}</a> ", escape(name));
            }
            o.push_str("</p>\n");
        }
        o.push_str("<dl class=\"facts\">");
        for (name, value) in &self.facts {
            let _ = write!(o, "<div><dt>{}</dt><dd>{}</dd></div>", escape(name), escape(value));
        }
        o.push_str("</dl>\n</header>\n<main>\n");
        for (k, (name, pieces)) in self.sections.iter().enumerate() {
            section(&mut o, &format!("part{k}"), name, pieces)?;
        }
        close(&mut o);
        Ok(o)
    }
}

/// A heading and what follows it.
pub(super) fn section(o: &mut String, id: &str, name: &str, pieces: &[Piece]) -> Result<()> {
    let _ = writeln!(o, "<section id=\"{id}\">\n<h2>{}</h2>", escape(name));
    pieces.iter().try_for_each(|p| p.write(o))?;
    o.push_str("</section>\n");
    Ok(())
}

impl Piece {
    fn write(&self, o: &mut String) -> Result<()> {
        match self {
            Piece::Text(text) => {
                let _ = writeln!(o, "<p class=\"intro\">{}</p>", escape(text));
            }
            Piece::Plots(plots) => {
                o.push_str("<div class=\"plots\">\n");
                plots.iter().for_each(|p| o.push_str(&p.svg()));
                o.push_str("</div>\n");
            }
            Piece::Table(table) => table.write(o),
            Piece::Pictures(columns, pictures) => {
                let _ = writeln!(o, "<div class=\"shots\" style=\"--columns:{columns}\">");
                for (caption, picture) in pictures {
                    let img = image(picture, caption)?;
                    let _ = writeln!(o, "<figure>{img}<figcaption>{}</figcaption></figure>", escape(caption));
                }
                o.push_str("</div>\n");
            }
            Piece::Terms(terms) => {
                o.push_str("<div class=\"notes\"><dl>\n");
                for (term, text) in terms {
                    let _ = writeln!(o, "<dt>{}</dt><dd>{}</dd>", escape(term), escape(text));
                }
                o.push_str("</dl></div>\n");
            }
            Piece::Commands(lines) => commands(o, lines),
        }
        Ok(())
    }
}

impl Table {
    fn write(&self, o: &mut String) {
        o.push_str("<div class=\"scroll\"><table>\n<thead><tr>");
        for (k, (name, meaning)) in self.columns.iter().enumerate() {
            let class = if k == 0 { " class=\"left\"" } else { "" };
            let _ = write!(o, "<th{class} title=\"{}\">{}</th>", escape(meaning), escape(name));
        }
        o.push_str("</tr></thead>\n<tbody>\n");
        for (fields, marked) in &self.rows {
            let _ = write!(o, "<tr{}>", if *marked { " class=\"marked\"" } else { "" });
            for (k, field) in fields.iter().enumerate() {
                let (tag, scope) = if k == 0 { ("th", " scope=\"row\"") } else { ("td", "") };
                let _ = write!(o, "<{tag}{scope}>{}</{tag}>", escape(field));
            }
            o.push_str("</tr>\n");
        }
        o.push_str("</tbody></table></div>\n");
    }
}
