//! Line plots: several curves over one variable, with reference lines, as PNG and as CSV.

use std::io::{self, Write};
use std::path::Path;

use super::canvas::{Align, Canvas, Dash, GRID, INK, Rgb, SOFT_INK, Shape, WHITE, fitting_size, text_width};
use super::color::CURVES;
use super::table::quoted;
use super::ticks::{self, Ticks, number};
use super::{OutputError, write_whole};

pub(crate) const TITLE_SIZE: f64 = 30.0;
pub(crate) const LABEL_SIZE: f64 = 25.0;
pub(crate) const TICK_SIZE: f64 = 22.0;
const MARKER_SIZE: f64 = 13.0;
const TICK_LENGTH: f64 = 8.0;
const DASH: [f64; 4] = [12.0, 8.0, 12.0, 8.0];
/// Ways to break a line that can be told apart in grey print; the first is none.
const PATTERNS: [Dash; 5] =
    [None, Some([20.0, 10.0, 20.0, 10.0]), Some([3.0, 8.0, 3.0, 8.0]), Some([20.0, 8.0, 3.0, 8.0]), Some([34.0, 9.0, 12.0, 9.0])];
/// Room around a triangle that shows a slope, for its numbers.
const SLOPE_ROOM: f64 = 30.0;

/// Division of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scale {
    /// Equal differences are equally long.
    #[default]
    Linear,
    /// Equal ratios are equally long; only positive values are shown.
    Logarithmic,
}

/// An axis of a plot.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// What is shown.
    pub label: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Division.
    pub scale: Scale,
    /// Ends; without them the data decide.
    pub range: Option<[f64; 2]>,
}

impl Axis {
    /// A linear axis that spans the data.
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// The same axis with a unit.
    pub fn unit(mut self, unit: impl Into<String>) -> Self {
        self.unit = Some(unit.into());
        self
    }

    /// The same axis, divided logarithmically.
    pub fn logarithmic(mut self) -> Self {
        self.scale = Scale::Logarithmic;
        self
    }

    /// The same axis with fixed ends.
    pub fn range(mut self, from: f64, to: f64) -> Self {
        self.range = Some([from, to]);
        self
    }

    /// Label with unit: `displacement (mm)`.
    pub fn heading(&self) -> String {
        with_unit(&self.label, self.unit.as_deref())
    }
}

/// `name (unit)`, or the name alone.
pub(crate) fn with_unit(name: &str, unit: Option<&str>) -> String {
    match unit {
        Some(unit) if !unit.is_empty() => format!("{name} ({unit})"),
        _ => name.to_string(),
    }
}

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Style {
    /// A solid line: computed curves.
    #[default]
    Line,
    /// A dashed dark line: analytic curves and references.
    Dashed,
    /// Markers alone: measured points.
    Markers,
    /// Markers joined by a solid line: studies of few values.
    LineAndMarkers,
    /// A coloured line of this pattern: 0 solid, 1 dashed, 2 dotted, 3 dash-dotted, 4 long and short dashes, then again.
    Pattern(u8),
    /// A dark line of this pattern: several references in one plot.
    Reference(u8),
}

impl Style {
    fn has_markers(self) -> bool {
        matches!(self, Self::Markers | Self::LineAndMarkers)
    }

    /// References stand apart from the computed curves by their ink, and lie above them.
    fn is_reference(self) -> bool {
        matches!(self, Self::Dashed | Self::Reference(_))
    }

    /// Width and pattern of the line, if there is one.
    fn line(self) -> Option<(f64, Dash)> {
        let pattern = |k: u8| PATTERNS[k as usize % PATTERNS.len()];
        match self {
            Self::Line => Some((3.5, None)),
            Self::LineAndMarkers => Some((2.5, None)),
            Self::Dashed => Some((2.5, Some(DASH))),
            Self::Markers => None,
            Self::Pattern(k) => Some((3.5, pattern(k))),
            Self::Reference(k) => Some((2.5, pattern(k))),
        }
    }
}

/// Where the curves are named.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Legend {
    /// Within the frame, where it hides the least.
    #[default]
    Inside,
    /// Within the frame if it hides nothing there, else beside it.
    Clear,
    /// Nowhere.
    None,
}

