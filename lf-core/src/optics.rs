//! Rays through a plenoptic camera: object point, main lens, lenslet, sensor. The frame and the signs of every tool.
//!
//! # Frames
//!
//! **Object.** The origin is the point where the optical axis meets the focal plane, which is conjugate to the
//! microlens array. X points right and Y up in the picture as it is stored, Z points towards the camera: the frame is
//! right-handed, so what turns anticlockwise in the picture has positive vorticity about Z. All lengths are mm.
//!
//! **Sensor.** x runs along the columns, y along the rows, and the origin is on the axis. A sensor of W x H pixels with
//! pitch pp has pixel (i, j) at `[(i - W/2) pp, (i + 1 - W/2) pp]` in x; y is alike, with j and H. So a pixel's centre
//! has half-integer coordinates in pixels.
//!
//! The main lens inverts the image, and the camera reads it out upright: what moves along +X moves to higher columns,
//! what moves along +Y to lower rows. Along the sensor's axes the place (X, Y) of the object is (-X, Y), which the lens
//! inverts; [`sensor_axes`] alone turns it. The aperture and all keys of a camera are measured along the sensor's axes;
//! among them are the lattice's turn, the tilt, and p1 and p2 of the distortion.
//!
//! # A ray
//!
//! A ray starts at the point (X, Y, Z) and passes the aperture at (U, V). It meets the array at (x_m, y_m), in the cell
//! of the lenslet with centre c, and the sensor at (x_s, y_s). The equations for y are below; those for x have -X and U
//! in place of Y and V.
//!
//! ```text
//! beta(Z)  = s_i / (s_o - Z)            local magnification
//! alpha(Z) = 1 - s_i / f + beta(Z)      spread on the array per length of the aperture; 0 in focus
//! y_m      = -beta Y + alpha V          (and x_m = beta X + alpha U)
//! y_s      = c + k (y_m - V)
//! ```
//!
//! Here f is the focal length of the main lens, s_i and s_o are its image and object distances for the focal plane, and
//! k = f_l / s_i, where f_l is the focal length of a lenslet. See [`crate::camera`] for all symbols.
//!
//! The microlenses are thin and the sensor stands at their focal length. Therefore all light from one U meets one place
//! under a lenslet, and the *image* of the aperture under a lenslet is centred at c (1 + k), not at c.
//!
//! # What optional blocks of a camera add
//!
//! A block that a camera does not have costs nothing.
//!
//! - **Exit pupil** (`main_lens.pupil_distance_mm`, l). The rest of the equations takes the main lens for the stop: the
//!   exit pupil stands at l = s_i from the array. In a real lens it stands elsewhere. (U, V) is then the place in the
//!   exit pupil, D = l / N_w, and k = f_l / l. The lens still images points as a thin lens does: a point at Z is imaged
//!   s_i alpha / (1 - alpha) behind the array. A line from (U, V) through this image meets the array with
//!   `alpha_l = r alpha / d` and `beta_l = beta / d`, where r = s_i / l and d = 1 + (r - 1) alpha. They take the places
//!   of alpha and beta. In focus nothing changes on the array: d = 1. A ray that passes V and meets the array at y_m
//!   has passed the lens at h = r V + (1 - r) y_m.
//! - **Far pupil** (`main_lens.pupil_vergence_per_mm`, 1 / l). l may be infinite, or negative: behind the array. A
//!   ray is then named not by its place in the pupil but by the slope V / L with which it would meet the middle of the
//!   array, where L = s_i. So D = L / N_w and k = f_l / L as in the thin lens, and with e = L / l
//!   `y_s = c + k (e y_m - V)`, `h = (s_i / L) V + (1 - s_i / l) y_m`. With e = 1 these are the equations above.
//! - **Telecentric lens** (`main_lens.telecentric`). `y_m = -m Y + m Z t`, where t is the tangent of the ray's angle
//!   before the lens in a medium of index n. By Abbe's sine condition the angle's sine is m V / (n L), so
//!   `t = m V / sqrt((n L)^2 - (m V)^2)`, along V. Therefore beta = m at all depths. e = 0 unless the camera says where
//!   the pupil is.
//! - **Medium.** The ray bends at both faces of the window by Snell's law. Let q be its slope in the air before the
//!   lens. Then `y_m = V (1 - s_i / f) + s_i q`. Without a medium q = (V - Y) / (s_o - Z), which gives the y_m above.
//!   With an exit pupil, h takes the place of V.
//! - **Distortion.** Every ray of a point moves on the array as the ray through the lens's centre does; the place in
//!   the aperture does not matter (Seidel's fifth aberration). With t = q(0) and r = |t|,
//!   `x_m += s_i (t (k1 r^2 + k2 r^4 + k3 r^6) + tangential)`. The tangential part is 2 p1 t_x t_y + p2 (r^2 + 2 t_x^2)
//!   in x and p1 (r^2 + 2 t_y^2) + 2 p2 t_x t_y in y (Brown 1966).
//! - **Aberrations.** A ray moves on the array by the gradient of the wave aberration. Let u be (U, V) over the half
//!   width of the stop, and h the chief ray's place on the array, without distortion, over half the sensor's diagonal.
//!   With Seidel's terms S, C, A and F (spherical aberration, coma, astigmatism, field curvature),
//!   `(x_m, y_m) += S u u^2 + C (2 u (u h) + h u^2) + A h (u h) + F u h^2`, where products are those of vectors.
//!   Two further terms are what fast lenses need next: secondary spherical aberration T, `T u u^4`, and a coma that
//!   grows with depth, `C = C_0 + C_1 Z`.
//! - **Gap and tilt.** A sensor at a distance g other than f_l sees the ray after the lenslet has bent it:
//!   `x_s = x_m + g ((x_m - U) / s_i - (x_m - c) / f_l)`, with l in place of s_i if there is an exit pupil. On a tilted
//!   sensor g is the gap at x_s. Places on a tilted sensor are read along the axis, an error of half the square of the
//!   tilt.

