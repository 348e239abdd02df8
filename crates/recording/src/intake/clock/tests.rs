//! Times of every spelling, and those that are refused.

use super::*;

fn clock(name: &str, unit: &str, given: &[(&str, &str)]) -> Clock {
    let mut options = Options::default();
    for (option, text) in given {
        options.set(option, text).unwrap();
    }
    Clock::new(name, unit, &options)
}

fn read(clock: &mut Clock, text: &str) -> Result<f64, &'static str> {
    clock
        .read(&Cell::Text(text), None)
        .map_err(|(code, _)| code)
}

fn start(clock: &Clock) -> String {
    clock.start(0.0).unwrap().to_string()
}

#[test]
fn numbers_count_from_the_first_row_in_the_unit_of_the_header() {
    let mut clock = clock("time", "ms", &[]);
    assert_eq!(read(&mut clock, "1500"), Ok(0.0));
    assert_eq!(read(&mut clock, " 1750 "), Ok(0.25));
    assert_eq!(read(&mut clock, "2026-03-02T08:15:00Z"), Err("not_a_time"));
    assert_eq!(read(&mut clock, ""), Err("missing_time"));
    assert_eq!(read(&mut clock, "inf"), Err("not_a_time"));
    assert_eq!(clock.start(0.0), None);
}

#[test]
fn negative_and_exponent_notation_are_numbers() {
    let mut clock = clock("time", "s", &[]);
    assert_eq!(read(&mut clock, "-1e-3"), Ok(0.0));
    assert_eq!(read(&mut clock, "1e-3"), Ok(0.002));
}

#[test]
fn unix_times_are_told_by_their_size_and_it_is_said() {
    for (first, second) in [
        ("1557320284", "1557320285"),
        ("1557320284000", "1557320285000"),
        ("1557320284000000", "1557320285000000"),
        ("1557320284000000000", "1557320285000000000"),
    ] {
        let mut clock = clock("ts", "", &[]);
        assert_eq!(read(&mut clock, first), Ok(0.0));
        assert_eq!(read(&mut clock, second), Ok(1.0));
        assert_eq!(start(&clock), "2019-05-08T12:58:04Z");
        assert_eq!(clock.notes()[0].code, "time_unit_from_size");
    }
    let mut clock = clock("ts", "", &[("time_unit", "ms")]);
    assert_eq!(read(&mut clock, "1557320284000"), Ok(0.0));
    assert!(clock.notes().is_empty());
}

#[test]
fn numbers_that_may_be_anything_are_asked_about() {
    for name in ["sample_index", "Sample", "n", "foo", "x"] {
        let mut clock = clock(name, "", &[]);
        assert_eq!(read(&mut clock, "0"), Err("time_unit_needed"), "{name}");
    }
    let mut counted = clock("sample", "", &[("time_unit", "10ms")]);
    assert_eq!(read(&mut counted, "5"), Ok(0.0));
    assert_eq!(read(&mut counted, "7"), Ok(0.02));
    let mut days = clock("time", "", &[]);
    assert_eq!(read(&mut days, "45353.5"), Err("time_unit_needed"));
}

/// Noon of 2 March 2024 as each program counts it, and a second later; a Julian day begins at noon.
#[test]
fn counts_of_programs_are_told_by_their_size_or_asked_about() {
    let told = [
        ("ts", "133538544000000000", "133538544010000000"),
        ("ts", "638449776000000000", "638449776010000000"),
        ("datenum", "739313.5", "739313.500011574"),
        ("julian date", "2460372", "2460372.000011574"),
    ];
    for (name, first, second) in told {
        let mut clock = clock(name, "", &[("tz", "UTC")]);
        assert_eq!(read(&mut clock, first), Ok(0.0), "{name} {first}");
        let seconds = read(&mut clock, second).unwrap();
        assert!((seconds - 1.0).abs() < 1e-4, "{name} {seconds}");
        assert_eq!(start(&clock), "2024-03-02T12:00:00Z", "{name} {first}");
        assert_eq!(clock.notes()[0].code, "time_unit_from_size");
    }
    let asked = [
        ("time", "", "739313.5", "datenum"),
        ("time", "", "2460372", "julian"),
        ("time", "", "3792225600", "labview"),
        ("time", "s", "3792225600", "labview"),
    ];
    for (name, unit, number, option) in asked {
        let mut open = clock(name, unit, &[]);
        assert_eq!(read(&mut open, number), Err("time_unit_needed"), "{number}");
        let mut said = clock(name, unit, &[("time_unit", option), ("tz", "UTC")]);
        assert_eq!(read(&mut said, number), Ok(0.0), "{number}");
        assert_eq!(start(&said), "2024-03-02T12:00:00Z", "{number}");
    }
    let mut seconds = clock("time", "", &[("time_unit", "s")]);
    assert_eq!(read(&mut seconds, "739313.5"), Ok(0.0));
    assert_eq!(read(&mut seconds, "739314.5"), Ok(1.0));
}

