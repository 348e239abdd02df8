//! The damage that a server has met since it began: rows that are not what was written, and a database that
//! is itself not sound.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Meaning, StoreError};

/// Rows that are remembered at the most; of more it is said that there are so many.
const MOST_ROWS: usize = 10_000;

/// Damage that was met. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Damage(Arc<Mutex<Met>>);

#[derive(Debug, Default)]
struct Met {
    rows: BTreeSet<(&'static str, String)>,
    is_of_the_database: bool,
}

/// How much damage a server has met since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DamageMet {
    /// Rows that are not what was written.
    pub rows: usize,
    /// Whether the database itself is not sound: its pages, its indices.
    pub is_of_the_database: bool,
}

impl Damage {
    fn met(&self) -> MutexGuard<'_, Met> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Remembers and counts an error that tells of damage; others are let pass.
    pub fn note(&self, error: &StoreError) {
        if error.meaning() != Meaning::Damaged {
            return;
        }
        let mut met = self.met();
        let what = match error.corrupt_row() {
            Some((what, of)) => {
                if met.rows.len() < MOST_ROWS {
                    met.rows.insert((what, of.to_owned()));
                }
                what
            }
            None => {
                met.is_of_the_database = true;
                "database"
            }
        };
        metrics::counter!("greybox_damage_met_total", "what" => what).increment(1);
    }

    /// How much damage was met since the server began.
    pub fn seen(&self) -> DamageMet {
        let met = self.met();
        DamageMet {
            rows: met.rows.len(),
            is_of_the_database: met.is_of_the_database,
        }
    }
}
