//! `winder lesson`

use std::io::{self, BufRead, Write};
use std::process::ExitCode;
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use model_core::image;

use crate::interrupt;
use crate::lesson::{Act, Lesson, Play, TICK_S, shipped};
use crate::plc::shown;

/// The state is told so often, s.
const TELL_S: f64 = 5.0;

/// Which lesson.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// The lesson's name; without one, all are listed
    name: Option<String>,
    /// Simulated time over real time
    #[arg(long, default_value_t = 1.0)]
    pace: f64,
    /// Play the solution instead, as fast as the PC can
    #[arg(long)]
    solve: bool,
}

/// Lists the lessons or plays one; exit status 1 if the score is not full.
pub fn main(args: &Args) -> Result<ExitCode> {
    let lessons = shipped()?;
    let Some(name) = &args.name else {
        for lesson in &lessons {
            println!("{:<14}  {}", lesson.name, lesson.title);
        }
        return Ok(ExitCode::SUCCESS);
    };
    ensure!(
        (0.1..=100.0).contains(&args.pace),
        "pace {} is outside 0.1 to 100",
        args.pace
    );
    let lesson = lessons
        .iter()
        .find(|lesson| lesson.name == *name)
        .with_context(|| {
            let names: Vec<_> = lessons.iter().map(|lesson| lesson.name.as_str()).collect();
            format!("there is no lesson {name}: {}", names.join(", "))
        })?;
    let mut play = Play::new(lesson)?;
    if args.solve {
        for act in &lesson.solution {
            play.act(act)?;
        }
    } else {
        by_hand(lesson, &mut play, args.pace)?;
    }
    for (score, earned) in play.scores() {
        let points = if earned { score.points } else { 0 };
        println!("{points:>3} of {:>3}  {}", score.points, score.what);
    }
    println!("{} of 100 points", play.points());
    Ok(if play.points() == 100 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// What is typed is done, while the winder's time goes on.
fn by_hand(lesson: &Lesson, play: &mut Play, pace: f64) -> Result<()> {
    println!(
        "{}\n{}\nType press BUTTON, set NAME VALUE, hint or end.",
        lesson.title, lesson.goal
    );
    let (typed, lines) = mpsc::channel();
    thread::spawn(move || {
        for line in io::stdin().lock().lines().map_while(Result::ok) {
            if typed.send(line).is_err() {
                return;
            }
        }
    });
    let (period, mut hints) = (Duration::from_secs_f64(TICK_S / pace), lesson.hints.iter());
    let mut told = f64::NEG_INFINITY;
    while !play.is_over() {
        interrupt::check()?;
        let began = Instant::now();
        match lines.try_recv() {
            Ok(line) => match line.trim() {
                "" => {}
                "end" => return Ok(()),
                "hint" => println!("{}", hints.next().map_or("no more hints", |hint| hint)),
                line => match Act::read(line) {
                    Ok(act) => play.act(&act)?,
                    Err(error) => println!("{error:#}"),
                },
            },
            Err(mpsc::TryRecvError::Empty) => {}
            Err(mpsc::TryRecvError::Disconnected) => return Ok(()),
        }
        play.tick()?;
        if play.t_s() - told >= TELL_S {
            told = play.t_s();
            tell(play)?;
        }
        thread::sleep(period.saturating_sub(began.elapsed()));
    }
    Ok(())
}

fn tell(play: &Play) -> io::Result<()> {
    let Some(seen) = play.image() else {
        return Ok(());
    };
    let (state, alarms) = shown(&seen.commands);
    let value = |signal| seen.feedback.get::<f64>(signal);
    writeln!(
        io::stdout(),
        "{:>6.0} s  {state}  {:.0} m/min  {:.0} N/m  {:.1} mm  {:.0} m  {}",
        play.t_s(),
        value(&image::V_WEB),
        value(&image::TENSION),
        value(&image::D_WU),
        value(&image::LENGTH_WU),
        alarms.join(" ")
    )
}
