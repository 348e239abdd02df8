//! What is said of a job on the command line, as a job document.

use super::error::CommandError;
use serde_json::{Map, Value, json};

/// `mass=50..70`, `mass=50..70:log`, `mass=58`, `mass=58±1%` or `mass=?`, as what a job says of a
/// parameter.
///
/// # Errors
/// A sentence on what cannot be read.
pub fn parameter(said: &str) -> Result<(String, Value), String> {
    let (name, known) = pair(said, "mass=50..70, mass=58, mass=58±1% or mass=?")?;
    let known = if known == "?" {
        json!({"estimate": {}})
    } else if let Some((lower, rest)) = known.split_once("..") {
        let (upper, scale) = match rest.split_once(':') {
            Some((upper, scale)) => (upper, Some(scale)),
            None => (rest, None),
        };
        let mut range = Map::new();
        for (side, text) in [("lower", lower), ("upper", upper)] {
            if !text.is_empty() {
                range.insert(side.to_owned(), number(said, text)?);
            }
        }
        range.extend(scale.map(|scale| ("scale".to_owned(), Value::from(scale))));
        json!({"estimate": range})
    } else if let Some((value, tolerance)) =
        known.split_once('±').or_else(|| known.split_once("+-"))
    {
        let tolerance = match tolerance.trim() {
            share if share.ends_with('%') => Value::from(share),
            absolute => number(said, absolute)?,
        };
        json!({"value": number(said, value)?, "tolerance": tolerance})
    } else {
        json!({"value": number(said, known)?})
    };
    Ok((name.to_owned(), known))
}

/// `position=cyl_pos`: the model's signal and the recording's.
///
/// # Errors
/// A sentence on what cannot be read.
pub fn signal(said: &str) -> Result<(String, Value), String> {
    let (model, recorded) = pair(said, "position=cyl_pos")?;
    Ok((model.to_owned(), Value::from(recorded)))
}

fn pair<'a>(said: &'a str, example: &str) -> Result<(&'a str, &'a str), String> {
    let pair = said.split_once('=');
    let pair = pair.map(|(name, value)| (name.trim(), value.trim()));
    pair.filter(|(name, value)| !name.is_empty() && !value.is_empty())
        .ok_or_else(|| format!("`{said}` is not like {example}"))
}

fn number(said: &str, text: &str) -> Result<Value, String> {
    let number = text.trim().parse::<f64>().ok();
    let number = number.and_then(serde_json::Number::from_f64);
    number
        .map(Value::Number)
        .ok_or_else(|| format!("`{text}` in `{said}` is not a number"))
}

/// Puts what was said into a job: parameters as they are, signals into each of its experiments.
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
        let said = root.entry("parameters").or_insert_with(|| json!({}));
        let said = said.as_object_mut().ok_or_else(not_a_job)?;
        said.extend(parameters.iter().cloned());
    }
    if !signals.is_empty() {
        let experiments = root.entry("experiments").or_insert_with(|| json!([{}]));
        for experiment in experiments.as_array_mut().ok_or_else(not_a_job)? {
            let experiment = experiment.as_object_mut().ok_or_else(not_a_job)?;
            let said = experiment.entry("signals").or_insert_with(|| json!({}));
            let said = said.as_object_mut().ok_or_else(not_a_job)?;
            said.extend(signals.iter().cloned());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_of_a_parameter_becomes_what_a_job_says() {
        for (said, expected) in [
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
            assert_eq!(parameter(said), Ok(("mass".to_owned(), expected)), "{said}");
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
    fn what_is_said_goes_into_the_job_beside_what_it_says_itself() {
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
