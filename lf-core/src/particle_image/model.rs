//! The image of a particle, lenslet by lenslet.

use super::beam::{Beam, Tracer};
use super::cell_surface::{Ladder, REACH_SIGMA, Surfaces, half_sides};
use super::fresnel::WaveCell;
use super::lenslet_image::{LensletImage, Listed, Patch, Scratch};
use super::lenslet_lines::LensletLines;
use super::pictures::Pictures;
use super::quantities::{LIGHT, PLACES, QUANTITIES};
use super::sensor_blur::SensorBlur;
use super::view::View;
use crate::halo::Halo;
use crate::simd::fastest;
use crate::{Camera, Optics, Refusal, camera::Aperture, weights::check_depth_mm};
use glam::DVec2;
use std::f64::consts::PI;
use std::sync::Arc;

/// Images of particles of one size, seen by one camera, within a range of depths.
#[derive(Debug, Clone)]
pub struct ParticleModel {
    pub(super) view: View,
    tracer: Tracer,
    lines: LensletLines,
    /// Tables for spots on the array.
    surfaces: Surfaces,
    /// Standard deviation of a particle, mm.
    sigma_mm: f64,
    /// Growth of alpha with depth in focus, 1/mm.
    alpha_by_z: f64,
    bend_px: f64,
}

/// Ratio of the sizes of neighbouring tables. Between two tables the model is linear in the size; it errs by 2e-4.
const TABLE_RATIO: f64 = 1.04;
/// The largest table, pitches of the lenslets.
const MOST_PITCHES: f64 = 8.0;
/// Spots smaller than this are drawn at this size, pixel pitches on the array.
const LEAST_SPOT_PX: f64 = 0.05;
/// Largest distance of the ends of a cell's edges from those along the axes for which they are taken as one, px.
const MOST_TURN_PX: f64 = 0.06;
/// Cells whose corners lie this near to each other share their tables, px: an edge moves by a thousandth of a spot.
const ALIKE_PX: f64 = 5e-4;

/// Takes a lenslet and its pixels or places.
type Found<'a> = &'a mut dyn FnMut(Patch, &Scratch);

impl ParticleModel {
    /// For particles of standard deviation `sigma_mm` within `depth_mm`. Refuses depths that no camera sees (see
    /// [`check_depth_mm`]), and a size that is not above 0 or wider than two lenslets.
    pub fn new(camera: &Camera, sigma_mm: f64, depth_mm: [f64; 2]) -> Result<Self, Refusal> {
        Self::from(None, camera, sigma_mm, depth_mm)
    }

    /// The model of another size, or of a camera that was moved a little. It shares the tables where the cell is the
    /// same, and then costs little. Refuses what [`Self::new`] refuses.
    pub fn reshaped(&self, camera: &Camera, sigma_mm: f64, depth_mm: [f64; 2]) -> Result<Self, Refusal> {
        Self::from(Some(self), camera, sigma_mm, depth_mm)
    }

