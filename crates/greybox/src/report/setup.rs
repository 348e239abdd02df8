//! What a report says of what was asked: the model, the recordings, what was taken as fixed, and who
//! signs.

use super::facts::Report;
use super::html::{escape, number, push, unit_cell};
use super::left_out;
use crate::identification::spec::{ExperimentRole, ParameterSpec};
use greybox_numerics::digits::significant;
use greybox_simulation::mathml::{self, TypesetEquation};
use greybox_simulation::model::{ParameterDescription, Tolerance};
use std::borrow::Cow;

/// The model's equations and signals.
pub fn model(page: &mut String, report: &Report<'_>) {
    let model = report.model;
    push(
        page,
        format_args!(
            "<section>\n<h2>Model</h2>\n<p><strong>{}</strong> (<code>{}</code>). {}</p>\n",
            escape(&model.title),
            escape(&model.name),
            escape(&model.summary)
        ),
    );
    equations(page, &model.equations);
    page.push_str(
        "<div class=\"scroll\"><table>\n<thead><tr><th>signal</th><th class=\"words\">is</th><th>unit</th>\
         <th class=\"words\">recorded as</th><th class=\"words\">meaning</th></tr></thead>\n",
    );
    let used = |name: &str| {
        let experiments = report.spec.experiments.iter();
        let mut names: Vec<&str> = experiments
            .filter_map(|experiment| experiment.signals.get(name).map(String::as_str))
            .collect();
        names.dedup();
        names.join(", ")
    };
    let inputs = model.inputs.iter().map(|signal| ("input", signal));
    let outputs = model.outputs.iter().map(|signal| ("output", signal));
    for (kind, signal) in inputs.chain(outputs) {
        let recorded = used(&signal.name);
        if recorded.is_empty() {
            continue;
        }
        push(
            page,
            format_args!(
                "<tr><td>{}</td><td class=\"words\">{kind}</td><td>{}</td><td class=\"words\">{}</td>\
                 <td class=\"words\">{}</td></tr>\n",
                escape(&signal.name),
                escape(unit_cell(&signal.unit)),
                escape(&recorded),
                escape(&signal.meaning)
            ),
        );
    }
    page.push_str("</table></div>\n</section>\n");
}

/// The equations as they are written by hand; as code where they are not all in the language of model documents.
fn equations(page: &mut String, lines: &[Cow<'static, str>]) {
    let typeset = lines.iter().map(|line| mathml::equation(line));
    let Some(typeset) = typeset.collect::<Option<Vec<_>>>() else {
        return push(
            page,
            format_args!("<pre>{}</pre>\n", escape(&lines.join("\n"))),
        );
    };
    for TypesetEquation {
        pieces,
        text,
        words,
    } in typeset
    {
        let text = escape(text);
        let drawn: Vec<String> = pieces
            .iter()
            .map(|piece| format!("<math displaystyle=\"true\" aria-hidden=\"true\">{piece}</math>"))
            .collect();
        let shown = match drawn.is_empty() {
            true => format!("<code>{text}</code>"),
            false => format!(
                "<span role=\"math\" aria-label=\"{text}\">{}</span>",
                drawn.join(" ")
            ),
        };
        push(
            page,
            format_args!(
                "<p class=\"equation\">{shown}<span class=\"muted\">{}</span></p>\n",
                escape(words)
            ),
        );
    }
}

/// The recordings, an experiment after the other.
pub fn recordings(page: &mut String, report: &Report<'_>) {
    page.push_str(
        "<section>\n<h2>Recordings</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>experiment</th>\
         <th class=\"words\">recording</th><th class=\"words\">recorded</th><th>samples</th>\
         <th>used [s]</th><th class=\"words\">for</th></tr></thead>\n",
    );
    let experiments = report.spec.experiments.iter().zip(report.recordings);
    for (number, (experiment, recording)) in experiments.enumerate() {
        let window = experiment.window.as_ref();
        let from = window.and_then(|window| window.from_s).unwrap_or(0.0);
        let to = window.and_then(|window| window.to_s);
        let to = to.unwrap_or(recording.duration_s);
        let role = match experiment.role {
            ExperimentRole::Estimation => "estimation",
            ExperimentRole::Validation => "validation only",
        };
        let place = recording.zone.as_deref();
        let place = place.map_or_else(String::new, |zone| format!(" ({})", escape(zone)));
        push(
            page,
            format_args!(
                "<tr><td>{}</td><td class=\"words\">{}<br><code>{}</code><br><code>{}</code></td>\
                 <td class=\"words\">{}{place}</td><td>{}</td><td>{} … {}</td>\
                 <td class=\"words\">{role}</td></tr>\n",
                number + 1,
                escape(recording.name.as_deref().unwrap_or("without a name")),
                experiment.dataset,
                escape(&recording.digest),
                recording
                    .start
                    .as_deref()
                    .map_or_else(|| "not said".to_owned(), escape),
                recording.samples,
                significant(from, 6),
                significant(to, 6)
            ),
        );
    }
    page.push_str("</table></div>\n");
    for sentence in left_out::sentences(&report.spec.experiments) {
        push(page, format_args!("<p>{}</p>\n", escape(&sentence)));
    }
    page.push_str("</section>\n");
}

/// The parameters that were not estimated, each as name, value, tolerance and unit, with the effects that the data
/// did not support.
pub fn fixed_rows(report: &Report<'_>) -> Vec<[String; 4]> {
    let row = |about: &ParameterDescription| {
        let estimated = &report.outcome.parameters;
        let is_estimated = estimated
            .iter()
            .any(|parameter| parameter.name == about.name);
        let (value, tolerance) = match report.spec.parameters.get(&*about.name) {
            Some(ParameterSpec::Fixed(fixed)) => {
                let tolerance = match fixed.tolerance.or(about.tolerance) {
                    None => "exact".to_owned(),
                    Some(Tolerance::Absolute(deviation)) => significant(deviation, 3),
                    Some(Tolerance::Percent(share)) => format!("{} %", significant(share, 3)),
                };
                (fixed.value, tolerance)
            }
            Some(_) if !is_estimated => (
                about.default,
                "left out: the data do not support it".to_owned(),
            ),
            _ => return None,
        };
        let name = format!("{} ({})", about.name, about.symbol);
        let unit = unit_cell(&about.unit).to_owned();
        Some([name, number(value), tolerance, unit])
    };
    report.model.parameters.iter().filter_map(row).collect()
}

/// The table of the parameters that were not estimated; nothing where all were.
pub fn fixed(page: &mut String, report: &Report<'_>) {
    let rows = fixed_rows(report);
    if rows.is_empty() {
        return;
    }
    page.push_str(
        "<section>\n<h2>Taken as fixed</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>parameter</th><th>value</th>\
         <th>± (one standard deviation)</th><th>unit</th></tr></thead>\n",
    );
    for row in rows {
        let cells = row.map(|cell| format!("<td>{}</td>", escape(&cell)));
        push(page, format_args!("<tr>{}</tr>\n", cells.concat()));
    }
    page.push_str("</table></div>\n</section>\n");
}

/// Who made, checked and released it.
pub fn sign_off(page: &mut String) {
    page.push_str(
        "<section class=\"sign\">\n<h2>Sign-off</h2>\n<table>\n<tr><td></td>\
         <th class=\"words\">name</th><th class=\"words\">place and date</th>\
         <th class=\"words\">signature</th></tr>\n",
    );
    for role in ["prepared by", "checked by", "released by"] {
        push(
            page,
            format_args!("<tr><td>{role}</td><td></td><td></td><td></td></tr>\n"),
        );
    }
    page.push_str("</table>\n</section>\n");
}
