//! A line chart as SVG: axes with round ticks, a line for each series, a legend.

use std::fmt::Write;

/// How the values are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal steps, from zero.
    Linear,
    /// Equal ratios.
    Log,
}

/// One series.
#[derive(Clone, Debug)]
pub struct Line {
    /// What the legend says.
    pub name: String,
    /// Abscissa and value.
    pub points: Vec<(f64, f64)>,
}

/// The chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Above the chart.
    pub title: String,
    /// Below the chart.
    pub x_label: String,
    /// Beside the chart.
    pub y_label: String,
    /// How the values are laid out.
    pub y_scale: Scale,
    /// The series, the first drawn first.
    pub lines: Vec<Line>,
}

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 360.0;
/// The frame of the lines: left, right, top, bottom.
const FRAME: [f64; 4] = [72.0, 744.0, 36.0, 312.0];
/// A blue and an orange that the colour-blind can tell apart (M. Okabe, K. Ito, 2008).
const COLOURS: [&str; 2] = ["#e69f00", "#0072b2"];

/// Where a value goes.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn place(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }
}

impl Chart {
    /// The picture.
    pub fn svg(&self) -> String {
        let [left, right, top, bottom] = FRAME;
        let finite = |values: Vec<f64>| values.into_iter().filter(|value| value.is_finite());
        let all = || self.lines.iter().flat_map(|line| &line.points);
        let last = finite(all().map(|point| point.0).collect()).fold(1.0, f64::max);
        let values: Vec<f64> = finite(all().map(|point| self.scaled(point.1)).collect()).collect();
        let highest = values.iter().copied().fold(f64::MIN, f64::max);
        let lowest = values.iter().copied().fold(f64::MAX, f64::min);
        let x = Axis {
            low: 0.0,
            high: last,
            from: left,
            to: right,
        };
        let y = match self.y_scale {
            Scale::Linear => Axis {
                low: 0.0,
                high: 1.05 * highest,
                from: bottom,
                to: top,
            },
            Scale::Log => Axis {
                low: lowest.floor(),
                high: highest.ceil(),
                from: bottom,
                to: top,
            },
        };
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
             font-family=\"sans-serif\" font-size=\"12\">\n\
             <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"white\"/>\n"
        );
        svg += &self.texts();
        svg += &self.ticks(&x, &y);
        for (line, colour) in self.lines.iter().zip(COLOURS) {
            svg += &self.path(line, colour, &x, &y);
        }
        svg += &self.legend();
        svg + "</svg>\n"
    }

    fn scaled(&self, value: f64) -> f64 {
        match self.y_scale {
            Scale::Linear => value,
            Scale::Log => value.log10(),
        }
    }

    fn texts(&self) -> String {
        let [left, right, top, bottom] = FRAME;
        let (middle, centre) = ((left + right) / 2.0, (top + bottom) / 2.0);
        format!(
            "<text x=\"{left}\" y=\"20\" font-size=\"14\">{}</text>\n\
             <text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(18 {centre}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
            self.title,
            HEIGHT - 10.0,
            self.x_label,
            self.y_label
        )
    }

    fn ticks(&self, x: &Axis, y: &Axis) -> String {
        let [left, right, top, bottom] = FRAME;
        let mut svg =
            format!("<path d=\"M{left} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"#333\"/>\n");
        for value in round_values(x.high) {
            let at = x.place(value);
            let _ = writeln!(
                svg,
                "<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{value}</text>",
                bottom + 16.0
            );
        }
        let values: Vec<(f64, String)> = match self.y_scale {
            Scale::Linear => round_values(y.high)
                .map(|v| (v, format!("{}", (v * 1e6).round() / 1e6)))
                .collect(),
            Scale::Log => (y.low as i32..=y.high as i32)
                .map(|power| {
                    (
                        f64::from(power),
                        format!("10<tspan dy=\"-5\" font-size=\"9\">{power}</tspan>"),
                    )
                })
                .collect(),
        };
        for (value, text) in values {
            let at = y.place(value);
            let _ = write!(
                svg,
                "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#ddd\"/>\n\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>\n",
                left - 6.0,
                at + 4.0
            );
        }
        svg
    }

    fn path(&self, line: &Line, colour: &str, x: &Axis, y: &Axis) -> String {
        let mut path = String::new();
        let mut joins = false;
        for &(abscissa, value) in &line.points {
            let value = self.scaled(value);
            if !value.is_finite() {
                joins = false;
                continue;
            }
            let letter = if joins { 'L' } else { 'M' };
            let _ = write!(
                path,
                "{letter}{:.1} {:.1}",
                x.place(abscissa),
                y.place(value)
            );
            joins = true;
        }
        format!("<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.2\"/>\n")
    }

    fn legend(&self) -> String {
        let right = FRAME[1];
        let mut svg = String::new();
        for (place, (line, colour)) in self.lines.iter().zip(COLOURS).enumerate() {
            let y = FRAME[2] + 14.0 + 18.0 * place as f64;
            let _ = write!(
                svg,
                "<path d=\"M{} {}h24\" stroke=\"{colour}\" stroke-width=\"2\"/>\n\
                 <text x=\"{}\" y=\"{y}\">{}</text>\n",
                right - 140.0,
                y - 4.0,
                right - 110.0,
                line.name
            );
        }
        svg
    }
}

/// Four to ten round values from 0 to `high`.
fn round_values(high: f64) -> impl Iterator<Item = f64> {
    let power = 10f64.powf((high / 4.0).log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * power)
        .into_iter()
        .take_while(|step| high / step >= 4.0)
        .last()
        .unwrap_or(power);
    (0u32..)
        .map(move |count| f64::from(count) * step)
        .take_while(move |value| *value <= high)
}
