//! Whether a sensor stood still, or lay at an end of its range, while the plant moved.

/// A sensor stands still where it gives one value so many times in a row at the least …
const LEAST_RUN: usize = 20;
/// … in so large a share of its samples …
const SHARE: f64 = 1.0 / 3.0;
/// … although so large a share of its samples changes elsewhere.
const USUAL_CHANGES: f64 = 0.9;

/// Whether the samples of a sensor are one value, or stand still in a third of a window in which nearly every sample
/// differs from the one before elsewhere. A sensor of few steps, which stands still by nature, does not. NaN is a
/// missing sample.
#[must_use]
pub fn stands_still(samples: &[f64]) -> bool {
    let measured = samples.iter().copied().filter(|sample| !sample.is_nan());
    let measured: Vec<f64> = measured.collect();
    let (mut still, mut runs) = (0, 0);
    for run in measured.chunk_by(|sample, next| sample == next) {
        if run.len() == measured.len() {
            return run.len() > 1;
        }
        runs += 1;
        if run.len() >= LEAST_RUN {
            still += run.len();
            runs -= 1;
        }
    }
    let elsewhere = measured.len() - still;
    let changes_elsewhere = f64::from(runs) >= USUAL_CHANGES * elsewhere as f64;
    still as f64 >= SHARE * measured.len() as f64 && elsewhere >= LEAST_RUN && changes_elsewhere
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(samples: usize) -> Vec<f64> {
        (0..samples).map(|k| (k as f64 * 1e3).sin()).collect()
    }

    #[test]
    fn a_sensor_that_froze_or_clips_stands_still_and_one_of_few_steps_does_not() {
        let frozen = [noise(300), vec![0.7; 200]].concat();
        let clipped: Vec<f64> = (0..600)
            .map(|k| ((k as f64 * 0.02).sin() + 0.01 * (k as f64 * 1e3).sin()).min(0.4))
            .collect();
        let few_steps: Vec<f64> = (0..600).map(|k| f64::from(k / 40)).collect();
        let short = [noise(300), vec![0.7; 30], noise(300)].concat();
        let mut gaps = frozen.clone();
        gaps.iter_mut()
            .step_by(7)
            .for_each(|sample| *sample = f64::NAN);
        for (samples, expected) in [
            (vec![1.0; 5], true),
            (frozen, true),
            (clipped, true),
            (gaps, true),
            (few_steps, false),
            (short, false),
            (noise(500), false),
            (vec![f64::NAN; 9], false),
            (Vec::new(), false),
        ] {
            assert_eq!(
                stands_still(&samples),
                expected,
                "{:?}",
                &samples[..samples.len().min(5)]
            );
        }
    }
}
