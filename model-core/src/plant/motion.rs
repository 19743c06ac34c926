//! How the winder moves over a step: web, rolls and windup together, under loads that are held.
//!
//! Not here: what decides on those loads (brakes, nips, people), and what ends a step. All that is evaluated several
//! times a step is here, and nothing else; it never asks in what state the winder is, so that several winders can
//! go through it side by side.

use super::eccentricity::Offsets;
use super::rk4::{self, State, System};
use super::roll::{Idle, Unwind};
use super::span::{Spans, Web};
use super::units::Machines;
use super::windup::{self, Windup};
use crate::real::{Accumulator, Arithmetic};

/// The coefficients of all that moves.
#[derive(Clone, Debug)]
pub struct Motion<A: Arithmetic, const SPANS: usize> {
    /// The web.
    pub spans: Spans<A, SPANS>,
    /// The roll at the end of each span; at the end of the last is the windup, and none here.
    idle: [Idle<A>; SPANS],
    unwind: Unwind<A>,
    /// The windup.
    pub windup: Windup<A>,
}

/// What drives the winder, constant over a step.
#[derive(Clone, Copy, Debug)]
pub struct Load<'a, A, W, const SPANS: usize> {
    /// Torque on the parent roll less its brake's, N·m.
    pub uw: A,
    /// On the windup.
    pub windup: W,
    /// Speed of the layer that is wound, of the web's: z_eff/z; zero without web.
    pub layer: A,
    /// There is a web.
    pub threaded: bool,
    /// Where rolls are eccentric.
    pub offsets: Option<&'a Offsets<A, SPANS>>,
}

impl<'a, A: Copy, const SPANS: usize> Load<'a, A, (), SPANS> {
    /// The same with what acts on the windup.
    pub fn on<W>(&self, windup: W) -> Load<'a, A, W, SPANS> {
        Load {
            uw: self.uw,
            windup,
            layer: self.layer,
            threaded: self.threaded,
            offsets: self.offsets,
        }
    }
}

impl<A: Arithmetic, const SPANS: usize> Motion<A, SPANS> {
    /// From the description of machines with `SPANS` spans, for steps of `h` seconds.
    pub fn new(machines: &impl Machines<A>, h: f64) -> Self {
        Self {
            spans: Spans::new(machines, h),
            idle: core::array::from_fn(|i| {
                if i + 1 < SPANS {
                    Idle::new(machines, i, h)
                } else {
                    Idle::none(machines)
                }
            }),
            unwind: Unwind::new(machines, h),
            windup: Windup::new(machines, h),
        }
    }

    /// Strain rates and tensions of the web in a state.
    #[inline(always)]
    pub fn web<const APART: usize>(
        &self,
        x: &State<A, SPANS, APART>,
        offsets: Option<&Offsets<A, SPANS>>,
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

    /// Moves everything by a step; `web` belongs to the state at its start. Gives the mean speed of the rear drum.
    #[inline(always)]
    pub fn advance<W: windup::Load<A, APART>, const APART: usize>(
        &self,
        sums: &mut State<A::Sum, SPANS, APART>,
        web: &Web<A, SPANS>,
        load: &Load<A, W, SPANS>,
    ) -> A {
        if load.threaded && load.offsets.is_none() {
            let taut = Load {
                threaded: true,
                offsets: None,
                ..*load
            };
            self.integrate(sums, web, &taut)
        } else {
            self.advance_otherwise(sums, web, load)
        }
    }

    /// The same apart from the usual case, so that it does not stand in its way.
    #[cold]
    #[inline(never)]
    fn advance_otherwise<W: windup::Load<A, APART>, const APART: usize>(
        &self,
        sums: &mut State<A::Sum, SPANS, APART>,
        web: &Web<A, SPANS>,
        load: &Load<A, W, SPANS>,
    ) -> A {
        self.integrate(sums, web, load)
    }

    #[inline(always)]
    fn integrate<W: windup::Load<A, APART>, const APART: usize>(
        &self,
        sums: &mut State<A::Sum, SPANS, APART>,
        web: &Web<A, SPANS>,
        load: &Load<A, W, SPANS>,
    ) -> A {
        let k1 = self.rates(&sums.map(|sum| sum.value()), web, load);
        rk4::advance(sums, k1, &Loaded { motion: self, load })
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
            v: core::array::from_fn(|i| {
                if i + 1 < SPANS {
                    self.idle[i].acceleration(x.v[i], web.tension[i], web.tension[i + 1])
                } else {
                    rd
                }
            }),
            windup: apart,
            omega_uw: self.unwind.spin(load.uw, web.tension[0], v_uw, x.r_uw),
            r_uw: if load.threaded {
                self.unwind.thin(x.omega_uw)
            } else {
                A::no_rate()
            },
            r_wu: roll.radius_rate,
        }
    }
}

/// The winder under loads that are held.
struct Loaded<'a, A: Arithmetic, W, const SPANS: usize> {
    motion: &'a Motion<A, SPANS>,
    load: &'a Load<'a, A, W, SPANS>,
}

impl<A: Arithmetic, W: windup::Load<A, APART>, const SPANS: usize, const APART: usize>
    System<A, SPANS, APART> for Loaded<'_, A, W, SPANS>
{
    #[inline(always)]
    fn rates(&self, x: &State<A, SPANS, APART>) -> State<A::Rate, SPANS, APART> {
        let web = if self.load.threaded {
            self.motion.web(x, self.load.offsets)
        } else {
            Web::none()
        };
        self.motion.rates(x, &web, self.load)
    }
}
