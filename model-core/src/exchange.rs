//! What the plant, the regulators and the logic hand to each other.
//!
//! Not here: the process image, which is what a PLC sees. Each of these has one writer. The regulators get
//! [`Measurements`] and cannot name the plant: what a drive cannot measure, they do not know.

/// A value for each driven section.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BySection<T> {
    /// Unwind.
    pub uw: T,
    /// Rear drum.
    pub rd: T,
    /// Front drum.
    pub fd: T,
    /// Rider roll.
    pub rr: T,
}

impl<T: Copy> BySection<T> {
    /// The same for all four.
    pub fn all(value: T) -> Self {
        Self {
            uw: value,
            rd: value,
            fd: value,
            rr: value,
        }
    }
}

impl<T> BySection<T> {
    /// Applies `f` to every section.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> BySection<U> {
        BySection {
            uw: f(self.uw),
            rd: f(self.rd),
            fd: f(self.fd),
            rr: f(self.rr),
        }
    }

    /// Pairs every section with that of another.
    pub fn zip<U>(self, other: BySection<U>) -> BySection<(T, U)> {
        BySection {
            uw: (self.uw, other.uw),
            rd: (self.rd, other.rd),
            fd: (self.fd, other.fd),
            rr: (self.rr, other.rr),
        }
    }

    /// All sections in order.
    pub fn into_array(self) -> [T; 4] {
        [self.uw, self.rd, self.fd, self.rr]
    }
}

/// A value for each brake.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Brakes<T> {
    /// Unwind.
    pub uw: T,
    /// Rear drum.
    pub rd: T,
    /// Front drum.
    pub fd: T,
}

impl<T: Copy> Brakes<T> {
    /// The same for all three.
    pub fn all(value: T) -> Self {
        Self {
            uw: value,
            rd: value,
            fd: value,
        }
    }
}

/// What people do at the machine. Each act is idempotent, so it may stand for more than one step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Handling {
    /// Lead the web through the machine, with some slack.
    pub thread_web: bool,
    /// Put in an empty core.
    pub new_core: bool,
    /// Put in a full parent roll.
    pub new_parent_roll: bool,
    /// Cut the web and take it out.
    pub remove_web: bool,
}

/// What the rider roll is to do. At rest it lies on the shipping roll with the load of the machine's table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rider<R> {
    /// Lifted off the shipping roll.
    pub lifted: bool,
    /// Load beside that of the table, as a share of it.
    pub load_trim: R,
}

/// How a brake fails.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stuck {
    /// It works.
    #[default]
    No,
    /// It does not close.
    Open,
    /// It does not open.
    Closed,
}

impl Stuck {
    /// What becomes of a brake that should be closed or not.
    pub fn acts_on(self, closed: bool) -> bool {
        match self {
            Stuck::No => closed,
            Stuck::Open => false,
            Stuck::Closed => true,
        }
    }
}

/// Faults of the machine that a test puts in. Each is a level: it may stand for any time, and ends when taken back.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MachineFaults<R> {
    /// The web parts in this span, counted from the unwind; 0 leaves it whole.
    pub web_break: u8,
    /// The parent roll has run down to its expire radius.
    pub parent_roll_expired: bool,
    /// Diameter of the parent roll that is put in next, m; one that is not between expired and full is full.
    pub next_parent_roll: R,
    /// Brakes that do not follow.
    pub brakes: Brakes<Stuck>,
    /// Share of their friction that the drums have lost.
    pub drum_wear: R,
    /// Eccentricity of the parent roll beside the machine's own, m.
    pub eccentricity: R,
}

/// Faults of sensors that a test puts in, levels as well.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorFaults<R> {
    /// The unwind's encoder is silent.
    pub encoder_uw: bool,
    /// The rear drum's encoder is silent.
    pub encoder_rd: bool,
    /// The load cells show what they last showed.
    pub load_cell_stuck: bool,
    /// Error of the load cells' wrap angle, rad.
    pub wrap_error: R,
    /// The load cells' zero wanders off by so much in a second, N/s; it is back when there is no drift.
    pub drift: R,
}

