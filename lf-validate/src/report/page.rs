//! The page: its sections in the order of the chain.

use super::fields::FieldSections;
use super::folder::RunFiles;
use super::html::{Section, escape};
use super::source::Source;
use super::{camera, fields, frames, particles, space, stages, verdict, volumes, warnings};
use lf_core::{Camera, Refusal};
use serde_json::Value;

const PAGE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const SCRIPT: &str = concat!(include_str!("page/page.js"), include_str!("page/space.js"));

/// Choices that the names of the files do not show.
#[derive(Debug, Clone, Default)]
pub struct PageOptions {
    /// A raw frame.
    pub frame: Option<String>,
    /// A white image.
    pub white: Option<String>,
    /// Heading of the page.
    pub title: String,
}

/// A page, and what is on it.
pub struct Report {
    /// The text of the file.
    pub html: String,
    /// Sections on the page.
    pub sections: usize,
    /// Warnings on the page: lines of the logs, and files that could not be read.
    pub warnings: usize,
    /// Files that could not be read, and why.
    pub unread: Vec<String>,
}

/// The page of a run. Refuses a folder without any file of one.
pub fn report(source: &dyn Source, options: &PageOptions) -> Result<Report, Refusal> {
    let folder = RunFiles::of(source.names());
    let wanted = "wanted the folder of a run, with fields, volumes, particles or a camera";
    Refusal::unless(folder != RunFiles::default(), || "no file of a run", wanted)?;
    let mut unread = Vec::new();
    let camera = folder.camera.as_deref().and_then(|file| {
        let read = source.text(file).and_then(|text| Camera::from_json(&text).map_err(|refusal| refusal.about(file)));
        read.map_err(|error| unread.push(error.to_string())).ok()
    });
    let FieldSections { view, statistics, mut summary, motion, history } =
        fields::sections(source, &folder.fields, folder.mean.as_deref(), camera.as_ref(), &mut unread);
    let stats = stages::read(source, &folder.stats);
    let stages = stages::section(&stats, &mut unread);
    let images = [("Raw frame", options.frame.as_deref()), ("White image", options.white.as_deref())];
    summary.extend(counts(&folder));
    let mut timing = None;
    if let Some((section, seconds, peak_bytes)) = stages {
        summary.push(("time and memory".into(), format!("{seconds:.1} s in all stages, {:.0} MB", 1e-6 * peak_bytes)));
        timing = Some(section);
    }
    let particles = particles::section(source, &folder.particles, camera.as_ref(), fitted_noise(&stats), &mut unread);
    let sections: Vec<Section> = [
        view,
        space::section(source, &folder, camera.as_ref()),
        statistics,
        particles,
        volumes::reconstruction(source, &folder.volumes, &folder.records, &mut unread),
        volumes::pruning(source, &folder.supports, &mut unread),
        frames::section(source, images, camera.as_ref(), &mut unread),
        camera.as_ref().map(camera::section),
        timing,
        commands(&history),
    ]
    .into_iter()
    .flatten()
    .collect();
    let lines = warnings::lines(source, &folder.logs);
    let mut top = Section::new("summary", "Summary");
    verdict::judge(&mut top, &stats, camera.as_ref(), motion.as_ref());
    top.content += &warnings::list(&lines, &unread, !folder.logs.is_empty());
    if !summary.is_empty() {
        let rows: Vec<_> = summary.into_iter().map(|(label, text)| vec![label, text]).collect();
        top.table(&[], &rows, 2);
    }
    let html = assemble(&options.title, &top.content, &sections);
    Ok(Report { html, sections: sections.len(), warnings: lines.len() + unread.len(), unread })
}

/// Gain and read noise, counts, of the first run of lf-fit.
fn fitted_noise(stats: &[(String, Value)]) -> Option<[f64; 2]> {
    let number = |run: &Value, key: &str| run["counts"][key].as_f64();
    stats.iter().find_map(|(_, run)| Some([number(run, "gain_counts")?, number(run, "read_noise_counts")?]))
}

/// Lines of the summary that follow from the names alone.
fn counts(folder: &RunFiles) -> Vec<(String, String)> {
    let lists = [("volumes", &folder.volumes), ("tables of particles", &folder.particles)];
    let known = lists.into_iter().filter(|(_, files)| !files.is_empty());
    known.map(|(label, files)| (label.to_owned(), files.len().to_string())).collect()
}

fn commands(commands: &[String]) -> Option<Section> {
    let mut section = Section::new("commands", "Commands");
    section.details("The commands that made the last field, oldest first", commands);
    (!commands.is_empty()).then_some(section)
}

fn assemble(title: &str, summary: &str, sections: &[Section]) -> String {
    let links: String =
        sections.iter().map(|part| format!("<li><a href=\"#{}\">{}</a></li>", part.anchor, part.heading)).collect();
    let content: String = sections
        .iter()
        .map(|part| {
            format!("<section id=\"{0}\"><h2>{1}</h2>\n{2}</section>\n", part.anchor, part.heading, part.content)
        })
        .collect();
    let about = format!("Made by lf-validate {} from the files of the run.", env!("CARGO_PKG_VERSION"));
    // The content comes last: it may hold any text, also that of a placeholder.
    PAGE.replace("{{style}}", STYLE)
        .replace("{{script}}", SCRIPT)
        .replace("{{title}}", &escape(title))
        .replace("{{about}}", &about)
        .replace("{{links}}", &links)
        .replace("{{summary}}", summary)
        .replace("{{sections}}", &content)
}
