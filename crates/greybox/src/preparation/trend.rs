//! Trends of a signal over the whole recording.

use super::step::Trend;
use greybox_recording::TimeAxis;

/// Subtracts a trend from the samples that are there.
pub(super) fn subtract(values: &mut [f64], time: &TimeAxis, trend: Trend) {
    let present = || {
        let samples = values.iter().enumerate();
        samples.filter(|(_, value)| !value.is_nan())
    };
    let count = present().count().max(1) as f64;
    let mean = present().map(|(_, value)| value).sum::<f64>() / count;
    let middle = present().map(|(k, _)| time.instant(k)).sum::<f64>() / count;
    let (mut products, mut squares) = (0.0, 0.0);
    for (k, value) in present() {
        let from_middle = time.instant(k) - middle;
        products += from_middle * (value - mean);
        squares += from_middle * from_middle;
    }
    let slope = match trend {
        Trend::Line | Trend::Slope if squares > 0.0 => products / squares,
        _ => 0.0,
    };
    let level = match trend {
        Trend::Mean | Trend::Line => mean,
        Trend::Slope => 0.0,
    };
    for (k, value) in values.iter_mut().enumerate() {
        *value -= level + slope * (time.instant(k) - middle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trend_is_subtracted_and_nothing_else() {
        let time = TimeAxis::Uniform {
            sample_time: 0.5,
            samples: 41,
        };
        // The wave is even about the middle of the samples and has no mean where two of its zeros are missing.
        let wave = |k: usize| [1.0, 0.0, -1.0, 0.0][k % 4] - 1.0 / 39.0;
        for (trend, expected) in [
            (Trend::Mean, [-5.0, 0.25]),
            (Trend::Line, [0.0, 0.0]),
            (Trend::Slope, [12.0, 0.0]),
        ] {
            let mut values: Vec<f64> = (0..41).map(|k| 7.0 + 0.25 * k as f64 + wave(k)).collect();
            (values[9], values[31]) = (f64::NAN, f64::NAN);
            subtract(&mut values, &time, trend);
            for (k, value) in values.iter().enumerate() {
                let wanted = expected[0] + expected[1] * k as f64 + wave(k);
                let is_missing = k == 9 || k == 31;
                assert_eq!(value.is_nan(), is_missing);
                assert!(
                    is_missing || (value - wanted).abs() < 1e-9,
                    "{trend:?} {k}: {value} {wanted}"
                );
            }
        }
    }
}
