//! Places for what there may be only so much of at once, and whose turn it is: callers take turns, so that
//! one who asks for a thousand things waits for them alone.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::oneshot;

use super::error::{Answer, Kind, Problem};

/// How long a request waits for its turn.
const LONGEST_QUEUE: Duration = Duration::from_secs(10);

tokio::task_local! {
    /// Who asks what is being answered.
    static CALLER: Arc<str>;
}

/// Answers a request in the name of its caller, whose turns its work takes.
pub(super) async fn as_caller<F: Future>(who: &str, answering: F) -> F::Output {
    CALLER.scope(who.into(), answering).await
}

/// Places for something that there may be only so much of at once.
#[derive(Clone)]
pub(super) struct Places {
    turns: Arc<Mutex<Turns>>,
    /// What there was too much of, in a sentence.
    too_many: &'static str,
}

impl Places {
    pub(super) fn new(places: usize, too_many: &'static str) -> Self {
        let (free, waiting) = (places, VecDeque::new());
        Self {
            turns: Arc::new(Mutex::new(Turns { free, waiting })),
            too_many,
        }
    }

    /// A place, as soon as it is the caller's turn.
    pub(super) async fn take(&self) -> Answer<Place> {
        let caller = CALLER.try_with(Arc::clone).unwrap_or_default();
        let turn = match lock(&self.turns).ask(caller) {
            None => return Ok(Place::of(&self.turns)),
            Some(turn) => turn,
        };
        match tokio::time::timeout(LONGEST_QUEUE, turn).await {
            Ok(Ok(place)) => Ok(place),
            _ => Err(self.refusal()),
        }
    }

    /// A place, if there is one now.
    pub(super) fn try_take(&self) -> Answer<Place> {
        let mut turns = lock(&self.turns);
        turns.free = turns.free.checked_sub(1).ok_or_else(|| self.refusal())?;
        Ok(Place::of(&self.turns))
    }

    /// Places that nobody has.
    pub(super) fn free(&self) -> usize {
        lock(&self.turns).free
    }

    fn refusal(&self) -> Problem {
        Problem::new(Kind::Busy, self.too_many).retry_after(2)
    }
}

/// A place, until it goes out of scope.
#[derive(Debug)]
pub(super) struct Place(Option<Arc<Mutex<Turns>>>);

impl Place {
    fn of(turns: &Arc<Mutex<Turns>>) -> Self {
        Self(Some(turns.clone()))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let Some(turns) = self.0.take() else {
            return;
        };
        loop {
            let next = lock(&turns).next();
            let Some(next) = next else {
                return;
            };
            match next.send(Self::of(&turns)) {
                Ok(()) => return,
                // Whoever waited has left: the place is the next one's.
                Err(mut refused) => refused.0 = None,
            }
        }
    }
}

#[derive(Debug)]
struct Turns {
    free: usize,
    /// The requests that wait, by caller, in the order of the callers' turns.
    waiting: VecDeque<(Arc<str>, VecDeque<oneshot::Sender<Place>>)>,
}

impl Turns {
    /// Takes a free place, or waits for a turn.
    fn ask(&mut self, caller: Arc<str>) -> Option<oneshot::Receiver<Place>> {
        if self.free > 0 {
            self.free -= 1;
            return None;
        }
        let (send, turn) = oneshot::channel();
        match self.waiting.iter_mut().find(|(who, _)| *who == caller) {
            Some((_, own)) => {
                // Those that have waited too long are at the front.
                while own.front().is_some_and(oneshot::Sender::is_closed) {
                    own.pop_front();
                }
                own.push_back(send);
            }
            None => self.waiting.push_back((caller, VecDeque::from([send]))),
        }
        Some(turn)
    }

    /// Whose turn a place that came free is; nobody's while none waits.
    fn next(&mut self) -> Option<oneshot::Sender<Place>> {
        let Some((caller, mut own)) = self.waiting.pop_front() else {
            self.free += 1;
            return None;
        };
        let next = own.pop_front();
        if !own.is_empty() {
            self.waiting.push_back((caller, own));
        }
        next.or_else(|| self.next())
    }
}

fn lock(turns: &Mutex<Turns>) -> MutexGuard<'_, Turns> {
    turns.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waits for a place as a caller and notes when it came.
    fn wait(
        places: &Places,
        who: &'static str,
        came: &Arc<Mutex<Vec<&'static str>>>,
    ) -> tokio::task::JoinHandle<()> {
        let (places, came) = (places.clone(), came.clone());
        tokio::spawn(as_caller(who, async move {
            let _place = places.take().await.expect("a turn");
            came.lock().expect("no panic").push(who);
        }))
    }

    #[tokio::test]
    async fn callers_take_turns_however_much_one_asks_for() {
        let places = Places::new(1, "too many");
        let held = places.take().await.expect("a place");
        let came = Arc::default();
        let mut waiting = Vec::new();
        for who in ["many", "many", "many", "many", "few", "other", "few"] {
            waiting.push(wait(&places, who, &came));
            // The task runs until it waits, before the next one asks.
            tokio::task::yield_now().await;
        }
        assert!(came.lock().expect("no panic").is_empty());
        drop(held);
        for task in waiting {
            task.await.expect("no panic");
        }
        let turns = ["many", "few", "other", "many", "few", "many", "many"];
        assert_eq!(*came.lock().expect("no panic"), turns);
        assert_eq!(places.free(), 1);
    }

    #[tokio::test]
    async fn the_turn_of_one_that_has_left_is_the_next_ones() {
        let places = Places::new(1, "too many");
        let held = places.take().await.expect("a place");
        let came = Arc::default();
        let left = wait(&places, "left", &came);
        let stays = wait(&places, "stays", &came);
        tokio::task::yield_now().await;
        left.abort();
        assert!(left.await.is_err());
        drop(held);
        stays.await.expect("no panic");
        assert_eq!(*came.lock().expect("no panic"), ["stays"]);
        assert_eq!(places.free(), 1);
        assert!(places.try_take().is_ok());
    }

    #[tokio::test(start_paused = true)]
    async fn whoever_waits_too_long_is_told_so() {
        let places = Places::new(1, "too many");
        let held = places.take().await.expect("a place");
        places.take().await.expect_err("no turn in ten seconds");
        places.try_take().expect_err("none is free");
        drop(held);
        assert_eq!(places.free(), 1);
    }
}
