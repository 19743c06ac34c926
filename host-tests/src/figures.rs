//! The figures: the paper's 7 to 14 as this simulator gives them, and those of the physics.
//!
//! Not here: how they are drawn (that is [`crate::plot`]'s), and the proof: what a figure shows, a test checks.
//!
//! The paper sets an actual winder beside its simulator, two figures each. Here the pair is one figure: what the
//! simulator gives, with what it has to be compared with.

use anyhow::{Context, Result};
use model_core::exchange::{Actuators, Brakes, BySection};
use model_core::image::{self, Image, Signal};
use model_core::machine::Machine;
use model_core::plant::Winder;
use model_core::real::{Compensated, Plain, Sum};

use crate::plot::{Curve, Figure, Ink, Panel, Points};
use crate::report::TENSION_BAND;
use crate::scenario::place::{Assignment, Given};
use crate::scenario::{Scenario, library, lockstep, seconds};

/// Heights of diagrams.
const LOW: f64 = 170.0;
const HIGH: f64 = 240.0;
/// The step of the plant, s.
const STEP_S: f64 = 0.004;
/// A step so short that what holds a speed can take back what it gained, s.
const FINE_S: f64 = 1e-4;
/// Run speed of the default machine, m/s.
const RUN_M_S: f64 = 2200.0 / 60.0;

/// A figure and its file's name, without ending.
pub struct Named {
    /// The name.
    pub name: &'static str,
    /// The figure.
    pub figure: Figure,
}

/// All figures.
pub fn all() -> Result<Vec<Named>> {
    let mut all = paper()?;
    all.push(operators_lesson()?);
    all.extend([span_lag()?, brakes()?, slip()?, sums()]);
    Ok(all)
}

fn named(name: &'static str, figure: Figure) -> Named {
    Named { name, figure }
}

/// What a drive cycle of a run left.
struct Moment {
    t_s: f64,
    image: Image,
    /// The parent roll's diameter, mm: ground truth.
    d_uw: f64,
}

/// The run of a scenario of the library, with some other commands from power-up on.
fn run(name: &str, set: &[(&str, Given)]) -> Result<Vec<Moment>> {
    let path = library().join(name).with_extension("toml");
    let mut scenario = Scenario::open(&path)?;
    for (signal, given) in set {
        scenario.set.extend(Assignment::of(signal, given)?);
    }
    let mut moments = Vec::new();
    lockstep::play(&scenario, |bench, _| {
        let x = bench.simulator.plant.winder().state();
        moments.push(Moment {
            t_s: seconds(bench.cycle),
            image: bench.image,
            d_uw: 2e3 * f64::from(x.r_uw),
        });
    })
    .with_context(|| format!("cannot play the scenario {name}"))?;
    Ok(moments)
}

fn points(run: &[Moment], of: impl Fn(&Moment) -> f64) -> Points {
    run.iter().map(|moment| (moment.t_s, of(moment))).collect()
}

fn signal(run: &[Moment], signal: &Signal) -> Points {
    points(run, |moment| moment.image.feedback.get(signal))
}

fn panel(title: &str, height: f64, curves: Vec<Curve>) -> Panel {
    Panel {
        title: title.to_owned(),
        height,
        curves,
        band: None,
    }
}

fn over_time(title: &str, subtitle: &str, panels: Vec<Panel>, caption: &str) -> Figure {
    Figure {
        title: title.to_owned(),
        subtitle: subtitle.to_owned(),
        panels,
        axis: "time, s".to_owned(),
        caption: caption.to_owned(),
    }
}

/// Until this time the beginning of a run is looked at closely, s.
const START_S: f64 = 20.0;

