//! What a next step would change, as it was tried.

use crate::uncertainty::verdict::Trust;
use greybox_numerics::digits::short;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Significant digits of the numbers in words.
const DIGITS: usize = 3;

/// A smaller change of the criterion, or move in standard errors, is none.
const NOTHING: f64 = 0.05;

/// The steps that were tried, by the texts of their patches; none where a step came to nothing.
pub type Tries = BTreeMap<String, Option<TriedStep>>;

/// What a next step would change: the job was fitted anew with it from the estimate at hand, without another search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct TriedStep {
    /// The change of Schwarz's criterion: below zero the data ask for the step. `null` where only one of the two fits
    /// compares noise models, so that their criteria say nothing about each other.
    pub bic_change: Option<f64>,
    /// How far the result would be trusted.
    pub trust: Trust,
    /// Each unknown after the step.
    pub parameters: BTreeMap<String, TriedParameter>,
}

/// An unknown after a next step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct TriedParameter {
    /// The estimate, SI.
    pub estimate: f64,
    /// One standard deviation of the estimate's error, all that is assumed included, SI; `null` where the data do not
    /// fix the unknown.
    pub total_standard_error: Option<f64>,
    /// How far the total interval would be trusted.
    pub trust: Trust,
    /// How far the estimate moves, in total standard errors of the estimate at hand; `null` for an unknown that the
    /// step frees, and where the error is not known.
    pub moved: Option<f64>,
}

impl TriedStep {
    /// The result of the step in a sentence or two, beside how far the result at hand is trusted.
    #[must_use]
    pub(crate) fn in_words(&self, at_hand: Trust) -> String {
        let trust = self.trust.name();
        let trust = match self.trust == at_hand {
            true => format!("the trust stays {trust}"),
            false => format!("the trust becomes {trust}"),
        };
        let criterion = self.bic_change.map(|change| {
            if change.abs() < NOTHING {
                return "Schwarz's criterion stays, ".to_owned();
            }
            let word = if change < 0.0 { "falls" } else { "rises" };
            format!(
                "Schwarz's criterion {word} by {}, ",
                short(change.abs(), DIGITS)
            )
        });
        let moves = self.parameters.iter();
        let moves = moves.filter_map(|(name, tried)| Some((name, tried.moved?.abs())));
        let furthest = moves.max_by(|(_, a), (_, b)| a.total_cmp(b));
        let furthest = furthest.map(|(name, moved)| {
            if moved < NOTHING {
                return ", and no estimate moves".to_owned();
            }
            format!(
                ", and {} moves furthest, by {} of its total standard errors",
                name.replace('_', " "),
                short(moved, DIGITS)
            )
        });
        format!(
            "Tried: {}{trust}{}.",
            criterion.unwrap_or_default(),
            furthest.unwrap_or_default()
        )
    }
}