use crate::camera::{Aperture, Camera, Distortion, Medium, RayAberrations};
use crate::frame::sensor_axes;
use crate::lattice::Lattice;
use glam::DVec2;

/// Newton steps for a ray through a window. Each step squares the error, which starts at about a tenth of the squared
/// slope: two steps leave 1e-10 for rays within 0.15 rad of the axis.
const SNELL_STEPS: usize = 2;

/// Newton steps for the place on the lens of a ray through an exit pupil and a window. The paraxial slope is exact to a
/// hundredth, so each step leaves a hundredth of the error or less.
const PUPIL_STEPS: usize = 4;

/// Smallest squared cosine of a ray before a telecentric lens; those of the stop are larger, see [`Camera::check`].
const LEAST_COSINE2: f64 = 0.05;

/// The rays of one camera.
#[derive(Debug, Clone)]
pub struct Optics {
    /// s_i.
    pub image_distance_mm: f64,
    object_distance_mm: f64,
    focal_length_mm: f64,
    /// L, at which a place in the stop is measured: l, or s_i without an exit pupil and with a far one.
    pub stop_distance_mm: f64,
    /// L / l: 1 unless the pupil is far.
    pub pupil_ratio: f64,
    /// None without an exit pupil.
    lens_shares: Option<LensShares>,
    telecentric: Option<TelecentricRays>,
    /// k, the demagnification of the aperture under a lenslet: f_l / L, or g / L with a gap g.
    pub demagnification: f64,
    /// D / 2.
    pub half_aperture_mm: f64,
    aperture: Aperture,
    lattice: Lattice,
    /// Columns and rows of the sensor.
    pub sensor_px: [usize; 2],
    /// Distance between pixels.
    pub pixel_pitch_mm: f64,
    distortion: Option<Distortion>,
    aberrations: Option<RayAberrations>,
    has_bent_rays: bool,
    medium: Option<Medium>,
    sensor_plane: Option<SensorPlane>,
}

/// A sensor that does not stand at the lenslets' focal length everywhere.
#[derive(Debug, Clone, Copy)]
struct SensorPlane {
    focal_length_mm: f64,
    gap_mm: f64,
    /// Growth of the gap per mm along x and y.
    slope: DVec2,
}

/// Where a ray meets the main lens: `h = stop V + (1 - array) y_m`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LensShares {
    /// s_i / L.
    pub(crate) stop: f64,
    /// s_i / l.
    pub(crate) array: f64,
}

/// The rays of a telecentric lens.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TelecentricRays {
    magnification: f64,
    /// n L / m: the place in the stop of a ray that would run across the axis before the lens, mm.
    across_mm: f64,
    /// Whether rays are so steep that the sine condition shows.
    is_steep: bool,
}

impl TelecentricRays {
    fn new(camera: &Camera) -> Option<Self> {
        let (magnification, index) = (camera.main_lens.magnification, camera.main_lens.telecentric?.index);
        let across_mm = index * camera.stop_distance_mm() / magnification;
        Some(Self { magnification, across_mm, is_steep: camera.has_steep_rays() })
    }

    /// Where the chief ray of a place, along the sensor's axes, meets the array, mm.
    #[inline(always)]
    pub(crate) fn chief_mm(&self, object_mm: DVec2) -> DVec2 {
        -self.magnification * object_mm
    }

    /// Where a ray from depth `z_mm` meets the array, from its chief ray there, and how that changes with the place in
    /// the stop along x and y.
    #[inline(always)]
    pub(crate) fn spread(&self, z_mm: f64, aperture_mm: DVec2) -> [DVec2; 2] {
        let depth = self.magnification * z_mm;
        if !self.is_steep {
            return [depth / self.across_mm * aperture_mm, DVec2::splat(depth / self.across_mm)];
        }
        let (square, across2) = (aperture_mm * aperture_mm, self.across_mm * self.across_mm);
        // A place beside the stop may stand for no ray; it gets a finite place.
        let per_root = 1.0 / (across2 - square.x - square.y).max(LEAST_COSINE2 * across2).sqrt();
        let growth = depth * per_root * (1.0 + square * (per_root * per_root));
        [depth * per_root * aperture_mm, growth]
    }
}

/// Straight rays from one depth: no medium, no distortion.
#[derive(Debug, Clone, Copy)]
pub struct StraightRays {
    alpha: f64,
    beta: f64,
}

impl StraightRays {
    /// x_m = beta X + alpha U and y_m = -beta Y + alpha V: the place on the array, mm.
    #[inline(always)]
    pub fn array_mm(&self, object_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        self.chief_mm(object_mm) + self.alpha * aperture_mm
    }

    /// Where the ray through the middle of the aperture meets the array. This is linear in the place, so it also maps
    /// steps.
    #[inline(always)]
    pub fn chief_mm(&self, object_mm: DVec2) -> DVec2 {
        -self.beta * sensor_axes(object_mm)
    }
}

fn lens_shares(camera: &Camera) -> Option<LensShares> {
    let has_pupil = camera.main_lens.pupil_distance_mm.is_some() || camera.main_lens.pupil_vergence_per_mm.is_some();
    let stop = camera.image_distance_mm() / camera.stop_distance_mm();
    has_pupil.then(|| LensShares { stop, array: stop * camera.pupil_ratio() })
}

