//! Parts of a camera that do not fit each other.

use crate::points::sub_images::SHARE;
use crate::points::view::PointView;
use glam::DVec3;
use lf_core::{Camera, Optics};

/// Largest misfit of the f-numbers that needs no remark.
const NOTABLE: f64 = 0.03;
/// Pitches, px, that lenslets of light-field cameras have.
const USUAL_PITCH_PX: [f64; 2] = [5.0, 150.0];
/// Largest error of an equivalent camera, px, that needs no remark.
const NOTABLE_PX: f64 = 0.05;

/// Parts of a camera by its data sheets that do not fit each other, each with its figure and a remedy. `exact` is the
/// same camera with the liquid as it is, if the camera stands for one.
pub fn sheet_warnings(camera: &Camera, exact: Option<&Camera>) -> Vec<String> {
    [f_numbers(camera), pitch(camera), exact.and_then(|exact| aberration(camera, exact))]
        .into_iter()
        .flatten()
        .collect()
}

/// Compares the stop's image under a lenslet with the pitch.
fn f_numbers(camera: &Camera) -> Option<String> {
    let (lens, array) = (&camera.main_lens, &camera.microlenses);
    let fill = camera.demagnification() * camera.aperture_mm() / array.pitch_mm;
    if (fill - 1.0).abs() <= NOTABLE {
        return None;
    }
    let image_px = fill * camera.pitch_px();
    let what = if fill > 1.0 { "overlap" } else { "leave gaps" };
    // The words are about the data sheets: a camera that stands in air for one before a liquid has longer lengths.
    let index = camera.stands_for_index();
    let stated = lens.working_f_number / index;
    let matched = stated * fill;
    let ring = stated * (1.0 + lens.magnification);
    let remedy = if lens.telecentric.is_none() && (matched / ring - 1.0).abs() < 2.0 * NOTABLE {
        format!("if {} is the number on the lens's ring, give it with --ring", short(stated))
    } else {
        format!(
            "a working f-number of {matched:.2} matches lenslets of {} mm and {} mm focal length",
            short(array.pitch_mm),
            short(array.focal_length_mm / index)
        )
    };
    Some(format!(
        "lenslet images {what}: {image_px:.1} px wide on a pitch of {:.1} px, {:+.0} %; {remedy}",
        camera.pitch_px(),
        100.0 * (fill - 1.0)
    ))
}

/// A number with at most four digits.
fn short(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

fn pitch(camera: &Camera) -> Option<String> {
    let (pitch_px, [low, high]) = (camera.pitch_px(), USUAL_PITCH_PX);
    (!(low..=high).contains(&pitch_px)).then(|| {
        format!(
            "lenslets are {} pixels wide, where {low} to {high} are usual: check --pixel and --pitch",
            short(pitch_px)
        )
    })
}

/// Compares where lenslets show a point with where they show it through the liquid as it is.
fn aberration(camera: &Camera, exact: &Camera) -> Option<String> {
    let [optics, truth] = [camera, exact].map(Optics::new);
    let depth = camera.useful_depth_mm()[0];
    let place = DVec3::new(0.0, 0.0, depth);
    let [seen, there] = [&optics, &truth].map(|optics| PointView::new(optics, place));
    let lit = seen.lit_lenslets(SHARE, 0.0);
    let error = lit.iter().map(|lit| lit.place_px.distance(there.place_px(lit.lenslet))).fold(0.0, f64::max);
    (error > NOTABLE_PX).then(|| {
        format!(
            "the equivalent camera in air is off by {error:.2} px at the rim of the stop, {:.1} mm from focus: use --exact, \
             or stop the lens down",
            depth.abs()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nominal::data_sheet::{DataSheet, Liquid, tests::seed};
    use lf_core::camera::Medium;

    fn warnings_of(change: impl FnOnce(&mut DataSheet)) -> Vec<String> {
        let mut sheet = seed();
        change(&mut sheet);
        sheet_warnings(&sheet.camera(None).unwrap(), None)
    }

    #[test]
    fn matched_data_sheets_raise_no_warning() {
        assert!(warnings_of(|_| ()).is_empty());
        let water = seed().camera(Some(&Liquid::InAir { index: 1.333 })).unwrap();
        assert!(sheet_warnings(&water, None).is_empty());
    }

    #[test]
    fn unmatched_f_numbers_are_warned_of() {
        let text = warnings_of(|sheet| sheet.working_f_number = 3.5).join("");
        assert_eq!(
            text,
            "lenslet images overlap: 16.0 px wide on a pitch of 14.0 px, +14 %; a working f-number of 4.00 matches lenslets \
             of 0.077 mm and 0.308 mm focal length"
        );
        assert!(
            warnings_of(|sheet| sheet.working_f_number = 4.5)
                .join("")
                .starts_with("lenslet images leave gaps: 12.4 px")
        );
        let mut water =
            DataSheet { working_f_number: 3.5, ..seed() }.camera(Some(&Liquid::InAir { index: 1.333 })).unwrap();
        water.calibration = Some(serde_json::json!({"nominal": {"stands_in_air_for_index": 1.333}}));
        assert_eq!(sheet_warnings(&water, None).join(""), text);
        // f/2 on the ring is a working f-number of 4 at m = 1.
        let text = warnings_of(|sheet| sheet.working_f_number = 2.0).join("");
        assert!(text.ends_with("if 2 is the number on the lens's ring, give it with --ring"), "{text}");
    }

    #[test]
    fn lenslets_of_two_pixels_are_warned_of() {
        let text = warnings_of(|sheet| (sheet.pitch_mm, sheet.lenslet_focal_length_mm) = (0.011, 0.044)).join("");
        assert_eq!(text, "lenslets are 2 pixels wide, where 5 to 150 are usual: check --pixel and --pitch");
    }

    #[test]
    fn the_aberration_of_a_thick_tank_is_warned_of() {
        let through = |f_number: f64| {
            let mut sheet = seed();
            sheet.working_f_number = f_number;
            sheet.lenslet_focal_length_mm = 0.077 * f_number;
            let medium = Medium { index: 1.333, window_z_mm: 180.0, window_thickness_mm: 20.0, window_index: 1.49 };
            let exact = sheet.camera(Some(&Liquid::Exact(medium))).unwrap();
            sheet_warnings(&sheet.camera(Some(&Liquid::InAir { index: 1.333 })).unwrap(), Some(&exact))
        };
        assert!(through(16.0).is_empty(), "{:?}", through(16.0));
        let text = through(4.0).join("");
        assert!(text.starts_with("the equivalent camera in air is off by "), "{text}");
    }
}
