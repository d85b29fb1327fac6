//! Line plots as SVG. Colours are CSS variables with fallback values, so that a plot suits light and dark
//! pages and works alone.

use std::fmt::Write;

use super::text::{escape, figure};

/// Scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scale {
    /// Linear.
    #[default]
    Linear,
    /// Logarithmic; values of zero and below are omitted.
    Log,
}

/// An axis of a plot.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// Its scale.
    pub scale: Scale,
}

/// One line of a plot. Non-finite values break the line.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Line {
    /// Name in the legend.
    pub name: String,
    /// Points, in the order in which they are joined.
    pub points: Vec<(f64, f64)>,
}

/// A plot of one or more lines.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plot {
    /// Title for screen readers.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Lines, in the order of the legend.
    pub lines: Vec<Line>,
    /// Draws lines as stacked areas; all must have the same x values.
    pub stacked: bool,
    /// Marks every point with a dot.
    pub dots: bool,
}

/// Width and height of the drawing, and its margins: left, top, right, bottom.
const SIZE: (f64, f64) = (640.0, 270.0);
const MARGIN: (f64, f64, f64, f64) = (64.0, 30.0, 14.0, 40.0);

/// Colours that are distinguishable with colour vision deficiencies, on white and on black.
const COLOURS: [&str; 8] =
    ["#3b7dd8", "#e08a1e", "#2a9d6f", "#c8507a", "#8a63d2", "#a08c00", "#2fa3b8", "#7a8594"];

/// The CSS colour of line `i`, also for legends outside a plot.
pub fn colour(i: usize) -> String {
    format!("var(--line{}, {})", i % COLOURS.len(), COLOURS[i % COLOURS.len()])
}

