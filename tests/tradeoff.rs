//! `vug tradeoff` through the program, on the reference renderer: no adapter is needed.
#![cfg(all(feature = "cli", feature = "gpu"))]

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Output;

fn vug(dir: &Path, args: &[&str]) -> Output {
    assert_cmd::Command::cargo_bin("vug").unwrap().current_dir(dir).args(args).output().unwrap()
}

fn ok(dir: &Path, args: &[&str]) -> Output {
    let out = vug(dir, args);
    assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    out
}

/// A ball with ripples, 24×20×16 samples of 16 bits.
fn write_ball(path: &Path) {
    let value = |i: usize| {
        let [x, y, z] = [i % 24, i / 24 % 20, i / 480].map(|v| v as f64);
        let r = ((x - 11.5) / 11.0).hypot((y - 9.5) / 9.0).hypot((z - 7.5) / 7.0);
        if r < 1.0 { 1500.0 + 900.0 * (x * 0.9).sin() * (y * 0.7).cos() + 40.0 * z } else { 0.0 }
    };
    let bytes: Vec<u8> = (0..24 * 20 * 16).flat_map(|i| (value(i) as u16).to_le_bytes()).collect();
    fs::write(path, bytes).unwrap();
}

/// Rows of a CSV file by the names of its first line; fields in quotes may hold commas.
fn read_csv(path: &Path) -> Vec<BTreeMap<String, String>> {
    let text = fs::read_to_string(path).unwrap();
    let split = |line: &str| {
        let (mut fields, mut quoted) = (vec![String::new()], false);
        for c in line.chars() {
            match c {
                '"' => quoted = !quoted,
                ',' if !quoted => fields.push(String::new()),
                c => fields.last_mut().unwrap().push(c),
            }
        }
        fields
    };
    let mut lines = text.split_terminator("\r\n").map(split);
    let names = lines.next().unwrap();
    lines.map(|fields| names.iter().cloned().zip(fields).collect()).collect()
}

#[test]
fn a_sweep_writes_tables_pictures_and_a_page() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    write_ball(&d.join("ball.raw"));
    let args = [
        "tradeoff",
        "ball.raw",
        "--shape",
        "24,20,16",
        "--dtype",
        "u16",
        "-o",
        "out",
        "--adapter",
        "cpu",
        "--size",
        "20,16",
        "--frames",
        "1",
        "--bits",
        "2,4",
        "--blocks",
        "4,8",
        "--steps",
        "0.5,1",
        "--json",
    ];
    let json: Value = serde_json::from_slice(&ok(d, &args).stdout).unwrap();
    let out = d.join("out");
    let rows = read_csv(&out.join("tradeoff.csv"));
    // Raw: nearest and linear. Four settings: nearest, linear, optimised linear. Two steps each.
    assert_eq!(rows.len(), 2 * 2 + 4 * 3 * 2);
    assert_eq!(json["volumes"][0]["rows"].as_array().unwrap().len(), rows.len());
    let stored: Value = serde_json::from_str(&fs::read_to_string(out.join("tradeoff.json")).unwrap()).unwrap();
    assert_eq!(stored, json["volumes"][0]);
    let number = |r: &BTreeMap<String, String>, name: &str| r[name].parse::<f64>().unwrap();
    for r in &rows {
        assert!(number(r, "ms") > 0.0 && number(r, "ssim") <= 1.0, "{r:?}");
        assert!((number(r, "mse_per_channel") * 3.0 - number(r, "mse_per_pixel")).abs() < 1e-9);
        let pixels: f64 =
            r.iter().filter(|(k, _)| k.starts_with("pixels_")).map(|(_, v)| v.parse::<f64>().unwrap()).sum();
        assert_eq!(pixels, 320.0);
    }
    // Reused fetches do not change the picture.
    let mse = |sampler: &str, setting: &str, step: &str| {
        let of =
            |r: &&BTreeMap<String, String>| r["sampler"] == sampler && r["setting"] == setting && r["step"] == step;
        number(rows.iter().find(of).unwrap(), "mse_per_channel")
    };
    for setting in ["2 bit, 4³", "2 bit, 8³", "4 bit, 4³", "4 bit, 8³"] {
        assert_eq!(mse("linear", setting, "0.5"), mse("linear_opt", setting, "0.5"));
    }
    assert!(mse("linear", "4 bit, 4³", "0.5") < mse("linear", "2 bit, 8³", "0.5"));
    assert!(mse("linear", "raw", "0.5") <= mse("nearest", "raw", "0.5"));
    assert!(rows.iter().any(|r| r["pareto"] == "true"));
    // Two pictures for each row, and the reference.
    assert_eq!(fs::read_dir(out.join("images")).unwrap().count(), 2 * rows.len() + 1);
    let page = fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("Pareto front") && page.contains("<svg") && page.contains("data:image/png;base64,"));
    for outside in ["http:", "https:", "<script", "<link", "src=\"images"] {
        assert!(!page.contains(outside), "{outside}");
    }
    let again = vug(d, &args);
    assert_eq!(again.status.code(), Some(2), "a page that is there is not overwritten unasked");
}

#[test]
fn table_1_of_a_small_phantom() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let args = [
        "tradeoff",
        "--paper-table-1",
        "--phantom",
        "32,32,30",
        "-o",
        "t",
        "--adapter",
        "cpu",
        "--size",
        "12,12",
        "--frames",
        "1",
        "--steps",
        "1",
    ];
    ok(d, &args);
    let rows = read_csv(&d.join("t/table-1-phantom.csv"));
    assert_eq!(rows.len(), 14);
    assert!(rows.iter().all(|r| r["data"].contains("synthetic") && r["data"].contains("32×32×30")));
    assert!(
        rows.iter()
            .all(|r| ["nearest", "linear", "linear_opt"].iter().all(|s| !r[&format!("{s}_ssim_percent")].is_empty()))
    );
    assert_eq!(
        (rows[2]["index_bits"].as_str(), rows[2]["block"].as_str(), rows[2]["ratio_printed"].as_str()),
        ("2", "8", "7.757")
    );
    let page = fs::read_to_string(d.join("t/index.html")).unwrap();
    for figure in ["Fig. 5", "Fig. 9", "Fig. 10", "Fig. 11", "Fig. 12", "Fig. 13"] {
        assert!(page.contains(figure), "{figure}");
    }
    assert_eq!(read_csv(&d.join("t/figure-5-phantom.csv")).len(), 4 * 7);
}

#[test]
fn what_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    write_ball(&d.join("ball.raw"));
    let base = ["tradeoff", "ball.raw", "--shape", "24,20,16", "--dtype", "u16", "-o", "o", "--adapter", "cpu"];
    for wrong in [
        &["--bits", "3"][..],
        &["--blocks", "200"],
        &["--steps", "0"],
        &["--samplers", "cubic"],
        &["--size", "0,5"],
        &["--frames", "0"],
        &["--paper-table-1", "--bits", "2"],
        &["--phantom", "8,8,8"],
    ] {
        let args: Vec<&str> = base.iter().chain(wrong).copied().collect();
        assert_eq!(vug(d, &args).status.code(), Some(2), "{wrong:?}");
        assert!(!d.join("o").exists(), "{wrong:?} leaves nothing behind");
    }
    assert_eq!(vug(d, &["tradeoff", "-o", "o"]).status.code(), Some(2), "neither a source nor the table");
}
