//! Pictures and plots: sizes, and colours at known places.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use peridyne::output::OutputError;
use peridyne::output::canvas::{Canvas, INK, Rgb, WHITE};
use peridyne::output::color::{CURVES, ColorMap, NO_VALUE};
use peridyne::output::picture::{Body, Deformation, Options, Picture, Range, Shown, View, draw};
use peridyne::output::plot::{Axis, Curve, Plot, ReferenceLine, Style};

/// Both ends of viridis, from its published table.
const LOW: Rgb = [0x44, 0x01, 0x54];
const HIGH: Rgb = [0xfd, 0xe7, 0x25];

struct Image {
    width: usize,
    height: usize,
    bytes: Vec<u8>,
}

impl Image {
    fn read(path: &Path) -> Self {
        let file = BufReader::new(File::open(path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!(info.color_type, png::ColorType::Rgb);
        Self { width: info.width as usize, height: info.height as usize, bytes }
    }

    fn pixel(&self, (x, y): (usize, usize)) -> Rgb {
        let start = 3 * (y * self.width + x);
        [0, 1, 2].map(|c| self.bytes[start + c])
    }
}

/// A grid of `nx × ny × nz` points, middles of cells of edge `dx`.
fn grid(nx: usize, ny: usize, nz: usize, dx: f64) -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                points.push([i, j, k].map(|n| (n as f64 + 0.5) * dx));
            }
        }
    }
    points
}

fn scalar<'a>(values: &'a [f64]) -> Shown<'a> {
    Shown { name: "value", unit: Some("m"), values }
}

fn flat(mut points: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    for point in &mut points {
        point[2] = 0.0;
    }
    points
}

fn background(color: Rgb) -> bool {
    // White or a grid line: light and without hue.
    color.iter().all(|&c| c >= 220)
}

fn draw_plane(reference: &[[f64; 3]], displacement: &[[f64; 3]], dx: f64, values: &[f64], options: &Options) -> Picture {
    let edge = vec![dx; reference.len()];
    let body = Body { dimension: 2, reference, displacement, edge: &edge };
    draw(&body, &scalar(values), options).unwrap()
}

#[test]
fn two_values_show_the_two_ends_of_the_map_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.png");
    let reference = flat(grid(40, 20, 1, 0.1));
    let still = vec![[0.0; 3]; reference.len()];
    let values: Vec<f64> = reference.iter().map(|x| if x[0] < 2.0 { -7.0 } else { 3.0 }).collect();
    let picture = draw_plane(&reference, &still, 0.1, &values, &Options::default());
    picture.write(&path).unwrap();
    let image = Image::read(&path);
    assert_eq!(image.width, 1600);
    // A body twice as wide as high takes about half the height, and room for the text.
    assert!((700..900).contains(&image.height), "{}", image.height);
    for (x, value) in reference.iter().zip(&values) {
        let expected = if *value < 0.0 { LOW } else { HIGH };
        assert_eq!(image.pixel(picture.locate(*x).unwrap()), expected, "{x:?}");
    }
    // Outside of the body nothing is drawn.
    assert!(background(image.pixel(picture.locate([-0.03, 1.0, 0.0]).unwrap())));
    // One length is equally long in both directions.
    let [a, b, c] = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]].map(|x| picture.locate(x).unwrap());
    assert!((b.0 - a.0).abs_diff(a.1 - c.1) <= 1);
    assert_eq!((a.1, a.0), (b.1, c.0));
}

