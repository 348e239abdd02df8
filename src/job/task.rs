//! What a job is asked to do, as the row of the job holds it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{DesignTask, JobKind, SelectionTask};
use greybox::identification::spec::LimitsSpec;
use greybox::identification::{DatasetId, JobId, JobSpec};

/// What a job was asked to do.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
#[schema(as = SpecOfJob)]
pub enum JobTask {
    /// The task of an identification.
    Identification(Box<JobSpec>),
    /// The task of a design.
    Design(DesignTask),
    /// The task of a selection.
    Selection(SelectionTask),
}

impl JobTask {
    /// The task that a stored text says.
    ///
    /// # Errors
    /// The text is not that of a task.
    pub fn read(text: &str) -> serde_json::Result<JobTask> {
        /// The one field that tells the tasks from each other.
        #[derive(Deserialize)]
        struct KindOfTask {
            kind: Option<JobKind>,
        }
        let KindOfTask { kind } = serde_json::from_str(text)?;
        match kind {
            Some(JobKind::Design) => serde_json::from_str(text).map(JobTask::Design),
            Some(JobKind::Selection) => serde_json::from_str(text).map(JobTask::Selection),
            None | Some(JobKind::Identification) => {
                serde_json::from_str(text).map(JobTask::Identification)
            }
        }
    }

    /// What a job with this task does.
    #[must_use]
    pub fn kind(&self) -> JobKind {
        match self {
            JobTask::Identification(_) => JobKind::Identification,
            JobTask::Design(_) => JobKind::Design,
            JobTask::Selection(_) => JobKind::Selection,
        }
    }

    /// The specification of an identification.
    #[must_use]
    pub fn identification(&self) -> Option<&JobSpec> {
        match self {
            JobTask::Identification(spec) => Some(spec),
            JobTask::Design(_) | JobTask::Selection(_) => None,
        }
    }

    /// When the job stops at the latest.
    #[must_use]
    pub fn limits(&self) -> LimitsSpec {
        match self {
            JobTask::Identification(spec) => spec.limits,
            JobTask::Design(task) => task.limits,
            JobTask::Selection(task) => task.limits,
        }
    }

    /// What people should know of the job.
    #[must_use]
    pub fn note(&self) -> Option<&str> {
        match self {
            JobTask::Identification(spec) => spec.note.as_deref(),
            JobTask::Design(task) => task.note.as_deref(),
            JobTask::Selection(task) => task.note.as_deref(),
        }
    }

    /// Calls the job otherwise. The name and the labels of a design and of a selection stand beside the task alone.
    pub fn call(
        &mut self,
        name: Option<String>,
        labels: BTreeMap<String, String>,
        note: Option<String>,
    ) {
        match self {
            JobTask::Identification(spec) => {
                spec.name = name;
                spec.labels = labels;
                spec.note = note;
            }
            JobTask::Design(task) => task.note = note,
            JobTask::Selection(task) => task.note = note,
        }
    }

    /// The recordings that the job reads, one for each experiment.
    #[must_use]
    pub fn datasets(&self) -> Vec<DatasetId> {
        match self {
            JobTask::Identification(spec) => {
                let experiments = spec.experiments.iter();
                experiments.map(|experiment| experiment.dataset).collect()
            }
            JobTask::Design(task) => task.datasets(),
            JobTask::Selection(task) => task.datasets(),
        }
    }

    /// The recordings that the job reads, each once.
    #[must_use]
    pub fn recordings(&self) -> Vec<DatasetId> {
        let mut recordings = self.datasets();
        recordings.sort();
        recordings.dedup();
        recordings
    }

    /// The finished job that the job goes on from.
    #[must_use]
    pub fn past_job(&self) -> Option<JobId> {
        match self {
            JobTask::Identification(_) => None,
            JobTask::Design(task) => task.design.job(),
            JobTask::Selection(task) => task.selection.job(),
        }
    }

    /// The stream whose windows the job goes through.
    #[must_use]
    pub fn stream(&self) -> Option<&str> {
        match self {
            JobTask::Identification(_) | JobTask::Design(_) => None,
            JobTask::Selection(task) => task.selection.stream(),
        }
    }
}

#[cfg(test)]
impl JobTask {
    /// An identification that says next to nothing, for tests of what happens to jobs.
    pub(crate) fn nominal() -> JobTask {
        let text = r#"{"model":"positioning_drive","experiments":[],"seed":1}"#;
        JobTask::read(text).expect("a task")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTIFICATION: &str = concat!(
        r#"{"name":null,"labels":{},"model":"positioning_drive","experiments":[{"dataset":"#,
        r#""ds_0192d3a4b5c67d8e9f00112233445566","signals":{"position":"x"},"window":null,"#,
        r#""initial_state":{"position":"first_sample"},"role":"estimation"}],"parameters":{"mass":"#,
        r#"{"estimate":{"lower":0.5,"upper":10.0,"scale":"log"}},"offset":{"value":0.0}},"#,
        r#""outputs":{"position":{"noise_std":0.001}}"#,
    );
    const DESIGN: &str = concat!(
        r#"{"kind":"design","design":{"points":2.0,"job":"job_0192d3a4b5c67d8e9f00112233445566"},"#,
        r#""experiments":[{"dataset":"ds_0192d3a4b5c67d8e9f00112233445566"}],"#,
        r#""limits":{"max_duration_s":60.0}}"#,
    );

    #[test]
    fn a_stored_text_is_written_again_byte_for_byte() {
        let rest = r#","method":METHOD,"uncertainty":UNCERTAINTY,"validation":VALIDATION,"limits":{"max_duration_s":5.5},"seed":9007199254740991}"#;
        let sections = [
            (
                "METHOD",
                serde_json::to_string(&greybox::estimation::Settings::default()),
            ),
            (
                "UNCERTAINTY",
                serde_json::to_string(&greybox::uncertainty::Settings::default()),
            ),
            ("VALIDATION", Ok(r#"{"fraction":0.25}"#.to_owned())),
        ];
        let mut text = format!("{IDENTIFICATION}{rest}");
        for (section, written) in sections {
            text = text.replace(section, &written.expect("text keys"));
        }
        for (text, kind) in [(&*text, JobKind::Identification), (DESIGN, JobKind::Design)] {
            let task = JobTask::read(text).expect("a task");
            assert_eq!(task.kind(), kind);
            assert_eq!(serde_json::to_string(&task).expect("text keys"), text);
        }
    }

    #[test]
    fn a_design_names_the_recordings_and_the_job_that_the_design_goes_on_from() {
        let task = JobTask::read(DESIGN).expect("a task");
        assert_eq!(task.limits().max_duration_s, 60.0);
        assert_eq!(task.datasets().len(), 1);
        let past = task.past_job().map(|job| job.to_string());
        assert_eq!(
            past.as_deref(),
            Some("job_0192d3a4b5c67d8e9f00112233445566")
        );
        assert_eq!(task.identification(), None);
    }

    #[test]
    fn what_is_no_task_does_not_read() {
        for text in [
            "{}",
            "[]",
            r#"{"kind":"design"}"#,
            r#"{"kind":"repair"}"#,
            "{",
        ] {
            assert!(JobTask::read(text).is_err(), "{text}");
        }
    }
}
