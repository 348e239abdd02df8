//! HTTP to domain types and back: the route table.
