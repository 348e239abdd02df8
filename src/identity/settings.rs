//! How the provider is reached, and what this server is to it.

use std::net::IpAddr;

use rustls::RootCertStore;
use url::{Host, Url};

/// A provider as the operator names it.
#[derive(Clone, Debug)]
pub struct ProviderSettings {
    /// The issuer, as the provider writes it; the provider is discovered below it.
    pub issuer: String,
    /// The name of this server at the provider.
    pub client_id: String,
    /// The secret of this server at the provider, where the provider gave one.
    pub client_secret: Option<String>,
    /// The scopes that the provider is asked for beside `openid`.
    pub scopes: Vec<String>,
    /// The claim with the name of the person.
    pub name_claim: String,
    /// The claim with the groups of the person.
    pub groups_claim: String,
    /// Where the provider sends a browser back to.
    pub callback: Url,
    /// The authorities that sign the certificate of the provider.
    pub authorities: RootCertStore,
}

/// An address that cannot be used with a provider.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{address}` cannot be used to sign in: {why}")]
pub struct InvalidProvider {
    address: String,
    why: String,
}

impl InvalidProvider {
    fn new(address: &str, why: impl ToString) -> Self {
        Self {
            address: address.to_owned(),
            why: why.to_string(),
        }
    }
}

/// An address that secrets may be sent to: over TLS, or within this machine.
///
/// # Errors
/// The text is no address, or nobody would keep a secret that is sent there.
pub fn secure_address(text: &str) -> Result<Url, InvalidProvider> {
    let url = Url::parse(text).map_err(|error| InvalidProvider::new(text, error))?;
    let is_here = match url.host() {
        Some(Host::Domain(name)) => name == "localhost",
        Some(Host::Ipv4(address)) => IpAddr::from(address).is_loopback(),
        Some(Host::Ipv6(address)) => IpAddr::from(address).is_loopback(),
        None => return Err(InvalidProvider::new(text, "it names no host")),
    };
    if !url.username().is_empty() || url.password().is_some() || url.fragment().is_some() {
        let why = "it has a user, a password or a fragment";
        return Err(InvalidProvider::new(text, why));
    }
    match url.scheme() {
        "https" => Ok(url),
        "http" if is_here => Ok(url),
        _ => {
            let why = "it begins with https:// (http:// is for this machine alone)";
            Err(InvalidProvider::new(text, why))
        }
    }
}

/// The address that the provider sends browsers back to, below the address of this server.
///
/// # Errors
/// The address of this server is none, or has a path.
pub fn callback(server: &str, path: &str) -> Result<Url, InvalidProvider> {
    let server_url = secure_address(server)?;
    if server_url.path() != "/" || server_url.query().is_some() {
        let why = "the page is at the root of the server, so that the address has no path";
        return Err(InvalidProvider::new(server, why));
    }
    let callback = server_url.join(path);
    callback.map_err(|error| InvalidProvider::new(server, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_go_over_tls_or_stay_on_the_machine() {
        for text in [
            "https://login.plant.example/realms/hall-2",
            "http://127.0.0.1:8081/",
            "http://[::1]:8081",
            "http://localhost:8081",
        ] {
            assert!(secure_address(text).is_ok(), "{text}");
        }
        for text in [
            "http://login.plant.example",
            "http://127.0.0.1.attacker.example",
            "https://operator:secret@login.plant.example",
            "ftp://localhost",
            "login.plant.example",
            "https://login.plant.example/#x",
        ] {
            assert!(secure_address(text).is_err(), "{text}");
        }
    }

    #[test]
    fn the_page_is_at_the_root() {
        let back = callback("https://greybox.plant.example", "/v1/session/callback");
        let back = back.expect("an address").to_string();
        assert_eq!(back, "https://greybox.plant.example/v1/session/callback");
        assert!(callback("https://plant.example/greybox", "/back").is_err());
    }
}
