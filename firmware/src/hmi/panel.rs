//! The operator panel: what a winder PLC and its operator do to wind a set, where there is no PLC.
//!
//! Not here: who controls the winder, and how a command comes in. Whoever has the control calls [`Panel::cycle`] in
//! every drive cycle; when nobody does, the heartbeat stands still and the drives stop by themselves.
//!
//! What is asked for becomes a list of [`Step`]s, each with its commands and its end. Between two lists the panel
//! holds what stands, and what it is follows from the winder's mode alone: it is right after a fault, too.

use core::f32::consts::PI;
use core::fmt;

use heapless::Vec;
use model_core::desk::request;
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::exchange::TuneStep;
use model_core::image::{self, Commands, Feedback};
use model_core::logic::{Fault, LOOPS, Mode, Refusal, command, status};
use model_core::machine::Machine;
use model_core::profidrive::{stw1, zsw1};
use model_core::real::Real;

/// Drive cycles of a time.
const fn cycles(ms: u32) -> u32 {
    ms / DRIVE_PERIOD_MS
}
/// A step stands at least this long: its commands have arrived, and their effect is in the feedback.
const STEP: u32 = cycles(200);
/// The tension has settled when it has stayed for this long ...
const SETTLED: u32 = cycles(2_000);
/// ... this near to stall tension, of it.
const SETTLED_BAND: f32 = 0.05;
/// A diameter is that which was put in, mm.
const NEAR_MM: f32 = 1.0;
/// A parent roll is used up when its diameter is within this of where it runs out.
const USED_UP: f32 = 1.1;
/// Steps of the longest list.
const STEPS: usize = 10;
const SECONDS_PER_MINUTE: f32 = 60.0;
/// Longest set, m: more than any parent roll has.
const LENGTH_MAX_M: f32 = 100_000.0;

/// What can be asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// New core and parent roll, diameter preset, drives on, web led through.
    Prepare,
    /// Slack taken up at thread speed, then stall tension.
    Thread,
    /// To a speed, and a stop by itself at a goal.
    Run(Order),
    /// A normal stop.
    Stop,
    /// OFF3 of every drive.
    EmergencyStop,
    /// Faults acknowledged.
    Acknowledge,
    /// A new core, and a new parent roll if the old one is used up.
    NewSet,
    /// Auto-tune of a loop by its number in `autotune_loop`, from any standstill.
    Autotune(u16),
    /// Drives off, at standstill: what comes before the panel is left.
    SwitchOff,
    /// One thing at a time, as an operator of a PLC asks for it: drives on.
    SwitchOn,
    /// An empty core.
    NewCore,
    /// A parent roll, and its diameter as the operator has measured it.
    NewParentRoll,
    /// The web led through.
    LeadWeb,
    /// The web taken out.
    RemoveWeb,
}

/// Push-buttons of the operator's desk, which the panel follows where no PLC does, but for run, stop and the counter.
const BUTTONS: [(u16, Action); 9] = [
    (request::EMERGENCY_STOP, Action::EmergencyStop),
    (request::DRIVES_OFF, Action::SwitchOff),
    (request::ACKNOWLEDGE, Action::Acknowledge),
    (request::NEW_CORE, Action::NewCore),
    (request::NEW_PARENT_ROLL, Action::NewParentRoll),
    (request::WEB_REMOVED, Action::RemoveWeb),
    (request::DRIVES_ON, Action::SwitchOn),
    (request::WEB_LED, Action::LeadWeb),
    (request::THREAD, Action::Thread),
];

