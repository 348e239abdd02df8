//! Documents that run, and documents that are told why they do not.

use super::*;
use crate::model::Model;
use crate::{
    Accuracy, CandidateBlock, DrivingInputs, SimulatedCandidate, SimulationFailure, single,
};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::sync::atomic::AtomicBool;

fn model(document: &Value) -> Model {
    read(document)
        .unwrap_or_else(|faults| panic!("{faults:#?}"))
        .model
}

/// A lag whose rate of change the test writes.
fn lag(derivative: &str) -> Value {
    json!({
        "name": "lag",
        "inputs": {"u": {"unit": "V"}},
        "parameters": {
            "gain": {"symbol": "K", "unit": "m/V", "default": 2.0},
            "time": {"symbol": "T", "unit": "s", "default": 0.5},
            "force": {"symbol": "F", "unit": "N", "default": 1.0},
            "pressure": {"symbol": "p", "unit": "Pa", "default": 1.0}
        },
        "states": {"x": {"unit": "m", "derivative": derivative, "initial": 0}},
        "outputs": {"y": {"unit": "m", "expression": "x"}}
    })
}

fn simulate(
    model: &Model,
    parameters: &[f64],
    inputs: &[Vec<f64>],
) -> Result<Vec<Vec<f64>>, SimulationFailure> {
    let excitation = DrivingInputs {
        sample_time: 0.1,
        instants: None,
        samples: inputs[0].len(),
        input_set: 0,
        inputs,
        accuracy: Accuracy::Full,
    };
    let states = vec![None; model.description().states.len()];
    let candidate = SimulatedCandidate {
        parameters,
        initial_state: &states,
    };
    let simulated = single::outputs(
        model.plant(),
        &[(excitation, candidate)],
        &AtomicBool::new(false),
    );
    simulated.unwrap().map(|mut outputs| outputs.remove(0))
}

fn with(mut document: Value, pointer: &str, value: Value) -> Value {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = document.pointer_mut(parent).unwrap();
    parent
        .as_object_mut()
        .unwrap()
        .insert(key.to_owned(), value);
    document
}

/// The pointers, codes and sentences of what is wrong.
fn faults(document: &Value) -> Vec<(String, String, String)> {
    let faults = read(document).expect_err("the document is wrong");
    let told = faults.into_iter();
    told.map(|fault| {
        (
            fault.pointer().to_owned(),
            fault.code.into_owned(),
            fault.detail.into(),
        )
    })
    .collect()
}

#[test]
fn a_lag_follows_its_closed_form() {
    let model = model(&lag("(K*u - x)/T"));
    let outputs = simulate(&model, &[2.0, 0.5, 1.0, 1.0], &[vec![1.0; 50]]).unwrap();
    for (sample, y) in outputs[0].iter().enumerate() {
        let expected = 2.0 * (1.0 - (-0.1 * sample as f64 / 0.5).exp());
        assert!((y - expected).abs() < 1e-6, "at {sample}: {y} {expected}");
    }
}

#[test]
fn a_first_order_hold_joins_the_samples_by_straight_lines() {
    let integrator = with(lag("K*u/T"), "/options", json!({"input_hold": "first"}));
    let ramp: Vec<f64> = (0..30).map(|k| 0.1 * f64::from(k)).collect();
    let outputs = simulate(&model(&integrator), &[1.0, 1.0, 1.0, 1.0], &[ramp]).unwrap();
    for (sample, y) in outputs[0].iter().enumerate() {
        let t = 0.1 * sample as f64;
        assert!((y - 0.5 * t * t).abs() < 1e-12, "at {sample}: {y}");
    }
}

#[test]
fn a_delay_of_part_of_a_sample_moves_held_and_moving_inputs_by_its_length() {
    let ramp: Vec<f64> = (0..30).map(|k| 0.1 * f64::from(k)).collect();
    for hold in ["zero", "first"] {
        let options = json!({"input_hold": hold, "delay": "T"});
        let document = with(lag("K*u/sample_time*0.1"), "/options", options);
        let document = with(document, "/states/x/unit", json!("unitless"));
        let outputs = simulate(
            &model(&document),
            &[1.0, 0.25, 1.0, 1.0],
            std::slice::from_ref(&ramp),
        )
        .unwrap();
        for (sample, y) in outputs[0].iter().enumerate() {
            let t = (0.1 * sample as f64 - 0.25).max(0.0);
            let whole = (t / 0.1 + 1e-9).floor();
            let steps = 0.01 * whole * (whole - 1.0) / 2.0 + 0.1 * whole * (t - 0.1 * whole);
            let expected = if hold == "zero" { steps } else { 0.5 * t * t };
            assert!(
                (y - expected).abs() < 1e-12,
                "{hold} at {sample}: {y} {expected}"
            );
        }
    }
}

