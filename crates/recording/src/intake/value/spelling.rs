//! Numbers whose spelling has one meaning and is none of a program: `1 452,5`, `="1.5"`, `1.452×10^3`.

/// Signs between the thousands of a whole number that stand in no other number.
const GROUPING: [char; 3] = [' ', '\'', '_'];

/// A number as programs write it, but for its points and commas. None where the text has a sign of something else.
pub(super) fn plain(text: &str) -> Option<String> {
    /// Longer texts are no number.
    const LONGEST: usize = 80;
    if text.len() > LONGEST || !text.contains(char::is_numeric) {
        return None;
    }
    let text = text.trim();
    let formula = text
        .strip_prefix("=\"")
        .and_then(|text| text.strip_suffix('"'));
    // A spreadsheet shows that a cell is text by an apostrophe before it.
    let text = formula.or_else(|| text.strip_prefix('\'')).unwrap_or(text);
    let text: String = text.trim().chars().map(of_ascii).collect();
    let (sign, rest) = text.split_at(usize::from(text.starts_with(['-', '+'])));
    let rest = rest.trim_start();
    let is_of_mantissa = |c: char| c.is_ascii_digit() || GROUPING.contains(&c) || ".,".contains(c);
    let end = rest.find(|c| !is_of_mantissa(c)).unwrap_or(rest.len());
    let (mantissa, power) = rest.split_at(end);
    let mantissa = without_groups(mantissa.trim_end())?;
    let power = match power {
        "" => String::new(),
        power => format!("e{}", exponent(power, &mantissa)?),
    };
    Some(format!("{sign}{mantissa}{power}"))
}

/// A sign of a number in ASCII, where it has one.
fn of_ascii(sign: char) -> char {
    /// How far the signs of full width lie behind those of ASCII.
    const FULL_WIDTH: u32 = 0xFEE0;
    let code = u32::from(sign);
    let digit = |zero: u32| char::from_digit(code - zero, 10).unwrap_or(sign);
    match sign {
        '−' => '-',
        '’' => '\'',
        '\u{a0}' | '\u{2009}' | '\u{202f}' => ' ',
        '٠'..='٩' => digit(0x660),
        '۰'..='۹' => digit(0x6F0),
        '！'..='～' => char::from_u32(code - FULL_WIDTH).unwrap_or(sign),
        _ => sign,
    }
}

/// The digits of a number without the signs between its thousands.
fn without_groups(mantissa: &str) -> Option<String> {
    let end = mantissa.find(['.', ',']).unwrap_or(mantissa.len());
    let (whole, behind) = mantissa.split_at(end);
    let begins = mantissa.starts_with(|c: char| c.is_ascii_digit() || ".,".contains(c));
    let is_sound = begins && !behind.contains(GROUPING);
    let whole = match whole.chars().find(|c| GROUPING.contains(c)) {
        None => Some(whole.to_owned()),
        Some(mark) => is_in_thousands(whole, mark).then(|| whole.replace(mark, "")),
    };
    whole.filter(|_| is_sound).map(|whole| whole + behind)
}

/// The exponent in `E+03`, in Fortran's `D-01` and in `×10^3`.
fn exponent(power: &str, mantissa: &str) -> Option<String> {
    let sign = power.chars().next()?;
    let behind = power.strip_prefix(sign)?;
    let exponent = match sign {
        'e' | 'E' => behind.to_owned(),
        // Without a point the text may be hexadecimal, or a name.
        'd' | 'D' if mantissa.contains(['.', ',']) => behind.to_owned(),
        '×' | 'x' | '*' | '·' | '⋅' => {
            let behind = behind.trim_start().strip_prefix("10")?;
            match behind.strip_prefix('^') {
                Some(exponent) => exponent.chars().map(of_ascii).collect(),
                None => behind.chars().map(raised).collect::<Option<String>>()?,
            }
        }
        _ => return None,
    };
    let digits = exponent.strip_prefix(['-', '+']).unwrap_or(&exponent);
    let is_number = (1..=3).contains(&digits.len()) && is_of_digits(digits);
    is_number.then_some(exponent)
}

/// The sign that is raised in an exponent.
fn raised(sign: char) -> Option<char> {
    const RAISED: &str = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺";
    const PLAIN: &str = "0123456789-+";
    let place = RAISED.chars().position(|raised| raised == sign)?;
    PLAIN.chars().nth(place)
}

fn is_of_digits(text: &str) -> bool {
    text.bytes().all(|digit| digit.is_ascii_digit())
}

/// Whether separators stand between the thousands of a whole number: `1.052`, `12.345.678`.
pub(in crate::intake) fn is_in_thousands(text: &str, separator: char) -> bool {
    let mut groups = text.trim_start_matches(['-', '+']).split(separator);
    let first = groups.next().unwrap_or_default();
    let begins = (1..=3).contains(&first.len()) && !first.starts_with('0') && is_of_digits(first);
    let mut rest = groups.peekable();
    begins && rest.peek().is_some() && rest.all(|group| group.len() == 3 && is_of_digits(group))
}

/// Whether commas stand in a whole number as in India: before the last three digits, and before each two above them.
pub(in crate::intake) fn is_in_lakhs(text: &str) -> bool {
    let mut groups = text.trim_start_matches(['-', '+']).rsplit(',');
    let is_last = groups
        .next()
        .is_some_and(|last| last.len() == 3 && is_of_digits(last));
    let groups: Vec<&str> = groups.collect();
    let Some((first, between)) = groups.split_last() else {
        return false;
    };
    let begins = (1..=2).contains(&first.len()) && !first.starts_with('0') && is_of_digits(first);
    let are_pairs = between
        .iter()
        .all(|pair| pair.len() == 2 && is_of_digits(pair));
    is_last && begins && are_pairs && !between.is_empty()
}