/// A curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Its name in the legend; an empty name keeps it out.
    pub label: String,
    /// Points `[x, y]` in the order in which they are joined; values that are not finite
    /// break the line.
    pub points: Vec<[f64; 2]>,
    /// How it is drawn.
    pub style: Style,
}

impl Curve {
    /// A solid curve.
    pub fn new(label: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { label: label.into(), points, style: Style::Line }
    }

    /// The same curve in another style.
    pub fn style(mut self, style: Style) -> Self {
        self.style = style;
        self
    }
}

/// A straight reference line across the whole plot, named beside itself.
#[derive(Debug, Clone, PartialEq)]
pub enum ReferenceLine {
    /// A value of y.
    Horizontal {
        /// The value.
        y: f64,
        /// Name, may be empty.
        label: String,
    },
    /// A value of x.
    Vertical {
        /// The value.
        x: f64,
        /// Name, may be empty.
        label: String,
    },
}

/// A line plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// Title.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Curves, drawn in order.
    pub curves: Vec<Curve>,
    /// Straight reference lines, drawn below the curves.
    pub references: Vec<ReferenceLine>,
    /// Slopes shown by triangles between logarithmic axes.
    pub slopes: Vec<f64>,
    /// Where the curves are named.
    pub legend: Legend,
    /// Width of the picture in pixels.
    pub width: usize,
    /// Height of the picture in pixels.
    pub height: usize,
}