#[test]
fn a_sampled_quantity_is_held_and_remembers_itself() {
    let document = json!({
        "name": "loop",
        "inputs": {"r": {"unit": "m"}},
        "parameters": {"Ki": {"unit": "1/s", "default": 2.0}},
        "sampled": {"sum": {"unit": "m", "expression": "sum + Ki*sample_time*(r - x)", "initial": 0.5}},
        "states": {"x": {"unit": "m", "derivative": "sum / one", "initial": 0}},
        "constants": {"one": {"value": 1, "unit": "s"}},
        "outputs": {"x_out": "x", "sum_out": "sum"}
    });
    let outputs = simulate(&model(&document), &[2.0], &[vec![1.0; 20]]).unwrap();
    let (mut x, mut sum) = (0.0, 0.5);
    for (own_x, own_sum) in outputs[0].iter().zip(&outputs[1]) {
        assert!((own_x - x).abs() < 1e-12, "{own_x} {x}");
        sum += 2.0 * 0.1 * (1.0 - x);
        assert!((own_sum - sum).abs() < 1e-12, "{own_sum} {sum}");
        x += 0.1 * sum;
    }
}

#[test]
fn a_kink_between_two_samples_keeps_the_order_of_the_method() {
    let document = with(lag("-u - 5*abs(x)"), "/states/x/unit", json!("unitless"));
    let document = with(document, "/states/x/initial", json!(0.5));
    let outputs = simulate(&model(&document), &[1.0, 0.5, 1.0, 1.0], &[vec![1.0; 6]]).unwrap();
    let zero = 3.5_f64.ln() / 5.0;
    for (sample, y) in outputs[0].iter().enumerate() {
        let t = 0.1 * sample as f64;
        let expected = if t < zero {
            0.7 * (-5.0 * t).exp() - 0.2
        } else {
            0.2 - 0.2 * (5.0 * (t - zero)).exp()
        };
        assert!((y - expected).abs() < 3e-6, "at {sample}: {y} {expected}");
    }
}

#[test]
fn stiff_friction_is_integrated_and_an_explosion_is_an_honest_failure() {
    let stiff = with(lag("-1e6*(x - u)"), "/states/x/unit", json!("unitless"));
    let outputs = simulate(&model(&stiff), &[1.0; 4], &[vec![1.0; 20]]).unwrap();
    assert!((outputs[0][19] - 1.0).abs() < 1e-7);
    for (derivative, failure) in [
        ("1 + x^2 + 100*x^4", SimulationFailure::Diverged),
        ("sqrt(-1 - x)", SimulationFailure::Diverged),
        ("1/x", SimulationFailure::Diverged),
    ] {
        let document = with(lag(derivative), "/states/x/unit", json!("unitless"));
        assert_eq!(
            simulate(&model(&document), &[1.0; 4], &[vec![1.0; 50]]),
            Err(failure),
            "{derivative}"
        );
    }
    let limited = with(lag("u"), "/options", json!({"valid_while": "x < 1"}));
    let limited = with(limited, "/states/x/unit", json!("unitless"));
    let outcome = simulate(&model(&limited), &[1.0; 4], &[vec![1.0; 50]]);
    assert_eq!(outcome, Err(SimulationFailure::OutOfRange));
}

#[test]
fn lanes_that_repeat_the_first_do_not_count() {
    // Found by fuzzing: a growth of 1e6 per second, eight times over for one candidate.
    let steep = with(lag("x*u*u"), "/states/x/unit", json!("unitless"));
    let steep = model(&with(steep, "/states/x/initial", json!("1e-300")));
    let inputs = [vec![0.0, 1.0, -1e3]];
    let excitation = DrivingInputs {
        sample_time: 1e-3,
        instants: None,
        samples: 3,
        input_set: 0,
        inputs: &inputs,
        accuracy: Accuracy::Screening,
    };
    let parameters = steep.description().defaults();
    let candidate = SimulatedCandidate {
        parameters: &parameters,
        initial_state: &[None],
    };
    let run = |candidates: &[SimulatedCandidate<'_>]| {
        let mut rows = vec![greybox_numerics::lanes::Lanes([0.0; 8]); 3];
        let candidates = CandidateBlock {
            members: candidates,
            in_step: false,
        };
        let mut block = steep.plant().simulator(excitation, candidates);
        assert!(
            block
                .advance(3, &mut rows, &AtomicBool::new(false))
                .is_some()
        );
        (
            block.derivative_evaluations(),
            block.failures()[..].to_vec(),
        )
    };
    let (one, failures) = run(&[candidate]);
    let (all, eight_failures) = run(&[candidate; 8]);
    assert_eq!(failures, eight_failures);
    assert_eq!(all, 8 * one);
}

