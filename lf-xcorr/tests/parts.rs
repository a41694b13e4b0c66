//! Options beyond the usual: masks, several pairs, lists of passes.

use crate::scene::{self, Volume, Wear};
use lf_core::{Field, field::MEASURED};
use lf_xcorr::{Deform, Mask, Options, Outcome, Pass, Plan, Refused, Side, Sparse, correlate};
use std::sync::atomic::{AtomicU64, Ordering};

const SHAPE: [usize; 3] = [72, 64, 48];
const SHIFT: [f64; 3] = [1.4, -0.6, 0.8];

fn options() -> Options {
    Options::coarse_to_fine([48, 48, 32], [32, 32, 16], 0.75, [8, 8, 6], Options::REFINE)
}

fn cloud(seed: u64, per_window: f64, wear: Wear) -> [Volume; 2] {
    scene::worn_pair(&scene::grid(SHAPE), per_window / 32f64.powi(3), [0.8, 0.8, 1.2], seed, wear, |_| SHIFT)
}

fn field(pairs: &[[Sparse; 2]], mask: &Mask, options: &Options) -> Field {
    planned(pairs, mask, options).unwrap().field
}

fn planned(pairs: &[[Sparse; 2]], mask: &Mask, options: &Options) -> Result<Outcome, Refused> {
    Plan::new(pairs, mask, options)?.correlate(&|_| ())
}

fn rms(field: &Field) -> f64 {
    let measured = (0..field.len()).filter(|&i| field.flag[i] == MEASURED);
    let squares = measured.map(|i| {
        let errors = [field.u[i], field.v[i], field.w[i]].into_iter().zip(SHIFT).map(|(u, s)| u as f64 - s);
        errors.map(|e| e * e).sum::<f64>() / 3.0
    });
    let (sum, count) = squares.fold((0.0, 0), |(sum, count), square| (sum + square, count + 1));
    (sum / count as f64).sqrt()
}

#[test]
fn a_box_is_a_volume_of_its_own() {
    let [a, b] = cloud(1, 20.0, Wear::default());
    let sides = [20..72, 4..60, 0..48];
    let boxed = field(&[[a.sparse(), b.sparse()]], &Mask::Box(sides.clone()), &options());
    assert!(rms(&boxed) < 0.0035, "{}", rms(&boxed));
    assert_eq!(boxed.layout.origin_mm, [20.0 + 2.0 + 15.5, 4.0 + 15.5, 7.5]);
    // These voxels alone, in a smaller grid.
    let small = scene::grid([52, 56, 48]);
    let [a, b] = [&a, &b].map(|volume| {
        let mut dense = vec![0f32; small.len() as usize];
        for (&index, &value) in volume.indices.iter().zip(&volume.intensity) {
            let voxel = volume.grid.voxel(index);
            if (0..3).all(|axis| sides[axis].contains(&voxel[axis])) {
                dense[small.index([voxel[0] - 20, voxel[1] - 4, voxel[2]]) as usize] = value;
            }
        }
        Volume::from_dense(&small, &dense)
    });
    let alone = field(&[[a.sparse(), b.sparse()]], &Mask::Everything, &options());
    assert_eq!((&boxed.u, &boxed.w, &boxed.su), (&alone.u, &alone.w, &alone.su));
}

#[test]
fn a_support_keeps_its_voxels_alone() {
    let [a, b] = cloud(2, 20.0, Wear::default());
    // A support of everything changes nothing; one of half the volume darkens the other half.
    let all: Vec<u64> = (0..a.grid.len()).collect();
    let half: Vec<u64> = all.iter().copied().filter(|&i| a.grid.voxel(i)[1] < 40).collect();
    let pair = [[a.sparse(), b.sparse()]];
    let plain = field(&pair, &Mask::Everything, &options());
    assert_eq!(plain.u, field(&pair, &Mask::Support(&all), &options()).u);
    let halved = field(&pair, &Mask::Support(&half), &options());
    assert!(halved.count.iter().sum::<f32>() < 0.8 * plain.count.iter().sum::<f32>());
    assert!(rms(&halved) < 0.03, "{}", rms(&halved));

    let nowhere = planned(&pair, &Mask::Support(&[3]), &options()).unwrap_err();
    assert!(nowhere.side == Side::First(0) && nowhere.refusal.found.contains("inside the mask"), "{nowhere}");
    let empty = planned(&pair, &Mask::Box([80..90, 0..9, 0..9]), &options()).unwrap_err();
    assert!(empty.side == Side::Mask, "{empty}");
}

#[test]
fn more_pairs_of_worn_particles_scatter_less() {
    let worn = Wear { jitter_vox: [0.15; 3], lost: 0.2, flicker: 0.3 };
    let clouds: Vec<[Volume; 2]> = (0..6).map(|seed| cloud(10 + seed, 6.0, worn)).collect();
    let pairs: Vec<[Sparse; 2]> = clouds.iter().map(|pair| pair.each_ref().map(Volume::sparse)).collect();
    let [one, six] = [&pairs[..1], &pairs[..]].map(|pairs| field(pairs, &Mask::Everything, &options()));
    // Six times the particles: scatter and stated uncertainty fall by about sqrt(6).
    assert!(rms(&six) < 0.55 * rms(&one), "{} {}", rms(&six), rms(&one));
    let stated = |field: &Field| {
        let known: Vec<f64> = field.su.iter().filter(|s| s.is_finite()).map(|&s| s as f64).collect();
        known.iter().sum::<f64>() / known.len() as f64
    };
    assert!(stated(&six) < 0.6 * stated(&one), "{} {}", stated(&six), stated(&one));
    assert!(six.count.iter().sum::<f32>() > 4.0 * one.count.iter().sum::<f32>());
}

