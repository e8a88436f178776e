//! Expressions of a deck: `0.5*L*(1 - cos(pi*t))`, `1.0 if x < 0 else 2.0`, `not (x > 0 and y > 0)`.
//!
//! A text is read once (precedence climbing), its constant parts are folded, and the rest becomes a short program
//! for a stack of fixed size: evaluation neither allocates nor fails, and gives the same bits on every thread.
//!
//! Operators, loosest first: `a if c else b`; `or ||`; `and &&`; `not !`; `< <= > >= == !=` (may be chained,
//! `0 < x < 1`); `+ -`; `* /`; unary `-`; `^ **` (to the right). A comparison counts as 1 or 0 in arithmetic.
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// How many values the stack of a program holds.
const STACK: usize = 48;
/// How many values nearly all programs need at most.
const SHALLOW: usize = 8;
/// Longer texts are refused, so that reading them cannot exhaust the call stack.
const LONGEST: usize = 4096;
/// How deep parentheses, functions, signs and conditions may nest.
const DEEPEST: usize = 64;

const CONSTANTS: &[(&str, f64)] = &[("pi", std::f64::consts::PI), ("tau", std::f64::consts::TAU)];
const KEYWORDS: &[&str] = &["if", "else", "and", "or", "not", "where", "true", "false"];

type One = fn(f64) -> f64;
type Two = fn(f64, f64) -> f64;

const FUNCTIONS: &[(&str, One)] = &[
    ("abs", f64::abs),
    ("sign", |v| {
        if v > 0.0 {
            1.0
        } else if v < 0.0 {
            -1.0
        } else {
            v
        }
    }),
    // Heaviside's step: 0 before, 1 from zero on.
    ("step", |v| if v >= 0.0 { 1.0 } else { v * 0.0 }),
    ("sqrt", f64::sqrt),
    ("cbrt", f64::cbrt),
    ("exp", f64::exp),
    ("log", f64::ln),
    ("ln", f64::ln),
    ("log2", f64::log2),
    ("log10", f64::log10),
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("asin", f64::asin),
    ("acos", f64::acos),
    ("atan", f64::atan),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
    ("asinh", f64::asinh),
    ("acosh", f64::acosh),
    ("atanh", f64::atanh),
    ("floor", f64::floor),
    ("ceil", f64::ceil),
    ("round", f64::round),
    ("trunc", f64::trunc),
    ("fract", f64::fract),
];

/// Functions of two arguments; `min`, `max` and `hypot` also take more.
const FUNCTIONS_OF_TWO: &[(&str, Two, bool)] = &[
    ("min", f64::min, true),
    ("max", f64::max, true),
    ("hypot", f64::hypot, true),
    ("atan2", f64::atan2, false),
    ("pow", power, false),
    ("mod", f64::rem_euclid, false),
];

fn power(base: f64, exponent: f64) -> f64 {
    // Squares and cubes are by far the most common, and exact as products.
    match exponent {
        2.0 => base * base,
        3.0 => base * base * base,
        _ => base.powf(exponent),
    }
}

fn truth(value: bool) -> f64 {
    f64::from(u8::from(value))
}

/// Whether `name` means something in every expression, so that no parameter may be called so.
pub fn is_reserved(name: &str) -> bool {
    matches!(name, "x" | "y" | "z" | "t") || KEYWORDS.contains(&name) || CONSTANTS.iter().any(|c| c.0 == name) || is_function(name)
}

fn is_function(name: &str) -> bool {
    FUNCTIONS.iter().any(|f| f.0 == name) || FUNCTIONS_OF_TWO.iter().any(|f| f.0 == name) || name == "where"
}

/// What an expression can look up: the variables of its key and the parameters of the deck.
pub trait Scope {
    /// The value of parameter `name`; `Some(Err(why))` if it exists but is not a number. An empty reason means that
    /// the fault has been told elsewhere: the error of the expression then has an empty message.
    fn parameter(&self, name: &str) -> Option<Result<f64, String>>;
    /// The names of all numeric parameters, for suggestions.
    fn parameters(&self) -> Vec<&str>;
}

/// A fault in an expression: a range of bytes of its text, what is wrong, what would be right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExpressionError {
    /// Bytes of the text.
    pub range: Range<usize>,
    /// What is wrong.
    pub message: String,
    /// The remedy.
    pub help: String,
}

