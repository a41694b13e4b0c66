//! Description of a vector field.

use super::numbers::{figures, percent, product, whole};
use super::{description::Description, summary::Summary};
use crate::scores::units::AXES;
use lf_core::Field;
use lf_core::field::{MEASURED, REPLACED};

/// Describes a vector field. Its statistics are of the vectors that are measured or replaced.
pub fn field(field: &Field) -> Description {
    let layout = &field.layout;
    let mut about = Description::new("vector field (.exr)");
    let [nx, ny, nz] = layout.shape;
    let total = field.flag.len();
    about.line(
        "vectors",
        format!("{nx} x {ny} x {nz} = {}, every {} mm", whole(total as u64), product(&layout.spacing_mm)),
    );
    for (axis, name) in AXES.into_iter().enumerate() {
        let first = layout.origin_mm[axis];
        let last = first + layout.shape[axis].saturating_sub(1) as f64 * layout.spacing_mm[axis];
        about.line(format!("places {name}"), format!("{} to {} mm", figures(first), figures(last)));
    }
    about.line("voxel", format!("{} mm", product(&layout.voxel_mm)));
    if layout.window.contains(&0) {
        about.line("window", "none: not correlated");
    } else {
        let window = layout.window.map(|n| n as f64);
        let length = [0, 1, 2].map(|axis| window[axis] * layout.voxel_mm[axis]);
        let overlap = figures(100.0 * layout.overlap);
        about.line("window", format!("{} voxels = {} mm, overlap {overlap} %", product(&window), product(&length)));
    }
    if let Some(dt_s) = layout.dt_s {
        about.line("time step", format!("{} s", figures(dt_s)));
    }
    let count = |flag: f32| field.flag.iter().filter(|&&found| found == flag).count();
    let (measured, replaced) = (count(MEASURED), count(REPLACED));
    for (label, count) in [("measured", measured), ("replaced", replaced), ("no data", total - measured - replaced)] {
        about.line(label, format!("{}, {}", whole(count as u64), percent(count, total)));
    }
    let held = |values: &[f32]| {
        let kept = values.iter().zip(&field.flag).filter(|(_, flag)| [MEASURED, REPLACED].contains(*flag));
        Summary::of(kept.map(|(value, _)| value))
    };
    for (label, values) in [
        ("u (mm)", &field.u),
        ("v (mm)", &field.v),
        ("w (mm)", &field.w),
        ("peak", &field.peak),
        ("ratio", &field.ratio),
        ("su (mm)", &field.su),
        ("sv (mm)", &field.sv),
        ("sw (mm)", &field.sw),
        ("count", &field.count),
    ] {
        about.line(label, held(values).to_string());
    }
    about.history(&layout.history);
    about
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::field::NO_DATA;

    #[test]
    fn ranges_leave_out_places_without_data() {
        let mut truth = crate::scores::fixtures::field([4, 5, 3], |_| [0.5, 0.0, -1.0]);
        truth.u[7] = 1e6;
        truth.flag[7] = NO_DATA;
        let text = field(&truth).to_string();
        for wanted in [
            "4 x 5 x 3 = 60",
            "-3 to 1 mm",
            "none: not correlated",
            "measured  59, 98.3333 %",
            "min 0.5, max 0.5",
            "no finite value",
            "count     no finite value",
        ] {
            assert!(text.contains(wanted), "{wanted} is not in\n{text}");
        }
        truth.layout.window = [32, 32, 16];
        truth.layout.overlap = 0.75;
        truth.layout.dt_s = Some(2.5e-4);
        truth.count.fill(9.0);
        let text = field(&truth).to_string();
        for wanted in
            ["32 x 32 x 16 voxels = 0.32 x 0.64 x 1.6 mm, overlap 75 %", "0.00025 s", "count      min 9, max 9"]
        {
            assert!(text.contains(wanted), "{wanted} is not in\n{text}");
        }
    }
}
