//! The fraction of the vectors' errors that their stated uncertainties cover.

#[path = "../tests/coverage/mod.rs"]
mod coverage;
#[path = "../tests/scene/mod.rs"]
mod scene;

use coverage::{WORN, coverage, shear, vortices};
use scene::Wear;

fn main() {
    println!("{:22} {:>9}  {:17} {:22} {:22}", "", "particles", "covered, %", "error, voxel", "stated, voxel");
    let line = |name: &str, density: f64, wear: Wear, truth: &dyn Fn([f64; 3]) -> [f64; 3]| {
        let found = coverage(density, 0.75, wear, 1..5, truth);
        let [share, error, stated] = [found.share.map(|s| 100.0 * s), found.error_vox, found.stated_vox];
        println!(
            "{name:22} {density:9}  {:3.0}  {:3.0}  {:3.0}     {:.4} {:.4} {:.4}   {:.4} {:.4} {:.4}",
            share[0], share[1], share[2], error[0], error[1], error[2], stated[0], stated[1], stated[2]
        );
    };
    for density in [4.0, 8.0, 20.0] {
        line("uniform", density, Wear::default(), &shear(0.0));
        line("uniform, worn", density, WORN, &shear(0.0));
        line("shear 0.03, worn", density, WORN, &shear(0.03));
        line("vortices of 8 w., worn", density, WORN, &vortices(8.0));
        line("vortices of 4 w., worn", density, WORN, &vortices(4.0));
    }
}
