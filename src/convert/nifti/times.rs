//! Times of a series: `toffset`, `pixdim[4]` and the upper bits of `xyzt_units` (nifti1.h), and back.

use super::geometry::SPACE_UNIT_BITS;
use super::header::Header;
use crate::time::{TimeUnit, Times};

/// Bits of `xyzt_units` that hold the unit of time.
const TIME_UNIT_BITS: i32 = 0x38;
/// Hertz, parts per million and radians per second: the fourth axis is none of time.
const SPECTRA: [i32; 3] = [32, 40, 48];

/// When the time steps were taken; an interval of 0 (or NaN) means that it is not known.
pub(super) fn read(header: &Header, steps: u32) -> Option<Times> {
    let unit = match header.xyzt_units & TIME_UNIT_BITS {
        8 => TimeUnit::Second,
        16 => TimeUnit::Millisecond,
        24 => TimeUnit::Microsecond,
        code if SPECTRA.contains(&code) => return None,
        _ => TimeUnit::Unknown,
    };
    let interval = header.pixdim[4].abs();
    if steps < 2 || !interval.is_normal() {
        return None;
    }
    let first = if header.toffset.is_finite() { header.toffset } else { 0.0 };
    Some(Times::regular(unit, first, interval, steps)).filter(|t| t.check(steps).is_ok())
}

/// Code of a unit, and the factor that brings times to it: NIfTI has nothing above the second and below the microsecond.
const fn code_of(unit: TimeUnit) -> (i32, f64) {
    match unit {
        TimeUnit::Unknown => (0, 1.0),
        TimeUnit::Second => (8, 1.0),
        TimeUnit::Millisecond => (16, 1.0),
        TimeUnit::Microsecond => (24, 1.0),
        TimeUnit::Nanosecond => (24, 1e-3),
        TimeUnit::Picosecond => (24, 1e-6),
        TimeUnit::Femtosecond => (24, 1e-9),
        TimeUnit::Minute => (8, 60.0),
        TimeUnit::Hour => (8, 3600.0),
        TimeUnit::Day => (8, 86400.0),
    }
}

/// Sets interval, first time and unit. Steps that are not evenly apart have no place in NIfTI: their interval is unknown.
pub(super) fn write(header: &mut Header, times: Option<&Times>, steps: u32) {
    if steps > 1 {
        header.pixdim[4] = 0.0;
    }
    let Some(times) = times else { return };
    let (code, factor) = code_of(times.unit);
    header.xyzt_units = header.xyzt_units & SPACE_UNIT_BITS | code;
    header.toffset = times.steps[0] * factor;
    if let Some(interval) = times.interval() {
        // Where the second step says it exactly, it is not blurred by the last.
        let second = times.steps[1] - times.steps[0];
        let exact = Times::regular(times.unit, times.steps[0], second, steps) == *times;
        header.pixdim[4] = if exact { second } else { interval } * factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(pixdim: f64, units: i32, toffset: f64) -> Header {
        let mut h = Header { xyzt_units: units, toffset, ..Header::default() };
        h.pixdim[4] = pixdim;
        h
    }

    #[test]
    fn there_and_back() {
        for unit in [TimeUnit::Unknown, TimeUnit::Second, TimeUnit::Millisecond, TimeUnit::Microsecond] {
            let times = Times::regular(unit, 0.5, 0.1, 40);
            let mut h = header(0.0, 2, 0.0);
            write(&mut h, Some(&times), 40);
            assert_eq!((h.xyzt_units & SPACE_UNIT_BITS, h.pixdim[4]), (2, 0.1));
            assert_eq!(read(&h, 40), Some(times));
        }
        let mut h = header(0.0, 2, 0.0);
        write(&mut h, Some(&Times::regular(TimeUnit::Minute, 1.0, 0.5, 3)), 3);
        assert_eq!((h.xyzt_units, h.toffset, h.pixdim[4]), (10, 60.0, 30.0));
    }

    #[test]
    fn what_is_not_known_stays_so() {
        for (pixdim, units) in [(0.0, 8), (f64::NAN, 8), (f64::INFINITY, 8), (1e300 * 1e10, 8), (2.0, 32), (2.0, 48)] {
            assert_eq!(read(&header(pixdim, units, 0.0), 3), None, "{pixdim} {units}");
        }
        assert_eq!(read(&header(2.0, 8, f64::NAN), 1), None);
        assert_eq!(read(&header(2.0, 8, f64::NAN), 2).unwrap().steps, [0.0, 2.0]);
        let mut h = header(1.0, 2, 0.0);
        write(&mut h, Some(&Times { unit: TimeUnit::Second, steps: vec![0.0, 1.0, 5.0] }), 3);
        assert_eq!((h.pixdim[4], read(&h, 3)), (0.0, None));
        let mut h = header(1.0, 2, 0.0);
        write(&mut h, None, 1);
        assert_eq!(h.pixdim[4], 1.0);
    }
}
