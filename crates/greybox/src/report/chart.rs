//! Line charts as SVG, in a page or as a file.

use super::html::{escape, push};
use greybox_numerics::digits::short;

const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 230.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 18.0;
const BOTTOM: f64 = 34.0;

/// How the parts of a chart are drawn.
pub const STYLE: &str = include_str!("chart.css");

/// One line of a chart.
#[derive(Debug)]
pub struct Series<'a> {
    /// What the line shows.
    pub name: &'a str,
    /// The colour of the line.
    pub colour: &'a str,
    /// The points of the line; a value that is not a number breaks the line.
    pub points: Vec<(f64, f64)>,
}

/// A chart.
#[derive(Debug, Default)]
pub struct Chart<'a> {
    /// What is along the bottom.
    pub x_label: &'a str,
    /// What is up the side.
    pub y_label: &'a str,
    /// The lines.
    pub series: Vec<Series<'a>>,
    /// Dashed lines across.
    pub levels: Vec<f64>,
    /// Dashed lines up, with what they stand for.
    pub marks: Vec<(f64, &'a str)>,
    /// Whether each point is a bar from zero.
    pub bars: bool,
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

    /// Round numbers, about five of them.
    fn ticks(&self) -> Vec<f64> {
        let rough = (self.high - self.low) / 5.0;
        let decade = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|factor| factor * decade)
            .find(|step| *step >= rough)
            .unwrap_or(rough);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last).map(|k| k as f64 * step).collect()
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
        push(
            page,
            format_args!(
                "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{} over {}\">\n",
                escape(self.y_label),
                escape(self.x_label)
            ),
        );
        self.draw_axes(page, &x, &y);
        for level in &self.levels {
            let at = y.place(*level);
            let (from, to) = (x.from, x.to);
            push(
                page,
                format_args!("<path class=\"limit\" d=\"M{from:.1} {at:.1}H{to:.1}\"/>\n"),
            );
        }
        for (value, words) in &self.marks {
            let at = x.place(*value);
            push(
                page,
                format_args!(
                    "<path class=\"limit\" d=\"M{at:.1} {TOP}V{:.1}\"/><text class=\"tick\" \
                     x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
                    HEIGHT - BOTTOM,
                    at + 4.0,
                    HEIGHT - BOTTOM - 5.0,
                    escape(words)
                ),
            );
        }
        for series in &self.series {
            let path = if self.bars {
                bars(series, &x, &y)
            } else {
                line(series, &x, &y)
            };
            push(
                page,
                format_args!(
                    "<path class=\"series\" stroke=\"{}\" d=\"{path}\"/>\n",
                    series.colour
                ),
            );
        }
        self.draw_legend(page);
        page.push_str("</svg>\n");
    }

    fn axes(&self) -> Option<(Axis, Axis)> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let drawn = || points().filter(|(x, y)| x.is_finite() && y.is_finite());
        let (left, right) = extent(drawn().map(|(x, _)| *x))?;
        let zero = self.bars.then_some(0.0);
        let heights = drawn()
            .map(|(_, y)| *y)
            .chain(self.levels.iter().copied())
            .chain(zero);
        let (low, high) = extent(heights)?;
        let margin = 0.04 * (high - low);
        let x = Axis {
            low: left,
            high: right,
            from: LEFT,
            to: WIDTH - RIGHT,
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
        push(
            page,
            format_args!(
                "<path class=\"axis\" d=\"M{LEFT} {TOP}V{0:.1}H{1:.1}\"/>\n",
                HEIGHT - BOTTOM,
                WIDTH - RIGHT
            ),
        );
        for tick in x.ticks() {
            let (at, below) = (x.place(tick), HEIGHT - BOTTOM + 14.0);
            push(
                page,
                format_args!(
                    "<text class=\"tick\" text-anchor=\"middle\" x=\"{at:.1}\" y=\"{below:.1}\">\
                     {}</text>\n",
                    short(tick, 4)
                ),
            );
        }
        for tick in y.ticks() {
            let at = y.place(tick);
            push(
                page,
                format_args!(
                    "<path class=\"axis\" d=\"M{LEFT} {at:.1}h-4\"/><text class=\"tick\" \
                     text-anchor=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
                    LEFT - 7.0,
                    at + 4.0,
                    short(tick, 4)
                ),
            );
        }
        push(
            page,
            format_args!(
                "<text class=\"tick\" x=\"{LEFT}\" y=\"11\">{}</text><text class=\"tick\" \
                 text-anchor=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
                escape(self.y_label),
                WIDTH - RIGHT,
                HEIGHT - 5.0,
                escape(self.x_label)
            ),
        );
    }

    fn draw_legend(&self, page: &mut String) {
        if self.series.len() < 2 {
            return;
        }
        for (place, series) in self.series.iter().enumerate() {
            let at = WIDTH - RIGHT - 110.0 * (self.series.len() - place) as f64;
            push(
                page,
                format_args!(
                    "<path stroke=\"{}\" stroke-width=\"3\" d=\"M{at:.1} 7h16\"/><text \
                     class=\"tick\" x=\"{:.1}\" y=\"11\">{}</text>\n",
                    series.colour,
                    at + 21.0,
                    escape(series.name)
                ),
            );
        }
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
