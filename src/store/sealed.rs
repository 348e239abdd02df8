//! Seals: a digest beside each row that something is computed from or answered with, so that a row which is
//! not what was written is found when it is read, and is named.
//!
//! A seal covers the name of the table, the key and the content, so that rows which stand in each other's place
//! are found too. It has 64 bits of SHA-256: a row that is damaged by chance passes once in 2⁶⁴ times, and a
//! number of 64 bits is what both databases store and compare without a detour. A seal has no secret, so it is
//! no guard against somebody who changes a row and its seal; no width would be.
//!
//! Most rows never change, and whoever writes one writes the seal. Of rows that change, and of small rows that
//! are written in several places, triggers take the seal away with each change, and the end of each transaction
//! seals them anew (`changes`): nobody who writes has to think of it, servers of earlier versions included.
//!
//! Rows from before there were seals have none. Such a row is taken as it is, and `greybox check` counts it.

pub(super) mod changes;
pub(super) mod check;
mod kinds;
mod seal;
mod tables;

#[cfg(test)]
pub(super) use kinds::sealed_tables;
#[cfg(test)]
pub(super) use seal::Column;
pub(super) use seal::Sealed;
pub(super) use tables::*;
