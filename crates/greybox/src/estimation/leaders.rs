//! The best candidates of a search that are not alike: those that the refinement starts from.

use crate::genetic::{Chromosome, Encoding};
use serde::{Deserialize, Serialize};

/// A candidate and its cost.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Judged {
    /// The string of the candidate.
    pub chromosome: Chromosome,
    /// The cost of the candidate.
    pub cost: f64,
}

/// Two leaders differ by at least this share of the range in one coordinate.
const SMALLEST_DISTANCE: f64 = 0.02;

/// Enters a candidate among `places` leaders, in place of those that it resembles and beats; the
/// leaders stay sorted by cost.
pub fn enter(leaders: &mut Vec<Judged>, candidate: Judged, places: usize, encoding: Encoding) {
    let worst = leaders.last().map_or(f64::INFINITY, |leader| leader.cost);
    if leaders.len() >= places && candidate.cost >= worst {
        return;
    }
    let positions = encoding.decode(&candidate.chromosome);
    let alike = |leader: &Judged| {
        let decoded = encoding.decode(&leader.chromosome);
        let pairs = positions.iter().zip(decoded);
        pairs
            .into_iter()
            .all(|(a, b)| (a - b).abs() < SMALLEST_DISTANCE)
    };
    let beaten = |leader: &Judged| leader.cost <= candidate.cost && alike(leader);
    if leaders.iter().any(beaten) {
        return;
    }
    leaders.retain(|leader| !alike(leader));
    leaders.push(candidate);
    leaders.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    leaders.truncate(places);
}
