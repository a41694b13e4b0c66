//! A main lens by its surfaces: every ray is traced through them by Snell's law, in three dimensions.
//!
//! Lengths along the axis count from the first surface, positive towards the sensor. Across it they are along the
//! sensor's axes.

use super::samples::Shape;
use crate::key_checks::{finite, positive, within, wrong};
use glam::{DMat2, DVec2, DVec3};
use lf_core::{Camera, Refusal};
use serde::{Deserialize, Serialize};

/// A lens of spherical surfaces on one axis, in air. Light meets the first surface first. The scene's camera says how
/// wide the stop is, by its working f-number, and which magnification the lens is focused at; its focal length and its
/// exit pupil follow from the surfaces.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThickLens {
    /// The surfaces.
    pub surfaces: Vec<Surface>,
    /// Number of surfaces before the stop.
    pub stop_after: usize,
    /// Distance from the last of them to the stop, mm.
    pub stop_distance_mm: f64,
}

/// A surface of a lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surface {
    /// Radius of curvature, mm: positive if its middle is behind the surface; flat if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_mm: Option<f64>,
    /// Half its diameter, mm: light beyond does not pass.
    pub half_diameter_mm: f64,
    /// Index of refraction behind it; 1 if absent.
    #[serde(default = "one")]
    pub index: f64,
    /// Distance to the next surface, mm; 0 if absent, for the last.
    #[serde(default)]
    pub next_mm: f64,
}

fn one() -> f64 {
    1.0
}

/// Rays are drawn from this many times the width of the paraxial pupil, because pupils aberrate too.
pub(super) const WIDER: f64 = 1.25;

/// A lens that stands before a camera.
#[derive(Debug)]
pub(super) struct TracedLens {
    surfaces: Vec<Crossing>,
    /// Place of the stop along the axis, its number of surfaces before it, its half width and its shape.
    stop_mm: f64,
    stop_after: usize,
    half_stop_mm: f64,
    shape: Shape,
    /// Places of the plane in focus, the entrance pupil and the array.
    object_mm: f64,
    entrance_mm: f64,
    array_mm: f64,
    /// Half the paraxial entrance pupil.
    pub(super) half_entrance_mm: f64,
    /// Distance from the paraxial exit pupil to the array.
    exit_distance_mm: f64,
}

/// A surface in its place.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    place_mm: f64,
    curvature: f64,
    half_diameter_mm: f64,
    /// Index before and behind.
    indices: [f64; 2],
}

/// A ray: a point and a direction of length 1.
#[derive(Debug, Clone, Copy)]
struct Ray {
    at: DVec3,
    along: DVec3,
}

/// Where a ray meets the array, and the plane of the exit pupil that leads there.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct LensRay {
    pub(super) array_mm: DVec2,
    pub(super) aperture_mm: DVec2,
}

/// Lengths of a lens for rays near the axis, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Paraxial {
    focal_mm: f64,
    /// From the plane in focus to the first surface, and from the last surface to the array.
    object_mm: f64,
    image_mm: f64,
    /// From the first surface to the entrance pupil; its width over that of the stop.
    entrance_mm: f64,
    entrance_scale: f64,
    /// From the last surface to the exit pupil; its width over that of the stop.
    exit_mm: f64,
    exit_scale: f64,
}

impl ThickLens {
    /// Refuses what is no lens, and what the paraxial camera cannot say.
    pub(crate) fn check(&self, camera: &Camera) -> Result<(), Refusal> {
        let count = self.surfaces.len();
        within("thick_lens.surfaces, their number,", count as f64, 2.0..=100.0)?;
        within("thick_lens.stop_after", self.stop_after as f64, 1.0..=(count - 1) as f64)?;
        for (n, surface) in self.surfaces.iter().enumerate() {
            let key = |name: &str| format!("thick_lens.surfaces[{n}].{name}");
            positive(&key("half_diameter_mm"), surface.half_diameter_mm)?;
            within(&key("index"), surface.index, 1.0..=4.0)?;
            within(&key("next_mm"), surface.next_mm, 0.0..=1e4)?;
            if let Some(radius) = surface.radius_mm {
                finite(&key("radius_mm"), radius)?;
                if radius.abs() < surface.half_diameter_mm {
                    let found = format!("{} is {radius}, less than half the surface's diameter", key("radius_mm"));
                    return Err(wrong(found));
                }
            }
        }
        within("thick_lens.stop_distance_mm", self.stop_distance_mm, 0.0..=self.surfaces[self.stop_after - 1].next_mm)?;
        if self.surfaces[count - 1].index != 1.0 {
            return Err(wrong("thick_lens has glass behind its last surface; wanted index 1"));
        }
        let lens = &camera.main_lens;
        for (key, is_given) in [
            ("camera.main_lens.telecentric", lens.telecentric.is_some()),
            ("camera.medium", camera.medium.is_some()),
            ("camera.distortion", camera.distortion.is_some()),
            ("camera.aberrations", camera.aberrations.is_some()),
        ] {
            if is_given {
                return Err(wrong(format!("thick_lens is traced as it is; {key} does not go with it")));
            }
        }
        let Paraxial { focal_mm, object_mm, image_mm, exit_mm, .. } = self.paraxial(lens.magnification);
        let found = |what: &str| wrong(format!("thick_lens at magnification {} {what}", lens.magnification));
        match () {
            () if !(focal_mm.is_finite() && focal_mm > 0.0) => Err(found("does not focus")),
            () if object_mm.min(image_mm) <= 0.0 => Err(found("has its object or its image within the lens")),
            () if !(exit_mm.is_finite() && exit_mm < image_mm) => Err(found("has its exit pupil behind the array")),
            () => Ok(()),
        }
    }