impl Plot {
    /// The plot as an `svg` element.
    pub fn to_svg(&self) -> String {
        let lines = self.stacked_points();
        let values = |pick: fn(&(f64, f64)) -> f64| lines.iter().flat_map(move |l| l.iter().map(pick));
        let x = Ruler::new(self.x.scale, values(|p| p.0), false, (MARGIN.0, SIZE.0 - MARGIN.2));
        let from_zero = self.stacked || self.y.scale == Scale::Linear;
        let y = Ruler::new(self.y.scale, values(|p| p.1), from_zero, (SIZE.1 - MARGIN.3, MARGIN.1));
        let mut svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {} {}" role="img" font-family="system-ui, sans-serif" font-size="11"><title>{}</title>"#,
            SIZE.0,
            SIZE.1,
            escape(&self.title)
        );
        self.draw_axes(&mut svg, &x, &y);
        let floor = vec![(0.0, 0.0); lines.iter().map(Vec::len).max().unwrap_or(0)];
        for (i, points) in lines.iter().enumerate() {
            if self.stacked {
                let below = if i == 0 { &floor } else { &lines[i - 1] };
                area(&mut svg, points, below, &x, &y, &colour(i));
            } else {
                line(&mut svg, points, &x, &y, &colour(i), self.dots);
            }
        }
        self.draw_legend(&mut svg);
        svg.push_str("</svg>");
        svg
    }

    /// Points of the lines, accumulated if stacked.
    fn stacked_points(&self) -> Vec<Vec<(f64, f64)>> {
        let mut lines: Vec<Vec<(f64, f64)>> = self.lines.iter().map(|l| l.points.clone()).collect();
        if self.stacked {
            for i in 1..lines.len() {
                let (before, after) = lines.split_at_mut(i);
                for (above, below) in after[0].iter_mut().zip(&before[i - 1]) {
                    above.1 += below.1;
                }
            }
        }
        lines
    }

    fn draw_axes(&self, svg: &mut String, x: &Ruler, y: &Ruler) {
        let (left, right, top, bottom) = (MARGIN.0, SIZE.0 - MARGIN.2, MARGIN.1, SIZE.1 - MARGIN.3);
        let grid = r#"stroke="var(--grid, #8885)" stroke-width="1""#;
        let ink = r#"fill="var(--faint, #777)""#;
        for (place, label) in y.ticks() {
            push(svg, format_args!(r#"<path d="M{left:.1} {place:.1}H{right:.1}" {grid}/>"#));
            let (tx, ty) = (left - 6.0, place + 4.0);
            push(
                svg,
                format_args!(r#"<text x="{tx:.1}" y="{ty:.1}" text-anchor="end" {ink}>{label}</text>"#),
            );
        }
        for (place, label) in x.ticks() {
            push(svg, format_args!(r#"<path d="M{place:.1} {bottom:.1}v4" {grid}/>"#));
            let ty = bottom + 16.0;
            push(
                svg,
                format_args!(r#"<text x="{place:.1}" y="{ty:.1}" text-anchor="middle" {ink}>{label}</text>"#),
            );
        }
        push(svg, format_args!(r#"<path d="M{left:.1} {bottom:.1}H{right:.1}" {grid}/>"#));
        let (middle, low) = (0.5 * (left + right), SIZE.1 - 8.0);
        let (x_label, y_label) = (escape(&self.x.label), escape(&self.y.label));
        push(
            svg,
            format_args!(r#"<text x="{middle:.1}" y="{low:.1}" text-anchor="middle" {ink}>{x_label}</text>"#),
        );
        let high = top - 14.0;
        push(svg, format_args!(r#"<text x="8" y="{high:.1}" {ink}>{y_label}</text>"#));
    }

    /// Legend above the plot, right-aligned; omitted for a single line.
    fn draw_legend(&self, svg: &mut String) {
        if self.lines.len() < 2 {
            return;
        }
        let mut x = SIZE.0 - MARGIN.2;
        for (i, line) in self.lines.iter().enumerate().rev() {
            // A sans-serif letter at 11 px is about 6 px wide; the remainder is the swatch and the gaps.
            x -= 6.2 * line.name.chars().count() as f64 + 32.0;
            let (c, tx, name) = (colour(i), x + 14.0, escape(&line.name));
            push(svg, format_args!(r#"<rect x="{x:.1}" y="7" width="10" height="10" rx="2" fill="{c}"/>"#));
            push(svg, format_args!(r#"<text x="{tx:.1}" y="16" fill="var(--ink, #777)">{name}</text>"#));
        }
    }
}

fn line(svg: &mut String, points: &[(f64, f64)], x: &Ruler, y: &Ruler, colour: &str, dots: bool) {
    let mut path = String::new();
    let mut pen = 'M';
    for (px, py) in points {
        let (Some(px), Some(py)) = (x.place(*px), y.place(*py)) else {
            pen = 'M';
            continue;
        };
        push(&mut path, format_args!("{pen}{px:.1} {py:.1}"));
        pen = 'L';
        if dots {
            push(svg, format_args!(r#"<circle cx="{px:.1}" cy="{py:.1}" r="3" fill="{colour}"/>"#));
        }
    }
    push(
        svg,
        format_args!(
            r#"<path d="{path}" fill="none" stroke="{colour}" stroke-width="1.6" stroke-linejoin="round" stroke-linecap="round"/>"#
        ),
    );
}

fn area(svg: &mut String, points: &[(f64, f64)], below: &[(f64, f64)], x: &Ruler, y: &Ruler, colour: &str) {
    let edge = |(px, _): &(f64, f64), height: f64| Some((x.place(*px)?, y.place(height)?));
    let top = points.iter().filter_map(|p| edge(p, p.1));
    let bottom = points.iter().zip(below).rev().filter_map(|(p, b)| edge(p, b.1));
    let mut path = String::new();
    for (i, (px, py)) in top.chain(bottom).enumerate() {
        push(&mut path, format_args!("{}{px:.1} {py:.1}", if i == 0 { 'M' } else { 'L' }));
    }
    push(svg, format_args!(r#"<path d="{path}" fill="{colour}" fill-opacity="0.85"/>"#));
}

/// Map from values to positions along an axis of the drawing.
struct Ruler {
    scale: Scale,
    /// Ends of the axis; their decadic logarithms if it is logarithmic.
    low: f64,
    high: f64,
    step: f64,
    /// Positions of the ends in the drawing.
    span: (f64, f64),
}

impl Ruler {
    fn new(scale: Scale, values: impl Iterator<Item = f64>, from_zero: bool, span: (f64, f64)) -> Self {
        let start =
            if from_zero && scale == Scale::Linear { (0.0, 0.0) } else { (f64::INFINITY, f64::NEG_INFINITY) };
        let known = values.filter_map(|v| measure(scale, v));
        let (low, high) = known.fold(start, |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = match scale {
            _ if low > high => (0.0, 1.0),
            Scale::Log => (low.floor(), high.ceil().max(low.floor() + 1.0)),
            Scale::Linear if low == high => (low, low + if low == 0.0 { 1.0 } else { low.abs() }),
            Scale::Linear => (low, high),
        };
        let step = round_step((high - low) / 5.0);
        let step = if scale == Scale::Log { step.round().max(1.0) } else { step };
        // The vertical axis ends at round numbers, so that no line coincides with its border.
        let (low, high) = if from_zero {
            ((low / step).floor() * step, (high / step - 1e-9).ceil() * step)
        } else {
            (low, high)
        };
        Ruler { scale, low, high, step, span }
    }

    fn place(&self, value: f64) -> Option<f64> {
        let v = measure(self.scale, value)?;
        Some(self.span.0 + (v - self.low) / (self.high - self.low) * (self.span.1 - self.span.0))
    }

    /// Position and label of each tick.
    fn ticks(&self) -> Vec<(f64, String)> {
        let first = (self.low / self.step - 1e-9).ceil();
        let count = ((self.high - first * self.step) / self.step + 1e-6).floor();
        (0..=count as usize)
            .map(|k| {
                let v = (first + k as f64) * self.step;
                let place =
                    self.span.0 + (v - self.low) / (self.high - self.low) * (self.span.1 - self.span.0);
                (place, if self.scale == Scale::Log { format!("1e{v}") } else { figure(v) })
            })
            .collect()
    }
}

/// A value in the units of the scale; `None` if it is not finite.
fn measure(scale: Scale, value: f64) -> Option<f64> {
    let v = if scale == Scale::Log { value.log10() } else { value };
    v.is_finite().then_some(v)
}

/// The smallest of 1, 2 or 5 times a power of ten that is at least `x`.
fn round_step(x: f64) -> f64 {
    let power = 10f64.powf(x.log10().floor());
    let digit = x / power;
    power * [1.0, 2.0, 5.0].into_iter().find(|d| digit <= d + 1e-9).unwrap_or(10.0)
}

fn push(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments).expect("writing to a String cannot fail");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::text::check_markup;

    fn sample(scale: Scale) -> Plot {
        let points = |f: fn(f64) -> f64| (1..=9).map(|i| (f64::from(i), f(f64::from(i)))).collect();
        Plot {
            title: "a < b".into(),
            y: Axis { label: "tip error (1/L)".into(), scale },
            lines: vec![
                Line { name: "second & order".into(), points: points(|x| x.powi(-2)) },
                Line { name: "fourth".into(), points: points(|x| x.powi(-4)) },
            ],
            ..Plot::default()
        }
    }

    #[test]
    fn plots_are_well_formed_and_include_line_names() {
        for scale in [Scale::Linear, Scale::Log] {
            for (stacked, dots) in [(false, true), (true, false)] {
                let svg = Plot { stacked, dots, ..sample(scale) }.to_svg();
                check_markup(&svg).unwrap();
                assert!(svg.contains("second &amp; order") && svg.contains("a &lt; b"));
            }
        }
    }

    #[test]
    fn logarithmic_axis_has_evenly_spaced_decades() {
        let ruler =
            Ruler::new(Scale::Log, [0.002, 30.0, 0.0, -1.0, f64::NAN].into_iter(), false, (0.0, 500.0));
        let labels: Vec<_> = ruler.ticks().into_iter().map(|t| t.1).collect();
        assert_eq!(labels, ["1e-3", "1e-2", "1e-1", "1e0", "1e1", "1e2"]);
        assert_eq!(ruler.place(0.01).unwrap().round(), 100.0);
        assert_eq!(ruler.place(0.0), None);
    }

    #[test]
    fn linear_axis_ends_at_round_numbers() {
        let ruler = Ruler::new(Scale::Linear, [0.3, 8.7].into_iter(), true, (100.0, 0.0));
        assert_eq!((ruler.low, ruler.high, ruler.step), (0.0, 10.0, 2.0));
        assert_eq!(ruler.place(5.0), Some(50.0));
    }

    #[test]
    fn missing_values_break_lines_and_degenerate_data_are_drawn() {
        let broken =
            Line { name: "n".into(), points: vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0), (3.0, 3.0)] };
        let svg = Plot { lines: vec![broken], ..Plot::default() }.to_svg();
        let path = svg.rsplit("<path d=\"").next().unwrap().split('"').next().unwrap();
        assert_eq!(path.matches('M').count(), 2);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        for points in [vec![], vec![(5.0, 0.0)], vec![(5.0, -2.0)], vec![(f64::NAN, f64::NAN)]] {
            for scale in [Scale::Linear, Scale::Log] {
                let axis = Axis { scale, ..Axis::default() };
                let lines = vec![Line { points: points.clone(), ..Line::default() }];
                let svg = Plot { x: axis.clone(), y: axis, lines, ..Plot::default() }.to_svg();
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            }
        }
    }
}
