//! When time steps were taken, and which lists are series in time: `spacings`, `units`, `labels`, and the pairs that 3D
//! Slicer writes for sequences (`axis 0 index values:=0 1.5 3`).

use super::axes::Axes;
use super::fields;
use super::header::Header;
use crate::time::{TimeUnit, Times};

/// What the header says of a time axis; nothing is guessed.
pub(super) fn read(header: &Header, axes: &Axes) -> Option<Times> {
    let (axis, steps) = (axes.time?, axes.layout.time_steps);
    let unit = text_at(header, "units", axis).map_or(TimeUnit::Unknown, |t| unit_of(&t));
    if let Some(listed) = index_values(header, axis) {
        let times = Times { unit, steps: listed };
        if times.check(steps).is_ok() {
            return Some(times);
        }
    }
    let number = |id| Some(*fields::numbers(header.get(id)?).filter(|n| n.len() == axes.dimension)?.get(axis)?);
    let interval = number("spacings").filter(|s| s.is_normal() && *s > 0.0)?;
    let cell = header.get("centers").and_then(|c| c.split_whitespace().nth(axis));
    // The minimum of a cell-centred axis is half a step before its first sample.
    let half = if cell.is_some_and(|c| c.eq_ignore_ascii_case("cell")) { interval / 2.0 } else { 0.0 };
    let first = number("axismins").filter(|m| m.is_finite()).map_or(0.0, |m| m + half);
    Some(Times::regular(unit, first, interval, steps)).filter(|t| t.check(steps).is_ok())
}

/// Whether a `list` is one in time: it says so, has a unit of time, or has numbers by which Slicer orders its items.
pub(super) fn is_time_list(header: &Header, axis: usize) -> bool {
    let label = text_at(header, "labels", axis).unwrap_or_default().to_ascii_lowercase();
    let unit = text_at(header, "units", axis).map_or(TimeUnit::Unknown, |t| unit_of(&t));
    matches!(label.as_str(), "time" | "t") || unit != TimeUnit::Unknown || index_values(header, axis).is_some()
}

/// The pair by which Slicer says what an item of a list stands for.
pub(super) fn index_key(axis: usize) -> String {
    format!("axis {axis} index values")
}

fn index_values(header: &Header, axis: usize) -> Option<Vec<f64>> {
    let key = index_key(axis);
    let (_, values) = header.key_values.iter().find(|(k, _)| *k == key)?;
    fields::numbers(values).filter(|v| !v.is_empty())
}

fn text_at(header: &Header, id: &str, axis: usize) -> Option<String> {
    fields::quoted(header.get(id)?)?.into_iter().nth(axis)
}

/// A unit of time as people write it.
pub(super) fn unit_of(text: &str) -> TimeUnit {
    match text.trim() {
        "s" | "sec" | "secs" | "second" | "seconds" => TimeUnit::Second,
        "ms" | "msec" | "millisecond" | "milliseconds" => TimeUnit::Millisecond,
        "us" | "usec" | "\u{b5}s" | "\u{3bc}s" | "microsecond" | "microseconds" => TimeUnit::Microsecond,
        "ns" | "nsec" | "nanosecond" | "nanoseconds" => TimeUnit::Nanosecond,
        "ps" | "picosecond" | "picoseconds" => TimeUnit::Picosecond,
        "fs" | "femtosecond" | "femtoseconds" => TimeUnit::Femtosecond,
        "min" | "minute" | "minutes" => TimeUnit::Minute,
        "h" | "hr" | "hour" | "hours" => TimeUnit::Hour,
        "d" | "day" | "days" => TimeUnit::Day,
        _ => TimeUnit::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{axes, header::Field};
    use super::*;
    use std::path::Path;

    fn times(lines: &[(&str, &str)], pairs: &[(&str, &str)]) -> Option<Times> {
        let mut header = Header::default();
        let shape =
            [("type", "uchar"), ("dimension", "4"), ("sizes", "2 2 2 3"), ("kinds", "domain domain domain time")];
        for (id, value) in shape.iter().chain(lines) {
            header.fields.push(Field { id: (*id).into(), name: (*id).into(), value: (*value).into() });
        }
        header.key_values.extend(pairs.iter().map(|(k, v)| ((*k).into(), (*v).into())));
        let axes = axes::read(Path::new("f.nrrd"), &header, None).unwrap();
        read(&header, &axes)
    }

    #[test]
    fn regular_and_listed() {
        assert_eq!(times(&[], &[]), None);
        assert_eq!(times(&[("spacings", "1 1 1 nan")], &[]), None);
        assert_eq!(times(&[("spacings", "1 1 1 0")], &[]), None);
        let t = times(&[("spacings", "nan nan nan 2")], &[]).unwrap();
        assert_eq!((t.unit, t.steps), (TimeUnit::Unknown, vec![0.0, 2.0, 4.0]));
        let lines = [
            ("spacings", "nan nan nan 2"),
            ("units", "\"mm\" \"mm\" \"mm\" \"ms\""),
            ("axismins", "nan nan nan 5"),
            ("centers", "cell cell cell cell"),
        ];
        let t = times(&lines, &[]).unwrap();
        assert_eq!((t.unit, t.steps), (TimeUnit::Millisecond, vec![6.0, 8.0, 10.0]));
        // What is listed comes before what is regular, but for lists that are none of three ascending numbers.
        let key = index_key(3);
        let t = times(&lines, &[(&key, "0 1.5 7")]).unwrap();
        assert_eq!((t.unit, t.steps), (TimeUnit::Millisecond, vec![0.0, 1.5, 7.0]));
        for bad in ["0 1", "0 2 1", "0 1 inf", "0 1 x"] {
            assert_eq!(times(&lines, &[(&key, bad)]).unwrap().steps[0], 6.0, "{bad}");
        }
    }

    #[test]
    fn units_are_what_they_are_called() {
        for unit in TimeUnit::ALL.iter().filter(|u| **u != TimeUnit::Unknown) {
            assert_eq!(unit_of(unit.name()), *unit);
        }
        assert_eq!(unit_of("Ms"), TimeUnit::Unknown);
    }
}
