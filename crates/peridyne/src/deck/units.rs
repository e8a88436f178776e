//! Units of measure: what `72 GPa` or `3.8 J/m^2` means, and in which units a deck counts.
//!
//! A unit is a factor to SI and a [`Dimension`]. Factors are kept as *mantissa times a power of ten*, so that a
//! metric number keeps its digits: `3 mm` read in a deck that counts in millimetres is exactly `3`, and `3 mm` read
//! in SI is the double nearest to `0.003`. The values are those of the SI brochure and of NIST SP 811 (2008),
//! appendix B.
use std::fmt;
use std::str::FromStr;

/// Exponents are counted in sixths, so that square and cube roots of units (`MPa*m^0.5`) are exact.
const WHOLE: i16 = 6;

/// Exponents of mass, length, time and temperature, in sixths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dimension([i16; 4]);

impl Dimension {
    /// The dimension of pure numbers and of angles.
    pub const NONE: Self = Self::new(0, 0, 0, 0);

    /// The dimension `mass^m · length^l · time^t · temperature^k`.
    pub const fn new(m: i16, l: i16, t: i16, k: i16) -> Self {
        Self([m * WHOLE, l * WHOLE, t * WHOLE, k * WHOLE])
    }

    fn plus(self, other: Self, times: i16) -> Self {
        let mut sum = self;
        for axis in 0..4 {
            sum.0[axis] = sum.0[axis].saturating_add(times.saturating_mul(other.0[axis]));
        }
        sum
    }

    fn power(self, exponent: f64) -> Option<Self> {
        let mut result = Self::NONE;
        for axis in 0..4 {
            let sixths = f64::from(self.0[axis]) * exponent;
            if (sixths - sixths.round()).abs() > 1e-6 || sixths.abs() > 600.0 {
                return None;
            }
            result.0[axis] = sixths.round() as i16;
        }
        Some(result)
    }
}

/// The names of the dimensions that engineers have words for.
const NAMED: &[(&str, Dimension)] = &[
    ("a pure number", Dimension::NONE),
    ("a length", Dimension::new(0, 1, 0, 0)),
    ("an area", Dimension::new(0, 2, 0, 0)),
    ("a volume", Dimension::new(0, 3, 0, 0)),
    ("a mass", Dimension::new(1, 0, 0, 0)),
    ("a time", Dimension::new(0, 0, 1, 0)),
    ("a temperature", Dimension::new(0, 0, 0, 1)),
    ("a velocity", Dimension::new(0, 1, -1, 0)),
    ("an acceleration", Dimension::new(0, 1, -2, 0)),
    ("a density", Dimension::new(1, -3, 0, 0)),
    ("a force", Dimension::new(1, 1, -2, 0)),
    ("a pressure", Dimension::new(1, -1, -2, 0)),
    ("a force density", Dimension::new(1, -2, -2, 0)),
    ("an energy", Dimension::new(1, 2, -2, 0)),
    ("an energy per area", Dimension::new(1, 0, -2, 0)),
    ("a power", Dimension::new(1, 2, -3, 0)),
    ("a frequency", Dimension::new(0, 0, -1, 0)),
    ("a thermal expansion", Dimension::new(0, 0, 0, -1)),
];

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((name, _)) = NAMED.iter().find(|(_, dimension)| dimension == self) {
            return f.write_str(name);
        }
        f.write_str("a quantity in ")?;
        let mut first = true;
        for (base, &sixths) in ["kg", "m", "s", "K"].iter().zip(&self.0) {
            if sixths != 0 {
                let times = if first { "" } else { "*" };
                first = false;
                match f64::from(sixths) / f64::from(WHOLE) {
                    1.0 => write!(f, "{times}{base}")?,
                    exponent => write!(f, "{times}{base}^{}", (exponent * 1e3).round() / 1e3)?,
                }
            }
        }
        Ok(())
    }
}

