//! Pictures of a field on the deformed points.
//!
//! In one dimension: the field over x, and a strip of coloured cells at the deformed positions.
//! In two: each point as the cell that it stands for, deformed as its neighbours move.
//! In three: the cells as shaded blocks, seen from a chosen direction without perspective.

use std::collections::HashMap;
use std::path::Path;

use super::OutputError;
use super::canvas::{Align, Canvas, Cell, INK, Layer, Rgb, SOFT_INK, Shape, fitting_size, text_width};
use super::color::{CURVES, ColorMap};
use super::plot::{Curve, Frame, LABEL_SIZE, Mark, Scale, Style, TICK_SIZE, TITLE_SIZE, check_size, draw_curve, with_factor, with_unit};
use super::ticks::{self, number};

/// The points of a body, deformed.
#[derive(Debug, Clone, Copy)]
pub struct Body<'a> {
    /// Dimension of space, 1 to 3. A plate or shell embedded in space has 3.
    pub dimension: usize,
    /// Reference positions, zeros in unused directions.
    pub reference: &'a [[f64; 3]],
    /// Displacements, zeros in unused directions.
    pub displacement: &'a [[f64; 3]],
    /// Edge of the cell of each point: its length, the root of its area, or the cube root of
    /// its volume.
    pub edge: &'a [f64],
}

/// The values that are shown in colour.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    /// Name, as it stands at the colour bar.
    pub name: &'a str,
    /// Unit.
    pub unit: Option<&'a str>,
    /// One value a point; points whose value is not finite are grey.
    pub values: &'a [f64],
}

/// Which values the ends of the colour bar stand for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Range {
    /// The smallest and the largest value.
    #[default]
    Auto,
    /// The largest absolute value with both signs, so that zero is in the middle.
    Symmetric,
    /// Given ends; values beyond take the colours of the ends.
    Fixed {
        /// Lower end.
        min: f64,
        /// Upper end.
        max: f64,
    },
}

/// How much the displacements are magnified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Deformation {
    /// By a factor; 1 shows the body as it is, 0 the reference.
    Factor(f64),
    /// By the round factor that makes the largest displacement about a twentieth of the body.
    Auto,
}

/// From where a body in space is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Angle of the viewer around the z axis, from x toward y, in degrees.
    pub azimuth: f64,
    /// Angle of the viewer above the plane of x and y, in degrees.
    pub elevation: f64,
}

impl Default for View {
    fn default() -> Self {
        Self { azimuth: -60.0, elevation: 25.0 }
    }
}

/// Options of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Title; without one, the name of the field.
    pub title: Option<String>,
    /// What is said below the title (time, load); the magnification is added to it.
    pub caption: Option<String>,
    /// Colours.
    pub colors: ColorMap,
    /// Ends of the colour bar.
    pub range: Range,
    /// Magnification of the displacements.
    pub deformation: Deformation,
    /// Direction of view, in three dimensions.
    pub view: View,
    /// Unit of positions.
    pub length_unit: Option<String>,
    /// Largest width in pixels. The picture becomes narrower for a slender upright body.
    pub width: usize,
    /// Largest height in pixels. The picture becomes flatter for a slender lying body.
    pub height: usize,
    /// Whether the colour bar is drawn; without it pictures can stand side by side.
    pub bar: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            title: None,
            caption: None,
            colors: ColorMap::default(),
            range: Range::default(),
            deformation: Deformation::Factor(1.0),
            view: View::default(),
            length_unit: None,
            width: 1600,
            height: 1000,
            bar: true,
        }
    }
}

/// A finished picture.
#[derive(Debug, Clone)]
pub struct Picture {
    /// The pixels.
    pub canvas: Canvas,
    projection: Projection,
}

impl Picture {
    /// The pixel that shows a (magnified, deformed) position.
    pub fn locate(&self, position: [f64; 3]) -> Option<(usize, usize)> {
        let place = self.projection.place(position);
        let inside = |v: f64, limit: usize| v >= 0.0 && v < limit as f64;
        (inside(place[0], self.canvas.width()) && inside(place[1], self.canvas.height())).then(|| (place[0] as usize, place[1] as usize))
    }

    /// Writes the picture as a PNG.
    ///
    /// # Errors
    /// [`OutputError::Encode`], [`OutputError::Io`]; the final name is then untouched.
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        self.canvas.write(path)
    }
}

/// Positions to pixels, with the depth toward the viewer in pixels as third coordinate.
#[derive(Debug, Clone, Copy)]
struct Projection {
    /// Rows: to the right, downward, toward the viewer; in pixels a length.
    rows: [[f64; 3]; 3],
    shift: [f64; 2],
}

impl Projection {
    fn direction(&self, d: [f64; 3]) -> [f64; 3] {
        self.rows.map(|row| dot(row, d))
    }

    fn place(&self, x: [f64; 3]) -> [f64; 3] {
        let [right, down, near] = self.direction(x);
        [right + self.shift[0], down + self.shift[1], near]
    }
}

// Room around the cells, in pixels.
const TOP: f64 = 128.0;
const BOTTOM: f64 = 110.0;
const BAR_ROOM: f64 = 70.0;
const BAR_WIDTH: f64 = 34.0;
/// Least height of a colour bar that still carries readable marks.
const BAR_HEIGHT: f64 = 260.0;

