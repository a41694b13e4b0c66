//! Warnings about a frame that the tools share: clipped, with its background, or by another camera.

use super::session::Session;
use crate::Camera;
use crate::image::{ClippedBlack, Frame};
use crate::light::{Follows, LatticeLight, Tones};

/// Warn if at least this share of the pixels is clipped. Hot pixels are fewer.
const CLIPPED: f64 = 1e-3;

/// Warn of a background if the darkest tenth of the pixels reaches this share of the light's brightness. Frames of one
/// particle a lenslet without background have less than 0.01. From 0.2, the threshold of lf-prune, no voxel is removed.
const BRIGHT_DARKNESS: f64 = 0.15;

/// Warn of a white image if half of the pixels have this share of the light's brightness, and a thousandth of them less
/// than the ratio times that. White images have 1.0 and a ratio of 1.1; particles on a background have a larger one.
const WHITE: f64 = 0.75;
const WHITE_RATIO: f64 = 2.0;

/// Warn of a background with more counts than this share of the frame's: a dark image has fewer than its frame.
const TOO_BRIGHT: f64 = 1.05;

/// Warn of dark counts if no background is subtracted and the darkest hundredth of the pixels exceeds this share of the
/// light's brightness. Frames without dark counts have 0, at up to three particles a lenslet. With 10 dark counts and a
/// read noise of 3 it is 0.004 at one particle a lenslet, 0.012 at a tenth.
const DARK_COUNTS: f64 = 0.004;

/// Standard deviations of the noise that an offset must hold.
const OFFSET: f64 = 5.0;

impl Session {
    /// Warns of a frame that is clipped, that still has its background, or whose light does not lie where `camera` puts
    /// it. `has_background` says whether a background was subtracted.
    pub fn warn_of_frame(&mut self, frame: &Frame, camera: &Camera, has_background: bool) {
        let tones = Tones::new(frame.pixels.view());
        if let Some((level, share)) = frame.clipped.filter(|(_, share)| *share >= CLIPPED) {
            self.count("clipped_share", share);
            let percent = 100.0 * share;
            self.warn(format!(
                "{percent:.1} % of the pixels are clipped, at {level} counts: the brightest light is lost; lf-fit leaves \
                 such pixels out, volumes and their scores do not; expose less or lower the gain"
            ));
        }
        if let Some(ClippedBlack { level, share, noise, .. }) = frame.black {
            self.count("black_clipped_share", share);
            let (percent, offset) = (100.0 * share, (OFFSET * noise).ceil());
            self.warn(format!(
                "the black level is clipped: {percent:.0} % of the dark pixels are at {level}, the lowest count, and \
                 their noise of {noise:.1} counts is cut off there; leave an offset of {offset} counts in the camera's \
                 settings, and do not set pixels below a background to 0"
            ));
        }
        if let Some(share) = frame.background_share.filter(|share| *share > TOO_BRIGHT) {
            self.warn(format!(
                "the background of -b has {share:.1} times the counts of the frame: it is brighter than what it is \
                 subtracted from; give a dark image, or what lf-calib background makes of frames, and no white image"
            ));
        }
        let [middle, darkness] =
            [tones.middle, tones.dark].map(|brightness| brightness / tones.light.max(f64::MIN_POSITIVE));
        if middle >= WHITE && tones.bright < WHITE_RATIO * tones.middle {
            self.warn(format!(
                "half of the pixels are at least {:.0} % as bright as the light, and few are brighter: a white image, or \
                 a background without particles; give a frame of particles",
                100.0 * middle
            ));
        } else if darkness >= BRIGHT_DARKNESS {
            let remedy = if has_background {
                "the background of -b is not that of this frame; make one from frames of the same run with lf-calib \
                 background"
            } else {
                "the background is not subtracted, so no voxel is dark; subtract it with -b, lf-calib background \
                 makes it"
            };
            self.warn(format!(
                "the darkest tenth of the image is {:.0} % as bright as its light: {remedy}",
                100.0 * darkness
            ));
        } else if !has_background && tones.darkest > DARK_COUNTS * tones.light {
            self.warn(format!(
                "the darkest hundredth of the pixels has {:.1} counts, {:.1} % of the brightness of the light, and no \
                 background is subtracted: dark counts pass for light and make particles wider; subtract them with -b, \
                 lf-calib background makes the file",
                tones.darkest,
                100.0 * tones.darkest / tones.light
            ));
        }
        if let Some(light) = LatticeLight::new(frame.pixels.view(), camera, &tones) {
            self.warn_of_lattice(&light);
        }
    }

    fn warn_of_lattice(&mut self, light: &LatticeLight) {
        let LatticeLight { share, share_deviation, shift_px, gain, gain_deviation } = light;
        self.explain(format!(
            "light follows the lattice by {share:.2} +- {share_deviation:.2} of what the camera's stop predicts; \
             {shift_px:.2} px aside it follows by {gain:.2} +- {gain_deviation:.2} more"
        ));
        match light.follows() {
            Follows::Camera => (),
            Follows::AnotherLattice => self.warn(format!(
                "the light does not lie under the camera's lenslets: it follows their lattice by {:.0} % of what it \
                 should; the camera is another one or not calibrated; take this frame's camera, or calibrate with \
                 lf-calib lattice",
                100.0 * share.max(0.0)
            )),
            Follows::Moved => self.warn(format!(
                "the light lies {shift_px:.1} px beside the camera's lenslet images: the lattice has moved or is \
                 not calibrated; calibrate with lf-calib lattice"
            )),
        }
    }
}
