//! From names to types: the only place that matches on models, laws, controls and dimension.

use crate::deck::{
    self, BondLaw, Calibration, Condition, Criterion as CriterionName, DeckErrors, Influence as InfluenceName, Issue, Law as LawName,
    Orientation, SpaceField, ThermalExpansion,
};
use crate::problem::Problem;
use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::damage::Criterion;
use bodies::loads::{self, Field, Kind, Wall};
use bodies::part::{Constants, Part};
use bodies::structure::{Failure, Parts, Simulated, Structure, Temperature};
use catalog::{BondStrains, Catalog, Compiled, Law, Model, Place, SmoothLaw, StrainLaw};
use physics::constitutive::{
    HyperelasticConstants, J2PlasticityConstants, KelvinVoigtConstants, NeoHookeanConstants, OfStrainConstants, StrainMeasure,
};
use physics::elasticity::{self, Isotropic, Section, Stiffness};
use physics::failure::{CrackPlane, continuum_critical_bond_energy, continuum_critical_stretch, crossing_energy};
use physics::influence::Radial;
use physics::models::{
    BondBasedConstants, BondStrainCalibration, EmptySubHorizon, LARGEST_ORDER, LinearPeridynamicSolidConstants, SethHill,
};
use physics::stretch_law::{Bilinear, ElasticPlastic, Nonlinear, Tabulated};
use physics::sub_horizon::Partition;
use physics::tensor::Vector;
use physics::zero_energy::{self, AnyControl};

/// A constant that was derived from the deck: name, value, unit (of the deck's system).
pub type Derived = (String, f64, &'static str);

/// A body ready to be advanced, whatever its dimension and models, and the constants derived on the way.
pub struct Assembly {
    /// The body with its conditions.
    pub model: Box<dyn Simulated>,
    /// Derived constants.
    pub derived: Vec<Derived>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Builds the body of a problem.
///
/// # Errors
/// What only shows when shapes and constants are computed: singular families, unstable constants.
pub fn assemble(problem: &Problem) -> Result<Assembly, DeckErrors> {
    let made = match problem.section.dimension() {
        _ if problem.thin => crate::thin_registry::assemble(problem),
        1 => build::<1>(problem),
        2 => build::<2>(problem),
        _ => build::<3>(problem),
    };
    made.map_err(|issues| problem.deck.errors(issues))
}

type Checked<T> = Result<T, Vec<Issue>>;

fn build<const D: usize>(problem: &Problem) -> Checked<Assembly>
where
    Catalog: Compiled<D>,
{
    let (cloud, deck) = (&problem.cloud, &problem.deck);
    let n = cloud.len();
    let materials: Vec<&deck::Material> = deck.materials.iter().map(|(_, m)| m).collect();
    let weighted = materials.iter().any(|m| stores_influence(problem, m));
    let weights = Weights::new(problem);
    // one number for the body: a family of fewer sub-horizons leaves the others empty
    let sub_horizons = materials.iter().map(|m| planes(m, D)).max().unwrap_or(0);
    let geometry = Geometry { position: &cloud.position, volume: &cloud.volume, horizon: &problem.horizon };
    let mut body = Body::<D>::new(&geometry, weighted, sub_horizons, |p, out: &mut Vec<Link>| {
        problem.families.add_links(&cloud.position, p, out);
        if weighted {
            weights.fill::<D>(problem, materials[problem.material[p] as usize], p, out);
        }
        if sub_horizons > 0 {
            divide::<D>(problem, materials[problem.material[p] as usize], p, out);
        }
    });
    let mut parts: Vec<Box<dyn Part<D>>> = vec![];
    for (m, (name, material)) in deck.materials.iter().enumerate() {
        let points: Vec<u32> = (0..n as u32).filter(|&p| problem.material[p as usize] == m as u32).collect();
        let site = Site { problem, material, points: &points };
        let weighted = stores_influence(problem, material);
        let place = Place { name: &name.value, points: &points, chunks: body.chunks(), weighted, sub_horizons };
        parts.push(Catalog::part(model::<D>(&site)?, &place));
    }
    if let Err(singular) = body.assign(parts) {
        let p = singular[0];
        let issue = Issue::new(
            deck.body.horizon.span,
            format!(
                "{} families are singular: too few bonds, or all in a line or plane; the first is that of point {}",
                singular.len(),
                cloud.id[p]
            ),
            "enlarge the horizon, or give the thin part more points across",
        );
        return Err(vec![issue]);
    }
    let mut derived = vec![];
    let mut warnings = vec![];
    let mut failure = vec![];
    for (material, what, families) in body.shortfalls() {
        derived.push((format!("{material}: {what}"), families as f64, ""));
    }
    for (m, (name, material)) in deck.materials.iter().enumerate() {
        if let Some(damage) = &material.damage {
            let more = thresholds(problem, &body, m as u32, &name.value, material, damage, &mut derived)?;
            join(&mut failure, more);
        }
    }
    if let Some(cracks) = &problem.cracks {
        let broken = body.cut(|a, b| cracks.cut(a, b));
        derived.push(("bonds cut by cracks".into(), broken.bonds as f64 / 2.0, ""));
        if broken.bonds == 0 {
            warnings.push("the cracks cut no bond: check their place".into());
        }
        if broken.released > 0 {
            warnings.push(format!("the cracks leave {} points with a singular family; their bonds were released", broken.released));
        }
    }
    if problem.hidden_bonds > 0 {
        derived.push(("bonds left out across voids".into(), problem.hidden_bonds as f64 / 2.0, ""));
    }
    let conditions = conditions(problem);
    let temperature = deck.temperature.as_ref().map(|t| {
        let field = t.field.clone();
        Temperature { field: Box::new(move |x, time| field.eval(x, time)) as Field, reference: t.reference.value }
    });
    let density =
        (0..n).map(|p| materials[problem.material[p] as usize].density.as_ref().map_or(1.0, |d| d.eval(cloud.position[p], 0.0))).collect();
    let parts = Parts { id: cloud.id.clone(), user: problem.user.clone(), material: problem.material.clone(), density };
    let structure = Structure::new(body, parts, conditions, temperature, failure, problem.end().unwrap_or(0.0));
    Ok(Assembly { model: Catalog::simulated(structure), derived, warnings })
}

/// Where a model is made: a material of the deck and its points.
struct Site<'a> {
    problem: &'a Problem,
    material: &'a deck::Material,
    points: &'a [u32],
}

impl Site<'_> {
    /// Constants per point, or one for all where nothing depends on the place.
    fn constants<C>(&self, uniform: bool, at: impl Fn([f64; 3]) -> Result<C, Issue>) -> Checked<Constants<C>>
    where
        C: Clone,
    {
        if let Some(place) = self.problem.constants_at {
            return at(place).map(Constants::Uniform).map_err(|i| vec![i]);
        }
        let position = &self.problem.cloud.position;
        if uniform {
            return at(position[self.points.first().map_or(0, |&p| p as usize)]).map(Constants::Uniform).map_err(|i| vec![i]);
        }
        // points of other materials get the constants of the nearest listed point before them: never looked at
        let mut all = Vec::with_capacity(position.len());
        let mut mine = self.points.iter().peekable();
        let first = at(position[self.points[0] as usize]).map_err(|i| vec![i])?;
        for (p, &x) in position.iter().enumerate() {
            if mine.peek() == Some(&&(p as u32)) {
                mine.next();
                all.push(at(x).map_err(|i| vec![i])?);
            } else {
                all.push(first.clone());
            }
        }
        Ok(Constants::PerPoint(all))
    }
}