impl Plot {
    /// A plot of 1600 × 1000 pixels without curves.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        let (curves, references, slopes) = (Vec::new(), Vec::new(), Vec::new());
        Self { title: title.into(), x, y, curves, references, slopes, legend: Legend::Inside, width: 1600, height: 1000 }
    }

    /// The same plot with one more curve.
    pub fn curve(mut self, curve: Curve) -> Self {
        self.curves.push(curve);
        self
    }

    /// The same plot with one more reference line.
    pub fn reference(mut self, reference: ReferenceLine) -> Self {
        self.references.push(reference);
        self
    }

    /// Draws the plot.
    ///
    /// # Errors
    /// [`OutputError::Drawing`] if there is no point to show, an end of an axis is impossible or
    /// the picture is too small or too large.
    pub fn draw(&self) -> Result<Canvas, OutputError> {
        let refuse = |reason: String| OutputError::Drawing { what: format!("the plot `{}`", self.title), reason };
        check_size(self.width, self.height).map_err(refuse)?;
        let visible = |p: &[f64; 2]| is_shown(p[0], self.x.scale) && is_shown(p[1], self.y.scale);
        let shown: Vec<[f64; 2]> = self.curves.iter().flat_map(|curve| curve.points.iter().copied()).filter(visible).collect();
        if shown.is_empty() {
            return Err(refuse("no curve has a point to show; points need finite values, and positive ones on a logarithmic axis".into()));
        }
        let mut xs: Vec<f64> = shown.iter().map(|p| p[0]).collect();
        let mut ys: Vec<f64> = shown.iter().map(|p| p[1]).collect();
        for reference in &self.references {
            match reference {
                ReferenceLine::Horizontal { y, .. } if is_shown(*y, self.y.scale) => ys.push(*y),
                ReferenceLine::Vertical { x, .. } if is_shown(*x, self.x.scale) => xs.push(*x),
                _ => {}
            }
        }
        let x_margin = if self.curves.iter().any(|curve| curve.style.has_markers()) { 0.03 } else { 0.0 };
        let x_range = range_of(&self.x, &xs, x_margin).map_err(refuse)?;
        let y_range = range_of(&self.y, &ys, 0.06).map_err(refuse)?;

        let (width, height) = (self.width as f64, self.height as f64);
        let mut frame = Frame {
            left: 0.0,
            top: if self.title.is_empty() { 60.0 } else { 110.0 },
            right: width - 50.0,
            bottom: height - 105.0,
            x: x_range,
            y: y_range,
            x_scale: self.x.scale,
            y_scale: self.y.scale,
        };
        frame.left = frame.left_margin();
        let mut triangles = self.triangles(&frame);
        let mut legend = self.place_legend(&frame, &shown, &triangles);
        if let Some((place, hidden)) = &mut legend
            && self.legend == Legend::Clear
            && *hidden > 0
        {
            // never more than half of the picture
            let room = place[2] - place[0];
            frame.right = (width - room - 54.0).max(0.5 * width);
            triangles = self.triangles(&frame);
            *place = [frame.right + 30.0, frame.top, frame.right + 30.0 + room, frame.top + place[3] - place[1]];
        }
        let mut canvas = Canvas::new(self.width, self.height);
        let size = fitting_size(&self.title, TITLE_SIZE, frame.right - frame.left);
        let corner = [frame.left, 44.0];
        canvas.text(corner, &self.title, size, INK, Align::Left);
        frame.draw_grid(&mut canvas);

        for reference in &self.references {
            if let Some(placed) = place_reference(&frame, reference) {
                canvas.polyline(&placed.ends, 2.0, SOFT_INK, Some(DASH));
                let Placed { place, label, .. } = placed;
                canvas.text(place, label, TICK_SIZE, SOFT_INK, placed.align);
            }
        }
        let mut colors = CURVES.iter().cycle();
        let styles: Vec<(Rgb, Mark)> = self
            .curves
            .iter()
            .enumerate()
            .map(|(i, curve)| {
                // References stand apart from the computed curves by their ink.
                let color = if curve.style.is_reference() { INK } else { *colors.next().unwrap_or(&INK) };
                (color, Mark { shape: SHAPES[i % SHAPES.len()], hollow: i / SHAPES.len() % 2 == 1 })
            })
            .collect();
        // Dashed references last: they stay visible on top of a curve that meets them.
        let solid = |curve: &&Curve| !curve.style.is_reference();
        let order = |wanted: bool| self.curves.iter().zip(&styles).filter(move |(curve, _)| solid(curve) == wanted);
        for (curve, &(color, mark)) in order(true).chain(order(false)) {
            draw_curve(&mut canvas, &frame, curve, color, mark);
        }
        frame.draw_axes(&mut canvas, &self.x.heading(), &self.y.heading());
        for triangle in &triangles {
            triangle.draw(&mut canvas);
        }
        if let Some((place, _)) = legend {
            self.draw_legend(&mut canvas, place, &styles);
        }
        Ok(canvas)
    }

    /// Draws the plot into a PNG file.
    ///
    /// # Errors
    /// Those of [`Plot::draw`], [`OutputError::Encode`], [`OutputError::Io`].
    pub fn write_png(&self, path: &Path) -> Result<(), OutputError> {
        self.draw()?.write(path)
    }

    /// Writes the points of all curves as CSV: `curve, x, y`, the latter two under the names of
    /// the axes, in full precision.
    ///
    /// # Errors
    /// [`OutputError::Io`].
    pub fn write_csv(&self, path: &Path) -> Result<(), OutputError> {
        write_whole(path, |file| -> io::Result<()> {
            let (x, y) = (quoted(&self.x.heading()), quoted(&self.y.heading()));
            writeln!(file, "curve,{x},{y}")?;
            for curve in &self.curves {
                let label = quoted(&curve.label);
                for [x, y] in &curve.points {
                    writeln!(file, "{label},{x:?},{y:?}")?;
                }
            }
            Ok(())
        })
    }

    /// The box of the legend, and how much it hides; `None` without names.
    fn place_legend(&self, frame: &Frame, shown: &[[f64; 2]], triangles: &[Triangle]) -> Option<([f64; 4], usize)> {
        let labels: Vec<&str> = self.curves.iter().map(|curve| curve.label.as_str()).filter(|label| !label.is_empty()).collect();
        if labels.is_empty() || self.legend == Legend::None {
            return None;
        }
        let widest = labels.iter().map(|label| text_width(label, TICK_SIZE)).fold(0.0, f64::max);
        let width = 2.0 * LEGEND_PAD + LEGEND_SAMPLE + 14.0 + widest;
        let height = 2.0 * LEGEND_PAD + LEGEND_LINE * labels.len() as f64 - 6.0;
        let gap = 18.0;
        let rights = [frame.right - gap - width, frame.left + gap];
        let middle = 0.5 * (frame.left + frame.right - width);
        let tops = [frame.top + gap, frame.bottom - gap - height];
        let places =
            [[rights[0], tops[0]], [rights[1], tops[0]], [rights[0], tops[1]], [rights[1], tops[1]], [middle, tops[0]], [middle, tops[1]]];
        // Where it hides the least.
        let counts = places.map(|place| {
            let over = triangles.iter().filter(|t| overlap(t.room, [place[0], place[1], place[0] + width, place[1] + height])).count();
            // a legend higher than the frame hides its marks
            let beyond = usize::from(place[1] < frame.top || place[1] + height > frame.bottom || width > frame.right - frame.left);
            self.hidden_by(frame, place, width, height, shown) + HIDDEN_NAME * (over + beyond)
        });
        let best = (0..places.len()).min_by_key(|&i| counts[i])?;
        let [left, top] = places[best];
        Some(([left, top, left + width, top + height], counts[best]))
    }

    fn draw_legend(&self, canvas: &mut Canvas, [left, top, right, bottom]: [f64; 4], styles: &[(Rgb, Mark)]) {
        let entries = self.curves.iter().zip(styles).filter(|(curve, _)| !curve.label.is_empty());
        canvas.fill(left, top, right, bottom, WHITE, 0.88);
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        canvas.polyline(&corners, 1.0, [205, 208, 214], None);
        for (i, (curve, (color, mark))) in entries.enumerate() {
            let y = top + LEGEND_PAD + LEGEND_LINE * (i as f64 + 0.5) - 3.0;
            let x = left + LEGEND_PAD;
            if let Some((width, dash)) = curve.style.line() {
                canvas.polyline(&[[x, y], [x + LEGEND_SAMPLE, y]], width, *color, dash);
            }
            if curve.style.has_markers() {
                mark.draw(canvas, [x + 0.5 * LEGEND_SAMPLE, y], *color);
            }
            let place = [x + LEGEND_SAMPLE + 14.0, y];
            canvas.text(place, &curve.label, TICK_SIZE, INK, Align::Left);
        }
    }

    /// Triangles that show slopes, near the curves but not on them.
    fn triangles(&self, frame: &Frame) -> Vec<Triangle> {
        if self.x.scale != Scale::Logarithmic || self.y.scale != Scale::Logarithmic {
            return vec![];
        }
        let samples = self.samples(frame);
        let (across, down) = (frame.right - frame.left, frame.bottom - frame.top);
        let tilt = (down / (frame.y.1 / frame.y.0).ln()) / (across / (frame.x.1 / frame.x.0).ln());
        let mut placed: Vec<Triangle> = vec![];
        for &slope in self.slopes.iter().filter(|slope| slope.is_finite() && **slope != 0.0) {
            let width = (0.14 * across).min(0.25 * down / (slope.abs() * tilt));
            let height = width * slope.abs() * tilt;
            let candidate = |i: usize, j: usize| {
                let left = frame.left + 40.0 + (across - width - 100.0) * i as f64 / 40.0;
                let bottom = frame.bottom - 44.0 - (down - height - 70.0) * j as f64 / 40.0;
                Triangle::new(left, bottom, width, height, slope)
            };
            let cost = |t: &Triangle| {
                let hidden = samples.iter().filter(|s| inside(**s, t.room)).count() as f64;
                let taken = placed.iter().filter(|other| overlap(other.room, t.room)).count() as f64;
                let middle = [0.5 * (t.room[0] + t.room[2]), 0.5 * (t.room[1] + t.room[3])];
                let near = samples.iter().map(|s| (s[0] - middle[0]).hypot(s[1] - middle[1])).fold(f64::INFINITY, f64::min);
                1e4 * (hidden + 100.0 * taken) + near
            };
            let all = (0..=40).flat_map(|i| (0..=40).map(move |j| (i, j))).map(|(i, j)| candidate(i, j));
            if let Some((_, best)) = all.map(|t| (cost(&t), t)).min_by(|a, b| a.0.total_cmp(&b.0)) {
                placed.push(best);
            }
        }
        placed
    }

    /// Pixels on the curves within the frame, about ten apart.
    fn samples(&self, frame: &Frame) -> Vec<[f64; 2]> {
        let bounds = [frame.left, frame.top, frame.right, frame.bottom];
        let mut samples = vec![];
        for curve in &self.curves {
            let places: Vec<[f64; 2]> = curve.points.iter().map(|p| frame.place(*p)).collect();
            samples.extend(places.iter().copied());
            if curve.style.line().is_some() {
                for pair in places.windows(2) {
                    let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
                    let count = if length.is_finite() { ((length / 10.0) as usize).min(200) } else { 0 };
                    let at = |k: usize, t: f64| pair[0][k] + t * (pair[1][k] - pair[0][k]);
                    samples.extend((1..count).map(|i| i as f64 / count as f64).map(|t| [at(0, t), at(1, t)]));
                }
            }
        }
        samples.retain(|s| inside(*s, bounds));
        samples
    }

    /// How much of the curves a legend at a place would hide: points, and samples between them.
    fn hidden_by(&self, frame: &Frame, [left, top]: [f64; 2], width: f64, height: f64, shown: &[[f64; 2]]) -> usize {
        let inside = |p: [f64; 2]| {
            let margin = 8.0;
            p[0] > left - margin && p[0] < left + width + margin && p[1] > top - margin && p[1] < top + height + margin
        };
        let points = shown.iter().filter(|p| inside(frame.place(**p))).count();
        let mut between = 0;
        for curve in &self.curves {
            for pair in curve.points.windows(2) {
                let (a, b) = (frame.place(pair[0]), frame.place(pair[1]));
                let length = (b[0] - a[0]).hypot(b[1] - a[1]);
                if !length.is_finite() {
                    continue;
                }
                let samples = ((length / 10.0) as usize).min(200);
                between += (0..samples)
                    .filter(|&i| {
                        let t = (i as f64 + 0.5) / samples as f64;
                        inside([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])])
                    })
                    .count();
            }
        }
        let names = self.references.iter().filter_map(|reference| {
            let [l, t, r, b] = place_reference(frame, reference)?.label_box();
            let apart = r < left || l > left + width || b < top || t > top + height;
            (!apart).then_some(HIDDEN_NAME)
        });
        points + between + names.sum::<usize>()
    }
}

