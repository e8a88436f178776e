//! A fixed number of force evaluations of one model on a small block, for counting instructions: see `benches/instructions.sh`.
//!
//! `count` lists the models; `count NUMBER EVALUATIONS` runs one and prints its directed bonds.

mod decks;

use solvers::problem::Dynamics;

fn main() {
    // what valgrind knows, whatever the machine has
    physics::lanes::limit(physics::lanes::Instructions::Avx2);
    let arguments: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let &[number, evaluations] = arguments.as_slice() else {
        for (k, m) in decks::MODELS.iter().enumerate() {
            println!("{k}\t{}D {}", m.dimension, m.name);
        }
        return;
    };
    // this thread alone: threads that wait would be counted
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().expect("no thread is started");
    pool.install(|| {
        let model = &decks::MODELS[number];
        let cells = match model.dimension {
            3 => [10, 10, 8],
            2 => [40, 30, 1],
            _ => [2000, 1, 1],
        };
        let mut b = decks::block(model, cells);
        // a deformed state
        b.u.iter_mut().zip(&b.v).for_each(|(u, v)| *u = 1e-7 * v);
        let mut f = vec![0.0; b.u.len()];
        for _ in 0..evaluations {
            Dynamics::force(&mut *b.model, 0.0, &b.u, &b.v, &mut f).expect("the block is sound");
        }
        println!("{}", b.bonds);
    });
}
