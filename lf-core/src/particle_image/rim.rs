//! The rim of a round stop: on which side of it a pixel lies, and the strips of a pixel that it crosses.
//!
//! A strip lies across the rim and ends where the rim crosses it in the mean. Its integral is that of a rectangle. The
//! mean takes in where the rim leaves the pixel, so it has no kink as pixels move across the rim.

use super::place::Place;
use glam::DVec2;

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

/// Strips of a pixel at the rim.
const STRIPS: usize = 3;
/// A chord below this share of the radius has no slope: there the rim runs along the strip.
const SHORT: f64 = 1e-3;
/// The rim runs along a strip if its distance from the middle changes by less than this share.
const FLAT: f64 = 1e-6;

/// A strip inside the rim.
pub(super) struct Strip {
    /// Its ends across the rim.
    pub(super) ends: [Place; 2],
    /// How far the ends move in the stop with m, alpha and the lattice's shift of the other axis.
    pub(super) turn: [[f64; 3]; 2],
    /// Its sides along the rim.
    pub(super) along: [Place; 2],
}

/// Near the diagonal of the stop, strips run along both axes, and their shares change over this part of the distance
/// from the middle.
const TURNING: f64 = 0.05;

/// One of the two ways to cut a pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Way {
    /// The axis along which strips run.
    pub(super) across: usize,
    /// The part that this way has in the pixel's integral.
    pub(super) share: f64,
    /// How the part changes with m, alpha and the lattice's shift of either axis.
    pub(super) share_by: [[f64; 3]; 2],
}

/// The ways to cut the pixel between these edges.
#[inline(always)]
pub(super) fn ways(x: &[Place], y: &[Place]) -> [Way; 2] {
    let sums = [x[0].u + x[1].u, y[0].u + y[1].u];
    let [far_x, far_y] = [sums[0].abs(), sums[1].abs()];
    let all = (far_x + far_y).max(f64::MIN_POSITIVE);
    let part = (0.5 + 0.5 * (far_x - far_y) / (all * TURNING)).clamp(0.0, 1.0);
    let share = part * part * (3.0 - 2.0 * part);
    let slope = 6.0 * part * (1.0 - part) / (TURNING * all * all);
    let (by_x, by_y) = (sums[0].signum() * far_y * slope, -sums[1].signum() * far_x * slope);
    let (mut share_by, mut other_by) = ([[0.0; 3]; 2], [[0.0; 3]; 2]);
    if slope > 0.0 {
        for k in 0..3 {
            share_by[0][k] = by_x * (x[0].u_by[k] + x[1].u_by[k]);
            share_by[1][k] = by_y * (y[0].u_by[k] + y[1].u_by[k]);
            [other_by[0][k], other_by[1][k]] = [-share_by[0][k], -share_by[1][k]];
        }
    }
    [Way { across: 0, share, share_by }, Way { across: 1, share: 1.0 - share, share_by: other_by }]
}

/// Calls `each` for the strips along axis `across` of the pixel between these edges, as far as they lie inside the rim.
/// `alpha` is that of the axis.
#[inline(always)]
pub(super) fn strips(radius: f64, x: &[Place], y: &[Place], across: usize, alpha: f64, mut each: impl FnMut(&Strip)) {
    let (across, along) = if across == 0 { (x, y) } else { (y, x) };
    let mut first = along[0];
    for n in 1..=STRIPS {
        let last = Place::between(&along[0], &along[1], n as f64 / STRIPS as f64);
        let rim = Rim::new(radius, &first, &last);
        let is_beside = across[0].u * across[1].u > 0.0;
        let (left, left_turn) = end(&rim, &across[0], &across[1], is_beside, alpha);
        let (right, right_turn) = end(&rim, &across[1], &across[0], is_beside, alpha);
        if left.u != right.u {
            each(&Strip { ends: [left, right], turn: [left_turn, right_turn], along: [first, last] });
        }
        first = last;
    }
}

/// An end of a strip. The end nearer to the middle of the stop is inside, or the strip is empty.
#[inline(always)]
fn end(rim: &Rim, own: &Place, other: &Place, is_beside: bool, alpha: f64) -> (Place, [f64; 3]) {
    if !is_beside {
        rim.cut(own, &Place::default(), alpha)
    } else if own.u.abs() < other.u.abs() {
        (*own, [0.0; 3])
    } else {
        rim.cut(own, other, alpha)
    }
}

/// The rim along a strip: a straight line with the mean of the arc.
struct Rim {
    /// Its distance from the middle of the stop at both sides of the strip, and the derivatives by m, alpha and shift.
    ends: [f64; 2],
    ends_by: [[f64; 3]; 2],
}

impl Rim {
    #[inline(always)]
    fn new(radius: f64, first: &Place, last: &Place) -> Self {
        let middle = 0.5 * (first.u + last.u);
        let [a, m, b] = [first.u, middle, last.u].map(|v| (radius * radius - v * v).max(0.0).sqrt());
        let slope = |v: f64, chord: f64| if chord > SHORT * radius { -v / chord } else { 0.0 };
        let [by_a, by_m, by_b] = [slope(first.u, a), slope(middle, m), slope(last.u, b)];
        // Simpson's mean of the arc less that of the straight line.
        let bulge = (2.0 * m - a - b) / 3.0;
        let mut ends_by = [[0.0; 3]; 2];
        for k in 0..3 {
            let [by_first, by_last] = [by_a * first.u_by[k], by_b * last.u_by[k]];
            let bulge_by = (by_m * (first.u_by[k] + last.u_by[k]) - by_first - by_last) / 3.0;
            [ends_by[0][k], ends_by[1][k]] = [by_first + bulge_by, by_last + bulge_by];
        }
        Self { ends: [a + bulge, b + bulge], ends_by }
    }

