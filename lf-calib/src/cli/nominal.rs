//! `lf-calib nominal`: data sheets in, a camera and what follows from it out.

use super::{arguments::NominalArguments, files::with_history};
use lf_calib::{Advice, DataSheet, Liquid, advice, sheet_warnings};
use lf_core::{Camera, Error, Refusal, Result, Session, Verdict, camera::Medium, io};
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
    let NominalArguments { magnification, f_number, ring, .. } = *arguments;
    // clap requires one of the two.
    let of_ring = || ring.unwrap_or(f64::NAN) * (1.0 + magnification);
    DataSheet {
        sensor_px: arguments.sensor,
        pixel_mm: arguments.pixel,
        focal_length_mm: arguments.focal_length,
        magnification,
        working_f_number: f_number.unwrap_or_else(of_ring),
        aperture: arguments.aperture,
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
        "useful_depth_mm": advice.useful_depth_mm.map(hundredths),
        "pixels_per_voxel": advice.pixels_per_voxel,
        "target_depths_mm": advice.target_mm,
        "target_spacing_mm": advice.dots_mm[0],
    });
    if let Some(index) = arguments.water.filter(|_| !arguments.exact) {
        record["stands_in_air_for_index"] = json!(index);
    }
    record
}

fn hundredths(value: f64) -> f64 {
    (100.0 * value).round() / 100.0
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
    let [width, height] = camera.half_view_mm().map(|half| 2.0 * half);
    session.say(format!(
        "in focus the sensor sees {width:.1} x {height:.1} mm, a pixel {:.4} mm; lenslets are {:.2} px wide",
        camera.pixel_in_focus_mm(),
        camera.pitch_px()
    ));
    let [away, towards] = advice.useful_depth_mm;
    let blind = 0.5 * (advice.blind_depth_mm[1] - advice.blind_depth_mm[0]);
    let [halfway, end] = advice.resolution_mm;
    session.say(format!(
        "useful depth: z from {away:.1} to {towards:.1} mm, + towards the camera; within {blind:.2} mm of focus the image \
         says little of depth"
    ));
    session.say(format!(
        "depth resolution: {halfway:.2} mm halfway to the end of the useful depth, {end:.2} mm at its end"
    ));
    let fine = advice.pixels_per_voxel;
    session.say(format!(
        "volume: lf-prune --pvr {} --depth {},{}; --pvr {} has an eighth of the voxels",
        list(&fine),
        hundredths(away),
        hundredths(towards),
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