/// The model of a material, with its constants.
fn model<const D: usize>(site: &Site) -> Checked<Model<D>> {
    let section = site.problem.section;
    match &site.material.model {
        deck::Model::BondBased(b) => {
            check_bond_based_poisson(site, b)?;
            let constants = site.constants(b.youngs_modulus.constant().is_some(), |x| {
                let young = b.youngs_modulus.eval(x, 0.0);
                Ok(BondBasedConstants { young, section, continuum: matches!(b.calibration, Calibration::Continuum) })
            })?;
            let law = match &b.bond_law {
                BondLaw::Elastic => return Ok(Model::ElasticBonds(constants)),
                BondLaw::TensionOnly => Nonlinear::TensionOnly,
                BondLaw::Bilinear(l) => Nonlinear::Bilinear(Bilinear { peak: l.peak_stretch.value, failure: l.failure_stretch.value }),
                BondLaw::ElasticPlastic(l) => Nonlinear::ElasticPlastic(ElasticPlastic { yield_stretch: l.yield_stretch.value }),
                BondLaw::Expression(l) => {
                    let [low, high] = l.range.each_ref().map(|q| q.value);
                    Nonlinear::Tabulated(Tabulated::new(low, high, 4096, |s| l.force.at(s)))
                }
            };
            Ok(Model::NonlinearBonds(law, constants))
        }
        deck::Model::LinearPeridynamicSolid(l) => {
            if D == 1 {
                return Err(vec![Issue::new(
                    l.span,
                    "the linear peridynamic solid has no one-dimensional form",
                    "use `bond_based` for a bar",
                )]);
            }
            let e = &l.elasticity;
            let source =
                IsotropicSource { e: &e.youngs_modulus, nu: &e.poisson_ratio, k: &e.bulk_modulus, g: &e.shear_modulus, span: l.span };
            let rebuild = matches!(l.weighted_volume, deck::WeightedVolume::Intact);
            let constants = site.constants(source.is_constant(), |x| {
                let constants = LinearPeridynamicSolidConstants::new(source.at(x, section)?, section);
                Ok(if rebuild { constants.rebuilt() } else { constants })
            })?;
            Ok(Model::LinearPeridynamicSolid(constants))
        }
        deck::Model::ExtendedCorrespondence(m) => extended::<D>(site, m),
        deck::Model::Correspondence(c) => {
            let control = match c.control.as_ref().map(|c| &c.value) {
                // in one dimension the tensor is a number
                Some(deck::Control::Wan2019) if D > 1 => AnyControl::Wan2019,
                Some(deck::Control::None) => AnyControl::Isotropic(zero_energy::Isotropic::None),
                None | Some(deck::Control::Wan2019 | deck::Control::Wan2019Objective) => {
                    AnyControl::Isotropic(zero_energy::Isotropic::Wan2019)
                }
                Some(deck::Control::Silling2017(s)) => {
                    AnyControl::Isotropic(zero_energy::Isotropic::Silling2017 { strength: s.strength.value })
                }
            };
            let law = law::<D>(site, &c.law)?;
            match (&c.kinematics, law) {
                (deck::Kinematics::WholeFamily, law) => Ok(Model::Correspondence(law, control)),
                (deck::Kinematics::Corrected(k), Law::Smooth(law)) => {
                    let order = k.order.value as usize;
                    if order == 0 || order > LARGEST_ORDER[D - 1] {
                        return Err(vec![Issue::new(
                            k.order.span,
                            format!("an order of {order} is not available in {D}D"),
                            format!("give 1 to {}", LARGEST_ORDER[D - 1]),
                        )]);
                    }
                    let AnyControl::Isotropic(control) = control else {
                        return Err(vec![Issue::new(
                            c.control.as_ref().map_or(c.span, |c| c.span),
                            "a corrected influence function takes isotropic controls only",
                            "use `wan_2019_objective`, `silling_2017` or `none`",
                        )]);
                    };
                    Ok(Model::Corrected(law, control, order))
                }
                (deck::Kinematics::SubHorizons(s), Law::Smooth(law)) => {
                    if let Some(control) = c.control.as_ref().filter(|c| !matches!(c.value, deck::Control::None)) {
                        return Err(vec![Issue::new(
                            control.span,
                            "sub-horizons have no zero-energy modes, and take no control",
                            "remove `control`",
                        )]);
                    }
                    let count = partition(s, D).count(D).map_err(|e| vec![Issue::new(s.span, e.what, e.remedy)])?;
                    let empty = match s.empty_sub_horizon {
                        deck::EmptySubHorizonName::Renormalise => EmptySubHorizon::Renormalise,
                        deck::EmptySubHorizonName::ZeroEnergy => EmptySubHorizon::ZeroEnergy { of: count as u32 },
                    };
                    Ok(Model::SubHorizons(law, empty))
                }
                (_, _) => Err(vec![Issue::new(
                    c.span,
                    "this law works with one deformation gradient of the whole family",
                    "use `kinematics: whole_family`, or a law with an energy",
                )]),
            }
        }
        deck::Model::BondPairBeam(_) | deck::Model::BondMultiplePlate(_) | deck::Model::Shell(_) => Err(vec![thin_model(site.material)]),
    }
}

