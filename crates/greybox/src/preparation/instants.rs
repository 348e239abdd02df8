//! Steps that change the instants of a recording: a part of it, another grid, signals moved in time.

use super::fault::PreparationFault;
use super::limits;
use greybox_recording::{
    Class, ClassSpan, Interpolation, LONGEST_BRIDGE, MIN_SAMPLES, Recording, Signal, TimeAxis,
};

/// The most samples that a finer grid makes of one.
const FINEST: f64 = 100.0;
/// A grid that is coarser than the recording by less takes values between samples, and no means.
const COARSER: f64 = 1.5;
/// The share of a mean's span that has to be recorded.
const LEAST_RECORDED: f64 = 0.5;
/// How far a number of sample times may be from a whole number. It covers rounding.
const ROUNDING: f64 = 1e-6;

/// Keeps the samples between two times `[s]`.
pub(super) fn cut(
    recording: &mut Recording,
    from: Option<f64>,
    to: Option<f64>,
) -> Result<(), PreparationFault> {
    let kept = recording.time.between(from, to);
    if kept.len() < MIN_SAMPLES {
        let detail = format!(
            "{} samples lie there, of a recording of {:.6} s; {MIN_SAMPLES} at the least make one",
            kept.len(),
            recording.time.duration()
        );
        return Err(PreparationFault::of_step("too_short", detail));
    }
    let begin = recording.time.instant(kept.start);
    recording.start = recording.start.and_then(|start| {
        let later = jiff::SignedDuration::try_from_secs_f64(begin).ok()?;
        start.checked_add(later).ok()
    });
    recording.time = match &recording.time {
        TimeAxis::Uniform { sample_time, .. } => TimeAxis::Uniform {
            sample_time: *sample_time,
            samples: kept.len(),
        },
        TimeAxis::Instants(instants) => {
            let kept = instants[kept.clone()].iter();
            TimeAxis::from_instants(kept.map(|instant| instant - begin).collect(), begin)
        }
    };
    recording.double_hour = None;
    for signal in &mut recording.signals {
        let classes = signal.class_of_each();
        signal.classes = ClassSpan::of(classes[kept.clone()].iter().copied());
        signal.values = signal.values[kept.clone()].to_vec();
    }
    Ok(())
}

/// Moves a signal in time: later by `by` `[s]`.
pub(super) fn shift(signal: &mut Signal, time: &TimeAxis, by: f64) {
    let instants = || (0..time.samples()).map(|k| time.instant(k) - by);
    let values = signal.at(time, instants());
    signal.classes = classes_at(signal, time, instants());
    signal.values = values;
}

/// Puts a recording on a grid of a sample time `[s]` that begins at its first sample. The signals `held` keep their
/// value until the next sample.
pub(super) fn resample(
    recording: &mut Recording,
    sample_time: f64,
    held: &[usize],
) -> Result<(), PreparationFault> {
    let intervals = (recording.time.duration() / sample_time + ROUNDING).floor();
    if intervals + 1.0 < MIN_SAMPLES as f64 {
        let detail = format!("the recording lasts {:.6} s", recording.time.duration());
        return Err(PreparationFault::of_field(
            "sample_time_s",
            "out_of_range",
            detail,
        ));
    }
    if intervals + 1.0 > FINEST * recording.time.samples() as f64 {
        let detail = format!("that makes more than {FINEST} samples of each that was recorded");
        return Err(PreparationFault::of_field(
            "sample_time_s",
            "out_of_range",
            detail,
        ));
    }
    limits::check_values(intervals + 1.0, recording.signals.len())?;
    let grid = TimeAxis::Uniform {
        sample_time,
        samples: intervals as usize + 1,
    };
    for place in held {
        recording.signals[*place].interpolation = Some(Interpolation::Hold);
    }
    for signal in &mut recording.signals {
        *signal = match recording.own_instants {
            true => match sampled(signal, &recording.time) {
                Some((time, sampled)) => on_grid(&sampled, &time, &grid),
                None => Signal {
                    values: vec![f64::NAN; grid.samples()],
                    classes: Vec::new(),
                    ..signal.clone()
                },
            },
            false => on_grid(signal, &recording.time, &grid),
        };
    }
    recording.time = grid;
    recording.own_instants = false;
    Ok(())
}