#[test]
fn a_beam_keeps_its_thickness_where_it_turns() {
    // a row of cells along x, stretched by a half and turned by the angle
    for angle in [0.0f64, 0.7, 1.6, 2.5] {
        let (sin, cos) = angle.sin_cos();
        let reference: Vec<[f64; 3]> = (0..20).map(|i| [i as f64, 0.0, 0.0]).collect();
        let displacement: Vec<[f64; 3]> = reference.iter().map(|x| [1.5 * cos * x[0] - x[0], 1.5 * sin * x[0], 0.0]).collect();
        let options = Options { deformation: Deformation::Factor(1.0), range: Range::Fixed { min: 0.0, max: 1.0 }, ..Options::default() };
        let picture = draw_plane(&reference, &displacement, 1.0, &[1.0; 20], &options);
        let folder = tempfile::tempdir().unwrap();
        picture.write(&folder.path().join("beam.png")).unwrap();
        let image = Image::read(&folder.path().join("beam.png"));
        for (along, across, inside) in [(14.2, 0.4, true), (14.9, -0.4, true), (14.2, 0.8, false), (14.2, -0.8, false)] {
            let place = [along * cos - across * sin, along * sin + across * cos, 0.0];
            let color = image.pixel(picture.locate(place).unwrap());
            assert_eq!(color == HIGH, inside, "{angle} {place:?} {color:?}");
        }
    }
}

#[test]
fn a_magnified_even_deformation_leaves_no_gap() {
    let reference = flat(grid(30, 30, 1, 1.0));
    // u = H x with a stretch of 60 % and a shear of 30 % after magnification.
    let h = [[0.6e-3, 0.3e-3], [0.0, -0.2e-3]];
    let u = |x: &[f64; 3]| [h[0][0] * x[0] + h[0][1] * x[1], h[1][0] * x[0] + h[1][1] * x[1], 0.0];
    let displacement: Vec<[f64; 3]> = reference.iter().map(u).collect();
    let values = vec![1.0; reference.len()];
    let options = Options { deformation: Deformation::Factor(1000.0), range: Range::Fixed { min: 0.0, max: 1.0 }, ..Options::default() };
    let picture = draw_plane(&reference, &displacement, 1.0, &values, &options);
    // Places all over the deformed body, off the middles of the cells.
    for i in 1..300 {
        for j in 1..300 {
            let x = [i as f64 * 0.1, j as f64 * 0.1, 0.0];
            let y = std::array::from_fn(|k| x[k] + 1000.0 * u(&x)[k]);
            // Pixels on the rim are half covered.
            if i > 2 && j > 2 && i < 298 && j < 298 {
                let (column, row) = picture.locate(y).unwrap();
                assert_eq!(picture.canvas.pixel(column, row), Some(HIGH), "{x:?}");
            }
        }
    }
}

#[test]
fn a_crack_stays_open() {
    let reference = flat(grid(30, 30, 1, 1.0));
    let open = |x: &[f64; 3]| [0.0, if x[1] > 15.0 { 0.5 } else { -0.5 }, 0.0];
    let displacement: Vec<[f64; 3]> = reference.iter().map(open).collect();
    let values = vec![1.0; reference.len()];
    let options = Options { range: Range::Fixed { min: 0.0, max: 1.0 }, ..Options::default() };
    let picture = draw_plane(&reference, &displacement, 1.0, &values, &options);
    let at = |y: f64| {
        let (column, row) = picture.locate([7.3, y, 0.0]).unwrap();
        picture.canvas.pixel(column, row).unwrap()
    };
    // The gap is one edge wide, from 14.5 to 15.5; the cells at its faces keep their size.
    for y in [14.6, 15.0, 15.4] {
        assert!(background(at(y)), "{y}: {:?}", at(y));
    }
    for y in [13.6, 14.4, 15.6, 16.4] {
        assert_eq!(at(y), HIGH, "{y}");
    }
}

#[test]
fn units_do_not_change_the_picture() {
    let colors = |scale: f64| {
        let dx = 0.1 * scale;
        let reference = flat(grid(20, 10, 1, dx));
        let displacement: Vec<[f64; 3]> = reference.iter().map(|x| [0.01 * x[1], 0.02 * x[0], 0.0]).collect();
        let values: Vec<f64> = reference.iter().map(|x| x[0] + x[1]).collect();
        let options = Options { deformation: Deformation::Factor(10.0), width: 1200, ..Options::default() };
        let picture = draw_plane(&reference, &displacement, dx, &values, &options);
        let place = |(x, u): (&[f64; 3], &[f64; 3])| {
            let y = std::array::from_fn(|k| x[k] + 10.0 * u[k]);
            let (column, row) = picture.locate(y).unwrap();
            picture.canvas.pixel(column, row).unwrap()
        };
        reference.iter().zip(&displacement).map(place).collect::<Vec<_>>()
    };
    let plain = colors(1.0);
    assert_eq!(plain[0], LOW);
    assert_eq!(plain[199], HIGH);
    // Powers of two change no digit.
    assert_eq!(plain, colors(2.0_f64.powi(-120)));
    assert_eq!(plain, colors(2.0_f64.powi(120)));
}

