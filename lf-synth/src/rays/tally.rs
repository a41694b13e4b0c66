//! Rays counted for each pixel of a small part of the sensor.

use ndarray::Array2;
use rayon::prelude::*;

/// Rays counted for each pixel in a rectangle of the sensor, and a list of those that fell on the sensor outside it.
#[derive(Debug, Default)]
pub struct Tally {
    pub left: usize,
    pub top: usize,
    width: usize,
    rays: Vec<u32>,
    strays: Vec<usize>,
    arrived: u64,
    counts_per_ray: f64,
}

/// Light of a particle is counted in these shares where no rays are cast.
pub const LEAST_SHARE: f64 = 1.0 / (1 << 30) as f64;

impl Tally {
    /// An empty tally with room for this number of pixels: it need not grow, which would leave memory behind.
    pub fn with_capacity(pixels: f64) -> Self {
        Self { rays: Vec::with_capacity(pixels.ceil() as usize), ..Self::default() }
    }

    /// Empties the tally and moves it to the pixels from `low` up to `high`, excluded, on a sensor of `size`. All are
    /// (column, row).
    pub fn clear(&mut self, low: [f64; 2], high: [f64; 2], size: [usize; 2], counts_per_ray: f64) {
        // The cast turns NaN into 0.
        let on_sensor = |place: f64, axis: usize| place.clamp(0.0, size[axis] as f64) as usize;
        let [left, top] = [0, 1].map(|axis| on_sensor(low[axis].floor(), axis));
        let [right, bottom] = [0, 1].map(|axis| on_sensor(high[axis].ceil(), axis));
        (self.left, self.top, self.width) = (left, top, right.saturating_sub(left));
        self.rays.clear();
        self.rays.resize(self.width * bottom.saturating_sub(top), 0);
        self.strays.clear();
        (self.arrived, self.counts_per_ray) = (0, counts_per_ray);
    }

    /// Counts rays by the column and row of their pixel from the corner of the tally, on a sensor of `size`.
    #[inline(always)]
    pub fn count(&mut self, columns: &[i32], rows: &[i32], size: [usize; 2]) {
        let wide = self.width as u32;
        let high = (self.rays.len() / self.width.max(1)) as u32;
        let mut within = 0;
        for (&column, &row) in columns.iter().zip(rows) {
            // A negative number wraps to a place beyond the tally.
            let (x, y) = (column as u32, row as u32);
            if x < wide && y < high {
                self.rays[(y * wide + x) as usize] += 1;
                within += 1;
            } else {
                self.stray(column.into(), row.into(), size);
            }
        }
        self.arrived += within;
    }

    /// Adds a share of the light, of which a ray has [`LEAST_SHARE`], to a pixel of the sensor. Light outside the tally
    /// is lost.
    pub fn add_share(&mut self, [column, row]: [i64; 2], share: f64) {
        let (x, y) = (column - self.left as i64, row - self.top as i64);
        if (0..self.width as i64).contains(&x) && y >= 0 {
            let rays = (share / LEAST_SHARE).round() as u32;
            if let Some(pixel) = self.rays.get_mut(y as usize * self.width + x as usize) {
                *pixel += rays;
                self.arrived += u64::from(rays);
            }
        }
    }

    /// Lists a ray that fell outside the tally, if the sensor is there.
    #[cold]
    fn stray(&mut self, column: i64, row: i64, [width, height]: [usize; 2]) {
        let (x, y) = (column + self.left as i64, row + self.top as i64);
        if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
            self.strays.push(y as usize * width + x as usize);
            self.arrived += 1;
        }
    }

    /// Counts that arrived on the sensor.
    pub fn arrived(&self) -> f64 {
        self.arrived as f64 * self.counts_per_ray
    }
}

/// Rows of the image that one thread adds to at a time.
const BAND: usize = 64;

/// Adds tallies to an image, in their order at each pixel.
pub fn add(image: &mut Array2<f32>, tallies: &[Tally]) {
    let width = image.ncols();
    let pixels = image.as_slice_mut().expect("an image of our own is in rows");
    pixels.par_chunks_mut(BAND * width).enumerate().for_each(|(band, rows)| {
        for tally in tallies.iter().filter(|tally| !tally.rays.is_empty()) {
            let height = tally.rays.len() / tally.width;
            let from = tally.top.max(band * BAND);
            let to = (tally.top + height).min(band * BAND + rows.len() / width);
            for row in from..to {
                let start = (row - band * BAND) * width + tally.left;
                let counted = &tally.rays[(row - tally.top) * tally.width..][..tally.width];
                for (pixel, rays) in rows[start..][..tally.width].iter_mut().zip(counted) {
                    *pixel += (f64::from(*rays) * tally.counts_per_ray) as f32;
                }
            }
        }
    });
    for tally in tallies {
        for &stray in &tally.strays {
            pixels[stray] += tally.counts_per_ray as f32;
        }
    }
}
