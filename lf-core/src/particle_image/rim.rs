//! The round stop: the share of a small rectangle of the stop that lies inside the disc.
//!
//! Across a small rectangle the rim is a straight line that bulges by a known mean. The share that a line cuts off a
//! rectangle is the distribution of the sum of two even variables, a trapezium.

use glam::{DVec2, Vec2Swizzles};

/// The share inside, and how it changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RimShare {
    pub(super) share: f64,
    /// Slopes with the centre of the rectangle and with its half sides, 1/mm.
    pub(super) by_centre: DVec2,
    pub(super) by_half: DVec2,
}

/// Where a rectangle lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Inside,
    Across,
    Outside,
}

/// The side of the rim of a disc about 0 on which the rectangle from `low` to `high` lies.
pub(super) fn side(radius: f64, low: DVec2, high: DVec2) -> Side {
    let far = (-low).max(high);
    let near = low.max(-high).max(DVec2::ZERO);
    if far.length_squared() <= radius * radius {
        Side::Inside
    } else if near.length_squared() >= radius * radius {
        Side::Outside
    } else {
        Side::Across
    }
}

/// The share of the rectangle with this centre and these half sides inside the disc of `radius` about 0.
#[inline(always)]
pub(super) fn share(radius: f64, centre: DVec2, half: DVec2) -> RimShare {
    let distance = centre.length();
    let whole = RimShare { share: 1.0, by_centre: DVec2::ZERO, by_half: DVec2::ZERO };
    if distance < 1e-9 * radius {
        return whole;
    }
    let normal = centre / distance;
    let half = half.max(DVec2::splat(1e-6 * radius));
    // Half lengths across the rim, and the mean square along it, which makes the rim bulge.
    let across = (half * normal).abs();
    let along = DVec2::new(half.x * normal.y, half.y * normal.x);
    let inside = radius - distance - along.length_squared() / (6.0 * radius);
    let reach = across.x + across.y;
    if inside >= reach {
        return whole;
    } else if inside <= -reach {
        return RimShare { share: 0.0, ..whole };
    }
    let is_wide_x = across.x >= across.y;
    let (wide, narrow) = if is_wide_x { (across.x, across.y) } else { (across.y, across.x) };
    // The share and its derivatives by `inside`, `wide` and `narrow`.
    let (share, density, by_wide, by_narrow) = if inside.abs() <= wide - narrow {
        (0.5 + inside / (2.0 * wide), 1.0 / (2.0 * wide), -inside / (2.0 * wide * wide), 0.0)
    } else {
        let density = (reach - inside.abs()) / (4.0 * wide * narrow);
        let cut = 0.5 * (reach - inside.abs()) * density;
        let sign = -inside.signum();
        let share = if inside > 0.0 { 1.0 - cut } else { cut };
        (share, density, sign * (density - cut / wide), sign * (density - cut / narrow))
    };
    let by_across = if is_wide_x { DVec2::new(by_wide, by_narrow) } else { DVec2::new(by_narrow, by_wide) };
    let bulge = density / (3.0 * radius);
    let by_half = by_across * normal.abs() - bulge * along * DVec2::new(normal.y, normal.x);
    let by_normal = by_across * half * normal.signum() - bulge * along.yx() * half.yx();
    // A step of the centre moves the rim away and turns the normal.
    let turn = (by_normal - by_normal.dot(normal) * normal) / distance;
    RimShare { share, by_centre: turn - density * normal, by_half }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_add_up_to_the_disc() {
        let (radius, n) = (50.0, 14);
        let side = 2.0 * radius / n as f64;
        let area: f64 = (0..n * n)
            .map(|i| DVec2::new((i % n) as f64 + 0.5, (i / n) as f64 + 0.5) * side - radius)
            .map(|centre| share(radius, centre, DVec2::splat(0.5 * side)).share * side * side)
            .sum();
        let exact = std::f64::consts::PI * radius * radius;
        assert!((area / exact - 1.0).abs() < 1e-3, "{area} against {exact}");
    }

    #[test]
    fn a_share_is_the_share_of_many_points() {
        let (radius, half) = (50.0, DVec2::new(3.5, 2.5));
        for angle in 0..20 {
            for off in [-4.0, -1.0, 0.0, 2.0, 3.5] {
                let centre = DVec2::from_angle(0.31 * angle as f64) * (radius + off);
                let point = |n: usize| DVec2::new((n % 99) as f64 - 49.0, (n / 99) as f64 - 49.0) / 49.5 * half;
                let inside = (0..99 * 99).filter(|n| (centre + point(*n)).length() < radius).count();
                let got = share(radius, centre, half);
                let exact = inside as f64 / 9801.0;
                assert!((got.share - exact).abs() < 0.01, "{centre}: {got:?} for {exact}");
                let moved = |centre: DVec2, half: DVec2| share(radius, centre, half).share;
                for (step, to_centre, to_half) in
                    [(DVec2::X, 1.0, 0.0), (DVec2::Y, 1.0, 0.0), (DVec2::X, 0.0, 1.0), (DVec2::Y, 0.0, 1.0)]
                {
                    let by = |h: f64| moved(centre + h * to_centre * step, half + h * to_half * step);
                    let slope = (by(1e-5) - by(-1e-5)) / 2e-5;
                    let said = step.dot(to_centre * got.by_centre + to_half * got.by_half);
                    assert!((slope - said).abs() < 1e-6, "{centre} {half}: {slope} {got:?}");
                }
            }
        }
    }
}