/// Beams and plates are bodies of their own.
fn thin_model(m: &deck::Material) -> Issue {
    Issue::new(m.points.span, "a beam or plate does not mix with solids", "give all points the one material of the beam or plate")
}

/// Extended correspondence, with its constants.
fn extended<const D: usize>(site: &Site, m: &deck::ExtendedCorrespondence) -> Checked<Model<D>> {
    let section = site.problem.section;
    let law = match &m.law {
        deck::StrainLaw::LinearElastic(e) => StrainLaw::Elastic(site.constants(is_constant(e), |x| stiffness_at::<D>(e, x, section))?),
        deck::StrainLaw::J2Plasticity(j) => {
            let (uniform, at) = plasticity(j, section);
            StrainLaw::Plastic(site.constants(uniform, at)?)
        }
    };
    let exponent = SethHill::new(m.exponent.value)
        .map_err(|e| vec![Issue::new(m.exponent.span, e.to_string(), "give an exponent between -2 and 2: 0 is the logarithmic strain")])?;
    let calibration = match m.calibration {
        deck::StrainCalibration::MomentTensor => BondStrainCalibration::MomentTensor,
        deck::StrainCalibration::TruncatedMomentTensor => BondStrainCalibration::TruncatedMomentTensor,
        deck::StrainCalibration::AsPublished => BondStrainCalibration::AsPublished,
    };
    Ok(Model::Extended(law, BondStrains { exponent, calibration, control: m.control.value }))
}

/// The constants of a plastic law by place, and whether they are the same everywhere.
fn plasticity(j: &deck::J2Plasticity, section: Section) -> (bool, impl Fn([f64; 3]) -> Result<J2PlasticityConstants, Issue>) {
    let e = &j.elasticity;
    let source = IsotropicSource { e: &e.youngs_modulus, nu: &e.poisson_ratio, k: &e.bulk_modulus, g: &e.shear_modulus, span: j.span };
    let uniform = source.is_constant()
        && j.yield_stress.constant().is_some()
        && j.hardening_modulus.constant().is_some()
        && j.thermal_expansion.as_ref().is_none_or(|a| a.constant().is_some());
    let at = move |x: [f64; 3]| {
        let expansion = j.thermal_expansion.as_ref().map_or(0.0, |a| a.eval(x, 0.0));
        let (y, h) = (j.yield_stress.eval(x, 0.0), j.hardening_modulus.eval(x, 0.0));
        J2PlasticityConstants::new(source.at(x, section)?, y, h, expansion, section)
            .map_err(|e| Issue::new(j.span, e.to_string(), "correct the constant, or its expression at this place"))
    };
    (uniform, at)
}

/// The partition a deck names. In a dimension that does not have it, [`Partition::count`] refuses it.
fn partition(s: &deck::SubHorizons, d: usize) -> Partition {
    use deck::PartitionName as Name;
    let n = |c: &deck::Count| c.value as usize;
    match &s.partition {
        Name::Automatic => Partition::Automatic(if d == 3 { 8 } else { 2 * d }),
        Name::AtMost(c) => Partition::Automatic(n(c)),
        Name::Intervals(c) => Partition::Intervals(n(c)),
        Name::Quadrants if d == 2 => Partition::Orthants,
        Name::Octants if d == 3 => Partition::Orthants,
        Name::Quadrants => Partition::Sectors(4),
        Name::Octants => Partition::Cones(8),
        Name::Sectors(c) => Partition::Sectors(n(c)),
        Name::Cones(c) => Partition::Cones(n(c)),
    }
}

/// Sub-horizons of a material, if its kinematics have any.
fn sub_horizons(m: &deck::Material) -> Option<&deck::SubHorizons> {
    match &m.model {
        deck::Model::Correspondence(deck::Correspondence { kinematics: deck::Kinematics::SubHorizons(s), .. }) => Some(s),
        _ => None,
    }
}

/// Numbers of sub-horizons whose membership the bonds store. Partitions that do not fit the dimension store none: they are refused
/// with their material.
fn planes(m: &deck::Material, d: usize) -> usize {
    let history = matches!(&m.model, deck::Model::Correspondence(c) if matches!(c.law, LawName::J2Plasticity(_)));
    sub_horizons(m).and_then(|s| partition(s, d).count(d).ok()).map_or(0, |n| catalog::sub_horizon_planes(d, n, history))
}

