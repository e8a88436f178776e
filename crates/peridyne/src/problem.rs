//! From the deck as typed to a validated problem: points, sets, materials and conditions that fit together. All faults are
//! found before anything is computed, each with its place in the deck.

use crate::deck::{self, Axis, Condition, Deck, DeckErrors, Issue, Lattice, PointSet, Points, Region, SetRule, Shape, Solver, Span};
use crate::surface::Part;
use bodies::crack::{Crack, CrackError, Cracks};
use bodies::generate::{self, Filling, Jitter};
use bodies::inclined::{Axes, Place};
use bodies::neighbors::{Families, Mirror};
use bodies::points::PointCloud;
use bodies::region;
use physics::elasticity::Section;
use std::collections::BTreeMap;
use thin::surface::Surface;

/// A validated problem. Points are in sorted order throughout.
pub struct Problem {
    /// The deck.
    pub deck: Deck,
    /// The section.
    pub section: Section,
    /// The points.
    pub cloud: PointCloud,
    /// Place of each sorted point in the user's order.
    pub user: Vec<u32>,
    /// Horizon of each point.
    pub horizon: Vec<f64>,
    /// Points of each set, ascending; with `all` and the blocks.
    pub sets: BTreeMap<String, Vec<u32>>,
    /// Number of the material of each point.
    pub material: Vec<u32>,
    /// Families, without the bonds that cross voids.
    pub families: Families,
    /// Bonds left out because they cross voids.
    pub hidden_bonds: usize,
    /// Pre-cracks.
    pub cracks: Option<Cracks>,
    /// The surface of a shell, whose points are those of `cloud`, in the user's order; of several parts, all.
    pub surface: Option<Surface>,
    /// The parts of a shell.
    pub parts: Vec<Part>,
    /// Whether the body is a beam or a plate, whose families are those of bond pairs; `families` is empty then.
    pub thin: bool,
    /// Where all constants of materials are taken, whatever the place of a point; `None`: each point has its own.
    pub constants_at: Option<[f64; 3]>,
}

type Checked<T> = Result<T, Vec<Issue>>;

impl Problem {
    /// Builds the problem of a deck.
    ///
    /// # Errors
    /// Every fault found.
    pub fn new(deck: Deck) -> Result<Self, DeckErrors> {
        Self::build(&deck).map_err(|issues| deck.errors(issues)).map(|(section, parts)| {
            let Built { cloud, user, horizon, sets, material, families, hidden_bonds, cracks, surface, parts } = parts;
            let thin = is_thin(&deck);
            Problem {
                deck,
                section,
                cloud,
                user,
                horizon,
                sets,
                material,
                families,
                hidden_bonds,
                cracks,
                surface,
                parts,
                thin,
                constants_at: None,
            }
        })
    }

