//! Line charts as SVG, in a page or as a file.

use super::html::{escape, push};
use greybox_numerics::digits::short;

const HEIGHT: f64 = 240.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 28.0;
const BOTTOM: f64 = 44.0;

/// Letters on a narrow page have this share of a chart's width, so that they can be read there.
const NARROW_LETTERS: f64 = 0.022;

/// How the parts of a chart are drawn.
pub const STYLE: &str = include_str!("chart.css");

/// How much of a line of the page a chart takes; all of a line on a narrow one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChartSize {
    /// All of it.
    #[default]
    Whole,
    /// Two thirds, with another chart of a third beside it.
    TwoThirds,
    /// A half.
    Half,
    /// A third.
    Third,
}

impl ChartSize {
    /// The width in units of which the height of all charts has as many.
    fn width(self) -> f64 {
        match self {
            ChartSize::Whole => 900.0,
            ChartSize::TwoThirds => 595.0,
            ChartSize::Half => 445.0,
            ChartSize::Third => 295.0,
        }
    }

    /// The class of a figure of this size.
    #[must_use]
    pub fn class(self) -> &'static str {
        match self {
            ChartSize::Whole => "whole",
            ChartSize::TwoThirds => "two-thirds",
            ChartSize::Half => "half",
            ChartSize::Third => "third",
        }
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SeriesLook {
    /// Straight from point to point.
    #[default]
    Line,
    /// Each point is a bar from zero.
    Bars,
    /// Each point is a dot.
    Dots,
}

/// One line of a chart.
#[derive(Debug, Default)]
pub struct Series<'a> {
    /// What the line shows; a series without a name is not in the legend.
    pub name: &'a str,
    /// The colour of the line.
    pub colour: &'a str,
    /// How the points are drawn.
    pub look: SeriesLook,
    /// The points of the line; a value that is not a number breaks the line.
    pub points: Vec<(f64, f64)>,
}

/// A chart.
#[derive(Debug, Default)]
pub struct Chart<'a> {
    /// How much of a line the chart takes.
    pub size: ChartSize,
    /// What is along the bottom.
    pub x_label: &'a str,
    /// What is up the side.
    pub y_label: &'a str,
    /// The lines.
    pub series: Vec<Series<'a>>,
    /// Dashed lines across, with what they stand for.
    pub levels: Vec<(f64, &'a str)>,
    /// Dashed lines up, with what they stand for.
    pub marks: Vec<(f64, &'a str)>,
    /// A stretch along the bottom that is shaded.
    pub shaded: Option<[f64; 2]>,
}

/// The range of an axis and its place on the page.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn place(&self, value: f64) -> f64 {
        self.from + (self.to - self.from) * (value - self.low) / (self.high - self.low)
    }

    /// Round numbers, about as many as `count` says, with enough digits to tell them apart.
    fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        let rough = (self.high - self.low) / count;
        let decade = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|factor| factor * decade)
            .find(|step| *step >= rough)
            .unwrap_or(rough);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        let largest = self.low.abs().max(self.high.abs());
        let digits = (largest / step).log10().floor().clamp(2.0, 14.0) as usize + 2;
        let ticks = (first..=last).map(|k| k as f64 * step);
        ticks.map(|tick| (tick, short(tick, digits))).collect()
    }
}

