//! Numbers as people read them: with so many significant digits.

/// Powers of ten between which a number is written without an exponent.
const PLAIN: std::ops::Range<f64> = -4.0..6.0;

/// A number with so many significant digits, with an exponent where the number is very large or
/// very small.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor();
    if !PLAIN.contains(&magnitude) {
        return format!("{value:.*e}", digits - 1);
    }
    let decimals = (digits as f64 - 1.0 - magnitude).max(0.0) as usize;
    format!("{value:.decimals$}")
}

/// A number with so many significant digits at the most: without zeros at the end of its decimals.
#[must_use]
pub fn short(value: f64, digits: usize) -> String {
    let text = significant(value, digits);
    let (mantissa, exponent) = text.split_at(text.find('e').unwrap_or(text.len()));
    let mantissa = match mantissa.contains('.') {
        true => mantissa.trim_end_matches('0').trim_end_matches('.'),
        false => mantissa,
    };
    format!("{mantissa}{exponent}")
}

/// The nearest number that has so many significant digits.
#[must_use]
pub fn rounded(value: f64, digits: usize) -> f64 {
    let text = format!("{value:.*e}", digits - 1);
    text.parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_digits_and_not_more() {
        for (value, words) in [
            (57.962_18, "57.962"),
            (1.600_9e9, "1.6009e9"),
            (-0.012_345_678, "-0.012346"),
            (123_456.7, "123457"),
            (0.0, "0"),
            (4.8e-5, "4.8000e-5"),
            (-370.25, "-370.25"),
        ] {
            assert_eq!(significant(value, 5), words);
        }
    }

    #[test]
    fn zeros_at_the_end_are_left_out() {
        let shown = [0.0, 31.04, 0.001_23, 7e6, 8.91e-8, 123.4, -0.5, 300.0];
        let expected = ["0", "31", "0.00123", "7e6", "8.91e-8", "123", "-0.5", "300"];
        assert_eq!(shown.map(|value| short(value, 3)), expected);
    }

    #[test]
    fn a_rounded_number_is_the_one_that_its_digits_say() {
        let shown = [57.123_456, -1.600_96e9, 0.0, f64::INFINITY];
        let expected = [57.12, -1.601e9, 0.0, f64::INFINITY];
        assert_eq!(shown.map(|value| rounded(value, 4)), expected);
    }
}
