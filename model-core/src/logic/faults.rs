//! Faults: how they are found, which sections they take, how the winder stops for them.
//!
//! Not here: the stop itself (the mode's), the web's break as such (the plant's). A fault stays latched until an
//! edge acknowledges it at standstill, and longer if its cause still stands.

use super::detection::Persistent;
use super::{Fault, inject, warning};
use crate::exchange::{Brakes, BySection};

/// How the winder stops for a fault, the gentlest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reaction {
    /// A normal stop.
    NormalStop,
    /// A web-break stop.
    WebBreakStop,
    /// The section gives no torque any more; the others make an emergency stop.
    QuickStop,
    /// The drums cannot hold a speed: coast stop with all brakes closed.
    BrakeStop,
}

impl Reaction {
    /// What it is.
    pub fn name(self) -> &'static str {
        match self {
            Reaction::NormalStop => "normal stop",
            Reaction::WebBreakStop => "web-break stop",
            Reaction::QuickStop => "emergency stop without the section",
            Reaction::BrakeStop => "coast stop with all brakes closed",
        }
    }
}

/// A row of the table of faults.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// The fault.
    pub fault: Fault,
    /// Sections whose status word shows it.
    pub sections: BySection<bool>,
    /// The sections give no torque any more.
    pub trips: bool,
    /// How the winder stops.
    pub reaction: Reaction,
}

const NONE: BySection<bool> = BySection {
    uw: false,
    rd: false,
    fd: false,
    rr: false,
};
const ALL: BySection<bool> = BySection {
    uw: true,
    rd: true,
    fd: true,
    rr: true,
};
const UW: BySection<bool> = BySection { uw: true, ..NONE };
const RD: BySection<bool> = BySection { rd: true, ..NONE };
const FD: BySection<bool> = BySection { fd: true, ..NONE };
const RR: BySection<bool> = BySection { rr: true, ..NONE };

const fn row(fault: Fault, sections: BySection<bool>, trips: bool, reaction: Reaction) -> Row {
    Row {
        fault,
        sections,
        trips,
        reaction,
    }
}

/// Every fault with its sections and its stop.
#[rustfmt::skip]
pub const FAULTS: &[Row] = &[
    row(Fault::HeartbeatLost,   ALL,  false, Reaction::NormalStop),
    row(Fault::WebBreak,        NONE, false, Reaction::WebBreakStop),
    row(Fault::EncoderUnwind,   UW,   true,  Reaction::QuickStop),
    row(Fault::EncoderRearDrum, RD,   true,  Reaction::BrakeStop),
    row(Fault::TripUnwind,      UW,   true,  Reaction::QuickStop),
    row(Fault::TripRearDrum,    RD,   true,  Reaction::QuickStop),
    row(Fault::TripFrontDrum,   FD,   true,  Reaction::QuickStop),
    row(Fault::TripRiderRoll,   RR,   true,  Reaction::QuickStop),
    row(Fault::HotUnwind,       UW,   true,  Reaction::QuickStop),
    row(Fault::HotRearDrum,     RD,   true,  Reaction::QuickStop),
    row(Fault::HotFrontDrum,    FD,   true,  Reaction::QuickStop),
    row(Fault::HotRiderRoll,    RR,   true,  Reaction::QuickStop),
    row(Fault::BrakeUnwind,     UW,   false, Reaction::NormalStop),
    row(Fault::BrakeRearDrum,   RD,   false, Reaction::NormalStop),
    row(Fault::BrakeFrontDrum,  FD,   false, Reaction::NormalStop),
    row(Fault::UnwindDeviates,  UW,   true,  Reaction::QuickStop),
    row(Fault::Restarted,       ALL,  false, Reaction::NormalStop),
];

/// Drive cycles in a second.
const CYCLES_PER_S: u16 = 100;
/// A hot motor trips after this time, and must cool as long.
pub const HOT_CYCLES: u16 = 10 * CYCLES_PER_S;
/// Cycles without a single pulse while the others turn, until an encoder counts as lost.
pub const ENCODER_CYCLES: u16 = 2;

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultSet(u32);

impl FaultSet {
    /// Adds one.
    pub fn add(&mut self, fault: Fault) {
        if fault != Fault::None {
            self.0 |= 1 << fault as u32;
        }
    }

    /// It is in the set.
    pub fn has(self, fault: Fault) -> bool {
        self.0 >> fault as u32 & 1 == 1
    }

    /// There is none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Those that `other` has, too.
    pub fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    fn rows(self) -> impl Iterator<Item = &'static Row> {
        // mostly there is none
        let table = if self.is_empty() { &[] } else { FAULTS };
        table.iter().filter(move |row| self.has(row.fault))
    }

    /// The sections of all of them.
    pub fn sections(self) -> BySection<bool> {
        union(self.rows())
    }

    /// The sections that give no torque.
    pub fn tripped(self) -> BySection<bool> {
        union(self.rows().filter(|row| row.trips))
    }

    /// How the winder stops for all of them together; a web break stops it once and lets it rest.
    pub fn reaction(self) -> Option<Reaction> {
        let tripped = self.tripped();
        if tripped.rd && tripped.fd {
            return Some(Reaction::BrakeStop);
        }
        let stops = self.rows().filter(|row| row.fault != Fault::WebBreak);
        stops.map(|row| row.reaction).max()
    }
}

fn union<'a>(rows: impl Iterator<Item = &'a Row>) -> BySection<bool> {
    rows.fold(NONE, |sum, row| sum.zip(row.sections).map(|(a, b)| a | b))
}