/// A compiled expression of up to three coordinates and time.
///
/// `Send + Sync`; cloning is cheap.
#[derive(Clone)]
pub struct Expr {
    program: Arc<[Op]>,
    constant: Option<f64>,
    uses: [bool; 4],
    truth: bool,
    shallow: bool,
}

#[derive(Debug, Clone)]
enum Op {
    Push(f64),
    Load(usize),
    One(One),
    Two(Two),
    Add,
    Subtract,
    Multiply,
    Divide,
    Select,
    Table(Arc<[[f64; 2]]>),
}

impl fmt::Debug for Expr {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.constant {
            Some(value) => write!(f, "Expr({value})"),
            None => write!(f, "Expr({} operations)", self.program.len()),
        }
    }
}

impl Expr {
    /// The expression that is `value` everywhere.
    pub fn of(value: f64) -> Self {
        Self { program: [Op::Push(value)].into(), constant: Some(value), uses: [false; 4], truth: false, shallow: true }
    }

    /// Piecewise linear interpolation in variable `of` (0 to 2: coordinate, 3: time) through `rows` of abscissa and
    /// value, whose abscissae must increase; constant before the first and after the last row.
    pub fn table(rows: &[[f64; 2]], of: usize) -> Self {
        let mut uses = [false; 4];
        uses[of.min(3)] = true;
        Self { program: [Op::Load(of.min(3)), Op::Table(rows.into())].into(), constant: None, uses, truth: false, shallow: true }
    }

    /// Reads `text`; `variables` lists the allowed variables and their slots (0 to 2: coordinate, 3: time).
    ///
    /// # Errors
    /// All unknown names, or the first place where the text is not an expression.
    pub fn parse(text: &str, variables: &[(&str, usize)], scope: &dyn Scope) -> Result<Self, Vec<ExpressionError>> {
        let mut parser = Parser { text, at: 0, depth: 0, variables, scope, errors: Vec::new() };
        let tree = match parser.whole() {
            Ok(tree) => tree,
            Err(error) => {
                parser.errors.push(error);
                return Err(parser.errors);
            }
        };
        if !parser.errors.is_empty() {
            return Err(parser.errors);
        }
        let truth = tree.is_truth();
        let mut uses = [false; 4];
        let mut program = Vec::new();
        let depth = tree.emit(&mut program, &mut uses);
        if depth > STACK {
            return Err(vec![ExpressionError {
                range: 0..text.len(),
                message: "the expression is nested too deeply".into(),
                help: "name a part of it as a parameter, or write it with fewer parentheses".into(),
            }]);
        }
        let mut expression = Self { program: program.into(), constant: None, uses, truth, shallow: depth <= SHALLOW };
        if uses == [false; 4] {
            let value = expression.eval([0.0; 3], 0.0);
            expression = Self { truth, ..Self::of(value) };
        }
        Ok(expression)
    }

    /// The value at point `p` and time `t`. Does not allocate.
    #[inline]
    pub fn eval(&self, p: [f64; 3], t: f64) -> f64 {
        match self.constant {
            Some(value) => value,
            // Clearing the stack costs more than running a short program on it.
            None if self.shallow => self.run::<SHALLOW>([p[0], p[1], p[2], t]),
            None => self.run::<STACK>([p[0], p[1], p[2], t]),
        }
    }

    fn run<const N: usize>(&self, variables: [f64; 4]) -> f64 {
        let mut stack = [0.0; N];
        let mut top = 0usize;
        for op in self.program.iter() {
            let (a, b) = (top.wrapping_sub(2), top.wrapping_sub(1));
            match op {
                Op::Push(value) => {
                    stack[top] = *value;
                    top += 1;
                }
                Op::Load(slot) => {
                    stack[top] = variables[*slot];
                    top += 1;
                }
                Op::One(function) => stack[b] = function(stack[b]),
                Op::Table(rows) => stack[b] = interpolate(rows, stack[b]),
                Op::Two(function) => {
                    stack[a] = function(stack[a], stack[b]);
                    top -= 1;
                }
                Op::Add => {
                    stack[a] += stack[b];
                    top -= 1;
                }
                Op::Subtract => {
                    stack[a] -= stack[b];
                    top -= 1;
                }
                Op::Multiply => {
                    stack[a] *= stack[b];
                    top -= 1;
                }
                Op::Divide => {
                    stack[a] /= stack[b];
                    top -= 1;
                }
                Op::Select => {
                    // condition, then, else
                    stack[top - 3] = if stack[top - 3] != 0.0 { stack[a] } else { stack[b] };
                    top -= 2;
                }
            }
        }
        stack[0]
    }

