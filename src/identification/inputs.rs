//! What an identification is made of, from vectors and texts.

use crate::intake::{ReadError, csv};
use crate::model::{Catalogue, Model, document};
use crate::parsing::{Fault, json, yaml};
use crate::recording::{Recording, Signal, TimeAxis};
use std::io::Read;
use std::sync::Arc;

impl Recording {
    /// A recording from vectors: the sample time `[s]`, and of each signal the name, the SI unit
    /// and the samples, NaN where one is missing.
    ///
    /// # Panics
    /// When the signals are not all equally long.
    ///
    /// ```
    /// use greybox::Recording;
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

    /// A recording from CSV: a header row that names the columns with their units in brackets,
    /// the time in the first column.
    ///
    /// # Errors
    /// When the text cannot be read, with everything that is wrong with it.
    ///
    /// ```
    /// let text = "time [s],force [N],position [mm]\n0,0,0\n0.01,1,0\n0.02,1,0.02\n";
    /// let recording = greybox::Recording::from_csv(text.as_bytes())?;
    /// assert_eq!(recording.signals[1].values[2], 2e-5);
    /// # Ok::<(), greybox::intake::ReadError>(())
    /// ```
    pub fn from_csv(reader: impl Read) -> Result<Recording, ReadError> {
        csv::read(reader, &csv::Options::default())
    }
}

impl Model {
    /// A model of the catalogue; none where it has no such name.
    ///
    /// ```
    /// let servo = greybox::Model::named("single_rod_servo").expect("it is in the catalogue");
    /// assert!(servo.description().parameter_index("bulk_modulus").is_some());
    /// ```
    #[must_use]
    pub fn named(name: &str) -> Option<Arc<Model>> {
        Catalogue::built_in().get(name).cloned()
    }

    /// A model from the text of a document, YAML or JSON.
    ///
    /// # Errors
    /// Everything that is wrong with it, each fault with a JSON pointer.
    ///
    /// ```
    /// let lag = greybox::Model::from_text(
    ///     r#"{
    ///         "name": "lag",
    ///         "inputs": {"u": {"unit": "V"}},
    ///         "parameters": {"T": {"unit": "s", "default": 1, "lower": 0.1, "upper": 10}},
    ///         "states": {"y": {"unit": "V", "initial": 0, "derivative": "(u - y)/T"}},
    ///         "outputs": {"y_out": {"unit": "V", "expression": "y"}}
    ///     }"#,
    /// )?;
    /// assert_eq!(lag.description().states.len(), 1);
    /// # Ok::<(), Vec<greybox::parsing::Fault>>(())
    /// ```
    pub fn from_text(text: &str) -> Result<Arc<Model>, Vec<Fault>> {
        let unreadable = |error: String| vec![Fault::new("", "not_a_document", error)];
        let document = if text.trim_start().starts_with('{') {
            json::parse(text.as_bytes()).map_err(|error| unreadable(error.to_string()))?
        } else {
            yaml::parse(text).map_err(|error| unreadable(error.to_string()))?
        };
        document::referenced(&document).map(|read| read.model)
    }
}
