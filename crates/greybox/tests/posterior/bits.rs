//! Draws are equal for equal specification, data and seed, whatever the number of threads and however often the
//! run is saved and resumed.

use greybox::demo::{self, Demo};
use greybox::estimation::observer::PosteriorRow;
use greybox::estimation::{Advance, Observer};
use greybox::identification::Outcome;
use greybox::{Identification, Run};
use serde_json::json;
use std::sync::atomic::AtomicBool;

/// The generations at which the chains were looked at, and the bits of R̂ there.
#[derive(Debug, Default, PartialEq)]
struct Looks(Vec<(u32, u64)>);

impl Observer for Looks {
    fn posterior(&mut self, row: &PosteriorRow) {
        let r_hat = row
            .convergence
            .map_or(f64::NAN, |convergence| convergence.r_hat);
        self.0.push((row.generation, r_hat.to_bits()));
    }
}

/// Two seconds of demonstration C, with two unknowns and chains of 500 generations.
fn identification() -> Identification {
    let mut job = demo::job(Demo::C);
    job["experiments"] = json!([{}]);
    job["method"] = json!({"generations": 6, "population": 12, "refine_candidates": 1});
    job["validation"] = json!({"fraction": 0});
    job["uncertainty"] = json!({"intervals": "posterior", "posterior_generations": 500});
    Identification::of_job(job, demo::recording_of(Demo::C, 3, 200))
}

/// Runs to the end; after every unit for which `save` says so, the run is written down as JSON, dropped
/// and resumed from that text.
fn run(save: impl Fn(usize) -> bool) -> (Looks, Outcome) {
    let never = AtomicBool::new(false);
    let identification = identification();
    let mut run = identification.begin().unwrap();
    let mut looks = Looks::default();
    let mut unit = 0;
    while run.advance(&never, &mut looks) == Advance::Working {
        if save(unit) {
            let text = serde_json::to_string(&run.checkpoint()).unwrap();
            run = resumed(&identification, &text);
        }
        unit += 1;
    }
    assert!(unit > 15, "the chains take several units");
    let mut outcome = run.outcome(None, &never).unwrap().unwrap();
    // Candidates that a resumed run has forgotten are simulated again.
    outcome.search.distinct_evaluations = 0;
    (looks, outcome)
}

fn resumed(identification: &Identification, checkpoint: &str) -> Run {
    let (spec, model) = identification.specification().unwrap();
    let recordings = [demo::recording_of(Demo::C, 3, 200)];
    let checkpoint = serde_json::from_str(checkpoint).unwrap();
    Run::resume(&spec, &model, &recordings, checkpoint).unwrap()
}

#[test]
fn threads_and_resumptions_change_no_bit() {
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| run(|_| false))
    };
    let single = with_threads(1);
    let draws = single.1.posterior.as_ref().unwrap();
    assert_eq!(draws.generations, 500);
    assert!(draws.rows.len() > 500 && draws.rows.len() <= 1000);
    assert_eq!(single.0.0.len(), 2, "{:?}", single.0);
    let same = |other: &(Looks, Outcome)| {
        assert_eq!(single.0, other.0);
        assert_eq!(single.1.posterior, other.1.posterior);
        // The text of a difference would be as long as both results.
        assert!(single.1 == other.1);
    };
    same(&with_threads(2));
    same(&run(|_| true));
    same(&run(|unit| unit % 3 == 1));
}

#[test]
fn a_stretch_that_was_interrupted_is_drawn_again_with_the_same_bits() {
    let (go_on, halt) = (AtomicBool::new(false), AtomicBool::new(true));
    let identification = identification();
    let mut run = identification.begin().unwrap();
    let mut interruptions = 0;
    loop {
        interruptions += usize::from(run.advance(&halt, &mut ()) == Advance::Interrupted);
        if run.advance(&go_on, &mut ()) == Advance::Finished {
            break;
        }
    }
    assert!(interruptions > 10, "{interruptions}");
    let outcome = run.outcome(None, &go_on).unwrap().unwrap();
    assert!(outcome.posterior == self::run(|_| false).1.posterior);
}

#[test]
fn a_parameter_has_the_quantiles_of_the_draws_as_its_interval() {
    let (_, outcome) = run(|_| false);
    for parameter in &outcome.parameters {
        let estimate = &parameter.estimate;
        let interval = estimate.confidence_interval.as_ref().unwrap();
        let posterior = estimate.posterior.as_ref().unwrap();
        let [lower, median, upper] = &posterior.quantiles[..] else {
            panic!("three quantiles");
        };
        assert_eq!(interval.method, "posterior");
        assert_eq!(interval.lower, Some(lower.value));
        assert_eq!(interval.upper, Some(upper.value));
        assert!(lower.value < median.value && median.value < upper.value);
        // 500 generations are few: the verdict says so.
        let has_converged = posterior.r_hat.unwrap() < 1.01
            && posterior.ess_bulk.unwrap().min(posterior.ess_tail.unwrap()) > 400.0;
        let mut reasons = outcome.verdict.reasons.iter();
        let told = reasons.any(|reason| {
            let names = reason.concerns.as_ref();
            reason.code.code() == "posterior_not_converged"
                && names.is_some_and(|names| names.contains(&parameter.name))
        });
        assert_ne!(told, has_converged, "{}", parameter.name);
    }
}
