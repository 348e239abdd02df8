//! The plots of a report.

use super::chart::{Chart, ChartSize, Series, SeriesLook};
use super::facts::{GenerationCosts, Report};
use super::html::{escape, labelled, push};
use super::inset::{self, DenseStretch, POINTS};
use super::residuals::{self, Diagnostics};
use crate::identification::assemble::{
    DisturbancePath, ExperimentDisturbances, ExperimentTrajectory, OutputTrajectory,
};
use crate::identification::outcome::{ResidualReport, StopReason};
use greybox_recording::kept_indices;
use std::ops::Range;

/// Half the width of a 95 % interval, in standard deviations.
const NORMAL_95: f64 = 1.959_964;

const MEASURED: &str = "#8a93a0";
const SIMULATED: &str = "#c8462f";
const PLAIN: &str = "#2b6cb0";

/// Every experiment's outputs, residuals and their memory.
pub fn experiments(page: &mut String, report: &Report<'_>) {
    let diagnostics = residuals::diagnostics(report.experiments);
    for (number, experiment) in report.experiments.iter().enumerate() {
        push(
            page,
            format_args!(
                "<section>\n<h2>Experiment {}</h2>\n<p class=\"muted\">{} samples of <code>{}\
                 </code>, {} of them estimated from</p>\n",
                number + 1,
                experiment.time.len(),
                experiment.dataset,
                experiment.estimation_samples
            ),
        );
        for output in &experiment.outputs {
            let of = |all: &&Diagnostics| all.experiment == number && all.output == output.name;
            let diagnostics = diagnostics.iter().find(of);
            let noise = report.outcome.residuals.get(&output.name);
            push(
                page,
                format_args!(
                    "<h3>{}</h3>\n<div class=\"charts\">\n",
                    escape(&output.name)
                ),
            );
            output_charts(page, experiment, output, noise, diagnostics);
            page.push_str("</div>\n");
        }
        page.push_str("</section>\n");
    }
}

/// The charts of an output, with the stretch in which it moves most beside a line that is a band.
fn output_charts(
    page: &mut String,
    experiment: &ExperimentTrajectory,
    output: &OutputTrajectory,
    noise: Option<&ResidualReport>,
    diagnostics: Option<&Diagnostics>,
) {
    let stretch = inset::busiest(experiment, output);
    let (wide, small) = match stretch {
        Some(_) => (ChartSize::TwoThirds, ChartSize::Half),
        None => (ChartSize::Whole, ChartSize::Third),
    };
    followed(page, experiment, output, wide, stretch.as_ref());
    if let Some(stretch) = stretch {
        moving(page, experiment, output, &stretch);
    }
    left_over(page, experiment, output, wide, noise);
    if let Some(diagnostics) = diagnostics {
        spread(page, diagnostics);
        memory(page, diagnostics, small);
        frequencies(page, diagnostics, small);
    }
}

/// A disturbance over time between the ends of its 95 % band; `label` names the quantity that it acts on.
pub fn disturbance(
    page: &mut String,
    experiment: &ExperimentDisturbances,
    disturbance: &DisturbancePath,
    label: &str,
) {
    let path = &disturbance.path;
    let end = |by: f64| -> Vec<f64> {
        let values = path.values.iter().zip(&path.deviations);
        values
            .map(|(value, deviation)| value + by * deviation)
            .collect()
    };
    let [lower, upper] = [-NORMAL_95, NORMAL_95].map(end);
    let columns = [&path.values[..], &lower, &upper];
    let kept = kept_indices(&columns, 0..experiment.time.len(), POINTS);
    let series = [
        ("disturbance", PLAIN),
        ("95 % from", MEASURED),
        ("to", MEASURED),
    ];
    let series = series.into_iter().zip(columns);
    let series = series.map(|((name, colour), values)| Series {
        name,
        colour,
        points: points(&experiment.time, &kept, values),
        ..Series::default()
    });
    let label = labelled(label, &disturbance.unit);
    let chart = Chart {
        x_label: "time [s]",
        y_label: &label,
        series: series.collect(),
        ..Chart::default()
    };
    figure(
        page,
        &chart,
        "The disturbance as all samples show it, with its 95 % band.",
    );
}

