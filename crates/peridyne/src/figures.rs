//! The figures of a study: from what its runs left to curves and pictures.

use crate::deck::{
    Auto, CurveStyle, Deck, DeckErrors, FieldsFigure, Figure, FigureCurve, Issue, LinesFigure, LogAxes, Moment, ParameterValue, Text,
    placeholders,
};
use crate::output::OutputError;
use crate::output::color::ColorMap;
use crate::output::figure::{Panel, SideBySide};
use crate::output::picture::{Body, Deformation, Options, Range, View};
use crate::output::plot::{Axis, Curve, Legend, Plot, Style};
use crate::output::ticks::number;
use crate::reference::Table;
use crate::run::{Wanted, along};
use crate::study::{Made, groups};
use std::path::Path;

/// Points that an expression is drawn through.
const SAMPLES: usize = 400;
/// A file with more rows is drawn as a line, not as markers.
const MOST_MARKERS: usize = 80;

fn time_of(moment: &Moment) -> Option<f64> {
    match moment {
        Moment::At(time) => Some(time.value),
        Moment::End | Moment::All => None,
    }
}

fn drawn(curve: &FigureCurve, name: &str) -> bool {
    curve.runs.as_ref().is_none_or(|runs| runs.holds(name))
}

/// The fields that the figures of a deck need of the combination `name`.
pub(crate) fn wanted(deck: &Deck, name: &str) -> Vec<Wanted> {
    let mut all: Vec<Wanted> = vec![];
    let mut add = |wanted: Wanted| {
        if !all.iter().any(|w| w.field.to_string() == wanted.field.to_string() && w.time == wanted.time) {
            all.push(wanted);
        }
    };
    for figure in &deck.figures {
        match figure {
            Figure::Lines(lines) => {
                for curve in lines.curves.iter().filter(|curve| drawn(curve, name)) {
                    if let Some(field) = &curve.field {
                        add(Wanted { field: field.clone(), time: time_of(&curve.time) });
                    }
                }
            }
            Figure::Fields(fields) if fields.runs.holds(name) => {
                add(Wanted { field: fields.field.clone(), time: time_of(&fields.time) });
            }
            Figure::Fields(_) => {}
        }
    }
    all
}

/// The quantities that are drawn.
pub(crate) fn quantities(deck: &Deck) -> impl Iterator<Item = &Text> {
    let curves = deck.figures.iter().flat_map(|figure| match figure {
        Figure::Lines(lines) => &lines.curves[..],
        Figure::Fields(_) => &[],
    });
    curves.filter_map(|curve| curve.quantity.as_ref())
}

/// Reads all files of reference curves before anything is run.
///
/// # Errors
/// What is wrong with them.
pub(crate) fn check(deck: &Deck) -> Result<(), DeckErrors> {
    let mut issues = vec![];
    for figure in &deck.figures {
        let Figure::Lines(lines) = figure else { continue };
        for curve in &lines.curves {
            if let Some(csv) = &curve.csv
                && let Err((span, message)) = points_of_file(deck, curve)
            {
                let help = "the first line names the columns; choose two with `columns: [x, y]`";
                issues.push(Issue::new(span.unwrap_or(csv.span), message, help));
            }
        }
    }
    if issues.is_empty() { Ok(()) } else { Err(deck.errors(issues)) }
}

type FileFault = (Option<crate::deck::Span>, String);

fn points_of_file(deck: &Deck, curve: &FigureCurve) -> Result<Vec<[f64; 2]>, FileFault> {
    let Some(csv) = &curve.csv else { return Ok(vec![]) };
    let path = deck.resolve(&csv.value);
    let table = Table::read(&path).map_err(|e| (None, e))?;
    let [x, y] = match &curve.columns {
        Some([x, y]) => {
            let place = |name: &Text| table.column(&name.value, &path).map_err(|e| (Some(name.span), e));
            [place(x)?, place(y)?]
        }
        None if table.columns.len() < 2 => return Err((None, format!("{} has one column only", path.display()))),
        None => [0, 1],
    };
    Ok(table.rows.iter().map(|row| [row[x], row[y]]).collect())
}

/// Draws all figures into `folder`; what could not be drawn is told.
pub(crate) fn draw(written: &Deck, made: &[Made], folder: &Path) -> Vec<String> {
    let mut undrawn = vec![];
    for (k, figure) in written.figures.iter().enumerate() {
        let name = &figure.file().value;
        let (png, csv) = (folder.join(format!("{name}.png")), folder.join(format!("{name}.csv")));
        let result: Result<(), OutputError> = match figure {
            Figure::Lines(lines) => {
                let plot = plot(written, k, lines, made);
                plot.write_csv(&csv).and_then(|()| plot.write_png(&png))
            }
            Figure::Fields(fields) => pictures(written, fields, made, &png, &csv),
        };
        if let Err(e) = result {
            undrawn.push(format!("figure `{name}`: {e}"));
        }
    }
    undrawn
}

