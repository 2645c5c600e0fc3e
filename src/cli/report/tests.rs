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
