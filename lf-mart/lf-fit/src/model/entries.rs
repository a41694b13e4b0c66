//! The particles that light each pixel, and by how much.

use super::particle_image::{ParticleImage, UNKNOWNS};

/// The particles of each pixel, in the order of the particles.
#[derive(Debug, Default)]
pub(crate) struct Entries {
    /// By pixel: its next entry to take, and the end of its entries.
    runs: Vec<[u32; 2]>,
    owners: Vec<u32>,
    by: Vec<[f32; UNKNOWNS]>,
}

/// The entries of a pixel from that of one particle on.
pub(crate) struct Rest<'a> {
    /// The derivatives of the one.
    pub(crate) by: [f32; UNKNOWNS],
    /// The later particles and their derivatives.
    pub(crate) owners: &'a [u32],
    pub(crate) others: &'a [[f32; UNKNOWNS]],
}

impl Entries {
    /// Lists the images. `touched` are their pixels, `counts` holds how often each comes.
    #[inline(always)]
    pub(crate) fn fill<'i>(
        &mut self,
        images: impl Iterator<Item = &'i ParticleImage>,
        columns: usize,
        counts: &[u32],
        touched: &[u32],
    ) {
        if self.runs.len() < counts.len() {
            self.runs.resize(counts.len(), [0; 2]);
        }
        let mut first = 0;
        for &n in touched {
            self.runs[n as usize] = [first; 2];
            first += counts[n as usize];
        }
        if self.owners.len() < first as usize {
            self.owners.resize(first as usize, 0);
            self.by.resize(first as usize, [0.0; UNKNOWNS]);
        }
        let Self { runs, owners, by } = self;
        for (owner, image) in images.enumerate() {
            let owner = owner as u32;
            image.pixels(
                columns,
                #[inline(always)]
                |n, pixel| {
                    let [first, end] = &mut runs[n];
                    // A pixel may come in several lenslets of one image.
                    if *end > *first && owners[*end as usize - 1] == owner {
                        let by = &mut by[*end as usize - 1];
                        (0..UNKNOWNS).for_each(|k| by[k] += pixel[k]);
                    } else {
                        (owners[*end as usize], by[*end as usize]) = (owner, *pixel);
                        *end += 1;
                    }
                },
            );
        }
    }

    /// Takes the entry of a particle at a pixel; None if it was taken. Particles come in their order.
    #[inline(always)]
    pub(crate) fn take(&mut self, n: usize, owner: u32) -> Option<Rest<'_>> {
        let [next, end] = &mut self.runs[n];
        let at = *next as usize;
        if *next == *end || self.owners[at] != owner {
            return None;
        }
        *next += 1;
        let rest = at + 1..*end as usize;
        Some(Rest { by: self.by[at], owners: &self.owners[rest.clone()], others: &self.by[rest] })
    }
}