    fn build(deck: &Deck) -> Checked<(Section, Built)> {
        let section = section(deck);
        let mut issues = vec![];
        let (cloud, surface, parts) = points(deck, section)?;
        // points of a surface stay as they are: triangles and sets refer to them
        let (cloud, user) = if surface.is_some() {
            let user = (0..cloud.len() as u32).collect();
            (cloud, user)
        } else {
            let order = cloud.spatial_order();
            let user = order.order().to_vec();
            (cloud.reordered(&order), user)
        };

        let body = &deck.body;
        let horizon: Vec<f64> = cloud.position.iter().map(|&x| body.horizon.eval(x, 0.0)).collect();
        if let Some(p) = (0..cloud.len()).find(|&p| horizon[p].is_nan() || horizon[p] < cloud.spacing[p] * (1.0 - 1e-9)) {
            issues.push(Issue::new(
                body.horizon.span,
                format!("the horizon is {:.6e} at point {}, below the spacing {:.6e}", horizon[p], cloud.id[p], cloud.spacing[p]),
                "a family needs neighbours: use about three spacings, for example `horizon: 3.015*dx`",
            ));
            return Err(issues);
        }
        let sets = sets(deck, &cloud, surface.as_ref(), &mut issues);
        let material = materials(deck, &cloud, &sets, &mut issues);
        conditions(deck, &cloud, &sets, &mut issues);
        let thin = is_thin(deck);
        if !thin {
            solid(deck, &mut issues);
        }
        if thin {
            let cracks = cracks(deck, &mut issues);
            let (families, hidden_bonds) = (Families::default(), 0);
            let built = Built { cloud, user, horizon, sets, material, families, hidden_bonds, cracks, surface, parts };
            return if issues.is_empty() { Ok((section, built)) } else { Err(issues) };
        }

        let mirrors: Vec<Mirror> = deck
            .conditions
            .iter()
            .filter_map(|c| match c {
                Condition::Symmetry(s) => s.axis().map(|axis| Mirror { axis: axis.index(), at: s.at.value }),
                _ => None,
            })
            .collect();
        let mirror_span = deck
            .conditions
            .iter()
            .find(|c| matches!(c, Condition::Symmetry(s) if s.set.is_none()))
            .map_or(body.horizon.span, Condition::span);
        let found = match Families::find(&cloud.position, cloud.dimension, &cloud.spacing, &horizon, &mirrors) {
            Ok(found) => found,
            Err(e) => {
                issues.push(Issue::new(
                    mirror_span,
                    e.to_string(),
                    "move the symmetry plane to the face of the body, half a spacing from its outer points",
                ));
                return Err(issues);
            }
        };
        let nothing_between = !body.visibility || mirrors.is_empty() && bodies::visibility::fills_box(&cloud);
        let (families, hidden_bonds) = if nothing_between {
            (found, 0)
        } else {
            let lists = found.into_lists();
            match bodies::visibility::across_voids(&cloud, &lists, None) {
                Ok(hidden) => {
                    let count = hidden.iter().filter(|h| **h).count();
                    (Families::from(if count > 0 { lists.without(&hidden) } else { lists }), count)
                }
                Err(e) => {
                    issues.push(Issue::new(body.span, e.to_string(), "turn the test off with `visibility: false`"));
                    return Err(issues);
                }
            }
        };
        let largest = (0..cloud.len()).max_by_key(|&p| families.size(p));
        if let Some(p) = largest.filter(|&p| families.size(p) > bodies::body::MOST_NEIGHBORS) {
            let (n, most) = (families.size(p), bodies::body::MOST_NEIGHBORS);
            issues.push(Issue::new(
                body.horizon.span,
                format!("the family of point {} has {n} points, more than the {most} that a family may have", cloud.id[p]),
                "use a smaller horizon, or a larger spacing",
            ));
        }
        let lonely: Vec<u64> = (0..cloud.len()).filter(|&p| families.size(p) == 0).map(|p| cloud.id[p]).collect();
        if !lonely.is_empty() {
            let what = format!("{} points have no neighbour within the horizon, the first is point {}", lonely.len(), lonely[0]);
            // the visibility test may have taken the last bonds of a point
            let (what, remedy) = if hidden_bonds > 0 {
                (
                    format!("{what}; `visibility` left {} bonds out that cross voids of the body", hidden_bonds / 2),
                    "turn the test off with `visibility: false`, enlarge the horizon, or remove the points",
                )
            } else {
                (what, "enlarge the horizon, or remove the points")
            };
            issues.push(Issue::new(body.horizon.span, what, remedy));
        }
        let cracks = cracks(deck, &mut issues);
        references(deck, &cloud, &sets, &mut issues);
        if issues.is_empty() {
            Ok((section, Built { cloud, user, horizon, sets, material, families, hidden_bonds, cracks, surface, parts }))
        } else {
            Err(issues)
        }
    }

    /// Number of directions that displacements and reactions have in histories: beams and plates move out of their line or plane.
    pub fn directions(&self) -> usize {
        if self.thin { 3 } else { self.section.dimension() }
    }

    /// Points of a set.
    pub fn set(&self, name: &str) -> &[u32] {
        self.sets.get(name).map_or(&[], Vec::as_slice)
    }

    /// The point nearest to a position (sorted index); ties go to the smaller id.
    pub fn nearest(&self, x: [f64; 3]) -> usize {
        nearest(&self.cloud, x)
    }

    /// What a field should be at points (sorted indices) and a time.
    ///
    /// # Errors
    /// What is wrong with the file that says so.
    pub fn reference(&self, error: &deck::FieldError, points: &[u32], t: f64) -> Result<Vec<f64>, String> {
        match &error.against {
            Some(field) => Ok(points.iter().map(|&p| field.eval(self.cloud.position[p as usize], t)).collect()),
            None => reference_field(&self.deck, &self.cloud, error, points),
        }
    }

    /// End of the run: a time in dynamics, a load parameter in statics.
    pub fn end(&self) -> Option<f64> {
        match &self.deck.solver {
            Solver::VelocityVerlet(v) => v.end.map(|q| q.value),
            Solver::Statics(s) => Some(s.end.value),
            Solver::DynamicRelaxation(s) => Some(s.end.value),
            Solver::Buckling(b) => Some(b.end.value),
            Solver::Vibration(_) | Solver::Spectrum(_) => None,
        }
    }
}

/// Whether the body is a beam or a plate.
fn is_thin(deck: &Deck) -> bool {
    deck.materials.iter().any(|(_, m)| m.model.is_thin())
}

/// Refuses what only beams and plates understand.
fn solid(deck: &Deck, issues: &mut Vec<Issue>) {
    for c in deck.conditions.iter().filter(|c| c.is_thin()) {
        issues.push(Issue::new(
            c.span(),
            format!("`{}` is for beams and plates", c.name()),
            "use `displacement`, `traction` or `force_density` on a set of points",
        ));
    }
    for lattice in deck.body.points.iter().filter_map(lattice_of) {
        if matches!(lattice.placement, deck::Placement::Edges) {
            issues.push(Issue::new(
                lattice.spacing.span,
                "points on edges are for beams and plates: in a solid they would have too much volume",
                "use `placement: centers`",
            ));
        }
    }
}

struct Built {
    cloud: PointCloud,
    user: Vec<u32>,
    horizon: Vec<f64>,
    sets: BTreeMap<String, Vec<u32>>,
    material: Vec<u32>,
    families: Families,
    hidden_bonds: usize,
    cracks: Option<Cracks>,
    surface: Option<Surface>,
    parts: Vec<Part>,
}