/// Figures 7 to 14 from one whole set.
fn paper() -> Result<Vec<Named>> {
    const SET: &str =
        "a whole set: newsprint 45 g/m², 8 m wide, to 1 250 mm at 2 200 m/min; full_set.toml";
    let run = run("full_set", &[])?;
    let curve = |name: &str, ink, s: &Signal| Curve::new(name, ink, signal(&run, s));
    let mut tension = panel(
        "Web tension between guide and spreader rolls, N/m",
        HIGH,
        vec![
            curve("reference ±10 %", Ink::Reference, &image::TENSION_REF),
            curve("measured", Ink::Orange, &image::TENSION),
        ],
    );
    tension.band = Some((signal(&run, &image::TENSION_REF), TENSION_BAND));
    let speed = vec![
        curve("reference", Ink::Reference, &image::V_REF),
        curve("measured", Ink::Blue, &image::V_WEB),
    ];
    let torques = vec![
        curve("rear drum", Ink::Orange, &image::TORQUE_RD),
        curve("front drum", Ink::Green, &image::TORQUE_FD),
    ];
    let sound = self::run("operator_start", &[])?;
    let bare = [("fault_drives.bare_estimator", Given::Switch(true))];
    let bare = self::run("operator_start", &bare)?;
    let diameters = vec![
        curve("parent roll, estimate", Ink::Blue, &image::D_UW),
        Curve::new(
            "parent roll, true",
            Ink::Reference,
            points(&run, |m| m.d_uw),
        ),
        curve("shipping roll", Ink::Orange, &image::D_WU),
    ];
    let error = |run: &[Moment]| {
        let early = run.iter().filter(|moment| moment.t_s <= START_S);
        let error = |m: &Moment| m.image.feedback.get::<f64>(&image::D_UW) - m.d_uw;
        early.map(|moment| (moment.t_s, error(moment))).collect()
    };
    let start = vec![
        Curve::new("with interlocks", Ink::Blue, error(&sound)),
        Curve::new("without", Ink::Orange, error(&bare)),
    ];
    Ok(vec![
        named(
            "07-08-speed",
            over_time(
                "Web speed (the paper's figures 7 and 8)",
                SET,
                vec![panel("Web speed, m/min", HIGH, speed)],
                "Compare: the measured speed lies on its reference; it starts at zero, goes through thread speed, and \
                 rounds off into run speed and into standstill. The paper finds actual and simulated speed virtually \
                 identical, but for the start at zero.",
            ),
        ),
        named(
            "09-10-tension",
            over_time(
                "Web tension and its reference (the paper's figures 9 and 10)",
                SET,
                vec![tension],
                "Compare: disturbances stand where the speed begins or ends to change, as in both of the paper's figures, \
                 and stay within the band. There is no steady error: the paper's actual winder had one from a wrap angle \
                 that was compensated wrongly (scenario fault_wrap_angle), and noise from rolls out of round \
                 (fault_eccentricity_uw).",
            ),
        ),
        named(
            "11-12-torques",
            over_time(
                "Drum torques (the paper's figures 11 and 12)",
                SET,
                vec![panel("Motor torque, % of rated", HIGH, torques)],
                "Compare: the torques step with the acceleration; at constant speed the front drum's share goes from 60 to 52 %; \
                 in the stop both change their sign, and grow while friction helps less and less. The paper finds the same \
                 dynamics in both of its figures, and another level in one.",
            ),
        ),
        named(
            "13-14-diameters",
            over_time(
                "Roll diameters (the paper's figures 13 and 14)",
                SET,
                vec![panel("Diameter, mm", HIGH, diameters)],
                "Compare: the estimate lies on the true diameter of the parent roll from start to stop, and the shipping \
                 roll ends at 1 250 mm.",
            ),
        ),
        named(
            "14-estimate-at-start",
            over_time(
                "The estimate of the diameter at the start (the paper's figure 14)",
                "preset of 3 000 mm, thread, start; operator_start.toml",
                vec![panel(
                    "Estimated diameter of the parent roll less the true one, mm",
                    HIGH,
                    start,
                )],
                "Compare: without interlocks the estimate is the ratio of two encoders that have nothing to measure while \
                 the slack is taken up: the spike at the start of the paper's figure 14, for which it asks for \
                 interlocking. With interlocks there is none. (Scenario fault_bare_estimator.)",
            ),
        ),
    ])
}

/// The same start with the right diameter preset and with one that is 3.3 % low.
fn operators_lesson() -> Result<Named> {
    /// With either preset the web is under tension from here on, s.
    const PULLS_S: f64 = 25.0;
    const PRESET: [(&str, f64, Ink); 2] = [
        ("preset 3 000 mm: right", 3000.0, Ink::Blue),
        ("preset 2 901 mm: 3.3 % low", 2901.0, Ink::Orange),
    ];
    let (mut curves, mut deviations) = (Vec::new(), Vec::new());
    for (name, preset, ink) in PRESET {
        let mut run = run("operator_start", &[("d_preset_uw", Given::Number(preset))])?;
        run.retain(|moment| moment.t_s < 60.0);
        if curves.is_empty() {
            let reference = signal(&run, &image::TENSION_REF);
            curves.push(Curve::new("reference", Ink::Reference, reference));
        }
        curves.push(Curve::new(name, ink, signal(&run, &image::TENSION)));
        let started = run.iter().filter(|moment| moment.t_s > PULLS_S);
        let deviation = started.map(|moment| {
            let get = |signal| moment.image.feedback.get::<f64>(signal);
            let ratio = get(&image::TENSION) / get(&image::TENSION_REF);
            (moment.t_s, 100.0 * (ratio - 1.0))
        });
        deviations.push(Curve::new(name, ink, deviation.collect()));
    }
    Ok(named(
        "operators-lesson",
        over_time(
            "The operator's lesson: a wrong diameter preset",
            "thread and start to 2 200 m/min with a full parent roll; operator_start.toml",
            vec![
                panel("Web tension, N/m", HIGH, curves),
                panel("Its deviation from the reference, %", LOW, deviations),
            ],
            "Compare: with the low preset the slack is taken up late, and when the machine starts at 30 s, the tension rises \
             above its reference by more than twice as much, since the drive believes in less inertia than there is. It is \
             the case that the paper trains operators with: on a real winder it can end in a web break.",
        ),
    ))
}

