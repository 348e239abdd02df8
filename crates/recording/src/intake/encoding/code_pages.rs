//! Code pages of DOS, which programs of panels and dataloggers still write.

/// A code page whose lower half is ASCII: the signs of its bytes from 128 on, 32 to a line.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::intake) struct CodePage {
    names: [&'static str; 3],
    signs: [&'static str; 4],
}

/// Code page 850 of western Europe.
static PAGE_850: CodePage = CodePage {
    names: ["cp850", "ibm850", "850"],
    signs: PAGE_850_SIGNS,
};

/// Code page 437 of the United States.
static PAGE_437: CodePage = CodePage {
    names: ["cp437", "ibm437", "437"],
    signs: PAGE_437_SIGNS,
};

const PAGE_850_SIGNS: [&str; 4] = [
    "ÇüéâäàåçêëèïîìÄÅÉæÆôöòûùÿÖÜø£Ø×ƒ",
    "áíóúñÑªº¿®¬½¼¡«»░▒▓│┤ÁÂÀ©╣║╗╝¢¥┐",
    "└┴┬├─┼ãÃ╚╔╩╦╠═╬¤ðÐÊËÈıÍÎÏ┘┌█▄¦Ì▀",
    "ÓßÔÒõÕµþÞÚÛÙýÝ¯´\u{ad}±‗¾¶§÷¸°¨·¹³²■\u{a0}",
];

const PAGE_437_SIGNS: [&str; 4] = [
    "ÇüéâäàåçêëèïîìÄÅÉæÆôöòûùÿÖÜ¢£¥₧ƒ",
    "áíóúñÑªº¿⌐¬½¼¡«»░▒▓│┤╡╢╖╕╣║╗╝╜╛┐",
    "└┴┬├─┼╞╟╚╔╩╦╠═╬╧╨╤╥╙╘╒╓╫╪┘┌█▄▌▐▀",
    "αßΓπΣσµτΦΘΩδ∞φε∩≡±≥≤⌠⌡÷≈°∙·√ⁿ²■\u{a0}",
];

impl CodePage {
    /// The code page of that name, in any case of letters.
    pub(super) fn named(name: &str) -> Option<&'static Self> {
        let has_name = |page: &&Self| {
            let mut names = page.names.iter();
            names.any(|of_page| of_page.eq_ignore_ascii_case(name))
        };
        [&PAGE_850, &PAGE_437].into_iter().find(has_name)
    }

    /// Adds the text of bytes.
    pub(super) fn decode(&self, bytes: &[u8], into: &mut String) {
        into.extend(bytes.iter().map(|byte| self.sign(*byte)));
    }

    fn sign(&self, byte: u8) -> char {
        let place = usize::from(byte & 0x7F);
        let upper = || self.signs.get(place / 32)?.chars().nth(place % 32);
        match byte.is_ascii() {
            true => char::from(byte),
            false => upper().unwrap_or(char::REPLACEMENT_CHARACTER),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_byte_has_a_sign_of_its_own() {
        for (name, byte, sign) in [
            ("cp850", 0x9A, 'Ü'),
            ("IBM850", 0xF8, '°'),
            ("ibm850", 0x9B, 'ø'),
            ("cp437", 0x9B, '¢'),
            ("ibm437", 0xE1, 'ß'),
            ("cp437", 0xFF, '\u{a0}'),
        ] {
            let page = CodePage::named(name).unwrap();
            assert_eq!(page.sign(byte), sign, "{name} {byte:#x}");
            let mut text = String::new();
            page.decode(&(0..=255).collect::<Vec<u8>>(), &mut text);
            let signs: std::collections::HashSet<char> = text.chars().collect();
            assert_eq!(signs.len(), 256, "{name}");
            assert!(!signs.contains(&char::REPLACEMENT_CHARACTER));
        }
        assert_eq!(CodePage::named("cp852"), None);
    }
}
