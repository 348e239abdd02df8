//! The `exclude` of an experiment: what of its recording is left out.

use super::entries;
use super::window::inside;
use greybox_numerics::parsing::reader::{Field, Object, did_you_mean};
use greybox_recording::{Exclude, ExcludedClass, ExcludedSpan, Summary};

/// The most spans of one experiment.
const MAX_SPANS: usize = 1000;

/// What is left out, or `None` when any of it is wrong.
pub(super) fn read(field: &Field<'_>, recording: Option<&Summary>) -> Option<Exclude> {
    let mut object = field.object()?;
    let classes = object.optional("classes");
    let spans = object.optional("spans");
    object.finish();
    let classes = match classes {
        Some(classes) => {
            let read = classes.array()?.map(|class| read_class(&class));
            read.collect::<Option<_>>()?
        }
        None => Vec::new(),
    };
    let spans = match spans {
        Some(spans) => {
            let items = entries::at_most(&spans, MAX_SPANS, "spans")?;
            let read: Vec<_> = items.map(|span| read_span(&span, recording)).collect();
            read.into_iter().collect::<Option<_>>()?
        }
        None => Vec::new(),
    };
    Some(Exclude { classes, spans })
}

fn read_class(field: &Field<'_>) -> Option<ExcludedClass> {
    field.choice(&[
        ("uncertain", ExcludedClass::Uncertain),
        ("substituted", ExcludedClass::Substituted),
        ("frozen", ExcludedClass::Frozen),
        ("spike", ExcludedClass::Spike),
    ])
}

fn read_span(field: &Field<'_>, recording: Option<&Summary>) -> Option<ExcludedSpan> {
    let mut object = field.object()?;
    let span = read_bounds(field, &mut object, recording);
    object.finish();
    span
}

/// The bounds and signals of a span, whose object `field` may hold more.
pub(super) fn read_bounds(
    field: &Field<'_>,
    object: &mut Object<'_>,
    recording: Option<&Summary>,
) -> Option<ExcludedSpan> {
    let from = object.required("from_s");
    let to = object.required("to_s");
    let signals = object.optional("signals");
    let bound = |field: Option<Field<'_>>| {
        let field = field?;
        inside(&field, field.number()?, recording)
    };
    let (from_s, to_s) = (bound(from), bound(to));
    let (from_s, to_s) = (from_s?, to_s?);
    if from_s > to_s {
        let detail = format!("from_s {from_s} is after to_s {to_s}");
        field.fault("bounds_reversed", detail);
        return None;
    }
    let signals = match signals {
        Some(names) => {
            let read: Vec<_> = names
                .array()?
                .map(|name| read_name(&name, recording))
                .collect();
            Some(read.into_iter().collect::<Option<_>>()?)
        }
        None => None,
    };
    Some(ExcludedSpan {
        from_s,
        to_s,
        signals,
    })
}

/// The name of a signal of the recording.
fn read_name(field: &Field<'_>, recording: Option<&Summary>) -> Option<String> {
    let name = field.text()?;
    let mut names = recording
        .into_iter()
        .flat_map(|recording| &recording.signals);
    if recording.is_some() && !names.any(|signal| signal.name == name) {
        let signals = recording
            .into_iter()
            .flat_map(|recording| &recording.signals);
        let hint = did_you_mean(name, signals.map(|signal| signal.name.as_str()));
        let detail = format!("the recording has no signal `{name}`{hint}");
        field.fault("unknown_dataset_signal", detail);
        return None;
    }
    Some(name.to_owned())
}