#[test]
fn every_fault_is_told_at_once_with_its_place() {
    let document = json!({
        "name": "lag",
        "inputs": {"u": {"unit": "V"}},
        "parameters": {"force": {"unit": "N", "default": 1}, "pressure": {"unit": "Pa", "default": 1}},
        "quantities": {"a": "b", "b": "a", "c": "force +\n  pressure"},
        "states": {"x": {"unit": "m", "derivative": "tanh(u, 1) + presure", "initial": "x"}},
        "outputs": {"y": "sine(x)"},
        "option": {}
    });
    let told = faults(&document);
    let codes: Vec<(&str, &str)> = told
        .iter()
        .map(|(p, c, _)| (p.as_str(), c.as_str()))
        .collect();
    for expected in [
        ("/quantities/b", "algebraic_loop"),
        ("/quantities/c", "units_do_not_fit"),
        ("/states/x/derivative", "wrong_number_of_arguments"),
        ("/states/x/derivative", "unknown_name"),
        ("/states/x/initial", "name_not_possible_here"),
        ("/outputs/y", "unknown_function"),
        ("/option", "unknown_field"),
    ] {
        assert!(
            codes.contains(&expected),
            "{expected:?} is not in {told:#?}"
        );
    }
    let sentence = |code: &str| &told.iter().find(|(_, own, _)| own == code).unwrap().2;
    assert!(sentence("unknown_name").contains("did you mean `pressure`"));
    assert!(sentence("unknown_function").contains("did you mean `sin`"));
    let units = sentence("units_do_not_fit");
    assert!(
        units.contains("N (kg·m·s^-2)") && units.contains("Pa (kg·m^-1·s^-2)"),
        "{units}"
    );
    let faults = read(&document).unwrap_err();
    let place = faults
        .iter()
        .find(|fault| fault.code == "units_do_not_fit")
        .unwrap();
    assert_eq!((place.line, place.column.as_deref()), (Some(2), Some("3")));
}

#[test]
fn units_are_checked_over_the_whole_model_unless_a_quantity_opts_out() {
    for (derivative, fits) in [
        ("(K*u - x)/T", true),
        ("K*u", false),
        ("x/T + F/p*1", false),
        ("tanh(x)/T", false),
        ("tanh(x/K/u)*x/T", true),
        ("if(x > u, x, x)/T", false),
        ("signed_sqrt(p, p)/sqrt(p)*x/T", true),
        ("sqrt(x^2)/T", true),
        ("x^T", false),
        ("(x - 0.82)/T", true),
    ] {
        assert_eq!(read(&lag(derivative)).is_ok(), fits, "{derivative}");
    }
    for opted_out in ["1", "unitless"] {
        let document = with(lag("K*u - x"), "/states/x/unit", json!(opted_out));
        let document = with(document, "/parameters/gain/unit", json!(opted_out));
        let document = with(document, "/inputs/u/unit", json!(opted_out));
        assert!(read(&document).is_ok(), "{opted_out}");
    }
}

#[test]
fn a_parameter_that_nothing_uses_is_a_warning() {
    let read = read(&lag("(K*u - x)/T")).unwrap();
    let unused: Vec<&str> = read
        .warnings
        .iter()
        .map(|warning| warning.pointer())
        .collect();
    assert_eq!(unused, ["/parameters/force", "/parameters/pressure"]);
}

