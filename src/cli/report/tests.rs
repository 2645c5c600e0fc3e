//! Tests of the page: complete, self-contained, and whole in the odd cases.

use super::*;

fn picture(v: u8) -> Picture {
    Picture::filled(4, 3, [v; 3]).unwrap()
}

fn row(name: &str, bits_per_voxel: f64, psnr: Option<f64>) -> Row {
    Row {
        name: name.into(),
        short: name.into(),
        family: "s3dc <minmax>".into(),
        ratio_formula: Some(6.4),
        ratio_payload: 6.41,
        ratio_file: 9.876,
        bits_per_voxel,
        max_error: 20.475,
        range: 4095.0,
        rmse: 0.03125,
        psnr,
        ssim: 0.999_99,
        encode_s: 0.0125,
        decode_s: 0.0031,
        classes: [9_999_990, 9, 1, 0, 0],
        pictures: vec![(picture(2), picture(3))],
        commands: vec!["vug encode a.nrrd b.vug && vug verify b.vug".into()],
    }
}

fn report(rows: Vec<Row>) -> Report {
    Report {
        title: "A <title> & more".into(),
        label: "synthetic phantom".into(),
        intro: "Nobody's \"head\".".into(),
        parts: vec![Part {
            name: "Grey & plain".into(),
            intro: "A <part>.".into(),
            facts: vec![("size".into(), "1 B".into())],
            gallery: vec![("axial".into(), picture(1))],
            views: vec![("z = 1".into(), picture(1))],
            terms: vec![("kept".into(), "how <many>".into())],
            rows,
        }],
        #[cfg(feature = "gpu")]
        sections: Vec::new(),
        commands: vec!["vug demo".into()],
    }
}

#[test]
fn everything_is_on_the_page_and_nothing_is_fetched() {
    let html = report(vec![row("two bits", 1.625, Some(40.0)), row("eight bits", 5.0, Some(71.5))]).to_html().unwrap();
    for part in [
        "A &lt;title&gt; &amp; more",
        "synthetic phantom",
        "Nobody's &quot;head&quot;.",
        "<td>6.40</td><td>6.41</td><td><b>9.88</b></td><td>1.62</td><td>20.48</td><td>0.50</td><td>0.031</td>",
        "<td><b>40.00</b></td><td>&gt; 0.9999</td><td>12</td><td>3</td>",
        "below 5 % <b>9 voxels</b>",
        "vug encode a.nrrd b.vug &amp;&amp; vug verify b.vug",
        "s3dc &lt;minmax&gt;",
        "two bits: 1.62 bits per voxel, 40.00 dB",
        "PSNR in dB",
        "<h2>Grey &amp; plain: what it costs</h2>",
        "A &lt;part&gt;.",
        "<dt>kept</dt><dd>how &lt;many&gt;</dd>",
    ] {
        assert!(html.contains(part), "{part} is missing");
    }
    // One picture in the gallery, one shared original, two pictures for each row.
    assert_eq!(html.matches("data:image/png;base64,").count(), 1 + 1 + 2 * 2);
    for outside in ["http:", "https:", "src=\"//", "<script", "@import", "<link"] {
        assert!(!html.contains(outside), "{outside}");
    }
}

#[test]
fn odd_rows() {
    let mut flat = row("flat", 0.0, None);
    (flat.range, flat.max_error, flat.rmse, flat.ssim) = (0.0, 0.0, 0.0, 1.0);
    flat.ratio_formula = None;
    flat.classes = [0; 5];
    for rows in [vec![], vec![row("only", 2.0, Some(30.0))], vec![flat]] {
        let n = rows.len();
        let html = report(rows).to_html().unwrap();
        assert!(!html.contains("NaN") && !html.contains("inf<"), "no number is undefined");
        assert_eq!(html.matches("<article").count(), n);
    }
}

#[test]
fn the_parts_of_a_page_do_not_share_names() {
    let mut both = report(vec![row("a", 1.0, Some(30.0))]);
    both.parts.append(&mut report(vec![row("b", 2.0, Some(40.0))]).parts);
    let html = both.to_html().unwrap();
    let ids: Vec<&str> = html.match_indices(" id=\"").map(|(at, m)| &html[at + m.len()..]).collect();
    let mut ids: Vec<&str> = ids.into_iter().filter_map(|s| s.split('"').next()).collect();
    let all = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), all, "{ids:?}");
    assert_eq!(html.matches("background-image").count(), 2);
    assert!(html.contains("href=\"#s1-0\"") && html.contains("px o1-0"));
}

#[test]
fn marks_lie_inside_the_chart_and_labels_do_not_cover_each_other() {
    let rows: Vec<Row> =
        (0..12).map(|i| row("4 bit, 16³", 2.0 + f64::from(i) * 0.01, Some(40.0 + f64::from(i)))).collect();
    let svg = chart::svg(&rows);
    let number = |text: &str, key: &str| -> Option<f64> {
        let rest = &text[text.find(key)? + key.len()..];
        rest[..rest.find('"')?].parse().ok()
    };
    let marks: Vec<&str> = svg.lines().filter(|l| l.starts_with("<circle")).collect();
    assert_eq!(marks.len(), 12);
    for mark in marks {
        let (x, y) = (number(mark, "cx=\"").unwrap(), number(mark, "cy=\"").unwrap());
        assert!((50.0..650.0).contains(&x) && (30.0..360.0).contains(&y), "{mark}");
    }
    let labels: Vec<(f64, f64)> = svg
        .lines()
        .filter(|l| l.starts_with("<text class=\"label\""))
        .map(|l| (number(l, " x=\"").unwrap(), number(l, " y=\"").unwrap()))
        .collect();
    assert!(labels.len() >= 6, "{labels:?}");
    for (i, a) in labels.iter().enumerate() {
        assert!(labels[..i].iter().all(|b| (a.0 - b.0).abs() > 60.0 || (a.1 - b.1).abs() > 12.0), "{labels:?}");
    }
}

