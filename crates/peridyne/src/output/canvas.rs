//! A small software canvas: anti-aliased lines, markers, text and cells on a picture in memory.
//!
//! It needs no display, no graphics driver and no installed font, so the same input gives the
//! same picture on every machine.
//!
//! Coordinates are in pixels from the upper left corner; pixel `(i, j)` covers
//! `[i, i+1) × [j, j+1)`.

use std::path::Path;
use std::sync::OnceLock;

use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};

use super::{OutputError, write_whole};

/// A colour: red, green, blue, as stored in a PNG (sRGB).
pub type Rgb = [u8; 3];

/// White.
pub const WHITE: Rgb = [255, 255, 255];
/// The colour of text and frames.
pub const INK: Rgb = [38, 42, 48];
/// The colour of captions and other secondary text.
pub const SOFT_INK: Rgb = [104, 110, 120];
/// The colour of grid lines.
pub const GRID: Rgb = [226, 228, 232];

/// DejaVu Sans, reduced to the letters and signs of engineering notation.
static FONT: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");
/// Height of a capital letter of the font, as a part of its size.
const CAPITAL_HEIGHT: f64 = 0.729;

fn font() -> &'static FontRef<'static> {
    static PARSED: OnceLock<FontRef<'static>> = OnceLock::new();
    PARSED.get_or_init(|| FontRef::try_from_slice(FONT).expect("the embedded font is valid"))
}

/// Which part of a text stands at its position, from left to right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// The position is the left end.
    Left,
    /// The position is the middle.
    Center,
    /// The position is the right end.
    Right,
}

/// Shape of a marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A disc.
    Circle,
    /// A square.
    Square,
    /// A square on its corner.
    Diamond,
    /// A triangle, point up.
    Triangle,
}

/// How a line is broken: lengths of dash, gap, second dash and second gap in pixels.
pub type Dash = Option<[f64; 4]>;

/// A picture in memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
}

impl Canvas {
    /// A white canvas.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![WHITE; width * height] }
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The colour of a pixel, or `None` outside.
    pub fn pixel(&self, x: usize, y: usize) -> Option<Rgb> {
        (x < self.width && y < self.height).then(|| self.pixels[y * self.width + x])
    }

    /// Lays a colour over a pixel, which it covers by `coverage` (0 to 1). Outside, nothing happens.
    pub fn blend(&mut self, x: i64, y: i64, color: Rgb, coverage: f64) {
        if x < 0 || y < 0 || x >= self.width as i64 || y >= self.height as i64 {
            return;
        }
        let pixel = &mut self.pixels[y as usize * self.width + x as usize];
        let coverage = coverage.clamp(0.0, 1.0);
        for (below, above) in pixel.iter_mut().zip(color) {
            let mixed = f64::from(*below) + coverage * (f64::from(above) - f64::from(*below));
            *below = mixed.round() as u8;
        }
    }

    /// Fills the rectangle from `(left, top)` to `(right, bottom)` with opacity 0 to 1.
    pub fn fill(&mut self, left: f64, top: f64, right: f64, bottom: f64, color: Rgb, opacity: f64) {
        let (columns, rows) = (clipped(left, right, self.width), clipped(top, bottom, self.height));
        for y in rows {
            let part_y = overlap(y, top, bottom);
            for x in columns.clone() {
                self.blend(x, y, color, opacity * part_y * overlap(x, left, right));
            }
        }
    }