/// A signal that has instants of its own with these alone: those at which its source says something of it.
fn sampled(signal: &Signal, time: &TimeAxis) -> Option<(TimeAxis, Signal)> {
    let classes = signal.class_of_each();
    let is_told = |k: &usize| !signal.values[*k].is_nan() || classes[*k] != Class::Good;
    let told: Vec<usize> = (0..signal.values.len()).filter(is_told).collect();
    let instants = told.iter().map(|k| time.instant(*k)).collect();
    let sampled = Signal {
        values: told.iter().map(|k| signal.values[*k]).collect(),
        classes: ClassSpan::of(told.iter().map(|k| classes[*k])),
        ..signal.clone()
    };
    (!told.is_empty()).then_some((TimeAxis::Instants(instants), sampled))
}

/// A signal on a grid: its means where the grid is coarser than its samples and it is not held, else its values.
fn on_grid(signal: &Signal, time: &TimeAxis, grid: &TimeAxis) -> Signal {
    let instants = || (0..grid.samples()).map(|k| grid.instant(k));
    let is_held = signal.interpolation == Some(Interpolation::Hold);
    let values = match is_held || grid.sample_time() < COARSER * time.sample_time() {
        true => signal.at(time, instants()),
        false => means(time, &signal.values, grid),
    };
    Signal {
        classes: classes_at(signal, time, instants()),
        values,
        ..signal.clone()
    }
}

/// The mean around each instant of a grid, over one of its sample times, of the straight lines between samples.
/// Missing where less than [`LEAST_RECORDED`] of the span is recorded.
fn means(time: &TimeAxis, values: &[f64], grid: &TimeAxis) -> Vec<f64> {
    let width = grid.sample_time();
    let longest = LONGEST_BRIDGE * time.sample_time() * (1.0 + ROUNDING);
    let mut area = vec![0.0; grid.samples()];
    let mut recorded = vec![0.0; grid.samples()];
    for k in 1..values.len() {
        let (begin, end) = (time.instant(k - 1), time.instant(k));
        let (left, slope) = (values[k - 1], (values[k] - values[k - 1]) / (end - begin));
        if slope.is_nan() || end - begin > longest {
            continue;
        }
        let first = (begin / width + 0.5).floor() as usize;
        let last = ((end / width + 0.5).floor() as usize).min(grid.samples() - 1);
        for place in first..=last {
            let middle = grid.instant(place);
            let (from, to) = (
                begin.max(middle - 0.5 * width),
                end.min(middle + 0.5 * width),
            );
            if to > from {
                area[place] += (to - from) * (left + slope * (0.5 * (from + to) - begin));
                recorded[place] += to - from;
            }
        }
    }
    let duration = time.duration();
    (0..grid.samples())
        .map(|place| {
            let middle = grid.instant(place);
            let span = (middle + 0.5 * width).min(duration) - (middle - 0.5 * width).max(0.0);
            match recorded[place] >= LEAST_RECORDED * span {
                true => area[place] / recorded[place],
                false => f64::NAN,
            }
        })
        .collect()
}

