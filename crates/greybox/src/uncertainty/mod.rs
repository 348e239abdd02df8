//! How far an estimate can be trusted, and why.
//!
//! An [`Analyser`] weighs outputs of unknown noise by what is left of each (`reweighting`) and leaves
//! out what the data do not support, where that is asked for ([`selection`]); then it
//! linearises the residuals at the estimate and derives standard errors and intervals
//! ([`covariance`]; on request better ones, [`profile`], `bootstrap` and [`posterior`]), says what the numbers
//! that are taken as known add to them and whether the residuals contradict one ([`budget`]) or ask
//! for an unknown that changes within the record ([`drift`]), looks at what the model leaves
//! unexplained ([`residuals`], [`fit`]), and says in words what follows ([`verdict`]). A fit per
//! cent alone certifies nothing: a wrong structure can fit 99 % with parameters wrong by factors.
//! What the data could fix at all is forecast by [`identifiability`], and which experiment would
//! fix it better by [`design`].

mod analyser;
mod analysis;
pub mod assumed_values;
mod bootstrap;
pub mod budget;
pub mod constrained;
pub mod covariance;
pub mod design;
mod disturbed_estimate;
mod drawn_assumptions;
pub mod drift;
pub mod feedback;
pub mod fit;
mod hull;
pub mod identifiability;
pub mod joint;
mod linearised;
pub mod monte_carlo;
pub mod noise_analysis;
mod noise_choice;
mod noise_comparison;
mod nuisances;
pub mod posterior;
pub(crate) mod probes;
pub mod profile;
pub mod refits;
pub mod residuals;
mod reweighting;
mod rules;
pub mod selection;
mod sensors;
pub mod settings;
mod simulated_estimate;
mod solved;
pub mod validation_start;
pub mod verdict;
pub mod weighing;
pub mod whitening;
pub mod width;
pub mod windows;

pub use analyser::{Analyser, Conclusion, conclude};
pub use analysis::{Analysis, CoordinateUncertainty};
pub use probes::{DefaultTolerance, default_tolerances};
pub use refits::{Quota, Refits};
pub use settings::{Intervals, Request, Settings, SoughtNoise};

use crate::estimation::problem::Problem;
use crate::estimation::report::Report;
use linearised::LinearisedEstimate;
use std::sync::atomic::AtomicBool;
use verdict::Rule;

/// Analyses an estimate as it stands, at once. Answers nothing when `stop` was raised.
#[must_use]
pub fn analyse(
    problem: &Problem,
    report: &Report,
    request: &Request,
    stop: &AtomicBool,
) -> Option<Analysis> {
    let mut estimate = LinearisedEstimate::of(problem, report, request, stop)?;
    Refits::default().run(&mut estimate.sequences(), Quota::UNLIMITED, stop);
    estimate.analysis()
}

/// An estimate of which nothing is known yet, for whoever cannot wait for its analysis.
#[must_use]
pub fn unanalysed(problem: &Problem, report: &Report) -> Conclusion {
    let reason = "the job was stopped before the estimate was analysed".to_owned();
    Conclusion {
        problem: problem.clone(),
        report: report.clone(),
        analysis: analysis::unknown(problem, report, Rule::NotAnalysed, reason),
        selection: None,
    }
}
