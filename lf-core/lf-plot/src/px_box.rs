//! A rectangle on a drawing, and the parts of lines and areas inside it.

use super::drawing::At;

/// The upper left and the lower right corner, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PxBox {
    pub low: At,
    pub high: At,
}

impl PxBox {
    pub fn about(at: At, half: At) -> Self {
        Self { low: [0, 1].map(|axis| at[axis] - half[axis]), high: [0, 1].map(|axis| at[axis] + half[axis]) }
    }

    pub fn meets(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.low[axis] < other.high[axis] && other.low[axis] < self.high[axis])
    }

    /// Whether a place lies inside, not on an edge.
    pub fn holds(&self, at: At) -> bool {
        (0..2).all(|axis| self.low[axis] < at[axis] && at[axis] < self.high[axis])
    }

    /// Whether a place lies inside or on an edge, up to rounding.
    pub fn contains(&self, at: At) -> bool {
        (0..2).all(|axis| (self.low[axis] - 0.01..=self.high[axis] + 0.01).contains(&at[axis]))
    }

    /// The part of a straight line inside the frame, by the method of Liang and Barsky.
    fn part(&self, from: At, to: At) -> Option<[At; 2]> {
        let (mut start, mut end) = (0f64, 1f64);
        for axis in 0..2 {
            let along = to[axis] - from[axis];
            let [enter, leave] = [self.low[axis] - from[axis], self.high[axis] - from[axis]];
            if along == 0.0 {
                if enter > 0.0 || leave < 0.0 {
                    return None;
                }
                continue;
            }
            let [one, other] = [enter / along, leave / along];
            start = start.max(one.min(other));
            end = end.min(one.max(other));
        }
        let at = |share: f64| [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
        (start <= end).then(|| [if start == 0.0 { from } else { at(start) }, if end == 1.0 { to } else { at(end) }])
    }

    /// The parts of a line inside the frame. A place that is not finite is a gap.
    pub fn line(&self, places: &[At]) -> Vec<Vec<At>> {
        let mut parts: Vec<Vec<At>> = Vec::new();
        let mut last = None;
        for pair in places.windows(2) {
            let is_finite = pair.iter().flatten().all(|value| value.is_finite());
            let Some([from, to]) = is_finite.then(|| self.part(pair[0], pair[1])).flatten() else {
                last = None;
                continue;
            };
            match parts.last_mut().filter(|_| last == Some(from)) {
                Some(part) => part.push(to),
                None => parts.push(vec![from, to]),
            }
            last = Some(to);
        }
        parts
    }

    /// The part of an area inside the frame, by the method of Sutherland and Hodgman.
    pub fn area(&self, places: &[At]) -> Vec<At> {
        let mut kept = places.to_vec();
        for (axis, edge, sign) in
            [(0, self.low[0], 1.0), (0, self.high[0], -1.0), (1, self.low[1], 1.0), (1, self.high[1], -1.0)]
        {
            let whole = std::mem::take(&mut kept);
            let inside = |at: &At| sign * (at[axis] - edge) >= 0.0;
            for (n, at) in whole.iter().enumerate() {
                let before = &whole[(n + whole.len() - 1) % whole.len()];
                if inside(before) != inside(at) {
                    let share = (edge - before[axis]) / (at[axis] - before[axis]);
                    kept.push([0, 1].map(|a| before[a] + share * (at[a] - before[a])));
                }
                if inside(at) {
                    kept.push(*at);
                }
            }
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: PxBox = PxBox { low: [0.0, 0.0], high: [10.0, 10.0] };

    #[test]
    fn a_line_through_the_frame_keeps_its_inside() {
        let outside_and_back = [[-5.0, 5.0], [5.0, 5.0], [15.0, 5.0], [5.0, -5.0], [5.0, 3.0]];
        let parts = FRAME.line(&outside_and_back);
        assert_eq!(parts[0], [[0.0, 5.0], [5.0, 5.0], [10.0, 5.0]]);
        assert_eq!(parts.last().unwrap(), &[[5.0, 0.0], [5.0, 3.0]]);
        assert!(parts.iter().flatten().all(|at| FRAME.contains(*at)));
        let gap = [[1.0, 1.0], [2.0, 2.0], [f64::NAN, 3.0], [4.0, 4.0], [5.0, 4.0]];
        assert_eq!(FRAME.line(&gap), [[[1.0, 1.0], [2.0, 2.0]], [[4.0, 4.0], [5.0, 4.0]]]);
    }

    #[test]
    fn an_area_keeps_its_inside() {
        let area = FRAME.area(&[[-5.0, 2.0], [15.0, 2.0], [15.0, 20.0], [-5.0, 20.0]]);
        let sizes: f64 = (0..area.len())
            .map(|n| {
                let [a, b] = [area[n], area[(n + 1) % area.len()]];
                0.5 * (a[0] * b[1] - b[0] * a[1])
            })
            .sum();
        assert!((sizes.abs() - 80.0).abs() < 1e-9);
        assert!(FRAME.area(&[[20.0, 2.0], [30.0, 2.0], [25.0, 5.0]]).is_empty());
    }
}