/// A label with the values of a combination in it.
fn filled(template: &str, made: &Made) -> String {
    let mut text = template.to_string();
    for name in placeholders(template) {
        let value = if name == "run" { made.name.clone() } else { shown(made, name) };
        text = text.replace(&format!("{{{name}}}"), &value);
    }
    text
}

/// The value of a parameter as one would write it: as typed where that is a number, else with four digits.
fn shown(made: &Made, name: &str) -> String {
    match made.deck.parameters.get(name).map(|parameter| (&parameter.value, &parameter.text)) {
        Some((ParameterValue::Number(value, _), text)) => {
            let plain = text.starts_with(|c: char| c.is_ascii_digit() || c == '-') && !text.contains(['*', '/', '(', '+']);
            if plain { text.clone() } else { number(*value, 4) }
        }
        Some((_, text)) => text.clone(),
        None => String::new(),
    }
}

/// A curve before it has its style.
struct Drawn {
    label: String,
    points: Vec<[f64; 2]>,
    style: Option<CurveStyle>,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Computed,
    /// Few values, joined.
    Study,
    Expression,
    File,
}

fn plot(written: &Deck, number: usize, figure: &LinesFigure, made: &[Made]) -> Plot {
    let mut curves: Vec<Drawn> = vec![];
    let (mut across, mut along_y) = (Names::default(), Names::default());
    let several = |same: fn(&FigureCurve) -> bool| figure.curves.iter().filter(|curve| same(curve)).count() > 1;
    for (k, curve) in figure.curves.iter().enumerate() {
        let chosen: Vec<&Made> = made.iter().filter(|one| drawn(curve, &one.name)).collect();
        // the same curve as the combination reads it: its line and times may depend on parameters
        let own = |one: &'_ Made| -> FigureCurve {
            match one.deck.figures.get(number) {
                Some(Figure::Lines(lines)) => lines.curves.get(k).unwrap_or(curve).clone(),
                _ => curve.clone(),
            }
        };
        let label = |one: &Made, plain: String| curve.label.as_ref().map_or(plain, |label| filled(&label.value, one));
        let mut add = |label: String, points: Vec<[f64; 2]>, kind: Kind| {
            curves.push(Drawn { label, points, style: curve.style.clone(), kind });
        };
        if let Some(field) = &curve.field {
            let name = field.to_string();
            let line = curve.along.is_some();
            let over = curve.against.as_ref().map_or(if line { "distance" } else { "x" }, |a| a.value.as_str());
            across.add(if over == "distance" { "distance along the line" } else { over });
            along_y.add(&name);
            for one in chosen {
                let plain = if several(|c| c.field.is_some()) { format!("{}: {name}", one.name) } else { one.name.clone() };
                add(label(one, plain), field_points(&own(one), &name, over, one), Kind::Computed);
            }
        } else if let Some(column) = &curve.history {
            let over = curve.against.as_ref().map_or("time", |a| a.value.as_str());
            across.add(over);
            along_y.add(&column.value);
            for one in chosen {
                let (x, y) = (one.observed.column(over).unwrap_or_default(), one.observed.column(&column.value).unwrap_or_default());
                let plain = if several(|c| c.history.is_some()) { format!("{}: {}", one.name, column.value) } else { one.name.clone() };
                add(label(one, plain), x.into_iter().zip(y).map(|(x, y)| [x, y]).collect(), Kind::Computed);
            }
        } else if let (Some(quantity), Some(over)) = (&curve.quantity, &curve.against) {
            across.add(&over.value);
            along_y.add(&quantity.value);
            for group in groups(&chosen, &over.value) {
                let Some((_, first)) = group.members.first() else { continue };
                let plain = match (group.label.is_empty(), several(|c| c.quantity.is_some())) {
                    (true, _) => quantity.value.clone(),
                    (false, false) => group.label.clone(),
                    (false, true) => format!("{}, {}", quantity.value, group.label),
                };
                let points = group.members.iter().map(|(x, one)| [*x, one.quantity(&quantity.value).unwrap_or(f64::NAN)]).collect();
                add(label(first, plain), points, Kind::Study);
            }
        } else if curve.csv.is_some() {
            let plain = curve.label.as_ref().or(curve.csv.as_ref()).map_or(String::new(), |label| label.value.clone());
            add(plain, points_of_file(written, curve).unwrap_or_default(), Kind::File);
        } else if let Some(expression) = &curve.expression {
            // their ends may be those of the other curves: points come below
            let plain = |expression: &str| curve.label.as_ref().map_or(expression.to_string(), |label| label.value.clone());
            match &curve.runs {
                None => add(plain(&expression.text), vec![], Kind::Expression),
                Some(_) => {
                    chosen.iter().for_each(|one| add(label(one, format!("{}: {}", expression.text, one.name)), vec![], Kind::Expression))
                }
            }
        }
    }
    let logarithmic = |axis: LogAxes| {
        let both = matches!(figure.log, Some(LogAxes::Both));
        both || matches!((&figure.log, axis), (Some(LogAxes::X), LogAxes::X) | (Some(LogAxes::Y), LogAxes::Y))
    };
    trace_expressions(written, number, figure, made, &mut curves, logarithmic(LogAxes::X));

    let axis = |settings: &crate::deck::AxisSettings, names: &Names, logarithmic: bool| {
        let mut axis = Axis::new(settings.label.as_ref().map_or_else(|| names.text(), |label| label.value.clone()));
        axis.unit = settings.unit.as_ref().map(|unit| unit.value.clone());
        axis.range = settings.range.map(|range| range.map(|end| end.value));
        if logarithmic { axis.logarithmic() } else { axis }
    };
    let title = figure.title.as_ref().map_or_else(|| written.title.value.clone(), |title| title.value.clone());
    let mut plot = Plot::new(title, axis(&figure.x, &across, logarithmic(LogAxes::X)), axis(&figure.y, &along_y, logarithmic(LogAxes::Y)));
    plot.slopes = figure.slopes.iter().map(|slope| slope.value).collect();
    plot.legend = if figure.legend { Legend::Clear } else { Legend::None };
    let (mut computed, mut references) = (0, 0);
    for curve in curves {
        let style = style(&curve, &mut computed, &mut references);
        let factors = [figure.x.factor.value, figure.y.factor.value];
        let points = curve.points.iter().map(|p| [p[0] * factors[0], p[1] * factors[1]]).collect();
        plot = plot.curve(Curve::new(curve.label, points).style(style));
    }
    plot
}

