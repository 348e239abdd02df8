//! The event hub: append to the store, then wake the subscribers.
