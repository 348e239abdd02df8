//! The `method` and `uncertainty` sections: settings, each within its range.

use serde::de::value::StrDeserializer;
use serde::de::{DeserializeOwned, IntoDeserializer};

use super::{JobSpec, OutputSpec};
use crate::estimation::Settings;
use crate::uncertainty;
use crate::uncertainty::settings::Intervals;
use greybox_numerics::parsing::reader::{Field, Object};
use greybox_simulation::model::ModelDescription;

/// The settings; what the section leaves out is the method's default.
pub(super) fn read(field: &Field<'_>) -> Settings {
    let mut settings = Settings::default();
    let Some(mut object) = field.object() else {
        return settings;
    };
    let mut section = Section(&mut object);
    section.word("name", &mut settings.name);
    section.count("population", 2..=10_000, &mut settings.population);
    section.count("generations", 0..=1_000_000, &mut settings.generations);
    section.number(
        "crossover_probability",
        0.0..=1.0,
        &mut settings.crossover_probability,
    );
    section.count("crossover_parts", 2..=64, &mut settings.crossover_parts);
    section.number(
        "mutation_probability",
        0.0..=1.0,
        &mut settings.mutation_probability,
    );
    section.number("credit_gain", 0.01..=300.0, &mut settings.credit_gain);
    section.word("credit_form", &mut settings.credit_form);
    section.word("error_spread", &mut settings.error_spread);
    section.number("entropy_target", 0.05..=0.95, &mut settings.entropy_target);
    section.count("block_samples", 1..=1_000_000, &mut settings.block_samples);
    section.word("block_order", &mut settings.block_order);
    let mut credit_updates = 0;
    if section.count("credit_updates", 1..=1_000_000, &mut credit_updates) {
        settings.credit_updates = Some(credit_updates);
    }
    section.count(
        "bits_per_parameter",
        4..=32,
        &mut settings.bits_per_parameter,
    );
    section.flag("elitism", &mut settings.elitism);
    section.count(
        "hill_climbing_interval",
        0..=1_000_000,
        &mut settings.hill_climbing_interval,
    );
    section.count(
        "stagnation_generations",
        0..=1_000_000,
        &mut settings.stagnation_generations,
    );
    section.flag("noise_floor", &mut settings.noise_floor);
    let mut cost_target = 0.0;
    if section.number("cost_target", 0.0..=f64::INFINITY, &mut cost_target) {
        settings.cost_target = Some(cost_target);
    }
    let mut huber_threshold = 0.0;
    if section.number("huber_threshold", 0.5..=100.0, &mut huber_threshold) {
        settings.huber_threshold = Some(huber_threshold);
    }
    section.count("restarts", 1..=32, &mut settings.restarts);
    section.count("further_searches", 0..=31, &mut settings.further_searches);
    section.flag("refine", &mut settings.refine);
    section.count("refine_candidates", 1..=32, &mut settings.refine_candidates);
    object.finish();
    if let Some(detail) = settings.contradiction() {
        field.fault("contradiction", detail);
    }
    settings
}

/// What Huber's loss asks of the rest of the job: a noise level to measure residuals by, and
/// nothing that compares likelihoods.
pub(super) fn check_loss(job: &Object<'_>, spec: &JobSpec, model: &ModelDescription) {
    if spec.method.huber_threshold.is_none() {
        return;
    }
    let is_measured = |name: &str| {
        let mut experiments = spec.experiments.iter();
        experiments.any(|experiment| experiment.signals.contains_key(name))
    };
    let has_noise = |name: &str| {
        let known = spec.outputs.get(name);
        known.is_some_and(OutputSpec::declares_noise)
    };
    let outputs = model.outputs.iter().map(|output| &*output.name);
    for output in outputs.filter(|name| is_measured(name) && !has_noise(name)) {
        let detail = format!(
            "`method.huber_threshold` counts in units of the noise: \
             `outputs.{output}.noise_std` is needed"
        );
        job.fault("missing_field", detail);
    }
    if spec.model_search.is_some() {
        let detail = "`model_search` compares models by the likelihood of normal noise, which \
                      `method.huber_threshold` gives up: leave one of them out";
        job.fault("contradiction", detail);
    }
    if spec.uncertainty.intervals == Intervals::Profile {
        let detail = "profile intervals follow the likelihood of normal noise, which \
                      `method.huber_threshold` gives up: ask for `bootstrap`";
        job.fault("contradiction", detail);
    }
}

