//! The report of a bake: `report.html`, a self-contained page, and `report.json`, its data.

use std::fmt::Write;

use serde::Serialize;

use super::plot::{self, Axis, Line, Plot, Scale};
use super::text::{base64, escape, figure};
use super::view::View;
use super::warning::{Warning, frame_link};
use crate::error::{Error, Result};

/// Data of a report. Per-frame values are in the order of `frames`; a missing value is NaN, which becomes
/// `null` in JSON.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct BakeReport {
    /// Name of the shot.
    pub title: String,
    /// Settings of the bake: name, and value with unit.
    pub settings: Vec<(String, String)>,
    /// Frame numbers.
    pub frames: Vec<i32>,
    /// Time of each stage, seconds per frame.
    pub stages: Vec<Series>,
    /// All other measurements.
    pub charts: Vec<Chart>,
    /// What is not recorded and in no chart.
    pub unrecorded: Vec<String>,
    /// Warnings to the user.
    pub warnings: Vec<Warning>,
    /// Pictures of the shot.
    pub pictures: Vec<Picture>,
    /// The shot, to play; omitted in the JSON.
    #[serde(skip)]
    pub view: Option<View>,
}

/// One value per frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Series {
    /// Name, such as `mean` or `largest`.
    pub name: String,
    /// One value per frame.
    pub values: Vec<f64>,
}

/// Quantities of one kind and unit, drawn in one plot.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Chart {
    /// The quantity, such as `Strand speed`.
    pub name: String,
    /// Its unit; empty for a count.
    pub unit: String,
    /// Definition, or how to judge it.
    pub note: String,
    /// Whether the vertical axis is logarithmic.
    pub logarithmic: bool,
    /// Its series.
    pub series: Vec<Series>,
}

impl Series {
    /// Whether there is a value.
    fn is_known(&self) -> bool {
        self.values.iter().any(|v| v.is_finite())
    }
}

impl Chart {
    /// Whether there is a value.
    fn is_known(&self) -> bool {
        self.series.iter().any(Series::is_known)
    }

    /// What has no value: the chart, or series of it.
    fn unknown(&self) -> Option<String> {
        let missing: Vec<&str> =
            self.series.iter().filter(|s| !s.is_known()).map(|s| s.name.as_str()).collect();
        match missing.len() {
            0 => None,
            n if n == self.series.len() => Some(self.name.clone()),
            _ => Some(format!("{} ({})", self.name, missing.join(", "))),
        }
    }
}

/// A picture in the report.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Picture {
    /// Caption.
    pub caption: String,
    /// MIME type, such as `image/png` (APNG too).
    pub media_type: String,
    /// The encoded file; omitted in the JSON.
    #[serde(skip)]
    pub bytes: Vec<u8>,
}

const STYLE: &str = include_str!("style.css");

impl BakeReport {
    /// The data as JSON, without pictures.
    ///
    /// # Errors
    /// [`Error::Internal`] if the length of a series is not the number of frames.
    pub fn to_json(&self) -> Result<String> {
        self.check()?;
        serde_json::to_string_pretty(self).map_err(|e| Error::Internal(format!("report.json: {e}")))
    }

