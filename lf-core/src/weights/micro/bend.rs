//! Rays that a medium, a telecentric lens or its aberrations bend: how the place on the array departs from a straight
//! line in the place in the stop.
//!
//! A voxel's ray through U meets the array at `chief + alpha U + q(U)`. Over the stop q is a polynomial to the third
//! power. It changes slowly over the field, so it is fitted to exact rays at a net of places.

use crate::{Optics, linear, weights::geometry::Geometry};
use glam::{DMat2, DVec2};

/// Terms of a cubic polynomial in x and y without a constant: x, y, x^2, xy, y^2, x^3, x^2 y, xy^2, y^3.
pub(super) const TERMS: usize = 9;

/// Rays a side of the square around the stop at which a polynomial is fitted.
const RAYS: usize = 9;
/// Distance between the nodes of the net, mm of the array; and the range of their number along an axis.
const APART_MM: f64 = 1.5;
/// Largest change of a bend by aberrations between a node and its neighbour, px.
const APART_PX: f64 = 0.2;
const NODES: [usize; 2] = [3, 40];
/// Polynomials are fitted up to this many half apertures, so that they hold for lenslets beside the beam.
const BEYOND: f64 = 1.2;

/// The bend near one place of the field.
#[derive(Debug, Clone)]
pub(super) struct Node {
    /// q along x and y, mm, from the place in the stop, mm.
    pub(super) departure: [[f32; TERMS]; 2],
    /// The inverse: the place in the stop along x and y, mm, from the distance on the array to the chief ray, mm.
    pub(super) inverse: [[f32; TERMS]; 2],
    /// Width of a patch over that of straight rays: its constant, and its slopes by x, y and x^2 + y^2 in the stop.
    pub(super) width: [f32; 4],
}

impl Node {
    /// The place in the stop, mm, whose ray meets the array at (x, y) from the chief ray, mm. Straight rays spread by
    /// `alpha`.
    #[inline(always)]
    pub(super) fn aperture(&self, alpha: f32, per_alpha: f32, x: f32, y: f32) -> (f32, f32) {
        let (u, v) = (value(&self.inverse[0], x, y), value(&self.inverse[1], x, y));
        // Improve the approximate inverse by one Newton step: straight rays give the slope.
        let hit = [alpha * u + value(&self.departure[0], u, v), alpha * v + value(&self.departure[1], u, v)];
        (u + per_alpha * (x - hit[0]), v + per_alpha * (y - hit[1]))
    }
}

/// The bend of one slice.
#[derive(Debug, Clone, Default)]
pub(super) struct Bend {
    nodes: Vec<Node>,
    counts: [usize; 2],
    /// Nodes for a mm of the array, counted from `corner`.
    per_mm: DVec2,
    corner: DVec2,
    /// Spread on the array per length of the aperture on the axis.
    pub(super) alpha: f64,
    /// Largest q, mm.
    pub(super) greatest: f64,
    /// Largest distance on the array between a ray through the stop and the chief ray, mm.
    pub(super) reach: f64,
    /// Range of the width of a patch over that of straight rays.
    pub(super) widths: [f64; 2],
    /// Largest ratio of two widths from one point, if the camera has aberrations.
    pub(super) unlike: f64,
}

/// Distance on the array within which aberrations bend the rays of all points at a depth alike, mm; infinite without.
pub(super) fn alike_mm(optics: &Optics, z_mm: f64) -> f64 {
    let by_field = optics.aberrations(z_mm).map_or(0.0, |aberrations| aberrations.by_field());
    APART_PX * optics.pixel_pitch_mm / by_field
}

fn powers(place: DVec2) -> [f64; TERMS] {
    let [x, y] = place.to_array();
    [x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y]
}

/// The value of a polynomial.
#[inline(always)]
pub(super) fn value(terms: &[f32; TERMS], x: f32, y: f32) -> f32 {
    let [a, b, c, d, e, f, g, h, i] = *terms;
    x * (a + x * (c + x * f + y * g) + y * (d + y * h)) + y * (b + y * (e + y * i))
}