    fn from(known: Option<&Self>, camera: &Camera, sigma_mm: f64, depth_mm: [f64; 2]) -> Result<Self, Refusal> {
        depth_mm.into_iter().try_for_each(|z| check_depth_mm(camera, z))?;
        let optics = Optics::new(camera);
        let tracer = Tracer::new(camera);
        let pitch_mm = camera.microlenses.pitch_mm;
        let found = || format!("a particle of {sigma_mm} mm");
        let is_fit = sigma_mm > 0.0 && sigma_mm * optics.beta(0.0) < 2.0 * pitch_mm;
        Refusal::unless(is_fit, found, "wanted more than 0, less than two lenslets at the focal plane")?;
        let blur = SensorBlur::new(camera);
        let sizes: Vec<f64> =
            std::iter::successors(Some(LEAST_SPOT_PX * optics.pixel_pitch_mm), |size| Some(TABLE_RATIO * size))
                .take_while(|size| *size < MOST_PITCHES * pitch_mm)
                .collect();
        let corners = cell(&optics, pitch_mm, blur.is_some());
        let alike_mm = ALIKE_PX * optics.pixel_pitch_mm;
        let is_exact = known.is_some_and(|model| model.view.is_exact);
        let waves = camera.fresnel().map(|pattern| {
            let half_px = optics.demagnification * optics.half_aperture_mm / optics.pixel_pitch_mm;
            let is_round = camera.main_lens.aperture == Aperture::Circle;
            WaveCell::new(&corners, pitch_mm, pattern, (half_px, is_round))
        });
        let known = known.filter(|model| model.surfaces.are_for(&corners, &sizes, alike_mm));
        let surfaces = known.map_or_else(|| Surfaces::new(&corners, &sizes), |model| model.surfaces.clone());
        let are_alike = |pictures: &&Arc<Pictures>| match (&pictures.waves, &waves) {
            (Some(own), Some(other)) => own.is_like(other),
            (own, other) => own.is_none() && other.is_none(),
        };
        let pictures = known.and_then(|model| model.view.pictures.as_ref()).filter(are_alike).cloned();
        let width_mm = 2.0 * half_sides(&corners).max_element();
        let pictures = blur.is_some().then(|| pictures.unwrap_or_else(|| Arc::new(Pictures::new(width_mm, waves))));
        let has_round_stop = camera.main_lens.aperture == Aperture::Circle;
        let half = optics.half_aperture_mm;
        let in_focus = tracer.beam(&optics, [0.0; 3]);
        Ok(Self {
            lines: LensletLines::new(&optics, pitch_mm),
            surfaces,
            sigma_mm,
            alpha_by_z: in_focus.alpha_by[2],
            bend_px: in_focus.most_bend_mm / optics.pixel_pitch_mm,
            view: View {
                corner: half_sides(&corners),
                cell_radius: corners.iter().map(|corner| corner.length()).fold(0.0, f64::max),
                pitch_mm,
                has_round_stop,
                stop_mm2: if has_round_stop { PI * half * half } else { 4.0 * half * half },
                optics,
                pictures,
                is_exact,
                blur,
            },
            tracer,
        })
    }

    /// Whether light and its derivatives by place are exact where the stop cuts a lenslet's light. Pictures err there
    /// by up to 0.6 % of a particle's light, or 0.3 px in depth. Exact images take 1.2 to 1.5 times as long.
    pub fn set_exact(&mut self, is_exact: bool) {
        self.view.is_exact = is_exact;
    }

    /// Standard deviation of a particle, mm.
    pub fn sigma_mm(&self) -> f64 {
        self.sigma_mm
    }

    /// Largest bend of the rays of a particle in focus on the axis, px on the array.
    pub fn bend_px(&self) -> f64 {
        self.bend_px
    }

    /// Bytes of the tables of cells. A table is made when an image of its size is first drawn.
    pub fn table_bytes(&self) -> usize {
        self.surfaces.bytes() + self.view.pictures.as_ref().map_or(0, |pictures| pictures.bytes())
    }

    /// Whether the sensor is blurred.
    pub fn is_blurred(&self) -> bool {
        self.view.blur.is_some()
    }

    /// Whether lenslets make Fresnel's pattern.
    pub fn follows_waves(&self) -> bool {
        self.view.follows_waves()
    }

    /// The far light around the images; None if nothing diffracts.
    pub fn halo(&self) -> Option<&Halo> {
        self.view.blur.as_ref()?.halo.as_ref()
    }

    /// Columns and rows of the sensor.
    pub fn sensor_px(&self) -> [usize; 2] {
        self.view.optics.sensor_px
    }

    /// Column and row of the pixel under which a particle's chief ray meets the array, px.
    pub fn chief_px(&self, place_mm: [f64; 3]) -> [f64; 2] {
        let point = DVec2::new(place_mm[0], place_mm[1]);
        let hit = self.view.optics.array_from_object(point, place_mm[2], DVec2::ZERO);
        self.view.optics.place_px(self.view.optics.sensor_from_array(hit, DVec2::ZERO)).to_array()
    }

    /// How far, px on the array, a ray through the rim of the stop moves for a step of `step_mm` in depth near focus.
    pub fn spread_px(&self, step_mm: f64) -> f64 {
        (self.alpha_by_z * step_mm).abs() * self.view.optics.half_aperture_mm / self.view.optics.pixel_pitch_mm
    }

