//! One step of a monitor.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use jiff::Timestamp;

use super::signals::{inputs, outputs};
use crate::job::{JobTask, Status};
use crate::monitor::MAX_WINDOW_SAMPLES;
use crate::monitor::information;
use crate::monitor::record::{Alarm, Start, WindowStatus};
use crate::monitor::spec::MonitorSpec;
use crate::monitor::state::{State, Worked, instant, silence};
use crate::monitor::template::WindowLabel;
use crate::monitor::warm::{self, JointEstimate};
use crate::store::{
    Advance, AdvanceWindow, JobRow, MonitorRow, NewDataset, NewJob, NewWindowJob, Store,
    StoreError, StreamRow, UnmarkedRows,
};
use greybox::identification::assemble;
use greybox::identification::outcome::Outcome;
use greybox::identification::spec::{Context, SearchRange};
use greybox::identification::{DatasetId, JobId, JobSpec};
use greybox::model::{Catalogue, Model, document};
use greybox::parsing::Fault;
use greybox::recording::{Recording, RecordingSource, RowSignal, Rows, stands_still};

/// Monitors limit the time of their jobs by what the jobs themselves say.
const NO_LIMIT: f64 = f64::INFINITY;

/// What steps are taken with.
pub(super) struct Steps {
    pub(super) store: Store,
    pub(super) catalogue: Arc<Catalogue>,
}

impl Steps {
    /// Takes a step of each monitor that has something to do; says how many were taken.
    pub(super) async fn take_all(&self) -> Result<usize, StoreError> {
        let mut taken = 0;
        for row in self.store.monitors().to_step().await? {
            let id = row.id;
            match self.take(row).await {
                Ok(true) => taken += 1,
                Ok(false) => {}
                Err(error) => {
                    self.store.damage().note(&error);
                    tracing::error!(%error, monitor = %id, "a monitor cannot go on");
                }
            }
        }
        Ok(taken)
    }

    /// Takes a step; says whether there was one to take.
    async fn take(&self, row: MonitorRow) -> Result<bool, StoreError> {
        let Some(stream) = self.store.streams().find(&row.project, &row.stream).await? else {
            return Ok(false);
        };
        let step = MonitorStep::new(row, stream);
        let begun = step.clone();
        let patience = jiff::SignedDuration::try_from(step.spec.patience());
        let patience = patience.unwrap_or(jiff::SignedDuration::MAX);
        let is_silent = step.now.duration_since(step.stream.received_at) > patience;
        let advance = if is_silent != step.row.silent {
            step.silence(is_silent)
        } else if let Some(job) = step.row.job {
            match self.conclude(step, job).await? {
                Some(advance) => advance,
                None => return Ok(false),
            }
        } else if self.is_due(&step).await? {
            self.begin(step).await?
        } else {
            return Ok(false);
        };
        match self.store.monitors().advance(advance).await {
            Err(StoreError::Quota(exceeded)) => {
                let failed = begun.fails(exceeded.to_string());
                self.store.monitors().advance(failed).await
            }
            taken => taken,
        }
    }

    /// Whether the next window can be worked. Samples ahead of the server's clock do not count.
    async fn is_due(&self, step: &MonitorStep) -> Result<bool, StoreError> {
        let reached = self
            .store
            .streams()
            .last_instant(&step.stream, step.now_ns());
        Ok(reached.await?.is_some_and(|last| last >= step.row.due_ns))
    }

    /// Begins the next window.
    async fn begin(&self, mut step: MonitorStep) -> Result<Advance, StoreError> {
        let plan = step.spec.window;
        let span = step.state.span(&plan);
        let rows =
            self.store
                .streams()
                .unmarked_rows(&step.stream, span.0..span.1, MAX_WINDOW_SAMPLES);
        let Some(unmarked) = rows.await? else {
            let reason = format!("a window has more than {MAX_WINDOW_SAMPLES} instants");
            return Ok(step.fails(reason));
        };
        if unmarked.rows.rows() < 2 {
            let resumes = self
                .store
                .streams()
                .next_instant(&step.stream, span.1)
                .await?;
            let resumes = resumes.filter(|instant| *instant <= step.now_ns());
            let window = step.state.window(&plan, WindowStatus::NoData);
            step.state.go_on(&plan, resumes);
            return Ok(step.advance(Some(window.into()), Vec::new()));
        }
        let model = self.model(&step.spec).await?;
        let catalogue = self.catalogue.clone();
        let cutting = tokio::task::spawn_blocking(move || step.cut(unmarked, &catalogue, model));
        cutting.await.map_err(|_| StoreError::Closed)
    }

