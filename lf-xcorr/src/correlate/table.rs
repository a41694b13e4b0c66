//! Sums of many cells, columns or rows, side by side in one piece of memory.

use super::shifts::Shifts;
use super::sums::{Sums, SumsView, channel};
use rayon::prelude::*;
use std::ops::Range;

/// Sums of places along x and y, x fastest. Each place has its own box of shifts, or none.
#[derive(Debug, Default)]
pub(crate) struct Table {
    boxes: Vec<Option<Shifts>>,
    /// Where the numbers of each place start, and the end.
    starts: Vec<usize>,
    data: Vec<f64>,
}

impl Table {
    /// Calls `fill(scratch, place, shifts, numbers)` for every place that has a box and light. The numbers may hold
    /// anything. A dark place has room, so that the tables of all layers are of one size, but no sums.
    /// `room` is the memory of a table that is no longer needed: allocating takes longer than summing.
    pub fn new<S: Default + Send>(
        places: Vec<(Option<Shifts>, bool)>,
        room: Vec<f64>,
        fill: impl Fn(&mut S, usize, Shifts, &mut [f64]) + Sync,
    ) -> Self {
        let mut starts = Vec::with_capacity(places.len() + 1);
        starts.push(0);
        for (shifts, _) in &places {
            starts.push(starts[starts.len() - 1] + shifts.map_or(0, |shifts| channel::COUNT * shifts.len()));
        }
        let mut data = sized(room, starts[places.len()]);
        let boxes: Vec<Option<Shifts>> = places.into_iter().map(|(shifts, is_lit)| shifts.filter(|_| is_lit)).collect();
        let mut rest = data.as_mut_slice();
        let mut places = Vec::with_capacity(boxes.len());
        for (place, shifts) in boxes.iter().enumerate() {
            let (numbers, behind) = rest.split_at_mut(starts[place + 1] - starts[place]);
            rest = behind;
            places.extend(shifts.map(|shifts| (place, shifts, numbers)));
        }
        places
            .into_par_iter()
            .for_each_init(S::default, |scratch, (place, shifts, numbers)| fill(scratch, place, shifts, numbers));
        Self { boxes, starts, data }
    }

    /// The sums of a place; `None` if it has no box.
    pub fn get(&self, place: usize) -> Option<SumsView<'_>> {
        let Range { start, end } = self.starts[place]..self.starts[place + 1];
        Some(SumsView { shifts: self.boxes[place]?, data: &self.data[start..end] })
    }

    /// The memory, for another table.
    pub fn into_room(self) -> Vec<f64> {
        self.data
    }
}

/// `room` with `len` numbers, and hardly more capacity.
fn sized(mut room: Vec<f64>, len: usize) -> Vec<f64> {
    room.truncate(len);
    if room.capacity() > len + len / 8 {
        room.shrink_to(len);
    }
    // The system enlarges a large piece of memory without copying it.
    room.reserve_exact(len - room.len());
    room.resize(len, 0.0);
    room
}

/// Writes the total of `terms` over what `out` holds. The box of shifts of each term contains `shifts`.
pub(crate) fn total<'a>(out: &mut [f64], shifts: Shifts, mut terms: impl Iterator<Item = SumsView<'a>>) {
    let first: [Option<SumsView>; 4] = std::array::from_fn(|_| terms.next());
    match first {
        // At 75 % overlap a window has four cells along each axis: read each once and write the sum once.
        [Some(a), Some(b), Some(c), Some(d)] if [a, b, c, d].iter().all(|term| term.shifts == shifts) => {
            let four = a.data.iter().zip(b.data).zip(c.data).zip(d.data);
            out.iter_mut().zip(four).for_each(|(sum, (((a, b), c), d))| *sum = a + b + c + d);
        }
        _ => {
            out.fill(0.0);
            first.into_iter().flatten().for_each(|term| term.add_to(out, shifts));
        }
    }
    terms.for_each(|term| term.add_to(out, shifts));
}

/// The total of `terms` as [`total`] writes it, in the memory of `room`.
pub(crate) fn total_in<'a>(mut room: Vec<f64>, shifts: Shifts, terms: impl Iterator<Item = SumsView<'a>>) -> Sums {
    room.resize(channel::COUNT * shifts.len(), 0.0);
    total(&mut room, shifts, terms);
    Sums { shifts, data: room }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(radius: usize) -> Shifts {
        Shifts::around([0; 3], [radius; 3])
    }

    /// The number of a place everywhere. What the room held is seen where nothing is written.
    fn table(boxes: Vec<Option<Shifts>>, room: Vec<f64>) -> Table {
        let places = boxes.into_iter().map(|shifts| (shifts, true)).collect();
        Table::new(places, room, |(), place, _, numbers| numbers.fill(place as f64))
    }

    #[test]
    fn each_place_has_its_own_box() {
        let table = table(vec![Some(around(1)), None, Some(around(0)), Some(around(2))], Vec::new());
        assert!(table.get(1).is_none());
        for (place, radius) in [(0, 1), (2, 0), (3, 2)] {
            let sums = table.get(place).unwrap();
            assert_eq!(sums.shifts, around(radius));
            assert_eq!(sums.data, vec![place as f64; channel::COUNT * around(radius).len()]);
        }
    }

    #[test]
    fn a_dark_place_has_room_and_no_sums() {
        let shifts = around(1);
        let fill = |(): &mut (), place: usize, _: Shifts, numbers: &mut [f64]| numbers.fill(place as f64);
        let table = Table::new(vec![(Some(shifts), false), (Some(shifts), true)], Vec::new(), fill);
        let len = channel::COUNT * shifts.len();
        assert!(table.get(0).is_none() && table.data.len() == 2 * len);
        assert_eq!(table.get(1).unwrap().data, vec![1.0; len]);
    }

    /// Scar: buffers of small boxes grew with every larger box until all were as large as the largest.
    #[test]
    fn a_table_keeps_hardly_more_memory_than_its_numbers_take() {
        let mut room = Vec::new();
        for radius in [2, 3, 1, 1, 2] {
            let table = table(vec![Some(around(radius)); 3], room);
            let len = 3 * channel::COUNT * around(radius).len();
            assert_eq!(table.data.len(), len);
            assert!(table.data.capacity() <= len + len / 8, "{} of {len}", table.data.capacity());
            room = table.into_room();
        }
    }

    #[test]
    fn a_total_adds_terms_of_wider_boxes_where_they_overlap() {
        let numbers = |shifts: Shifts| -> Vec<f64> {
            let channel = (0..shifts.len()).map(|index| {
                let [x, y, z] = shifts.place(index);
                let [a, b, c] = [x, y, z].map(|k| k as f64);
                (a + shifts.low[0] as f64) + 10.0 * (b + shifts.low[1] as f64) + 100.0 * (c + shifts.low[2] as f64)
            });
            channel.cycle().take(channel::COUNT * shifts.len()).collect()
        };
        let boxes = [around(2), around(1), Shifts { low: [-1, -2, -1], n: [4, 5, 3] }, around(1), around(1)];
        let data = boxes.map(numbers);
        for terms in [1, 3, 4, 5] {
            let views = (0..terms).map(|n| SumsView { shifts: boxes[n], data: &data[n] });
            let sums = total_in(vec![7.0; 3], around(1), views);
            let wanted: Vec<f64> = numbers(around(1)).iter().map(|number| terms as f64 * number).collect();
            assert_eq!((sums.shifts, &sums.data), (around(1), &wanted));
        }
    }
}
