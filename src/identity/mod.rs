//! People who sign in at the plant's own identity provider, by OpenID Connect: the code flow with PKCE
//! (OpenID Connect Core 1.0, RFC 6749, RFC 7636).
//!
//! A browser that signs in is sent to the provider and comes back with a code, which the server turns into an ID
//! token: a text that the provider signed and that says who the person is and in which groups. What the server
//! remembers of the attempt between the two is one secret in a cookie ([`SignInAttempt`]), so that any node of a
//! cluster ends what another began.

mod attempt;
mod claims;
mod id_token;
mod keys;
mod provider;
mod settings;

pub use attempt::SignInAttempt;
pub use claims::Person;
pub use provider::{Provider, ProviderError};
pub use settings::{InvalidProvider, ProviderSettings, callback, secure_address};
