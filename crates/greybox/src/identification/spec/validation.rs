//! The `validation` section: what is held back to check the result.

use greybox_numerics::settings;

settings! {
    /// Which data are held back to check the result.
    #[derive(Copy)]
    pub struct ValidationSpec {
        /// The share of each experiment, at its end, that the estimation does not see.
        fraction: f64 = 0.25, from 0, to 0.9;
    }
}
