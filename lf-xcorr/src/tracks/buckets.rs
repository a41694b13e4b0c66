//! Places sorted into cubes, so that a search in a box looks at few of them.

use glam::DVec3;

/// Constant: places in a cube, on average.
const EACH: f64 = 2.0;

/// Places sorted into cubes.
pub(crate) struct Buckets {
    places: Vec<DVec3>,
    low: DVec3,
    side: f64,
    shape: [usize; 3],
    /// Cube `n` holds the members `start[n] .. start[n + 1]`.
    start: Vec<usize>,
    members: Vec<u32>,
}

impl Buckets {
    pub fn new(places: Vec<DVec3>) -> Self {
        let low = places.iter().copied().reduce(DVec3::min).unwrap_or_default();
        let extent = places.iter().copied().reduce(DVec3::max).unwrap_or_default() - low;
        // Axes without extent share no volume.
        let long: Vec<f64> = extent.to_array().into_iter().filter(|length| *length > 0.0).collect();
        let volume: f64 = long.iter().product();
        let side = (volume * EACH / places.len().max(1) as f64).powf(1.0 / long.len().max(1) as f64);
        // A cloud that is thin along one axis gets no more cubes than places along another.
        let side = side.max(extent.max_element() / places.len().max(1) as f64).max(f64::MIN_POSITIVE);
        let shape = extent.to_array().map(|length| (length / side) as usize + 1);
        let mut buckets = Self { places, low, side, shape, start: Vec::new(), members: Vec::new() };
        let cubes: Vec<usize> = buckets.places.iter().map(|place| buckets.cube(buckets.steps(*place))).collect();
        let mut members: Vec<u32> = (0..cubes.len() as u32).collect();
        members.sort_by_key(|member| cubes[*member as usize]);
        let mut start = vec![0; shape.iter().product::<usize>() + 1];
        cubes.iter().for_each(|cube| start[cube + 1] += 1);
        (1..start.len()).for_each(|n| start[n] += start[n - 1]);
        (buckets.start, buckets.members) = (start, members);
        buckets
    }

    fn steps(&self, place: DVec3) -> [usize; 3] {
        let steps = ((place - self.low) / self.side).to_array();
        [0, 1, 2].map(|axis| (steps[axis].max(0.0) as usize).min(self.shape[axis] - 1))
    }

    fn cube(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.shape[0] * (j + self.shape[1] * k)
    }

    /// The places within `half` of a centre along each axis, by cubes.
    pub fn near(&self, centre: DVec3, half: DVec3) -> impl Iterator<Item = usize> + '_ {
        let (from, to) = (self.steps(centre - half), self.steps(centre + half));
        let rows = (from[2]..=to[2]).flat_map(move |k| (from[1]..=to[1]).map(move |j| (j, k)));
        let in_row = move |(j, k)| self.start[self.cube([from[0], j, k])]..self.start[self.cube([to[0], j, k]) + 1];
        let members = rows.flat_map(in_row).map(|member| self.members[member] as usize);
        members.filter(move |place| (self.places[*place] - centre).abs().cmple(half).all())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn a_box_holds_the_places_that_a_look_at_all_finds() {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let mut place = |size: DVec3| size * DVec3::from_array([(); 3].map(|()| random.random::<f64>() - 0.5));
        for size in [DVec3::new(4.0, 3.0, 10.0), DVec3::new(4.0, 0.0, 1.0), DVec3::ZERO, DVec3::new(1e-9, 1e-9, 1.0)] {
            let places: Vec<DVec3> = (0..500).map(|_| place(size)).collect();
            let buckets = Buckets::new(places.clone());
            for _ in 0..50 {
                let (centre, half) = (place(1.5 * size), place(size).abs());
                let mut found: Vec<usize> = buckets.near(centre, half).collect();
                found.sort_unstable();
                let is_near = |i: &usize| (places[*i] - centre).abs().cmple(half).all();
                assert_eq!(found, (0..500).filter(is_near).collect::<Vec<_>>());
            }
        }
        assert_eq!(Buckets::new(Vec::new()).near(DVec3::ZERO, DVec3::ONE).count(), 0);
    }
}