fn section(deck: &Deck) -> Section {
    let body = &deck.body;
    let thickness = body.thickness.map_or(1.0, |t| t.value);
    match (body.dimensions(), body.plane.as_ref().map(|p| &p.value)) {
        (1, _) => Section::Bar { area: body.area.map_or(1.0, |a| a.value) },
        (2, Some(deck::Plane::Stress)) => Section::PlaneStress { thickness },
        (2, _) => Section::PlaneStrain { thickness },
        _ => Section::Solid,
    }
}

fn lattice_of(source: &Points) -> Option<&Lattice> {
    match source {
        Points::Line(s) => Some(&s.lattice),
        Points::Rectangle(s) => Some(&s.lattice),
        Points::Box(s) => Some(&s.lattice),
        Points::Disc(s) => Some(&s.lattice),
        Points::Cylinder(s) => Some(&s.lattice),
        Points::Sphere(s) => Some(&s.lattice),
        Points::File(_) | Points::Surface(_) => None,
    }
}

fn points(deck: &Deck, section: Section) -> Checked<(PointCloud, Option<Surface>, Vec<Part>)> {
    let mut issues = vec![];
    let mut whole: Option<PointCloud> = None;
    let surfaces: Vec<_> = deck.body.points.iter().filter_map(|p| if let Points::Surface(s) = p { Some(s) } else { None }).collect();
    if let Some(joint) = deck.body.joints.first().filter(|_| surfaces.len() < 2) {
        let help = "give two or more of `surface`, each with a `block` name; a single one needs no joint";
        return Err(vec![Issue::new(joint.span, "a joint is between two surfaces", help)]);
    }
    if let Some(s) = surfaces.first() {
        if deck.body.points.len() > surfaces.len() {
            return Err(vec![Issue::new(s.span, "a surface goes with no other kind of source of points", "give surfaces and lines alone")]);
        }
        if !deck.materials.iter().all(|(_, m)| matches!(m.model, deck::Model::Shell(_) | deck::Model::BondPairBeam(_))) {
            let help = "use it, or `bond_pair_beam` for lines in space, or other points";
            return Err(vec![Issue::new(s.span, "points of a surface are for the model `shell`", help)]);
        }
        let (parts, surface) = crate::surface::parts(deck, &surfaces)?;
        return Ok((crate::surface::cloud(&parts, &surface, section.dimension()), Some(surface), parts));
    }
    if let Some((name, _)) = deck.materials.iter().find(|(_, m)| matches!(m.model, deck::Model::Shell(_))) {
        let help = "write for example `- surface: {shape: {cylinder: {radius: 1, length: 2, cells: [64, 20]}}}` under `points:`";
        return Err(vec![Issue::new(name.span, "a shell needs points of a `surface`", help)]);
    }
    if let Some((name, _)) =
        deck.materials.iter().find(|(_, m)| deck.body.dimensions() > 1 && matches!(m.model, deck::Model::BondPairBeam(_)))
    {
        let help = "write for example `- surface: {shape: {line: {from: [0, 0, 0], to: [1, 0, 0], cells: 20}}}` under `points:`";
        return Err(vec![Issue::new(name.span, "a beam in space needs points of a `surface` that is a line", help)]);
    }
    for source in &deck.body.points {
        let made = match source {
            Points::File(file) => crate::point_file::read(&deck.resolve(&file.path.value), Some(section.dimension()), section.measure())
                .map(|mut cloud| {
                    if let Some(spacing) = file.spacing {
                        cloud.spacing.fill(spacing.value);
                    }
                    cloud
                })
                .map_err(|e| e.to_string().lines().map(|line| Issue::new(file.path.span, line, "correct the file")).collect()),
            _ => generated(source, section).map_err(|e| vec![e]),
        };
        match made {
            Ok(cloud) => match &mut whole {
                Some(w) => w.join(&cloud),
                None => whole = Some(cloud),
            },
            Err(e) => issues.extend(e),
        }
    }
    let span = deck.body.span;
    if let Some(cloud) = &mut whole {
        if cloud.is_empty() {
            issues.push(Issue::new(span, "no points are left", "the cuts remove the whole body: check `minus` and `only`"));
        } else if deck.body.points.len() > 1 {
            // generators number their points from 0 each: number the joined cloud anew, unless a file gave the ids
            let from_file = deck.body.points.iter().any(|p| matches!(p, Points::File(_)));
            if !from_file {
                cloud.id = (0..cloud.len() as u64).collect();
            }
        }
        if let Err(e) = cloud.validate() {
            for error in e.first.iter() {
                issues.push(Issue::new(span, error.to_string(), "correct the points or the shapes that make them"));
            }
            if e.count > e.first.len() {
                issues.push(Issue::new(span, format!("… and {} faults of points more", e.count - e.first.len()), ""));
            }
        }
    }
    match whole {
        Some(cloud) if issues.is_empty() => Ok((cloud, None, vec![])),
        _ => Err(issues),
    }
}