    /// Where the rim ends a strip that would end at `outer`, in the mean, with the move by the strip's sides. The strip
    /// begins at `inner`.
    #[inline(always)]
    fn cut(&self, outer: &Place, inner: &Place, alpha: f64) -> (Place, [f64; 3]) {
        let (low, high) = (inner.u.abs(), outer.u.abs());
        let held = |end: f64| end.clamp(low, high);
        // The integral of what is held.
        let sum = |end: f64| {
            let held = held(end);
            held * end - 0.5 * held * held
        };
        let [a, b] = self.ends;
        let way = b - a;
        let (mean, by_ends, above, below) = if way.abs() > FLAT * high {
            let mean = (sum(b) - sum(a)) / way;
            let part = |from: f64, to: f64| ((to - from) / way.abs()).clamp(0.0, 1.0);
            let (least, most) = (a.min(b), a.max(b));
            let by_ends = [(mean - held(a)) / way, (held(b) - mean) / way];
            (mean, by_ends, part(high.max(least), most), part(least, low.min(most)))
        } else {
            let middle = 0.5 * (a + b);
            let is = |yes: bool| if yes { 1.0 } else { 0.0 };
            let between = 0.5 * is(middle > low && middle < high);
            (held(middle), [between; 2], is(middle >= high), is(middle <= low))
        };
        let u = mean.copysign(outer.u);
        let u_by: [f64; 3] = std::array::from_fn(|k| above * outer.u_by[k] + below * inner.u_by[k]);
        let x_by = [1.0 + alpha * u_by[0], u + alpha * u_by[1], alpha * u_by[2] - 1.0];
        let place = Place { u, u_by, x: outer.x + alpha * (u - outer.u), x_by };
        let turn = std::array::from_fn(|k| {
            outer.u.signum() * (by_ends[0] * self.ends_by[0][k] + by_ends[1] * self.ends_by[1][k])
        });
        (place, turn)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(u: f64) -> Place {
        Place { u, u_by: [0.0, 0.0, 1.0], x: 0.0, x_by: [0.0; 3] }
    }

    /// Area of the part of a rectangle inside the rim, and its growth as the rectangle moves along y.
    fn area(radius: f64, centre: DVec2, half: DVec2) -> (f64, f64) {
        let (low, high) = (centre - half, centre + half);
        match side(radius, low, high) {
            Side::Inside => return (4.0 * half.x * half.y, 0.0),
            Side::Outside => return (0.0, 0.0),
            Side::Across => {}
        }
        let (x, y) = ([place(low.x), place(high.x)], [place(low.y), place(high.y)]);
        let (mut sum, mut growth) = (0.0, 0.0);
        for Way { across, share, share_by } in ways(&x, &y) {
            let mut whole = 0.0;
            strips(radius, &x, &y, across, 0.0, |strip| {
                let height = strip.along[1].u - strip.along[0].u;
                whole += height * (strip.ends[1].u - strip.ends[0].u);
                let own = strip.ends[1].u_by[2] - strip.ends[0].u_by[2];
                let moves = if across == 0 { strip.turn[1][2] - strip.turn[0][2] } else { own };
                growth += share * height * moves;
            });
            sum += share * whole;
            growth += share_by[1][2] * whole;
        }
        (sum, growth)
    }

    #[test]
    fn rectangles_add_up_to_the_disc() {
        let (radius, n) = (50.0, 14);
        let side = 2.0 * radius / n as f64;
        let centre = |i: usize| DVec2::new((i % n) as f64 + 0.5, (i / n) as f64 + 0.5) * side - radius;
        let sum: f64 = (0..n * n).map(|i| area(radius, centre(i), DVec2::splat(0.5 * side)).0).sum();
        let exact = std::f64::consts::PI * radius * radius;
        assert!((sum / exact - 1.0).abs() < 1e-3, "{sum} against {exact}");
    }

    #[test]
    fn a_part_is_that_of_many_points_and_grows_as_said() {
        let (radius, half) = (50.0, DVec2::new(3.5, 2.5));
        for angle in 0..20 {
            for off in [-4.0, -1.0, 0.0, 2.0, 3.5] {
                let centre = DVec2::from_angle(0.31 * angle as f64 + 0.01) * (radius + off);
                let point = |n: usize| DVec2::new((n % 99) as f64 - 49.0, (n / 99) as f64 - 49.0) / 49.5 * half;
                let inside = (0..99 * 99).filter(|n| (centre + point(*n)).length() < radius).count();
                let (part, growth) = area(radius, centre, half);
                let exact = inside as f64 / 9801.0;
                assert!((part / (4.0 * half.x * half.y) - exact).abs() < 0.01, "{centre}: {part} for {exact}");
                let moved = |by: f64| area(radius, centre + DVec2::Y * by, half).0;
                let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                assert!((slope - growth).abs() < 1e-3 * half.x, "{centre}: {slope}, said {growth}");
            }
        }
    }
}