/// The name of a reference line weighs as much as this many points of a curve.
const HIDDEN_NAME: usize = 100;

// Room in a legend, in pixels.
const LEGEND_PAD: f64 = 16.0;
const LEGEND_SAMPLE: f64 = 64.0;
const LEGEND_LINE: f64 = 36.0;

/// Whether a pixel lies in a box of left, top, right, bottom.
fn inside(p: [f64; 2], [left, top, right, bottom]: [f64; 4]) -> bool {
    p[0] > left && p[0] < right && p[1] > top && p[1] < bottom
}

/// Whether two boxes have a part in common.
fn overlap(a: [f64; 4], b: [f64; 4]) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// A right triangle whose hypotenuse has a slope.
struct Triangle {
    /// Both ends of the hypotenuse, and the right angle.
    corners: [[f64; 2]; 3],
    slope: f64,
    /// Left, top, right, bottom with the numbers.
    room: [f64; 4],
}

impl Triangle {
    fn new(left: f64, bottom: f64, width: f64, height: f64, slope: f64) -> Self {
        let (right, top) = (left + width, bottom - height);
        let text = text_width(&number(slope.abs(), 3), TICK_SIZE) + 16.0;
        // the vertical leg stands where the slope is seen from below
        let (corners, room) = if slope > 0.0 {
            ([[left, bottom], [right, top], [right, bottom]], [left - 8.0, top - 12.0, right + text, bottom + SLOPE_ROOM])
        } else {
            ([[left, top], [right, bottom], [left, bottom]], [left - text, top - 12.0, right + 8.0, bottom + SLOPE_ROOM])
        };
        Self { corners, slope, room }
    }

