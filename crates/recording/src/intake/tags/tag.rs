//! One tag: its samples in their order, and at the instants of all.

use super::super::column::SignalColumn;
use super::super::options::ReadingPurpose;
use super::super::order::{CoarseTimes, MOST_TIMES_USUAL, TimeOrder};
use crate::{Class, Interpolation, ResampleRule, TimeAxis, Warning, resample};

/// A tag with its own instants.
pub(super) struct Tag {
    /// The key that tells the tag from all others.
    pub(super) key: String,
    /// The name of the tag, which other tags may have too.
    pub(super) short: String,
    pub(super) column: SignalColumn,
    /// Seconds from the first instant that the source named.
    pub(super) instants: Vec<f64>,
    pub(super) values: Vec<f64>,
    pub(super) classes: Vec<Class>,
}

/// One sample of a tag.
#[derive(Clone, Copy)]
struct TagSample {
    instant: f64,
    value: f64,
    class: Class,
}

/// The instants of a recording, and the sample time where they are a grid.
pub(super) struct Common {
    pub(super) instants: Vec<f64>,
    pub(super) sample_time: Option<f64>,
    /// Every tag has its samples at these instants.
    pub(super) are_all: bool,
}

impl Tag {
    pub(super) fn new(key: &str, short: &str, column: SignalColumn) -> Self {
        Self {
            key: key.to_owned(),
            short: short.to_owned(),
            column,
            instants: Vec::new(),
            values: Vec::new(),
            classes: Vec::new(),
        }
    }

    /// Makes samples missing whose values stand for none.
    pub(super) fn leave_out_stand_ins(&mut self) {
        let stand_ins = self.column.stand_ins();
        let values = self.values.iter_mut();
        for value in values.filter(|value| stand_ins.contains(value)) {
            *value = f64::NAN;
        }
    }

    /// Sorts by instant and keeps one of the samples at an instant: the first of a recording, and of
    /// a batch of a stream the last that says something; those of instants that are told too coarsely
    /// are spread. Answers how many samples stood behind a later one, how many were dropped, and how
    /// they were spread.
    pub(super) fn order(&mut self, purpose: ReadingPurpose) -> (usize, usize, Option<CoarseTimes>) {
        let is_later = |pair: &&[f64]| pair[1] < pair[0];
        let mut disordered = self.instants.windows(2).filter(is_later).count();
        let coarse = match (disordered, purpose) {
            (0, ReadingPurpose::Recording) => self.spread(),
            _ => None,
        };
        if disordered > 0 {
            if disordered + 1 == self.instants.len() {
                // Newest first is an order too.
                disordered = 0;
            }
            self.sort();
        }
        let dropped = self.drop_repeated(purpose);
        (disordered, dropped, coarse)
    }

    /// Spreads the samples of instants that are told too coarsely. Two samples of one value at each
    /// instant are one sample twice.
    fn spread(&mut self) -> Option<CoarseTimes> {
        let pairs = self.instants.windows(2).zip(self.values.windows(2));
        let mut of_one_instant = pairs.filter(|(instants, _)| instants[0] == instants[1]);
        let are_repeated = of_one_instant.all(|(_, values)| values[0] == values[1]);
        let coarse = TimeOrder::of(&self.instants).coarse;
        let coarse = coarse.filter(|coarse| coarse.rows > 2 || !are_repeated)?;
        let mut steps = self.instants.windows(2).filter(|pair| pair[0] < pair[1]);
        let have_room = steps.all(|pair| coarse.has_room(pair[0], pair[1]));
        let most = MOST_TIMES_USUAL * coarse.rows;
        let mut groups = self.instants.chunk_by(|a, b| a == b);
        if !have_room || groups.any(|group| group.len() > most) {
            return None;
        }
        let mut is_oldest = true;
        for instants in self.instants.chunk_by_mut(|a, b| a == b) {
            let count = instants.len();
            for (k, instant) in instants.iter_mut().enumerate() {
                *instant += coarse.offset(k, count, is_oldest);
            }
            is_oldest = false;
        }
        Some(coarse)
    }

