//! Strides of a winder through smooth stretches, for runs on a PC that no PLC takes part in.
//!
//! Not here: step control, and whatever ends a stretch of smooth motion. A stride is taken only while motors are all
//! that acts on the winder, and only if its web stays taut and whole from the first moment to the last; a brake, a nip
//! that may slip, an eccentric roll, a loop of slack, a web about to break: there the winder takes its usual steps, to
//! the bits that it has without strides. Nothing looks at the sensors meanwhile: their filters stand still.

mod row;
mod series;

use model_core::exchange::{Actuators, BySection};
use model_core::machine::Machine;
use model_core::plant::rk4::State;
use model_core::plant::units::{One, Units};
use model_core::plant::{Limits, Winder, modes};
use model_core::real::{Accumulator, Sum};

use series::Series;
pub use series::{Held, ORDER};

/// Longest stride, in steps of the winder.
pub const LONGEST: u64 = 4;
/// Longest stride by the fastest mode of the web, h·|λ|. The series ends there at 1/9! = 3e-6 of the mode's amplitude,
/// as RK4 does at the 0.2 that its steps keep to.
const REACH: f64 = 1.0;

/// The smooth motion of a machine over holds of one length.
#[derive(Clone, Debug)]
pub struct Smooth(Blocks);

/// By the number of rolls.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "there are only a few of them")]
enum Blocks {
    One(Series<1>),
    Two(Series<2>),
    Three(Series<3>),
}

impl Smooth {
    /// Of a valid machine, for holds of `h` seconds. Nothing where a mode of its web is too fast for that.
    pub fn new(machine: &Machine, h: f64) -> Option<Self> {
        if h * modes::fastest(machine) > REACH {
            return None;
        }
        let one = Series::new(machine, h).map(Blocks::One);
        let two = || Series::new(machine, h).map(Blocks::Two);
        let three = || Series::new(machine, h).map(Blocks::Three);
        one.or_else(two).or_else(three).map(Self)
    }

    /// Where a state leads in a hold. Nothing where the web would be slack on the way, or torn.
    #[inline]
    pub fn advance<const SPANS: usize>(
        &self,
        x: &State<f64, SPANS, 0>,
        held: Held,
    ) -> Option<State<f64, SPANS, 0>> {
        match &self.0 {
            Blocks::One(series) => series.advance(x, held),
            Blocks::Two(series) => series.advance(x, held),
            Blocks::Three(series) => series.advance(x, held),
        }
    }
}

/// Takes a winder through smooth stretches in strides of several of its steps.
#[derive(Clone, Debug)]
pub struct Strider {
    /// The motion in strides of one step, two, …; no more than the web's modes allow.
    strides: Vec<Smooth>,
    limits: Limits<f64>,
    /// 1/R of rear drum, front drum, rider roll, 1/m.
    per_radius: [f64; 3],
}

impl Strider {
    /// For winders of a valid machine in steps of `h` seconds.
    pub fn new(machine: &Machine, h: f64) -> Self {
        let of = |steps: u64| Smooth::new(machine, h * steps as f64);
        let rolls = [&machine.rear_drum, &machine.front_drum, &machine.rider_roll];
        Self {
            strides: (1..=LONGEST).map_while(of).collect(),
            limits: Limits::new(&One(machine, &Units::SI)),
            per_radius: rolls.map(|roll| 1.0 / roll.radius_m),
        }
    }

    /// Takes `winder` on under held actuators by at most so many of its steps, and at least one; tells by how many.
    pub fn advance<const SPANS: usize>(
        &self,
        winder: &mut Winder<f64, SPANS>,
        actuators: &Actuators<f64>,
        most: u64,
    ) -> u64 {
        let steps = (self.strides.len() as u64).min(most);
        let stride = steps.checked_sub(1).map(|i| &self.strides[i as usize]);
        if let Some(stride) = stride
            && winder.threaded()
            && winder.glides(actuators)
            && self.stride(stride, winder, &actuators.torque)
        {
            return steps;
        }
        winder.step(actuators);
        1
    }

    /// Strides; or tells that this was not to be, and leaves everything as it was.
    fn stride<const SPANS: usize>(
        &self,
        stride: &Smooth,
        winder: &mut Winder<f64, SPANS>,
        torque: &BySection<f64>,
    ) -> bool {
        let [rd, fd, rr] = self.per_radius;
        let held = Held {
            uw: torque.uw,
            pull: torque.rd * rd + torque.fd * fd + torque.rr * rr,
        };
        let before = winder.sums().map(|sum| Sum::value(&sum));
        let Some(x) = stride.advance(&before, held) else {
            return false;
        };
        let finite = x.iter().sum::<f64>().is_finite();
        let holds =
            finite && x.r_uw > self.limits.expire_radius && x.r_wu >= self.limits.bare_radius;
        if holds {
            winder.resume(&x.map(Accumulator::at));
        }
        holds
    }
}
