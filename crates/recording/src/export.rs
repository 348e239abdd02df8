//! Samples as CSV in SI units.

use super::{Recording, Rows};
use std::io::{self, BufWriter, Write};

/// Writes samples as `time [s],name [unit],…` and a row for each instant. A missing sample is an empty
/// field. Numbers are the shortest text that reads back to the same bits.
pub struct CsvWriter<W: Write> {
    out: BufWriter<W>,
}

impl<W: Write> CsvWriter<W> {
    /// A writer that has written nothing.
    pub fn new(out: W) -> Self {
        Self {
            out: BufWriter::new(out),
        }
    }

    /// Writes the titles: of the time, and of signals by their name and SI unit.
    ///
    /// # Errors
    /// When the titles cannot be written.
    pub fn titles<'a>(
        &mut self,
        signals: impl Iterator<Item = (&'a str, &'a str)> + Clone,
    ) -> io::Result<()> {
        let mut time = "time".to_owned();
        while signals.clone().any(|(name, _)| name == time) {
            time.push('_');
        }
        write!(self.out, "{time} [s]")?;
        for (name, unit) in signals {
            write!(self.out, ",{}", quoted(&title(name, unit)))?;
        }
        writeln!(self.out)
    }

    /// Writes the samples of an instant `[s]`.
    ///
    /// # Errors
    /// When the samples cannot be written.
    pub fn row(&mut self, instant: f64, values: impl Iterator<Item = f64>) -> io::Result<()> {
        write!(self.out, "{instant:?}")?;
        for value in values {
            if value.is_nan() {
                write!(self.out, ",")?;
            } else {
                write!(self.out, ",{value:?}")?;
            }
        }
        writeln!(self.out)
    }

    /// Writes rows with their instants counted from one of them, nanoseconds since 1970.
    ///
    /// # Errors
    /// When the samples cannot be written.
    pub fn rows(&mut self, rows: &Rows, start: i64) -> io::Result<()> {
        for (row, instant) in rows.instants.iter().enumerate() {
            let instant = (instant - start) as f64 / 1e9;
            self.row(
                instant,
                rows.columns.iter().map(|column| column.values[row]),
            )?;
        }
        Ok(())
    }

    /// Writes what is still held.
    ///
    /// # Errors
    /// When the last rows cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Recording {
    /// Writes the recording as [`CsvWriter`] does.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write_csv(&self, out: impl Write) -> io::Result<()> {
        let signals = self.signals.iter();
        let titles = signals.map(|signal| (&*signal.name, &*signal.unit));
        let mut writer = CsvWriter::new(out);
        writer.titles(titles)?;
        for k in 0..self.time.samples() {
            let values = self.signals.iter().map(|signal| signal.values[k]);
            writer.row(self.time.instant(k), values)?;
        }
        writer.finish()
    }
}

fn title(name: &str, unit: &str) -> String {
    if unit.is_empty() && !name.ends_with(']') {
        name.to_owned()
    } else {
        format!("{name} [{unit}]")
    }
}

fn quoted(title: &str) -> String {
    if title.contains([',', ';', '"']) {
        format!("\"{}\"", title.replace('"', "\"\""))
    } else {
        title.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Signal, TimeAxis};

    #[test]
    fn missing_samples_are_empty_fields() {
        let time = TimeAxis::Uniform {
            sample_time: 0.5,
            samples: 3,
        };
        let position = Signal::new("position", "m", vec![1e-7, f64::NAN, 2.0]);
        let mut text = Vec::new();
        Recording::new(time, vec![position])
            .write_csv(&mut text)
            .unwrap();
        let expected = "time [s],position [m]\n0.0,1e-7\n0.5,\n1.0,2.0\n";
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }
}