#[test]
fn points_without_a_value_are_grey_and_points_without_a_place_are_left_out() {
    let mut reference = flat(grid(5, 5, 1, 1.0));
    let still = vec![[0.0; 3]; 25];
    let mut values: Vec<f64> = (0..25).map(f64::from).collect();
    values[12] = f64::NAN;
    values[13] = f64::INFINITY;
    reference[18][1] = f64::NAN;
    let picture = draw_plane(&reference, &still, 1.0, &values, &Options::default());
    let at = |x, y| {
        let (column, row) = picture.locate([x, y, 0.0]).unwrap();
        picture.canvas.pixel(column, row).unwrap()
    };
    assert_eq!(at(2.4, 2.4), NO_VALUE);
    assert_eq!(at(3.4, 2.4), NO_VALUE);
    assert!(background(at(3.4, 3.4)));
    assert_eq!(at(0.4, 0.4), LOW);
    assert_eq!(at(4.4, 4.4), HIGH);
}

#[test]
fn in_space_the_nearer_block_hides_the_farther() {
    let reference = grid(6, 6, 6, 0.5);
    let still = vec![[0.0; 3]; reference.len()];
    let edge = vec![0.5; reference.len()];
    // The layer at the top has the other value.
    let values: Vec<f64> = reference.iter().map(|x| f64::from(u8::from(x[2] > 2.5))).collect();
    let body = Body { dimension: 3, reference: &reference, displacement: &still, edge: &edge };
    // Shading scales all channels alike: their ratios tell the colour.
    let is = |found: Rgb, expected: Rgb| {
        let factor = f64::from(found[0]) / f64::from(expected[0]);
        (0.7..=1.0).contains(&factor) && (0..3).all(|c| (f64::from(found[c]) - factor * f64::from(expected[c])).abs() < 4.0)
    };
    for (elevation, expected) in [(90.0, HIGH), (-90.0, LOW), (40.0, HIGH), (-40.0, LOW)] {
        let options = Options { view: View { azimuth: 25.0, elevation }, ..Options::default() };
        let picture = draw(&body, &scalar(&values), &options).unwrap();
        // Middle of the top or bottom of the body, off the rims of the blocks.
        let z = if elevation > 0.0 { 3.0 } else { 0.0 };
        let (column, row) = picture.locate([1.75, 1.75, z]).unwrap();
        let found = picture.canvas.pixel(column, row).unwrap();
        assert!(is(found, expected), "{elevation}: {found:?}");
    }
}

#[test]
fn a_bar_shows_its_field_as_curve_and_strip() {
    let reference: Vec<[f64; 3]> = (0..50).map(|i| [i as f64 + 0.5, 0.0, 0.0]).collect();
    let still = vec![[0.0; 3]; 50];
    let edge = vec![1.0; 50];
    let values: Vec<f64> = (0..50).map(|i| if i < 25 { 0.0 } else { 1.0 }).collect();
    let body = Body { dimension: 1, reference: &reference, displacement: &still, edge: &edge };
    let picture = draw(&body, &scalar(&values), &Options::default()).unwrap();
    let canvas = &picture.canvas;
    assert_eq!((canvas.width(), canvas.height()), (1600, 1000));
    for (x, value) in reference.iter().zip(&values) {
        let (column, row) = picture.locate(*x).unwrap();
        let expected = if *value < 0.5 { LOW } else { HIGH };
        assert_eq!(canvas.pixel(column, row), Some(expected));
    }
    assert!(count(canvas, CURVES[0]) > 1000);
}