/// All that a test puts in between drives and sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults<R> {
    /// Of the machine.
    pub machine: MachineFaults<R>,
    /// Of its sensors.
    pub sensors: SensorFaults<R>,
}

/// What acts on the winder: from the drive task to the plant task.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Actuators<R> {
    /// Shaft torques of the motors, N·m.
    pub torque: BySection<R>,
    /// Brakes commanded on.
    pub brakes: Brakes<bool>,
    /// The rider roll.
    pub rider: Rider<R>,
    /// What people do.
    pub handling: Handling,
    /// Faults that a test puts in.
    pub faults: Faults<R>,
}

/// What can be measured on a winder: from the plant task to the drive task.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurements<R> {
    /// Angular velocities of the motors, referred to their rolls, rad/s.
    pub omega: BySection<R>,
    /// Web tension from the load cells, N, total across the width.
    pub tension: R,
    /// Shipping-roll diameter from the position of the rider-roll beam, m; of a lifted roll the last one.
    pub d_wu: R,
    /// Pulses of the rear drum's encoder since power-up; wraps.
    pub pulses_rd: u32,
    /// Brakes that are closed.
    pub brakes: Brakes<bool>,
    /// The rider roll is off the shipping roll.
    pub rider_lifted: bool,
}

/// How the unwind is controlled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UnwindControl {
    /// No torque.
    #[default]
    Off,
    /// Holds the web's speed less a small draw, with no more torque than the tension reference: takes up slack.
    TakeUp,
    /// Tension.
    Tension,
    /// Speed, without web: to turn the roll alone, or to stop it after a web break.
    Speed,
}

/// A loop that auto-tune can set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loop {
    /// Speed of the windup by both drums. Without a web, from standstill, the drums' brakes open.
    DrumSpeed,
    /// Speed of the parent roll by the unwind. Without a web, from standstill, its brake open.
    UnwindSpeed,
    /// Tension of the web by the unwind. With a web under stall tension that runs at thread speed, or is about to:
    /// tension control, drums on, brakes open.
    Tension,
}

/// How far auto-tune is: its steps, in order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum TuneStep {
    /// Not begun.
    #[default]
    Idle,
    /// Looks whether the conditions are there, and waits for rest.
    Check,
    /// Speed loops: runs up with a constant torque. Tension: the first step of torque.
    Up,
    /// Speed loops: runs down with the same torque turned round. Tension: the step is taken back.
    Down,
    /// The new gains are tried.
    Verify,
    /// Speed loops: comes to rest.
    Stop,
    /// The new gains are in use.
    Done,
    /// Ended without a result; the old gains are in use.
    Aborted,
}

/// Why auto-tune ended without a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TuneAbort {
    /// It did not.
    #[default]
    None,
    /// The command was taken back.
    Cancelled,
    /// The rolls turned when it was to begin.
    NotAtStandstill,
    /// There is a web where there must be none.
    WebPresent,
    /// A brake of the section is closed.
    BrakeClosed,
    /// There is no tension, or it was lost.
    NoTension,
    /// The unwind is not in tension control, or the drums are off.
    WrongControl,
    /// The web speed is not that of thread.
    WrongSpeed,
    /// The torque limit is too low for the test torque.
    TorqueLimit,
    /// The roll turned against its torque, or ran away.
    WrongDirection,
    /// A step took too long.
    TimeOut,
    /// What was found cannot be this machine, or the new gains did not hold.
    Implausible,
}

impl TuneStep {
    /// A line for every step, by its number.
    pub const TEXTS: [&str; 8] = [
        "not begun",
        "waiting for the conditions",
        "torque up",
        "torque down",
        "trying the new gains",
        "coming to rest",
        "done: the new gains are in use",
        "aborted: the old gains are in use",
    ];

    /// Its number.
    pub fn number(self) -> u8 {
        self as u8
    }
}

