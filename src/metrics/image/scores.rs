//! A score of three channels, and its two means.

/// Scores of red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelScores {
    /// Red, green, blue.
    pub channels: [f64; 3],
    /// Their mean.
    pub mean: f64,
    /// Their geometric mean; 0 where one of them is 0 or negative.
    pub geometric: f64,
    /// Whether a channel was negative, so that the geometric mean is 0 by agreement only.
    pub clamped: bool,
}

impl ChannelScores {
    /// Means of three scores, each at most 1.
    #[must_use]
    pub fn of(channels: [f64; 3]) -> Self {
        let clamped = channels.iter().any(|&v| v < 0.0);
        let product: f64 = channels.iter().map(|v| v.max(0.0)).product();
        let equal = channels.iter().all(|&v| v == channels[0]);
        // A cube root may be off in its last bit: three equal scores have that score for their mean.
        let geometric = if equal { channels[0].max(0.0) } else { product.cbrt() };
        let mean = if equal { channels[0] } else { channels.iter().sum::<f64>() / 3.0 };
        ChannelScores { channels, mean, geometric, clamped }
    }
}
