//! The sweep with a renderer that needs no GPU: it draws the middle slice.

use super::paper::{EXTENT, PICTURE, TABLE_1, csv as table_csv, sweep_of_table_1, table_1};
use super::*;
use crate::codec::s3dc::formula_ratio;
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::gpu::key::{Sampler, Source};
use crate::grid::Grid;
use crate::metrics::image::RgbImage;
use crate::volume::{At, Axis, EncodeOptions, Volume};
use std::sync::Arc;

/// A ball with a soft edge, ripples and a ramp, u16 in 12 bits.
fn ball(edge: u32) -> Grid {
    Grid::from_fn(Extent::cube(edge), |[x, y, z]| {
        let [x, y, z] = [x, y, z].map(|v| f64::from(v) / f64::from(edge) - 0.5);
        let r = (x * x + y * y + z * z).sqrt();
        let inside = 1.0 / (1.0 + ((r - 0.35) * 40.0).exp());
        (4000.0 * inside * (0.7 + 0.2 * (x * 30.0).sin() * (y * 23.0).cos() + 0.1 * z)) as u16
    })
    .unwrap()
}

/// The middle slice in grey; a frame takes as long as a sampler has fetches, and less for longer steps.
fn slice(volume: &Arc<Volume>, shot: &Shot) -> Result<Taken> {
    if shot.source == Source::Deferred {
        return Err(Error::new(Code::Unsupported, "source", "this renderer decodes nothing ahead"));
    }
    let e = volume.info().dims;
    let plane = volume.plane(At::default(), Axis::Z, e.z / 2)?;
    let fetches = [2.0, 16.0, 6.2, 1.0][shot.sampler as usize];
    let pixels = plane.samples::<u16>().iter().map(|&v| [(v / 16) as u8; 3]).collect();
    let seconds = vec![fetches / shot.step, fetches / shot.step * 2.0, fetches / shot.step / 2.0];
    Ok(Taken { image: RgbImage::new(e.x, e.y, pixels)?, seconds, fetches_per_sample: Some(fetches) })
}

fn small_sweep() -> Sweep {
    let s = |i, b| Setting::s3dc(i, b).unwrap();
    Sweep {
        settings: vec![Setting::Raw, s(2, 4), s(2, 16), s(4, 4), s(4, 16)],
        samplers: vec![Sampler::Nearest, Sampler::LinearOpt, Sampler::HwLinear],
        steps: vec![0.5, 1.0],
        reference_step: 0.25,
    }
}

fn run(sweep_: &Sweep) -> Outcome {
    let mut seen = Vec::new();
    let outcome =
        sweep(&mut ball(48), &EncodeOptions::default(), sweep_, &mut slice, &mut |done, all| seen.push((done, all)))
            .unwrap();
    assert_eq!(seen, (1..=sweep_.pictures()).map(|n| (n, sweep_.pictures())).collect::<Vec<_>>());
    outcome
}

#[test]
fn every_combination_is_there_and_the_others_say_why() {
    let o = run(&small_sweep());
    // Raw: nearest and the texture unit's filter; s3dc: nearest and optimised linear; two steps each.
    assert_eq!(o.rows.len(), 2 * 2 + 4 * 2 * 2);
    assert_eq!(o.left_out.len(), 4 * 2);
    assert!(o.left_out.iter().all(|(name, why)| name.contains("hw_linear") && why.contains("decodes nothing")));
    let raw = &o.rows[0];
    assert!(raw.error.identical() && raw.encoded.max_error == 0.0 && raw.error.psnr == f64::INFINITY);
    assert_eq!((raw.seconds, raw.frames), ([4.0, 2.0, 8.0], 3), "median, least, most");
    let stems: std::collections::BTreeSet<String> = o.rows.iter().map(Row::stem).collect();
    assert_eq!(stems.len(), o.rows.len(), "each row has a file name of its own");
}

