//! `winder figures`

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};

use crate::figures::{self, Named};
use crate::plot;

/// Where the figures go.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Directory for the figures
    #[arg(long, value_name = "DIR", default_value = "out/figures")]
    out: PathBuf,
    /// Leave out the PNGs
    #[arg(long)]
    svg_only: bool,
}

/// Draws all figures.
pub fn main(args: &Args) -> Result<ExitCode> {
    fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot make the directory {}", args.out.display()))?;
    let save = |name: &str, ending: &str, bytes: &[u8]| {
        let path = args.out.join(name).with_extension(ending);
        fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
    };
    let all = figures::all()?;
    for Named { name, figure } in &all {
        let svg = figure.svg();
        save(name, "svg", svg.as_bytes())?;
        if !args.svg_only {
            save(name, "png", &plot::png(&svg)?)?;
        }
        println!("{:<18} {}", name, figure.title);
    }
    println!("{} figures in {}", all.len(), args.out.display());
    Ok(ExitCode::SUCCESS)
}
