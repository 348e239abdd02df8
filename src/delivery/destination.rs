//! Where events may be delivered: to what the operator names, and to no private address that is not
//! named too.
//!
//! A server inside a plant reaches much that its clients do not; it must not be made to ask that for
//! them. A name is resolved once, by whoever connects, so that it cannot mean something else the next
//! time (DNS rebinding).

use std::net::IpAddr;
use std::str::FromStr;

use ipnet::IpNet;
use url::Url;

/// The longest address of a receiver.
const LONGEST_URL: usize = 2000;

/// What is not to be asked although no network says so: of IPv4 what RFC 6890 lists as not global.
const NOT_PUBLIC: [&str; 14] = [
    "0.0.0.0/8",
    "10.0.0.0/8",
    "100.64.0.0/10",
    "127.0.0.0/8",
    "169.254.0.0/16",
    "172.16.0.0/12",
    "192.0.0.0/24",
    "192.0.2.0/24",
    "192.168.0.0/16",
    "198.18.0.0/15",
    "198.51.100.0/24",
    "203.0.113.0/24",
    "224.0.0.0/4",
    "240.0.0.0/4",
];
/// The public part of IPv6, from which addresses that stand for one of IPv4 or for documentation are taken away.
const PUBLIC_V6: &str = "2000::/3";
const NOT_PUBLIC_V6: [&str; 3] = ["2001::/23", "2001:db8::/32", "2002::/16"];

/// What the operator allows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Destinations {
    any_public: bool,
    names: Vec<String>,
    networks: Vec<IpNet>,
}

/// A text that is no destination.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no destination: a name, `*.` and a name, an address, a network, or `*`")]
pub struct InvalidDestination(String);

/// Why nothing is delivered to an address.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RefusedDestination {
    /// It is no address of a web server.
    #[error("`{0}` is no address of the form https://name/path, without a user in it")]
    Form(String),
    /// The operator does not name it.
    #[error(
        "nothing is delivered to `{0}`: the server is started with the destinations that it may \
         deliver to (--webhook-to)"
    )]
    NotNamed(String),
    /// It is an address of the inside.
    #[error(
        "nothing is delivered to {0}, which is not a public address: the server has to be told its \
         network too (--webhook-to)"
    )]
    NotPublic(IpAddr),
}

impl Destinations {
    /// Destinations from their texts.
    ///
    /// # Errors
    /// One is no destination.
    pub fn new<'a>(texts: impl IntoIterator<Item = &'a str>) -> Result<Self, InvalidDestination> {
        let mut all = Self::default();
        for text in texts {
            let text = text.trim().to_ascii_lowercase();
            if text == "*" {
                all.any_public = true;
            } else if let Ok(address) = text.parse::<IpAddr>() {
                all.networks.push(address.into());
            } else if let Ok(network) = IpNet::from_str(&text) {
                all.networks.push(network);
            } else if is_name(text.strip_prefix("*.").unwrap_or(&text)) {
                all.names.push(text);
            } else {
                return Err(InvalidDestination(text));
            }
        }
        Ok(all)
    }

    /// Whether something may be delivered to an address, as far as its text says.
    ///
    /// # Errors
    /// It may not.
    pub fn check(&self, url: &str) -> Result<Url, RefusedDestination> {
        let shown: String = url.chars().take(200).collect();
        let form = || RefusedDestination::Form(shown.clone());
        let parsed = Url::parse(url).map_err(|_| form())?;
        let is_web = matches!(parsed.scheme(), "http" | "https");
        let has_user = !parsed.username().is_empty() || parsed.password().is_some();
        let host = parsed.host_str().filter(|_| is_web && !has_user);
        let host = host.filter(|_| url.len() <= LONGEST_URL).ok_or_else(form)?;
        let bare = host.trim_start_matches('[').trim_end_matches(']');
        match bare.parse::<IpAddr>() {
            Ok(address) => {
                self.check_address(address)?;
                if !self.any_public && !self.is_in_network(address) {
                    return Err(RefusedDestination::NotNamed(shown));
                }
            }
            Err(_) if self.any_public || self.names_host(host) => {}
            Err(_) => return Err(RefusedDestination::NotNamed(shown)),
        }
        Ok(parsed)
    }

    fn names_host(&self, host: &str) -> bool {
        let host = host.trim_end_matches('.').to_ascii_lowercase();
        self.names.iter().any(|name| match name.strip_prefix('*') {
            Some(end) => host.ends_with(end),
            None => host == *name,
        })
    }

    fn is_in_network(&self, address: IpAddr) -> bool {
        let address = address.to_canonical();
        self.networks
            .iter()
            .any(|network| network.contains(&address))
    }

    /// Whether an address that a name stands for may be asked.
    pub(super) fn check_address(&self, address: IpAddr) -> Result<(), RefusedDestination> {
        if is_public(address) || self.is_in_network(address) {
            Ok(())
        } else {
            Err(RefusedDestination::NotPublic(address.to_canonical()))
        }
    }
}