    /// The page with embedded plots and pictures. It needs no network, and scripts for the view only.
    ///
    /// # Errors
    /// [`Error::Internal`] if the length of a series is not the number of frames.
    pub fn to_html(&self) -> Result<String> {
        self.check()?;
        let title = escape(&self.title);
        let mut page = format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\
             <title>{title}</title><style>{STYLE}</style></head>\n<body><h1>{title}</h1>\n"
        );
        let time = Chart {
            name: "Time by stage".into(),
            unit: "s".into(),
            note: "Wall-clock time of each frame, stacked by stage.".into(),
            logarithmic: false,
            series: self.stages.clone(),
        };
        let charts = std::iter::once((&time, true)).chain(self.charts.iter().map(|c| (c, false)));
        let charts = charts.filter(|(chart, _)| !chart.series.is_empty());
        let charts: Vec<_> = charts.collect();
        let unknown = charts.iter().filter_map(|(chart, _)| chart.unknown());
        let unknown: Vec<String> = unknown.chain(self.unrecorded.iter().cloned()).collect();
        page.push_str(&self.lead(&unknown));
        if !self.warnings.is_empty() {
            let linked = self.view.is_some();
            let items: String =
                self.warnings.iter().map(|w| format!("<li>{}</li>", w.to_html(linked))).collect();
            add(
                &mut page,
                format_args!("<section class=\"warnings\"><h2>Warnings</h2><ul>{items}</ul></section>\n"),
            );
        }
        if let Some(view) = &self.view {
            page.push_str(&view.to_html());
        }
        for p in &self.pictures {
            let (caption, kind) = (escape(&p.caption), escape(&p.media_type));
            let data = base64(&p.bytes);
            add(
                &mut page,
                format_args!(
                    "<figure class=\"picture\"><img alt=\"{caption}\" src=\"data:{kind};base64,{data}\"/>\
                     <figcaption>{caption}</figcaption></figure>\n"
                ),
            );
        }
        page.push_str("<div class=\"charts\">\n");
        for (chart, stacked) in charts.into_iter().filter(|(chart, _)| chart.is_known()) {
            page.push_str(&self.card(chart, stacked));
        }
        page.push_str("</div>\n");
        page.push_str(&settings(&self.settings));
        page.push_str("</body></html>\n");
        Ok(page)
    }

    /// What the page begins with: its frames, their time, and what is not known of them.
    fn lead(&self, unknown: &[String]) -> String {
        let (Some(first), Some(last)) = (self.frames.first(), self.frames.last()) else {
            return "<p class=\"lead\">No frames were baked.</p>\n".into();
        };
        let (n, time) = (self.frames.len(), self.time());
        let mut lead = format!("<p class=\"lead\">Frames {first} to {last} ({n} frames). {time}</p>\n");
        if !unknown.is_empty() {
            let unknown = escape(&unknown.join(", "));
            add(
                &mut lead,
                format_args!(
                    "<p class=\"lead\">Not recorded in the cache, and neither drawn nor warned of: \
                     {unknown}.</p>\n"
                ),
            );
        }
        lead
    }

    /// The time of the frames whose time is known, in words.
    fn time(&self) -> String {
        let frame = |i: usize| self.stages.iter().map(|s| s.values[i]).sum::<f64>();
        let known: Vec<f64> = (0..self.frames.len()).map(frame).filter(|s| s.is_finite()).collect();
        let total: f64 = known.iter().sum();
        let (whole, each) = (figure(total), figure(total / known.len() as f64));
        match known.len() {
            0 => "Their time is not known.".into(),
            n if n == self.frames.len() => format!("Total time {whole} s, {each} s per frame."),
            n => {
                format!("Time of {n} of them {whole} s, {each} s per frame; that of the others is not known.")
            }
        }
    }

    fn card(&self, chart: &Chart, stacked: bool) -> String {
        let line = |s: &Series| {
            let points = self.frames.iter().zip(&s.values).map(|(f, v)| (f64::from(*f), *v));
            Line { name: s.name.clone(), points: points.collect() }
        };
        let scale = if chart.logarithmic { Scale::Log } else { Scale::Linear };
        let plot = Plot {
            title: chart.name.clone(),
            x: Axis { label: "frame".into(), ..Axis::default() },
            y: Axis { label: chart.unit.clone(), scale },
            lines: chart.series.iter().map(line).collect(),
            stacked,
            dots: self.frames.len() == 1,
        };
        let (name, note, svg) = (escape(&chart.name), escape(&chart.note), plot.to_svg());
        let unit = if chart.unit.is_empty() { String::new() } else { format!(" ({})", escape(&chart.unit)) };
        let rows: String = chart.series.iter().enumerate().map(|(i, s)| self.row(i, s)).collect();
        format!(
            "<section class=\"card\"><h2>{name}{unit}</h2><p>{note}</p>{svg}<table><thead>\
             <tr><th></th><th>mean</th><th>min</th><th>max</th><th>max at frame</th></tr></thead>\
             <tbody>{rows}</tbody></table></section>\n"
        )
    }

    fn row(&self, i: usize, series: &Series) -> String {
        let finite = || self.frames.iter().zip(&series.values).filter(|(_, v)| v.is_finite());
        let mean = finite().map(|(_, v)| v).sum::<f64>() / finite().count() as f64;
        let min = finite().map(|(_, v)| *v).fold(f64::NAN, f64::min);
        // The first of equal values.
        let max = finite().rev().max_by(|a, b| a.1.total_cmp(b.1));
        let (max, frame) =
            max.map_or((f64::NAN, String::new()), |(f, v)| (*v, frame_link(*f, self.view.is_some())));
        let (name, colour) = (escape(&series.name), plot::colour(i));
        format!(
            "<tr><th><i style=\"background:{colour}\"></i>{name}</th><td>{}</td><td>{}</td><td>{}</td>\
             <td>{frame}</td></tr>",
            figure(mean),
            figure(min),
            figure(max)
        )
    }

    /// Checks the lengths of all series.
    fn check(&self) -> Result<()> {
        let n = self.frames.len();
        let all = self.stages.iter().chain(self.charts.iter().flat_map(|c| &c.series));
        match all.into_iter().find(|s| s.values.len() != n) {
            Some(s) => {
                let found = s.values.len();
                Err(Error::Internal(format!("series {:?} has {found} values for {n} frames", s.name)))
            }
            None => Ok(()),
        }
    }
}