/// Fills in the points of expressions, in the order in which they were put into the list.
fn trace_expressions(written: &Deck, number: usize, figure: &LinesFigure, made: &[Made], curves: &mut [Drawn], logarithmic: bool) {
    let xs = || curves.iter().flat_map(|c| &c.points).map(|p| p[0]).filter(|x| x.is_finite() && (!logarithmic || *x > 0.0));
    let (mut low, mut high) = (xs().fold(f64::INFINITY, f64::min), xs().fold(f64::NEG_INFINITY, f64::max));
    if let Some([from, to]) = figure.x.range {
        (low, high) = (from.value / figure.x.factor.value, to.value / figure.x.factor.value);
    }
    if low.is_nan() || low >= high {
        (low, high) = if logarithmic { (1.0, 10.0) } else { (0.0, 1.0) };
    }
    let mut empty = curves.iter_mut().filter(|curve| curve.kind == Kind::Expression);
    for (k, curve) in figure.curves.iter().enumerate().filter(|(_, curve)| curve.expression.is_some()) {
        let decks: Vec<&Deck> = match &curve.runs {
            None => vec![written],
            Some(_) => made.iter().filter(|one| drawn(curve, &one.name)).map(|one| &one.deck).collect(),
        };
        for deck in decks {
            let own = match deck.figures.get(number) {
                Some(Figure::Lines(lines)) => lines.curves.get(k).unwrap_or(curve),
                _ => curve,
            };
            let (Some(slot), Some(expression)) = (empty.next(), &own.expression) else { continue };
            let (from, to) = (own.from.map_or(low, |q| q.value), own.to.map_or(high, |q| q.value));
            let at = |i: usize| {
                let t = i as f64 / SAMPLES as f64;
                if logarithmic && from > 0.0 { from * (to / from).powf(t) } else { from + t * (to - from) }
            };
            slot.points = (0..=SAMPLES).map(at).map(|x| [x, expression.eval([x, 0.0, 0.0], 0.0)]).collect();
        }
    }
}

fn field_points(curve: &FigureCurve, name: &str, over: &str, one: &Made) -> Vec<[f64; 2]> {
    let observed = &one.observed;
    let Some(kept) = observed.field(name, time_of(&curve.time)) else { return vec![] };
    let on: Vec<(f64, usize)> = match &curve.along {
        Some(line) => along(&observed.reference, &observed.edge, line.from.point(), line.to.point()),
        None => {
            let mut all: Vec<(f64, usize)> = observed.reference.iter().enumerate().map(|(q, x)| (x[0], q)).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            all
        }
    };
    let abscissa = |s: f64, q: usize| match over {
        "x" => observed.reference[q][0],
        "y" => observed.reference[q][1],
        "z" => observed.reference[q][2],
        _ => s,
    };
    on.iter().map(|&(s, q)| [abscissa(s, q), kept.values[q]]).collect()
}

