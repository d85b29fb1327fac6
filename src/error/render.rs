//! Diagnostics as text for a terminal, the wrong text underlined.

use super::diagnostic::Diagnostic;
use miette::{
    GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteError, MietteSpanContents, SourceCode,
    SourceSpan, SpanContents,
};
use std::fmt::Write;

/// Most bytes of a line that are shown: a motion file may hold a megabyte in one line.
const MAX_SHOWN: usize = 88;

/// All `diagnostics` as one report, each with file, line, column, key, message, allowed values and help.
/// Reads the files again to show the lines concerned. `colour`: with ANSI colours.
pub fn render(diagnostics: &[Diagnostic], colour: bool) -> String {
    let theme = if colour { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_width(110).with_context_lines(1);
    let mut text = String::new();
    for diagnostic in diagnostics {
        let excerpt = diagnostic.span.and_then(|span| Excerpt::read(diagnostic, span));
        let report = Report { diagnostic, excerpt };
        // Writing to a string does not fail; if the excerpt cannot be drawn, the message still appears.
        if handler.render_report(&mut text, &report).is_err() {
            let _ = writeln!(text, "{report}");
        }
    }
    text
}

/// A diagnostic with an excerpt of its file.
#[derive(Debug)]
struct Report<'a> {
    diagnostic: &'a Diagnostic,
    excerpt: Option<Excerpt>,
}

impl std::fmt::Display for Report<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Diagnostic { file, key, message, .. } = self.diagnostic;
        match (&self.excerpt, key.as_str()) {
            (_, "") => write!(f, "{}: {message}", file.display()),
            (Some(_), key) => write!(f, "{key}: {message}"),
            (None, key) => write!(f, "{}: {key}: {message}", file.display()),
        }
    }
}

impl std::error::Error for Report<'_> {}

impl miette::Diagnostic for Report<'_> {
    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        Some(Box::new(format!("{}\nallowed: {}", self.diagnostic.help, self.diagnostic.allowed)))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.excerpt.as_ref().map(|excerpt| excerpt as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let excerpt = self.excerpt.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::underline(excerpt.span))))
    }
}

/// The part of a line around a span that is short enough to show.
#[derive(Debug)]
struct Excerpt {
    /// Name of the file.
    name: String,
    /// The text shown.
    text: String,
    /// Offset and length of the span within `text`.
    span: (usize, usize),
    /// Line and column of the file at which `text` starts, from 0.
    start: (usize, usize),
}

impl Excerpt {
    fn read(diagnostic: &Diagnostic, (offset, len): (usize, usize)) -> Option<Self> {
        let bytes = std::fs::read(&diagnostic.file).ok()?;
        let before = bytes.get(..offset)?;
        let line_start = before.iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
        let line_end = bytes[offset..].iter().position(|&b| b == b'\n').map_or(bytes.len(), |i| offset + i);
        let boundary = |mut i: usize| {
            // Back out of a UTF-8 sequence.
            while i > line_start && i < line_end && bytes[i] & 0xc0 == 0x80 {
                i -= 1;
            }
            i
        };
        let shown = len.clamp(1, MAX_SHOWN);
        let start = boundary(offset.saturating_sub((MAX_SHOWN - shown) / 2).max(line_start));
        let end = boundary((start + MAX_SHOWN).min(line_end)).max(start);
        let line = before.iter().filter(|&&b| b == b'\n').count();
        // Control characters would steer the terminal.
        let text: String = String::from_utf8_lossy(&bytes[start..end])
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .collect();
        let at = (offset - start).min(text.len());
        Some(Excerpt {
            name: diagnostic.file.display().to_string(),
            span: (at, shown.min(text.len() - at)),
            start: (line, start - line_start),
            text,
        })
    }
}

impl SourceCode for Excerpt {
    fn read_span<'a>(
        &'a self,
        _: &SourceSpan,
        lines_before: usize,
        _: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let (line, column) = self.start;
        // miette asks without context lines for the header, which names the line and column of the span.
        let first = if lines_before == 0 { self.span.0 } else { 0 };
        Ok(Box::new(MietteSpanContents::new_named(
            self.name.clone(),
            &self.text.as_bytes()[first..],
            (first, self.text.len() - first).into(),
            line,
            column + first,
            1,
        )))
    }
}
