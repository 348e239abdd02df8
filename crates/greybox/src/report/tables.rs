//! The tables of a report.

use super::Report;
use super::html::{
    escape, in_unit, labelled, number, optional, push, to_spread, unit_cell, with_code,
};
use crate::identification::budget::BudgetLine;
use crate::identification::outcome::{Estimate, Outcome, OutputFit, Trust};
use greybox_numerics::digits::significant;

/// Shares of a variance below this are not shown.
const SMALLEST_SHARE: f64 = 0.01;

/// The estimates and how well each is known.
pub fn estimates(page: &mut String, report: &Report<'_>) {
    let outcome = report.outcome;
    page.push_str(
        "<section>\n<h2>Estimates</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>parameter</th>\
         <th>estimate</th><th>unit</th><th>± of noise alone</th><th>95 % interval</th>\
         <th>± with all that is assumed</th><th>95 % interval</th><th>trust</th>\
         <th>searched</th></tr></thead>\n",
    );
    for parameter in &outcome.parameters {
        row(
            page,
            &parameter.label(),
            &parameter.unit,
            &parameter.estimate,
        );
    }
    for state in &outcome.initial_states {
        row(page, &state.label(), &state.unit, &state.estimate);
    }
    page.push_str("</table></div>\n");
    changes(page, report);
    if !outcome.flat_directions.is_empty() {
        page.push_str("<p class=\"warn\">What the data do not see:</p>\n<ul>\n");
        for words in &outcome.flat_directions {
            push(page, format_args!("<li>{}</li>\n", with_code(words)));
        }
        page.push_str("</ul>\n");
    }
    page.push_str("</section>\n");
}

fn row(page: &mut String, name: &str, unit: &str, estimate: &Estimate) {
    let error = estimate.standard_error;
    let interval = match &estimate.confidence_interval {
        Some(interval) => format!(
            "{} … {}<br><span class=\"muted\">{}</span>",
            end(interval.lower, error),
            end(interval.upper, error),
            escape(&interval.method.replace('_', " "))
        ),
        None => escape(
            estimate
                .confidence_interval_reason
                .as_deref()
                .unwrap_or("–"),
        ),
    };
    let total = match &estimate.total_interval {
        Some(interval) => {
            let error = estimate.total_standard_error;
            format!(
                "{} … {}",
                end(interval.lower, error),
                end(interval.upper, error)
            )
        }
        None => "–".to_owned(),
    };
    let trust = estimate.trust.map_or("–", Trust::name);
    let mut flags = String::new();
    if estimate.at_bound {
        flags.push_str("<br><span class=\"warn\">at its bound</span>");
    }
    if !estimate.identifiable {
        flags.push_str("<br><span class=\"warn\">not fixed by the data</span>");
    }
    push(
        page,
        format_args!(
            "<tr><td>{}{flags}</td><td>{}</td><td>{}</td><td>{}</td><td>{interval}</td>\
             <td>{}</td><td>{total}</td><td>{trust}</td><td>{} … {}</td></tr>\n",
            escape(name),
            to_spread(estimate.estimate, error),
            escape(unit_cell(unit)),
            error.map_or_else(|| "–".to_owned(), |error| significant(error, 2)),
            estimate
                .total_standard_error
                .map_or_else(|| "–".to_owned(), |error| significant(error, 2)),
            significant(estimate.lower, 4),
            significant(estimate.upper, 4)
        ),
    );
}

/// How much the outputs follow each parameter.
fn changes(page: &mut String, report: &Report<'_>) {
    let parameters = report.outcome.parameters.iter();
    let changes: Vec<String> = parameters
        .filter(|parameter| !parameter.estimate.output_change.is_empty())
        .map(|parameter| {
            let each = parameter.estimate.output_change.iter();
            let each: Vec<String> = each
                .map(|(output, change)| {
                    let change = in_unit(&significant(*change, 3), output_unit(report, output));
                    format!("{} {change}", escape(output))
                })
                .collect();
            format!("{}: {}", escape(&parameter.label()), each.join(", "))
        })
        .collect();
    if !changes.is_empty() {
        push(
            page,
            format_args!(
                "<p class=\"muted\">Change of the outputs, root mean square, when a \
                 parameter grows by 100 %: {}.</p>\n",
                changes.join("; ")
            ),
        );
    }
}

/// The unit of an output; empty where the model opted out of units.
pub fn output_unit<'r>(report: &Report<'r>, output: &str) -> &'r str {
    let mut outputs = report.model.outputs.iter();
    let named = outputs.find(|signal| signal.name == output);
    named.map_or("", |signal| &signal.unit)
}

