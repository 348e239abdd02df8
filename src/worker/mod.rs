//! Works jobs off the queue, a slice at a time.
