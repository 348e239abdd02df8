//! Trajectories and numbers that other programs computed.

mod servo_trajectories;
