//! The components of arrays as lists with names of their own, for formats of columns and channels.

use super::vti::Array;

impl Array {
    /// The components as lists of their own. Three are named `_x`, `_y`, `_z`, or as the name itself lists them:
    /// `strain_xy_xz_yz` has `strain_xy`, `strain_xz`, `strain_yz`, with the unit behind.
    pub(in crate::field) fn parts(&self) -> Vec<(String, Vec<f32>)> {
        if self.components == 1 {
            return vec![(self.name.to_owned(), self.values.clone())];
        }
        let part = |c: usize| self.values.iter().skip(c).step_by(self.components).copied().collect();
        (0..self.components).map(|c| (self.part_name(c), part(c))).collect()
    }

    fn part_name(&self, component: usize) -> String {
        for list in ["_xx_yy_zz", "_xy_xz_yz"] {
            if let Some((before, after)) = self.name.split_once(list) {
                let letters: Vec<&str> = list[1..].split('_').collect();
                return format!("{before}_{}{after}", letters[component]);
            }
        }
        let letter = ["x", "y", "z"][component];
        match self.name.split_once("_1_s") {
            Some((before, after)) => format!("{before}_{letter}_1_s{after}"),
            None => format!("{}_{letter}", self.name),
        }
    }
}

/// The components of all arrays.
pub(super) fn all(arrays: &[Array]) -> Vec<(String, Vec<f32>)> {
    arrays.iter().flat_map(Array::parts).collect()
}
