//! Keys of objects, compared by their letters and digits.

/// Whether the letters and digits of a key are these.
pub(super) fn is_called(key: &str, plain: &str) -> bool {
    let letters = key.chars().filter(|c| c.is_alphanumeric());
    letters.flat_map(char::to_lowercase).eq(plain.chars())
}

/// Whether a key is one of these by its letters and digits.
pub(super) fn is_any(key: &str, names: &[&str]) -> bool {
    names.iter().any(|name| is_called(key, name))
}
