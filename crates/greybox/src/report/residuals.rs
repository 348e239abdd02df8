//! What residuals look like: how they are spread, how they follow themselves, and at which
//! frequencies they are large.

use serde::Serialize;
use utoipa::ToSchema;

use crate::identification::assemble::ExperimentTrajectory;

/// Lags of the autocorrelation.
const LAGS: usize = 25;
/// The 99 % point of the normal distribution, two-sided.
const NORMAL_99: f64 = 2.576;
/// Bars of the histogram.
const BARS: usize = 40;
/// Samples of a segment of the spectrum at the most.
const SEGMENT: usize = 256;
/// Segments at the most; of longer recordings some are left out, evenly.
const MOST_SEGMENTS: usize = 400;

/// The residuals of one output over the part of an experiment that was estimated from.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct Diagnostics {
    /// The experiment, counted from 0 in the order of the job.
    pub experiment: usize,
    /// The output.
    #[schema(example = "position")]
    pub output: String,
    /// The SI unit of the output.
    #[schema(example = "m")]
    pub unit: String,
    /// Residuals that are not missing.
    pub samples: usize,
    /// How the residuals are spread.
    pub histogram: Histogram,
    /// The autocorrelation of the residuals at lags 1, 2, … samples; empty where they are all zero.
    pub autocorrelation: Vec<f64>,
    /// White residuals stay within ± this in 99 of 100 lags.
    pub white_within: f64,
    /// The power density of the residuals by frequency, `[Hz, unit²/Hz]`, by Welch's method.
    pub spectrum: Vec<[f64; 2]>,
}

/// How residuals are spread.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct Histogram {
    /// Where the first bar begins, SI.
    pub from: f64,
    /// How wide each bar is, SI.
    pub width: f64,
    /// How many residuals are in each bar.
    pub counts: Vec<u64>,
}

/// The diagnostics of every output of every experiment that was estimated from.
#[must_use]
pub fn diagnostics(experiments: &[ExperimentTrajectory]) -> Vec<Diagnostics> {
    let mut diagnostics = Vec::new();
    for (number, experiment) in experiments.iter().enumerate() {
        let used = experiment.estimation_samples.min(experiment.time.len());
        let sample_time = match &experiment.time[..] {
            [first, .., last] => (last - first) / (experiment.time.len() - 1) as f64,
            _ => continue,
        };
        if used < 2 {
            continue;
        }
        for output in &experiment.outputs {
            let residuals = &output.residual[..used];
            let present: Vec<f64> = residuals
                .iter()
                .copied()
                .filter(|r| r.is_finite())
                .collect();
            diagnostics.push(Diagnostics {
                experiment: number,
                output: output.name.clone(),
                unit: output.unit.clone(),
                samples: present.len(),
                histogram: histogram(&present),
                autocorrelation: autocorrelation(residuals),
                white_within: NORMAL_99 / f64::sqrt(present.len().max(1) as f64),
                spectrum: spectrum(residuals, sample_time),
            });
        }
    }
    diagnostics
}

fn histogram(values: &[f64]) -> Histogram {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut counts = vec![0; BARS];
    if low >= high {
        return Histogram {
            from: if low.is_finite() { low } else { 0.0 },
            width: 0.0,
            counts: vec![values.len() as u64],
        };
    }
    let width = (high - low) / BARS as f64;
    for value in values {
        let bar = ((value - low) / width) as usize;
        counts[bar.min(BARS - 1)] += 1;
    }
    Histogram {
        from: low,
        width,
        counts,
    }
}

/// At lags 1, 2, …; samples that are missing are left out.
fn autocorrelation(residuals: &[f64]) -> Vec<f64> {
    let mean_product = |lag: usize| {
        let pairs = residuals.iter().zip(residuals.iter().skip(lag));
        let products = pairs
            .map(|(a, b)| a * b)
            .filter(|product| product.is_finite());
        let (sum, count) = products.fold((0.0, 0.0), |(sum, n), product| (sum + product, n + 1.0));
        sum / f64::max(count, 1.0)
    };
    let power = mean_product(0);
    if power > 0.0 {
        let lags = 1..=LAGS.min(residuals.len() - 1);
        lags.map(|lag| mean_product(lag) / power).collect()
    } else {
        Vec::new()
    }
}