    /// The value, if it depends on no variable.
    pub fn constant(&self) -> Option<f64> {
        self.constant
    }

    /// Whether time occurs in it.
    pub fn depends_on_time(&self) -> bool {
        self.uses[3]
    }

    /// Whether coordinate `axis` (0, 1, 2) occurs in it.
    pub fn depends_on(&self, axis: usize) -> bool {
        axis < 3 && self.uses[axis]
    }

    /// Whether it is a condition (comparison, `and`, `or`, `not`), whose value is 1 or 0.
    pub fn is_condition(&self) -> bool {
        self.truth
    }
}

fn interpolate(rows: &[[f64; 2]], x: f64) -> f64 {
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
        return 0.0;
    };
    if x.is_nan() {
        return x;
    }
    if x <= first[0] {
        return first[1];
    }
    if x >= last[0] {
        return last[1];
    }
    let right = rows.partition_point(|row| row[0] <= x);
    let ([x0, y0], [x1, y1]) = (rows[right - 1], rows[right]);
    y0 + (y1 - y0) * ((x - x0) / (x1 - x0))
}

#[derive(Clone)]
enum Tree {
    Number(f64),
    Truth(f64),
    Variable(usize),
    One(One, Box<Tree>),
    Two(Operator, Box<Tree>, Box<Tree>),
    Select(Box<[Tree; 3]>),
}

#[derive(Clone)]
enum Operator {
    Arithmetic(Op),
    /// Its value is 1 or 0.
    Logic(Two),
}

impl Tree {
    fn is_truth(&self) -> bool {
        match self {
            Tree::Truth(_) | Tree::Two(Operator::Logic(_), ..) => true,
            Tree::Select(parts) => parts[1].is_truth() && parts[2].is_truth(),
            _ => false,
        }
    }

    fn value(&self) -> Option<f64> {
        match self {
            Tree::Number(value) | Tree::Truth(value) => Some(*value),
            _ => None,
        }
    }

    fn one(function: One, a: Tree) -> Self {
        match a.value() {
            Some(a) => Tree::Number(function(a)),
            None => Tree::One(function, Box::new(a)),
        }
    }

    fn two(operator: Operator, a: Tree, b: Tree) -> Self {
        let (Some(u), Some(v)) = (a.value(), b.value()) else {
            return Tree::Two(operator, Box::new(a), Box::new(b));
        };
        match operator {
            Operator::Logic(function) => Tree::Truth(function(u, v)),
            Operator::Arithmetic(Op::Two(function)) => Tree::Number(function(u, v)),
            Operator::Arithmetic(Op::Add) => Tree::Number(u + v),
            Operator::Arithmetic(Op::Subtract) => Tree::Number(u - v),
            Operator::Arithmetic(Op::Multiply) => Tree::Number(u * v),
            Operator::Arithmetic(Op::Divide) => Tree::Number(u / v),
            Operator::Arithmetic(_) => Tree::Two(operator, Box::new(a), Box::new(b)),
        }
    }

    fn select(condition: Tree, yes: Tree, no: Tree) -> Self {
        match condition.value() {
            Some(0.0) => no,
            Some(_) => yes,
            None => Tree::Select(Box::new([condition, yes, no])),
        }
    }

    /// Appends the program of this tree, notes the variables used, and returns the depth of stack it needs.
    fn emit(&self, program: &mut Vec<Op>, uses: &mut [bool; 4]) -> usize {
        match self {
            Tree::Number(value) | Tree::Truth(value) => {
                program.push(Op::Push(*value));
                1
            }
            Tree::Variable(slot) => {
                uses[*slot] = true;
                program.push(Op::Load(*slot));
                1
            }
            Tree::One(function, a) => {
                let depth = a.emit(program, uses);
                program.push(Op::One(*function));
                depth
            }
            Tree::Two(operator, a, b) => {
                let depth = a.emit(program, uses).max(b.emit(program, uses) + 1);
                program.push(match operator {
                    Operator::Arithmetic(op) => op.clone(),
                    Operator::Logic(function) => Op::Two(*function),
                });
                depth
            }
            Tree::Select(parts) => {
                let depths = [0, 1, 2].map(|k| parts[k].emit(program, uses) + k);
                program.push(Op::Select);
                depths.into_iter().max().unwrap_or(0)
            }
        }
    }
}

