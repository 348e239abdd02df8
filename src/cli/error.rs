//! What ends a command early, and the exit code that says of what kind it was.

use greybox::parsing::Fault;
use std::fmt;
use std::process::ExitCode;

/// The most faults that are shown.
const MOST_FAULTS_SHOWN: usize = 50;

/// Why a command did not do what it was asked.
#[derive(Debug)]
pub struct CommandError {
    sentences: Vec<String>,
    code: u8,
}

impl CommandError {
    /// An error of one wrong input.
    pub fn input(sentence: impl fmt::Display) -> CommandError {
        CommandError::inputs([sentence])
    }

    /// An error of an input that is wrong in several places.
    pub fn inputs(sentences: impl IntoIterator<Item = impl fmt::Display>) -> CommandError {
        let sentences = sentences.into_iter().map(|sentence| sentence.to_string());
        CommandError {
            sentences: sentences.collect(),
            code: 2,
        }
    }

    /// Faults in a file, each with its place.
    pub fn faults(file: impl fmt::Display, faults: &[Fault]) -> CommandError {
        CommandError::inputs(faults.iter().map(|fault| format!("{file}: {fault}")))
    }

    /// Something failed on the way.
    pub fn failed(sentence: impl fmt::Display) -> CommandError {
        CommandError {
            sentences: vec![sentence.to_string()],
            code: 1,
        }
    }

    /// What the process ends with.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.code)
    }
}

impl fmt::Display for CommandError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = self.sentences.iter().take(MOST_FAULTS_SHOWN);
        for (place, sentence) in shown.enumerate() {
            let newline = if place > 0 { "\n" } else { "" };
            write!(formatter, "{newline}error: {sentence}")?;
        }
        match self.sentences.len().saturating_sub(MOST_FAULTS_SHOWN) {
            0 => Ok(()),
            more => write!(formatter, "\nerror: and {more} more"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_a_line_with_its_file_and_place() {
        let faults = [
            Fault::new("/seed", "out_of_range", "-1 is below 0"),
            Fault::new("", "empty", "nothing is free"),
        ];
        let error = CommandError::faults("job.json", &faults);
        let expected = "error: job.json: /seed: -1 is below 0\nerror: job.json: nothing is free";
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn a_flood_of_faults_ends_with_their_number() {
        let text = CommandError::inputs(0..60).to_string();
        assert_eq!(text.lines().count(), 51);
        assert!(text.ends_with("error: and 10 more"));
    }
}
