//! The recorded counts against the moments that the model of the camera predicts.

use super::{Recorded, SensorNoise};
use ndarray::Array2;

/// Shape of a flat image. Its pixels give a variance to 0.3 %.
const SHAPE: (usize, usize) = (400, 500);

fn noise(json: &str) -> SensorNoise {
    let noise: SensorNoise = serde_json::from_str(json).unwrap();
    noise.check().unwrap();
    noise
}

fn flat(level: f32) -> Array2<f32> {
    Array2::from_elem(SHAPE, level)
}

fn recorded(json: &str, mut image: Array2<f32>, frame: usize) -> (Array2<f32>, Recorded) {
    let recorded = noise(json).record(&mut image, None, 7, frame);
    (image, recorded)
}

/// Mean, variance, and third central moment.
fn moments(image: &Array2<f32>) -> [f64; 3] {
    let n = image.len() as f64;
    let mean = image.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    let central = |power| image.iter().map(|v| (f64::from(*v) - mean).powi(power)).sum::<f64>() / n;
    [mean, central(2), central(3)]
}

fn bits_of(image: &Array2<f32>) -> Vec<u32> {
    image.iter().map(|v| v.to_bits()).collect()
}

#[track_caller]
fn near(found: f64, wanted: f64, deviation: f64) {
    assert!((found - wanted).abs() < 4.5 * deviation, "{found} against {wanted} +- {deviation}");
}