/// As an operator says it.
impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Prepare => "prepare",
            Self::Thread => "thread",
            Self::Run(_) => "run",
            Self::Stop => "stop",
            Self::EmergencyStop => "emergency stop",
            Self::Acknowledge => "acknowledge",
            Self::NewSet => "new set",
            Self::Autotune(_) => "auto-tune",
            Self::SwitchOff => "switch off",
            Self::SwitchOn => "switch on",
            Self::NewCore => "new core",
            Self::NewParentRoll => "new parent roll",
            Self::LeadWeb => "web led through",
            Self::RemoveWeb => "web taken out",
        })?;
        match self {
            Self::Run(Order { v_set_m_min, goal }) => {
                if let Some(speed) = v_set_m_min {
                    write!(f, " at {speed} m/min")?;
                }
                if let Some(length) = goal.length_m {
                    write!(f, " to {length} m")?;
                }
                if let Some(diameter) = goal.diameter_mm {
                    write!(f, " to {diameter} mm")?;
                }
                Ok(())
            }
            Self::Autotune(number) => match LOOPS.get(usize::from(*number)) {
                Some(name) => write!(f, " of the {name}"),
                None => Ok(()),
            },
            _ => Ok(()),
        }
    }
}

/// What to wind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Order {
    /// Web speed, m/min; the one before if none is given.
    pub v_set_m_min: Option<f32>,
    /// Where to stop.
    pub goal: Goal,
}

/// Where a set ends. Of both, what comes first; of none, where somebody stops it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Goal {
    /// Length on the shipping roll, m.
    pub length_m: Option<f32>,
    /// Diameter of the shipping roll, mm.
    pub diameter_mm: Option<f32>,
}

/// Why something is not done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wrong {
    /// It does not go with the present state.
    NotNow(State),
    /// A value is outside its limits.
    Outside {
        /// The name of the value.
        parameter: &'static str,
        /// What was given.
        value: f32,
        /// Smallest permitted value.
        low: f32,
        /// Largest permitted value.
        high: f32,
        /// Unit of all three.
        unit: &'static str,
    },
}

/// Where the set is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Drives off, or no web.
    Off,
    /// Rolls, drives and web are made ready.
    Preparing,
    /// Drives on, web led through, slack.
    Ready,
    /// Slack is taken up.
    Threading,
    /// Web under tension: in thread, or at standstill.
    Threaded,
    /// The roll grows.
    Running,
    /// The machine stops.
    Stopping,
    /// A loop is being tuned.
    Tuning,
}

impl State {
    /// As it travels.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Preparing => "preparing",
            Self::Ready => "ready",
            Self::Threading => "threading",
            Self::Threaded => "threaded",
            Self::Running => "running",
            Self::Stopping => "stopping",
            Self::Tuning => "tuning",
        }
    }
}

/// One step of a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    SwitchOff,
    Acknowledge,
    RemoveWeb,
    NewRolls,
    NewCore,
    NewParentRoll,
    Preset,
    SwitchOn,
    LeadWeb,
    Thread,
    Tension,
    Run,
    Stop,
    EmergencyStop,
    Tune,
}

