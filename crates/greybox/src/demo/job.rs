//! The jobs that belong to the recordings.

use super::Demo;
use super::rig::{imperfect_parameters, model};
use super::sensors::{POSITION_NOISE, PRESSURE_NOISE};
use serde_json::{Map, Value, json};

/// The seed of the search, so that a demonstration repeats.
const SEED: u64 = 1;

/// A job for the recording, as it is submitted but without the dataset's id: what the model calls
/// unknown, in the model's search box. For D also the parameters in which its rig differs from
/// the data sheet; for B not, as in the paper, which is why its result must not be trusted.
#[must_use]
pub fn job(demo: Demo) -> Value {
    let mut outputs = Map::new();
    let mut signals = Map::new();
    signals.insert("reference".to_owned(), json!("reference"));
    let measured: &[(&str, f64)] = &[
        ("position", POSITION_NOISE),
        ("chamber_pressure_1", PRESSURE_NOISE),
        ("chamber_pressure_2", PRESSURE_NOISE),
    ];
    let n_measured = if demo.has_pressure_sensors() { 3 } else { 1 };
    for &(output, noise) in &measured[..n_measured] {
        signals.insert(output.to_owned(), json!(output));
        outputs.insert(output.to_owned(), json!({ "noise_std": noise }));
    }
    json!({
        "name": format!("demonstration {}", demo.letter()),
        "labels": { "demonstration": demo.letter().to_string().to_lowercase() },
        "model": model().description().name,
        "experiments": [{ "signals": signals }],
        "parameters": free_parameters(demo),
        "outputs": outputs,
        "seed": SEED,
    })
}

/// The search ranges, written out so that the document says what is looked for and where.
fn free_parameters(demo: Demo) -> Value {
    let model = model();
    let description = model.description();
    let is_free = |name: &str| {
        let known_to_differ =
            demo == Demo::D && imperfect_parameters().any(|parameter| parameter == name);
        let index = description.parameter_index(name);
        known_to_differ || index.is_some_and(|at| description.parameters[at].unknown_by_default)
    };
    let ranges = description
        .parameters
        .iter()
        .filter(|parameter| is_free(&parameter.name))
        .map(|parameter| {
            let estimate = json!({
                "lower": parameter.lower,
                "upper": parameter.upper,
                "scale": parameter.scale,
            });
            (parameter.name.to_string(), json!({ "estimate": estimate }))
        });
    Value::Object(ranges.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn free(demo: Demo) -> Vec<String> {
        let job = job(demo);
        let parameters = job["parameters"].as_object().expect("an object");
        parameters.keys().cloned().collect()
    }

    #[test]
    fn the_four_unknowns_of_the_paper_are_free_and_for_d_also_what_its_rig_has() {
        let four = ["mass", "damping", "stiffness", "bulk_modulus"];
        for demo in [Demo::A, Demo::B, Demo::C] {
            assert_eq!(free(demo), four);
        }
        let mut nine = free(Demo::D);
        nine.sort();
        let mut expected = four.to_vec();
        expected.extend(["flow_gain", "valve_offset", "coulomb_friction", "dead_band"]);
        expected.push("spool_natural_frequency");
        expected.sort_unstable();
        assert_eq!(nine, expected);
    }

    #[test]
    fn every_true_value_lies_inside_its_search_range() {
        for demo in Demo::ALL {
            let job = job(demo);
            let truths = crate::demo::true_parameters(demo);
            for name in free(demo) {
                let range = &job["parameters"][&name]["estimate"];
                let bound = |side| range[side].as_f64().expect("a number");
                let truth = truths.iter().find(|(own, _)| *own == name);
                let truth = truth.expect("a true value").1;
                assert!(truth > 1.1 * bound("lower"), "{demo:?} {name}");
                assert!(truth < 0.9 * bound("upper"), "{demo:?} {name}");
            }
        }
    }
}
