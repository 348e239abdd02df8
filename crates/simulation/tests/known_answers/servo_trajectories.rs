//! The servo against trajectories of other integrators.
//!
//! Three come from two independent adaptive integrators that agree with each other to 1e-10 m and
//! 0.5 Pa (`reference/manifest.json`); two, with every switchable effect on and with the piston
//! stalled at its stops, from `scripts/all_effects.py`.

use greybox_numerics::lanes::Lanes;
use greybox_simulation::batch::{self, BatchRun, Sink};
use greybox_simulation::model::{Catalogue, Model};
use greybox_simulation::{Accuracy, DrivingInputs, SimulatedCandidate, single};
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/known_answers/reference");

/// The manifest's symbols and the model's names.
const NAMES: [(&str, &str); 22] = [
    ("M", "mass"),
    ("B", "damping"),
    ("Ks", "stiffness"),
    ("Km", "bulk_modulus"),
    ("Kq", "flow_gain"),
    ("u0", "valve_offset"),
    ("ps", "supply_pressure"),
    ("pt", "return_pressure"),
    ("d0", "transition_pressure"),
    ("Fc", "coulomb_friction"),
    ("vs", "friction_velocity"),
    ("xs0", "spring_neutral_position"),
    ("ci", "internal_leakage"),
    ("A1", "piston_area"),
    ("A2", "annulus_area"),
    ("L", "stroke"),
    ("V01", "dead_volume_1"),
    ("V02", "dead_volume_2"),
    ("wv", "spool_natural_frequency"),
    ("zv", "spool_damping_ratio"),
    ("Kp", "position_gain"),
    ("db", "dead_band"),
];

struct Reference {
    parameters: BTreeMap<String, f64>,
    /// time, reference, valve command, position, velocity, both chamber pressures
    columns: Vec<Vec<f64>>,
    input_set: usize,
}

impl Reference {
    fn read(name: &str, entry: &Value, parameters: BTreeMap<String, f64>) -> Reference {
        let mut reader = csv::Reader::from_path(format!("{FOLDER}/{name}.csv")).unwrap();
        let mut columns = vec![Vec::new(); 7];
        for record in reader.deserialize::<[f64; 7]>() {
            for (column, value) in columns.iter_mut().zip(record.unwrap()) {
                column.push(value);
            }
        }
        let input_set = usize::from(entry["input"] == "valve_command");
        Reference {
            parameters,
            columns,
            input_set,
        }
    }

    /// One of the three of `manifest.json`.
    fn of_manifest(name: &str) -> Reference {
        let manifest = json("manifest.json");
        let entry = &manifest[name];
        let value = |symbol: &str| entry["parameters"][symbol].as_f64().unwrap();
        let named = NAMES
            .iter()
            .map(|(symbol, name)| ((*name).to_owned(), value(symbol)));
        Reference::read(name, entry, named.collect())
    }

    /// One of the two of `scripts/all_effects.py`.
    fn of_script(name: &str) -> Reference {
        let entry = json(&format!("{name}.json"));
        let parameters = entry["parameters"].as_object().unwrap();
        let named = parameters
            .iter()
            .map(|(name, value)| (name.clone(), value.as_f64().unwrap()));
        Reference::read(name, &entry, named.collect())
    }

    fn input(&self) -> &[f64] {
        &self.columns[1 + self.input_set]
    }
}

