//! Which rules fit a series; looked up once for each way in which a series is written.

use crate::RowSignal;
use crate::intake::lines::mapping::{Mapping, MappingRule};
use crate::intake::lines::point::{LineFault, ProtocolLine};
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
}

/// Where the values of a field go.
#[derive(Clone)]
pub(super) struct FieldRoute {
    /// The place of the rule.
    pub(super) rule: usize,
    /// The place of the signal among those of the stream.
    pub(super) signal: usize,
    pub(super) unit: RecordedUnit,
}

/// A series and the rules that fit it.
#[derive(Debug, Default)]
pub(super) struct Route {
    pub(super) measurement: String,
    pub(super) tags: BTreeMap<String, String>,
    rules: Vec<usize>,
}

impl<'m> Routes<'m> {
    /// The rules; `place` gives each signal its place among those of its stream. Fields whose unit is not known
    /// have no signal.
    pub(super) fn new(
        mapping: &'m Mapping,
        mut place: impl FnMut(&'m MappingRule, RowSignal) -> usize,
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
            rules.push(RuleRoute { rule, fields });
        }
        Self {
            rules,
            by_measurement,
            remembered: HashMap::new(),
        }
    }

    /// The route of a line's series.
    pub(super) fn of(&mut self, point: &ProtocolLine<'_>) -> Result<Rc<Route>, LineFault> {
        if let Some(route) = self.remembered.get(point.series) {
            return Ok(Rc::clone(route));
        }
        let measurement = point.measurement();
        let tags = point.tags()?;
        let has = |(key, value): (&String, &String)| {
            tags.get(key.as_str())
                .is_some_and(|tag| tag == value.as_str())
        };
        let rules = self.by_measurement.get(&*measurement);
        let rules = rules.into_iter().flatten().copied();
        let rules = rules.filter(|k| self.rules[*k].rule.tags.iter().all(has));
        let route = Rc::new(Route {
            rules: rules.collect(),
            measurement: measurement.into_owned(),
            tags: tags
                .iter()
                .map(|(key, value)| (key.to_string(), value.to_string()))
                .collect(),
        });
        if self.remembered.len() >= REMEMBERED {
            self.remembered.clear();
        }
        self.remembered
            .insert(point.series.to_owned(), Rc::clone(&route));
        Ok(route)
    }

    /// Where the values of a field of a series go, by the first rule that names the field.
    pub(super) fn field(&self, route: &Route, name: &str) -> Option<FieldRoute> {
        let mut rules = route.rules.iter();
        rules.find_map(|k| self.rules[*k].fields.get(name).cloned())
    }

    /// The stream of a rule.
    pub(super) fn stream(&self, rule: usize) -> &'m str {
        &self.rules[rule].rule.stream
    }
}
