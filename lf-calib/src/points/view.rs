//! Where a lenslet shows a point that is out of focus.
//!
//! Such a point lights many lenslets. If the whole cell of a lenslet is lit from inside the stop, its light is even
//! over the cell and keeps its proportions on the sensor. The middle of the sub-image is therefore where the ray
//! through the lenslet's centre c lands: `x_m(U) = c` gives U, and U gives the position on the sensor.
//!
//! Where rays bend (aberrations, a window) light is not even over the cell, and its place in the stop is not linear in
//! that on the array. Both move the middle, by the cell's second moment.

use glam::{DMat2, DVec2, DVec3};
use lf_core::Optics;
use std::f64::consts::SQRT_2;

/// Steps that find the ray through a position on the array.
const STEPS: usize = 16;
/// Step of a derivative, as a fraction of the stop's radius.
const STEP: f64 = 1e-4;
/// A cell over which light changes by more than this part, from the middle to its side, is not lit as a whole.
const UNEVEN: f64 = 0.3;
/// Tolerance of the position in the aperture, as a fraction of its radius.
const NEAR_ENOUGH: f64 = 1e-10;

/// A point of the object as the lenslets see it.
pub(crate) struct PointView<'a> {
    optics: &'a Optics,
    place_mm: DVec3,
    /// Where the ray through the middle of the stop meets the array, mm.
    pub chief_mm: DVec2,
    /// Distance on the array for each unit of distance in the aperture.
    pub alpha: f64,
    cell_variance_mm2: f64,
}

pub(crate) struct LitLenslet {
    pub lenslet: (i64, i64),
    pub place_px: DVec2,
}

impl<'a> PointView<'a> {
    pub fn new(optics: &'a Optics, place_mm: DVec3) -> Self {
        let (object, z_mm) = (place_mm.truncate(), place_mm.z);
        let radius = optics.half_aperture_mm;
        let hit = |u: f64| optics.array_from_object(object, z_mm, DVec2::new(u, 0.0));
        let alpha = (hit(0.5 * radius).x - hit(-0.5 * radius).x) / radius;
        Self { optics, place_mm, chief_mm: hit(0.0), alpha, cell_variance_mm2: cell_variance_mm2(optics) }
    }

    /// Where the ray that meets the array at `array_mm` passes the aperture, mm.
    pub fn aperture_mm(&self, array_mm: DVec2) -> DVec2 {
        self.find_aperture(array_mm).0
    }

    /// Like [`Self::aperture_mm`], and whether the ray was found.
    fn find_aperture(&self, array_mm: DVec2) -> (DVec2, bool) {
        let radius = self.optics.half_aperture_mm;
        let mut aperture = (array_mm - self.chief_mm) / self.alpha;
        let mut by_hit = DMat2::from_diagonal(DVec2::splat(1.0 / self.alpha));
        if self.optics.bends_rays() {
            let by_place = self.spread(aperture, STEP * radius).0.inverse();
            // At a caustic it has no bound.
            if by_place.is_finite() {
                by_hit = by_place;
            }
        }
        for _ in 0..STEPS {
            let step = (by_hit * (array_mm - self.hit(aperture))).clamp_length_max(radius);
            aperture += step;
            if step.length() < NEAR_ENOUGH * radius {
                return (aperture, true);
            }
        }
        (aperture, false)
    }

    /// Where the ray that passes the aperture at `aperture` meets the array, mm.
    fn hit(&self, aperture: DVec2) -> DVec2 {
        self.optics.array_from_object(self.place_mm.truncate(), self.place_mm.z, aperture)
    }

    /// First and pure second derivatives of that place by the one in the aperture, by differences over `step`.
    fn spread(&self, aperture: DVec2, step: f64) -> (DMat2, [DVec2; 2]) {
        let middle = self.hit(aperture);
        let along = |axis: DVec2| {
            let (before, after) = (self.hit(aperture - step * axis), self.hit(aperture + step * axis));
            ((after - before) / (2.0 * step), (after + before - 2.0 * middle) / (step * step))
        };
        let (x, y) = (along(DVec2::X), along(DVec2::Y));
        (DMat2::from_cols(x.0, y.0), [x.1, y.1])
    }

    /// Middle of the sub-image under lenslet (i, j), px.
    pub fn place_px(&self, (i, j): (i64, i64)) -> DVec2 {
        let centre = self.optics.lattice().centre_mm(i, j);
        self.middle_px(centre, self.aperture_mm(centre)).0
    }