/// A winder in f64 that is put into a state at run speed.
fn winder(machine: &Machine, step_s: f64) -> Result<Winder<f64, 3>> {
    Winder::new(machine, step_s).context("the default machine cannot be built")
}

/// Tensions after all speeds behind a span rise by 0.1 %.
fn span_lag() -> Result<Named> {
    let machine = Machine::news_8000();
    let lengths = [
        machine.idle[0].span_m,
        machine.idle[1].span_m,
        machine.last_span_m,
    ];
    let stiffness = machine.web.stiffness_n_m * machine.web.width_m;
    let inks = [Ink::Blue, Ink::Orange, Ink::Green];
    let names = ["6.0 m: L/V = 164 ms", "3.0 m: 82 ms", "2.5 m: 68 ms"];
    let mut curves = Vec::new();
    for (i, length) in lengths.into_iter().enumerate() {
        let mut winder = winder(&machine, FINE_S)?;
        winder.thread_at(machine.operation.tension_n_m * machine.web.width_m);
        // rolls that keep the web at one strain
        let strain = winder.state().strain[0];
        let mut v = [RUN_M_S * (1.0 + strain); 3];
        v[i..].fill(1.001 * RUN_M_S * (1.0 + strain));
        let before = winder.tension()[i];
        let mut curve = Points::new();
        for step in 0..6000_u32 {
            // the speeds are held
            let mut x = winder.state();
            x.v = v;
            x.windup = [v[2]; 3];
            x.omega_uw = RUN_M_S / x.r_uw;
            winder.set_state(&x);
            if step.is_multiple_of(40) {
                curve.push((FINE_S * f64::from(step), winder.tension()[i] - before));
            }
            winder.step(&Actuators::default());
        }
        curves.push(Curve::new(names[i], inks[i], curve));
        if i == 0 {
            let steady = stiffness * (1.0 + strain) * 0.001;
            let closed = |k: u32| {
                let t = 0.004 * f64::from(k);
                (t, steady * (1.0 - (-t * RUN_M_S / length).exp()))
            };
            curves.push(Curve::new(
                "1 − exp(−t·V/L)",
                Ink::Reference,
                (0..150).map(closed).collect(),
            ));
        }
    }
    Ok(named(
        "span-lag",
        over_time(
            "A span lags by its length over its speed",
            "the speed at a span's end rises by 0.1 % at 2 200 m/min, all speeds held",
            vec![panel("Rise of the tension, N", HIGH, curves)],
            "Compare: every span ends at EA·(1+ε)·0.1 %, about 2 083 N, and is at 63 % of it after L/V. The step at once is the \
             web's viscosity, EA·τ_v·ΔV/L.",
        ),
    ))
}

/// Stall of a braked unwind: the set-valued law beside the paper's.
fn brakes() -> Result<Named> {
    const LAWS: [(&str, f64, Ink); 3] = [
        ("set-valued", 0.0, Ink::Blue),
        ("Karnopp, ΔV = 0.005 m/s", 0.005, Ink::Green),
        ("Karnopp, ΔV = 0.05 m/s", 0.05, Ink::Orange),
    ];
    let mut curves = Vec::new();
    for (name, band, ink) in LAWS {
        let mut machine = Machine::news_8000();
        machine.brakes.karnopp_m_s = band;
        let tension = machine.operation.tension_n_m * machine.web.width_m;
        let mut winder = winder(&machine, STEP_S)?;
        winder.thread_at(tension);
        let mut x = winder.state();
        x.omega_uw = 0.01;
        winder.set_state(&x);
        let actuators = Actuators {
            // the drums hold the web by their motors, too
            torque: BySection {
                rd: tension * machine.rear_drum.radius_m,
                ..BySection::default()
            },
            brakes: Brakes::all(true),
            ..Actuators::default()
        };
        let mut curve = Points::new();
        for step in 0..2000_u32 {
            if step.is_multiple_of(5) {
                curve.push((STEP_S * f64::from(step), winder.tension()[0]));
            }
            winder.step(&actuators);
        }
        curves.push(Curve::new(name, ink, curve));
    }
    Ok(named(
        "brake-hold",
        over_time(
            "A brake that holds, and the paper's that creeps",
            "web under 2 800 N between standing rolls; the unwind comes to its brake with 0.01 rad/s",
            vec![panel("Tension at the unwind, N", HIGH, curves)],
            "Compare: the set-valued law ends the motion and keeps the tension for good. The Karnopp model balances the forces in \
             its band and leaves the speed: the roll creeps on until the web is slack.",
        ),
    ))
}