impl TuneAbort {
    /// A line for every code, by its number.
    pub const TEXTS: [&str; 12] = [
        "none",
        "cancelled",
        "not at standstill",
        "there is a web",
        "a brake is closed",
        "no tension",
        "unwind not in tension control, or drums off",
        "not at thread speed",
        "torque limit below the test torque",
        "roll turns against its torque, or runs away",
        "a step took too long",
        "result implausible",
    ];

    /// Its number.
    pub fn number(self) -> u8 {
        self as u8
    }
}

/// A PI regulator's setting as a commissioning engineer reads it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setting<R> {
    /// Proportional gain: N·m·s/rad at the unwind's or the rear drum's shaft, N/N for the tension.
    pub gain: R,
    /// Integral action time, s.
    pub time: R,
}

/// What auto-tune tells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Autotune<R> {
    /// The loop that is being tuned, or was last.
    pub of: Option<Loop>,
    /// Where it is.
    pub step: TuneStep,
    /// How far, 0 to 100 %.
    pub progress: R,
    /// Why it ended without a result.
    pub abort: TuneAbort,
    /// Inertia found, kg·m², at the unwind's or the rear drum's shaft; none by the tension loop.
    pub inertia: R,
    /// Friction found, N·m·s/rad, at the same shaft.
    pub friction: R,
    /// Stiffness of the web path found, N/m; by the tension loop alone.
    pub stiffness: R,
    /// Setting before.
    pub old: Setting<R>,
    /// Setting found.
    pub new: Setting<R>,
}

/// What the logic asks of the regulators for one drive cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveCommand<R> {
    /// How the unwind is controlled.
    pub unwind: UnwindControl,
    /// Drums and rider roll hold the web speed; otherwise no torque.
    pub drums: bool,
    /// Web speed to go to, m/s.
    pub v_target: R,
    /// Limit of the acceleration on the way, m/s².
    pub acceleration: R,
    /// Limit of its rate, m/s³.
    pub jerk: R,
    /// Tension to go to, N.
    pub tension: R,
    /// The tension loop is open: the unwind pulls what the reference says, whatever the load cells show.
    pub tension_open: bool,
    /// Radius of the parent roll to take over, m.
    pub preset: Option<R>,
    /// The web is gone: hold the diameter estimate.
    pub freeze_diameter: bool,
    /// The unwind's brake helps when its motor comes to its limit.
    pub brake_assist: bool,
    /// Limits of the motors' torques, of rated torque.
    pub torque_limit: BySection<R>,
    /// Added to the front drum's share of the drum torque.
    pub front_share_trim: R,
    /// Brakes on.
    pub brakes: Brakes<bool>,
    /// The rider roll; its drive coasts while it is lifted.
    pub rider: Rider<R>,
    /// What people do, handed on to the plant.
    pub handling: Handling,
    /// Faults that a test puts in, handed on to the plant.
    pub faults: Faults<R>,
    /// Tune this loop: runs as long as it stands, aborts when it is taken back.
    pub autotune: Option<Loop>,
    /// A defect: the diameter estimator without its interlocks.
    pub bare_estimator: bool,
    /// A defect: no torque for the inertias that the ramps accelerate.
    pub no_inertia_compensation: bool,
}

/// What the regulators tell the logic after a drive cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveStatus<R> {
    /// Web speed from the rear drum, m/s.
    pub v: R,
    /// Speed reference after the ramp, m/s.
    pub v_ref: R,
    /// Its acceleration, m/s².
    pub a_ref: R,
    /// Surface speed of the parent roll as the drive knows it, m/s.
    pub v_uw: R,
    /// Estimated radius of the parent roll, m.
    pub r_uw: R,
    /// Tension reference after its ramp, N.
    pub tension_ref: R,
    /// Measured tension without the lag of the load cells' filter, N: coarse, but it tells at once when there is none.
    pub tension_at_once: R,
    /// Torques that act on the shafts, N·m.
    pub torque: BySection<R>,
    /// Auto-tune.
    pub autotune: Autotune<R>,
}