    /// Takes what the job of a window came to; nothing while it has not ended.
    async fn conclude(&self, step: MonitorStep, id: JobId) -> Result<Option<Advance>, StoreError> {
        let job = self.store.jobs().find(id).await?;
        if job.as_ref().is_some_and(|job| !job.status.is_terminal()) {
            return Ok(None);
        }
        let result = match &job {
            Some(job) if job.status == Status::Succeeded => self.store.results().find(id).await?,
            _ => None,
        };
        let outcome = result.map(|result| result.outcome());
        let is_warm = step.is_warm();
        match outcome {
            Some(Ok(outcome)) if !(is_warm && warm::is_in_doubt(&outcome)) => {
                Ok(Some(step.takes(&outcome)))
            }
            _ if is_warm && job.is_some() => self.begin_again(step).await.map(Some),
            _ => {
                let reason = reason(job.as_deref());
                Ok(Some(step.fails(reason)))
            }
        }
    }

    /// Has a window worked again, with nothing of what was known before.
    async fn begin_again(&self, step: MonitorStep) -> Result<Advance, StoreError> {
        let number = step.state.next;
        let window = self.store.monitors().window(step.row.id, number).await?;
        let dataset = window.and_then(|window| window.dataset);
        let stored = match dataset {
            Some(dataset) => self.store.datasets().find(dataset).await?,
            None => None,
        };
        let Some(stored) = stored else {
            return Ok(step.fails("its recording was removed".to_owned()));
        };
        let model = self.model(&step.spec).await?;
        let (catalogue, dataset) = (self.catalogue.clone(), stored.id);
        let window = RecordedWindow {
            dataset,
            summary: &stored.summary,
            models: descriptions(&catalogue, model.as_ref()),
        };
        Ok(match step.job(&window) {
            Ok(job) => {
                let ranges = warm::searched(&job);
                let new = step.new_job(job, None);
                step.works(Start::Cold, ranges, new)
            }
            Err(faults) => step.fails(sentence(&faults)),
        })
    }

    /// The model of the job, where the catalogue does not have it.
    async fn model(&self, spec: &MonitorSpec) -> Result<Option<Arc<Model>>, StoreError> {
        let Some(name) = spec.job.model() else {
            return Ok(None);
        };
        if self.catalogue.get(name).is_some() {
            return Ok(None);
        }
        let Some(row) = self.store.models().by_reference(name).await? else {
            return Ok(None);
        };
        let reading = tokio::task::spawn_blocking(move || document::referenced(&row.document));
        let read = reading.await.map_err(|_| StoreError::Closed)?;
        Ok(read.ok().map(|read| read.model))
    }
}

/// Why a job came to no estimate.
fn reason(job: Option<&JobRow>) -> String {
    let Some(job) = job else {
        return "its job was deleted".to_owned();
    };
    match &job.error {
        Some(failure) => failure.detail.clone(),
        None => format!("its job was {}", job.status),
    }
}

fn sentence(faults: &[Fault]) -> String {
    let first = faults.first().map(Fault::to_string);
    first.unwrap_or_else(|| "the job cannot run".to_owned())
}

/// A step that is being taken.
#[derive(Clone)]
struct MonitorStep {
    now: Timestamp,
    row: MonitorRow,
    spec: MonitorSpec,
    state: State,
    stream: StreamRow,
}

/// A window that is there, for a job to be read against.
struct RecordedWindow<'a> {
    dataset: DatasetId,
    summary: &'a greybox::recording::Summary,
    models: Vec<&'a greybox::model::ModelDescription>,
}

impl RecordedWindow<'_> {
    /// Reads a job against the window.
    fn read(
        &self,
        read: impl FnOnce(&Context<'_>) -> Result<JobSpec, Vec<Fault>>,
    ) -> Result<JobSpec, Vec<Fault>> {
        let datasets = HashMap::from([(self.dataset, self.summary.clone())]);
        read(&Context {
            models: self.models.clone(),
            datasets: &datasets,
            versions: None,
            max_duration_s: NO_LIMIT,
        })
    }
}

fn descriptions<'a>(
    catalogue: &'a Catalogue,
    model: Option<&'a Arc<Model>>,
) -> Vec<&'a greybox::model::ModelDescription> {
    let all = catalogue.iter().chain(model);
    all.map(|model| model.description()).collect()
}

