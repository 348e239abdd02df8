//! What a program asks for is done as a client's job is, and refused in the same words.

use super::*;
use crate::estimation::{Advance, GenerationRow, Observer, Share, StopReason};
use crate::identification::Outcome;
use crate::identification::outcome::Trust;
use greybox_recording::Recording;
use greybox_simulation::model::Model;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A carriage with 3 N·s/m of viscous friction under a square wave, integrated at a tenth of the
/// sample time, with an error of a tenth of a millimetre that has no pattern.
fn carriage(mass: f64) -> Recording {
    let (mut position, mut velocity) = (0.0, 0.0);
    let forces = (0..200).map(|k| if (k / 17) % 2 == 0 { 20.0 } else { -20.0 });
    let forces: Vec<f64> = forces.collect();
    let positions = forces.iter().enumerate().map(|(k, force)| {
        let now = position + 1e-4 * ((k * k * 7919 % 101) as f64 / 50.0 - 1.0);
        for _ in 0..10 {
            velocity += 2e-3 * (force - 3.0 * velocity) / mass;
            position += 2e-3 * velocity;
        }
        now
    });
    let positions = positions.collect();
    Recording::from_samples(0.02, [("force", "N", forces), ("position", "m", positions)])
}

fn drive() -> Arc<Model> {
    Model::named("positioning_drive").expect("it is in the catalogue")
}

fn identification(experiment: impl Into<Experiment>) -> Identification {
    Identification::new(&drive(), experiment)
        .free("mass", 0.5..=10.0)
        .free("viscous_friction", 0.1..=20.0)
        .fix("coulomb_friction", 0.0)
        .fix("offset", 0.0)
        .noise("position", 1e-3)
        .seed(7)
}

#[test]
fn a_program_and_a_document_that_say_the_same_have_the_same_bits() {
    let job = json!({
        "model": "positioning_drive",
        "experiments": [{}],
        "parameters": {
            "mass": {"estimate": {"lower": 0.5, "upper": 10.0}},
            "viscous_friction": {"estimate": {"lower": 0.1, "upper": 20.0}},
            "coulomb_friction": {"value": 0.0},
            "offset": {"value": 0.0}
        },
        "outputs": {"position": {"noise_std": 1e-3}},
        "seed": 7
    });
    let said = identification(carriage(2.0)).run().expect("an outcome");
    let written = Identification::of_job(job, carriage(2.0)).run();
    assert_eq!(said, written.expect("an outcome"));
    let mass = said
        .parameter("mass")
        .expect("it is free")
        .estimate
        .estimate;
    assert!((mass - 2.0).abs() < 0.02, "{mass}");
}

#[test]
fn experiments_share_what_they_do_not_have_for_themselves() {
    let first = Experiment::new(carriage(2.0)).free("mass", 0.5..=10.0);
    let second = Experiment::new(carriage(4.0)).fix("mass", 4.0);
    let found = identification(first).experiment(second).run();
    let found = found.expect("an outcome");
    let mass = found.parameter("mass").expect("one is free");
    assert_eq!(mass.experiment, Some(0));
    // Euler's steps of a tenth of a sample leave errors of some tenths of a per cent.
    assert!((mass.estimate.estimate - 2.0).abs() < 0.02, "{mass:?}");
    let friction = found.parameter("viscous_friction").expect("it is free");
    assert_eq!(friction.experiment, None);
}

#[test]
fn everything_that_is_wrong_is_said_at_once_with_its_place() {
    let wrong = identification(carriage(2.0))
        .free("mass", 10.0..=0.5)
        .fix("colour", 1.0)
        .noise("position", -1.0);
    let Err(IdentificationError::Invalid(faults)) = wrong.run() else {
        panic!("it cannot be run");
    };
    let places: Vec<&str> = faults.iter().map(|fault| fault.pointer()).collect();
    for place in [
        "/parameters/mass/estimate/lower",
        "/parameters/colour",
        "/outputs/position/noise_std",
    ] {
        assert!(places.contains(&place), "{faults:?}");
    }
}

/// Raises the flag at the second generation.
struct Impatient<'a>(&'a AtomicBool);

impl Observer for Impatient<'_> {
    fn generation(&mut self, row: &GenerationRow) {
        self.0.store(row.generation == 2, Ordering::Relaxed);
    }
}

#[test]
fn a_run_that_is_stopped_has_the_best_so_far_and_says_so() {
    let stop = AtomicBool::new(false);
    let found = identification(carriage(2.0)).run_observed(&stop, &mut Impatient(&stop));
    let found = found.expect("an outcome");
    assert_eq!(found.stop_reason, StopReason::Cancelled);
    assert_eq!(found.verdict.trust, Trust::Low);
}

