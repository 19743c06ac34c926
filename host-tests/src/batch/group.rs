//! Sixteen runs side by side, and a run alone.
//!
//! Not here: which runs there are, and what is made of their outcome.
//!
//! Winders that glide, see [`glide`](model_core::plant::glide), are moved together: those with a whole web in one pack
//! of lanes, those whose web has broken in another. Where a lane comes to a limit of its own, its winder takes the
//! sums from before the step and does this step by itself, as it does all steps with a brake in them, until it glides
//! again. So every winder computes in every step what it would compute alone, and all bits are the same.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use anyhow::{Result, bail};
use model_core::exchange::{Actuators, Brakes, BySection};
use model_core::machine::{Machine, MachineError};
use model_core::plant::motion::{Load, Motion};
use model_core::plant::rk4::State;
use model_core::plant::span::Web;
use model_core::plant::windup::Whole;
use model_core::plant::{Limits, Winder};
use model_core::real::{Compensated, Real, Ring, Scalar};

use super::lanes::{self, AllExtremes, LANES, Lanes, Set, SideBySide, Sums};
use crate::plant::{self, H, Row, Schedule};

/// Steps after which a run looks up: to tell how far it is, and whether it is still wanted.
const SLICE: u64 = 1 << 14;

/// How far all runs are, and whether they are still wanted.
#[derive(Debug, Default)]
pub struct Progress {
    /// Steps done, of all winders.
    pub steps: AtomicU64,
    /// Nobody waits for the outcome any more.
    pub stop: AtomicBool,
}

impl Progress {
    fn add(&self, steps: u64) -> Result<()> {
        self.steps.fetch_add(steps, Ordering::Relaxed);
        if self.stop.load(Ordering::Relaxed) {
            bail!("stopped");
        }
        Ok(())
    }
}

/// Largest and smallest tension in any span of the whole web, and the step after which it was the largest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extremes<R> {
    /// The largest, N.
    pub largest: R,
    /// After which step.
    pub at: u32,
    /// The smallest, N.
    pub smallest: R,
}

impl<R: Real> Extremes<R> {
    /// Sees the tensions after a step.
    fn see(&mut self, tension: &[R], step: u32) {
        for t in tension {
            if *t > self.largest {
                (self.largest, self.at) = (*t, step);
            }
            self.smallest = self.smallest.min(*t);
        }
    }
}

/// A run: its winder, and what has come of it so far.
#[derive(Clone, Debug)]
pub struct Run<R: Scalar, const SPANS: usize> {
    /// The winder as it stands.
    pub winder: Winder<R, SPANS>,
    /// Of the tension.
    pub extremes: Extremes<R::Si>,
    /// The step in which the web broke, …
    pub web_break: Option<u32>,
    /// … a roll of the windup first lost traction, …
    pub slip: Option<u32>,
    /// … the shipping roll burst.
    pub burst: Option<u32>,
}

impl<R: Scalar, const SPANS: usize> Run<R, SPANS> {
    /// At its start.
    pub fn new(machine: &Machine) -> Result<Self, MachineError> {
        let winder = plant::at_start::<R, SPANS>(machine)?;
        let tension = winder.tension();
        let mut extremes = Extremes {
            largest: tension[0],
            at: 0,
            smallest: tension[0],
        };
        extremes.see(&tension, 0);
        Ok(Self {
            winder,
            extremes,
            web_break: None,
            slip: None,
            burst: None,
        })
    }

    /// One step, by itself.
    fn step(&mut self, actuators: &Actuators<R::Si>, step: u32) {
        self.winder.step(actuators);
        if self.winder.threaded() {
            self.extremes.see(&self.winder.tension(), step);
        } else {
            self.web_break.get_or_insert(step);
        }
        let winding = self.winder.winding();
        if winding.slides.contains(&true) {
            self.slip.get_or_insert(step);
        }
        if winding.burst {
            self.burst.get_or_insert(step);
        }
    }
}

/// What acts on a winder by a row of the schedule.
fn actuators<R: Real>(row: &Row) -> Actuators<R> {
    Actuators {
        torque: row.torque.map(R::of),
        brakes: row.brakes,
        ..Actuators::default()
    }
}

