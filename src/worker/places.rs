//! Places to compute, given out in fair turns between projects.
//!
//! A place that comes free goes to the project that has the fewest at that moment, and of such to the
//! one that has waited the longest since its last turn. A project that queues many jobs so delays the
//! first of another by no more than the slices at work.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::oneshot;

use crate::access::Project;

/// The places. Cheap to clone.
#[derive(Clone)]
pub(super) struct Places(Arc<Mutex<State>>);

struct State {
    free: usize,
    waiting: VecDeque<(Project, oneshot::Sender<Place>)>,
    at_work: HashMap<Project, Turns>,
    /// Places given out so far.
    given: u64,
}

#[derive(Clone, Copy, Default)]
struct Turns {
    /// Places that the project has.
    places: usize,
    /// The number of its last turn.
    last: u64,
}

/// A place, until it is dropped.
pub(super) struct Place {
    project: Project,
    places: Places,
}

impl Places {
    /// So many places.
    pub(super) fn new(free: usize) -> Self {
        Self(Arc::new(Mutex::new(State {
            free,
            waiting: VecDeque::new(),
            at_work: HashMap::new(),
            given: 0,
        })))
    }

    /// A place for a job of the project, when it is its turn.
    pub(super) async fn take(&self, project: Project) -> Place {
        let (sender, place) = oneshot::channel();
        self.state().waiting.push_back((project, sender));
        self.give_out();
        place
            .await
            .expect("whoever waits is given a place or waits")
    }

    /// A place for the project, where one is free that nobody waits for.
    pub(super) fn take_free(&self, project: Project) -> Option<Place> {
        let mut state = self.state();
        let is_free = state.free > 0 && state.waiting.is_empty();
        is_free.then(|| {
            state.give(&project);
            Place {
                project,
                places: self.clone(),
            }
        })
    }

    /// Whether anybody waits for one.
    pub(super) fn are_waited_for(&self) -> bool {
        !self.state().waiting.is_empty()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives the free places to those whose turn it is.
    fn give_out(&self) {
        loop {
            let Some((project, sender)) = self.state().next() else {
                return;
            };
            let place = Place {
                project,
                places: self.clone(),
            };
            // One that waits no longer gives its place back as it is dropped here.
            drop(sender.send(place));
        }
    }
}

impl State {
    fn next(&mut self) -> Option<(Project, oneshot::Sender<Place>)> {
        if self.free == 0 {
            return None;
        }
        let turn = |(place, (project, _)): &(usize, &(Project, _))| {
            let turns = self.at_work.get(project).copied().unwrap_or_default();
            (turns.places, turns.last, *place)
        };
        let next = self.waiting.iter().enumerate().min_by_key(turn);
        let (place, _) = next?;
        let (project, sender) = self.waiting.remove(place)?;
        self.give(&project);
        Some((project, sender))
    }

    /// Notes that a project has one of the free places.
    fn give(&mut self, project: &Project) {
        self.free -= 1;
        self.given += 1;
        let turns = self.at_work.entry(project.clone()).or_default();
        turns.places += 1;
        turns.last = self.given;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut state = self.places.state();
        state.free += 1;
        if let Some(turns) = state.at_work.get_mut(&self.project) {
            turns.places -= 1;
        }
        drop(state);
        self.places.give_out();
    }
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt;

    use super::*;

    fn project(name: &str) -> Project {
        name.parse().expect("a name")
    }

    #[tokio::test]
    async fn a_newcomer_comes_before_those_of_a_project_that_has_places() {
        let places = Places::new(2);
        let first = places.take(project("a")).await;
        let second = places.take(project("a")).await;
        let mut more: Vec<_> = (0..100)
            .map(|_| Box::pin(places.take(project("a"))))
            .collect();
        for waiting in &mut more {
            assert!(waiting.now_or_never().is_none());
        }
        let mut newcomer = Box::pin(places.take(project("b")));
        assert!((&mut newcomer).now_or_never().is_none());
        drop(first);
        let newcomer = newcomer.now_or_never().expect("its turn");
        // With one place each, whose last turn is longer ago is next.
        let mut again = Box::pin(places.take(project("b")));
        assert!((&mut again).now_or_never().is_none());
        drop(second);
        assert!((&mut again).now_or_never().is_none());
        let turn = (&mut more[0]).now_or_never().expect("its turn");
        drop((newcomer, turn));
        let last = again.now_or_never();
        assert!(last.is_some());
    }

    #[tokio::test]
    async fn who_does_not_wait_gets_only_a_place_that_nobody_waits_for() {
        let places = Places::new(1);
        let first = places.take_free(project("a")).expect("it is free");
        assert!(places.take_free(project("a")).is_none());
        let mut waits = Box::pin(places.take(project("b")));
        assert!((&mut waits).now_or_never().is_none());
        assert!(places.are_waited_for());
        drop(first);
        assert!(places.take_free(project("a")).is_none());
        drop(waits.now_or_never().expect("its turn"));
        assert!(places.take_free(project("a")).is_some());
    }

    #[tokio::test]
    async fn a_place_that_nobody_waits_for_any_more_goes_to_the_next() {
        let places = Places::new(1);
        let first = places.take(project("a")).await;
        let mut gone = Box::pin(places.take(project("a")));
        assert!((&mut gone).now_or_never().is_none());
        let mut next = Box::pin(places.take(project("a")));
        assert!((&mut next).now_or_never().is_none());
        drop(gone);
        drop(first);
        assert!(next.now_or_never().is_some());
    }
}
