//! The promises of the service, each held against the program itself: a process that is started,
//! killed and asked over its socket.
//!
//! | promise | test |
//! |---|---|
//! | P1 an accepted job survives kill -9 | [`kill`] |
//! | P2 one terminal state, one result | [`kill`] |
//! | P3 a crash costs at most a slice | [`kill`], [`disk`] |
//! | P4 the same bits whatever the threads, slices, nodes and crashes | [`kill`], [`nodes`], [`posterior`] |
//! | P5 event ids without gap or repeat | [`kill`] |
//! | P6 cancel and pause within 2 s | [`stop`] |
//! | P7 an orderly end within 5 s | [`stop`] |
//! | P8 one key, one job | [`kill`], and `tests/service/idempotency.rs` |
//! | P9 one bad job stops no other | [`isolation`], and `tests/service/slow.rs` |
//! | the same for the windows of a monitor | [`watch`] |
//! | no sample of a stream is lost, moved or made up | [`streams`] |
//! | events reach a receiver at least once | [`deliveries`] |
//! | spans reach a collector | [`traces`] |
//! | no body takes more than four times its size and 64 MiB of memory | [`memory`] |
//! | P10 no request makes a 500 | `tests/service/faults.rs` |

#[path = "../../src/store/tests/cluster.rs"]
mod cluster;
mod deliveries;
mod disk;
mod follower;
mod hostile;
mod isolation;
mod kill;
mod memory;
mod nodes;
mod plant;
mod posterior;
mod server;
mod stop;
mod streams;
mod traces;
mod watch;
