//! The ICRA network: credits for the candidates of one generation.