impl Chart<'_> {
    /// The chart as a file of its own; nothing where there is nothing to draw.
    #[must_use]
    pub fn file(&self) -> String {
        let mut drawn = String::new();
        self.draw(&mut drawn);
        let drawn = drawn.replacen("<svg ", "<svg xmlns=\"http://www.w3.org/2000/svg\" ", 1);
        drawn.replacen(">\n", &format!(">\n<style>\n{STYLE}</style>\n"), 1)
    }

    /// Draws the chart on a page; nothing where there is nothing to draw.
    pub fn draw(&self, page: &mut String) {
        let Some((x, y)) = self.axes() else {
            return;
        };
        let width = self.size.width();
        push(
            page,
            format_args!(
                "<svg viewBox=\"0 0 {width} {HEIGHT}\" style=\"--narrow: {:.1}px\" role=\"img\" \
                 aria-label=\"{} over {}\">\n",
                width * NARROW_LETTERS,
                escape(self.y_label),
                escape(self.x_label)
            ),
        );
        self.draw_axes(page, &x, &y);
        self.draw_limits(page, &x, &y);
        for series in &self.series {
            let path = match series.look {
                SeriesLook::Line => line(series, &x, &y),
                SeriesLook::Bars => bars(series, &x, &y),
                SeriesLook::Dots => dots(series, &x, &y),
            };
            let look = match series.look {
                SeriesLook::Dots => "series dots",
                _ => "series",
            };
            push(
                page,
                format_args!(
                    "<path class=\"{look}\" stroke=\"{}\" d=\"{path}\"/>\n",
                    series.colour
                ),
            );
        }
        self.draw_legend(page);
        page.push_str("</svg>\n");
    }

    /// Draws the shaded stretch, and the dashed lines with their words.
    fn draw_limits(&self, page: &mut String, x: &Axis, y: &Axis) {
        if let Some(ends) = self.shaded {
            let [from, to] = ends.map(|end| x.place(end));
            let (bottom, width) = (HEIGHT - BOTTOM, to - from);
            push(
                page,
                format_args!(
                    "<path class=\"shaded\" d=\"M{from:.1} {TOP}V{bottom:.1}h{width:.1}V{TOP}z\"/>\n"
                ),
            );
        }
        for (level, words) in &self.levels {
            let (from, at, to) = (x.from, y.place(*level), x.to);
            push(
                page,
                format_args!("<path class=\"limit\" d=\"M{from:.1} {at:.1}H{to:.1}\"/>"),
            );
            text(page, "middle", [0.5 * (from + to), at], "-.3em", words);
        }
        for (value, words) in &self.marks {
            let (at, bottom) = (x.place(*value), HEIGHT - BOTTOM);
            push(
                page,
                format_args!("<path class=\"limit\" d=\"M{at:.1} {TOP}V{bottom:.1}\"/>"),
            );
            text(page, "start", [at + 4.0, bottom], "-.4em", words);
        }
    }

    fn axes(&self) -> Option<(Axis, Axis)> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let drawn = || points().filter(|(x, y)| x.is_finite() && y.is_finite());
        let (left, right) = extent(drawn().map(|(x, _)| *x))?;
        let has_bars = self
            .series
            .iter()
            .any(|series| series.look == SeriesLook::Bars);
        let zero = has_bars.then_some(0.0);
        let heights = drawn()
            .map(|(_, y)| *y)
            .chain(self.levels.iter().map(|(level, _)| *level))
            .chain(zero);
        let (low, high) = extent(heights)?;
        let margin = 0.04 * (high - low);
        let x = Axis {
            low: left,
            high: right,
            from: LEFT,
            to: self.size.width() - RIGHT,
        };
        let y = Axis {
            low: low - margin,
            high: high + margin,
            from: HEIGHT - BOTTOM,
            to: TOP,
        };
        Some((x, y))
    }

    fn draw_axes(&self, page: &mut String, x: &Axis, y: &Axis) {
        let (bottom, right) = (HEIGHT - BOTTOM, x.to);
        push(
            page,
            format_args!("<path class=\"axis\" d=\"M{LEFT} {TOP}V{bottom:.1}H{right:.1}\"/>\n"),
        );
        for (tick, digits) in x.ticks(((right - LEFT) / 150.0).max(4.0)) {
            text(page, "middle", [x.place(tick), bottom], "1.2em", &digits);
        }
        for (tick, digits) in y.ticks(5.0) {
            let at = y.place(tick);
            push(
                page,
                format_args!("<path class=\"axis\" d=\"M{LEFT} {at:.1}h-4\"/>"),
            );
            text(page, "end", [LEFT - 7.0, at], ".35em", &digits);
        }
        text(page, "start", [LEFT, 0.0], "1em", self.y_label);
        text(page, "end", [right, HEIGHT], "-.3em", self.x_label);
    }

    fn draw_legend(&self, page: &mut String) {
        let letter = 0.56 * (self.size.width() * NARROW_LETTERS).max(11.0);
        let mut at = self.size.width() - RIGHT;
        let named = self.series.iter().filter(|series| !series.name.is_empty());
        for series in named.rev() {
            at -= 34.0 + letter * series.name.chars().count() as f64;
            push(
                page,
                format_args!(
                    "<path stroke=\"{}\" stroke-width=\"3\" d=\"M{at:.1} 8h16\"/>",
                    series.colour
                ),
            );
            text(page, "start", [at + 21.0, 0.0], "1em", series.name);
        }
    }
}

