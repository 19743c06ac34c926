//! The table of a machine's parameters: names, units, limits, descriptions.
//!
//! Not here: what the parameters do, and limits that take more than a comparison of numbers.
//!
//! Whatever names a parameter walks this table: [`Machine::validate`], machine files, panels. A parameter's name is
//! the path of its field in [`Machine`], so that it ends with the unit; an element of a list has its index from 0:
//! `idle[2].span_m`. A list's length is a parameter, too; it stands before the elements. A limit may depend on
//! parameters that stand further up.

use core::f64::consts::PI;
use core::fmt;
use core::ops::RangeInclusive;

use heapless::Vec;

use super::{MAX_BRAKE_DELAY_S, MAX_FRONT_SHARES, MAX_RIDER_LOADS, MAX_SPANS, Machine};

/// What a parameter can be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A number in the parameter's unit.
    Number(f64),
    /// How many, or which one, from 0.
    Count(usize),
    /// Whether.
    Switch(bool),
}

impl Value {
    /// As a number, to compare it with limits: a switch is 0 or 1.
    pub fn number(self) -> f64 {
        match self {
            Self::Number(number) => number,
            Self::Count(count) => count as f64,
            Self::Switch(on) => f64::from(u8::from(on)),
        }
    }
}

/// With as many digits as it takes to read the same value back.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number:?}"),
            Self::Count(count) => write!(f, "{count}"),
            Self::Switch(on) => write!(f, "{on}"),
        }
    }
}

/// A parameter of a machine.
#[derive(Debug)]
pub struct Parameter {
    /// `part.name_unit`, as `idle[2].span_m`.
    pub name: &'static str,
    /// SI unit; empty for what has none.
    pub unit: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// Place in its list; 0 outside a list.
    index: usize,
    limits: fn(&Machine, usize) -> RangeInclusive<f64>,
    get: fn(&Machine, usize) -> Option<Value>,
    set: fn(&mut Machine, usize, Value) -> Option<()>,
}

impl Parameter {
    /// Its value; none if the machine's list is too short to have it.
    pub fn get(&self, machine: &Machine) -> Option<Value> {
        (self.get)(machine, self.index)
    }

    /// Gives it a value, within its limits or not; none, and nothing is done, if the machine does not have it or it
    /// is of another kind. A list that becomes longer repeats its last element.
    #[must_use]
    pub fn set(&self, machine: &mut Machine, value: Value) -> Option<()> {
        (self.set)(machine, self.index, value)
    }

    /// Smallest and largest permitted value, those of the other parameters being what they are.
    pub fn limits(&self, machine: &Machine) -> Option<RangeInclusive<f64>> {
        self.get(machine)?;
        Some((self.limits)(machine, self.index))
    }

    /// The list whose length it is.
    pub fn length_of(&self) -> Option<&'static str> {
        Some(self.name.split_once(' ')?.0)
    }

    /// Refuses a value outside the limits.
    pub fn check(&self, machine: &Machine) -> Result<(), MachineError> {
        let (Some(value), Some(limits)) = (self.get(machine), self.limits(machine)) else {
            return Ok(());
        };
        let value = value.number();
        // a NaN is in no range
        if limits.contains(&value) {
            return Ok(());
        }
        Err(MachineError {
            parameter: self.name,
            value,
            low: *limits.start(),
            high: *limits.end(),
        })
    }
}

/// A parameter that no winder can have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineError {
    /// The parameter's name.
    pub parameter: &'static str,
    /// The value that was given.
    pub value: f64,
    /// Smallest permitted value.
    pub low: f64,
    /// Largest permitted value.
    pub high: f64,
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} = {} is outside {} to {}",
            self.parameter, self.value, self.low, self.high
        )
    }
}

impl core::error::Error for MachineError {}

/// Every parameter that a machine can have, those of the longest lists included.
pub fn parameters() -> impl Iterator<Item = &'static Parameter> {
    TABLE.iter().copied().flatten()
}

impl Machine {
    /// The parameter of a name.
    pub fn parameter(name: &str) -> Option<&'static Parameter> {
        parameters().find(|parameter| parameter.name == name)
    }

    /// Refuses a machine that cannot be: the first parameter outside its limits.
    pub fn validate(&self) -> Result<(), MachineError> {
        parameters().try_for_each(|parameter| parameter.check(self))
    }

    /// The parameters of this machine that `other` has not, or has otherwise.
    pub fn differences(&self, other: &Self) -> impl Iterator<Item = &'static Parameter> {
        parameters().filter(move |parameter| {
            let value = parameter.get(self);
            value.is_some() && value != parameter.get(other)
        })
    }
}

/// A type of field that a parameter can be.
trait Field {
    fn value(&self) -> Value;
    /// None if the value is of another kind.
    fn put(&mut self, value: Value) -> Option<()>;
}