/// The style of a curve: as asked for, or one that can be told from the others without colour.
fn style(curve: &Drawn, computed: &mut u8, references: &mut u8) -> Style {
    let reference = matches!(curve.kind, Kind::Expression | Kind::File);
    let line = |pattern: u8| if reference { Style::Reference(pattern) } else { Style::Pattern(pattern) };
    match &curve.style {
        Some(CurveStyle::Line) => line(0),
        Some(CurveStyle::Dashed) => line(1),
        Some(CurveStyle::Dotted) => line(2),
        Some(CurveStyle::DashDot) => line(3),
        Some(CurveStyle::Markers) => Style::Markers,
        Some(CurveStyle::LineAndMarkers) => Style::LineAndMarkers,
        None if curve.kind == Kind::Study => Style::LineAndMarkers,
        None if curve.kind == Kind::File && curve.points.len() <= MOST_MARKERS => Style::Markers,
        None => {
            let count = if reference { &mut *references } else { &mut *computed };
            *count = count.wrapping_add(1);
            // references begin with dashes
            if reference { Style::Reference(*count) } else { Style::Pattern(*count - 1) }
        }
    }
}

/// What stands along an axis: the one name that all curves share.
#[derive(Default)]
struct Names(Vec<String>);

impl Names {
    fn add(&mut self, name: &str) {
        if !self.0.iter().any(|own| own == name) {
            self.0.push(name.into());
        }
    }

    fn text(&self) -> String {
        if self.0.is_empty() { "x".into() } else { self.0.join(", ") }
    }
}

fn pictures(written: &Deck, figure: &FieldsFigure, made: &[Made], png: &Path, csv: &Path) -> Result<(), OutputError> {
    let name = figure.field.to_string();
    let damage = figure.field.field.name() == "damage";
    let own_time = |one: &Made| match one.deck.figures.iter().find(|own| own.file().value == figure.name.value) {
        Some(Figure::Fields(own)) => time_of(&own.time),
        _ => time_of(&figure.time),
    };
    type Shown<'a> = (&'a Made, String, Vec<f64>, &'a [[f64; 3]]);
    let shown: Vec<Shown> = made
        .iter()
        .filter(|one| figure.runs.holds(&one.name))
        .filter_map(|one| {
            let kept = one.observed.field(&name, own_time(one))?;
            let title = figure.label.as_ref().map_or_else(|| one.name.clone(), |label| filled(&label.value, one));
            let values = kept.values.iter().map(|v| v * figure.factor.value).collect();
            Some((one, title, values, &kept.displacement[..]))
        })
        .collect();
    let all = || shown.iter().flat_map(|s| &s.2);
    let signed = all().any(|v| *v < 0.0) && all().any(|v| *v > 0.0);
    let view = figure
        .view
        .as_ref()
        .map_or_else(View::default, |view| View { azimuth: view.azimuth.value.to_degrees(), elevation: view.elevation.value.to_degrees() });
    let options = Options {
        caption: time_of(&figure.time).map(|t| format!("at {}", number(t, 4))),
        colors: match (damage, signed) {
            (true, _) => ColorMap::Ember,
            (_, true) => ColorMap::Diverging,
            _ => ColorMap::Viridis,
        },
        range: match figure.range {
            Some([min, max]) => Range::Fixed { min: min.value, max: max.value },
            None if damage => Range::Fixed { min: 0.0, max: 1.0 },
            None if signed => Range::Symmetric,
            None => Range::Auto,
        },
        deformation: match figure.scale {
            Auto::Auto => Deformation::Auto,
            Auto::Given(factor) => Deformation::Factor(factor.value),
        },
        view,
        ..Options::default()
    };
    let panels = shown
        .iter()
        .map(|(one, title, values, displacement)| Panel {
            title,
            body: Body { dimension: one.observed.dimension, reference: &one.observed.reference, displacement, edge: &one.observed.edge },
            values,
        })
        .collect();
    let title = figure.title.as_ref().map_or_else(|| written.title.value.clone(), |title| title.value.clone());
    let unit = figure.unit.as_ref().map(|unit| unit.value.clone());
    let columns = figure.columns.map(|columns| columns.value as usize);
    let whole = SideBySide { title, name, unit, panels, columns, options };
    whole.write_csv(csv)?;
    whole.write_png(png)
}