/// A factor `mantissa · 10^(tens/6)` to SI and a dimension.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    mantissa: f64,
    /// In sixths like the exponents of the dimension, so that `mm^0.5` is exact too.
    tens: i32,
    /// What a quantity in this unit measures.
    pub dimension: Dimension,
    /// What is added after scaling: only degrees Celsius have one.
    offset: f64,
}

impl Unit {
    const ONE: Self = Self::of(1.0, 0, Dimension::NONE);

    const fn of(mantissa: f64, tens: i32, dimension: Dimension) -> Self {
        Self { mantissa, tens: tens * WHOLE as i32, dimension, offset: 0.0 }
    }

    /// The factor to the SI unit of the same dimension.
    pub fn factor(&self) -> f64 {
        scale(self.mantissa, self.tens)
    }

    fn times(self, other: Self) -> Self {
        Self {
            mantissa: self.mantissa * other.mantissa,
            tens: self.tens.saturating_add(other.tens),
            dimension: self.dimension.plus(other.dimension, 1),
            offset: 0.0,
        }
    }

    fn power(self, exponent: f64) -> Option<Self> {
        let tens = (f64::from(self.tens) * exponent).round();
        if !(-2000.0..=2000.0).contains(&tens) {
            return None;
        }
        let mantissa = if self.mantissa == 1.0 { 1.0 } else { self.mantissa.powf(exponent) };
        // The dimension admits whole sixths only, so that `tens`, a multiple of its exponents, is whole as well …
        let dimension = self.dimension.power(exponent)?;
        // … except for pure numbers (`%^0.1`), where what is lost goes into the mantissa.
        let lost = f64::from(self.tens) * exponent - tens;
        let mantissa = if lost.abs() < 1e-6 { mantissa } else { mantissa * 10f64.powf(lost / f64::from(WHOLE)) };
        Some(Self { mantissa, tens: tens as i32, dimension, offset: 0.0 })
    }
}

/// `value · 10^(tens/6)` with one rounding wherever the power of ten is exact.
fn scale(value: f64, sixths: i32) -> f64 {
    let (tens, rest) = (sixths.div_euclid(WHOLE.into()), sixths.rem_euclid(WHOLE.into()));
    let value = if rest == 0 { value } else { value * 10f64.powf(f64::from(rest) / f64::from(WHOLE)) };
    match tens {
        0 => value,
        1..=22 => value * 10f64.powi(tens),
        -22..=-1 => value / 10f64.powi(-tens),
        _ => value * 10f64.powf(f64::from(tens)),
    }
}

const PREFIXES: &[(&str, i32)] = &[
    ("Q", 30),
    ("R", 27),
    ("Y", 24),
    ("Z", 21),
    ("E", 18),
    ("P", 15),
    ("T", 12),
    ("G", 9),
    ("M", 6),
    ("k", 3),
    ("h", 2),
    ("da", 1),
    ("d", -1),
    ("c", -2),
    ("m", -3),
    ("µ", -6),
    ("μ", -6),
    ("u", -6),
    ("n", -9),
    ("p", -12),
    ("f", -15),
    ("a", -18),
    ("z", -21),
    ("y", -24),
    ("r", -27),
    ("q", -30),
];