/// The faults that are latched, and what watches for new ones.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    latched: FaultSet,
    /// The first one since the last acknowledge.
    first: Fault,
    /// Those whose cause stood in the last cycle.
    standing: FaultSet,
    hot: BySection<Persistent>,
    brakes: Brakes<Persistent>,
    encoder_uw: Persistent,
    encoder_rd: Persistent,
    deviation: Persistent,
    warnings: u16,
}

/// What the watch looks at.
pub struct Look {
    /// The word of injected drive faults.
    pub injected: u16,
    /// Brakes that differ from their command.
    pub brake_differs: Brakes<bool>,
    /// The unwind's encoder says nothing while the web runs.
    pub silent_uw: bool,
    /// The rear drum's encoder says nothing while the front drum turns.
    pub silent_rd: bool,
    /// The unwind's speed does not fit the web's.
    pub unwind_deviates: bool,
    /// Motors that have used up their overload.
    pub overloaded: BySection<bool>,
    /// The load cells show tension without web.
    pub load_cell_zero: bool,
}

/// How long what is watched must last, drive cycles.
#[derive(Clone, Copy, Debug)]
pub struct Patience {
    /// A brake that differs from its command.
    pub brake: u16,
    /// A speed that does not fit.
    pub deviation: u16,
}

impl Faults {
    /// One cycle: latches what has gone wrong.
    pub fn watch(&mut self, look: &Look, patience: &Patience) {
        let has = |bit: u16| look.injected & bit != 0;
        let trips = [
            (has(inject::TRIP_UW), Fault::TripUnwind),
            (has(inject::TRIP_RD), Fault::TripRearDrum),
            (has(inject::TRIP_FD), Fault::TripFrontDrum),
            (has(inject::TRIP_RR), Fault::TripRiderRoll),
        ];
        let hot = [
            (has(inject::HOT_UW), &mut self.hot.uw, Fault::HotUnwind),
            (has(inject::HOT_RD), &mut self.hot.rd, Fault::HotRearDrum),
            (has(inject::HOT_FD), &mut self.hot.fd, Fault::HotFrontDrum),
            (has(inject::HOT_RR), &mut self.hot.rr, Fault::HotRiderRoll),
        ];
        let (b, d) = (&mut self.brakes, look.brake_differs);
        let brakes = [
            (d.uw, &mut b.uw, Fault::BrakeUnwind),
            (d.rd, &mut b.rd, Fault::BrakeRearDrum),
            (d.fd, &mut b.fd, Fault::BrakeFrontDrum),
        ];

        let mut standing = FaultSet::default();
        let mut stand = |on: bool, fault| {
            if on {
                standing.add(fault);
            }
        };
        for (on, fault) in trips {
            stand(on, fault);
        }
        let warn = [
            warning::HOT_UW,
            warning::HOT_RD,
            warning::HOT_FD,
            warning::HOT_RR,
        ];
        self.warnings = 0;
        for ((now, watch, fault), warning) in hot.into_iter().zip(warn) {
            stand(watch.step(now, HOT_CYCLES), fault);
            if now || watch.is_on() {
                self.warnings |= warning;
            }
        }
        let o = look.overloaded;
        for (now, warning) in [
            (look.load_cell_zero, warning::LOAD_CELL_ZERO),
            (o.uw, warning::OVERLOAD_UW),
            (o.rd, warning::OVERLOAD_RD),
            (o.fd, warning::OVERLOAD_FD),
            (o.rr, warning::OVERLOAD_RR),
        ] {
            if now {
                self.warnings |= warning;
            }
        }
        for (differs, watch, fault) in brakes {
            if !differs {
                watch.reset();
            }
            stand(watch.step(differs, patience.brake), fault);
        }
        let (uw, rd) = (&mut self.encoder_uw, &mut self.encoder_rd);
        for (now, watch, cycles, fault) in [
            (look.silent_uw, uw, ENCODER_CYCLES, Fault::EncoderUnwind),
            (look.silent_rd, rd, ENCODER_CYCLES, Fault::EncoderRearDrum),
            (
                look.unwind_deviates,
                &mut self.deviation,
                patience.deviation,
                Fault::UnwindDeviates,
            ),
        ] {
            if !now {
                watch.reset();
            }
            stand(watch.step(now, cycles), fault);
        }
        self.standing = standing;
        for row in standing.rows() {
            self.latch(row.fault);
        }
    }

    /// Latches a fault.
    pub fn latch(&mut self, fault: Fault) {
        if self.latched.is_empty() {
            self.first = fault;
        }
        self.latched.add(fault);
    }

    /// Forgets the faults whose cause is gone; true if that was all of them.
    pub fn acknowledge(&mut self) -> bool {
        self.latched = self.latched.and(self.standing);
        let left = FAULTS.iter().find(|row| self.latched.has(row.fault));
        self.first = left.map_or(Fault::None, |row| row.fault);
        left.is_none()
    }

    /// Those that are latched.
    pub fn latched(&self) -> FaultSet {
        self.latched
    }

    /// The one that the PLC is told: the first.
    pub fn first(&self) -> Fault {
        self.first
    }

    /// The sections with a warning.
    pub fn warned(&self) -> BySection<bool> {
        let any = |bits| self.warnings & bits != 0;
        BySection {
            uw: any(warning::HOT_UW | warning::OVERLOAD_UW),
            rd: any(warning::HOT_RD | warning::OVERLOAD_RD),
            fd: any(warning::HOT_FD | warning::OVERLOAD_FD),
            rr: any(warning::HOT_RR | warning::OVERLOAD_RR),
        }
    }

    /// The warnings that stand.
    pub fn warnings(&self) -> u16 {
        self.warnings
    }
}
