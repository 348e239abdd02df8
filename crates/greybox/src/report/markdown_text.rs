//! Texts of others in a report in Markdown.

/// Text in the cell of a table.
pub fn cell(text: &str) -> String {
    line(text).replace('|', "\\|")
}

/// Text on one line that opens no markup: neither a tag nor a link nor a picture.
pub fn line(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    let mut line = String::with_capacity(text.len());
    for character in words.join(" ").chars() {
        match character {
            '<' => line.push_str("&lt;"),
            '\\' | '`' | '[' | ']' => line.extend(['\\', character]),
            _ => line.push(character),
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::{cell, line};

    #[test]
    fn a_name_opens_neither_a_link_nor_a_picture_nor_a_cell() {
        let link = line("[x](javascript:alert(1))");
        assert_eq!(link, r"\[x\](javascript:alert(1))");
        let picture = line("![x](http://plant.example/p.png)");
        assert_eq!(picture, r"!\[x\](http://plant.example/p.png)");
        let escaped_already = line(r"\[x\](javascript:alert(1))");
        assert_eq!(escaped_already, r"\\\[x\\\](javascript:alert(1))");
        assert_eq!(line("<b>\n`x`"), r"&lt;b> \`x\`");
        assert_eq!(cell(r"a\|b"), r"a\\\|b");
    }
}
