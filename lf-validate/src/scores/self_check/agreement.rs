//! Whether two fits of the same particles agree within their stated uncertainties.

use crate::scores::distribution::root_mean;
use crate::scores::particles::matches;
use crate::scores::units::AXES;
use lf_core::statistics::{median, quantile};
use lf_core::{Particle, Refusal};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// Share of normal errors within one standard deviation.
const ONE_SIGMA: f64 = 0.682_689_492_137_086;

/// Two lists of the same particles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Agreement {
    /// All particles.
    #[serde(flatten)]
    pub all: Pairs,
    /// Particles between two distances from the focal plane.
    pub by_depth: Vec<Slab>,
}

/// Particles between two distances from the focal plane.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Slab {
    /// The distances, mm.
    pub z_mm: [f64; 2],
    /// The particles.
    #[serde(flatten)]
    pub pairs: Pairs,
}

/// Some particles of two lists.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Pairs {
    /// Particles of the first list, of the second, and pairs.
    pub counts: [usize; 3],
    /// Place in the first list minus that in the second, and its stated standard uncertainty, of each pair, px.
    differences: Vec<[(f64, f64); 3]>,
}

impl Pairs {
    /// Share of the particles that have no partner. None without particles.
    pub fn alone(&self) -> Option<f64> {
        let [a, b, both] = self.counts.map(|count| count as f64);
        (a + b > 0.0).then(|| 1.0 - 2.0 * both / (a + b))
    }

    /// The factor on stated uncertainties with which 68.3 % of the differences along an axis lie within one. It is 1
    /// where they are right. None without pairs.
    pub fn factor(&self, axis: usize) -> Option<f64> {
        let mut ratios: Vec<f64> = self.along(axis).map(|(difference, stated)| difference.abs() / stated).collect();
        Some(quantile(&mut ratios, ONE_SIGMA)).filter(|factor| factor.is_finite())
    }

    fn along(&self, axis: usize) -> impl Iterator<Item = (f64, f64)> {
        self.differences.iter().map(move |difference| difference[axis])
    }
}

impl Serialize for Pairs {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (key, count) in ["a", "b", "pairs"].iter().zip(self.counts) {
            map.serialize_entry(key, &count)?;
        }
        map.serialize_entry("alone", &self.alone())?;
        for (axis, name) in AXES.iter().enumerate() {
            let count = self.differences.len() as f64;
            let within = self.along(axis).filter(|(difference, stated)| difference.abs() <= *stated).count() as f64;
            let half_root = std::f64::consts::FRAC_1_SQRT_2;
            let rms = half_root * root_mean(self.along(axis).map(|(difference, _)| difference * difference));
            let stated = half_root * root_mean(self.along(axis).map(|(_, stated)| stated * stated));
            map.serialize_entry(&format!("rms_{name}_px"), &rms)?;
            map.serialize_entry(&format!("stated_{name}_px"), &stated)?;
            map.serialize_entry(&format!("within_1_{name}"), &(within / count))?;
            map.serialize_entry(&format!("factor_{name}"), &self.factor(axis))?;
            let shift = median(&mut self.along(axis).map(|(difference, _)| difference).collect::<Vec<f64>>());
            map.serialize_entry(&format!("shift_{name}_px"), &shift)?;
        }
        map.end()
    }
}

