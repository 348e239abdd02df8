//! A recording: signals over one time axis, and what their source said of them.

use super::{DoubleHour, RecordingSource, Signal, TimeAxis, Warning};

/// The most signals one recording may have.
pub const MAX_SIGNALS: usize = 1000;

/// The longest signal name, in characters.
pub const MAX_NAME_CHARACTERS: usize = 200;

/// The fewest samples of a recording: two make a sample time.
pub const MIN_SAMPLES: usize = 2;

/// Signals that were recorded together, in SI units: each with its samples ([`Signal`]), or described
/// without them ([`NamedSignal`](crate::NamedSignal)).
#[derive(Clone, Debug)]
pub struct Recording<S = Signal> {
    /// A name for people.
    pub name: Option<String>,
    /// The instant of the first sample, where the source gave one.
    pub start: Option<jiff::Timestamp>,
    /// The time zone that the source counted in, where it is known: an IANA name or an offset.
    pub zone: Option<String>,
    /// The format and the options that the recording was read with.
    pub source: RecordingSource,
    /// When the samples were taken.
    pub time: TimeAxis,
    /// The local hour that came twice, where nothing in the source tells its passes apart.
    pub double_hour: Option<DoubleHour>,
    /// Whether signals have instants of their own, so that a missing sample of one may mean that
    /// another was taken there.
    pub own_instants: bool,
    /// The signals in the order of the source; their samples are as many as those of `time`.
    pub signals: Vec<S>,
    /// What reading changed or assumed, e.g. rows that were dropped.
    pub notes: Vec<Warning>,
}

impl Recording {
    /// A recording from vectors: the sample time `[s]`, and of each signal the name, the SI unit
    /// and the samples, NaN where one is missing.
    ///
    /// # Panics
    /// When the signals are not all equally long.
    ///
    /// ```
    /// use greybox_recording::Recording;
    ///
    /// let recording = Recording::from_samples(
    ///     0.01,
    ///     [("force", "N", vec![0.0, 1.0, 1.0]), ("position", "m", vec![0.0, 0.0, 2e-5])],
    /// );
    /// assert_eq!(recording.signal("force").map(|signal| signal.values.len()), Some(3));
    /// ```
    #[must_use]
    pub fn from_samples<'a>(
        sample_time: f64,
        signals: impl IntoIterator<Item = (&'a str, &'a str, Vec<f64>)>,
    ) -> Recording {
        let signals: Vec<Signal> = signals
            .into_iter()
            .map(|(name, unit, values)| Signal::new(name, unit, values))
            .collect();
        let samples = signals.first().map_or(0, |first| first.values.len());
        let is_long = |signal: &Signal| signal.values.len() == samples;
        assert!(signals.iter().all(is_long), "signals are equally long");
        Recording::new(
            TimeAxis::Uniform {
                sample_time,
                samples,
            },
            signals,
        )
    }

    /// A recording with neither name nor start.
    #[must_use]
    pub fn new(time: TimeAxis, signals: Vec<Signal>) -> Self {
        Self {
            name: None,
            start: None,
            zone: None,
            source: RecordingSource::default(),
            time,
            double_hour: None,
            own_instants: false,
            signals,
            notes: Vec::new(),
        }
    }

    /// The bytes of all samples as numbers of double precision.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.time.samples() * self.signals.len() * size_of::<f64>()
    }

    /// The signal of that name.
    #[must_use]
    pub fn signal(&self, name: &str) -> Option<&Signal> {
        self.signals.iter().find(|signal| signal.name == name)
    }
}

impl<S> Recording<S> {
    /// The recording with its signals in another form.
    pub(crate) fn with_signals<T>(self, signals: Vec<T>) -> Recording<T> {
        Recording {
            name: self.name,
            start: self.start,
            zone: self.zone,
            source: self.source,
            time: self.time,
            double_hour: self.double_hour,
            own_instants: self.own_instants,
            signals,
            notes: self.notes,
        }
    }
}

/// Why `name` cannot name a signal or a recording: a code and a sentence.
#[must_use]
pub fn name_fault(name: &str) -> Option<(&'static str, String)> {
    if name.is_empty() {
        Some(("empty_name", "the name is empty".to_owned()))
    } else if name.chars().count() > MAX_NAME_CHARACTERS {
        let start: String = name.chars().take(20).collect();
        let detail = format!(
            "the name starting with `{start}` is longer than {MAX_NAME_CHARACTERS} characters"
        );
        Some(("name_too_long", detail))
    } else if name.chars().any(char::is_control) {
        let detail = format!("the name {name:?} has a control character in it");
        Some(("control_character", detail))
    } else {
        None
    }
}
