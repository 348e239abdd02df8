//! What the numbers of a sensor, and the clock that samples are taken by, do to what is simulated.
//!
//! A sensor shows `gain · y(t − lag) + offset` of an output y. A clock that is off by a share makes
//! every time between samples longer by it, for the inputs as for the outputs.

use crate::estimation::problem::{Assumed, Experiment, Innovations, Problem, SensorNumber};
use crate::estimation::sensitivity::ResidualPlace;
use crate::estimation::trajectory;
use greybox_simulation::single::Outputs;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The clock is moved by this share to each side.
const CLOCK_SHIFT: f64 = 1e-4;

/// A sensor's number is moved by this share of its tolerance to each side.
const SENSOR_SHIFT: f64 = 0.1;

/// The simulation at a candidate, as sensors and clock change it.
#[derive(Clone, Debug, Default)]
pub(super) struct Sensors {
    /// For each experiment its outputs; empty where nothing is assumed of sensors or clock, or the
    /// candidate cannot be simulated.
    simulated: Vec<Outputs>,
    /// For each experiment its outputs with a slower and with a faster clock.
    clocks: Option<[Vec<Outputs>; 2]>,
    /// For each experiment when its samples were taken `[s]`.
    instants: Vec<Vec<f64>>,
    /// What each sensor's number does to the expected outputs, where innovations are compared.
    responses: Vec<SensorResponse>,
}

/// The expected outputs where the samples of a sensor are corrected for a number of it.
#[derive(Clone, Debug)]
struct SensorResponse {
    target: Assumed,
    /// The number is moved by so much to each side, SI.
    shift: f64,
    /// For each experiment its outputs with the number below and above its value.
    sides: [Vec<Outputs>; 2],
}

impl SensorResponse {
    /// The slope of an expected output's sample by the number.
    fn slope(&self, experiment: usize, index: usize, sample: usize) -> f64 {
        let [below, above] = &self.sides;
        let of = |side: &[Outputs]| side[experiment][index][sample];
        (of(above) - of(below)) / (2.0 * self.shift)
    }
}

impl Sensors {
    /// Simulates what the assumptions of a problem need. Answers nothing when `stop` was raised.
    pub(super) fn simulate(
        problem: &Problem,
        positions: &[f64],
        stop: &AtomicBool,
    ) -> Option<Sensors> {
        let assumed = || {
            problem
                .assumptions
                .iter()
                .map(|assumption| assumption.target)
        };
        if !assumed().any(|target| target.simulated().is_none()) {
            return Some(Sensors::default());
        }
        let at_clock = |factor: f64| {
            let mut changed = problem.clone();
            if factor != 1.0 {
                let experiments = Arc::make_mut(&mut changed.experiments).iter_mut();
                experiments.for_each(|experiment| stretch(experiment, factor));
            }
            trajectory::simulate(&changed, positions, stop)
        };
        let Ok(simulated) = at_clock(1.0)? else {
            return Some(Sensors::default());
        };
        let mut clocks = None;
        if assumed().any(|target| target == Assumed::Clock) {
            let sides = [at_clock(1.0 - CLOCK_SHIFT)?, at_clock(1.0 + CLOCK_SHIFT)?];
            if let [Ok(slow), Ok(fast)] = sides {
                clocks = Some([slow, fast]);
            }
        }
        let instants = problem.experiments.iter().map(instants).collect();
        let mut sensors = Sensors {
            simulated,
            clocks,
            instants,
            responses: Vec::new(),
        };
        if let Some(innovations) = problem.innovations.as_deref() {
            sensors.responses = sensors.responses(problem, innovations, positions, stop)?;
        }
        Some(sensors)
    }

