//! The raw frame and the white image, whole and near the middle with the camera's lattice over them.

use super::html::{Section, base64, escape};
use super::source::Source;
use glam::DVec2;
use lf_core::image::picture;
use lf_core::statistics::quantile;
use lf_core::{Camera, Optics, Result};
use ndarray::{Array2, ArrayView2, s};

/// Longer side of a whole picture, px.
const WHOLE_PX: usize = 560;
/// Side of a piece, lenslets.
const LENSLETS: f64 = 10.0;
/// Share of the pixels that are not drawn white.
const USUAL: f64 = 0.999;

/// The section: an image that cannot be read is named in `notes`. None without an image.
pub(super) fn section(
    source: &dyn Source,
    images: [(&str, Option<&str>); 2],
    camera: Option<&Camera>,
    notes: &mut Vec<String>,
) -> Option<Section> {
    let mut section = Section::new("frames", "Images");
    for (what, file) in images.into_iter().filter_map(|(what, file)| Some((what, file?))) {
        match pictures(source, what, file, camera) {
            Ok(html) => section.content += &html,
            Err(error) => notes.push(error.to_string()),
        }
    }
    (!section.content.is_empty()).then_some(section)
}

fn pictures(source: &dyn Source, what: &str, file: &str, camera: Option<&Camera>) -> Result<String> {
    let pixels = source.image(file)?;
    let (height, width) = pixels.dim();
    let caption = format!("{what}: {file}, {width} x {height} px");
    let block = width.max(height).div_ceil(WHOLE_PX);
    // A block shows its brightest pixel, so that particles do not vanish.
    let whole = Array2::from_shape_fn((height.div_ceil(block), width.div_ceil(block)), |(y, x)| {
        let rows = y * block..((y + 1) * block).min(height);
        let columns = x * block..((x + 1) * block).min(width);
        pixels.slice(s![rows, columns]).fold(0f32, |most, value| most.max(*value))
    });
    let mut html = format!("<h3>{}</h3>\n<div class=\"pair\">\n", escape(&caption));
    html += &figure("frame", &png(whole.view())?, "", "The whole image; a drawn pixel is the brightest of a block.");
    if let Some(camera) = camera.filter(|camera| (camera.sensor.width, camera.sensor.height) == (width, height)) {
        let side = ((LENSLETS * camera.pitch_px()).ceil() as usize).clamp(8, width.min(height));
        let corner = [(width - side) / 2, (height - side) / 2];
        let piece = pixels.slice(s![corner[1]..corner[1] + side, corner[0]..corner[0] + side]);
        let lattice = lattice(camera, corner, side);
        let text = "Its middle, with the lenslet images of the camera over it: each circle should hold one.";
        html += &figure("crop", &png(piece)?, &lattice, text);
    }
    Ok(html + "</div>\n")
}

/// A PNG in grey, from 0 to the value that few pixels exceed.
fn png(pixels: ArrayView2<f32>) -> Result<Vec<u8>> {
    let mut values: Vec<f64> = pixels.iter().map(|value| f64::from(*value)).collect();
    let most = quantile(&mut values, USUAL).max(f64::MIN_POSITIVE) as f32;
    // A root shows faint particles.
    let grey = pixels.mapv(|value| (255.0 * (value / most).clamp(0.0, 1.0).sqrt()).round() as u8);
    picture(&grey).map_err(|refusal| refusal.about("report"))
}

fn figure(class: &str, png: &[u8], over: &str, caption: &str) -> String {
    let (image, text) = (base64(png), escape(caption));
    format!(
        "<figure><div class=\"{class}\"><img alt=\"{text}\" src=\"data:image/png;base64,{image}\">{over}</div>\
         <figcaption>{text}</figcaption></figure>\n"
    )
}

/// Circles about the centres of the lenslet images of a piece, as an SVG over it.
fn lattice(camera: &Camera, corner: [usize; 2], side: usize) -> String {
    let (optics, lattice) = (Optics::new(camera), camera.lattice());
    let middle_px = DVec2::new(corner[0] as f64, corner[1] as f64) + 0.5 * side as f64;
    let half_sensor = DVec2::new(camera.sensor.width as f64, camera.sensor.height as f64) * 0.5;
    let middle_mm = (middle_px - half_sensor) * camera.sensor.pixel_pitch_mm / (1.0 + camera.image_growth());
    let (i, j) = lattice.lenslet_at(middle_mm);
    let reach = LENSLETS as i64;
    let radius = 0.5 * camera.stop_image_px();
    let mut circles = String::new();
    for (di, dj) in (-reach..=reach).flat_map(|dj| (-reach..=reach).map(move |di| (di, dj))) {
        let centre = lattice.centre_mm(i + di, j + dj);
        let place = optics.place_px(optics.sensor_through(centre, centre, DVec2::ZERO));
        let [x, y] = [place.x - corner[0] as f64, place.y - corner[1] as f64];
        if [x, y].iter().all(|along| (-radius..side as f64 + radius).contains(along)) {
            circles += &format!("<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius:.2}\"/>");
        }
    }
    format!(
        "<svg viewBox=\"0 0 {side} {side}\" aria-hidden=\"true\"><g fill=\"none\" stroke=\"#e69f00\" \
         stroke-width=\"0.35\">{circles}</g></svg>"
    )
}
