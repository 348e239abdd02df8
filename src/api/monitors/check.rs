//! Whether a monitor can be made of a specification and a stream.

use std::collections::HashMap;
use std::sync::Arc;

use super::stored::clock_ns;
use crate::api::ApiState;
use crate::api::client::Client;
use crate::api::error::{Answer, Problem};
use crate::monitor::{JobTemplate, MonitorSpec, warm};
use crate::store::StreamRow;
use greybox::identification::assemble::{self, starts_elsewhere};
use greybox::identification::spec::Context;
use greybox::identification::{DatasetId, JobSpec};
use greybox::model::{InitialState, Model, ModelDescription};
use greybox::parsing::Fault;
use greybox::recording::{Recording, RecordingSource, shown};

/// Reads the job against the newest window of the stream, or says everything that is wrong with it;
/// puts the model's name in the place of a model.
pub(super) async fn check(
    state: &ApiState,
    spec: &mut MonitorSpec,
    stream: &StreamRow,
    client: &Client,
) -> Answer<()> {
    let below = |problem: Problem| problem.below("/job");
    let asked = state
        .library
        .asked(spec.job.document(), client)
        .await
        .map_err(below)?;
    spec.job = JobTemplate::new(asked.document.clone());
    let dataset = DatasetId::new();
    let recording = newest(state, stream, spec.window.length_s).await?;
    let datasets = HashMap::from([(dataset, recording.summary())]);
    let context = Context {
        models: state.library.descriptions(&asked),
        datasets: &datasets,
        versions: None,
        max_duration_s: state.limits.max_duration_s,
    };
    let job = spec.job.job(dataset, &context);
    let job = job.map_err(Problem::of_document).map_err(below)?;
    let searched = warm::searched(&job);
    let mut faults = Vec::new();
    if searched.is_empty() {
        let detail = "no parameter is looked for: there is nothing to watch";
        faults.push(Fault::new("/job/parameters", "nothing_to_estimate", detail));
    }
    for name in spec
        .drift
        .keys()
        .filter(|name| !searched.contains_key(*name))
    {
        let detail = format!("the job does not look for `{name}`");
        let place = greybox::parsing::fault::pointer_to("/drift", name);
        faults.push(Fault::new(place, "unknown_parameter", detail));
    }
    if let Some(only) = &spec.only_when
        && !stream
            .signals
            .iter()
            .any(|signal| signal.name == only.signal)
    {
        let detail = format!("the stream has no signal `{}`", only.signal);
        faults.push(Fault::new("/only_when/signal", "unknown_signal", detail));
    }
    if !faults.is_empty() {
        return Err(Problem::of_document(faults));
    }
    if let Some(model) = state.library.asked_model(&asked, &job.model) {
        check_start(state, job, model, recording).await?;
    }
    if let Some(new) = asked.new {
        state.store.models().insert(new).await?;
    }
    Ok(())
}

/// Refuses a job whose model starts elsewhere than the newest window of the stream, in a state of which the job says
/// nothing: a window of a plant at work begins wherever the plant is.
async fn check_start(
    state: &ApiState,
    job: JobSpec,
    model: Arc<Model>,
    recording: Recording,
) -> Answer<()> {
    let from_model = states_from_model(&job, model.description());
    if from_model.is_empty() {
        return Ok(());
    }
    let looked = state.work.compute(move |stop| {
        let assembly = assemble::problem(&job, &model, &[recording]);
        let elsewhere = assembly
            .ok()
            .and_then(|assembly| starts_elsewhere(&assembly.problem, stop));
        Ok(elsewhere)
    });
    let Some(elsewhere) = looked.await? else {
        return Ok(());
    };
    let detail = format!(
        "the model starts where `{}` is {} {unit}, and the newest window of the stream begins at {} {unit}: say where \
         each window begins, as a range that is estimated ({{\"{}\": {{\"estimate\": {{\"lower\": …, \"upper\": …}}}}}}), \
         as `first_sample` for a state that is a measured output, or as the number of the model; of {}",
        elsewhere.output,
        shown(elsewhere.simulated),
        shown(elsewhere.measured),
        from_model[0],
        from_model.join(", "),
        unit = elsewhere.unit
    );
    let place = "/job/experiments/0/initial_state";
    let fault = Fault::new(place, "starts_elsewhere", detail);
    Err(Problem::of_document(vec![fault]))
}

/// The states that start where the model puts them, because the job says nothing of them.
fn states_from_model(job: &JobSpec, model: &ModelDescription) -> Vec<String> {
    let experiment = job.experiments.first();
    let is_named = |name: &str| {
        experiment.is_some_and(|experiment| experiment.initial_state.contains_key(name))
    };
    let states = model.states.iter();
    states
        .filter(|state| state.initial == InitialState::Model && !is_named(&state.name))
        .map(|state| state.name.to_string())
        .collect()
}

/// The newest window of a stream.
async fn newest(state: &ApiState, stream: &StreamRow, length_s: f64) -> Answer<Recording> {
    let now = clock_ns();
    let reached = state.store.streams().last_instant(stream, now).await?;
    let last = reached.unwrap_or(now);
    let from = last.saturating_sub((length_s * 1e9) as i64);
    let _permit = state.work.recording_permit().await?;
    let most = crate::monitor::MAX_WINDOW_SAMPLES;
    let too_many = || {
        let detail = format!("a window would have more than {most} instants");
        Problem::of_document(vec![Fault::new(
            "/window/length_s",
            "too_many_samples",
            detail,
        )])
    };
    let rows = state
        .store
        .streams()
        .rows(stream, from..last.saturating_add(1), most)
        .await?;
    let rows = rows.ok_or_else(too_many)?;
    let signals = stream.signals.clone();
    let recording = state.work.convert(move || {
        let recording = rows.into_recording(&signals, RecordingSource::default());
        recording.ok_or_else(|| {
            let detail = "the newest window of the stream has fewer than two samples";
            Problem::of_document(vec![Fault::new(
                "/window/length_s",
                "too_few_samples",
                detail,
            )])
        })
    });
    recording.await
}