    /// The camera as a data sheet describes it: a thin lens of the same focal length, with the exit pupil of this one.
    /// Refuses a lens that does not focus, and one beside distortion or aberrations.
    pub fn camera(&self, camera: &Camera) -> Result<Camera, Refusal> {
        self.check(camera)?;
        let Paraxial { focal_mm, image_mm, exit_mm, .. } = self.paraxial(camera.main_lens.magnification);
        let mut found = camera.clone();
        found.main_lens.focal_length_mm = focal_mm;
        found.main_lens.pupil_vergence_per_mm = None;
        found.main_lens.pupil_distance_mm = Some(image_mm - exit_mm);
        found.check().map(|()| found)
    }

    /// Depth of the first surface, mm.
    pub(crate) fn front_mm(&self, camera: &Camera) -> f64 {
        self.paraxial(camera.main_lens.magnification).object_mm
    }

    /// The lens by the matrices of Gaussian optics, for heights and for slopes times the index.
    fn paraxial(&self, magnification: f64) -> Paraxial {
        let (mut all, mut before, mut index) = (DMat2::IDENTITY, DMat2::IDENTITY, 1.0);
        let transfer = |length: f64| DMat2::from_cols(DVec2::X, DVec2::new(length, 1.0));
        for (n, surface) in self.surfaces.iter().enumerate() {
            let power = (surface.index - index) * surface.curvature();
            all = DMat2::from_cols(DVec2::new(1.0, -power), DVec2::Y) * all;
            index = surface.index;
            if n + 1 == self.stop_after {
                before = transfer(self.stop_distance_mm / index) * all;
            }
            if n + 1 < self.surfaces.len() {
                all = transfer(surface.next_mm / index) * all;
            }
        }
        let [a, c, b, d] = all.to_cols_array();
        let image_mm = (-magnification - a) / c;
        let behind = all * before.inverse();
        Paraxial {
            focal_mm: -1.0 / c,
            object_mm: (b + image_mm * d) / magnification,
            image_mm,
            entrance_mm: before.y_axis.x / before.x_axis.x,
            entrance_scale: 1.0 / before.x_axis.x.abs(),
            exit_mm: -behind.y_axis.x / behind.y_axis.y,
            exit_scale: 1.0 / behind.y_axis.y.abs(),
        }
    }
}

impl Surface {
    fn curvature(&self) -> f64 {
        self.radius_mm.map_or(0.0, f64::recip)
    }
}

impl TracedLens {
    /// The lens before a camera that [`ThickLens::camera`] made.
    pub(super) fn new(lens: &ThickLens, camera: &Camera) -> Self {
        let paraxial = lens.paraxial(camera.main_lens.magnification);
        let (mut place_mm, mut index) = (0.0, 1.0);
        let mut surfaces = Vec::new();
        for surface in &lens.surfaces {
            surfaces.push(Crossing {
                place_mm,
                curvature: surface.curvature(),
                half_diameter_mm: surface.half_diameter_mm,
                indices: [index, surface.index],
            });
            (place_mm, index) = (place_mm + surface.next_mm, surface.index);
        }
        let last_mm = surfaces[surfaces.len() - 1].place_mm;
        let half_stop_mm = 0.5 * camera.aperture_mm() / paraxial.exit_scale;
        Self {
            stop_mm: surfaces[lens.stop_after - 1].place_mm + lens.stop_distance_mm,
            stop_after: lens.stop_after,
            half_stop_mm,
            shape: camera.main_lens.aperture.into(),
            object_mm: -paraxial.object_mm,
            entrance_mm: paraxial.entrance_mm,
            array_mm: last_mm + paraxial.image_mm,
            half_entrance_mm: half_stop_mm * paraxial.entrance_scale,
            exit_distance_mm: paraxial.image_mm - paraxial.exit_mm,
            surfaces,
        }
    }

