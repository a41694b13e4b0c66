//! The velocity field of a vortex ring.

use glam::DVec3;

/// A circular vortex filament with a softened kernel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ring {
    centre: DVec3,
    axis: DVec3,
    radius: f64,
    core: f64,
    displacement: f64,
    /// Cosines of the quadrature points on half the ring.
    cosines: Vec<f64>,
}

impl Ring {
    /// A ring whose velocity at the centre is `displacement` along `axis`.
    pub(super) fn new(centre: DVec3, axis: DVec3, radius: f64, core: f64, displacement: f64) -> Self {
        // The integrand is periodic and smooth over an angle of core / radius. Once the points are closer than that,
        // the midpoint rule converges faster than any power of their number. This many give 1e-6 of the field at the
        // core.
        let count = (9.0 * radius / core).ceil().max(16.0) as usize;
        let cosines = (0..count).map(|n| (std::f64::consts::PI * (n as f64 + 0.5) / count as f64).cos());
        Self { centre, axis: axis.normalize(), radius, core, displacement, cosines: cosines.collect() }
    }

    /// Velocity at a place. Let s be the place along the axis and r its distance from the axis, in radii of the ring,
    /// and e the core in radii. With q = (r^2 + s^2 + 1 + e^2 - 2 r cos t)^(-3/2), the velocity is the mean over t from
    /// 0 to pi of (1 - r cos t) q along the axis, and of s cos t q away from it, divided by the value (1 + e^2)^(-3/2)
    /// at the centre.
    pub(super) fn at(&self, place: DVec3) -> DVec3 {
        let offset = (place - self.centre) / self.radius;
        let s = offset.dot(self.axis);
        let away = offset - s * self.axis;
        let r = away.length();
        let e2 = (self.core / self.radius).powi(2);
        let distance = r * r + s * s + 1.0 + e2;
        let (mut along, mut outward) = (0.0, 0.0);
        for cos in &self.cosines {
            let d = distance - 2.0 * r * cos;
            let q = 1.0 / (d * d.sqrt());
            along += (1.0 - r * cos) * q;
            outward += s * cos * q;
        }
        let scale = self.displacement * (1.0 + e2).powf(1.5) / self.cosines.len() as f64;
        let direction = if r > 0.0 { away / r } else { DVec3::ZERO };
        scale * (along * self.axis + outward * direction)
    }
}