    fn draw(&self, canvas: &mut Canvas) {
        let [a, b, c] = self.corners;
        canvas.polyline(&[a, b, c, a], 2.0, INK, None);
        canvas.text([0.5 * (a[0] + b[0]), c[1] + 18.0], "1", TICK_SIZE, INK, Align::Center);
        let middle = 0.5 * (a[1] + b[1]);
        let text = number(self.slope.abs(), 3);
        if self.slope > 0.0 {
            canvas.text([c[0] + 10.0, middle], &text, TICK_SIZE, INK, Align::Left);
        } else {
            canvas.text([c[0] - 10.0, middle], &text, TICK_SIZE, INK, Align::Right);
        }
    }
}

/// A marker.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mark {
    pub shape: Shape,
    /// Whether only its outline is drawn.
    pub hollow: bool,
}

impl Mark {
    fn draw(self, canvas: &mut Canvas, place: [f64; 2], color: Rgb) {
        canvas.marker(place, MARKER_SIZE, self.shape, color);
        if self.hollow {
            canvas.marker(place, 0.4 * MARKER_SIZE, self.shape, WHITE);
        }
    }
}

const SHAPES: [Shape; 4] = [Shape::Circle, Shape::Square, Shape::Triangle, Shape::Diamond];

/// Largest width or height of a picture.
const LARGEST: usize = 16_384;