fn generated(source: &Points, section: Section) -> Result<PointCloud, Issue> {
    let lattice = lattice_of(source).expect("files are read elsewhere");
    let a2 = |q: &[deck::Quantity<deck::Length>; 2]| q.each_ref().map(|q| q.value);
    let a3 = |q: &[deck::Quantity<deck::Length>; 3]| q.each_ref().map(|q| q.value);
    let inner = |q: &Option<deck::Quantity<deck::Length>>| q.map_or(0.0, |q| q.value);
    // points on edges: the lattice of cells that reach half a spacing beyond
    let beyond = match lattice.placement {
        deck::Placement::Centers => 0.0,
        deck::Placement::Edges => 0.5 * lattice.spacing.value,
    };
    if beyond > 0.0 && !matches!(source, Points::Line(_) | Points::Rectangle(_)) {
        return Err(Issue::new(
            lattice.spacing.span,
            format!("a `{}` has no points on its edges", source.name()),
            "use `line` or `rectangle`, or `placement: centers`",
        ));
    }
    let shape = match source {
        Points::Line(s) => generate::Shape::Line { from: s.from.value - beyond, to: s.to.value + beyond },
        Points::Rectangle(s) => generate::Shape::Rectangle { from: a2(&s.from).map(|x| x - beyond), to: a2(&s.to).map(|x| x + beyond) },
        Points::Box(s) => generate::Shape::Box { from: a3(&s.from), to: a3(&s.to) },
        Points::Disc(s) => generate::Shape::Disc { centre: a2(&s.center), radius: s.radius.value, inner_radius: inner(&s.inner_radius) },
        Points::Cylinder(s) => {
            generate::Shape::Cylinder { from: a3(&s.from), to: a3(&s.to), radius: s.radius.value, inner_radius: inner(&s.inner_radius) }
        }
        Points::Sphere(s) => {
            generate::Shape::Sphere { centre: a3(&s.center), radius: s.radius.value, inner_radius: inner(&s.inner_radius) }
        }
        Points::File(_) | Points::Surface(_) => unreachable!("files and surfaces are made elsewhere"),
    };
    let mut filling = Filling::of_spacing(lattice.spacing.value);
    filling.section = section.measure();
    filling.jitter = lattice.jitter.as_ref().map(|j| Jitter { amplitude: j.amplitude.value, seed: j.seed.value });
    if let Some(block) = &lattice.block {
        filling.block = block.value.clone();
    }
    let mut cloud = shape
        .fill(&filling)
        .map_err(|e| Issue::new(lattice.spacing.span, e.to_string(), "choose a spacing that divides the lengths, for example `L/100`"))?;
    for cut in &lattice.minus {
        let inside = region_of(cut);
        cloud.remove(&*inside);
    }
    if let Some(only) = &lattice.only {
        let inside = region_of(only);
        cloud.keep(&*inside);
    }
    // ids run without gaps over the points that are left
    cloud.id = (0..cloud.len() as u64).collect();
    Ok(cloud)
}

pub(crate) type Inside = Box<dyn Fn([f64; 3]) -> bool>;

pub(crate) fn region_of(region: &Region) -> Inside {
    match region {
        Region::Where(f) => {
            let f = f.clone();
            Box::new(move |x| f.eval(x, 0.0) > 0.0)
        }
        Region::Shape(shape) => shape_of(shape),
    }
}

fn shape_of(shape: &Shape) -> Inside {
    match shape {
        Shape::Polygon(corners) => polygon_of(corners),
        Shape::Disc(ball) => ball_of(ball),
        Shape::Box(bounds) => box_of(bounds),
    }
}

fn polygon_of(corners: &[[deck::Quantity<deck::Length>; 2]]) -> Inside {
    Box::new(region::polygon(corners.iter().map(|c| c.each_ref().map(|q| q.value)).collect()))
}

fn ball_of(ball: &deck::Ball) -> Inside {
    Box::new(region::ball(ball.center.point(), ball.radius.value))
}

fn box_of(bounds: &deck::Bounds) -> Inside {
    Box::new(region::cuboid(bounds.from.point(), bounds.to.point()))
}

fn nearest(cloud: &PointCloud, x: [f64; 3]) -> usize {
    let square = |p: usize| (0..cloud.dimension).map(|k| (cloud.position[p][k] - x[k]).powi(2)).sum::<f64>();
    (0..cloud.len()).min_by(|&a, &b| square(a).total_cmp(&square(b)).then(cloud.id[a].cmp(&cloud.id[b]))).unwrap_or(0)
}

fn sets(deck: &Deck, cloud: &PointCloud, surface: Option<&Surface>, issues: &mut Vec<Issue>) -> BTreeMap<String, Vec<u32>> {
    let mut known: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    known.insert("all".into(), (0..cloud.len() as u32).collect());
    for (b, name) in cloud.block_names.iter().enumerate() {
        known.insert(name.clone(), (0..cloud.len() as u32).filter(|&p| cloud.block[p as usize] == b as u32).collect());
    }
    for (name, points) in surface.iter().flat_map(|s| &s.sets) {
        let mut points = points.clone();
        points.sort_unstable();
        known.insert(name.clone(), points);
    }
    for (name, _) in deck.sets.iter() {
        if surface.is_some_and(|s| s.sets.contains_key(&name.value)) {
            issues.push(Issue::new(name.span, format!("the surface has a set `{}` of its own", name.value), "use another name"));
        }
        resolve(deck, cloud, &name.value, name.span, &mut vec![], &mut known, issues);
    }
    for (name, _) in deck.sets.iter() {
        if known.get(&name.value).is_some_and(Vec::is_empty) {
            issues.push(Issue::new(
                name.span,
                format!("the set `{}` has no points", name.value),
                "check its rule against the extent of the body",
            ));
        }
    }
    known
}