fn negate(value: f64) -> f64 {
    -value
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
    variables: &'a [(&'a str, usize)],
    scope: &'a dyn Scope,
    errors: Vec<ExpressionError>,
}

type Parsed = Result<Tree, ExpressionError>;

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn skip(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    fn wrong(&self, range: Range<usize>, message: impl Into<String>, help: impl Into<String>) -> ExpressionError {
        ExpressionError { range, message: message.into(), help: help.into() }
    }

    /// What stands here, for messages.
    fn here(&self) -> (Range<usize>, String) {
        match self.rest().chars().next() {
            None => (self.at..self.at, "the end".into()),
            Some(c) => {
                let word = self.word();
                let end = self.at + word.map_or(c.len_utf8(), str::len);
                (self.at..end, format!("`{}`", &self.text[self.at..end]))
            }
        }
    }

    /// The name that starts here, without consuming it.
    fn word(&self) -> Option<&'a str> {
        let rest = self.rest();
        if !rest.starts_with(|c: char| c.is_alphabetic() || c == '_') {
            return None;
        }
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        Some(&rest[..end])
    }

    fn accept(&mut self, symbols: &[&str]) -> bool {
        self.skip();
        for symbol in symbols {
            let found = if symbol.starts_with(char::is_alphabetic) { self.word() == Some(symbol) } else { self.rest().starts_with(symbol) };
            if found {
                self.at += symbol.len();
                return true;
            }
        }
        false
    }

    fn nested(&mut self, parse: impl FnOnce(&mut Self) -> Parsed) -> Parsed {
        self.depth += 1;
        if self.depth > DEEPEST {
            let message = "the expression is nested too deeply";
            return Err(self.wrong(self.here().0, message, "name a part of it as a parameter"));
        }
        let tree = parse(self);
        self.depth -= 1;
        tree
    }

    fn whole(&mut self) -> Parsed {
        if self.text.len() > LONGEST {
            let message = format!("the expression is longer than {LONGEST} characters");
            return Err(self.wrong(0..self.text.len(), message, "name parts of it as parameters, or use a table"));
        }
        let tree = self.conditional()?;
        self.skip();
        if self.at == self.text.len() {
            return Ok(tree);
        }
        let (range, found) = self.here();
        let help = if self.word().is_some() {
            "a product is written with `*`; a unit may only follow a single number, as in `0.5 mm`"
        } else if self.rest().starts_with('=') {
            "equality is written `==`"
        } else {
            "an operator such as `+`, `*` or `<` is expected here"
        };
        Err(self.wrong(range, format!("{found} is not expected here"), help))
    }

    fn condition(&self, start: usize, tree: &Tree) -> Result<(), ExpressionError> {
        if tree.is_truth() {
            return Ok(());
        }
        let range = start..self.text[..self.at].trim_end().len().max(start);
        let message = format!("`{}` is a number, but a condition is needed here", self.text[range.clone()].trim());
        Err(self.wrong(range, message, "write a comparison, such as `x < 0`"))
    }

    fn conditional(&mut self) -> Parsed {
        self.skip();
        let yes = self.disjunction()?;
        if !self.accept(&["if"]) {
            return Ok(yes);
        }
        self.skip();
        let start = self.at;
        let condition = self.disjunction()?;
        self.condition(start, &condition)?;
        if !self.accept(&["else"]) {
            let (range, found) = self.here();
            return Err(self.wrong(range, format!("`else` is expected before {found}"), "write `1.0 if x < 0 else 2.0`"));
        }
        let no = self.nested(Self::conditional)?;
        Ok(Tree::select(condition, yes, no))
    }

    fn disjunction(&mut self) -> Parsed {
        self.logic(&["or", "||"], Self::conjunction, |a, b| truth(a != 0.0 || b != 0.0))
    }

    fn conjunction(&mut self) -> Parsed {
        self.logic(&["and", "&&"], Self::negation, |a, b| truth(a != 0.0 && b != 0.0))
    }

    fn logic(&mut self, symbols: &[&str], part: fn(&mut Self) -> Parsed, function: Two) -> Parsed {
        self.skip();
        let mut start = self.at;
        let mut left = part(self)?;
        while self.accept(symbols) {
            self.condition(start, &left)?;
            self.skip();
            let right_start = self.at;
            let right = part(self)?;
            self.condition(right_start, &right)?;
            left = Tree::two(Operator::Logic(function), left, right);
            start = self.at;
        }
        Ok(left)
    }

    fn negation(&mut self) -> Parsed {
        self.skip();
        let not = self.word() == Some("not") || self.rest().starts_with('!') && !self.rest().starts_with("!=");
        if !not {
            return self.comparison();
        }
        self.accept(&["not", "!"]);
        self.skip();
        let start = self.at;
        let part = self.nested(Self::negation)?;
        self.condition(start, &part)?;
        Ok(Tree::two(Operator::Logic(|a, b| truth(a == b)), part, Tree::Number(0.0)))
    }

    fn comparison(&mut self) -> Parsed {
        const SYMBOLS: [(&str, Two); 6] = [
            ("<=", |a, b| truth(a <= b)),
            (">=", |a, b| truth(a >= b)),
            ("==", |a, b| truth(a == b)),
            ("!=", |a, b| truth(a != b)),
            ("<", |a, b| truth(a < b)),
            (">", |a, b| truth(a > b)),
        ];
        let mut left = self.sum()?;
        let mut all: Option<Tree> = None;
        while let Some((_, function)) = SYMBOLS.iter().find(|(symbol, _)| self.accept(&[symbol])) {
            let right = self.sum()?;
            let pair = Tree::two(Operator::Logic(*function), left, right.clone());
            all = Some(match all {
                None => pair,
                Some(before) => Tree::two(Operator::Logic(|a, b| truth(a != 0.0 && b != 0.0)), before, pair),
            });
            left = right;
        }
        Ok(all.unwrap_or(left))
    }

    fn sum(&mut self) -> Parsed {
        let mut left = self.product()?;
        loop {
            let op = if self.accept(&["+"]) {
                Op::Add
            } else if self.accept(&["-"]) {
                Op::Subtract
            } else {
                return Ok(left);
            };
            let right = self.product()?;
            left = Tree::two(Operator::Arithmetic(op), left, right);
        }
    }

    fn product(&mut self) -> Parsed {
        let mut left = self.signed()?;
        loop {
            self.skip();
            let op = if !self.rest().starts_with("**") && self.accept(&["*"]) {
                Op::Multiply
            } else if self.accept(&["/"]) {
                Op::Divide
            } else {
                return Ok(left);
            };
            let right = self.signed()?;
            left = Tree::two(Operator::Arithmetic(op), left, right);
        }
    }

    fn signed(&mut self) -> Parsed {
        if self.accept(&["-"]) {
            Ok(Tree::one(negate, self.nested(Self::signed)?))
        } else if self.accept(&["+"]) {
            self.nested(Self::signed)
        } else {
            self.power()
        }
    }

    fn power(&mut self) -> Parsed {
        let base = self.atom()?;
        if self.accept(&["^", "**"]) {
            let exponent = self.nested(Self::signed)?;
            return Ok(Tree::two(Operator::Arithmetic(Op::Two(power)), base, exponent));
        }
        Ok(base)
    }

    fn atom(&mut self) -> Parsed {
        self.skip();
        let start = self.at;
        if self.accept(&["("]) {
            let inner = self.nested(Self::conditional)?;
            self.close(start)?;
            return Ok(inner);
        }
        if self.rest().starts_with(|c: char| c.is_ascii_digit() || c == '.') {
            return self.number();
        }
        match self.word() {
            None => {
                let (range, found) = self.here();
                let help = if self.text.trim().is_empty() {
                    "write a number or an expression"
                } else {
                    "a number, a name or `(` is expected here"
                };
                Err(self.wrong(range, format!("{found} is not expected here"), help))
            }
            Some(word) => {
                self.at += word.len();
                self.skip();
                if self.rest().starts_with('(') { self.call(word, start) } else { self.name(word, start) }
            }
        }
    }

    fn close(&mut self, open: usize) -> Result<(), ExpressionError> {
        if self.accept(&[")"]) {
            return Ok(());
        }
        let (range, found) = self.here();
        if found == "the end" {
            return Err(self.wrong(open..open + 1, "this `(` is not closed", "add a `)`"));
        }
        Err(self.wrong(range, format!("{found} is not expected here"), "an operator, `,` or `)` is expected here"))
    }

    fn number(&mut self) -> Parsed {
        let length = number_length(self.rest());
        let range = self.at..self.at + length.max(1);
        match self.text[self.at..self.at + length].parse() {
            Ok(value) => {
                self.at += length;
                if let Some(word) = self.word() {
                    let message = format!("`{}{word}` is not a number", &self.text[range.clone()]);
                    let help = format!(
                        "write a product as `{}*{word}`; a unit may only follow a single number, as in `0.5 mm`",
                        &self.text[range.clone()]
                    );
                    return Err(self.wrong(range.start..self.at + word.len(), message, help));
                }
                Ok(Tree::Number(value))
            }
            Err(_) => Err(self.wrong(range, "this is not a number", "write for example `0.5` or `1e-3`")),
        }
    }

    fn name(&mut self, name: &str, start: usize) -> Parsed {
        let range = start..start + name.len();
        let parameter = self.scope.parameter(name);
        if let Some((_, slot)) = self.variables.iter().find(|variable| variable.0 == name) {
            if parameter.is_some() {
                let message = format!("`{name}` is both the variable of this key and a parameter");
                self.errors.push(self.wrong(range, message, "give the parameter another name"));
            }
            return Ok(Tree::Variable(*slot));
        }
        if let Some(parameter) = parameter {
            return match parameter {
                Ok(value) => Ok(Tree::Number(value)),
                Err(why) => {
                    let help = "give the parameter a number, or use its text with `${…}`";
                    let message = match why.as_str() {
                        "" => String::new(),
                        why => format!("parameter `{name}` is not a number: {why}"),
                    };
                    self.errors.push(self.wrong(range, message, help));
                    Ok(Tree::Number(f64::NAN))
                }
            };
        }
        if let Some((_, value)) = CONSTANTS.iter().find(|constant| constant.0 == name) {
            return Ok(Tree::Number(*value));
        }
        match name {
            "true" => return Ok(Tree::Truth(1.0)),
            "false" => return Ok(Tree::Truth(0.0)),
            _ => {}
        }
        let (message, help) = if KEYWORDS.contains(&name) {
            return Err(self.wrong(range, format!("`{name}` is not expected here"), "write `1.0 if x < 0 else 2.0`, `a and not b`"));
        } else if is_function(name) {
            (format!("function `{name}` has no argument"), format!("write `{name}(…)`"))
        } else if matches!(name, "x" | "y" | "z" | "t") {
            let allowed: Vec<String> = self.variables.iter().map(|variable| format!("`{}`", variable.0)).collect();
            let help = if allowed.is_empty() {
                "this value is one number: only parameters may occur in it".into()
            } else {
                format!("this value may depend on {} and parameters only", allowed.join(", "))
            };
            (format!("`{name}` cannot be used here"), help)
        } else {
            let parameters = self.scope.parameters();
            let known = self.variables.iter().map(|variable| variable.0).chain(parameters).chain(["pi"]);
            let known: Vec<&str> = known.collect();
            (format!("`{name}` is neither a variable nor a parameter"), super::report::suggest(name, known))
        };
        self.errors.push(self.wrong(range, message, help));
        // `true` and a number at once, so that one unknown name gives one message.
        Ok(Tree::Truth(f64::NAN))
    }

    fn call(&mut self, name: &str, start: usize) -> Parsed {
        let range = start..start + name.len();
        let open = self.at;
        self.accept(&["("]);
        let mut arguments = Vec::new();
        self.skip();
        let first = self.at;
        if !self.rest().starts_with(')') {
            loop {
                arguments.push(self.nested(Self::conditional)?);
                if arguments.len() == 1 && name == "where" {
                    self.condition(first, &arguments[0])?;
                }
                if !self.accept(&[","]) {
                    break;
                }
            }
        }
        self.close(open)?;
        let count = arguments.len();
        let wants = |many: &str| {
            self.wrong(start..self.at, format!("`{name}` takes {many}, not {count}"), format!("write for example `{}`", example(name)))
        };
        if name == "where" {
            let Ok([condition, yes, no]) = <[Tree; 3]>::try_from(arguments) else {
                return Err(wants("three arguments"));
            };
            return Ok(Tree::select(condition, yes, no));
        }
        if let Some((_, function)) = FUNCTIONS.iter().find(|function| function.0 == name) {
            let Ok([argument]) = <[Tree; 1]>::try_from(arguments) else {
                return Err(wants("one argument"));
            };
            return Ok(Tree::one(*function, argument));
        }
        if let Some((_, function, more)) = FUNCTIONS_OF_TWO.iter().find(|function| function.0 == name) {
            if count < 2 || count > 2 && !more {
                return Err(wants(if *more { "two or more arguments" } else { "two arguments" }));
            }
            let mut arguments = arguments.into_iter();
            let first = arguments.next().unwrap_or(Tree::Number(f64::NAN));
            return Ok(arguments.fold(first, |a, b| Tree::two(Operator::Arithmetic(Op::Two(*function)), a, b)));
        }
        let known = FUNCTIONS.iter().map(|f| f.0).chain(FUNCTIONS_OF_TWO.iter().map(|f| f.0)).chain(["where"]);
        let known: Vec<&str> = known.collect();
        self.errors.push(self.wrong(range, format!("`{name}` is not a known function"), super::report::suggest(name, known)));
        Ok(Tree::Truth(f64::NAN))
    }
}

