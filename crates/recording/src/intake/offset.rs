//! Offsets of local times from UTC, as text.

/// The seconds that local times of an offset are ahead of UTC: `+01:00`, `-0530`, `+01`.
pub(super) fn seconds(text: &str) -> Option<i32> {
    let (sign, digits) = match text.split_at_checked(1)? {
        ("+", digits) => (1, digits),
        ("-", digits) => (-1, digits),
        _ => return None,
    };
    let (hours, minutes) = match digits.split_once(':') {
        Some(parts) => parts,
        None => digits.split_at_checked(2)?,
    };
    let number = |text: &str, length: usize| {
        let is_number = text.len() == length && text.bytes().all(|digit| digit.is_ascii_digit());
        text.parse::<i32>().ok().filter(|_| is_number)
    };
    let minutes = match (minutes, digits.len()) {
        ("", 2) => 0,
        _ => number(minutes, 2).filter(|minutes| *minutes < 60)?,
    };
    let hours = number(hours, 2).filter(|hours| *hours < 24)?;
    Some(sign * (hours * 3600 + minutes * 60))
}

/// An offset as text.
pub(super) fn written(seconds: i32) -> String {
    let minutes = seconds.abs() / 60;
    let sign = if seconds < 0 { '-' } else { '+' };
    format!("{sign}{:02}:{:02}", minutes / 60, minutes % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_read_as_they_are_written() {
        for (text, minutes) in [("+01:00", 60), ("-0530", -330), ("+09", 540), ("-00:00", 0)] {
            assert_eq!(seconds(text), Some(minutes * 60), "{text}");
        }
        assert_eq!(written(-19_800), "-05:30");
        for text in [
            "", "+", "+1", "01:00", "+1:00", "+01:", "+01:60", "+24:00", "+01:0a", "+010", "+€1",
        ] {
            assert_eq!(seconds(text), None, "{text}");
        }
    }
}
