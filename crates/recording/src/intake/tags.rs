//! Tags of a historian, each with its own instants, values and quality, and the recording they make.
//!
//! All of it is held in memory, 17 bytes a sample and as many as [`SAMPLE_BYTES`] while it is sorted:
//! [`MAX_HELD_SAMPLES`] samples at the most, and no more than [`Memory`] allows for the body.

use super::cell::Cell;
use super::clock::Clock;
use super::column::SignalColumn;
use super::error::{ReadError, ReadingFaults, no_signals};
use super::memory::Memory;
use super::options::{GridOption, Options, ReadingPurpose};
use super::order::CoarseTimes;
use super::quality::{Scheme, is_good_everywhere, quality_schemes};
use crate::columns::SampleColumns;
use crate::{
    Class, ClassSpan, Interpolation, MAX_SIGNALS, ReceivedRecording, Recording, TimeAxis, Warning,
    name_fault, shown,
};
use greybox_numerics::parsing::Fault;
use std::collections::HashMap;
use tag::{Common, Tag};

mod course;
mod tag;

/// The most samples of a source that is held in memory until its end, all tags together.
pub const MAX_HELD_SAMPLES: usize = 16_000_000;

/// Bytes that a sample takes at the most until it is at its instant: its own, the room that lists of
/// samples have for more, and what sorting takes.
const SAMPLE_BYTES: u64 = 26;

/// Bytes of a sample at one of the common instants.
const COMMON_SAMPLE_BYTES: u64 = 8;

/// Bytes of a common instant itself: a list of instants, one of intervals and the classes of a signal.
const COMMON_INSTANT_BYTES: u64 = 32;

/// Bytes of samples in a row that are of one class, from here to where they are stored.
const SPAN_BYTES: u64 = 256;

/// What a sender can do whose samples are too many.
const INSTEAD: &str = "send fewer at once, or a CSV with a column for each signal";

/// What a sender can do whose signals take too much on common instants.
const COARSER: &str = "say a coarser `grid`, leave signals out with `ignore`, or send less at once";

/// A grid may have so many samples for each that was recorded.
const MOST_GRID_SAMPLES: usize = 20;

/// The tags of one source.
pub(super) struct Tags<'o> {
    pub(super) options: &'o Options,
    pub(super) clock: Clock,
    pub(super) faults: ReadingFaults,
    pub(super) notes: Vec<Warning>,
    /// What codes of quality mean, where the format or an option says so.
    scheme: Option<Scheme>,
    tags: Vec<Tag>,
    by_key: HashMap<String, usize>,
    samples: usize,
    memory: Memory,
    /// More samples came than memory may hold.
    is_too_much: bool,
}

/// A sample as the source has it.
pub(super) struct RawSample<'c> {
    pub(super) tag: usize,
    pub(super) time: Cell<'c>,
    pub(super) value: Cell<'c>,
    pub(super) quality: Quality<'c>,
}

/// What the source says of a sample.
pub(super) enum Quality<'c> {
    /// Nothing.
    Unsaid,
    /// A code of the source's scheme.
    Code(Cell<'c>),
    /// A class.
    Of(Class),
}

