//! How well what a model document takes as exact is known, where a job says so by name.

use crate::estimation::Problem;
use crate::identification::spec::JobSpec;
use crate::uncertainty::{DefaultTolerance, default_tolerances};
use greybox_numerics::parsing::fault::Fault;
use greybox_numerics::parsing::reader::{did_you_mean, listed};
use greybox_simulation::model::Tolerance;
use std::collections::BTreeMap;

/// The name that stands for every number that is not named otherwise.
const ALL_OTHERS: &str = "*";

/// The tolerance of each number that a job names, SI.
///
/// # Errors
/// A fault for each name that is none of a number whose tolerance is left open, for each share of a
/// number that is 0, and where all others are not taken as exact.
pub(super) fn named(
    spec: &JobSpec,
    problem: &Problem,
) -> Result<BTreeMap<String, f64>, Vec<Fault>> {
    if spec.tolerances.is_empty() {
        return Ok(BTreeMap::new());
    }
    let open = default_tolerances(problem);
    let (mut named, mut faults) = (BTreeMap::new(), Vec::new());
    if spec.tolerances.contains_key(ALL_OTHERS) {
        named.extend(open.iter().map(|number| (number.name.clone(), 0.0)));
    }
    for (name, tolerance) in &spec.tolerances {
        match checked(name, *tolerance, &open) {
            Ok(tolerance) => {
                named.insert(name.clone(), tolerance);
            }
            Err((code, detail)) => {
                faults.push(Fault::new(format!("/tolerances/{name}"), code, detail));
            }
        }
    }
    match faults.is_empty() {
        true => Ok(named),
        false => Err(faults),
    }
}

/// The tolerance of a number, SI; else the code of the fault and what is wrong.
fn checked(
    name: &str,
    tolerance: Tolerance,
    open: &[DefaultTolerance],
) -> Result<f64, (&'static str, String)> {
    if name == ALL_OTHERS {
        return match tolerance.of(1.0) {
            0.0 => Ok(0.0),
            _ => {
                let detail =
                    "numbers of different units have no tolerance in common: `*` can be 0 alone";
                Err(("tolerance_not_understood", detail.to_owned()))
            }
        };
    }
    let Some(number) = open.iter().find(|number| number.name == name) else {
        let names: Vec<&str> = open.iter().map(|number| &*number.name).collect();
        let detail = match names.is_empty() {
            true => {
                "the model is no document: it says itself how well each number is known, and a job \
                     says otherwise in `parameters`"
                    .to_owned()
            }
            false => {
                let hint = did_you_mean(name, names.iter().copied());
                format!(
                    "the tolerances that nobody declared are {}{hint}",
                    listed(&names)
                )
            }
        };
        return Err(("unknown_number", detail));
    };
    match tolerance {
        Tolerance::Percent(_) if number.value == 0.0 => {
            let detail = format!(
                "`{name}` is 0: give its tolerance in {}, not as a share",
                number.unit
            );
            Err(("tolerance_not_understood", detail))
        }
        tolerance => Ok(tolerance.of(number.value)),
    }
}