/// The name and the unit of the unknown that the result has under a key; experiments count from 1. A key of no
/// estimate stands for itself.
pub fn unknown<'o>(outcome: &'o Outcome, key: &str) -> (String, &'o str) {
    let mut parameters = outcome.parameters.iter();
    let mut states = outcome.initial_states.iter();
    let parameter = parameters.find(|parameter| parameter.key() == key);
    match (parameter, states.find(|state| state.key() == key)) {
        (Some(parameter), _) => {
            let experiment = parameter.experiment.map(|experiment| experiment + 1);
            let place = experiment.map(|number| format!(" in experiment {number}"));
            let name = format!("{}{}", parameter.name, place.unwrap_or_default());
            (name, &*parameter.unit)
        }
        (None, Some(state)) => (state.label(), &*state.unit),
        (None, None) => (key.to_owned(), ""),
    }
}

/// An end of an interval, with the digits that the error needs.
pub fn end(value: Option<f64>, error: Option<f64>) -> String {
    value.map_or_else(|| "open".to_owned(), |value| to_spread(value, error))
}

/// Lines in a cell of a table.
fn joined(lines: &[String]) -> String {
    match lines {
        [] => "–".to_owned(),
        lines => lines.join("<br>"),
    }
}

/// The tolerance of a line, and whether nobody declared it.
fn tolerance(line: &BudgetLine) -> String {
    let size = significant(line.tolerance, 3);
    match line.by_default {
        true => format!("{size} (default)"),
        false => size,
    }
}

/// The table of what was taken as known, and how far it moves the estimates.
pub fn budget(page: &mut String, outcome: &Outcome) {
    if outcome.budget.is_empty() {
        return;
    }
    page.push_str(
        "<section>\n<h2>What was taken as known</h2>\n<div class=\"scroll\"><table>\n\
         <thead><tr><th>assumption</th><th>value</th><th>tolerance</th><th>unit</th><th>score</th>\
         <th>suggested</th><th>unnoticed up to</th><th>share of the total variance</th></tr></thead>\n",
    );
    let three =
        |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| significant(value, 3));
    for line in &outcome.budget {
        let suggested = line.suggested.map_or_else(
            || "–".to_owned(),
            |suggested| {
                let (value, error) = (suggested.value, suggested.standard_error);
                let value = to_spread(value, Some(error));
                format!("{value} ± {}", significant(error, 2))
            },
        );
        let shares: Vec<String> = line
            .contributions
            .iter()
            .filter(|(_, contribution)| contribution.share.abs() >= SMALLEST_SHARE)
            .map(|(name, contribution)| {
                let share = 100.0 * contribution.share;
                format!("{} {share:.0} %", escape(&unknown(outcome, name).0))
            })
            .collect();
        push(
            page,
            format_args!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{suggested}</td>\
                 <td>{}</td><td>{}</td></tr>\n",
                escape(&line.assumption),
                number(line.value),
                tolerance(line),
                escape(unit_cell(&line.unit)),
                three(line.score),
                three(line.unnoticed_up_to),
                joined(&shares)
            ),
        );
    }
    page.push_str("</table></div>\n</section>\n");
}

/// How well the outputs are followed, and what the residuals look like.
pub fn fit(page: &mut String, report: &Report<'_>) {
    let outcome = report.outcome;
    page.push_str(
        "<section>\n<h2>Fit</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>output</th><th>data</th>\
         <th>fit [%]</th><th>RMSE</th><th>largest error</th><th>samples</th></tr></thead>\n",
    );
    let parts = [
        ("estimated from", &outcome.fit.estimation),
        ("held back", &outcome.fit.validation),
    ];
    for (data, fits) in parts {
        for (output, fit) in fits.iter().filter(|(_, fit)| fit.samples > 0) {
            fit_row(page, (output, output_unit(report, output)), data, fit);
        }
    }
    page.push_str(
        "</table></div>\n<div class=\"scroll\"><table>\n<thead><tr><th>residuals of</th><th>noise</th>\
         <th>chi²/n</th><th>correlation with the next</th><th>white</th><th>Ljung–Box p</th>\
         <th class=\"words\">follow an input</th></tr></thead>\n",
    );
    let two =
        |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| significant(value, 2));
    for (output, residuals) in &outcome.residuals {
        let white = match residuals.white {
            Some(true) => "yes",
            Some(false) => "no",
            None => "too few to tell",
        };
        let follow: Vec<String> = residuals
            .inputs
            .iter()
            .map(|(input, following)| {
                let correlation = two(following.correlation);
                let word = if following.significant { "yes" } else { "no" };
                format!("{}: {word} ({correlation})", escape(input))
            })
            .collect();
        let outliers = residuals
            .outliers
            .map_or_else(String::new, |count| format!("<br>{count} outliers"));
        push(
            page,
            format_args!(
                "<tr><td>{}</td><td>{} ({}){outliers}</td><td>{}</td><td>{}</td><td>{white}</td>\
                 <td>{}</td><td class=\"words\">{}</td></tr>\n",
                escape(output),
                in_unit(
                    &significant(residuals.noise_std, 3),
                    output_unit(report, output)
                ),
                escape(&residuals.noise_std_source),
                optional(residuals.chi_square_per_sample),
                optional(residuals.lag_1_autocorrelation),
                two(residuals.ljung_box_p),
                joined(&follow)
            ),
        );
    }
    page.push_str("</table></div>\n");
    criteria(page, outcome);
}

