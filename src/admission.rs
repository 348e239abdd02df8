//! Permits for what there may be only so much of at once, given out in fair turns.
//!
//! A permit that comes free goes to the caller that holds the fewest at that moment, and among
//! equals to the caller whose last turn is the longest ago. A caller that asks for a thousand things
//! delays the first request of another by no more than the work that is going on.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use parking_lot::Mutex;
use tokio::sync::oneshot;

/// The permits of one kind. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Admission(Arc<Mutex<State>>);

#[derive(Debug)]
struct State {
    free: usize,
    /// Permits that one caller may hold.
    most_of_one: usize,
    waiting: VecDeque<Waiting>,
    /// Callers that hold a permit or wait for one.
    callers: HashMap<Arc<str>, Turns>,
    /// Permits given out so far.
    given: u64,
}

#[derive(Debug)]
struct Waiting {
    caller: Arc<str>,
    turn: oneshot::Sender<Permit>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Turns {
    /// Permits that the caller holds.
    held: usize,
    /// The number of the caller's last turn.
    last: u64,
}

/// Leave to go on, until it is dropped.
#[derive(Debug)]
pub struct Permit {
    caller: Arc<str>,
    /// Where the permit goes back to; nothing where it has been taken back.
    admission: Option<Admission>,
}

impl Admission {
    /// An admission with so many permits.
    #[must_use]
    pub fn new(free: usize) -> Self {
        Self::with_limit(free, free)
    }

    /// An admission with so many permits, of which one caller holds so many at the most: others find one free while a
    /// caller asks for more than there is.
    #[must_use]
    pub fn with_limit(free: usize, most_of_one: usize) -> Self {
        Self(Arc::new(Mutex::new(State {
            free,
            most_of_one,
            waiting: VecDeque::new(),
            callers: HashMap::new(),
            given: 0,
        })))
    }

    /// A permit for a caller, when it is the caller's turn. Whoever stops waiting gives up the turn.
    pub async fn take(&self, caller: impl Into<Arc<str>>) -> Permit {
        let (turn, permit) = oneshot::channel();
        let caller = caller.into();
        self.0.lock().join(Waiting { caller, turn });
        self.give_out();
        permit
            .await
            .expect("a caller that waits is given a permit or goes on waiting")
    }

    /// A permit for a caller, where one is free that nobody waits for.
    #[must_use]
    pub fn take_free(&self, caller: impl Into<Arc<str>>) -> Option<Permit> {
        let caller = caller.into();
        let mut state = self.0.lock();
        let waits = |state: &State| {
            state
                .waiting
                .iter()
                .any(|request| state.may_have(&request.caller))
        };
        let is_free = state.free > 0 && state.may_have(&caller) && !waits(&state);
        is_free.then(|| {
            state.give(&caller);
            self.permit(caller)
        })
    }

    /// Whether anybody waits for a permit.
    #[must_use]
    pub fn is_waited_for(&self) -> bool {
        !self.0.lock().waiting.is_empty()
    }

    /// Permits that nobody holds.
    #[must_use]
    pub fn free(&self) -> usize {
        self.0.lock().free
    }

    fn permit(&self, caller: Arc<str>) -> Permit {
        Permit {
            caller,
            admission: Some(self.clone()),
        }
    }

    /// Gives the free permits to the callers whose turn it is.
    fn give_out(&self) {
        loop {
            let Some(Waiting { caller, turn }) = self.0.lock().next() else {
                return;
            };
            // A permit that nobody waits for any more is taken back here, not as it is dropped: a
            // thousand requests that were given up do not nest a thousand calls.
            if let Err(mut refused) = turn.send(self.permit(caller)) {
                refused.admission = None;
                self.0.lock().take_back(&refused.caller);
            }
        }
    }
}

impl State {
    /// Adds a request to those that wait, without the requests that were given up meanwhile.
    fn join(&mut self, request: Waiting) {
        let before = self.waiting.len();
        self.waiting.retain(|waiting| !waiting.turn.is_closed());
        if self.waiting.len() < before {
            let waiting = &self.waiting;
            let waits = |caller: &Arc<str>| waiting.iter().any(|request| request.caller == *caller);
            self.callers
                .retain(|caller, turns| turns.held > 0 || waits(caller));
        }
        self.waiting.push_back(request);
    }

    /// Whether a caller holds fewer permits than one caller may.
    fn may_have(&self, caller: &Arc<str>) -> bool {
        let turns = self.callers.get(caller);
        turns.is_none_or(|turns| turns.held < self.most_of_one)
    }

