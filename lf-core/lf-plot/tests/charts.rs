//! Properties of all charts. The pictures stay in the build folder, to be looked at.

use lf_core::VectorGrid;
use lf_plot::{Arrows, Axis, Chart, Mark, Panel, Place, Slice, draw, save};
use std::path::Path;

/// The texts of an SVG. Fails if a tag is not closed.
fn texts(svg: &str) -> Vec<String> {
    let mut open = Vec::new();
    let mut texts = Vec::new();
    let mut rest = svg;
    while let Some(start) = rest.find('<') {
        let end = start + rest[start..].find('>').expect("a tag that ends");
        let (content, tag) = (rest[..start].trim(), &rest[start + 1..end]);
        if matches!(open.last(), Some(&"text" | &"title")) && !content.is_empty() {
            let plain = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&amp;", "&")];
            texts.push(plain.iter().fold(content.to_owned(), |text, (code, letter)| text.replace(code, letter)));
        } else {
            assert_eq!(content, "", "text outside a text");
        }
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(tag.split(' ').next().unwrap());
        }
        rest = &rest[end + 1..];
    }
    assert!(open.is_empty() && rest.trim().is_empty());
    texts
}

/// Draws a chart, checks the properties of all charts, and keeps the picture.
fn drawn(name: &str, chart: &Chart) -> String {
    let drawing = draw(chart).unwrap();
    let svg = drawing.svg();
    assert_eq!(svg, draw(chart).unwrap().svg(), "{name} is drawn twice");
    assert!(svg.len() < 1_000_000, "{name} takes {} bytes", svg.len());
    assert!(!svg.contains("NaN") && !svg.contains("inf") && !svg.contains("-2147483648"), "{name}");
    let found = texts(&svg).join(" ");
    for panel in &chart.panels {
        for part in [&chart.title, &panel.title, &panel.x.name, &panel.y.name] {
            assert!(found.contains(part.as_str()), "{name} lacks {part}");
        }
    }
    for end in ["svg", "png", "pdf"] {
        save(&Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.{end}")), &drawing).unwrap();
    }
    svg
}

fn chart(title: &str, columns: usize, panels: Vec<Panel>) -> Chart {
    Chart { title: title.into(), notes: Vec::new(), columns, panels }
}

fn panel(x: Axis, y: Axis, marks: Vec<Mark>) -> Panel {
    Panel { marks, ..Panel::new("", x, y) }
}

fn curve(count: usize, of: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
    (0..count).map(|n| n as f64 / (count - 1) as f64).map(|x| [x, of(x)]).collect()
}

/// Lines of the data, two px wide.
fn strokes(svg: &str) -> usize {
    svg.matches("<polyline").count()
        - svg.lines().filter(|line| line.starts_with("<polyline") && line.contains("stroke-width=\"1\"")).count()
}

#[test]
fn a_line_is_one_path_with_its_name_in_the_key() {
    let marks = vec![Mark::line("first & <last>", curve(50, |x| x * x))];
    let svg = drawn("line", &chart("One line", 1, vec![panel(Axis::new("x, mm"), Axis::new("y, px"), marks)]));
    // The line, and its sample in the key.
    assert_eq!(strokes(&svg), 2);
    let found = texts(&svg);
    for text in ["One line", "x, mm", "y, px", "first & <last>", "0.4", "1"] {
        assert!(found.iter().any(|known| known == text), "{text} in {found:?}");
    }
}

#[test]
fn a_gap_parts_a_line_and_a_point_without_a_place_is_left_out() {
    let mut points = curve(9, |x| 1.0 + x);
    points[4][1] = f64::NAN;
    points.push([2.0, f64::INFINITY]);
    let marks = vec![Mark::line("", points)];
    let svg = drawn("gap", &chart("Gap", 1, vec![panel(Axis::new("x"), Axis::new("y"), marks)]));
    assert_eq!(strokes(&svg), 2);
}

#[test]
fn an_empty_panel_says_so() {
    let nothing = panel(Axis::new("x"), Axis::log("y"), vec![Mark::line("none", vec![[1.0, -1.0], [f64::NAN, 2.0]])]);
    let svg = drawn("empty", &chart("Nothing", 2, vec![nothing, panel(Axis::new("x"), Axis::new("y"), Vec::new())]));
    assert_eq!(texts(&svg).iter().filter(|text| *text == "no data").count(), 2);
    assert!(texts(&svg).iter().any(|text| text.starts_with("1 point at or below 0")));
    drawn("blank", &chart("No panels", 3, Vec::new()));
}

fn lines_and_references() -> Panel {
    let line = |name: &str, scale: f64| {
        Mark::line(name, [1.0, 3.0, 10.0, 30.0, 100.0].map(|x| [x, scale / f64::sqrt(x)]).to_vec())
    };
    let mut lines = panel(
        Axis::log("iterations"),
        Axis::log("rms_w_px, px"),
        vec![
            Mark::Region { name: "published".into(), x: [5.0, 20.0] },
            line("relaxation = 0.5", 1.0),
            line("relaxation = 1", 0.4),
            Mark::reference("slope -1/2", Place::Curve(vec![[1.0, 0.6], [100.0, 0.06]])),
            Mark::reference("noise floor", Place::Horizontal(0.05)),
        ],
    );
    lines.title = "Lines and references".into();
    lines
}

fn histogram() -> Panel {
    let bell = |middle: f64| {
        (0..40).map(|n| (-0.5 * ((n as f64 / 4.0 - 5.0 - middle) / 1.3).powi(2)).exp()).collect::<Vec<f64>>()
    };
    let edges: Vec<f64> = (0..=40).map(|n| n as f64 / 4.0 - 5.0).collect();
    let steps = |name: &str, middle: f64| Mark::Steps { name: name.into(), edges: edges.clone(), values: bell(middle) };
    panel(
        Axis::new("displacement, px"),
        Axis::new("share of vectors, 1/px"),
        vec![steps("u", 0.0), steps("v", 1.0), steps("w", -1.5), Mark::reference("true mean", Place::Vertical(0.0))],
    )
}

fn map_to_scale() -> Panel {
    let values = (0..60 * 30).map(|n| (n % 60) as f64 * (n / 60) as f64).map(|v| if v == 0.0 { f64::NAN } else { v });
    let mut map = panel(
        Axis::new("x, mm"),
        Axis::new("z, mm"),
        vec![Mark::Map {
            values: values.collect(),
            cells: [60, 30],
            x: [-3.0, 3.0],
            y: [-1.5, 1.5],
            scale: Axis::log("light, counts"),
        }],
    );
    map.is_to_scale = true;
    map
}

fn waves() -> Panel {
    let dashed = Mark::dashed("theory", curve(200, |x| (20.0 * x).sin()));
    panel(
        Axis::new("time, s").over([0.2, 0.9]),
        Axis::new("a rather long name of a quantity that has to be broken into lines, mm/s"),
        vec![dashed, Mark::line("measured", curve(200, |x| 0.9 * (20.0 * x).sin()))],
    )
}

fn many_lines() -> Panel {
    let many = (0..9).map(|n| {
        let name = format!("a long name of setting number {n} with all its words");
        Mark::line(name, curve(30, |x| f64::from(n) + x))
    });
    panel(Axis::new("x"), Axis::new("y"), many.collect())
}

#[test]
fn five_panels_with_everything_that_can_be_drawn() {
    let panels = vec![lines_and_references(), histogram(), map_to_scale(), waves(), many_lines()];
    let mut chart = chart("Five panels", 3, panels);
    chart.notes = vec!["mean of three runs".into()];
    let svg = drawn("five", &chart);
    let found = texts(&svg).join(" ");
    for name in ["relaxation = 0.5", "slope -1/2", "noise floor", "published", "true mean", "theory"] {
        assert!(found.contains(name), "{name}");
    }
    assert!(found.contains("a long name of setting number 8 with all its words"));
    assert!(found.contains("no data"), "a map's cells without values are in the key");
    let first = Chart { panels: vec![chart.panels[0].clone()], columns: 1, ..chart.clone() };
    drawn("single", &first);
    let two = Chart { panels: vec![chart.panels[1].clone(), chart.panels[2].clone()], columns: 2, ..chart.clone() };
    drawn("two", &two);
}

#[test]
fn a_noisy_map_stays_small_and_says_that_it_is_coarser() {
    let values = (0..900 * 900u64).map(|n| (n.wrapping_mul(6364136223846793005) >> 33) as f64);
    let map = Mark::Map {
        values: values.collect(),
        cells: [900, 900],
        x: [0.0, 900.0],
        y: [900.0, 0.0],
        scale: Axis::new("noise"),
    };
    let mut shown = panel(Axis::new("x, px"), Axis::new("y, px").over([900.0, 0.0]), vec![map]);
    shown.is_to_scale = true;
    let svg = drawn("noise", &chart("Noise", 1, vec![shown]));
    assert!(texts(&svg).iter().any(|text| text.contains("is the mean of up to")));
}

#[test]
fn marks_that_do_not_fit_together_are_refused() {
    let refused = |x: Axis, mark: Mark| draw(&chart("", 1, vec![panel(x, Axis::new("y"), vec![mark])])).unwrap_err();
    let steps = Mark::Steps { name: "bins".into(), edges: vec![0.0, 1.0], values: vec![1.0, 2.0] };
    assert_eq!(refused(Axis::new("x"), steps).to_string(), "'bins' has 2 edges; wanted 3");
    let line = Mark::line("", Vec::new());
    let refusal = refused(Axis::log("time, s").over([0.0, 1.0]), line);
    assert!(refusal.found.contains("time, s") && refusal.wanted.contains("above 0"), "{refusal}");
}

#[test]
fn a_flat_layer_of_vectors_is_stretched_and_its_arrows_keep_their_direction() {
    let grid = VectorGrid {
        shape: [40, 2, 3],
        spacing_mm: [0.5; 3],
        origin_mm: [0.0; 3],
        voxel_mm: [0.0; 3],
        window: [0; 3],
        overlap: 0.0,
        dt_s: None,
        history: Vec::new(),
    };
    let slice = Slice { grid: &grid, through: 1, layer: 1 };
    assert_eq!((slice.shape(), slice.across(), slice.place_mm()), ([40, 3], [0, 2], 0.5));
    assert_eq!(slice.nodes().take(2).collect::<Vec<_>>(), [40, 41]);
    // Three rows of 0.5 mm are drawn 20 / (6 x 1.5) times longer: as far apart as every third column, or more.
    assert_eq!([slice.arrow_stride(47), slice.arrow_stride(20)], [[1, 1], [2, 1]]);
    let mut panel = slice.panel("", Axis::symmetric("v, mm", 2.0), vec![1.0; 120]);
    let arrows = slice.arrows(20, |node| if node == 40 { [50.0, 0.0] } else { [1.0, 1.0] });
    assert_eq!((arrows.usual, arrows.spacing), (2f64.sqrt(), [1.0, 0.5]));
    panel.marks.push(Mark::Arrows(Arrows { unit: "mm".into(), ..arrows }));
    let svg = drawn("layer", &chart("Layer", 1, vec![panel]));
    let found = texts(&svg);
    for text in ["z stretched 2.22 times", "one arrow cut short", "2 mm"] {
        assert!(found.iter().any(|known| known == text), "{text} in {found:?}");
    }
    // The shafts run to the right and up at 45 degrees, up to rounding.
    let slanted = shafts(&svg).into_iter().filter(|[x, y, u, v]| (u - x - (y - v)).abs() < 2);
    assert_eq!(slanted.count(), 59);
}

/// The shafts of the arrows in a picture: from (x, y) to (u, v), px from the upper left corner.
fn shafts(svg: &str) -> Vec<[i32; 4]> {
    let shaft = |line: &str| {
        let (_, points) = line.strip_prefix("<polyline")?.split_once("points=\"")?;
        let (points, _) = points.split_once('"')?;
        let places: Vec<i32> = points.split([' ', ',']).flat_map(str::parse).collect();
        places.try_into().ok().filter(|[x, _, u, _]: &[i32; 4]| u - x > 8)
    };
    svg.lines().filter_map(shaft).collect()
}

/// A layer across z looks as the camera sees it: x to the right, y up.
#[test]
fn y_runs_up_in_a_layer_across_z() {
    let grid = VectorGrid {
        shape: [3, 3, 1],
        spacing_mm: [0.5; 3],
        origin_mm: [-0.5, -0.5, 0.0],
        voxel_mm: [0.0; 3],
        window: [0; 3],
        overlap: 0.0,
        dt_s: None,
        history: Vec::new(),
    };
    let slice = Slice { grid: &grid, through: 2, layer: 0 };
    let mut panel = slice.panel("", Axis::symmetric("w, mm", 2.0), vec![1.0; 9]);
    // The vectors at the largest y point to the right and up, those at the smallest y to the right and down.
    let vector = |node: usize| [[1.0, -1.0], [f64::NAN; 2], [1.0, 1.0]][node / 3];
    panel.marks.push(Mark::Arrows(Arrows { unit: "mm".into(), ..slice.arrows(20, vector) }));
    let shafts = shafts(&drawn("upright", &chart("Layer", 1, vec![panel])));
    let [up, down] =
        [-1, 1].map(|way| shafts.iter().filter(|[_, y, _, v]| (v - y).signum() == way).collect::<Vec<_>>());
    assert_eq!([up.len(), down.len()], [3, 3], "{shafts:?}");
    assert!(up.iter().all(|above| down.iter().all(|below| above[1] < below[3])), "{shafts:?}");
}