#[test]
fn impossible_pictures_are_refused() {
    let reference = flat(grid(3, 3, 1, 1.0));
    let still = vec![[0.0; 3]; 9];
    let edge = vec![1.0; 9];
    let values = vec![0.0; 9];
    let body = Body { dimension: 2, reference: &reference, displacement: &still, edge: &edge };
    let plain = Options::default();
    let refused = |body: &Body, values: &[f64], options: &Options, words: &str| {
        let error = draw(body, &scalar(values), options).unwrap_err();
        assert!(matches!(error, OutputError::Drawing { .. }));
        let text = error.to_string();
        assert!(text.contains(words) && text.contains("`value`"), "{text}");
    };
    refused(&body, &values[1..], &plain, "8 values for 9 points");
    let dimension = Body { dimension: 4, ..body };
    refused(&dimension, &values, &plain, "dimension is 4");
    let nowhere = vec![[f64::NAN; 3]; 9];
    let lost = Body { reference: &nowhere, ..body };
    refused(&lost, &values, &plain, "no point has a finite position");
    let none = Body { dimension: 2, reference: &[], displacement: &[], edge: &[] };
    refused(&none, &[], &plain, "no point");
    let range = Options { range: Range::Fixed { min: 1.0, max: 1.0 }, ..plain.clone() };
    refused(&body, &values, &range, "from 1 to 1");
    let tiny = Options { width: 20, ..plain.clone() };
    refused(&body, &values, &tiny, "20 × 1000 pixels");
    let turned = Options { deformation: Deformation::Factor(f64::INFINITY), ..plain };
    refused(&body, &values, &turned, "magnification is inf");
}

fn count(canvas: &Canvas, color: Rgb) -> usize {
    places(canvas, color).len()
}

fn places(canvas: &Canvas, color: Rgb) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for y in 0..canvas.height() {
        for x in 0..canvas.width() {
            if canvas.pixel(x, y) == Some(color) {
                found.push((x, y));
            }
        }
    }
    found
}

#[test]
fn a_curve_is_where_its_axes_say() {
    let plot = Plot::new("", Axis::new("x").range(0.0, 4.0), Axis::new("y").range(0.0, 10.0))
        .curve(Curve::new("", vec![[1.0, 5.0], [2.0, 5.0], [f64::NAN, 5.0], [3.0, 5.0], [9.0, 5.0]]));
    let canvas = plot.draw().unwrap();
    assert_eq!((canvas.width(), canvas.height()), (1600, 1000));
    // The frame: columns and rows that are dark along most of their length.
    let dark_column = |x: &usize| (0..1000).filter(|&y| canvas.pixel(*x, y) == Some(INK)).count() > 500;
    let dark_row = |y: &usize| (0..1600).filter(|&x| canvas.pixel(x, *y) == Some(INK)).count() > 800;
    let columns: Vec<usize> = (0..1600).filter(dark_column).collect();
    let rows: Vec<usize> = (0..1000).filter(dark_row).collect();
    let (left, right) = (columns[1] as f64 + 1.0, columns[2] as f64);
    let (top, bottom) = (rows[1] as f64 + 1.0, rows[2] as f64);
    let unit = (right - left) / 4.0;

    let curve = places(&canvas, CURVES[0]);
    let middle = 0.5 * (top + bottom);
    assert!(curve.iter().all(|p| (p.1 as f64 + 0.5 - middle).abs() < 2.0));
    let has = |x: f64| curve.iter().any(|p| p.0 == (left + x * unit) as usize);
    assert!(has(1.02) && has(1.5) && has(1.98));
    assert!(!has(0.95) && !has(2.5));
    // A single point between gaps has no line; the piece that leaves the frame is cut there.
    assert!(has(3.02) && has(3.98) && !curve.iter().any(|p| p.0 as f64 > right + 2.0));
}

