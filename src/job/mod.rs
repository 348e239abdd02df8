//! What a job is: its specification, its life, its events and its outcome. Pure types.
