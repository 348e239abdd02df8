//! Which recordings there are, and what tells them apart.

use serde::Deserialize;
use utoipa::ToSchema;

/// The time from one sample to the next `[s]`.
pub const SAMPLE_TIME: f64 = 0.01;

/// Samples of a recording: 120 s.
pub const SAMPLES: usize = 12_000;

/// One of the recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Demo {
    /// The nominal rig under a rich excitation.
    A,
    /// An imperfect rig under the excitation of the paper.
    B,
    /// The nominal rig under a rich excitation, with both chamber pressures recorded.
    C,
    /// The imperfect rig of B under the excitation of A.
    D,
}

impl Demo {
    /// All of them.
    pub const ALL: [Demo; 4] = [Demo::A, Demo::B, Demo::C, Demo::D];

    /// The letter that names it.
    #[must_use]
    pub fn letter(self) -> char {
        match self {
            Demo::A => 'A',
            Demo::B => 'B',
            Demo::C => 'C',
            Demo::D => 'D',
        }
    }

    pub(super) fn has_imperfect_rig(self) -> bool {
        matches!(self, Demo::B | Demo::D)
    }

    pub(super) fn has_paper_excitation(self) -> bool {
        self == Demo::B
    }

    pub(super) fn has_pressure_sensors(self) -> bool {
        self == Demo::C
    }
}