#[test]
fn logarithmic_axes_space_decades_evenly_and_leave_out_what_is_not_positive() {
    let points = vec![[1.0, 1e-3], [10.0, 1e-5], [100.0, 1e-7], [0.0, 1e-5], [10.0, -1.0]];
    let plot =
        Plot::new("order", Axis::new("x").logarithmic(), Axis::new("y").logarithmic()).curve(Curve::new("", points).style(Style::Markers));
    let marks = places(&plot.draw().unwrap(), CURVES[0]);
    // Markers are discs: their middles are the means of three well separated groups.
    let mean = |from: f64, to: f64, axis: fn(&(usize, usize)) -> f64| {
        let group: Vec<f64> = marks.iter().filter(|p| (p.0 as f64) >= from && (p.0 as f64) < to).map(axis).collect();
        assert!(group.len() > 60);
        group.iter().sum::<f64>() / group.len() as f64
    };
    let third = 1600.0 / 3.0;
    let x: Vec<f64> = (0..3).map(|i| mean(i as f64 * third, (i + 1) as f64 * third, |p| p.0 as f64)).collect();
    let y: Vec<f64> = (0..3).map(|i| mean(i as f64 * third, (i + 1) as f64 * third, |p| p.1 as f64)).collect();
    assert!((x[2] - 2.0 * x[1] + x[0]).abs() < 1.0, "{x:?}");
    assert!((y[2] - 2.0 * y[1] + y[0]).abs() < 1.0, "{y:?}");
    assert!(y[2] - y[0] > 500.0);
}

#[test]
fn a_plot_writes_its_points_and_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let plot = Plot::new("t", Axis::new("time").unit("s"), Axis::new("force, total").unit("N"))
        .curve(Curve::new("a", vec![[0.1, 1.0 / 3.0], [0.2, -1e-300]]))
        .curve(Curve::new("b", vec![[0.3, 2.0]]).style(Style::LineAndMarkers))
        .curve(Curve::new("exact", vec![[0.0, 0.0], [0.3, 1.0]]).style(Style::Dashed))
        .reference(ReferenceLine::Horizontal { y: 1.5, label: "limit".into() })
        .reference(ReferenceLine::Vertical { x: 0.25, label: "end".into() });
    let table = folder.path().join("plot.csv");
    plot.write_csv(&table).unwrap();
    let mut reader = csv::Reader::from_path(&table).unwrap();
    let header: Vec<&str> = reader.headers().unwrap().iter().collect();
    assert_eq!(header, ["curve", "time (s)", "force, total (N)"]);
    let rows: Vec<(String, f64, f64)> = reader.deserialize().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 5);
    assert_eq!(rows[0], ("a".to_string(), 0.1, 1.0 / 3.0));
    assert_eq!(rows[1], ("a".to_string(), 0.2, -1e-300));
    assert_eq!(rows[4], ("exact".to_string(), 0.3, 1.0));

    let picture = folder.path().join("plot.png");
    plot.write_png(&picture).unwrap();
    let image = Image::read(&picture);
    assert_eq!((image.width, image.height), (1600, 1000));
    assert_eq!(image.pixel((0, 0)), WHITE);
}

#[test]
fn impossible_plots_are_refused() {
    let empty = Plot::new("empty", Axis::new("x"), Axis::new("y").logarithmic()).curve(Curve::new("a", vec![[0.0, -1.0], [f64::NAN, 1.0]]));
    let text = empty.draw().unwrap_err().to_string();
    assert!(text.contains("`empty`") && text.contains("no curve has a point"), "{text}");
    let point = Curve::new("a", vec![[1.0, 1.0]]);
    let reversed = Plot::new("p", Axis::new("x").range(2.0, 1.0), Axis::new("y"));
    let text = reversed.curve(point.clone()).draw().unwrap_err().to_string();
    assert!(text.contains("`x` cannot run from 2 to 1"), "{text}");
    let zero = Plot::new("p", Axis::new("x").logarithmic().range(0.0, 1.0), Axis::new("y"));
    assert!(zero.curve(point.clone()).draw().is_err());
    // A single point is enough, on any axes.
    let single = Plot::new("p", Axis::new("x").logarithmic(), Axis::new("y"));
    assert!(single.curve(point).draw().is_ok());
}

