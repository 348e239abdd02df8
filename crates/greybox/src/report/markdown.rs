//! A result as Markdown: for wikis, merge requests and files that are compared line by line.

use super::html::{push, to_spread, unit_cell};
use super::markdown_text::{cell, line};
use super::tables::{end, output_unit};
use super::{Report, verdict_words};
use crate::identification::outcome::{Estimate, Outcome, Trust};
use greybox_numerics::digits::significant;

/// The report without its plots.
#[must_use]
pub fn render(report: &Report<'_>) -> String {
    let outcome = report.outcome;
    let mut text = format!("# {}\n\n{}\n", line(report.title), super::subtitle(report));
    push(
        &mut text,
        format_args!("\n**{}**\n\n", verdict_words(outcome.verdict.trust)),
    );
    if !outcome.verdict.summary.is_empty() {
        push(&mut text, format_args!("{}\n\n", outcome.verdict.summary));
    }
    for reason in &outcome.verdict.reasons {
        push(
            &mut text,
            format_args!("- **{}:** {}\n", reason.code.entry().title, reason.detail),
        );
        for step in &reason.next {
            push(
                &mut text,
                format_args!("  - {}. {}\n", step.label, step.why),
            );
        }
    }
    estimates(&mut text, outcome);
    super::profiles::markdown(&mut text, outcome);
    super::process_noise::markdown(&mut text, outcome);
    super::posterior::markdown(&mut text, outcome);
    fit(&mut text, report);
    budget(&mut text, outcome);
    fixed(&mut text, report);
    text.push_str("\n## Model\n\n```text\n");
    for equation in &report.model.equations {
        push(&mut text, format_args!("{equation}\n"));
    }
    text.push_str("```\n\n## Recordings\n\n| experiment | recording | recorded | samples | digest |\n|---|---|---|---:|---|\n");
    for (number, recording) in report.recordings.iter().enumerate() {
        push(
            &mut text,
            format_args!(
                "| {} | {} | {} | {} | `{}` |\n",
                number + 1,
                cell(recording.name.as_deref().unwrap_or("without a name")),
                recording.start.as_deref().unwrap_or("not said"),
                recording.samples,
                recording.digest
            ),
        );
    }
    for sentence in super::left_out::sentences(&report.spec.experiments) {
        push(&mut text, format_args!("\n{sentence}\n"));
    }
    let engine = &outcome.engine;
    push(
        &mut text,
        format_args!(
            "\n## What made it\n\ngreybox {}, seed {}, specification `{}`\n\n```json\n{}\n```\n",
            engine.version,
            engine.seed,
            engine.spec_digest,
            super::specification(report)
        ),
    );
    text
}

fn estimates(text: &mut String, outcome: &Outcome) {
    text.push_str(
        "\n## Estimates\n\n| parameter | estimate | ± | ± with all that is assumed | 95 % interval \
         with all that is assumed | trust | unit |\n|---|---:|---:|---:|---|---|---|\n",
    );
    let mut row = |name: &str, unit: &str, estimate: &Estimate| {
        let error = |value: Option<f64>| {
            value.map_or_else(|| "–".to_owned(), |error| significant(error, 2))
        };
        let interval = estimate.total_interval.map_or_else(
            || "–".to_owned(),
            |total| {
                let error = estimate.total_standard_error;
                format!("{} … {}", end(total.lower, error), end(total.upper, error))
            },
        );
        push(
            text,
            format_args!(
                "| {} | {} | {} | {} | {interval} | {} | {} |\n",
                cell(name),
                to_spread(estimate.estimate, estimate.standard_error),
                error(estimate.standard_error),
                error(estimate.total_standard_error),
                estimate.trust.map_or("–", Trust::name),
                cell(unit_cell(unit))
            ),
        );
    };
    for parameter in &outcome.parameters {
        row(&parameter.label(), &parameter.unit, &parameter.estimate);
    }
    for state in &outcome.initial_states {
        row(&state.label(), &state.unit, &state.estimate);
    }
}

fn fit(text: &mut String, report: &Report<'_>) {
    let outcome = report.outcome;
    text.push_str(
        "\n## Fit\n\n| output | data | fit [%] | RMSE | unit | samples |\n|---|---|---:|---:|---|---:|\n",
    );
    let parts = [
        ("estimated from", &outcome.fit.estimation),
        ("held back", &outcome.fit.validation),
    ];
    let number =
        |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| significant(value, 4));
    for (data, fits) in parts {
        for (output, fit) in fits.iter().filter(|(_, fit)| fit.samples > 0) {
            push(
                text,
                format_args!(
                    "| {} | {data} | {} | {} | {} | {} |\n",
                    cell(output),
                    number(fit.fit_percent),
                    number(fit.rmse),
                    cell(unit_cell(output_unit(report, output))),
                    fit.samples
                ),
            );
        }
    }
}

fn budget(text: &mut String, outcome: &Outcome) {
    if outcome.budget.is_empty() {
        return;
    }
    text.push_str("\n## What was taken as known\n\n| assumption | value | ± | unit | score |\n|---|---:|---:|---|---:|\n");
    for line in &outcome.budget {
        push(
            text,
            format_args!(
                "| {} | {} | {} | {} | {} |\n",
                cell(&line.assumption),
                significant(line.value, 5),
                significant(line.tolerance, 3),
                cell(unit_cell(&line.unit)),
                line.score
                    .map_or_else(|| "–".to_owned(), |score| significant(score, 3))
            ),
        );
    }
}

/// The parameters that were not estimated; nothing where all were.
fn fixed(text: &mut String, report: &Report<'_>) {
    let rows = super::setup::fixed_rows(report);
    if rows.is_empty() {
        return;
    }
    text.push_str(
        "\n## Taken as fixed\n\n| parameter | value | ± (one standard deviation) | unit |\n|---|---:|---:|---|\n",
    );
    for row in rows {
        let cells = row.map(|text| cell(&text));
        push(text, format_args!("| {} |\n", cells.join(" | ")));
    }
}
