//! Reads image and camera, prunes, and writes the support.

use super::again::{self, Frame, Pruned};
use super::{arguments::Arguments, threshold, warnings};
use lf_core::image::{self, FrameFiles};
use lf_core::{Camera, Grid, Result, Session, Tile, Verdict, cli, io, particles, volume, weights::aperture_sections};
use lf_prune::{Automatic, PruneOptions, PrunePlan, Region, Support};
use std::path::Path;
use std::process::ExitCode;

pub fn main() -> ExitCode {
    cli::run("lf-prune", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    arguments.check()?;
    let mut inputs = vec![arguments.image.as_path(), arguments.camera.as_path()];
    let others = [&arguments.background, &arguments.mask, &arguments.truth, &arguments.like];
    inputs.extend(others.into_iter().flat_map(|file| file.as_deref()));
    session.keep_apart(&arguments.output, &inputs)?;
    io::check_place(&arguments.output)?;
    let (camera, image) = session.phase("read", |_| {
        let camera = Camera::open(&arguments.camera)?;
        let files = FrameFiles { background: arguments.background.as_deref(), mask: arguments.mask.as_deref() };
        let channel = arguments.reading.channel;
        let image = image::open_frame(&arguments.image, files, &camera, &arguments.camera, channel)?;
        Ok((camera, image))
    })?;
    let pixels = image.pixels.view();
    if let Some(preset) = arguments.preset {
        session.explain_preset(preset, arguments.preset_settings(preset));
    }
    let flat = camera.flat_field(&arguments.camera);
    session.keep_apart(&arguments.output, &flat.as_deref().into_iter().collect::<Vec<&Path>>())?;
    let grid = arguments.grid(&camera)?;
    allow(PrunePlan::list_bytes(&grid), arguments, &grid)?;
    session.warn_of_frame(&image, &camera, arguments.background.is_some());
    warnings::warn_of_voxels(&grid, &camera, session);
    let found = Automatic::new(pixels, image.noise, &camera, arguments.scored_by());
    let tile = tile(arguments, &camera, &grid)?;
    let whole = || vec![[0..grid.shape[0], 0..grid.shape[1]]; grid.shape[2]];
    let regions: Vec<Region> = tile.as_ref().map_or_else(whole, |tile| tile.held(&camera, &grid));
    let refused = |refusal: lf_core::Refusal| refusal.about(arguments.grid_subject());
    let first = arguments.options(found.threshold);
    let plan = PrunePlan::new(&camera, &grid, &regions, &first).map_err(refused)?;
    allow(plan.bytes(pixels.len(), 0.0) as f64, arguments, &grid)?;
    let options = threshold::options(arguments, &found, &camera, &grid, pixels, session).map_err(refused)?;
    let plan = PrunePlan::new(&camera, &grid, &regions, &options).map_err(refused)?;
    explain_plan(arguments, &plan, &camera, session);
    if let Some(tile) = &tile {
        explain_tile(tile, session);
    }
    let may_exceed = allow(plan.bytes(pixels.len(), plan.voxels() as f64) as f64, arguments, &grid).is_err();
    if arguments.estimate || may_exceed {
        let kept = session.phase("forecast", |_| plan.estimated_kept(pixels).map_err(refused))?;
        let counts = [("voxels", plan.voxels()), ("kept", kept as u64)];
        let bytes = plan.bytes(pixels.len(), kept);
        if arguments.estimate {
            session.print_estimate(bytes, &counts, &[])?;
            return Ok(Verdict::Done);
        }
        let what = || format!("{kept:.0} voxels kept of a {grid}");
        session.allow_memory(arguments.memory, bytes as f64, arguments.grid_subject(), what)?;
    }

    let support = session.phase("prune", |session| {
        let progress = session.progress("slices", grid.shape[2] as u64);
        Ok(plan.prune(pixels, |slices| progress.add(slices)))
    })?;
    let frame = Frame { pixels, camera: &camera, grid: &grid, found: &found, is_whole: tile.is_none() };
    let is_automatic = arguments.typed_threshold().is_none();
    let Pruned { support, options, explained } =
        again::improve(Pruned::new(support, options, &frame), &frame, &regions, is_automatic, session)
            .map_err(refused)?;
    report(&support, &plan, &grid, &options, session);
    if let Some(file) = &arguments.truth {
        report_lost(&support, &grid, file, arguments.frame, session)?;
    }
    if support.indices.is_empty() {
        return Err(warnings::nothing_left(io::name(&arguments.image), &image, &support, &plan, &camera));
    }
    warnings::warn_of_light(explained, session);
    warnings::warn(&support, &plan, &camera, &options, found.noise, session);
    session.phase("write", |session| {
        let history = session.history(&image.history);
        io::save(&arguments.output, |out| {
            let tile = tile.as_ref().map(Tile::header).unwrap_or_default();
            volume::write_with(out, &grid, &support.indices, &[("score", &support.scores)], &history, &tile)
        })
    })?;
    Ok(Verdict::Done)
}

/// Refuses a grid that takes more bytes than allowed.
fn allow(bytes: f64, arguments: &Arguments, grid: &Grid) -> Result<()> {
    cli::check_memory(arguments.memory, bytes, arguments.grid_subject(), || format!("a {grid}"))
}

fn tile(arguments: &Arguments, camera: &Camera, grid: &Grid) -> Result<Option<Tile>> {
    let Some([index, of]) = arguments.tile else { return Ok(None) };
    let halo_mm = arguments.halo.unwrap_or_else(|| Tile::usual_halo_mm(camera, grid));
    Tile::new(camera, grid, index, of, halo_mm).map(Some).map_err(|refusal| refusal.about("--tile"))
}

fn explain_tile(tile: &Tile, session: &mut Session) {
    let Tile { index, of, halo_mm, core_vox: [[x0, x1], [y0, y1]], pixels: [[c0, c1], [r0, r1]] } = tile;
    session.count("halo_mm", *halo_mm);
    session.explain(format!(
        "tile {index} of {of}: voxels {x0} to {x1} along x and {y0} to {y1} along y; with a halo of {halo_mm:.3} mm, \
         columns {c0} to {c1} and rows {r0} to {r1} of the image, and the voxels that light them"
    ));
}

fn explain_plan(arguments: &Arguments, plan: &PrunePlan, camera: &Camera, session: &mut Session) {
    let sections = arguments.sections.unwrap_or_else(|| aperture_sections(camera));
    session.count("sections", sections);
    session.explain(format!("camera: {}", camera.about()));
    session.explain(plan.about());
    let depth_px = camera.depth_resolution_px();
    session.explain(format!(
        "the camera resolves about {depth_px:.0} px in depth (r): --pvr 1,1,r/2 puts two voxels into it, --pvr 2,2,r \
         takes an eighth of the voxels"
    ));
    session.explain(format!("{sections} x {sections} sections of the aperture, scored by {}", arguments.score_about()));
}

fn report(support: &Support, plan: &PrunePlan, grid: &Grid, options: &PruneOptions, session: &mut Session) {
    let (kept, all) = (support.indices.len(), plan.voxels());
    session.count("voxels", all);
    session.count("kept", kept);
    let [nx, ny, nz] = grid.shape;
    let (share, threshold) = (100.0 * kept as f64 / all as f64, 100.0 * options.threshold);
    session.explain(format!(
        "kept {kept} of {nx} x {ny} x {nz} voxels ({share:.3} %) scoring {threshold:.2} % of the brightest pixel or \
         more"
    ));
}

fn report_lost(support: &Support, grid: &Grid, file: &Path, frame: usize, session: &mut Session) -> Result<()> {
    let text = io::open_text(file)?;
    let table = particles::read(&text).map_err(|refusal| refusal.about(io::name(file)))?;
    particles::warn_unmarked(&text, &io::name(file), session);
    let shown = table.iter().filter(|particle| particle.frame == frame);
    let places: Vec<[f64; 3]> = shown.map(|particle| particle.place_mm).collect();
    let (inside, lost) = support.lost(grid, &places);
    session.count("particles", inside);
    session.count("lost_particles", lost);
    session.say(format!(
        "{lost} of {inside} particles lost ({:.2} %), {:.0} voxels kept for each",
        100.0 * lost as f64 / inside.max(1) as f64,
        support.indices.len() as f64 / inside.max(1) as f64
    ));
    Ok(())
}