#[test]
fn what_the_data_cannot_fix_is_refused_by_name() {
    // A carriage that stands still does not tell its mass from its friction.
    let still = |name, unit| (name, unit, vec![0.0; 200]);
    let recording = Recording::from_samples(0.02, [still("force", "N"), still("position", "m")]);
    let settings = crate::uncertainty::Settings {
        flat_directions: crate::uncertainty::settings::FlatDirections::Refuse,
        ..Default::default()
    };
    let found = identification(recording).uncertainty(&settings).run();
    let Err(IdentificationError::NotIdentifiable(findings)) = found else {
        panic!("{found:?}");
    };
    let places: Vec<&str> = findings.iter().map(|finding| &*finding.pointer).collect();
    assert!(places.contains(&"/parameters/mass"), "{findings:?}");
}

/// The text of a checkpoint as commit 2eabe3d wrote it: with the fields of all stages in each.
fn as_2eabe3d_wrote(checkpoint: &Checkpoint) -> String {
    let mut saved = serde_json::to_value(checkpoint).expect("it can be written");
    let fields = saved.as_object_mut().expect("an object");
    for of_one_stage in ["shootings", "twins"] {
        fields.entry(of_one_stage).or_insert_with(|| json!([]));
    }
    let names: Vec<&str> = fields.keys().map(String::as_str).collect();
    let mut expected = vec![
        "search",
        "earlier",
        "searches",
        "descents",
        "shootings",
        "shot_searches",
        "exchanged",
        "twins",
        "phase",
        "stop_reason",
    ];
    if names.contains(&"refits") {
        expected.push("refits");
    }
    expected.sort_unstable();
    let mut names = names;
    names.sort_unstable();
    assert_eq!(names, expected);
    saved.to_string()
}

#[test]
fn an_analysis_of_many_refits_is_saved_between_them_and_goes_on_with_the_same_bits() {
    let settings = crate::uncertainty::Settings {
        intervals: crate::uncertainty::Intervals::Bootstrap,
        bootstrap_samples: 200,
        // Checkpoints of 2eabe3d hold no steps that were tried.
        tried_steps: 0,
        ..Default::default()
    };
    let identification = identification(carriage(2.0)).uncertainty(&settings);
    let whole = identification.run().expect("an outcome");
    let stop = AtomicBool::new(false);
    let mut run = identification.begin().expect("it is sound");
    let mut units_of_analysis = 0;
    while run.advance(&stop, &mut ()) == Advance::Working {
        // Another program goes on from what was written down.
        let saved = as_2eabe3d_wrote(&run.checkpoint());
        units_of_analysis += u32::from(saved.contains("\"bootstrap/0\""));
        let checkpoint = serde_json::from_str(&saved).expect("it reads back");
        let (spec, model) = identification.specification().expect("it is sound");
        run = Run::resume(&spec, &model, &[carriage(2.0)], checkpoint).expect("it goes on");
    }
    assert_eq!(units_of_analysis, 3, "200 refits, 64 at a time");
    let pieces = run.outcome(None, &stop).expect("it is sound");
    // A run that is resumed simulates again what it has seen before, and counts it.
    let pieces = Outcome {
        search: whole.search.clone(),
        ..pieces.expect("an outcome")
    };
    assert_eq!(pieces, whole);
}

#[test]
fn an_experiment_that_only_validates_starts_where_it_starts() {
    // The carriage is on its way already when the second recording begins.
    let whole = carriage(2.0);
    let rest = |name: &str| whole.signal(name).map(|own| own.values[110..].to_vec());
    let rest = |name: &str| rest(name).expect("it is recorded");
    let moving = Recording::from_samples(
        0.02,
        [
            ("force", "N", rest("force")),
            ("position", "m", rest("position")),
        ],
    );
    let checked = Experiment::new(moving).only_validates();
    let found = identification(whole.clone())
        .experiment(checked)
        .hold_back(0.0)
        .run();
    let found = found.expect("an outcome");
    let [position, velocity] = &found.validation_starts[..] else {
        panic!("two states start somewhere: {:?}", found.validation_starts);
    };
    assert_eq!(
        (&*position.state, &*velocity.state),
        ("position", "velocity")
    );
    let positions = &whole.signal("position").expect("it is recorded").values;
    let slope = (positions[112] - positions[108]) / 0.08;
    assert!(
        (velocity.value - slope).abs() < 0.1,
        "{slope}: {velocity:?}"
    );
    assert!(slope.abs() > 0.1, "it moves");
    assert!(
        position.fitted_s > 0.0 && position.fitted_s <= 0.5,
        "{position:?}"
    );
    let errors = |part: &std::collections::BTreeMap<
        String,
        crate::identification::outcome::OutputFit,
    >| { part["position"].rmse.expect("it varies") };
    let (estimated, validated) = (errors(&found.fit.estimation), errors(&found.fit.validation));
    assert!(validated < 1.5 * estimated, "{validated} after {estimated}");
}

