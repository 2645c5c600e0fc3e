//! When the time steps of a series were taken.

use crate::error::{Code, Error, Result};

macro_rules! units {
    ($($(#[$doc:meta])* $name:ident = $wire:literal, $text:literal;)*) => {
        /// Unit of times.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
        #[repr(u8)]
        pub enum TimeUnit { $($(#[$doc])* $name = $wire,)* }

        impl TimeUnit {
            /// All units.
            pub const ALL: &'static [TimeUnit] = &[$(TimeUnit::$name,)*];

            /// The name used in messages and JSON.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(TimeUnit::$name => $text,)* }
            }
        }
    };
}

units! {
    /// Not given.
    #[default]
    Unknown = 0, "unknown";
    /// Seconds.
    Second = 1, "s";
    /// Milliseconds.
    Millisecond = 2, "ms";
    /// Microseconds.
    Microsecond = 3, "µs";
    /// Nanoseconds.
    Nanosecond = 4, "ns";
    /// Picoseconds.
    Picosecond = 5, "ps";
    /// Femtoseconds.
    Femtosecond = 6, "fs";
    /// Minutes.
    Minute = 7, "min";
    /// Hours.
    Hour = 8, "h";
    /// Days.
    Day = 9, "d";
}

impl TimeUnit {
    /// The unit of a code in a file.
    #[must_use]
    pub fn from_wire(code: u8) -> Option<Self> {
        TimeUnit::ALL.iter().copied().find(|u| *u as u8 == code)
    }
}

/// The time of each step of a series.
#[derive(Clone, Debug, PartialEq)]
pub struct Times {
    /// Unit of the times.
    pub unit: TimeUnit,
    /// One time per step, ascending.
    pub steps: Vec<f64>,
}

impl Times {
    /// Steps that lie `interval` apart, the first at `first`.
    #[must_use]
    pub fn regular(unit: TimeUnit, first: f64, interval: f64, steps: u32) -> Self {
        Times { unit, steps: (0..steps).map(|i| first + f64::from(i) * interval).collect() }
    }

    /// The interval between steps, where all are alike to one part in 10^6.
    #[must_use]
    pub fn interval(&self) -> Option<f64> {
        let [first, .., last] = self.steps[..] else { return None };
        let interval = (last - first) / (self.steps.len() - 1) as f64;
        let even = |pair: &[f64]| ((pair[1] - pair[0]) - interval).abs() <= 1e-6 * interval.abs();
        self.steps.windows(2).all(even).then_some(interval)
    }

    /// Checks that there is one finite time per step and that none is before the one before it.
    ///
    /// # Errors
    /// `E_SIZE`, `E_NONFINITE`, `E_ORDER`.
    pub fn check(&self, time_steps: u32) -> Result<()> {
        if self.steps.len() as u64 != u64::from(time_steps) {
            let message = format!("{} times for {time_steps} time steps", self.steps.len());
            return Err(Error::new(Code::Size, "times", message));
        }
        if let Some(i) = self.steps.iter().position(|t| !t.is_finite()) {
            return Err(Error::new(Code::NonFinite, "times", format!("the time of step {i} is {}", self.steps[i])));
        }
        if let Some(i) = self.steps.windows(2).position(|pair| pair[1] <= pair[0]) {
            let message = format!("step {} at {} is not after {}", i + 1, self.steps[i + 1], self.steps[i]);
            return Err(Error::new(Code::Order, "times", message));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_and_order() {
        let t = Times::regular(TimeUnit::Second, 1.0, 2.0, 4);
        assert_eq!((t.steps.clone(), t.interval()), (vec![1.0, 3.0, 5.0, 7.0], Some(2.0)));
        t.check(4).unwrap();
        assert_eq!(t.check(5).unwrap_err().code(), Code::Size);
        let uneven = Times { unit: TimeUnit::Second, steps: vec![0.0, 1.0, 3.0] };
        assert_eq!(uneven.interval(), None);
        for (steps, code) in [(vec![0.0, 0.0], Code::Order), (vec![0.0, f64::NAN], Code::NonFinite)] {
            assert_eq!(Times { unit: TimeUnit::Unknown, steps }.check(2).unwrap_err().code(), code);
        }
        for unit in TimeUnit::ALL {
            assert_eq!(TimeUnit::from_wire(*unit as u8), Some(*unit));
        }
        assert_eq!(TimeUnit::from_wire(200), None);
    }
}