/// Evaluates a named set, and first the sets it names.
fn resolve(
    deck: &Deck,
    cloud: &PointCloud,
    name: &str,
    span: Span,
    open: &mut Vec<String>,
    known: &mut BTreeMap<String, Vec<u32>>,
    issues: &mut Vec<Issue>,
) -> Vec<u32> {
    if let Some(points) = known.get(name) {
        return points.clone();
    }
    let Some(set) = deck.sets.get(name) else {
        issues.push(Issue::new(span, format!("there is no set `{name}`"), "define it under `sets:`"));
        return vec![];
    };
    if open.iter().any(|o| o == name) {
        issues.push(Issue::new(span, format!("the set `{name}` is defined by itself"), "remove the circle"));
        return vec![];
    }
    open.push(name.into());
    let inside = members(deck, cloud, set, open, known, issues);
    open.pop();
    let points: Vec<u32> = (0..cloud.len() as u32).filter(|&p| inside[p as usize]).collect();
    known.insert(name.into(), points.clone());
    points
}

fn members(
    deck: &Deck,
    cloud: &PointCloud,
    set: &PointSet,
    open: &mut Vec<String>,
    known: &mut BTreeMap<String, Vec<u32>>,
    issues: &mut Vec<Issue>,
) -> Vec<bool> {
    let by = |inside: &dyn Fn([f64; 3]) -> bool| -> Vec<bool> { cloud.position.iter().map(|&x| inside(x)).collect() };
    let marked = |points: &[u32]| {
        let mut inside = vec![false; cloud.len()];
        points.iter().for_each(|&p| inside[p as usize] = true);
        inside
    };
    let rule = match set {
        PointSet::Name(name) => return marked(&resolve(deck, cloud, &name.value, name.span, open, known, issues)),
        PointSet::Rule(rule) => rule,
    };
    match rule {
        SetRule::Where(f) => by(&|x| f.eval(x, 0.0) > 0.0),
        SetRule::Box(b) => by(&*box_of(b)),
        SetRule::Disc(b) => by(&*ball_of(b)),
        SetRule::Polygon(c) => by(&*polygon_of(c)),
        SetRule::Nearest(x) => marked(&[nearest(cloud, x.point()) as u32]),
        SetRule::Ids(ids) => ids_of(cloud, ids.iter().map(|i| (i.value, i.span)), issues),
        SetRule::Layer(l) => {
            let (axis, last) = l.side.axis();
            layers(cloud, axis, last, l.count.value as usize)
        }
        SetRule::AllOf(parts) => {
            let all: Vec<Vec<bool>> = parts.iter().map(|s| members(deck, cloud, s, open, known, issues)).collect();
            (0..cloud.len()).map(|p| all.iter().all(|m| m[p])).collect()
        }
        SetRule::AnyOf(parts) => {
            let all: Vec<Vec<bool>> = parts.iter().map(|s| members(deck, cloud, s, open, known, issues)).collect();
            (0..cloud.len()).map(|p| all.iter().any(|m| m[p])).collect()
        }
        SetRule::Not(part) => members(deck, cloud, part, open, known, issues).into_iter().map(|m| !m).collect(),
        SetRule::File(path) => match crate::point_file::read_ids(&deck.resolve(&path.value)) {
            Ok(ids) => ids_of(cloud, ids.into_iter().map(|i| (i, path.span)), issues),
            Err(e) => {
                issues.push(Issue::new(path.span, e, "write one point id a line"));
                vec![false; cloud.len()]
            }
        },
    }
}

fn ids_of(cloud: &PointCloud, ids: impl Iterator<Item = (u64, Span)>, issues: &mut Vec<Issue>) -> Vec<bool> {
    let place: std::collections::HashMap<u64, usize> = cloud.id.iter().enumerate().map(|(p, &i)| (i, p)).collect();
    let mut inside = vec![false; cloud.len()];
    for (id, span) in ids {
        match place.get(&id) {
            Some(&p) => inside[p] = true,
            None => {
                issues.push(Issue::new(span, format!("there is no point with id {id}"), "ids are those of the point file, or count from 0"))
            }
        }
    }
    inside
}

/// The outermost `count` layers of points along an axis: coordinates that differ by less than a quarter spacing are one.
fn layers(cloud: &PointCloud, axis: usize, last: bool, count: usize) -> Vec<bool> {
    let sign = if last { -1.0 } else { 1.0 };
    let mut order: Vec<usize> = (0..cloud.len()).collect();
    order.sort_by(|&a, &b| (sign * cloud.position[a][axis]).total_cmp(&(sign * cloud.position[b][axis])));
    let mut inside = vec![false; cloud.len()];
    let (mut layer, mut level) = (0, f64::NAN);
    for p in order {
        let x = cloud.position[p][axis];
        if level.is_nan() || (x - level).abs() > 0.25 * cloud.spacing[p] {
            layer += 1;
            level = x;
        }
        if layer > count {
            break;
        }
        inside[p] = true;
    }
    inside
}

