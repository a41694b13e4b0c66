//! The subcommands and the options that all of them share.

use super::{curves, depth, displacement, divergence, elongation, ensemble, info, line, quality, trade};
use clap::{Parser, Subcommand};
use lf_core::cli::Common;

/// Result and truth to scores
///
/// Scores are one JSON object on standard output; a number that does not exist, such as an error without vectors, is
/// null. Exit codes: 0 done, 1 judged and the answer is no, 2 could not do the work.
#[derive(Parser)]
#[command(
    name = "lf-validate",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate quality scene/truth-0000.lfv volume-0000.lfv --min-q 0.8 --plot quality.svg
  lf-validate info camera.json"
)]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Command,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Subcommand)]
pub enum Command {
    /// Q factor, ghosts and missed light of a volume
    ///
    /// q = sum E1 E0 / sqrt(sum E1^2 sum E0^2) over all voxels, 0 where either volume is dark. scale: the factor on the
    /// volume that brings it closest to the truth. ghost_share: share of the volume's light in voxels where the truth is
    /// zero. missed_share: share of the truth's light in voxels that the volume leaves zero. max_difference: the largest
    /// difference of a voxel over the truth's brightest. *_voxels: voxels that are not zero. by_depth and by_region: the same for each slice across z and for each box, null where there is no light to
    /// take a share of. Both files need the column `intensity` and the same grid.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate quality scene/truth-0000.lfv volume-0000.lfv --min-q 0.8 --plot quality.svg
  lf-validate quality scene/truth-0000.lfv volume-0000.lfv --regions 1,1,5")]
    Quality(quality::Arguments),
    /// Diameters of reconstructed particles along x, y and z
    ///
    /// diameter: as the paper takes it, where a particle has fallen to exp(-2) of its peak, 3 voxels for its ideal particle,
    /// a Gaussian of 0.75 voxel. half_maximum: the full width at half maximum. Both are read along the three lines of
    /// voxels through the brightest voxel near a particle's true place, between voxels as a Gaussian falls. median, p10
    /// and p90 of all particles, in vox, mm and, with --camera, px of the focal plane. histogram: shares of the particles in
    /// bins of half a voxel. by_depth: medians in twenty slabs. Not measured are particles without light near them
    /// (missed), with a brightest voxel that is nearer to another particle (merged), and at the end of the grid (cut).
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate elongation scene/particles.csv volume-0000.lfv -c camera.json --plot elongation.svg
  lf-validate elongation scene/particles.csv volume-0001.lfv --frame 1 --max-diameter 4,4,9")]
    Elongation(elongation::Arguments),
    /// Light along z: profile, brightest voxel per slice, light outside the lit slab
    ///
    /// profile: light of each slice across z, mean of the volumes. peak: brightest voxel of each slice, mean of the
    /// volumes. With --slab: outside_share, of all light, in slices whose middle is outside; outside_peak, the brightest
    /// slice outside over the mean of those inside. unevenness: standard deviation over mean of the slices in the slab.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate depth volume-000?.lfv --plot depth.svg
  lf-validate depth volume-000?.lfv --slab -4,4 --max-outside 0.3")]
    Depth(depth::Arguments),
    /// Error of a vector field: bias, RMS, standard deviation, median and density per component, and its stated uncertainty
    ///
    /// error = measured - true. TRUTH is a field, interpolated to the places of the measured vectors; or a scene.json,
    /// whose steady flow is known everywhere (displacement from its first frame to its second); or a particles.csv, whose
    /// particles move from frame A to frame B: then the measured field is interpolated to the middle of each path, and
    /// flow structures below the size of a window are part of the error. Not scored but counted: vectors outside the truth
    /// (outside_truth), places without data (no_data), particles outside the field or beside a gap (outside_field), or in
    /// one frame only (unpaired). vectors: those scored; with a particles.csv, particles.
    ///
    /// Units: mm; vox, the voxels correlated; px, pixels at the focal plane, only with --camera. outliers: vectors more
    /// than 5 robust standard deviations and 0.1 voxel from the median error; they stay in every number. The object
    /// measured_only leaves out the replaced vectors.
    ///
    /// uncertainty, of measured vectors with a stated standard uncertainty: their number (stated), the shares of their
    /// errors within one and two of it (within_1, within_2; 0.683 and 0.954 for a normal distribution that is stated
    /// rightly), and the RMS of both (rms_stated, rms_error).
    ///
    /// pdf: density of the error of u in `u`, per `unit`, in bins about `x_u`, and the shares below and above them. Bins
    /// are 0.05 px to 4 px for u and v and 0.5 px to 40 px for w with --camera, else 0.05 vox to 4 vox.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate displacement scene/flow.exr field-0000-0001.exr -c camera.json --max-rms 0.7,0.2,2
  lf-validate displacement scene/particles.csv field-0000-0001.exr -c camera.json --plot error.svg")]
    Displacement(displacement::Arguments),
    /// Divergence and noise of a vector field, without the truth
    ///
    /// Differences are taken over as many vectors as a window covers, rounded up (stride), so that neighbours share no
    /// data; errors that such neighbours share are not seen. Numbers of the divergence have no unit: change of volume over
    /// volume between the two volumes. It is the sum of three central differences, at places whose six neighbours a stride
    /// away have data (count); sigma is its robust standard deviation, rms_gradient the RMS of all nine gradients,
    /// relative = rms / RMS of sqrt((du/dx)^2 + (dv/dy)^2 + (dw/dz)^2): 0 where volume is kept, 1 for noise, also
    /// for that of a flow without such gradients.
    /// rms_of_noise: what the noise alone would give.
    ///
    /// noise: sigma of each component, from the median absolute deviation of third differences, which take away a flow up
    /// to its second derivative; the axis that says least, of those with 100 differences or more. stated: median of the
    /// uncertainties stated of measured vectors. Units: mm; vox; px only with --camera.
    ///
    /// pdf: density of the divergence, in bins of a fifth of sigma to 8 sigma.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate divergence field-0000-0001.exr -c camera.json
  lf-xcorr volume-0000.lfv volume-0001.lfv --window 80,80,8 | lf-validate divergence --plot div.svg")]
    Divergence(divergence::Arguments),
    /// Mean, fluctuations and vorticity of many fields of one flow
    ///
    /// Only measured vectors count; replaced ones repeat their neighbours. -o mean.exr is a field like any other, its
    /// uncertainty that of the mean by the scatter of the fields; -o all.vti, for ParaView, holds mean, RMS and products of the
    /// fluctuations, vorticity and the number of vectors. The numbers printed are RMS over the places, along x, y and z:
    /// of the mean, of the fluctuations (by n - 1; noise is a part of them), of the mean's uncertainty, of the vorticity of
    /// the mean (1, or 1/s where fields know the time between their volumes). The picture is a slice: mean with arrows,
    /// the mean through it, RMS of u, v, w, and the vorticity through it.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate ensemble field-0000-0001.exr -o mean.vti -o mean.exr
  lf-validate ensemble field-*.exr --slice y=0 --plot mean.svg")]
    Ensemble(ensemble::Arguments),
    /// What any of the chain's files is, in one screen
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate info camera.json
  lf-prune scene/frame-0000.exr -c camera.json --pvr 4,4,40 --depth -5,5 | lf-validate info")]
    Info(info::Arguments),
    /// One run as one line of JSON, of its settings and of what tools wrote about it
    ///
    /// KEY=VALUE is a setting: a number, true or false, or else text. FILE is JSON of any tool, scores or --stats: its keys,
    /// nested ones joined with dots (counts.kept); lists of numbers stay, other lists are left out. NAME:FILE puts `NAME.`
    /// before them. An argument is a setting where `=` comes before any `:` and `/`. A key given twice is refused. Lines
    /// of many runs are what `curves` and `trade` read; a factor of a study is best named set.KEY, its seed set.seed.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate line name=a set.seed=1 volume-0000.stats.json quality-0000.json > runs.jsonl
  lf-validate line name=b set.seed=1 volume-0001.stats.json quality-0001.json >> runs.jsonl")]
    Line(line::Arguments),
    /// Runs as curves: medians over seeds, with their spread
    ///
    /// Runs with equal --panel, --by and x are one group: they differ in their seed. median, low and high: its median,
    /// least and greatest value; runs: how many have a number there. Where x and y are lists, such as a profile, each run
    /// is a curve and all is taken bin by bin; the bins of a series' runs must agree, and x with one number more than y is
    /// the edges of bins, told by their centres. Numeric series are sorted by number. Runs that lack a key are left out and
    /// counted in a warning. In the picture the line is the median, the area least to greatest.
    #[command(after_help = "Examples, in out/ after scripts/demo; the second is of what lf-mart --log writes:
  lf-validate curves displacement.json -x pdf.x_u -y pdf.u,pdf.v --log-y --plot density.svg
  lf-validate curves sweeps.jsonl -x iteration -y misfit --log-x --plot sweeps.svg")]
    Curves(curves::Arguments),
    /// Cost against error of settings: the Pareto front, and each factor's own effect
    ///
    /// Runs of one name, which differ in set.seed only, are a setting: cost, error and memory are medians over them, *_range
    /// least and greatest. front: settings for which no other has both less or equal cost and error, with one of them
    /// strictly less; by rising cost. dominated_by: of the front, the setting with at most this cost and the least error.
    /// With --base, factors: settings that differ from the base in exactly one key set.KEY, by that key, with cost, error
    /// and memory over the base's (*_ratio); ungrouped: settings that differ in more keys, or in none. Runs without name,
    /// cost or error are left out and counted in a warning.
    #[command(
        after_help = "Examples, in out/ after scripts/demo, with the runs.jsonl that `lf-validate line --help` makes:
  lf-validate trade runs.jsonl --error missed_share
  lf-validate trade runs.jsonl --error missed_share --cost peak_bytes --plot trade.svg"
    )]
    Trade(trade::Arguments),
}