/// Mean, variance and third central moment of a Poisson number all equal its mean. The means range from far below the
/// validity of a normal approximation to far above.
#[test]
fn electrons_follow_a_poisson_distribution() {
    let n = flat(0.0).len() as f64;
    for mean in [0.02, 0.7, 3.0, 11.9, 12.1, 30.0, 400.0, 50_000.0] {
        let (image, clipped) = recorded(r#"{"photon_noise": true}"#, flat(mean as f32), 0);
        assert!(image.iter().all(|v| *v >= 0.0 && v.fract() == 0.0));
        let mean = f64::from(mean as f32);
        let [found, variance, third] = moments(&image);
        near(found, mean, (mean / n).sqrt());
        near(variance, mean, ((2.0 * mean * mean + mean) / n).sqrt());
        // Variance of the third central moment of n numbers: (mu6 - mu3^2 - 6 mu2 mu4 + 9 mu2^3) / n.
        near(third, mean, ((6.0 * mean.powi(3) + 18.0 * mean.powi(2) + mean) / n).sqrt());
        assert_eq!(clipped, Recorded::default());
    }
    assert_eq!(recorded(r#"{"photon_noise": true}"#, flat(0.0), 0).0, flat(0.0));
    assert_eq!(recorded(r#"{"photon_noise": true}"#, flat(-3.0), 0).0, flat(0.0));
}

/// Photon transfer: the variance starts at gain^2 read_noise^2 + 1/12 and rises by the gain with the mean above the
/// offset.
#[test]
fn the_photon_transfer_curve_has_the_slope_of_the_gain() {
    let n = flat(0.0).len() as f64;
    for gain in [0.4, 2.5] {
        let json = format!(
            r#"{{"gain_counts_per_electron": {gain}, "photon_noise": true, "read_noise_electrons": 6,
                "dark_counts": 200, "bits": 16}}"#
        );
        let start = gain * gain * 36.0 + 1.0 / 12.0;
        for level in [0.0, 80.0, 1000.0, 12_000.0] {
            let (image, clipped) = recorded(&json, flat(level), 0);
            let level = f64::from(level);
            let [mean, variance, _] = moments(&image);
            let wanted = start + gain * level;
            near(mean, 200.0 + level, (wanted / n).sqrt());
            near(variance, wanted, wanted * (2.0 / n).sqrt());
            assert_eq!(clipped, Recorded::default());
        }
    }
}

#[test]
fn read_noise_is_normal_and_new_in_every_frame_and_pixel() {
    let json = r#"{"gain_counts_per_electron": 3, "read_noise_electrons": 5}"#;
    let (image, _) = recorded(json, flat(10.0), 0);
    let n = image.len() as f64;
    let [mean, variance, third] = moments(&image);
    near(mean, 10.0, 15.0 / n.sqrt());
    near(variance, 225.0, 225.0 * (2.0 / n).sqrt());
    near(third, 0.0, 15f64.powi(3) * (6.0 / n).sqrt());
    assert!(image.iter().any(|v| *v < -30.0), "a float may be negative");
    let beyond = image.iter().filter(|v| (**v - 10.0).abs() > 30.0).count() as f64;
    near(beyond, 0.0455 * n, (0.0455 * n).sqrt());

    let (next, _) = recorded(json, flat(10.0), 1);
    let other_seed = &mut flat(10.0);
    noise(json).record(other_seed, None, 8, 0);
    let down = Array2::from_shape_fn(SHAPE, |(y, x)| image[[(y + 1) % SHAPE.0, x]]);
    let aside = Array2::from_shape_fn(SHAPE, |(y, x)| image[[y, (x + 1) % SHAPE.1]]);
    for other in [&next, other_seed, &down, &aside] {
        let product = |(a, b): (&f32, &f32)| (f64::from(*a) - 10.0) * (f64::from(*b) - 10.0);
        near(image.iter().zip(other).map(product).sum::<f64>() / n, 0.0, 225.0 / n.sqrt());
    }
    assert_eq!(recorded(json, flat(10.0), 0).0, image);
}

/// The full well cuts before read noise and gain, so the counts still spread about it.
#[test]
fn a_full_well_holds_no_more() {
    let json = r#"{"gain_counts_per_electron": 0.5, "photon_noise": true, "full_well_electrons": 900,
        "dark_counts": 20}"#;
    let all = SHAPE.0 as u64 * SHAPE.1 as u64;
    let (image, full) = recorded(json, flat(1000.0), 0);
    assert_eq!(image, flat(470.0));
    assert_eq!(full, Recorded { clipped: all, ..Recorded::default() });
    let (image, half) = recorded(json, flat(450.0), 0);
    assert!(image.iter().all(|v| *v <= 470.0));
    near(half.clipped as f64, 0.49 * all as f64, 0.005 * all as f64);
    let (image, full) = recorded(r#"{"full_well_electrons": 900, "read_noise_electrons": 4}"#, flat(1000.0), 0);
    near(moments(&image)[1], 16.0, 16.0 * (2.0 / all as f64).sqrt());
    assert_eq!(full.clipped, all);
}

#[test]
fn bits_round_and_clip() {
    let mut image = ndarray::array![[-0.4f32, -0.6, 0.4, 0.6, 254.4, 255.4, 255.6, 1e9]];
    let clipped = noise(r#"{"bits": 8}"#).record(&mut image, None, 0, 0);
    assert_eq!(image, ndarray::array![[0.0, 0.0, 0.0, 1.0, 254.0, 255.0, 255.0, 255.0]]);
    assert!(image.iter().all(|v| v.is_sign_positive()));
    assert_eq!(clipped, Recorded { clipped: 2, below_zero: 1, ..Recorded::default() });
    for (bits, full) in [(1, 1.0), (12, 4095.0), (16, 65535.0)] {
        assert_eq!(recorded(&format!(r#"{{"bits": {bits}}}"#), flat(1e6), 0).0, flat(full));
    }
    let (image, cut) = recorded(r#"{"bits": 12, "read_noise_electrons": 100, "dark_counts": 50}"#, flat(0.0), 0);
    assert!(image.iter().all(|v| (0.0..=4095.0).contains(v) && v.fract() == 0.0));
    // Counts below -0.5 lie more than 0.505 standard deviations under the mean.
    let n = image.len() as f64;
    near(cut.below_zero as f64, 0.3068 * n, (0.3068 * 0.6932 * n).sqrt());
}

#[test]
fn dead_and_hot_pixels_stay_where_they_are() {
    let json = r#"{"photon_noise": true, "read_noise_electrons": 3, "dark_counts": 100, "bits": 12,
        "dead_share": 0.02, "hot_share": 0.01}"#;
    let places = |image: &Array2<f32>, value: f32| -> Vec<usize> {
        image.iter().enumerate().filter(|(_, v)| **v == value).map(|(n, _)| n).collect()
    };
    let (first, count) = recorded(json, flat(1000.0), 0);
    let (dead, hot) = (places(&first, 100.0), places(&first, 4095.0));
    let n = first.len() as f64;
    near(dead.len() as f64, 0.02 * n, (0.02 * n).sqrt());
    near(hot.len() as f64, 0.01 * n, (0.01 * n).sqrt());
    assert_eq!(count, Recorded { dead: dead.len() as u64, hot: hot.len() as u64, ..Recorded::default() });
    for (frame, level) in [(1, 1000.0), (5, 2500.0)] {
        let (image, again) = recorded(json, flat(level), frame);
        assert_ne!(image, first);
        assert_eq!((places(&image, 100.0), places(&image, 4095.0)), (dead.clone(), hot.clone()));
        assert_eq!(again, count);
    }
    let mut other = flat(1000.0);
    noise(json).record(&mut other, None, 8, 0);
    assert_ne!(places(&other, 100.0), dead);
    // They lie at random: only as many rows have none as chance leaves.
    let rows: std::collections::BTreeSet<usize> = dead.iter().map(|place| place / SHAPE.1).collect();
    assert!(rows.len() > 395, "{}", rows.len());
    let columns: std::collections::BTreeSet<usize> = dead.iter().map(|place| place % SHAPE.1).collect();
    assert!(columns.len() > 490, "{}", columns.len());
}

#[test]
fn a_hot_pixel_reads_as_its_keys_say() {
    for (keys, value) in [
        (r#""bits": 10"#, 1023.0),
        (r#""full_well_electrons": 500, "gain_counts_per_electron": 0.5, "dark_counts": 7"#, 257.0),
        (r#""full_well_electrons": 500, "bits": 8"#, 255.0),
        (r#""full_well_electrons": 500, "bits": 12"#, 500.0),
        (r#""hot_counts": 77.5"#, 77.5),
        (r#""hot_counts": 77, "bits": 4"#, 15.0),
    ] {
        let (image, count) = recorded(&format!(r#"{{"hot_share": 1, {keys}}}"#), flat(3.0), 0);
        assert_eq!(image, flat(value), "{keys}");
        assert_eq!((count.hot, count.clipped), (image.len() as u64, 0));
    }
    assert_eq!(recorded(r#"{"dead_share": 1, "photon_noise": true}"#, flat(3.0), 0).0, flat(0.0));
}

#[test]
fn the_background_is_light_with_its_own_noise() {
    let noise = noise(r#"{"photon_noise": true, "gain_counts_per_electron": 2}"#);
    let mut image = flat(300.0);
    noise.record(&mut image, Some(&flat(500.0)), 7, 0);
    let n = image.len() as f64;
    let [mean, variance, _] = moments(&image);
    near(mean, 800.0, (1600.0 / n).sqrt());
    near(variance, 1600.0, 1600.0 * (2.0 / n).sqrt());
    let mut alone = flat(300.0);
    SensorNoise::default().record(&mut alone, Some(&flat(500.0)), 7, 0);
    assert_eq!(alone, flat(800.0));
}

#[test]
fn without_a_key_no_bit_changes() {
    let odd = ndarray::array![[0.1f32, -0.0, 1e-40, f32::from_bits(0x7fa0_0001)], [-7.5, f32::INFINITY, 3e38, 0.5]];
    let mut image = odd.clone();
    assert_eq!(noise("{}").record(&mut image, None, 1, 2), Recorded::default());
    assert_eq!(bits_of(&image), bits_of(&odd));
    // Keys that ask for nothing change nothing either.
    let ramp = Array2::from_shape_fn(SHAPE, |(y, x)| (y * 500 + x) as f32 * 0.37);
    for json in [r#"{"gain_counts_per_electron": 0.3}"#, r#"{"dead_share": 0, "hot_share": 0, "photon_noise": false}"#]
    {
        assert_eq!(recorded(json, ramp.clone(), 0).0, ramp);
    }
    assert_eq!(serde_json::to_string(&SensorNoise::default()).unwrap(), "{}");
}

#[test]
fn any_number_of_threads_and_any_layout_give_the_same_bytes() {
    let json = r#"{"photon_noise": true, "read_noise_electrons": 3, "full_well_electrons": 60, "bits": 6,
        "dead_share": 0.1, "hot_share": 0.1}"#;
    let ramp = || Array2::from_shape_fn((37, 41), |(y, x)| (y + x) as f32);
    let turned = || ramp().t().as_standard_layout().into_owned().reversed_axes();
    let run = |threads, image: Array2<f32>| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (image, count) = pool.install(|| recorded(json, image, 3));
        (bits_of(&image), count)
    };
    let alone = run(1, ramp());
    for other in [run(2, ramp()), run(5, ramp()), run(4, turned())] {
        assert!(other == alone);
    }
    let none = noise(json).record(&mut Array2::zeros((0, 4)), None, 1, 1);
    assert_eq!(none, Recorded::default());
}

#[test]
fn a_wrong_key_is_named() {
    let refused = |json: &str| serde_json::from_str::<SensorNoise>(json).unwrap().check().unwrap_err().found;
    for (json, found) in [
        (r#"{"gain_counts_per_electron": 0}"#, "sensor_noise.gain_counts_per_electron is 0, not a positive number"),
        (r#"{"full_well_electrons": -1}"#, "sensor_noise.full_well_electrons is -1, not a positive number"),
        (r#"{"read_noise_electrons": -1}"#, "sensor_noise.read_noise_electrons is -1, not a number of 0 or more"),
        (r#"{"dark_counts": 1e300}"#, "sensor_noise.dark_counts is 1000"),
        (r#"{"hot_counts": -2}"#, "sensor_noise.hot_counts is -2"),
        (r#"{"bits": 0}"#, "sensor_noise.bits is 0, outside 1 to 16"),
        (r#"{"bits": 17}"#, "sensor_noise.bits is 17, outside 1 to 16"),
        (r#"{"dead_share": 1.5}"#, "sensor_noise.dead_share is 1.5, outside 0 to 1"),
        (r#"{"hot_share": -0.5, "bits": 8}"#, "sensor_noise.hot_share is -0.5, outside 0 to 1"),
        (r#"{"dead_share": 0.6, "hot_share": 0.6, "bits": 8}"#, "dead_share and sensor_noise.hot_share sum to 1.2"),
        (r#"{"hot_share": 0.1}"#, "sensor_noise.hot_share has no 'hot_counts'"),
    ] {
        assert!(refused(json).contains(found), "{}", refused(json));
    }
    assert!(serde_json::from_str::<SensorNoise>(r#"{"gain": 1}"#).is_err());
    let nan = SensorNoise { read_noise_electrons: Some(f64::NAN), ..SensorNoise::default() };
    assert!(nan.check().unwrap_err().found.contains("read_noise_electrons is NaN"));
}
