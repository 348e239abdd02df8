//! Networks as settings name them.

use std::net::IpAddr;

use ipnet::IpNet;

use super::SettingsError;

/// A network, or the one address of a text.
pub(super) fn network(text: &str) -> Result<IpNet, SettingsError> {
    let network = text.parse::<IpAddr>().map(IpNet::from);
    network
        .or_else(|_| text.parse())
        .map_err(|_| SettingsError::Network(text.to_owned()))
}