    /// What each sensor's number does to what is expected from its samples. A number whose simulation
    /// fails has no response. Answers nothing when `stop` was raised.
    fn responses(
        &self,
        problem: &Problem,
        innovations: &Innovations,
        positions: &[f64],
        stop: &AtomicBool,
    ) -> Option<Vec<SensorResponse>> {
        let mut responses = Vec::new();
        for assumption in problem.assumptions.iter() {
            let Assumed::Sensor { output, .. } = assumption.target else {
                continue;
            };
            let shift = SENSOR_SHIFT * assumption.tolerance;
            let shown = |place| self.shown(problem, assumption.target, place);
            let corrected = |by: f64| {
                let off = |place| by * shown(place);
                let corrected = corrected(problem, innovations, output, off);
                trajectory::simulate(&corrected, positions, stop)
            };
            if let [Ok(below), Ok(above)] = [corrected(-shift)?, corrected(shift)?] {
                responses.push(SensorResponse {
                    target: assumption.target,
                    shift,
                    sides: [below, above],
                });
            }
        }
        Some(responses)
    }

    /// How a sample of an output changes with what is assumed; nothing where it does not, or cannot
    /// be said.
    pub(super) fn derivative(
        &self,
        problem: &Problem,
        assumed: Assumed,
        place: ResidualPlace,
    ) -> f64 {
        let index = problem.outputs[place.output].index;
        let mut responses = self.responses.iter();
        let response = responses.find(|response| response.target == assumed);
        let by_samples = response.map_or(0.0, |response| {
            response.slope(place.experiment, index, place.sample)
        });
        by_samples + self.shown(problem, assumed, place)
    }

    /// How what a sensor shows of a simulated sample changes with what is assumed.
    fn shown(&self, problem: &Problem, assumed: Assumed, place: ResidualPlace) -> f64 {
        let ResidualPlace {
            experiment,
            sample,
            output,
        } = place;
        let index = problem.outputs[output].index;
        let Some(outputs) = self.simulated.get(experiment) else {
            return 0.0;
        };
        let values = &outputs[index];
        match assumed {
            Assumed::Model(_) | Assumed::Probe(_) | Assumed::Input(_) => 0.0,
            Assumed::Sensor { output: shown, .. } if shown != output => 0.0,
            Assumed::Sensor { number, .. } => match number {
                SensorNumber::Gain => values[sample],
                SensorNumber::Offset => 1.0,
                SensorNumber::Lag => {
                    // An expected sample rests on the samples before, so that the next one knows the error of
                    // this one: a slope that looked at it would pull at the lag of every sensor.
                    let after = match problem.innovations {
                        Some(_) => sample,
                        None => (sample + 1).min(values.len().saturating_sub(1)),
                    };
                    -slope(
                        values,
                        &self.instants[experiment],
                        [sample.saturating_sub(1), after],
                    )
                }
            },
            Assumed::Clock => self.clocks.as_ref().map_or(0.0, |[slow, fast]| {
                let of = |side: &[Outputs]| side[experiment][index][sample];
                (of(fast) - of(slow)) / (2.0 * CLOCK_SHIFT * problem.clock())
            }),
        }
    }
}

/// The problem as if each sample of an output that corrects what is expected had been smaller by so much.
fn corrected(
    problem: &Problem,
    innovations: &Innovations,
    output: usize,
    by: impl Fn(ResidualPlace) -> f64,
) -> Problem {
    let mut corrected = problem.clone();
    let experiments = Arc::make_mut(&mut corrected.experiments).iter_mut();
    for (experiment, data) in experiments.enumerate() {
        let measured = &mut data.measured_inputs(innovations)[problem.outputs[output].index];
        for (sample, value) in measured.iter_mut().enumerate() {
            *value -= by(ResidualPlace {
                experiment,
                sample,
                output,
            });
        }
    }
    corrected
}

/// Lets the time between samples be longer by a factor.
pub(super) fn stretch(experiment: &mut Experiment, factor: f64) {
    experiment.sample_time *= factor;
    let instants = experiment.instants.iter_mut().flatten();
    instants.for_each(|instant| *instant *= factor);
}