/// Pairs two lists of particles with uncertainties, and compares them between rising distances from the focal plane. A
/// pair is at most `box_px` pixels apart along each axis, or three standard uncertainties. Refuses a list without
/// uncertainties; `Err` has the number of the list.
pub fn agreement(
    lists: [&[Particle]; 2],
    box_px: [f64; 3],
    depths_mm: &[f64],
    pixel_mm: f64,
) -> Result<Agreement, (usize, Refusal)> {
    for (n, list) in lists.iter().enumerate() {
        let is_stated = list.iter().all(|particle| particle.uncertainty.is_some());
        let wanted = "wanted the table of lf-fit, with uncertainties";
        Refusal::unless(is_stated, || "particles without uncertainties", wanted).map_err(|refusal| (n, refusal))?;
    }
    let [a, b] = lists;
    let pairs = matches(a, b, box_px.map(|side| side * pixel_mm));
    let mut partner = vec![None; b.len()];
    pairs.iter().for_each(|&(of_a, of_b)| partner[of_b] = Some(of_a));
    let variance = |particle: &Particle, axis: usize| {
        particle.uncertainty.map_or(0.0, |uncertainty| uncertainty.std_mm()[axis].powi(2))
    };
    let between = |low: f64, high: f64| {
        let is_in = |particle: &Particle| (low..high).contains(&particle.place_mm[2].abs());
        let paired: Vec<[(f64, f64); 3]> = pairs
            .iter()
            .map(|&(of_a, of_b)| (&a[of_a], &b[of_b]))
            .filter(|(of_a, _)| is_in(of_a))
            .map(|(of_a, of_b)| {
                [0, 1, 2].map(|axis| {
                    let stated = (variance(of_a, axis) + variance(of_b, axis)).sqrt();
                    ((of_a.place_mm[axis] - of_b.place_mm[axis]) / pixel_mm, stated / pixel_mm)
                })
            })
            .collect();
        // A pair counts at the depth of its first particle.
        let in_b = (0..b.len()).filter(|n| is_in(partner[*n].map_or(&b[*n], |of_a| &a[of_a]))).count();
        Pairs { counts: [a.iter().filter(|one| is_in(one)).count(), in_b, paired.len()], differences: paired }
    };
    let slab = |depths: &[f64]| Slab { z_mm: [depths[0], depths[1]], pairs: between(depths[0], depths[1]) };
    Ok(Agreement { all: between(0.0, f64::INFINITY), by_depth: depths_mm.windows(2).map(slab).collect() })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use glam::{DMat3, DVec3};
    use lf_core::particles::Uncertainty;
    use serde_json::json;

    pub(crate) fn at(place_mm: [f64; 3], std_mm: f64) -> Particle {
        let covariance_mm2 = DMat3::from_diagonal(DVec3::splat(std_mm * std_mm));
        let uncertainty = Some(Uncertainty { covariance_mm2, intensity: 1.0 });
        Particle { frame: 0, id: 0, place_mm, intensity: 10.0, uncertainty }
    }

    /// By hand: of three and two particles two are pairs, apart by 2 and -4 px along z, with stated 5 and 5.
    #[test]
    fn an_agreement_by_hand() {
        let a = [at([0.0, 0.0, 1.0], 0.3), at([5.0, 0.0, -3.0], 0.3), at([9.0, 0.0, 1.0], 0.3)];
        let b = [at([5.0, 0.1, -2.6], 0.4), at([0.0, 0.0, 0.8], 0.4)];
        let found = agreement([&a, &b], [1.0, 1.0, 5.0], &[0.0, 2.0, 4.0], 0.1).unwrap();
        let value = serde_json::to_value(&found).unwrap();
        assert_eq!((found.all.counts, found.all.alone()), ([3, 2, 2], Some(1.0 - 4.0 / 5.0)));
        let near = |key: &str, wanted: f64| {
            let found = value[key].as_f64().unwrap();
            assert!((found - wanted).abs() < 1e-9, "{key}: {found}");
        };
        near("rms_z_px", 5f64.sqrt());
        near("stated_z_px", 5.0 / 2f64.sqrt());
        near("within_1_z", 1.0);
        near("shift_z_px", -1.0);
        near("factor_z", 0.4 + ONE_SIGMA * 0.4);
        assert_eq!(found.by_depth.iter().map(|slab| slab.pairs.counts).collect::<Vec<_>>(), [[2, 1, 1], [1, 1, 1]]);
        let none = agreement([&a, &[]], [1.0; 3], &[], 0.1).unwrap();
        assert_eq!(serde_json::to_value(none).unwrap()["factor_z"], json!(null));
    }

    #[test]
    fn tables_of_truth_are_refused() {
        let a = [at([0.0; 3], 0.1)];
        let b = [Particle { uncertainty: None, ..a[0] }];
        assert_eq!(agreement([&a, &b], [1.0; 3], &[], 0.1).unwrap_err().0, 1);
    }
}