/// An identification of the carriage of which a document says more.
fn asked(more: &Value) -> Identification {
    let mut job = json!({
        "model": "positioning_drive",
        "experiments": [{}],
        "parameters": {
            "mass": {"estimate": {"lower": 0.5, "upper": 10.0}},
            "viscous_friction": {"estimate": {"lower": 0.1, "upper": 20.0}},
            "coulomb_friction": {"estimate": {"lower": 1.0, "upper": 500.0}},
            "offset": {"value": 0.0}
        },
        "outputs": {"position": {"noise_std": 1e-3}},
        "seed": 7
    });
    for (section, said) in more.as_object().into_iter().flatten() {
        job[section] = said.clone();
    }
    Identification::of_job(job, carriage(2.0))
}

/// A run that has come to where others can help with it, saved.
fn once_shareable(mut run: Run) -> Checkpoint {
    let stop = AtomicBool::new(false);
    while !run.is_shareable() {
        assert_eq!(run.advance(&stop, &mut ()), Advance::Working);
    }
    run.checkpoint()
}

/// What a run reports of its generations; one that was simulated again is reported of again.
#[derive(Default)]
struct Generations(Vec<GenerationRow>);

impl Observer for Generations {
    fn generation(&mut self, row: &GenerationRow) {
        self.0.push(GenerationRow {
            simulated: Vec::new(),
            ..row.clone()
        });
    }
}

/// How a run and one that helps with it take turns: units of the one, then of the other.
const TURNS: [(usize, usize); 3] = [(1, 1), (5, 1), (1, 7)];

#[test]
fn a_run_that_is_shared_comes_to_the_bits_of_one_that_is_not() {
    let searches = |name: &str| json!({"name": name, "restarts": 6, "stagnation_generations": 4});
    let stop = AtomicBool::new(false);
    for what in [
        json!({"uncertainty": {"intervals": "bootstrap", "bootstrap_samples": 60}}),
        json!({"uncertainty": {"intervals": "profile", "monte_carlo_samples": 100}}),
        json!({"model_search": {"effects": ["coulomb_friction", "offset"]}}),
        json!({"method": searches("icra_genetic")}),
        json!({"method": searches("differential_evolution")}),
        json!({"method": searches("cma_es")}),
    ] {
        let checkpoint = once_shareable(asked(&what).begin().expect("a run"));
        let (spec, model) = asked(&what).specification().expect("a specification");
        let recordings = [carriage(2.0)];
        let resumed =
            || Run::resume(&spec, &model, &recordings, checkpoint.clone()).expect("a run");
        let mut seen_alone = Generations::default();
        let alone = resumed().finish(&stop, &mut seen_alone);
        let alone = in_bits(alone.expect("an outcome"));
        for turns in TURNS {
            let mut seen = Generations::default();
            let (shared, n_helped) = together((resumed(), resumed()), turns, &mut seen);
            assert!(in_bits(shared) == alone, "{what} {turns:?}");
            let rows = |seen: &Generations| format!("{:?}", seen.0);
            assert!(rows(&seen) == rows(&seen_alone), "{what} {turns:?}");
            assert!(n_helped > 0, "{what} {turns:?}");
        }
    }
}

/// All of an outcome but how many candidates were remembered: whoever goes on elsewhere remembers none.
fn in_bits(mut outcome: Outcome) -> Outcome {
    outcome.search.distinct_evaluations = 0;
    outcome
}

/// What a run comes to with one that helps, and the parts that this one did.
fn together(
    (mut run, mut helper): (Run, Run),
    turns: (usize, usize),
    seen: &mut Generations,
) -> (Outcome, usize) {
    let stop = AtomicBool::new(false);
    let shares = [1, 0].map(|index| Share { index, of: 2 });
    let mut n_helped = 0;
    loop {
        for _ in 0..turns.1 {
            let mut helped = shares.iter().map(|share| helper.help(*share, 8, &stop));
            let helped = helped.find(|parts| !parts.is_empty()).unwrap_or_default();
            n_helped += helped.len();
            run.take_parts(through_json(helped));
        }
        for _ in 0..turns.0 {
            run.share(Share { index: 0, of: 2 }, 8);
            let advance = run.advance(&stop, seen);
            helper.take_parts(through_json(run.new_parts()));
            if advance == Advance::Finished {
                let outcome = run.outcome(None, &stop).expect("no fault");
                return (outcome.expect("an outcome"), n_helped);
            }
        }
    }
}

/// As it comes to another node.
fn through_json(parts: Vec<(String, Part)>) -> Vec<(String, Part)> {
    let written = serde_json::to_string(&parts).expect("JSON");
    serde_json::from_str(&written).expect("what was written")
}