impl Step {
    /// What happens, for the operator.
    const fn text(self) -> &'static str {
        match self {
            Self::SwitchOff => "switching the drives off",
            Self::Acknowledge => "acknowledging faults",
            Self::RemoveWeb => "taking the web out",
            Self::NewRolls => "putting in a core and a parent roll",
            Self::NewCore => "putting in a core",
            Self::NewParentRoll => "putting in a parent roll",
            Self::Preset => "the drive takes over the parent roll's diameter",
            Self::SwitchOn => "switching the drives on",
            Self::LeadWeb => "leading the web through",
            Self::Thread => "taking up slack",
            Self::Tension => "building up tension",
            Self::Run => "winding",
            Self::Stop => "stopping",
            Self::EmergencyStop => "emergency stop",
            Self::Tune => "tuning",
        }
    }

    /// The winder's command word. A bit that acts on its rising edge stands in one step only.
    const fn word(self) -> u16 {
        match self {
            Self::Acknowledge => command::ACKNOWLEDGE,
            Self::RemoveWeb => command::WEB_REMOVED,
            Self::NewRolls => command::NEW_CORE | command::NEW_PARENT_ROLL,
            Self::NewCore => command::NEW_CORE,
            Self::NewParentRoll => command::NEW_PARENT_ROLL,
            Self::Preset => command::PRESET_ACCEPT,
            Self::LeadWeb => command::WEB_THREADED,
            Self::Thread | Self::Tension => command::THREAD,
            Self::Run => command::RUN,
            Self::Tune => command::AUTOTUNE,
            Self::SwitchOff | Self::SwitchOn | Self::Stop | Self::EmergencyStop => 0,
        }
    }

    /// Control word 1 of every drive; none keeps the one before.
    const fn stw1(self) -> Option<u16> {
        match self {
            Self::SwitchOff => Some(stw1::READY),
            Self::SwitchOn => Some(stw1::RUN),
            Self::EmergencyStop => Some(stw1::RUN & !stw1::NO_QUICK_STOP),
            _ => None,
        }
    }

    /// How long it may take, drive cycles; none for as long as it likes.
    const fn limit(self) -> Option<u32> {
        match self {
            Self::Run => None,
            Self::Thread => Some(cycles(60_000)),
            Self::Tension => Some(cycles(30_000)),
            // from the highest speed of any machine, slowly
            Self::Stop | Self::EmergencyStop => Some(cycles(900_000)),
            Self::Tune => Some(cycles(600_000)),
            Self::SwitchOff => Some(cycles(15_000)),
            _ => Some(cycles(5_000)),
        }
    }

    /// The state while it lasts.
    const fn state(self) -> State {
        match self {
            Self::Thread | Self::Tension => State::Threading,
            Self::Run => State::Running,
            Self::Stop | Self::EmergencyStop => State::Stopping,
            Self::Tune => State::Tuning,
            _ => State::Preparing,
        }
    }

    /// A fault does not end it.
    const fn bears_faults(self) -> bool {
        matches!(
            self,
            Self::SwitchOff | Self::Acknowledge | Self::Stop | Self::EmergencyStop
        )
    }
}

/// The numbers of the machine that the panel goes by.
#[derive(Clone, Copy, Debug)]
struct Numbers {
    core_mm: f32,
    full_mm: f32,
    parent_mm: f32,
    used_up_mm: f32,
    caliper_mm: f32,
    v_max_m_min: f32,
}

impl Numbers {
    fn of(machine: &Machine) -> Self {
        let diameter_mm = |radius_m: f64| (2e3 * radius_m) as f32;
        Self {
            core_mm: diameter_mm(machine.shipping_roll.core_radius_m),
            full_mm: diameter_mm(machine.shipping_roll.full_radius_m),
            parent_mm: diameter_mm(machine.parent_roll.full_radius_m),
            used_up_mm: USED_UP * diameter_mm(machine.parent_roll.expire_radius_m),
            caliper_mm: (1e3 * machine.web.caliper_m) as f32,
            v_max_m_min: machine.operation.max_speed_m_s as f32 * SECONDS_PER_MINUTE,
        }
    }
}

/// The panel.
#[derive(Clone, Debug)]
pub struct Panel {
    numbers: Numbers,
    /// What is left to do, the present step first.
    steps: Vec<Step, STEPS>,
    /// Drive cycles in the present step.
    since: u32,
    /// Drive cycles for which the tension has been that of standstill.
    settled: u32,
    /// The refusal that stood when the step began.
    refusal: u16,
    /// What stands between two lists.
    word: u16,
    stw1: u16,
    v_set_m_min: Option<f32>,
    tune: u16,
    goal: Goal,
    /// The set that runs, or has run last, has come to its goal.
    at_goal: bool,
    /// Sets that have.
    sets: u16,
    /// Diameter of the parent roll as the operator has measured it, mm; 0 is a full one.
    measured_mm: f32,
    /// Push-buttons of the desk that are pressed.
    pressed: u16,
    message: &'static str,
}

impl Panel {
    /// A panel that nobody has touched.
    pub fn new(machine: &Machine) -> Self {
        Self {
            numbers: Numbers::of(machine),
            steps: Vec::new(),
            since: 0,
            settled: 0,
            refusal: 0,
            word: 0,
            stw1: stw1::READY,
            v_set_m_min: None,
            tune: 0,
            goal: Goal::default(),
            at_goal: false,
            sets: 0,
            measured_mm: 0.0,
            pressed: u16::MAX,
            message: "",
        }
    }

