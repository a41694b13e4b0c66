//! The lenslets that the sensor sees, as the kernels read them: row after row, eight at a time.

use crate::Optics;
use glam::{DVec2, Vec2};
use std::ops::Range;

/// Lenslets that a kernel reads at once. Each row is padded by this many lenslets, which no light reaches.
pub(super) const LANES: usize = 8;

/// Coordinate of a padding lenslet, mm: no ray reaches it.
const NOWHERE: f32 = 1e6;

#[derive(Debug, Clone, Default)]
pub(crate) struct LensletArray {
    /// The centre of lenslet 0 of row 0, and the steps along a row and from row to row in the perfect lattice, mm.
    pub(super) origin: DVec2,
    pub(super) along: DVec2,
    pub(super) across: DVec2,
    pub(super) first_row: i64,
    /// Lenslets of a row, with the padding.
    pub(super) length: usize,
    /// Centres, mm.
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    /// The middle of the stop's image, px from the micro-image's first corner.
    pub(super) middle_x: Vec<f32>,
    pub(super) middle_y: Vec<f32>,
    /// px on the sensor for a mm of the stop.
    pub(super) per_mm: Vec<f32>,
    /// Distance on the sensor between a ray and the image of its place in the stop, px for a mm on the array from the
    /// lenslet's centre.
    pub(super) refocus: Vec<f32>,
    /// `per_mm` and `refocus` where the sensor is nearest to the array, and where it is farthest.
    pub(super) extremes: [[f64; 2]; 2],
    /// The micro-image's first column and row on the sensor.
    pub(super) column: Vec<i32>,
    pub(super) row: Vec<i32>,
    /// Pixels of a micro-image, a side.
    pub(super) side: usize,
    /// For each row of lenslets, the range of the first rows of its micro-images.
    pub(super) spans: Vec<(i32, i32)>,
    /// Upper bound of a lenslet's departure from the perfect lattice along an axis, mm.
    pub(super) departure: f64,
    /// The centre of each row's first lenslet in the perfect lattice, mm.
    pub(super) starts: Vec<[f32; 2]>,
    /// Lenslets for a mm along a row, and rows for a mm across.
    pub(super) per_along: [f32; 2],
    pub(super) per_across: [f32; 2],
    /// mm between rows, across them.
    pub(super) apart: f32,
    /// Pixels for a mm on the sensor.
    pub(super) per_pixel: f32,
    /// Upper bound of the departure of a lenslet's image from that of a perfect lattice, px.
    pub(super) slack: f32,
}