/// The factor by which [`Deformation::Auto`] magnifies displacements; `None` where nothing can be drawn.
pub fn automatic_factor(body: &Body<'_>) -> Option<f64> {
    Blocks::new(body, Deformation::Auto).map(|blocks| blocks.factor)
}

/// Draws a field on the deformed points.
///
/// # Errors
/// [`OutputError::Drawing`] if lists differ in length, there is no point with a finite position,
/// the dimension is not 1 to 3, an option is impossible or the picture too small or too large.
pub fn draw(body: &Body<'_>, shown: &Shown<'_>, options: &Options) -> Result<Picture, OutputError> {
    let refuse = |reason: String| OutputError::Drawing { what: format!("the picture of `{}`", shown.name), reason };
    check(body, shown, options).map_err(refuse)?;
    let range = range_of(shown.values, options.range).map_err(refuse)?;
    let blocks =
        Blocks::new(body, options.deformation).ok_or_else(|| refuse("no point has a finite position and a cell with an edge".into()))?;
    let colors: Vec<Rgb> = shown.values.iter().map(|&v| options.colors.color(share(v, range))).collect();
    let scene = Scene { body, shown, options, range, blocks: &blocks, colors: &colors };
    Ok(match body.dimension {
        1 => scene.strip(),
        2 => scene.plane(),
        _ => scene.space(),
    })
}

/// Draws a field on the deformed points of a surface in perspective, shaded: on its triangles, or, without any, on discs across the normals.
///
/// # Errors
/// Those of [`draw`].
pub fn draw_surface(
    body: &Body<'_>,
    triangles: &[[u32; 3]],
    normals: &[[f64; 3]],
    shown: &Shown<'_>,
    options: &Options,
) -> Result<Picture, OutputError> {
    let refuse = |reason: String| OutputError::Drawing { what: format!("the picture of `{}`", shown.name), reason };
    check(body, shown, options).map_err(refuse)?;
    let points = body.reference.len();
    if triangles.iter().flatten().any(|&q| q as usize >= points) || (triangles.is_empty() && normals.len() != points) {
        return Err(refuse("its triangles or normals do not fit its points".into()));
    }
    let range = range_of(shown.values, options.range).map_err(refuse)?;
    let blocks =
        Blocks::new(body, options.deformation).ok_or_else(|| refuse("no point has a finite position and a cell with an edge".into()))?;
    let colors: Vec<Rgb> = shown.values.iter().map(|&v| options.colors.color(share(v, range))).collect();
    let scene = Scene { body, shown, options, range, blocks: &blocks, colors: &colors };
    Ok(scene.surface(triangles, normals))
}

fn check(body: &Body<'_>, shown: &Shown<'_>, options: &Options) -> Result<(), String> {
    let points = body.reference.len();
    for (name, found) in [("displacements", body.displacement.len()), ("edges", body.edge.len()), ("values", shown.values.len())] {
        if found != points {
            return Err(format!("there are {found} {name} for {points} points"));
        }
    }
    if !(1..=3).contains(&body.dimension) {
        return Err(format!("the dimension is {}; only 1, 2 and 3 can be drawn", body.dimension));
    }
    let factor = match options.deformation {
        Deformation::Factor(factor) => factor,
        Deformation::Auto => 1.0,
    };
    let View { azimuth, elevation } = options.view;
    for (name, value) in [("magnification", factor), ("azimuth", azimuth), ("elevation", elevation)] {
        if !value.is_finite() {
            return Err(format!("the {name} is {value}; it must be finite"));
        }
    }
    check_size(options.width, options.height)
}

fn range_of(values: &[f64], range: Range) -> Result<(f64, f64), String> {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let min = finite().fold(f64::INFINITY, f64::min);
    let max = finite().fold(f64::NEG_INFINITY, f64::max);
    match range {
        Range::Auto => Ok(ticks::open_range(min, max)),
        Range::Symmetric => {
            let most = min.abs().max(max.abs());
            let most = if most.is_finite() && most > 0.0 { most } else { 1.0 };
            Ok((-most, most))
        }
        Range::Fixed { min, max } if min.is_finite() && max.is_finite() && min < max => Ok((min, max)),
        Range::Fixed { min, max } => Err(format!("the colours cannot run from {min} to {max}; the first end must be smaller")),
    }
}