/// Welch's method: Hann windows of segments that overlap by half, their periodograms averaged. A
/// segment with a missing sample is left out.
fn spectrum(residuals: &[f64], sample_time: f64) -> Vec<[f64; 2]> {
    let length = SEGMENT.min(residuals.len() / 2 * 2);
    if length < 16 || sample_time <= 0.0 {
        return Vec::new();
    }
    let turns = |k: usize| 2.0 * std::f64::consts::PI * k as f64 / length as f64;
    let window: Vec<f64> = (0..length).map(|k| 0.5 - 0.5 * turns(k).cos()).collect();
    let scale: f64 = window.iter().map(|w| w * w).sum::<f64>() / sample_time;
    let (cosines, sines): (Vec<f64>, Vec<f64>) = (0..length)
        .map(|k| (turns(k).cos(), turns(k).sin()))
        .unzip();
    let starts: Vec<usize> = (0..=residuals.len() - length).step_by(length / 2).collect();
    let every = starts.len().div_ceil(MOST_SEGMENTS);
    let mut power = vec![0.0; length / 2];
    let mut segments = 0.0;
    for start in starts.into_iter().step_by(every) {
        let part = &residuals[start..start + length];
        if part.iter().any(|value| !value.is_finite()) {
            continue;
        }
        let mean = part.iter().sum::<f64>() / length as f64;
        let weighed: Vec<f64> = part
            .iter()
            .zip(&window)
            .map(|(r, w)| (r - mean) * w)
            .collect();
        for (line, power) in power.iter_mut().enumerate() {
            let frequency = line + 1;
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (k, value) in weighed.iter().enumerate() {
                let angle = frequency * k % length;
                real += value * cosines[angle];
                imaginary -= value * sines[angle];
            }
            // Each line stands for itself and its mirror image, but for that at half the rate.
            let sides = if frequency == length / 2 { 1.0 } else { 2.0 };
            *power += sides * (real * real + imaginary * imaginary) / scale;
        }
        segments += 1.0;
    }
    if segments == 0.0 {
        return Vec::new();
    }
    let step = 1.0 / (length as f64 * sample_time);
    let lines = power.iter().enumerate();
    lines
        .map(|(line, power)| [(line + 1) as f64 * step, power / segments])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identification::DatasetId;
    use crate::identification::assemble::OutputTrajectory;

    fn of(residual: Vec<f64>, sample_time: f64) -> Diagnostics {
        let samples = residual.len();
        let experiment = ExperimentTrajectory {
            dataset: DatasetId::new(),
            time: (0..samples).map(|k| k as f64 * sample_time).collect(),
            estimation_samples: samples,
            outputs: vec![OutputTrajectory {
                name: "y".into(),
                unit: "m".into(),
                measured: residual.clone(),
                simulated: vec![0.0; samples],
                residual,
                deviation: None,
            }],
        };
        diagnostics(&[experiment]).remove(0)
    }

    #[test]
    fn the_spectrum_of_a_sine_is_at_its_frequency_and_holds_its_power() {
        let (rate, frequency, amplitude) = (100.0, 12.5, 3.0);
        let turns = |k: i32| 2.0 * std::f64::consts::PI * frequency * f64::from(k) / rate;
        let diagnostics = of(
            (0..4096).map(|k| amplitude * turns(k).sin()).collect(),
            1.0 / rate,
        );
        let peak = diagnostics
            .spectrum
            .iter()
            .max_by(|a, b| a[1].total_cmp(&b[1]));
        assert!((peak.expect("lines")[0] - frequency).abs() < 1e-9);
        let step = diagnostics.spectrum[1][0] - diagnostics.spectrum[0][0];
        let power: f64 = diagnostics.spectrum.iter().map(|line| line[1] * step).sum();
        assert!(
            (power / (amplitude * amplitude / 2.0) - 1.0).abs() < 0.02,
            "{power}"
        );
        assert!(
            (diagnostics.autocorrelation[7] - 1.0).abs() < 1e-2,
            "a period is eight samples"
        );
    }

    #[test]
    fn every_residual_is_in_a_bar_and_missing_ones_in_none() {
        let mut residual: Vec<f64> = (0..1000).map(f64::from).collect();
        residual[500] = f64::NAN;
        let diagnostics = of(residual, 0.1);
        assert_eq!(diagnostics.samples, 999);
        assert_eq!(diagnostics.histogram.counts.iter().sum::<u64>(), 999);
        assert_eq!(diagnostics.histogram.from, 0.0);
    }

    #[test]
    fn residuals_that_are_all_zero_are_no_fault() {
        let diagnostics = of(vec![0.0; 100], 0.1);
        assert!(diagnostics.autocorrelation.is_empty());
        assert_eq!(diagnostics.histogram.counts, [100]);
        assert!(diagnostics.spectrum.iter().all(|line| line[1] == 0.0));
    }
}
