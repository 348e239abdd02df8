//! What moves the plant beside its inputs, in a report.

use super::html::{escape, optional, push};
use crate::identification::outcome::{DisturbanceReport, NoiseNumberReport, Outcome};
use crate::identification::spec::{ActsOnSpec, NoiseKind};
use greybox_numerics::digits::significant;

/// Digits of the numbers.
const DIGITS: usize = 3;

/// The disturbances, the noise models that were compared, and what the free run makes of the parameters.
pub fn section(page: &mut String, outcome: &Outcome) {
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
        .map(|(name, free)| format!("{name} {}", significant(free.estimate, 5)))
        .collect();
    push(
        page,
        format_args!(
            "<p>The free run, which knows of no disturbance, makes of the same record: {}.</p>\n\
             </section>\n",
            escape(&free.join(", "))
        ),
    );
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

fn acted_on(acts_on: &ActsOnSpec) -> String {
    match acts_on {
        ActsOnSpec::Parameter(name) => name.clone(),
        ActsOnSpec::State(name) => format!("the rate of {name}"),
        ActsOnSpec::Output(name) => format!("the sensor of {name}"),
    }
}

fn strength_unit(disturbance: &DisturbanceReport) -> String {
    match disturbance.kind {
        NoiseKind::Walk => format!("{}/√s", disturbance.unit),
        NoiseKind::White | NoiseKind::Memory => format!("{}·√s", disturbance.unit),
    }
}

fn number(found: Option<&NoiseNumberReport>) -> String {
    let Some(found) = found else {
        return "–".to_owned();
    };
    let estimate = significant(found.estimate, DIGITS);
    match found.standard_error {
        Some(error) => format!("{estimate} ± {}", significant(error, DIGITS)),
        None => estimate,
    }
}

fn with_unit(found: Option<&NoiseNumberReport>, unit: &str) -> String {
    match found {
        Some(_) => format!("{} {}", number(found), escape(unit)),
        None => number(found),
    }
}

fn shares(disturbance: &DisturbanceReport) -> String {
    let shares = disturbance.share_of_output.iter();
    let shares =
        shares.map(|(output, share)| format!("{output} {} %", significant(100.0 * share, 2)));
    shares.collect::<Vec<_>>().join(", ")
}