    /// By how much a source of this standard deviation along x and y moves the middle of a sub-image from that of a
    /// point, px. Where rays bend, the sides of the source send different light to a lenslet.
    pub fn shift_px(&self, lenslet: (i64, i64), object_mm: f64) -> DVec2 {
        if !self.optics.bends_rays() {
            return DVec2::ZERO;
        }
        let centre = self.optics.lattice().centre_mm(lenslet.0, lenslet.1);
        let (mut sum, mut light) = (DVec2::ZERO, 0.0);
        for side in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y] {
            let view = Self::new(self.optics, self.place_mm + SQRT_2 * object_mm * side);
            let aperture = view.aperture_mm(centre);
            // The share of the stop that lights the cell.
            let share = 1.0 / view.spread(aperture, STEP * self.optics.half_aperture_mm).0.determinant().abs();
            sum += share * view.middle_px(centre, aperture).0;
            light += share;
        }
        sum / light - self.place_px(lenslet)
    }

    /// Middle of the sub-image, px, under the lenslet at `centre` that is lit from `aperture`, and the part by which
    /// its light changes from the middle of the cell to its side.
    fn middle_px(&self, centre: DVec2, aperture: DVec2) -> (DVec2, f64) {
        let central = self.optics.place_px(self.optics.sensor_from_array(centre, aperture));
        if !self.optics.bends_rays() {
            return (central, 0.0);
        }
        let side = self.cell_variance_mm2.sqrt();
        let (by_stop, [xx, yy]) = self.spread(aperture, side / self.alpha.abs());
        let by_place = by_stop.inverse();
        // Rays are the gradient of a wave: a mixed derivative of one component is a pure one of the other.
        let xy = DVec2::new(xx.y, yy.x);
        let trace = |by: DMat2| (by_place * by).x_axis.x + (by_place * by).y_axis.y;
        let parting = DVec2::new(trace(DMat2::from_cols(xx, xy)), trace(DMat2::from_cols(xy, yy)));
        let on_array = -self.cell_variance_mm2 * (by_place.transpose() * parting);
        let change = on_array.length() / side;
        // At a caustic the series has no bound.
        if change.is_nan() || change >= 1.0 {
            return (central, f64::INFINITY);
        }
        let bent = |step: DVec2| step.x * step.x * xx + 2.0 * step.x * step.y * xy + step.y * step.y * yy;
        let both = bent(by_place.x_axis) + bent(by_place.y_axis);
        let in_stop = aperture + by_place * (on_array - 0.5 * self.cell_variance_mm2 * both);
        (self.optics.place_px(self.optics.sensor_through(centre, centre + on_array, in_stop)), change)
    }

    /// Signed distance on the sensor for each unit of distance on the array, under lenslet (i, j).
    pub fn widening(&self, (i, j): (i64, i64)) -> f64 {
        let lattice = self.optics.lattice();
        let centre = lattice.centre_mm(i, j);
        let step = DVec2::new(0.1 * lattice.row_pitch_mm(), 0.0);
        let at = |array: DVec2| self.optics.sensor_from_array(array, self.aperture_mm(array)).x;
        (at(centre + step) - at(centre - step)) / (2.0 * step.x)
    }

    /// Motion of a sub-image for each mm that the point moves across the axis, px per mm.
    pub fn px_per_mm(&self) -> f64 {
        let step = DVec2::new(0.01, 0.0);
        let (object, z_mm) = (self.place_mm.truncate(), self.place_mm.z);
        let hit = |place: DVec2| self.optics.array_from_object(place, z_mm, DVec2::ZERO);
        let on_array = (hit(object + step).x - hit(object - step).x) / (2.0 * step.x);
        // A motion on the array changes the position in the aperture that lights a lenslet.
        let k = self.optics.demagnification;
        let pitch_mm = self.optics.pixel_pitch_mm;
        (k * on_array / self.alpha / pitch_mm).abs()
    }

    /// The lenslets with a cell that is lit, at every corner, from within `share` of the stop's radius or half side.
    /// The point has this radius in mm.
    pub fn lit_lenslets(&self, share: f64, radius_mm: f64) -> Vec<LitLenslet> {
        let lattice = self.optics.lattice();
        let reach = self.optics.half_aperture_mm * self.alpha.abs() * share + lattice.row_pitch_mm();
        let cell = lattice.cell_mm();
        let pitch_px = self.optics.place_px(DVec2::X) - self.optics.place_px(DVec2::ZERO);
        let size = radius_mm * self.px_per_mm() / (pitch_px.x * self.optics.demagnification);
        let passes = |aperture: DVec2| {
            let outward = if size > 0.0 { aperture + size * self.outward(aperture) } else { aperture };
            self.optics.passes(outward / share)
        };
        lattice
            .lenslets_within(self.chief_mm, DVec2::splat(reach))
            .filter_map(|(i, j, centre)| {
                let (aperture_mm, is_found) = self.find_aperture(centre);
                let is_lit = is_found && cell.iter().all(|corner| passes(aperture_mm + *corner / self.alpha));
                let (place_px, change) = if is_lit { self.middle_px(centre, aperture_mm) } else { return None };
                (change < UNEVEN).then_some(LitLenslet { lenslet: (i, j), place_px })
            })
            .collect()
    }

    /// Direction out of the stop: of length 1 in a round stop, a step of 1 along each axis in a square one.
    fn outward(&self, aperture: DVec2) -> DVec2 {
        let diagonal = DVec2::splat(self.optics.half_aperture_mm * 0.99);
        // The corner of the bounding square passes only through a square stop.
        if self.optics.passes(diagonal) { aperture.signum() } else { aperture.normalize_or_zero() }
    }
}

