//! Limits of what may be asked for at once: callers take turns, so that a caller who asks for a thousand
//! things waits for them alone.

use std::sync::Arc;
use std::time::Duration;

use super::error::{Answer, Kind, Problem};
use crate::admission::{Admission, Permit};

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

/// Who asks what is being answered; nobody outside a request.
fn caller() -> Arc<str> {
    CALLER.try_with(Arc::clone).unwrap_or_default()
}

/// Something that there may be only so much of at once.
#[derive(Clone)]
pub(super) struct Limited {
    admission: Admission,
    /// What there was too much of, in a sentence.
    too_many: &'static str,
    /// How long a caller waits for its turn.
    longest_wait: Duration,
}

impl Limited {
    pub(super) fn new(permits: usize, too_many: &'static str) -> Self {
        Self {
            // Whoever asks for all of them at once leaves one to others.
            admission: Admission::with_limit(permits, permits.saturating_sub(1).max(1)),
            too_many,
            longest_wait: LONGEST_QUEUE,
        }
    }

    /// A permit, as soon as it is the caller's turn.
    pub(super) async fn take(&self) -> Answer<Permit> {
        let turn = self.admission.take(caller());
        let turn = tokio::time::timeout(self.longest_wait, turn).await;
        turn.map_err(|_too_long| self.refusal())
    }

    /// A permit, if there is one now.
    pub(super) fn try_take(&self) -> Answer<Permit> {
        self.admission
            .take_free(caller())
            .ok_or_else(|| self.refusal())
    }

    /// Permits that nobody holds.
    pub(super) fn free(&self) -> usize {
        self.admission.free()
    }

    fn refusal(&self) -> Problem {
        Problem::new(Kind::Busy, self.too_many).retry_after(2)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// Waits for a permit as a caller and notes when it came.
    fn wait(
        limited: &Limited,
        who: &'static str,
        came: &Arc<Mutex<Vec<&'static str>>>,
    ) -> tokio::task::JoinHandle<()> {
        let (limited, came) = (limited.clone(), came.clone());
        tokio::spawn(as_caller(who, async move {
            let _permit = limited.take().await.expect("a turn");
            came.lock().expect("no panic").push(who);
        }))
    }

    #[tokio::test]
    async fn callers_take_turns_however_much_one_asks_for() {
        let limited = Limited::new(1, "too many");
        let held = limited.take().await.expect("a permit");
        let came = Arc::default();
        let mut waiting = Vec::new();
        for who in ["many", "many", "many", "many", "few", "other", "few"] {
            waiting.push(wait(&limited, who, &came));
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
        assert_eq!(limited.free(), 1);
    }

    #[tokio::test]
    async fn the_turn_of_one_that_has_left_is_the_next_ones() {
        let limited = Limited::new(1, "too many");
        let held = limited.take().await.expect("a permit");
        let came = Arc::default();
        let left = wait(&limited, "left", &came);
        let stays = wait(&limited, "stays", &came);
        tokio::task::yield_now().await;
        left.abort();
        assert!(left.await.is_err());
        drop(held);
        stays.await.expect("no panic");
        assert_eq!(*came.lock().expect("no panic"), ["stays"]);
        assert_eq!(limited.free(), 1);
        assert!(limited.try_take().is_ok());
    }

    #[tokio::test]
    async fn whoever_waits_too_long_is_told_so() {
        let limited = Limited {
            longest_wait: Duration::from_millis(1),
            ..Limited::new(1, "too many")
        };
        let held = limited.take().await.expect("a permit");
        limited.take().await.expect_err("no turn in time");
        limited.try_take().expect_err("none is free");
        drop(held);
        assert_eq!(limited.free(), 1);
    }
}
