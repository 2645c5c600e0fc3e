//! Bounds and rates of zerobit: held on every voxel, or refused with the reason.

mod support;
mod zerobit_coding;

use std::io::Cursor;
use support::{ball, encode, hash, noise, open, verify};
use vug::codec::zerobit::{KEEP_ALL, Training};
use vug::metrics::{compare, error_stats};
use vug::volume::{At, Bound, CodecChoice, EncodeOptions, EncodeReport, Quality, ZerobitOptions};
use vug::{Code, Error, Extent, Grid};

fn with(quality: Quality) -> EncodeOptions {
    EncodeOptions { codec: CodecChoice::Zerobit, quality, ..EncodeOptions::default() }
}

fn try_encode(grid: &mut Grid, options: &EncodeOptions) -> Result<(Vec<u8>, EncodeReport), Error> {
    let mut file = Cursor::new(Vec::new());
    let report = vug::volume::encode(grid, &mut file, options, &mut |done, total| assert!(done <= total))?;
    Ok((file.into_inner(), report))
}

/// What came of a bound: the report, checked against the decoded voxels, or the reason of a refusal.
fn outcome(name: &str, grid: &mut Grid, options: &EncodeOptions) -> Option<EncodeReport> {
    let range = grid.range().map_or(0.0, |(lo, hi)| hi - lo);
    match try_encode(grid, options) {
        Ok((bytes, report)) => {
            assert!(verify(&bytes).is_empty());
            let decoded = open(bytes).read(At::default()).unwrap();
            let found = error_stats(&grid.view(), &decoded.view()).unwrap();
            let violations = match options.quality {
                Quality::MaxError(bound) => {
                    let most = match bound {
                        Bound::Absolute(v) => v,
                        Bound::Percent(v) => v / 100.0 * range,
                    };
                    usize::from(found.max_abs > most)
                }
                Quality::Psnr(db) => {
                    let c = compare(&grid.view(), &decoded.view()).unwrap();
                    usize::from(!c.identical && c.psnr.unwrap() < db)
                }
                _ => unreachable!("a bound"),
            };
            assert_eq!(violations, 0, "{name}: {:?}", options.quality);
            assert_eq!(found.max_abs, report.max_error);
            println!(
                "{name} {:?}: {} keeps {:?} millionths, {} bytes, largest error {}",
                options.quality,
                report.codec,
                report.zerobit.map(|p| p.keep_ppm()),
                report.bytes,
                report.max_error
            );
            Some(report)
        }
        Err(error) => {
            let field = if matches!(options.quality, Quality::Psnr(_)) { "psnr" } else { "max-error" };
            assert_eq!((error.code(), error.field()), (Code::Param, field), "{error}");
            println!("{name} {:?}: {error}", options.quality);
            // The message tells how far one gets; all coefficients do not get further, and do not hold the bound.
            let all = EncodeOptions { quality: Quality::Keep(KEEP_ALL), ..options.clone() };
            let all = try_encode(grid, &all).unwrap().1;
            let number = |name: &str| -> f64 {
                let rest = error.message().split_once(name).unwrap().1;
                rest.split(' ').next().unwrap().parse().unwrap()
            };
            let (max, db) = (number("a largest error of "), number(&format!("{} and ", number("a largest error of "))));
            match options.quality {
                Quality::MaxError(bound) => {
                    let most = match bound {
                        Bound::Absolute(v) => v,
                        Bound::Percent(v) => v / 100.0 * range,
                    };
                    assert!(max > most && all.max_error >= max, "{error}");
                }
                Quality::Psnr(v) => assert!(db < v + 0.005 && all.psnr.unwrap() < db + 0.005, "{error}"),
                _ => unreachable!("a bound"),
            }
            None
        }
    }
}

fn synthetic() -> Vec<(&'static str, Grid)> {
    let e = Extent::new(50, 37, 41);
    let colours = |c: [u32; 3]| {
        let h = hash(c).to_le_bytes();
        if c[0] < 11 { [0; 3] } else { [c[0] as u8 * 4 + h[0] / 32, h[1] / 16 + 90, (c[1] * c[2]) as u8 / 4] }
    };
    vec![
        ("ball", ball(e)),
        ("colours", Grid::from_fn(e, colours).unwrap()),
        ("u16", Grid::from_fn(e, |c| (c[0] * 600 + c[1] * 300) as u16 + (hash(c) >> 26) as u16).unwrap()),
        ("i16", noise(e, |h| (h >> 16) as u16 as i16)),
        ("constant", noise(e, |_| 40u8)),
    ]
}

#[test]
fn bounds_are_held_or_refused() {
    let mut met = [0, 0];
    for (name, mut grid) in synthetic() {
        for quality in [
            Quality::MaxError(Bound::Absolute(7.0)),
            Quality::MaxError(Bound::Absolute(60.0)),
            Quality::MaxError(Bound::Percent(0.0)),
            Quality::MaxError(Bound::Percent(4.0)),
            Quality::MaxError(Bound::Percent(100.0)),
            Quality::Psnr(25.0),
            Quality::Psnr(38.0),
            Quality::Psnr(90.0),
        ] {
            let held = outcome(name, &mut grid, &with(quality)).is_some();
            met[usize::from(held)] += 1;
        }
        // 8 bits: all coefficients, each with its word, are off by 7 at most.
        if name == "ball" {
            assert!(outcome(name, &mut grid, &with(Quality::MaxError(Bound::Absolute(7.0)))).is_some());
            assert!(outcome(name, &mut grid, &with(Quality::MaxError(Bound::Absolute(0.0)))).is_none());
        }
    }
    assert!(met[0] > 4 && met[1] > 15, "{met:?}");
}

