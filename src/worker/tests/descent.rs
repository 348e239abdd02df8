//! A small method for tests: seeded, deterministic, with places where it waits or breaks on order.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex};

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::PATIENCE;
use crate::job::{Candidate, CandidateColumn, Failure, GenerationEvent, ResultOfJob};
use crate::worker::run::{Advance, Assignment, Method, Row, Run, StopReason};
use greybox::estimation::{Phase, Progress};

/// Looks for the minimum of (x − 3)² by seeded trial; then halves the distance a few times.
pub(crate) struct Descent {
    pub(crate) gate: Arc<Gate>,
}

/// Where a run with `wait_at` waits until it is stopped, and a result with `hold_result` until the gate is
/// opened; tests wait for them to get there.
#[derive(Default)]
pub(crate) struct Gate {
    n_waiting: Mutex<usize>,
    arrived: Condvar,
    /// Raised for runs that wait with their results.
    is_open: AtomicBool,
}

impl Gate {
    fn hold_until(&self, stop: &AtomicBool) {
        *self.n_waiting.lock().expect("unpoisoned") += 1;
        self.arrived.notify_all();
        while !stop.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
    }

    /// Lets the results go that wait here, now and later.
    pub(crate) fn open(&self) {
        self.is_open.store(true, Ordering::Relaxed);
    }

    pub(crate) fn wait_for_arrival(&self) {
        self.wait_for_arrivals(1);
    }

    /// Waits until runs have come here so often.
    pub(crate) fn wait_for_arrivals(&self, arrivals: usize) {
        let waiting = self.n_waiting.lock().expect("unpoisoned");
        let (_guard, timeout) = self
            .arrived
            .wait_timeout_while(waiting, PATIENCE, |n| *n < arrivals)
            .expect("unpoisoned");
        assert!(!timeout.timed_out(), "no run came to the gate");
    }
}

#[derive(Clone, Copy, Deserialize)]
struct Orders {
    generations: u32,
    refinements: u32,
    #[serde(default)]
    wait_at: Option<u32>,
    #[serde(default)]
    panic_at: Option<u32>,
    /// Whether what is said of the best so far takes until somebody hurries it.
    #[serde(default)]
    analyse_for_ever: bool,
    /// Whether the result of the finished run waits at the gate until that is opened.
    #[serde(default)]
    hold_result: bool,
    /// Whether the best so far of a run that was stopped waits there too.
    #[serde(default)]
    hold_best: bool,
    /// Where the run waits until it is stopped, unless the gate is open.
    #[serde(default)]
    wait_once_at: Option<u32>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
struct State {
    unit: u32,
    random: u64,
    best: f64,
}

struct DescentRun {
    orders: Orders,
    state: State,
    gate: Arc<Gate>,
}

impl Method for Descent {
    fn begin(&self, assignment: Assignment) -> Result<Box<dyn Run>, Failure> {
        let orders = serde_json::from_str(&assignment.job.labels["orders"])
            .map_err(|error| Failure::cannot_run(error.to_string(), Vec::new()))?;
        let start = State {
            unit: 0,
            random: 1,
            best: 100.0,
        };
        let state = assignment.checkpoint.map_or(start, |bytes| {
            serde_json::from_slice(&bytes).expect("a checkpoint of this method")
        });
        Ok(Box::new(DescentRun {
            orders,
            state,
            gate: self.gate.clone(),
        }))
    }
}

impl DescentRun {
    fn cost(&self) -> f64 {
        (self.state.best - 3.0).powi(2)
    }

    fn is_finished(&self) -> bool {
        self.state.unit >= self.orders.generations + self.orders.refinements
    }