/// The cost and the information criteria, which end the section of the fit.
fn criteria(page: &mut String, outcome: &Outcome) {
    let criteria = &outcome.criteria;
    push(
        page,
        format_args!(
            "<p>AIC {} · AICc {} · BIC {} · FPE {} · cost {}</p>\n</section>\n",
            optional(criteria.aic),
            optional(criteria.aicc),
            optional(criteria.bic),
            optional(criteria.fpe),
            optional(criteria.cost)
        ),
    );
}

fn fit_row(page: &mut String, (output, unit): (&str, &str), data: &str, fit: &OutputFit) {
    let quantity = |value: Option<f64>| in_unit(&optional(value), unit);
    push(
        page,
        format_args!(
            "<tr><td>{}</td><td>{data}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
            escape(output),
            optional(fit.fit_percent),
            quantity(fit.rmse),
            quantity(fit.max_abs_error),
            fit.samples
        ),
    );
}

/// A label that may be broken behind each underscore.
fn breakable(label: &str) -> String {
    escape(label).replace('_', "_<wbr>")
}

/// How the errors of the estimates hang together.
pub fn correlation(page: &mut String, outcome: &Outcome) {
    let Some(correlation) = &outcome.correlation else {
        return;
    };
    page.push_str(
        "<section>\n<h2>Correlation of the estimates</h2>\n<div class=\"scroll\"><table class=\"unknowns\">\n\
         <thead><tr><th>correlation [1]</th>",
    );
    for name in &correlation.names {
        let (name, _) = unknown(outcome, name);
        push(page, format_args!("<th>{}</th>", breakable(&name)));
    }
    page.push_str("</tr></thead>\n");
    for (name, row) in correlation.names.iter().zip(&correlation.matrix) {
        let (name, _) = unknown(outcome, name);
        push(page, format_args!("<tr><td>{}</td>", escape(&name)));
        for entry in row {
            // The deeper the colour, the less the two are told apart.
            let depth = entry.map_or(0.0, |value| value.abs() * 0.5);
            let words = entry.map_or_else(|| "–".to_owned(), |value| format!("{value:.2}"));
            push(
                page,
                format_args!("<td style=\"background:rgb(200 70 47 / {depth:.2})\">{words}</td>"),
            );
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table></div>\n");
    if let Some(condition) = correlation.condition_number {
        push(
            page,
            format_args!("<p>Condition number {}.</p>\n", significant(condition, 3)),
        );
    }
    page.push_str("</section>\n");
}

/// Which effects the data support, where the job left that open; the best model first.
pub fn model_search(page: &mut String, outcome: &Outcome) {
    let Some(search) = &outcome.model_search else {
        return;
    };
    let listed = |effects: &[String]| match effects {
        [] => "none".to_owned(),
        some => escape(&some.join(", ")),
    };
    push(
        page,
        format_args!(
            "<section>\n<h2>Effects</h2>\n<p>The data support: {}. Compared by the BIC of the \
             {} data.</p>\n<div class=\"scroll\"><table>\n<thead><tr><th>effects</th><th>unknowns</th>\
             <th>cost</th><th>BIC</th></tr></thead>\n",
            listed(&search.supported),
            escape(&search.compared_on)
        ),
    );
    for tried in &search.tried {
        push(
            page,
            format_args!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                listed(&tried.effects),
                tried.unknowns,
                optional(tried.cost),
                optional(tried.bic)
            ),
        );
    }
    page.push_str("</table></div>\n</section>\n");
}

/// Where each start of the refinement ended, the lowest first.
pub fn starts(page: &mut String, outcome: &Outcome) {
    let mut starts: Vec<_> = outcome.starts.iter().collect();
    let cost = |cost: Option<f64>| cost.unwrap_or(f64::INFINITY);
    starts.sort_by(|a, b| cost(a.cost).total_cmp(&cost(b.cost)));
    let Some(first) = starts.first() else {
        return;
    };
    page.push_str(
        "<section>\n<h2>Starts of the refinement</h2>\n<div class=\"scroll\"><table class=\"unknowns\">\n<thead><tr>\
         <th>cost</th><th>from</th>",
    );
    for name in first.parameters.keys() {
        let (name, unit) = unknown(outcome, name);
        let label = labelled(&name, unit);
        push(page, format_args!("<th>{}</th>", breakable(&label)));
    }
    page.push_str("</tr></thead>\n");
    for start in starts {
        push(
            page,
            format_args!(
                "<tr><td>{}</td><td>{}</td>",
                optional(start.cost),
                optional(start.initial_cost)
            ),
        );
        for value in start.parameters.values() {
            push(page, format_args!("<td>{}</td>", number(*value)));
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table></div>\n</section>\n");
}
