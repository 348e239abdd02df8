//! Units as plants spell them, beside how their letters multiply.

/// A foot-pound-force `[N·m]`: 0.3048 m · 0.453 592 37 kg · 9.806 65 m/s².
const FOOT_POUND: f64 = 0.3048 * 0.453_592_37 * 9.806_65;

/// The unit of a time by a word for it, in any case: `seconds`, `second(s)`, `sec.`, `Sek`; a second without a word.
pub(super) fn time(word: &str) -> Option<&'static str> {
    const WORDS: [(&str, &str); 7] = [
        ("s", "s sec secs second seconds sek sekunde sekunden"),
        (
            "ms",
            "ms msec msecs millisec millis millisecond milliseconds millisekunde millisekunden",
        ),
        (
            "us",
            "us µs μs usec usecs µsec microsecond microseconds mikrosekunde mikrosekunden",
        ),
        (
            "ns",
            "ns nsec nsecs nanosecond nanoseconds nanosekunde nanosekunden",
        ),
        ("min", "min mins minute minutes minuten"),
        ("h", "h hr hrs hour hours std stunde stunden"),
        ("d", "d day days tag tage"),
    ];
    if word.is_empty() {
        return Some("s");
    }
    let word = word
        .trim_end_matches('.')
        .replace("(s)", "s")
        .to_lowercase();
    let is_in = |names: &str| names.split(' ').any(|name| name == word);
    let unit = WORDS.iter().find(|(_, names)| is_in(names));
    unit.map(|(unit, _)| *unit)
}

/// A torque in pounds and feet or inches, which the letters make a mass by a length `[N·m]`.
pub(super) fn torque(text: &str) -> Option<f64> {
    let is_sign = |sign: char| " ·⋅*-.".contains(sign);
    let letters: String = text.chars().filter(|sign| !is_sign(*sign)).collect();
    match letters.to_lowercase().as_str() {
        "lbft" | "ftlb" | "lbfft" | "ftlbf" | "ftlbs" => Some(FOOT_POUND),
        "lbin" | "inlb" | "lbfin" | "inlbf" | "inlbs" => Some(FOOT_POUND / 12.0),
        "ozin" | "inoz" | "ozfin" | "inozf" => Some(FOOT_POUND / 192.0),
        _ => None,
    }
}

/// A quotient as plants mean it: `W/mK` and `W/m·K` are `W/(m·K)`, and blanks around a `/` say nothing. None where a blank leaves open what belongs to the divisor.
fn one_divisor(text: &str) -> Option<String> {
    let parts: Vec<&str> = text.trim().split('/').map(str::trim).collect();
    let [dividend, divisor] = parts[..] else {
        return Some(parts.join("/"));
    };
    if divisor.starts_with('(') {
        return Some(parts.join("/"));
    }
    if divisor.contains(' ') {
        return None;
    }
    let before = divisor.strip_suffix('K').unwrap_or_default();
    let before = before.trim_end_matches(['·', '⋅', '*']);
    match ["m", "m2", "m²", "m^2", "kg", "g"].contains(&before) {
        true => Some(format!("{dividend}/({before}·K)")),
        false => Some(parts.join("/")),
    }
}

/// `m3/(h bar)` as `m^3/(h*bar)`, `s-1` as `s^-1`.
pub(super) fn out(text: &str) -> Option<String> {
    let mut spelled = String::with_capacity(text.len() + 8);
    let text = one_divisor(text)?;
    let mut symbols = text.chars().peekable();
    while let Some(symbol) = symbols.next() {
        let next = symbols.peek().copied().unwrap_or(' ');
        let ends_a_unit = symbol.is_alphabetic() || symbol == ')';
        match symbol {
            ' ' | '.' if next.is_alphabetic() => spelled.push('*'),
            ' ' => {}
            _ => spelled.push(symbol),
        }
        if ends_a_unit && (next.is_ascii_digit() || next == '-') {
            spelled.push('^');
        }
    }
    Some(spelled)
}
