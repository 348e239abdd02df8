//! Numbers that count from an instant of their own, as programs write them.

use std::ops::Range;

/// Unix times of plants: 1990 to 2100 `[s]`.
pub(super) const UNIX: std::ops::Range<f64> = 631_152_000.0..4_102_444_800.0;

/// Units in which Unix times are written `[s]`.
pub(super) const UNIX_SCALES: [(f64, &str); 4] = [
    (1.0, "Unix seconds"),
    (1e-3, "Unix milliseconds"),
    (1e-6, "Unix microseconds"),
    (1e-9, "Unix nanoseconds"),
];

/// A way of counting time. The ranges of numbers are those of 1990 to 2100.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Epoch {
    /// Days since the beginning of 1900 in local time, as spreadsheets count them.
    Excel,
    /// Days since the beginning of the year 0 in local time, as MATLAB counts them.
    Datenum,
    /// Days since noon of 1 January 4713 BC, as astronomers count them.
    Julian,
    /// Seconds since 1904, as `LabVIEW` counts them.
    LabView,
    /// Tenths of a microsecond since 1601, as Windows counts them.
    FileTime,
    /// Tenths of a microsecond since the year 1, as .NET counts them.
    Ticks,
}

/// How far a number lies from a count that the clock reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Counted {
    /// A count of days that begins `before` days before the serial days of a spreadsheet.
    Days { before: f64 },
    /// A count of units of `factor` seconds that begins `before` units before 1970.
    Units { before: i64, factor: f64 },
}

impl Epoch {
    /// All epochs but that of spreadsheets.
    pub(super) const OF_PROGRAMS: [Epoch; 5] = [
        Epoch::Datenum,
        Epoch::Julian,
        Epoch::LabView,
        Epoch::FileTime,
        Epoch::Ticks,
    ];

    /// The epoch that the option `time_unit` names.
    pub(super) fn named(text: &str) -> Option<Epoch> {
        let mut all = Epoch::OF_PROGRAMS.into_iter().chain([Epoch::Excel]);
        all.find(|epoch| epoch.option() == text)
    }

    /// The word of the option `time_unit`.
    pub(super) fn option(self) -> &'static str {
        match self {
            Epoch::Excel => "excel",
            Epoch::Datenum => "datenum",
            Epoch::Julian => "julian",
            Epoch::LabView => "labview",
            Epoch::FileTime => "filetime",
            Epoch::Ticks => "ticks",
        }
    }

    /// The words for people.
    pub(super) fn words(self) -> &'static str {
        match self {
            Epoch::Excel => "serial days of a spreadsheet",
            Epoch::Datenum => "days of MATLAB (datenum)",
            Epoch::Julian => "Julian days",
            Epoch::LabView => "seconds since 1904 (LabVIEW)",
            Epoch::FileTime => "Windows file times",
            Epoch::Ticks => ".NET ticks",
        }
    }

    /// The numbers of 1990 to 2100.
    pub(super) fn numbers(self) -> Range<f64> {
        match self {
            Epoch::Excel => 32_874.0..73_051.0,
            Epoch::Datenum => 726_834.0..767_011.0,
            Epoch::Julian => 2_447_892.5..2_488_070.0,
            Epoch::LabView => 2_713_996_800.0..6_185_289_600.0,
            Epoch::FileTime => 122_756_256e9..157_469_184e9,
            Epoch::Ticks => 627_667_488e9..662_380_416e9,
        }
    }

    pub(super) fn counted(self) -> Counted {
        let units = |before: i64, factor: f64| Counted::Units { before, factor };
        match self {
            Epoch::Excel => Counted::Days { before: 0.0 },
            Epoch::Datenum => Counted::Days { before: 693_960.0 },
            Epoch::Julian => Counted::Days {
                before: 2_415_018.5,
            },
            Epoch::LabView => units(2_082_844_800, 1.0),
            Epoch::FileTime => units(116_444_736_000_000_000, 1e-7),
            Epoch::Ticks => units(621_355_968_000_000_000, 1e-7),
        }
    }

    /// Whether a column's name, small letters and digits alone, says that the column counts so.
    pub(super) fn is_named_by(self, name: &str) -> bool {
        match self {
            Epoch::Excel => name.contains("date") && !name.contains("datenum"),
            Epoch::Datenum => name.contains("datenum"),
            Epoch::Julian => name.contains("julian"),
            Epoch::LabView => name.contains("labview"),
            Epoch::FileTime => name.contains("filetime"),
            Epoch::Ticks => name.contains("ticks"),
        }
    }
}

/// Whether a number is a Unix time of plants by its size.
pub(super) fn is_unix_time(value: f64) -> bool {
    let mut scales = UNIX_SCALES.iter();
    scales.any(|(factor, _)| UNIX.contains(&(value * factor)))
}
