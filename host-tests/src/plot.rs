//! Pictures of curves over one axis: the picture of a run in the manner of the paper's figures 7 to 14, and any
//! other figure of the same kind.
//!
//! Not here: plotting in general: a figure is a column of diagrams that share their horizontal axis. It is drawn as
//! SVG; the PNG is the same drawing.

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
/// The same of a caption's letter, and the height of its line.
const CAPTION_LETTER: f64 = 7.0;
const CAPTION_LINE: f64 = 20.0;
/// A curve may be drawn off its points by so much.
const THIN: f64 = 0.1;

/// Points of a curve: where on the common axis, and the value there.
pub type Points = Vec<(f64, f64)>;

/// What a curve looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// The first curve.
    Blue,
    /// The second.
    Orange,
    /// The third.
    Green,
    /// What the others are compared with: grey and dashed.
    Reference,
}

impl Ink {
    fn colour(self) -> &'static str {
        match self {
            Ink::Blue => BLUE,
            Ink::Orange => ORANGE,
            Ink::Green => GREEN,
            Ink::Reference => GREY,
        }
    }
}

/// A curve of a panel.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// What it looks like.
    pub ink: Ink,
    /// What it shows.
    pub points: Points,
}

impl Curve {
    /// A curve.
    pub fn new(name: &str, ink: Ink, points: Points) -> Self {
        Self {
            name: name.to_owned(),
            ink,
            points,
        }
    }
}

/// One diagram of a figure.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What it shows, with its unit.
    pub title: String,
    /// Height of the diagram.
    pub height: f64,
    /// Its curves.
    pub curves: Vec<Curve>,
    /// A band about these points, of their values.
    pub band: Option<(Points, f64)>,
}

/// A figure.
#[derive(Clone, Debug)]
pub struct Figure {
    /// What it is.
    pub title: String,
    /// Of what.
    pub subtitle: String,
    /// Its diagrams, from above.
    pub panels: Vec<Panel>,
    /// The common axis, with its unit.
    pub axis: String,
    /// What to compare; empty for none.
    pub caption: String,
}

/// The curves of a run: name, ink, signal.
type RunCurves = &'static [(&'static str, Ink, &'static Signal)];

/// A panel of the picture of a run.
struct RunPanel {
    title: &'static str,
    height: f64,
    curves: RunCurves,
    /// A band about this signal, of its value.
    band: Option<(&'static Signal, f64)>,
}

const RUN: &[RunPanel] = &[
    RunPanel {
        title: "Web speed, m/min",
        height: 170.0,
        curves: &[
            ("reference", Ink::Reference, &image::V_REF),
            ("measured", Ink::Blue, &image::V_WEB),
        ],
        band: None,
    },
    RunPanel {
        title: "Web tension, N/m",
        height: 210.0,
        curves: &[
            ("reference ±10 %", Ink::Reference, &image::TENSION_REF),
            ("measured", Ink::Orange, &image::TENSION),
        ],
        band: Some((&image::TENSION_REF, TENSION_BAND)),
    },
    RunPanel {
        title: "Motor torque, % of rated",
        height: 210.0,
        curves: &[
            ("unwind", Ink::Blue, &image::TORQUE_UW),
            ("rear drum", Ink::Orange, &image::TORQUE_RD),
            ("front drum", Ink::Green, &image::TORQUE_FD),
        ],
        band: None,
    },
    RunPanel {
        title: "Diameter, mm",
        height: 170.0,
        curves: &[
            ("parent roll (drive's estimate)", Ink::Blue, &image::D_UW),
            ("shipping roll", Ink::Orange, &image::D_WU),
        ],
        band: None,
    },
];

/// The picture of a run as SVG.
pub fn svg(title: &str, subtitle: &str, samples: &[Sample]) -> String {
    let points =
        |signal: &Signal| -> Points { samples.iter().map(|s| (s.t_s, s.value(signal))).collect() };
    let panels = RUN.iter().map(|panel| Panel {
        title: panel.title.to_owned(),
        height: panel.height,
        curves: panel
            .curves
            .iter()
            .map(|(name, ink, signal)| Curve::new(name, *ink, points(signal)))
            .collect(),
        band: panel.band.map(|(signal, share)| (points(signal), share)),
    });
    let figure = Figure {
        title: title.to_owned(),
        subtitle: subtitle.to_owned(),
        panels: panels.collect(),
        axis: "time, s".to_owned(),
        caption: String::new(),
    };
    let end_s = samples.last().map_or(1.0, |s| s.t_s.max(1.0));
    draw(&figure, &modes(samples, end_s), end_s)
}

impl Figure {
    /// The figure as SVG.
    pub fn svg(&self) -> String {
        let curves = self.panels.iter().flat_map(|panel| &panel.curves);
        let ends = curves.flat_map(|curve| curve.points.last());
        let end = ends.fold(0.0, |end: f64, (x, _)| end.max(*x));
        draw(self, &[], if end > 0.0 { end } else { 1.0 })
    }
}

fn draw(figure: &Figure, spans: &[Span], end: f64) -> String {
    let strip_height = if spans.is_empty() { 0.0 } else { STRIP };
    let panels: f64 = figure.panels.iter().map(|p| p.height + GAP).sum();
    let caption = wrap(
        &figure.caption,
        ((WIDTH - LEFT - RIGHT) / CAPTION_LETTER) as usize,
    );
    let height = HEAD + strip_height + FOOT + panels + CAPTION_LINE * caption.len() as f64;
    let time = Axis {
        low: 0.0,
        high: end,
        from: LEFT,
        to: WIDTH - RIGHT,
    };
    let mut out = Svg(String::new());
    out.add(format_args!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {height}' width='{WIDTH}' height='{height}' \
         font-family=\"Ubuntu, 'Helvetica Neue', Arial, sans-serif\" font-size='13' fill='{INK}'>\n\
         <rect width='100%' height='100%' fill='white'/>\n"
    ));
    out.text(LEFT, 32.0, "font-size='20'", &figure.title);
    out.text(LEFT, 54.0, &format!("fill='{GREY}'"), &figure.subtitle);