#[test]
fn serial_days_are_local_times() {
    let mut clock = clock("Date", "", &[("tz", "Europe/Berlin")]);
    assert_eq!(read(&mut clock, "45353.5"), Ok(0.0));
    assert_eq!(read(&mut clock, "45353.50001157407"), Ok(1.0));
    assert_eq!(start(&clock), "2024-03-02T11:00:00Z");
    assert_eq!(clock.zone().as_deref(), Some("Europe/Berlin"));
}

#[test]
fn timestamps_with_different_offsets_are_compared_as_instants() {
    let mut clock = clock("t", "", &[]);
    assert_eq!(read(&mut clock, "2026-03-02T09:15:00+01:00"), Ok(0.0));
    assert_eq!(
        read(&mut clock, "2026-03-02T08:15:00.2500001Z"),
        Ok(0.250_000_1)
    );
    assert_eq!(start(&clock), "2026-03-02T08:15:00Z");
    assert_eq!(clock.zone().as_deref(), Some("+01:00"));
}

#[test]
fn a_timestamp_that_could_be_anywhere_needs_a_zone() {
    for text in [
        "2026-03-02T08:15:00",
        "2026-03-02 08:15:00",
        "2026-03-02",
        "02.03.2026 08:15",
    ] {
        let mut unknown = clock("", "", &[]);
        assert_eq!(read(&mut unknown, text), Err("no_offset"), "{text}");
    }
    let mut clock = clock("", "", &[("tz", "Europe/Berlin")]);
    assert_eq!(read(&mut clock, "02.03.2026 08:15"), Ok(0.0));
    assert_eq!(start(&clock), "2026-03-02T07:15:00Z");
}

#[test]
fn the_hour_that_comes_twice_is_told_apart_by_its_order() {
    let mut clock = clock("t", "", &[("tz", "Europe/Berlin")]);
    let hours = ["01:30", "02:00", "02:30", "02:00", "02:30", "03:00"];
    let mut before = None;
    let seconds = hours.map(|hour| {
        let stamp = format!("2026-10-25 {hour}:00");
        before = clock.read(&Cell::Text(&stamp), before).ok();
        before.unwrap()
    });
    assert_eq!(seconds, [0.0, 1800.0, 3600.0, 5400.0, 7200.0, 9000.0]);
    assert_eq!(clock.notes()[0].code, "daylight_saving_fold");
    assert_eq!(clock.double_hour(0.0), None);
    assert_eq!(
        read(&mut clock, "2026-03-29 02:30:00"),
        Err("no_such_local_time")
    );
}

#[test]
fn the_hour_that_comes_twice_is_open_where_no_order_tells_its_passes_apart() {
    let mut clock = clock("t", "", &[("tz", "Europe/Berlin")]);
    for (hour, seconds) in [("02:10", 0.0), ("02:50", 2400.0), ("03:10", 7200.0)] {
        assert_eq!(
            read(&mut clock, &format!("2026-10-25 {hour}:00")),
            Ok(seconds)
        );
    }
    let hour = clock.double_hour(0.0).expect("it is open");
    let end: Timestamp = "2026-10-25T01:00:00Z".parse().unwrap();
    assert_eq!(i128::from(hour.end_ns), end.as_nanosecond());
    assert_eq!(hour.length_ns, 3600 * 1_000_000_000);
    assert_eq!(clock.double_hour(3600.0), None, "it begins after the hour");
}