    /// The ray of a point, along the sensor's axes and at a depth, through a place of the paraxial entrance pupil. None
    /// if it misses a surface. Stops and the rims of surfaces hold it back only if `is_cut`.
    pub(super) fn ray_from_object(&self, point_mm: DVec2, z_mm: f64, pupil_mm: DVec2, is_cut: bool) -> Option<LensRay> {
        let at = point_mm.extend(self.object_mm + z_mm);
        let way = pupil_mm.extend(self.entrance_mm) - at;
        let mut ray = Ray { at, along: way.normalize() * way.z.signum() };
        for (n, surface) in self.surfaces.iter().enumerate() {
            if n == self.stop_after && is_cut && !self.passes_stop(&ray) {
                return None;
            }
            ray = surface.cross(&ray, is_cut)?;
        }
        let array_mm = ray.place_at(self.array_mm);
        Some(LensRay { array_mm, aperture_mm: ray.place_at(self.array_mm - self.exit_distance_mm) })
    }

    /// Whether light reaches a place of the array from a place in the plane of the exit pupil.
    pub(super) fn lets_through(&self, array_mm: DVec2, aperture_mm: DVec2) -> bool {
        let at = array_mm.extend(self.array_mm);
        let way = aperture_mm.extend(self.array_mm - self.exit_distance_mm) - at;
        let mut ray = Ray { at, along: way.normalize() };
        for (n, surface) in self.surfaces.iter().enumerate().rev() {
            let Some(next) = surface.cross(&ray, true) else { return false };
            ray = next;
            if n == self.stop_after && !self.passes_stop(&ray) {
                return false;
            }
        }
        true
    }

    fn passes_stop(&self, ray: &Ray) -> bool {
        let place = ray.place_at(self.stop_mm) / self.half_stop_mm;
        if self.shape == Shape::Disc { place.length_squared() <= 1.0 } else { place.abs().max_element() <= 1.0 }
    }
}

impl Ray {
    /// Where the ray meets a plane across the axis.
    fn place_at(&self, along_mm: f64) -> DVec2 {
        (self.at + (along_mm - self.at.z) / self.along.z * self.along).truncate()
    }
}

impl Crossing {
    /// The ray behind the surface, from either side. None if it misses the surface or is reflected in the glass.
    fn cross(&self, ray: &Ray, is_cut: bool) -> Option<Ray> {
        // Start where the ray meets the plane of the vertex. With p from the vertex, c the curvature and z along the
        // axis, c p^2 = 2 z on the sphere. Of its two places on the ray, take the one near the vertex.
        let (p, along, c) = (ray.place_at(self.place_mm).extend(0.0), ray.along, self.curvature);
        let (b, rest) = (along.z - c * p.dot(along), c * p.length_squared());
        let root = (b * b - c * rest).sqrt().copysign(b);
        let hit = p + rest / (b + root) * along;
        if hit.is_nan() || is_cut && hit.truncate().length_squared() > self.half_diameter_mm * self.half_diameter_mm {
            return None;
        }
        // Refract: the part of the direction along the surface changes by the ratio of the indices.
        let normal = DVec3::Z - c * hit;
        let [before, behind] = self.indices;
        let ratio = if along.z > 0.0 { before / behind } else { behind / before };
        let cosine = along.dot(normal);
        let refracted = (1.0 - ratio * ratio * (1.0 - cosine * cosine)).sqrt().copysign(cosine);
        let along = ratio * along + (refracted - ratio * cosine) * normal;
        (!along.is_nan()).then(|| Ray { at: hit + self.place_mm * DVec3::Z, along })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Scene, ready};
    use lf_core::Optics;
    use lf_core::frame::sensor_axes;

    /// The ready lens, and the camera that describes it.
    fn doublets() -> (ThickLens, Camera) {
        let value = ready::scene("doublets").unwrap();
        let scene: Scene = serde_json::from_value(value.clone()).unwrap();
        let lens = scene.thick_lens.unwrap();
        let camera = lens.camera(&Camera::from_json(&value["camera"].to_string()).unwrap()).unwrap();
        (lens, camera)
    }

    /// Rays from a point in a sphere of glass of radius R and index n, R / n from its middle, leave as if they came
    /// from n R off it, at any angle: the sphere's aplanatic points.
    #[test]
    fn a_sphere_has_its_aplanatic_points() {
        let (radius, index) = (10.0, 1.5);
        let surface =
            Crossing { place_mm: 3.0, curvature: -1.0 / radius, half_diameter_mm: 9.9, indices: [index, 1.0] };
        let middle = DVec3::new(0.0, 0.0, 3.0 - radius);
        for slope in [0.05, 0.3, 0.9, 2.0] {
            let at = middle - radius / index * DVec3::Z;
            let out = surface.cross(&Ray { at, along: DVec3::new(slope, 0.4 * slope, 1.0).normalize() }, true).unwrap();
            let image = out.place_at(middle.z - index * radius);
            assert!(image.length() < 1e-12, "{slope}: {image}");
            // The way back is the same.
            let back = surface.cross(&Ray { at: out.at, along: -out.along }, true).unwrap();
            assert!(back.place_at(at.z).length() < 1e-12, "{slope}");
        }
    }

