//! Which particles light a pixel, and by how much.

use super::image::{SpotImage, UNKNOWNS};

/// The derivatives of one particle on one pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Entry {
    pub(super) owner: u32,
    pub(super) by: [f32; UNKNOWNS],
}

/// The particles of each pixel, in the order of the particles. Nothing is listed between uses.
#[derive(Debug, Default)]
pub(super) struct Entries {
    /// By pixel: the first entry, the entries so far, and the last particle that was taken, plus one.
    pub(super) runs: Vec<[u32; 3]>,
    pub(super) list: Vec<Entry>,
}

impl Entries {
    /// Lists the images. `touched` are their pixels.
    pub(super) fn fill<'i>(
        &mut self,
        images: impl Iterator<Item = &'i SpotImage> + Clone,
        columns: usize,
        pixels: usize,
        touched: &[u32],
    ) {
        if self.runs.len() < pixels {
            self.runs.resize(pixels, [0; 3]);
        }
        images.clone().for_each(|image| image.pixels(columns, |n, _| self.runs[n][1] += 1));
        let mut first = 0;
        for n in touched {
            let run = &mut self.runs[*n as usize];
            let count = run[1];
            *run = [first, 0, 0];
            first += count;
        }
        self.list.clear();
        self.list.resize(first as usize, Entry::default());
        for (owner, image) in images.enumerate() {
            let owner = owner as u32;
            image.pixels(columns, |n, pixel| {
                let run = &mut self.runs[n];
                let end = (run[0] + run[1]) as usize;
                // A pixel may come in several lenslets of one image.
                if run[1] > 0 && self.list[end - 1].owner == owner {
                    (0..UNKNOWNS).for_each(|k| self.list[end - 1].by[k] += pixel[k]);
                } else {
                    self.list[end] = Entry { owner, by: *pixel };
                    run[1] += 1;
                }
            });
        }
    }

    pub(super) fn wipe(&mut self, touched: &[u32]) {
        touched.iter().for_each(|n| self.runs[*n as usize] = [0; 3]);
    }
}
