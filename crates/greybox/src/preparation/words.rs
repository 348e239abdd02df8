//! Steps in words.

use super::step::{PreparationStep, Trend};

/// Says what a step did.
pub(super) fn sentence(step: &PreparationStep) -> String {
    match step {
        PreparationStep::Cut { from_s, to_s } => match (from_s, to_s) {
            (Some(from), Some(to)) => format!("cut to {from} to {to} s"),
            (Some(from), None) => format!("cut from {from} s on"),
            (None, Some(to)) => format!("cut at {to} s"),
            (None, None) => "nothing cut".to_owned(),
        },
        PreparationStep::Remove { signals } => format!("{} left out", listed(signals)),
        PreparationStep::Median { signals, samples } => {
            format!("median of {samples} samples, {}", which(signals.as_deref()))
        }
        PreparationStep::LowPass { signals, cutoff_hz } => format!(
            "low pass at {cutoff_hz} Hz (Butterworth of second order, forwards and backwards), {}",
            which(signals.as_deref())
        ),
        PreparationStep::HighPass { signals, cutoff_hz } => format!(
            "high pass at {cutoff_hz} Hz (Butterworth of second order, forwards and backwards), {}",
            which(signals.as_deref())
        ),
        PreparationStep::Detrend { signals, trend } => {
            let trend = match trend {
                Trend::Mean => "mean",
                Trend::Line => "straight line",
                Trend::Slope => "slope",
            };
            format!("{trend} subtracted, {}", which(signals.as_deref()))
        }
        PreparationStep::Shift { signals, by_s } => {
            let direction = if *by_s < 0.0 { "earlier" } else { "later" };
            format!("{} moved {} s {direction}", listed(signals), by_s.abs())
        }
        PreparationStep::Resample {
            sample_time_s,
            held,
        } => match held.is_empty() {
            true => format!("on a grid of {sample_time_s} s"),
            false => format!("on a grid of {sample_time_s} s, {} held", listed(held)),
        },
        PreparationStep::Calculate {
            signal,
            equation,
            unit,
            names,
        } => {
            let unit = if unit.is_empty() {
                String::new()
            } else {
                format!(" [{unit}]")
            };
            let names = names
                .iter()
                .map(|(name, signal)| format!(", {name} is `{signal}`"));
            format!("`{signal}`{unit} = {equation}{}", names.collect::<String>())
        }
    }
}

fn which(signals: Option<&[String]>) -> String {
    signals.map_or_else(|| "all signals".to_owned(), listed)
}

fn listed(signals: &[String]) -> String {
    let quoted: Vec<String> = signals.iter().map(|name| format!("`{name}`")).collect();
    quoted.join(", ")
}
