//! The round stop: the share of a small rectangle of the aperture that lies inside the disc.

/// A row of the aperture from v0 to v1, cut by the disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chords {
    /// Rectangles within `|u| <= inner` lie inside, mm.
    pub inner: f32,
    /// Rectangles beyond `|u| >= outer` lie outside, mm.
    pub outer: f32,
    /// Half chords at three Gauss-Legendre nodes of v, of weights 5, 8 and 5 out of 18, mm.
    pub nodes: [f32; 3],
}

/// Gauss-Legendre with three nodes: weight 8/18 in the middle, 5/18 at -/+ sqrt(3/5) of the half interval.
pub(super) const OUTER_NODE: f64 = 0.774_596_669_241_483_4;

impl Chords {
    /// A square stop cuts nothing.
    pub const UNCUT: Self = Self { inner: f32::INFINITY, outer: f32::INFINITY, nodes: [f32::INFINITY; 3] };

    /// The cut by a disc of radius `radius` over `v0 <= v <= v1`, mm.
    pub fn of_disc(radius: f64, v0: f64, v1: f64) -> Self {
        let half = |v: f64| (radius * radius - v * v).max(0.0).sqrt();
        let inner = half(v0).min(half(v1));
        let outer = if v0 * v1 <= 0.0 { radius } else { half(v0).max(half(v1)) };
        let (middle, reach) = (0.5 * (v0 + v1), 0.5 * (v1 - v0));
        let nodes = [-OUTER_NODE, 0.0, OUTER_NODE].map(|n| half(middle + n * reach) as f32);
        Self { inner: inner as f32, outer: outer as f32, nodes }
    }

    /// Share inside the disc of the rectangle `u0 <= u <= u1` of this row; 0 to 1.
    #[inline]
    pub fn share(&self, u0: f32, u1: f32) -> f32 {
        let far = (-u0).max(u1);
        if far <= self.inner {
            return 1.0;
        }
        let near = u0.max(-u1).max(0.0);
        if near >= self.outer {
            return 0.0;
        }
        let width = u1 - u0;
        let at = |half: f32| {
            let inside = u1.min(half) - u0.max(-half);
            if width > 0.0 { (inside / width).max(0.0) } else { f32::from(far <= half) }
        };
        (5.0 * (at(self.nodes[0]) + at(self.nodes[2])) + 8.0 * at(self.nodes[1])) / 18.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_add_up_to_the_disc() {
        let (radius, n) = (50.0, 28);
        let edge = |i: usize| -radius + 2.0 * radius * i as f64 / n as f64;
        let mut area = 0.0;
        for row in 0..n {
            let chords = Chords::of_disc(radius, edge(row), edge(row + 1));
            for column in 0..n {
                let share = chords.share(edge(column) as f32, edge(column + 1) as f32);
                assert!((0.0..=1.0).contains(&share));
                area += f64::from(share) * (2.0 * radius / n as f64).powi(2);
            }
        }
        let exact = std::f64::consts::PI * radius * radius;
        assert!((area / exact - 1.0).abs() < 5e-4, "{area} against {exact}");
    }
}
