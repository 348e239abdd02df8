//! Which of the other nodes no longer say that they live.
//!
//! A node is dead when its counter has stood still while observers raised their own five times. No clock
//! decides: a database that stands still stops all counters together, and an observer that stands still
//! sees nothing. The database holds how long a counter has stood still, so that an observer goes on where
//! another one ended.

use std::collections::HashMap;

/// Beats of an observer for which the counter of another node may stand still.
const PATIENCE: i64 = 5;

/// The counter of a node that lives.
#[derive(Clone, Copy, Debug, sqlx::FromRow)]
pub(super) struct Beat {
    pub(super) life: i64,
    pub(super) beat: i64,
    /// How often it is raised [ms].
    pub(super) beat_ms: i64,
    /// For how long the counter has stood still at the least, counted in the beats of observers [ms].
    pub(super) silence_ms: i64,
}

impl Beat {
    /// Whether observers whose counters are raised every `own_ms` take the node for dead.
    pub(super) fn is_dead(&self, own_ms: i64) -> bool {
        let own_ms = own_ms.max(1);
        let own_beats_for_one = self.beat_ms.max(1).div_euclid(own_ms)
            + i64::from(self.beat_ms.max(1).rem_euclid(own_ms) > 0);
        self.silence_ms
            >= PATIENCE
                .saturating_mul(own_beats_for_one)
                .saturating_mul(own_ms)
    }
}

/// The counters of other nodes as they were last seen.
pub(super) struct Watch {
    life: i64,
    seen: HashMap<i64, Beat>,
}

impl Watch {
    /// What the node of a life watches.
    pub(super) fn of(life: i64) -> Self {
        Self {
            life,
            seen: HashMap::new(),
        }
    }

    /// Takes the counters as they are after an own beat, which come every `own_ms`; answers those that
    /// stand still, with their silence up to now. What another observer counted holds where it is more than
    /// was counted here.
    pub(super) fn observe(&mut self, own_ms: i64, live: &[Beat]) -> Vec<Beat> {
        let others = live.iter().filter(|node| node.life != self.life);
        let seen = others.map(|node| {
            let silence_ms = match self.seen.get(&node.life) {
                Some(before)
                    if before.beat == node.beat && node.silence_ms <= before.silence_ms =>
                {
                    before.silence_ms.saturating_add(own_ms)
                }
                _ => node.silence_ms,
            };
            (
                node.life,
                Beat {
                    silence_ms,
                    ..*node
                },
            )
        });
        self.seen = seen.collect();
        let silent = self.seen.values().filter(|node| node.silence_ms > 0);
        silent.copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(life: i64, beat: i64) -> Beat {
        Beat {
            life,
            beat,
            beat_ms: 1000,
            silence_ms: 0,
        }
    }

    fn standing_still(silence_ms: i64) -> Beat {
        Beat {
            silence_ms,
            ..node(2, 7)
        }
    }

    /// After how many own beats a node is dead whose counter is as `beat_at` says.
    fn dead_after(own_ms: i64, beat_at: impl Fn(i64) -> Beat) -> Option<i64> {
        let mut watch = Watch::of(1);
        (0..100).find(|at| {
            let silent = watch.observe(own_ms, &[node(1, *at), beat_at(*at)]);
            silent.iter().any(|node| node.is_dead(own_ms))
        })
    }

    #[test]
    fn a_counter_that_stands_still_for_five_own_beats_is_that_of_a_dead_node() {
        assert_eq!(dead_after(1000, |_| node(2, 7)), Some(5));
        assert_eq!(dead_after(1000, |at| node(2, at.min(20))), Some(25));
    }

    #[test]
    fn a_node_that_raises_its_counter_at_times_lives() {
        assert_eq!(dead_after(1000, |at| node(2, at / 5)), None);
    }

    #[test]
    fn a_node_that_raises_its_counter_more_slowly_is_given_longer() {
        let slow = |at: i64| Beat {
            beat_ms: 3000,
            ..node(2, at.min(3))
        };
        assert_eq!(dead_after(1000, slow), Some(18));
        assert_eq!(dead_after(3000, slow), Some(8));
    }

    #[test]
    fn a_node_never_finds_itself_dead() {
        let mut watch = Watch::of(1);
        let found = (0..100).map(|_| watch.observe(1000, &[node(1, 0)]));
        assert!(found.flatten().next().is_none());
    }
    #[test]
    fn an_observer_goes_on_where_another_one_ended() {
        // The database holds what the observer before wrote. The first look of an observer counts nothing.
        let mut silence_ms = 0;
        for (beats, expected_ms) in [(2, 1000), (3, 3000), (3, 5000)] {
            let mut watch = Watch::of(1);
            for _ in 0..beats {
                let silent = watch.observe(1000, &[standing_still(silence_ms)]);
                silence_ms = silent.first().map_or(0, |node| node.silence_ms);
            }
            assert_eq!(silence_ms, expected_ms);
        }
        assert!(standing_still(silence_ms).is_dead(1000));
    }

    #[test]
    fn observers_together_count_no_more_than_one_of_them() {
        let mut watches = [Watch::of(1), Watch::of(3)];
        let mut silence_ms = 0;
        for turn in 0..5 {
            for watch in &mut watches {
                let silent = watch.observe(
                    1000,
                    &[Beat {
                        silence_ms,
                        ..node(2, 7)
                    }],
                );
                let counted = silent.first().map_or(0, |node| node.silence_ms);
                assert!(counted <= turn * 1000, "{counted} ms after {turn} beats");
                silence_ms = silence_ms.max(counted);
            }
        }
        assert_eq!(silence_ms, 4000);
    }
}
