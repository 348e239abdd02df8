//! Who may do what.
//!
//! A *project* is a name space: jobs, recordings, models and comparisons of one are not seen from
//! another. A program asks with a [`token`](Secret) that is bound to one project and one [`Scope`];
//! people sign in at an identity provider or come through a proxy that knows them, and have the [`Role`] of one of their
//! groups. A server without tokens, provider and proxies listens to its own machine alone and lets everybody there do everything
//! in the project `default`.

mod project;
mod role;
mod scope;
mod secret;
mod stream_names;

use std::time::Duration;

pub use project::{InvalidProject, Project};
pub use role::{InvalidRole, Role, Roles};
pub use scope::{InvalidScope, Scope};
pub use secret::{Digest, Secret, random_bytes};
pub use stream_names::{InvalidStreamNames, StreamNames, is_stream_name};

/// For how long a server believes what it read of a token. Whoever revokes a token waits for as long
/// before the token is said to be revoked.
pub const BELIEVED: Duration = Duration::from_secs(1);