    /// Where the set is.
    pub fn state(&self, feedback: &Feedback) -> State {
        if let Some(step) = self.steps.first() {
            return step.state();
        }
        let is = |bits| is(feedback, bits);
        match mode(feedback) {
            Mode::Ready if is(status::WEB_THREADED) => State::Ready,
            Mode::Off | Mode::Ready => State::Off,
            Mode::Thread if is(status::TENSION_DETECTED) => State::Threaded,
            Mode::Thread => State::Threading,
            Mode::Stall => State::Threaded,
            Mode::Run => State::Running,
            Mode::AutoTune => State::Tuning,
            _ => State::Stopping,
        }
    }

    /// What happens, or why it does not.
    pub fn message(&self) -> &'static str {
        self.steps.first().map_or(self.message, |step| step.text())
    }

    /// Where the set ends.
    pub fn goal(&self) -> Goal {
        self.goal
    }

    /// Asks for something. What cannot be done changes nothing.
    pub fn act(&mut self, action: Action, feedback: &Feedback) -> Result<(), Wrong> {
        use Step::*;
        let state = self.state(feedback);
        let at_rest = matches!(state, State::Off | State::Ready | State::Threaded)
            && is(feedback, status::ZERO_SPEED);
        let web = is(feedback, status::WEB_THREADED);
        let ok = match action {
            Action::Prepare
            | Action::NewSet
            | Action::SwitchOff
            | Action::SwitchOn
            | Action::NewCore
            | Action::NewParentRoll
            | Action::LeadWeb
            | Action::RemoveWeb => at_rest,
            Action::Autotune(loop_) => at_rest && usize::from(loop_) < LOOPS.len(),
            Action::Thread => {
                state == State::Ready || state == State::Threaded && mode(feedback) == Mode::Stall
            }
            Action::Run(_) => {
                let tight = state == State::Threading && is(feedback, status::TENSION_DETECTED);
                tight || matches!(state, State::Threaded | State::Running)
            }
            Action::Stop => !matches!(state, State::Off | State::Ready),
            Action::Acknowledge => self.steps.is_empty(),
            Action::EmergencyStop => true,
        };
        if !ok {
            return Err(Wrong::NotNow(state));
        }
        match action {
            Action::Prepare => self.begin(
                feedback,
                [
                    Some(SwitchOff),
                    Some(Acknowledge),
                    web.then_some(RemoveWeb),
                    Some(NewRolls),
                    Some(Preset),
                    Some(SwitchOn),
                    Some(LeadWeb),
                ],
            ),
            Action::NewSet => {
                let d_uw: f32 = feedback.get(&image::D_UW);
                let used_up = d_uw < self.numbers.used_up_mm;
                let preset = used_up || !is(feedback, status::PRESET_TAKEN);
                self.begin(
                    feedback,
                    [
                        Some(SwitchOff),
                        Some(Acknowledge),
                        (web && used_up).then_some(RemoveWeb),
                        Some(if preset { NewRolls } else { NewCore }),
                        preset.then_some(Preset),
                        Some(SwitchOn),
                        (!web || used_up).then_some(LeadWeb),
                    ],
                );
            }
            Action::Autotune(number) => {
                const TENSION: u16 = 2;
                self.tune = number;
                let tension = number == TENSION;
                let preset = !is(feedback, status::PRESET_TAKEN);
                self.begin(
                    feedback,
                    [
                        Some(SwitchOff),
                        Some(Acknowledge),
                        (web && !tension).then_some(RemoveWeb),
                        preset.then_some(NewRolls),
                        preset.then_some(Preset),
                        Some(SwitchOn),
                        (tension && !web).then_some(LeadWeb),
                        tension.then_some(Thread),
                        tension.then_some(Tension),
                        Some(Tune),
                    ],
                );
            }
            Action::Thread => self.begin(feedback, [Some(Thread), Some(Tension)]),
            Action::Run(order) => {
                self.check(&order)?;
                self.goal = order.goal;
                self.v_set_m_min = order.v_set_m_min.or(self.v_set_m_min);
                // a set that runs takes another speed or goal without a new start
                if self.steps.first() != Some(&Run) {
                    self.at_goal = false;
                    self.begin(feedback, [Some(Run), Some(Stop)]);
                }
            }
            Action::Stop => self.begin(feedback, [Some(Stop)]),
            Action::EmergencyStop => self.begin(feedback, [Some(EmergencyStop), Some(SwitchOff)]),
            Action::Acknowledge => self.begin(feedback, [Some(Acknowledge)]),
            Action::SwitchOff => self.begin(feedback, [Some(SwitchOff)]),
            Action::SwitchOn => self.begin(feedback, [Some(SwitchOn)]),
            Action::NewCore => self.begin(feedback, [Some(NewCore)]),
            Action::NewParentRoll => self.begin(feedback, [Some(NewParentRoll), Some(Preset)]),
            Action::LeadWeb => self.begin(feedback, [Some(LeadWeb)]),
            Action::RemoveWeb => self.begin(feedback, [Some(RemoveWeb)]),
        }
        Ok(())
    }

    /// One drive cycle: what the drives say, what to command. The simulator's own words stay as they are.
    pub fn cycle(&mut self, feedback: &Feedback, commands: &mut Commands) {
        self.follow_desk(feedback, commands);
        let tension: f32 = feedback.get(&image::TENSION);
        let stall: f32 = commands.get(&image::STALL_SET);
        self.settled = match (tension - stall).abs() <= SETTLED_BAND * stall {
            true => self.settled.saturating_add(1),
            false => 0,
        };
        if let Some(&step) = self.steps.first() {
            self.since = self.since.saturating_add(1);
            let fault = feedback.word(&image::FAULT);
            if fault != 0 && !step.bears_faults() {
                self.give_up(Fault::ALL.get(usize::from(fault)).map_or("", |f| f.name()));
            } else if self.since >= STEP && self.finished(step, feedback, commands) {
                self.at_goal |= step == Step::Run && self.time_to_stop(feedback, commands);
                self.next(feedback);
            } else if let Some(refusal) = self.refused(feedback) {
                self.give_up(refusal.name());
            } else if step.limit().is_some_and(|limit| self.since > limit) {
                self.give_up("a step took too long");
            }
        }
        let (word, control) = match self.steps.first() {
            Some(step) => (step.word(), step.stw1()),
            // what has ended by itself is not held any longer
            None if matches!(mode(feedback), Mode::Thread | Mode::Run) => (self.word, None),
            None => (0, None),
        };
        self.word = word;
        self.stw1 = control.unwrap_or(self.stw1);

        let beat = commands.word(&image::HEARTBEAT_PLC).wrapping_add(1);
        commands.set_word(&image::HEARTBEAT_PLC, beat);
        commands.set_word(&image::WINDER_COMMAND, self.word);
        for signal in image::STW1 {
            commands.set_word(signal, self.stw1);
        }
        commands.set_word(&image::AUTOTUNE_LOOP, self.tune);
        commands.set(&image::D_PRESET_UW, self.preset_mm());
        commands.set_word(&image::PLC_SETS, self.sets);
        if let Some(v_set_m_min) = self.v_set_m_min {
            commands.set(&image::V_SET, v_set_m_min);
        }
    }

    /// The parent roll's diameter as the drive shall take it over, mm.
    fn preset_mm(&self) -> f32 {
        match self.measured_mm > 0.0 {
            true => self.measured_mm,
            false => self.numbers.parent_mm,
        }
    }

    /// The push-buttons and set-points of the operator's desk count here, where no PLC reads them.
    fn follow_desk(&mut self, feedback: &Feedback, commands: &mut Commands) {
        self.measured_mm = commands.get(&image::OPERATOR_PARENT);
        let now = commands.word(&image::OPERATOR_REQUEST);
        let pressed = now & !core::mem::replace(&mut self.pressed, now);
        if pressed & request::RESET_SETS != 0 {
            self.sets = 0;
        }
        let set = |signal| Some(commands.get::<f32>(signal)).filter(|value| *value > 0.0);
        let tension = set(&image::OPERATOR_TENSION_SET);
        let order = Order {
            v_set_m_min: set(&image::OPERATOR_V_SET),
            goal: Goal {
                length_m: set(&image::OPERATOR_LENGTH_SET),
                diameter_mm: set(&image::OPERATOR_DIAMETER_SET),
            },
        };
        let others = [
            (request::STOP, Action::Stop),
            (request::RUN, Action::Run(order)),
        ];
        for (button, action) in BUTTONS.into_iter().chain(others) {
            if pressed & button == 0 {
                continue;
            }
            match self.act(action, feedback) {
                Ok(()) if button == request::RUN => {
                    if let Some(tension) = tension {
                        commands.set(&image::TENSION_SET, tension);
                    }
                }
                Ok(()) => {}
                Err(Wrong::NotNow(_)) => self.message = "not now",
                Err(Wrong::Outside { .. }) => self.message = "the desk asks for more than there is",
            }
        }
    }

    /// Refuses what cannot be wound.
    fn check(&self, order: &Order) -> Result<(), Wrong> {
        let n = &self.numbers;
        for (parameter, value, low, high, unit) in [
            (
                "v_set_m_min",
                order.v_set_m_min,
                0.0,
                n.v_max_m_min,
                "m/min",
            ),
            ("length_m", order.goal.length_m, 1.0, LENGTH_MAX_M, "m"),
            (
                "diameter_mm",
                order.goal.diameter_mm,
                n.core_mm,
                n.full_mm,
                "mm",
            ),
        ] {
            // not a number is inside of nothing
            if let Some(value) = value
                && !(low..=high).contains(&value)
            {
                return Err(Wrong::Outside {
                    parameter,
                    value,
                    low,
                    high,
                    unit,
                });
            }
        }
        Ok(())
    }

    fn begin<const N: usize>(&mut self, feedback: &Feedback, steps: [Option<Step>; N]) {
        const { assert!(N <= STEPS) };
        self.steps = steps.into_iter().flatten().collect();
        self.message = "";
        self.enter(feedback);
    }

    fn enter(&mut self, feedback: &Feedback) {
        self.since = 0;
        self.settled = 0;
        self.refusal = feedback.word(&image::REFUSAL);
    }

    fn next(&mut self, feedback: &Feedback) {
        let done = self.steps.remove(0);
        if self.steps.is_empty() {
            self.word = done.word() & command::THREAD;
            let wound = done == Step::Stop && core::mem::take(&mut self.at_goal);
            self.sets = self.sets.wrapping_add(u16::from(wound));
            self.message = match done {
                Step::Stop => "the machine stands",
                Step::Tension => "the web is under tension",
                Step::Tune => tuned(feedback),
                _ => "",
            };
        }
        self.enter(feedback);
    }

    fn give_up(&mut self, why: &'static str) {
        self.steps.clear();
        self.word = 0;
        self.message = why;
    }

    /// A refusal that has come since the step began.
    fn refused(&self, feedback: &Feedback) -> Option<Refusal> {
        let code = feedback.word(&image::REFUSAL);
        let new = code != Refusal::None as u16 && code != self.refusal && self.since >= STEP;
        new.then(|| Refusal::ALL.get(usize::from(code)).copied())
            .flatten()
    }

    /// Has the step reached its end?
    fn finished(&self, step: Step, feedback: &Feedback, commands: &Commands) -> bool {
        let is = |bits| is(feedback, bits);
        let drives = |bits| {
            image::ZSW1
                .iter()
                .all(|zsw1| feedback.word(zsw1) & bits == bits)
        };
        let near = |signal, mm: f32| (feedback.get::<f32>(signal) - mm).abs() < NEAR_MM;
        let mode = mode(feedback);
        let stands =
            is(status::ZERO_SPEED) && matches!(mode, Mode::Off | Mode::Ready | Mode::Stall);
        match step {
            Step::SwitchOff => mode == Mode::Off && drives(zsw1::READY_TO_SWITCH_ON),
            Step::Acknowledge => feedback.word(&image::FAULT) == Fault::None as u16,
            Step::RemoveWeb => !is(status::WEB_THREADED),
            Step::NewRolls | Step::NewCore => near(&image::D_WU, self.numbers.core_mm),
            // A parent roll that is put in takes the preset away.
            Step::NewParentRoll => !is(status::PRESET_TAKEN),
            Step::Preset => is(status::PRESET_TAKEN) && near(&image::D_UW, self.preset_mm()),
            Step::SwitchOn => drives(zsw1::OPERATION_ENABLED) && is(status::DRIVES_ON),
            Step::LeadWeb => is(status::WEB_THREADED),
            Step::Thread => is(status::TENSION_DETECTED),
            Step::Tension => self.settled >= SETTLED,
            Step::Run => self.time_to_stop(feedback, commands) || mode != Mode::Run,
            Step::Stop => stands,
            Step::EmergencyStop => stands,
            Step::Tune => {
                let step = feedback.word(&image::AUTOTUNE_STEP);
                mode != Mode::AutoTune
                    && (step == u16::from(TuneStep::Done.number())
                        || step == u16::from(TuneStep::Aborted.number()))
            }
        }
    }

    /// Will the set be at its goal when the machine stands, if it stops now?
    fn time_to_stop(&self, feedback: &Feedback, commands: &Commands) -> bool {
        let v = feedback.get::<f32>(&image::V_REF) / SECONDS_PER_MINUTE;
        let a = feedback.get::<f32>(&image::A_REF).max(0.0);
        let cycle_s = 1e-3 * DRIVE_PERIOD_MS as f32;
        // the command arrives two cycles later
        let stop_m = stop_m(
            v,
            a,
            commands.get(&image::ACCEL_SET),
            commands.get(&image::JERK_SET),
        ) + 2.0 * cycle_s * v;
        let by_length = self.goal.length_m.map(|length_m| {
            // 32 bits of counts do not fit into an f32
            let wound_m = feedback.get::<f64>(&image::LENGTH_WU);
            (f64::from(length_m) - wound_m) as f32
        });
        let by_diameter = self.goal.diameter_mm.map(|goal| {
            let d: f32 = feedback.get(&image::D_WU);
            PI * (goal * goal - d * d) / (4.0 * self.numbers.caliper_mm) * 1e-3
        });
        let left = [by_length, by_diameter].into_iter().flatten();
        left.into_iter().any(|left_m| left_m <= stop_m)
    }
}

