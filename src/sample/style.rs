//! The four hair styles of the samples, after the table of Bertails & Cani 2004 (figure 6).

use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// A style of the paper's table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Short and smooth.
    Short,
    /// Short curls.
    ShortCurly,
    /// To the shoulders and below.
    Long,
    /// Long ringlets.
    LongCurly,
}

/// What makes a style. Lengths in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cut {
    /// Leaf wisps; each has one guide.
    pub(super) wisps: usize,
    /// Sections of a wisp.
    pub(super) sections: usize,
    /// Levels of the hierarchy, and its coarse wisps.
    pub(super) levels: usize,
    pub(super) coarse: usize,
    /// Longest hair, along its run.
    pub(super) longest: f64,
    /// Height in rest space at which the hair is cut.
    pub(super) hem: f64,
    /// Radius of the curls.
    pub(super) curl_radius: f64,
    /// Length of the run in one turn of a curl.
    pub(super) curl_pitch: f64,
    /// Vertices of guides and render strands.
    pub(super) vertices: [usize; 2],
}

impl Style {
    /// All of them, in the table's order.
    pub const ALL: [Style; 4] = [Style::Short, Style::ShortCurly, Style::Long, Style::LongCurly];

    /// Nodes of the finest level and levels in the paper's table.
    pub fn paper(self) -> (usize, usize) {
        match self {
            Style::Short => (5149, 2),
            Style::ShortCurly => (4909, 2),
            Style::Long => (6065, 3),
            Style::LongCurly => (9853, 3),
        }
    }

    /// Nodes of the finest level here: leaf wisps × sections, within three of the paper's.
    pub fn nodes(self) -> usize {
        self.cut().wisps * self.cut().sections
    }

    pub(super) fn cut(self) -> Cut {
        let (_, levels) = self.paper();
        match self {
            Style::Short => Cut {
                wisps: 644,
                sections: 8,
                levels,
                coarse: 18,
                longest: 0.085,
                hem: 0.02,
                curl_radius: 0.0012,
                curl_pitch: 0.05,
                vertices: [16, 9],
            },
            Style::ShortCurly => Cut {
                wisps: 491,
                sections: 10,
                levels,
                coarse: 26,
                longest: 0.10,
                hem: 0.0,
                curl_radius: 0.0055,
                curl_pitch: 0.026,
                vertices: [64, 40],
            },
            Style::Long => Cut {
                wisps: 674,
                sections: 9,
                levels,
                coarse: 10,
                longest: 0.48,
                hem: -0.20,
                curl_radius: 0.002,
                curl_pitch: 0.13,
                vertices: [48, 28],
            },
            Style::LongCurly => Cut {
                wisps: 821,
                sections: 12,
                levels,
                coarse: 14,
                longest: 0.42,
                hem: -0.16,
                curl_radius: 0.009,
                curl_pitch: 0.05,
                vertices: [128, 80],
            },
        }
    }
}

impl fmt::Display for Style {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Style::Short => "short",
            Style::ShortCurly => "short-curly",
            Style::Long => "long",
            Style::LongCurly => "long-curly",
        })
    }
}

impl FromStr for Style {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Style::ALL.into_iter().find(|style| style.to_string() == name).ok_or_else(|| {
            Error::Usage(format!("no sample {name}: there are short, short-curly, long and long-curly"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_counts_are_the_papers_within_three() {
        for style in Style::ALL {
            assert!(style.nodes().abs_diff(style.paper().0) <= 3, "{style}: {}", style.nodes());
            assert_eq!(style.to_string().parse::<Style>().unwrap(), style);
        }
        assert!("bald".parse::<Style>().is_err());
    }
}
