//! Likelihood profiles: how far the sum of squares rises as an estimate is held at another value and all other
//! estimates are fitted again.

use super::chart::{Chart, ChartSize, Series, SeriesLook};
use super::html::{labelled, push, to_spread, unit_cell};
use super::markdown_text::cell;
use super::plots::figure;
use crate::identification::outcome::{Estimate, Outcome, ProfilePoint};
use greybox_numerics::digits::short;

/// Points of the curve between two fits.
const BETWEEN: u32 = 24;

/// A profile has this many fits at the least: one on each side of the estimate.
const FEWEST: usize = 3;

const WORDS: &str = "All other estimates are fitted again while this one is held (dots). The interval ends where \
                     the curve reaches 1; a parabola means that it is symmetric, a side that stays low that the \
                     data leave it open.";

/// An estimate that has a profile.
struct Profiled<'a> {
    label: String,
    unit: &'a str,
    estimate: &'a Estimate,
}

impl Profiled<'_> {
    /// The probability at which the interval ends, as a percentage.
    fn level(&self) -> String {
        let interval = self.estimate.confidence_interval.as_ref();
        let level = interval.map_or(0.95, |interval| interval.level);
        format!("{} %", short(100.0 * level, 4))
    }

    fn value(&self, point: &ProfilePoint) -> String {
        let profile = &self.estimate.profile;
        let ends = profile.first().zip(profile.last());
        let spread = ends.map(|(first, last)| 0.5 * (last.value - first.value));
        to_spread(point.value, spread)
    }
}

fn profiled(outcome: &Outcome) -> Vec<Profiled<'_>> {
    let parameters = outcome.parameters.iter().map(|parameter| Profiled {
        label: parameter.label(),
        unit: &parameter.unit,
        estimate: &parameter.estimate,
    });
    let states = outcome.initial_states.iter().map(|state| Profiled {
        label: state.label(),
        unit: &state.unit,
        estimate: &state.estimate,
    });
    let all = parameters.chain(states);
    all.filter(|profiled| profiled.estimate.profile.len() >= FEWEST)
        .collect()
}

/// A chart for each estimate that has a profile; nothing where none has.
pub fn section(page: &mut String, outcome: &Outcome) {
    let profiled = profiled(outcome);
    if profiled.is_empty() {
        return;
    }
    push(
        page,
        format_args!(
            "<section>\n<h2>Likelihood profiles</h2>\n<p class=\"muted\">{WORDS}</p>\n<div class=\"charts\">\n"
        ),
    );
    for profiled in profiled {
        let (x_label, level) = (labelled(&profiled.label, profiled.unit), profiled.level());
        let y_label = format!("rise [1 = {level}]");
        let fits = profiled.estimate.profile.iter();
        let series = |colour, look, points| Series {
            colour,
            look,
            points,
            ..Series::default()
        };
        let chart = Chart {
            size: ChartSize::Third,
            x_label: &x_label,
            y_label: &y_label,
            series: vec![
                series(
                    "#2b6cb0",
                    SeriesLook::Line,
                    curve(&profiled.estimate.profile),
                ),
                series(
                    "#c8462f",
                    SeriesLook::Dots,
                    fits.map(|point| (point.value, point.excess)).collect(),
                ),
            ],
            levels: vec![(1.0, &level)],
            ..Chart::default()
        };
        figure(page, &chart, "");
    }
    page.push_str("</div>\n</section>\n");
}

/// The fits of each profile in Markdown; nothing where no estimate has one.
pub fn markdown(text: &mut String, outcome: &Outcome) {
    let profiled = profiled(outcome);
    if profiled.is_empty() {
        return;
    }
    push(
        text,
        format_args!(
            "\n## Likelihood profiles\n\n{}\n\n| estimate | unit | held at (rise, 1 = end of the interval) | \
             interval |\n|---|---|---|---|\n",
            WORDS.replace(" (dots)", "")
        ),
    );
    for profiled in profiled {
        let fits = profiled.estimate.profile.iter();
        let fits =
            fits.map(|point| format!("{} ({})", profiled.value(point), short(point.excess, 3)));
        push(
            text,
            format_args!(
                "| {} | {} | {} | {} |\n",
                cell(&profiled.label),
                cell(unit_cell(profiled.unit)),
                fits.collect::<Vec<_>>().join(", "),
                profiled.level()
            ),
        );
    }
}

/// The curve through the fits. The root of the rise is nearly straight in the value, so the root is drawn straight
/// between two fits.
fn curve(profile: &[ProfilePoint]) -> Vec<(f64, f64)> {
    let least = |a: &&ProfilePoint, b: &&ProfilePoint| a.excess.total_cmp(&b.excess);
    let middle = profile
        .iter()
        .min_by(least)
        .map_or(0.0, |point| point.value);
    let root =
        |point: &ProfilePoint| point.excess.max(0.0).sqrt() * (point.value - middle).signum();
    let mut points = Vec::new();
    for pair in profile.windows(2) {
        for part in 0..BETWEEN {
            let share = f64::from(part) / f64::from(BETWEEN);
            let between = |from: f64, to: f64| from + share * (to - from);
            let rise = between(root(&pair[0]), root(&pair[1])).powi(2);
            points.push((between(pair[0].value, pair[1].value), rise));
        }
    }
    points.extend(profile.last().map(|point| (point.value, point.excess)));
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_between_fits_of_a_parabola_is_the_parabola() {
        let fits = [-1.2, -0.5, 0.0, 0.7, 1.1];
        let profile = fits.map(|value: f64| ProfilePoint {
            value: 3.0 + value,
            excess: value.powi(2),
        });
        let curve = curve(&profile);
        assert_eq!(curve.len(), 4 * BETWEEN as usize + 1);
        for (value, rise) in curve {
            assert!(
                (rise - (value - 3.0).powi(2)).abs() < 1e-12,
                "{value}: {rise}"
            );
        }
    }
}