    let mut y = HEAD;
    strip(&mut out, spans, &time, y);
    y += strip_height;
    for panel in &figure.panels {
        y += GAP;
        draw_panel(&mut out, panel, spans, &time, y);
        y += panel.height;
    }
    for t in time.ticks(10) {
        out.text(time.at(t), y + 20.0, "text-anchor='middle'", &number(t));
    }
    out.text(WIDTH - RIGHT, y + 40.0, "text-anchor='end'", &figure.axis);
    y += FOOT;
    for line in caption {
        out.text(LEFT, y + 8.0, "font-size='14'", &line);
        y += CAPTION_LINE;
    }
    out.0.push_str("</svg>\n");
    out.0
}

/// A text in lines of at most so many letters, between its words.
fn wrap(text: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= letters => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
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

/// A tick's value, without the last digits of its computation, with a proper minus sign.
fn number(value: f64) -> String {
    let value = (value * 1e9).round() / 1e9;
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

fn draw_panel(out: &mut Svg, panel: &Panel, spans: &[Span], time: &Axis, top: f64) {
    let value = range(panel, top);
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

    out.text(LEFT, top - 10.0, "font-size='14'", &panel.title);
    legend(out, panel, time.to, top - 10.0);

    if let Some((points, share)) = &panel.band {
        let edge = |share: f64| {
            let scaled: Points = points
                .iter()
                .map(|(t, v)| (*t, v * (1.0 + share)))
                .collect();
            thin(&trace(&scaled, time, &value))
        };
        let (above, below) = (edge(*share), edge(-share));
        if !above.is_empty() {
            let points = above.iter().chain(below.iter().rev());
            out.add(format_args!(
                "<path d='{}Z' fill='{BAND}'/>\n",
                polyline(points)
            ));
        }
    }
    for curve in &panel.curves {
        let points = thin(&trace(&curve.points, time, &value));
        path(out, curve.ink, &polyline(points.iter()));
    }
}

/// The names of the curves, right-aligned: one text, so that nothing has to know how wide a letter is.
fn legend(out: &mut Svg, panel: &Panel, right: f64, y: f64) {
    let entries: Vec<_> = panel
        .curves
        .iter()
        .map(|curve| {
            let sample = match curve.ink {
                Ink::Reference => "- - -",
                _ => "——",
            };
            let (colour, name) = (curve.ink.colour(), &curve.name);
            format!("<tspan fill='{colour}'>{sample} {name}</tspan>")
        })
        .collect();
    out.add(format_args!(
        "<text x='{right:.1}' y='{y:.1}' text-anchor='end' xml:space='preserve'>{}</text>\n",
        entries.join("      ")
    ));
}

fn path(out: &mut Svg, ink: Ink, d: &str) {
    let (width, dashes) = match ink {
        Ink::Reference => ("1.4", " stroke-dasharray='5 3'"),
        _ => ("1.6", ""),
    };
    let colour = ink.colour();
    out.add(format_args!(
        "<path d='{d}' fill='none' stroke='{colour}' stroke-width='{width}' stroke-linejoin='round'{dashes}/>\n"
    ));
}

/// The panel's vertical axis: all its curves and zero, to the next round value.
fn range(panel: &Panel, top: f64) -> Axis {
    let points = panel.curves.iter().flat_map(|c| &c.points);
    let values = points.map(|(_, value)| *value);
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

/// The points of a curve in the drawing, no more than the eye can tell apart, and no peak lost.
fn trace(points: &[(f64, f64)], time: &Axis, value: &Axis) -> Points {
    let point = |(t, v): &(f64, f64)| (time.at(*t), value.at(*v));
    points
        .chunks(points.len().div_ceil(COLUMNS).max(1))
        .flat_map(|column| {
            let extreme = |sign: f64| {
                (0..column.len())
                    .max_by(|&i, &j| (sign * column[i].1).total_cmp(&(sign * column[j].1)))
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

/// Leaves out the points that lie on the line between those that are kept.
///
/// Source: D. H. Douglas, T. K. Peucker, Cartographica 10 (1973) 112.
fn thin(points: &[(f64, f64)]) -> Points {
    let Some(last) = points.len().checked_sub(1) else {
        return Points::new();
    };
    let mut keep = vec![false; points.len()];
    (keep[0], keep[last]) = (true, true);
    let mut stretches = vec![(0, last)];
    while let Some((from, to)) = stretches.pop() {
        let off = |i: &usize| distance(points[*i], points[from], points[to]);
        let furthest = (from + 1..to).max_by(|i, j| off(i).total_cmp(&off(j)));
        if let Some(i) = furthest.filter(|i| off(i) > THIN) {
            keep[i] = true;
            stretches.extend([(from, i), (i, to)]);
        }
    }
    let kept = points.iter().zip(keep).filter(|(_, keep)| *keep);
    kept.map(|(point, _)| *point).collect()
}

/// Of a point from the stretch between two others.
fn distance(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (along, off) = (
        (to.0 - from.0, to.1 - from.1),
        (point.0 - from.0, point.1 - from.1),
    );
    let square = along.0 * along.0 + along.1 * along.1;
    let share = if square > 0.0 {
        ((off.0 * along.0 + off.1 * along.1) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (off.0 - share * along.0).hypot(off.1 - share * along.1)
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
        let points: Points = samples
            .iter()
            .map(|s| (s.t_s, s.value(&image::V_WEB)))
            .collect();
        let points = trace(&points, &time, &value);
        assert!(points.len() <= 2 * COLUMNS);
        assert_eq!(points.iter().filter(|(_, y)| *y > 0.5).count(), 1);
    }

    /// What is left out was on the line to a tenth of a pixel; corners and ends stay.
    #[test]
    fn thinning_leaves_the_curve_where_it_was() {
        let curve: Points = (0..=1000)
            .map(|i| {
                let x = f64::from(i);
                (
                    x,
                    if i < 500 {
                        0.3 * x
                    } else {
                        150.0 + 40.0 * (0.02 * x).sin()
                    },
                )
            })
            .collect();
        let thinned = thin(&curve);
        assert!(thinned.len() < 200, "{}", thinned.len());
        assert_eq!((thinned[0], thinned.last()), (curve[0], curve.last()));
        for point in &curve {
            let off = thinned.windows(2).map(|w| distance(*point, w[0], w[1]));
            assert!(off.fold(f64::MAX, f64::min) <= THIN, "{point:?}");
        }
        for n in 0..3 {
            assert_eq!(thin(&curve[..n]), curve[..n]);
        }
    }

    #[test]
    fn captions_break_between_words() {
        assert_eq!(wrap("one two  three", 7), ["one two", "three"]);
        assert_eq!(wrap("immeasurable x", 5), ["immeasurable", "x"]);
        assert!(wrap("", 5).is_empty());
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