fn materials(deck: &Deck, cloud: &PointCloud, sets: &BTreeMap<String, Vec<u32>>, issues: &mut Vec<Issue>) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    let mut material = vec![NONE; cloud.len()];
    for (m, (name, typed)) in deck.materials.iter().enumerate() {
        let Some(points) = sets.get(&typed.points.value) else {
            issues.push(Issue::new(
                typed.points.span,
                format!("there is no set `{}`", typed.points.value),
                "define it under `sets:`, or use a block",
            ));
            continue;
        };
        if let Some(&p) = points.iter().find(|&&p| material[p as usize] != NONE) {
            let other = &deck.materials.0[material[p as usize] as usize].0.value;
            issues.push(Issue::new(
                typed.points.span,
                format!("point {} belongs to the materials `{other}` and `{}`", cloud.id[p as usize], name.value),
                "make the sets disjoint, for example with `all_of: [a, {not: b}]`",
            ));
        }
        points.iter().for_each(|&p| material[p as usize] = m as u32);
    }
    if let Some(p) = material.iter().position(|&m| m == NONE) {
        let count = material.iter().filter(|&&m| m == NONE).count();
        if let Some((name, _)) = deck.materials.iter().next() {
            issues.push(Issue::new(
                name.span,
                format!("{count} points have no material, the first is point {}", cloud.id[p]),
                "assign one: `points: all`, or a set that holds them",
            ));
        }
    }
    material
}

/// Contradictions: one component of one point prescribed twice with different values, or velocities in statics.
fn conditions(deck: &Deck, cloud: &PointCloud, sets: &BTreeMap<String, Vec<u32>>, issues: &mut Vec<Issue>) {
    let known = issues.len();
    let statics = !matches!(deck.solver, Solver::VelocityVerlet(_));
    let end = match &deck.solver {
        Solver::VelocityVerlet(v) => v.end.map_or(1.0, |e| e.value),
        Solver::Statics(s) => s.end.value,
        Solver::DynamicRelaxation(s) => s.end.value,
        Solver::Buckling(b) => b.end.value,
        Solver::Vibration(_) | Solver::Spectrum(_) => 1.0,
    };
    without_value(deck, cloud, sets, end, issues);
    type Seen<'a> = BTreeMap<(u32, usize), (usize, &'a Condition)>;
    let mut seen: Seen = BTreeMap::new();
    for (n, c) in deck.conditions.iter().enumerate() {
        if let Some(set) = c.set()
            && !sets.contains_key(&set.value)
        {
            issues.push(Issue::new(set.span, format!("there is no set `{}`", set.value), "define it under `sets:`, or use a block"));
            continue;
        }
        match c {
            Condition::Velocity(v) if statics => {
                issues.push(Issue::new(v.span, "a velocity cannot be prescribed in statics", "prescribe a displacement"))
            }
            Condition::InitialVelocity(v) if statics => {
                issues.push(Issue::new(v.span, "statics have no initial velocity", "remove it, or use `velocity_verlet`"))
            }
            Condition::Symmetry(s) if s.axis().is_some_and(|axis| axis.index() >= cloud.dimension) => {
                issues.push(Issue::new(
                    s.span,
                    "the symmetry plane is normal to a direction the body does not have",
                    "choose another `normal`",
                ));
            }
            Condition::RigidWall(w) if w.normal.len() != cloud.dimension => {
                issues.push(Issue::new(
                    w.span,
                    format!("the wall is given in {} dimensions, the body has {}", w.normal.len(), cloud.dimension),
                    "give as many components as the body has dimensions",
                ));
            }
            _ => {}
        }
        if !matches!(c, Condition::Displacement(_) | Condition::Velocity(_)) || c.direction().is_some() {
            continue;
        }
        let components = components(c);
        let Some(points) = c.set().and_then(|s| sets.get(&s.value)) else { continue };
        let mut told = false;
        for &p in points {
            for k in (0..cloud.dimension).filter(|&k| components[k].is_some()) {
                match seen.get(&(p, k)) {
                    None => {
                        seen.insert((p, k), (n, c));
                    }
                    Some((_, other)) if !told => {
                        let x = cloud.position[p as usize];
                        let same = std::mem::discriminant(*other) == std::mem::discriminant(c)
                            && [0.0, 0.37, 1.0].iter().all(|s| prescribed(other, k, x, s * end) == prescribed(c, k, x, s * end));
                        if !same {
                            told = true;
                            let axis = ["x", "y", "z"][k];
                            issues.push(Issue::new(
                                components[k].unwrap_or(c.span()),
                                format!(
                                    "component {axis} of point {} is prescribed by `{}` and, differently, by `{}`",
                                    cloud.id[p as usize],
                                    other.label(),
                                    c.label()
                                ),
                                "make the sets disjoint, or the values equal",
                            ));
                        }
                    }
                    Some(_) => {}
                }
            }
        }
    }
    if issues.len() == known {
        directions(deck, cloud, sets, end, issues);
    }
}

