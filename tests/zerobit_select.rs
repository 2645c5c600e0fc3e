//! Selective compression: cells that nobody wants are null, and the ratio to keep refers to the others.

mod support;
mod zerobit_coding;

use std::io::Cursor;
use support::{encode, hash, noise, open, verify};
use vug::codec::zerobit::Threshold;
use vug::metrics::error_stats;
use vug::volume::{At, CodecChoice, EncodeOptions, EncodeReport, Quality, Selection, Volume, ZerobitOptions};
use vug::{Code, Extent, Grid, SampleType};

fn keep(ppm: u32) -> EncodeOptions {
    EncodeOptions { codec: CodecChoice::Zerobit, quality: Quality::Keep(ppm), ..EncodeOptions::default() }
}

/// Voxels near a slanted sheet, as a texture on a surface would want them.
fn sheet(c: [u32; 3]) -> bool {
    (2 * c[0] + c[1] + 3 * c[2]) / 4 == 37
}

/// Cells (by first voxel) that hold a wanted voxel.
fn wanted(e: Extent, c: [u32; 3]) -> bool {
    let first = c.map(|v| v / 4 * 4);
    (0..64).any(|k| {
        let at = std::array::from_fn(|a| first[a] + (k >> (2 * a) & 3));
        e.contains(at) && sheet(at)
    })
}

fn each(e: Extent) -> impl Iterator<Item = [u32; 3]> {
    (0..e.z).flat_map(move |z| (0..e.y).flat_map(move |y| (0..e.x).map(move |x| [x, y, z])))
}

fn colours(e: Extent) -> Grid {
    Grid::from_fn(e, |c| {
        let h = hash(c).to_le_bytes();
        [c[0] as u8 * 3, 255 - c[1] as u8 * 2 - h[0] / 8, h[1] / 2]
    })
    .unwrap()
}

fn selection(e: Extent) -> Selection {
    Selection::from_mask(&mut Grid::from_fn(e, |c| u8::from(sheet(c))).unwrap()).unwrap()
}

fn checked(grid: &mut Grid, options: &EncodeOptions) -> (Volume, vug::volume::EncodeReport) {
    let (bytes, report) = encode(grid, options);
    assert!(verify(&bytes).is_empty(), "{:?}", verify(&bytes));
    (open(bytes), report)
}

#[test] // V12; spec: ZBT-26
fn unselected_cells_are_null_and_the_ratio_is_that_of_the_rest() {
    let e = Extent::new(75, 66, 53);
    let chosen = each(e).filter(|&c| wanted(e, c)).count() as u64;
    assert!(chosen * 4 < e.voxels());
    for threshold in [Threshold::Adaptive, Threshold::Global] {
        for (ppm, null_value) in [(30_000, 0.0), (1_000_000, 200.0)] {
            let zerobit = ZerobitOptions { threshold, ..ZerobitOptions::default() };
            let all = EncodeOptions { zerobit, null_value, ..keep(ppm) };
            let some = EncodeOptions { selection: Some(selection(e)), ..all.clone() };
            let mut grid = colours(e);
            let (volume, report) = checked(&mut grid, &some);
            assert_eq!(report.zerobit.unwrap().selected, chosen);
            let back = volume.read(At::default()).unwrap();
            let null = volume.info().null_sample();
            let outside = each(e).filter(|&c| !wanted(e, c));
            assert!({ outside }.all(|c| back.value(c).unwrap() == null));
            // The report measures what was selected, against the null value elsewhere.
            let mut masked = Grid::from_fn(e, |c| {
                if wanted(e, c) { grid.samples::<[u8; 3]>()[e.index(c) as usize] } else { [null_value as u8; 3] }
            })
            .unwrap();
            assert_eq!(error_stats(&masked.view(), &back.view()).unwrap().max_abs, report.max_error);
            // It takes about the part of the bytes that it is of the volume, and is as good.
            let whole = checked(&mut grid, &all).1;
            assert!(report.stored_bytes * 3 < whole.stored_bytes, "{} {}", report.stored_bytes, whole.stored_bytes);
            // Without a selection, but the same samples: the ratio then refers to all voxels, and keeps more.
            let same = checked(&mut masked, &all).1;
            assert_eq!(same.zerobit.unwrap().selected, 0);
            if ppm < 1_000_000 {
                assert!(same.stored_bytes > report.stored_bytes && same.rmse < report.rmse);
            } else {
                assert_eq!((same.stored_bytes, same.max_error), (report.stored_bytes, report.max_error));
                // The mean is over the selected voxels alone.
                let square = |r: &EncodeReport, n: u64| r.rmse * r.rmse * n as f64;
                let (of_all, of_some) = (square(&same, e.voxels()), square(&report, chosen));
                assert!((of_all - of_some).abs() <= 1e-9 * of_all, "{of_all} {of_some}");
            }
        }
    }
}