    /// Largest distance from the chief ray of a particle at depth `z_mm` to a pixel that it lights, px.
    pub fn reach_px(&self, z_mm: f64) -> f64 {
        let beam = self.tracer.beam(&self.view.optics, [0.0, 0.0, z_mm]);
        let spot = REACH_SIGMA * beam.beta * self.sigma_mm;
        let on_array = beam.alpha.abs() * self.view.optics.half_aperture_mm + spot + self.view.pitch_mm;
        let blur_px = self.view.blur.as_ref().map_or(0.0, |blur| blur.reach_px() + self.view.fringes_px());
        let picture = self.view.optics.demagnification * self.view.optics.half_aperture_mm + self.view.pitch_mm;
        (on_array + picture) / self.view.optics.pixel_pitch_mm + blur_px + 2.0
    }

    /// Calls `found(patch, pixels)` for the lenslets that a particle at `place_mm` lights. `size` is its standard
    /// deviation over that of the model. The pixels of a patch come row by row; each holds the share of the particle's
    /// light and its derivatives: see [`QUANTITIES`]. A pixel may come in several patches: its share is the sum.
    pub fn visit(
        &self,
        place_mm: [f64; 3],
        size: f64,
        scratch: &mut Scratch,
        mut found: impl FnMut(Patch, &[[f64; QUANTITIES]]),
    ) {
        self.draw((QUANTITIES, false), place_mm, size, scratch, &mut |patch, scratch| found(patch, &scratch.pixels));
    }

    /// Like [`Self::visit`], but with the first [`PLACES`] quantities only, in less time. The derivative by z leaves
    /// out that the spot grows towards the camera, a ten-thousandth of it.
    pub fn visit_places(
        &self,
        place_mm: [f64; 3],
        size: f64,
        scratch: &mut Scratch,
        mut found: impl FnMut(Patch, &[[f32; PLACES]]),
    ) {
        self.draw((PLACES, false), place_mm, size, scratch, &mut |patch, scratch| found(patch, &scratch.places));
    }

    /// Like [`Self::visit_places`], but the derivatives are not wanted.
    pub fn visit_light(
        &self,
        place_mm: [f64; 3],
        size: f64,
        scratch: &mut Scratch,
        mut found: impl FnMut(Patch, &[[f32; PLACES]]),
    ) {
        self.draw((LIGHT, false), place_mm, size, scratch, &mut |patch, scratch| found(patch, &scratch.places));
    }

    /// Visits pixels whose light [`Self::visit_light`] has wrong: waves put other light at the rim of the stop and far
    /// from the shadow.
    /// The first number of a pixel is the share of light to add, which may be negative. A model that does not follow
    /// waves visits no pixel. The visit takes ten to fifty times as long as [`Self::visit_light`].
    pub fn visit_rest(
        &self,
        place_mm: [f64; 3],
        size: f64,
        scratch: &mut Scratch,
        mut found: impl FnMut(Patch, &[[f32; PLACES]]),
    ) {
        if self.follows_waves() {
            self.draw((LIGHT, true), place_mm, size, scratch, &mut |patch, scratch| found(patch, &scratch.places));
        }
    }

    /// No generic function, so that it is compiled in this crate alone.
    fn draw(
        &self,
        (quantities, is_rest): (usize, bool),
        place_mm: [f64; 3],
        size: f64,
        scratch: &mut Scratch,
        found: Found,
    ) {
        match quantities {
            LIGHT => self.draw_first::<LIGHT>(place_mm, (size, is_rest), scratch, found),
            PLACES => self.draw_first::<PLACES>(place_mm, (size, is_rest), scratch, found),
            _ => self.draw_first::<QUANTITIES>(place_mm, (size, is_rest), scratch, found),
        }
    }

    fn draw_first<const N: usize>(
        &self,
        place_mm: [f64; 3],
        (size, is_rest): (f64, bool),
        scratch: &mut Scratch,
        found: Found,
    ) {
        let beam = self.tracer.beam(&self.view.optics, place_mm);
        let sigma_mm = size * self.sigma_mm;
        let spot_mm = (sigma_mm * beam.beta).max(LEAST_SPOT_PX * self.view.optics.pixel_pitch_mm);
        let how = ([sigma_mm, spot_mm], is_rest);
        fastest(
            #[inline(always)]
            || match &self.surfaces {
                Surfaces::Any(ladder) => self.draw_lenslets::<_, N>(&beam, ladder, how, scratch, found),
                Surfaces::Rectangle(ladder) => self.draw_lenslets::<_, N>(&beam, ladder, how, scratch, found),
            },
        );
    }