#[test]
fn error_falls_with_bits_and_grows_with_blocks() {
    // S-32: quality rises with the bits, falls with the block's edge, and the block matters more where bits are few.
    let o = run(&small_sweep());
    let mse = |i, b| {
        let of = |r: &&Row| (r.encoded.setting.index_bits(), r.encoded.setting.block()) == (Some(i), Some(b));
        o.rows.iter().find(of).unwrap().error.errors.mse()
    };
    assert!(mse(4, 4) < mse(4, 16) && mse(4, 16) < mse(2, 16) && mse(4, 4) < mse(2, 4) && mse(2, 4) < mse(2, 16));
    assert!(mse(2, 16) - mse(2, 4) > mse(4, 16) - mse(4, 4));
    for row in o.rows.iter().filter(|r| r.encoded.setting != Setting::Raw) {
        // S-36: errors are larger where gradients are.
        assert!(row.encoded.concentration.unwrap() > 0.2, "{}: {:?}", row.name(), row.encoded.concentration);
        assert!(row.encoded.bits_per_voxel > 0.0 && row.encoded.ratio_payload >= row.encoded.ratio_formula * 0.99);
    }
}

#[test]
fn the_front_holds_what_nothing_beats() {
    let points = [(1.0, 5.0), (2.0, 3.0), (2.0, 4.0), (3.0, 3.0), (4.0, 0.0), (0.5, f64::NAN), (4.0, 0.0)];
    assert_eq!(pareto(&points), [true, true, false, false, true, false, true]);
    assert_eq!(pareto(&[]), [false; 0]);
    let o = run(&small_sweep());
    let front: Vec<&Row> = o.rows.iter().filter(|r| r.pareto).collect();
    assert!(!front.is_empty() && front.len() < o.rows.len());
    for row in &o.rows {
        let beaten = o.rows.iter().any(|other| {
            let (a, b) = ((other.seconds[0], other.error.errors.sum), (row.seconds[0], row.error.errors.sum));
            a.0 <= b.0 && a.1 <= b.1 && a != b
        });
        assert_eq!(row.pareto, !beaten, "{}", row.name());
    }
}

#[test]
fn csv_and_json_hold_the_same() {
    let o = run(&small_sweep());
    let (text, values) = (csv(&o.rows), json(&o.rows));
    let lines: Vec<&str> = text.split_terminator("\r\n").collect();
    assert_eq!(lines.len(), o.rows.len() + 1);
    assert_eq!(lines[0].split(',').count(), COLUMNS.len());
    assert!(lines[0].starts_with("setting,index_bits,block,sampler,source,step,"));
    assert!(lines[1].starts_with("raw,,,nearest,direct,0.5,1,") && lines[1].contains(",inf,"));
    assert_eq!(values[0]["psnr"], serde_json::Value::Null);
    assert_eq!(values[0]["identical"], true);
    let row = o.rows.iter().position(|r| r.encoded.setting.name() == "4 bit, 16³").unwrap();
    assert!(lines[row + 1].starts_with("\"4 bit, 16³\",4,16,nearest,"));
    assert_eq!(values[row]["mse_per_channel"].as_f64().unwrap() * 3.0, values[row]["mse_per_pixel"].as_f64().unwrap());
    let pixels: u64 =
        COLUMNS.iter().filter(|c| c.name.starts_with("pixels_")).map(|c| values[row][c.name].as_u64().unwrap()).sum();
    assert_eq!(pixels, 48 * 48);
}

#[test]
fn ratios_are_the_papers_to_three_decimals() {
    assert_eq!((EXTENT, PICTURE), (Extent::new(512, 512, 486), [768, 768]));
    for p in TABLE_1 {
        let Setting::S3dc(params) = Setting::s3dc(p.index_bits, p.block).unwrap() else { unreachable!() };
        let ratio = formula_ratio(EXTENT, 16, &params);
        assert_eq!(format!("{ratio:.3}"), format!("{:.3}", p.ratio), "{p:?}");
    }
}

