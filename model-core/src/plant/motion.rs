//! How the winder moves over a step: web, rolls and windup together, under loads that are held.
//!
//! Not here: what decides on those loads (brakes, nips, people), and what ends a step. All that is evaluated several
//! times a step is here, and nothing else; it never asks in what state the winder is, so that several winders can
//! go through it side by side.

use super::eccentricity::Offsets;
use super::rk4::{self, State};
use super::roll::{Idle, Unwind};
use super::span::{Spans, Web};
use super::units::Units;
use super::windup::{self, Windup};
use crate::machine::Machine;
use crate::real::{Accumulator, Arithmetic, Scalar};

/// The coefficients of all that moves.
#[derive(Clone, Debug)]
pub struct Motion<A: Arithmetic, const SPANS: usize> {
    /// The web.
    pub spans: Spans<A, SPANS>,
    /// The roll at the end of each span but the last, where the windup is.
    idle: [Option<Idle<A>>; SPANS],
    unwind: Unwind<A>,
    windup: Windup<A>,
}

/// What drives the winder, constant over a step.
#[derive(Clone, Copy, Debug)]
pub struct Load<A, W, const SPANS: usize> {
    /// Torque on the parent roll less its brake's, N·m.
    pub uw: A,
    /// On the windup.
    pub windup: W,
    /// Speed of the layer that is wound, of the web's: z_eff/z; zero without web.
    pub layer: A,
    /// There is a web.
    pub threaded: bool,
    /// Where rolls are eccentric.
    pub offsets: Option<Offsets<A, SPANS>>,
}

impl<A: Copy, const SPANS: usize> Load<A, (), SPANS> {
    /// The same with what acts on the windup.
    pub fn on<W>(&self, windup: W) -> Load<A, W, SPANS> {
        Load {
            uw: self.uw,
            windup,
            layer: self.layer,
            threaded: self.threaded,
            offsets: self.offsets,
        }
    }
}

impl<R: Scalar, const SPANS: usize> Motion<R, SPANS> {
    /// From the machine's description, for steps of `h` seconds.
    pub fn new(machine: &Machine, units: &Units, h: f64) -> Self {
        let roll = |i: usize| machine.idle.get(i);
        let web = &machine.web;
        Self {
            spans: Spans::new(
                core::array::from_fn(|i| roll(i).map_or(machine.last_span_m, |r| r.span_m)),
                web.stiffness_n_m * web.width_m,
                web.retardation_s,
                units,
                h,
            ),
            idle: core::array::from_fn(|i| roll(i).map(|roll| Idle::new(roll, units, h))),
            unwind: Unwind::new(machine, units, h),
            windup: Windup::new(machine, units, h),
        }
    }
}

impl<A: Arithmetic, const SPANS: usize> Motion<A, SPANS> {
    /// Strain rates and tensions of the web in a state.
    #[inline(always)]
    pub fn web<const APART: usize>(
        &self,
        x: &State<A, SPANS, APART>,
        offsets: &Option<Offsets<A, SPANS>>,
    ) -> Web<A, SPANS> {
        let v_uw = x.omega_uw * x.r_uw;
        match offsets {
            None => self.spans.web(v_uw, &x.v, &x.strain),
            Some(offsets) => {
                let v = offsets.added_to(&x.v);
                self.spans.web(v_uw + offsets.uw, &v, &x.strain)
            }
        }
    }

    /// Moves everything by a step; `web` belongs to the state at its start.
    #[inline(always)]
    pub fn advance<W: windup::Load<A, APART>, const APART: usize>(
        &self,
        sums: &mut State<A::Sum, SPANS, APART>,
        web: &Web<A, SPANS>,
        load: &Load<A, W, SPANS>,
    ) {
        let k1 = self.rates(&sums.map(|sum| sum.value()), web, load);
        rk4::advance(sums, k1, |x| {
            let web = if load.threaded {
                self.web(x, &load.offsets)
            } else {
                Web::none()
            };
            self.rates(x, &web, load)
        });
    }

    #[inline(always)]
    fn rates<W: windup::Load<A, APART>, const APART: usize>(
        &self,
        x: &State<A, SPANS, APART>,
        web: &Web<A, SPANS>,
        load: &Load<A, W, SPANS>,
    ) -> State<A::Rate, SPANS, APART> {
        let (v_rd, t_sr) = (x.v[SPANS - 1], web.tension[SPANS - 1]);
        let roll = self.windup.shipping_roll(x.r_wu, v_rd * load.layer);
        let windup = &self.windup;
        let (rd, apart) = load.windup.accelerate(windup, v_rd, &x.windup, &roll, t_sr);
        let v_uw = x.omega_uw * x.r_uw;
        State {
            strain: web.strain_rate,
            v: core::array::from_fn(|i| match &self.idle[i] {
                Some(idle) => idle.acceleration(x.v[i], web.tension[i], web.tension[i + 1]),
                None => rd,
            }),
            windup: apart,
            omega_uw: self.unwind.spin(load.uw, web.tension[0], v_uw, x.r_uw),
            r_uw: if load.threaded {
                self.unwind.thin(x.omega_uw)
            } else {
                A::no_rate()
            },
            r_wu: roll.radius_rate,
            travel: windup.way(v_rd),
        }
    }
}
