//! The picture of a run: speed, tension, torques and diameters over one time axis.
//!
//! Not here: plotting in general. One picture in the manner of the paper's figures 7 to 14, drawn from the
//! samples as SVG; the PNG is the same drawing.

use std::fmt::Write;
use std::sync::Arc;

use anyhow::{Context, Result};
use model_core::image::{self, Signal};
use model_core::logic::Mode;
use resvg::{tiny_skia, usvg};

use crate::plc::Sample;
use crate::report::TENSION_BAND;

/// Pixels of the PNG for one unit of the drawing: sharp on paper and on dense screens.
const PNG_SCALE: f32 = 2.0;

// the drawing, in its own units
const WIDTH: f64 = 1000.0;
const LEFT: f64 = 76.0;
const RIGHT: f64 = 24.0;
const HEAD: f64 = 74.0;
const STRIP: f64 = 20.0;
const GAP: f64 = 46.0;
const FOOT: f64 = 50.0;
/// A curve is drawn through so many columns; within one, its lowest and highest value are kept.
const COLUMNS: usize = 900;

// a palette that the colour-blind can tell apart (Okabe and Ito, 2008), darkened for thin lines
const BLUE: &str = "#0a6aa8";
const ORANGE: &str = "#c75b12";
const GREEN: &str = "#0d8a68";
const GREY: &str = "#8a929c";
const INK: &str = "#22272e";
const FAINT: &str = "#e6e9ed";
const BAND: &str = "#e3e5e8";
/// About the width of a letter.
const LETTER: f64 = 6.4;

/// A curve of a panel.
struct Curve {
    name: &'static str,
    signal: &'static Signal,
    colour: &'static str,
    width: f64,
    dashed: bool,
}

const fn curve(name: &'static str, signal: &'static Signal, colour: &'static str) -> Curve {
    Curve {
        name,
        signal,
        colour,
        width: 1.6,
        dashed: false,
    }
}

const fn reference(name: &'static str, signal: &'static Signal) -> Curve {
    Curve {
        name,
        signal,
        colour: GREY,
        width: 1.4,
        dashed: true,
    }
}

/// One diagram of the picture.
struct Panel {
    title: &'static str,
    height: f64,
    curves: &'static [Curve],
    /// A band about this signal, of its value.
    band: Option<(&'static Signal, f64)>,
}

const PANELS: &[Panel] = &[
    Panel {
        title: "Web speed, m/min",
        height: 170.0,
        curves: &[
            reference("reference", &image::V_REF),
            curve("measured", &image::V_WEB, BLUE),
        ],
        band: None,
    },
    Panel {
        title: "Web tension, N/m",
        height: 210.0,
        curves: &[
            reference("reference ±10 %", &image::TENSION_REF),
            curve("measured", &image::TENSION, ORANGE),
        ],
        band: Some((&image::TENSION_REF, TENSION_BAND)),
    },
    Panel {
        title: "Motor torque, % of rated",
        height: 210.0,
        curves: &[
            curve("unwind", &image::TORQUE_UW, BLUE),
            curve("rear drum", &image::TORQUE_RD, ORANGE),
            curve("front drum", &image::TORQUE_FD, GREEN),
        ],
        band: None,
    },
    Panel {
        title: "Diameter, mm",
        height: 170.0,
        curves: &[
            curve("parent roll (drive's estimate)", &image::D_UW, BLUE),
            curve("shipping roll", &image::D_WU, ORANGE),
        ],
        band: None,
    },
];

/// The picture as SVG.
pub fn svg(title: &str, subtitle: &str, samples: &[Sample]) -> String {
    let height = HEAD + STRIP + FOOT + PANELS.iter().map(|p| p.height + GAP).sum::<f64>();
    let end_s = samples.last().map_or(1.0, |s| s.t_s.max(1.0));
    let time = Axis {
        low: 0.0,
        high: end_s,
        from: LEFT,
        to: WIDTH - RIGHT,
    };
    let mut out = Svg(String::new());
    out.add(format_args!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {height}' width='{WIDTH}' height='{height}' \
         font-family=\"Ubuntu, 'Helvetica Neue', Arial, sans-serif\" font-size='13' fill='{INK}'>\n\
         <rect width='100%' height='100%' fill='white'/>\n"
    ));
    out.text(LEFT, 32.0, "font-size='20'", title);
    out.text(LEFT, 54.0, &format!("fill='{GREY}'"), subtitle);

