//! Text for pages: escaping, numbers, and Base64.

/// Escapes text for content and quoted attributes of HTML and SVG. Control characters, which neither allows,
/// become U+FFFD.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            '\t' | '\n' => safe.push(c),
            c if c.is_control() => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// A number with four significant digits, in scientific notation if it is very small or large; a dash if it
/// is not finite.
pub fn figure(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let short = |text: String| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    };
    match value.abs() {
        0.0 => "0".into(),
        a if !(1e-3..1e6).contains(&a) => {
            let text = format!("{value:.3e}");
            let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
            format!("{}e{power}", short(digits.into()))
        }
        a => {
            let decimals = (3 - a.log10().floor() as i32).max(0) as usize;
            short(format!("{value:.decimals$}"))
        }
    }
}

/// Base64 with padding (RFC 4648, section 4).
pub fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let word = group.iter().enumerate().fold(0u32, |w, (i, b)| w | u32::from(*b) << (16 - 8 * i));
        for i in 0..4 {
            let letter = ALPHABET[(word >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= group.len() { letter as char } else { '=' });
        }
    }
    text
}

/// JSON as the content of a script element, which no text in it can end.
pub fn script_json(value: &serde_json::Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

/// Checks that markup is well formed: one root, closed tags, quoted attributes, known references.
#[cfg(test)]
pub fn check_markup(text: &str) -> Result<(), String> {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = text.trim_start().trim_start_matches("<!doctype html>");
    let mut roots = 0;
    while let Some(start) = rest.find('<') {
        check_references(&rest[..start])?;
        let end = rest.find('>').ok_or("a tag without an end")?;
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop() != Some(name) {
                return Err(format!("</{name}> closes nothing"));
            }
            continue;
        }
        let (body, leaf) = tag.strip_suffix('/').map_or((tag, false), |b| (b, true));
        let name = body.split_whitespace().next().ok_or("a tag without a name")?;
        let quoted: Vec<&str> = body[name.len()..].split('"').collect();
        let keyed = quoted.iter().step_by(2).all(|k| k.trim().is_empty() || k.ends_with('='));
        if quoted.len().is_multiple_of(2) || !keyed || quoted.last().is_some_and(|k| k.contains('=')) {
            return Err(format!("attributes of <{body}>"));
        }
        quoted.iter().try_for_each(|q| check_references(q))?;
        roots += usize::from(open.is_empty());
        if !leaf {
            open.push(name);
        }
    }
    if !open.is_empty() || roots != 1 {
        return Err(format!("{roots} roots, left open: {open:?}"));
    }
    Ok(())
}

#[cfg(test)]
fn check_references(text: &str) -> Result<(), String> {
    let known = ["amp;", "lt;", "gt;", "quot;", "#39;"];
    match text.split('&').skip(1).find(|r| !known.iter().any(|k| r.starts_with(k))) {
        Some(bad) => Err(format!("unknown reference &{bad}")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_four_significant_digits() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-12.5, "-12.5"),
            (0.123456, "0.1235"),
            (98765.4, "98765"),
            (1.5e-7, "1.5e-7"),
            (2e9, "2e9"),
            (240.0, "240"),
            (f64::NAN, "–"),
            (0.001, "0.001"),
        ];
        for (value, text) in cases {
            assert_eq!(figure(value), text);
        }
    }

    #[test]
    fn base64_matches_the_test_vectors_of_rfc_4648() {
        let cases = [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")];
        for (plain, coded) in cases {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64(&[0xff, 0xef, 0xfe]), "/+/+");
    }

    #[test]
    fn text_in_a_script_does_not_end_it() {
        let nasty = serde_json::json!({ "a</script>": "<!--\\<" });
        let json = script_json(&nasty);
        assert!(!json.contains('<'));
        assert_eq!(serde_json::from_str::<serde_json::Value>(&json).unwrap(), nasty);
    }

    #[test]
    fn escaped_text_is_well_formed_and_raw_text_is_not() {
        let nasty = "<script>\"a\" & 'b'</script>\u{0}";
        check_markup(&format!("<p title=\"{0}\">{0}</p>", escape(nasty))).unwrap();
        for bad in ["<p>&</p>", "<p><b></p>", "<p a=b></p>", "<p/><p/>", "<p a=\"b>", "<p>"] {
            assert!(check_markup(bad).is_err(), "{bad}");
        }
    }
}