/// Symbol, mantissa, power of ten, dimension (mass, length, time, temperature), and whether SI prefixes apply.
type Row = (&'static str, f64, i32, [i16; 4], bool);

const TABLE: &[Row] = &[
    ("m", 1.0, 0, [0, 1, 0, 0], true),
    ("g", 1.0, -3, [1, 0, 0, 0], true),
    ("s", 1.0, 0, [0, 0, 1, 0], true),
    ("K", 1.0, 0, [0, 0, 0, 1], true),
    ("t", 1.0, 3, [1, 0, 0, 0], false),
    ("tonne", 1.0, 3, [1, 0, 0, 0], false),
    ("min", 60.0, 0, [0, 0, 1, 0], false),
    ("h", 3600.0, 0, [0, 0, 1, 0], false),
    ("d", 86400.0, 0, [0, 0, 1, 0], false),
    ("Hz", 1.0, 0, [0, 0, -1, 0], true),
    ("N", 1.0, 0, [1, 1, -2, 0], true),
    ("dyn", 1.0, -5, [1, 1, -2, 0], false),
    ("kgf", 9.80665, 0, [1, 1, -2, 0], false),
    ("lbf", 4.448_221_615_260_5, 0, [1, 1, -2, 0], false),
    ("kip", 4.448_221_615_260_5, 3, [1, 1, -2, 0], false),
    ("Pa", 1.0, 0, [1, -1, -2, 0], true),
    ("bar", 1.0, 5, [1, -1, -2, 0], true),
    ("atm", 101_325.0, 0, [1, -1, -2, 0], false),
    // lbf/in^2 with the exact pound-force and inch: 4.448 221 615 260 5 / 0.0254^2.
    ("psi", 6_894.757_293_168_361, 0, [1, -1, -2, 0], false),
    ("ksi", 6_894.757_293_168_361, 3, [1, -1, -2, 0], false),
    ("Msi", 6_894.757_293_168_361, 6, [1, -1, -2, 0], false),
    ("J", 1.0, 0, [1, 2, -2, 0], true),
    ("erg", 1.0, -7, [1, 2, -2, 0], false),
    ("eV", 1.602_176_634, -19, [1, 2, -2, 0], true),
    ("W", 1.0, 0, [1, 2, -3, 0], true),
    ("in", 2.54, -2, [0, 1, 0, 0], false),
    ("ft", 3.048, -1, [0, 1, 0, 0], false),
    ("mil", 2.54, -5, [0, 1, 0, 0], false),
    ("lb", 4.535_923_7, -1, [1, 0, 0, 0], false),
    ("slug", 14.593_902_937_206_364, 0, [1, 0, 0, 0], false),
    ("rad", 1.0, 0, [0, 0, 0, 0], true),
    ("deg", std::f64::consts::PI / 180.0, 0, [0, 0, 0, 0], false),
    ("°", std::f64::consts::PI / 180.0, 0, [0, 0, 0, 0], false),
    ("%", 1.0, -2, [0, 0, 0, 0], false),
];

/// Why a unit text was not understood, and what to write instead.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct UnitError {
    /// What is wrong.
    pub message: String,
    /// The remedy.
    pub help: String,
}

fn symbol(name: &str) -> Result<Unit, UnitError> {
    let row_unit = |row: &Row| Unit::of(row.1, row.2, Dimension::new(row.3[0], row.3[1], row.3[2], row.3[3]));
    // A whole symbol wins over prefix and symbol: `min` is a minute, `ft` a foot.
    if let Some(row) = TABLE.iter().find(|row| row.0 == name) {
        return Ok(row_unit(row));
    }
    for (prefix, tens) in PREFIXES {
        if let Some(row) = name.strip_prefix(prefix).and_then(|rest| TABLE.iter().find(|row| row.4 && row.0 == rest)) {
            let mut unit = row_unit(row);
            unit.tens += tens * i32::from(WHOLE);
            return Ok(unit);
        }
    }
    let common = ["mm", "cm", "km", "um", "nm", "kg", "mg", "ms", "us", "ns", "kN", "MN", "kPa", "MPa", "GPa", "kJ", "mJ"];
    let known: Vec<&str> = common.into_iter().chain(TABLE.iter().map(|row| row.0)).collect();
    let folded = known.iter().copied().find(|unit| unit.eq_ignore_ascii_case(name));
    let help = match folded.or_else(|| super::report::nearest(name, known.iter().copied())) {
        Some(near) => format!("did you mean `{near}`? upper and lower case differ in units"),
        None => "write a unit such as `mm`, `kg/m^3`, `GPa`, `J/m^2` or `20 m/s`; a product of numbers is written with `*`".into(),
    };
    Err(UnitError { message: format!("`{name}` is not a known unit"), help })
}

