//! The analysis of an estimate, and how much of it needs no derivatives.

use super::budget::Budget;
use super::constrained::Binding;
use super::covariance::{Linear, NORMAL_95};
use super::drift::Drift;
use super::fit::{Criteria, OutputFit};
use super::identifiability::FlatDirection;
use super::monte_carlo::MonteCarlo;
use super::noise_analysis::NoiseAnalysis;
use super::posterior::Posterior;
use super::profile::Ends;
use super::residuals::ResidualReport;
use super::verdict::{Doubt, Judgement, Rule, Trust};
use super::windows::WindowAgreement;
use crate::estimation::problem::{Coordinate, Problem};
use crate::estimation::report::Report;

/// How near to an end of its range an estimate counts as standing there.
const BOUND_DISTANCE: f64 = 1e-6;

/// The uncertainty of one coordinate beside its value.
#[derive(Clone, Debug)]
pub struct CoordinateUncertainty {
    /// The standard error, SI; none where the data do not fix the coordinate.
    pub standard_error: Option<f64>,
    /// The 95 % interval, SI; asymmetric for a coordinate on a log scale. An end that the data
    /// leave open is none.
    pub interval: Option<(Option<f64>, Option<f64>)>,
    /// How the interval was made.
    pub method: &'static str,
    /// The ends of the 95 % interval as positions, before they are made values.
    pub(super) ends: Option<Ends>,
    /// The likelihood profile where one was made: values, SI, and how far the sum of squares rises
    /// there, as a multiple of the rise at which the interval ends.
    pub profile: Vec<(f64, f64)>,
    /// The standard error with all that is taken as known, SI.
    pub total_error: Option<f64>,
    /// The 95 % interval with all that is taken as known, SI.
    pub total_interval: Option<(Option<f64>, Option<f64>)>,
    /// How the fits of a Monte Carlo analysis lie about the estimate, where one was asked for.
    pub monte_carlo: Option<MonteCarlo>,
    /// How many standard deviations of its prior the estimate is off its middle.
    pub prior_shift: Option<f64>,
    /// How far the total interval can be relied on.
    pub trust: Trust,
    /// Whether the estimate stands at an end of its search range.
    pub at_bound: bool,
    /// Whether the data fix the coordinate more closely than the search range does.
    pub identifiable: bool,
    /// For each output the root mean square of its change when the coordinate's value grows by
    /// 100 %, linearised, SI; empty where the simulation near the estimate fails.
    pub output_changes: Vec<f64>,
}

/// All that is said of an estimate.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// One for each coordinate.
    pub coordinates: Vec<CoordinateUncertainty>,
    /// Correlations of the coordinates; none where there is no covariance.
    pub correlation: Option<Vec<Vec<f64>>>,
    /// The condition number of the derivatives, each column scaled to the same length.
    pub condition: Option<f64>,
    /// What the data do not see near the estimate.
    pub flat: Vec<FlatDirection>,
    /// Why there are no standard errors, where there are none.
    pub missing: Option<String>,
    /// For each output how well the data that were estimated from are explained.
    pub estimation_fit: Vec<OutputFit>,
    /// For each output how well the data that were held back are explained.
    pub validation_fit: Vec<OutputFit>,
    /// For each output what is left unexplained.
    pub residuals: Vec<ResidualReport>,
    /// Criteria for the comparison of models.
    pub criteria: Criteria,
    /// For each coordinate the standard deviation that noise alone leaves, as a share of its
    /// search range.
    pub deviations: Vec<Option<f64>>,
    /// The assumptions of the job, and how each moves the estimate.
    pub budget: Budget,
    /// Unknowns that the residuals say to change within the record.
    pub drifts: Vec<Drift>,
    /// How the windows of the record agree, where innovations are compared.
    pub windows: Option<WindowAgreement>,
    /// Constraints that keep the estimate from where the data would have it.
    pub bindings: Vec<Binding>,
    /// What moves the plant beside its inputs, where that was looked for and found.
    pub noise: Option<Box<NoiseAnalysis>>,
    /// The draws from the posterior distribution, where they were asked for.
    pub posterior: Option<Box<Posterior>>,
    /// Whether the numbers can be trusted.
    pub judgement: Judgement,
}

impl Analysis {
    /// The analysis of the first coordinates alone.
    pub(super) fn of_first(mut self, n: usize) -> Analysis {
        self.coordinates.truncate(n);
        self.deviations.truncate(n);
        if let Some(rows) = &mut self.correlation {
            rows.truncate(n);
            rows.iter_mut().for_each(|row| row.truncate(n));
        }
        for flat in &mut self.flat {
            flat.parts.retain(|(coordinate, _)| *coordinate < n);
        }
        self.flat.retain(|flat| !flat.parts.is_empty());
        self.budget.totals.truncate(n);
        for line in &mut self.budget.lines {
            line.contributions.truncate(n);
        }
        self.drifts.retain(|drift| drift.coordinate < n);
        for drift in &mut self.drifts {
            drift.moves.truncate(n);
        }
        self.posterior = self
            .posterior
            .map(|posterior| Box::new(posterior.of_first(n)));
        if let Some(windows) = &mut self.windows {
            windows.spreads.truncate(n);
            windows.scatters.truncate(n);
        }
        self
    }

    /// Takes over from the free run how outputs change with each unknown, and how far the data go from priors and
    /// beyond constraints: a noise model excuses what they contradict.
    pub(super) fn take_over(&mut self, free_run: &Analysis) {
        for (described, free) in self.coordinates.iter_mut().zip(&free_run.coordinates) {
            described.output_changes.clone_from(&free.output_changes);
            let shifts = [described.prior_shift, free.prior_shift];
            let shifts = shifts.into_iter().flatten();
            described.prior_shift = shifts.max_by(|a, b| a.abs().total_cmp(&b.abs()));
        }
        for binding in &mut self.bindings {
            let mut of_free_run = free_run.bindings.iter();
            let same = of_free_run.find(|free| free.constraint == binding.constraint);
            let deviations = same.map_or(0.0, |free| free.deviations);
            binding.deviations = binding.deviations.max(deviations);
        }
    }