fn json(file: &str) -> Value {
    let text = std::fs::read_to_string(format!("{FOLDER}/{file}")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn servo() -> Arc<Model> {
    Catalogue::built_in()
        .get("single_rod_servo")
        .unwrap()
        .clone()
}

/// Position, velocity and both pressures of the servo under an input.
fn simulate(parameters: &BTreeMap<String, f64>, input_set: usize, input: &[f64]) -> Vec<Vec<f64>> {
    simulate_as(Accuracy::Full, parameters, (input_set, input))
}

fn simulate_as(
    accuracy: Accuracy,
    parameters: &BTreeMap<String, f64>,
    (input_set, input): (usize, &[f64]),
) -> Vec<Vec<f64>> {
    let model = servo();
    let mut values = model.description().defaults();
    for (name, value) in parameters {
        let index = model.description().parameter_index(name);
        values[index.unwrap_or_else(|| panic!("the servo has no parameter `{name}`"))] = *value;
    }
    let excitation = DrivingInputs {
        sample_time: 0.01,
        instants: None,
        samples: input.len(),
        input_set,
        inputs: &[input.to_vec()],
        accuracy,
    };
    let candidate = SimulatedCandidate {
        parameters: &values,
        initial_state: &[None; 6],
    };
    let stop = AtomicBool::new(false);
    let outputs = single::outputs(model.plant(), &[(excitation, candidate)], &stop);
    outputs.unwrap().unwrap().remove(0)
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

fn range(values: &[f64]) -> f64 {
    let high = values.iter().copied().fold(f64::MIN, f64::max);
    high - values.iter().copied().fold(f64::MAX, f64::min)
}

fn assert_agrees(name: &str, reference: &Reference, largest_position_difference: f64) {
    let simulated = simulate(
        &reference.parameters,
        reference.input_set,
        reference.input(),
    );
    let position = largest_difference(&simulated[0], &reference.columns[3]);
    assert!(
        position <= largest_position_difference,
        "{name}: {position} m apart"
    );
    for (output, column) in [(2, 5), (3, 6)] {
        let share = largest_difference(&simulated[output], &reference.columns[column])
            / range(&reference.columns[column]);
        assert!(share <= 1e-3, "{name}: pressure {share} of its range apart");
    }
}

#[test]
fn the_nominal_closed_loop_agrees() {
    let name = "nominal_closed_loop";
    assert_agrees(name, &Reference::of_manifest(name), 1e-7);
}

#[test]
fn the_closed_loop_with_friction_dead_band_offset_and_leakage_agrees() {
    let name = "effects_closed_loop";
    assert_agrees(name, &Reference::of_manifest(name), 1e-7);
}

#[test]
fn other_parameters_under_a_recorded_valve_command_agree() {
    let name = "other_parameters_valve_command";
    assert_agrees(name, &Reference::of_manifest(name), 1e-7);
}

#[test]
fn every_switchable_effect_together_agrees() {
    let name = "all_effects_closed_loop";
    assert_agrees(name, &Reference::of_script(name), 1e-7);
}

/// The servo stalls against both end stops, where fixed explicit steps would be unstable. The
/// impact itself is resolved to a tenth of a micrometre or better.
#[test]
fn a_piston_stalled_at_its_stops_agrees() {
    let name = "stalled_valve_command";
    assert_agrees(name, &Reference::of_script(name), 1e-6);
}

/// A tenth of a micrometre is a twentieth of what the steps of a ranking err by themselves.
#[test]
fn ranking_in_single_precision_moves_the_piston_by_less_than_a_tenth_of_a_micrometre() {
    let references = [
        Reference::of_manifest("nominal_closed_loop"),
        Reference::of_manifest("effects_closed_loop"),
        Reference::of_manifest("other_parameters_valve_command"),
        Reference::of_script("all_effects_closed_loop"),
        Reference::of_script("stalled_valve_command"),
    ];
    for reference in references {
        let input = (reference.input_set, reference.input());
        let [ranked, screened] = [Accuracy::Ranking, Accuracy::Screening]
            .map(|accuracy| simulate_as(accuracy, &reference.parameters, input).remove(0));
        let squares = ranked.iter().zip(&screened).map(|(a, b)| (a - b).powi(2));
        let rms = (squares.sum::<f64>() / ranked.len() as f64).sqrt();
        assert!(rms > 0.0, "both are of the same precision");
        assert!(rms < 1e-7, "{rms} m apart");
    }
}

/// Where each candidate's piston stands at each sample, by the candidate's place.
fn positions(accuracy: Accuracy, candidates: &[Vec<f64>], input: &[f64]) -> Vec<Vec<f64>> {
    struct Positions(Vec<Lanes>);
    impl Sink for Positions {
        fn consume(&mut self, _first_sample: usize, outputs: &[Lanes]) {
            self.0.extend(outputs.chunks_exact(4).map(|row| row[0]));
        }
    }
    let candidate = |parameters| SimulatedCandidate {
        parameters,
        initial_state: &[None; 6],
    };
    let run = BatchRun {
        excitation: DrivingInputs {
            sample_time: 0.01,
            instants: None,
            samples: input.len(),
            input_set: 0,
            inputs: &[input.to_vec()],
            accuracy,
        },
        candidates: candidates.iter().map(|c| candidate(c.as_slice())).collect(),
        in_step: 0,
    };
    let model = servo();
    let stop = AtomicBool::new(false);
    let pieces = batch::simulate(model.plant(), &[run], &stop, |_| Positions(Vec::new()));
    let mut positions = vec![Vec::new(); candidates.len()];
    for piece in pieces.unwrap() {
        for (lane, &member) in piece.members.iter().enumerate() {
            assert!(positions[member].is_empty(), "a candidate comes out once");
            positions[member] = piece.sink.0.iter().map(|row| row.0[lane]).collect();
        }
    }
    positions
}

/// More candidates than a block of either precision holds, some with friction and some without,
/// in no order of their rates.
#[test]
fn every_candidate_of_a_ranking_comes_out_in_its_place() {
    let reference = Reference::of_manifest("nominal_closed_loop");
    let input = &reference.input()[..600];
    let description = servo().description().clone();
    let place = |name: &str| description.parameter_index(name).unwrap();
    let candidates: Vec<Vec<f64>> = (0..37)
        .map(|index| {
            let mut candidate = description.defaults();
            candidate[place("mass")] *= 0.7 + f64::from(index * 17 % 37) * 0.02;
            candidate[place("coulomb_friction")] = f64::from(index % 5) * 20.0;
            candidate
        })
        .collect();
    let [ranked, screened] = [Accuracy::Ranking, Accuracy::Screening]
        .map(|accuracy| positions(accuracy, &candidates, input));
    for (index, (ranked, screened)) in ranked.iter().zip(&screened).enumerate() {
        let own = largest_difference(ranked, screened);
        assert!(own < 1e-6, "candidate {index}: {own} m apart");
    }
    for (a, b) in screened.iter().zip(&screened[1..]) {
        assert!(largest_difference(a, b) > 1e-5, "the candidates differ");
    }
}

/// A valve that lags in second order is simulated by equations of its own while nobody beside it
/// needs others; that must not show, and a valve with another lag must not get them.
#[test]
fn every_lag_of_the_valve_moves_alone_as_beside_the_others() {
    let reference = Reference::of_manifest("nominal_closed_loop");
    let input = &reference.input()[..600];
    let description = servo().description().clone();
    let place = |name: &str| description.parameter_index(name).unwrap();
    let second_order = description.defaults();
    let [late, soon, direct] = [4e-3, 1e-3, 0.0].map(|time_constant| {
        let mut candidate = second_order.clone();
        candidate[place("spool_natural_frequency")] = 0.0;
        candidate[place("spool_time_constant")] = time_constant;
        candidate
    });
    let candidates = [second_order, late, soon, direct];
    for accuracy in [Accuracy::Ranking, Accuracy::Screening, Accuracy::Full] {
        let together = positions(accuracy, &candidates, input);
        for (candidate, beside) in candidates.iter().zip(&together) {
            let alone = &positions(accuracy, std::slice::from_ref(candidate), input)[0];
            let bits = |track: &[f64]| track.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(alone), bits(beside));
        }
        // The shorter the lag, the nearer to none; each is a motion of its own.
        let [second_order, late, soon, direct] = &together[..] else {
            panic!("four candidates went in")
        };
        let [far, near] = [late, soon].map(|track| largest_difference(track, direct));
        assert!(far > 2.0 * near && near > 1e-5, "{far} and {near} m");
        assert!(largest_difference(second_order, direct) > 1e-5);
    }
}

/// (M, B, Ks, Km, forces, pressures, d0)·λ with Kq/√λ and leakage/λ leaves the motion as it is.
/// λ is a power of four, so that every scaled number is exact and only the order of rounding in
/// roots can differ.
#[test]
fn scaling_masses_forces_and_pressures_together_leaves_the_motion_unchanged() {
    let reference = Reference::of_manifest("effects_closed_loop");
    let scale = 4.0;
    let mut scaled = reference.parameters.clone();
    for (name, value) in &mut scaled {
        *value *= match name.as_str() {
            "mass"
            | "damping"
            | "stiffness"
            | "bulk_modulus"
            | "supply_pressure"
            | "return_pressure"
            | "transition_pressure"
            | "coulomb_friction" => scale,
            "flow_gain" => 1.0 / f64::sqrt(scale),
            "internal_leakage" => 1.0 / scale,
            _ => 1.0,
        };
    }
    let plain = simulate(
        &reference.parameters,
        reference.input_set,
        reference.input(),
    );
    let other = simulate(&scaled, reference.input_set, reference.input());
    let difference = largest_difference(&plain[0], &other[0]) / range(&plain[0]);
    assert!(
        difference <= 1e-12,
        "the motion differs by {difference} of its range"
    );
    let pressure: Vec<f64> = other[2].iter().map(|p| p / scale).collect();
    assert!(largest_difference(&plain[2], &pressure) <= 1e-9 * range(&plain[2]));
}
