//! How a body with samples is to be read: options of the query, and those of a layout that the query names.

use std::collections::BTreeMap;

use utoipa::IntoParams;
use utoipa::openapi::Object;

use super::error::{Answer, Kind, Problem};
use super::query::{QueryReader, one_of};
use crate::access::Project;
use crate::store::Layouts;
use greybox::intake::{self, Options};
use greybox::parsing::Fault;

fn formats() -> Object {
    one_of(intake::Format::names())
}

fn quality_schemes() -> Object {
    one_of(intake::quality_schemes())
}

/// How a body is to be read.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ReadingQuery {
    /// The time column of a CSV or pandas body; the first one when absent.
    pub time: Option<String>,
    /// How the body is written, where that is not told from its type and its first lines:
    /// `wide_csv`, `long_csv`, `paired_csv`, `senseye`, `simulink_csv`, `influx_csv`,
    /// `influx_line_protocol`, `influx_json`, `pi_web_api`, `omf`, `aveva_odata`, `aveva_sql`, `canary`, `ignition`, `opc_ua_json`, `cognite`,
    /// `pandas_records`, `pandas_split`, `pandas_table`, `json_series`, `excel`, `parquet` or `json`.
    #[param(schema_with = formats)]
    pub format: Option<String>,
    /// The zone of times without an offset, by its IANA name, or their offset, such as `+01:00`.
    #[param(example = "Europe/Berlin")]
    pub tz: Option<String>,
    /// What numbers of time are: a unit (`ms`), the sample time of a counter (`10ms`), serial days
    /// (`excel`, `datenum`, `julian`) or a program's count (`labview`, `filetime`, `ticks`); of dates, whether the day (`dmy`) or the month (`mdy`) comes first.
    #[param(example = "ms")]
    pub time_unit: Option<String>,
    /// What separates a number's fraction: `.` or `,`.
    pub decimal: Option<String>,
    /// The encoding of the text, where it is not UTF-8 and has no byte order mark.
    #[param(example = "windows-1252")]
    pub encoding: Option<String>,
    /// Numbers and words, separated by commas, that stand for a missing sample.
    #[param(example = "-9999,Bad")]
    pub missing: Option<String>,
    /// Signals to leave out, separated by commas, or as a JSON array.
    pub ignore: Option<String>,
    /// Units of signals, `name:unit` separated by commas, or as a JSON object.
    #[param(example = "p:bar,x:mm")]
    pub units: Option<String>,
    /// New names of signals, `old:new` separated by commas, or as a JSON object.
    pub rename: Option<String>,
    /// What codes of quality mean: `opc_da`, `opc_ua`, `aveva_quality`, `aveva_quality_detail`,
    /// `ignition`, `ignition_legacy`, `cognite`, `is_good` (1 good, 0 bad), `proficy` or `words`.
    #[param(schema_with = quality_schemes)]
    pub quality_scheme: Option<String>,
    /// How signals go on between samples: `hold` or `linear`, or `name:hold` separated by commas.
    #[param(example = "valve:hold")]
    pub interpolation: Option<String>,
    /// The instants for signals that have different ones: a sample time (`10ms`), a rate
    /// (`100Hz`), or `none` for those of all of them together.
    pub grid: Option<String>,
    /// The worksheet of a workbook; the first that can be seen and has anything in it when absent.
    #[param(example = "Data")]
    pub sheet: Option<String>,
    /// The line of a table's titles, from 1, or `none`: its columns are then called `column_1`, `column_2` and so on.
    #[param(example = "3")]
    pub header_row: Option<String>,
    /// The line of the units of a table's columns, from 1, or `none`.
    #[param(example = "none")]
    pub unit_row: Option<String>,
    /// The column that names the signal of a row, by its title, or the key of such a field in records of JSON: each row
    /// is then of one signal.
    #[param(example = "Messstelle")]
    pub tag: Option<String>,
    /// The columns of values of such a table, separated by commas, or as a JSON array; of Cognite, the aggregates. Of several
    /// each is a signal of its own, such as `pump.pressure`; all columns of numbers when absent.
    #[param(example = "Wert")]
    pub value: Option<String>,
    /// The column of the quality of such a table, or `none`.
    pub quality: Option<String>,
    /// The lines of a text, from 1, that are left out whatever stands in them.
    #[param(example = "7,20-25,100-")]
    pub skip: Option<String>,
    /// A layout that was saved (`PUT /v1/layouts/{name}`), whose options count where the query does not give them.
    #[param(example = "monthly export of hall 2")]
    pub layout: Option<String>,
}

/// The names of the options, in the order in which a digest counts them.
pub fn option_names() -> impl Iterator<Item = &'static str> {
    ["time"].into_iter().chain(Options::NAMES)
}

/// The options of a request, each understood for itself.
pub struct GivenOptions {
    /// The texts of the options by their names.
    texts: BTreeMap<&'static str, String>,
    /// The layout that the request names.
    layout: Option<String>,
}

impl GivenOptions {
    /// Reads the options of a query.
    pub fn read(query: &mut QueryReader) -> Self {
        let mut texts = BTreeMap::new();
        for name in option_names() {
            let set = |text: &str| Options::default().set(name, text).map(|()| text.to_owned());
            texts.extend(query.parsed(name, set).map(|text| (name, text)));
        }
        let layout = query.text("layout");
        Self { texts, layout }
    }

    /// The options as they came, with the layout by its name, in the order in which a digest counts them.
    pub fn as_they_came(&self) -> Vec<(&'static str, String)> {
        let layout = self.layout.iter().map(|layout| ("layout", layout.clone()));
        self.in_order().chain(layout).collect()
    }

    /// The options with those of the layout in the place of what the request leaves out.
    pub async fn completed(
        mut self,
        layouts: &Layouts,
        project: &Project,
    ) -> Answer<CompleteOptions> {
        let Some(name) = self.layout.take() else {
            return Ok(CompleteOptions(self));
        };
        let Some(layout) = layouts.find(project, &name).await? else {
            return Err(layout_fault(format!("there is no layout `{name}`")));
        };
        for option in option_names() {
            if let Some(text) = layout.options.get(option) {
                self.texts.entry(option).or_insert_with(|| text.clone());
            }
        }
        self.layout = Some(name);
        Ok(CompleteOptions(self))
    }

    fn in_order(&self) -> impl Iterator<Item = (&'static str, String)> {
        option_names().filter_map(|name| Some((name, self.texts.get(name)?.clone())))
    }
}

/// The options of a request with those of its layout.
pub struct CompleteOptions(GivenOptions);

impl CompleteOptions {
    /// The texts that a digest of the recording counts beside its bytes: the name of the recording, and each option
    /// whether the query or the layout gives the option.
    pub fn digested(&self, name: Option<&String>) -> Vec<(&'static str, String)> {
        let name = name.map(|name| ("name", name.clone()));
        name.into_iter().chain(self.0.in_order()).collect()
    }

    /// The options, as the readers take them.
    pub fn options(&self) -> Answer<Options> {
        let mut options = Options::default();
        for (name, text) in self.0.in_order() {
            let set = options.set(name, &text);
            set.map_err(|why| layout_fault(format!("its `{name}` is not understood: {why}")))?;
        }
        Ok(options)
    }
}

/// Checks the text of an option.
///
/// # Errors
/// A sentence on what is wrong with the text.
pub fn option_fault(name: &str, text: &str) -> Result<(), String> {
    Options::default().set(name, text)
}

fn layout_fault(detail: String) -> Problem {
    let fault = Fault::of_parameter("layout", "invalid_parameter", detail);
    Problem::of_faults(Kind::Invalid, [fault])
}
