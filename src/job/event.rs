//! The events of a job's stream, in the shapes that clients see.
//!
//! An event is a name and one line of JSON. The first event of a job is `state`, the last `end`.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{ResultOfJob, Status};
use greybox::estimation::{Finding, GenerationRow, PosteriorRow};
use greybox::identification::design::{Design, RankedProposal};
use greybox::identification::outcome::{Fit, ParameterEstimate};
use greybox::identification::selection::ChosenWindow;
use greybox::numerics::convergence::Convergence;
use greybox::report::GenerationCosts;

/// One event of a job.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum Event {
    /// `state`: the job came into a state.
    #[schema(title = "StateEvent")]
    State {
        /// The state.
        status: Status,
    },
    /// `finding`: what should be known about the job before its numbers are read.
    Finding(Finding),
    /// `generation`: the search finished a generation.
    Generation(GenerationEvent),
    /// `design`: a better experiment was found.
    Design(DesignEvent),
    /// `selection`: more windows were looked at.
    Selection(SelectionEvent),
    /// `refinement`: the refinement finished an iteration.
    #[schema(title = "RefinementEvent")]
    Refinement {
        /// Counts from 1.
        iteration: u32,
        /// The cost that the iteration reached.
        cost: f64,
    },
    /// `posterior`: the chains of a posterior were looked at.
    Posterior(PosteriorEvent),
    /// `result`: the job has an estimate.
    #[schema(title = "ResultEvent")]
    Result {
        /// The `parameters` of the result.
        parameters: Vec<ParameterEstimate>,
        /// The `fit` of the result.
        fit: Fit,
    },
    /// `result` of a design: the experiment.
    #[schema(title = "DesignResultEvent")]
    DesignResult {
        /// The `proposals` of the result.
        proposals: Vec<RankedProposal>,
    },
    /// `result` of a selection: the windows.
    #[schema(title = "SelectionResultEvent")]
    SelectionResult {
        /// The `chosen` of the result.
        chosen: Vec<ChosenWindow>,
    },
    /// `end`: the last event; nothing follows.
    #[schema(title = "EndEvent")]
    End {
        /// The terminal state.
        status: Status,
    },
}

/// The best experiment of a design so far.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct DesignEvent {
    /// Experiments that were looked at.
    pub assessed: u64,
    /// The best of them.
    pub best: RankedProposal,
}

impl DesignEvent {
    /// The event of a design that has an experiment.
    #[must_use]
    pub fn of(design: &Design) -> Option<DesignEvent> {
        Some(DesignEvent {
            assessed: design.assessed,
            best: design.proposals.first()?.clone(),
        })
    }
}

/// How far a selection came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct SelectionEvent {
    /// Windows that were looked at.
    pub looked: u64,
    /// Windows that there are.
    pub windows: u64,
}

/// What a generation of the search came to. The same row is kept in the job's history.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GenerationEvent {
    /// Counts from 1.
    pub generation: u32,
    /// Candidates judged since the job began.
    pub evaluations: u64,
    /// The lowest cost over all the data so far; `null` while every candidate diverged.
    pub best_cost: Option<f64>,
    /// The lowest cost in this generation; without elitism it may rise.
    #[serde(default)]
    pub generation_best_cost: Option<f64>,
    /// The mean cost of this generation's candidates that did not diverge.
    pub mean_cost: Option<f64>,
    /// The largest credit at the end of the competition.
    pub best_credit: Option<f64>,
    /// The entropy of the credits at the end of the competition `[nat]`.
    pub entropy: Option<f64>,
    /// Blocks of data judged before the credits were concentrated enough.
    pub credit_updates: u32,
    /// The champion: each free parameter's value, SI.
    #[schema(value_type = Object)]
    pub best: IndexMap<String, Option<f64>>,
}

impl From<&GenerationRow> for GenerationEvent {
    /// What is not finite is absent: JSON has no number for it.
    fn from(row: &GenerationRow) -> Self {
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        let best = row.best.iter();
        let best = best.map(|(name, value)| (name.clone(), finite(*value)));
        Self {
            generation: row.generation,
            evaluations: row.evaluations,
            best_cost: finite(row.best_cost),
            generation_best_cost: finite(row.generation_best_cost),
            mean_cost: row.mean_cost.and_then(finite),
            best_credit: finite(row.best_credit),
            entropy: finite(row.entropy),
            credit_updates: row.credit_updates,
            best: best.collect(),
        }
    }
}

impl From<&GenerationEvent> for GenerationCosts {
    fn from(row: &GenerationEvent) -> Self {
        Self {
            generation: row.generation,
            best: row.best_cost,
            mean: row.mean_cost,
        }
    }
}

