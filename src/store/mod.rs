//! The only SQL: jobs, queue entries, events, checkpoints, results and datasets in SQLite.
