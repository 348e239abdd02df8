//! A result as one page for the file: HTML with its plots inside, no script, nothing fetched.
//!
//! It shows what the result document says, in the order in which an engineer asks: can I trust
//! it, what are the numbers, does the model follow the data, what is left over, how was it found,
//! and from what. It prints on A4 and Letter without a cut; [`markdown`] says the same without plots,
//! and [`document`] as a document for programs.

pub mod chart;
mod facts;
mod html;
mod inset;
mod left_out;
pub mod markdown;
mod markdown_text;
mod plots;
mod posterior;
mod process_noise;
mod profiles;
pub mod residuals;
mod setup;
mod tables;

pub use facts::{GenerationCosts, RecordingFacts, Report};
pub use html::escape;

use crate::identification::JobSpec;
use crate::identification::outcome::{NextStep, Outcome, Trust};
use greybox_simulation::model::ModelDescription;
use html::push;
use residuals::Diagnostics;
use serde::Serialize;
use utoipa::ToSchema;

/// A report for programs.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ReportDocument {
    /// The job's name, or what else it is called.
    pub title: String,
    /// When the job ended.
    pub finished_at: Option<String>,
    /// The specification of the job, with every default completed.
    pub spec: JobSpec,
    /// The model.
    pub model: ModelDescription,
    /// The recordings, one for each experiment.
    pub recordings: Vec<RecordingFacts>,
    /// The result of the job.
    pub result: Outcome,
    /// What the residuals look like.
    pub residuals: Vec<Diagnostics>,
}

/// The report for programs.
#[must_use]
pub fn document(report: &Report<'_>) -> ReportDocument {
    ReportDocument {
        title: report.title.to_owned(),
        finished_at: report.finished_at.map(str::to_owned),
        spec: report.spec.clone(),
        model: report.model.clone(),
        recordings: report.recordings.to_vec(),
        result: report.outcome.clone(),
        residuals: residuals::diagnostics(report.experiments),
    }
}

/// The page.
#[must_use]
pub fn render(report: &Report<'_>) -> String {
    let mut page = String::from("<!doctype html>\n<html lang=\"en\">\n<head>\n");
    let title = escape(report.title);
    let (style, charts) = (include_str!("style.css"), chart::STYLE);
    push(
        &mut page,
        format_args!(
            "<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width\">\n\
             <title>{title} – identification report</title>\n<style>\n{style}{charts}\
             @page {{ @bottom-left {{ content: \"{}\"; }} }}\n</style>\n</head>\n\
             <body>\n<header>\n<h1>{title}</h1>\n<p>Identification report · {}</p>\n",
            in_style(report.title),
            escape(&subtitle(report))
        ),
    );
    labels(&mut page, report.spec);
    note(&mut page, report.spec);
    page.push_str("</header>\n<main>\n");
    verdict(&mut page, report.outcome);
    tables::estimates(&mut page, report);
    profiles::section(&mut page, report.outcome);
    tables::budget(&mut page, report.outcome);
    tables::fit(&mut page, report);
    process_noise::section(&mut page, report);
    tables::model_search(&mut page, report.outcome);
    setup::model(&mut page, report);
    setup::recordings(&mut page, report);
    setup::fixed(&mut page, report);
    plots::experiments(&mut page, report);
    tables::correlation(&mut page, report.outcome);
    posterior::section(&mut page, report.outcome);
    plots::search(&mut page, report);
    tables::starts(&mut page, report.outcome);
    setup::sign_off(&mut page);
    origin(&mut page, report);
    page.push_str("</main>\n</body>\n</html>\n");
    reachable(&page)
}

/// What scrolls by itself on a narrow page can be reached by keyboard.
fn reachable(page: &str) -> String {
    let mut parts = page.split("<div class=\"scroll\">");
    let mut reached = parts.next().unwrap_or_default().to_owned();
    for (number, part) in (1..).zip(parts) {
        push(
            &mut reached,
            format_args!(
                "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"table \
                 {number}\">{part}"
            ),
        );
    }
    reached
}

fn subtitle(report: &Report<'_>) -> String {
    let outcome = report.outcome;
    let mut words = format!("model {}, {}", outcome.model, outcome.job);
    if let Some(instant) = report.finished_at {
        // To the second; nobody signs nanoseconds.
        let (date, time) = instant.split_once('T').unwrap_or((instant, ""));
        let time = time.split(['.', 'Z']).next().unwrap_or_default();
        push(&mut words, format_args!(", finished {date} {time} UTC"));
    }
    words
}

fn verdict(page: &mut String, outcome: &Outcome) {
    let trust = outcome.verdict.trust;
    let (class, words) = (trust.name(), verdict_words(trust));
    push(
        page,
        format_args!("<section class=\"verdict {class}\">\n<h2>{words}</h2>\n"),
    );
    if !outcome.verdict.summary.is_empty() {
        push(
            page,
            format_args!("<p>{}</p>\n", html::with_code(&outcome.verdict.summary)),
        );
    }
    if !outcome.verdict.reasons.is_empty() {
        page.push_str("<ul>\n");
        for reason in &outcome.verdict.reasons {
            push(
                page,
                format_args!(
                    "<li><strong>{}:</strong> {}",
                    reason.code.entry().title,
                    html::with_code(&reason.detail)
                ),
            );
            next_steps(page, &reason.next);
            page.push_str("</li>\n");
        }
        page.push_str("</ul>\n");
    }
    page.push_str("</section>\n");
}

/// What may be done about a reason.
fn next_steps(page: &mut String, steps: &[NextStep]) {
    if steps.is_empty() {
        return;
    }
    page.push_str("\n<ul>\n");
    for step in steps {
        let (label, why) = (escape(&step.label), escape(&step.why));
        push(page, format_args!("<li>{label}. {why}</li>\n"));
    }
    page.push_str("</ul>\n");
}

/// What a grade says of the numbers.
fn verdict_words(trust: Trust) -> &'static str {
    match trust {
        Trust::High => "High trust: nothing speaks against the numbers.",
        Trust::Moderate => "Moderate trust: use the numbers with these in mind.",
        Trust::Low => "Low trust: do not use the numbers before this is settled.",
    }
}

/// What the job is found by: site, rig, author.
fn labels(page: &mut String, spec: &JobSpec) {
    if spec.labels.is_empty() {
        return;
    }
    let shown = spec.labels.iter();
    let shown: Vec<String> = shown
        .map(|(name, value)| format!("{}: {}", escape(name), escape(value)))
        .collect();
    push(page, format_args!("<p>{}</p>\n", shown.join(" · ")));
}

/// What people noted of the job, in their lines.
fn note(page: &mut String, spec: &JobSpec) {
    if let Some(note) = &spec.note {
        let note = escape(note);
        push(page, format_args!("<p class=\"note\">{note}</p>\n"));
    }
}

/// Text as a string of a stylesheet.
fn in_style(text: &str) -> String {
    let mut string = String::new();
    for character in text.chars() {
        if character.is_alphanumeric() || " .,:()-".contains(character) {
            string.push(character);
        } else {
            push(&mut string, format_args!("\\{:x} ", u32::from(character)));
        }
    }
    string
}

/// The completed specification as it stands.
fn specification(report: &Report<'_>) -> String {
    serde_json::to_string_pretty(report.spec).expect("a specification has text keys")
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
    push(
        page,
        format_args!(
            "<h3>The completed specification</h3>\n<pre class=\"spec\">{}</pre>\n</section>\n",
            escape(&specification(report))
        ),
    );
}

#[cfg(test)]
pub mod tests;