    /// Draws a line through all points, with round ends and joints.
    ///
    /// Points that are not finite break the line.
    pub fn polyline(&mut self, points: &[[f64; 2]], width: f64, color: Rgb, dash: Dash) {
        let pieces = match dash {
            None => points
                .windows(2)
                .map(|pair| [pair[0], pair[1]])
                .filter(|piece| piece.as_flattened().iter().all(|c| c.is_finite()))
                .collect(),
            Some(dash) => dashes(points, dash),
        };
        let Some(bounds) = bounds_of(&pieces) else {
            return;
        };
        let reach = 0.5 * width + 1.0;
        let columns = clipped(bounds[0] - reach, bounds[2] + reach, self.width);
        let rows = clipped(bounds[1] - reach, bounds[3] + reach, self.height);
        // All pieces meet in one mask, which is laid on once: blended one by one, the joints
        // of a fine polyline would lose their smooth edge.
        let mask_width = (columns.end - columns.start).max(0) as usize;
        let mask_height = (rows.end - rows.start).max(0) as usize;
        let mut mask = vec![0.0_f32; mask_width * mask_height];
        for [a, b] in &pieces {
            let piece_columns = clipped(a[0].min(b[0]) - reach, a[0].max(b[0]) + reach, self.width);
            let piece_rows = clipped(a[1].min(b[1]) - reach, a[1].max(b[1]) + reach, self.height);
            for y in piece_rows {
                for x in piece_columns.clone() {
                    let center = [x as f64 + 0.5, y as f64 + 0.5];
                    let coverage = 0.5 * width + 0.5 - distance(center, *a, *b);
                    let coverage = coverage.clamp(0.0, width.min(1.0)) as f32;
                    let index = (y - rows.start) as usize * mask_width + (x - columns.start) as usize;
                    mask[index] = mask[index].max(coverage);
                }
            }
        }
        for y in rows.clone() {
            for x in columns.clone() {
                let index = (y - rows.start) as usize * mask_width + (x - columns.start) as usize;
                if mask[index] > 0.0 {
                    self.blend(x, y, color, f64::from(mask[index]));
                }
            }
        }
    }

    /// Draws a filled marker of the given diameter with a thin white rim.
    pub fn marker(&mut self, center: [f64; 2], diameter: f64, shape: Shape, color: Rgb) {
        if !center.iter().all(|c| c.is_finite()) {
            return;
        }
        let radius = 0.5 * diameter;
        let reach = radius + 3.0;
        for y in clipped(center[1] - reach, center[1] + reach, self.height) {
            for x in clipped(center[0] - reach, center[0] + reach, self.width) {
                let dx = x as f64 + 0.5 - center[0];
                let dy = y as f64 + 0.5 - center[1];
                // Signed distance to the outline; the factors give all shapes a like area.
                let outside = match shape {
                    Shape::Circle => dx.hypot(dy) - radius,
                    Shape::Square => dx.abs().max(dy.abs()) - 0.88 * radius,
                    Shape::Diamond => (dx.abs() + dy.abs()) / 2.0_f64.sqrt() - 0.88 * radius,
                    Shape::Triangle => {
                        let side = 0.866 * dx.abs() - 0.5 * (dy - 0.15 * radius);
                        side.max(dy - 0.15 * radius) - 0.6 * radius
                    }
                };
                self.blend(x, y, WHITE, 0.5 - (outside - 1.5));
                self.blend(x, y, color, 0.5 - outside);
            }
        }
    }

    /// Lays another canvas over this one, its upper left corner at `(left, top)`.
    pub fn paste(&mut self, other: &Self, left: usize, top: usize) {
        for y in 0..other.height.min(self.height.saturating_sub(top)) {
            for x in 0..other.width.min(self.width.saturating_sub(left)) {
                self.pixels[(top + y) * self.width + left + x] = other.pixels[y * other.width + x];
            }
        }
    }

    /// Writes a line of text of the given size (pixels an em), vertically centred on its capitals.
    pub fn text(&mut self, position: [f64; 2], text: &str, size: f64, color: Rgb, align: Align) {
        let start = position[0] - shift(text, size, align);
        let baseline = (position[1] + 0.5 * CAPITAL_HEIGHT * size).round();
        for glyph in layout(text, size, start, baseline) {
            draw_glyph(glyph, |x, y, coverage| self.blend(x, y, color, coverage));
        }
    }