impl GenerationEvent {
    /// A table in CSV with a row for each generation; the champion's unknowns stand in the last
    /// columns. What is absent is an empty field.
    #[must_use]
    pub fn csv(rows: &[Self]) -> String {
        let mut text = String::from(
            "generation,evaluations,best_cost,generation_best_cost,mean_cost,best_credit,entropy,\
             credit_updates",
        );
        let names: Vec<&String> = rows
            .iter()
            .take(1)
            .flat_map(|row| row.best.keys())
            .collect();
        text.extend(names.iter().map(|name| format!(",{name}")));
        text.push('\n');
        let field = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        for row in rows {
            let costs = [row.best_cost, row.generation_best_cost, row.mean_cost];
            let credits = [row.best_credit, row.entropy];
            let mut fields = vec![row.generation.to_string(), row.evaluations.to_string()];
            fields.extend(costs.into_iter().chain(credits).map(field));
            fields.push(row.credit_updates.to_string());
            let values = names.iter().map(|name| *row.best.get(*name)?);
            fields.extend(values.map(field));
            text.push_str(&fields.join(","));
            text.push('\n');
        }
        text
    }
}

/// How far the chains of a posterior came.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct PosteriorEvent {
    /// How many generations the chains moved.
    pub generation: u32,
    /// Generations at the most.
    pub generations: u32,
    /// The largest R̂ of an unknown over the second half of the generations; `null` where an unknown has not
    /// moved.
    pub r_hat: Option<f64>,
    /// The smallest effective sample size of an unknown, for the middle of its distribution.
    pub ess_bulk: Option<f64>,
    /// The smallest effective sample size of an unknown, for the tails of its distribution.
    pub ess_tail: Option<f64>,
}

impl From<&PosteriorRow> for PosteriorEvent {
    fn from(row: &PosteriorRow) -> Self {
        let figure = |of: fn(Convergence) -> f64| row.convergence.map(of);
        let finite = |figure: Option<f64>| figure.filter(|value| value.is_finite());
        Self {
            generation: row.generation,
            generations: row.generations,
            r_hat: finite(figure(|convergence| convergence.r_hat)),
            ess_bulk: finite(figure(|convergence| convergence.ess_bulk)),
            ess_tail: finite(figure(|convergence| convergence.ess_tail)),
        }
    }
}

impl Event {
    /// The event of a result: of an estimate, of a design, or of a selection.
    pub fn of_result(result: &ResultOfJob) -> Event {
        match result {
            ResultOfJob::Identification(outcome) => Event::Result {
                parameters: outcome.parameters.clone(),
                fit: outcome.fit.clone(),
            },
            ResultOfJob::Design(design) => Event::DesignResult {
                proposals: design.proposals.clone(),
            },
            ResultOfJob::Selection(selection) => Event::SelectionResult {
                chosen: selection.chosen.clone(),
            },
        }
    }

    /// The name of the event in the stream.
    pub fn name(&self) -> &'static str {
        match self {
            Event::State { .. } => "state",
            Event::Finding(_) => "finding",
            Event::Generation(_) => "generation",
            Event::Refinement { .. } => "refinement",
            Event::Posterior(_) => "posterior",
            Event::Design(_) => "design",
            Event::Selection(_) => "selection",
            Event::Result { .. } | Event::DesignResult { .. } | Event::SelectionResult { .. } => {
                "result"
            }
            Event::End { .. } => "end",
        }
    }

    /// The data of the event: one line of JSON.
    pub fn data(&self) -> String {
        serde_json::to_string(self).expect("an event has only text keys")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox::estimation::StopReason;

    #[test]
    fn data_has_the_shapes_that_clients_rely_on() {
        let state = Event::State {
            status: Status::Queued,
        };
        assert_eq!(
            (state.name(), &*state.data()),
            ("state", r#"{"status":"queued"}"#)
        );

        let refinement = Event::Refinement {
            iteration: 3,
            cost: 0.5,
        };
        assert_eq!(refinement.data(), r#"{"iteration":3,"cost":0.5}"#);

        let row = PosteriorRow {
            stretch: 25,
            generation: 250,
            generations: 10_000,
            convergence: Some(Convergence {
                r_hat: 1.25,
                ess_bulk: 120.0,
                ess_tail: f64::INFINITY,
            }),
        };
        let posterior = Event::Posterior(PosteriorEvent::from(&row));
        assert_eq!(
            posterior.data(),
            r#"{"generation":250,"generations":10000,"r_hat":1.25,"ess_bulk":120.0,"ess_tail":null}"#
        );

        let result = Event::of_result(&ResultOfJob::sample(StopReason::Stagnation, "mass", 58.0));
        assert_eq!(
            result.data(),
            r#"{"parameters":[{"name":"mass","symbol":"x","unit":"1","estimate":58.0,"standard_error":null,"confidence_interval":null,"total_standard_error":null,"total_interval":null,"trust":null,"lower":0.0,"upper":100.0,"at_bound":false,"identifiable":true,"output_change":{}}],"fit":{"estimation":{},"validation":{}}}"#
        );
    }

    #[test]
    fn a_generation_is_one_line_without_nan() {
        let event = Event::Generation(GenerationEvent {
            generation: 1,
            evaluations: 30,
            best_cost: Some(f64::NAN),
            generation_best_cost: None,
            mean_cost: None,
            best_credit: Some(0.4),
            entropy: Some(1.2),
            credit_updates: 430,
            best: IndexMap::from([("mass".to_owned(), Some(58.0))]),
        });
        assert_eq!(
            event.data(),
            r#"{"generation":1,"evaluations":30,"best_cost":null,"generation_best_cost":null,"mean_cost":null,"best_credit":0.4,"entropy":1.2,"credit_updates":430,"best":{"mass":58.0}}"#
        );
    }
}
