//! A column for each signal, with times or codes of quality of its own beside it:
//! `PT Time [s],PT [bar],TT Time [s],TT [degC]` and `time,PT [bar],PT.Quality`.

use super::super::cell::Cell;
use super::super::clock::Clock;
use super::super::error::{ReadError, at_line, invalid};
use super::super::layout::ColumnRole;
use super::super::memory::Memory;
use super::super::options::Options;
use super::super::quality::{Scheme, may_rate};
use super::super::tags::{Quality, RawSample, Tags};
use super::super::title;
use super::fields::{all_fields, is_called_time, line_of, runs, texts, time_name_and_unit};
use super::rows::{TableRows, is_empty, read_row};
use crate::ReceivedRecording;
use ::csv::ByteRecord;
use std::io::Read;

/// Words that call a column the quality of another.
const QUALITIES: [&str; 13] = [
    "dataquality",
    "isgood",
    "good",
    "isvalid",
    "valid",
    "validity",
    "qualitycode",
    "quality",
    "qual",
    "status",
    "statuscode",
    "qualität",
    "qualitaet",
];

/// A signal with the columns beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SeriesColumns {
    time: usize,
    value: usize,
    quality: Option<usize>,
}

/// The columns of all signals.
#[derive(Debug)]
pub(super) struct PairedColumns(Vec<SeriesColumns>);

impl PairedColumns {
    /// What the titles say, with the first rows below them; none where the signals share one time and have no
    /// quality. The time of signals that share one stands in the column `time`.
    pub(super) fn of(titles: &[&str], rows: &[Vec<String>], time: usize) -> Option<PairedColumns> {
        let is_time = |column: usize| is_called_time(titles[column]) && runs(rows, column);
        let times: Vec<usize> = (0..titles.len())
            .filter(|column| is_time(*column))
            .collect();
        let follows = |pair: &[usize]| pair[1] > pair[0] + 1;
        let last = *times.last()?;
        let are_paired = times.len() > 1
            && times[0] == 0
            && times.windows(2).all(follows)
            && last + 1 < titles.len();
        let times = match are_paired {
            true => times,
            false => vec![time],
        };
        let names: Vec<&str> = titles
            .iter()
            .map(|title| title::name_and_unit(title).0)
            .collect();
        // A title that stands behind each signal says nothing but what the column is.
        let is_again = |title: &str| titles.iter().filter(|again| **again == title).count() > 1;
        let rated = |column: usize| {
            let title = titles[column];
            let beside = column.checked_sub(1).map(|before| names[before]);
            let behind = is_again(title) && is_quality_title(title)
                || title.is_empty() && are_ratings(rows, column);
            beside
                .filter(|_| behind)
                .or_else(|| rated_by(title))
                .or_else(|| rated_by_letter(title, rows, column))
        };
        let quality_of = |name: &str| {
            let mut columns = 0..titles.len();
            columns.find(|column| rated(*column) == Some(name))
        };
        let is_rating = |column: usize| rated(column).is_some_and(|rated| names.contains(&rated));
        let is_signal = |column: &usize| !times.contains(column) && !is_rating(*column);
        let signals = (0..titles.len()).filter(is_signal);
        let series: Vec<SeriesColumns> = signals
            .map(|value| SeriesColumns {
                time: times
                    .iter()
                    .rfind(|time| **time < value)
                    .copied()
                    .unwrap_or(time),
                value,
                quality: quality_of(names[value]),
            })
            .collect();
        let has_quality = series.iter().any(|series| series.quality.is_some());
        (are_paired || has_quality).then_some(PairedColumns(series))
    }
}

impl PairedColumns {
    /// What a column holds.
    pub(super) fn role(&self, column: usize) -> ColumnRole {
        let is_any = |of: &dyn Fn(&SeriesColumns) -> bool| self.0.iter().any(of);
        if is_any(&|series| series.time == column) {
            ColumnRole::Time
        } else if is_any(&|series| series.value == column) {
            ColumnRole::Signal
        } else if is_any(&|series| series.quality == Some(column)) {
            ColumnRole::Quality
        } else {
            ColumnRole::LeftOut
        }
    }
}

fn is_quality_title(title: &str) -> bool {
    let letters = title.chars().filter(|letter| letter.is_alphanumeric());
    let plain: String = letters.flat_map(char::to_lowercase).collect();
    QUALITIES.contains(&plain.as_str())
}