pub(crate) fn check_size(width: usize, height: usize) -> Result<(), String> {
    if (400..=LARGEST).contains(&width) && (300..=LARGEST).contains(&height) {
        Ok(())
    } else {
        Err(format!("its size is {width} × {height} pixels; at least 400 × 300 and at most {LARGEST} each way are possible"))
    }
}

fn is_shown(value: f64, scale: Scale) -> bool {
    value.is_finite() && (scale == Scale::Linear || value > 0.0)
}

/// Ends of an axis: as given, or those of the data with a margin.
fn range_of(axis: &Axis, values: &[f64], margin: f64) -> Result<(f64, f64), String> {
    if let Some([from, to]) = axis.range {
        if is_shown(from, axis.scale) && is_shown(to, axis.scale) && from < to {
            return Ok((from, to));
        }
        return Err(format!(
            "the axis `{}` cannot run from {from} to {to}; the first end must be smaller, and both positive on a logarithmic axis",
            axis.label
        ));
    }
    let min = values.iter().copied().fold(f64::INFINITY, f64::min);
    let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Ok(match axis.scale {
        Scale::Linear => {
            let (low, high) = ticks::open_range(min, max);
            let room = margin * (high - low);
            (low - room, high + room)
        }
        Scale::Logarithmic => {
            let (low, high) = (min.ln(), max.ln());
            // Markers at the ends need room; a single value gets a decade around it.
            let room = if high > low { 0.06 * (high - low) } else { 1.2 };
            ((low - room).exp(), (high + room).exp())
        }
    })
}

/// A rectangle of a canvas with its ranges.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
    pub x: (f64, f64),
    pub y: (f64, f64),
    pub x_scale: Scale,
    pub y_scale: Scale,
}

