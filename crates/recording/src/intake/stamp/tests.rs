//! Dates of many countries and programs, and what is no date.

use super::*;
use proptest::prelude::*;

fn local(text: &str, day_first: Option<bool>) -> Result<Stamp, &'static str> {
    parse(text, day_first).map_err(|(code, _)| code)
}

#[test]
fn dates_of_many_countries_are_one_time() {
    let expected: DateTime = "2026-03-02T20:15:00.5".parse().unwrap();
    for (text, day_first) in [
        ("2026-03-02 20:15:00.5", None),
        ("2026/03/02 20:15:00.5", None),
        ("02.03.2026 20:15:00,5", None),
        ("2.3.26 20:15:00.5", None),
        ("02-Mar-2026 20:15:00.5", None),
        ("02-Mär-26 20:15:00.5", None),
        ("02-Mrz-26 20:15:00.5", None),
        ("03/02/2026 8:15:00.5 PM", Some(false)),
        ("02/03/2026 20:15:00.5", Some(true)),
        ("02/03/2026 20.15.00,5", Some(true)),
        ("2.3.2026 20.15.00.5", None),
        ("02-MAR-26 08.15.00.500000000 PM", None),
        ("20:15:00.5 02.03.2026", None),
        ("8:15:00.5 PM 03/02/2026", Some(false)),
        ("2026-03-02 PM 8:15:00.5", None),
        ("2026-03-02 오후 8:15:00.5", None),
        ("2026-03-02 20:15:00;500", None),
        ("2026年03月02日 20:15:00.5", None),
        ("2026年3月2日 20时15分00.5秒", None),
        ("20260302T201500.5", None),
        ("20260302 201500.5", None),
        ("20260302201500500", None),
        ("2026-061T20:15:00.5", None),
        ("DTL#2026-03-02-20:15:00.5", None),
        ("dt#2026-03-02-20:15:00.5", None),
        ("'26-03-02 20:15:00.5", None),
        ("'2026-03-02 20:15:00.5", None),
        ("'02.03.2026 20:15:00.5", None),
        ("Mar 2 2026 20:15:00.5", None),
        ("Mar 2, 2026 8:15:00.5PM", None),
        ("2. März 2026 20:15:00.5", None),
        ("Mon Mar  2 20:15:00.5 2026", None),
    ] {
        assert_eq!(local(text, day_first), Ok(Stamp::Local(expected)), "{text}");
    }
}

#[test]
fn zones_of_programs_are_offsets() {
    let expected: Timestamp = "2026-03-02T08:15:00Z".parse().unwrap();
    for text in [
        "2026-03-02T09:15:00+01:00",
        "2026-03-02 08:15:00 +0000 UTC",
        "2026-03-02 09:15:00 +0100 CET",
        "2026-03-02 03:15:00 -0500 EST",
        "2026-03-02 09:15:00.0 +01",
        "Mon, 02 Mar 2026 08:15:00 GMT",
        "Monday, 02-Mar-26 08:15:00 GMT",
        "Mon Mar 02 2026 09:15:00 GMT+0100 (Central European Standard Time)",
        "Mon Mar 02 09:15:00 CET 2026",
        "20260302T081500.000Z",
        "20260302T0815Z",
        "2026-061T09:15:00+01:00",
        "2026-03-02T03:15:00-05:00 New_York",
        "2026-03-02T09:15:00+01:00[Europe/Berlin]",
        "02.03.2026 09:15:00+0100",
    ] {
        let Ok(Stamp::Instant(instant, _)) = local(text, None) else {
            panic!("{text}: {:?}", local(text, None));
        };
        assert_eq!(instant, expected, "{text}");
    }
    let lettered = local("Mon Mar 02 09:15:00 IST 2026", None);
    assert!(matches!(lettered, Ok(Stamp::Lettered(_, letters)) if letters == "IST"));
}

