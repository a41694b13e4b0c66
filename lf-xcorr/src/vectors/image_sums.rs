//! The contributions of particle images to the sums of a window.

use super::particle_images::{ParticleImages, Voxel};
use crate::correlate::WindowGrid;
use crate::volumes::Rows;
use glam::DVec3;
use rayon::prelude::*;

/// The particle images in every cell of the window grid, cut at the cell's sides; x fastest.
pub(crate) fn images_of_cells(matched: &[[Rows; 2]], windows: &WindowGrid) -> Vec<Vec<ImageSums>> {
    let mut cells: Vec<Vec<ImageSums>> = vec![Vec::new(); windows.cell_count()];
    let mut first_image = 0u64;
    for (number, pair) in matched.iter().enumerate() {
        let images = ParticleImages::new(pair.each_ref());
        let in_cell = |cell: usize| {
            let mut found: Vec<ImageSums> = Vec::new();
            images.visit(windows.cell(cell), |voxel| {
                let sums = ImageSums::new(&voxel, number, first_image);
                match found.iter_mut().rev().find(|other| other.image == sums.image) {
                    Some(same) => same.add(&sums),
                    None => found.push(sums),
                }
            });
            found
        };
        let found: Vec<Vec<ImageSums>> = (0..cells.len()).into_par_iter().map(in_cell).collect();
        cells.iter_mut().zip(found).for_each(|(cell, found)| cell.extend(found));
        first_image += images.count() as u64;
    }
    cells
}

/// The contribution of a particle image to the sums of a window. Pairs and images have numbers.
#[derive(Clone, Copy, Default)]
pub(crate) struct ImageSums {
    pub pair: usize,
    pub image: u64,
    /// 1 if the top of the image is here.
    pub tops: usize,
    /// Sum of first x second; sums of the first and of the second, plain and squared.
    pub product: f64,
    /// Sum of the places of its voxels, weighted by first x second.
    pub moment: DVec3,
    pub light: [f64; 2],
    pub squares: [f64; 2],
    /// Sum of first x second, with the second at +1 and at -1 voxel along each axis.
    pub plus: DVec3,
    pub minus: DVec3,
    /// Change of the sums of squares of the first and of the second from -1 to +1 voxel along each axis.
    pub flux: [DVec3; 2],
}

impl ImageSums {
    /// A voxel of pair number `pair`, whose images are numbered from `first_image` on.
    fn new(voxel: &Voxel, pair: usize, first_image: u64) -> Self {
        let [a, b] = voxel.light.map(f64::from);
        let [a_next, b_next] = [0, 1].map(|volume| DVec3::from_array(voxel.next.map(|light| f64::from(light[volume]))));
        Self {
            pair,
            image: voxel.image as u64 + first_image,
            tops: voxel.is_top as usize,
            product: a * b,
            moment: a * b * DVec3::from_array(voxel.place.map(|place| place as f64)),
            light: [a, b],
            squares: [a * a, b * b],
            plus: a * b_next,
            minus: a_next * b,
            flux: [a * a - a_next * a_next, b_next * b_next - b * b],
        }
    }

    pub fn add(&mut self, other: &Self) {
        self.tops += other.tops;
        self.product += other.product;
        self.moment += other.moment;
        self.plus += other.plus;
        self.minus += other.minus;
        for i in 0..2 {
            self.light[i] += other.light[i];
            self.squares[i] += other.squares[i];
            self.flux[i] += other.flux[i];
        }
    }
}

/// The pieces of each particle image put together, in the order of the images.
pub(crate) fn joined(mut pieces: Vec<ImageSums>) -> Vec<ImageSums> {
    pieces.sort_by_key(|piece| piece.image);
    let total = |pieces: &[ImageSums]| {
        let mut total = pieces[0];
        pieces[1..].iter().for_each(|piece| total.add(piece));
        total
    };
    pieces.chunk_by(|a, b| a.image == b.image).map(total).collect()
}
