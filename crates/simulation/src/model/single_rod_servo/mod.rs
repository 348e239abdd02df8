//! The electro-hydraulic servo of the paper: valve, single-rod cylinder, mass on a spring.
//!
//! SI, absolute pressures, x in [0, L] from the retracted end, a positive spool extends. With
//! `ψ` of `orifice` and the opening u in [-1, 1]:
//!
//! ```text
//! u ≥ 0:  Q1 = Kq·u·ψ(ps − p1)     Q2 = Kq·u·ψ(p2 − pt)      Q1 into chamber 1, Q2 out of chamber 2
//! u < 0:  Q1 = Kq·u·ψ(p1 − pt)     Q2 = Kq·u·ψ(ps − p2)
//! ```
//!
//! and the pressures of `cylinder`, the motion of `load`, the spool of `servovalve`. The
//! paper's Eq. 1–6 are corrected in five places: the flow follows both signs of both pressure
//! drops, the ports switch with the sign of the spool, p2' has its sign turned round, the root
//! covers the pressure drop, and v' stands beside the other states. Its "C" and "B" are one
//! damping; its numbers (Km 16324.71 kgf/cm², Ks and C in N and cm) give the nominal rig.
//!
//! Exact symmetry: (M, B, Ks, Km, forces, pressures, d0)·λ with Kq/√λ and leakage/λ leaves x(t)
//! as it is, so position alone cannot tell the pressures and the mass apart.

mod cylinder;
mod description;
mod dynamics;
mod friction;
mod load;
mod orifice;
mod plant;
mod servovalve;

use super::Model;
use plant::Servo;
use std::sync::Arc;

/// The model with its description.
#[must_use]
pub fn model() -> Model {
    let description = description::describe();
    let n_outputs = description.outputs.len();
    Model::of_plant(description, Arc::new(Servo::new(n_outputs)))
}