impl Frame {
    /// The pixel position of a point; not finite where an axis cannot show it.
    pub fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let part = |v: f64, (from, to): (f64, f64), scale| match scale {
            Scale::Linear => (v - from) / (to - from),
            Scale::Logarithmic if v > 0.0 => (v / from).ln() / (to / from).ln(),
            Scale::Logarithmic => f64::NAN,
        };
        [
            self.left + part(x, self.x, self.x_scale) * (self.right - self.left),
            self.bottom - part(y, self.y, self.y_scale) * (self.bottom - self.top),
        ]
    }

    fn x_ticks(&self) -> Ticks {
        let room = ((self.right - self.left) / 140.0).clamp(2.0, 10.0) as usize;
        marks(self.x, self.x_scale, room)
    }

    fn y_ticks(&self) -> Ticks {
        let room = ((self.bottom - self.top) / 90.0).clamp(2.0, 8.0) as usize;
        marks(self.y, self.y_scale, room)
    }

    /// Where the frame must begin so that the labels of the vertical axis fit left of it.
    pub fn left_margin(&self) -> f64 {
        let widths = self.y_ticks().labels;
        let widest = widths.iter().map(|label| text_width(label, TICK_SIZE));
        (82.0 + widest.fold(0.0, f64::max)).ceil()
    }

    pub fn draw_grid(&self, canvas: &mut Canvas) {
        for value in self.x_ticks().values {
            let x = self.place([value, self.y.0])[0].round();
            canvas.fill(x, self.top, x + 1.0, self.bottom, GRID, 1.0);
        }
        for value in self.y_ticks().values {
            let y = self.place([self.x.0, value])[1].round();
            canvas.fill(self.left, y, self.right, y + 1.0, GRID, 1.0);
        }
    }

    /// Frame, marks, their labels, and the headings of both axes.
    pub fn draw_axes(&self, canvas: &mut Canvas, x_heading: &str, y_heading: &str) {
        let (left, right) = (self.left.round(), self.right.round());
        let (top, bottom) = (self.top.round(), self.bottom.round());
        let w = 2.0;
        canvas.fill(left - w, bottom, right + w, bottom + w, INK, 1.0);
        canvas.fill(left - w, top - w, right + w, top, INK, 1.0);
        canvas.fill(left - w, top - w, left, bottom + w, INK, 1.0);
        canvas.fill(right, top - w, right + w, bottom + w, INK, 1.0);

        let ticks = self.x_ticks();
        for (value, label) in ticks.values.iter().zip(&ticks.labels) {
            let x = self.place([*value, self.y.0])[0].round();
            canvas.fill(x - 1.0, bottom, x + 1.0, bottom + TICK_LENGTH, INK, 1.0);
            canvas.text([x, bottom + 26.0], label, TICK_SIZE, INK, Align::Center);
        }
        for value in &ticks.minor {
            let x = self.place([*value, self.y.0])[0].round();
            canvas.fill(x, bottom, x + 1.0, bottom + 0.6 * TICK_LENGTH, INK, 1.0);
        }
        let heading = with_factor(x_heading, ticks.factor.as_deref());
        let size = fitting_size(&heading, LABEL_SIZE, right - left + 80.0);
        let middle = [0.5 * (left + right), bottom + 68.0];
        canvas.text(middle, &heading, size, INK, Align::Center);

        let ticks = self.y_ticks();
        let mut widest: f64 = 0.0;
        for (value, label) in ticks.values.iter().zip(&ticks.labels) {
            let y = self.place([self.x.0, *value])[1].round();
            canvas.fill(left - TICK_LENGTH, y - 1.0, left, y + 1.0, INK, 1.0);
            canvas.text([left - 14.0, y], label, TICK_SIZE, INK, Align::Right);
            widest = widest.max(text_width(label, TICK_SIZE));
        }
        for value in &ticks.minor {
            let y = self.place([self.x.0, *value])[1].round();
            canvas.fill(left - 0.6 * TICK_LENGTH, y, left, y + 1.0, INK, 1.0);
        }
        let heading = with_factor(y_heading, ticks.factor.as_deref());
        let size = fitting_size(&heading, LABEL_SIZE, bottom - top + 80.0);
        let middle = [left - widest - 46.0, 0.5 * (top + bottom)];
        canvas.text_upwards(middle, &heading, size, INK);
    }
}

/// The common factor of the labels joins the unit in the heading, where it cannot be overlooked:
/// `displacement (10⁻³ m)` for `displacement (m)`.
pub(crate) fn with_factor(heading: &str, factor: Option<&str>) -> String {
    match (factor, heading.strip_suffix(')')) {
        (None, _) => heading.to_string(),
        (Some(factor), Some(body)) if body.contains('(') => {
            let (name, unit) = body.rsplit_once('(').unwrap_or((body, ""));
            format!("{name}({factor} {unit})")
        }
        (Some(factor), _) => format!("{heading} (×{factor})"),
    }
}

fn marks(range: (f64, f64), scale: Scale, room: usize) -> Ticks {
    match scale {
        Scale::Linear => ticks::linear(range.0, range.1, room),
        Scale::Logarithmic => ticks::logarithmic(range.0, range.1, room),
    }
}

