//! The pelts of lynx and hare that the Hudson's Bay Company collected from 1900 to 1920 (G. Howard, 2009; B.
//! Carpenter, "Predator-Prey Population Dynamics: the Lotka-Volterra model in Stan", 2018), in thousands.

use super::{descended, draw};
use greybox::estimation::Problem;
use greybox::estimation::prior::Prior;
use greybox::estimation::process_noise::{NoiseModel, NoiseNumber, filtered};
use greybox::model::{Model, Scale};
use greybox::{Identification, Recording};
use serde_json::json;

const HARE: [f64; 21] = [
    30.0, 47.2, 70.2, 77.4, 36.3, 20.6, 18.1, 21.4, 22.0, 25.4, 27.1, 40.3, 57.0, 76.6, 52.3, 19.5,
    11.2, 7.6, 14.6, 16.2, 24.7,
];
const LYNX: [f64; 21] = [
    4.0, 6.1, 9.8, 35.2, 59.4, 41.7, 19.0, 13.0, 8.3, 9.1, 7.4, 8.0, 12.3, 19.5, 45.7, 51.1, 29.7,
    15.8, 9.7, 10.1, 8.6,
];

/// The mean and the standard deviation of an unknown in the published draws, and the standard error of
/// the mean.
struct Published {
    name: &'static str,
    mean: f64,
    standard_deviation: f64,
    error: f64,
}

const fn published(name: &'static str, mean: f64, deviation: f64, error: f64) -> Published {
    Published {
        name,
        mean,
        standard_deviation: deviation,
        error,
    }
}

/// Of the 10 000 reference draws `hudson_lynx_hare-lotka_volterra` of posteriordb (M. Magnusson et al.,
/// 2021), in the order of the coordinates: the means and their errors are those of its
/// `mean_value` summary; the standard deviations were computed from the draws.
const PUBLISHED: [Published; 8] = [
    published("a", 0.546_864_5, 0.063_054_79, 0.000_626),
    published("b", 0.027_747_29, 0.004_154_718, 0.000_041_2),
    published("c", 0.800_095_4, 0.089_370_18, 0.000_885),
    published("d", 0.024_085_92, 0.003_528_09, 0.000_035),
    published("initial_hare", 34.035_22, 2.916_899, 0.0293),
    published("initial_lynx", 5.935_897, 0.530_552, 0.005_34),
    published("noise of hare_seen", 0.248_056_9, 0.043_262_68, 0.000_439),
    published("noise of lynx_seen", 0.251_016_9, 0.043_590_34, 0.000_44),
];

/// The priors of the case study, each on a search range that is laid out on the other scale where it can
/// be: the density has to be right in the values.
pub fn problem() -> Problem {
    let parameter = |lower: f64, upper: f64| {
        json!({
            "unit": "1/s", "default": lower, "lower": lower, "upper": upper, "scale": "log",
            "unknown": true
        })
    };
    let document = json!({
        "name": "pelts", "title": "lynx and hare",
        "parameters": {
            "a": parameter(0.1, 3.0), "b": parameter(0.002, 0.3),
            "c": parameter(0.1, 3.0), "d": parameter(0.002, 0.3)
        },
        "states": {
            "hare": {"unit": "1", "derivative": "(a - b*lynx)*hare", "initial": 30},
            "lynx": {"unit": "1", "derivative": "(-c + d*hare)*lynx", "initial": 4}
        },
        "outputs": {
            "hare_seen": {"unit": "1", "expression": "log(hare)"},
            "lynx_seen": {"unit": "1", "expression": "log(lynx)"}
        }
    });
    let model = Model::from_text(&document.to_string()).unwrap();
    let logarithms = |pelts: [f64; 21]| pelts.map(f64::ln).to_vec();
    let signals = [
        ("hare_seen", "1", logarithms(HARE)),
        ("lynx_seen", "1", logarithms(LYNX)),
    ];
    let job = json!({
        "experiments": [{"initial_state": {
            "hare": {"estimate": {"lower": 1, "upper": 150}},
            "lynx": {"estimate": {"lower": 0.5, "upper": 50}}
        }}],
        "validation": {"fraction": 0}
    });
    let recording = Recording::from_samples(1.0, signals);
    let identification = Identification::of_job(job, recording).model(&model);
    let mut problem = identification.problem().unwrap();
    let normal = |middle, deviation| Prior {
        middle,
        deviation,
        scale: Scale::Linear,
    };
    let rate = normal(1.0, 0.5);
    let coupling = normal(0.05, 0.05);
    let log_normal = |middle: f64| Prior {
        middle,
        deviation: 1.0,
        scale: Scale::Log,
    };
    let start = log_normal(10_f64.ln());
    let priors = [rate, coupling, rate, coupling, start, start];
    for (coordinate, prior) in problem.coordinates.iter_mut().zip(priors) {
        coordinate.prior = Some(prior);
    }
    let sensor = NoiseNumber::Unknown {
        lower: 0.05,
        upper: 2.0,
        prior: Some(log_normal(-1.0)),
    };
    let noise = NoiseModel {
        disturbances: Vec::new(),
        sensors: vec![sensor; 2],
        steps: 1,
    };
    filtered(&problem, &noise).unwrap()
}

/// Where the descent begins: the means of the case study, rounded.
pub fn start(problem: &Problem) -> Vec<f64> {
    let values = [0.55, 0.028, 0.8, 0.024, 34.0, 5.9, 0.25, 0.25];
    let pairs = problem.coordinates.iter().zip(values);
    let position =
        pairs.map(|(unknown, value)| unknown.scale.position(value, unknown.lower, unknown.upper));
    position.collect()
}

#[test]
fn lynx_and_hare_have_the_moments_of_the_published_draws() {
    let problem = problem();
    let report = descended(&problem, start(&problem));
    let posterior = draw(&problem, &report, 10_000, 1);
    println!(
        "{} generations, {} draws",
        posterior.generations, posterior.draws
    );
    let described = posterior.coordinates.iter().zip(&PUBLISHED);
    for ((drawn, published), coordinate) in described.zip(&problem.coordinates) {
        let convergence = drawn.convergence.unwrap();
        println!(
            "{}: {:.6} beside {:.6}, sd {:.6} beside {:.6}, {convergence:?}",
            published.name,
            drawn.mean,
            published.mean,
            drawn.standard_deviation,
            published.standard_deviation
        );
        assert_eq!(coordinate.name, published.name);
        assert!(convergence.r_hat < 1.01);
        assert!(convergence.ess_bulk > 400.0 && convergence.ess_tail > 400.0);
        let error = drawn.standard_deviation / convergence.ess_bulk.sqrt();
        let off = (drawn.mean - published.mean) / error.hypot(published.error);
        assert!(off.abs() < 4.0, "{off}");
        let ratio = drawn.standard_deviation / published.standard_deviation;
        assert!((ratio - 1.0).abs() < 0.07, "{ratio}");
    }
}