fn settings(settings: &[(String, String)]) -> String {
    if settings.is_empty() {
        return String::new();
    }
    let rows: String = settings
        .iter()
        .map(|(k, v)| format!("<tr><th>{}</th><td>{}</td></tr>", escape(k), escape(v)))
        .collect();
    format!(
        "<section class=\"card settings\"><h2>Scene and settings</h2><table><tbody>{rows}</tbody></table>\
         </section>\n"
    )
}

fn add(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments).expect("writing to a String cannot fail");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::picture::Image;
    use crate::report::text::check_markup;

    fn sample() -> BakeReport {
        let series = |name: &str, f: fn(f64) -> f64| Series {
            name: name.into(),
            values: (0..48).map(|i| f(f64::from(i))).collect(),
        };
        BakeReport {
            title: "Shot <12> & \"turn\"".into(),
            settings: vec![("substeps".into(), "8".into()), ("track".into(), "<b>.json".into())],
            frames: (1001..1049).collect(),
            stages: vec![series("solve", |i| 0.1 + 0.02 * (i * 0.3).sin()), series("write", |_| 0.012)],
            charts: vec![
                Chart {
                    name: "Strand speed".into(),
                    unit: "m/s".into(),
                    note: "Points of guides > 1 mm/s.".into(),
                    logarithmic: false,
                    series: vec![
                        series("mean", |i| (i * 0.2).sin().abs()),
                        series("max", |i| 3.0 * (i * 0.2).sin().abs()),
                    ],
                },
                Chart {
                    name: "Stretch".into(),
                    logarithmic: true,
                    series: vec![series("largest", |i| if i == 7.0 { f64::NAN } else { 1e-9 * (1.0 + i) })],
                    ..Chart::default()
                },
            ],
            unrecorded: Vec::new(),
            warnings: vec![Warning::new("3 strands <short> of contact")],
            pictures: vec![Picture {
                caption: "Frames 1001–1048".into(),
                media_type: "image/png".into(),
                bytes: Image::new(4, 4).to_png().unwrap(),
            }],
            view: None,
        }
    }

    #[test]
    fn page_is_well_formed_and_complete() {
        let report = sample();
        let page = report.to_html().unwrap();
        check_markup(&page).unwrap();
        for chart in &report.charts {
            assert!(page.contains(&format!("<h2>{}", chart.name)));
            for s in &chart.series {
                assert!(page.contains(&format!("</i>{}</th>", s.name)), "{}", s.name);
            }
        }
        assert!(page.contains("</i>solve</th>") && page.contains("Time by stage"));
        assert!(page.contains("&lt;b&gt;.json") && page.contains("3 strands &lt;short&gt;"));
        assert!(page.contains(&base64(&report.pictures[0].bytes)));
        assert_eq!(page.matches("<svg").count(), 3);
        assert!(!page.contains("NaN"));
    }

    #[test]
    fn tables_give_the_extremes_and_their_frames() {
        let mut report = sample();
        report.charts = vec![Chart {
            series: vec![Series { name: "depth".into(), values: vec![f64::NAN; 48] }],
            ..Chart::default()
        }];
        report.charts[0].series[0].values[3] = 2.5;
        report.charts[0].series[0].values[9] = 0.5;
        let page = report.to_html().unwrap();
        assert!(page.contains("</i>depth</th><td>1.5</td><td>0.5</td><td>2.5</td><td>1004</td>"));
    }

    #[test]
    fn what_is_not_known_is_said_and_not_drawn() {
        let mut report = sample();
        report.charts[1].series[0].values = vec![f64::NAN; 48];
        report.stages[0].values[5] = f64::NAN;
        let page = report.to_html().unwrap();
        check_markup(&page).unwrap();
        assert!(page.contains("neither drawn nor warned of: Stretch.</p>") && !page.contains("<h2>Stretch"));
        assert_eq!(page.matches("<svg").count(), 2);
        assert!(page.contains("Time of 47 of them "));
        // A chart of which something is known says what is not.
        let depths = |name: &str, value: f64| Series { name: name.into(), values: vec![value; 48] };
        report.charts.push(Chart {
            name: "Penetration".into(),
            series: vec![depths("guides", 1.0), depths("exempt", f64::NAN)],
            ..Chart::default()
        });
        report.unrecorded = vec!["guides <halved>".into()];
        let page = report.to_html().unwrap();
        assert!(page.contains("warned of: Stretch, Penetration (exempt), guides &lt;halved&gt;.</p>"));
        assert!(page.contains("<h2>Penetration") && !page.contains("NaN"));
        report.charts.pop();
        report.unrecorded.clear();
        report.stages.iter_mut().for_each(|s| s.values = vec![f64::NAN; 48]);
        let page = report.to_html().unwrap();
        assert!(
            page.contains("Their time is not known.") && page.contains("warned of: Time by stage, Stretch.")
        );
        assert!(!page.contains("Total time") && !page.contains("<h2>Time"));
    }

    #[test]
    fn frames_are_links_where_there_is_a_view() {
        let mut report = sample();
        report.warnings[0].frame(1004, "0.3 mm");
        let link = "<a href=\"#frame=1004\">1004</a>";
        assert!(!report.to_html().unwrap().contains("#frame="));
        report.view = Some(View::sample());
        let page = report.to_html().unwrap();
        assert!(
            page.contains(&format!("<li>3 strands &lt;short&gt; of contact in frame {link} (0.3 mm)</li>"))
        );
        assert!(page.matches("#frame=").count() > 4, "and those of extremes");
        let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
        assert_eq!(json["warnings"][0], "3 strands <short> of contact in frame 1004 (0.3 mm)");
    }

    #[test]
    fn json_has_the_same_numbers_and_null_for_missing_values() {
        let report = sample();
        let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
        let values = &json["charts"][1]["series"][0]["values"];
        assert!(values[7].is_null());
        assert_eq!(values[8].as_f64(), Some(report.charts[1].series[0].values[8]));
        assert_eq!(json["frames"][47], 1048);
        assert!(json["pictures"][0].get("bytes").is_none());
    }

    #[test]
    fn series_of_the_wrong_length_is_an_error() {
        let mut report = sample();
        report.stages[1].values.pop();
        let error = report.to_html().unwrap_err().to_string();
        assert!(error.contains("\"write\" has 47 values for 48 frames"), "{error}");
        assert!(report.to_json().is_err());
    }

    #[test]
    fn empty_report_is_a_page() {
        let page = BakeReport::default().to_html().unwrap();
        check_markup(&page).unwrap();
        assert!(page.contains("No frames were baked"));
    }
}
