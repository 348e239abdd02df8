//! A recording as CSV in SI units.

use super::{Recording, Signal};
use std::io::{self, BufWriter, Write};

impl Recording {
    /// Writes `time [s],name [unit],…` and a row for each sample. A missing sample is an empty
    /// field. Numbers are the shortest text that reads back to the same bits.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write_csv(&self, out: impl Write) -> io::Result<()> {
        let mut out = BufWriter::new(out);
        write!(out, "{}", self.time_title())?;
        for signal in &self.signals {
            write!(out, ",{}", quoted(&title(signal)))?;
        }
        writeln!(out)?;
        for k in 0..self.time.samples() {
            write!(out, "{:?}", self.time.instant(k))?;
            for signal in &self.signals {
                write_field(&mut out, signal.values[k])?;
            }
            writeln!(out)?;
        }
        out.flush()
    }

    /// The title of the time column, which no signal has.
    fn time_title(&self) -> String {
        let mut name = "time".to_owned();
        while self.signal(&name).is_some() {
            name.push('_');
        }
        format!("{name} [s]")
    }
}

fn title(signal: &Signal) -> String {
    if signal.unit.is_empty() && !signal.name.ends_with(']') {
        signal.name.clone()
    } else {
        format!("{} [{}]", signal.name, signal.unit)
    }
}

fn quoted(title: &str) -> String {
    if title.contains([',', ';', '"']) {
        format!("\"{}\"", title.replace('"', "\"\""))
    } else {
        title.to_owned()
    }
}

fn write_field(out: &mut impl Write, value: f64) -> io::Result<()> {
    if value.is_nan() {
        write!(out, ",")
    } else {
        write!(out, ",{value:?}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimeAxis;

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