    fn next(&mut self) -> Option<Waiting> {
        if self.free == 0 {
            return None;
        }
        let turn = |(place, request): &(usize, &Waiting)| {
            let turns = self.callers.get(&request.caller);
            let turns = turns.copied().unwrap_or_default();
            (turns.held, turns.last, *place)
        };
        let waiting = self.waiting.iter().enumerate();
        let waiting = waiting.filter(|(_, request)| self.may_have(&request.caller));
        let (place, _) = waiting.min_by_key(turn)?;
        let request = self.waiting.remove(place)?;
        self.give(&request.caller);
        Some(request)
    }

    /// Notes that a caller holds one of the free permits.
    fn give(&mut self, caller: &Arc<str>) {
        self.free -= 1;
        self.given += 1;
        let turns = self.callers.entry(caller.clone()).or_default();
        turns.held += 1;
        turns.last = self.given;
    }

    /// Notes that a caller holds one permit less. A caller that neither holds nor waits is forgotten.
    fn take_back(&mut self, caller: &Arc<str>) {
        self.free += 1;
        let waits = |request: &Waiting| request.caller == *caller;
        let Some(turns) = self.callers.get_mut(caller) else {
            return;
        };
        turns.held -= 1;
        if turns.held == 0 && !self.waiting.iter().any(waits) {
            self.callers.remove(caller);
        }
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        if let Some(admission) = self.admission.take() {
            admission.0.lock().take_back(&self.caller);
            admission.give_out();
        }
    }
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt;

    use super::*;

    #[tokio::test]
    async fn a_newcomer_comes_before_the_requests_of_a_caller_that_holds_permits() {
        let admission = Admission::new(2);
        let first = admission.take("a").await;
        let second = admission.take("a").await;
        let mut more: Vec<_> = (0..100).map(|_| Box::pin(admission.take("a"))).collect();
        for waiting in &mut more {
            assert!(waiting.now_or_never().is_none());
        }
        let mut newcomer = Box::pin(admission.take("b"));
        assert!((&mut newcomer).now_or_never().is_none());
        drop(first);
        let newcomer = newcomer.now_or_never().expect("its turn");
        // With one permit each, whose last turn is longer ago is next.
        let mut again = Box::pin(admission.take("b"));
        assert!((&mut again).now_or_never().is_none());
        drop(second);
        assert!((&mut again).now_or_never().is_none());
        let turn = (&mut more[0]).now_or_never().expect("its turn");
        drop((newcomer, turn));
        let last = again.now_or_never();
        assert!(last.is_some());
    }

    #[tokio::test]
    async fn the_last_permit_is_for_others_than_whoever_holds_the_most_of_one() {
        let admission = Admission::with_limit(2, 1);
        let first = admission.take("a").await;
        let mut second = Box::pin(admission.take("a"));
        assert!((&mut second).now_or_never().is_none());
        assert!(admission.take_free("a").is_none());
        assert!(admission.take_free("b").is_some());
        let permit_of_b = admission.take("b").now_or_never().expect("it is free");
        drop(first);
        drop(second.now_or_never().expect("its turn"));
        drop(permit_of_b);
        assert_eq!(admission.free(), 2);
    }

    #[tokio::test]
    async fn who_does_not_wait_gets_only_a_permit_that_nobody_waits_for() {
        let admission = Admission::new(1);
        let first = admission.take_free("a").expect("it is free");
        assert!(admission.take_free("a").is_none());
        let mut waits = Box::pin(admission.take("b"));
        assert!((&mut waits).now_or_never().is_none());
        assert!(admission.is_waited_for());
        drop(first);
        assert!(admission.take_free("a").is_none());
        drop(waits.now_or_never().expect("its turn"));
        assert!(admission.take_free("a").is_some());
    }

    #[tokio::test]
    async fn the_permit_of_a_request_that_was_given_up_goes_to_the_next() {
        let admission = Admission::new(1);
        let first = admission.take("a").await;
        let mut gone = Box::pin(admission.take("a"));
        assert!((&mut gone).now_or_never().is_none());
        let mut next = Box::pin(admission.take("a"));
        assert!((&mut next).now_or_never().is_none());
        drop(gone);
        drop(first);
        assert!(next.now_or_never().is_some());
    }

    #[tokio::test]
    async fn callers_that_neither_hold_nor_wait_are_forgotten() {
        let admission = Admission::new(1);
        for caller in ["a", "b", "c"] {
            drop(admission.take(caller).await);
        }
        let held = admission.take("a").await;
        let mut given_up: Vec<_> = (0..10_000).map(|_| Box::pin(admission.take("b"))).collect();
        for waiting in &mut given_up {
            assert!(waiting.now_or_never().is_none());
        }
        drop(given_up);
        drop(held);
        assert_eq!(admission.free(), 1);
        assert!(admission.0.lock().callers.is_empty());
    }
}