#[test]
fn a_selection_of_everything_changes_nothing_and_of_nothing_is_refused() {
    let e = Extent::new(40, 33, 18);
    let mut grid = colours(e);
    let with = |mask: u8| EncodeOptions {
        selection: Some(Selection::from_mask(&mut noise(e, |_| mask)).unwrap()),
        ..keep(50_000)
    };
    let (all, of_all) = checked(&mut grid, &with(1));
    let (plain, of_plain) = checked(&mut grid, &keep(50_000));
    assert_eq!((of_all.zerobit.unwrap().selected, of_all.rmse), (e.voxels(), of_plain.rmse));
    assert_eq!(all.read(At::default()).unwrap().bytes(), plain.read(At::default()).unwrap().bytes());
    let nothing = Selection::from_mask(&mut noise(e, |_| 0u8)).unwrap_err();
    assert!(nothing.code() == Code::Param && nothing.message().contains("0 everywhere"), "{nothing}");
}

#[test] // coarser levels hold what is below them, and no more
fn levels_of_a_selection() {
    let e = Extent::new(75, 66, 53);
    let options =
        EncodeOptions { selection: Some(selection(e)), levels: 0, brick: Some(16), null_value: 7.0, ..keep(200_000) };
    let (volume, _) = checked(&mut colours(e), &options);
    assert!(volume.info().lod_count >= 3);
    for lod in 1..volume.info().lod_count {
        let level = volume.read(At::lod(lod)).unwrap();
        let size = level.extent();
        let below = |c: [u32; 3]| {
            let cell = c.map(|v| v / 4 * 4);
            each(Extent::cube(4 << lod)).step_by(3).any(|at| {
                let c = std::array::from_fn(|a| (cell[a] << lod) + at[a]);
                e.contains(c) && wanted(e, c)
            })
        };
        for c in each(size).step_by(7) {
            if !below(c) {
                assert_eq!(level.value(c).unwrap(), volume.info().null_sample(), "level {lod}, {c:?}");
            }
        }
    }
}

#[test]
fn masks() {
    let e = Extent::new(41, 29, 34);
    // Of any type, not 0 counts; a byte of a sample is enough.
    let masks = [
        Grid::from_fn(e, |c| u8::from(sheet(c))).unwrap(),
        Grid::from_fn(e, |c| u16::from(sheet(c)) << 15).unwrap(),
        Grid::from_fn(e, |c| if sheet(c) { -1.5f32 } else { 0.0 }).unwrap(),
        Grid::from_fn(e, |c| [0, 0, u8::from(sheet(c))]).unwrap(),
    ];
    for mut mask in masks {
        let selection = Selection::from_mask(&mut mask).unwrap();
        assert_eq!(selection.extent(), e);
        for c in each(e) {
            assert_eq!(selection.contains(c.map(|v| v / 4)), wanted(e, c));
        }
        assert!(!selection.contains([11, 0, 0]) && !selection.contains([0, 8, 0]), "outside nothing is selected");
    }
    let other = EncodeOptions { selection: Some(selection(e)), ..keep(10) };
    let mut grid = colours(Extent::new(9, 21, 14));
    let error = vug::volume::encode(&mut grid, Cursor::new(Vec::new()), &other, &mut |_, _| {}).unwrap_err();
    assert_eq!((error.code(), error.field()), (Code::Param, "selection"));
    // Other codecs take a selection as well: the rest of the volume is the null value.
    let raw = EncodeOptions { codec: CodecChoice::Raw, selection: Some(selection(e)), ..EncodeOptions::default() };
    let mut grid = noise(e, |h| h as u16 | 1);
    let back = checked(&mut grid, &raw).0.read(At::default()).unwrap();
    assert_eq!(back.sample_type(), SampleType::U16);
    for c in each(e) {
        let expected = if wanted(e, c) { grid.samples::<u16>()[e.index(c) as usize] } else { 0 };
        assert_eq!(back.samples::<u16>()[e.index(c) as usize], expected);
    }
}
