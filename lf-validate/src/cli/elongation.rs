//! `elongation`: how large reconstructed particles are.

use super::inputs::{check_inputs, light, open_whole, pixel_mm};
use super::limits::{are_at_most, counts, verdict};
use super::picture::Picture;
use super::print::print;
use lf_core::cli::{Session, Verdict, numbers};
use lf_core::volume::Volume;
use lf_core::{Error, Result, io, particles};
use lf_validate::pictures;
use lf_validate::scores::elongation::{Elongation, elongation};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// Where the particles truly are: frame,id,x_mm,y_mm,z_mm,intensity
    particles: PathBuf,
    /// The volume to score
    #[arg(default_value = "-")]
    volume: PathBuf,
    /// More particles and volumes of the same grid, taken together. Can be given again
    #[arg(long, num_args = 2, value_names = ["PARTICLES", "VOLUME"])]
    and: Vec<PathBuf>,
    /// Frame of the tables that the volumes show
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: usize,
    /// How far from its true place a particle's brightest voxel is looked for, voxels
    #[arg(long, value_name = "X,Y,Z", default_value = "2,2,3", value_parser = numbers::<3>)]
    search: [f64; 3],
    /// Camera that gives the size of a pixel
    #[arg(short, long, value_name = "FILE")]
    camera: Option<PathBuf>,
    #[command(flatten)]
    picture: Picture,
    /// Exit code 1 when a median diameter is above so many voxels along x, y, z
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>)]
    max_diameter: Option<[f64; 3]>,
}

/// Reads, scores, prints, judges.
pub fn judge(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let files: Vec<&Path> =
        [&arguments.particles, &arguments.volume].into_iter().chain(&arguments.and).map(PathBuf::as_path).collect();
    let inputs: Vec<&Path> = files.iter().copied().chain(arguments.camera.as_deref()).collect();
    check_inputs(&inputs, session)?;
    arguments.picture.check(&inputs, session)?;
    let search_vox = counts("--search", arguments.search)?;
    let (pairs, pixel_mm) = session.phase("read", |_| {
        let pairs: Result<Vec<_>> = files.chunks(2).map(|pair| read(pair, arguments.frame)).collect();
        Ok((pairs?, pixel_mm(arguments.camera.as_deref())?))
    })?;
    let grid = pairs[0].1.grid();
    let volumes = pairs
        .iter()
        .map(|(places, volume)| {
            if !grid.agrees_with(volume.grid()) {
                let wanted = format!("wanted the first volume's {grid}");
                return Err(Error::new(volume.name(), volume.grid().to_string(), wanted));
            }
            Ok((light(volume)?, places.clone()))
        })
        .collect::<Result<Vec<_>>>()?;
    let score = session.phase("score", |_| Ok(elongation(&volumes, grid, search_vox, pixel_mm)))?;
    session.count("particles", score.particles);
    session.count("measured", score.measured);
    arguments.picture.draw(session, || pictures::elongation(&score))?;
    print(&score)?;
    if score.measured == 0 {
        let Elongation { particles, missed, merged, cut, .. } = score;
        let of = format!("of {particles}, {missed} missed, {merged} merged, {cut} cut");
        session.warn(format!("{}: no particle could be measured: {of}", pairs[0].1.name()));
    }
    Ok(verdict(are_at_most(Some(score.diameter.vox.median), arguments.max_diameter)))
}

fn read(pair: &[&Path], frame: usize) -> Result<(Vec<[f64; 3]>, Volume)> {
    let [table, volume] = pair else { unreachable!("clap takes them in pairs") };
    let text = io::open_text(table)?;
    let all = particles::read(&text).map_err(|refusal| refusal.about(io::name(table)))?;
    let of_frame = all.iter().filter(|particle| particle.frame == frame);
    let places: Vec<[f64; 3]> = of_frame.map(|particle| particle.place_mm).collect();
    if places.is_empty() {
        let found = format!("no particle of frame {frame} among {}", all.len());
        return Err(Error::new(io::name(table), found, "wanted a frame that it has"));
    }
    Ok((places, open_whole(volume)?))
}
