use super::*;
use crate::affine::ValueMap;
use crate::error::Code;
use crate::voxel::SampleType;

fn at(value: f64, alpha: f32) -> Point {
    Point { value, color: [alpha; 3], alpha }
}

fn tf(points: &[(f64, f32)]) -> TransferFunction {
    TransferFunction::new(points.iter().map(|&(v, a)| at(v, a)).collect()).unwrap()
}

/// The largest opacity that a fine walk over the range finds.
fn walked(tf: &TransferFunction, lo: f64, hi: f64) -> f64 {
    (0..=20_000).map(|i| tf.eval(lo + (hi - lo) * f64::from(i) / 20_000.0)[3]).fold(0.0, f64::max)
}

#[test] // hard case: R-15
fn steps_single_points_and_thin_peaks() {
    let step = tf(&[(0.0, 0.25), (10.0, 0.25), (10.0, 1.0), (20.0, 1.0)]);
    assert_eq!(step.eval(10.0_f64.next_down())[3], 0.25);
    assert_eq!(step.eval(10.0)[3], 1.0, "at the step the right one holds");
    assert_eq!((step.max_alpha(5.0, 10.0_f64.next_down()), step.max_alpha(5.0, 10.0)), (0.25, 1.0));
    // A step down: a range that reaches it from the left comes as close to the left one as it likes.
    let down = tf(&[(0.0, 1.0), (10.0, 1.0), (10.0, 0.0)]);
    assert_eq!((down.max_alpha(10.0, 30.0), down.max_alpha(9.0, 10.0), down.eval(10.0)[3]), (0.0, 1.0, 0.0));

    let one = tf(&[(7.0, 0.5)]);
    for v in [f64::NEG_INFINITY, -1e30, 7.0, 1e30, f64::INFINITY, f64::NAN] {
        assert_eq!(one.eval(v), [0.5; 4], "{v}");
    }
    assert_eq!(one.max_alpha(-1.0, 1.0), 0.5);

    // A peak far narrower than any bin of a lookup table.
    let peak = tf(&[(0.0, 0.0), (499.9999, 0.0), (500.0, 0.9), (500.0001, 0.0), (1000.0, 0.0)]);
    assert_eq!(peak.max_alpha(0.0, 1000.0), 0.9);
    assert_eq!(peak.max_alpha(500.0, 500.0), 0.9, "hard case: R-19, the range touches the peak at one point");
    assert_eq!((peak.max_alpha(0.0, 499.0), peak.max_alpha(501.0, 1000.0)), (0.0, 0.0));

    for (points, word) in [
        (vec![], "no points"),
        (vec![at(1.0, 0.0), at(0.0, 0.0)], "sort"),
        (vec![at(1.0, 0.0), at(1.0, 0.5), at(1.0, 1.0)], "three"),
        (vec![at(f64::NAN, 0.0)], "finite"),
        (vec![at(1e300, 0.0)], "finite"),
        (vec![at(0.0, 1.5)], "0 to 1"),
        (vec![at(0.0, f32::NAN)], "0 to 1"),
        (vec![at(0.0, -0.1)], "0 to 1"),
    ] {
        let e = TransferFunction::new(points).unwrap_err();
        assert!(e.code() == Code::Param && e.message().contains(word), "{e}");
    }
    let many = vec![at(0.0, 0.0); MAX_POINTS + 1];
    assert_eq!(TransferFunction::new(many).unwrap_err().code(), Code::Limit);
}