    let spans = modes(samples, end_s);
    let mut y = HEAD;
    strip(&mut out, &spans, &time, y);
    y += STRIP;
    for panel in PANELS {
        y += GAP;
        draw(&mut out, panel, samples, &spans, &time, y);
        y += panel.height;
    }
    for t in time.ticks(10) {
        out.text(time.at(t), y + 20.0, "text-anchor='middle'", &number(t));
    }
    out.text(WIDTH - RIGHT, y + 40.0, "text-anchor='end'", "time, s");
    out.0.push_str("</svg>\n");
    out.0
}

/// An SVG as PNG, with the program's own font.
pub fn png(svg: &str) -> Result<Vec<u8>> {
    let mut options = usvg::Options::default();
    Arc::make_mut(&mut options.fontdb).load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
    let tree = usvg::Tree::from_str(svg, &options).context("cannot read the picture back")?;
    let size = tree
        .size()
        .to_int_size()
        .scale_by(PNG_SCALE)
        .context("the picture has no size")?;
    let mut pixels =
        tiny_skia::Pixmap::new(size.width(), size.height()).context("no memory for the picture")?;
    resvg::render(
        &tree,
        tiny_skia::Transform::from_scale(PNG_SCALE, PNG_SCALE),
        &mut pixels.as_mut(),
    );
    pixels
        .encode_png()
        .context("cannot encode the picture as PNG")
}

/// The drawing as it grows.
struct Svg(String);

impl Svg {
    fn add(&mut self, piece: std::fmt::Arguments<'_>) {
        // a String takes everything
        let _ = self.0.write_fmt(piece);
    }

    fn text(&mut self, x: f64, y: f64, style: &str, text: &str) {
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        self.add(format_args!(
            "<text x='{x:.1}' y='{y:.1}' {style}>{text}</text>\n"
        ));
    }

    fn line(&mut self, (x_1, y_1): (f64, f64), (x_2, y_2): (f64, f64), colour: &str) {
        self.add(format_args!(
            "<path d='M{x_1:.1} {y_1:.1}L{x_2:.1} {y_2:.1}' stroke='{colour}'/>\n"
        ));
    }
}

