//! A time of day as people and programs write it.

/// A time of day; 24 o'clock is the end of the day.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DayTime {
    pub(super) hour: u32,
    pub(super) minute: u32,
    pub(super) second: u32,
    pub(super) nanosecond: u32,
}

/// The half of a day that a word names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum HalfDay {
    Morning,
    Afternoon,
}

impl HalfDay {
    /// The half of the day that a word is.
    pub(super) fn named(word: &str) -> Option<Self> {
        const MORNING: [&str; 5] = ["am", "a.m.", "오전", "上午", "午前"];
        const AFTERNOON: [&str; 5] = ["pm", "p.m.", "오후", "下午", "午後"];
        let is_among = |words: [&str; 5]| words.iter().any(|name| name.eq_ignore_ascii_case(word));
        match (is_among(MORNING), is_among(AFTERNOON)) {
            (true, _) => Some(Self::Morning),
            (_, true) => Some(Self::Afternoon),
            _ => None,
        }
    }

    /// A time and the half of the day at its end: `8:15PM`.
    pub(super) fn split(text: &str) -> (&str, Option<Self>) {
        let end = text
            .trim_end_matches(|c: char| c.is_ascii_alphabetic())
            .len();
        match Self::named(&text[end..]) {
            Some(half) => (&text[..end], Some(half)),
            None => (text, None),
        }
    }
}

impl DayTime {
    /// `8:15`, `08:15:00.5`, `08:15:00,5`, `08:15:00:500`, `08:15:00;500`.
    pub(super) fn of_colons(text: &str) -> Option<Self> {
        let mut fields = text.split(':');
        let (hour, minute) = (fields.next()?, fields.next()?);
        let seconds = fields.next().unwrap_or("0");
        let (second, fraction) = match fields.next() {
            // Three digits behind a colon are milliseconds.
            Some(milliseconds) => {
                let is_last = milliseconds.len() == 3 && fields.next().is_none();
                (seconds, is_last.then_some(milliseconds)?)
            }
            None => fraction_of(seconds)?,
        };
        Self::of_fields([hour, minute, second], fraction)
    }

    /// `10.15.00`, `10.15.00,5`, `08.15.00.500` and `10.15`.
    pub(super) fn of_dots(text: &str) -> Option<Self> {
        let mut fields = text.splitn(4, '.');
        let (hour, minute) = (fields.next()?, fields.next()?);
        let seconds = fields.next().unwrap_or("00");
        let (second, fraction) = match fields.next() {
            Some(fraction) => (seconds, fraction),
            None => seconds.split_once(',').unwrap_or((seconds, "")),
        };
        let is_clear = hour.len() <= 2 && minute.len() == 2 && second.len() == 2;
        Self::of_fields([hour, minute, second], fraction).filter(|_| is_clear)
    }

    /// `081500`, `081500.5` and `0815`.
    pub(super) fn of_digits(text: &str) -> Option<Self> {
        let (digits, fraction) = text.split_once(['.', ',']).unwrap_or((text, ""));
        let (hour, minute) = (digits.get(..2)?, digits.get(2..4)?);
        let second = match digits.len() {
            4 => "0",
            6 => digits.get(4..)?,
            _ => return None,
        };
        Self::of_fields([hour, minute, second], fraction)
    }

    fn of_fields([hour, minute, second]: [&str; 3], fraction: &str) -> Option<Self> {
        Some(Self {
            hour: digits(hour)?,
            minute: digits(minute)?,
            second: digits(second)?,
            nanosecond: nanoseconds(fraction)?,
        })
    }

    /// The time in a half of the day; none where the half has no such hour.
    pub(super) fn in_half(self, half: Option<HalfDay>) -> Option<Self> {
        let hour = match half {
            None => self.hour,
            Some(HalfDay::Morning) if self.hour > 12 => return None,
            Some(HalfDay::Morning) => self.hour % 12,
            Some(HalfDay::Afternoon) => self.hour % 12 + 12,
        };
        Some(Self { hour, ..self })
    }

    /// Whether the time is the end of the day: 24 o'clock.
    pub(super) fn is_end(self) -> bool {
        let end = Self {
            hour: 24,
            ..Self::default()
        };
        self == end
    }

    /// The seconds since midnight.
    pub(super) fn seconds(self) -> f64 {
        let minutes = f64::from(self.minute) + 60.0 * f64::from(self.hour);
        f64::from(self.second) + 60.0 * minutes + f64::from(self.nanosecond) / 1e9
    }
}

/// Seconds and their fraction; controllers write milliseconds behind a semicolon.
fn fraction_of(seconds: &str) -> Option<(&str, &str)> {
    match seconds.split_once(';') {
        Some((_, milliseconds)) if milliseconds.len() != 3 => None,
        Some(parts) => Some(parts),
        None => Some(seconds.split_once(['.', ',']).unwrap_or((seconds, ""))),
    }
}

/// A whole number of a few digits.
pub(super) fn digits(text: &str) -> Option<u32> {
    let is_number = (1..=6).contains(&text.len()) && text.bytes().all(|c| c.is_ascii_digit());
    text.parse().ok().filter(|_| is_number)
}

/// The nanoseconds of a fraction of a second, whose digits these are.
fn nanoseconds(fraction: &str) -> Option<u32> {
    let is_number = fraction.len() <= 9 && fraction.bytes().all(|c| c.is_ascii_digit());
    let digits: u32 = match fraction {
        "" => 0,
        digits => digits.parse().ok().filter(|_| is_number)?,
    };
    let exponent = 9_u32.checked_sub(u32::try_from(fraction.len()).ok()?)?;
    digits.checked_mul(10_u32.pow(exponent))
}
