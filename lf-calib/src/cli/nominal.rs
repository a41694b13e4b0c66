//! `lf-calib nominal`: data sheets in, a camera and what follows from it out.

use super::{arguments::NominalArguments, files::with_history};
use lf_calib::{Advice, DataSheet, LightSheet, Liquid, advice, light_sheet, sheet_warnings};
use lf_core::camera::{Medium, STANDS_FOR};
use lf_core::{Camera, Error, Refusal, Result, Session, Verdict, io};
use serde_json::json;

pub fn nominal(arguments: &NominalArguments, session: &mut Session) -> Result<Verdict> {
    io::check_place(&arguments.output)?;
    session.keep_apart(&arguments.output, &[])?;
    let sheet = data_sheet(arguments);
    let exact = exact(arguments)?;
    let liquid = match (&exact, arguments.water) {
        (Some(exact), _) if arguments.exact => Some(exact.clone()),
        (_, Some(index)) => Some(Liquid::InAir { index }),
        _ => None,
    };
    let refused = |refusal: Refusal| refusal.about("the data sheets");
    let mut camera = sheet.camera(liquid.as_ref()).map_err(refused)?;
    let through = exact.filter(|_| !arguments.exact).map(|exact| sheet.camera(Some(&exact))).transpose();
    let through = through.map_err(refused)?;
    let advice = advice(&camera);
    camera.calibration = Some(json!({"nominal": record(arguments, &advice)}));
    let camera = with_history(camera, session);
    session.phase("write", |_| io::save_text(&arguments.output, |out| out.write_all(camera.to_json().as_bytes())))?;
    report(arguments, &camera, &advice, session);
    for warning in sheet_warnings(&camera, through.as_ref()) {
        session.warn(warning);
    }
    Ok(Verdict::Done)
}

fn data_sheet(arguments: &NominalArguments) -> DataSheet {
    let NominalArguments { f_number, ring, microscope, tube_lens, telecentric, .. } = *arguments;
    // clap requires what is needed here.
    let of_tube = || tube_lens.unwrap_or(f64::NAN) / arguments.focal_length.unwrap_or(f64::NAN);
    let magnification = arguments.magnification.unwrap_or_else(of_tube);
    let of_ring = ring.map(|ring| ring * (1.0 + magnification));
    let of_sine = microscope.map(|[aperture, _]| magnification / (2.0 * aperture));
    // No ray of a telecentric lens depends on its focal length.
    let usual_focal = if microscope.is_some() { TUBE_LENS_MM / magnification } else { TUBE_LENS_MM };
    DataSheet {
        sensor_px: arguments.sensor,
        pixel_mm: arguments.pixel,
        focal_length_mm: arguments.focal_length.unwrap_or(usual_focal),
        magnification,
        working_f_number: f_number.or(of_ring).or(of_sine).unwrap_or(f64::NAN),
        aperture: arguments.aperture,
        telecentric_index: telecentric.or(microscope.map(|[_, index]| index)),
        wavelength_nm: arguments.wavelength,
        layout: arguments.layout,
        pitch_mm: arguments.pitch,
        lenslet_focal_length_mm: arguments.lenslet_focal_length,
    }
}

/// The liquid with its window, if both are typed.
fn exact(arguments: &NominalArguments) -> Result<Option<Liquid>> {
    let Some(index) = arguments.water else { return Ok(None) };
    if !(1.0..=4.0).contains(&index) {
        return Err(Error::new("--water", index.to_string(), "wanted an index of 1 to 4"));
    }
    let medium = |[window_z_mm, window_thickness_mm, window_index]: [f64; 3]| {
        Liquid::Exact(Medium { index, window_z_mm, window_thickness_mm, window_index })
    };
    Ok(arguments.window.map(medium))
}

/// The record in the camera's file: its depths, and the liquid that it stands in air for.
fn record(arguments: &NominalArguments, advice: &Advice) -> serde_json::Value {
    let mut record = json!({
        "useful_depth_mm": advice.useful_depth_mm.map(|depth| hundredths(depth, advice.useful_depth_mm)),
        "pixels_per_voxel": advice.pixels_per_voxel,
        "target_depths_mm": advice.target_mm,
        "target_spacing_mm": advice.dots_mm[0],
    });
    if let Some(index) = arguments.water.filter(|_| !arguments.exact) {
        record[STANDS_FOR] = json!(index);
    }
    record
}