#[test]
fn colors_beyond_a_fixed_range_are_those_of_its_ends() {
    let reference = flat(grid(4, 4, 1, 1.0));
    let still = vec![[0.0; 3]; 16];
    let values: Vec<f64> = (0..16).map(|i| if i % 4 < 2 { -50.0 } else { 50.0 }).collect();
    let options = Options { colors: ColorMap::Diverging, range: Range::Fixed { min: -1.0, max: 1.0 }, ..Options::default() };
    let picture = draw_plane(&reference, &still, 1.0, &values, &options);
    let at = |x| {
        let (column, row) = picture.locate([x, 1.4, 0.0]).unwrap();
        picture.canvas.pixel(column, row).unwrap()
    };
    // Blue on one side, red on the other.
    assert!(at(0.4)[2] > 2 * at(0.4)[0] && at(3.4)[0] > 2 * at(3.4)[2]);
}

#[test]
fn patterns_can_be_told_apart_without_colour() {
    let level = |k: u8| Curve::new("", vec![[0.0, f64::from(k)], [1.0, f64::from(k)]]).style(Style::Pattern(k));
    let plot = (0..4).fold(Plot::new("patterns", Axis::new("x"), Axis::new("y")), |plot, k| plot.curve(level(k)));
    let canvas = plot.draw().unwrap();
    // the number of pieces over the length of the frame, from the lengths of dashes and gaps: 30, 11, and 39 pixels for two
    let pieces = |color: Rgb| {
        let marks = places(&canvas, color);
        let row = marks.iter().map(|p| p.1).max_by_key(|y| marks.iter().filter(|p| p.1 == *y).count()).unwrap();
        let mut columns: Vec<usize> = marks.iter().filter(|p| p.1 == row).map(|p| p.0).collect();
        columns.sort_unstable();
        let length = (columns[columns.len() - 1] - columns[0]) as f64;
        (1 + columns.windows(2).filter(|w| w[1] > w[0] + 2).count(), length)
    };
    for (k, per_pixel) in [(0, 0.0), (1, 1.0 / 30.0), (2, 1.0 / 11.0), (3, 2.0 / 39.0)] {
        let (count, length) = pieces(CURVES[k]);
        assert!((count as f64 - (1.0_f64).max(length * per_pixel)).abs() <= 2.0, "{k}: {count} over {length}");
    }
}

#[test]
fn a_slope_is_shown_beside_the_curves() {
    let points: Vec<[f64; 2]> = (0..5).map(|i| 10.0_f64.powf(-0.5 * f64::from(i))).map(|x| [x, x * x]).collect();
    let bare = Plot::new("order", Axis::new("x").logarithmic(), Axis::new("y").logarithmic())
        .curve(Curve::new("error", points).style(Style::LineAndMarkers));
    let mut with = bare.clone();
    with.slopes = vec![2.0];
    let (bare, with) = (bare.draw().unwrap(), with.draw().unwrap());
    // none of the curve is hidden, and something dark has come
    assert_eq!(places(&bare, CURVES[0]), places(&with, CURVES[0]));
    let new: Vec<(usize, usize)> = places(&with, INK).into_iter().filter(|p| bare.pixel(p.0, p.1) != Some(INK)).collect();
    // its hypotenuse is parallel to the curve: the triangle's height over width is that of the curve
    let span = |all: &[(usize, usize)], axis: fn(&(usize, usize)) -> usize| {
        (all.iter().map(axis).max().unwrap() - all.iter().map(axis).min().unwrap()) as f64
    };
    let curve = places(&bare, CURVES[0]);
    let (left, right) = (new.iter().map(|p| p.0).min().unwrap(), new.iter().map(|p| p.0).max().unwrap());
    assert!(right > left);
    // legs: the longest row and column of new dark pixels
    let longest = |axis: fn(&(usize, usize)) -> usize| {
        let mut counts = std::collections::BTreeMap::new();
        new.iter().for_each(|p| *counts.entry(axis(p)).or_insert(0) += 1);
        f64::from(*counts.values().max().unwrap())
    };
    let (width, height) = (longest(|p| p.1), longest(|p| p.0));
    let expected = span(&curve, |p| p.1) / span(&curve, |p| p.0);
    assert!((height / width / expected - 1.0).abs() < 0.04, "{height} / {width}, {expected}");
}
