//! Packs the page: every file of `src/hmi/www` that a browser asks for, compressed, with its type and its tag.
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

    let mut table = String::from("&[\n");
    for (number, file) in files.iter().enumerate() {
        let extension = file.extension().and_then(|e| e.to_str());
        let Some((_, kind)) = TYPES.iter().find(|(e, _)| Some(*e) == extension) else {
            continue;
        };
        let packed = pack(&fs::read(file)?)?;
        let mut crc = Crc::new();
        crc.update(&packed);
        let stored = out.join(format!("{number}.gz"));
        let path = file.strip_prefix(&www).unwrap_or(file).display();
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