    #[inline(always)]
    fn draw_lenslets<T: Listed, const N: usize>(
        &self,
        beam: &Beam,
        ladder: &Ladder<T>,
        ([sigma_mm, spot_mm], is_rest): ([f64; 2], bool),
        scratch: &mut Scratch,
        found: Found,
    ) {
        let tables = ladder.nearest(spot_mm);
        let margin = self.view.corner + REACH_SIGMA * spot_mm + beam.most_bend_mm;
        let image = LensletImage { view: &self.view, beam, tables, spot_mm, more_mm: spot_mm - tables.sigma_mm };
        scratch.shared.begin();
        let middle = self.lines.within(beam.chief, DVec2::splat(0.5 * self.view.pitch_mm)).next();
        let scale = middle.map_or(0.0, |line| image.scale(line));
        scratch.even.begin(scale);
        let fringes = if scale > 0.0 { self.view.rim_px(scale) / scale } else { 0.0 };
        let margin = margin + fringes;
        let spread = beam.alpha.abs() * self.view.optics.half_aperture_mm;
        for line in self.lines.within(beam.chief, margin + spread) {
            if self.view.has_round_stop {
                // The light of a round stop cannot reach the corners of its square.
                let beyond = ((line.centre - beam.chief).abs() - margin).max(DVec2::ZERO);
                if beyond.length_squared() > spread * spread {
                    continue;
                }
            }
            if is_rest {
                let Some(blur) = &self.view.blur else { continue };
                let Some(patch) = image.coherent(blur, line, scratch) else { continue };
                patch.into_iter().for_each(|patch| found(patch, scratch));
            }
            let by_shift = self.lines.by_shift;
            // Not in closures: these are compiled for the oldest processors unless they are inlined.
            let by_axes =
                if self.view.follows_waves() { None } else { T::by_axes::<N>(&image, line, by_shift, scratch) };
            let (patch, is_by_place) = match (by_axes, &self.view.blur) {
                (Some(patch), _) => (patch, false),
                (None, None) => (image.integrate::<N>(line, by_shift, scratch), false),
                (None, Some(blur)) => {
                    let (known, is_by_place) = match (N > PLACES, self.view.follows_waves()) {
                        (true, true) => (None, true),
                        (true, false) => (image.unshaded((blur, ladder), by_shift, line, scratch), false),
                        (false, _) => (image.even::<N>((blur, ladder), line, scratch), true),
                    };
                    match known {
                        Some(patch) => (patch, is_by_place),
                        None => (image.blurred::<N>((blur, ladder), (sigma_mm, by_shift), line, scratch), true),
                    }
                }
            };
            if let Some(patch) = patch {
                if !is_by_place {
                    to_place::<N>(beam, sigma_mm, scratch);
                }
                if is_rest {
                    scratch.places.iter_mut().for_each(|pixel| pixel[0] = -pixel[0]);
                }
                found(patch, scratch);
            }
        }
    }
}

/// Corners of a lenslet's cell, mm. The edges of a square that is turned by so little that blur hides it are laid along
/// the axes: then the image is a product. The centre of the lenslet keeps its place.
fn cell(optics: &Optics, pitch_mm: f64, is_blurred: bool) -> Vec<DVec2> {
    let turned = optics.lattice().cell_mm();
    let corner = 0.5 * pitch_mm;
    let most = MOST_TURN_PX * optics.pixel_pitch_mm;
    let is_near = turned.iter().all(|at| (at.abs() - corner).abs().max_element() < most);
    if !is_blurred || turned.len() != 4 || !is_near {
        return turned;
    }
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| corner * DVec2::new(x, y)).to_vec()
}

/// From derivatives by the beam (m, alpha, spot) to derivatives by the place and the size of the particle.
#[inline(always)]
fn to_place<const N: usize>(beam: &Beam, sigma_mm: f64, scratch: &mut Scratch) {
    let Scratch { pixels, places, .. } = scratch;
    places.clear();
    for pixel in pixels {
        let [light, mx, my, alpha, spot, shift_x, shift_y, blur] = *pixel;
        let by = |axis: usize| beam.chief_by[axis].x * mx + beam.chief_by[axis].y * my + beam.alpha_by[axis] * alpha;
        if N <= PLACES {
            places.push([light, by(0), by(1), by(2)].map(|number| number as f32));
            continue;
        }
        let z = by(2) + sigma_mm * beam.beta_by_z * spot;
        *pixel = [light, by(0), by(1), z, beam.beta * spot, shift_x, shift_y, blur];
    }
}
