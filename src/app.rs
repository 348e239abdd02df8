//! The composition root: store, events, worker and router, started in order and stopped in reverse.
