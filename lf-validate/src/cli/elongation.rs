//! `elongation`: how large reconstructed particles are.

use super::inputs::{light, open_particles, open_whole, pixel_mm};
use super::limits::{are_at_most, counts, verdict};
use super::output::{Picture, print};
use lf_core::{Error, Result, Session, Verdict, Volume, cli::numbers};
use lf_validate::pictures;
use lf_validate::scores::elongation::{SizeCounts, elongation};
use std::path::PathBuf;

/// Diameters of reconstructed particles along x, y and z
///
/// Read along the three lines of voxels through the brightest voxel near a particle's true place,
/// interpolated between voxels as a Gaussian falls.
///
///   diameter      the paper's: full width at exp(-2) of the peak, 4 standard deviations of a
///                 Gaussian; 3 voxels for the ideal particle, a Gaussian of 0.75 voxel
///   half_maximum  full width at half maximum
///   histogram     shares of the particles in bins of half a voxel, at vox; the share above 12
///                 voxels is beyond
///   by_depth      median diameters in twenty slabs of equal depth, at z_mm
///
/// Median, p10 and p90 over all particles are given in vox, mm and, with --camera, px of the focal
/// plane. Particles are counted as
///
///   measured      both widths are known along all axes
///   missed        no light near the true place
///   merged        the brightest voxel is nearer to another particle
///   cut           the particle reaches over the end of the grid
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate elongation scene/particles.csv volume-0000.lfv -c camera.json --plot elongation.svg
  lf-validate elongation scene/particles.csv volume-0001.lfv --frame 1 --max-diameter 4,4,9"
)]
pub struct ElongationArguments {
    /// True places of the particles (particles.csv): frame,id,x_mm,y_mm,z_mm,intensity
    particles: PathBuf,
    /// The volume to score
    #[arg(default_value = "-")]
    volume: PathBuf,
    /// Another table and volume, of the same grid; all are scored together. May be given again
    #[arg(long, num_args = 2, value_names = ["PARTICLES", "VOLUME"])]
    and: Vec<PathBuf>,
    /// Frame of the tables that is in the volumes
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: usize,
    /// Reach of the search for a particle's brightest voxel, from its true place, voxels
    #[arg(long, value_name = "X,Y,Z", default_value = "2,2,3", value_parser = counts::<3>)]
    search: [usize; 3],
    /// Camera, for numbers in pixels
    #[arg(short, long, value_name = "FILE")]
    camera: Option<PathBuf>,
    #[command(flatten)]
    picture: Picture,
    /// Exit code 1 when a median diameter along x, y or z is above this, voxels
    #[arg(long, help_heading = "Limits", value_name = "X,Y,Z", value_parser = numbers::<3>)]
    max_diameter: Option<[f64; 3]>,
}

/// Measures the particles of one or more volumes.
pub fn judge(arguments: &ElongationArguments, session: &mut Session) -> Result<Verdict> {
    let files: Vec<&PathBuf> = [&arguments.particles, &arguments.volume].into_iter().chain(&arguments.and).collect();
    arguments.picture.check(files.iter().copied().chain(&arguments.camera), session)?;
    let (pairs, pixel_mm) = session.phase("read", |session| {
        let pairs: Result<Vec<_>> = files.chunks(2).map(|pair| read(pair, arguments.frame, session)).collect();
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
    let score = session.phase("score", |_| Ok(elongation(&volumes, grid, arguments.search, pixel_mm)))?;
    let SizeCounts { particles, measured, missed, merged, cut } = score.counts;
    session.count("particles", particles);
    session.count("measured", measured);
    arguments.picture.draw(session, || pictures::elongation(&score))?;
    print(&score)?;
    if measured == 0 {
        let counts = format!("of {particles}, {missed} missed, {merged} merged, {cut} cut");
        session.warn(format!("{}: no particle could be measured: {counts}", pairs[0].1.name()));
    }
    Ok(verdict(are_at_most(Some(score.medians_vox()), arguments.max_diameter)))
}

/// The places of a table and the volume that belongs to it.
fn read(pair: &[&PathBuf], frame: usize, session: &Session) -> Result<(Vec<[f64; 3]>, Volume)> {
    let [table, volume] = pair else { unreachable!("clap takes them in pairs") };
    let places = open_particles(table, frame, session)?.iter().map(|particle| particle.place_mm).collect();
    Ok((places, open_whole(volume)?))
}