/// Words of a chart at a place, moved down by `dy`; nothing where there are none.
fn text(page: &mut String, anchor: &str, [x, y]: [f64; 2], dy: &str, words: &str) {
    if !words.is_empty() {
        push(
            page,
            format_args!(
                "<text class=\"tick\" text-anchor=\"{anchor}\" x=\"{x:.1}\" y=\"{y:.1}\" dy=\"{dy}\">{}</text>\n",
                escape(words)
            ),
        );
    }
}

/// The least and the largest, never the same.
fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    if low > high {
        return None;
    }
    let width = (high - low).max(1e-9 * high.abs()).max(f64::MIN_POSITIVE);
    Some(if high > low {
        (low, high)
    } else {
        (low - width, high + width)
    })
}

fn line(series: &Series<'_>, x: &Axis, y: &Axis) -> String {
    let mut path = String::new();
    let mut is_down = false;
    for (along, up) in &series.points {
        let is_there = along.is_finite() && up.is_finite();
        if is_there {
            let command = if is_down { 'L' } else { 'M' };
            let (along, up) = (x.place(*along), y.place(*up));
            push(&mut path, format_args!("{command}{along:.1} {up:.1}"));
        }
        is_down = is_there;
    }
    path
}

fn bars(series: &Series<'_>, x: &Axis, y: &Axis) -> String {
    let mut path = String::new();
    let zero = y.place(0.0);
    for (along, up) in series.points.iter().filter(|(_, up)| up.is_finite()) {
        let (along, up) = (x.place(*along), y.place(*up));
        push(&mut path, format_args!("M{along:.1} {zero:.1}V{up:.1}"));
    }
    path
}

fn dots(series: &Series<'_>, x: &Axis, y: &Axis) -> String {
    let mut path = String::new();
    for (along, up) in series.points.iter().filter(|(_, up)| up.is_finite()) {
        let (along, up) = (x.place(*along), y.place(*up));
        push(&mut path, format_args!("M{along:.1} {up:.1}h0"));
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_of_a_narrow_range_far_from_zero_are_told_apart() {
        let axis = Axis {
            low: 2999.94,
            high: 3000.09,
            from: 0.0,
            to: 1.0,
        };
        let ticks: Vec<String> = axis
            .ticks(4.0)
            .into_iter()
            .map(|(_, digits)| digits)
            .collect();
        assert_eq!(ticks, ["2999.95", "3000", "3000.05"]);
    }

    #[test]
    fn only_series_with_a_name_are_in_the_legend() {
        let series = |name| Series {
            name,
            points: vec![(0.0, 0.0), (1.0, 1.0)],
            ..Series::default()
        };
        let chart = Chart {
            series: vec![series("measured"), series("")],
            ..Chart::default()
        };
        let file = chart.file();
        assert_eq!(file.matches("stroke-width=\"3\"").count(), 1, "{file}");
        assert_eq!(file.matches("class=\"series\"").count(), 2, "{file}");
    }
}