    /// Writes text from bottom to top, centred on `position`.
    pub fn text_upwards(&mut self, position: [f64; 2], text: &str, size: f64, color: Rgb) {
        let start = -0.5 * text_width(text, size);
        let baseline = (0.5 * CAPITAL_HEIGHT * size).round();
        let origin = [position[0].round() as i64, position[1].round() as i64];
        for glyph in layout(text, size, start, baseline) {
            draw_glyph(glyph, |x, y, coverage| {
                self.blend(origin[0] + y, origin[1] - x - 1, color, coverage);
            });
        }
    }

    /// Writes the canvas as a PNG.
    ///
    /// # Errors
    /// [`OutputError::Encode`], [`OutputError::Io`]; the final name is then untouched.
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        write_whole(path, |file| -> Result<(), png::EncodingError> {
            let mut encoder = png::Encoder::new(file, self.width as u32, self.height as u32);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
            let mut writer = encoder.write_header()?;
            writer.write_image_data(self.pixels.as_flattened())?;
            writer.finish()
        })
    }
}

/// Width of a text in pixels.
pub fn text_width(text: &str, size: f64) -> f64 {
    let font = font();
    let scaled = font.as_scaled(scale_of(size));
    let mut width = 0.0;
    let mut former = None;
    for character in text.chars() {
        let id = font.glyph_id(character);
        if let Some(former) = former {
            width += scaled.kern(former, id);
        }
        width += scaled.h_advance(id);
        former = Some(id);
    }
    f64::from(width)
}

/// The largest size up to `size` at which the text fits into `width`.
pub fn fitting_size(text: &str, size: f64, width: f64) -> f64 {
    let needed = text_width(text, size);
    if needed > width && width > 0.0 { size * width / needed } else { size }
}

fn scale_of(size: f64) -> PxScale {
    let font = font();
    // The scale of the font library counts from the deepest descender to the highest ascender.
    let per_em = font.units_per_em().unwrap_or(2048.0);
    PxScale::from(size as f32 * font.height_unscaled() / per_em)
}

fn shift(text: &str, size: f64, align: Align) -> f64 {
    match align {
        Align::Left => 0.0,
        Align::Center => 0.5 * text_width(text, size),
        Align::Right => text_width(text, size),
    }
}

fn layout(text: &str, size: f64, start: f64, baseline: f64) -> Vec<Glyph> {
    let font = font();
    let scale = scale_of(size);
    let scaled = font.as_scaled(scale);
    let mut x = start as f32;
    let mut former = None;
    let mut glyphs = Vec::new();
    for character in text.chars() {
        let id = font.glyph_id(character);
        if let Some(former) = former {
            x += scaled.kern(former, id);
        }
        glyphs.push(id.with_scale_and_position(scale, point(x, baseline as f32)));
        x += scaled.h_advance(id);
        former = Some(id);
    }
    glyphs
}

fn draw_glyph(glyph: Glyph, mut blend: impl FnMut(i64, i64, f64)) {
    if let Some(outline) = font().outline_glyph(glyph) {
        let corner = outline.px_bounds().min;
        let (left, top) = (corner.x as i64, corner.y as i64);
        outline.draw(|x, y, coverage| {
            blend(left + i64::from(x), top + i64::from(y), f64::from(coverage));
        });
    }
}

/// The pixels that `from..to` touches, within `0..limit`.
fn clipped(from: f64, to: f64, limit: usize) -> std::ops::Range<i64> {
    let limit = limit as f64;
    let start = from.floor().clamp(0.0, limit) as i64;
    let end = to.ceil().clamp(0.0, limit) as i64;
    start..end.max(start)
}

/// The part of pixel `i` that lies in `from..to`.
fn overlap(i: i64, from: f64, to: f64) -> f64 {
    let i = i as f64;
    (to.min(i + 1.0) - from.max(i)).clamp(0.0, 1.0)
}

