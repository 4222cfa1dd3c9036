//! Text as every reader takes it: without a byte order mark, in UTF-8, with lines that end in a line feed.

use crate::build::DAMAGED;
use std::borrow::Cow;

/// Bytes without a mark at their start; in UTF-8 if that says UTF-16.
pub fn unmarked(bytes: &[u8]) -> Cow<'_, [u8]> {
    let wide = |rest: &[u8], unit: fn([u8; 2]) -> u16| {
        let units = rest.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        let text: String = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        Cow::Owned(text.into_bytes())
    };
    match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => Cow::Borrowed(rest),
        [0xff, 0xfe, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => wide(rest, u16::from_be_bytes),
        _ => Cow::Borrowed(bytes),
    }
}

/// Text whose lines end in a line feed, whether they do in the file, or in a carriage return, or in both. Names may be in any encoding.
pub fn lines_of(bytes: &[u8]) -> Cow<'_, str> {
    let text = String::from_utf8_lossy(bytes);
    if text.contains('\r') { Cow::Owned(text.replace("\r\n", "\n").replace('\r', "\n")) } else { text }
}

/// The number that a word is.
///
/// # Errors
/// That it is none, with the cause as far as it shows, and a cure.
pub fn number(word: &str) -> Result<f64, String> {
    word.parse().map_err(|_| match comma(word) {
        Some(cause) => format!("\"{word}\" {cause}"),
        None => format!("\"{word}\" is not a number; {DAMAGED}"),
    })
}

/// What commas in a word are there for; `None` if it has none, or is no number without them.
pub fn comma(word: &str) -> Option<&'static str> {
    let is_number = |part: &str| part.parse::<f64>().is_ok();
    if !word.contains(',') {
        None
    } else if is_number(&word.replace(',', ".")) && !word.ends_with(',') {
        Some(
            "has a decimal comma, as programs write it that follow the language (locale) of the system; export it again under a locale \
             with a decimal point (LC_ALL=C, or English), or replace the commas by points",
        )
    } else if word.split(',').all(|part| part.is_empty() || is_number(part)) {
        Some("has a comma that parts numbers or thousands; only blanks part numbers here: export it again without commas, or replace them")
    } else {
        None
    }
}