    /// Says how many samples have no value though their source does not call them bad.
    pub(super) fn missing(&self) -> Option<Warning> {
        let missing = (0..self.values.len())
            .filter(|k| self.says_nothing(*k))
            .count();
        let detail = || format!("{missing} of {} samples are missing", self.values.len());
        (missing > 0).then(|| Warning::of_signal("missing_samples", &self.column.name, detail()))
    }

    fn says_nothing(&self, k: usize) -> bool {
        self.values[k].is_nan() && self.classes[k] == Class::Good
    }

    /// Puts the samples in the order of their instants; those at one instant stay in theirs. Beside the
    /// samples memory holds four bytes for each.
    fn sort(&mut self) {
        /// Marks a place that has its sample.
        const DONE: u32 = 1 << 31;
        let samples = u32::try_from(self.instants.len()).expect("fewer samples than are held");
        let mut order: Vec<u32> = (0..samples).collect();
        let instant = |k: u32| self.instants[k as usize];
        order.sort_unstable_by(|a, b| instant(*a).total_cmp(&instant(*b)).then(a.cmp(b)));
        for first in 0..order.len() {
            if order[first] & DONE != 0 {
                continue;
            }
            let moved = self.sample(first);
            let mut place = first;
            let mut from = order[place] as usize;
            while from != first {
                order[place] |= DONE;
                self.set(place, self.sample(from));
                place = from;
                from = order[place] as usize;
            }
            order[place] |= DONE;
            self.set(place, moved);
        }
    }

    /// Keeps one of the samples at an instant; answers how many were dropped.
    fn drop_repeated(&mut self, purpose: ReadingPurpose) -> usize {
        let samples = self.instants.len();
        let mut kept = 0;
        for k in 0..samples {
            if kept == 0 || self.instants[k] > self.instants[kept - 1] {
                self.set(kept, self.sample(k));
                kept += 1;
            } else if purpose.is_later_right() && !self.says_nothing(k) {
                self.set(kept - 1, self.sample(k));
            }
        }
        self.instants.truncate(kept);
        self.values.truncate(kept);
        self.classes.truncate(kept);
        samples - kept
    }

    fn sample(&self, k: usize) -> TagSample {
        TagSample {
            instant: self.instants[k],
            value: self.values[k],
            class: self.classes[k],
        }
    }

    fn set(&mut self, k: usize, sample: TagSample) {
        self.instants[k] = sample.instant;
        self.values[k] = sample.value;
        self.classes[k] = sample.class;
    }

    /// The values and classes at the instants that all signals have; the tag has no samples then.
    pub(super) fn take_on(&mut self, common: &Common) -> (Vec<f64>, Vec<Class>) {
        if common.are_all || self.instants == common.instants {
            self.instants = Vec::new();
            return (
                std::mem::take(&mut self.values),
                std::mem::take(&mut self.classes),
            );
        }
        let on = self.on(common);
        self.instants = Vec::new();
        self.values = Vec::new();
        self.classes = Vec::new();
        on
    }

    fn on(&self, common: &Common) -> (Vec<f64>, Vec<Class>) {
        let at = &common.instants;
        let Some(sample_time) = common.sample_time else {
            let place = |instant: &f64| {
                self.instants
                    .binary_search_by(|sampled| sampled.total_cmp(instant))
            };
            let index = |instant| place(instant).ok();
            let value = |instant| index(instant).map_or(f64::NAN, |k| self.values[k]);
            let class = |instant| index(instant).map_or(Class::Good, |k| self.classes[k]);
            return (
                at.iter().map(value).collect(),
                at.iter().map(class).collect(),
            );
        };
        let rule = ResampleRule::of(self.column.interpolation, Interpolation::Linear);
        let own_time = TimeAxis::sample_time_of(&self.instants, 0.0);
        let rule = rule.scaled(own_time / sample_time);
        let at_instants = at.iter().copied();
        let values = resample(&self.instants, &self.values, at_instants, sample_time, rule);
        // A value is as good as the worse of the samples that it stands between.
        let class = |instant: &f64| {
            let right = self.instants.partition_point(|sampled| sampled < instant);
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
