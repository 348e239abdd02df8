//! Recordings that the program makes itself: the paper's rig, simulated and measured as a data
//! logger would, so that every estimate can be held against a truth that is known.
//!
//! Each is 120 s at 100 Hz: the `reference` of the position loop, the `valve_command` that the
//! controller gave, and the `position` that a potentiometer of 12 bits saw. The loop itself closes
//! on the true position. The same recording and seed give the same bits.
//!
//! | | excitation ([`excitation`]) | rig ([`rig`]) | also recorded |
//! |---|---|---|---|
//! | A, "textbook" | ±25 mm and ±10 mm, fast and slow | nominal | |
//! | B, "as in the paper" | ±10 mm | with the imperfections of a real rig | |
//! | C | as A | nominal | both chamber pressures |
//! | D | as A | as B | |

pub mod excitation;
mod job;
pub mod rig;
pub mod sensors;
mod variant;

pub use job::job;
pub use variant::{Demo, SAMPLE_TIME, SAMPLES};

use greybox_recording::{Recording, Signal, TimeAxis};

/// The recording of [`SAMPLES`] samples, SI.
#[must_use]
pub fn recording(demo: Demo, seed: u64) -> Recording {
    recording_of(demo, seed, SAMPLES)
}

/// The first `samples` samples of the recording.
#[must_use]
pub fn recording_of(demo: Demo, seed: u64, samples: usize) -> Recording {
    let parameters = rig::parameters(demo);
    let reference = if demo.has_paper_excitation() {
        excitation::as_in_the_paper(seed, samples)
    } else {
        excitation::textbook(seed, samples)
    };
    let trajectory = rig::simulate(&parameters, &reference);
    let command = rig::command(&reference, &trajectory.position);
    let position = sensors::potentiometer(&trajectory.position);
    let mut signals = vec![
        Signal::new("reference", "m", reference),
        Signal::new("valve_command", "1", command),
        Signal::new("position", "m", position),
    ];
    if demo.has_pressure_sensors() {
        let [chamber_1, chamber_2] = sensors::pressures(seed, &trajectory.chamber_pressures);
        signals.push(Signal::new("chamber_pressure_1", "Pa", chamber_1));
        signals.push(Signal::new("chamber_pressure_2", "Pa", chamber_2));
    }
    let time = TimeAxis::Uniform {
        sample_time: SAMPLE_TIME,
        samples,
    };
    let mut recording = Recording::new(time, signals);
    recording.name = Some(format!(
        "demonstration recording {}, seed {seed}",
        demo.letter()
    ));
    recording
}

