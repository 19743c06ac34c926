//! Packs the page: every file of `src/hmi/www` that a browser asks for, compressed, with its type and its tag; and the
//! lessons, as one more file.
//!
//! Not here: a bundler. The files are served one by one, as they are.

use std::fmt::Write as _;
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use flate2::{Compression, Crc, GzBuilder};

/// Types by extension; a file of another one is not for browsers.
const TYPES: &[(&str, &str)] = &[
    ("css", "text/css; charset=utf-8"),
    ("html", "text/html; charset=utf-8"),
    ("json", "application/json"),
    ("js", "text/javascript; charset=utf-8"),
    ("png", "image/png"),
    ("svg", "image/svg+xml"),
    ("webmanifest", "application/manifest+json"),
];

fn main() -> io::Result<()> {
    let (here, out) = (directory("CARGO_MANIFEST_DIR"), directory("OUT_DIR"));
    let www = here.join("src/hmi/www");
    println!("cargo::rerun-if-changed={}", www.display());
    let mut files = Vec::new();
    if www.is_dir() {
        walk(&www, &mut files)?;
    }
    files.sort();
    let mut contents = Vec::new();
    for file in &files {
        let path = file.strip_prefix(&www).unwrap_or(file);
        // What has to do with the vendored parts' making is for people.
        if path.extension().is_none_or(|extension| extension != "json") {
            contents.push((path.to_owned(), fs::read(file)?));
        }
    }
    let lessons = lessons(&here.join("../host-tests/lessons"))?;
    contents.push(("lessons.json".into(), lessons));

    let mut table = String::from("&[\n");
    for (number, (path, content)) in contents.iter().enumerate() {
        let extension = path.extension().and_then(|e| e.to_str());
        let Some((_, kind)) = TYPES.iter().find(|(e, _)| Some(*e) == extension) else {
            continue;
        };
        let packed = pack(content)?;
        let mut crc = Crc::new();
        crc.update(&packed);
        let stored = out.join(format!("{number}.gz"));
        let path = path.display();
        writeln!(
            table,
            "    Asset {{ path: \"/{path}\", content_type: \"{kind}\", etag: \"\\\"{:08x}\\\"\", gzip: \
             include_bytes!({stored:?}) }},",
            crc.sum()
        )
        .map_err(io::Error::other)?;
        fs::write(stored, packed)?;
    }
    table.push_str("]\n");
    fs::write(out.join("assets.rs"), table)
}

/// The lessons as a list, each with its name. What solves them stays with us.
fn lessons(directory: &Path) -> io::Result<Vec<u8>> {
    println!("cargo::rerun-if-changed={}", directory.display());
    let mut files = Vec::new();
    walk(directory, &mut files)?;
    files.sort();
    let mut list = Vec::new();
    for file in &files {
        let text = fs::read_to_string(file)?;
        let mut lesson: serde_json::Map<String, serde_json::Value> =
            toml::from_str(&text).map_err(io::Error::other)?;
        lesson.remove("solution");
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        lesson.insert("name".into(), name.into());
        list.push(lesson);
    }
    serde_json::to_vec(&list).map_err(io::Error::other)
}

fn directory(variable: &str) -> PathBuf {
    std::env::var_os(variable).expect("cargo sets it").into()
}

fn walk(directory: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        if path.is_dir() {
            walk(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}

/// Without a name or a time, so that the same file gives the same bytes.
fn pack(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = GzBuilder::new().write(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}