impl Optics {
    /// The rays of a checked camera.
    pub fn new(camera: &Camera) -> Self {
        Self {
            image_distance_mm: camera.image_distance_mm(),
            object_distance_mm: camera.object_distance_mm(),
            focal_length_mm: camera.main_lens.focal_length_mm,
            stop_distance_mm: camera.stop_distance_mm(),
            pupil_ratio: camera.pupil_ratio(),
            lens_shares: lens_shares(camera),
            telecentric: TelecentricRays::new(camera),
            demagnification: camera.demagnification(),
            half_aperture_mm: 0.5 * camera.aperture_mm(),
            aperture: camera.main_lens.aperture,
            lattice: camera.lattice(),
            sensor_px: [camera.sensor.width, camera.sensor.height],
            pixel_pitch_mm: camera.sensor.pixel_pitch_mm,
            distortion: camera.distortion.clone(),
            aberrations: RayAberrations::new(camera),
            has_bent_rays: camera.has_bent_rays(),
            medium: camera.medium.clone(),
            sensor_plane: (camera.tilt.is_some() || camera.microlenses.gap_mm.is_some()).then(|| SensorPlane {
                focal_length_mm: camera.microlenses.focal_length_mm,
                gap_mm: camera.gap_mm(),
                slope: camera.tilt.as_ref().map_or(DVec2::ZERO, |t| DVec2::new(t.x_rad.tan(), t.y_rad.tan())),
            }),
        }
    }

    /// beta and alpha of a lens that is its own stop.
    #[inline]
    fn thin_lens(&self, z_mm: f64) -> [f64; 2] {
        let beta = self.image_distance_mm / (self.object_distance_mm - z_mm);
        [beta, 1.0 - self.image_distance_mm / self.focal_length_mm + beta]
    }

    /// beta and alpha in air, for paraxial rays.
    #[inline]
    fn paraxial(&self, z_mm: f64) -> [f64; 2] {
        if let Some(rays) = &self.telecentric {
            return [rays.magnification, rays.spread(z_mm, DVec2::ZERO)[1].x];
        }
        let [beta, alpha] = self.thin_lens(z_mm);
        let Some(LensShares { stop, array }) = self.lens_shares else { return [beta, alpha] };
        let away = 1.0 + (array - 1.0) * alpha;
        [beta / away, stop * alpha / away]
    }

    /// beta(Z), the local magnification in air. Z must lie before the main lens: Z < s_o.
    #[inline]
    pub fn beta(&self, z_mm: f64) -> f64 {
        self.paraxial(z_mm)[0]
    }

    /// alpha(Z), the spread on the array per length of the aperture in air. It is 0 at the focal plane.
    #[inline]
    pub fn alpha(&self, z_mm: f64) -> f64 {
        self.paraxial(z_mm)[1]
    }

    /// The rays from depth Z without medium and distortion. Keep them where many points share a depth.
    #[inline]
    pub fn straight_rays(&self, z_mm: f64) -> StraightRays {
        StraightRays { alpha: self.alpha(z_mm), beta: self.beta(z_mm) }
    }

    /// g / l: lenslet images lie by this share farther apart than lenslets.
    #[inline]
    pub fn image_growth(&self) -> f64 {
        self.demagnification * self.pupil_ratio
    }

    /// The factors of x_m and c in `x_s = array_gain x_m + lenslet_gain c - k U`, for a sensor without tilt: f_l / l
    /// and 1, or `g / l + 1 - g / f_l` and `g / f_l` with a gap g.
    #[inline]
    pub(crate) fn gains(&self) -> (f64, f64) {
        self.sensor_plane.as_ref().map_or((self.image_growth(), 1.0), |plane| {
            let lenslet_gain = plane.gap_mm / plane.focal_length_mm;
            (self.image_growth() + 1.0 - lenslet_gain, lenslet_gain)
        })
    }

    /// The factors of h and q in `y_m = (1 - s_i / f) h + s_i q`, where a ray of slope q before the lens meets it at h.
    pub(crate) fn lens_gains(&self) -> (f64, f64) {
        (1.0 - self.image_distance_mm / self.focal_length_mm, self.image_distance_mm)
    }

    /// The shares of stop and array in a ray's place on the lens; None without an exit pupil.
    pub(crate) fn lens_shares(&self) -> Option<LensShares> {
        self.lens_shares
    }

    /// The rays of a telecentric lens; None for a thin lens.
    pub(crate) fn telecentric(&self) -> Option<TelecentricRays> {
        self.telecentric
    }

    /// See [`Camera::has_bent_rays`].
    #[inline]
    pub fn bends_rays(&self) -> bool {
        self.has_bent_rays
    }

    /// The aberrations of a point at a depth; None without the block.
    #[inline(always)]
    pub(crate) fn aberrations(&self, z_mm: f64) -> Option<RayAberrations> {
        self.aberrations.map(|aberrations| aberrations.at(z_mm))
    }

    /// The microlens lattice.
    #[inline]
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Whether the stop lets a ray through.
    #[inline]
    pub fn passes(&self, aperture_mm: DVec2) -> bool {
        match self.aperture {
            Aperture::Circle => aperture_mm.length_squared() <= self.half_aperture_mm * self.half_aperture_mm,
            Aperture::Square => aperture_mm.abs().max_element() <= self.half_aperture_mm,
        }
    }

    /// q, the slope in the air before the main lens of a ray that meets the lens at `lens_mm`, along the sensor's axes:
    /// mm sideways per mm towards the lens. The relative error is below 1e-10 for rays within 0.15 rad of the axis and
    /// below 1e-7 within 0.4 rad.
    #[inline(always)]
    pub fn slope(&self, object_mm: DVec2, z_mm: f64, lens_mm: DVec2) -> DVec2 {
        let offset = lens_mm - sensor_axes(object_mm);
        let Some(medium) = &self.medium else {
            return 1.0 / (self.object_distance_mm - z_mm) * offset;
        };
        let offset_mm2 = offset.length_squared();
        // By Snell's law n sin(angle) is the same in every layer. A ray of slope t in air therefore moves sideways by
        // h t / sqrt(n^2 + (n^2 - 1) t^2) in a layer of thickness h. The sum over air and layers is |offset|.
        // Newton's method for g = t / |offset| starts from the paraxial answer and rises to the root.
        let air = medium.air_mm(self.object_distance_mm);
        let layers = medium.layers_from(z_mm);
        let mut g = 1.0 / (air + layers[0].0 / layers[0].1 + layers[1].0 / layers[1].1);
        for _ in 0..SNELL_STEPS {
            let (mut reach, mut growth) = (air, air);
            for (thickness, index) in layers {
                let n2 = index * index;
                let root = 1.0 / (n2 + (n2 - 1.0) * g * g * offset_mm2).sqrt();
                reach += thickness * root;
                growth += thickness * n2 * root * root * root;
            }
            g += (1.0 - g * reach) / growth;
        }
        g * offset
    }

