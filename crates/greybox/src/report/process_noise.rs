//! What moves the plant beside its inputs, in a report.

use super::facts::Report;
use super::html::{self, escape, optional, push};
use super::plots;
use super::tables::unknown;
use crate::identification::assemble::{DatedEvent, DisturbancePath};
use crate::identification::outcome::{DisturbanceReport, NoiseNumberReport, Outcome};
use crate::identification::spec::{ActsOnSpec, NoiseKind};
use greybox_numerics::digits::significant;

/// Digits of the numbers.
const DIGITS: usize = 3;

/// Events of a disturbance that are listed at the most.
const MOST_EVENTS: usize = 8;

/// The disturbances, the noise models that were compared, and what the free run makes of the parameters.
pub fn section(page: &mut String, report: &Report<'_>) {
    let outcome = report.outcome;
    let Some(noise) = &outcome.process_noise else {
        return;
    };
    page.push_str(
        "<section>\n<h2>What acted on the plant</h2>\n<div class=\"scroll\"><table>\n<thead><tr>\
         <th>acts on</th><th>kind</th><th>standard deviation</th><th>strength</th><th>memory [s]</th>\
         <th>share of an output's variance</th></tr></thead>\n",
    );
    for disturbance in &noise.disturbances {
        push(
            page,
            format_args!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                escape(&acted_on(&disturbance.acts_on)),
                disturbance.kind.name(),
                with_unit(disturbance.std.as_ref(), &disturbance.unit),
                with_unit(Some(&disturbance.strength), &strength_unit(disturbance)),
                number(disturbance.time_constant_s.as_ref()),
                escape(&shares(disturbance))
            ),
        );
    }
    page.push_str(
        "</table></div>\n<div class=\"scroll\"><table>\n<thead><tr><th>noise model</th>\
         <th>log-likelihood</th><th>BIC</th></tr></thead>\n",
    );
    for compared in &noise.compared {
        let mark = if compared.name == noise.chosen {
            " ←"
        } else {
            ""
        };
        push(
            page,
            format_args!(
                "<tr><td>{}{mark}</td><td>{}</td><td>{}</td></tr>\n",
                escape(&compared.name.replace('`', "")),
                optional(compared.log_likelihood),
                optional(compared.bic)
            ),
        );
    }
    page.push_str("</table></div>\n");
    let free: Vec<String> = outcome
        .output_error
        .iter()
        .map(|(name, free)| {
            let (name, unit) = unknown(outcome, name);
            let estimate = html::in_unit(&significant(free.estimate, 5), unit);
            format!("{} {estimate}", escape(&name))
        })
        .collect();
    push(
        page,
        format_args!(
            "<p>The free run, which knows of no disturbance, makes of the same record: {}.</p>\n",
            free.join(", ")
        ),
    );
    for (number, experiment) in report.disturbances.iter().enumerate() {
        for disturbance in &experiment.disturbances {
            let label = acted_on(&disturbance.acts_on);
            plots::disturbance(page, experiment, disturbance, &label);
            events(page, number, disturbance);
        }
    }
    page.push_str("</section>\n");
}

/// The largest events of a disturbance.
fn events(page: &mut String, experiment: usize, disturbance: &DisturbancePath) {
    if disturbance.events.is_empty() {
        return;
    }
    let mut largest: Vec<&DatedEvent> = disturbance.events.iter().collect();
    largest.sort_by(|a, b| b.residual.abs().total_cmp(&a.residual.abs()));
    let size = match disturbance.kind {
        NoiseKind::White => "mean",
        NoiseKind::Memory | NoiseKind::Walk => "change",
    };
    push(
        page,
        format_args!(
            "<p>Events in {}, experiment {}, that the noise model does not expect: {}, the largest first.</p>\n\
             <div class=\"scroll\"><table>\n<thead><tr><th>from [s]</th><th>to [s]</th>\
             <th>{size} [{}]</th><th>t</th></tr></thead>\n",
            escape(&acted_on(&disturbance.acts_on)),
            experiment + 1,
            largest.len(),
            escape(&disturbance.unit)
        ),
    );
    for event in largest.into_iter().take(MOST_EVENTS) {
        let [size, residual] = [event.size, event.residual].map(|value| significant(value, DIGITS));
        push(
            page,
            format_args!(
                "<tr><td>{}</td><td>{}</td><td>{size}</td><td>{residual}</td></tr>\n",
                html::number(event.start),
                html::number(event.end)
            ),
        );
    }
    page.push_str("</table></div>\n");
}

/// The section in Markdown.
pub fn markdown(text: &mut String, outcome: &Outcome) {
    let Some(noise) = &outcome.process_noise else {
        return;
    };
    text.push_str(
        "\n## What acted on the plant\n\n| acts on | kind | standard deviation | strength | memory [s] |\n\
         |---|---|---|---|---|\n",
    );
    for disturbance in &noise.disturbances {
        let std = with_unit(disturbance.std.as_ref(), &disturbance.unit);
        let strength = with_unit(Some(&disturbance.strength), &strength_unit(disturbance));
        push(
            text,
            format_args!(
                "| {} | {} | {std} | {strength} | {} |\n",
                acted_on(&disturbance.acts_on).replace('|', "\\|"),
                disturbance.kind.name(),
                number(disturbance.time_constant_s.as_ref())
            ),
        );
    }
}

/// The quantity that a disturbance acts on.
fn acted_on(acts_on: &ActsOnSpec) -> String {
    match acts_on {
        ActsOnSpec::Parameter(name) => name.clone(),
        ActsOnSpec::State(name) => format!("the rate of {name}"),
        ActsOnSpec::Output(name) => format!("the sensor of {name}"),
        ActsOnSpec::Sampled(name) => format!("what computes {name}"),
    }
}

fn strength_unit(disturbance: &DisturbanceReport) -> String {
    match disturbance.kind {
        NoiseKind::Walk => format!("{}/√s", disturbance.unit),
        NoiseKind::White | NoiseKind::Memory => format!("{}·√s", disturbance.unit),
    }
}

fn number(estimate: Option<&NoiseNumberReport>) -> String {
    let Some(number) = estimate else {
        return "–".to_owned();
    };
    let estimate = significant(number.estimate, DIGITS);
    match number.standard_error {
        Some(error) => format!("{estimate} ± {}", significant(error, DIGITS)),
        None => estimate,
    }
}

fn with_unit(estimate: Option<&NoiseNumberReport>, unit: &str) -> String {
    match estimate {
        Some(_) => html::in_unit(&number(estimate), unit),
        None => number(estimate),
    }
}

fn shares(disturbance: &DisturbanceReport) -> String {
    let shares = disturbance.share_of_output.iter();
    let shares =
        shares.map(|(output, share)| format!("{output} {} %", significant(100.0 * share, 2)));
    shares.collect::<Vec<_>>().join(", ")
}
