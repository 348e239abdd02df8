//! The pages that the server shows to people, embedded in the program.