/// The rows of a schedule and the steps in which each holds, counted from 1, in slices.
fn slices(schedule: &Schedule) -> impl Iterator<Item = (&Row, std::ops::Range<u32>)> {
    schedule.rows().flat_map(|(row, steps)| {
        let starts = steps.clone().step_by(SLICE as usize);
        starts.map(move |start| {
            let end = (start + SLICE).min(steps.end);
            // a schedule of the longest permitted time has 2.5e8 steps
            (row, start as u32 + 1..end as u32 + 1)
        })
    })
}

/// A run by itself.
pub fn alone<R: Scalar, const SPANS: usize>(
    machine: &Machine,
    schedule: &Schedule,
    progress: &Progress,
) -> Result<Run<R, SPANS>> {
    let mut run = Run::new(machine)?;
    go_alone(&mut run, schedule, progress)?;
    Ok(run)
}

fn go_alone<R: Scalar, const SPANS: usize>(
    run: &mut Run<R, SPANS>,
    schedule: &Schedule,
    progress: &Progress,
) -> Result<()> {
    for (row, steps) in slices(schedule) {
        let actuators = actuators(row);
        progress.add(steps.len() as u64)?;
        for step in steps {
            run.step(&actuators, step);
        }
    }
    Ok(())
}

/// A run of each machine, side by side those that can be: which ever glide, in steps of integration of one length.
pub fn side_by_side<const SPANS: usize>(
    machines: &[Machine],
    schedule: &Schedule,
    progress: &Progress,
) -> Result<Vec<Run<f32, SPANS>>> {
    let mut runs = Vec::with_capacity(machines.len());
    for machine in machines {
        runs.push(Run::new(machine)?);
    }
    let mut gliding: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, run) in runs.iter_mut().enumerate() {
        if run.winder.glides(&Actuators::default()) {
            gliding.entry(run.winder.substeps()).or_default().push(i);
        } else {
            go_alone(run, schedule, progress)?;
        }
    }
    for members in gliding.values().flat_map(|all| all.chunks(LANES)) {
        let of = |i: &usize| (&machines[*i], runs[*i].clone());
        let mut group = Group::new(members.iter().map(of));
        group.go(schedule, progress)?;
        for (i, run) in members.iter().zip(group.runs) {
            runs[*i] = run;
        }
    }
    Ok(runs)
}

/// Up to sixteen runs side by side.
struct Group<const SPANS: usize> {
    runs: Vec<Run<f32, SPANS>>,
    motion: Motion<Lanes, SPANS>,
    limits: Limits<Lanes>,
    substeps: u32,
    /// Winders that glide with a whole web, …
    whole: Pack<SPANS>,
    /// … with a broken one, …
    broken: Pack<SPANS>,
    /// … and those that go by themselves.
    alone: Set,
    /// Their tensions, of the lanes of `whole`.
    extremes: AllExtremes,
}

/// Winders that glide together. The numbers of the other lanes mean nothing.
#[derive(Clone, Copy)]
struct Pack<const SPANS: usize> {
    lanes: Set,
    sums: Sums<SPANS>,
    web: Web<Lanes, SPANS>,
    load: Load<'static, Lanes, Whole<Lanes>, SPANS>,
}

