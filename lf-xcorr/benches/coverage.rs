//! The share of the vectors' errors that their stated uncertainties cover.
//!
//! `cargo bench -p lf-xcorr --bench coverage` reports; `-- windows` reports on other windows and longer particles. With
//! `-- choose` it runs the clouds that the constants of the uncertainties were chosen on; they share no density, no
//! seed and no turning flow with the report.

#[path = "../tests/coverage/mod.rs"]
mod coverage;
#[path = "../tests/scene/mod.rs"]
mod scene;

use coverage::{Cloud, Coverage, Flow, coverage};
use std::ops::Range;

/// One line of the table.
fn line(name: &str, cloud: Cloud, flow: Flow, seeds: Range<u64>) {
    let Coverage { share, error_vox: error, stated_vox: stated, replaced } =
        coverage(&cloud, |place| flow.at(place), seeds);
    let share = share.map(|share| 100.0 * share);
    println!(
        "{:24} {name:14} {:5}   {:3.0}  {:3.0}  {:3.0}   {:.4} {:.4} {:.4}   {:.4} {:.4} {:.4}   {:.1}",
        flow.words(),
        cloud.density,
        share[0],
        share[1],
        share[2],
        error[0],
        error[1],
        error[2],
        stated[0],
        stated[1],
        stated[2],
        100.0 * replaced
    );
}

fn choose() {
    for density in [6.0, 15.0, 40.0] {
        for flow in [
            Flow::Shear(0.0),
            Flow::Shear(3.0),
            Flow::Shear(8.0),
            Flow::Rotation(6.0),
            Flow::Vortices(6.0, 2.0),
            Flow::Vortices(6.0, 6.0),
            Flow::Wave(5.0, 4.0),
            Flow::Jet(1.2, 5.0),
        ] {
            line("exact", Cloud::exact(density), flow, 101..103);
            line("worn", Cloud::worn(density), flow, 101..103);
        }
    }
}

fn report() {
    for density in [8.0, 20.0] {
        for flow in [
            Flow::Shear(0.0),
            Flow::Shear(2.0),
            Flow::Shear(5.0),
            Flow::Shear(10.0),
            Flow::Rotation(10.0),
            Flow::Vortices(8.0, 3.0),
            Flow::Vortices(8.0, 10.0),
            Flow::Vortices(4.0, 3.0),
            Flow::Jet(0.9, 8.0),
            Flow::Ring(0.6, 5.0),
        ] {
            line("exact", Cloud::exact(density), flow, 1..4);
            line("worn", Cloud::worn(density), flow, 1..4);
        }
    }
}

/// Other windows, and particles that are long along z.
fn windows() {
    for flow in [Flow::Shear(0.0), Flow::Shear(5.0), Flow::Vortices(8.0, 5.0), Flow::Ring(0.6, 5.0)] {
        let flat = Cloud { window: [48, 48, 16], ..Cloud::worn(10.0) };
        line("worn, flat w.", flat, flow, 1..4);
        line("worn, overlap 0.5", Cloud { overlap: 0.5, ..Cloud::worn(10.0) }, flow, 1..4);
        line("worn, long", Cloud { sigma_vox: [0.75, 0.75, 2.0], ..Cloud::worn(10.0) }, flow, 1..4);
    }
}

fn main() {
    println!("{:24} {:>20}   {:13}   {:20}   {:20}   %", "", "in 32^3", "covered, %", "error, voxel", "stated, voxel");
    let is_asked = |what: &str| std::env::args().any(|word| word == what);
    match () {
        () if is_asked("choose") => choose(),
        () if is_asked("windows") => windows(),
        () => report(),
    }
}