/// A constitutive law, with its constants.
fn law<const D: usize>(site: &Site, law: &LawName) -> Checked<Law<D>> {
    let section = site.problem.section;
    Ok(match law {
        LawName::LinearElastic(e) => Law::Smooth(SmoothLaw::Hyperelastic(
            site.constants(is_constant(e), |x| Ok(HyperelasticConstants::LinearElastic(stiffness_at::<D>(e, x, section)?)))?,
        )),
        LawName::SaintVenantKirchhoff(e) => Law::Smooth(SmoothLaw::Hyperelastic(
            site.constants(is_constant(e), |x| Ok(HyperelasticConstants::SaintVenantKirchhoff(stiffness_at::<D>(e, x, section)?)))?,
        )),
        LawName::J2Plasticity(j) => {
            let measure = match j.strain {
                deck::PlasticStrain::Small => StrainMeasure::Small,
                deck::PlasticStrain::Logarithmic => StrainMeasure::Logarithmic,
            };
            let (uniform, at) = plasticity(j, section);
            Law::Smooth(SmoothLaw::Plastic(site.constants(uniform, |x| Ok(OfStrainConstants { measure, law: at(x)? }))?))
        }
        LawName::NeoHookean(n) => {
            let e = &n.elasticity;
            let source =
                IsotropicSource { e: &e.youngs_modulus, nu: &e.poisson_ratio, k: &e.bulk_modulus, g: &e.shear_modulus, span: n.span };
            let uniform = source.is_constant() && n.thermal_expansion.as_ref().is_none_or(|a| a.constant().is_some());
            Law::Smooth(SmoothLaw::Hyperelastic(site.constants(uniform, |x| {
                let expansion = n.thermal_expansion.as_ref().map_or(0.0, |a| a.eval(x, 0.0));
                Ok(HyperelasticConstants::NeoHookean(NeoHookeanConstants { elastic: source.at(x, section)?, expansion, section }))
            })?))
        }
        LawName::KelvinVoigt(k) => {
            let uniform = k.retardation_time.constant().is_some() && is_constant(&k.elasticity);
            Law::KelvinVoigt(site.constants(uniform, |x| {
                let stiffness = stiffness_at::<D>(&k.elasticity, x, section)?;
                Ok(KelvinVoigtConstants { stiffness, retardation_time: k.retardation_time.eval(x, 0.0) })
            })?)
        }
        LawName::Almansi(e) => {
            if let Some(t) = &site.problem.deck.temperature {
                return Err(vec![Issue::new(t.span, "the law `almansi` knows no temperature", "use another law, or remove `temperature`")]);
            }
            let source =
                IsotropicSource { e: &e.youngs_modulus, nu: &e.poisson_ratio, k: &e.bulk_modulus, g: &e.shear_modulus, span: e.span };
            Law::Almansi(site.constants(source.is_constant(), |x| Ok((source.at(x, section)?, section)))?)
        }
    })
}

fn check_bond_based_poisson(site: &Site, b: &deck::BondBased) -> Checked<()> {
    let (Some(given), Some(fixed)) = (&b.poisson_ratio, BondBasedConstants::poisson(site.problem.section)) else { return Ok(()) };
    let wrong = site
        .points
        .iter()
        .map(|&p| given.eval(site.problem.constants_at.unwrap_or(site.problem.cloud.position[p as usize]), 0.0))
        .find(|nu| (nu - fixed).abs() > 1e-6);
    match wrong {
        None => Ok(()),
        Some(nu) => Err(vec![Issue::new(
            given.span,
            format!("a bond-based solid of this kind has Poisson's ratio {fixed:.4}, not {nu}"),
            "leave `poisson_ratio` out, or use `linear_peridynamic_solid`",
        )]),
    }
}

/// Two isotropic constants as fields.
struct IsotropicSource<'a> {
    e: &'a Option<SpaceField<deck::Pressure>>,
    nu: &'a Option<SpaceField<deck::Number>>,
    k: &'a Option<SpaceField<deck::Pressure>>,
    g: &'a Option<SpaceField<deck::Pressure>>,
    span: deck::Span,
}

impl IsotropicSource<'_> {
    fn is_constant(&self) -> bool {
        [self.e, self.k, self.g].into_iter().flatten().all(|f| f.constant().is_some())
            && self.nu.as_ref().is_none_or(|f| f.constant().is_some())
    }
    fn at(&self, x: [f64; 3], section: Section) -> Result<Isotropic, Issue> {
        let v = |f: &Option<SpaceField<deck::Pressure>>| f.as_ref().map(|f| f.eval(x, 0.0));
        let nu = self.nu.as_ref().map(|f| f.eval(x, 0.0));
        let m = match (v(self.e), nu, v(self.k), v(self.g)) {
            (Some(young), Some(poisson), ..) => Isotropic { young, poisson },
            (Some(e), _, Some(k), _) => Isotropic { young: e, poisson: (3.0 * k - e) / (6.0 * k) },
            (Some(e), _, _, Some(g)) => Isotropic { young: e, poisson: e / (2.0 * g) - 1.0 },
            (_, Some(nu), Some(k), _) => Isotropic { young: 3.0 * k * (1.0 - 2.0 * nu), poisson: nu },
            (_, Some(nu), _, Some(g)) => Isotropic { young: 2.0 * g * (1.0 + nu), poisson: nu },
            (_, _, Some(k), Some(g)) => Isotropic::from_bulk_shear(k, g),
            // nothing in a bar depends on it
            (Some(young), None, None, None) if matches!(section, Section::Bar { .. }) => Isotropic { young, poisson: 0.0 },
            _ => return Err(Issue::new(self.span, "two elastic constants are needed", "give `youngs_modulus` and `poisson_ratio`")),
        };
        let incompressible = m.poisson >= 0.5 - 1e-9 && !matches!(section, Section::Bar { .. } | Section::PlaneStress { .. });
        if m.poisson.is_nan() || m.poisson <= -1.0 || m.poisson > 0.5 || incompressible || m.young.is_nan() || m.young <= 0.0 {
            return Err(Issue::new(
                self.span,
                format!("Young's modulus {:.6e} with Poisson's ratio {:.6} is no stable elastic solid here", m.young, m.poisson),
                "Poisson's ratio lies above -1 and below 1/2",
            ));
        }
        Ok(m)
    }
}

