//! Which of the other nodes no longer say that they live.
//!
//! A node is dead when its counter has stood still while the observer raised its own five times. No clock
//! decides: a database that stands still stops all counters together, and an observer that stands still
//! sees nothing.

use std::collections::HashMap;

/// Own beats for which the counter of another may stand still.
const PATIENCE: u32 = 5;

/// The counter of a node that lives.
#[derive(Clone, Copy, Debug, sqlx::FromRow)]
pub(super) struct Beat {
    pub(super) life: i64,
    pub(super) beat: i64,
    /// How often it is raised [ms].
    pub(super) beat_ms: i64,
}

/// The counters of other nodes as they were last seen.
pub(super) struct Watch {
    life: i64,
    seen: HashMap<i64, Standstill>,
}

#[derive(Clone, Copy)]
struct Standstill {
    beat: i64,
    /// Own beats since it was raised.
    own_beats: u32,
}

impl Watch {
    /// What the node of a life watches.
    pub(super) fn of(life: i64) -> Self {
        Self {
            life,
            seen: HashMap::new(),
        }
    }

    /// Takes the counters as they are after an own beat, which come every `own_ms`; answers those of
    /// nodes that are dead.
    pub(super) fn observe(&mut self, own_ms: i64, live: &[Beat]) -> Vec<Beat> {
        self.seen
            .retain(|life, _| live.iter().any(|node| node.life == *life));
        let others = live.iter().filter(|node| node.life != self.life);
        let dead = others.filter(|node| {
            let own_beats = match self.seen.get(&node.life) {
                Some(seen) if seen.beat == node.beat => seen.own_beats + 1,
                _ => 0,
            };
            let seen = Standstill {
                beat: node.beat,
                own_beats,
            };
            self.seen.insert(node.life, seen);
            own_beats >= patience(own_ms, node.beat_ms)
        });
        dead.copied().collect()
    }
}

/// Own beats for which the counter of a node may stand still that is raised every `other_ms`.
fn patience(own_ms: i64, other_ms: i64) -> u32 {
    let own_beats_for_one = other_ms
        .unsigned_abs()
        .div_ceil(own_ms.unsigned_abs().max(1));
    PATIENCE.saturating_mul(u32::try_from(own_beats_for_one.max(1)).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(life: i64, beat: i64) -> Beat {
        Beat {
            life,
            beat,
            beat_ms: 1000,
        }
    }

    /// After how many own beats a node is dead whose counter is as `beat_at` says.
    fn dead_after(own_ms: i64, beat_at: impl Fn(i64) -> Beat) -> Option<i64> {
        let mut watch = Watch::of(1);
        (0..100).find(|at| {
            !watch
                .observe(own_ms, &[node(1, *at), beat_at(*at)])
                .is_empty()
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
}
