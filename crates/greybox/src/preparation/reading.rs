//! Recipes as they are submitted.

use std::collections::BTreeMap;

use serde_json::Value;

use super::step::{PreparationStep, Trend};
use greybox_numerics::parsing::Fault;
use greybox_numerics::parsing::reader::{Field, Object, read_document};

/// The most steps of a recipe.
pub const MAX_STEPS: usize = 50;
/// The most samples that a median is of.
const MAX_MEDIAN: u64 = 1001;

/// What a client wants to be made of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Recipe {
    /// A name for the prepared recording.
    pub name: Option<String>,
    /// The version of the recording whose marked samples are left out; the newest where it is left out.
    pub version: Option<u32>,
    /// The steps in their order.
    pub steps: Vec<PreparationStep>,
}

/// Reads a recipe, whose name has `max_name` characters at the most and whose version is at most `max_version`.
///
/// # Errors
/// Everything that is wrong with the document.
pub fn read_recipe(
    document: &Value,
    max_name: usize,
    max_version: u32,
) -> Result<Recipe, Vec<Fault>> {
    read_document(document, |root| {
        let mut object = root.object()?;
        let name = object.optional("name");
        let name = name.map(|field| read_name(&field, max_name));
        let version = object.optional("version");
        let version = version.map(|field| field.integer(0, u64::from(max_version)));
        let steps = object.required("steps");
        object.finish();
        let steps = read_steps(&steps?)?;
        Some(Recipe {
            name: name.map_or(Some(None), |name| name.map(Some))?,
            version: match version {
                Some(number) => Some(u32::try_from(number?).ok()?),
                None => None,
            },
            steps,
        })
    })
}

fn read_name(field: &Field<'_>, max_name: usize) -> Option<String> {
    let name = field.text()?;
    if name.chars().count() > max_name || name.contains('\0') {
        let detail = format!("a name has at most {max_name} characters, none of them NUL");
        field.fault("out_of_range", detail);
        return None;
    }
    Some(name.to_owned())
}

fn read_steps(field: &Field<'_>) -> Option<Vec<PreparationStep>> {
    let steps = field.array()?;
    let count = steps.len();
    if count == 0 || count > MAX_STEPS {
        let detail = format!("a recipe has 1 to {MAX_STEPS} steps, not {count}");
        field.fault("out_of_range", detail);
        return None;
    }
    let steps: Vec<Option<PreparationStep>> = steps.map(|step| read_step(&step)).collect();
    steps.into_iter().collect()
}

/// The kinds of steps.
#[derive(Clone, Copy)]
enum StepKind {
    Cut,
    Remove,
    Median,
    LowPass,
    HighPass,
    Detrend,
    Shift,
    Resample,
    Calculate,
}

const KINDS: [(&str, StepKind); 9] = [
    ("cut", StepKind::Cut),
    ("remove", StepKind::Remove),
    ("median", StepKind::Median),
    ("low_pass", StepKind::LowPass),
    ("high_pass", StepKind::HighPass),
    ("detrend", StepKind::Detrend),
    ("shift", StepKind::Shift),
    ("resample", StepKind::Resample),
    ("calculate", StepKind::Calculate),
];

fn read_step(field: &Field<'_>) -> Option<PreparationStep> {
    let mut object = field.object()?;
    let kind = object.required("step")?.choice(&KINDS)?;
    let step = match kind {
        StepKind::Cut => read_cut(field, &mut object),
        StepKind::Remove => {
            required_names(&mut object).map(|signals| PreparationStep::Remove { signals })
        }
        StepKind::Median => read_median(&mut object),
        StepKind::LowPass => read_filter(&mut object, |signals, cutoff_hz| {
            PreparationStep::LowPass { signals, cutoff_hz }
        }),
        StepKind::HighPass => read_filter(&mut object, |signals, cutoff_hz| {
            PreparationStep::HighPass { signals, cutoff_hz }
        }),
        StepKind::Detrend => read_detrend(&mut object),
        StepKind::Shift => read_shift(&mut object),
        StepKind::Resample => read_resample(&mut object),
        StepKind::Calculate => read_calculate(&mut object),
    };
    object.finish();
    step
}