struct Reader<'a> {
    text: &'a str,
    depth: usize,
}

impl<'a> Reader<'a> {
    fn peek(&self) -> Option<char> {
        self.text.chars().next()
    }

    fn skip(&mut self) -> bool {
        let trimmed = self.text.trim_start();
        let moved = trimmed.len() != self.text.len();
        self.text = trimmed;
        moved
    }

    fn accept(&mut self, c: char) -> bool {
        match self.text.strip_prefix(c) {
            Some(rest) => {
                self.text = rest;
                true
            }
            None => false,
        }
    }

    fn split(&mut self, end: impl Fn(char) -> bool) -> &'a str {
        let (head, tail) = self.text.split_at(self.text.find(end).unwrap_or(self.text.len()));
        self.text = tail;
        head
    }

    fn wrong(&self, message: impl Into<String>) -> UnitError {
        UnitError { message: message.into(), help: "write a unit such as `mm`, `kg/m^3`, `N*mm` or `MPa*m^0.5`".into() }
    }

    fn product(&mut self) -> Result<Unit, UnitError> {
        self.skip();
        let mut unit = if self.text.starts_with('/') { Unit::ONE } else { self.factor()? };
        loop {
            let spaced = self.skip();
            let divide = match self.peek() {
                Some('*' | '·' | '/') => self.text.chars().next().is_some_and(|c| self.accept(c) && c == '/'),
                Some(c) if spaced && c != ')' => false,
                _ => return Ok(unit),
            };
            self.skip();
            let factor = self.factor()?;
            let factor = if divide { factor.power(-1.0) } else { Some(factor) };
            unit = unit.times(factor.ok_or_else(|| self.wrong("the exponent of a unit is too large"))?);
        }
    }

    fn factor(&mut self) -> Result<Unit, UnitError> {
        let unit = if self.accept('(') {
            self.depth += 1;
            if self.depth > 20 {
                return Err(self.wrong("too many nested parentheses in a unit"));
            }
            let inner = self.product()?;
            if !self.accept(')') {
                return Err(self.wrong("a `)` is missing in the unit"));
            }
            inner
        } else if self.accept('1') {
            Unit::ONE
        } else if self.accept('%') {
            symbol("%")?
        } else {
            let name = self.split(|c: char| !(c.is_alphabetic() || c == '°') || matches!(c, '²' | '³'));
            match name {
                "" => {
                    let found = self.peek().map_or("the end".into(), |c| format!("`{c}`"));
                    return Err(self.wrong(format!("a unit is expected before {found}")));
                }
                "degC" | "°C" => {
                    return Err(self.wrong(format!("`{name}` can only stand alone, as in `20 degC`; write `K` in products")));
                }
                name => symbol(name)?,
            }
        };
        let exponent = self.exponent()?;
        if exponent == 1.0 {
            return Ok(unit);
        }
        unit.power(exponent).ok_or_else(|| self.wrong(format!("a unit cannot be raised to the power {exponent}")))
    }

    fn exponent(&mut self) -> Result<f64, UnitError> {
        for (c, exponent) in [('²', 2.0), ('³', 3.0)] {
            if self.accept(c) {
                return Ok(exponent);
            }
        }
        let marked = self.accept('^') || self.text.starts_with("**") && self.accept('*') && self.accept('*');
        if !marked {
            // `kg/m3` is common usage.
            let digits = self.split(|c: char| !c.is_ascii_digit());
            return if digits.is_empty() { Ok(1.0) } else { digits.parse().map_err(|_| self.wrong("unreadable exponent")) };
        }
        let bracketed = self.accept('(');
        let text = self.split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | '+')));
        let mut exponent: f64 = text.parse().map_err(|_| self.wrong("a number is expected after `^`"))?;
        if bracketed {
            if self.accept('/') {
                let below = self.split(|c: char| !c.is_ascii_digit());
                exponent /= below.parse::<f64>().map_err(|_| self.wrong("a whole number is expected after `/`"))?;
            }
            if !self.accept(')') {
                return Err(self.wrong("a `)` is missing in the exponent"));
            }
        }
        Ok(exponent)
    }
}