/// Second moment of a lenslet's cell along any axis, mm^2, for square and hexagonal cells.
pub(crate) fn cell_variance_mm2(optics: &Optics) -> f64 {
    let cell = optics.lattice().cell_mm();
    let (mut area, mut moment) = (0.0, 0.0);
    for n in 0..cell.len() {
        let (a, b) = (cell[n], cell[(n + 1) % cell.len()]);
        // For a triangle with one corner at 0, the mean of |x|^2 is (a.a + a.b + b.b) / 6.
        let triangle = 0.5 * a.perp_dot(b);
        area += triangle;
        moment += triangle * (a.dot(a) + a.dot(b) + b.dot(b)) / 6.0;
    }
    0.5 * moment / area
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::nominal::data_sheet::{DataSheet, tests::seed as sheet};
    use lf_core::camera::{Aberrations, Camera, Distortion, Layout, Medium, Tilt};
    use lf_core::lattice::Centres;

    /// The seed camera of the simulations behind a round stop.
    pub(crate) fn seed(lenslets: usize, layout: Layout) -> Camera {
        DataSheet { sensor_px: [14 * lenslets; 2], layout, ..sheet() }.camera(None).unwrap()
    }

    #[test]
    fn the_image_of_a_point_on_the_axis_by_hand() {
        // m = 1, s_i = s_o = 400, Z = 4: alpha = 4/396. Lenslet c is lit through U = c / alpha = 99 c, and shows the
        // point at c (1 + k (1 - 99)), k = 0.00077.
        let camera = seed(20, Layout::Square);
        let optics = Optics::new(&camera);
        let view = PointView::new(&optics, DVec3::new(0.0, 0.0, 4.0));
        let centre = 4.5 * 0.077;
        assert!((view.alpha - 4.0 / 396.0).abs() < 1e-15);
        assert!((view.aperture_mm(DVec2::new(centre, 0.0)).x - 99.0 * centre).abs() < 1e-9);
        let place = view.place_px((4, -1));
        assert!((place.x - 140.0 - centre * (1.0 + 0.00077 * (1.0 - 99.0)) / 0.0055).abs() < 1e-9);
        // The image of a cell of 14 px is wider by k (1/alpha - 1). A motion of the point moves it by k beta / alpha.
        assert!((view.widening((4, -1)) - 0.00077 * (1.0 - 99.0)).abs() < 1e-9);
        assert!((view.px_per_mm() - 0.00077 * 100.0 / 0.0055).abs() < 1e-6);
        assert!((cell_variance_mm2(&optics) - 0.077 * 0.077 / 12.0).abs() < 1e-12);
    }

    /// Mean position of a point's light under a lenslet, from rays spread evenly over the stop, and their number.
    fn by_rays(optics: &Optics, place: DVec3, seen: &LitLenslet, whole: DVec2) -> (DVec2, f64) {
        const SIDE: usize = 400;
        let centre = optics.lattice().centre_mm(seen.lenslet.0, seen.lenslet.1);
        let middle = PointView::new(optics, place).aperture_mm(centre);
        let (mut sum, mut count) = (DVec2::ZERO, 0.0);
        for n in 0..SIDE * SIDE {
            let part = (DVec2::new((n % SIDE) as f64, (n / SIDE) as f64) + 0.5) / SIDE as f64 - 0.5;
            let aperture = middle + part * whole;
            let array = optics.array_from_object(place.truncate(), place.z, aperture);
            if optics.lattice().nearest_centre_mm(array).distance(centre) < 1e-9 && optics.passes(aperture) {
                sum += optics.place_px(optics.sensor_from_array(array, aperture));
                count += 1.0;
            }
        }
        (sum / count, count)
    }

    #[test]
    fn the_middle_of_the_light_is_where_the_central_ray_lands() {
        type Change = fn(&mut Camera);
        let changes: [(&str, Change); 8] = [
            ("plain", |_| ()),
            ("distortion", |camera| {
                camera.distortion = Some(Distortion { radial: [60.0, 1e4, 0.0], tangential: [0.02, -0.03] });
            }),
            ("tilt", |camera| camera.tilt = Some(Tilt { x_rad: 0.02, y_rad: -0.01 })),
            ("gap", |camera| camera.microlenses.gap_mm = Some(0.32)),
            ("aberrations", |camera| {
                camera.aberrations = Some(Aberrations {
                    spherical_px: 1.0,
                    secondary_spherical_px: 0.5,
                    coma_px: 3.0,
                    coma_px_per_mm: 0.5,
                    astigmatism_px: 3.0,
                    field_curvature_px: -2.0,
                });
            }),
            ("medium", |camera| {
                camera.medium =
                    Some(Medium { index: 1.333, window_z_mm: 40.0, window_thickness_mm: 10.0, window_index: 1.49 });
            }),
            ("tank", |camera| {
                camera.medium =
                    Some(Medium { index: 1.333, window_z_mm: 180.0, window_thickness_mm: 20.0, window_index: 1.49 });
            }),
            ("centres", |camera| {
                let x_mm = vec![0.004, -0.003, 0.002, 0.001, -0.002];
                let y_mm = x_mm.iter().rev().copied().collect();
                camera.centres = Some(Centres { radius_mm: 1.1, x_mm, y_mm });
            }),
        ];
        for layout in [Layout::Square, Layout::Hexagonal] {
            for (name, change) in changes {
                let mut camera = seed(40, layout);
                camera.microlenses.rotation_rad = 0.01;
                change(&mut camera);
                camera.check().unwrap();
                let optics = Optics::new(&camera);
                for place in [DVec3::new(0.5, -0.3, 4.0), DVec3::new(-0.6, 0.2, -2.5)] {
                    let view = PointView::new(&optics, place);
                    let fan = view.lit_lenslets(0.95, 0.0);
                    let fewest = if name == "tank" { 10 } else { 11 };
                    assert!(fan.len() >= fewest, "{name} {}", fan.len());
                    let whole = DVec2::splat(1.3 * 0.077 / view.alpha.abs());
                    for seen in fan.iter().step_by(7) {
                        let (mean, count) = by_rays(&optics, place, seen, whole);
                        let off = mean.distance(seen.place_px);
                        let most_px = if name == "tank" { 0.02 } else { 0.004 };
                        assert!(off < most_px, "{layout:?} {name} {place}: {off} px");
                        assert!(seen.place_px.distance(view.place_px(seen.lenslet)) < 1e-12);
                        // A lenslet that is lit as a whole gets rays in proportion to its cell's area.
                        let wanted = optics.lattice().cell_area_mm2() / (whole.x * view.alpha).powi(2);
                        let most = match name {
                            "tank" => 0.9,
                            "medium" | "aberrations" => 0.5,
                            _ => 0.02,
                        };
                        assert!((count / 160_000.0 / wanted - 1.0).abs() < most, "{name} {count}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_dot_moves_the_middle_of_the_light_as_its_rays_do() {
        let mut camera = seed(40, Layout::Square);
        let mut most_px = 0.0f64;
        let tank = Medium { index: 1.333, window_z_mm: 180.0, window_thickness_mm: 20.0, window_index: 1.49 };
        for medium in [None, Some(tank)] {
            camera.medium = medium;
            let optics = Optics::new(&camera);
            for (place, radius) in [(DVec3::new(0.5, -0.3, 4.0), 0.04), (DVec3::new(-0.6, 0.2, -2.5), 0.025)] {
                let view = PointView::new(&optics, place);
                let whole = DVec2::splat(1.3 * 0.077 / view.alpha.abs());
                for seen in view.lit_lenslets(0.9, 0.025).iter().step_by(3) {
                    // Two rings of equal area.
                    let (mut sum, mut light) = (DVec2::ZERO, 0.0);
                    for n in 0..16 {
                        let ring = radius * if n < 8 { 0.5 } else { 0.75f64.sqrt() };
                        let side = DVec2::from_angle(std::f64::consts::FRAC_PI_4 * f64::from(n)) * ring;
                        let (mean, count) = by_rays(&optics, place + side.extend(0.0), seen, whole);
                        sum += count * mean;
                        light += count;
                    }
                    let shift = view.shift_px(seen.lenslet, 0.5 * radius);
                    let off = sum / light - seen.place_px;
                    assert!(off.distance(shift) < 0.001 + 0.25 * off.length(), "{place} {off} {shift}");
                    most_px = most_px.max(shift.length());
                }
            }
        }
        assert!(most_px > 0.04, "{most_px}");
    }
}
