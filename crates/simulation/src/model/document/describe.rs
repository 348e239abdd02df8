//! What a document's model says of itself in the catalogue.

use super::definition::{Declared, Definition, Formula, Initial, Measured};
use crate::model::{
    InitialState, ModelDescription, ParameterDescription, SignalDescription, StateDescription,
};
use greybox_numerics::parsing::reader::{Faults, did_you_mean};
use std::borrow::Cow;

/// The catalogue's entry; faults where an initial value names no output.
pub fn describe(definition: &Definition, faults: &Faults) -> ModelDescription {
    let states = definition.states.iter().map(|state| StateDescription {
        name: owned(&state.declared.name),
        unit: owned(shown_unit(&state.declared)),
        meaning: owned(&state.declared.meaning),
        initial: initial(definition, &state.initial, faults),
    });
    ModelDescription {
        name: owned(&definition.name),
        title: owned(&definition.title),
        summary: owned(&definition.summary),
        inputs: definition.inputs.iter().map(signal).collect(),
        input_sets: vec![
            definition
                .inputs
                .iter()
                .map(|input| owned(&input.name))
                .collect(),
        ],
        states: states.collect(),
        sampled: definition
            .sampled
            .iter()
            .map(|quantity| signal(&quantity.formula.declared))
            .collect(),
        outputs: definition
            .outputs
            .iter()
            .map(|output| signal(&output.declared))
            .collect(),
        parameters: definition.parameters.iter().map(parameter).collect(),
        equations: equations(definition),
        source: owned(&definition.source),
    }
}

fn owned(text: &str) -> Cow<'static, str> {
    Cow::Owned(text.to_owned())
}

/// A quantity that opted out of units is shown without one, and takes any recording.
fn shown_unit(declared: &Declared) -> &str {
    match declared.unit_text.as_str() {
        "unitless" => "",
        text => text,
    }
}

fn signal(declared: &Declared) -> SignalDescription {
    SignalDescription {
        name: owned(&declared.name),
        unit: owned(shown_unit(declared)),
        meaning: owned(&declared.meaning),
    }
}

fn parameter(parameter: &super::definition::Parameter) -> ParameterDescription {
    let declared = &parameter.declared;
    let [lower, upper] = parameter.bounds;
    let [minimum, maximum] = parameter.limits;
    ParameterDescription {
        name: owned(&declared.name),
        symbol: owned(declared.written_as()),
        unit: owned(shown_unit(declared)),
        meaning: owned(&declared.meaning),
        default: parameter.default,
        lower,
        upper,
        scale: parameter.scale,
        unknown_by_default: parameter.unknown,
        minimum,
        maximum,
        tolerance: parameter.tolerance,
        tolerance_source: None,
    }
}

fn initial(definition: &Definition, initial: &Initial, faults: &Faults) -> InitialState {
    let Initial::Measured {
        kind,
        output: name,
        pointer,
        ..
    } = initial
    else {
        return InitialState::Model;
    };
    let names = || {
        definition
            .outputs
            .iter()
            .map(|output| output.declared.name.as_str())
    };
    let Some(output) = names().position(|output| output == name) else {
        let hint = did_you_mean(name, names());
        let detail = format!("there is no output `{name}`{hint}");
        faults.add(pointer.clone(), "unknown_output", detail);
        return InitialState::Model;
    };
    match kind {
        Measured::First => InitialState::FirstSample { output },
        Measured::Near => InitialState::EstimatedFromOutput { output },
        Measured::NearSlope => InitialState::EstimatedFromSlope { output },
    }
}

/// The equations, a line each: quantities and states by the symbols that stand on the right, outputs by their names.
fn equations(definition: &Definition) -> Vec<Cow<'static, str>> {
    let formula = |formula: &Formula| {
        let Formula { declared, text } = formula;
        format!("{} = {}", declared.written_as(), text.text)
    };
    let quantities = definition.quantities.iter().map(formula);
    let sampled = definition.sampled.iter().map(|sampled| {
        let shown = formula(&sampled.formula);
        format!("{shown}, once a sample, held")
    });
    let states = definition.states.iter().map(|state| {
        format!(
            "{}' = {}",
            state.declared.written_as(),
            state.derivative.text
        )
    });
    let outputs = definition.outputs.iter().map(|output| {
        let Formula { declared, text } = output;
        format!("{} = {}", declared.name, text.text)
    });
    let all = quantities.chain(sampled).chain(states).chain(outputs);
    all.map(Cow::Owned).collect()
}
