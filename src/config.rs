//! Every setting, default and limit; the only reader of the environment.