fn read_cut(field: &Field<'_>, object: &mut Object<'_>) -> Option<PreparationStep> {
    let mut bound = |name| match object.optional(name) {
        Some(field) => field.number_within(0.0, f64::MAX).map(Some),
        None => Some(None),
    };
    let (from_s, to_s) = (bound("from_s"), bound("to_s"));
    let (from_s, to_s) = (from_s?, to_s?);
    if let (Some(from), Some(to)) = (from_s, to_s)
        && from >= to
    {
        let detail = format!("from_s {from} is not before to_s {to}");
        field.fault("bounds_reversed", detail);
        return None;
    }
    Some(PreparationStep::Cut { from_s, to_s })
}

fn read_median(object: &mut Object<'_>) -> Option<PreparationStep> {
    let signals = optional_names(object);
    let field = object.required("samples")?;
    let samples = field.integer(3, MAX_MEDIAN)?;
    if samples.is_multiple_of(2) {
        field.fault(
            "out_of_range",
            "a sample is in the middle of an odd number of samples",
        );
        return None;
    }
    Some(PreparationStep::Median {
        signals: signals?,
        samples: u32::try_from(samples).ok()?,
    })
}

fn read_filter(
    object: &mut Object<'_>,
    filter: impl FnOnce(Option<Vec<String>>, f64) -> PreparationStep,
) -> Option<PreparationStep> {
    let signals = optional_names(object);
    let cutoff_hz = object.required("cutoff_hz")?.positive()?;
    Some(filter(signals?, cutoff_hz))
}

fn read_detrend(object: &mut Object<'_>) -> Option<PreparationStep> {
    let signals = optional_names(object);
    let trend = object.required("trend")?.choice(&[
        ("mean", Trend::Mean),
        ("line", Trend::Line),
        ("slope", Trend::Slope),
    ])?;
    Some(PreparationStep::Detrend {
        signals: signals?,
        trend,
    })
}

fn read_shift(object: &mut Object<'_>) -> Option<PreparationStep> {
    let signals = required_names(object);
    let by_s = object.required("by_s")?.number()?;
    Some(PreparationStep::Shift {
        signals: signals?,
        by_s,
    })
}

fn read_resample(object: &mut Object<'_>) -> Option<PreparationStep> {
    let sample_time_s = object
        .required("sample_time_s")
        .and_then(|field| field.positive());
    let held = match object.optional("held") {
        Some(field) => read_names(&field)?,
        None => Vec::new(),
    };
    Some(PreparationStep::Resample {
        sample_time_s: sample_time_s?,
        held,
    })
}

fn read_calculate(object: &mut Object<'_>) -> Option<PreparationStep> {
    let mut text = |name| {
        object
            .required(name)
            .and_then(|field| field.text().map(str::to_owned))
    };
    let (signal, equation) = (text("signal"), text("equation"));
    let unit = match object.optional("unit") {
        Some(field) => field.text()?.to_owned(),
        None => String::new(),
    };
    let mut names = BTreeMap::new();
    if let Some(field) = object.optional("names") {
        for (name, signal) in field.object()?.entries() {
            names.insert(name.to_owned(), signal.text()?.to_owned());
        }
    }
    Some(PreparationStep::Calculate {
        signal: signal?,
        equation: equation?,
        unit,
        names,
    })
}

fn required_names(object: &mut Object<'_>) -> Option<Vec<String>> {
    read_names(&object.required("signals")?)
}

fn optional_names(object: &mut Object<'_>) -> Option<Option<Vec<String>>> {
    match object.optional("signals") {
        Some(field) => read_names(&field).map(Some),
        None => Some(None),
    }
}

fn read_names(field: &Field<'_>) -> Option<Vec<String>> {
    let names = field.array()?.map(|name| name.text().map(str::to_owned));
    names.collect()
}
