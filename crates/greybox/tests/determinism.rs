//! The same problem, settings and seed give the same bits: for any number of threads, and however
//! often the run is saved and resumed.

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set itself up has failed"
)]

use greybox::Identification;
use greybox::demo::{self, Demo};
use greybox::estimation::{
    Advance, Estimation, GenerationRow, Observer, Problem, RefinementRow, Settings,
};
use std::sync::atomic::AtomicBool;

const SEED: u64 = 5;

/// The methods that search, a generation at a time.
const SEARCHES: [&str; 3] = ["icra_genetic", "differential_evolution", "cma_es"];

/// Writes down the bits of everything that is reported.
#[derive(Default, PartialEq, Debug)]
struct Diary(Vec<u64>);

impl Observer for Diary {
    fn generation(&mut self, row: &GenerationRow) {
        self.0
            .extend([row.best_cost, row.best_credit, row.entropy].map(f64::to_bits));
        self.0
            .extend(row.best.iter().map(|(_, value)| value.to_bits()));
    }

    fn refinement(&mut self, row: &RefinementRow) {
        self.0.push(row.cost.to_bits());
    }
}

/// Four seconds of recording D: friction, dead band, and nine unknowns.
fn problem(method: &str) -> (Problem, Settings) {
    let mut job = demo::job(Demo::D);
    // One refinement is like another: the rivals of the method go without.
    job["method"] = serde_json::json!({
        "name": method, "generations": 12, "population": 12, "refine_candidates": 2,
        "refine": method == SEARCHES[0],
        "further_searches": 1
    });
    job["experiments"] = serde_json::json!([{}]);
    let recording = demo::recording_of(Demo::D, 3, 400);
    let (assembly, spec) = Identification::of_job(job, recording).assembly().unwrap();
    (assembly.problem, spec.method)
}

/// Runs to the end; after every unit of work for which `save` says so, the run is written down as
/// JSON, dropped, and resumed from that text.
fn run(method: &str, save: impl Fn(usize) -> bool) -> (Diary, Vec<u64>) {
    let (problem, settings) = problem(method);
    let go_on = AtomicBool::new(false);
    let mut diary = Diary::default();
    let mut run = Estimation::start(&problem, &settings, SEED);
    let mut unit = 0;
    while run.advance(&problem, &go_on, &mut diary) == Advance::Working {
        if save(unit) {
            let text = serde_json::to_string(&run.checkpoint()).unwrap();
            let checkpoint = serde_json::from_str(&text).unwrap();
            run = Estimation::resume(&problem, &settings, SEED, checkpoint).unwrap();
        }
        unit += 1;
    }
    let report = run.report(&problem, None).unwrap();
    (
        diary,
        report.values.iter().map(|value| value.to_bits()).collect(),
    )
}

#[test]
fn saving_a_run_after_any_unit_changes_no_bit() {
    for method in SEARCHES {
        let unbroken = run(method, |_| false);
        assert!(
            unbroken.0.0.len() > 100,
            "the run has generations and refinements to compare"
        );
        assert_eq!(unbroken, run(method, |_| true), "{method}");
        assert_eq!(unbroken, run(method, |unit| unit % 3 == 1), "{method}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let with_threads = |method, threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| run(method, |_| false))
    };
    for method in SEARCHES {
        let single = with_threads(method, 1);
        assert_eq!(single, with_threads(method, 2), "{method}");
        assert_eq!(single, with_threads(method, 5), "{method}");
    }
}

#[test]
fn an_interrupted_unit_is_done_again_with_the_same_bits() {
    let (problem, settings) = problem(SEARCHES[0]);
    let (go_on, halt) = (AtomicBool::new(false), AtomicBool::new(true));
    let mut plain = Diary::default();
    let mut interrupted = Diary::default();
    let mut first = Estimation::start(&problem, &settings, SEED);
    let mut second = Estimation::start(&problem, &settings, SEED);
    while first.advance(&problem, &go_on, &mut plain) == Advance::Working {
        let advance = second.advance(&problem, &halt, &mut interrupted);
        assert!(matches!(advance, Advance::Interrupted | Advance::Working));
        if advance == Advance::Interrupted {
            second.advance(&problem, &go_on, &mut interrupted);
        }
    }
    assert_eq!(plain, interrupted);
}
