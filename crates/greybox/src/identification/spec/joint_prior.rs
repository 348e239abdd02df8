//! The `priors` section: what is known of several parameters together.

use super::entries;
use super::own_parameters::JobParameters;
use crate::estimation::prior::JointPrior;
use greybox_numerics::parsing::reader::{Field, did_you_mean};
use greybox_simulation::model::Scale;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The joint priors of one job at the most.
pub const MAX_PRIORS: usize = 16;

/// What is known of several parameters together before the recording is looked at: a normal
/// distribution, of their logarithms on a log scale. The last estimate is one: its values, its
/// standard errors and its correlations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = JointPrior, example = json!({
    "parameters": ["mass", "viscous_damping"],
    "mean": [58.0, 420.0],
    "covariance": [[4.0, 3.0], [3.0, 90.0]]
}))]
pub struct JointPriorSpec {
    /// Estimated parameters that all experiments share, each in one prior.
    #[schema(min_items = 2)]
    pub parameters: Vec<String>,
    /// The mean of each parameter, SI.
    pub mean: Vec<f64>,
    /// The covariance of the parameters, SI. In its place a job may give `std`, the standard
    /// deviation of each, and `correlation`, their correlations.
    pub covariance: Vec<Vec<f64>>,
    /// What is normal: the values, or their logarithms.
    #[serde(default)]
    #[schema(required = false)]
    pub scale: Scale,
}

/// The section; what is wrong is told.
pub(super) fn read(field: &Field<'_>, parameters: JobParameters<'_>) -> Vec<JointPriorSpec> {
    let mut priors: Vec<JointPriorSpec> = Vec::new();
    for entry in entries::first(field, MAX_PRIORS, "priors") {
        priors.extend(read_prior(&entry, parameters, &priors));
    }
    priors
}

/// A joint prior, after those of the same job before it.
fn read_prior(
    field: &Field<'_>,
    job: JobParameters<'_>,
    before: &[JointPriorSpec],
) -> Option<JointPriorSpec> {
    let model = job.model;
    let before = before.iter().flat_map(|prior| &prior.parameters);
    let mut object = field.object()?;
    let mut parameters: Vec<String> = Vec::new();
    let named = object.required("parameters");
    for entry in named.iter().filter_map(Field::array).flatten() {
        let name = entry.text()?;
        if model.parameter_index(name).is_none() {
            let hint = did_you_mean(name, model.parameters.iter().map(|p| &*p.name));
            let detail = format!("`{}` has no parameter of this name{hint}", model.name);
            entry.fault("unknown_parameter", detail);
        } else if let Some(unknown) = job.shared_unknown(name) {
            let is_same = |other: &String| other == name;
            if unknown.prior.is_some()
                || parameters.iter().any(is_same)
                || before.clone().any(is_same)
            {
                let detail = format!("of `{name}` something else is known already: one prior each");
                entry.fault("duplicate", detail);
            }
        } else {
            let detail = format!("`{name}` is not estimated for all experiments together");
            entry.fault("not_estimated", detail);
        }
        parameters.push(name.to_owned());
    }
    let n = parameters.len();
    if let (Some(named), true) = (&named, n < 2) {
        let detail = "a joint prior is one of two parameters or more";
        named.fault("out_of_range", detail);
    }
    let mean = object.required("mean");
    let mean = mean.and_then(|field| numbers(&field, n));
    let scale = object.optional("scale");
    let scale = scale.map(|field| field.choice(&[("linear", Scale::Linear), ("log", Scale::Log)]));
    let scale = scale.unwrap_or(Some(Scale::Linear));
    let [covariance, std, correlation] =
        ["covariance", "std", "correlation"].map(|name| object.optional(name));
    let covariance = match (covariance, std, correlation) {
        (Some(covariance), None, None) => matrix(&covariance, n),
        (None, Some(std), Some(correlation)) => {
            let (std, correlation) = (numbers(&std, n), matrix(&correlation, n));
            std.zip(correlation).map(|(std, rows)| scaled(&rows, &std))
        }
        _ => {
            let detail = "either `covariance` is needed, or `std` and `correlation`";
            object.fault("missing_field", detail);
            None
        }
    };
    object.finish();
    let prior = JointPriorSpec {
        parameters,
        mean: mean?,
        covariance: covariance?,
        scale: scale?,
    };
    is_sound(field, &prior).then_some(prior)
}