/// What the codes of a column mean by its title, where the title says it.
fn scheme_of_title(title: &str) -> Option<Scheme> {
    let title = title.to_lowercase();
    let is_good = ["isgood", "is_good", "isvalid", "is_valid"];
    let says_good = is_good
        .iter()
        .any(|word| title.ends_with(word) || title.starts_with(word));
    says_good.then_some(Scheme::IsGood)
}

/// Whether a column has nothing but codes or words of quality.
fn are_ratings(rows: &[Vec<String>], column: usize) -> bool {
    all_fields(rows, column, &may_rate)
}

/// The name of the signal whose quality a column holds, by its title.
fn rated_by(title: &str) -> Option<&str> {
    let is_quality = is_quality_title;
    if let Some((before, behind)) = title
        .strip_suffix(')')
        .and_then(|title| title.split_once('('))
    {
        let (before, behind) = (before.trim(), behind.trim());
        let rated = [(before, behind), (behind, before)];
        let rated = rated.into_iter().find(|(word, _)| is_quality(word));
        return rated.map(|(_, name)| name);
    }
    let (name, word) = title.rsplit_once(['.', ' ', '_', ':', '/'])?;
    is_quality(word).then(|| name.trim())
}

/// The signal before a letter that may call a column its quality, where the column holds nothing but codes or words
/// of quality: `A_Q` beside `A`.
fn rated_by_letter<'t>(title: &'t str, rows: &[Vec<String>], column: usize) -> Option<&'t str> {
    const LETTERS: [&str; 5] = ["q", "qf", "qc", "flag", "flags"];
    const SIGNS: [char; 5] = ['.', ' ', '_', ':', '/'];
    let is_letter = |word: &str| LETTERS.contains(&word.to_lowercase().as_str());
    let behind = title.rsplit_once(SIGNS).filter(|(_, word)| is_letter(word));
    let before = title.split_once(SIGNS).filter(|(word, _)| is_letter(word));
    let name = behind
        .map(|(name, _)| name)
        .or(before.map(|(_, name)| name))?;
    are_ratings(rows, column).then(|| name.trim())
}

/// Reads all rows.
pub(super) fn read(
    mut rows: TableRows<'_, impl Read>,
    columns: Option<PairedColumns>,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let mut record = ByteRecord::new();
    read_row(&mut rows, &mut record)?;
    let titles = texts(&record)?;
    let Some(PairedColumns(columns)) = columns else {
        let detail = "a time or a quality of its own stands beside each signal, such as `PT Time [s],PT [bar],\
                      TT Time [s],TT [degC]` or `time,PT [bar],PT.Quality`";
        return Err(invalid(at_line(1, None, "columns_missing", detail)));
    };
    let (name, unit) = time_name_and_unit(titles[columns.first().map_or(0, |series| series.time)]);
    let qualities = columns.iter().filter_map(|series| series.quality);
    let mut schemes = qualities.map(|column| scheme_of_title(titles[column]));
    let scheme = schemes
        .next()
        .flatten()
        .filter(|first| schemes.all(|scheme| scheme == Some(*first)));
    let mut tags = Tags::new(Clock::new(name, unit, options), options, scheme, memory);
    let mut series = Vec::new();
    for columns in columns {
        let title = titles[columns.value];
        let (name, unit) = title::name_and_unit(title);
        let place = |code, detail: String| at_line(1, Some(title), code, detail);
        if let Some(tag) = tags.tag(name, &place) {
            tags.describe(tag, Some(unit), None, &place);
            series.push((tag, columns));
        }
    }
    while !tags.is_full() && read_row(&mut rows, &mut record)? {
        if is_empty(&record) {
            continue;
        }
        let line = line_of(&record);
        let fields = texts(&record)?;
        let field = |place: usize| fields.get(place).copied().unwrap_or_default();
        for (tag, columns) in &series {
            if field(columns.time).is_empty() {
                continue;
            }
            let sample = RawSample {
                tag: *tag,
                time: Cell::Text(field(columns.time)),
                value: Cell::Text(field(columns.value)),
                quality: match columns.quality {
                    Some(quality) => Quality::Code(Cell::Text(field(quality))),
                    None => Quality::Unsaid,
                },
            };
            let place = |code, detail: String| at_line(line, None, code, detail);
            tags.push(&sample, &place);
        }
    }
    tags.into_received("paired_csv")
}
