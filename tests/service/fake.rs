//! A method that answers at once, to try the service without computing.
use greybox::job::*;
use greybox::worker::run::*;
use serde_json::{Value, json};
use std::sync::atomic::AtomicBool;
pub struct Fake;
struct FakeRun {
    job: String,
    n: u32,
    at: u32,
}
impl Method for Fake {
    fn begin(&self, a: Assignment) -> Result<Box<dyn Run>, Failure> {
        let at = a
            .checkpoint
            .map_or(0, |c| String::from_utf8(c).unwrap().parse().unwrap());
        Ok(Box::new(FakeRun {
            job: a.job.id.to_string(),
            n: a.job.spec["method"]["generations"].as_u64().unwrap() as u32,
            at,
        }))
    }
}
impl Run for FakeRun {
    fn advance(&mut self, _s: &AtomicBool, rows: &mut dyn FnMut(Row)) -> Advance {
        if self.at >= self.n {
            rows(Row::Refinement {
                iteration: 1,
                cost: 1.0,
            });
            return Advance::Finished;
        }
        self.at += 1;
        if self.n > 1000 {
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        rows(Row::Generation(GenerationEvent {
            generation: self.at,
            evaluations: 1,
            best_cost: Some(1.0),
            mean_cost: None,
            best_credit: None,
            entropy: None,
            credit_updates: 1,
            best: Default::default(),
        }));
        Advance::Working
    }
    fn progress(&self) -> Progress {
        Progress {
            phase: Phase::Search,
            generation: self.at,
            generations: self.n,
            evaluations: 0,
            best_cost: None,
            best_credit: None,
            fraction: 0.0,
            eta_s: None,
        }
    }
    fn checkpoint(&self) -> Vec<u8> {
        self.at.to_string().into_bytes()
    }
    fn outcome(&mut self, stopped: Option<StopReason>) -> Result<Option<Value>, Failure> {
        Ok(Some(
            json!({"job": self.job, "parameters":[{"name":"mass","estimate":100.0}], "fit":{}, "engine":{"seed":1},
          "stop_reason": match stopped { None=>"generation_limit", Some(StopReason::Cancelled)=>"cancelled", Some(StopReason::Paused)=>"paused", _=>"time_limit"}}),
        ))
    }
}
