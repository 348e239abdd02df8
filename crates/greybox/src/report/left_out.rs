//! Sentences of a report on the samples that the experiments do without.

use crate::identification::spec::ExperimentSpec;
use greybox_numerics::digits::short;
use greybox_recording::{ExcludedClass, ExcludedSpan};

/// Sentences on the samples that the experiments do without: one for each kind of samples, each span and each mark.
pub(super) fn sentences(experiments: &[ExperimentSpec]) -> impl Iterator<Item = String> {
    let experiments = experiments.iter().zip(1..);
    experiments.flat_map(|(experiment, number): (_, usize)| {
        let left_out = left_out_of(experiment).into_iter();
        left_out.map(move |samples| format!("Left out of experiment {number}: {samples}."))
    })
}

fn left_out_of(experiment: &ExperimentSpec) -> Vec<String> {
    let exclude = experiment.exclude.iter();
    let classes = exclude.clone().flat_map(|exclude| &exclude.classes);
    let spans = exclude.flat_map(|exclude| &exclude.spans);
    let by_job = classes.map(|class| format!("{}, as the job asks", kind(*class)));
    let by_job = by_job.chain(spans.map(|span| format!("{}, as the job asks", time(span))));
    let versions = experiment.version.iter();
    let marked = versions.flat_map(|version| {
        let marks = version.marks.iter();
        marks.map(move |mark| {
            let (span, version) = (time(&mark.span()), version.number);
            format!(
                "{span}: {} (version {version} of the recording)",
                mark.reason
            )
        })
    });
    by_job.chain(marked).collect()
}

fn kind(class: ExcludedClass) -> &'static str {
    match class {
        ExcludedClass::Uncertain => "samples that their source calls uncertain",
        ExcludedClass::Substituted => "samples that their source put in",
        ExcludedClass::Frozen => "stretches in which a signal is frozen",
        ExcludedClass::Spike => "spikes",
    }
}

fn time(span: &ExcludedSpan) -> String {
    let from = short(span.from_s, 6);
    let bounds = match span.from_s == span.to_s {
        true => format!("at {from} s"),
        false => format!("{from} to {} s", short(span.to_s, 6)),
    };
    match &span.signals {
        Some(signals) => format!("{bounds} of {}", signals.join(", ")),
        None => bounds,
    }
}