/// Measured and simulated over time.
fn followed(
    page: &mut String,
    experiment: &ExperimentTrajectory,
    output: &OutputTrajectory,
    size: ChartSize,
    stretch: Option<&DenseStretch>,
) {
    let whole = 0..experiment.time.len();
    let shaded = stretch.map(|stretch| stretch.ends(&experiment.time));
    let label = labelled(&output.name, &output.unit);
    let chart = Chart {
        size,
        y_label: &label,
        marks: held_back(experiment),
        shaded,
        ..both(experiment, output, whole, ["measured", "simulated"])
    };
    let words = match shaded {
        Some(_) => {
            "Measured and simulated, free run from the first sample; shaded: the stretch beside."
        }
        None => "Measured and simulated, free run from the first sample.",
    };
    figure(page, &chart, words);
}

/// A stretch that is short enough to see how the output moves.
fn moving(
    page: &mut String,
    experiment: &ExperimentTrajectory,
    output: &OutputTrajectory,
    stretch: &DenseStretch,
) {
    let label = labelled(&output.name, &output.unit);
    let chart = Chart {
        size: ChartSize::Third,
        y_label: &label,
        ..both(experiment, output, stretch.samples.clone(), ["", ""])
    };
    figure(page, &chart, &stretch.words(&experiment.time));
}

/// The residuals over time, between twice the noise.
fn left_over(
    page: &mut String,
    experiment: &ExperimentTrajectory,
    output: &OutputTrajectory,
    size: ChartSize,
    noise: Option<&ResidualReport>,
) {
    let kept = kept_indices(&[&output.residual], 0..experiment.time.len(), POINTS);
    let label = labelled("measured − simulated", &output.unit);
    let noise = noise.map(|report| 2.0 * report.noise_std);
    let chart = Chart {
        size,
        x_label: "time [s]",
        y_label: &label,
        series: vec![Series {
            name: "",
            colour: PLAIN,
            points: kept
                .iter()
                .map(|&k| (experiment.time[k], output.residual[k]))
                .collect(),
            ..Series::default()
        }],
        levels: noise.map_or_else(Vec::new, |noise| vec![(-noise, ""), (noise, "")]),
        marks: held_back(experiment),
        ..Chart::default()
    };
    figure(page, &chart, "What is left over; dashed: twice the noise.");
}

/// The autocorrelation of the residuals in the part that was estimated from.
fn memory(page: &mut String, diagnostics: &Diagnostics, size: ChartSize) {
    let lags = diagnostics.autocorrelation.iter().zip(1..);
    let within = diagnostics.white_within;
    let chart = Chart {
        size,
        x_label: "lag [samples]",
        y_label: "autocorrelation [1]",
        series: vec![Series {
            name: "",
            colour: PLAIN,
            look: SeriesLook::Bars,
            points: lags.map(|(value, lag)| (f64::from(lag), *value)).collect(),
        }],
        levels: vec![(-within, ""), (within, "")],
        ..Chart::default()
    };
    figure(
        page,
        &chart,
        "The autocorrelation of the residuals: white ones stay between the dashed lines in 99 of 100 lags.",
    );
}

/// How often residuals are how large.
fn spread(page: &mut String, diagnostics: &Diagnostics) {
    let histogram = &diagnostics.histogram;
    let bars = histogram.counts.iter().zip(0_u32..);
    let label = labelled("measured − simulated", &diagnostics.unit);
    let chart = Chart {
        size: ChartSize::Third,
        x_label: &label,
        y_label: "number of residuals",
        series: vec![Series {
            name: "",
            colour: PLAIN,
            look: SeriesLook::Bars,
            points: bars
                .map(|(count, bar)| {
                    let middle = histogram.from + (f64::from(bar) + 0.5) * histogram.width;
                    (middle, *count as f64)
                })
                .collect(),
        }],
        ..Chart::default()
    };
    figure(page, &chart, "How the residuals are spread.");
}