    /// Slope, without distortion and aberrations, of the ray that passes `aperture_mm` and meets the array at
    /// `array_mm`. The few px by which aberrations move a ray turn it by some 1e-4 rad.
    #[inline(always)]
    pub fn slope_from_array(&self, array_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        let lens_mm = self.lens_mm(array_mm, aperture_mm);
        (self.pupil_ratio * array_mm - aperture_mm) / self.stop_distance_mm + lens_mm / self.focal_length_mm
    }

    /// Where the ray that passes `aperture_mm` and meets the array at `array_mm` has met the main lens, mm.
    #[inline(always)]
    pub fn lens_mm(&self, array_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        self.lens_shares.map_or(aperture_mm, |shares| shares.stop * aperture_mm + (1.0 - shares.array) * array_mm)
    }

    /// Where a ray that meets the lens at `lens_mm` meets the array behind a window, mm.
    #[inline(always)]
    fn array_from_lens(&self, object_mm: DVec2, z_mm: f64, lens_mm: DVec2) -> DVec2 {
        let lens = 1.0 - self.image_distance_mm / self.focal_length_mm;
        lens_mm * lens + self.image_distance_mm * self.slope(object_mm, z_mm, lens_mm)
    }

    /// Where a ray that passes `aperture_mm` of an exit pupil meets the array.
    #[inline(never)]
    fn array_from_pupil(&self, object_mm: DVec2, z_mm: f64, aperture_mm: DVec2, shares: LensShares) -> DVec2 {
        // Newton's method for h = (s_i / L) V + (1 - s_i / l) y_m(h); near the axis y_m changes by alpha h.
        let near = DVec2::new(1e-3, 0.0);
        let alpha = (self.array_from_lens(DVec2::ZERO, z_mm, near) - self.array_from_lens(DVec2::ZERO, z_mm, -near)).x;
        let fall = 1.0 / (1.0 - (1.0 - shares.array) * alpha / 2e-3);
        let mut lens_mm = aperture_mm;
        for _ in 0..PUPIL_STEPS {
            let hit = self.array_from_lens(object_mm, z_mm, lens_mm);
            lens_mm += fall * (self.lens_mm(hit, aperture_mm) - lens_mm);
        }
        self.array_from_lens(object_mm, z_mm, lens_mm)
    }

    /// Shift of a point's image on the array by distortion, mm; 0 without distortion.
    #[inline(always)]
    pub fn distortion_mm(&self, object_mm: DVec2, z_mm: f64) -> DVec2 {
        let Some(Distortion { radial: [k1, k2, k3], tangential: [p1, p2] }) = &self.distortion else {
            return DVec2::ZERO;
        };
        let t = match &self.telecentric {
            Some(rays) => rays.chief_mm(sensor_axes(object_mm)) / self.image_distance_mm,
            None => self.slope(object_mm, z_mm, DVec2::ZERO),
        };
        let r2 = t.length_squared();
        let both = 2.0 * t.x * t.y;
        let tangential = DVec2::new(p1 * both + p2 * (r2 + 2.0 * t.x * t.x), p1 * (r2 + 2.0 * t.y * t.y) + p2 * both);
        self.image_distance_mm * (t * (r2 * (k1 + r2 * (k2 + r2 * k3))) + tangential)
    }

    /// Where a ray meets the array, mm.
    #[inline(always)]
    pub fn array_from_object(&self, object_mm: DVec2, z_mm: f64, aperture_mm: DVec2) -> DVec2 {
        let hit = self.perfect_hit(object_mm, z_mm, aperture_mm) + self.distortion_mm(object_mm, z_mm);
        let Some(aberrations) = self.aberrations(z_mm) else { return hit };
        hit + aberrations.shift_mm(self.perfect_hit(object_mm, z_mm, DVec2::ZERO), aperture_mm)
    }

    /// Where a ray meets the array without distortion and aberrations.
    #[inline(always)]
    fn perfect_hit(&self, object_mm: DVec2, z_mm: f64, aperture_mm: DVec2) -> DVec2 {
        match (&self.medium, self.lens_shares, &self.telecentric) {
            (_, _, Some(rays)) => rays.spread(z_mm, aperture_mm)[0] + rays.chief_mm(sensor_axes(object_mm)),
            (None, _, None) => self.straight_rays(z_mm).array_mm(object_mm, aperture_mm),
            (Some(_), None, None) => self.array_from_lens(object_mm, z_mm, aperture_mm),
            (Some(_), Some(shares), None) => self.array_from_pupil(object_mm, z_mm, aperture_mm, shares),
        }
    }

    /// Where the ray that passes `aperture_mm` and meets the array at `array_mm` meets the sensor, mm.
    #[inline(always)]
    pub fn sensor_from_array(&self, array_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        self.sensor_through(self.lattice.nearest_centre_mm(array_mm), array_mm, aperture_mm)
    }