macro_rules! fields {
    ($($kind:ident $type:ty),*) => {$(
        impl Field for $type {
            fn value(&self) -> Value {
                Value::$kind(*self)
            }
            fn put(&mut self, value: Value) -> Option<()> {
                let Value::$kind(value) = value else { return None };
                *self = value;
                Some(())
            }
        }
    )*};
}
fields!(Number f64, Count usize, Switch bool);

/// The length of a list is a parameter of it.
impl<T: Clone, const N: usize> Field for Vec<T, N> {
    fn value(&self) -> Value {
        Value::Count(self.len())
    }
    fn put(&mut self, value: Value) -> Option<()> {
        match value {
            Value::Count(0) => self.clear(),
            Value::Count(length) => self.resize(length, self.last()?.clone()).ok()?,
            _ => return None,
        }
        Some(())
    }
}

/// Parameters of one part: `(part) { field "unit", limits, "description"; … }`. The limits may name the machine and
/// the index.
macro_rules! part {
    (|$m:ident, $i:ident| $part:tt { $($field:ident $unit:literal, $limits:expr, $about:expr;)* }) => {
        &[$(parameter!(|$m, $i| $part $field $unit, $limits, $about)),*]
    };
}

macro_rules! parameter {
    (|$m:ident, $i:ident| ($($part:ident).*) $field:ident $unit:literal, $limits:expr, $about:expr) => {
        parameter! {
            concat!($(stringify!($part), ".",)* stringify!($field)), 0, $unit, $about;
            |$m, $i| $limits;
            |m, _| m$(.$part)*.$field;
            |m, _| m$(.$part)*.$field
        }
    };
    (|$m:ident, $i:ident| ($($part:ident).+ [$index:literal]) $field:ident $unit:literal, $limits:expr, $about:expr) => {
        parameter! {
            parameter!(@path $($part).+ [$index] $field), $index, $unit, $about;
            |$m, $i| $limits;
            |m, i| m$(.$part)+.get(i)?.$field;
            |m, i| m$(.$part)+.get_mut(i)?.$field
        }
    };
    (@path $first:ident $(.$next:ident)* [$index:literal] $field:ident) => {
        concat!(stringify!($first), $(".", stringify!($next),)* "[", $index, "].", stringify!($field))
    };
    ($name:expr, $index:expr, $unit:expr, $about:expr;
     |$lm:ident, $li:ident| $limits:expr;
     |$gm:ident, $gi:pat_param| $get:expr;
     |$sm:ident, $si:pat_param| $set:expr) => {
        Parameter {
            name: $name,
            unit: $unit,
            about: $about,
            index: $index,
            // few limits depend on the machine
            #[allow(unused_variables)]
            limits: |$lm, $li| $limits,
            get: |$gm, $gi| Some(Field::value(&$get)),
            set: |$sm, $si, value| Field::put(&mut $set, value),
        }
    };
}

macro_rules! idle_roll {
    ($index:literal) => {
        part!(|m, i| (idle[$index]) {
            span_m "m", 0.05..=50.0, "length of the span that leads to the roll";
            radius_m "m", 0.01..=2.0, "radius";
            inertia_kg_m2 "kg·m²", 1e-5..=1e4, "inertia, of all rolls where several are lumped";
            friction_n_s_m "N·s/m", 0.0..=1e4, "friction referred to the surface";
            eccentricity_m "m", 0.0..=0.1 * m.idle[i].radius_m,
                "distance of the axis of rotation from the centre";
        })
    };
}

macro_rules! driven_roll {
    ($roll:ident) => {
        part!(|m, i| ($roll) {
            radius_m "m", 0.01..=2.0, "radius";
            inertia_kg_m2 "kg·m²", 1e-5..=1e5, "inertia with the drive train";
            friction_n_s_m "N·s/m", 0.0..=1e4, "friction referred to the surface";
        })
    };
}

macro_rules! rider_load {
    ($index:literal) => {
        part!(|m, i| (nips.rider_load[$index]) {
            diameter_m "m", i.checked_sub(1).map_or(0.0, |i| m.nips.rider_load[i].diameter_m)..=5.0,
                "diameter of the shipping roll";
            load_n_m "N/m", 0.0..=1e5, "load of the rider roll per width Q";
        })
    };
}

macro_rules! motor {
    ($section:ident) => {
        part!(|m, i| (motors.$section) {
            power_w "W", 1.0..=1e7, "rated power";
            torque_n_m "N·m", 0.01..=1e6, "rated torque at the roll's shaft";
        })
    };
}

macro_rules! front_share {
    ($index:literal) => {
        part!(|m, i| (operation.front_share[$index]) {
            diameter_m "m", i.checked_sub(1).map_or(0.0, |i| m.operation.front_share[i].diameter_m)..=5.0,
                "diameter of the shipping roll";
            share "", 0.0..=1.0, "front drum's share of the force of both drums";
        })
    };
}

