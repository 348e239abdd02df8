//! Which rules fit a series; looked up once for each way in which a series is written.

use super::mapping::{Mapping, MappingRule};
use crate::RowSignal;
use crate::intake::quality::Scheme;
use crate::intake::units::{self, RecordedUnit};
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

/// Series that are remembered before all are forgotten.
const REMEMBERED: usize = 10_000;

/// The rules of a mapping, by their measurements.
pub(super) struct Routes<'m> {
    rules: Vec<RuleRoute<'m>>,
    by_measurement: HashMap<&'m str, Vec<usize>>,
    /// Routes by the series as it is written.
    remembered: HashMap<String, Rc<Route>>,
}

struct RuleRoute<'m> {
    rule: &'m MappingRule,
    /// The signals by the names of the fields.
    fields: HashMap<&'m str, FieldRoute>,
    /// The meaning of the codes of quality.
    scheme: Scheme,
}

/// Where the values of a field go.
#[derive(Clone)]
pub(super) struct FieldRoute {
    /// The place of the rule.
    pub(super) rule: usize,
    /// The place of the signal among those of the stream.
    pub(super) signal: u32,
    pub(super) unit: RecordedUnit,
}

/// A series and the rules that fit it.
#[derive(Debug, Default)]
pub(in crate::intake) struct Route {
    pub(super) measurement: String,
    pub(super) tags: BTreeMap<String, String>,
    rules: Vec<usize>,
    /// The places of rules that say how good values are.
    rules_with_quality: Vec<usize>,
}

impl<'m> Routes<'m> {
    /// The rules; `place` gives each signal its place among those of its stream. Fields whose unit is not known
    /// have no signal.
    pub(super) fn new(
        mapping: &'m Mapping,
        mut place: impl FnMut(&'m MappingRule, RowSignal) -> u32,
    ) -> Self {
        let mut by_measurement: HashMap<&str, Vec<usize>> = HashMap::new();
        let mut rules = Vec::with_capacity(mapping.rules.len());
        for (k, rule) in mapping.rules.iter().enumerate() {
            by_measurement.entry(&rule.measurement).or_default().push(k);
            let fields = rule.signals.iter().filter_map(|(field, mapped)| {
                let unit = units::parse(&mapped.unit)?;
                let signal = RowSignal {
                    name: mapped.signal.clone(),
                    unit: unit.si.clone().into_owned(),
                    recorded_unit: mapped.unit.clone(),
                    interpolation: mapped.interpolation,
                };
                let signal = place(rule, signal);
                let route = FieldRoute {
                    rule: k,
                    signal,
                    unit,
                };
                Some((field.as_str(), route))
            });
            let fields = fields.collect();
            let codes = rule.quality.as_ref();
            let codes = codes.and_then(|quality| Scheme::named(quality.codes.as_deref()?).ok());
            rules.push(RuleRoute {
                rule,
                fields,
                scheme: codes.unwrap_or(Scheme::Words),
            });
        }
        Self {
            rules,
            by_measurement,
            remembered: HashMap::new(),
        }
    }

    /// The route of a series, which `parts` takes apart where it is new.
    pub(super) fn of<E>(
        &mut self,
        series: &str,
        parts: impl FnOnce() -> Result<(String, BTreeMap<String, String>), E>,
    ) -> Result<Rc<Route>, E> {
        if let Some(route) = self.remembered.get(series) {
            return Ok(Rc::clone(route));
        }
        let (measurement, tags) = parts()?;
        let has = |(key, value): (&String, &String)| tags.get(key) == Some(value);
        let rules = self.by_measurement.get(measurement.as_str());
        let rules = rules.into_iter().flatten().copied();
        let rules = rules.filter(|k| self.rules[*k].rule.tags.iter().all(has));
        let rules: Vec<usize> = rules.collect();
        let has_quality = |k: &&usize| self.rules[**k].rule.quality.is_some();
        let route = Rc::new(Route {
            rules_with_quality: rules.iter().filter(has_quality).copied().collect(),
            rules,
            measurement,
            tags,
        });
        if self.remembered.len() >= REMEMBERED {
            self.remembered.clear();
        }
        self.remembered.insert(series.to_owned(), Rc::clone(&route));
        Ok(route)
    }

    /// Where the values of a field of a series go, by the first rule that names the field.
    pub(super) fn field(&self, route: &Route, name: &str) -> Option<FieldRoute> {
        let mut rules = route.rules.iter();
        rules.find_map(|k| self.rules[*k].fields.get(name).cloned())
    }

    /// The rules that take a field of a series for one that says how good the others are, and what its codes mean.
    pub(super) fn quality<'r>(
        &'r self,
        route: &'r Route,
        name: &'r str,
    ) -> impl Iterator<Item = (usize, Scheme)> + 'r {
        let rules = route.rules_with_quality.iter().copied();
        rules.filter_map(move |k| {
            let RuleRoute { rule, scheme, .. } = &self.rules[k];
            let fields = &rule.quality.as_ref()?.fields;
            fields
                .iter()
                .any(|field| field == name)
                .then_some((k, *scheme))
        })
    }

    /// The stream of a rule.
    pub(super) fn stream(&self, rule: usize) -> &'m str {
        &self.rules[rule].rule.stream
    }
}
