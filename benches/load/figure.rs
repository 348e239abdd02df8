//! One measured figure beside its target, and what is made of many samples.

use std::time::Duration;

/// What a figure should reach.
#[derive(Clone, Copy)]
pub enum Target {
    /// So much or more.
    AtLeast(f64),
    /// Less than so much.
    Below(f64),
    /// Told for the record.
    None,
}

/// A line of the table.
pub struct Figure {
    what: String,
    value: f64,
    unit: &'static str,
    target: Target,
    /// One-minute load average of the machine when it was measured.
    load: String,
}

impl Figure {
    /// A figure that was measured just now.
    pub fn new(what: impl Into<String>, value: f64, unit: &'static str, target: Target) -> Self {
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        Self {
            what: what.into(),
            value,
            unit,
            target,
            load: load.split(' ').next().unwrap_or("").to_owned(),
        }
    }

    /// Prints it as a row of the table.
    pub fn print(&self) {
        let Self {
            what,
            value,
            unit,
            target,
            load,
        } = self;
        let (target, reached) = match *target {
            Target::AtLeast(least) => (format!("≥ {least} {unit}"), *value >= least),
            Target::Below(limit) => (format!("< {limit} {unit}"), *value < limit),
            Target::None => (String::new(), true),
        };
        let missed = if reached { "" } else { "missed" };
        let decimals = match value.abs() {
            100.0.. => 0,
            _ if value.fract() == 0.0 => 0,
            10.0.. => 1,
            _ => 2,
        };
        println!("| {what} | {value:.decimals$} {unit} | {target} | {missed} | {load} |");
    }
}

/// Prints what the rows stand below.
pub fn print_head() {
    println!("| point | figure | target | | load of the machine |");
    println!("|---|---|---|---|---|");
}

/// The value that a share of the samples does not exceed [ms].
pub fn percentile_ms(samples: &mut [Duration], share: f64) -> f64 {
    if samples.is_empty() {
        return f64::NAN;
    }
    samples.sort_unstable();
    let place = (share * samples.len() as f64).ceil() as usize;
    samples[place.clamp(1, samples.len()) - 1].as_secs_f64() * 1e3
}