/// The class of the sample next to each instant.
fn classes_at(
    signal: &Signal,
    time: &TimeAxis,
    instants: impl Iterator<Item = f64>,
) -> Vec<ClassSpan> {
    if signal.classes.is_empty() {
        return Vec::new();
    }
    let classes = signal.class_of_each();
    let nearest = |instant: f64| {
        let after = time
            .between(Some(instant), None)
            .start
            .min(classes.len() - 1);
        let before = after.saturating_sub(1);
        let distance = |k: usize| (time.instant(k) - instant).abs();
        classes[if distance(before) < distance(after) {
            before
        } else {
            after
        }]
    };
    // A value that was made of neighbours is not bad because the sample beside it was.
    let usable = |class| {
        if class == Class::Bad {
            Class::Good
        } else {
            class
        }
    };
    ClassSpan::of(instants.map(|instant| usable(nearest(instant))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(samples: u32, sample_time: f64) -> Recording {
        let values = (0..samples).map(|k| f64::from(k) * sample_time).collect();
        Recording::from_samples(sample_time, [("x", "m", values)])
    }

    #[test]
    fn a_coarser_grid_has_means_and_a_finer_one_straight_lines() {
        let mut recording = ramp(101, 0.1);
        recording.signals[0].values[50] += 8.0;
        resample(&mut recording, 1.0, &[]).unwrap();
        assert_eq!(recording.time.samples(), 11);
        let values = &recording.signals[0].values;
        // The ramp itself at inner instants; a tenth of the single sample at that of 5 s.
        for (k, value) in values.iter().enumerate().skip(1).take(9) {
            let expected = k as f64 + if k == 5 { 0.8 } else { 0.0 };
            assert!((value - expected).abs() < 1e-9, "{k}: {value}");
        }
        resample(&mut recording, 0.25, &[]).unwrap();
        assert_eq!(recording.time.samples(), 41);
        assert!((recording.signals[0].values[5] - 1.25).abs() < 1e-9);
    }

    #[test]
    fn signals_with_instants_of_their_own_are_put_on_one_grid_each_by_its_own_samples() {
        // The level comes each second, the valve half a second later each second.
        let values = |first: usize, value: fn(f64) -> f64| {
            let value = |k: usize| match k % 2 == first {
                true => value(0.5 * k as f64),
                false => f64::NAN,
            };
            (0..41).map(value).collect::<Vec<f64>>()
        };
        let signals = [
            ("level", "m", values(0, |t| t)),
            ("valve", "", values(1, |t| -t)),
        ];
        let mut recording = Recording::from_samples(0.5, signals);
        recording.own_instants = true;
        resample(&mut recording, 0.25, &[]).unwrap();
        assert!(!recording.own_instants);
        for (signal, sign) in recording.signals.iter().zip([1.0, -1.0]) {
            for k in 4..70 {
                let expected = sign * 0.25 * k as f64;
                assert!(
                    (signal.values[k] - expected).abs() < 1e-9,
                    "{} {k}",
                    signal.name
                );
            }
        }
    }

    #[test]
    fn a_grid_that_takes_too_much_memory_is_refused_before_it_is_made() {
        let mut recording = ramp(1_000_000, 0.1);
        let fault = resample(&mut recording, 0.002, &[]).unwrap_err();
        assert_eq!(fault.faults[0].code, "too_large");
        assert_eq!(recording.time.samples(), 1_000_000);
    }

    #[test]
    fn a_held_signal_keeps_its_steps_on_a_coarser_grid() {
        let values = (0..101).map(|k| if k < 47 { 0.0 } else { 4.0 }).collect();
        let mut recording = Recording::from_samples(0.1, [("u", "V", values)]);
        resample(&mut recording, 1.0, &[0]).unwrap();
        let expected: Vec<f64> = (0..11).map(|k| if k < 5 { 0.0 } else { 4.0 }).collect();
        assert_eq!(recording.signals[0].values, expected);
    }

    #[test]
    fn what_was_not_recorded_has_no_mean() {
        let mut recording = ramp(101, 0.1);
        recording.signals[0].values[36..64].fill(f64::NAN);
        resample(&mut recording, 1.0, &[]).unwrap();
        let missing: Vec<usize> = (0..11)
            .filter(|k| recording.signals[0].values[*k].is_nan())
            .collect();
        assert_eq!(missing, [4, 5, 6]);
        assert!(resample(&mut recording, 1e-9, &[]).is_err());
        assert!(resample(&mut recording, 100.0, &[]).is_err());
    }

    #[test]
    fn a_part_begins_at_its_own_zero_with_the_clock_moved_along() {
        let mut recording = ramp(101, 0.1);
        recording.start = Some("2026-03-02T08:15:00Z".parse().unwrap());
        recording.signals[0].classes = vec![ClassSpan {
            class: Class::Uncertain,
            first: 18,
            samples: 4,
        }];
        cut(&mut recording, Some(2.0), Some(4.0)).unwrap();
        assert_eq!(recording.time.samples(), 21);
        assert!((recording.signals[0].values[0] - 2.0).abs() < 1e-12);
        assert_eq!(recording.start.unwrap().to_string(), "2026-03-02T08:15:02Z");
        let span = ClassSpan {
            class: Class::Uncertain,
            first: 0,
            samples: 2,
        };
        assert_eq!(recording.signals[0].classes, [span]);
        assert!(cut(&mut recording, Some(7.0), None).is_err());
    }

    #[test]
    fn a_signal_moves_in_time_and_what_it_leaves_is_missing() {
        let mut recording = ramp(11, 0.1);
        let time = recording.time.clone();
        shift(&mut recording.signals[0], &time, 0.25);
        let values = &recording.signals[0].values;
        assert!(values[..3].iter().all(|value| value.is_nan()));
        assert!((values[6] - 0.35).abs() < 1e-12);
        shift(&mut recording.signals[0], &time, -0.25);
        assert!((recording.signals[0].values[4] - 0.4).abs() < 1e-12);
    }
}