fn is_name(text: &str) -> bool {
    let is_label = |label: &str| {
        let is_letter = |b: u8| b.is_ascii_alphanumeric() || b == b'-' || b == b'_';
        (1..=63).contains(&label.len()) && label.bytes().all(is_letter)
    };
    text.len() <= 253 && text.split('.').all(is_label)
}

/// Whether an address is one of the public network.
fn is_public(address: IpAddr) -> bool {
    let address = address.to_canonical();
    let is_in = |network: &str| {
        let network: IpNet = network.parse().expect("the networks of this file");
        network.contains(&address)
    };
    match address {
        IpAddr::V4(_) => !NOT_PUBLIC.iter().any(|network| is_in(network)),
        IpAddr::V6(_) => is_in(PUBLIC_V6) && !NOT_PUBLIC_V6.iter().any(|network| is_in(network)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(destinations: &[&str], url: &str) -> Result<(), RefusedDestination> {
        let all = Destinations::new(destinations.iter().copied()).expect("destinations");
        all.check(url).map(drop)
    }

    #[test]
    fn only_what_is_named_is_delivered_to() {
        let named = ["mes.example.com", "*.plant.example", "10.1.0.0/16"];
        for url in [
            "https://mes.example.com/hook",
            "https://MES.example.com.:8443/",
            "http://a.plant.example/x",
            "http://10.1.2.3:9000/x",
        ] {
            assert_eq!(check(&named, url), Ok(()), "{url}");
        }
        for url in [
            "https://example.com/",
            "https://plant.example/",
            "https://mes.example.com.attacker.example/",
            "http://10.2.0.1/",
            "http://8.8.8.8/",
        ] {
            assert!(check(&named, url).is_err(), "{url}");
            assert!(check(&[], url).is_err(), "{url}");
        }
        assert_eq!(check(&["*"], "https://anything.example/"), Ok(()));
    }

    #[test]
    fn whatever_is_written_for_a_private_address_is_one() {
        for url in [
            "http://127.0.0.1/",
            "http://2130706433/",
            "http://0x7f.1/",
            "http://0177.0.0.1/",
            "http://[::1]/",
            "http://[::ffff:127.0.0.1]/",
            "http://[::ffff:a00:1]/",
            "http://[fe80::1]/",
            "http://[fd00::1]/",
            "http://[64:ff9b::7f00:1]/",
            "http://[2002:7f00:1::]/",
            "http://10.0.0.1/",
            "http://169.254.169.254/latest/meta-data",
            "http://192.168.1.1/",
            "http://172.31.0.1/",
            "http://100.64.0.1/",
            "http://0.0.0.0/",
        ] {
            let refused = check(&["*"], url);
            let is_private = matches!(refused, Err(RefusedDestination::NotPublic(_)));
            assert!(is_private, "{url}: {refused:?}");
        }
        assert_eq!(check(&["*"], "http://8.8.8.8/"), Ok(()));
        assert_eq!(check(&["*"], "http://[2606:4700::1111]/"), Ok(()));
        assert_eq!(check(&["127.0.0.1"], "http://127.0.0.1:99/"), Ok(()));
    }

    #[test]
    fn what_is_no_address_of_a_web_server_is_refused() {
        for url in [
            "",
            "mes.example.com",
            "file:///etc/passwd",
            "gopher://mes.example.com/",
            "https://user:word@mes.example.com/",
            "https://",
        ] {
            let refused = check(&["*"], url);
            assert!(
                matches!(refused, Err(RefusedDestination::Form(_))),
                "{url}: {refused:?}"
            );
        }
        for text in ["http://mes", "a b", "*.*", "", "10.0.0.0/99"] {
            assert!(Destinations::new([text]).is_err(), "{text}");
        }
    }
}
