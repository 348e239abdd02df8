//! Parameters and signals that are assigned on the command line, as parts of a job document.

use super::error::CommandError;
use serde_json::{Map, Value, json};

/// Reads `mass=50..70`, `mass=50..70:log`, `mass=58`, `mass=58±1%` or `mass=?` as the entry of a parameter
/// in a job.
///
/// # Errors
/// A sentence on what cannot be read.
pub fn parameter(assignment: &str) -> Result<(String, Value), String> {
    let (name, value) = pair(assignment, "mass=50..70, mass=58, mass=58±1% or mass=?")?;
    let entry = if value == "?" {
        json!({"estimate": {}})
    } else if let Some((lower, rest)) = value.split_once("..") {
        let (upper, scale) = match rest.split_once(':') {
            Some((upper, scale)) => (upper, Some(scale)),
            None => (rest, None),
        };
        let mut range = Map::new();
        for (side, text) in [("lower", lower), ("upper", upper)] {
            if !text.is_empty() {
                range.insert(side.to_owned(), number(assignment, text)?);
            }
        }
        range.extend(scale.map(|scale| ("scale".to_owned(), Value::from(scale))));
        json!({"estimate": range})
    } else if let Some((value, tolerance)) =
        value.split_once('±').or_else(|| value.split_once("+-"))
    {
        let tolerance = match tolerance.trim() {
            share if share.ends_with('%') => Value::from(share),
            absolute => number(assignment, absolute)?,
        };
        json!({"value": number(assignment, value)?, "tolerance": tolerance})
    } else {
        json!({"value": number(assignment, value)?})
    };
    Ok((name.to_owned(), entry))
}

/// Reads `position=cyl_pos` as a signal of the model and a signal of the recording.
///
/// # Errors
/// A sentence on what cannot be read.
pub fn signal(assignment: &str) -> Result<(String, Value), String> {
    let (model, recorded) = pair(assignment, "position=cyl_pos")?;
    Ok((model.to_owned(), Value::from(recorded)))
}

fn pair<'a>(assignment: &'a str, example: &str) -> Result<(&'a str, &'a str), String> {
    let pair = assignment.split_once('=');
    let pair = pair.map(|(name, value)| (name.trim(), value.trim()));
    pair.filter(|(name, value)| !name.is_empty() && !value.is_empty())
        .ok_or_else(|| format!("`{assignment}` is not like {example}"))
}

fn number(assignment: &str, text: &str) -> Result<Value, String> {
    let number = text.trim().parse::<f64>().ok();
    let number = number.and_then(serde_json::Number::from_f64);
    number
        .map(Value::Number)
        .ok_or_else(|| format!("`{text}` in `{assignment}` is not a number"))
}

/// Puts parameters into a job, and signals into each experiment of the job.
///
/// # Errors
/// The job is no document that either can be put into.
pub fn into_job(
    job: &mut Value,
    parameters: &[(String, Value)],
    signals: &[(String, Value)],
) -> Result<(), CommandError> {
    let not_a_job = || CommandError::input("the job is not an object");
    let root = job.as_object_mut().ok_or_else(not_a_job)?;
    if !parameters.is_empty() {
        let entries = root.entry("parameters").or_insert_with(|| json!({}));
        let entries = entries.as_object_mut().ok_or_else(not_a_job)?;
        entries.extend(parameters.iter().cloned());
    }
    if !signals.is_empty() {
        let experiments = root.entry("experiments").or_insert_with(|| json!([{}]));
        for experiment in experiments.as_array_mut().ok_or_else(not_a_job)? {
            let experiment = experiment.as_object_mut().ok_or_else(not_a_job)?;
            let entries = experiment.entry("signals").or_insert_with(|| json!({}));
            let entries = entries.as_object_mut().ok_or_else(not_a_job)?;
            entries.extend(signals.iter().cloned());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_assignment_becomes_the_entry_of_a_parameter() {
        for (assignment, expected) in [
            (
                "mass=50..70",
                json!({"estimate": {"lower": 50.0, "upper": 70.0}}),
            ),
            (
                "mass=1e2..1e4:log",
                json!({"estimate": {"lower": 100.0, "upper": 1e4, "scale": "log"}}),
            ),
            ("mass=..70", json!({"estimate": {"upper": 70.0}})),
            ("mass=?", json!({"estimate": {}})),
            ("mass = 58", json!({"value": 58.0})),
            ("mass=58±1%", json!({"value": 58.0, "tolerance": "1%"})),
            ("mass=58+-0.5", json!({"value": 58.0, "tolerance": 0.5})),
        ] {
            let read = parameter(assignment);
            assert_eq!(read, Ok(("mass".to_owned(), expected)), "{assignment}");
        }
        for wrong in [
            "mass",
            "=5",
            "mass=",
            "mass=heavy",
            "mass=5..much",
            "mass=1e999",
        ] {
            assert!(parameter(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn assignments_stand_in_the_job_beside_its_other_entries() {
        let mut job = json!({"parameters": {"mass": {"value": 1}, "gain": {"value": 2}}});
        let parameters = [parameter("mass=?").unwrap()];
        let signals = [signal("position=x").unwrap()];
        into_job(&mut job, &parameters, &signals).unwrap();
        assert_eq!(
            job,
            json!({"parameters": {"mass": {"estimate": {}}, "gain": {"value": 2}},
                   "experiments": [{"signals": {"position": "x"}}]})
        );
    }
}