fn is_constant(e: &deck::Elasticity) -> bool {
    let tables = e.orthotropic.as_ref().is_none_or(|o| {
        [&o.e1, &o.e2, &o.e3, &o.g12, &o.g13, &o.g23].iter().all(|f| f.constant().is_some())
            && [&o.nu12, &o.nu13, &o.nu23].iter().all(|f| f.constant().is_some())
    }) && e.transversely_isotropic.as_ref().is_none_or(|o| {
        [&o.e_parallel, &o.e_transverse, &o.g_parallel].iter().all(|f| f.constant().is_some())
            && [&o.nu_parallel, &o.nu_transverse].iter().all(|f| f.constant().is_some())
    }) && e.anisotropic.as_ref().is_none_or(|a| a.voigt.0.iter().all(|f| f.constant().is_some()));
    let orientation = match &e.orientation {
        Some(Orientation::Angle(f)) => f.constant().is_some(),
        _ => true,
    };
    let expansion = match &e.thermal_expansion {
        Some(ThermalExpansion::Isotropic(f)) => f.constant().is_some(),
        Some(ThermalExpansion::Axes(f)) => f.iter().all(|f| f.constant().is_some()),
        None => true,
    };
    let isotropic = [&e.youngs_modulus, &e.bulk_modulus, &e.shear_modulus].into_iter().flatten().all(|f| f.constant().is_some())
        && e.poisson_ratio.as_ref().is_none_or(|f| f.constant().is_some());
    tables && orientation && expansion && isotropic
}

/// The stiffness of the section at a place: constants, orientation and thermal expansion.
fn stiffness_at<const D: usize>(e: &deck::Elasticity, x: [f64; 3], section: Section) -> Result<Stiffness<D>, Issue> {
    let unstable = || {
        Issue::new(
            e.span,
            "the elastic constants are not those of a stable material",
            "the stiffness must be positive definite: check the Poisson's ratios",
        )
    };
    let mut c = if let Some(o) = &e.orthotropic {
        let v = |f: &SpaceField<deck::Pressure>| f.eval(x, 0.0);
        let nu = |f: &SpaceField<deck::Number>| f.eval(x, 0.0);
        let o = elasticity::Orthotropic {
            young: [v(&o.e1), v(&o.e2), v(&o.e3)],
            shear: [v(&o.g23), v(&o.g13), v(&o.g12)],
            poisson: [nu(&o.nu23), nu(&o.nu13), nu(&o.nu12)],
        };
        o.voigt().ok_or_else(unstable)?
    } else if let Some(o) = &e.transversely_isotropic {
        let v = |f: &SpaceField<deck::Pressure>| f.eval(x, 0.0);
        let nu = |f: &SpaceField<deck::Number>| f.eval(x, 0.0);
        elasticity::Orthotropic::transverse(
            v(&o.e_parallel),
            v(&o.e_transverse),
            nu(&o.nu_parallel),
            nu(&o.nu_transverse),
            v(&o.g_parallel),
        )
        .voigt()
        .ok_or_else(unstable)?
    } else if let Some(a) = &e.anisotropic {
        let mut c = [[0.0; 6]; 6];
        let mut upper = a.voigt.0.iter();
        for i in 0..6 {
            for j in i..6 {
                let value = upper.next().map_or(0.0, |f| f.eval(x, 0.0));
                c[i][j] = value;
                c[j][i] = value;
            }
        }
        c
    } else {
        let source = IsotropicSource { e: &e.youngs_modulus, nu: &e.poisson_ratio, k: &e.bulk_modulus, g: &e.shear_modulus, span: e.span };
        source.at(x, section)?.voigt()
    };
    let mut expansion = [0.0; 6];
    match &e.thermal_expansion {
        Some(ThermalExpansion::Isotropic(f)) => expansion[..3].fill(f.eval(x, 0.0)),
        Some(ThermalExpansion::Axes(f)) => (0..3).for_each(|k| expansion[k] = f[k].eval(x, 0.0)),
        None => {}
    }
    if let Some(orientation) = &e.orientation {
        let axes = material_axes(orientation, x)
            .ok_or_else(|| Issue::new(e.span, "the two axes of the orientation are parallel", "give two different directions"))?;
        c = elasticity::rotate(&c, &axes);
        expansion = rotate_strain(&expansion, &axes);
    }
    let s = Stiffness::<D>::new(&c, &expansion, section);
    if s.is_stable() { Ok(s) } else { Err(unstable()) }
}