/// The settings of the uncertainty analysis.
pub(super) fn read_uncertainty(field: &Field<'_>) -> uncertainty::Settings {
    let mut settings = uncertainty::Settings::default();
    let Some(mut object) = field.object() else {
        return settings;
    };
    let mut section = Section(&mut object);
    section.word("intervals", &mut settings.intervals);
    section.count(
        "bootstrap_samples",
        40..=10_000,
        &mut settings.bootstrap_samples,
    );
    if let Some(field) = section.0.optional("monte_carlo_samples") {
        let value = field.integer(0, 100_000);
        match value.and_then(|value| u32::try_from(value).ok()) {
            Some(few @ 1..100) => field.fault(
                "out_of_range",
                format!("{few} fits say nothing of an interval: 0 for none, or 100 at the least"),
            ),
            value => settings.monte_carlo_samples = value.unwrap_or_default(),
        }
    }
    section.word("flat_directions", &mut settings.flat_directions);
    object.finish();
    settings
}

/// Puts what the document says into the place of the default; answers whether it said anything.
struct Section<'o, 'v>(&'o mut Object<'v>);

impl Section<'_, '_> {
    fn count(
        &mut self,
        name: &'static str,
        range: std::ops::RangeInclusive<u32>,
        place: &mut u32,
    ) -> bool {
        let (least, most) = (u64::from(*range.start()), u64::from(*range.end()));
        let field = self.0.optional(name);
        let value = field.and_then(|field| field.integer(least, most));
        let value = value.and_then(|value| u32::try_from(value).ok());
        put(value, place)
    }

    fn number(
        &mut self,
        name: &'static str,
        range: std::ops::RangeInclusive<f64>,
        place: &mut f64,
    ) -> bool {
        let field = self.0.optional(name);
        put(
            field.and_then(|field| field.number_within(*range.start(), *range.end())),
            place,
        )
    }

    fn flag(&mut self, name: &'static str, place: &mut bool) -> bool {
        put(
            self.0.optional(name).and_then(|field| field.boolean()),
            place,
        )
    }

    fn word<T: DeserializeOwned>(&mut self, name: &'static str, place: &mut T) -> bool {
        put(
            self.0.optional(name).and_then(|field| variant(&field)),
            place,
        )
    }
}

fn put<T>(value: Option<T>, place: &mut T) -> bool {
    let said = value.is_some();
    if let Some(value) = value {
        *place = value;
    }
    said
}

/// One of the words of an enumeration; the fault lists them all.
fn variant<T: DeserializeOwned>(field: &Field<'_>) -> Option<T> {
    let word: StrDeserializer<'_, serde::de::value::Error> = field.text()?.into_deserializer();
    match T::deserialize(word) {
        Ok(value) => Some(value),
        Err(error) => {
            field.fault("unknown_choice", error.to_string());
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::parsing::reader::Faults;
    use serde_json::json;

    #[test]
    fn too_few_fits_for_an_interval_are_refused_where_they_are_asked_for() {
        for (asked, is_refused) in [(0, false), (3, true), (100, false), (100_001, true)] {
            let document = json!({"monte_carlo_samples": asked});
            let faults = Faults::default();
            read_uncertainty(&Field::root(&document, &faults));
            let faults = faults.into_vec();
            assert_eq!(!faults.is_empty(), is_refused, "{asked}: {faults:?}");
            assert!(
                faults
                    .iter()
                    .all(|own| own.pointer == "/monte_carlo_samples")
            );
        }
    }
}
