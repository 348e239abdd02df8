//! Runs a job on a recording in this process, as a worker does.

use greybox::estimation::{Advance, Estimation, GenerationRow, Observer, RefinementRow};
use greybox::job::assemble::{self, Origin};
use greybox::job::spec::Context;
use greybox::job::{DatasetId, JobSpec, Outcome};
use greybox::model::{Catalogue, document};
use greybox::recording::Recording;
use greybox::uncertainty;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;

struct Unwatched;

impl Observer for Unwatched {
    fn generation(&mut self, _row: &GenerationRow) {}
    fn refinement(&mut self, _row: &RefinementRow) {}
}

/// The result of the job on the recording, from which every experiment is cut; its model may be a document.
pub fn run(mut job: Value, recording: Recording) -> Outcome {
    let dataset = DatasetId::new();
    let experiments = job["experiments"].as_array_mut().expect("experiments");
    for experiment in experiments {
        experiment["dataset"] = json!(dataset);
    }
    let mut models = Catalogue::built_in();
    if job["model"].is_object() {
        let read = document::referenced(&job["model"]);
        let read = read.unwrap_or_else(|faults| panic!("{faults:#?}"));
        job["model"] = json!(read.reference());
        models.add(read.model);
    }
    let context = Context {
        models: models.iter().map(|model| model.description()).collect(),
        datasets: &HashMap::from([(dataset, recording.summary())]),
        max_duration_s: f64::INFINITY,
    };
    let spec = JobSpec::read(&job, &context).unwrap_or_else(|faults| panic!("{faults:?}"));
    let model = models
        .get(&spec.model)
        .expect("the model of a specification");
    let recordings = vec![recording; spec.experiments.len()];
    let assembly = assemble::problem(&spec, model, &recordings);
    let problem = assembly
        .unwrap_or_else(|faults| panic!("{faults:?}"))
        .problem;
    let never = AtomicBool::new(false);
    let mut run = Estimation::start(&problem, &spec.method, spec.seed);
    while run.advance(&problem, &never, &mut Unwatched) != Advance::Finished {}
    let report = run.report(&problem, None).expect("an estimate");
    let conclusion = uncertainty::conclude(&problem, &report, &spec.request(), &never);
    let conclusion = conclusion.expect("nobody stops it");
    let origin = Origin {
        job: String::new(),
        seed: spec.seed,
        spec_digest: String::new(),
        dataset_digests: Vec::new(),
    };
    assemble::outcome(&origin, &conclusion)
}
