//! The plots of a report.

use super::chart::{Chart, Series};
use super::facts::{GenerationCosts, Report};
use super::html::{escape, push};
use super::residuals::{self, Diagnostics};
use crate::identification::assemble::{
    DisturbancePath, ExperimentDisturbances, ExperimentTrajectory, OutputTrajectory,
};
use crate::identification::outcome::ResidualReport;
use greybox_recording::kept_indices;

/// Points of a line at the most; the extremes of each stretch are kept.
const POINTS: usize = 1500;

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
            let residuals = report.outcome.residuals.get(&output.name);
            push(page, format_args!("<h3>{}</h3>\n", escape(&output.name)));
            followed(page, experiment, output);
            left_over(page, experiment, output, residuals);
            let of = |all: &&Diagnostics| all.experiment == number && all.output == output.name;
            if let Some(diagnostics) = diagnostics.iter().find(of) {
                memory(page, diagnostics);
                spread(page, diagnostics);
                frequencies(page, diagnostics);
            }
        }
        page.push_str("</section>\n");
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
        points: kept
            .iter()
            .map(|&k| (experiment.time[k], values[k]))
            .collect(),
    });
    let label = format!("{label} [{}]", disturbance.unit);
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
fn followed(page: &mut String, experiment: &ExperimentTrajectory, output: &OutputTrajectory) {
    let columns = [&output.measured[..], &output.simulated];
    let kept = kept_indices(&columns, 0..experiment.time.len(), POINTS);
    let points = |values: &[f64]| {
        kept.iter()
            .map(|&k| (experiment.time[k], values[k]))
            .collect()
    };
    let label = format!("{} [{}]", output.name, output.unit);
    let chart = Chart {
        x_label: "time [s]",
        y_label: &label,
        series: vec![
            Series {
                name: "measured",
                colour: MEASURED,
                points: points(&output.measured),
            },
            Series {
                name: "simulated",
                colour: SIMULATED,
                points: points(&output.simulated),
            },
        ],
        marks: held_back(experiment),
        ..Chart::default()
    };
    figure(
        page,
        &chart,
        "Measured and simulated, free run from the first sample.",
    );
}

/// The residuals over time, between twice the noise.
fn left_over(
    page: &mut String,
    experiment: &ExperimentTrajectory,
    output: &OutputTrajectory,
    residuals: Option<&ResidualReport>,
) {
    let kept = kept_indices(&[&output.residual], 0..experiment.time.len(), POINTS);
    let label = format!("measured − simulated [{}]", output.unit);
    let noise = residuals.map(|report| report.noise_std);
    let chart = Chart {
        x_label: "time [s]",
        y_label: &label,
        series: vec![Series {
            name: "residual",
            colour: PLAIN,
            points: kept
                .iter()
                .map(|&k| (experiment.time[k], output.residual[k]))
                .collect(),
        }],
        levels: noise.map_or_else(Vec::new, |noise| vec![-2.0 * noise, 2.0 * noise]),
        marks: held_back(experiment),
        ..Chart::default()
    };
    figure(page, &chart, "What is left over; dashed: twice the noise.");
}

/// The autocorrelation of the residuals in the part that was estimated from.
fn memory(page: &mut String, diagnostics: &Diagnostics) {
    let lags = diagnostics.autocorrelation.iter().zip(1..);
    let chart = Chart {
        x_label: "lag [samples]",
        y_label: "autocorrelation of the residuals",
        series: vec![Series {
            name: "autocorrelation",
            colour: PLAIN,
            points: lags.map(|(value, lag)| (f64::from(lag), *value)).collect(),
        }],
        levels: vec![-diagnostics.white_within, diagnostics.white_within],
        bars: true,
        ..Chart::default()
    };
    figure(
        page,
        &chart,
        "White residuals stay between the dashed lines in 99 of 100 lags.",
    );
}

/// How often residuals are how large.
fn spread(page: &mut String, diagnostics: &Diagnostics) {
    let histogram = &diagnostics.histogram;
    let bars = histogram.counts.iter().zip(0_u32..);
    let label = format!("measured − simulated [{}]", diagnostics.unit);
    let chart = Chart {
        x_label: &label,
        y_label: "residuals",
        series: vec![Series {
            name: "residuals",
            colour: PLAIN,
            points: bars
                .map(|(count, bar)| {
                    let middle = histogram.from + (f64::from(bar) + 0.5) * histogram.width;
                    (middle, *count as f64)
                })
                .collect(),
        }],
        bars: true,
        ..Chart::default()
    };
    figure(page, &chart, "How the residuals are spread.");
}

/// At which frequencies the residuals are large.
fn frequencies(page: &mut String, diagnostics: &Diagnostics) {
    let lines = diagnostics
        .spectrum
        .iter()
        .filter(|[_, power]| *power > 0.0);
    let label = format!("log10 of the power density [{}²/Hz]", diagnostics.unit);
    let chart = Chart {
        x_label: "frequency [Hz]",
        y_label: &label,
        series: vec![Series {
            name: "power",
            colour: PLAIN,
            points: lines.map(|[hz, power]| (*hz, power.log10())).collect(),
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
             them simulated; ended by <code>{}</code>. Each of the search's: \
             <code>/v1/jobs/{}/candidates</code>, as JSON or CSV.</p>\n",
            outcome.search.generations,
            outcome.search.evaluations,
            outcome.search.distinct_evaluations,
            outcome.stop_reason.name(),
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
        y_label: "log10 of the cost",
        series: vec![
            Series {
                name: "mean",
                colour: MEASURED,
                points: points(|row| row.mean),
            },
            Series {
                name: "best",
                colour: SIMULATED,
                points: points(|row| row.best),
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

fn held_back(experiment: &ExperimentTrajectory) -> Vec<(f64, &'static str)> {
    let first = experiment.time.get(experiment.estimation_samples);
    first.map(|time| (*time, "held back")).into_iter().collect()
}

fn figure(page: &mut String, chart: &Chart<'_>, caption: &str) {
    let mut drawn = String::new();
    chart.draw(&mut drawn);
    if !drawn.is_empty() {
        push(
            page,
            format_args!("<figure>\n{drawn}<figcaption>{caption}</figcaption>\n</figure>\n"),
        );
    }
}
