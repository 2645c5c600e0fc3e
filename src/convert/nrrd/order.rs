//! The axes of a file that is to be written: those of the file that the volume came from, where they still fit.

use super::axes::{components, role_of};
use crate::convert::layout::Role;
use crate::convert::stream::CHANNELS_THEN_TIME;
use crate::voxel::SampleType;

/// An axis and the word that says what it is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// What it stands for; the parts of a colour are `Nothing`.
    pub role: Role,
    /// Its word in the field `kinds`.
    pub kind: String,
}

/// The axes of a file, the fastest first.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axes {
    /// All of them.
    pub list: Vec<Axis>,
    /// Whether they are those of the source: what it said of each of them still holds.
    pub original: bool,
}

impl Axes {
    /// The axes for a series; `kinds` is the field of the source. A list of time steps stays one where times are known:
    /// without them, nothing would say that it is one of time.
    pub(super) fn new(
        sample_type: SampleType,
        (steps, channels): (u32, u32),
        kinds: Option<&str>,
        timed: bool,
    ) -> Self {
        let rgb = sample_type == SampleType::Rgb8;
        if let Some(mut list) = kinds.and_then(|k| restored(k, rgb, steps, channels)) {
            list.iter_mut().filter(|a| a.role == Role::Time && !timed).for_each(|a| a.kind = "time".into());
            return Axes { list, original: true };
        }
        let wanted = |role: &Role| match role {
            Role::Time => steps > 1,
            Role::Channel => channels > 1,
            Role::Space(_) | Role::Nothing => true,
        };
        let mut list: Vec<Axis> = CHANNELS_THEN_TIME.into_iter().filter(wanted).map(axis).collect();
        if rgb {
            list.insert(0, Axis { role: Role::Nothing, kind: "RGB-color".into() });
        }
        // One volume has nothing but axes of space, whatever they were called.
        Axes { list, original: (steps, channels) == (1, 1) }
    }

    /// What each axis stands for, but for the parts of a colour.
    pub(super) fn roles(&self) -> Vec<Role> {
        self.list.iter().map(|a| a.role).filter(|r| *r != Role::Nothing).collect()
    }

    /// A word for each axis.
    pub(super) fn line(&self, mut word: impl FnMut(&Axis) -> String) -> String {
        self.list.iter().map(&mut word).collect::<Vec<_>>().join(" ")
    }
}

fn axis(role: Role) -> Axis {
    let kind = match role {
        Role::Time => "time",
        Role::Channel => "list",
        Role::Space(_) | Role::Nothing => "domain",
    };
    Axis { role, kind: kind.into() }
}

/// The source's axes, where x, y, z follow one another and time and channels are what they were.
fn restored(kinds: &str, rgb: bool, steps: u32, channels: u32) -> Option<Vec<Axis>> {
    let mut space = 0..3;
    let mut list = Vec::new();
    for (i, kind) in kinds.split_whitespace().enumerate() {
        let role = match role_of(kind)? {
            Role::Channel if i == 0 && rgb => Role::Nothing,
            // A list is one of time where there are no channels.
            Role::Channel if kind.eq_ignore_ascii_case("list") && channels == 1 => Role::Time,
            Role::Space(_) => Role::Space(space.next()?),
            role => role,
        };
        list.push(Axis { role, kind: kind.to_owned() });
    }
    let at = |role| list.iter().position(|a: &Axis| a.role == role);
    let count = |role| list.iter().filter(|a| a.role == role).count();
    let (x, z) = (at(Role::Space(0))?, at(Role::Space(2))?);
    let fits = z == x + 2
        && count(Role::Time) == usize::from(steps > 1)
        && count(Role::Channel) == usize::from(channels > 1)
        && count(Role::Nothing) == usize::from(rgb)
        && list.iter().filter(|a| a.role == Role::Channel).all(|a| components(&a.kind).is_none_or(|n| n == channels));
    // One volume is written as ever.
    (fits && (steps, channels) != (1, 1)).then_some(list)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(sample_type: SampleType, series: (u32, u32), source: &str) -> (String, bool) {
        let axes = Axes::new(sample_type, series, Some(source).filter(|s| !s.is_empty()), true);
        (axes.line(|a| a.kind.clone()), axes.original)
    }

    #[test]
    fn the_axes_of_the_source_or_plain_ones() {
        let u8 = |series, source| kinds(SampleType::U8, series, source);
        let of = |text: &str, original| (text.to_owned(), original);
        assert_eq!(u8((1, 1), ""), of("domain domain domain", true));
        assert_eq!(u8((1, 1), "space space space"), of("domain domain domain", true));
        assert_eq!(u8((5, 1), ""), of("domain domain domain time", false));
        assert_eq!(u8((5, 2), ""), of("domain domain domain list time", false));
        assert_eq!(kinds(SampleType::Rgb8, (5, 1), ""), of("RGB-color domain domain domain time", false));
        for source in ["domain domain domain time", "list space space space", "time domain domain domain"] {
            assert_eq!(u8((5, 1), source), of(source, true));
        }
        for source in ["vector domain domain domain", "domain domain domain list", "3-color space space space"] {
            assert_eq!(u8((1, 3), source), of(source, true));
        }
        assert_eq!(u8((4, 3), "3-vector domain domain domain list"), of("domain domain domain list time", false));
        assert_eq!(u8((4, 3), "3-vector domain domain domain time"), of("3-vector domain domain domain time", true));
        let colour = "RGB-color domain domain domain time";
        assert_eq!(kinds(SampleType::Rgb8, (4, 1), colour), of(colour, true));
        let untimed = Axes::new(SampleType::U8, (5, 1), Some("list space space space"), false);
        assert_eq!(untimed.line(|a| a.kind.clone()), "time space space space");
        // What has been cut out, joined or reordered since is written plainly.
        for (series, source) in [
            ((1, 2), "3-color domain domain domain"),
            ((5, 1), "domain domain time"),
            ((5, 1), "domain domain time domain"),
            ((5, 1), "domain domain domain domain"),
            ((5, 1), "domain domain domain"),
            ((5, 1), "domain domain domain ???"),
        ] {
            assert!(!u8(series, source).1, "{source}");
        }
    }
}