    pub(super) fn judge(&mut self, judgement: Judgement) {
        for (coordinate, trust) in self.coordinates.iter_mut().zip(&judgement.coordinates) {
            coordinate.trust = *trust;
        }
        self.judgement = judgement;
    }
}

pub(super) fn without_simulation(problem: &Problem, report: &Report) -> Analysis {
    let reason = "the simulation at the estimate fails".to_owned();
    unknown(problem, report, Rule::SimulationFails, reason)
}

pub(super) fn unknown(problem: &Problem, report: &Report, rule: Rule, reason: String) -> Analysis {
    let mut analysis = undetermined(problem, report, reason.clone());
    let doubt = Doubt::new(rule, Trust::Low, reason);
    analysis.judge(Judgement::of(problem, vec![doubt]));
    analysis
}

/// What can be said of an estimate without its simulation and its derivatives.
pub(super) fn undetermined(problem: &Problem, report: &Report, reason: String) -> Analysis {
    Analysis {
        coordinates: coordinates(problem, report, None),
        correlation: None,
        condition: None,
        flat: Vec::new(),
        missing: Some(reason),
        estimation_fit: Vec::new(),
        validation_fit: Vec::new(),
        residuals: Vec::new(),
        criteria: Criteria::missing(),
        deviations: vec![None; problem.coordinates.len()],
        budget: Budget::default(),
        drifts: Vec::new(),
        windows: None,
        bindings: Vec::new(),
        noise: None,
        posterior: None,
        judgement: Judgement::default(),
    }
}

impl CoordinateUncertainty {
    /// Widens the total interval to the ends of another, as positions.
    pub(super) fn cover(&mut self, coordinate: &Coordinate, position: f64, [low, high]: [f64; 2]) {
        let Some((lower, upper)) = self.total_interval else {
            return;
        };
        let [low_value, high_value] = [low, high].map(|end| value_near(coordinate, end));
        let wider = |end: Option<f64>, other: Option<f64>, widest: fn(f64, f64) -> f64| {
            end.zip(other).map(|(end, other)| widest(end, other))
        };
        self.total_interval = Some((
            wider(lower, low_value, f64::min),
            wider(upper, high_value, f64::max),
        ));
        let half = (position - low).max(high - position) / NORMAL_95;
        let error = half * coordinate.slope(position).abs();
        self.total_error = self.total_error.map(|total| total.max(error));
    }

    /// Adds what is assumed: the total and the noise alone, as standard deviations of the
    /// position. Each end of the interval goes out by what the total's square has more.
    pub(super) fn widen(
        &mut self,
        coordinate: &Coordinate,
        position: f64,
        deviations: Option<(f64, f64)>,
    ) {
        let (Some((total, noise)), Some((lower, upper))) = (deviations, self.ends) else {
            return;
        };
        self.total_error = Some(total * coordinate.slope(position).abs());
        let more = NORMAL_95 * NORMAL_95 * (total * total - noise * noise).max(0.0);
        let end = |end: f64| {
            let half = end - position;
            let end = position + (half * half + more).sqrt().copysign(half);
            value_near(coordinate, end)
        };
        self.total_interval = Some((lower.and_then(end), upper.and_then(end)));
    }
}

/// The value at an end of an interval; none where it lies a whole search range beyond it: there
/// the data leave it open.
pub(super) fn value_near(coordinate: &Coordinate, position: f64) -> Option<f64> {
    let (lower, upper) = (coordinate.lower, coordinate.upper);
    (-1.0..=2.0)
        .contains(&position)
        .then(|| coordinate.scale.value_beyond(position, lower, upper))
}

pub(super) fn coordinates(
    problem: &Problem,
    report: &Report,
    linear: Option<&Linear>,
) -> Vec<CoordinateUncertainty> {
    let pairs = problem
        .coordinates
        .iter()
        .zip(&report.positions)
        .enumerate();
    pairs
        .map(|(index, (coordinate, &position))| {
            let deviation = linear.and_then(|linear| linear.deviation(index));
            let covariance = linear.and_then(|linear| linear.covariance.as_ref());
            let slope = coordinate.slope(position).abs();
            let value = |position: f64| value_near(coordinate, position);
            let ends = deviation.map(|deviation| {
                let half = NORMAL_95 * deviation;
                (Some(position - half), Some(position + half))
            });
            let prior = problem.prior_of(index);
            let relative = coordinate.value(position).abs() / slope;
            let slopes = linear.map(|linear| linear.slopes[index].iter());
            CoordinateUncertainty {
                standard_error: deviation.map(|deviation| deviation * slope),
                interval: ends.map(|(low, high)| (low.and_then(value), high.and_then(value))),
                ends,
                profile: Vec::new(),
                total_error: None,
                total_interval: None,
                monte_carlo: None,
                prior_shift: prior.map(|prior| prior.residual(coordinate.value(position))),
                trust: Trust::default(),
                method: covariance.map_or("fisher", |covariance| covariance.method()),
                at_bound: !(BOUND_DISTANCE..=1.0 - BOUND_DISTANCE).contains(&position),
                identifiable: deviation.is_some_and(|deviation| 2.0 * NORMAL_95 * deviation < 1.0),
                output_changes: slopes
                    .into_iter()
                    .flatten()
                    .map(|slope| slope * relative)
                    .collect(),
            }
        })
        .collect()
}
