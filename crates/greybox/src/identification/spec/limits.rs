//! The `limits` section: when a job stops at the latest.

use greybox_numerics::parsing::reader::Field;
use greybox_numerics::settings;

settings! {
    /// When to stop at the latest.
    #[derive(Copy)]
    pub struct LimitsSpec {
        /// Computing time `[s]`; the best estimate so far is then the result.
        max_duration_s: f64 = 3600.0, above 0;
    }
}

impl LimitsSpec {
    /// The limits of a job that names none, on a server that allows so long `[s]`.
    #[must_use]
    pub fn within(longest: f64) -> LimitsSpec {
        let usual = LimitsSpec::default();
        LimitsSpec {
            max_duration_s: usual.max_duration_s.min(longest),
        }
    }
}

pub(super) fn read(field: &Field<'_>, longest: f64) -> LimitsSpec {
    let mut limits = LimitsSpec::within(longest);
    if let Some(mut object) = field.object() {
        if let Some(field) = object.optional("max_duration_s")
            && let Some(asked) = field.positive()
        {
            if asked > longest {
                let detail = format!("{asked} s is more than this server allows, {longest} s");
                field.fault("out_of_range", detail);
            }
            limits.max_duration_s = asked;
        }
        object.finish();
    }
    limits
}
