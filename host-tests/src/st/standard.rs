//! The function blocks of the standard, and what a cycle does to them.
//!
//! Not here: those that a text defines itself.

use super::{Type, Value};

/// A function block of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standard {
    /// On-delay.
    Ton,
    /// Off-delay.
    Tof,
    /// Pulse.
    Tp,
    /// Rising edge.
    RTrig,
    /// Falling edge.
    FTrig,
    /// Counter up.
    Ctu,
    /// Counter down.
    Ctd,
    /// Set dominates.
    Sr,
    /// Reset dominates.
    Rs,
}

/// Input, or not: name, type.
type Pin = (bool, &'static str, Type);

const TIMER: &[Pin] = &[
    (true, "in", Type::Bool),
    (true, "pt", Type::Time),
    (false, "q", Type::Bool),
    (false, "et", Type::Time),
    // the input of the last cycle, when the time began, and whether it runs
    (false, "", Type::Bool),
    (false, "", Type::Time),
    (false, "", Type::Bool),
];
const EDGE: &[Pin] = &[
    (true, "clk", Type::Bool),
    (false, "q", Type::Bool),
    (false, "", Type::Bool),
];
const COUNT_UP: &[Pin] = &[
    (true, "cu", Type::Bool),
    (true, "r", Type::Bool),
    (true, "pv", Type::Int),
    (false, "q", Type::Bool),
    (false, "cv", Type::Int),
    (false, "", Type::Bool),
];
const COUNT_DOWN: &[Pin] = &[
    (true, "cd", Type::Bool),
    (true, "ld", Type::Bool),
    (true, "pv", Type::Int),
    (false, "q", Type::Bool),
    (false, "cv", Type::Int),
    (false, "", Type::Bool),
];
const SET: &[Pin] = &[
    (true, "s1", Type::Bool),
    (true, "r", Type::Bool),
    (false, "q1", Type::Bool),
];
const RESET: &[Pin] = &[
    (true, "s", Type::Bool),
    (true, "r1", Type::Bool),
    (false, "q1", Type::Bool),
];

/// Every one by its name, in small letters.
const NAMES: [(&str, Standard); 9] = [
    ("ton", Standard::Ton),
    ("tof", Standard::Tof),
    ("tp", Standard::Tp),
    ("r_trig", Standard::RTrig),
    ("f_trig", Standard::FTrig),
    ("ctu", Standard::Ctu),
    ("ctd", Standard::Ctd),
    ("sr", Standard::Sr),
    ("rs", Standard::Rs),
];

impl Standard {
    /// The block of a name in small letters.
    pub fn of(name: &str) -> Option<Self> {
        let found = NAMES.iter().find(|(n, _)| *n == name)?;
        Some(found.1)
    }

    /// Its inputs and outputs in the order of its memory, and behind them what it remembers, which has no name.
    pub fn pins(self) -> &'static [Pin] {
        match self {
            Self::Ton | Self::Tof | Self::Tp => TIMER,
            Self::RTrig | Self::FTrig => EDGE,
            Self::Ctu => COUNT_UP,
            Self::Ctd => COUNT_DOWN,
            Self::Sr => SET,
            Self::Rs => RESET,
        }
    }

    /// A call, at a time of the program's clock.
    pub fn call(self, m: &mut [Value], now_ms: i64) {
        match self {
            Self::Ton | Self::Tof | Self::Tp => self.time(m, now_ms),
            Self::RTrig | Self::FTrig => {
                let (now, before) = (m[0].truth(), m[2].truth());
                let edge = match self {
                    Self::RTrig => now && !before,
                    _ => before && !now,
                };
                (m[1], m[2]) = (Value::Bool(edge), Value::Bool(now));
            }
            Self::Ctu => {
                let (edge, most) = (m[0].truth() && !m[5].truth(), i64::from(i16::MAX));
                let count = m[4].integer();
                let count = if m[1].truth() {
                    0
                } else if edge && count < most {
                    count + 1
                } else {
                    count
                };
                (m[5], m[4]) = (m[0], Value::Int(count));
                m[3] = Value::Bool(count >= m[2].integer());
            }
            Self::Ctd => {
                let (edge, least) = (m[0].truth() && !m[5].truth(), i64::from(i16::MIN));
                let count = m[4].integer();
                let count = if m[1].truth() {
                    m[2].integer()
                } else if edge && count > least {
                    count - 1
                } else {
                    count
                };
                (m[5], m[4]) = (m[0], Value::Int(count));
                m[3] = Value::Bool(count <= 0);
            }
            Self::Sr => m[2] = Value::Bool(m[0].truth() || (!m[1].truth() && m[2].truth())),
            Self::Rs => m[2] = Value::Bool(!m[1].truth() && (m[0].truth() || m[2].truth())),
        }
    }

    fn time(self, m: &mut [Value], now_ms: i64) {
        let (input, before, preset) = (m[0].truth(), m[4].truth(), m[1].integer().max(0));
        let begins = match self {
            Self::Ton => input && !before,
            Self::Tof => before && !input,
            // a pulse is not begun again while it lasts
            _ => input && !before && !m[2].truth(),
        };
        if begins {
            (m[5], m[6]) = (Value::Int(now_ms), Value::Bool(true));
        }
        let elapsed = (now_ms - m[5].integer()).min(preset);
        let lasts = elapsed < preset;
        // whether the time runs on, and the output while it runs and while it does not
        let (runs, in_time, at_rest) = match self {
            Self::Ton => (input, !lasts, false),
            Self::Tof => (!input && m[6].truth(), lasts, input),
            _ => (m[6].truth() && (lasts || input), lasts, false),
        };
        m[2] = Value::Bool(if runs { in_time } else { at_rest });
        m[3] = Value::Int(if runs { elapsed } else { 0 });
        (m[4], m[6]) = (Value::Bool(input), Value::Bool(runs));
    }
}