fn is(feedback: &Feedback, bits: u16) -> bool {
    feedback.word(&image::WINDER_STATUS) & bits == bits
}

/// The winder's mode; a code that is none is no mode to do anything in.
fn mode(feedback: &Feedback) -> Mode {
    let code = usize::from(feedback.word(&image::MODE));
    Mode::ALL.get(code).copied().unwrap_or(Mode::CoastStop)
}

fn tuned(feedback: &Feedback) -> &'static str {
    let step = usize::from(feedback.word(&image::AUTOTUNE_STEP));
    TuneStep::TEXTS.get(step).copied().unwrap_or("")
}

/// Web that runs until standstill, m, on an S-curve from speed `v`, m/s, while still accelerating with `a` ≥ 0, m/s².
///
/// The acceleration first goes to zero: t₀ = a/j, v₀ = v + a²/2j, s₀ = v·t₀ + a³/3j². Then the speed falls,
/// symmetrically in time, so that the mean speed is v₀/2: T = v₀/a_max + a_max/j with a stretch of constant
/// deceleration, T = 2·√(v₀/j) without.
fn stop_m(v: f32, a: f32, a_max: f32, j: f32) -> f32 {
    let v_0 = v + a * a / (2.0 * j);
    let s_0 = v * a / j + a * a * a / (3.0 * j * j);
    let fall_s = if v_0 >= a_max * a_max / j {
        v_0 / a_max + a_max / j
    } else {
        2.0 * Real::sqrt(v_0 / j)
    };
    s_0 + 0.5 * v_0 * fall_s
}
