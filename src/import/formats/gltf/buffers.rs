//! The binary data of a glTF file.

use crate::import::source::Source;
use crate::{Diagnostic, Error, Result};
use gltf::{Document, buffer};

/// Prefix of a buffer embedded as text.
const DATA_URI: &str = "data:";

/// Reads every buffer: the binary chunk, a file in the same folder, or base64 text. `blob` is the binary
/// chunk.
///
/// # Errors
/// Every buffer that cannot be read.
pub(super) fn read(source: &Source, document: &Document, mut blob: Option<Vec<u8>>) -> Result<Vec<Vec<u8>>> {
    let mut diagnostics = Vec::new();
    let mut all = Vec::new();
    for buffer in document.buffers() {
        match read_buffer(source, &buffer, &mut blob) {
            Ok(bytes) => all.push(bytes),
            Err(what) => diagnostics.push(Diagnostic::new(
                &source.path,
                format!("buffers[{}].uri", buffer.index()),
                what,
                "the name of a file in the same folder, or base64",
                "export as .glb",
            )),
        }
    }
    Error::if_any(diagnostics)?;
    Ok(all)
}

fn read_buffer(
    source: &Source,
    buffer: &buffer::Buffer,
    blob: &mut Option<Vec<u8>>,
) -> std::result::Result<Vec<u8>, String> {
    let uri = match buffer.source() {
        buffer::Source::Bin => return Ok(blob.take().unwrap_or_default()),
        buffer::Source::Uri(uri) => uri,
    };
    if let Some(data) = uri.strip_prefix(DATA_URI) {
        let text = data.split_once(";base64,").map(|(_, text)| text);
        return text.and_then(decode_base64).ok_or_else(|| "not valid base64".into());
    }
    if !crate::file::is_plain_name(uri) {
        return Err(format!("\"{uri}\" is not a plain file name"));
    }
    crate::file::read_file(&source.folder().join(uri)).map_err(|e| format!("\"{uri}\" cannot be read: {e}"))
}

/// Decodes base64 (RFC 4648, section 4); padding is optional.
fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0);
    for c in text.trim_end_matches('=').bytes() {
        let six = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        (bits, held) = (bits << 6 | u32::from(six), held + 6);
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    Some(out)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) fn to_base64(bytes: &[u8]) -> String {
        const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let group = |part: &[u8]| {
            let bits = part.iter().fold(0u32, |bits, b| bits << 8 | u32::from(*b)) << (8 * (3 - part.len()));
            (0..4).map(move |i| LETTERS[(bits >> (18 - 6 * i) & 63) as usize] as char)
        };
        bytes.chunks(3).flat_map(group).collect()
    }

    #[test]
    fn base64_is_decoded() {
        for bytes in [&b""[..], b"a", b"ab", b"abc", b"\xff\x00\xfe\x01"] {
            let unpadded = &to_base64(bytes)[..(8 * bytes.len()).div_ceil(6)];
            assert_eq!(decode_base64(unpadded).as_deref(), Some(bytes));
        }
        assert_eq!(decode_base64("YWI=").as_deref(), Some(&b"ab"[..]));
        assert_eq!(decode_base64("Y*I="), None);
    }
}