#[test]
fn stamps_that_a_double_cannot_tell_are_said_to_be_rounded() {
    for (last, code) in [
        ("2026-03-02T08:15:00.123456789Z", None),
        ("2026-07-02T08:15:00.1234567Z", None),
        ("2026-07-02T08:15:00.123456789Z", Some("rounded_stamps")),
    ] {
        let mut clock = clock("t", "", &[]);
        read(&mut clock, "2026-03-02T08:15:00Z").unwrap();
        read(&mut clock, last).unwrap();
        let notes = clock.notes();
        assert_eq!(notes.first().map(|note| note.code.as_str()), code, "{last}");
    }
}

#[test]
fn what_comes_later_tells_whether_the_day_comes_first() {
    let times = ["02/03/2026 08:15", "02/13/2026 08:15"];
    let mut clock = clock("t", "", &[("tz", "UTC")]);
    clock.look_ahead(times.into_iter());
    assert_eq!(read(&mut clock, times[0]), Ok(0.0));
    assert_eq!(start(&clock), "2026-02-03T08:15:00Z");
}

#[test]
fn a_unit_that_is_no_time_is_refused() {
    assert_eq!(read(&mut clock("t", "mm", &[]), "0.0"), Err("unknown_unit"));
    let mut stamped = clock("t", "s", &[]);
    assert_eq!(
        read(&mut stamped, "2026-03-02T08:15:00Z"),
        Err("unknown_unit")
    );
}

#[test]
fn numbers_that_are_a_date_of_digits_are_told_to_be_one() {
    let mut zoned = clock("time", "", &[("tz", "Europe/Berlin")]);
    assert_eq!(read(&mut zoned, "20260302081540"), Ok(0.0));
    assert_eq!(read(&mut zoned, "20260302081600"), Ok(20.0));
    assert_eq!(
        zoned.read(&Cell::Integer(20_260_302_081_700), None),
        Ok(80.0)
    );
    assert_eq!(read(&mut zoned, "20260302081660"), Err("not_a_time"));
    assert_eq!(start(&zoned), "2026-03-02T07:15:40Z");
    assert_eq!(zoned.notes()[0].code, "time_unit_from_size");
    let mut unzoned = clock("ts", "", &[]);
    assert_eq!(read(&mut unzoned, "20260302081540"), Err("no_offset"));
    for (unit, option) in [("ms", &[][..]), ("", &[("time_unit", "ms")])] {
        let mut counted = clock("time", unit, option);
        assert_eq!(read(&mut counted, "20260302081540"), Ok(0.0));
        assert_eq!(read(&mut counted, "20260302081600"), Ok(0.06));
    }
    let mut thirteenth_month = clock("ts", "", &[]);
    assert_eq!(
        read(&mut thirteenth_month, "20261302081540"),
        Err("time_unit_needed")
    );
}

#[test]
fn times_with_a_unit_of_their_own_are_read_where_no_other_stands_in_the_title() {
    let mut durations = clock("Time", "", &[]);
    assert_eq!(read(&mut durations, "500 ms"), Ok(0.0));
    assert_eq!(read(&mut durations, "1 sec"), Ok(0.5));
    assert_eq!(read(&mut durations, "2"), Err("not_a_time"));
    assert!(durations.notes().is_empty());
    assert_eq!(read(&mut clock("t", "s", &[]), "1.5 s"), Ok(0.0));
    assert_eq!(
        read(&mut clock("t", "ms", &[]), "1.5 s"),
        Err("unknown_unit")
    );
    let mut clocks = clock("Time", "", &[]);
    assert_eq!(read(&mut clocks, "00:59.5"), Ok(0.0));
    assert_eq!(read(&mut clocks, "01:00.0"), Ok(0.5));
    assert_eq!(clocks.notes()[0].code, "times_without_date");
}

#[test]
fn a_zone_may_be_an_offset() {
    let mut clock = clock("t", "", &[("tz", "-05:30")]);
    assert_eq!(read(&mut clock, "02.03.2026 08:15:00"), Ok(0.0));
    assert_eq!(start(&clock), "2026-03-02T13:45:00Z");
    assert_eq!(clock.zone().as_deref(), Some("-05:30"));
}