/// Useful depths below this are those of microscopes, mm: they are reported in um.
const MICROSCOPIC_MM: f64 = 0.5;
/// Focal length of a usual tube lens, mm.
const TUBE_LENS_MM: f64 = 200.0;

/// A depth rounded for a file or an option, mm: to hundredths, and to hundredths of a micrometre in a microscope.
fn hundredths(value: f64, useful_mm: [f64; 2]) -> f64 {
    let parts = if is_microscopic(useful_mm) { 1e5 } else { 1e2 };
    (parts * value).round() / parts
}

fn is_microscopic([away, towards]: [f64; 2]) -> bool {
    towards - away < 2.0 * MICROSCOPIC_MM
}

fn report(arguments: &NominalArguments, camera: &Camera, advice: &Advice, session: &Session) {
    let list = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let lens = &camera.main_lens;
    if let Some(index) = arguments.water.filter(|_| !arguments.exact) {
        session.say(format!(
            "camera in air for a liquid of index {index}: f {:.4} mm, working f-number {:.4}, lenslets of {:.4} mm focal \
             length; depths are those in the liquid",
            lens.focal_length_mm, lens.working_f_number, camera.microlenses.focal_length_mm
        ));
    } else if arguments.ring.is_some() {
        session.say(format!("working f-number {:.4}", lens.working_f_number));
    }
    if lens.telecentric.is_some() && arguments.f_number.is_none() {
        session.say(format!("magnification {:.4}, working f-number {:.4}", lens.magnification, lens.working_f_number));
    }
    let (unit, per_mm) = if is_microscopic(advice.useful_depth_mm) { ("um", 1e3) } else { ("mm", 1.0) };
    let [width, height] = camera.half_view_mm().map(|half| 2.0 * half * per_mm);
    session.say(format!(
        "in focus the sensor sees {width:.1} x {height:.1} {unit}, a pixel {:.4} {unit}; lenslets are {:.2} px wide",
        camera.pixel_in_focus_mm() * per_mm,
        camera.pitch_px()
    ));
    let [away_mm, towards_mm] = advice.useful_depth_mm;
    let [away, towards] = advice.useful_depth_mm.map(|depth| depth * per_mm);
    let blind = 0.5 * (advice.blind_depth_mm[1] - advice.blind_depth_mm[0]) * per_mm;
    let [halfway, end] = advice.resolution_mm.map(|step| step * per_mm);
    session.say(format!(
        "useful depth: z from {away:.1} to {towards:.1} {unit}, + towards the camera; within {blind:.2} {unit} of focus the image \
         says little of depth"
    ));
    session.say(format!(
        "depth resolution: {halfway:.2} {unit} halfway to the end of the useful depth, {end:.2} {unit} at its end"
    ));
    if let Some(LightSheet { sides_mm, std_mm }) = light_sheet(camera) {
        let [[a, b], [c, d]] = sides_mm.map(|side| side.map(|z| z * per_mm));
        session.say(format!(
            "light sheet: best within z from {a:.2} to {b:.2} or from {c:.2} to {d:.2} {unit}, where z of a lone particle is known \
             to {:.2} px ({:.4} {unit}) under a noise of 1 % of its brightest pixel",
            std_mm / camera.pixel_in_focus_mm(),
            std_mm * per_mm
        ));
    }
    let fine = advice.pixels_per_voxel;
    session.say(format!(
        "volume: lf-prune --pvr {} --depth {},{}; --pvr {} has an eighth of the voxels",
        list(&fine),
        hundredths(away_mm, advice.useful_depth_mm),
        hundredths(towards_mm, advice.useful_depth_mm),
        list(&fine.map(|pixels| 2.0 * pixels))
    ));
    let near = advice.target_mm.iter().copied().filter(|z| *z > 0.0).fold(f64::INFINITY, f64::min);
    let [spacing, diameter] = advice.dots_mm;
    session.say(format!(
        "dot target: no nearer to focus than {near} mm on either side, where a dot lights 6 lenslets; dots at most \
         {diameter} mm wide and {spacing} mm apart or more"
    ));
    session.say(format!(
        "dot target: lf-calib volume IMAGES --spacing {spacing} --depths {} -c camera.json",
        list(&advice.target_mm)
    ));
}