/// A polynomial at this y, as a cubic in x: its constant, and the factors of x, x^2 and x^3.
#[inline(always)]
pub(super) fn cubic_at(terms: &[f32; TERMS], y: f32) -> [f32; 4] {
    let [a, b, c, d, e, f, g, h, i] = *terms;
    [y * (b + y * (e + y * i)), a + y * (d + y * h), c + y * g, f]
}

/// Fits each column of `values` by a sum of N terms, by least squares.
fn fit<const N: usize, const M: usize>(terms: &[[f64; N]], values: &[[f64; M]]) -> [[f64; N]; M] {
    let (mut normal, mut solutions) = ([[0.0; N]; N], [[0.0; N]; M]);
    for (terms, values) in terms.iter().zip(values) {
        for (row, factor) in normal.iter_mut().zip(terms).chain(solutions.iter_mut().zip(values)) {
            row.iter_mut().zip(terms).for_each(|(sum, term)| *sum += factor * term);
        }
    }
    let normal = normal.as_flattened_mut();
    linear::cholesky_above(normal, N, |_, _| f64::MIN_POSITIVE);
    solutions.iter_mut().for_each(|solution| linear::solve(normal, solution));
    solutions
}

/// Coefficients for places in mm, from those for places in units of `scale` mm.
fn scaled(terms: [f64; TERMS], scale: f64) -> [f32; TERMS] {
    const POWERS: [i32; TERMS] = [1, 1, 2, 2, 2, 3, 3, 3, 3];
    std::array::from_fn(|n| (terms[n] / scale.powi(POWERS[n])) as f32)
}

/// Rays spread over the stop, mm.
fn apertures(geometry: &Geometry) -> Vec<DVec2> {
    let most = (RAYS - 1) as f64;
    let at = |n: usize| DVec2::new((n % RAYS) as f64, (n / RAYS) as f64) * (2.0 / most) - 1.0;
    let places = (0..RAYS * RAYS).map(at).filter(|place| !geometry.has_round_stop || place.length() < 1.1);
    places.map(|place| place * BEYOND * geometry.optics.half_aperture_mm).collect()
}