/// Where a value lies in the range, 0 to 1; NaN where it is not finite.
fn share(value: f64, (min, max): (f64, f64)) -> f64 {
    if value.is_finite() { (value - min) / (max - min) } else { f64::NAN }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The deformed cells of all points.
struct Blocks {
    /// Magnification used.
    factor: f64,
    /// Middles; not finite for points that cannot be drawn.
    center: Vec<[f64; 3]>,
    /// Three half edges each.
    half: Vec<[[f64; 3]; 3]>,
    /// Smallest and largest corner of the reference body, cells included.
    reference: [[f64; 3]; 2],
}

impl Blocks {
    fn new(body: &Body<'_>, deformation: Deformation) -> Option<Self> {
        let points = body.reference.len();
        let drawable: Vec<bool> = (0..points)
            .map(|i| {
                let all = [body.reference[i], body.displacement[i]];
                all.as_flattened().iter().all(|c| c.is_finite()) && body.edge[i].is_finite() && body.edge[i] > 0.0
            })
            .collect();
        let mut reference = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let mut largest: f64 = 0.0;
        for i in (0..points).filter(|&i| drawable[i]) {
            for k in 0..3 {
                let half = if k < body.dimension { 0.5 * body.edge[i] } else { 0.0 };
                reference[0][k] = reference[0][k].min(body.reference[i][k] - half);
                reference[1][k] = reference[1][k].max(body.reference[i][k] + half);
            }
            let u = body.displacement[i];
            largest = largest.max(dot(u, u).sqrt());
        }
        if reference[0][0] > reference[1][0] {
            return None;
        }
        let size = (0..3).map(|k| reference[1][k] - reference[0][k]).fold(0.0, f64::max);
        let factor = match deformation {
            Deformation::Factor(factor) => factor,
            Deformation::Auto if largest > 0.0 => round_down(0.05 * size / largest),
            Deformation::Auto => 1.0,
        };
        let center = (0..points)
            .map(|i| match drawable[i] {
                true => std::array::from_fn(|k| body.reference[i][k] + factor * body.displacement[i][k]),
                false => [f64::NAN; 3],
            })
            .collect();
        let half = if largest == 0.0 || factor == 0.0 {
            let edge = |i: &f64| identity(0.5 * i);
            body.edge.iter().map(edge).collect()
        } else {
            deformed_halves(body, factor, &drawable)
        };
        Some(Self { factor, center, half, reference })
    }

    /// Indices of the points that can be drawn.
    fn drawn(&self) -> impl Iterator<Item = usize> {
        (0..self.center.len()).filter(|&i| self.center[i][0].is_finite())
    }

    /// Smallest and largest projection of all cells onto a direction.
    fn extent(&self, direction: [f64; 3], dimension: usize) -> (f64, f64) {
        let mut extent = (f64::INFINITY, f64::NEG_INFINITY);
        for i in self.drawn() {
            let middle = dot(self.center[i], direction);
            let reach: f64 = (0..dimension).map(|k| dot(self.half[i][k], direction).abs()).sum();
            extent = (extent.0.min(middle - reach), extent.1.max(middle + reach));
        }
        extent
    }
}

/// The largest of 1, 2, 5 times a power of ten that is not above `value`.
fn round_down(value: f64) -> f64 {
    let power = 10.0_f64.powf(value.log10().floor());
    let mantissa = value / power;
    // Dividing by exact powers keeps small factors free of rounding dust in the caption.
    let digit = if mantissa >= 5.0 {
        5.0
    } else if mantissa >= 2.0 {
        2.0
    } else {
        1.0
    };
    format!("{:.0e}", digit * power).parse().unwrap_or(1.0)
}

fn identity(scale: f64) -> [[f64; 3]; 3] {
    let mut matrix = [[0.0; 3]; 3];
    for k in 0..3 {
        matrix[k][k] = scale;
    }
    matrix
}

/// Half edges of all cells, deformed by the gradient of the neighbours' magnified displacements.
///
/// The gradient is a weighted fit over the nearest neighbours. The weights cannot change it where
/// the deformation is even; beside a crack they suppress the neighbours on the far side, whose
/// displacements differ far more than those of the others.
fn deformed_halves(body: &Body<'_>, factor: f64, drawable: &[bool]) -> Vec<[[f64; 3]; 3]> {
    let dimension = body.dimension;
    let points = body.reference.len();
    let largest = (0..points).filter(|&i| drawable[i]).map(|i| body.edge[i]).fold(0.0, f64::max);
    // Diagonal neighbours of a regular grid are 1.42 (1.73 in space) edges away.
    let reach = 1.8;
    let side = reach * largest;
    let box_of = |i: usize| body.reference[i].map(|x| (x / side).floor() as i64);
    let mut order: Vec<usize> = (0..points).filter(|&i| drawable[i]).collect();
    order.sort_by_key(|&i| (box_of(i), i));
    let mut boxes: HashMap<[i64; 3], (usize, usize)> = HashMap::new();
    for (place, &i) in order.iter().enumerate() {
        let range = boxes.entry(box_of(i)).or_insert((place, place));
        range.1 = place + 1;
    }

    let mut near: Vec<([f64; 3], [f64; 3], f64)> = Vec::new();
    let mut ratios: Vec<f64> = Vec::new();
    (0..points)
        .map(|i| {
            if !drawable[i] {
                return [[0.0; 3]; 3];
            }
            let edge = body.edge[i];
            near.clear();
            ratios.clear();
            let home = box_of(i);
            for offset in 0..27 {
                let step = [offset % 3 - 1, offset / 3 % 3 - 1, offset / 9 - 1];
                let key = std::array::from_fn(|k| home[k].saturating_add(step[k]));
                let Some(&(from, to)) = boxes.get(&key) else {
                    continue;
                };
                for &j in order[from..to].iter().filter(|&&j| j != i) {
                    let xi: [f64; 3] = std::array::from_fn(|k| body.reference[j][k] - body.reference[i][k]);
                    let length = dot(xi, xi).sqrt();
                    if length > reach * edge.max(body.edge[j]) || length == 0.0 {
                        continue;
                    }
                    let eta: [f64; 3] = std::array::from_fn(|k| factor * (body.displacement[j][k] - body.displacement[i][k]));
                    let ratio = dot(eta, eta).sqrt() / length;
                    near.push((xi, eta, ratio));
                    ratios.push(ratio);
                }
            }
            let gradient = gradient_along_curve(&near, dimension).unwrap_or_else(|| gradient(&near, &mut ratios, edge, dimension));
            std::array::from_fn(|k| {
                let mut column = [0.0; 3];
                for r in 0..3 {
                    column[r] = 0.5 * edge * (gradient[r][k] + f64::from(u8::from(r == k)));
                }
                column
            })
        })
        .collect()
}

/// In the plane, where all neighbours stand in line: a beam. Its cells turn with it, and keep their thickness.
fn gradient_along_curve(near: &[([f64; 3], [f64; 3], f64)], dimension: usize) -> Option<[[f64; 3]; 3]> {
    let sum = |f: &dyn Fn(&[f64; 3]) -> f64| near.iter().map(|(xi, _, _)| f(xi)).sum::<f64>();
    let (xx, xy, yy) = (sum(&|x| x[0] * x[0]), sum(&|x| x[0] * x[1]), sum(&|x| x[1] * x[1]));
    if dimension != 2 || near.is_empty() || xx * yy - xy * xy > 1e-3 * (xx + yy).powi(2) {
        return None;
    }
    let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
    let (mut before, mut after) = (0.0, [0.0; 2]);
    for (xi, eta, _) in near {
        let along = xi[0] * cos + xi[1] * sin;
        before += along.abs();
        (0..2).for_each(|k| after[k] += along.signum() * (xi[k] + eta[k]));
    }
    let length = after[0].hypot(after[1]);
    if !(length > 0.0 && before > 0.0) {
        return None;
    }
    let (stretch, x, y) = (length / before, after[0] / length, after[1] / length);
    // F = λ t ⊗ t₀ + n ⊗ n₀
    let deformed = [[stretch * x * cos + y * sin, stretch * x * sin - y * cos], [stretch * y * cos - x * sin, stretch * y * sin + x * cos]];
    let mut gradient = [[0.0; 3]; 3];
    for k in 0..2 {
        for l in 0..2 {
            gradient[k][l] = deformed[k][l] - f64::from(u8::from(k == l));
        }
    }
    Some(gradient)
}

/// The displacement gradient that fits the neighbours best: `(Σ w η ⊗ ξ)(Σ w ξ ⊗ ξ)⁻¹`.
fn gradient(near: &[([f64; 3], [f64; 3], f64)], ratios: &mut [f64], edge: f64, dimension: usize) -> [[f64; 3]; 3] {
    if near.is_empty() {
        return [[0.0; 3]; 3];
    }
    ratios.sort_by(f64::total_cmp);
    let typical = ratios[ratios.len() / 2];
    let mut shape = [[0.0; 3]; 3];
    let mut moved = [[0.0; 3]; 3];
    for (xi, eta, ratio) in near {
        // A magnified strain of a twentieth is never taken for a crack.
        let weight = 1.0 / (1.0 + (ratio / (2.0 * typical + 0.05)).powi(8));
        for r in 0..3 {
            for c in 0..3 {
                // Lengths in edges, so that the shape tensor has no unit.
                shape[r][c] += weight * xi[r] * xi[c] / (edge * edge);
                moved[r][c] += weight * eta[r] * xi[c] / (edge * edge);
            }
        }
    }
    // Directions without a neighbour (a line, a surface, an unused axis) keep their edge.
    let trace = shape[0][0] + shape[1][1] + shape[2][2];
    for k in 0..3 {
        if k >= dimension || shape[k][k] <= 1e-6 * trace {
            shape[k] = [0.0; 3];
            for row in &mut shape {
                row[k] = 0.0;
            }
            shape[k][k] = trace;
            for row in &mut moved {
                row[k] = 0.0;
            }
        }
    }
    let columns = [cross(shape[1], shape[2]), cross(shape[2], shape[0]), cross(shape[0], shape[1])];
    let det = dot(shape[0], columns[0]);
    let scale = shape[0][0] * shape[1][1] * shape[2][2];
    if det.is_nan() || det <= 1e-3 * scale {
        return [[0.0; 3]; 3];
    }
    // The shape tensor is symmetric, and so is its adjugate.
    moved.map(|row| std::array::from_fn(|c| dot(row, columns[c]) / det))
}

/// Everything a drawing needs.
struct Scene<'a> {
    body: &'a Body<'a>,
    shown: &'a Shown<'a>,
    options: &'a Options,
    range: (f64, f64),
    blocks: &'a Blocks,
    colors: &'a [Rgb],
}

