//! The hair styles of the samples: four after Bertails & Cani 2004, figure 6, and others that people wear.

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
    /// Hair cut at the jaw, with a fringe.
    Bob,
    /// Hair gathered at the back of the head in a tie.
    Ponytail,
    /// Hair gathered in a tie and braided from there, in three strands.
    Braid,
    /// Tight coils that stand around the head.
    Coils,
    /// Hair cut to less than a centimetre.
    Buzz,
}

/// Which way hair is combed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Comb {
    /// Away from the whorl at the crown, on all sides.
    Whorl,
    /// To both sides of a parting, which begins so far to the left of the middle, m.
    Parted(f64),
    /// As parted, but forward over the forehead.
    Fringe(f64),
    /// To a tie at the back of the head.
    Gathered,
    /// The same, and braided from there.
    Braided,
    /// Straight out of the scalp.
    Out,
}

/// Parameters of a style; lengths in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cut {
    /// Leaf wisps, with one guide each; coarse wisps; levels of the hierarchy; sections of each wisp.
    pub(super) wisps: usize,
    pub(super) coarse: usize,
    pub(super) levels: usize,
    pub(super) sections: usize,
    /// Number of render strands.
    pub(super) strands: usize,
    /// Vertices per guide and per render strand.
    pub(super) vertices: [usize; 2],
    /// Which way hair is combed.
    pub(super) comb: Comb,
    /// Length of hair, along its course, on top of the head and at its sides and nape.
    pub(super) length: [f64; 2],
    /// Share of its length by which a strand may be shorter than others.
    pub(super) uneven: f64,
    /// Share of its length by which hair is shorter at the hairline.
    pub(super) fade: f64,
    /// Height in rest space at which the lowest hair is cut, and by how much higher the topmost: layers.
    pub(super) hem: f64,
    pub(super) layers: f64,
    /// Height of the topmost hair above the scalp.
    pub(super) body: f64,
    /// Length over which a hair bends from the scalp into the direction of the comb.
    pub(super) bend: f64,
    /// Radius of the curls, and length of the course per turn.
    pub(super) curl: [f64; 2],
    /// Radius of the curls that guides make: that of the strands, or less where their strands coil around
    /// them, each by itself.
    pub(super) guide_curl: f64,
    /// How far tips of a wisp, and of the tufts within it, come together: 0 to 1.
    pub(super) clump: [f64; 2],
    /// Directions of strands that stray: standard deviation, rad.
    pub(super) stray: f64,
    /// Length along which the direction in which a strand strays turns once around the root's normal.
    pub(super) wander: f64,
}

/// Hair that is short and straight: what the other styles are told apart from.
const SHORT: Cut = Cut {
    wisps: 644,
    coarse: 18,
    levels: 2,
    sections: 8,
    strands: 8000,
    vertices: [16, 9],
    comb: Comb::Parted(0.022),
    length: [0.085, 0.065],
    uneven: 0.25,
    fade: 0.0,
    hem: 0.03,
    layers: 0.0,
    body: 0.012,
    bend: 0.018,
    curl: [0.0012, 0.06],
    guide_curl: 0.0012,
    clump: [0.35, 0.5],
    stray: 0.10,
    wander: f64::INFINITY,
};

impl Style {
    /// All styles; the first four in the order of the figure.
    pub const ALL: [Style; 9] = [
        Style::Short,
        Style::ShortCurly,
        Style::Long,
        Style::LongCurly,
        Style::Bob,
        Style::Ponytail,
        Style::Braid,
        Style::Coils,
        Style::Buzz,
    ];

    /// Nodes of the finest level, and levels, in the figure; `None` for the other styles.
    pub fn published(self) -> Option<(usize, usize)> {
        match self {
            Style::Short => Some((5149, 2)),
            Style::ShortCurly => Some((4909, 2)),
            Style::Long => Some((6065, 3)),
            Style::LongCurly => Some((9853, 3)),
            _ => None,
        }
    }

    /// Nodes of the finest level: leaf wisps × sections, within three of [`Style::published`].
    pub fn nodes(self) -> usize {
        self.cut().wisps * self.cut().sections
    }