impl<const SPANS: usize> Group<SPANS> {
    /// Of runs that have not begun, at least one, all with as many steps of integration.
    fn new<'a>(of: impl Iterator<Item = (&'a Machine, Run<f32, SPANS>)>) -> Self {
        let (machines, runs): (Vec<_>, Vec<_>) = of.unzip();
        let mut alone = Set::NONE;
        (0..runs.len()).for_each(|lane| alone.insert(lane));
        // a lane without a run does what the first one does
        let machines = SideBySide(std::array::from_fn(|lane| {
            *machines.get(lane).unwrap_or(&machines[0])
        }));
        let substeps = runs[0].winder.substeps();
        let sums = runs[0].winder.sums().map(|sum| Compensated {
            value: Lanes::all(sum.value),
            carry: Lanes::all(sum.carry),
        });
        let pack = |threaded| Pack {
            lanes: Set::NONE,
            sums,
            web: Web::none(),
            load: Load {
                uw: Lanes::ZERO,
                windup: Whole(Lanes::ZERO),
                layer: if threaded { Lanes::ONE } else { Lanes::ZERO },
                threaded,
                offsets: None,
            },
        };
        Self {
            motion: Motion::new(&machines, H / f64::from(substeps)),
            limits: Limits::new(&machines),
            substeps,
            runs,
            whole: pack(true),
            broken: pack(false),
            alone,
            extremes: AllExtremes::none(),
        }
    }

    fn go(&mut self, schedule: &Schedule, progress: &Progress) -> Result<()> {
        for (row, steps) in slices(schedule) {
            progress.add((steps.len() * self.runs.len()) as u64)?;
            let actuators = actuators(row);
            self.begin(&actuators);
            for step in steps {
                self.glide_whole(step);
                self.glide_broken();
                self.step_alone(&actuators, step);
            }
        }
        self.part();
        Ok(())
    }

    /// Under new torques and brakes: who goes alone, and what drives those that glide.
    fn begin(&mut self, actuators: &Actuators<f32>) {
        if actuators.brakes != Brakes::default() {
            self.part();
        }
        let BySection { uw, rd, fd, rr } = actuators.torque.map(Lanes::all);
        let windup = Whole(self.motion.windup.pull([rd, fd, rr]));
        for pack in [&mut self.whole, &mut self.broken] {
            (pack.load.uw, pack.load.windup) = (uw, windup);
        }
        for lane in self.alone.iter() {
            self.join_if_gliding(lane, actuators);
        }
    }

    /// A step of those that have a whole web.
    #[inline(always)]
    fn glide_whole(&mut self, step: u32) {
        if self.whole.lanes.is_empty() {
            return;
        }
        let (mut sums, mut web) = (self.whole.sums, self.whole.web);
        let mut reached = Set::NONE;
        for _ in 0..self.substeps {
            self.motion.advance(&mut sums, &web, &self.whole.load);
            let x = sums.map(|sum| sum.value);
            web = self.motion.web(&x, None);
            reached = reached.or(lanes::at_limit(&self.limits, &x, Some(&web)));
        }
        for lane in reached.and(self.whole.lanes).iter() {
            self.release(lane);
        }
        (self.whole.sums, self.whole.web) = (sums, web);
        self.extremes.see(&web.tension, step);
    }

    /// A step of those that have none.
    #[inline(always)]
    fn glide_broken(&mut self) {
        if self.broken.lanes.is_empty() {
            return;
        }
        let mut sums = self.broken.sums;
        let mut reached = Set::NONE;
        for _ in 0..self.substeps {
            self.motion
                .advance(&mut sums, &self.broken.web, &self.broken.load);
            let x = sums.map(|sum| sum.value);
            reached = reached.or(lanes::at_limit(&self.limits, &x, None));
        }
        for lane in reached.and(self.broken.lanes).iter() {
            self.release(lane);
        }
        self.broken.sums = sums;
    }

    /// A step of the others.
    #[inline(always)]
    fn step_alone(&mut self, actuators: &Actuators<f32>, step: u32) {
        if self.alone.is_empty() {
            return;
        }
        for lane in self.alone.iter() {
            self.runs[lane].step(actuators, step);
            self.join_if_gliding(lane, actuators);
        }
    }

    /// A winder that goes alone joins the others once it glides.
    fn join_if_gliding(&mut self, lane: usize, actuators: &Actuators<f32>) {
        let run = &self.runs[lane];
        if !run.winder.glides(actuators) {
            return;
        }
        self.alone.remove(lane);
        if run.winder.threaded() {
            self.extremes.put(lane, &run.extremes);
            self.whole.take(lane, run.winder.sums());
            self.whole.web = self.motion.web(&self.whole.sums.map(|sum| sum.value), None);
        } else {
            self.broken.take(lane, run.winder.sums());
        }
    }

    /// A winder that has glided goes on alone.
    fn release(&mut self, lane: usize) {
        let run = &mut self.runs[lane];
        let pack = if run.winder.threaded() {
            run.extremes = self.extremes.lane(lane);
            &mut self.whole
        } else {
            &mut self.broken
        };
        pack.lanes.remove(lane);
        run.winder.resume(&lanes::sums_of(&pack.sums, lane));
        self.alone.insert(lane);
    }

    /// All go alone.
    fn part(&mut self) {
        for lane in self.whole.lanes.or(self.broken.lanes).iter() {
            self.release(lane);
        }
    }
}

impl<const SPANS: usize> Pack<SPANS> {
    fn take(&mut self, lane: usize, sums: &State<Compensated<f32>, SPANS, 0>) {
        lanes::put_sums(&mut self.sums, lane, sums);
        self.lanes.insert(lane);
    }
}