/// Distance of a point to the straight piece from `a` to `b`.
fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let from = [p[0] - a[0], p[1] - a[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let t = if square > 0.0 { ((from[0] * along[0] + from[1] * along[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    (from[0] - t * along[0]).hypot(from[1] - t * along[1])
}

/// Smallest box around all pieces: left, top, right, bottom.
fn bounds_of(pieces: &[[[f64; 2]; 2]]) -> Option<[f64; 4]> {
    let mut bounds: Option<[f64; 4]> = None;
    for end in pieces.as_flattened() {
        let b = bounds.get_or_insert([end[0], end[1], end[0], end[1]]);
        *b = [b[0].min(end[0]), b[1].min(end[1]), b[2].max(end[0]), b[3].max(end[1])];
    }
    bounds
}

/// Most dashes of one line: more could not be told apart on any canvas.
const MOST_DASHES: usize = 100_000;

/// Cuts a polyline into dashes that run on around its corners.
fn dashes(points: &[[f64; 2]], pattern: [f64; 4]) -> Vec<[[f64; 2]; 2]> {
    // a curve of many points gives a piece for each, dashes apart
    let most = MOST_DASHES + points.len();
    let mut pieces = Vec::new();
    // dashes have even places
    let mut place = 0;
    let mut left = pattern[place];
    for pair in points.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        if !length.is_finite() || length == 0.0 {
            continue;
        }
        let at = |s: f64| {
            let t = s / length;
            [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
        };
        let mut s = 0.0;
        while s < length && pieces.len() < most {
            let end = (s + left).min(length);
            if place % 2 == 0 {
                pieces.push([at(s), at(end)]);
            }
            left -= end - s;
            s = end;
            // what is left may be too short to move on by
            if left <= 1e-6 {
                place = (place + 1) % 4;
                left = pattern[place];
            }
        }
    }
    pieces
}

/// Samples a pixel has in each direction of a [`Layer`].
pub const SAMPLES: usize = 3;

/// A finely sampled picture of cells with depth, laid onto a canvas as a whole.
///
/// Neighbouring cells share their edges without a seam, because each sample belongs to exactly
/// one of them; the edges become smooth when the samples are averaged.
#[derive(Debug)]
pub struct Layer {
    left: f64,
    top: f64,
    width: usize,
    height: usize,
    color: Vec<Rgb>,
    /// Depth toward the viewer; minus infinity where nothing was drawn.
    depth: Vec<f32>,
}

/// A parallelogram: middle, two half edges, in pixels of the canvas, with depth as third entry.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// The middle.
    pub center: [f64; 3],
    /// Half of the first edge.
    pub first: [f64; 3],
    /// Half of the second edge.
    pub second: [f64; 3],
}

impl Layer {
    /// An empty layer over `width × height` pixels with its corner at `(left, top)`.
    pub fn new(left: f64, top: f64, width: usize, height: usize) -> Self {
        let samples = width * height * SAMPLES * SAMPLES;
        Self {
            left: left.round(),
            top: top.round(),
            width: width * SAMPLES,
            height: height * SAMPLES,
            color: vec![WHITE; samples],
            depth: vec![f32::NEG_INFINITY; samples],
        }
    }

    /// Draws a cell over what lies deeper; at equal depth the later cell wins.
    ///
    /// `rim` darkens the outermost part of large cells, so that they can be told apart.
    pub fn cell(&mut self, cell: &Cell, color: Rgb, rim: bool) {
        let scale = SAMPLES as f64;
        let center = [(cell.center[0] - self.left) * scale, (cell.center[1] - self.top) * scale];
        let p = [cell.first[0] * scale, cell.first[1] * scale];
        let q = [cell.second[0] * scale, cell.second[1] * scale];
        let det = p[0] * q[1] - p[1] * q[0];
        let lengths = [p[0].hypot(p[1]), q[0].hypot(q[1])];
        // A cell seen edge-on has no area.
        if !det.is_finite() || det.abs() <= 1e-9 * lengths[0] * lengths[1] || det == 0.0 {
            return;
        }
        // Half distance of opposite edges, in samples.
        let across = [det.abs() / lengths[1], det.abs() / lengths[0]];
        // A tenth of a sample closes the cracks that rounding opens between neighbours.
        let limit = [1.0 + 0.1 / across[0], 1.0 + 0.1 / across[1]];
        let rim = rim && across[0].min(across[1]) > 3.0 * scale;
        let rim_color = color.map(|c| (f64::from(c) * 0.88).round() as u8);

        let reach = [p[0].abs() * limit[0] + q[0].abs() * limit[1], p[1].abs() * limit[0] + q[1].abs() * limit[1]];
        let columns = clipped(center[0] - reach[0], center[0] + reach[0], self.width);
        for y in clipped(center[1] - reach[1], center[1] + reach[1], self.height) {
            for x in columns.clone() {
                let d = [x as f64 + 0.5 - center[0], y as f64 + 0.5 - center[1]];
                let u = (d[0] * q[1] - d[1] * q[0]) / det;
                let v = (p[0] * d[1] - p[1] * d[0]) / det;
                if u.abs() > limit[0] || v.abs() > limit[1] {
                    continue;
                }
                let depth = (cell.center[2] + u * cell.first[2] + v * cell.second[2]) as f32;
                let index = y as usize * self.width + x as usize;
                if depth < self.depth[index] {
                    continue;
                }
                let to_edge = ((1.0 - u.abs()) * across[0]).min((1.0 - v.abs()) * across[1]);
                self.depth[index] = depth;
                self.color[index] = if rim && to_edge < 0.5 * scale { rim_color } else { color };
            }
        }
    }

    /// Draws a triangle over what lies deeper: corners in pixels of the canvas with depth, and their colours, blended between.
    pub fn triangle(&mut self, corners: &[[f64; 3]; 3], colors: &[[f64; 3]; 3]) {
        let scale = SAMPLES as f64;
        let at = corners.map(|c| [(c[0] - self.left) * scale, (c[1] - self.top) * scale]);
        let area = (at[1][0] - at[0][0]) * (at[2][1] - at[0][1]) - (at[1][1] - at[0][1]) * (at[2][0] - at[0][0]);
        if !area.is_finite() || area == 0.0 {
            return;
        }
        let range = |k: usize| at.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), c| (a.min(c[k]), b.max(c[k])));
        let (x, y) = (range(0), range(1));
        // a little beyond the edges, against cracks between neighbours
        let slack = -0.1 / area.abs().sqrt().max(1.0);
        for row in clipped(y.0, y.1, self.height) {
            for column in clipped(x.0, x.1, self.width) {
                let p = [column as f64 + 0.5, row as f64 + 0.5];
                let share = |a: [f64; 2], b: [f64; 2]| ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) / area;
                let w = [share(at[1], at[2]), share(at[2], at[0]), share(at[0], at[1])];
                if w.iter().any(|s| *s < slack) {
                    continue;
                }
                let blend = |v: [f64; 3]| (0..3).map(|k| w[k] * v[k]).sum::<f64>();
                let depth = blend(corners.map(|c| c[2])) as f32;
                let index = row as usize * self.width + column as usize;
                if depth < self.depth[index] {
                    continue;
                }
                self.depth[index] = depth;
                self.color[index] = std::array::from_fn(|k| blend(colors.map(|c| c[k])).round().clamp(0.0, 255.0) as u8);
            }
        }
    }

    /// Averages the samples onto the canvas.
    pub fn lay_on(&self, canvas: &mut Canvas) {
        for y in 0..self.height / SAMPLES {
            for x in 0..self.width / SAMPLES {
                let mut sum = [0_u32; 3];
                let mut drawn = 0;
                for j in 0..SAMPLES {
                    for i in 0..SAMPLES {
                        let index = (y * SAMPLES + j) * self.width + x * SAMPLES + i;
                        if self.depth[index] > f32::NEG_INFINITY {
                            drawn += 1;
                            for c in 0..3 {
                                sum[c] += u32::from(self.color[index][c]);
                            }
                        }
                    }
                }
                if drawn > 0 {
                    let mean = sum.map(|s| ((s + drawn / 2) / drawn) as u8);
                    let coverage = f64::from(drawn) / (SAMPLES * SAMPLES) as f64;
                    let column = self.left as i64 + x as i64;
                    canvas.blend(column, self.top as i64 + y as i64, mean, coverage);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_the_signs_of_engineering() {
        for character in "AZaz09 .,:;()[]/%+−×·°µ²³⁻⁰⁴⁹₀₉αβγδεθκλμνρσφωΔΣΩ…–∂∞≈≤≥".chars()
        {
            assert_ne!(font().glyph_id(character).0, 0, "{character}");
        }
    }

    #[test]
    fn a_rectangle_covers_the_part_of_each_pixel_it_overlaps() {
        let mut canvas = Canvas::new(4, 3);
        canvas.fill(1.0, 1.0, 2.5, 2.0, [0, 0, 0], 1.0);
        let row: Vec<u8> = (0..4).map(|x| canvas.pixel(x, 1).unwrap()[0]).collect();
        // Half covered: 255 / 2, rounded.
        assert_eq!(row, [255, 0, 128, 255]);
        assert_eq!(canvas.pixel(1, 0), Some(WHITE));
        assert_eq!(canvas.pixel(4, 0), None);
    }

    #[test]
    fn a_line_has_its_width_and_stays_smooth_where_pieces_meet() {
        let draw = |pieces: usize| {
            let mut canvas = Canvas::new(60, 20);
            let at = |i| [5.0 + 50.0 * i as f64 / pieces as f64, 10.3];
            let points: Vec<[f64; 2]> = (0..=pieces).map(at).collect();
            canvas.polyline(&points, 3.0, [0, 0, 0], None);
            canvas
        };
        assert_eq!(draw(1), draw(500));
        let canvas = draw(1);
        let darkness: f64 = (0..20).map(|y| 1.0 - f64::from(canvas.pixel(30, y).unwrap()[0]) / 255.0).sum();
        assert!((darkness - 3.0).abs() < 0.01, "{darkness}");
    }

    #[test]
    fn dashes_have_their_lengths_around_corners() {
        let pieces = dashes(&[[0.0, 0.0], [5.0, 0.0], [5.0, 5.0]], [3.0, 1.0, 3.0, 1.0]);
        let expected = [[[0.0, 0.0], [3.0, 0.0]], [[4.0, 0.0], [5.0, 0.0]], [[5.0, 0.0], [5.0, 2.0]], [[5.0, 3.0], [5.0, 5.0]]];
        assert_eq!(pieces, expected);
    }

    #[test]
    fn neighbouring_cells_leave_no_seam_and_the_nearer_one_wins() {
        let mut layer = Layer::new(0.0, 0.0, 20, 10);
        let half = 10.0 / 3.0;
        let cell = |x: f64, depth: f64| Cell { center: [x, 5.0, depth], first: [half, 0.0, 0.0], second: [0.0, 5.0, 0.0] };
        for i in 0..3 {
            layer.cell(&cell(half * (2 * i + 1) as f64, 0.0), [10, 20, 30], false);
        }
        layer.cell(&cell(10.0, -1.0), [200, 0, 0], false);
        let mut canvas = Canvas::new(20, 10);
        layer.lay_on(&mut canvas);
        assert!(canvas.pixels.iter().all(|&pixel| pixel == [10, 20, 30]));
    }

    #[test]
    fn text_is_as_wide_as_measured() {
        let mut canvas = Canvas::new(400, 60);
        canvas.text([50.0, 30.0], "HHHH", 40.0, [0, 0, 0], Align::Left);
        let inked = |x: usize| (0..60).any(|y| canvas.pixel(x, y) != Some(WHITE));
        let first = (0..400).find(|&x| inked(x)).unwrap() as f64;
        let last = (0..400).rfind(|&x| inked(x)).unwrap() as f64;
        let width = text_width("HHHH", 40.0);
        // The letter has a margin of about a tenth of an em on each side.
        assert!((50.0..56.0).contains(&first), "{first}");
        assert!(last < 50.0 + width && last > 50.0 + width - 7.0, "{last}");
        assert!((fitting_size("HHHH", 40.0, 0.5 * width) - 20.0).abs() < 1e-3);
    }
}