/// Expressions of conditions that have no value somewhere, at the end or on the way. (At the start they need none: loads may begin there.)
fn without_value(deck: &Deck, cloud: &PointCloud, sets: &BTreeMap<String, Vec<u32>>, end: f64, issues: &mut Vec<Issue>) {
    type Given<'a> = (Span, Box<dyn Fn([f64; 3], f64) -> f64 + 'a>);
    macro_rules! given {
        ($($field:expr),*) => {
            [$($field.as_ref().map(|f| (f.span, Box::new(move |x, t| f.eval(x, t)) as Box<dyn Fn([f64; 3], f64) -> f64>))),*].into_iter().flatten().collect()
        };
    }
    for c in &deck.conditions {
        let fields: Vec<Given> = match c {
            Condition::Displacement(d) => given!(d.x, d.y, d.z, d.along),
            Condition::Velocity(d) => given!(d.x, d.y, d.z, d.along),
            Condition::ForceDensity(d) => given!(d.x, d.y, d.z),
            Condition::Traction(d) => given!(d.x, d.y, d.z),
            _ => continue,
        };
        let points = c.set().and_then(|s| sets.get(&s.value)).map_or(&[][..], Vec::as_slice);
        for (span, value) in fields {
            let bad = points.iter().find_map(|&p| {
                let x = cloud.position[p as usize];
                [0.37, 1.0].map(|s| (s * end, value(x, s * end))).into_iter().find(|v| !v.1.is_finite()).map(|v| (p, x, v))
            });
            if let Some((p, x, (t, value))) = bad {
                issues.push(Issue::new(
                    span,
                    format!(
                        "the expression is {value} at point {} at ({:.6e}, {:.6e}, {:.6e}) and t = {t:.6e}",
                        cloud.id[p as usize], x[0], x[1], x[2]
                    ),
                    "let it have a finite value at every point of the set and every time of the run",
                ));
            }
        }
    }
}

/// Contradictions at points where a direction is prescribed that is no axis: what is prescribed along a direction must be what others say of it.
fn directions(deck: &Deck, cloud: &PointCloud, sets: &BTreeMap<String, Vec<u32>>, end: f64, issues: &mut Vec<Issue>) {
    let d = cloud.dimension;
    type Given<'a> = (&'a Condition, usize, [f64; 3]);
    let mut at: BTreeMap<u32, Vec<Given>> = BTreeMap::new();
    let points = |c: &Condition| c.set().and_then(|s| sets.get(&s.value)).map_or(&[][..], Vec::as_slice);
    let inclined: Vec<&Condition> = deck.conditions.iter().filter(|c| c.direction().is_some()).collect();
    for &p in inclined.iter().flat_map(|c| points(c)) {
        at.entry(p).or_default();
    }
    if let (Solver::Statics(deck::Statics { control: deck::StaticControl::Displacement(control), .. }), Some(c)) =
        (&deck.solver, inclined.first())
        && sets.get(&control.over.value).is_some_and(|over| over.iter().any(|p| at.contains_key(p)))
    {
        let message = format!("the set `{}` has points that `{}` holds along a direction of its own", control.over.value, c.label());
        issues.push(Issue::new(control.over.span, message, "control points that are free, or held along axes"));
    }
    for c in &deck.conditions {
        let prescribes = matches!(c, Condition::Displacement(_) | Condition::Velocity(_)) || c.direction().is_some();
        let components = components(c);
        for p in points(c).iter().filter(|_| prescribes) {
            let Some(list) = at.get_mut(p) else { continue };
            match c.direction() {
                Some(direction) => list.push((c, 0, direction)),
                None => list.extend((0..d).filter(|&k| components[k].is_some()).map(|k| (c, k, unit(k)))),
            }
        }
    }
    let mut told: Vec<*const Condition> = vec![];
    for (p, given) in at {
        let x = cloud.position[p as usize];
        let mut axes = Axes::new();
        let mut kept: Vec<Given> = vec![];
        for (c, k, direction) in given {
            let velocity = |c: &Condition| matches!(c, Condition::Velocity(_));
            let wrong = if kept.first().is_some_and(|first| velocity(first.0) != velocity(c)) {
                Some("prescribes a velocity, another a displacement".to_owned())
            } else if let Place::Known(factors) = axes.add(kept.len(), direction) {
                let same = [0.0, 0.37, 1.0].iter().all(|s| {
                    let values: Vec<f64> = kept.iter().map(|(c, k, _)| prescribed(c, *k, x, s * end).unwrap_or(0.0)).collect();
                    let expected: f64 = factors.iter().zip(&values).map(|(f, v)| f * v).sum();
                    let own = prescribed(c, k, x, s * end).unwrap_or(0.0);
                    (own - expected).abs() <= 1e-9 * values.iter().fold(own.abs(), |m, v| m.max(v.abs()))
                });
                (!same).then(|| "prescribes along a direction that others hold already, and differently".to_owned())
            } else {
                kept.push((c, k, direction));
                None
            };
            if let (Some(what), false) = (wrong, told.contains(&std::ptr::from_ref(c))) {
                told.push(c);
                let others: Vec<String> = kept.iter().map(|(c, ..)| format!("`{}`", c.label())).collect();
                issues.push(Issue::new(
                    c.span(),
                    format!("at point {} `{}` {what}: {}", cloud.id[p as usize], c.label(), others.join(", ")),
                    "make the sets disjoint, or the values agree",
                ));
            }
        }
    }
}

