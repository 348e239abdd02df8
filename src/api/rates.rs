//! How fast a caller may ask, and how many of its requests may be under way at once.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::response::Response;

use super::error::{Answer, Kind, Problem};
use super::watched_body::watched;
use crate::allowance::{Allowance, Rate};

/// How long the refusal of a caller that asks too fast is held back. A flood of refusals takes the server's time else.
const HELD_BACK: Duration = Duration::from_millis(500);
/// A caller that has asked nothing for so long is forgotten first.
const IDLE: Duration = Duration::from_secs(60);
/// Callers that are remembered before those that are idle are forgotten.
const REMEMBERED: usize = 10_000;

/// What callers have asked lately, and have under way.
#[derive(Clone)]
pub(super) struct Rates {
    rate: Rate,
    at_once: u32,
    callers: Arc<Mutex<HashMap<String, Caller>>>,
}

struct Caller {
    allowance: Allowance,
    seen: Instant,
    under_way: u32,
}

impl Rates {
    /// Limits of each caller: requests a second, requests that may come together, and requests that
    /// may be under way.
    pub(super) fn new(per_second: f64, burst: f64, at_once: u32) -> Self {
        Self {
            rate: Rate {
                per_second,
                at_once: burst.max(1.0),
            },
            at_once,
            callers: Arc::default(),
        }
    }

    fn callers(&self) -> MutexGuard<'_, HashMap<String, Caller>> {
        self.callers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a request of a caller, which is under way until what is answered is dropped. A refusal comes later.
    pub(super) async fn count(&self, who: &str) -> Answer<UnderWay> {
        let counted = self.admit(who);
        if counted.is_err() {
            tokio::time::sleep(HELD_BACK).await;
        }
        counted
    }

    fn admit(&self, who: &str) -> Answer<UnderWay> {
        let now = Instant::now();
        let mut callers = self.callers();
        if callers.len() >= REMEMBERED && !callers.contains_key(who) {
            callers.retain(|_, caller| caller.under_way > 0 || caller.seen.elapsed() < IDLE);
        }
        let caller = callers.entry(who.to_owned()).or_insert(Caller {
            allowance: Allowance::of(self.rate, now),
            seen: now,
            under_way: 0,
        });
        caller.seen = now;
        if caller.under_way >= self.at_once {
            let detail = format!("{} requests of `{who}` are under way at once", self.at_once);
            return Err(Problem::new(Kind::TooMany, detail).retry_after(1));
        }
        if let Err(wait) = caller.allowance.take(self.rate, now) {
            let wait_s = wait.as_secs_f64().ceil();
            let detail = format!(
                "`{who}` may ask {} times a second; the next time in {wait_s} s",
                self.rate.per_second
            );
            return Err(Problem::new(Kind::TooMany, detail).retry_after(wait_s as u32));
        }
        caller.under_way += 1;
        Ok(UnderWay {
            rates: self.clone(),
            who: who.to_owned(),
        })
    }
}

/// A request of a caller, from when it was counted to the end of its answer.
pub(super) struct UnderWay {
    rates: Rates,
    who: String,
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        if let Some(caller) = self.rates.callers().get_mut(&self.who) {
            caller.under_way -= 1;
        }
    }
}

impl UnderWay {
    /// The answer, which carries the count to its end.
    pub(super) fn until_the_end_of(self, answer: Response) -> Response {
        answer.map(|body| {
            watched(body, move |_| {
                // Dropped with the body.
                let _counted = &self;
                Ok(())
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use axum::body::{Body, HttpBody};
    use axum::http::StatusCode;
    use axum::response::IntoResponse;

    use super::*;

    #[test]
    fn a_caller_that_asks_too_fast_waits_and_others_do_not() {
        // One in an hour: time that the test takes counts for nothing.
        let rates = Rates::new(1.0 / 3600.0, 1.0, 10);
        let first = rates.admit("a");
        assert!(first.is_ok());
        let refused = rates.admit("a").err().expect("too fast").into_response();
        assert_eq!(refused.status(), StatusCode::TOO_MANY_REQUESTS);
        assert!(rates.admit("b").is_ok());
    }

    #[test]
    fn a_request_is_under_way_until_its_answer_is_dropped() {
        let rates = Rates::new(1e6, 1e6, 1);
        let answer = rates.admit("a").expect("the first");
        let answer = answer.until_the_end_of(Response::new(Body::from("x")));
        assert_eq!(answer.body().size_hint().exact(), Some(1));
        assert!(rates.admit("a").is_err());
        drop(answer);
        assert!(rates.admit("a").is_ok());
    }
}