macro_rules! length {
    ($name:literal, $most:expr, $about:literal, $($list:ident).+) => {
        &[parameter! {
            $name, 0, "", $about;
            |_m, _i| 1.0..=$most as f64;
            |m, _| m.$($list).+;
            |m, _| m.$($list).+
        }]
    };
}

/// In the order of checking: what a limit depends on stands before it.
static TABLE: &[&[Parameter]] = &[
    part!(|m, i| (web) {
        width_m "m", 0.05..=15.0, "width W";
        grammage_kg_m2 "kg/m²", 0.005..=2.0, "mass per area g";
        caliper_m "m", 5e-6..=5e-3, "thickness z";
        stiffness_n_m "N/m", 1e3..=1e8, "stiffness per width E·z";
        retardation_s "s", 0.0..=0.05, "retardation time of the Kelvin–Voigt web τ_v";
        strength_n_m "N/m", 10.0..=1e6, "ultimate tensile strength per width";
        tail "", 0.0..=1.0, "the web between a break and the rear drum is wound up, too";
    }),
    part!(|m, i| (parent_roll) {
        spool_radius_m "m", 0.02..=2.0, "radius of the empty spool";
        expire_radius_m "m", m.parent_roll.spool_radius_m..=3.0, "radius at which the roll runs out of paper";
        full_radius_m "m", m.parent_roll.expire_radius_m..=3.0, "radius of a full roll R_reel";
        spool_inertia_kg_m2 "kg·m²", 1e-4..=1e5, "inertia of spool and drive train J_0";
        friction_n_s_m "N·s/m", 0.0..=1e4, "friction referred to the surface";
        eccentricity_m "m", 0.0..=0.1 * m.parent_roll.spool_radius_m,
            "distance of the axis of rotation from the centre";
    }),
    length!(
        "idle (number of rolls)",
        (MAX_SPANS - 1),
        "idle rolls from the unwind to the windup, each with the span before it",
        idle
    ),
    idle_roll!(0),
    idle_roll!(1),
    idle_roll!(2),
    idle_roll!(3),
    idle_roll!(4),
    idle_roll!(5),
    idle_roll!(6),
    part!(|m, i| () {
        last_span_m "m", 0.05..=50.0, "length of the last span, to the rear drum";
    }),
    part!(|m, i| (load_cells) {
        roll "", 0.0..=m.idle.len().saturating_sub(1) as f64, "which idle roll, from 0, lies on the load cells";
        both_spans "", 0.0..=1.0, "they feel the spans on both sides of the roll, not only the one after it";
        wrap_rad "rad", 0.05..=PI, "wrap angle of the web β";
        calibrated_wrap_rad "rad", 0.05..=PI, "wrap angle that the amplifier has been calibrated for β_cal";
        tare_n "N", -1e5..=1e5, "error of the zero";
        filter_s "s", 0.004..=10.0, "time constant of the filter";
        full_scale_n "N", 1.0..=1e6, "web tension at which the amplifier's analogue output is at its end";
    }),
    driven_roll!(rear_drum),
    driven_roll!(front_drum),
    driven_roll!(rider_roll),
    part!(|m, i| (shipping_roll) {
        core_radius_m "m", 0.01..=1.0, "radius of the core R_core";
        full_radius_m "m", m.shipping_roll.core_radius_m..=2.0, "radius of a full roll";
        friction_n_s_m "N·s/m", 0.0..=1e4, "rolling resistance referred to the surface";
    }),
    part!(|m, i| (nips) {
        slip "", 0.0..=1.0, "the rolls may slip on each other; otherwise the windup turns as one body";
        friction "", 0.01..=2.0, "coefficient of sliding friction between drum and paper μ";
        static_ratio "", 1.0..=2.0, "static over sliding friction";
        // the bare core must not fall through
        drum_gap_m "m", 0.0..=1.9 * m.shipping_roll.core_radius_m, "gap between the drums s";
    }),
    length!(
        "nips.rider_load (number of points)",
        MAX_RIDER_LOADS,
        "load of the rider roll over the diameter of the shipping roll, linear between the points",
        nips.rider_load
    ),
    rider_load!(0),
    rider_load!(1),
    rider_load!(2),
    rider_load!(3),
    rider_load!(4),
    rider_load!(5),
    rider_load!(6),
    rider_load!(7),
    rider_load!(8),
    rider_load!(9),
    rider_load!(10),
    rider_load!(11),
    rider_load!(12),
    rider_load!(13),
    rider_load!(14),
    rider_load!(15),
    part!(|m, i| (wound_on_tension) {
        compresses "", 0.0..=1.0,
            "the thickness of a wound layer follows the wound-on tension; otherwise it is the caliper";
        tension_gain "", 0.0..=2.0, "gain of the web tension k_t";
        force_gain "", 0.0..=2.0, "gain of the front drum's force k_F";
        paper_friction "", 0.0..=2.0, "coefficient of friction paper on paper μ_ww";
        nip_scale_n_m "N/m", 1.0..=1e6, "nip force per width at which its effect has fallen to a half N_0";
        reference_n_m "N/m", 1.0..=1e6,
            "wound-on tension per width at which a layer has the caliper WOT_ref";
        hardness "", 0.0..=0.1, "loss of thickness κ for a doubled wound-on tension";
    }),
    motor!(uw),
    motor!(rd),
    motor!(fd),
    motor!(rr),
    part!(|m, i| (motors) {
        overload "", 1.0..=3.0, "torque for a short time, of rated torque";
    }),
    part!(|m, i| (brakes) {
        uw_n_m "N·m", 0.0..=1e6, "torque of the unwind's brake";
        rd_n_m "N·m", 0.0..=1e6, "torque of the rear drum's brake";
        fd_n_m "N·m", 0.0..=1e6, "torque of the front drum's brake";
        delay_s "s", 0.0..=MAX_BRAKE_DELAY_S, "time from command to effect";
        static_ratio "", 1.0..=2.0, "static over sliding friction";
        karnopp_m_s "m/s", 0.0..=1.0,
            "half width ΔV of the stiction band of the Karnopp brake; 0 for the set-valued law";
    }),
    part!(|m, i| (operation) {
        max_speed_m_s "m/s", 0.1..=60.0, "highest web speed";
        run_speed_m_s "m/s", 0.1..=m.operation.max_speed_m_s, "usual web speed";
        thread_speed_m_s "m/s", 0.01..=m.operation.run_speed_m_s, "web speed in thread";
        acceleration_m_s2 "m/s²", 0.01..=5.0, "acceleration and deceleration";
        jerk_m_s3 "m/s³", 0.01..=10.0, "rate of change of the acceleration";
        emergency_m_s2 "m/s²", m.operation.acceleration_m_s2..=10.0, "deceleration of an emergency stop";
        tension_n_m "N/m", 1.0..=0.5 * m.web.strength_n_m, "web tension per width";
        stall_share "", 0.05..=1.0, "tension at standstill, of the web tension";
        rider_share "", 0.0..=0.5, "rider roll's share of the winding force";
    }),
    length!(
        "operation.front_share (number of points)",
        MAX_FRONT_SHARES,
        "front drum's share of the drums' force over the diameter of the shipping roll, linear between the points",
        operation.front_share
    ),
    front_share!(0),
    front_share!(1),
    front_share!(2),
    front_share!(3),
    front_share!(4),
    front_share!(5),
    front_share!(6),
    front_share!(7),
    part!(|m, i| () {
        encoder_pulses "", 1.0..=1e5, "pulses of the rear drum's encoder for one revolution";
        encoder_pulses_uw "", 1.0..=1e5, "pulses of the unwind's encoder for one revolution";
    }),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// The table has a row for every element of the longest lists.
    #[test]
    fn the_longest_lists_are_in_the_table() {
        let mut machine = Machine::news_8000();
        for length in parameters().filter(|parameter| parameter.length_of().is_some()) {
            let most = *length.limits(&machine).unwrap().end() as usize;
            length.set(&mut machine, Value::Count(most)).unwrap();
            let last = |i| {
                let element = (length.length_of().unwrap(), i);
                parameters().any(|p| {
                    p.name
                        .strip_prefix(element.0)
                        .and_then(|rest| rest.strip_prefix('[')?.split_once(']'))
                        .is_some_and(|(index, _)| index.parse() == Ok(element.1))
                })
            };
            assert!(last(most - 1) && !last(most), "{}", length.name);
        }
        assert!(parameters().all(|parameter| parameter.get(&machine).is_some()));
    }

    #[test]
    fn names_are_unique() {
        for (i, parameter) in parameters().enumerate() {
            let namesakes = parameters().take(i).filter(|p| p.name == parameter.name);
            assert_eq!(namesakes.count(), 0, "{}", parameter.name);
        }
    }

    #[test]
    fn a_value_of_another_kind_changes_nothing() {
        let mut machine = Machine::news_8000();
        for (name, value) in [
            ("web.width_m", Value::Count(7)),
            ("load_cells.roll", Value::Number(1.0)),
            ("nips.slip", Value::Number(1.0)),
            ("idle (number of rolls)", Value::Count(MAX_SPANS)),
            ("idle[2].span_m", Value::Number(1.0)),
        ] {
            let parameter = Machine::parameter(name).unwrap();
            assert_eq!(parameter.set(&mut machine, value), None, "{name}");
        }
        assert_eq!(machine, Machine::news_8000());
    }
}
