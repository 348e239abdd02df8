//! A result as one page for the file: HTML with its plots inside, no script, nothing fetched.
//!
//! It shows what the result document says, in the order in which an engineer asks: can I trust
//! it, what are the numbers, does the model follow the data, what is left over, how was it found,
//! and from what. It prints as it looks.

mod chart;
mod html;
mod plots;
mod tables;

use crate::job::assemble::ExperimentTrajectory;
use crate::job::outcome::{Outcome, Trust};
use crate::job::{GenerationEvent, JobSpec};
use html::escape;
use std::fmt::Write as _;

/// What a page is made from.
#[derive(Clone, Copy, Debug)]
pub struct Report<'a> {
    /// The job's name, or what else to call it.
    pub title: &'a str,
    /// When it ended, as it shall be shown.
    pub finished_at: Option<&'a str>,
    /// What was asked.
    pub spec: &'a JobSpec,
    /// What was found.
    pub outcome: &'a Outcome,
    /// The history of the search.
    pub generations: &'a [GenerationEvent],
    /// Measured and simulated outputs.
    pub experiments: &'a [ExperimentTrajectory],
}

/// The page.
#[must_use]
pub fn render(report: &Report<'_>) -> String {
    let mut page = String::from("<!doctype html>\n<html lang=\"en\">\n<head>\n");
    let title = escape(report.title);
    let style = include_str!("style.css");
    push(
        &mut page,
        format_args!(
            "<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width\">\n\
             <title>{title} – identification report</title>\n<style>\n{style}</style>\n</head>\n\
             <body>\n<header>\n<h1>{title}</h1>\n<p>Identification report · {}</p>\n</header>\n",
            escape(&subtitle(report))
        ),
    );
    verdict(&mut page, report.outcome);
    tables::estimates(&mut page, report.outcome);
    tables::budget(&mut page, report.outcome);
    tables::fit(&mut page, report.outcome);
    tables::model_search(&mut page, report.outcome);
    plots::experiments(&mut page, report);
    tables::correlation(&mut page, report.outcome);
    plots::search(&mut page, report);
    tables::starts(&mut page, report.outcome);
    origin(&mut page, report);
    page.push_str("</body>\n</html>\n");
    page
}

fn subtitle(report: &Report<'_>) -> String {
    let outcome = report.outcome;
    let mut words = format!("model {}, {}", outcome.model, outcome.job);
    if let Some(instant) = report.finished_at {
        words.push_str(", finished ");
        words.push_str(instant);
    }
    words
}

fn verdict(page: &mut String, outcome: &Outcome) {
    let (class, words) = match outcome.verdict.trust {
        Trust::High => ("high", "High trust: nothing speaks against the numbers."),
        Trust::Moderate => (
            "moderate",
            "Moderate trust: use the numbers with these in mind.",
        ),
        Trust::Low => (
            "low",
            "Low trust: do not use the numbers before this is settled.",
        ),
    };
    push(
        page,
        format_args!("<section class=\"verdict {class}\">\n<h2>{words}</h2>\n"),
    );
    if !outcome.verdict.reasons.is_empty() {
        page.push_str("<ul>\n");
        for reason in &outcome.verdict.reasons {
            push(
                page,
                format_args!(
                    "<li>{} <code>{}</code></li>\n",
                    html::with_code(&reason.detail),
                    escape(&reason.code)
                ),
            );
        }
        page.push_str("</ul>\n");
    }
    page.push_str("</section>\n");
}

/// What made the result, so that it can be made again.
fn origin(page: &mut String, report: &Report<'_>) {
    let engine = &report.outcome.engine;
    push(
        page,
        format_args!(
            "<section>\n<h2>What made it</h2>\n<p>greybox {}, seed {}, specification \
             <code>{}</code>; the same engine, specification and recordings give the same bits.</p>\n",
            escape(&engine.version),
            engine.seed,
            escape(&engine.spec_digest)
        ),
    );
    page.push_str("<ul>\n");
    for digest in &engine.dataset_digests {
        push(
            page,
            format_args!("<li>recording <code>{}</code></li>\n", escape(digest)),
        );
    }
    page.push_str("</ul>\n");
    let spec = serde_json::to_string_pretty(report.spec).expect("a specification has text keys");
    push(
        page,
        format_args!(
            "<details><summary>The completed specification</summary><pre>{}</pre></details>\n\
             </section>\n",
            escape(&spec)
        ),
    );
}

/// Writes to a page.
fn push(page: &mut String, words: std::fmt::Arguments<'_>) {
    page.write_fmt(words)
        .expect("writing to a string does not fail");
}