/// Makes a fault at a place of the source.
pub(super) type MakeFault<'p> = &'p dyn Fn(&'static str, String) -> Fault;

impl<'o> Tags<'o> {
    /// No tags yet. `scheme` is what the format itself says of its codes of quality.
    pub(super) fn new(
        clock: Clock,
        options: &'o Options,
        scheme: Option<Scheme>,
        memory: &Memory,
    ) -> Self {
        Self {
            options,
            clock,
            faults: ReadingFaults::default(),
            notes: Vec::new(),
            scheme: options.quality_scheme.or(scheme),
            tags: Vec::new(),
            by_key: HashMap::new(),
            samples: 0,
            memory: memory.clone(),
            is_too_much: false,
        }
    }

    /// Whether so much is wrong that reading on is pointless.
    pub(super) fn is_full(&self) -> bool {
        self.faults.full() || self.is_too_much
    }

    /// The tag of that name, which may be new.
    pub(super) fn tag(&mut self, name: &str, place: MakeFault<'_>) -> Option<usize> {
        self.series(name, name, place)
    }

    /// The tag of that key, which may be new. It is called by its short name where no other has
    /// the same.
    pub(super) fn series(&mut self, key: &str, short: &str, place: MakeFault<'_>) -> Option<usize> {
        if let Some(tag) = self.by_key.get(key) {
            return Some(*tag);
        }
        if self.tags.len() > MAX_SIGNALS {
            return None;
        }
        if let Some((code, detail)) = name_fault(short) {
            self.faults.invalid(place(code, detail));
            return None;
        }
        if self.tags.len() == MAX_SIGNALS {
            let detail = format!("more than {MAX_SIGNALS} signals");
            self.faults.invalid(place("too_many_signals", detail));
        }
        // In a tag's name brackets need not hold a unit: `PLC1.data[3]`.
        let column = SignalColumn::titled(short, self.options);
        let column = column.unwrap_or_else(|_| SignalColumn::named(short, self.options));
        self.tags.push(Tag::new(key, short, column));
        self.by_key.insert(key.to_owned(), self.tags.len() - 1);
        Some(self.tags.len() - 1)
    }

    /// The tag of that name, where there is one.
    pub(super) fn of_key(&self, key: &str) -> Option<usize> {
        self.by_key.get(key).copied()
    }

    /// Gives a tag another key, by which it is called where its short name is not enough.
    pub(super) fn set_key(&mut self, tag: usize, key: String) {
        self.tags[tag].key = key;
    }

    /// What the source says of a tag; options win.
    pub(super) fn describe(
        &mut self,
        tag: usize,
        unit: Option<&str>,
        interpolation: Option<Interpolation>,
        place: MakeFault<'_>,
    ) {
        let is_said = self.options.units.contains_key(&self.tags[tag].short);
        let column = &mut self.tags[tag].column;
        column.interpolation = column.interpolation.or(interpolation);
        let unit = unit.map(str::trim).unwrap_or_default();
        if unit.is_empty() || is_said || column.recorded_unit == unit {
            return;
        }
        if !self.tags[tag].values.is_empty() && !self.tags[tag].column.recorded_unit.is_empty() {
            let earlier_unit = &self.tags[tag].column.recorded_unit;
            let detail = format!("`{unit}` where the samples before are in `{earlier_unit}`");
            self.faults.invalid(place("units_differ", detail));
            return;
        }
        let tag = &mut self.tags[tag];
        let before = tag.column.unit.clone();
        match tag.column.set_unit(unit) {
            Ok(()) if before != tag.column.unit => {
                let unit = &tag.column.unit;
                tag.values
                    .iter_mut()
                    .for_each(|value| *value = unit.to_si(*value));
            }
            Ok(()) => {}
            Err(detail) => self.faults.invalid(place("unknown_unit", detail)),
        }
    }

    /// Takes a sample.
    pub(super) fn push(&mut self, sample: &RawSample<'_>, place: MakeFault<'_>) {
        if self.tags[sample.tag].column.is_ignored() {
            return;
        }
        let before = self.tags[sample.tag].instants.last().copied();
        let instant = match self.clock.read(&sample.time, before) {
            Ok(instant) => instant,
            Err((code, detail)) => return self.faults.invalid(place(code, detail)),
        };
        let class = self.class(&sample.quality, place);
        let tag = &mut self.tags[sample.tag];
        let mut value = match class {
            // The value of a bad sample may be anything.
            Class::Bad if !matches!(sample.value, Cell::Number(_) | Cell::Integer(_)) => f64::NAN,
            _ => tag.column.take(&sample.value, self.options, place),
        };
        if class == Class::Bad {
            value = f64::NAN;
        }
        tag.instants.push(instant);
        tag.values.push(value);
        tag.classes.push(class);
        self.samples += 1;
        if let Some(detail) = self.too_many() {
            self.is_too_much = true;
            self.faults.invalid(place("too_many_samples", detail));
        }
    }

    /// Why the samples that came are too many, where they are.
    fn too_many(&self) -> Option<String> {
        if self.samples > MAX_HELD_SAMPLES {
            return Some(format!(
                "more than {MAX_HELD_SAMPLES} samples, which this format holds in memory; {INSTEAD}"
            ));
        }
        let what = "samples of this format";
        self.memory.refusal(self.held_bytes(), what, INSTEAD)
    }

    fn held_bytes(&self) -> u64 {
        SAMPLE_BYTES * self.samples as u64
    }

    fn class(&mut self, quality: &Quality<'_>, place: MakeFault<'_>) -> Class {
        let code = match quality {
            Quality::Unsaid => return Class::Good,
            Quality::Of(class) => return *class,
            Quality::Code(code) => code,
        };
        if self.scheme.is_none() && is_good_everywhere(code) {
            return Class::Good;
        }
        let scheme = self.scheme.unwrap_or(Scheme::Words);
        scheme.class(code).unwrap_or_else(|| {
            let (kind, detail) = match self.scheme {
                Some(_) => (
                    "unknown_quality",
                    format!("`{code}` is no code of quality here"),
                ),
                None => (
                    "quality_scheme_needed",
                    "codes of quality mean different things: 0 is bad in one scheme and good in another"
                        .to_owned(),
                ),
            };
            let schemes: Vec<&str> = quality_schemes().collect();
            let detail = format!("{detail}; say quality_scheme ({})", schemes.join(", "));
            self.faults.invalid(place(kind, detail));
            Class::Bad
        })
    }

    /// The recording, or all faults.
    pub(super) fn into_received(mut self, format: &str) -> Result<ReceivedRecording, ReadError> {
        self.check_options();
        self.settle_names();
        for tag in &mut self.tags {
            let faults = tag.column.faults();
            self.faults.extend(faults);
            self.notes.extend(tag.column.notes());
            tag.leave_out_stand_ins();
        }
        let texts = self.tags.iter().find_map(|tag| tag.column.first_text());
        let no_signals = no_signals("there is no signal with a number in it", texts);
        self.tags
            .retain(|tag| tag.column.is_signal() && !tag.instants.is_empty());
        self.check_names();
        if self.tags.is_empty() && self.faults.is_empty() {
            self.faults.invalid(no_signals);
        }
        std::mem::take(&mut self.faults).result()?;
        let first = self.order();
        let common = self.common_instants()?;
        let own_instants = !common.are_all && common.sample_time.is_none();
        let mut bytes = self.common_bytes(&common);
        let options = self.options;
        if own_instants && options.purpose == ReadingPurpose::Stream {
            self.notes.extend(self.tags.iter().filter_map(Tag::missing));
        }
        let mut signals = Vec::with_capacity(self.tags.len());
        let mut columns = Vec::with_capacity(self.tags.len());
        for (k, mut tag) in self.tags.into_iter().enumerate() {
            let (values, classes) = tag.take_on(&common);
            bytes += SPAN_BYTES * ClassSpan::count(&classes) as u64;
            let what = "samples whose quality changes so often";
            self.memory.hold(bytes, what, INSTEAD)?;
            let spans = ClassSpan::of(classes.into_iter());
            signals.push(tag.column.into_named(spans, k));
            columns.push(values);
        }
        self.notes.extend(self.clock.notes());
        Ok(ReceivedRecording {
            header: Recording {
                name: options.name.clone(),
                start: self.clock.start(first),
                zone: self.clock.zone(),
                source: options.source(format),
                double_hour: self.clock.double_hour(first),
                own_instants,
                time: options.purpose.axis(common.instants, self.clock.scale()),
                signals,
                notes: self.notes,
            },
            columns: SampleColumns::of(columns),
        })
    }

    /// Names that options speak of are names of tags.
    fn check_options(&mut self) {
        let names: Vec<&str> = self.tags.iter().map(|tag| tag.short.as_str()).collect();
        self.options.check_names(&names, &mut self.faults);
    }

    /// Two tags of one short name are called by their keys.
    fn settle_names(&mut self) {
        let mut count: HashMap<String, usize> = HashMap::new();
        for tag in &self.tags {
            *count.entry(tag.short.clone()).or_default() += 1;
        }
        for tag in self.tags.iter_mut().filter(|tag| count[&tag.short] > 1) {
            tag.column.name.clone_from(&tag.key);
        }
    }

    /// Renaming may have made two names one.
    fn check_names(&mut self) {
        let mut seen = std::collections::HashSet::new();
        for tag in &self.tags {
            if !seen.insert(tag.column.name.as_str()) {
                let detail = format!("two signals are called `{}`", tag.column.name);
                self.faults
                    .invalid(Fault::of_whole("duplicate_name", detail));
            }
        }
    }

    /// Puts each tag's samples in their order, and the first instant of all at 0. Answers when
    /// that was by the clock.
    fn order(&mut self) -> f64 {
        let (mut disordered, mut duplicates, mut spread) = (0, 0, None);
        for tag in &mut self.tags {
            let (moved, dropped, coarse) = tag.order(self.options.purpose);
            disordered += moved;
            duplicates += dropped;
            spread = spread.or(coarse);
        }
        let firsts = self.tags.iter().filter_map(|tag| tag.instants.first());
        let first = firsts.copied().fold(f64::INFINITY, f64::min);
        let exact = self.clock.is_absolute();
        for instant in self.tags.iter_mut().flat_map(|tag| &mut tag.instants) {
            *instant -= first;
            if exact && first != 0.0 {
                *instant = (*instant * 1e9).round() / 1e9;
            }
        }
        self.notes.extend(spread.map(CoarseTimes::note));
        if disordered > 0 {
            let detail = format!("{disordered} samples came out of their order and were sorted");
            self.notes
                .push(Warning::of_recording("out_of_order", detail));
        }
        if duplicates > 0 {
            self.notes
                .push(self.options.purpose.duplicate_time(duplicates));
        }
        first
    }

    /// The instants of all tags together, in their order.
    fn all_instants(&self) -> Vec<f64> {
        let mut instants: Vec<f64> = Vec::with_capacity(self.samples);
        instants.extend(self.tags.iter().flat_map(|tag| &tag.instants));
        instants.sort_unstable_by(f64::total_cmp);
        instants.dedup();
        instants
    }

    /// The instants that all signals will have.
    fn common_instants(&mut self) -> Result<Common, ReadError> {
        let first = &self.tags[0].instants;
        let all_equal = self.tags.iter().all(|tag| tag.instants == *first);
        let least = self.options.purpose.least_instants();
        let grid = match self.options.purpose {
            ReadingPurpose::Recording => self.options.grid,
            ReadingPurpose::Stream => Some(GridOption::None),
        };
        if all_equal && !matches!(grid, Some(GridOption::Every(_))) {
            let instants = std::mem::take(&mut self.tags[0].instants);
            return Ok(Common {
                instants: enough(instants, least)?,
                sample_time: None,
                are_all: true,
            });
        }
        if grid == Some(GridOption::None) {
            let mut instants = self.all_instants();
            self.check_common(instants.len())?;
            instants.shrink_to_fit();
            return Ok(Common {
                instants: enough(instants, least)?,
                sample_time: None,
                are_all: false,
            });
        }
        let scale = self.clock.scale();
        let times = self.tags.iter();
        let medians = times.map(|tag| TimeAxis::sample_time_of(&tag.instants, scale));
        let fastest = medians
            .filter(|time| *time > 0.0)
            .fold(f64::INFINITY, f64::min);
        let (sample_time, reason) = match grid {
            Some(GridOption::Every(seconds)) => (seconds, "as `grid` says"),
            _ => (
                fastest,
                "the median interval of the fastest; `grid` says otherwise",
            ),
        };
        let lasts = self.tags.iter().filter_map(|tag| tag.instants.last());
        let last = lasts.copied().fold(0.0, f64::max);
        let points = last / sample_time + 1.0;
        if !sample_time.is_finite() || points > (MOST_GRID_SAMPLES * self.samples) as f64 {
            let detail = format!(
                "a grid of {} s would have far more instants than there are samples; say another \
                 `grid`, or `none`",
                shown(sample_time)
            );
            return Err(super::error::invalid(Fault::of_whole(
                "grid_too_fine",
                detail,
            )));
        }
        self.check_common(points as usize)?;
        let courses = self.tags.iter_mut();
        self.notes
            .extend(courses.filter_map(|tag| tag.settle_course(fastest)));
        let detail = format!(
            "the signals have instants of their own; they were put on a grid of {} s, {reason}: \
             held ones keep their last value, others are interpolated linearly",
            shown(sample_time)
        );
        self.notes
            .push(Warning::of_recording("put_on_grid", detail));
        let instants = (0..=(points - 1.0 + 1e-6) as usize).map(|k| k as f64 * sample_time);
        Ok(Common {
            instants: enough(instants.collect(), least)?,
            sample_time: Some(sample_time),
            are_all: false,
        })
    }

    /// Refuses so many common instants where the samples at them take too much memory.
    fn check_common(&self, instants: usize) -> Result<(), ReadError> {
        let signals = self.tags.len();
        let what = format!("{signals} signals at {instants} common instants");
        let each = COMMON_SAMPLE_BYTES * signals as u64 + COMMON_INSTANT_BYTES;
        let bytes = self.held_bytes() + each.saturating_mul(instants as u64);
        self.memory.hold(bytes, &what, COARSER)
    }

    /// Bytes of the samples, and of those at the common instants where the tags have others.
    fn common_bytes(&self, common: &Common) -> u64 {
        let each = match common.are_all {
            true => 0,
            false => COMMON_SAMPLE_BYTES * self.tags.len() as u64 + COMMON_INSTANT_BYTES,
        };
        self.held_bytes() + each * common.instants.len() as u64
    }
}

fn enough(instants: Vec<f64>, least: usize) -> Result<Vec<f64>, ReadError> {
    if instants.len() >= least {
        return Ok(instants);
    }
    let detail = format!(
        "{} samples at distinct times; at least {least} are needed",
        instants.len()
    );
    Err(super::error::invalid(Fault::of_whole(
        "too_few_samples",
        detail,
    )))
}