/// At which frequencies the residuals are large.
fn frequencies(page: &mut String, diagnostics: &Diagnostics, size: ChartSize) {
    let lines = diagnostics
        .spectrum
        .iter()
        .filter(|[_, power]| *power > 0.0);
    let label = match diagnostics.unit.as_str() {
        "" => "log10 of the power density [1/Hz]".to_owned(),
        unit if unit.contains(['/', '*']) => format!("log10 of the power density [({unit})²/Hz]"),
        unit => format!("log10 of the power density [{unit}²/Hz]"),
    };
    let chart = Chart {
        size,
        x_label: "frequency [Hz]",
        y_label: &label,
        series: vec![Series {
            name: "",
            colour: PLAIN,
            points: lines.map(|[hz, power]| (*hz, power.log10())).collect(),
            ..Series::default()
        }],
        ..Chart::default()
    };
    figure(
        page,
        &chart,
        "The spectrum of the residuals: flat where they are white, high where the model misses \
         dynamics.",
    );
}

/// How the search came down.
pub fn search(page: &mut String, report: &Report<'_>) {
    let outcome = report.outcome;
    push(
        page,
        format_args!(
            "<section>\n<h2>How it was found</h2>\n<p>{} generations, {} candidates judged, {} of \
             them simulated; {}. Each of the search's: \
             <code>/v1/jobs/{}/candidates</code>, as JSON or CSV.</p>\n",
            outcome.search.generations,
            outcome.search.evaluations,
            outcome.search.distinct_evaluations,
            ended(outcome.stop_reason),
            escape(&outcome.job)
        ),
    );
    let points = |cost: fn(&GenerationCosts) -> Option<f64>| {
        let rows = report.generations.iter();
        rows.map(|row| {
            let height = cost(row).map_or(f64::NAN, f64::log10);
            (f64::from(row.generation), height)
        })
        .collect()
    };
    let chart = Chart {
        x_label: "generation",
        y_label: "log10 of the cost [1]",
        series: vec![
            Series {
                name: "mean",
                colour: MEASURED,
                points: points(|row| row.mean),
                ..Series::default()
            },
            Series {
                name: "best",
                colour: SIMULATED,
                points: points(|row| row.best),
                ..Series::default()
            },
        ],
        ..Chart::default()
    };
    figure(
        page,
        &chart,
        "The lowest cost so far, and the mean of each generation.",
    );
    page.push_str("</section>\n");
}

/// Why a search ended.
fn ended(reason: StopReason) -> &'static str {
    match reason {
        StopReason::GenerationLimit => "it ended with the last generation that the job allows",
        StopReason::CostTarget => "it ended at the cost that the job asks for",
        StopReason::NoiseFloor => "it ended where the best candidate leaves no more than the noise",
        StopReason::Stagnation => "it ended as nothing was gained in many generations",
        StopReason::TimeLimit => "it ended as the time of the job was used up",
        StopReason::Cancelled => "it ended as the job was cancelled",
        StopReason::Paused => "the job was paused",
    }
}

fn held_back(experiment: &ExperimentTrajectory) -> Vec<(f64, &'static str)> {
    let first = experiment.time.get(experiment.estimation_samples);
    first.map(|time| (*time, "held back")).into_iter().collect()
}

/// The points of a line at the samples that are kept.
fn points(times: &[f64], kept: &[usize], values: &[f64]) -> Vec<(f64, f64)> {
    let points = kept.iter().map(|k| (times[*k], values[*k]));
    points.collect()
}

/// Measured and simulated over some of the samples.
fn both<'a>(
    experiment: &ExperimentTrajectory,
    output: &OutputTrajectory,
    samples: Range<usize>,
    [measured, simulated]: [&'a str; 2],
) -> Chart<'a> {
    let columns = [&output.measured[..], &output.simulated];
    let kept = kept_indices(&columns, samples, POINTS);
    let series = |name, colour, values: &[f64]| Series {
        name,
        colour,
        points: points(&experiment.time, &kept, values),
        ..Series::default()
    };
    Chart {
        x_label: "time [s]",
        series: vec![
            series(measured, MEASURED, &output.measured),
            series(simulated, SIMULATED, &output.simulated),
        ],
        ..Chart::default()
    }
}

/// Draws a chart with words below it, where there are any; nothing where there is nothing to draw.
pub fn figure(page: &mut String, chart: &Chart<'_>, words: &str) {
    let mut drawn = String::new();
    chart.draw(&mut drawn);
    if drawn.is_empty() {
        return;
    }
    let class = chart.size.class();
    let caption = match words {
        "" => String::new(),
        words => format!("<figcaption>{words}</figcaption>\n"),
    };
    push(
        page,
        format_args!("<figure class=\"{class}\">\n{drawn}{caption}</figure>\n"),
    );
}