#[test]
fn the_largest_opacity_is_no_estimate() {
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    for _ in 0..200 {
        let mut values: Vec<f64> = (0..6).map(|_| (random() * 8.0).floor()).collect();
        values.sort_by(f64::total_cmp);
        let mut points: Vec<Point> = values.into_iter().map(|v| at(v, random() as f32)).collect();
        points.dedup_by_key(|p| p.value);
        let f = TransferFunction::new(points.clone()).unwrap();
        let (a, b) = (random() * 10.0 - 1.0, random() * 10.0 - 1.0);
        let (lo, hi) = (a.min(b), a.max(b));
        let (exact, walked) = (f64::from(f.max_alpha(lo, hi)), walked(&f, lo, hi));
        // Never below, and above by no more than the walk's steps and the rounding allow.
        assert!(exact >= walked && exact - walked < 2e-3, "{lo} to {hi}: {exact} and {walked} of {points:?}");
    }
    let f = tf(&[(0.0, 0.0), (10.0, 0.0), (20.0, 1.0)]);
    assert_eq!(f.max_alpha(0.0, 10.0), 0.0, "0 only where nothing can be seen");
    assert!(f.max_alpha(0.0, 10.000_000_001) > 0.0 && f.max_alpha(0.0, 1e-300) == 0.0);
    assert_eq!((f.max_alpha(f64::NAN, 1.0), f.max_alpha(5.0, 1.0)), (1.0, 1.0), "no range: all of them");
}

#[test] // hard case: R-16
fn presets_over_a_range_and_over_one_value() {
    for preset in Preset::ALL {
        assert_eq!(preset.name().parse::<Preset>().unwrap(), *preset);
        let wide = preset.over(-7.0, 93.0).unwrap();
        assert!(wide.max_alpha(-7.0, 93.0) > 0.05, "{} shows something", preset.name());
        assert_eq!(wide.eval(-7.0)[3], 0.0, "{}: the bottom of the range is clear", preset.name());
        // lo == hi: a step, and no division by zero.
        let flat = preset.over(5.0, 5.0).unwrap();
        assert!([4.0, 5.0, 6.0].iter().all(|v| flat.eval(*v).iter().all(|c| c.is_finite())));
        assert!(flat.points().len() == 2 && flat.eval(5.0) == flat.eval(1e9) && flat.eval(4.99)[3] == 0.0);
        // A range that f32 can hardly resolve.
        preset.over(1e9, 1e9 + 100.0).unwrap();
        for bad in [(1.0, 0.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            assert_eq!(preset.over(bad.0, bad.1).unwrap_err().code(), Code::Param);
        }
    }
    let unknown = "bone".parse::<Preset>().unwrap_err();
    assert!(unknown.message().contains("ct-bone") && unknown.message().contains("auto"), "{unknown}");
}

#[test]
fn ct_presets_mean_hounsfield_units() {
    let hu = |scale, offset, lo, hi| ValueStats {
        sample_type: SampleType::I16,
        extremes: (lo, hi),
        range: (lo, hi),
        median: lo,
        value_map: ValueMap { scale, offset },
    };
    let plain = Preset::CtBone.of(&hu(1.0, 0.0, -1024.0, 3071.0)).unwrap();
    assert_eq!((plain.eval(149.0)[3], f64::from(plain.points()[2].alpha)), (0.0, plain.eval(500.0)[3]));
    // Stored as unsigned: the same units, moved.
    let moved = Preset::CtBone.of(&hu(1.0, -1024.0, 0.0, 4095.0)).unwrap();
    assert_eq!(moved.eval(500.0 + 1024.0), plain.eval(500.0));
    let turned = Preset::CtBone.of(&hu(-1.0, 0.0, -3071.0, 1024.0)).unwrap();
    assert_eq!(turned.eval(-500.0), plain.eval(500.0));
    // Not in such units: over the range.
    let other = Preset::CtBone.of(&ValueStats { sample_type: SampleType::U8, ..hu(1.0, 0.0, 0.0, 255.0) }).unwrap();
    assert_eq!(other, Preset::CtBone.over(0.0, 255.0).unwrap());
}

#[test]
fn json_there_and_back() {
    let f = tf(&[(0.1, 0.1), (10.0, 0.3), (10.0, 1.0)]);
    assert_eq!(TransferFunction::from_json(&f.to_json()).unwrap(), f);
    for (bad, word) in [
        ("{}", "points"),
        (r#"{"points": [], "colour": 1}"#, "colour"),
        (r#"{"points": []}"#, "no points"),
        (r#"{"points": [{"value": 1, "color": [1, 1], "alpha": 1}]}"#, "3 are wanted"),
    ] {
        let e = TransferFunction::from_json(bad).unwrap_err();
        assert!(e.code() == Code::Param && e.message().contains(word), "{e}");
    }
}
