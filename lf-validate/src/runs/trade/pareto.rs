//! The Pareto front of cost and error.

/// The front, and the points behind it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pareto {
    /// Indices of the points that no other point dominates, by rising cost. Equal points keep their order.
    pub front: Vec<usize>,
    /// For every other point: the point of the front with at most its cost and the least error.
    pub dominated_by: Vec<Option<usize>>,
}

/// The Pareto front of points (cost, error): the points that no other point dominates. A point dominates another if
/// neither its cost nor its error is greater, and one of them is less. Equal points do not dominate each other. A point
/// with a number that is not finite is neither on the front nor dominated. O(n log n).
pub fn pareto(points: &[[f64; 2]]) -> Pareto {
    let mut order: Vec<usize> = (0..points.len()).filter(|n| points[*n].iter().all(|v| v.is_finite())).collect();
    // A stable sort keeps the order of equal points. Adding 0 makes -0 equal to 0.
    order.sort_by(|a, b| {
        let [a, b] = [a, b].map(|n| points[*n].map(|value| value + 0.0));
        a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
    });
    let mut front: Vec<usize> = Vec::new();
    let mut dominated_by = vec![None; points.len()];
    // The last point of the front so far, and the first of those equal to it.
    let mut last: Option<usize> = None;
    for n in order {
        match last {
            Some(last) if points[n] == points[last] => front.push(n),
            Some(last) if points[n][1] >= points[last][1] => dominated_by[n] = Some(last),
            _ => {
                front.push(n);
                last = Some(n);
            }
        }
    }
    Pareto { front, dominated_by }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, checked for all pairs.
    fn naive(points: &[[f64; 2]]) -> Pareto {
        let is_finite = |n: usize| points[n].iter().all(|value| value.is_finite());
        let dominates = |a: [f64; 2], b: [f64; 2]| a[0] <= b[0] && a[1] <= b[1] && (a[0] < b[0] || a[1] < b[1]);
        let is_dominated = |n: usize| (0..points.len()).any(|m| is_finite(m) && dominates(points[m], points[n]));
        let mut front: Vec<usize> = (0..points.len()).filter(|n| is_finite(*n) && !is_dominated(*n)).collect();
        front.sort_by(|a, b| points[*a][0].partial_cmp(&points[*b][0]).unwrap().then(a.cmp(b)));
        let by = |n: usize| {
            let below = front.iter().copied().filter(|m| points[*m][0] <= points[n][0]);
            below.min_by(|a, b| points[*a][1].partial_cmp(&points[*b][1]).unwrap().then(a.cmp(b)))
        };
        let dominated_by =
            (0..points.len()).map(|n| if is_finite(n) && is_dominated(n) { by(n) } else { None }).collect();
        Pareto { front, dominated_by }
    }

    #[test]
    fn fronts_by_hand() {
        let checked = |points: &[[f64; 2]]| {
            assert_eq!(pareto(points), naive(points), "{points:?}");
            pareto(points)
        };
        assert_eq!(checked(&[]).front, [0; 0]);
        assert_eq!(checked(&[[1.0, 2.0]]).front, [0]);
        // Equal points, and a tie in either number.
        let found = checked(&[[3.0, 1.0], [1.0, 3.0], [3.0, 1.0], [1.0, 4.0], [5.0, 1.0], [2.0, 3.0]]);
        assert_eq!(found.front, [1, 0, 2]);
        assert_eq!(found.dominated_by, [None, None, None, Some(1), Some(0), Some(1)]);
        let found = checked(&[[f64::NAN, 0.0], [1.0, 1.0], [0.0, f64::INFINITY], [2.0, 2.0]]);
        assert_eq!((found.front, found.dominated_by), (vec![1], vec![None, None, None, Some(1)]));
        assert_eq!(checked(&[[0.0, 1.0], [-0.0, 0.5]]).front, [1]);
    }

    #[test]
    fn the_sweep_agrees_with_the_definition() {
        // A linear congruence with few values, so that there are many ties and equal points.
        let mut state = 1u64;
        let mut next = |most: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % most
        };
        for round in 0..400 {
            let most = 2 + round % 13;
            let points: Vec<[f64; 2]> = (0..next(40)).map(|_| [next(most) as f64, next(most) as f64]).collect();
            assert_eq!(pareto(&points), naive(&points), "{points:?}");
        }
    }
}