    /// Near the axis the lens is the thin one that its camera describes, with its exit pupil.
    #[test]
    fn near_the_axis_the_lens_is_its_camera() {
        let (lens, camera) = doublets();
        let (traced, optics) = (TracedLens::new(&lens, &camera), Optics::new(&camera));
        assert!((camera.main_lens.working_f_number, camera.main_lens.magnification) == (4.0, 1.0));
        for (x, z, u) in [(0.01, 0.0, 0.0), (0.01, -5.0, 0.02), (-0.02, 4.0, 0.01)] {
            let point = DVec2::new(x, 0.5 * x);
            let ray = traced.ray_from_object(sensor_axes(point), z, DVec2::new(u, -u), true).unwrap();
            let hit = optics.array_from_object(point, z, ray.aperture_mm);
            assert!(hit.distance(ray.array_mm) < 1e-8, "{hit} {}", ray.array_mm);
        }
    }

    /// Three rays by another program, which meets each sphere by the distance from its middle: on the axis through the
    /// rim, beside it, and through the middle of the stop.
    #[test]
    fn rays_are_those_of_another_program() {
        let (lens, camera) = doublets();
        let traced = TracedLens::new(&lens, &camera);
        assert!((traced.half_entrance_mm - 26.990_684_729).abs() < 1e-8);
        for (point, pupil, array, aperture) in [
            ([0.0, 0.0], [26.990_684_729, 0.0], [0.045_103_80, 0.0], [26.991_203_16, 0.0]),
            ([3.0, 4.0], [10.0, -20.0], [-3.001_596_44, -3.970_948_28], [9.973_664_90, -20.051_085_65]),
            ([-4.0, 1.0], [0.0, 0.0], [4.0, -1.0], [2.273_859e-6, -5.684_648e-7]),
        ] {
            let ray = traced.ray_from_object(point.into(), 0.0, pupil.into(), false).unwrap();
            assert!(ray.array_mm.distance(array.into()) < 2e-8, "{ray:?}");
            assert!(ray.aperture_mm.distance(aperture.into()) < 2e-8, "{ray:?}");
        }
    }

    /// Light comes back the way it went: what the stop and the rims hold back on the one way, they do on the other.
    #[test]
    fn both_ways_pass_alike() {
        let (mut lens, camera) = doublets();
        lens.surfaces[0].half_diameter_mm = 22.0;
        let traced = TracedLens::new(&lens, &camera);
        let (mut passed, mut cut) = (0, 0);
        for n in 0..400 {
            let at = |n: usize, times: usize| ((n * times) % 400) as f64 / 200.0 - 1.0;
            let (point, pupil) = (4.0 * DVec2::new(at(n, 7), at(n, 31)), 30.0 * DVec2::new(at(n, 1), at(n, 57)));
            let ray = traced.ray_from_object(point, 1.0, pupil, false).unwrap();
            let passes = traced.ray_from_object(point, 1.0, pupil, true).is_some();
            assert_eq!(traced.lets_through(ray.array_mm, ray.aperture_mm), passes, "{point} {pupil}");
            (passed, cut) = (passed + usize::from(passes), cut + usize::from(!passes));
        }
        assert!(passed > 100 && cut > 100, "{passed} {cut}");
    }

    #[test]
    fn what_is_no_lens_is_refused() {
        let (lens, camera) = doublets();
        let found = |change: &dyn Fn(&mut ThickLens)| {
            let mut wrong = lens.clone();
            change(&mut wrong);
            wrong.check(&camera).unwrap_err().found
        };
        assert!(found(&|lens| lens.stop_after = 6).contains("stop_after is 6"));
        assert!(found(&|lens| lens.surfaces[1].index = 9.0).contains("surfaces[1].index is 9"));
        assert!(found(&|lens| lens.surfaces[2].radius_mm = Some(3.0)).contains("less than half"));
        assert!(found(&|lens| lens.surfaces[5].index = 1.5).contains("glass behind its last surface"));
        assert!(found(&|lens| lens.surfaces.iter_mut().for_each(|s| s.radius_mm = None)).contains("does not focus"));
        let mut wet = camera.clone();
        wet.aberrations = Some(Default::default());
        assert!(lens.check(&wet).unwrap_err().found.contains("camera.aberrations does not go with it"));
    }
}
