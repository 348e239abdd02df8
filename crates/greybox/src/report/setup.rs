//! What a report says of what was asked: the model, the recordings, what was taken as fixed, and who
//! signs.

use super::facts::Report;
use super::html::{escape, number, push};
use super::left_out;
use crate::identification::spec::{ExperimentRole, ParameterSpec};
use greybox_numerics::digits::significant;
use greybox_simulation::model::Tolerance;

/// The model's equations and signals.
pub fn model(page: &mut String, report: &Report<'_>) {
    let model = report.model;
    push(
        page,
        format_args!(
            "<section>\n<h2>Model</h2>\n<p><strong>{}</strong> (<code>{}</code>). {}</p>\n<pre>",
            escape(&model.title),
            escape(&model.name),
            escape(&model.summary)
        ),
    );
    for line in &model.equations {
        push(page, format_args!("{}\n", escape(line)));
    }
    page.push_str(
        "</pre>\n<div class=\"scroll\"><table>\n<thead><tr><th>signal</th><th class=\"words\">is</th><th>unit</th>\
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
                escape(&signal.unit),
                escape(&recorded),
                escape(&signal.meaning)
            ),
        );
    }
    page.push_str("</table></div>\n</section>\n");
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

/// The parameters that were not estimated, with how well each is known, and the effects that the data did not
/// support; nothing where all were estimated.
pub fn fixed(page: &mut String, report: &Report<'_>) {
    let mut rows = String::new();
    for about in &report.model.parameters {
        let estimated = report.outcome.parameters.iter();
        let is_estimated = estimated
            .clone()
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
            _ => continue,
        };
        push(
            &mut rows,
            format_args!(
                "<tr><td>{} ({})</td><td>{}</td><td>{tolerance}</td><td>{}</td></tr>\n",
                escape(&about.name),
                escape(&about.symbol),
                number(value),
                escape(&about.unit)
            ),
        );
    }
    if rows.is_empty() {
        return;
    }
    push(
        page,
        format_args!(
            "<section>\n<h2>Taken as fixed</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>parameter</th><th>value</th>\
             <th>± (one standard deviation)</th><th>unit</th></tr></thead>\n{rows}</table></div>\n</section>\n"
        ),
    );
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