/// The front drum under a rising torque, until its nip slides.
fn slip() -> Result<Named> {
    let mut machine = Machine::news_8000();
    machine.nips.slip = true;
    let mut winder = winder(&machine, STEP_S)?;
    let (v, r_wu) = (20.0, 0.3);
    let mut x = winder.state();
    (x.v, x.windup, x.r_wu) = ([v; 3], [v; 3], r_wu);
    x.omega_uw = v / x.r_uw;
    winder.set_state(&x);
    let (mut force, mut traction, mut apart) = (Points::new(), Points::new(), Points::new());
    let mut torque = Points::new();
    for step in 0..1250_u32 {
        let t = STEP_S * f64::from(step);
        // up, down, and off
        let given = 6e3 * if t < 1.5 { t } else { (3.0 - t).max(0.0) };
        winder.step(&Actuators {
            torque: BySection {
                fd: given,
                ..BySection::default()
            },
            ..Actuators::default()
        });
        let (x, winding) = (winder.state(), winder.winding());
        torque.push((t, 1e-3 * given / machine.front_drum.radius_m));
        force.push((t, 1e-3 * winding.nip_force[1]));
        let limit = machine.nips.friction * winding.nip_load[1] * machine.web.width_m;
        traction.push((t, 1e-3 * limit));
        let [fd, _, wu] = x.windup;
        apart.push((t, fd - wu));
    }
    Ok(named(
        "slip",
        over_time(
            "The front drum loses its traction and finds it again",
            "no web, shipping roll of 600 mm at 20 m/s; the torque rises for 1.5 s and falls for 1.5 s",
            vec![
                panel(
                    "Force at the front drum's nip, kN",
                    HIGH,
                    vec![
                        Curve::new("traction μ·N·W", Ink::Reference, traction),
                        Curve::new("torque over radius", Ink::Green, torque),
                        Curve::new("nip", Ink::Orange, force),
                    ],
                ),
                panel(
                    "Drum's speed less the roll's, m/s",
                    LOW,
                    vec![Curve::new("slip", Ink::Blue, apart)],
                ),
            ],
            "Compare: the nip carries less than the torque, by what accelerates the drum itself, until it has reached its \
             traction; from there it carries that, and the drum runs ahead. When the slip has ended, both stick again at once.",
        ),
    ))
}

/// The parent roll's radius in f32 as a plain and as a compensated sum.
fn sums() -> Named {
    let curves = vec![
        Curve::new("plain, 4 ms", Ink::Orange, drift::<Plain<f32>>(STEP_S)),
        Curve::new(
            "plain, 1 ms",
            Ink::Green,
            drift::<Plain<f32>>(0.25 * STEP_S),
        ),
        Curve::new(
            "compensated, 4 ms",
            Ink::Blue,
            drift::<Compensated<f32>>(STEP_S),
        ),
    ];
    let mut figure = over_time(
        "Why slow states are summed up with compensation",
        "fall of the parent roll's radius in f32 at 2 200 m/min, against the closed form {4}",
        vec![panel("Error of the fall of R_uw, %", HIGH, curves)],
        "Compare: the plain sum loses what is below half the spacing of the numbers near 1.5 m, and a shorter step makes it \
         worse. The compensated sum carries it over: its error cannot be seen.",
    );
    figure.axis = "length, km".to_owned();
    named("radius-drift", figure)
}

/// Length in km, and error of the fall of the radius in %.
fn drift<S: Sum<f32>>(step_s: f64) -> Points {
    let machine = Machine::news_8000();
    let (full, caliper) = (machine.parent_roll.full_radius_m, machine.web.caliper_m);
    let layer = (caliper / std::f64::consts::TAU) as f32;
    let (v, h) = (RUN_M_S as f32, step_s as f32);
    let mut r = S::at(full as f32);
    let steps = (20e3 / (RUN_M_S * step_s)) as u32;
    let every = steps / 400;
    let mut points = Points::new();
    for step in 1..=steps {
        // {5}, halfway through the step
        let rate = |r: f32| -layer * v / r;
        let half = r.value() + 0.5 * h * rate(r.value());
        r.add(h * rate(half));
        if step.is_multiple_of(every) {
            let length = f64::from(step) * RUN_M_S * step_s;
            let radius = (full * full - caliper * length / std::f64::consts::PI).sqrt();
            let error = (full - f64::from(r.value())) / (full - radius) - 1.0;
            points.push((1e-3 * length, 100.0 * error));
        }
    }
    points
}
