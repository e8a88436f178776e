//! Pictures of a field for several runs, side by side with one colour bar.

use std::io::{self, Write};
use std::path::Path;

use super::canvas::{Align, Canvas, INK, SOFT_INK, fitting_size};
use super::picture::{self, Body, Deformation, Options, Range, Shown, bar_width, color_bar};
use super::plot::{TICK_SIZE, TITLE_SIZE, with_unit};
use super::table::quoted;
use super::ticks::{self, number};
use super::{OutputError, write_whole};

/// One picture of a figure.
#[derive(Debug, Clone, Copy)]
pub struct Panel<'a> {
    /// Its title.
    pub title: &'a str,
    /// The points.
    pub body: Body<'a>,
    /// One value a point.
    pub values: &'a [f64],
}

/// The same picture of a field for several runs.
#[derive(Debug, Clone)]
pub struct SideBySide<'a> {
    /// Title of the whole.
    pub title: String,
    /// Name of the field, at the colour bar.
    pub name: String,
    /// Its unit.
    pub unit: Option<String>,
    /// The pictures, in reading order.
    pub panels: Vec<Panel<'a>>,
    /// Pictures in a row; chosen by their shape if not given.
    pub columns: Option<usize>,
    /// Colours, ends of the colour bar, magnification and view, the same for all; other options are not looked at.
    pub options: Options,
}

/// Largest size of one picture, in pixels: two in a row are as wide as a page.
const PANEL: [usize; 2] = [800, 640];
// Room around the pictures.
const TOP: usize = 104;
const EDGE: usize = 24;
/// Least width of one picture.
const SMALLEST: usize = 420;
/// Height over width that the whole should have.
const SHAPE: f64 = 0.62;

fn largest(all: &[Canvas]) -> [usize; 2] {
    [all.iter().map(Canvas::width).max().unwrap_or(0), all.iter().map(Canvas::height).max().unwrap_or(0)]
}

