//! Problems as text for a terminal, the offending place underlined.

use super::Problem;
use miette::{
    GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteError, MietteSpanContents, SourceCode,
    SourceSpan, SpanContents,
};
use std::fmt::Write;

/// Longest part of a line that is shown; a motion file may hold a megabyte in one line.
const WINDOW: usize = 88;

/// All `problems` as one report, each with file, line and column, key, value found, allowed range and remedy.
/// Reads the files again to show the lines at fault. `colour`: with ANSI colours.
pub fn render(problems: &[Problem], colour: bool) -> String {
    let theme = if colour { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_width(110).with_context_lines(1);
    let mut text = String::new();
    for problem in problems {
        let report = Report { problem, source: problem.span.and_then(|span| Excerpt::read(problem, span)) };
        // Writing to a string does not fail; a report that could not be drawn still says what is wrong.
        if handler.render_report(&mut text, &report).is_err() {
            let _ = writeln!(text, "{report}");
        }
    }
    text
}

/// One problem with the piece of its file that shows it.
#[derive(Debug)]
struct Report<'a> {
    problem: &'a Problem,
    source: Option<Excerpt>,
}

impl std::fmt::Display for Report<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Problem { file, key, what, .. } = self.problem;
        match (&self.source, key.as_str()) {
            (Some(_), "") => write!(f, "the file {what}"),
            (Some(_), key) => write!(f, "{key}: {what}"),
            (None, "") => write!(f, "{}: {what}", file.display()),
            (None, key) => write!(f, "{}: {key}: {what}", file.display()),
        }
    }
}

impl std::error::Error for Report<'_> {}

impl miette::Diagnostic for Report<'_> {
    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        Some(Box::new(format!("{}\nallowed: {}", self.problem.remedy, self.problem.allowed)))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source.as_ref().map(|source| source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let excerpt = self.source.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::underline(excerpt.span))))
    }
}

/// The line of a span, cut to what can be shown around it.
#[derive(Debug)]
struct Excerpt {
    name: String,
    text: String,
    /// The span within `text`.
    span: (usize, usize),
    /// Line and column in the file at which `text` starts, from 0.
    start: (usize, usize),
}

impl Excerpt {
    fn read(problem: &Problem, (offset, len): (usize, usize)) -> Option<Self> {
        let bytes = std::fs::read(&problem.file).ok()?;
        let before = bytes.get(..offset)?;
        let line_start = before.iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
        let line_end = bytes[offset..].iter().position(|&b| b == b'\n').map_or(bytes.len(), |i| offset + i);
        let boundary = |mut i: usize| {
            // Not inside a UTF-8 sequence.
            while i > line_start && i < line_end && bytes[i] & 0xc0 == 0x80 {
                i -= 1;
            }
            i
        };
        let shown = len.clamp(1, WINDOW);
        let start = boundary(offset.saturating_sub((WINDOW - shown) / 2).max(line_start));
        let end = boundary((start + WINDOW).min(line_end)).max(start);
        let line = before.iter().filter(|&&b| b == b'\n').count();
        // Control characters would steer the terminal.
        let text: String = String::from_utf8_lossy(&bytes[start..end])
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .collect();
        let at = (offset - start).min(text.len());
        Some(Excerpt {
            name: problem.file.display().to_string(),
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
        // Without context lines the header asks, for the place to name.
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
