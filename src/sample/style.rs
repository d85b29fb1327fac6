//! The four hair styles of the samples, after Bertails & Cani 2004, figure 6.

use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// A hair style.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Short, smooth hair.
    Short,
    /// Short curls.
    ShortCurly,
    /// Hair below the shoulders.
    Long,
    /// Long ringlets.
    LongCurly,
}

/// Parameters of a style; lengths in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cut {
    /// Number of leaf wisps, with one guide each.
    pub(super) wisps: usize,
    /// Sections per wisp.
    pub(super) sections: usize,
    /// Levels of the hierarchy.
    pub(super) levels: usize,
    /// Number of coarse wisps.
    pub(super) coarse: usize,
    /// Length of the longest hair, along its course.
    pub(super) longest: f64,
    /// Height of the hem in rest space.
    pub(super) hem: f64,
    /// Radius of the curls.
    pub(super) curl_radius: f64,
    /// Length of the course per turn of a curl.
    pub(super) curl_pitch: f64,
    /// Vertices per guide and per render strand.
    pub(super) vertices: [usize; 2],
}

impl Style {
    /// All styles, in the order of the figure.
    pub const ALL: [Style; 4] = [Style::Short, Style::ShortCurly, Style::Long, Style::LongCurly];

    /// Nodes of the finest level, and levels, in the figure.
    pub fn published(self) -> (usize, usize) {
        match self {
            Style::Short => (5149, 2),
            Style::ShortCurly => (4909, 2),
            Style::Long => (6065, 3),
            Style::LongCurly => (9853, 3),
        }
    }

    /// Nodes of the finest level: leaf wisps × sections, within three of [`Style::published`].
    pub fn nodes(self) -> usize {
        self.cut().wisps * self.cut().sections
    }

    pub(super) fn cut(self) -> Cut {
        let (_, levels) = self.published();
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
            Error::Usage(format!(
                "no sample is named {name}: use short, short-curly, long, long-curly or creature"
            ))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_counts_are_within_three_of_the_published_ones() {
        for style in Style::ALL {
            assert!(style.nodes().abs_diff(style.published().0) <= 3, "{style}: {}", style.nodes());
            assert_eq!(style.to_string().parse::<Style>().unwrap(), style);
        }
        assert!("bald".parse::<Style>().is_err());
    }
}