#[test]
fn the_hostile_are_bounded() {
    // A chain of names, each defined by the next, cannot exhaust the stack.
    let chain: serde_json::Map<String, Value> = (0..256)
        .map(|k| {
            (
                format!("q{k}"),
                json!(format!("{}q{}{}", "(".repeat(60), k + 1, ")".repeat(60))),
            )
        })
        .collect();
    let document = with(lag("q0"), "/quantities", Value::Object(chain));
    assert!(read(&document).is_err());
    // More operations than a model may have.
    let many: serde_json::Map<String, Value> = (0..256)
        .map(|k| {
            (
                format!("q{k}"),
                json!(format!("sin({k}*K) + cos({k}*T) + exp({k}*u)")),
            )
        })
        .collect();
    assert!(read(&with(lag("x"), "/quantities", Value::Object(many))).is_err());
    let many: serde_json::Map<String, Value> = (0..20_000)
        .map(|k| (format!("wrong name {k}"), json!("?")))
        .collect();
    let told = read(&with(lag("x"), "/quantities", Value::Object(many))).unwrap_err();
    assert!(told.len() < 1000);
    // Unknown names without end are told a hundred times at the most.
    let unknown: Vec<String> = (0..250).map(|k| format!("nosuch{k}")).collect();
    let unknown = json!(unknown.join("+"));
    let many: serde_json::Map<String, Value> = (0..256)
        .map(|k| (format!("q{k}"), unknown.clone()))
        .collect();
    let told = read(&with(lag("x"), "/quantities", Value::Object(many))).unwrap_err();
    assert_eq!(told.len(), 100);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_candidate_does_not_see_its_neighbours(gain in 0.1..5.0f64, time in 0.01..2.0f64) {
        let model = model(&with(lag("(K*sign(u)*abs(x + 1) - x)/T"), "/states/x/unit", json!("unitless")));
        let own = [gain, time, 1.0, 1.0];
        let others: Vec<[f64; 4]> = (0..7).map(|k| [-10.0 * f64::from(k), 1e-3, 1.0, 1.0]).collect();
        let inputs = [(0..40).map(|k| if k % 9 < 4 { 1.0 } else { -1.0 }).collect::<Vec<f64>>()];
        let excitation = DrivingInputs {
            sample_time: 0.1, instants: None, samples: 40, input_set: 0, inputs: &inputs, accuracy: Accuracy::Screening,
        };
        let candidate = |parameters| SimulatedCandidate { parameters, initial_state: &[None] };
        let run = |candidates: &[SimulatedCandidate<'_>]| {
            let mut rows = vec![greybox_numerics::lanes::Lanes([0.0; 8]); 40];
            let candidates = CandidateBlock { members: candidates, in_step: false };
            let mut block = model.plant().simulator(excitation, candidates);
            assert!(block.advance(40, &mut rows, &AtomicBool::new(false)).is_some());
            rows.iter().map(|row| row.0[0].to_bits()).collect::<Vec<_>>()
        };
        let alone = run(&[candidate(&own)]);
        let mut all = vec![candidate(&own)];
        all.extend(others.iter().map(|other| candidate(other.as_slice())));
        prop_assert_eq!(alone, run(&all));
    }

    #[test]
    fn no_document_makes_the_reader_panic(
        derivative in "[-+*/^(),<>=. a-zKTuxFp0-9]{0,60}",
        unit in "[a-zA-Z0-9*/^() ]{0,12}",
        initial in prop_oneof![Just(json!(null)), Just(json!([])), Just(json!("first_sample")), Just(json!("K"))],
    ) {
        let document = with(lag(&derivative), "/states/x/unit", json!(unit));
        let document = with(document, "/states/x/initial", initial);
        if let Ok(read) = read(&document) {
            drop(simulate(&read.model, &[1.0, 0.5, 1.0, 1.0], &[vec![1.0; 5]]));
        }
    }
}

#[test]
fn the_fastest_mode_is_found_where_the_document_does_not_say_it() {
    // It swings at 30 and creeps at 0.5 [1/s].
    let document = json!({
        "name": "swing",
        "parameters": {
            "rate": {"symbol": "r", "unit": "1/s", "default": 30},
            "creep": {"symbol": "c", "unit": "1/s", "default": 0.5}
        },
        "states": {
            "x": {"unit": "", "derivative": "rate*v", "initial": 1},
            "v": {"unit": "", "derivative": "-rate*x", "initial": 0},
            "slow": {"unit": "", "derivative": "(x - slow)*creep", "initial": 0}
        },
        "outputs": {"y": {"unit": "", "expression": "x"}}
    });
    let rate = model(&document).plant().fastest_rate(&[30.0, 0.5]);
    assert!((rate - 30.0).abs() < 1e-9, "{rate}");
}

#[test]
fn equations_name_states_and_quantities_by_their_symbols_on_both_sides() {
    let document = json!({
        "name": "lag",
        "inputs": {"drive": {"symbol": "u", "unit": "V"}},
        "parameters": {"time": {"symbol": "T", "unit": "s", "default": 0.5}},
        "quantities": {"difference": {"symbol": "d", "unit": "V", "expression": "u - x"}},
        "states": {"level": {"symbol": "x", "unit": "V", "derivative": "d/T", "initial": 0}},
        "outputs": {"reading": {"unit": "V", "expression": "x"}}
    });
    let model = model(&document);
    let equations = &model.description().equations;
    assert_eq!(equations, &["d = u - x", "x' = d/T", "reading = x"]);
}