impl Bend {
    pub(super) fn new(geometry: &Geometry, z: usize) -> Self {
        let (optics, grid) = (&geometry.optics, &geometry.grid);
        let z_mm = grid.centre_mm(2, z);
        let apertures = apertures(geometry);
        let beta = optics.beta(z_mm);
        let ends = [0, 1].map(|axis| {
            let ends = [0, grid.shape[axis] - 1].map(|voxel| grid.centre_mm(axis, voxel));
            (0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]))
        });
        let apart_mm = APART_MM.min(alike_mm(optics, z_mm));
        let counts = ends.map(|(_, half)| ((2.0 * half * beta / apart_mm) as usize + 1).clamp(NODES[0], NODES[1]));
        let axial = optics.array_from_object(DVec2::ZERO, z_mm, DVec2::new(0.5 * optics.half_aperture_mm, 0.0));
        let alpha = axial.x / (0.5 * optics.half_aperture_mm);
        let middle = |n: usize, axis: usize| {
            let (middle, half) = ends[axis];
            middle + half * ((2 * n + 1) as f64 / counts[axis] as f64 - 1.0)
        };
        let mut this = Self { counts, alpha, widths: [f64::INFINITY, 0.0], unlike: 1.0, ..Self::default() };
        for n in 0..counts[0] * counts[1] {
            let place = DVec2::new(middle(n % counts[0], 0), middle(n / counts[0], 1));
            this.add(geometry, place, z_mm, &apertures);
        }
        let chief = |x: f64, y: f64| optics.array_from_object(DVec2::new(x, y), z_mm, DVec2::ZERO);
        let [(x, half_x), (y, half_y)] = ends;
        let corners = [chief(x - half_x, y - half_y), chief(x + half_x, y + half_y)];
        this.corner = corners[0];
        this.per_mm = DVec2::new(counts[0] as f64, counts[1] as f64) / (corners[1] - corners[0]);
        this
    }

    /// Fits the polynomials of a node to exact rays.
    fn add(&mut self, geometry: &Geometry, place: DVec2, z_mm: f64, apertures: &[DVec2]) {
        let optics = &geometry.optics;
        let range = BEYOND * optics.half_aperture_mm;
        let chief = optics.array_from_object(place, z_mm, DVec2::ZERO);
        // Trace rays through the stop.
        let hits: Vec<DVec2> =
            apertures.iter().map(|aperture| optics.array_from_object(place, z_mm, *aperture) - chief).collect();
        // Fit the departure from straight rays by the place in the stop.
        let by_stop: Vec<[f64; TERMS]> = apertures.iter().map(|aperture| powers(*aperture / range)).collect();
        let bends: Vec<[f64; 2]> =
            hits.iter().zip(apertures).map(|(hit, aperture)| (*hit - self.alpha * *aperture).to_array()).collect();
        let departure = fit(&by_stop, &bends).map(|terms| scaled(terms, range));
        // Fit the place in the stop by the hit on the array.
        let farthest = hits.iter().fold(1e-12f64, |most, hit| most.max(hit.length()));
        let by_hit: Vec<[f64; TERMS]> = hits.iter().map(|hit| powers(*hit / farthest)).collect();
        let places: Vec<[f64; 2]> = apertures.iter().map(|aperture| aperture.to_array()).collect();
        let inverse = fit(&by_hit, &places).map(|terms| scaled(terms, farthest));
        // Fit the width of a patch by the place in the stop.
        let widths: Vec<[f64; 1]> = apertures.iter().map(|aperture| [self.width(&departure, *aperture)]).collect();
        let terms: Vec<[f64; 4]> = apertures
            .iter()
            .map(|aperture| [1.0, aperture.x / range, aperture.y / range, aperture.length_squared() / (range * range)])
            .collect();
        let [width] = fit(&terms, &widths);
        let scales = [1.0, range, range, range * range];
        let width = std::array::from_fn(|n| (width[n] / scales[n]) as f32);
        // Keep the extremes of the slice.
        let within = |aperture: &DVec2| aperture.abs().max_element() <= optics.half_aperture_mm;
        let bends = bends.iter().zip(apertures).filter(|(_, aperture)| within(aperture));
        self.greatest = bends.fold(self.greatest, |most, (bend, _)| most.max(DVec2::from(*bend).length()));
        self.reach = self.reach.max(farthest / BEYOND);
        let range = widths.iter().fold([f64::INFINITY, 0.0], |[a, b], [width]| [width.min(a), width.max(b)]);
        self.widths = [self.widths[0].min(range[0]), self.widths[1].max(range[1])];
        if optics.aberrations(z_mm).is_some() {
            self.unlike = self.unlike.max(range[1] / range[0]);
        }
        self.nodes.push(Node { departure, inverse, width });
    }

    /// The width of a patch over that of straight rays, where a place in the stop has the bend `departure`.
    fn width(&self, departure: &[[f32; TERMS]; 2], aperture: DVec2) -> f64 {
        let [x, y] = aperture.as_vec2().to_array();
        let near = 0.01f32 * aperture.length().max(1.0) as f32;
        let slope = |terms: &[f32; TERMS], dx: f32, dy: f32| {
            f64::from((value(terms, x + dx, y + dy) - value(terms, x - dx, y - dy)) / (2.0 * near))
        };
        let [along_x, along_y] = departure;
        let change = DMat2::from_cols(
            DVec2::new(self.alpha + slope(along_x, near, 0.0), slope(along_y, near, 0.0)),
            DVec2::new(slope(along_x, 0.0, near), self.alpha + slope(along_y, 0.0, near)),
        );
        (self.alpha * self.alpha / change.determinant().abs().max(1e-12)).sqrt().min(10.0)
    }

    /// The node nearest to a chief ray that meets the array at `chief`, mm.
    #[inline]
    pub(super) fn near(&self, chief: DVec2) -> &Node {
        let place = (chief - self.corner) * self.per_mm;
        let [x, y] = [(place.x, self.counts[0]), (place.y, self.counts[1])]
            .map(|(place, count)| (place.max(0.0) as usize).min(count - 1));
        &self.nodes[x + self.counts[0] * y]
    }

    /// Bytes of the nodes.
    pub(super) fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>()
    }
}
