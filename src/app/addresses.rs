//! How many connections one address has and how fast it opens them, so that none takes those of all others or the
//! time of the server.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::Arc;
use std::time::Instant;

use ipnet::IpNet;
use parking_lot::Mutex;

use crate::allowance::{Allowance, Rate};

/// The bits of an address of IPv6 that stand for a site; whoever has one has all addresses in it.
const SITE_BITS: u32 = 64;

/// Connections that one address opens a second in the long run. A client that keeps its connections opens few.
const OPENED_PER_SECOND: f64 = 500.0;
/// Addresses that are remembered before those that may open all of theirs again are forgotten.
const REMEMBERED: usize = 10_000;

/// The connections of each address. Cheap to clone.
#[derive(Clone)]
pub(super) struct Addresses {
    most: usize,
    rate: Rate,
    /// Proxies, who stand for many.
    free: Arc<[IpNet]>,
    sites: Arc<Mutex<HashMap<IpAddr, AddressUse>>>,
}

/// The connections that an address has open, and those that it may open now.
struct AddressUse {
    open: usize,
    opening: Allowance,
}

impl Addresses {
    /// Counts of up to `most` connections of each address, all of which it may open at once after a pause; addresses of
    /// proxies are not counted.
    pub(super) fn new(most: usize, proxies: &[IpNet]) -> Self {
        let rate = Rate {
            per_second: OPENED_PER_SECOND,
            at_once: most as f64,
        };
        Self {
            most,
            rate,
            free: proxies.into(),
            sites: Arc::default(),
        }
    }

    /// A place for one more connection of an address that opens it now; nothing where it has as many as it may, or
    /// opens them too fast.
    pub(super) fn place(&self, peer: IpAddr, now: Instant) -> Option<Place> {
        let peer = peer.to_canonical();
        let is_free = self.free.iter().any(|net| net.contains(&peer));
        let mut sites = self.sites.lock();
        if sites.len() >= REMEMBERED {
            sites.retain(|_, site| site.open > 0 || !site.opening.is_whole(self.rate, now));
        }
        let address = site_of(peer);
        let site = sites.entry(address).or_insert(AddressUse {
            open: 0,
            opening: Allowance::of(self.rate, now),
        });
        let may_open = site.open < self.most && site.opening.take(self.rate, now).is_ok();
        if !(is_free || may_open) {
            return None;
        }
        site.open += 1;
        Some(Place {
            addresses: self.clone(),
            site: address,
        })
    }
}

fn site_of(address: IpAddr) -> IpAddr {
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
        if let Some(site) = self.addresses.sites.lock().get_mut(&self.site) {
            site.open -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;
    use std::time::Duration;

    use super::*;

    fn ip(text: &str) -> IpAddr {
        text.parse().expect("an address")
    }

    #[test]
    fn an_address_has_so_many_places_and_proxies_have_all() {
        let proxies = ["10.0.0.7/32".parse().expect("a network")];
        let addresses = Addresses::new(1, &proxies);
        let now = Instant::now();
        let first = addresses.place(ip("10.0.0.1"), now);
        assert!(first.is_some());
        assert!(addresses.place(ip("10.0.0.1"), now).is_none());
        assert!(addresses.place(ip("::ffff:10.0.0.1"), now).is_none());
        let _other = addresses.place(ip("10.0.0.2"), now).expect("its own place");
        let _proxy = addresses.place(ip("10.0.0.7"), now).expect("a place");
        let _again = addresses.place(ip("10.0.0.7"), now).expect("another place");
        drop(first);
        let later = now + Duration::from_secs(1);
        assert!(addresses.place(ip("10.0.0.1"), later).is_some());
    }

    #[test]
    fn an_address_that_opens_connections_too_fast_waits_and_others_do_not() {
        let addresses = Addresses::new(2, &[]);
        let now = Instant::now();
        let opened = |peer, at| {
            (0..10)
                .filter(|_| addresses.place(ip(peer), at).is_some())
                .count()
        };
        assert_eq!(opened("10.0.0.1", now), 2);
        assert_eq!(opened("10.0.0.2", now), 2);
        let later = now + Duration::from_secs_f64(1.0 / OPENED_PER_SECOND);
        assert_eq!(opened("10.0.0.1", later), 1);
    }

    #[test]
    fn of_addresses_that_have_left_few_are_remembered() {
        let addresses = Addresses::new(2, &[]);
        let now = Instant::now();
        let kept = addresses.place(ip("10.9.0.1"), now);
        for number in 0..2 * REMEMBERED as u32 {
            let address = IpAddr::from(Ipv4Addr::from_bits(0x0a00_0000 + number));
            // Each comes when the one before may open all of its connections again.
            let at = now + Duration::from_secs_f64(f64::from(number) * 2.0 / OPENED_PER_SECOND);
            drop(addresses.place(address, at));
            assert!(addresses.sites.lock().len() <= REMEMBERED);
        }
        assert!(addresses.sites.lock().contains_key(&ip("10.9.0.1")));
        drop(kept);
    }

    #[test]
    fn a_site_of_ipv6_is_one_address() {
        let addresses = Addresses::new(1, &[]);
        let now = Instant::now();
        let _place = addresses.place(ip("2001:db8::1"), now).expect("a place");
        assert!(addresses.place(ip("2001:db8::2"), now).is_none());
        assert!(addresses.place(ip("2001:db8:0:1::2"), now).is_some());
    }
}
