//! Recordings and the experiments cut from them.