/// A linear axis: values from `low` to `high` stand between `from` and `to`.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn at(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Round values, about `count` of them.
    fn ticks(&self, count: usize) -> Vec<f64> {
        let step = round_step((self.high - self.low) / count as f64);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

/// A tick's value, with a proper minus sign.
fn number(value: f64) -> String {
    value.to_string().replace('-', "\u{2212}")
}

/// The round step nearest above: 1, 2 or 5 times a power of ten.
fn round_step(rough: f64) -> f64 {
    let power = 10f64.powf(rough.max(f64::MIN_POSITIVE).log10().floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|f| f * power >= rough * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

/// A stretch of time in one mode.
struct Span {
    mode: Option<Mode>,
    from_s: f64,
    to_s: f64,
}

fn modes(samples: &[Sample], end_s: f64) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for sample in samples {
        match spans.last_mut() {
            Some(span) if span.mode == sample.mode() => {}
            last => {
                if let Some(span) = last {
                    span.to_s = sample.t_s;
                }
                spans.push(Span {
                    mode: sample.mode(),
                    from_s: sample.t_s,
                    to_s: end_s,
                });
            }
        }
    }
    spans
}

/// The modes as a coloured strip, each named where its name fits.
fn strip(out: &mut Svg, spans: &[Span], time: &Axis, y: f64) {
    for span in spans {
        let (colour, name) = match span.mode {
            Some(Mode::Thread) => ("#d3e7f5", "thread"),
            Some(Mode::Stall) => ("#ece4f3", "stall"),
            Some(Mode::Run) => ("#d6efe4", "run"),
            Some(Mode::NormalStop) => ("#fbe5cf", "normal stop"),
            Some(Mode::EmergencyStop) => ("#f6c9c4", "emergency stop"),
            Some(Mode::CoastStop) => ("#f6c9c4", "coast stop"),
            Some(Mode::WebBreakStop) => ("#f6c9c4", "web break"),
            Some(Mode::UnwindManeuver) => ("#e3e0f2", "unwind maneuver"),
            Some(Mode::AutoTune) => ("#d9ecec", "auto-tune"),
            Some(Mode::Ready) => ("#f1f3f5", "ready"),
            Some(Mode::Off) => ("#f1f3f5", "off"),
            None => ("#f6c9c4", "unknown mode"),
        };
        let (x, width) = (
            time.at(span.from_s),
            time.at(span.to_s) - time.at(span.from_s),
        );
        out.add(format_args!(
            "<rect x='{x:.1}' y='{y:.1}' width='{width:.1}' height='{STRIP}' fill='{colour}'/>\n"
        ));
        if width > LETTER * name.len() as f64 {
            out.text(
                x + 0.5 * width,
                y + 14.0,
                "text-anchor='middle' font-size='12'",
                name,
            );
        }
    }
}

fn draw(out: &mut Svg, panel: &Panel, samples: &[Sample], spans: &[Span], time: &Axis, top: f64) {
    let value = range(panel, samples, top);
    let bottom = top + panel.height;
    for v in value.ticks(4) {
        let y = value.at(v);
        out.line((time.from, y), (time.to, y), FAINT);
        out.text(time.from - 8.0, y + 4.5, "text-anchor='end'", &number(v));
    }
    for span in spans.iter().skip(1) {
        let x = time.at(span.from_s);
        out.line((x, top), (x, bottom), FAINT);
    }
    out.line((time.from, value.at(0.0)), (time.to, value.at(0.0)), GREY);

    out.text(LEFT, top - 10.0, "font-size='14'", panel.title);
    legend(out, panel, time.to, top - 10.0);

    if let Some((signal, share)) = panel.band {
        let edge = |share: f64| trace(samples, time, &value, |s| s.value(signal) * (1.0 + share));
        let (above, below) = (edge(share), edge(-share));
        if !above.is_empty() {
            let points = above.iter().chain(below.iter().rev());
            out.add(format_args!(
                "<path d='{}Z' fill='{BAND}'/>\n",
                polyline(points)
            ));
        }
    }
    for curve in panel.curves {
        path(
            out,
            curve,
            &polyline(trace(samples, time, &value, |s| s.value(curve.signal)).iter()),
        );
    }
}

/// The names of the curves, right-aligned: one text, so that nothing has to know how wide a letter is.
fn legend(out: &mut Svg, panel: &Panel, right: f64, y: f64) {
    let entries: Vec<_> = panel
        .curves
        .iter()
        .map(|curve| {
            let sample = if curve.dashed { "- - -" } else { "——" };
            format!(
                "<tspan fill='{}'>{sample} {}</tspan>",
                curve.colour, curve.name
            )
        })
        .collect();
    out.add(format_args!(
        "<text x='{right:.1}' y='{y:.1}' text-anchor='end' xml:space='preserve'>{}</text>\n",
        entries.join("      ")
    ));
}

fn path(out: &mut Svg, curve: &Curve, d: &str) {
    let dashes = if curve.dashed {
        " stroke-dasharray='5 3'"
    } else {
        ""
    };
    out.add(format_args!(
        "<path d='{d}' fill='none' stroke='{}' stroke-width='{}' stroke-linejoin='round'{dashes}/>\n",
        curve.colour, curve.width
    ));
}

/// The panel's vertical axis: all its curves and zero, to the next round value.
fn range(panel: &Panel, samples: &[Sample], top: f64) -> Axis {
    let values = panel
        .curves
        .iter()
        .flat_map(|c| samples.iter().map(|s| s.value(c.signal)));
    let (low, high) = values.fold((0.0, 0.0), |(low, high): (f64, f64), v| {
        (low.min(v), high.max(v))
    });
    let high = if high > low { high } else { low + 1.0 };
    let step = 0.5 * round_step((high - low) / 4.0);
    Axis {
        low: (low / step).floor() * step,
        high: (high / step).ceil() * step,
        from: top + panel.height,
        to: top,
    }
}

/// The points of a curve, no more than the eye can tell apart, and no peak lost.
fn trace(
    samples: &[Sample],
    time: &Axis,
    value: &Axis,
    of: impl Fn(&Sample) -> f64,
) -> Vec<(f64, f64)> {
    let point = |s: &Sample| (time.at(s.t_s), value.at(of(s)));
    samples
        .chunks(samples.len().div_ceil(COLUMNS).max(1))
        .flat_map(|column| {
            let extreme = |sign: f64| {
                (0..column.len())
                    .max_by(|&i, &j| (sign * of(&column[i])).total_cmp(&(sign * of(&column[j]))))
            };
            let mut kept: Vec<_> = extreme(-1.0).into_iter().chain(extreme(1.0)).collect();
            kept.sort_unstable();
            kept.dedup();
            kept.into_iter()
                .map(|i| point(&column[i]))
                .collect::<Vec<_>>()
        })
        .collect()
}

fn polyline<'a>(points: impl Iterator<Item = &'a (f64, f64)>) -> String {
    let mut d = String::new();
    for (i, (x, y)) in points.enumerate() {
        let _ = write!(d, "{}{x:.1} {y:.1}", if i == 0 { 'M' } else { 'L' });
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plc::Step;
    use model_core::image::Feedback;

    fn ramp(n: usize) -> Vec<Sample> {
        (0..n)
            .map(|i| {
                let mut feedback = Feedback::default();
                feedback.set(&image::V_WEB, i as f64);
                feedback.set_word(&image::MODE, (i / 7) as u16);
                Sample {
                    t_s: 0.04 * i as f64,
                    step: Step::Run,
                    feedback,
                }
            })
            .collect()
    }

    #[test]
    fn any_number_of_samples_makes_a_picture() {
        for n in [0, 1, 2, 100, 5000] {
            let svg = svg("A & B < C", "", &ramp(n));
            assert!(png(&svg).unwrap().starts_with(b"\x89PNG"), "{n} samples");
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{n} samples");
        }
    }

    #[test]
    fn thinning_out_keeps_every_peak() {
        let mut samples = ramp(0);
        for i in 0..20_000 {
            let mut feedback = Feedback::default();
            feedback.set(&image::V_WEB, if i == 12_345 { 1000.0 } else { 0.0 });
            samples.push(Sample {
                t_s: f64::from(i),
                step: Step::Run,
                feedback,
            });
        }
        let time = Axis {
            low: 0.0,
            high: 2e4,
            from: 0.0,
            to: 1.0,
        };
        let value = Axis {
            low: 0.0,
            high: 1000.0,
            from: 0.0,
            to: 1.0,
        };
        let points = trace(&samples, &time, &value, |s| s.value(&image::V_WEB));
        assert!(points.len() <= 2 * COLUMNS);
        assert_eq!(points.iter().filter(|(_, y)| *y > 0.5).count(), 1);
    }

    #[test]
    fn steps_are_round() {
        for (rough, step) in [
            (0.9, 1.0),
            (1.1, 2.0),
            (3.0, 5.0),
            (7.0, 10.0),
            (550.0, 1000.0),
        ] {
            assert!((round_step(rough) / step - 1.0).abs() < 1e-9, "{rough}");
        }
    }
}