impl SideBySide<'_> {
    /// Ends of the colours, from all values.
    fn range(&self) -> (f64, f64) {
        let finite = || self.panels.iter().flat_map(|panel| panel.values).copied().filter(|v| v.is_finite());
        let min = finite().fold(f64::INFINITY, f64::min);
        let max = finite().fold(f64::NEG_INFINITY, f64::max);
        match self.options.range {
            Range::Fixed { min, max } => (min, max),
            Range::Auto => ticks::open_range(min, max),
            Range::Symmetric => {
                let most = min.abs().max(max.abs());
                let most = if most.is_finite() && most > 0.0 { most } else { 1.0 };
                (-most, most)
            }
        }
    }

    /// The magnification that suits all: the smallest of those that suit each.
    fn factor(&self) -> f64 {
        match self.options.deformation {
            Deformation::Factor(factor) => factor,
            Deformation::Auto => {
                let all = self.panels.iter().filter_map(|panel| picture::automatic_factor(&panel.body));
                let least = all.fold(f64::INFINITY, f64::min);
                if least.is_finite() { least } else { 1.0 }
            }
        }
    }

    /// Draws all pictures.
    ///
    /// # Errors
    /// [`OutputError::Drawing`] if there is no picture, or one of them cannot be drawn.
    pub fn draw(&self) -> Result<Canvas, OutputError> {
        if self.panels.is_empty() {
            let reason = "there is no run to show".to_string();
            return Err(OutputError::Drawing { what: format!("the figure `{}`", self.title), reason });
        }
        let (range, factor) = (self.range(), self.factor());
        let mut drawn = self.panels(PANEL, range, factor)?;
        let mut cell = largest(&drawn);
        // bodies in one dimension show their values on the axis: colours need no bar there
        let bar = if self.panels.iter().all(|panel| panel.body.dimension == 1) { 0.0 } else { bar_width(range) };
        let count = drawn.len();
        let size = |cell: [usize; 2], columns: usize| {
            let rows = count.div_ceil(columns);
            (2.0 * EDGE as f64 + (columns * cell[0]) as f64 + bar, (TOP + EDGE + rows * cell[1]) as f64)
        };
        let misfit = |columns: usize| {
            let (width, height) = size(cell, columns);
            // a picture that is alone in the last row leaves a hole
            let holes = columns * count.div_ceil(columns) - count;
            (height / (SHAPE * width)).ln().abs() + 0.2 * holes as f64
        };
        let columns = self.columns.map_or_else(
            || (1..=count.min(4)).min_by(|&a, &b| misfit(a).total_cmp(&misfit(b))).unwrap_or(1),
            |columns| columns.clamp(1, count),
        );
        if columns > 2 {
            // letters keep their size and must stay readable where the whole is as wide as a page
            drawn = self.panels([(2 * PANEL[0] / columns).max(SMALLEST), PANEL[1]], range, factor)?;
            cell = largest(&drawn);
        }
        let (width, height) = size(cell, columns);
        let mut canvas = Canvas::new(width.ceil() as usize, height.ceil() as usize);
        for (k, panel) in drawn.iter().enumerate() {
            canvas.paste(panel, EDGE + k % columns * cell[0], TOP + k / columns * cell[1]);
        }
        let room = width - 4.0 * EDGE as f64;
        let left = 2.0 * EDGE as f64;
        canvas.text([left, 40.0], &self.title, fitting_size(&self.title, 1.1 * TITLE_SIZE, room), INK, Align::Left);
        let caption = match factor {
            1.0 => String::new(),
            0.0 => "reference shape".into(),
            _ => format!("displacements × {}", number(factor, 3)),
        };
        let caption = match &self.options.caption {
            Some(own) if caption.is_empty() => own.clone(),
            Some(own) => format!("{own}, {caption}"),
            None => caption,
        };
        canvas.text([left, 80.0], &caption, fitting_size(&caption, TICK_SIZE, room), SOFT_INK, Align::Left);
        if bar > 0.0 {
            // as high as the pictures, but no higher than is useful
            let (top, bottom) = (TOP as f64 + 90.0, height - EDGE as f64 - 90.0);
            let spare = (0.5 * (bottom - top) - 400.0).max(0.0);
            let heading = with_unit(&self.name, self.unit.as_deref());
            color_bar(&mut canvas, [width - bar, top + spare, bottom - spare], self.options.colors, range, &heading);
        }
        Ok(canvas)
    }

    /// The pictures, none larger than `most`.
    fn panels(&self, most: [usize; 2], range: (f64, f64), factor: f64) -> Result<Vec<Canvas>, OutputError> {
        let options = Options {
            caption: None,
            range: Range::Fixed { min: range.0, max: range.1 },
            deformation: Deformation::Factor(factor),
            width: most[0],
            height: most[1],
            bar: false,
            ..self.options.clone()
        };
        let draw = |panel: &Panel<'_>| {
            let shown = Shown { name: &self.name, unit: self.unit.as_deref(), values: panel.values };
            let options = Options { title: Some(panel.title.to_string()), ..options.clone() };
            picture::draw(&panel.body, &shown, &options).map(|picture| picture.canvas)
        };
        self.panels.iter().map(draw).collect()
    }

    /// Draws all pictures into a PNG file.
    ///
    /// # Errors
    /// Those of [`SideBySide::draw`], [`OutputError::Encode`], [`OutputError::Io`].
    pub fn write_png(&self, path: &Path) -> Result<(), OutputError> {
        self.draw()?.write(path)
    }

    /// Writes the values as CSV, one row a point of each picture: `run,x,y,z` and the field.
    ///
    /// # Errors
    /// [`OutputError::Io`].
    pub fn write_csv(&self, path: &Path) -> Result<(), OutputError> {
        write_whole(path, |file| -> io::Result<()> {
            writeln!(file, "run,x,y,z,{}", quoted(&with_unit(&self.name, self.unit.as_deref())))?;
            for panel in &self.panels {
                let title = quoted(panel.title);
                for (x, value) in panel.body.reference.iter().zip(panel.values) {
                    writeln!(file, "{title},{:?},{:?},{:?},{value:?}", x[0], x[1], x[2])?;
                }
            }
            Ok(())
        })
    }
}