fn instants(experiment: &Experiment) -> Vec<f64> {
    match &experiment.instants {
        Some(instants) => instants.clone(),
        None => (0..experiment.samples)
            .map(|sample| sample as f64 * experiment.sample_time)
            .collect(),
    }
}

/// How fast a signal moves from one sample to another `[1/s]`.
fn slope(values: &[f64], instants: &[f64], [before, after]: [usize; 2]) -> f64 {
    let time = instants[after] - instants[before];
    if time > 0.0 {
        (values[after] - values[before]) / time
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use crate::{Identification, Outcome, Recording};
    use greybox_numerics::rng::{self, Purpose, stream};
    use serde_json::json;

    const RATE: f64 = 0.7;
    const NOISE: f64 = 1e-3;

    /// What decays, and how well its sensor and its clock are known.
    fn decay() -> Outcome {
        let mut noise = stream(1, 0, Purpose::Noise);
        let values = (0..200).map(|k| {
            let t = 0.02 * f64::from(k);
            2.0 * (-RATE * t).exp() + NOISE * rng::normal(&mut noise)
        });
        let recording = Recording::from_samples(0.02, [("y", "V", values.collect())]);
        let job = json!({
            "model": {
                "name": "decay",
                "parameters": {
                    "rate": {"unit": "1/s", "default": 1, "lower": 0.1, "upper": 5, "unknown": true},
                    "size": {"unit": "V", "default": 1, "lower": 0.1, "upper": 5, "unknown": true},
                },
                "states": {"x": {"unit": "V", "initial": "size", "derivative": "-rate*x"}},
                "outputs": {"y": {"unit": "V", "expression": "x"}},
            },
            "outputs": {"y": {
                "noise_std": NOISE, "gain_tolerance": "1 %", "lag_tolerance_s": 0.003,
            }},
            "clock_tolerance": "0.5 %",
            "tolerances": {"y.offset": 0},
            "validation": {"fraction": 0},
            "seed": 1,
        });
        let found = Identification::of_job(job, recording).run();
        found.unwrap_or_else(|error| panic!("{error}"))
    }

    /// A gain and a lag of the sensor look like another size, 1 + δ and e^(rate·lag) times as large,
    /// and a clock like another rate: the data cannot tell them apart, so that each adds its square
    /// as it is.
    #[test]
    fn what_a_sensor_and_a_clock_add_is_that_of_closed_forms() {
        let outcome = decay();
        let own = |name: &str| {
            let own = outcome.parameters.iter().find(|own| own.name == name);
            own.expect("it is free").estimate.clone()
        };
        let adds = |line: &str, parameter: &str| {
            let mut lines = outcome.budget.iter();
            let line = lines.find(|own| own.assumption == line).expect("a line");
            line.contributions[parameter].standard_error
        };
        let (size, rate) = (own("size"), own("rate"));
        let expected = [
            ("y.gain", "size", 0.01 * size.estimate),
            ("y.lag", "size", 0.003 * rate.estimate * size.estimate),
            ("clock", "rate", 0.005 * rate.estimate),
        ];
        for (line, parameter, expected) in expected {
            let found = adds(line, parameter);
            assert!(
                (found / expected - 1.0).abs() < 1e-3,
                "{line}: {found} {expected}"
            );
        }
        for (line, parameter) in [("y.gain", "rate"), ("clock", "size")] {
            assert!(
                adds(line, parameter) < 1e-5,
                "{line} does nothing to {parameter}"
            );
        }
        let squares = [0.01 * size.estimate, 0.003 * rate.estimate * size.estimate];
        let squares: f64 = squares.iter().map(|own| own * own).sum();
        let (noise, total) = (size.standard_error, size.total_standard_error);
        let (noise, total) = (noise.expect("noise"), total.expect("a total"));
        assert!((total / (noise * noise + squares).sqrt() - 1.0).abs() < 1e-3);
    }
}
