//! Trajectories and numbers that other programs computed.

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot read its own files has failed"
)]

mod servo_trajectories;
mod test_set;