#[test]
fn a_pair_given_twice_is_the_pair() {
    let [a, b] = cloud(3, 10.0, Wear::default());
    let pair = [a.sparse(), b.sparse()];
    let options = Options::coarse_to_fine([48, 48, 32], [32, 32, 16], 0.5, [8, 8, 6], Options::REFINE);
    let [once, twice] = [&[pair][..], &[pair, pair]].map(|pairs| field(pairs, &Mask::Everything, &options));
    for i in 0..once.len() {
        assert!((once.u[i] - twice.u[i]).abs() < 1e-5 && (once.peak[i] - twice.peak[i]).abs() < 1e-5);
        assert_eq!(2.0 * once.count[i], twice.count[i]);
    }
}

#[test]
fn any_list_of_passes_is_done_one_after_the_other() {
    let [a, b] = cloud(4, 20.0, Wear::default());
    let pass = |window: [usize; 3], overlap: f64, search: [usize; 3]| Pass { window, overlap, search };
    let passes = vec![
        pass([64, 64, 48], 0.5, [6, 6, 6]),
        pass([40, 48, 32], 0.6, [4, 4, 3]),
        pass([32, 32, 24], 0.5, [3, 3, 3]),
        pass([24, 24, 16], 0.75, [3, 3, 2]),
    ];
    let options = Options::new(passes);
    let counted = AtomicU64::new(0);
    let watch = |n: u64| {
        counted.fetch_add(n, Ordering::Relaxed);
    };
    let pairs = [[a.sparse(), b.sparse()]];
    let plan = Plan::new(&pairs, &Mask::Everything, &options).unwrap();
    let outcome = plan.correlate(&watch).unwrap();
    assert_eq!(counted.into_inner(), plan.windows());
    assert_eq!(outcome.passes.iter().map(|pass| pass.window).collect::<Vec<_>>()[1..3], [[40, 48, 32], [32, 32, 24]]);
    assert!(outcome.passes[..3].iter().all(|pass| pass.repeats.len() == 1));
    let repeats = &outcome.passes[3].repeats;
    assert!(repeats.len() > 1 && repeats.len() <= Options::REPEATS && repeats.last().unwrap().deformed);
    assert!(rms(&outcome.field) < 0.0027, "{}", rms(&outcome.field));
}

#[test]
fn one_pass_without_deformation_is_enough() {
    let [a, b] = cloud(5, 20.0, Wear::default());
    let mut options = Options::new(vec![Pass { window: [32, 32, 24], overlap: 0.5, search: [5, 5, 5] }]);
    options.deform = Deform::Never;
    let outcome = correlate(&a.sparse(), &b.sparse(), &options).unwrap();
    let repeats = &outcome.passes[0].repeats;
    assert!(repeats.len() == 1 && !repeats[0].deformed);
    assert!(outcome.field.su.iter().filter(|s| s.is_finite()).count() > outcome.field.len() / 2);
    assert!(rms(&outcome.field) < 0.0098, "{}", rms(&outcome.field));
}

/// Deformed windows follow a shear of 0.2 voxel per voxel; shifted windows do not.
#[test]
fn deformation_follows_a_steep_gradient() {
    let grid = scene::grid([96, 96, 64]);
    let truth = |p: [f64; 3]| [0.2 * (p[1] - 48.0), 0.0, 0.15 * (p[0] - 48.0)];
    let [a, b] = scene::pair(&grid, 12.0 / 32f64.powi(3), [0.8; 3], 7, truth);
    let error = |deform: Deform| {
        let options =
            Options { deform, ..Options::coarse_to_fine([48, 48, 48], [32; 3], 0.75, [12, 4, 10], Options::REFINE) };
        let field = correlate(&a.sparse(), &b.sparse(), &options).unwrap().field;
        let measured: Vec<usize> = (0..field.len()).filter(|&i| field.flag[i] == MEASURED).collect();
        let square = |&i: &usize| (field.u[i] as f64 - truth(field.place_mm(i))[0]).powi(2);
        (measured.iter().map(square).sum::<f64>() / measured.len() as f64).sqrt()
    };
    let (auto, never) = (error(Deform::Auto), error(Deform::Never));
    assert!(auto < 0.01 && auto < 0.2 * never, "{auto} {never}");
}

/// Three separate particles, one of them too faint to count.
#[test]
fn particle_images_are_counted() {
    let grid = scene::grid([40, 40, 40]);
    let mut dense = vec![0f32; grid.len() as usize];
    for (centre, peak) in [([10.0, 10.0, 10.0], 1.0), ([30.2, 28.0, 12.0], 0.8), ([12.0, 30.0, 30.0], 0.02)] {
        scene::splat(&mut dense, &grid, centre, [0.8; 3], peak);
    }
    let volume = Volume::from_dense(&grid, &dense);
    let options = Options::coarse_to_fine([40; 3], [40; 3], 0.0, [4; 3], [3; 3]);
    let field = correlate(&volume.sparse(), &volume.sparse(), &options).unwrap().field;
    assert_eq!(field.count, [2.0]);
}
