//! The windows of a monitor as a table.

use std::fmt::Write as _;

use crate::monitor::ShownWindow;
use crate::monitor::record::WindowStatus;
use greybox::identification::outcome::Trust;

/// A row for each window, the parameters of the newest that has any as columns. What is absent is
/// an empty field.
pub(super) fn table(windows: &[ShownWindow]) -> String {
    let estimated = windows
        .iter()
        .find(|shown| shown.window.status == WindowStatus::Estimated);
    let parameters = estimated.map_or(&[][..], |shown| &shown.window.parameters);
    let mut text = "window,from,to,status,trust".to_owned();
    for parameter in parameters {
        let name = &parameter.name;
        write!(
            text,
            ",{name},{name}_standard_error,{name}_lower,{name}_upper,{name}_total_lower,\
             {name}_total_upper"
        )
        .expect("writing to a string does not fail");
    }
    text.push('\n');
    for shown in windows {
        let window = &shown.window;
        let trust = window.trust.map(Trust::name);
        let (from, to, status) = (window.from, window.to, window.status.as_str());
        let trust = trust.unwrap_or_default();
        write!(text, "{},{from},{to},{status},{trust}", window.number)
            .expect("writing to a string does not fail");
        for column in parameters {
            let estimate = window
                .parameters
                .iter()
                .find(|estimate| estimate.name == column.name);
            let interval = estimate.and_then(|estimate| estimate.confidence_interval.as_ref());
            let total = estimate.and_then(|estimate| estimate.total_interval);
            let fields = [
                estimate.map(|estimate| estimate.estimate),
                estimate.and_then(|estimate| estimate.standard_error),
                interval.and_then(|interval| interval.lower),
                interval.and_then(|interval| interval.upper),
                total.and_then(|total| total.lower),
                total.and_then(|total| total.upper),
            ];
            for field in fields {
                text.push(',');
                text.extend(field.map(|value| value.to_string()));
            }
        }
        text.push('\n');
    }
    text
}