impl Scene<'_> {
    fn heading(&self) -> String {
        with_unit(self.shown.name, self.shown.unit)
    }

    fn axis(&self, name: &str) -> String {
        with_unit(name, self.options.length_unit.as_deref())
    }

    fn draw_title(&self, canvas: &mut Canvas, left: f64) {
        let room = canvas.width() as f64 - left - 40.0;
        let title = self.options.title.as_deref().unwrap_or(self.shown.name);
        let size = fitting_size(title, TITLE_SIZE, room);
        canvas.text([left, 42.0], title, size, INK, Align::Left);
        let mut caption = self.options.caption.clone().unwrap_or_default();
        let factor = self.blocks.factor;
        if factor != 1.0 && self.options.bar {
            if !caption.is_empty() {
                caption.push_str(", ");
            }
            if factor == 0.0 {
                caption.push_str("reference shape");
            } else {
                caption.push_str(&format!("displacements × {}", number(factor, 3)));
            }
        }
        let size = fitting_size(&caption, TICK_SIZE, room);
        canvas.text([left, 82.0], &caption, size, SOFT_INK, Align::Left);
    }

    /// Width that the colour bar needs right of the cells.
    fn bar_room(&self) -> f64 {
        if !self.options.bar {
            return 30.0;
        }
        BAR_ROOM + bar_width(self.range)
    }

    fn draw_bar(&self, canvas: &mut Canvas, left: f64, top: f64, bottom: f64) {
        if self.options.bar {
            color_bar(canvas, [left, top, bottom], self.options.colors, self.range, &self.heading());
        }
    }

    /// Space left for the cells, their scale, and the size of the whole picture, for cells that
    /// span `size` lengths and margins of `left` and `right` pixels.
    fn fit(&self, size: [f64; 2], left: f64, right: f64) -> ([f64; 2], f64, [f64; 2]) {
        let most = [(self.options.width as f64 - left - right).max(1.0), (self.options.height as f64 - TOP - BOTTOM).max(1.0)];
        let scale = (most[0] / size[0]).min(most[1] / size[1]);
        let cells = [size[0] * scale, size[1] * scale];
        // without a bar, pictures of slender bodies may stand close
        let least = if self.options.bar { [(820.0 - left - right).max(1.0), BAR_HEIGHT] } else { [200.0, 120.0] };
        let room = std::array::from_fn(|k| cells[k].max(least[k].min(most[k])).ceil());
        let whole = [room[0] + left + right, room[1] + TOP + BOTTOM];
        (room, scale, whole)
    }

    fn plane(&self) -> Picture {
        let x = self.blocks.extent([1.0, 0.0, 0.0], 2);
        let y = self.blocks.extent([0.0, 1.0, 0.0], 2);
        let margin = 0.02 * (x.1 - x.0).max(y.1 - y.0);
        let size = [x.1 - x.0 + 2.0 * margin, y.1 - y.0 + 2.0 * margin];
        let bar_room = self.bar_room();
        // The labels of the vertical axis decide the left margin, its length their number.
        let mut left = 130.0;
        let mut frame = self.plane_frame(left, size, x, y, bar_room).0;
        left = frame.left_margin();
        let (fitted, room, scale, whole) = {
            let (frame, room, scale, whole) = self.plane_frame(left, size, x, y, bar_room);
            (frame, room, scale, whole)
        };
        frame = fitted;

        let mut canvas = Canvas::new(whole[0] as usize, whole[1] as usize);
        self.draw_title(&mut canvas, left);
        frame.draw_grid(&mut canvas);
        let origin = frame.place([0.0, 0.0]);
        let projection = Projection { rows: [[scale, 0.0, 0.0], [0.0, -scale, 0.0], [0.0; 3]], shift: [origin[0], origin[1]] };
        let mut layer = Layer::new(left, TOP, room[0] as usize, room[1] as usize);
        for i in self.blocks.drawn() {
            let cell = Cell {
                center: projection.place(self.blocks.center[i]),
                first: projection.direction(self.blocks.half[i][0]),
                second: projection.direction(self.blocks.half[i][1]),
            };
            layer.cell(&cell, self.colors[i], false);
        }
        layer.lay_on(&mut canvas);
        frame.draw_axes(&mut canvas, &self.axis("x"), &self.axis("y"));
        let bar = frame.right + BAR_ROOM;
        self.draw_bar(&mut canvas, bar, frame.top, frame.bottom);
        Picture { canvas, projection }
    }

    fn plane_frame(&self, left: f64, size: [f64; 2], x: (f64, f64), y: (f64, f64), bar_room: f64) -> (Frame, [f64; 2], f64, [f64; 2]) {
        let (room, scale, whole) = self.fit(size, left, bar_room);
        // Room that the equal scales leave over is shown empty, on both sides of the body.
        let about = |(from, to): (f64, f64), pixels: f64| {
            let middle = 0.5 * (from + to);
            let half = 0.5 * pixels / scale;
            (middle - half, middle + half)
        };
        let frame = Frame {
            left,
            top: TOP,
            right: left + room[0],
            bottom: TOP + room[1],
            x: about(x, room[0]),
            y: about(y, room[1]),
            x_scale: Scale::Linear,
            y_scale: Scale::Linear,
        };
        (frame, room, scale, whole)
    }

    fn space(&self) -> Picture {
        let (sa, ca) = self.options.view.azimuth.to_radians().sin_cos();
        let (se, ce) = self.options.view.elevation.to_radians().sin_cos();
        let near = [ce * ca, ce * sa, se];
        let right = [-sa, ca, 0.0];
        let up = cross(near, right);
        let across = self.blocks.extent(right, 3);
        let along = self.blocks.extent(up, 3);
        let size = [1.04 * (across.1 - across.0).max(f64::MIN_POSITIVE), 1.04 * (along.1 - along.0).max(f64::MIN_POSITIVE)];
        let left = 60.0;
        let (room, scale, whole) = self.fit(size, left, self.bar_room());
        let middle = [left + 0.5 * room[0], TOP + 0.5 * room[1]];
        let scaled = |v: [f64; 3], by: f64| v.map(|c| c * by);
        let projection = Projection {
            rows: [scaled(right, scale), scaled(up, -scale), scaled(near, scale)],
            shift: [middle[0] - 0.5 * scale * (across.0 + across.1), middle[1] + 0.5 * scale * (along.0 + along.1)],
        };

        let mut canvas = Canvas::new(whole[0] as usize, whole[1] as usize);
        self.draw_title(&mut canvas, left);
        let mut layer = Layer::new(left, TOP, room[0] as usize, room[1] as usize);
        // Light from the upper left behind the viewer.
        let light = [-0.36, 0.56, 0.746];
        let light: [f64; 3] = std::array::from_fn(|k| light[0] * right[k] + light[1] * up[k] + light[2] * near[k]);
        for i in self.blocks.drawn() {
            let half = &self.blocks.half[i];
            for k in 0..3 {
                let (a, b) = (half[(k + 1) % 3], half[(k + 2) % 3]);
                let normal = cross(a, b);
                let length = dot(normal, normal).sqrt();
                let toward = dot(normal, near);
                if length == 0.0 || toward == 0.0 {
                    continue;
                }
                // Of two opposite faces one is turned to the viewer, and only that is drawn.
                // Which one the normal means depends on the handedness of the half edges.
                let outward = dot(normal, half[k]).signum();
                let side = toward.signum() * outward;
                let center = std::array::from_fn(|r| self.blocks.center[i][r] + side * half[k][r]);
                let lit = (dot(normal, light) * toward.signum() / length).max(0.0);
                let cell = Cell { center: projection.place(center), first: projection.direction(a), second: projection.direction(b) };
                layer.cell(&cell, shaded(self.colors[i], lit), true);
            }
        }
        layer.lay_on(&mut canvas);
        self.draw_triad(&mut canvas, [right, up], left);
        let bar_top = TOP + (0.5 * room[1] - 300.0).max(0.0);
        let bar_bottom = TOP + room[1] - (0.5 * room[1] - 300.0).max(0.0);
        let bar = left + room[0] + BAR_ROOM;
        self.draw_bar(&mut canvas, bar, bar_top, bar_bottom);
        Picture { canvas, projection }
    }

    /// A surface in perspective.
    fn surface(&self, triangles: &[[u32; 3]], normals: &[[f64; 3]]) -> Picture {
        /// Distance of the viewer from the middle, in half diagonals of the body.
        const DISTANCE: f64 = 4.0;
        let (sa, ca) = self.options.view.azimuth.to_radians().sin_cos();
        let (se, ce) = self.options.view.elevation.to_radians().sin_cos();
        let near = [ce * ca, ce * sa, se];
        let right = [-sa, ca, 0.0];
        let up = cross(near, right);
        let center = &self.blocks.center;
        // corners of triangles: of the points, or of discs around them
        let mut corners: Vec<[[f64; 3]; 3]> = vec![];
        let mut of: Vec<[usize; 3]> = vec![];
        if triangles.is_empty() {
            const SIDES: usize = 10;
            for i in self.blocks.drawn() {
                let n = normals[i];
                let other = if n[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
                let a = cross(n, other);
                let length = dot(a, a).sqrt();
                let a = a.map(|x| x / length);
                let b = cross(n, a);
                let radius = 0.62 * self.body.edge[i];
                let rim = |k: usize| -> [f64; 3] {
                    let (s, c) = (std::f64::consts::TAU * k as f64 / SIDES as f64).sin_cos();
                    std::array::from_fn(|r| center[i][r] + radius * (c * a[r] + s * b[r]))
                };
                for k in 0..SIDES {
                    corners.push([center[i], rim(k), rim(k + 1)]);
                    of.push([i; 3]);
                }
            }
        } else {
            for t in triangles.iter().map(|t| t.map(|q| q as usize)).filter(|t| t.iter().all(|&q| center[q][0].is_finite())) {
                corners.push(t.map(|q| center[q]));
                of.push(t);
            }
            // points of no triangle, those of beams: beads that face the viewer, before the surface they lie in
            let mut bare = vec![true; center.len()];
            of.iter().flatten().for_each(|&q| bare[q] = false);
            for i in self.blocks.drawn().filter(|&i| bare[i] && !normals.is_empty()) {
                const SIDES: usize = 12;
                let radius = 0.45 * self.body.edge[i];
                let middle: [f64; 3] = std::array::from_fn(|r| center[i][r] + 0.3 * radius * near[r]);
                let rim = |k: usize| -> [f64; 3] {
                    let (s, c) = (std::f64::consts::TAU * k as f64 / SIDES as f64).sin_cos();
                    std::array::from_fn(|r| middle[r] + radius * (c * right[r] + s * up[r]))
                };
                for k in 0..SIDES {
                    corners.push([middle, rim(k), rim(k + 1)]);
                    of.push([i; 3]);
                }
            }
        }
        // light of each point: the mean of its triangles, so that a smooth surface looks smooth
        let mut facing = vec![[0.0; 3]; center.len()];
        for (t, c) in of.iter().zip(&corners) {
            let edge = |k: usize| -> [f64; 3] { std::array::from_fn(|r| c[k][r] - c[0][r]) };
            let n = cross(edge(1), edge(2));
            t.iter().for_each(|&q| (0..3).for_each(|r| facing[q][r] += n[r]));
        }
        let all = || corners.iter().flatten();
        let bounds = |direction: [f64; 3]| {
            all().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(dot(*x, direction)), b.max(dot(*x, direction))))
        };
        let (r, u, n) = (bounds(right), bounds(up), bounds(near));
        let middle = [0.5 * (r.0 + r.1), 0.5 * (u.0 + u.1), 0.5 * (n.0 + n.1)];
        let half = 0.5 * [r.1 - r.0, u.1 - u.0, n.1 - n.0].iter().map(|x| x * x).sum::<f64>().sqrt();
        let distance = DISTANCE * half.max(f64::MIN_POSITIVE);
        // (right, up, near) as seen: what is nearer is larger
        let seen = |x: &[f64; 3]| {
            let depth = dot(*x, near) - middle[2];
            let larger = distance / (distance - depth);
            [(dot(*x, right) - middle[0]) * larger, (dot(*x, up) - middle[1]) * larger, depth]
        };
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for x in all() {
            let s = seen(x);
            (0..2).for_each(|k| (low[k], high[k]) = (low[k].min(s[k]), high[k].max(s[k])));
        }
        let size: [f64; 2] = std::array::from_fn(|k| 1.04 * (high[k] - low[k]).max(f64::MIN_POSITIVE));
        let left = 60.0;
        let (room, scale, whole) = self.fit(size, left, self.bar_room());
        let pixel = [left + 0.5 * room[0] - 0.5 * scale * (low[0] + high[0]), TOP + 0.5 * room[1] + 0.5 * scale * (low[1] + high[1])];
        let scaled = |v: [f64; 3], by: f64| v.map(|c| c * by);
        // without perspective: right in the middle of the body
        let projection = Projection {
            rows: [scaled(right, scale), scaled(up, -scale), scaled(near, scale)],
            shift: [pixel[0] - scale * middle[0], pixel[1] + scale * middle[1]],
        };
        let mut canvas = Canvas::new(whole[0] as usize, whole[1] as usize);
        self.draw_title(&mut canvas, left);
        let mut layer = Layer::new(left, TOP, room[0] as usize, room[1] as usize);
        let light = [-0.36, 0.56, 0.746];
        let light: [f64; 3] = std::array::from_fn(|k| light[0] * right[k] + light[1] * up[k] + light[2] * near[k]);
        for (t, c) in of.iter().zip(&corners) {
            let place = c.each_ref().map(|x| {
                let s = seen(x);
                [pixel[0] + scale * s[0], pixel[1] - scale * s[1], s[2]]
            });
            // both sides of a shell are lit alike
            let colors = t.map(|q| {
                let n = facing[q];
                let length = dot(n, n).sqrt();
                let lit = if length > 0.0 { (dot(n, light) * dot(n, near).signum() / length).max(0.0) } else { 1.0 };
                let factor = 0.55 + 0.45 * lit;
                self.colors[q].map(|c| f64::from(c) * factor)
            });
            layer.triangle(&place, &colors);
        }
        layer.lay_on(&mut canvas);
        self.draw_triad(&mut canvas, [right, up], left);
        let bar_top = TOP + (0.5 * room[1] - 300.0).max(0.0);
        let bar_bottom = TOP + room[1] - (0.5 * room[1] - 300.0).max(0.0);
        self.draw_bar(&mut canvas, left + room[0] + BAR_ROOM, bar_top, bar_bottom);
        Picture { canvas, projection }
    }

    /// The three axes as they are seen, and the extents of the reference body beside them.
    fn draw_triad(&self, canvas: &mut Canvas, [right, up]: [[f64; 3]; 2], left: f64) {
        let origin = [left + 50.0, canvas.height() as f64 - 60.0];
        let length = 44.0;
        let colors = [CURVES[1], CURVES[2], CURVES[0]];
        for (k, name) in ["x", "y", "z"].iter().enumerate() {
            let tip = [right[k] * length, -up[k] * length];
            let end = [origin[0] + tip[0], origin[1] + tip[1]];
            canvas.polyline(&[origin, end], 3.0, colors[k], None);
            let reach = tip[0].hypot(tip[1]);
            // An axis that points at the viewer has no room for its name.
            if reach > 0.25 * length {
                let beyond = 1.0 + 15.0 / reach;
                let place = [origin[0] + beyond * tip[0], origin[1] + beyond * tip[1]];
                canvas.text(place, name, TICK_SIZE, INK, Align::Center);
            }
        }
        let [low, high] = self.blocks.reference;
        let unit = self.options.length_unit.as_deref().unwrap_or("");
        let sides: Vec<String> = (0..3).map(|k| number(high[k] - low[k], 3)).collect();
        let text = format!("{} {unit}", sides.join(" × "));
        let place = [origin[0] + 90.0, canvas.height() as f64 - 40.0];
        canvas.text(place, text.trim_end(), TICK_SIZE, SOFT_INK, Align::Left);
    }

    fn strip(&self) -> Picture {
        let (width, height) = (self.options.width as f64, self.options.height as f64);
        let x = self.blocks.extent([1.0, 0.0, 0.0], 1);
        let [low, high] = self.blocks.reference;
        let ends = (x.0.min(low[0]), x.1.max(high[0]));
        let margin = 0.02 * (ends.1 - ends.0);
        let room = 0.06 * (self.range.1 - self.range.0);
        let strip_height = (0.07 * height).max(24.0);
        let mut frame = Frame {
            left: 0.0,
            top: TOP,
            right: width - 50.0,
            bottom: height - BOTTOM - strip_height - 50.0,
            x: (ends.0 - margin, ends.1 + margin),
            y: (self.range.0 - room, self.range.1 + room),
            x_scale: Scale::Linear,
            y_scale: Scale::Linear,
        };
        frame.left = frame.left_margin();
        let mut canvas = Canvas::new(self.options.width, self.options.height);
        self.draw_title(&mut canvas, frame.left);

        // The curve stands over the reference positions, in their order along the bar.
        frame.draw_grid(&mut canvas);
        let mut order: Vec<usize> = self.blocks.drawn().collect();
        order.sort_by(|&i, &j| self.body.reference[i][0].total_cmp(&self.body.reference[j][0]));
        let point = |&i: &usize| [self.body.reference[i][0], self.shown.values[i]];
        let few = order.len() <= 60;
        let curve = Curve::new("", order.iter().map(point).collect()).style(if few { Style::LineAndMarkers } else { Style::Line });
        draw_curve(&mut canvas, &frame, &curve, CURVES[0], Mark { shape: Shape::Circle, hollow: false });
        frame.draw_axes(&mut canvas, &self.axis("x"), &self.heading());

        let top = height - strip_height - 40.0;
        let scale = (frame.right - frame.left) / (frame.x.1 - frame.x.0);
        let projection =
            Projection { rows: [[scale, 0.0, 0.0], [0.0; 3], [0.0; 3]], shift: [frame.left - scale * frame.x.0, top + 0.5 * strip_height] };
        let room = [frame.right - frame.left, strip_height];
        let mut layer = Layer::new(frame.left, top, room[0].ceil() as usize, room[1].ceil() as usize);
        for &i in &order {
            let cell = Cell {
                center: projection.place(self.blocks.center[i]),
                first: projection.direction(self.blocks.half[i][0]),
                second: [0.0, 0.5 * strip_height, 0.0],
            };
            layer.cell(&cell, self.colors[i], false);
        }
        layer.lay_on(&mut canvas);
        Picture { canvas, projection }
    }
}