#[test] // a search takes little more than it has to: one part in 64 less misses the bound, unless errors are not monotone
fn searches_end_near_the_edge() {
    let mut grid = ball(Extent::cube(64));
    let report = outcome("ball", &mut grid, &with(Quality::Psnr(35.0))).unwrap();
    let keep = report.zerobit.unwrap().keep_ppm();
    let less = try_encode(&mut grid, &with(Quality::Keep(keep - keep / 16))).unwrap().1;
    assert!(less.psnr.unwrap() < 35.0 && report.psnr.unwrap() < 35.5, "{:?} {:?}", less.psnr, report.psnr);
}

#[test] // codebooks and coarser levels count
fn rates_are_kept() {
    for (name, mut grid) in synthetic() {
        let voxels = grid.extent().voxels() as f64;
        for (levels, brick) in [(1, None), (0, Some(16))] {
            let mut last = f64::INFINITY;
            for rate in [0.6, 1.5, 3.0, 20.0] {
                let options = EncodeOptions { levels, brick, ..with(Quality::Rate(rate)) };
                let (bytes, report) = match try_encode(&mut grid, &options) {
                    Ok(found) => found,
                    Err(error) => {
                        assert_eq!((error.code(), error.field()), (Code::Param, "rate"), "{error}");
                        assert!(error.message().contains("at least"), "{error}");
                        continue;
                    }
                };
                let volume = open(bytes);
                let books = volume.head().section(*b"CBOK").map_or(0, |s| s.stored_len);
                let bits = (volume.info().payload_bytes + books) as f64 * 8.0 / voxels;
                assert!(bits <= rate, "{name}: {bits} > {rate}");
                assert!(
                    report.rmse <= last * 1.02,
                    "{name}: the best of all that was tried, so that more bits are hardly worse"
                );
                last = report.rmse;
            }
        }
        let error = try_encode(&mut grid, &with(Quality::Rate(1e-5))).map(|(_, r)| r.codebooks);
        assert!(error.is_err() || name == "constant");
    }
}

#[test]
fn auto_on_colours() {
    let auto = |quality| EncodeOptions { codec: CodecChoice::Auto, ..with(quality) };
    let colours = || synthetic().swap_remove(1).1;
    let report = outcome("auto", &mut colours(), &auto(Quality::Psnr(30.0))).unwrap();
    assert_eq!((report.codec, report.notes.len()), ("zerobit", 0));
    let report = encode(&mut colours(), &auto(Quality::Rate(2.0))).1;
    assert_eq!(report.codec, "zerobit");
    // Out of reach: raw, with the reason.
    let report = outcome("auto", &mut colours(), &auto(Quality::MaxError(Bound::Absolute(0.0)))).unwrap();
    assert_eq!((report.codec, report.max_error), ("raw", 0.0));
    assert!(report.notes[0].contains("zerobit cannot reach"), "{:?}", report.notes);
    // In reach, but no smaller than raw: many zeros.
    let mut few =
        Grid::from_fn(Extent::cube(64), |c| if hash(c).is_multiple_of(4000) { [255u8, 0, 9] } else { [0; 3] }).unwrap();
    let report = outcome("few", &mut few, &auto(Quality::MaxError(Bound::Absolute(4.0)))).unwrap();
    println!("few voxels: {} {:?}", report.codec, report.notes);
    // Without a bound colours stay as they are.
    let explicit = auto(Quality::Explicit { index_bits: 4, block: Extent::cube(4) });
    assert_eq!(encode(&mut colours(), &explicit).1.codec, "raw");
    // Nonsense is refused before anything is read twice.
    for quality in [Quality::Psnr(f64::NAN), Quality::Rate(-1.0), Quality::MaxError(Bound::Percent(f64::INFINITY))] {
        assert_eq!(try_encode(&mut colours(), &with(quality)).unwrap_err().code(), Code::Param);
    }
    let keep = EncodeOptions { codec: CodecChoice::S3dc, ..with(Quality::Keep(9)) };
    assert_eq!(try_encode(&mut ball(Extent::cube(9)), &keep).unwrap_err().field(), "keep");
    assert_eq!(try_encode(&mut colours(), &with(Quality::Keep(1_000_001))).unwrap_err().field(), "keep");
    assert_eq!(
        try_encode(&mut colours(), &EncodeOptions { codec: CodecChoice::Zerobit, ..explicit }).unwrap_err().field(),
        "keep"
    );
}

#[test] // real volumes; skipped where there are none
#[cfg(feature = "convert")]
fn bounds_on_real_volumes() {
    let Some(dir) = support::data() else { return };
    for name in zerobit_coding::REAL {
        let mut grid = zerobit_coding::load(&dir, name, 12);
        let zerobit = ZerobitOptions { training: Training::MedianCut, ..ZerobitOptions::default() };
        for quality in [Quality::MaxError(Bound::Percent(8.0)), Quality::Psnr(36.0)] {
            outcome(name, &mut grid, &EncodeOptions { zerobit, ..with(quality) });
        }
    }
}