impl MonitorStep {
    /// The next step of a monitor, which begins now.
    fn new(row: MonitorRow, stream: StreamRow) -> Self {
        Self {
            now: Timestamp::now(),
            spec: row.spec.clone(),
            state: row.state.clone(),
            row,
            stream,
        }
    }

    /// The server's clock, nanoseconds since 1970.
    fn now_ns(&self) -> i64 {
        i64::try_from(self.now.as_nanosecond()).unwrap_or(i64::MAX)
    }

    fn is_warm(&self) -> bool {
        let worked = self.state.worked.as_ref();
        worked.is_some_and(|worked| worked.start == Start::Warm)
    }

    /// The step that says that data stopped, or that they came again.
    fn silence(self, is_silent: bool) -> Advance {
        let alarm = is_silent.then(|| silence(self.stream.received_at, self.now));
        let mut advance = self.advance(None, alarm.into_iter().collect());
        advance.silent = is_silent;
        advance
    }

    /// The step that ends a window which says nothing.
    fn rests(mut self, reason: String) -> Advance {
        let window = self.state.quiet(&self.spec.window, reason);
        self.state.go_on(&self.spec.window, None);
        self.advance(Some(window.into()), Vec::new())
    }

    /// The step that ends a window without an estimate.
    fn fails(mut self, reason: String) -> Advance {
        let (window, alarms) = self.state.fail(&self.spec, reason, self.now);
        self.state.go_on(&self.spec.window, None);
        self.advance(Some(window.into()), alarms)
    }

    /// The step that ends a window with one.
    fn takes(mut self, outcome: &Outcome) -> Advance {
        if self.state.known.is_none() && information::says_nothing(outcome) {
            return self.rests("it fixed no parameter to within half its value".to_owned());
        }
        let (window, alarms) = self.state.take(&self.spec, outcome, self.now);
        self.state.go_on(&self.spec.window, None);
        self.advance(Some(window.into()), alarms)
    }

    /// The step that has a job work the window.
    fn works(
        mut self,
        start: Start,
        ranges: BTreeMap<String, SearchRange>,
        job: NewWindowJob,
    ) -> Advance {
        let mut window = self.state.window(&self.spec.window, WindowStatus::Running);
        window.start = Some(start);
        let prior = match start {
            Start::Warm => self.prior(&ranges),
            Start::Cold => None,
        };
        self.state.worked = Some(Worked {
            start,
            prior,
            ranges,
        });
        let job = Some(job);
        self.advance(Some(AdvanceWindow { window, job }), Vec::new())
    }

    fn advance(self, window: Option<AdvanceWindow>, alarms: Vec<Alarm>) -> Advance {
        Advance {
            due_ns: self.state.due(&self.spec.window),
            silent: self.row.silent,
            window,
            alarms,
            forget_before: self.state.next - i64::from(self.spec.keep_jobs),
            state: self.state,
            from: self.row,
        }
    }

    /// The job of the window, by what the monitor was asked.
    fn job(&self, window: &RecordedWindow<'_>) -> Result<JobSpec, Vec<Fault>> {
        let number = self.state.next;
        let name = self.spec.name.as_deref().unwrap_or(&self.spec.stream);
        let name: String = name.chars().take(150).collect();
        let label = WindowLabel {
            name: format!("{name}, window {number}"),
            monitor: self.row.id.to_string(),
        };
        let template = &self.spec.job;
        window.read(|context| template.job_of_window(window.dataset, label, context))
    }

    fn new_job(&self, spec: JobSpec, dataset: Option<(DatasetId, NewDataset)>) -> NewWindowJob {
        let (name, labels) = (spec.name.clone(), spec.labels.clone());
        let model = spec.model.clone();
        let task = JobTask::Identification(Box::new(spec));
        NewWindowJob {
            job: NewJob {
                project: self.row.project.clone(),
                name,
                labels,
                model,
                datasets: task.recordings(),
                task,
                idempotency: None,
            },
            dataset,
        }
    }