/// The room that a colour bar needs beside its left side, in pixels.
pub fn bar_width(range: (f64, f64)) -> f64 {
    let ticks = ticks::linear(range.0, range.1, 7);
    let widest = ticks.labels.iter().map(|label| text_width(label, TICK_SIZE));
    BAR_WIDTH + widest.fold(0.0, f64::max) + 95.0
}

/// Draws a colour bar with its marks from `top` to `bottom`, `left` being its left side.
pub fn color_bar(canvas: &mut Canvas, [left, top, bottom]: [f64; 3], colors: ColorMap, range: (f64, f64), heading: &str) {
    let (top, bottom, left) = (top.round(), bottom.round(), left.round());
    let right = left + BAR_WIDTH;
    let rows = (bottom - top) as usize;
    for row in 0..rows {
        let t = 1.0 - (row as f64 + 0.5) / rows as f64;
        let y = top + row as f64;
        canvas.fill(left, y, right, y + 1.0, colors.color(t), 1.0);
    }
    let w = 2.0;
    canvas.fill(left - w, top - w, right + w, top, INK, 1.0);
    canvas.fill(left - w, bottom, right + w, bottom + w, INK, 1.0);
    canvas.fill(left - w, top, left, bottom, INK, 1.0);
    canvas.fill(right, top, right + w, bottom, INK, 1.0);
    let room = ((bottom - top) / 80.0).clamp(3.0, 8.0) as usize;
    let ticks = ticks::linear(range.0, range.1, room);
    let mut widest: f64 = 0.0;
    for (value, label) in ticks.values.iter().zip(&ticks.labels) {
        let y = (bottom - share(*value, range) * (bottom - top)).round();
        canvas.fill(right + w, y - 1.0, right + 9.0, y + 1.0, INK, 1.0);
        canvas.text([right + 16.0, y], label, TICK_SIZE, INK, Align::Left);
        widest = widest.max(text_width(label, TICK_SIZE));
    }
    let heading = with_factor(heading, ticks.factor.as_deref());
    let size = fitting_size(&heading, LABEL_SIZE, bottom - top + 120.0);
    let place = [right + 16.0 + widest + 34.0, 0.5 * (top + bottom)];
    canvas.text_upwards(place, &heading, size, INK);
}

/// A face in the light: never so dark that its colour could be mistaken for another of the map.
fn shaded(color: Rgb, lit: f64) -> Rgb {
    let factor = 0.74 + 0.26 * lit;
    color.map(|c| (f64::from(c) * factor).round() as u8)
}