    pub(super) fn cut(self) -> Cut {
        match self {
            Style::Short => SHORT,
            Style::ShortCurly => Cut {
                wisps: 491,
                coarse: 26,
                sections: 10,
                vertices: [64, 40],
                length: [0.10, 0.075],
                hem: 0.0,
                body: 0.016,
                curl: [0.0055, 0.026],
                guide_curl: 0.0055,
                clump: [0.5, 0.5],
                ..SHORT
            },
            Style::Long => Cut {
                wisps: 674,
                coarse: 10,
                levels: 3,
                sections: 9,
                vertices: [48, 28],
                length: [0.50, 0.46],
                hem: -0.20,
                layers: 0.05,
                uneven: 0.12,
                body: 0.014,
                bend: 0.022,
                curl: [0.0025, 0.14],
                guide_curl: 0.0025,
                stray: 0.07,
                ..SHORT
            },
            Style::LongCurly => Cut {
                wisps: 821,
                coarse: 14,
                levels: 3,
                sections: 12,
                vertices: [128, 80],
                length: [0.44, 0.40],
                hem: -0.16,
                layers: 0.06,
                uneven: 0.12,
                body: 0.018,
                bend: 0.022,
                curl: [0.009, 0.05],
                guide_curl: 0.009,
                clump: [0.6, 0.5],
                stray: 0.07,
                ..SHORT
            },
            Style::Bob => Cut {
                wisps: 600,
                coarse: 14,
                levels: 3,
                sections: 9,
                vertices: [32, 20],
                comb: Comb::Fringe(0.0),
                length: [0.30, 0.22],
                uneven: 0.04,
                hem: 0.025,
                layers: 0.0,
                body: 0.013,
                bend: 0.020,
                stray: 0.05,
                ..SHORT
            },
            Style::Ponytail => Cut {
                wisps: 600,
                coarse: 10,
                levels: 3,
                sections: 14,
                vertices: [64, 40],
                comb: Comb::Gathered,
                length: [0.55, 0.48],
                uneven: 0.2,
                hem: -0.18,
                body: 0.007,
                bend: 0.012,
                curl: [0.002, 0.12],
                guide_curl: 0.002,
                stray: 0.05,
                ..SHORT
            },
            Style::Braid => Cut {
                wisps: 300,
                coarse: 10,
                levels: 3,
                sections: 40,
                vertices: [110, 80],
                comb: Comb::Braided,
                length: [0.55, 0.48],
                uneven: 0.1,
                hem: -0.5,
                body: 0.007,
                bend: 0.012,
                curl: [0.0008, 0.12],
                guide_curl: 0.0008,
                clump: [0.2, 0.3],
                stray: 0.04,
                ..SHORT
            },
            Style::Coils => Cut {
                wisps: 600,
                coarse: 30,
                sections: 6,
                vertices: [24, 90],
                comb: Comb::Out,
                length: [0.085, 0.065],
                uneven: 0.25,
                fade: 0.6,
                hem: -0.2,
                body: 0.1,
                curl: [0.0035, 0.0065],
                guide_curl: 0.0008,
                clump: [0.0, 0.25],
                stray: 1.2,
                wander: 0.09,
                ..SHORT
            },
            Style::Buzz => Cut {
                wisps: 800,
                coarse: 40,
                sections: 4,
                strands: 40_000,
                vertices: [6, 5],
                comb: Comb::Whorl,
                length: [0.012, 0.008],
                uneven: 0.2,
                fade: 0.5,
                body: 0.004,
                bend: 0.008,
                curl: [0.0002, 0.01],
                guide_curl: 0.0,
                clump: [0.0, 0.1],
                stray: 0.2,
                ..SHORT
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
            Style::Bob => "bob",
            Style::Ponytail => "ponytail",
            Style::Braid => "braid",
            Style::Coils => "coils",
            Style::Buzz => "buzz",
        })
    }
}

impl FromStr for Style {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Style::ALL.into_iter().find(|style| style.to_string() == name).ok_or_else(|| {
            let names: Vec<String> = Style::ALL.iter().map(ToString::to_string).collect();
            Error::Usage(format!("no sample is named {name}: use creature, or one of {}", names.join(", ")))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_counts_are_within_three_of_the_published_ones() {
        for style in Style::ALL {
            if let Some((nodes, levels)) = style.published() {
                assert!(style.nodes().abs_diff(nodes) <= 3, "{style}: {}", style.nodes());
                assert_eq!(style.cut().levels, levels);
            }
            assert_eq!(style.to_string().parse::<Style>().unwrap(), style);
        }
        assert!("bald".parse::<Style>().is_err());
    }
}
