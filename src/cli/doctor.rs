//! `greybox doctor`: what a server would meet where it is started with some settings.

use super::error::CommandError;
use super::serve::block_on;
use crate::app::doctor::{self, DoctorFinding, MatterCondition};
use crate::config::Settings;
use clap::Args;

/// What `doctor` is given: what `serve` is given.
#[derive(Debug, Args)]
pub struct DoctorArguments {
    /// Print a JSON document for programs
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: Settings,
}

/// Says what a server would meet; fails where something is bad.
pub fn doctor(arguments: &DoctorArguments) -> Result<(), CommandError> {
    let findings = block_on(async { Ok(doctor::examine(&arguments.settings).await) })?;
    if arguments.json {
        let document = serde_json::to_string_pretty(&findings).map_err(CommandError::failed)?;
        println!("{document}");
    } else {
        for finding in &findings {
            println!("{}", line(finding));
        }
    }
    let is_bad = |finding: &&DoctorFinding| finding.condition == MatterCondition::Bad;
    match findings.iter().filter(is_bad).count() {
        0 => Ok(()),
        1 => Err(CommandError::failed("one matter is bad")),
        bad => Err(CommandError::failed(format!("{bad} matters are bad"))),
    }
}

/// A finding for people.
fn line(finding: &DoctorFinding) -> String {
    let condition = match finding.condition {
        MatterCondition::Good => "good",
        MatterCondition::Doubtful => "doubtful",
        MatterCondition::Bad => "BAD",
    };
    format!("{condition:<9} {:<11} {}", finding.about, finding.says)
}