/// Every parameter of the rig by its name, SI, in the order of the model's description.
#[must_use]
pub fn true_parameters(demo: Demo) -> Vec<(String, f64)> {
    let model = rig::model();
    let names = model.description().parameters.iter();
    names
        .map(|parameter| parameter.name.to_string())
        .zip(rig::parameters(demo))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values<'a>(recording: &'a Recording, name: &str) -> &'a [f64] {
        let signal = recording.signal(name).expect("a recorded signal");
        &signal.values
    }

    #[test]
    fn a_recording_repeats_with_its_seed_and_differs_with_another() {
        let bits = |seed| {
            let recording = recording_of(Demo::C, seed, 300);
            let all = recording.signals.iter().flat_map(|signal| &signal.values);
            all.map(|value| value.to_bits()).collect::<Vec<_>>()
        };
        assert_eq!(bits(1), bits(1));
        assert_ne!(bits(1), bits(2));
    }

    #[test]
    fn a_shorter_recording_is_the_beginning_of_a_longer_one() {
        let (short, long) = (recording_of(Demo::C, 4, 100), recording_of(Demo::C, 4, 400));
        for (short, long) in short.signals.iter().zip(&long.signals) {
            assert_eq!(short.values[..], long.values[..100], "{}", short.name);
        }
    }

    #[test]
    fn signals_are_those_of_the_data_logger() {
        for demo in Demo::ALL {
            let recording = recording_of(demo, 1, 50);
            let names: Vec<&str> = recording.signals.iter().map(|s| s.name.as_str()).collect();
            assert_eq!(names[..3], ["reference", "valve_command", "position"]);
            let pressures = ["chamber_pressure_1", "chamber_pressure_2"];
            assert_eq!(names[3..], pressures[..if demo == Demo::C { 2 } else { 0 }]);
            assert!(recording.signals.iter().all(|s| s.values.len() == 50));
        }
    }

    #[test]
    fn position_stands_on_the_codes_of_twelve_bits_within_half_a_code_of_the_truth() {
        let code = 0.14 / 4095.0;
        let recording = recording_of(Demo::A, 3, 2000);
        let reference = values(&recording, "reference").to_vec();
        let truth = rig::simulate(&rig::parameters(Demo::A), &reference).position;
        for (measured, truth) in values(&recording, "position").iter().zip(truth) {
            let codes = measured / code;
            assert!((codes - codes.round()).abs() < 1e-9);
            assert!((measured - truth).abs() <= 0.5 * code * (1.0 + 1e-9));
        }
    }

    #[test]
    fn the_command_is_the_controllers_and_drives_the_rig_to_the_same_trajectory() {
        let recording = recording_of(Demo::D, 5, 1000);
        let command = values(&recording, "valve_command");
        assert!(command.iter().all(|u| (-1.0..=1.0).contains(u)));
        assert!(command.contains(&1.0) && command.contains(&-1.0));
        let parameters = rig::parameters(Demo::D);
        let closed = rig::simulate(&parameters, values(&recording, "reference")).position;
        let open = rig::simulate_under_command(&parameters, command).position;
        let apart = closed.iter().zip(&open).map(|(a, b)| (a - b).abs());
        // The command is computed from the same position to rounding, and the rig is stable.
        assert!(apart.fold(0.0, f64::max) < 1e-9);
    }

    #[test]
    fn pressures_carry_noise_of_a_thousandth_of_their_range() {
        let recording = recording_of(Demo::C, 6, 4000);
        let reference = values(&recording, "reference").to_vec();
        let truth = rig::simulate(&rig::parameters(Demo::C), &reference).chamber_pressures;
        for (name, truth) in ["chamber_pressure_1", "chamber_pressure_2"]
            .iter()
            .zip(truth)
        {
            let errors = values(&recording, name)
                .iter()
                .zip(&truth)
                .map(|(m, t)| m - t);
            let mean_square = errors.map(|e| e * e).sum::<f64>() / 4000.0;
            // Five standard errors of a variance estimated from 4000 numbers.
            let tolerance = 5.0 * (2.0f64 / 4000.0).sqrt();
            assert!((mean_square / 7e3f64.powi(2) - 1.0).abs() < tolerance);
        }
    }

    #[test]
    fn the_imperfect_rig_differs_from_the_nominal_one_in_five_parameters() {
        let differing = |demo| {
            let nominal = true_parameters(Demo::A);
            let differing = true_parameters(demo).into_iter().zip(nominal);
            let differing = differing.filter(|(this, nominal)| this.1 != nominal.1);
            differing.map(|(this, _)| this).collect::<Vec<_>>()
        };
        let expected = [
            ("flow_gain", 1.03 * 8.91e-8),
            ("spool_natural_frequency", 60.0 * std::f64::consts::TAU),
            ("dead_band", 0.02),
            ("valve_offset", 0.01),
            ("coulomb_friction", 100.0),
        ];
        for demo in [Demo::B, Demo::D] {
            let found = differing(demo);
            let found: Vec<_> = found.iter().map(|(name, v)| (name.as_str(), *v)).collect();
            assert_eq!(found, expected);
        }
        assert!(differing(Demo::C).is_empty());
    }
}
