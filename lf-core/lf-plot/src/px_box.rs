//! A rectangle on a drawing, and the parts of lines inside it.

use super::drawing::At;

/// The upper left and the lower right corner, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PxBox {
    pub low: At,
    pub high: At,
}

impl PxBox {
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
}