    /// Like [`Self::sensor_from_array`], but through the lenslet with centre `centre`, even if the ray meets the array
    /// outside that lenslet's cell.
    #[inline(always)]
    pub fn sensor_through(&self, centre: DVec2, array_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        let Some(plane) = &self.sensor_plane else {
            return centre + self.demagnification * (self.pupil_ratio * array_mm - aperture_mm);
        };
        let from_pupil = (self.pupil_ratio * array_mm - aperture_mm) / self.stop_distance_mm;
        let slope = from_pupil - (array_mm - centre) / plane.focal_length_mm;
        let gap = (plane.gap_mm + plane.slope.dot(array_mm)) / (1.0 - plane.slope.dot(slope));
        array_mm + gap * slope
    }

    /// Where a ray meets the sensor, mm.
    #[inline]
    pub fn sensor_from_object(&self, object_mm: DVec2, z_mm: f64, aperture_mm: DVec2) -> DVec2 {
        self.sensor_from_array(self.array_from_object(object_mm, z_mm, aperture_mm), aperture_mm)
    }

    /// Half sides of the part of the array that the sensor sees, mm: the image of the stop under a lenslet farther from
    /// the axis lies beside the sensor.
    pub(crate) fn seen_mm(&self) -> DVec2 {
        self.pixel_pitch_mm * self.middle_px() + self.demagnification * self.half_aperture_mm
    }

