//! The options by which a command reads a recording: those of `POST /v1/datasets`, as flags.

use super::error::CommandError;
use clap::Args;
use greybox::intake::{Options, ReadError};
use std::path::Path;

/// How the recording is read, where its text does not say.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "How the recording is read")]
pub struct Reading {
    /// The time column [default: the first]
    #[arg(long)]
    time: Option<String>,

    /// How the file is written, such as `wide_csv`, `long_csv` or `pi_web_api`
    #[arg(long)]
    format: Option<String>,

    /// The zone of times without an offset, such as `Europe/Berlin` or `+01:00`
    #[arg(long)]
    tz: Option<String>,

    /// What numbers of time are (`ms`, `10ms`, `excel`, `filetime`), or of dates whether the day comes first (`dmy`, `mdy`)
    #[arg(long, alias = "time_unit")]
    time_unit: Option<String>,

    /// What separates a number's fraction: `.` or `,`
    #[arg(long)]
    decimal: Option<String>,

    /// The encoding of the text, such as `windows-1252`
    #[arg(long)]
    encoding: Option<String>,

    /// Numbers and words that stand for a missing sample: `-9999,Bad`
    #[arg(long, allow_hyphen_values = true)]
    missing: Option<String>,

    /// Signals to leave out, separated by commas
    #[arg(long)]
    ignore: Option<String>,

    /// Units of signals: `p:bar,x:mm`
    #[arg(long)]
    units: Option<String>,

    /// New names of signals: `old:new`, separated by commas
    #[arg(long)]
    rename: Option<String>,

    /// What codes of quality mean, such as `opc_da` or `opc_ua`
    #[arg(long, alias = "quality_scheme")]
    quality_scheme: Option<String>,

    /// How signals go on between samples: `hold`, `linear`, or `valve:hold`
    #[arg(long)]
    interpolation: Option<String>,

    /// The instants for signals that have different ones: `10ms`, `100Hz` or `none`
    #[arg(long)]
    grid: Option<String>,

    /// The worksheet of a workbook
    #[arg(long)]
    sheet: Option<String>,

    /// The line of a table's titles, from 1, or `none`: columns are then called column_1, column_2 and so on
    #[arg(long, alias = "header_row")]
    header_row: Option<String>,

    /// The line of the units of a table's columns, from 1, or `none`
    #[arg(long, alias = "unit_row")]
    unit_row: Option<String>,

    /// The column that names the signal of a row
    #[arg(long)]
    tag: Option<String>,

    /// The columns of values, separated by commas, where a row names its signal
    #[arg(long)]
    value: Option<String>,

    /// The column of the quality, where a row names its signal, or `none`
    #[arg(long)]
    quality: Option<String>,

    /// The lines of a text, from 1, that are left out: `7,20-25,100-`
    #[arg(long)]
    skip: Option<String>,
}

impl Reading {
    /// The options, as the readers take them.
    pub fn options(&self) -> Result<Options, CommandError> {
        let mut options = Options::default();
        options.time.clone_from(&self.time);
        let given = self.given().into_iter();
        let faults: Vec<String> = given
            .filter_map(|(name, text)| {
                let set = options.set(name, text?);
                set.err().map(|detail| format!("{}: {detail}", flag(name)))
            })
            .collect();
        match faults[..] {
            [] => Ok(options),
            _ => Err(CommandError::inputs(faults)),
        }
    }

    /// Every option by its name, in the order of the readers.
    fn given(&self) -> [(&'static str, Option<&str>); Options::NAMES.len()] {
        [
            ("format", self.format.as_deref()),
            ("tz", self.tz.as_deref()),
            ("time_unit", self.time_unit.as_deref()),
            ("decimal", self.decimal.as_deref()),
            ("encoding", self.encoding.as_deref()),
            ("missing", self.missing.as_deref()),
            ("ignore", self.ignore.as_deref()),
            ("units", self.units.as_deref()),
            ("rename", self.rename.as_deref()),
            ("quality_scheme", self.quality_scheme.as_deref()),
            ("interpolation", self.interpolation.as_deref()),
            ("grid", self.grid.as_deref()),
            ("sheet", self.sheet.as_deref()),
            ("header_row", self.header_row.as_deref()),
            ("unit_row", self.unit_row.as_deref()),
            ("tag", self.tag.as_deref()),
            ("value", self.value.as_deref()),
            ("quality", self.quality.as_deref()),
            ("skip", self.skip.as_deref()),
        ]
    }
}

/// The faults of a file, each with the flag that mends it.
pub fn faults(path: &Path, error: &ReadError) -> Vec<String> {
    let faults = error.faults().iter();
    faults
        .map(|fault| {
            let mend = fault.parameter.as_deref().map(flag);
            let mend = mend.map_or_else(String::new, |flag| format!(" [{flag}]"));
            format!("{}: {fault}{mend}", path.display())
        })
        .collect()
}

fn flag(option: &str) -> String {
    format!("--{}", option.replace('_', "-"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        reading: Reading,
    }

    #[test]
    fn every_option_of_the_readers_has_a_flag() {
        let names = Reading::default().given().map(|(name, _)| name);
        assert_eq!(names, Options::NAMES);
    }

    #[test]
    fn flags_read_a_table_as_they_say() {
        let arguments = [
            "",
            "--decimal",
            ",",
            "--missing",
            "-9999",
            "--units",
            "p:bar",
        ];
        let options = Command::parse_from(arguments).reading.options().unwrap();
        let text = "time [s];p\n0;1,5\n1;-9999\n2;2,5\n3;3\n4;4\n";
        let kind = greybox::intake::MediaKind::Text;
        let recording = greybox::intake::read(text.as_bytes(), kind, &options).unwrap();
        let values = &recording.signals[0].values;
        assert!(
            (values[0] - 1.5e5).abs() < 1e-6 && values[1].is_nan(),
            "{values:?}"
        );
    }

    #[test]
    fn a_wrong_option_is_told_by_its_flag() {
        let arguments = ["", "--time-unit", "fortnights", "--decimal", "!"];
        let error = Command::parse_from(arguments)
            .reading
            .options()
            .unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("--time-unit: ") && text.contains("--decimal: "),
            "{text}"
        );
    }
}
