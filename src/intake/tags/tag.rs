//! One tag: its samples in their order, and at the instants of all.

use super::super::column::Column;
use super::super::options::Purpose;
use crate::recording::{Class, Interpolation, Rule, TimeAxis, Warning, resample};

/// A tag with its own instants.
pub(super) struct Tag {
    /// What tells it from all others.
    pub(super) key: String,
    /// Its name, which others may have too.
    pub(super) short: String,
    pub(super) column: Column,
    /// Seconds from the first instant that the source named.
    pub(super) instants: Vec<f64>,
    pub(super) values: Vec<f64>,
    pub(super) classes: Vec<Class>,
}

/// The instants of a recording, and the sample time where they are a grid.
pub(super) struct Common {
    pub(super) instants: Vec<f64>,
    pub(super) sample_time: Option<f64>,
}

impl Tag {
    pub(super) fn new(key: &str, short: &str, column: Column) -> Self {
        Self {
            key: key.to_owned(),
            short: short.to_owned(),
            column,
            instants: Vec::new(),
            values: Vec::new(),
            classes: Vec::new(),
        }
    }

    /// Sorts by instant and keeps one of the samples at an instant: the first of a recording, and of
    /// a batch of a stream the last that says something. Answers how many samples stood behind a
    /// later one, and how many were dropped.
    pub(super) fn order(&mut self, purpose: Purpose) -> (usize, usize) {
        let is_later = |pair: &&[f64]| pair[1] < pair[0];
        let mut disordered = self.instants.windows(2).filter(is_later).count();
        if disordered > 0 {
            if disordered + 1 == self.instants.len() {
                // Newest first is an order too.
                disordered = 0;
            }
            let mut order: Vec<usize> = (0..self.instants.len()).collect();
            order.sort_by(|a, b| self.instants[*a].total_cmp(&self.instants[*b]));
            self.instants = order.iter().map(|k| self.instants[*k]).collect();
            self.values = order.iter().map(|k| self.values[*k]).collect();
            self.classes = order.iter().map(|k| self.classes[*k]).collect();
        }
        let instants = &self.instants;
        let is_kept = |k: usize| match purpose {
            Purpose::Recording => k == 0 || instants[k] > instants[k - 1],
            Purpose::Stream => k + 1 == instants.len() || instants[k + 1] > instants[k],
        };
        let keep: Vec<bool> = (0..instants.len()).map(is_kept).collect();
        if purpose.is_later_right() {
            let says_nothing = |k: usize| self.values[k].is_nan() && self.classes[k] == Class::Good;
            let is_repeat = |k: usize| instants[k] == instants[k - 1];
            let silent: Vec<usize> = (1..instants.len())
                .filter(|k| is_repeat(*k) && says_nothing(*k))
                .collect();
            for k in silent {
                (self.values[k], self.classes[k]) = (self.values[k - 1], self.classes[k - 1]);
            }
        }
        let dropped = keep.iter().filter(|keep| !**keep).count();
        if dropped > 0 {
            retain(&mut self.instants, &keep);
            retain(&mut self.values, &keep);
            retain(&mut self.classes, &keep);
        }
        (disordered, dropped)
    }

    /// Says how many samples have no value though their source does not call them bad.
    pub(super) fn missing(&self) -> Option<Warning> {
        let samples = self.values.iter().zip(&self.classes);
        let is_missing = |(value, class): &(&f64, &Class)| value.is_nan() && **class == Class::Good;
        let missing = samples.filter(is_missing).count();
        let detail = || format!("{missing} of {} samples are missing", self.values.len());
        (missing > 0).then(|| Warning::of_signal("missing_samples", &self.column.name, detail()))
    }

    /// The values and classes at the instants that all signals have.
    pub(super) fn on(&self, common: &Common) -> (Vec<f64>, Vec<Class>) {
        let at = &common.instants;
        if self.instants == *at {
            return (self.values.clone(), self.classes.clone());
        }
        let Some(sample_time) = common.sample_time else {
            let place =
                |instant: &f64| self.instants.binary_search_by(|own| own.total_cmp(instant));
            let own = |instant| place(instant).ok();
            let value = |instant| own(instant).map_or(f64::NAN, |k| self.values[k]);
            let class = |instant| own(instant).map_or(Class::Good, |k| self.classes[k]);
            return (
                at.iter().map(value).collect(),
                at.iter().map(class).collect(),
            );
        };
        let rule = Rule::of(self.column.interpolation, Interpolation::Linear);
        let own_time = TimeAxis::from_instants(self.instants.clone(), 0.0).sample_time();
        let rule = rule.scaled(own_time / sample_time);
        let samples = (self.instants.as_slice(), self.values.as_slice());
        let values = resample(samples, at.iter().copied(), sample_time, rule);
        // A value is as good as the worse of the samples that it stands between.
        let class = |instant: &f64| {
            let right = self.instants.partition_point(|own| own < instant);
            if self.instants.get(right) == Some(instant) {
                return self.classes[right];
            }
            let left = self.classes.get(right.saturating_sub(1));
            let right = self.classes.get(right);
            left.max(right).copied().unwrap_or(Class::Good)
        };
        (values, at.iter().map(class).collect())
    }
}

fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    values.retain(|_| *keep.next().expect("as long as the values"));
}
