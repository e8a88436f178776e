//! Plain loops over one bond at a time, as one would write them by hand for one model: what the general loop must beat.
//! Same lattice, same neighbour lists, full lists, unit volumes, continuum micromodulus or given constants.

/// Neighbour lists and coordinates as a hand-written code would hold them.
pub struct Lists {
    /// Positions, 3 a point.
    pub x: Vec<f64>,
    /// First bond of each point.
    pub start: Vec<usize>,
    /// Far points.
    pub neighbor: Vec<u32>,
    /// Reference lengths.
    pub length: Vec<f64>,
}

/// Bond-based: each point sums the pair forces of its own bonds.
pub fn bond_based(l: &Lists, y: &[f64], c: f64, f: &mut [f64]) {
    for i in 0..l.start.len() - 1 {
        let mut sum = [0.0; 3];
        let yi = [y[3 * i], y[3 * i + 1], y[3 * i + 2]];
        for s in l.start[i]..l.start[i + 1] {
            let j = 3 * l.neighbor[s] as usize;
            let d = [y[j] - yi[0], y[j + 1] - yi[1], y[j + 2] - yi[2]];
            let r = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let t = c * (r - l.length[s]) / (l.length[s] * r);
            for k in 0..3 {
                sum[k] += t * d[k];
            }
        }
        f[3 * i..3 * i + 3].copy_from_slice(&sum);
    }
}

/// Linear peridynamic solid: dilatation of each point, then its force state given to both ends.
pub fn linear_solid(l: &Lists, y: &[f64], m: &[f64], bulk: f64, shear: f64, f: &mut [f64]) {
    f.fill(0.0);
    for i in 0..l.start.len() - 1 {
        let yi = [y[3 * i], y[3 * i + 1], y[3 * i + 2]];
        let mut theta = 0.0;
        for s in l.start[i]..l.start[i + 1] {
            let j = 3 * l.neighbor[s] as usize;
            let d = [y[j] - yi[0], y[j + 1] - yi[1], y[j + 2] - yi[2]];
            theta += l.length[s] * ((d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() - l.length[s]);
        }
        theta *= 3.0 / m[i];
        let alpha = 15.0 * shear / m[i];
        let a = 3.0 * bulk * theta / m[i] - alpha * theta / 3.0;
        for s in l.start[i]..l.start[i + 1] {
            let j = 3 * l.neighbor[s] as usize;
            let d = [y[j] - yi[0], y[j + 1] - yi[1], y[j + 2] - yi[2]];
            let r = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let t = (a * l.length[s] + alpha * (r - l.length[s])) / r;
            for k in 0..3 {
                f[3 * i + k] += t * d[k];
                f[j + k] -= t * d[k];
            }
        }
    }
}

/// Correspondence with a Saint-Venant–Kirchhoff law and an isotropic control of strength s.
pub fn correspondence(l: &Lists, y: &[f64], inverse: &[[f64; 9]], lambda: f64, mu: f64, control: f64, f: &mut [f64]) {
    f.fill(0.0);
    for i in 0..l.start.len() - 1 {
        let (xi, yi) = ([l.x[3 * i], l.x[3 * i + 1], l.x[3 * i + 2]], [y[3 * i], y[3 * i + 1], y[3 * i + 2]]);
        let mut a = [0.0; 9];
        for s in l.start[i]..l.start[i + 1] {
            let j = 3 * l.neighbor[s] as usize;
            for p in 0..3 {
                for q in 0..3 {
                    a[3 * p + q] += (y[j + p] - yi[p]) * (l.x[j + q] - xi[q]);
                }
            }
        }
        let product =
            |a: &[f64; 9], b: &[f64; 9]| -> [f64; 9] { std::array::from_fn(|k| (0..3).map(|m| a[k / 3 * 3 + m] * b[m * 3 + k % 3]).sum()) };
        let g = product(&a, &inverse[i]);
        let transposed: [f64; 9] = std::array::from_fn(|k| g[k % 3 * 3 + k / 3]);
        let mut e = product(&transposed, &g);
        for k in 0..3 {
            e[4 * k] -= 1.0;
        }
        let trace = 0.5 * (e[0] + e[4] + e[8]);
        let second: [f64; 9] = std::array::from_fn(|k| mu * e[k] + if k % 4 == 0 { lambda * trace } else { 0.0 });
        let pk = product(&product(&g, &second), &inverse[i]);
        let q: [f64; 9] = std::array::from_fn(|k| pk[k] - control * g[k]);
        for s in l.start[i]..l.start[i + 1] {
            let j = 3 * l.neighbor[s] as usize;
            for p in 0..3 {
                let mut t = control * (y[j + p] - yi[p]);
                for r in 0..3 {
                    t += q[3 * p + r] * (l.x[j + r] - xi[r]);
                }
                f[3 * i + p] += t;
                f[j + p] -= t;
            }
        }
    }
}