    /// Cuts the window out of its stream, and has a job work it where it says something.
    fn cut(
        mut self,
        unmarked: UnmarkedRows,
        catalogue: &Catalogue,
        model: Option<Arc<Model>>,
    ) -> Advance {
        let UnmarkedRows { rows, told } = unmarked;
        let signals = self.stream.signals.clone();
        let id = DatasetId::new();
        let (mut recording, digest) = self.recording(&signals, &rows);
        recording.notes = told;
        let summary = recording.summary();
        let window = RecordedWindow {
            dataset: id,
            summary: &summary,
            models: descriptions(catalogue, model.as_ref()),
        };
        let job = match self.job(&window) {
            Ok(job) => job,
            Err(faults) => return self.fails(sentence(&faults)),
        };
        let movers = match &self.spec.only_when {
            Some(only) => vec![only.signal.clone()],
            None => inputs(&job, &window.models),
        };
        let movement = self.spec.movement();
        let moves = self.state.moves(&signals, &rows, &movers, movement);
        let ranges = warm::searched(&job);
        let (start, job) = self.warm(&window, job);
        let ahead = (start == Start::Warm && self.spec.only_when.is_none())
            .then(|| self.informs(&job, &recording, catalogue, model.as_ref()))
            .flatten();
        let quiet = match ahead {
            Some(true) => None,
            Some(false) => Some("it would fix no parameter to within half its value".to_owned()),
            None => (!moves).then(|| format!("{} did not move", movers.join(", "))),
        };
        if let Some(reason) = quiet {
            return self.rests(reason);
        }
        let still = outputs(&job, &window.models).into_iter().find(|output| {
            let column = signals.iter().position(|signal| signal.name == *output);
            column.is_some_and(|column| stands_still(&rows.columns[column].values))
        });
        if let Some(still) = still {
            let reason = format!("`{still}` stood still while {} moved", movers.join(", "));
            return self.fails(reason);
        }
        let dataset = NewDataset {
            project: self.row.project.clone(),
            name: recording.name.clone(),
            digest,
            summary: summary.clone(),
            recording: recording.into(),
        };
        let new = self.new_job(job, Some((id, dataset)));
        self.works(start, ranges, new)
    }

    /// Whether the window could fix a parameter well enough to be used, by what drives the plant in it and what is
    /// known of the plant; nothing where that cannot be told.
    fn informs(
        &self,
        warm: &JobSpec,
        recording: &Recording,
        catalogue: &Catalogue,
        model: Option<&Arc<Model>>,
    ) -> Option<bool> {
        let ahead = information::looking_ahead(warm, &self.state.left);
        let model = catalogue.get(&ahead.model).or(model)?;
        let assembly = assemble::problem(&ahead, model, &[recording]).ok()?;
        assemble::informs(&assembly.problem, &AtomicBool::new(false))
    }

    /// The window as a recording, and what it is known by: two monitors do not share one.
    fn recording(&self, signals: &[RowSignal], rows: &Rows) -> (Recording, String) {
        use sha2::Digest;
        let (from, to) = self.state.span(&self.spec.window);
        let mut digest = rows.digest(signals);
        digest.update(format!("\0{} {}", self.row.id, self.state.next));
        let digest = hex::encode(digest.finalize());
        let source = RecordingSource {
            format: "stream".to_owned(),
            options: [
                ("stream", self.stream.name.clone()),
                ("from", instant(from).to_string()),
                ("to", instant(to).to_string()),
            ]
            .map(|(name, text)| (name.to_owned(), text))
            .into(),
        };
        let recording = rows.clone().into_recording(signals, source);
        let mut recording = recording.expect("a window that is worked has two samples");
        recording.zone.clone_from(&self.stream.zone);
        recording.name = Some(format!("{}, window {}", self.stream.name, self.state.next));
        (recording, format!("sha256:{digest}"))
    }

    /// What is known of the window's parameters before it is looked at; nothing before the first estimate,
    /// or where nothing is looked for.
    fn prior(&self, ranges: &BTreeMap<String, SearchRange>) -> Option<JointEstimate> {
        let (begun, estimate) = self.state.known.as_ref()?;
        let after = (self.state.span(&self.spec.window).0 - begun) as f64 * 1e-9;
        (!ranges.is_empty()).then(|| warm::prior(&self.spec, estimate, ranges, after))
    }

    /// The job that begins where the one before ended, where there was one and where it can.
    fn warm(&self, window: &RecordedWindow<'_>, cold: JobSpec) -> (Start, JobSpec) {
        let ranges = warm::searched(&cold);
        let prior = self.prior(&ranges);
        // Every parameter that is looked for must be known; what is not has nowhere to begin.
        let Some(prior) = prior.filter(|prior| ranges.keys().all(|name| prior.holds(name))) else {
            return (Start::Cold, cold);
        };
        let warm = warm::begin_warm(&cold, &ranges, &prior);
        match window.read(|context| warm.checked(context)) {
            Ok(job) => (Start::Warm, job),
            Err(_) => (Start::Cold, cold),
        }
    }
}
