//! Lattices of points in the order in which the program holds them, and bodies on them.

use bodies::body::{Body, Geometry};
use bodies::chunk::Link;
use bodies::neighbors::{Neighbors, neighbors};
use bodies::part::{Assigned, Constants, Part};
use bodies::sort::spatial_order;
use physics::material::Material;
use physics::sub_horizon::Partition;
use physics::tensor::Vector;

/// Points of a lattice of spacing 1, spatially sorted, with their families.
pub struct Lattice<const D: usize> {
    /// Positions.
    pub position: Vec<[f64; 3]>,
    /// Horizon ratio.
    pub horizon: f64,
    /// Families.
    pub families: Neighbors,
}

impl<const D: usize> Lattice<D> {
    /// The points of a box of so many cells for which `kept` holds, with families of the horizon ratio.
    pub fn new(cells: [usize; 3], horizon: f64, kept: impl Fn([f64; 3]) -> bool) -> Self {
        let [a, b, c] = cells;
        let grid: Vec<[f64; 3]> = (0..a * b * c).map(|q| [q % a, q / a % b, q / (a * b)].map(|k| k as f64)).filter(|&x| kept(x)).collect();
        let position = spatial_order(&grid, D, 1.0).apply(&grid);
        let families = neighbors(&position, D, &vec![horizon; position.len()]).expect("a lattice is a valid cloud");
        Lattice { position, horizon, families }
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.position.len()
    }

    /// A body without a material; with the sub-horizons of a partition, where there is one.
    pub fn body(&self, partition: Option<(Partition, usize)>) -> Body<D> {
        let n = self.points();
        let (volume, horizon) = (vec![1.0; n], vec![self.horizon; n]);
        let geometry = Geometry { position: &self.position, volume: &volume, horizon: &horizon };
        Body::new(&geometry, false, partition.map_or(0, |p| p.1), |p, out: &mut Vec<Link>| {
            out.extend(self.families.of(p).iter().map(|&q| Link {
                point: q,
                flips: 0,
                end: self.position[q as usize],
                weight: 1.0,
                sets: 0,
            }));
            if let Some((partition, _)) = partition {
                let x = self.position[p];
                let bonds: Vec<_> = out.iter().map(|l| (Vector(std::array::from_fn(|k| l.end[k] - x[k])), 1.0)).collect();
                out.iter_mut().zip(partition.membership::<D>(&bonds, self.horizon)).for_each(|(l, sets)| l.sets = sets);
            }
        })
    }

    /// A body of one material.
    pub fn of<M: Material<D>>(&self, model: M, constants: M::Constants, partition: Option<(Partition, usize)>) -> Body<D> {
        let mut body = self.body(partition);
        let points: Vec<u32> = (0..self.points() as u32).collect();
        let part: Box<dyn Part<D>> = Box::new(Assigned::new("material", model, Constants::Uniform(constants), &points, body.chunks()));
        body.assign(vec![part]).expect("every family is regular");
        body
    }
}
