//! Which experiment next: the one that most shrinks what is not known of some of the unknowns.
//!
//! With J the derivatives of an experiment's outputs by the unknowns and the assumptions, each
//! divided by its output's noise, an experiment adds `JᵀJ` to what is known before: priors,
//! tolerances, and the data of an earlier estimate. Of the sum the part of the wanted unknowns,
//! with all others eliminated (the Schur complement), is the inverse of their covariance with
//! everything that is not known. Its determinant is made largest (the D-criterion; for a single
//! unknown that is its variance; A. C. Atkinson, A. N. Donev, R. D. Tobias, *Optimum Experimental
//! Designs*, 2007, ch. 10 and 17).
//!
//! J depends on the unknowns themselves, so the logarithm of the determinant is averaged over
//! several points of what is known of them at present, drawn with a seed, the first of them the
//! middle ([`Present`]). An experiment that cannot be simulated at a point tells nothing there.
//!
//! An [`Excitation`] with few numbers is searched over those numbers ([`search`]); instants to
//! measure at are chosen from candidates ([`instants`]). Windows of what was recorded before are chosen like
//! experiments whose inputs are known already ([`history`]).

mod assessment;
mod information;
mod present;

pub mod excitation;
pub mod history;
pub mod instants;
pub mod search;

pub use assessment::Assessment;
pub use excitation::{Excitation, Grid, Limits};
pub use information::Known;
pub use present::{Past, Present};
