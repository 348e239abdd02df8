//! Texts whose signs have four bytes each, told by their byte order mark.

/// Signs of four bytes on their way in.
pub(super) struct Utf32 {
    is_little: bool,
    /// The first bytes of a sign whose others are still to come.
    begun: Vec<u8>,
}

impl Utf32 {
    /// The encoding of a text that begins with its byte order mark.
    pub(super) fn of_mark(head: &[u8]) -> Option<Self> {
        let is_little = match head.get(..4)? {
            [0xFF, 0xFE, 0, 0] => true,
            [0, 0, 0xFE, 0xFF] => false,
            _ => return None,
        };
        Some(Self {
            is_little,
            begun: Vec::new(),
        })
    }

    /// Adds the text of the next bytes; there are none at the end.
    pub(super) fn decode(&mut self, bytes: &[u8], into: &mut String) {
        if bytes.is_empty() && !self.begun.is_empty() {
            self.begun.clear();
            into.push(char::REPLACEMENT_CHARACTER);
        }
        self.begun.extend_from_slice(bytes);
        let (signs, rest) = self.begun.as_chunks();
        let code = |sign: &[u8; 4]| match self.is_little {
            true => u32::from_le_bytes(*sign),
            false => u32::from_be_bytes(*sign),
        };
        let signs = signs.iter().map(code).map(char::from_u32);
        into.extend(signs.map(|sign| sign.unwrap_or(char::REPLACEMENT_CHARACTER)));
        self.begun = rest.to_vec();
    }
}
