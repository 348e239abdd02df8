//! How many connections one address has: so many at the most, so that none takes those of all others.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::Arc;

use ipnet::IpNet;
use parking_lot::Mutex;

/// The bits of an address of IPv6 that stand for a site; whoever has one has all addresses in it.
const SITE_BITS: u32 = 64;

/// The connections of each address. Cheap to clone.
#[derive(Clone)]
pub(super) struct Addresses {
    most: usize,
    /// Proxies, who stand for many.
    free: Arc<[IpNet]>,
    open: Arc<Mutex<HashMap<IpAddr, usize>>>,
}

impl Addresses {
    /// Counts of up to `most` connections of each address; addresses of proxies are not counted.
    pub(super) fn new(most: usize, proxies: &[IpNet]) -> Self {
        Self {
            most,
            free: proxies.into(),
            open: Arc::default(),
        }
    }

    /// A place for one more connection of an address; nothing where it has as many as it may.
    pub(super) fn place(&self, peer: IpAddr) -> Option<Place> {
        let peer = peer.to_canonical();
        let most = match self.free.iter().any(|net| net.contains(&peer)) {
            true => usize::MAX,
            false => self.most,
        };
        let site = site(peer);
        let mut open = self.open.lock();
        let connections = open.entry(site).or_insert(0);
        if *connections >= most {
            return None;
        }
        *connections += 1;
        Some(Place {
            addresses: self.clone(),
            site,
        })
    }
}

fn site(address: IpAddr) -> IpAddr {
    match address {
        IpAddr::V4(_) => address,
        IpAddr::V6(address) => {
            let bits = u128::from(address) >> SITE_BITS << SITE_BITS;
            Ipv6Addr::from(bits).into()
        }
    }
}

/// The place of a connection, until it is dropped.
pub(super) struct Place {
    addresses: Addresses,
    site: IpAddr,
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut open = self.addresses.open.lock();
        if let Some(connections) = open.get_mut(&self.site) {
            *connections -= 1;
            if *connections == 0 {
                open.remove(&self.site);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ip(text: &str) -> IpAddr {
        text.parse().expect("an address")
    }

    #[test]
    fn an_address_has_so_many_places_and_proxies_have_all() {
        let proxies = ["10.0.0.7/32".parse().expect("a network")];
        let addresses = Addresses::new(1, &proxies);
        let first = addresses.place(ip("10.0.0.1"));
        assert!(first.is_some());
        assert!(addresses.place(ip("10.0.0.1")).is_none());
        assert!(addresses.place(ip("::ffff:10.0.0.1")).is_none());
        let _other = addresses.place(ip("10.0.0.2")).expect("its own place");
        let _proxy = addresses.place(ip("10.0.0.7")).expect("a place");
        let _again = addresses.place(ip("10.0.0.7")).expect("another place");
        drop(first);
        assert!(addresses.place(ip("10.0.0.1")).is_some());
        // Nothing is remembered of whoever has left.
        assert_eq!(addresses.open.lock().len(), 2);
    }

    #[test]
    fn a_site_of_ipv6_is_one_address() {
        let addresses = Addresses::new(1, &[]);
        let _place = addresses.place(ip("2001:db8::1")).expect("a place");
        assert!(addresses.place(ip("2001:db8::2")).is_none());
        assert!(addresses.place(ip("2001:db8:0:1::2")).is_some());
    }
}