#[test]
fn the_end_of_a_day_is_the_beginning_of_the_next() {
    for text in ["2025-12-31 24:00:00", "31.12.2025 24:00"] {
        let midnight: DateTime = "2026-01-01T00:00:00".parse().unwrap();
        assert_eq!(local(text, None), Ok(Stamp::Local(midnight)), "{text}");
    }
    assert_eq!(local("2025-12-31 24:00:01", None), Err("not_a_time"));
}

#[test]
fn what_is_no_date_is_refused() {
    for text in [
        "yesterday-ish",
        "31/02/2026",
        "29.02.2026 08:15",
        "2026-061",
        "2026-366T08:15:00Z",
        "2026-000T08:15:00Z",
        "10.1.2.3",
        "Mar 02 03 08:15",
        "2026-03-02 09:15:00 +0100 UTC",
        "2026-03-02 5:15:00 PM PM",
        "13:15:00 AM 02.03.2026",
        "2026-03-02 09:15:00 New_York",
        "Mon Mar 02 2026 09:15:00 (Central European Standard Time)",
        "11.10 12.09.08",
        "2026-03-02 08.5",
        "20261302T081500Z",
        "2026-03-02 08:15:00;5",
        "PT101",
        "12:30",
        "年",
        "'",
        "#",
        "",
    ] {
        assert_eq!(local(text, Some(true)), Err("not_a_time"), "{text}");
        assert!(!is_one(text), "{text}");
    }
}

#[test]
fn a_date_of_two_meanings_is_asked_about() {
    for text in [
        "02/03/2026",
        "02/03/2026 10.15.00",
        "08:15:01 02/03/2026",
        "02-03-2026 08:15",
    ] {
        assert_eq!(local(text, None), Err("ambiguous_date"), "{text}");
    }
    assert_eq!(day_first("02/13/2026"), Some(false));
    assert_eq!(day_first("13/02/2026 8:00"), Some(true));
    assert_eq!(day_first("13/02/2026 8.00.00"), Some(true));
}

#[test]
fn numbers_and_names_are_no_dates() {
    for text in [
        "-1,0e-03",
        "1.452×10^-3",
        "−1.5",
        "20260302",
        "20260302081500",
        "1 452 000",
    ] {
        assert!(!looks_like_one(text), "{text}");
    }
    for text in [
        "1001-101",
        "PT-101",
        "PT1H",
        "START 02.03.2026",
        "Pump 1 (2)",
        "May 2026",
    ] {
        assert!(!is_one(text), "{text}");
    }
    assert!(is_date("02 Mar 2026") && is_date("2026-03-02"));
    assert!(!is_date("23/04/2026 10.15.00") && !is_date("08:15:00"));
    assert!(is_of_digits("20260302081500") && is_of_digits("20260302081500123"));
    for text in [
        "20261302081500",
        "20260302",
        "18260302081500",
        "20260302T081500",
        "202603020815",
    ] {
        assert!(!is_of_digits(text), "{text}");
    }
}

#[test]
fn serial_days_count_from_the_thirtieth_of_december_1899() {
    // 45353.5 is noon of 2024-03-02 in every spreadsheet.
    let noon = from_serial_days((45_353.5 * 86_400e6) as i64).unwrap();
    assert_eq!(noon, "2024-03-02T12:00:00".parse().unwrap());
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_of_a_time_panic(
        text in prop_oneof![".{0,30}", "[0-9:;.,/ T#'年月日apmPMZ+()_-]{0,30}", "(DT|T|P|PT|'|-)?#?[0-9.:-]{0,20}[ A-Za-z年]{0,5}"],
    ) {
        let is_date = is_one(&text) && span(&text, None).is_none();
        let is_read = parse(&text, Some(true)).is_ok() || parse(&text, Some(false)).is_ok();
        prop_assert!(!is_date || is_read, "{text}");
        let _ = (super::is_date(&text), is_of_digits(&text), value::number(&text, None));
    }
}