#[test] // the vectors of RFC 4648
fn base64_vectors() {
    for (plain, coded) in
        [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("foobar", "Zm9vYmFy")]
    {
        assert_eq!(base64::encode(plain.as_bytes()), coded);
    }
    assert_eq!(base64::encode(&[0xFB, 0xEF, 0xFF]), "++//");
}

#[cfg(feature = "gpu")]
mod of_pieces {
    use super::super::{Mark, Page, Piece, Plot, Scale, Series, Table};
    use super::picture;

    fn plot(scale: Scale, ys: &[f64]) -> Plot {
        let mark = |(i, &y): (usize, &f64)| Mark { x: 2f64.powi(i as i32), y, title: format!("<m{i}>"), front: i < 2 };
        let marks = ys.iter().enumerate().map(mark).collect();
        let series = vec![Series { name: "near & far".into(), marks, joined: true }];
        Plot { title: "a < b".into(), x: ("edge".into(), Scale::Doubling), y: ("dB".into(), scale), series }
    }

    #[test]
    fn marks_lie_in_the_plot_whatever_their_values() {
        let cases: [&[f64]; 6] =
            [&[1.0, 2.0, 3.0], &[0.0, 1e-3, 1e5], &[f64::INFINITY, 30.0], &[5.0], &[f64::NAN, 1.0], &[]];
        for scale in [Scale::Linear, Scale::Log] {
            for ys in cases {
                let svg = plot(scale, ys).svg();
                let shown = ys.iter().filter(|y| !y.is_nan()).count();
                assert_eq!(svg.matches("<title>").count(), shown, "{ys:?}");
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{ys:?} {svg}");
                for part in svg.split("cy=\"").skip(1) {
                    let y: f64 = part[..part.find('"').unwrap()].parse().unwrap();
                    assert!((40.0..=348.0).contains(&y), "{y}");
                }
                assert!(svg.contains("a &lt; b") && svg.contains("near &amp; far"));
                assert_eq!(svg.contains("Pareto front"), ys.iter().take(2).any(|y| !y.is_nan()));
            }
        }
        assert!(plot(Scale::Linear, &[f64::INFINITY, 30.0]).svg().contains("at the edge"));
        // A logarithm's order is kept: larger values are higher up.
        let svg = plot(Scale::Log, &[1.0, 10.0, 100.0]).svg();
        let heights: Vec<f64> = svg
            .split("r=\"4.5\"")
            .map(|p| p.rsplit("cy=\"").next().unwrap())
            .take(3)
            .map(|p| p[..p.find('"').unwrap()].parse().unwrap())
            .collect();
        assert!(heights[0] > heights[1] && heights[1] > heights[2], "{heights:?}");
        assert!(((heights[0] - heights[1]) - (heights[1] - heights[2])).abs() < 0.11, "{heights:?}");
    }

    #[test]
    fn a_page_of_pieces_is_whole_and_fetches_nothing() {
        let table = Table {
            columns: vec![("setting".into(), "what".into()), ("ms".into(), "time & more".into())],
            rows: vec![(vec!["4 bit <16³>".into(), "1.5".into()], true), (vec!["raw".into(), "9".into()], false)],
        };
        let page = Page {
            title: "T & t".into(),
            label: "phantom".into(),
            intro: "i".into(),
            facts: vec![("size".into(), "1 B".into())],
            sections: vec![
                ("One".into(), vec![Piece::Text("x < y".into()), Piece::Plots(vec![plot(Scale::Linear, &[1.0])])]),
                ("Two".into(), vec![Piece::Table(table), Piece::Pictures(2, vec![("c".into(), picture(3))])]),
                (
                    "Three".into(),
                    vec![Piece::Terms(vec![("w".into(), "m".into())]), Piece::Commands(vec!["vug".into()])],
                ),
            ],
        };
        let html = page.to_html().unwrap();
        for part in [
            "T &amp; t",
            "x &lt; y",
            "<tr class=\"marked\"><th scope=\"row\">4 bit &lt;16³&gt;</th><td>1.5</td>",
            "title=\"time &amp; more\"",
            "href=\"#part2\"",
            "<dt>w</dt><dd>m</dd>",
            "<pre><code>vug</code></pre>",
        ] {
            assert!(html.contains(part), "{part} is missing");
        }
        assert_eq!(html.matches("data:image/png;base64,").count(), 1);
        for outside in ["http:", "https:", "src=\"//", "<script", "@import", "<link"] {
            assert!(!html.contains(outside), "{outside}");
        }
        for tag in ["section", "figure", "table", "svg", "div", "p"] {
            let open = html.matches(&format!("<{tag} ")).count() + html.matches(&format!("<{tag}>")).count();
            assert_eq!(open, html.matches(&format!("</{tag}>")).count(), "{tag}");
        }
    }
}
