//! Time of assembling, ordering, factoring and solving a 2D lattice problem with the couplings of a state-based tangent.
//!
//! `cargo run --release -p peridyne-solvers --example direct_speed [nx ny radius threads]`

use std::sync::Arc;
use std::time::Instant;

use solvers::direct::SparseCholesky;
use solvers::sparse::{BlockMatrix, BlockPattern, FamilyList};

fn main() {
    let arguments: Vec<f64> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let get = |k: usize, default: f64| arguments.get(k).copied().unwrap_or(default);
    let (nx, ny, radius, threads) = (get(0, 160.0) as i64, get(1, 80.0) as i64, get(2, 4.4), get(3, 2.0) as usize);
    let points = (nx * ny) as usize;
    let reach = radius.floor() as i64;
    let (mut starts, mut members) = (vec![0], Vec::new());
    let mut positions = Vec::new();
    for x in 0..nx {
        for y in 0..ny {
            positions.extend([x as f64, y as f64]);
            for dx in -reach..=reach {
                for dy in -reach..=reach {
                    let (a, b) = (x + dx, y + dy);
                    if ((dx * dx + dy * dy) as f64) <= radius * radius && (0..nx).contains(&a) && (0..ny).contains(&b) {
                        members.push((a * ny + b) as u32);
                    }
                }
            }
            starts.push(members.len());
        }
    }
    let mut fixed = vec![false; 2 * points];
    fixed[..4 * 2 * ny as usize].fill(true);
    let report = |what: &str, since: Instant| eprintln!("{what:<28} {:8.3} s", since.elapsed().as_secs_f64());

    let time = Instant::now();
    let families = FamilyList::new(points, starts, members).expect("families of a lattice");
    report("families", time);
    let time = Instant::now();
    let pattern = Arc::new(BlockPattern::from_families(2, &families).expect("pattern"));
    report("pattern", time);
    let mut matrix = BlockMatrix::new(pattern.clone());
    for _ in 0..2 {
        matrix.clear();
        let time = Instant::now();
        // Energy ½ Σ |u_a − mean u|²: couples every two members, positive up to translations, which the fixed edge removes.
        let fill = |_: &mut (), k: usize, dense: &mut [f64]| {
            let n = families.family(k).len();
            dense.fill(0.0);
            for a in 0..n {
                for b in 0..n {
                    let value = f64::from(u8::from(a == b)) - 1.0 / n as f64;
                    dense[2 * a * 2 * n + 2 * b] = value;
                    dense[(2 * a + 1) * 2 * n + 2 * b + 1] = 1.5 * value;
                }
            }
            Ok::<(), ()>(())
        };
        matrix.add_families(&families, || (), fill).expect("no family fails");
        report("assembly", time);
    }
    let time = Instant::now();
    let mut cholesky = SparseCholesky::analyze(pattern.clone(), &positions, &fixed, threads).expect("analysis");
    report("ordering and symbolic", time);
    let per_row = 2.0 * 2.0 * pattern.blocks() as f64 / points as f64;
    let (free, values) = (cholesky.free_dofs(), cholesky.factor_values());
    eprintln!("{free} dofs, {per_row:.0} nonzeros a row, {:?}, {:.1} M in the factor", cholesky.ordering(), values as f64 / 1e6);
    let b: Vec<f64> = (0..2 * points).map(|k| ((k % 7) as f64 - 3.0) / 3.0).collect();
    let mut x = vec![0.0; 2 * points];
    for _ in 0..3 {
        let time = Instant::now();
        cholesky.factor(&matrix, None).expect("positive definite");
        report("numeric", time);
        let time = Instant::now();
        let solved = cholesky.solve(&b, &mut x).expect("accurate");
        report("solve", time);
        let bits = x.iter().fold(0u64, |h, x| h.rotate_left(5) ^ x.to_bits());
        eprintln!("relative residual {:.1e}, bits {bits:016x}", solved.residual);
    }
    let mut y = vec![0.0; 2 * points];
    matrix.product(&x, &mut y);
    let time = Instant::now();
    for _ in 0..10 {
        matrix.product(&x, &mut y);
    }
    report("ten products", time);
}