#[test]
fn the_table_has_the_papers_rows() {
    let sweep = sweep_of_table_1(0.5).unwrap();
    let mut pictured = sweep.clone();
    pictured.settings.truncate(2);
    let o = run(&pictured);
    let table = table_1(&o);
    assert_eq!(table.len(), 14);
    assert!(table[..2].iter().all(|row| row.found.iter().all(Option::is_some)));
    assert!(table[2..].iter().all(|row| row.ratio().is_none()), "what was not pictured is left open");
    // Nearest takes 2 fetches, linear 16.
    assert_eq!(table[0].found.map(|r| r.unwrap().seconds[0]), [4.0, 32.0, 12.4]);
    let text = table_csv(&table, "a ball, 48³");
    let lines: Vec<&str> = text.split_terminator("\r\n").collect();
    assert_eq!(lines.len(), 15);
    assert!(lines[1].starts_with("\"a ball, 48³\",2,2,"), "{}", lines[1]);
    assert!(lines[14].starts_with("\"a ball, 48³\",4,128,,4.000,"));
    assert!(lines[14].ends_with(",15.03,36.93,96.1,3.95,36.35,98.22"));
}

#[test]
fn what_cannot_be_swept() {
    let mut grid = ball(16);
    let base = Sweep { settings: vec![Setting::Raw], ..small_sweep() };
    let cases = [
        (Sweep { settings: vec![], ..base.clone() }, "bits"),
        (Sweep { samplers: vec![], ..base.clone() }, "samplers"),
        (Sweep { steps: vec![], ..base.clone() }, "steps"),
        (Sweep { steps: vec![0.0], ..base.clone() }, "steps"),
        (Sweep { reference_step: f64::NAN, ..base.clone() }, "steps"),
    ];
    for (wrong, field) in cases {
        let e = sweep(&mut grid, &EncodeOptions::default(), &wrong, &mut slice, &mut |_, _| {}).unwrap_err();
        assert_eq!((e.code(), e.field()), (Code::Param, field));
    }
    let mut broken = |_: &Arc<Volume>, _: &Shot| -> Result<Taken> { Err(Error::param("camera", "no")) };
    let e = sweep(&mut grid, &EncodeOptions::default(), &base, &mut broken, &mut |_, _| {}).unwrap_err();
    assert_eq!(e.field(), "camera", "only what a device cannot do or hold is left out");
    // A level that does not fit: the rows go, but there must be a reference.
    let mut full = |_: &Arc<Volume>, shot: &Shot| -> Result<Taken> {
        Err(Error::new(if shot.step < 0.5 { Code::Range } else { Code::Limit }, "level", "too large"))
    };
    let e = sweep(&mut grid, &EncodeOptions::default(), &base, &mut full, &mut |_, _| {}).unwrap_err();
    assert_eq!(e.code(), Code::Range);
    let mut small = |volume: &Arc<Volume>, shot: &Shot| match shot.step < 0.5 {
        true => slice(volume, shot),
        false => Err(Error::new(Code::Limit, "level", "too large")),
    };
    let o = sweep(&mut grid, &EncodeOptions::default(), &base, &mut small, &mut |_, _| {}).unwrap();
    assert_eq!((o.rows.len(), o.left_out.len()), (0, base.shots(&Setting::Raw).len()));
}

#[test]
fn correlation_by_hand() {
    let of = |v: [u8; 4]| Grid::from_samples(Extent::new(4, 1, 1), &v).unwrap();
    // Gradients ½·(10, 20, 20, 10) = 5, 10, 10, 5 of a ramp; errors 1, 2, 2, 1: in proportion.
    let a = of([0, 10, 20, 30]);
    assert!((gradient_correlation(&a, &of([1, 12, 18, 29])).unwrap().unwrap() - 1.0).abs() < 1e-12);
    assert!((gradient_correlation(&a, &of([2, 11, 21, 28])).unwrap().unwrap() + 1.0).abs() < 1e-12);
    assert_eq!(gradient_correlation(&a, &a).unwrap(), None);
    assert!(gradient_correlation(&a, &Grid::from_samples(Extent::new(2, 2, 1), &[0u8; 4]).unwrap()).is_err());
}
