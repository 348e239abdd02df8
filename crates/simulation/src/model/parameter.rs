//! Parameters and signals as a model describes them.

use super::tolerance::{Tolerance, ToleranceText};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use utoipa::ToSchema;

/// How a parameter's range is laid out for the search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Equal steps.
    #[default]
    Linear,
    /// Equal ratios; both bounds are positive.
    Log,
}

impl Scale {
    /// The position of `value` between the bounds, 0 at the lower and 1 at the upper.
    #[must_use]
    pub fn position(self, value: f64, lower: f64, upper: f64) -> f64 {
        match self {
            Scale::Linear => (value - lower) / (upper - lower),
            Scale::Log => libm::log(value / lower) / libm::log(upper / lower),
        }
    }

    /// The value at a position between the bounds; exactly the bounds at 0 and 1.
    #[must_use]
    pub fn value(self, position: f64, lower: f64, upper: f64) -> f64 {
        if position <= 0.0 {
            return lower;
        }
        if position >= 1.0 {
            return upper;
        }
        self.value_beyond(position, lower, upper)
    }

    /// The value at a position that may lie outside the bounds.
    #[must_use]
    pub fn value_beyond(self, position: f64, lower: f64, upper: f64) -> f64 {
        match self {
            Scale::Linear => lower + position * (upper - lower),
            Scale::Log => lower * libm::exp(position * libm::log(upper / lower)),
        }
    }
}

/// One physical parameter of a model.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ParameterDescription {
    /// The name in requests and results, e.g. `bulk_modulus`.
    #[schema(value_type = String)]
    pub name: Cow<'static, str>,
    /// The symbol in the equations, e.g. `Km`.
    #[schema(value_type = String)]
    pub symbol: Cow<'static, str>,
    /// The SI unit, e.g. `Pa`; `1` where there is none.
    #[schema(value_type = String)]
    pub unit: Cow<'static, str>,
    /// What the parameter means, in one sentence.
    #[schema(value_type = String)]
    pub meaning: Cow<'static, str>,
    /// The value when a job does not name it, SI.
    pub default: f64,
    /// The default search range, SI.
    pub lower: f64,
    /// The default search range, SI.
    pub upper: f64,
    /// How the default search range is laid out.
    pub scale: Scale,
    /// Whether a job that does not name it estimates it.
    pub unknown_by_default: bool,
    /// Smaller values are physically impossible and refused; none: no limit.
    pub minimum: Option<f64>,
    /// Larger values are physically impossible and refused; none: no limit.
    pub maximum: Option<f64>,
    /// How well a job knows its value that does not say: one standard deviation. Of an effect
    /// that is off, its plausible size; none: exactly.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<ToleranceText>, nullable = false)]
    pub tolerance: Option<Tolerance>,
    /// Where that is from.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>, nullable = false)]
    pub tolerance_source: Option<Cow<'static, str>>,
}

impl ParameterDescription {
    /// A quantity that cannot be negative, known unless the job says otherwise.
    #[must_use]
    pub fn known(
        name: &'static str,
        [symbol, unit, meaning]: [&'static str; 3],
        default: f64,
        [lower, upper]: [f64; 2],
    ) -> Self {
        ParameterDescription {
            name: Cow::Borrowed(name),
            symbol: Cow::Borrowed(symbol),
            unit: Cow::Borrowed(unit),
            meaning: Cow::Borrowed(meaning),
            default,
            lower,
            upper,
            scale: Scale::Linear,
            unknown_by_default: false,
            minimum: Some(0.0),
            maximum: None,
            tolerance: None,
            tolerance_source: None,
        }
    }

    /// The description of a parameter that is estimated unless the job says otherwise.
    #[must_use]
    pub fn unknown(self) -> Self {
        ParameterDescription {
            unknown_by_default: true,
            ..self
        }
    }

    /// The description of a parameter that is searched in equal ratios.
    #[must_use]
    pub fn log_scale(self) -> Self {
        ParameterDescription {
            scale: Scale::Log,
            ..self
        }
    }

    /// The description of a parameter known no better than this where a job does not say.
    #[must_use]
    pub fn within_tolerance(self, tolerance: Tolerance, source: &'static str) -> Self {
        ParameterDescription {
            tolerance: Some(tolerance),
            tolerance_source: Some(Cow::Borrowed(source)),
            ..self
        }
    }

    /// The description with other physical limits.
    #[must_use]
    pub fn within(self, minimum: Option<f64>, maximum: Option<f64>) -> Self {
        ParameterDescription {
            minimum,
            maximum,
            ..self
        }
    }
}

/// An input, a state or an output of a model.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct SignalDescription {
    /// The name in requests and results.
    #[schema(value_type = String)]
    pub name: Cow<'static, str>,
    /// The SI unit.
    #[schema(value_type = String)]
    pub unit: Cow<'static, str>,
    /// What the signal means, in one sentence.
    #[schema(value_type = String)]
    pub meaning: Cow<'static, str>,
}

/// Where a state starts when a job does not say.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialState {
    /// Where the model puts it: a fixed number or what follows from the parameters.
    Model,
    /// At the first measured sample of an output.
    FirstSample {
        /// The output, by its place in the description.
        output: usize,
    },
    /// Estimated near the first samples of the output that measures it.
    EstimatedFromOutput {
        /// The output, by its place in the description.
        output: usize,
    },
    /// Estimated near the slope of the first samples of the output whose derivative it is.
    EstimatedFromSlope {
        /// The output, by its place in the description.
        output: usize,
    },
}

impl SignalDescription {
    /// A signal of a model that is part of this program.
    #[must_use]
    pub fn new(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        SignalDescription {
            name: Cow::Borrowed(name),
            unit: Cow::Borrowed(unit),
            meaning: Cow::Borrowed(meaning),
        }
    }
}

impl InitialState {
    /// Whether the initial value is one more unknown.
    #[must_use]
    pub fn is_estimated(self) -> bool {
        matches!(
            self,
            InitialState::EstimatedFromOutput { .. } | InitialState::EstimatedFromSlope { .. }
        )
    }
}

/// A state of a model.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct StateDescription {
    /// The name in requests and results.
    #[schema(value_type = String)]
    pub name: Cow<'static, str>,
    /// The SI unit.
    #[schema(value_type = String)]
    pub unit: Cow<'static, str>,
    /// What the state means, in one sentence.
    #[schema(value_type = String)]
    pub meaning: Cow<'static, str>,
    /// Where the state starts when a job does not say.
    pub initial: InitialState,
}