    /// The trials of a unit, and the best so far once more, as a run tells that has forgotten it.
    fn search(&mut self) -> Vec<Candidate> {
        let mut trials = Vec::new();
        for _ in 0..30 {
            let random = self.state.random;
            self.state.random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let trial = (self.state.random >> 11) as f64 / (1_u64 << 53) as f64 * 200.0 - 100.0;
            if (trial - 3.0).abs() < (self.state.best - 3.0).abs() {
                self.state.best = trial;
            }
            trials.push(trial);
        }
        trials.push(self.state.best);
        let candidates = (0..).zip(trials).map(|(place, x)| Candidate {
            generation: self.state.unit,
            place,
            cost: Some((x - 3.0).powi(2)),
            failure: None,
            values: vec![x],
        });
        candidates.collect()
    }
}

impl Run for DescentRun {
    fn advance(&mut self, stop: &AtomicBool, rows: &mut dyn FnMut(Row)) -> Advance {
        if self.is_finished() {
            return Advance::Finished;
        }
        let unit = self.state.unit + 1;
        if self.orders.wait_at == Some(unit) {
            self.gate.hold_until(stop);
            return Advance::Interrupted;
        }
        if self.orders.wait_once_at == Some(unit) && !self.gate.is_open.load(Ordering::Relaxed) {
            self.gate.hold_until(stop);
            return Advance::Interrupted;
        }
        assert!(self.orders.panic_at != Some(unit), "unit {unit} is cursed");
        self.state.unit = unit;
        if unit <= self.orders.generations {
            let candidates = self.search();
            rows(Row::Generation(GenerationEvent {
                generation: unit,
                evaluations: u64::from(unit) * 30,
                best_cost: Some(self.cost()),
                generation_best_cost: None,
                mean_cost: None,
                best_credit: None,
                entropy: None,
                credit_updates: 0,
                best: IndexMap::from([("x".to_owned(), Some(self.state.best))]),
            }));
            let column = CandidateColumn {
                name: "x".to_owned(),
                unit: "1".to_owned(),
                experiment: None,
                state: None,
            };
            rows(Row::Candidates {
                columns: [column].into(),
                candidates,
            });
        } else {
            self.state.best = 3.0 + (self.state.best - 3.0) / 2.0;
            rows(Row::Refinement {
                iteration: unit - self.orders.generations,
                cost: self.cost(),
            });
        }
        match self.is_finished() {
            true => Advance::Finished,
            false => Advance::Working,
        }
    }

    fn progress(&self) -> Progress {
        let total = f64::from(self.orders.generations + self.orders.refinements);
        Progress {
            phase: Phase::Search,
            generation: self.state.unit.min(self.orders.generations),
            generations: self.orders.generations,
            evaluations: 0,
            best_cost: Some(self.cost()),
            best_credit: None,
            fraction: f64::from(self.state.unit) / total,
            eta_s: None,
        }
    }

    fn checkpoint(&self) -> Vec<u8> {
        serde_json::to_vec(&self.state).expect("plain numbers")
    }

    fn outcome(
        &mut self,
        stopped: Option<StopReason>,
        hurry: &AtomicBool,
    ) -> Result<Option<ResultOfJob>, Failure> {
        if self.orders.analyse_for_ever && stopped.is_some() {
            self.gate.hold_until(hurry);
        }
        let is_held = match stopped {
            None => self.orders.hold_result,
            Some(_) => self.orders.hold_best,
        };
        if is_held {
            self.gate.hold_until(&self.gate.is_open);
        }
        let reason = stopped.unwrap_or(StopReason::GenerationLimit);
        Ok(Some(ResultOfJob::sample(reason, "x", self.state.best)))
    }
}

/// The bits of the estimate of a run that nothing interrupts.
pub(crate) fn unbroken(generations: u32, refinements: u32) -> u64 {
    let mut run = DescentRun {
        orders: Orders {
            generations,
            refinements,
            wait_at: None,
            panic_at: None,
            analyse_for_ever: false,
            hold_result: false,
            hold_best: false,
            wait_once_at: None,
        },
        state: State {
            unit: 0,
            random: 1,
            best: 100.0,
        },
        gate: Arc::default(),
    };
    let never = AtomicBool::new(false);
    while run.advance(&never, &mut |_| ()) == Advance::Working {}
    run.state.best.to_bits()
}