impl LensletArray {
    pub(super) fn new(optics: &Optics) -> Self {
        let lattice = optics.lattice();
        let [origin, along, across] = lattice.rows_along_x();
        let stop = 2.0 * optics.demagnification * optics.half_aperture_mm;
        let half = optics.pixel_pitch_mm * optics.middle_px() + DVec2::splat(stop + along.length());
        // Sample the departures on a net of places, with a margin for what lies between them.
        let net = (0..81).map(|n| half * DVec2::new((n % 9) as f64 / 4.0 - 1.0, (n / 9) as f64 / 4.0 - 1.0));
        let departure =
            net.map(|place| (lattice.departed(place) - place).abs().max_element()).fold(0.0, f64::max) * 1.5;
        let half = half + departure;
        let row_of = |place: DVec2| along.perp_dot(place - origin) / along.perp_dot(across);
        let corners = [half, -half, DVec2::new(half.x, -half.y), DVec2::new(-half.x, half.y)].map(row_of);
        let first_row = corners.iter().fold(f64::INFINITY, |a, b| a.min(*b)).ceil() as i64;
        let last_row = corners.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b)).floor() as i64;
        let left = |row: i64| ((-half.x - origin.x - row as f64 * across.x) / along.x).ceil() as i64;
        let first: Vec<i64> = (first_row..=last_row).map(left).collect();
        let seen = (2.0 * half.x / along.x).ceil() as usize + 1;
        let length = seen + LANES;
        let mut this = Self {
            origin,
            along,
            across,
            first_row,
            length,
            departure,
            per_along: (along / along.length_squared()).as_vec2().to_array(),
            per_across: (along.perp() / along.perp_dot(across)).as_vec2().to_array(),
            per_pixel: (1.0 / optics.pixel_pitch_mm) as f32,
            slack: (2.0 * departure / optics.pixel_pitch_mm) as f32,
            apart: (along.perp_dot(across) / along.length()).abs() as f32,
            ..Self::default()
        };
        this.fill(optics, &first, seen);
        this
    }

    fn fill(&mut self, optics: &Optics, first: &[i64], seen: usize) {
        let middle = |centre: DVec2| optics.place_px(optics.sensor_through(centre, centre, DVec2::ZERO));
        let per_mm = |centre: DVec2| {
            let away = DVec2::new(0.5 * optics.half_aperture_mm, 0.0);
            let [a, b] = [-away, away].map(|place| optics.sensor_through(centre, centre, place));
            (a - b).x / (2.0 * away.x * optics.pixel_pitch_mm)
        };
        let pitch = self.along.length();
        let refocus = |centre: DVec2| {
            let beside = DVec2::new(0.25 * pitch, 0.0);
            let [a, b] = [-beside, beside].map(|beside| optics.sensor_through(centre, centre + beside, DVec2::ZERO));
            (a - b).x / (-2.0 * beside.x * optics.pixel_pitch_mm)
        };
        let mut largest = 0f64;
        let (mut per_mms, mut refocuses) = (Vec::new(), Vec::new());
        let mut places = Vec::with_capacity(first.len() * self.length);
        for (row, first) in (self.first_row..).zip(first) {
            let start = self.origin + *first as f64 * self.along + row as f64 * self.across;
            self.starts.push(start.as_vec2().to_array());
            for number in 0..self.length {
                let perfect = self.origin + (first + number as i64) as f64 * self.along + row as f64 * self.across;
                let centre = optics.lattice().departed(perfect);
                let (place, scale) = (middle(centre), per_mm(centre));
                largest = largest.max(scale * optics.half_aperture_mm);
                self.x.push(if number < seen { centre.x as f32 } else { NOWHERE });
                self.y.push(centre.y as f32);
                places.push(place);
                per_mms.push(scale);
                refocuses.push(refocus(centre));
            }
        }
        self.side = (2.0 * largest + 1.0).ceil() as usize;
        self.set_extremes(&per_mms, &refocuses);
        for place in places {
            let corner = (place - largest).floor();
            self.column.push(corner.x as i32);
            self.row.push(corner.y as i32);
            self.middle_x.push((place - corner).x as f32);
            self.middle_y.push((place - corner).y as f32);
        }
        let span = |rows: &[i32]| rows.iter().fold((i32::MAX, i32::MIN), |(a, b), row| (a.min(*row), b.max(*row)));
        self.spans = self.row.chunks(self.length).map(span).collect();
    }

    fn set_extremes(&mut self, per_mms: &[f64], refocuses: &[f64]) {
        let order = |a: &usize, b: &usize| per_mms[*a].total_cmp(&per_mms[*b]);
        let ends = [(0..per_mms.len()).min_by(order), (0..per_mms.len()).max_by(order)];
        self.extremes = ends.map(|n| n.map_or([0.0; 2], |n| [per_mms[n], refocuses[n]]));
        self.per_mm = per_mms.iter().map(|value| *value as f32).collect();
        self.refocus = refocuses.iter().map(|value| *value as f32).collect();
    }

    /// Whether the sensor is nearer to some lenslets than to others.
    pub(super) fn is_tilted(&self) -> bool {
        let [[near, _], [far, _]] = self.extremes;
        far - near > 1e-9 * near
    }

    /// px on the sensor for a mm of the stop, for rays of a point whose light spreads by `alpha` on the array: the mean
    /// of both extremes.
    pub(super) fn usual_slope(&self, alpha: f64) -> f64 {
        let [a, b] = self.extremes.map(|[per_mm, refocus]| per_mm - refocus * alpha);
        0.5 * (a + b)
    }

    /// Calls `found(lenslet)` for the lenslets whose centres lie within a box of these half sides about a point of the
    /// array, and a few more; all mm.
    #[inline(always)]
    pub(crate) fn near(&self, point: Vec2, half: Vec2, mut found: impl FnMut(usize)) {
        let half = half + self.departure as f32;
        let reach_along = self.per_along[0].abs() * half.x + self.per_along[1].abs() * half.y;
        let reach_across = self.per_across[0].abs() * half.x + self.per_across[1].abs() * half.y;
        let away = point - self.origin.as_vec2();
        let middle = self.per_across[0] * away.x + self.per_across[1] * away.y - self.first_row as f32;
        for row in whole(middle, reach_across, self.rows()) {
            let [x, y] = self.starts[row];
            let middle = self.per_along[0] * (point.x - x) + self.per_along[1] * (point.y - y);
            for number in whole(middle, reach_along, self.length - LANES) {
                found(row * self.length + number);
            }
        }
    }

    /// A lenslet's centre, mm.
    #[inline(always)]
    pub(crate) fn centre(&self, lenslet: usize) -> DVec2 {
        DVec2::new(f64::from(self.x[lenslet]), f64::from(self.y[lenslet]))
    }

    /// Change of the place on the sensor with the place in the aperture, px for a mm, of rays through a lenslet that
    /// spread by `alpha` on the array.
    #[inline(always)]
    pub(crate) fn slope(&self, lenslet: usize, alpha: Vec2) -> Vec2 {
        self.refocus[lenslet] * alpha - self.per_mm[lenslet]
    }

    /// Bytes of the lenslets.
    pub(super) fn bytes(&self) -> usize {
        8 * size_of::<f32>() * self.x.len()
    }

    pub(super) fn rows(&self) -> usize {
        self.starts.len()
    }
}

/// The integers from 0 up to `count` within `reach` of `middle`, and perhaps one more.
#[inline(always)]
fn whole(middle: f32, reach: f32, count: usize) -> Range<usize> {
    // A cast rounds down and saturates at 0.
    (middle - reach + 0.999) as usize..((middle + reach + 1.001) as usize).min(count)
}
