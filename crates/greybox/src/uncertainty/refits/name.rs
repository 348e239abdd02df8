//! The names of refits. Checkpoints and the parts that nodes share carry them as text.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt;
use std::str::FromStr;

/// What a refit fits.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum RefitName {
    /// The estimate, with outputs weighed anew.
    Reweighted {
        /// How often the outputs were weighed anew before.
        round: u32,
    },
    /// The estimate, with what is taken as known where the data and the tolerances put it.
    Nuisances {
        /// How many steps were tried before.
        round: u32,
    },
    /// A model without some of the effects that may be left out.
    Effects {
        /// The effects that the model has.
        effects: Vec<String>,
        /// Whether the fit is finely simulated, from where a coarse one ended.
        is_fine: bool,
    },
    /// The unknowns of the plant and those of a noise model.
    ProcessNoise {
        /// The place of the noise model among those that are compared.
        model: u32,
    },
    /// All coordinates but one that is held.
    Profile {
        /// The coordinate that is held.
        coordinate: usize,
        /// The bits of the position at which the coordinate is held.
        position: u64,
    },
    /// The estimate, with residuals drawn anew.
    Bootstrap {
        /// Which of the drawings.
        sample: u32,
    },
    /// The estimate, with residuals and assumptions drawn anew.
    MonteCarlo {
        /// Which of the drawings.
        sample: u32,
    },
    /// A stretch of the chains of a posterior.
    Posterior {
        /// How many stretches went before.
        stretch: u32,
    },
}

impl RefitName {
    /// Names the refit of all coordinates but one that is held at a position.
    #[must_use]
    pub fn profile(coordinate: usize, position: f64) -> RefitName {
        RefitName::Profile {
            coordinate,
            position: position.to_bits(),
        }
    }

    /// Returns the number by which all nodes cut refits into the same shares, whatever build each
    /// node runs; none for a refit that all other refits wait for. The refits of one sequence have
    /// one number.
    #[must_use]
    pub fn number(&self) -> Option<u64> {
        match self {
            RefitName::Reweighted { .. }
            | RefitName::Nuisances { .. }
            | RefitName::Posterior { .. } => None,
            _ => Some(number_of(&self.group())),
        }
    }

    /// The beginning of the name that the refits of one sequence have in common.
    fn group(&self) -> String {
        match self {
            RefitName::Reweighted { round } => format!("reweighted/{round}"),
            RefitName::Nuisances { round } => format!("nuisances/{round}"),
            RefitName::Effects { effects, .. } => format!("effects/{}", effects.join(", ")),
            RefitName::ProcessNoise { model } => format!("process_noise/{model}"),
            RefitName::Profile { coordinate, .. } => format!("profile/{coordinate}"),
            RefitName::Bootstrap { sample } => format!("bootstrap/{sample}"),
            RefitName::MonteCarlo { sample } => format!("monte_carlo/{sample}"),
            RefitName::Posterior { stretch } => format!("posterior/{stretch}"),
        }
    }
}

/// The first eight bytes of the SHA-256 of a text.
fn number_of(text: &str) -> u64 {
    let digest = Sha256::digest(text);
    digest[..8]
        .iter()
        .fold(0, |number, byte| number << 8 | u64::from(*byte))
}

impl fmt::Display for RefitName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.group())?;
        match self {
            RefitName::Effects { is_fine: true, .. } => f.write_str("/fine"),
            RefitName::Effects { is_fine: false, .. } => f.write_str("/coarse"),
            RefitName::Profile { position, .. } => write!(f, "/{:e}", f64::from_bits(*position)),
            _ => Ok(()),
        }
    }
}

/// A text that names no refit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not the name of a refit")]
pub struct InvalidRefitName(String);

impl FromStr for RefitName {
    type Err = InvalidRefitName;

    fn from_str(text: &str) -> Result<RefitName, InvalidRefitName> {
        parsed(text).ok_or_else(|| InvalidRefitName(text.to_owned()))
    }
}

fn parsed(text: &str) -> Option<RefitName> {
    let (kind, which) = text.split_once('/')?;
    Some(match kind {
        "reweighted" => RefitName::Reweighted {
            round: which.parse().ok()?,
        },
        "nuisances" => RefitName::Nuisances {
            round: which.parse().ok()?,
        },
        "effects" => {
            let (effects, accuracy) = which.rsplit_once('/')?;
            let effects = effects.split(", ").filter(|effect| !effect.is_empty());
            RefitName::Effects {
                effects: effects.map(str::to_owned).collect(),
                is_fine: match accuracy {
                    "coarse" => false,
                    "fine" => true,
                    _ => return None,
                },
            }
        }
        "process_noise" => RefitName::ProcessNoise {
            model: which.parse().ok()?,
        },
        "profile" => {
            let (coordinate, position) = which.split_once('/')?;
            RefitName::profile(coordinate.parse().ok()?, position.parse().ok()?)
        }
        "bootstrap" => RefitName::Bootstrap {
            sample: which.parse().ok()?,
        },
        "monte_carlo" => RefitName::MonteCarlo {
            sample: which.parse().ok()?,
        },
        "posterior" => RefitName::Posterior {
            stretch: which.parse().ok()?,
        },
        _ => return None,
    })
}

impl From<RefitName> for String {
    fn from(name: RefitName) -> String {
        name.to_string()
    }
}

impl TryFrom<String> for RefitName {
    type Error = InvalidRefitName;

    fn try_from(text: String) -> Result<RefitName, InvalidRefitName> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `printf profile/4 | sha256sum` begins with e0590f96736ed77a.
    #[test]
    fn every_build_cuts_the_same_shares() {
        let number = RefitName::profile(4, 0.25).number();
        assert_eq!(number, Some(16_165_969_476_279_261_050));
    }

    /// The texts are those that checkpoints of commit 2eabe3d carry, with `nuisances` and `posterior` beside them.
    #[test]
    fn names_are_written_as_they_were_and_read_back() {
        let effects = |effects: &[&str], is_fine| RefitName::Effects {
            effects: effects.iter().map(|effect| (*effect).to_owned()).collect(),
            is_fine,
        };
        let names = [
            (RefitName::Reweighted { round: 3 }, "reweighted/3"),
            (RefitName::Nuisances { round: 12 }, "nuisances/12"),
            (effects(&[], false), "effects//coarse"),
            (
                effects(&["drag", "lag[0]"], true),
                "effects/drag, lag[0]/fine",
            ),
            (
                RefitName::profile(2, 0.1 + 0.2),
                "profile/2/3.0000000000000004e-1",
            ),
            (RefitName::profile(0, 0.0), "profile/0/0e0"),
            (RefitName::Bootstrap { sample: 63 }, "bootstrap/63"),
            (RefitName::MonteCarlo { sample: 0 }, "monte_carlo/0"),
            (RefitName::Posterior { stretch: 7 }, "posterior/7"),
        ];
        for (name, text) in names {
            assert_eq!(name.to_string(), text);
            assert_eq!(text.parse(), Ok(name));
        }
    }

    #[test]
    fn other_texts_name_no_refit() {
        for text in [
            "",
            "bootstrap",
            "bootstrap/x",
            "effects/a/finer",
            "search/1/begun",
        ] {
            let parsed: Result<RefitName, _> = text.parse();
            assert_eq!(parsed, Err(InvalidRefitName(text.to_owned())));
        }
    }
}
