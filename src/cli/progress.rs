//! A live line about an estimation: redrawn in place on a terminal, printed now and then
//! elsewhere.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Time between two lines where the line cannot be redrawn.
const LINE_INTERVAL: Duration = Duration::from_secs(2);

/// The parts of the bar.
const PARTS: u64 = 1000;

/// The live line.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    /// When the last line was printed, where lines are printed.
    printed: Option<Instant>,
    is_terminal: bool,
}

impl Progress {
    /// A line without content.
    pub fn new() -> Progress {
        let is_terminal = std::io::stderr().is_terminal();
        let bar = if is_terminal {
            ProgressBar::new(PARTS)
        } else {
            ProgressBar::hidden()
        };
        let style = ProgressStyle::with_template("[{elapsed}] {bar:20} {wide_msg}");
        bar.set_style(style.expect("the template is well formed"));
        Progress {
            bar,
            printed: None,
            is_terminal,
        }
    }

    /// Shows how far it is, 0 to 1, in words and as a bar.
    pub fn update(&mut self, fraction: f64, message: String) {
        self.bar.set_position((fraction * PARTS as f64) as u64);
        let is_due = self
            .printed
            .is_none_or(|printed| printed.elapsed() >= LINE_INTERVAL);
        if !self.is_terminal && is_due {
            eprintln!("{message}");
            self.printed = Some(Instant::now());
        }
        self.bar.set_message(message);
    }

    /// Ends the line, leaving its last state to be read.
    pub fn finish(&mut self) {
        if !self.is_terminal {
            eprintln!("{}", self.bar.message());
        }
        self.bar.abandon();
    }
}

/// A generation of the search in words.
pub fn generation<'a>(
    counts: [u64; 2],
    [cost, credit]: [Option<f64>; 2],
    best: impl Iterator<Item = (&'a str, f64)>,
) -> String {
    let number = |value: Option<f64>| value.map_or("-".to_owned(), super::table::short);
    let mut text = format!(
        "generation {} of at most {}  cost {}  credit {}",
        counts[0],
        counts[1],
        number(cost),
        number(credit)
    );
    for (name, value) in best {
        text += &format!("  {name} {}", super::table::short(value));
    }
    text
}

/// How far the chains of a posterior came, in words.
pub fn posterior(counts: [u64; 2], r_hat: Option<f64>) -> String {
    let r_hat = r_hat.map_or("-".to_owned(), super::table::short);
    format!(
        "posterior {} of at most {}  R̂ {r_hat}",
        counts[0], counts[1]
    )
}

/// An iteration of the refinement in words.
pub fn refinement(iteration: u64, cost: f64) -> String {
    format!("refinement {iteration}  cost {}", super::table::short(cost))
}