    /// The centres, mm, of the lenslets within `reach_mm` of a point of the array that the sensor sees, and a few more.
    pub(crate) fn lenslets_seen(&self, point_mm: DVec2, reach_mm: DVec2) -> impl Iterator<Item = DVec2> + '_ {
        // A gap that grows across the sensor makes the images of the stop up to twice as wide.
        let seen = self.seen_mm() + self.demagnification * self.half_aperture_mm + self.lattice.period_y_mm();
        let (low, high) = ((point_mm - reach_mm).max(-seen), (point_mm + reach_mm).min(seen));
        let is_clipped = low != point_mm - reach_mm || high != point_mm + reach_mm;
        let (point_mm, reach_mm) =
            if is_clipped { (0.5 * (low + high), 0.5 * (high - low)) } else { (point_mm, reach_mm) };
        self.lattice.lenslets_within(point_mm, reach_mm).map(|(_, _, centre)| centre)
    }

    /// Where the axis meets the sensor, px.
    #[inline]
    pub(crate) fn middle_px(&self) -> DVec2 {
        0.5 * DVec2::from(self.sensor_px.map(|count| count as f64))
    }

    /// A place on the sensor in pixels. 0 is the left or top edge; a pixel's centre is at a half.
    #[inline]
    pub fn place_px(&self, sensor_mm: DVec2) -> DVec2 {
        sensor_mm / self.pixel_pitch_mm + self.middle_px()
    }

    /// Centre of a pixel on the sensor, mm.
    #[inline]
    pub fn centre_mm(&self, column: u32, row: u32) -> DVec2 {
        let place = DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5);
        (place - self.middle_px()) * self.pixel_pitch_mm
    }

    /// Column and row of the pixel at a place on the sensor, mm. None beside the sensor.
    #[inline]
    pub fn pixel_at(&self, sensor_mm: DVec2) -> Option<(usize, usize)> {
        self.pixel_under(self.place_px(sensor_mm))
    }

    /// Column and row of the pixel at a place in pixels, as [`Optics::place_px`] gives it. None beside the sensor.
    #[inline]
    pub fn pixel_under(&self, place_px: DVec2) -> Option<(usize, usize)> {
        let [x, y] = place_px.to_array();
        let [width, height] = self.sensor_px.map(|count| count as f64);
        let is_inside = x >= 0.0 && y >= 0.0 && x < width && y < height;
        is_inside.then_some((x as usize, y as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Telecentric, tests::seed};
    use crate::lattice::Layout;

    fn with(change: impl Fn(&mut Camera)) -> Optics {
        let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
        change(&mut camera);
        Optics::new(&camera)
    }

    fn plain() -> Optics {
        with(|_| ())
    }

    /// The picture is upright: to the right, to the top.
    #[test]
    fn x_runs_along_the_columns_and_y_against_the_rows() {
        let tank = with(|camera| camera.medium = Some(TANK));
        let bent = with(|camera| {
            camera.distortion = Some(Distortion { radial: [5.0, 0.0, 0.0], tangential: [0.01, -0.01] });
        });
        for optics in [plain(), tank, bent] {
            for (z, aperture) in [(0.0, DVec2::ZERO), (-3.0, DVec2::new(20.0, -10.0)), (3.0, DVec2::new(-5.0, 30.0))] {
                let hit = |x: f64, y: f64| optics.array_from_object(DVec2::new(x, y), z, aperture);
                let (right, up) = (hit(0.4, 0.1) - hit(0.3, 0.1), hit(0.3, 0.2) - hit(0.3, 0.1));
                assert!((right.x - 0.1).abs() < 2e-3 && right.y.abs() < 1e-3, "{right}");
                assert!((up.y + 0.1).abs() < 2e-3 && up.x.abs() < 1e-3, "{up}");
            }
        }
        // By hand: 0.3 mm to the right and 0.2 mm up of the middle, (140, 140).
        let place = plain().place_px(plain().array_from_object(DVec2::new(0.3, 0.2), 0.0, DVec2::ZERO));
        assert!(place.distance(DVec2::new(140.0 + 0.3 / 0.0055, 140.0 - 0.2 / 0.0055)) < 1e-9);
    }

    #[test]
    fn a_point_in_focus_stays_under_one_lenslet_and_fills_its_disc() {
        let optics = plain();
        assert!(optics.alpha(0.0).abs() < 1e-15);
        let centre = optics.lattice().centre_mm(2, -3);
        for angle in 0..12 {
            let rim = DVec2::from_angle(angle as f64) * optics.half_aperture_mm;
            let hit = optics.sensor_from_object(-sensor_axes(centre), 0.0, rim);
            // The lens turns the disc over: U lands at c (1 + k) - k U. Half a pitch is k D/2.
            let expected = centre * (1.0 + optics.demagnification) - rim.normalize() * 0.0385;
            assert!(hit.distance(expected) < 1e-12);
        }
    }

    #[test]
    fn sub_images_drift_with_depth_by_the_slope_of_the_paper_drawing() {
        // By hand: m = 1, s_i = s_o = 400 and Z = 4 give beta = 400/396 and alpha = 4/396. A point on the axis lights
        // lenslet c through U = c / alpha and lands at c + k (c - c / alpha). The drift k (1 - 1/alpha) is
        // 0.00077 (1 - 99) px per px.
        let optics = plain();
        let centre = optics.lattice().centre_mm(4, 0).x;
        let aperture = DVec2::new(centre / (4.0 / 396.0), 0.0);
        let hit = optics.sensor_from_object(DVec2::ZERO, 4.0, aperture);
        assert!((hit.x - centre * (1.0 + 0.00077 * (1.0 - 99.0))).abs() < 1e-12);
    }

    #[test]
    fn pixels_are_counted_from_the_top_left_corner() {
        let pixel_at = |x, y| plain().pixel_at(DVec2::new(x, y));
        assert_eq!(pixel_at(0.001, -0.001), Some((140, 139)));
        assert_eq!(pixel_at(-0.77 + 1e-9, 0.77 - 1e-9), Some((0, 279)));
        assert_eq!(pixel_at(0.7701, 0.0), None);
    }

    const TANK: Medium = Medium { index: 1.333, window_z_mm: 60.0, window_thickness_mm: 20.0, window_index: 1.49 };

    /// Snell's law holds at both faces of the window, and the focal plane is where paraxial rays put it.
    #[test]
    fn rays_through_a_window_obey_snell() {
        assert!((TANK.air_mm(400.0) - (400.0 - 60.0 / 1.333 - 20.0 / 1.49)).abs() < 1e-12);
        for tank in [TANK, Medium { window_z_mm: 400.0, ..TANK }] {
            let optics = with(|camera| camera.medium = Some(tank.clone()));
            for (x, u, z) in [(0.0, 50.0, 0.0), (3.0, -35.0, -5.0), (-10.0, 20.0, 7.0), (0.0, 150.0, 0.0)] {
                let sine = |slope: f64| slope / (1.0 + slope * slope).sqrt();
                let slope = optics.slope(DVec2::new(x, 0.0), z, DVec2::new(u, 0.0)).x;
                let (in_window, in_water) = (sine(slope) / 1.49, sine(slope) / 1.333);
                let aside = |sine: f64| sine / (1.0 - sine * sine).sqrt();
                let wet = (tank.window_z_mm - z) * aside(in_water) + 20.0 * aside(in_window);
                let reached = -x + wet + tank.air_mm(400.0) * slope;
                assert!((reached - u).abs() < if u == 150.0 { 1e-5 } else { 1e-9 }, "{reached} for {u}");
            }
        }
        let optics = with(|camera| camera.medium = Some(TANK));
        // Near the axis a point at depth Z in water is one at Z / n in air.
        let near = DVec2::new(1e-4, 0.0);
        let in_air = plain().array_from_object(DVec2::ZERO, 4.0 / 1.333, near);
        assert!(optics.array_from_object(DVec2::ZERO, 4.0, near).distance(in_air) < 1e-12);
        assert!(optics.array_from_object(DVec2::ZERO, 0.0, near).length() < 1e-15);
    }

    /// By hand: at m = 1 a point at X = 4 mm in focus has t = X / 400 = 0.01 along x and r^2 = 1e-4. It moves by
    /// 400 t k1 r^2 on the array, through every part of the aperture.
    #[test]
    fn distortion_moves_whole_images() {
        let optics = with(|camera| {
            camera.distortion = Some(Distortion { radial: [5.0, 0.0, 0.0], tangential: [0.0, 0.01] });
        });
        let plain = plain();
        for (z, u) in [(0.0, 0.0), (0.0, 40.0), (3.0, -40.0)] {
            let t = 4.0 / (400.0 - z);
            let moved = 400.0 * (t * 5.0 * t * t + 0.01 * 3.0 * t * t);
            let (object, aperture) = (DVec2::new(4.0, 0.0), DVec2::new(u, 0.0));
            let shift = optics.array_from_object(object, z, aperture) - plain.array_from_object(object, z, aperture);
            assert!(shift.distance(DVec2::new(moved, 0.0)) < 1e-12, "{shift}");
        }
    }

    /// A ray through (u, v) of the exit pupil, traced step by step without alpha and beta: among the rays of the point,
    /// bisection finds the one that the thin lens bends through that place of the pupil plane.
    fn slow_array_mm(camera: &Camera, object: f64, pupil: f64, layers: &[(f64, f64)], air: f64) -> f64 {
        let (s_i, f, l) = (camera.image_distance_mm(), camera.main_lens.focal_length_mm, camera.pupil_distance_mm());
        let trace = |sine: f64| {
            let aside = |sine: f64| sine / (1.0 - sine * sine).sqrt();
            let wet: f64 = layers.iter().map(|(thickness, index)| thickness * aside(sine / index)).sum();
            let height = object + wet + air * aside(sine);
            let slope = aside(sine) - height / f;
            [height + (s_i - l) * slope, height + s_i * slope]
        };
        let (mut low, mut high) = (-0.6, 0.6);
        let rises = trace(high)[0] > trace(low)[0];
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if (trace(middle)[0] < pupil) == rises { low = middle } else { high = middle }
        }
        trace(0.5 * (low + high))[1]
    }

    #[test]
    fn rays_through_an_exit_pupil_are_those_of_a_slow_trace() {
        for l in [250.0, 400.0, 502.0, 900.0] {
            for (f, m) in [(200.0, 1.0), (100.0, 2.5), (80.0, 0.4)] {
                let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
                (camera.main_lens.focal_length_mm, camera.main_lens.magnification) = (f, m);
                camera.main_lens.pupil_distance_mm = Some(l);
                camera.check().unwrap();
                let optics = Optics::new(&camera);
                assert!((2.0 * optics.half_aperture_mm * 4.0 / l - 1.0).abs() < 1e-12);
                for (y, z, v) in [(0.0, 0.0, 20.0), (3.0, -5.0, 0.0), (-4.0, 7.0, -30.0), (2.0, 4.0, 11.0)] {
                    let hit = optics.array_from_object(DVec2::new(0.0, y), z, DVec2::new(0.0, v)).y;
                    let slow = slow_array_mm(&camera, y, v, &[], camera.object_distance_mm() - z);
                    assert!((hit - slow).abs() < 1e-9, "{l} {f} {m} {y} {z} {v}: {hit} {slow}");
                    // The lenslet does not bend a ray through its centre: it goes on by its slope from the pupil.
                    let centre = optics.lattice().nearest_centre_mm(DVec2::new(0.0, hit));
                    let place = optics.sensor_from_object(DVec2::new(0.0, y), z, DVec2::new(0.0, v));
                    let by_hand = centre.y + 0.308 * (hit - v) / l;
                    assert!((place.y - by_hand).abs() < 1e-12);
                    let before =
                        optics.slope(DVec2::new(0.0, y), z, optics.lens_mm(DVec2::new(0.0, hit), DVec2::new(0.0, v)));
                    let back = optics.slope_from_array(DVec2::new(0.0, hit), DVec2::new(0.0, v));
                    assert!((before.y - back.y).abs() < 1e-12, "{before} {back}");
                }
            }
        }
        // In water behind a window.
        for l in [300.0, 502.0] {
            let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
            camera.main_lens.pupil_distance_mm = Some(l);
            camera.medium = Some(TANK);
            let optics = Optics::new(&camera);
            for (y, z, v) in [(0.0, 0.0, 20.0), (3.0, -5.0, 0.0), (-4.0, 7.0, -30.0), (2.0, 4.0, 11.0)] {
                let hit = optics.array_from_object(DVec2::new(0.0, y), z, DVec2::new(0.0, v)).y;
                let in_focus = 60.0 / 1.333 + 20.0 / 1.49;
                let layers = [(60.0 - z, 1.333), (20.0, 1.49)];
                let slow = slow_array_mm(&camera, y, v, &layers, 400.0 - in_focus);
                assert!((hit - slow).abs() < 1e-7, "{l} {y} {z} {v}: {hit} {slow}");
            }
        }
    }

    /// A lens of focal length f with its exit pupil at infinity or behind the array, against a trace step by step:
    /// among the rays of the point, bisection finds the one with the slope that V stands for. Near pupils are those of
    /// `pupil_distance_mm`, with V measured elsewhere.
    #[test]
    fn rays_through_a_far_pupil_are_those_of_a_slow_trace() {
        for vergence in [0.0, -0.004, -0.0005, 0.002] {
            for (f, m) in [(200.0, 1.0), (100.0, 2.5)] {
                let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
                (camera.main_lens.focal_length_mm, camera.main_lens.magnification) = (f, m);
                camera.main_lens.pupil_vergence_per_mm = Some(vergence);
                camera.check().unwrap();
                let (optics, s_i) = (Optics::new(&camera), camera.image_distance_mm());
                for (y, z, v) in [(0.0, 0.0, 20.0), (3.0, -5.0, 0.0), (-4.0, 7.0, -30.0), (2.0, 4.0, 11.0)] {
                    let trace = |slope: f64| {
                        let height = y + (camera.object_distance_mm() - z) * slope;
                        let after = slope - height / f;
                        let array = height + s_i * after;
                        // The ray stands off by this slope from the one through the middle of the pupil.
                        [array * vergence - after, array]
                    };
                    let (mut low, mut high) = (-1.0, 1.0);
                    let rises = trace(high)[0] > trace(low)[0];
                    for _ in 0..200 {
                        let middle = 0.5 * (low + high);
                        if (trace(middle)[0] < v / s_i) == rises { low = middle } else { high = middle }
                    }
                    let slow = trace(low)[1];
                    let hit = optics.array_from_object(DVec2::new(0.0, y), z, DVec2::new(0.0, v)).y;
                    assert!((hit - slow).abs() < 1e-9, "{vergence} {f} {m} {y} {z} {v}: {hit} {slow}");
                    // A ray through the lenslet's centre goes on with its slope on the array.
                    let place = optics.sensor_through(DVec2::new(0.0, hit), DVec2::new(0.0, hit), DVec2::new(0.0, v));
                    let by_hand = hit + 0.308 * (hit * vergence - v / s_i);
                    assert!((place.y - by_hand).abs() < 1e-12, "{place} {by_hand}");
                }
            }
        }
        // 1 over a distance is that distance: the same rays, with places in the stop measured at s_i.
        let [near, same] = [(Some(250.0), None), (None, Some(1.0 / 250.0))].map(|(distance, vergence)| {
            let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
            (camera.main_lens.pupil_distance_mm, camera.main_lens.pupil_vergence_per_mm) = (distance, vergence);
            Optics::new(&camera)
        });
        for share in [-1.0, 0.3] {
            let (object, place) = (DVec2::new(2.0, -1.0), DVec2::new(share, 0.4));
            let [a, b] = [&near, &same].map(|optics| {
                let aperture = optics.half_aperture_mm * place;
                let hit = optics.array_from_object(object, 4.0, aperture);
                [hit, optics.sensor_from_array(hit, aperture)]
            });
            assert!(a[0].distance(b[0]) < 1e-12 && a[1].distance(b[1]) < 1e-12, "{a:?} {b:?}");
        }
    }

    /// By hand: at 20 times and N_w = 20 the numerical aperture is 0.5. In water the rim's ray has the sine 0.5 /
    /// 1.333; 0.1 mm from focus it meets the plane in focus 0.1 mm times the tangent off, and the array 20 times that.
    #[test]
    fn a_microscope_keeps_the_sine_condition() {
        let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
        camera.main_lens.focal_length_mm = 10.0;
        (camera.main_lens.magnification, camera.main_lens.working_f_number) = (20.0, 20.0);
        camera.main_lens.telecentric = Some(Telecentric { index: 1.333 });
        camera.check().unwrap();
        assert!(camera.has_steep_rays() && camera.image_growth() == 0.0);
        let optics = Optics::new(&camera);
        let sine = 0.5 / 1.333f64;
        let by_hand = 20.0 * 0.1 * sine / (1.0 - sine * sine).sqrt();
        let rim = DVec2::new(optics.half_aperture_mm, 0.0);
        let hit = optics.array_from_object(DVec2::new(0.01, 0.0), 0.1, rim);
        assert!((hit.x - 0.2 - by_hand).abs() < 1e-12 && hit.y == 0.0, "{hit} {by_hand}");
        // The image of the stop under a lenslet is f_l / N_w wide, about the lenslet's centre.
        let centre = DVec2::new(1.0, 0.5);
        let place = optics.sensor_through(centre, hit, rim);
        assert!((centre - place).distance(DVec2::new(0.308 / 40.0, 0.0)) < 1e-12, "{place}");
        // A lens of small aperture has paraxial rays only.
        camera.main_lens.working_f_number = 400.0;
        assert!(!camera.has_steep_rays());
        assert_eq!((Optics::new(&camera).beta(0.3), camera.bends()), (20.0, None));
    }

    #[test]
    fn the_thin_lens_is_its_own_exit_pupil() {
        let same = with(|camera| camera.main_lens.pupil_distance_mm = Some(400.0));
        let plain = plain();
        for z in [-6.0, 0.0, 3.0] {
            assert_eq!((same.alpha(z), same.beta(z)), (plain.alpha(z), plain.beta(z)));
        }
        // A stop in the back focal plane, s_i - f from the array, makes the lens telecentric towards the object: a
        // point's picture does not grow with its depth.
        let telecentric = with(|camera| camera.main_lens.pupil_distance_mm = Some(200.0));
        assert_eq!(telecentric.demagnification, 0.308 / 200.0);
        for z in [-6.0, 0.0, 3.0] {
            assert!((telecentric.beta(z) - 1.0).abs() < 1e-12, "{}", telecentric.beta(z));
        }
    }

    /// A gap equal to the focal length changes nothing. A longer gap magnifies a lenslet's image by g / f_l about the
    /// point where the lenslet's axis meets the sensor, and adds (1 - g / f_l) of the ray's distance from that axis.
    #[test]
    fn gap_and_tilt_move_rays_on_the_sensor() {
        let plain = plain();
        let same = with(|camera| camera.microlenses.gap_mm = Some(0.308));
        let longer = with(|camera| camera.microlenses.gap_mm = Some(0.33));
        let tilted = with(|camera| camera.tilt = Some(crate::camera::Tilt { x_rad: 0.01, y_rad: 0.0 }));
        let (array, aperture) = (DVec2::new(0.511, -0.2), DVec2::new(20.0, -30.0));
        assert!(same.sensor_from_array(array, aperture).distance(plain.sensor_from_array(array, aperture)) < 1e-14);
        let centre = DVec2::new(6.5 * 0.077, -2.5 * 0.077);
        let stretch = 0.33 / 0.308;
        let by_hand = array * (1.0 - stretch) + centre * stretch + 0.33 / 400.0 * (array - aperture);
        assert!(longer.sensor_from_array(array, aperture).distance(by_hand) < 1e-12);
        let hit = tilted.sensor_from_array(array, aperture);
        let gap = 0.308 + 0.01f64.tan() * hit.x;
        let there = with(|camera| camera.microlenses.gap_mm = Some(gap)).sensor_from_array(array, aperture);
        assert!(hit.distance(there) < 1e-12);
    }

    /// Scar: far out of focus, and far beside the sensor, all lenslets of the beam were walked.
    #[test]
    fn lenslets_beside_the_sensor_are_left_out_and_no_other() {
        for (layout, turn) in [(Layout::Square, 0.0), (Layout::Hexagonal, 0.2)] {
            let optics = Optics::new(&seed(20, Aperture::Circle, layout, turn));
            let half = optics.pixel_pitch_mm * optics.middle_px();
            for (point, reach) in [(DVec2::new(0.3, -0.2), 40.0), (DVec2::new(-30.0, 0.1), 31.0), (half, 0.2)] {
                let seen: Vec<DVec2> = optics.lenslets_seen(point, DVec2::splat(reach)).collect();
                assert!(!seen.is_empty() && seen.len() < 1000, "{}", seen.len());
                let within = |centre: DVec2| (centre - point).abs().max_element() <= reach;
                let near = optics.lattice().lenslets_within(DVec2::ZERO, 2.0 * half).map(|(_, _, centre)| centre);
                for centre in near.filter(|centre| within(*centre)) {
                    let ends = [-1.0, 1.0].map(|side| side * DVec2::splat(optics.half_aperture_mm));
                    let [a, b] = ends.map(|aperture| optics.sensor_through(centre, centre, aperture));
                    let is_lit = a.max(b).cmpgt(-half).all() && a.min(b).cmplt(half).all();
                    assert!(!is_lit || seen.contains(&centre), "{point} {centre}");
                }
            }
        }
    }
}
