//! A result as people read it: a table of parameters (Markdown), the verdict and how well the outputs fit.

use comfy_table::{Table, presets};
use greybox::identification::outcome::{Estimate, Outcome, OutputFit, Trust};
use greybox::numerics::digits::significant;
use std::collections::BTreeMap;

/// What is shown of a result; `truths` are the known values of a plant that has them.
pub fn of(outcome: &Outcome, truths: Option<&[(String, f64)]>) -> String {
    let mut text = format!("{}\n\n{}", estimates(outcome, truths), verdict(outcome));
    text += &fit("estimation", &outcome.fit.estimation);
    text += &fit("validation", &outcome.fit.validation);
    text
}

fn estimates(outcome: &Outcome, truths: Option<&[(String, f64)]>) -> String {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    let mut header = vec![
        "parameter",
        "unit",
        "estimate",
        "±",
        "noise alone",
        "95 % interval",
        "trust",
        "",
    ];
    if truths.is_some() {
        header.splice(2..2, ["true value"]);
        header.splice(4..4, ["error"]);
    }
    table.set_header(header);
    for parameter in &outcome.parameters {
        let truth = truths.map(|truths| {
            let of_name = truths.iter().find(|(name, _)| *name == parameter.name);
            of_name.map(|(_, value)| *value)
        });
        let name = parameter.label();
        table.add_row(row(name, &parameter.unit, &parameter.estimate, truth));
    }
    for state in &outcome.initial_states {
        let truth = truths.map(|_| None);
        table.add_row(row(state.label(), &state.unit, &state.estimate, truth));
    }
    table.trim_fmt()
}

/// A row shows the error and the interval with all that was taken as known, and the error of noise alone beside
/// them; `truth`: no such column, a column without a value, or a value.
fn row(name: String, unit: &str, estimate: &Estimate, truth: Option<Option<f64>>) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or("-".to_owned(), short);
    let total = estimate
        .total_interval
        .map(|total| (total.lower, total.upper));
    let noise = estimate.confidence_interval.as_ref();
    let interval = total.or(noise.map(|noise| (noise.lower, noise.upper)));
    let end = |value: Option<f64>| value.map_or("open".to_owned(), short);
    let mut cells = vec![
        name,
        unit.to_owned(),
        short(estimate.estimate),
        number(estimate.total_standard_error.or(estimate.standard_error)),
        number(estimate.standard_error),
        interval.map_or("-".to_owned(), |(lower, upper)| {
            format!("{} to {}", end(lower), end(upper))
        }),
        estimate.trust.map_or("-", Trust::name).to_owned(),
        remark(estimate).to_owned(),
    ];
    if let Some(truth) = truth {
        let error = truth.map(|truth| 100.0 * (estimate.estimate / truth - 1.0));
        let error = error.filter(|error| error.is_finite());
        cells.insert(2, number(truth));
        cells.insert(4, error.map_or("-".to_owned(), |e| format!("{e:+.2} %")));
    }
    cells
}

fn remark(estimate: &Estimate) -> &'static str {
    match (estimate.at_bound, estimate.identifiable) {
        (true, _) => "at a bound",
        (false, false) => "not identifiable",
        (false, true) => "",
    }
}

fn verdict(outcome: &Outcome) -> String {
    let trust = outcome.verdict.trust.name();
    let mut text = format!("trust {trust}, ended by {}\n", outcome.stop_reason.name());
    for reason in &outcome.verdict.reasons {
        text += &format!("  {}: {}\n", reason.code, reason.detail);
        for step in &reason.next {
            text += &format!("    next: {}. {}\n", step.label, step.why);
        }
    }
    if let Some(search) = &outcome.model_search {
        let effects = match &search.supported[..] {
            [] => "none of the effects".to_owned(),
            some => some.join(", "),
        };
        text += &format!("the {} data support {effects}\n", search.compared_on);
    }
    text
}

fn fit(data: &str, outputs: &BTreeMap<String, OutputFit>) -> String {
    let number = |value: Option<f64>| value.map_or("-".to_owned(), short);
    outputs
        .iter()
        .map(|(output, fit)| {
            format!(
                "{data} data, {output}: fit {} %, rmse {}, largest error {}, {} samples\n",
                number(fit.fit_percent),
                number(fit.rmse),
                number(fit.max_abs_error),
                fit.samples
            )
        })
        .collect()
}

/// A number of a table.
pub fn short(value: f64) -> String {
    significant(value, 5)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(json: serde_json::Value) -> Estimate {
        serde_json::from_value(json).expect("an estimate")
    }

    #[test]
    fn a_row_shows_the_total_interval_and_the_truth_where_it_is_known() {
        let estimate = estimate(serde_json::json!({
            "estimate": 59.0, "standard_error": 0.5, "total_standard_error": 4.0, "trust": "moderate",
            "confidence_interval": {"level": 0.95, "lower": 58.0, "upper": null, "method": "profile"},
            "total_interval": {"level": 0.95, "lower": 51.0, "upper": null},
            "lower": 20.0, "upper": 120.0, "at_bound": false, "identifiable": true,
        }));
        let cells = row("mass (M)".to_owned(), "kg", &estimate, Some(Some(50.0)));
        let expected = [
            "mass (M)",
            "kg",
            "50.000",
            "59.000",
            "+18.00 %",
            "4.0000",
            "0.50000",
            "51.000 to open",
            "moderate",
            "",
        ];
        assert_eq!(cells, expected);
        let cells = row("mass (M)".to_owned(), "kg", &estimate, None);
        assert_eq!(cells.len(), 8);
    }

    #[test]
    fn a_parameter_at_its_bound_or_without_information_is_marked() {
        let at_bound = estimate(serde_json::json!({
            "estimate": 20.0, "standard_error": null, "confidence_interval": null,
            "lower": 20.0, "upper": 120.0, "at_bound": true, "identifiable": false,
        }));
        assert_eq!(remark(&at_bound), "at a bound");
        let unknown = Estimate {
            at_bound: false,
            ..at_bound
        };
        assert_eq!(remark(&unknown), "not identifiable");
    }
}
