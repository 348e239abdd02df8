//! What moves the plant beside its inputs, as the result document tells it.

use crate::estimation::problem::{Coordinate, Problem};
use crate::estimation::process_noise::ProcessNoise;
use crate::identification::outcome::{
    BandReport, ComparedNoiseReport, ConfidenceInterval, DisturbanceReport, InnovationReport,
    NoiseNumberReport, OutputErrorEstimate, ProcessNoiseReport,
};
use crate::identification::spec::{ActsOnSpec, NoiseKind};
use crate::uncertainty::Analysis;
use crate::uncertainty::noise_analysis::{
    ComparedNoise, DisturbanceEstimate, FreeRunEstimate, NoiseAnalysis, NoiseEstimate,
};
use greybox_numerics::statistics::finite;
use greybox_simulation::model::ModelDescription;
use std::collections::BTreeMap;

/// The section of a result.
pub(super) fn report(
    problem: &Problem,
    noise: &NoiseAnalysis,
    analysis: &Analysis,
) -> ProcessNoiseReport {
    let model = problem.model.description();
    let compared = noise.compared.iter();
    let held_back = problem.outputs.iter().zip(&noise.bands);
    let held_back = held_back.filter_map(|(output, band)| {
        let band = (*band)?;
        let report = BandReport {
            samples: band.samples as u64,
            inside: band.inside,
            mean_square: band.mean_square,
        };
        Some((output.name.clone(), report))
    });
    let innovations: Vec<InnovationReport> = analysis
        .residuals
        .iter()
        .map(|residual| InnovationReport {
            white: residual.white,
            chi_square_per_sample: residual.chi_square_per_sample,
            lag_1_autocorrelation: residual.lag_1_autocorrelation,
        })
        .collect();
    let sensors: Vec<NoiseNumberReport> = noise.sensors.iter().map(number).collect();
    let spreads = analysis.windows.iter().flat_map(|window| &window.spreads);
    let window_spread = problem.coordinates.iter().zip(spreads);
    ProcessNoiseReport {
        filter: "ekf".to_owned(),
        chosen: name(model, &noise.compared[noise.chosen].disturbances),
        compared: compared
            .map(|weighed| compared_report(problem, weighed))
            .collect(),
        disturbances: noise
            .disturbances
            .iter()
            .map(|estimate| disturbance(problem, estimate))
            .collect(),
        sensors: problem.by_output(&sensors),
        innovations: problem.by_output(&innovations),
        held_back: held_back.collect(),
        window_spread: window_spread
            .filter_map(|(coordinate, spread)| Some((coordinate.name.clone(), finite((*spread)?)?)))
            .collect(),
    }
}

/// What the free run makes of each parameter.
pub(super) fn output_error(
    problem: &Problem,
    noise: &NoiseAnalysis,
) -> BTreeMap<String, OutputErrorEstimate> {
    let estimates = problem.coordinates.iter().zip(&noise.free_run);
    let report = |(coordinate, free): (&Coordinate, &FreeRunEstimate)| {
        let estimate = OutputErrorEstimate {
            estimate: free.value,
            standard_error: free.standard_error.and_then(finite),
            trust: free.trust,
        };
        (coordinate.name.clone(), estimate)
    };
    estimates.map(report).collect()
}

/// The name of a noise model.
fn name(model: &ModelDescription, disturbances: &[ProcessNoise]) -> String {
    let names: Vec<String> = disturbances
        .iter()
        .map(|disturbance| disturbance.in_words(model))
        .collect();
    match names[..] {
        [] => "none".to_owned(),
        _ => names.join(" and "),
    }
}

fn compared_report(problem: &Problem, compared: &ComparedNoise) -> ComparedNoiseReport {
    let fit = compared.fit.as_ref();
    let parameters = fit.map(|fit| problem.named_values(&fit.positions));
    ComparedNoiseReport {
        name: name(problem.model.description(), &compared.disturbances),
        log_likelihood: fit.and_then(|fit| finite(fit.log_likelihood)),
        too_strong: compared.is_too_strong,
        bic: fit.and_then(|fit| finite(fit.bic)),
        parameters: parameters.into_iter().flatten().collect(),
    }
}

fn disturbance(problem: &Problem, estimate: &DisturbanceEstimate) -> DisturbanceReport {
    let model = problem.model.description();
    let acts_on = estimate.sought.disturbance.acts_on;
    let shares = problem.outputs.iter().zip(&estimate.shares);
    DisturbanceReport {
        acts_on: ActsOnSpec::of(acts_on, model),
        kind: NoiseKind::from(estimate.sought.disturbance.kind),
        unit: estimate.sought.unit(model),
        std: estimate.std.as_ref().map(number),
        strength: number(&estimate.strength),
        time_constant_s: estimate.time_constant.as_ref().map(number),
        share_of_output: shares
            .filter_map(|(output, share)| Some((output.name.clone(), (*share)?)))
            .collect(),
    }
}

fn number(estimate: &NoiseEstimate) -> NoiseNumberReport {
    let interval = estimate
        .interval()
        .map(|[lower, upper]| ConfidenceInterval {
            level: 0.95,
            lower: finite(lower),
            upper: finite(upper),
            method: "fisher".to_owned(),
        });
    NoiseNumberReport {
        estimate: estimate.value,
        standard_error: estimate.standard_error().and_then(finite),
        confidence_interval: interval,
    }
}