/// A reference line on the canvas: its ends, and where its name stands.
struct Placed<'a> {
    ends: [[f64; 2]; 2],
    label: &'a str,
    place: [f64; 2],
    align: Align,
}

impl Placed<'_> {
    /// Left, top, right, bottom of the name.
    fn label_box(&self) -> [f64; 4] {
        let width = text_width(self.label, TICK_SIZE);
        let left = match self.align {
            Align::Left => self.place[0],
            Align::Center => self.place[0] - 0.5 * width,
            Align::Right => self.place[0] - width,
        };
        let half = 0.5 * TICK_SIZE;
        [left, self.place[1] - half, left + width, self.place[1] + half]
    }
}

/// Where a reference line is drawn; `None` outside of the frame.
fn place_reference<'a>(frame: &Frame, reference: &'a ReferenceLine) -> Option<Placed<'a>> {
    match reference {
        ReferenceLine::Horizontal { y, label } => {
            let y = frame.place([frame.x.0, *y])[1];
            // Above the line, unless the frame ends there.
            let above = if y - 32.0 > frame.top { -18.0 } else { 18.0 };
            (y >= frame.top && y <= frame.bottom).then(|| Placed {
                ends: [[frame.left, y], [frame.right, y]],
                label,
                place: [frame.right - 12.0, y + above],
                align: Align::Right,
            })
        }
        ReferenceLine::Vertical { x, label } => {
            let x = frame.place([*x, frame.y.0])[0];
            let width = text_width(label, TICK_SIZE);
            let (shift, align) = if x + width + 24.0 < frame.right { (12.0, Align::Left) } else { (-12.0, Align::Right) };
            (x >= frame.left && x <= frame.right).then(|| Placed {
                ends: [[x, frame.bottom], [x, frame.top]],
                label,
                place: [x + shift, frame.bottom - 24.0],
                align,
            })
        }
    }
}

/// Draws a curve, cut at the frame.
pub(crate) fn draw_curve(canvas: &mut Canvas, frame: &Frame, curve: &Curve, color: Rgb, mark: Mark) {
    let places: Vec<[f64; 2]> = curve.points.iter().map(|p| frame.place(*p)).collect();
    if let Some((width, dash)) = curve.style.line() {
        for run in clipped_runs(&places, frame) {
            canvas.polyline(&run, width, color, dash);
        }
    }
    if curve.style.has_markers() {
        let slack = 0.5;
        for place in places {
            let inside = place[0] >= frame.left - slack
                && place[0] <= frame.right + slack
                && place[1] >= frame.top - slack
                && place[1] <= frame.bottom + slack;
            if inside {
                mark.draw(canvas, place, color);
            }
        }
    }
}

/// The parts of a polyline inside the frame (Liang and Barsky 1984), in order.
fn clipped_runs(places: &[[f64; 2]], frame: &Frame) -> Vec<Vec<[f64; 2]>> {
    let mut runs: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut joined = false;
    for pair in places.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let Some((from, to)) = clip(a, b, frame) else {
            joined = false;
            continue;
        };
        let at = |t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
        match runs.last_mut() {
            Some(run) if joined && from == 0.0 => run.push(at(to)),
            _ => runs.push(vec![at(from), at(to)]),
        }
        joined = to == 1.0;
    }
    runs
}

/// The part of the piece from `a` to `b` inside the frame, as fractions of its length.
fn clip(a: [f64; 2], b: [f64; 2], frame: &Frame) -> Option<(f64, f64)> {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    let sides = [
        (a[0] - b[0], a[0] - frame.left),
        (b[0] - a[0], frame.right - a[0]),
        (a[1] - b[1], a[1] - frame.top),
        (b[1] - a[1], frame.bottom - a[1]),
    ];
    for (outward, room) in sides {
        if !(outward.is_finite() && room.is_finite()) {
            return None;
        }
        if outward == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if outward > 0.0 {
            to = to.min(room / outward);
        } else {
            from = from.max(room / outward);
        }
    }
    (from <= to).then_some((from, to))
}