/// The unit vector along an axis.
fn unit(k: usize) -> [f64; 3] {
    std::array::from_fn(|q| f64::from(u8::from(q == k)))
}

/// The places of the components that a condition prescribes.
fn components(c: &Condition) -> [Option<Span>; 3] {
    match c {
        Condition::Displacement(d) => [&d.x, &d.y, &d.z].map(|f| f.as_ref().map(|f| f.span)),
        Condition::Velocity(d) => [&d.x, &d.y, &d.z].map(|f| f.as_ref().map(|f| f.span)),
        _ => [None; 3],
    }
}

/// The value that a condition prescribes.
fn prescribed(c: &Condition, k: usize, x: [f64; 3], t: f64) -> Option<f64> {
    match c {
        Condition::Displacement(d) if d.direction.is_some() => d.along.as_ref().map(|f| f.eval(x, t)),
        Condition::Velocity(d) if d.direction.is_some() => d.along.as_ref().map(|f| f.eval(x, t)),
        Condition::Displacement(d) => [&d.x, &d.y, &d.z][k].as_ref().map(|f| f.eval(x, t)),
        Condition::Velocity(d) => [&d.x, &d.y, &d.z][k].as_ref().map(|f| f.eval(x, t)),
        _ => None,
    }
}

fn cracks(deck: &Deck, issues: &mut Vec<Issue>) -> Option<Cracks> {
    if deck.body.cracks.is_empty() {
        return None;
    }
    let a2 = |q: &[deck::Quantity<deck::Length>; 2]| q.each_ref().map(|q| q.value);
    let a3 = |q: &[deck::Quantity<deck::Length>; 3]| q.each_ref().map(|q| q.value);
    let list: Vec<(Crack, Span)> = deck
        .body
        .cracks
        .iter()
        .map(|c| match c {
            deck::Crack::Segment(c) => (Crack::Segment { from: a2(&c.from), to: a2(&c.to) }, c.span),
            deck::Crack::Rectangle(c) => (Crack::Parallelogram { corner: a3(&c.corner), edges: c.edges.each_ref().map(a3) }, c.span),
            deck::Crack::Disc(c) => {
                (Crack::Disc { centre: a3(&c.center), normal: c.normal.each_ref().map(|q| q.value), radius: c.radius.value }, c.span)
            }
            deck::Crack::Point(c) => (Crack::Point { at: c.at.value }, c.span),
        })
        .collect();
    let cracks: Vec<Crack> = list.iter().map(|c| c.0).collect();
    match Cracks::new(&cracks, deck.body.dimensions()) {
        Ok(cracks) => Some(cracks),
        Err(e) => {
            let (number, what, remedy) = match &e {
                CrackError::NotFinite { number, .. } => (*number, "the crack has a value that is not finite".into(), "correct it"),
                CrackError::Degenerate { number, .. } => (
                    *number,
                    "the crack has no extent".into(),
                    "give two different points, or edges, a normal and a radius that do not vanish",
                ),
                CrackError::Dimension { number, dimension, .. } => (
                    *number,
                    format!("the body has {dimension} dimensions, which this crack does not fit"),
                    "use a `point` in one dimension, a `segment` in two, a `rectangle` or `disc` in three",
                ),
            };
            issues.push(Issue::new(list[number].1, what, remedy));
            None
        }
    }
}

/// Fields in files that results are compared with must have a line at each point that they are compared at.
fn references(deck: &Deck, cloud: &PointCloud, sets: &BTreeMap<String, Vec<u32>>, issues: &mut Vec<Issue>) {
    for error in deck.expectations().chain(deck.measures()).filter_map(|e| e.error.as_ref()) {
        if let (Some(csv), Some(points)) = (&error.csv, sets.get(&error.over.value))
            && let Err(message) = reference_field(deck, cloud, error, points)
        {
            issues.push(Issue::new(csv.span, message, "the file needs columns x, y, z as the body has dimensions, and the reference"));
        }
    }
}

fn reference_field(deck: &Deck, cloud: &PointCloud, error: &deck::FieldError, points: &[u32]) -> Result<Vec<f64>, String> {
    let Some(csv) = &error.csv else { return Ok(vec![]) };
    let position: Vec<[f64; 3]> = points.iter().map(|&p| cloud.position[p as usize]).collect();
    let spacing: Vec<f64> = points.iter().map(|&p| cloud.spacing[p as usize]).collect();
    crate::reference::field_at(&deck.resolve(&csv.value), &error.column.value, &position, &spacing, cloud.dimension)
}

/// The axis letter of a component.
pub fn axis_name(k: usize) -> &'static str {
    [Axis::X, Axis::Y, Axis::Z][k].name()
}
