//! The `process_noise` section: what moves the plant and was not recorded.

use super::entries;
use crate::estimation::process_noise::{NoiseNumber, ProcessNoise};
use greybox_numerics::parsing::reader::{Field, Object, did_you_mean};
use greybox_simulation::model::ModelDescription;
use greybox_simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The disturbances of one document at the most.
pub const MAX_DISTURBANCES: usize = 8;

/// A quantity that wanders and was not recorded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ProcessNoise, example = json!({
    "acts_on": {"state": "velocity"}, "kind": "memory", "std": 0.2, "time_constant_s": 0.5
}))]
pub struct ProcessNoiseSpec {
    /// What the quantity acts on.
    pub acts_on: ActsOnSpec,
    /// How the quantity moves.
    pub kind: NoiseKind,
    /// The standard deviation of a quantity with memory, in the unit of what it acts on; a state's
    /// is that of its rate.
    #[schema(minimum = 0, nullable = false)]
    pub std: Option<f64>,
    /// How long a quantity with memory remembers `[s]`.
    #[schema(exclusive_minimum = 0, nullable = false)]
    pub time_constant_s: Option<f64>,
    /// The strength of white noise, in the unit of what it acts on times √s, or that of a walk, in
    /// the unit of what it acts on per √s.
    #[schema(minimum = 0, nullable = false)]
    pub strength: Option<f64>,
}

/// What a disturbance acts on: one of the three.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schema(as = ActsOn)]
pub enum ActsOnSpec {
    /// A parameter, which wanders about its value.
    Parameter(String),
    /// A state, whose rate is disturbed.
    State(String),
    /// An output, whose sensor drifts.
    Output(String),
}

/// How a disturbance moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseKind {
    /// The quantity forgets its value at once.
    White,
    /// The quantity forgets its value within its time constant (an Ornstein–Uhlenbeck process).
    Memory,
    /// The quantity keeps its value but for what is added.
    Walk,
}

/// The disturbances of a document, all of whose numbers are given; what is wrong is told.
pub(super) fn read(field: &Field<'_>, model: &ModelDescription) -> Vec<ProcessNoise> {
    let entries = entries::first(field, MAX_DISTURBANCES, "disturbances");
    entries
        .filter_map(|entry| read_disturbance(&entry, model))
        .collect()
}

fn read_disturbance(field: &Field<'_>, model: &ModelDescription) -> Option<ProcessNoise> {
    let mut object = field.object()?;
    let target = object.required("acts_on");
    let target = target.and_then(|field| read_target(&field, model));
    let kind = object.required("kind").and_then(|field| {
        field.choice(&[
            ("white", DisturbanceKind::White),
            ("memory", DisturbanceKind::Memory),
            ("walk", DisturbanceKind::Walk),
        ])
    });
    let numbers = kind.and_then(|kind| read_numbers(&mut object, kind));
    object.finish();
    let (target, kind) = (target?, kind?);
    if kind == DisturbanceKind::White && matches!(target.acts_on, ActsOn::Output(_)) {
        let detail = "white noise of a sensor is its `noise_std`";
        field.fault("kind_not_possible", detail);
    }
    let numbers = numbers?;
    Some(ProcessNoise {
        name: target.name,
        disturbance: Disturbance {
            acts_on: target.acts_on,
            kind,
        },
        strength: NoiseNumber::Given(numbers.strength),
        time_constant: numbers.time_constant.map(NoiseNumber::Given),
    })
}

/// What a disturbance acts on, by the name that the document gives it.
struct DisturbedQuantity {
    name: String,
    acts_on: ActsOn,
}

fn read_target(field: &Field<'_>, model: &ModelDescription) -> Option<DisturbedQuantity> {
    let mut object = field.object()?;
    let [parameter, state, output] =
        ["parameter", "state", "output"].map(|name| object.optional(name));
    let parameters = model.parameters.iter().map(|parameter| &*parameter.name);
    let states = model.states.iter().map(|state| &*state.name);
    let outputs = model.outputs.iter().map(|output| &*output.name);
    let target = match (&parameter, &state, &output) {
        (Some(field), None, None) => find(field, parameters, ActsOn::Parameter),
        (None, Some(field), None) => find(field, states, ActsOn::Rate),
        (None, None, Some(field)) => find(field, outputs, ActsOn::Output),
        _ => {
            let detail = "a disturbance acts on one of `parameter`, `state` and `output`";
            field.fault("acts_on_unclear", detail);
            None
        }
    };
    object.finish();
    target
}

fn find<'a>(
    field: &Field<'_>,
    names: impl Iterator<Item = &'a str> + Clone,
    acts_on: impl Fn(usize) -> ActsOn,
) -> Option<DisturbedQuantity> {
    let name = field.text()?;
    let place = names.clone().position(|candidate| candidate == name);
    if place.is_none() {
        let hint = did_you_mean(name, names);
        field.fault("unknown_name", format!("the model has no `{name}`{hint}"));
    }
    Some(DisturbedQuantity {
        name: name.to_owned(),
        acts_on: acts_on(place?),
    })
}

/// The numbers of a disturbance, as the filter takes them.
struct Numbers {
    strength: f64,
    time_constant: Option<f64>,
}

fn read_numbers(object: &mut Object<'_>, kind: DisturbanceKind) -> Option<Numbers> {
    let not_negative = |field: Field<'_>| field.number_within(0.0, f64::MAX);
    if kind != DisturbanceKind::Memory {
        let strength = object.required("strength").and_then(not_negative);
        return Some(Numbers {
            strength: strength?,
            time_constant: None,
        });
    }
    let std = object.required("std").and_then(not_negative);
    let time_constant = object.required("time_constant_s");
    let time_constant = time_constant.and_then(|field| field.positive())?;
    Some(Numbers {
        strength: std? * (2.0 * time_constant).sqrt(),
        time_constant: Some(time_constant),
    })
}

/// The standard deviation of the noise of each output that is named; every name must be one that the
/// recording has.
pub(super) fn read_sensors(
    field: &Field<'_>,
    is_measured: impl Fn(&str) -> bool,
) -> Vec<(String, f64)> {
    let mut sensors = Vec::new();
    let entries = field.object().map(|object| object.entries());
    for (name, field) in entries.into_iter().flatten() {
        if !is_measured(name) {
            let detail = format!("no signal of the recording is the output `{name}`");
            field.fault("output_not_measured", detail);
        }
        let Some(mut object) = field.object() else {
            continue;
        };
        let noise = object.required("noise_std");
        let noise = noise.and_then(|field| field.positive());
        object.finish();
        sensors.extend(noise.map(|noise| (name.to_owned(), noise)));
    }
    sensors
}