impl FromStr for Unit {
    type Err = UnitError;

    /// Reads a product, quotient or power of units: `kg/m^3`, `N*mm`, `MPa*m^0.5`, `1/K`.
    fn from_str(text: &str) -> Result<Self, UnitError> {
        if matches!(text.trim(), "degC" | "°C") {
            return Ok(Self { offset: 273.15, ..Self::of(1.0, 0, Dimension::new(0, 0, 0, 1)) });
        }
        let mut reader = Reader { text: text.trim(), depth: 0 };
        let unit = reader.product()?;
        if reader.text.is_empty() { Ok(unit) } else { Err(reader.wrong(format!("`{}` is not part of a unit", reader.text))) }
    }
}

/// The units in which a deck counts: its plain numbers, and every number handed on to the solver.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitSystem {
    /// Mass, length, time, temperature.
    base: [Unit; 4],
    symbols: [String; 4],
}

impl UnitSystem {
    /// Metre, kilogram, second, kelvin.
    pub fn si() -> Self {
        Self::from_symbols(["kg", "m", "s", "K"])
    }

    /// Millimetre, newton, megapascal: millimetre, tonne, second, kelvin.
    pub fn mm_n_mpa() -> Self {
        Self::from_symbols(["t", "mm", "s", "K"])
    }

    fn from_symbols(symbols: [&str; 4]) -> Self {
        let base = symbols.map(|text| symbol(text).unwrap_or(Unit::ONE));
        Self { base, symbols: symbols.map(String::from) }
    }

    /// A system of the given units of mass, length, time and temperature.
    ///
    /// # Errors
    /// The axis (0 to 3) whose text is not a unit of that dimension, with the reason.
    pub fn new(symbols: [&str; 4]) -> Result<Self, (usize, UnitError)> {
        let mut system = Self::si();
        for (axis, text) in symbols.into_iter().enumerate() {
            let unit: Unit = text.parse().map_err(|error| (axis, error))?;
            let expected = system.base[axis].dimension;
            if unit.dimension != expected || unit.offset != 0.0 {
                let message = format!("`{text}` is {}, but the unit of {expected} is asked for", unit.dimension);
                let help = format!("write for example `{}`", ["kg", "mm", "s", "K"][axis]);
                return Err((axis, UnitError { message, help }));
            }
            system.base[axis] = unit;
            system.symbols[axis] = text.into();
        }
        Ok(system)
    }

    /// The symbols of the units of mass, length, time and temperature.
    pub fn symbols(&self) -> [&str; 4] {
        [&self.symbols[0], &self.symbols[1], &self.symbols[2], &self.symbols[3]]
    }

    /// `number` of `unit`, counted in this system.
    pub fn convert(&self, number: f64, unit: &Unit) -> f64 {
        let mut own = Unit::ONE;
        for (base, &sixths) in self.base.iter().zip(&unit.dimension.0) {
            own = own.times(base.power(f64::from(sixths) / f64::from(WHOLE)).unwrap_or(Unit::ONE));
        }
        let ratio = if unit.mantissa == own.mantissa { 1.0 } else { unit.mantissa / own.mantissa };
        let offset = if unit.offset == 0.0 { 0.0 } else { scale(unit.offset / own.mantissa, -own.tens) };
        scale(number * ratio, unit.tens - own.tens) + offset
    }

    /// How large one unit of `dimension` of this system is in SI.
    pub fn in_si(&self, dimension: Dimension) -> f64 {
        1.0 / self.convert(1.0, &Unit::of(1.0, 0, dimension))
    }
}