/// Whether there is such a distribution.
fn is_sound(field: &Field<'_>, prior: &JointPriorSpec) -> bool {
    if prior.scale == Scale::Log && prior.mean.iter().any(|mean| *mean <= 0.0) {
        let detail = "a mean that is not above 0 has no logarithm";
        field.fault("out_of_range", detail);
        return false;
    }
    let rows = prior.covariance.iter().enumerate();
    let mut pairs = rows.flat_map(|(a, row)| row.iter().enumerate().map(move |(b, x)| (a, b, x)));
    let is_symmetric = pairs.all(|(a, b, entry)| {
        let (other, size) = (
            prior.covariance[b][a],
            (prior.covariance[a][a] * prior.covariance[b][b]).sqrt(),
        );
        (entry - other).abs() <= 1e-9 * size
    });
    let places = (0..prior.parameters.len()).collect();
    let joint = JointPrior::new(places, prior.scale, &prior.mean, &prior.covariance);
    let is_sound = is_symmetric && joint.is_some();
    if !is_sound {
        let detail = "the covariance is not symmetric and positive definite";
        field.fault("not_a_covariance", detail);
    }
    is_sound
}

/// A list of so many numbers.
fn numbers(field: &Field<'_>, n: usize) -> Option<Vec<f64>> {
    let entries = field.array()?;
    if entries.len() != n {
        let detail = format!("{} entries, where {n} are needed", entries.len());
        field.fault("wrong_length", detail);
        return None;
    }
    entries.map(|entry| entry.number()).collect()
}

fn matrix(field: &Field<'_>, n: usize) -> Option<Vec<Vec<f64>>> {
    let rows = field.array()?;
    if rows.len() != n {
        let detail = format!("{} rows, where {n} are needed", rows.len());
        field.fault("wrong_length", detail);
        return None;
    }
    rows.map(|row| numbers(&row, n)).collect()
}

/// The covariance of deviations and correlations.
fn scaled(correlation: &[Vec<f64>], std: &[f64]) -> Vec<Vec<f64>> {
    let rows = correlation.iter().zip(std);
    let row = |(row, of_row): (&Vec<f64>, &f64)| {
        let pairs = row.iter().zip(std);
        pairs
            .map(|(entry, of_column)| entry * of_row * of_column)
            .collect()
    };
    rows.map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::own_parameters;
    use super::*;
    use serde_json::{Value, json};

    fn faults(document: &Value) -> Vec<(String, String)> {
        own_parameters::faults_of(document, read)
    }

    #[test]
    fn what_is_no_distribution_of_unknowns_is_refused_at_its_place() {
        let with = |changed: &[(&str, Value)]| {
            let mut prior = json!({
                "parameters": ["mass", "damping"], "mean": [58, 420], "std": [2, 9],
                "correlation": [[1, 0.5], [0.5, 1]]
            });
            for (name, value) in changed {
                prior[name] = value.clone();
            }
            json!([prior])
        };
        assert_eq!(faults(&with(&[])), []);
        assert_eq!(faults(&with(&[("scale", json!("log"))])), []);
        let correlation = |value: f64| json!([[1, value], [value, 1]]);
        for (changed, pointer, code) in [
            (
                ("parameters", json!(["mass", "dampng"])),
                "/0/parameters/1",
                "unknown_parameter",
            ),
            (
                ("parameters", json!(["mass", "supply_pressure"])),
                "/0/parameters/1",
                "not_estimated",
            ),
            (
                ("parameters", json!(["mass", "mass"])),
                "/0/parameters/1",
                "duplicate",
            ),
            (("mean", json!([58])), "/0/mean", "wrong_length"),
            (("correlation", correlation(1.2)), "/0", "not_a_covariance"),
            (
                ("correlation", json!([[1, 0.5], [0.4, 1]])),
                "/0",
                "not_a_covariance",
            ),
            (
                ("covariance", json!([[4, 3], [3, 9]])),
                "/0",
                "missing_field",
            ),
        ] {
            let expected = (pointer.to_owned(), code.to_owned());
            assert_eq!(
                faults(&with(std::slice::from_ref(&changed))),
                [expected],
                "{changed:?}"
            );
        }
        let twice = [with(&[])[0].clone(), with(&[])[0].clone()];
        let duplicate = |place| (format!("/1/parameters/{place}"), "duplicate".to_owned());
        assert_eq!(faults(&json!(twice)), [duplicate(0), duplicate(1)]);
    }
}