/// Material axes as rows, orthonormal and right-handed.
fn material_axes(o: &Orientation, x: [f64; 3]) -> Option<[[f64; 3]; 3]> {
    let cross = |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let unit = |a: [f64; 3]| {
        let l = (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
        (l > 0.0).then(|| a.map(|c| c / l))
    };
    match o {
        Orientation::Angle(f) => {
            let (s, c) = f.eval(x, 0.0).sin_cos();
            Some([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        }
        Orientation::Axes(axes) => {
            let [a, b] = axes.each_ref().map(|v| v.each_ref().map(|q| q.value));
            let first = unit(a)?;
            let third = unit(cross(first, b))?;
            Some([first, cross(third, first), third])
        }
        Orientation::Euler(angles) => {
            // rotations about z, the new x, and the new z
            let [p, q, r] = angles.each_ref().map(|a| a.value);
            let about_z = |t: f64| [[t.cos(), t.sin(), 0.0], [-t.sin(), t.cos(), 0.0], [0.0, 0.0, 1.0]];
            let about_x = |t: f64| [[1.0, 0.0, 0.0], [0.0, t.cos(), t.sin()], [0.0, -t.sin(), t.cos()]];
            let product = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| -> [[f64; 3]; 3] {
                std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
            };
            Some(product(about_z(r), product(about_x(q), about_z(p))))
        }
    }
}

/// Strain in Voigt order (engineering shears) from material axes (rows) to space.
fn rotate_strain(e: &[f64; 6], axes: &[[f64; 3]; 3]) -> [f64; 6] {
    let t = [[e[0], e[5] / 2.0, e[4] / 2.0], [e[5] / 2.0, e[1], e[3] / 2.0], [e[4] / 2.0, e[3] / 2.0, e[2]]];
    let r = |i: usize, j: usize| -> f64 { (0..3).map(|k| (0..3).map(|l| axes[k][i] * t[k][l] * axes[l][j]).sum::<f64>()).sum() };
    [r(0, 0), r(1, 1), r(2, 2), 2.0 * r(1, 2), 2.0 * r(0, 2), 2.0 * r(0, 1)]
}

fn influence_of(m: &deck::Material) -> (&InfluenceName, bool) {
    match &m.model {
        deck::Model::BondBased(b) => (&b.influence, b.isotropy_correction),
        deck::Model::LinearPeridynamicSolid(l) => (&l.influence, l.isotropy_correction),
        deck::Model::Correspondence(c) => (&c.influence, false),
        deck::Model::ExtendedCorrespondence(c) => (&c.influence, false),
        deck::Model::BondPairBeam(_) | deck::Model::BondMultiplePlate(_) | deck::Model::Shell(_) => (&InfluenceName::Constant, false),
    }
}

fn stores_influence(problem: &Problem, m: &deck::Material) -> bool {
    let (influence, corrected) = influence_of(m);
    let always = match &m.model {
        deck::Model::BondBased(b) => !matches!(b.bond_law, BondLaw::Elastic),
        deck::Model::Correspondence(c) => {
            matches!(c.law, LawName::KelvinVoigt(_) | LawName::Almansi(_) | LawName::J2Plasticity(_))
                || matches!(c.kinematics, deck::Kinematics::Corrected(_))
        }
        deck::Model::ExtendedCorrespondence(c) => matches!(c.law, deck::StrainLaw::J2Plasticity(_)),
        deck::Model::LinearPeridynamicSolid(_)
        | deck::Model::BondPairBeam(_)
        | deck::Model::BondMultiplePlate(_)
        | deck::Model::Shell(_) => false,
    };
    always
        || problem.section.dimension() == 1
        || corrected
        || !matches!(influence, InfluenceName::Constant)
        || matches!(problem.deck.body.partial_volumes, deck::PartialVolumes::Linear)
}

/// Stored influences: the function itself, the share of a neighbour's volume inside the horizon, and the correction of the
/// family's fourth moments. The last two enter as factors of ω because every integral of every model has ω in it.
struct Weights {
    linear: bool,
}

impl Weights {
    fn new(problem: &Problem) -> Self {
        Weights { linear: matches!(problem.deck.body.partial_volumes, deck::PartialVolumes::Linear) }
    }

    fn fill<const D: usize>(&self, problem: &Problem, m: &deck::Material, p: usize, links: &mut [Link]) {
        let (influence, corrected) = influence_of(m);
        let (x, delta) = (problem.cloud.position[p], problem.horizon[p]);
        for link in links.iter_mut() {
            let r = (0..3).map(|k| (link.end[k] - x[k]).powi(2)).sum::<f64>().sqrt();
            let radial = |f: Radial| f.at(r, delta);
            link.weight = match influence {
                InfluenceName::Constant => 1.0,
                InfluenceName::InverseLength => radial(Radial::InverseLength),
                InfluenceName::Cone => radial(Radial::Cone),
                InfluenceName::Gaussian(g) => radial(Radial::Gaussian { width: g.width.value }),
                InfluenceName::CubicSpline => radial(Radial::CubicSpline),
                InfluenceName::Expression(f) => f.at(r / delta),
            };
            if self.linear {
                let h = problem.cloud.spacing[link.point as usize];
                link.weight *= ((delta + 0.5 * h - r) / h).clamp(0.0, 1.0);
            }
        }
        if corrected {
            let bonds: Vec<(Vector<f64, D>, f64)> = links
                .iter()
                .map(|l| (Vector(std::array::from_fn(|k| l.end[k] - x[k])), l.weight * problem.cloud.volume[l.point as usize]))
                .collect();
            let power = if matches!(m.model, deck::Model::BondBased(_)) { 1 } else { 2 };
            if let Some(factors) = physics::isotropy::fourth_moment_factors(&bonds, power) {
                links.iter_mut().zip(factors).for_each(|(l, s)| l.weight *= s);
            }
        }
    }
}

/// The sub-horizons of each bond of a family.
fn divide<const D: usize>(problem: &Problem, m: &deck::Material, p: usize, links: &mut [Link]) {
    let Some(s) = sub_horizons(m) else { return };
    let partition = partition(s, D);
    if partition.count(D).is_err() {
        return;
    }
    let x = problem.cloud.position[p];
    let bonds: Vec<(Vector<f64, D>, f64)> = links
        .iter()
        .map(|l| (Vector(std::array::from_fn(|k| l.end[k] - x[k])), l.weight * problem.cloud.volume[l.point as usize]))
        .collect();
    links.iter_mut().zip(partition.membership(&bonds, problem.horizon[p])).for_each(|(l, sets)| l.sets = sets);
}

/// Criteria of the same kind become one, so that a bond between two materials breaks at the mean of their thresholds. Between
/// materials of different criteria, or where one has none, bonds do not break.
fn join(all: &mut Vec<Failure>, more: Failure) {
    for known in all.iter_mut() {
        let (a, b) = match (&mut known.criterion, &more.criterion) {
            (Criterion::CriticalStretch(a), Criterion::CriticalStretch(b)) => (a, b),
            (Criterion::CriticalBondEnergy(a), Criterion::CriticalBondEnergy(b)) => (a, b),
            _ => continue,
        };
        a.iter_mut().zip(b).for_each(|(a, b)| *a = a.min(*b));
        return;
    }
    all.push(more);
}

/// Thresholds of a material's damage criterion per point, infinite at the points of other materials.
fn thresholds<const D: usize>(
    problem: &Problem,
    body: &Body<D>,
    number: u32,
    name: &str,
    m: &deck::Material,
    damage: &deck::Damage,
    derived: &mut Vec<Derived>,
) -> Checked<Failure> {
    let cloud = &problem.cloud;
    let section = problem.section;
    let points: Vec<usize> = (0..cloud.len()).filter(|&p| problem.material[p] == number).collect();
    // the family that stands for the bulk: the largest of the material
    let volume = |p: usize| body.reference_family(p).iter().map(|b| b.1).sum::<f64>();
    let step = (points.len() / 20_000).max(1);
    let bulk = points.iter().step_by(step).copied().max_by(|&a, &b| volume(a).total_cmp(&volume(b)).then(b.cmp(&a))).unwrap_or(0);
    let family = body.reference_family(bulk);
    let weights = body.reference_weights(bulk);
    let delta = problem.horizon[bulk];
    let plane = if cloud.lattice.is_some() { CrackPlane::Normal([1.0, 0.0, 0.0]) } else { CrackPlane::Average };
    let continuum = matches!(damage.calibration, Calibration::Continuum);
    let length = |k: usize| family[k].0.iter().map(|x| x * x).sum::<f64>().sqrt();
    let moment: f64 = family.iter().enumerate().map(|(k, b)| weights[k] * length(k) * b.1).sum();
    let non_elastic = matches!(&m.model, deck::Model::BondBased(b) if !matches!(b.bond_law, BondLaw::Elastic | BondLaw::TensionOnly));
    if non_elastic && let Some(g) = &damage.energy_release_rate {
        return Err(vec![Issue::new(
            g.span,
            "an energy release rate sets the strength of elastic bonds only",
            "give `critical_stretch` instead",
        )]);
    }
    let mut out = vec![f64::INFINITY; cloud.len()];
    for &p in &points {
        let x = cloud.position[p];
        let relative = problem.horizon[p] / delta;
        let elastic = isotropic_estimate::<D>(m, x, section).map_err(|i| vec![i])?;
        out[p] = if let Some(s) = &damage.critical_stretch {
            s.eval(x, 0.0)
        } else if let Some(w) = &damage.critical_bond_energy {
            w.eval(x, 0.0)
        } else {
            let g = damage.energy_release_rate.as_ref().map_or(f64::INFINITY, |g| g.eval(x, 0.0));
            match damage.criterion {
                CriterionName::CriticalStretch if continuum => {
                    continuum_critical_stretch(g, elastic.young, elastic.bulk(), problem.horizon[p], section)
                }
                CriterionName::CriticalStretch => {
                    // pair energy c ω s² |ξ|/2 of the bond-based solid with the same moduli
                    let constants = BondBasedConstants { young: elastic.young, section, continuum: false };
                    let modulus = if matches!(section, Section::Solid) { 18.0 * elastic.bulk() } else { constants.modulus() };
                    let c = modulus / moment;
                    let per_square = crossing_energy(&family, D, plane, |k| 0.5 * c * weights[k] * length(k));
                    (g / (per_square * relative)).sqrt()
                }
                CriterionName::CriticalBondEnergy if continuum => continuum_critical_bond_energy(g, problem.horizon[p], section),
                CriterionName::CriticalBondEnergy => g / (crossing_energy(&family, D, plane, |_| 1.0) * relative.powi(D as i32 + 1)),
            }
        };
    }
    if let Some(&p) = points.first() {
        let (what, unit) = match damage.criterion {
            CriterionName::CriticalStretch => ("critical stretch", ""),
            CriterionName::CriticalBondEnergy => ("critical bond energy", "energy/volume²"),
        };
        derived.push((format!("{what} of {name}"), out[p], unit));
    }
    if let Some(keep) = &damage.no_damage {
        problem.set(&keep.value).iter().for_each(|&p| out[p as usize] = f64::INFINITY);
    }
    let criterion = match damage.criterion {
        CriterionName::CriticalStretch => Criterion::CriticalStretch(out),
        CriterionName::CriticalBondEnergy => Criterion::CriticalBondEnergy(out),
    };
    Ok(Failure { criterion, batch: 0.95 })
}

/// Isotropic moduli of a material at a place, for calibrations: of an anisotropic one the Voigt average.
fn isotropic_estimate<const D: usize>(m: &deck::Material, x: [f64; 3], section: Section) -> Result<Isotropic, Issue> {
    match &m.model {
        deck::Model::BondBased(b) => {
            Ok(Isotropic { young: b.youngs_modulus.eval(x, 0.0), poisson: BondBasedConstants::poisson(section).unwrap_or(0.25) })
        }
        deck::Model::LinearPeridynamicSolid(l) => {
            let e = &l.elasticity;
            IsotropicSource { e: &e.youngs_modulus, nu: &e.poisson_ratio, k: &e.bulk_modulus, g: &e.shear_modulus, span: l.span }
                .at(x, section)
        }
        deck::Model::ExtendedCorrespondence(c) => match &c.law {
            deck::StrainLaw::LinearElastic(e) => Ok(stiffness_at::<D>(e, x, section)?.average),
            deck::StrainLaw::J2Plasticity(j) => Ok(plasticity(j, section).1(x)?.elastic),
        },
        deck::Model::Correspondence(c) => match &c.law {
            LawName::LinearElastic(e) | LawName::SaintVenantKirchhoff(e) => Ok(stiffness_at::<D>(e, x, section)?.average),
            LawName::KelvinVoigt(k) => Ok(stiffness_at::<D>(&k.elasticity, x, section)?.average),
            LawName::J2Plasticity(j) => Ok(plasticity(j, section).1(x)?.elastic),
            LawName::NeoHookean(deck::NeoHookean { elasticity: e, .. }) | LawName::Almansi(e) => {
                IsotropicSource { e: &e.youngs_modulus, nu: &e.poisson_ratio, k: &e.bulk_modulus, g: &e.shear_modulus, span: e.span }
                    .at(x, section)
            }
        },
        deck::Model::BondPairBeam(_) | deck::Model::BondMultiplePlate(_) | deck::Model::Shell(_) => Err(thin_model(m)),
    }
}

fn conditions(problem: &Problem) -> Vec<loads::Condition> {
    let deck = &problem.deck;
    let mut out = vec![];
    macro_rules! components {
        ($c:expr) => {
            [&$c.x, &$c.y, &$c.z].map(|f| {
                f.as_ref().map(|f| {
                    let f = f.clone();
                    Box::new(move |x, t| f.eval(x, t)) as Field
                })
            })
        };
    }
    for (c, name) in deck.conditions.iter().zip(deck::labels(&deck.conditions)) {
        let points = c.set().map(|s| problem.set(&s.value).to_vec()).unwrap_or_default();
        match c {
            Condition::Displacement(d) => {
                out.push(prescribed(
                    Kind::Displacement,
                    name,
                    points,
                    components!(d),
                    c,
                    d.along.clone().map(|f| Box::new(move |x, t| f.eval(x, t)) as Field),
                ));
            }
            Condition::Velocity(d) => {
                out.push(prescribed(
                    Kind::Velocity,
                    name,
                    points,
                    components!(d),
                    c,
                    d.along.clone().map(|f| Box::new(move |x, t| f.eval(x, t)) as Field),
                ));
            }
            Condition::Symmetry(s) if s.axis().is_none() => {
                out.push(prescribed(Kind::Displacement, name, points, [None, None, None], c, None));
            }
            Condition::ForceDensity(d) => {
                out.push(loads::Condition { name, kind: Kind::ForceDensity, points, components: components!(d), along: None })
            }
            Condition::Traction(d) => {
                let depth = points.iter().map(|&p| d.depth.map_or(problem.cloud.spacing[p as usize], |q| q.value)).collect();
                out.push(loads::Condition { name, kind: Kind::Traction { depth }, points, components: components!(d), along: None });
            }
            Condition::RigidWall(w) => {
                let mut normal = [0.0; 3];
                let mut at = [0.0; 3];
                for k in 0..w.normal.len().min(3) {
                    normal[k] = w.normal[k].value;
                    at[k] = w.at[k].value;
                }
                let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
                let normal = normal.map(|n| n / length);
                let points: Vec<u32> = (0..problem.cloud.len() as u32).collect();
                let stiffness = points
                    .iter()
                    .map(|&p| {
                        let p = p as usize;
                        let per_depth = w.stiffness.map_or_else(
                            || {
                                let m = &deck.materials.0[problem.material[p] as usize].1;
                                let young = match problem.section.dimension() {
                                    1 => isotropic_estimate::<1>(m, problem.cloud.position[p], problem.section),
                                    2 => isotropic_estimate::<2>(m, problem.cloud.position[p], problem.section),
                                    _ => isotropic_estimate::<3>(m, problem.cloud.position[p], problem.section),
                                };
                                young.map_or(0.0, |e| e.young) / problem.cloud.spacing[p].powi(2)
                            },
                            |s| s.value,
                        );
                        per_depth * problem.cloud.volume[p]
                    })
                    .collect();
                let velocity = w.velocity.clone();
                let motion = move |t: f64| velocity.as_ref().map_or(0.0, |v| travelled(|s| v.eval([0.0; 3], s), t));
                let wall = Wall { normal, at, motion: Box::new(motion), stiffness };
                out.push(loads::Condition { name, kind: Kind::RigidWall(wall), points, components: [None, None, None], along: None });
            }
            // the last are refused for solids, and made elsewhere for beams and plates
            Condition::InitialVelocity(_)
            | Condition::InitialDisplacement(_)
            | Condition::Symmetry(_)
            | Condition::SimplySupported(_)
            | Condition::Clamped(_)
            | Condition::Pin(_)
            | Condition::PointLoad(_)
            | Condition::DistributedLoad(_)
            | Condition::LineLoad(_)
            | Condition::Pressure(_)
            | Condition::Moment(_) => {}
        }
    }
    out
}

/// A prescribed motion: of components along the axes, or of the one along the direction of the condition, which is 0 where it is not given.
fn prescribed(
    kind: Kind,
    name: String,
    points: Vec<u32>,
    components: [Option<Field>; 3],
    c: &Condition,
    value: Option<Field>,
) -> loads::Condition {
    let along = c.direction();
    let components = if along.is_some() { [value.or_else(|| Some(Box::new(|_, _| 0.0))), None, None] } else { components };
    loads::Condition { name, kind, points, components, along }
}

/// ∫₀ᵗ v dt by Gauss' rule of three points on 16 intervals: exact for polynomials of degree five.
fn travelled(v: impl Fn(f64) -> f64, t: f64) -> f64 {
    const INTERVALS: usize = 16;
    let h = t / INTERVALS as f64;
    let offset = 0.6f64.sqrt() / 2.0;
    (0..INTERVALS)
        .map(|k| {
            let middle = (k as f64 + 0.5) * h;
            h / 18.0 * (5.0 * v(middle - offset * h) + 8.0 * v(middle) + 5.0 * v(middle + offset * h))
        })
        .sum()
}

/// Initial displacements and velocities of a body of so many dofs, as many words a point, in sorted order. Beams and plates that move
/// across alone have one word: y of a beam, z of a plate.
pub fn initial_state(problem: &Problem, dofs: usize) -> (Vec<f64>, Vec<f64>) {
    let n = problem.cloud.len();
    let d = dofs / n.max(1);
    let component = |k: usize| if problem.thin && d == 1 { problem.section.dimension() } else { k };
    let (mut u, mut v) = (vec![0.0; n * d], vec![0.0; n * d]);
    crate::thin_registry::stress_free_shape(problem, d, &mut u);
    for c in &problem.deck.conditions {
        let Some(set) = c.set() else { continue };
        for &p in problem.set(&set.value) {
            let x = problem.cloud.position[p as usize];
            for k in 0..d {
                let q = p as usize * d + k;
                match c {
                    Condition::InitialVelocity(i) => {
                        if let Some(f) = [&i.x, &i.y, &i.z][component(k)] {
                            v[q] = f.eval(x, 0.0);
                        }
                    }
                    Condition::InitialDisplacement(i) => {
                        if let Some(f) = [&i.x, &i.y, &i.z][component(k)] {
                            u[q] = f.eval(x, 0.0);
                        }
                    }
                    _ => {}
                }
            }
        }
    }
    (u, v)
}