fn example(name: &str) -> &'static str {
    match name {
        "where" => "where(x < 0, 1.0, 2.0)",
        "atan2" => "atan2(y, x)",
        "pow" => "pow(x, 2)",
        "mod" => "mod(t, 1e-3)",
        "min" | "max" | "hypot" => "max(x, y)",
        _ => "sin(x)",
    }
}

/// How many bytes of `text` are an unsigned decimal number.
pub(crate) fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| from + bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = digits(0);
    let mut any = end > 0;
    if bytes.get(end) == Some(&b'.') {
        let fraction = digits(end + 1);
        any |= fraction > end + 1;
        end = fraction;
    }
    if !any {
        return 0;
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let signed = end + 1 + usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        if signed <= bytes.len() && digits(signed) > signed {
            end = digits(signed);
        }
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Names(&'static [(&'static str, f64)]);

    impl Scope for Names {
        fn parameter(&self, name: &str) -> Option<Result<f64, String>> {
            self.0.iter().find(|p| p.0 == name).map(|p| Ok(p.1))
        }

        fn parameters(&self) -> Vec<&str> {
            self.0.iter().map(|p| p.0).collect()
        }
    }

    const XYZT: [(&str, usize); 4] = [("x", 0), ("y", 1), ("z", 2), ("t", 3)];

    fn at(text: &str, p: [f64; 3], t: f64) -> f64 {
        Expr::parse(text, &XYZT, &Names(&[("L", 8.0), ("m", 3.0)])).unwrap_or_else(|e| panic!("{text}: {e:?}")).eval(p, t)
    }

    #[test]
    fn arithmetic_follows_the_usual_rules() {
        let p = [2.0, -3.0, 0.5];
        for (text, expected) in [
            ("1 + 2*3", 7.0),
            ("-x^2", -4.0),
            ("2^3^2", 512.0),
            ("2**-1", 0.5),
            ("L/160", 0.05),
            ("m*sqrt(2)*x", 3.0 * std::f64::consts::SQRT_2 * 2.0),
            ("1 - 2 - 3", -4.0),
            ("8/2/2", 2.0),
            ("--x", 2.0),
            ("1e-3*x + .5", 0.502),
            ("max(x, y, 7)", 7.0),
            ("atan2(y, x)", (-3f64).atan2(2.0)),
            ("hypot(x, y)", 13f64.sqrt()),
            ("mod(y, 2)", 1.0),
            ("log(exp(x))", 2.0),
            ("log10(1000)", 3.0),
            ("step(x) + step(y) + step(0)", 2.0),
            ("sign(y)", -1.0),
            ("sin(pi/2)", 1.0),
            ("x*t", 8.0),
        ] {
            let value = at(text, p, 4.0);
            assert!((value - expected).abs() <= 4e-16 * expected.abs(), "{text}: {value} instead of {expected}");
        }
    }

    #[test]
    fn conditions_choose() {
        let p = [2.0, -3.0, 0.5];
        for (text, expected) in [
            ("1.0 if x<0 else 2.0", 2.0),
            ("1 if x < 0 else 2 if y < 0 else 3", 2.0),
            ("where(x < 0, 1, 5)", 5.0),
            ("x > 0 and not (y > 0)", 1.0),
            ("x > 0 && y > 0 || z == 0.5", 1.0),
            ("!(x > 0)", 0.0),
            ("not x > 0", 0.0),
            ("0 < z < 1", 1.0),
            ("0 < x < 1", 0.0),
            ("(t<1)*3 + (t>=1)*5", 5.0),
            ("true and x != 2", 0.0),
            ("1/0 if false else 3", 3.0),
        ] {
            assert_eq!(at(text, p, 4.0), expected, "{text}");
        }
    }

    #[test]
    fn constants_are_folded_and_uses_known() {
        let names = Names(&[("L", 8.0)]);
        assert_eq!(Expr::parse("2*L + sin(0)", &XYZT, &names).unwrap().constant(), Some(16.0));
        let moving = Expr::parse("L*sin(t)*y", &XYZT, &names).unwrap();
        assert_eq!(moving.constant(), None);
        assert!(moving.depends_on_time() && moving.depends_on(1) && !moving.depends_on(0));
        assert!(Expr::parse("x < 1", &XYZT, &names).unwrap().is_condition());
    }

    #[test]
    fn tables_interpolate_and_stay_constant_outside() {
        let ramp = Expr::table(&[[0.0, 0.0], [1e-5, 2.0], [2e-5, 2.0]], 3);
        for (t, expected) in [(-1.0, 0.0), (0.0, 0.0), (2.5e-6, 0.5), (1e-5, 2.0), (1.5e-5, 2.0), (9.0, 2.0)] {
            assert!((ramp.eval([0.0; 3], t) - expected).abs() < 1e-15, "{t}");
        }
    }

    #[test]
    fn faults_point_at_their_place() {
        let names = Names(&[("length", 8.0)]);
        for (text, range, part) in [
            ("2*lenght + q", 2..8, "`lenght` is neither"),
            ("sine(x)", 0..4, "`sine` is not a known function"),
            ("(x + 1", 0..1, "not closed"),
            ("x + ", 4..4, "the end is not expected"),
            ("2x", 0..2, "`2x` is not a number"),
            ("x = 1", 2..3, "`=` is not expected"),
            ("1 if x else 2", 5..6, "`x` is a number"),
            ("sin(x, y)", 0..9, "one argument"),
            ("x $ y", 2..3, "`$`"),
        ] {
            let errors = Expr::parse(text, &XYZT, &names).unwrap_err();
            assert_eq!(errors[0].range, range, "{text}: {errors:?}");
            assert!(errors[0].message.contains(part), "{text}: {errors:?}");
        }
        let both = Expr::parse("2*lenght + q", &XYZT, &names).unwrap_err();
        assert_eq!(both.len(), 2);
        assert!(both[0].help.contains("`length`"), "{both:?}");
        let time = Expr::parse("2*t", &XYZT[..3], &names).unwrap_err();
        assert!(time[0].help.contains("`x`, `y`, `z`"), "{time:?}");
    }

    #[test]
    fn hostile_texts_are_refused() {
        let names = Names(&[]);
        for text in [
            "(".repeat(4000),
            "-".repeat(4000),
            "1+".repeat(4000),
            format!("{}x{}", "(x+".repeat(60), ")".repeat(60)),
            "2^".repeat(2000),
            "not ".repeat(1000),
        ] {
            assert!(Expr::parse(&text, &XYZT, &names).is_err());
        }
    }

    /// `cargo test --release -p peridyne speed -- --ignored --nocapture`
    #[test]
    #[ignore = "prints times"]
    fn speed() {
        let names = Names(&[("L", 8.0)]);
        for text in ["x*sin(2*pi*t)", "2*x + y", "1.0 if x < 0 else 2.0", "x > -0.5*L and x < 0.5*L"] {
            let expression = Expr::parse(text, &XYZT, &names).unwrap();
            let start = std::time::Instant::now();
            let mut sum = 0.0;
            for k in 0..1_000_000 {
                sum += expression.eval([f64::from(k) * 1e-6, 0.5, 0.0], 0.3);
            }
            println!("{text}: {:.0} ns ({sum})", start.elapsed().as_secs_f64() * 1e3);
        }
    }
}
