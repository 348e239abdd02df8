//! Reports of real jobs on a mass on a spring that swings for a minute.

use super::{Report, markdown, render};
use crate::identification::assemble::{ExperimentTrajectory, trajectory};
use crate::identification::{Identification, JobSpec, Outcome};
use greybox_recording::Recording;
use greybox_simulation::model::Model;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A trajectory without outputs at these instants.
pub fn experiment(time: Vec<f64>) -> ExperimentTrajectory {
    ExperimentTrajectory {
        dataset: "ds_00000000000000000000000000000001"
            .parse()
            .expect("an identifier"),
        estimation_samples: time.len(),
        time,
        outputs: Vec::new(),
    }
}

/// A mass of 2 kg on a spring of 400 N/m with a damper of 3 N·s/m, driven near its resonance.
fn swinging() -> Recording {
    const PARTS: u32 = 10;
    let sample_time = 0.02;
    let step = sample_time / f64::from(PARTS);
    let forces = (0..3000).map(|k| 20.0 * (14.0 * sample_time * f64::from(k)).sin());
    let forces: Vec<f64> = forces.collect();
    let (mut position, mut velocity) = (0.0, 0.0);
    let positions = forces.iter().enumerate().map(|(k, force)| {
        let now = position + 1e-4 * ((k * k * 7919 % 101) as f64 / 50.0 - 1.0);
        for _ in 0..PARTS {
            velocity += step * (force - 3.0 * velocity - 400.0 * position) / 2.0;
            position += step * velocity;
        }
        now
    });
    let positions = positions.collect();
    let signals = [("force", "N", forces), ("displacement", "m", positions)];
    Recording::from_samples(sample_time, signals)
}

/// A job that is done.
struct Done {
    spec: JobSpec,
    model: Arc<Model>,
    outcome: Outcome,
    experiments: Vec<ExperimentTrajectory>,
}

impl Done {
    fn run(model: &str) -> Done {
        let job = json!({
            "model": model,
            "experiments": [{}],
            "parameters": {"coulomb_friction": {"value": 0.0}},
            "outputs": {"displacement": {"noise_std": 6e-5}},
            "uncertainty": {"intervals": "profile"},
            "seed": 7
        });
        let identification = Identification::of_job(job, swinging());
        let (spec, model) = identification.specification().expect("a specification");
        let outcome = identification.run().expect("an outcome");
        let recordings = [Arc::new(swinging())];
        let stop = AtomicBool::new(false);
        let experiments = trajectory(&spec, &model, &recordings, &outcome, &stop);
        Done {
            experiments: experiments.expect("a simulation").expect("not stopped"),
            spec,
            model,
            outcome,
        }
    }

    fn report(&self) -> Report<'_> {
        Report {
            title: "spring",
            finished_at: None,
            spec: &self.spec,
            model: self.model.description(),
            recordings: &[],
            outcome: &self.outcome,
            generations: &[],
            experiments: &self.experiments,
            disturbances: &[],
        }
    }
}

/// The parts of a page between an opening and the next closing text.
fn between<'p>(page: &'p str, open: &str, close: &str) -> Vec<&'p str> {
    let parts = page.split(open).skip(1);
    parts
        .filter_map(|part| Some(part.split_once(close)?.0))
        .collect()
}

#[test]
fn a_report_shows_profiles_equations_and_a_stretch_of_a_dense_line() {
    let done = Done::run("mass_spring_damper");
    let page = render(&done.report());

    let profiles = between(&page, "<h2>Likelihood profiles</h2>", "</section>");
    let charts = between(profiles[0], "<figure class=\"third\">", "</figure>");
    assert_eq!(charts.len(), done.outcome.parameters.len());
    for (chart, parameter) in charts.iter().zip(&done.outcome.parameters) {
        let axis = format!(
            "{} ({}) [{}]</text>",
            parameter.name, parameter.symbol, parameter.unit
        );
        assert!(chart.contains(&axis), "{axis} in {chart}");
        let dots = between(chart, "class=\"series dots\"", "/>");
        assert_eq!(
            dots[0].matches("h0").count(),
            parameter.estimate.profile.len()
        );
        assert!(chart.contains(">95 %</text>"), "{chart}");
    }

    let equations = between(&page, "<p class=\"equation\">", "</p>");
    assert_eq!(equations.len(), done.model.description().equations.len());
    assert!(
        equations[1].contains("aria-label=\"v&#39; = (f - d*v - k*x - Fc*soft_sign(v, vs))/m\"")
    );
    assert!(equations[1].contains("<mfrac>"), "{}", equations[1]);

    let inset = between(&page, "<figcaption>", "</figcaption>");
    let inset = inset.iter().find(|words| words.contains("moves most"));
    assert!(inset.expect("a dense line").contains(" % of the recording"));
}

#[test]
fn every_parameter_is_accounted_for_and_every_row_has_its_unit() {
    let done = Done::run("mass_spring_damper");
    let report = done.report();
    let (page, text) = (render(&report), markdown::render(&report));
    let tables = ["Estimates", "Taken as fixed"];
    for parameter in &done.model.description().parameters {
        let name = format!("{} ({})", parameter.name, parameter.symbol);
        let rows: Vec<&str> = tables
            .into_iter()
            .flat_map(|table| between(&page, &format!("<h2>{table}</h2>"), "</section>"))
            .flat_map(|table| between(table, "<tr>", "</tr>"))
            .filter(|row| row.contains(&name))
            .collect();
        assert_eq!(rows.len(), 1, "{name}");
        assert!(
            rows[0].contains(&format!("<td>{}</td>", parameter.unit)),
            "{}",
            rows[0]
        );
        let written = text
            .lines()
            .filter(|line| line.starts_with(&format!("| {name} |")));
        let written = written.filter(|line| line.contains(&format!(" {} |", parameter.unit)));
        assert!(written.count() >= 1, "{name} in {text}");
    }
    assert!(text.contains("## Likelihood profiles"), "{text}");
    assert!(text.contains("```text\nx' = v\n"), "{text}");
    for empty in ["<td></td>", "|  |"] {
        let before_signatures = page.split("<h2>Sign-off</h2>").next().unwrap_or_default();
        assert!(
            !before_signatures.contains(empty) && !text.contains(empty),
            "{empty}"
        );
    }
}

#[test]
fn equations_that_are_not_of_the_language_stay_as_they_are() {
    let done = Done::run("mass_spring_damper");
    let servo = Model::named("single_rod_servo").expect("it is in the catalogue");
    let report = Report {
        model: servo.description(),
        ..done.report()
    };
    let page = render(&report);
    assert!(
        page.contains("<pre>psi(d) = d / (d^2 + d0^2)^(1/4)\n"),
        "{page}"
    );
    assert!(!page.contains("<math"), "{page}");
}
