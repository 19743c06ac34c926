//! What happens in an acceptance run, episode by episode.
//!
//! Not here: what must then be so. An episode begins where [`Run::recover`] leaves the machine, so that one that got
//! stuck does not spoil the next; its moments have names, and the checks look from there.

use model_core::desk::{alarm, request};
use model_core::image;

use super::run::{Done, Run};

/// Speed of the episodes in which something breaks, m/min.
const SLOW: f64 = 100.0;
/// Web tension per width, N/m.
pub const TENSION: f64 = 350.0;
/// Speed of the first run, and the one it is changed to, m/min.
pub const SPEEDS: [f64; 2] = [300.0, 360.0];
/// Speed of the sets, m/min.
const SET_SPEED: f64 = 400.0;
/// A speed that no winder has, m/min.
pub const TOO_FAST: f64 = 3000.0;
/// Length of the first set, m.
pub const LENGTH: f64 = 120.0;
/// Diameter of the second set, mm.
pub const DIAMETER: f64 = 160.0;
/// Taper of the second set, of 1.
pub const TAPER: f64 = 0.2;
/// Winding force and rider load of the second set at its diameter, %.
pub const FORCE: f64 = 6.0;
/// See [`FORCE`].
pub const RIDER: f64 = 140.0;
/// A full parent roll, one that is nearly used up, and where it is, mm.
pub const PARENTS: [f64; 3] = [3000.0, 935.0, 925.0];

/// An episode with its name.
pub type Row = (&'static str, fn(&mut Run) -> Done);

/// The course.
pub const EPISODES: &[Row] = &[
    ("before the start", before_the_start),
    ("new rolls", new_rolls),
    ("maneuver", maneuver),
    ("thread", thread),
    ("run", run),
    ("set to a length", set_to_length),
    ("set to a diameter", set_to_diameter),
    ("end of the parent roll", parent_roll_end),
    ("web break", web_break),
    ("front drum's drive trips", trip_fd),
    ("unwind's drive trips", trip_uw),
    ("emergency stop", emergency_stop),
    ("load cells are stuck", load_cells),
    ("unwind's encoder is silent", encoder),
    ("front drum's brake does not close", brake),
    ("rider roll's motor is warm", hot),
    ("link is lost", link),
    ("heartbeat wraps", heartbeat),
];

fn before_the_start(run: &mut Run) -> Done {
    run.ask(&image::OPERATOR_V_SET, SPEEDS[0])?;
    run.ask(&image::OPERATOR_TENSION_SET, TENSION)?;
    run.ask(&image::OPERATOR_PARENT, PARENTS[0])?;
    run.excuse(u16::MAX);
    run.wait(2.0)?;
    // what an earlier run may have left behind
    run.recover()?;
    run.press(request::RESET_SETS)?;
    run.mark("idle");
    run.wait(3.0)?;
    run.mark("asked without drives");
    run.press(request::THREAD)?;
    run.press(request::RUN)?;
    run.wait(1.0)?;
    run.mark("asked without drives, over");
    run.ask(&image::OPERATOR_V_SET, TOO_FAST)?;
    run.wait(0.5)?;
    run.mark("too fast");
    run.wait(0.5)?;
    run.ask(&image::OPERATOR_V_SET, SPEEDS[0])?;
    run.wait(0.3)
}

fn new_rolls(run: &mut Run) -> Done {
    run.mark("new core");
    run.press(request::NEW_CORE)?;
    run.wait(0.5)?;
    run.mark("new parent roll");
    run.press(request::NEW_PARENT_ROLL)?;
    run.until("winder_status.preset_taken", 5.0)?;
    run.wait(1.0)?;
    run.mark("preset");
    Ok(())
}

fn maneuver(run: &mut Run) -> Done {
    // a web is led through only afterwards
    run.press(request::WEB_REMOVED)?;
    run.mark("drives on");
    run.press(request::DRIVES_ON)?;
    run.until("winder_status.drives_on", 5.0)?;
    run.mark("in operation");
    run.wait(0.5)?;
    for (button, name, over) in [
        (request::JOG_FORWARD, "forward", "forward, over"),
        (request::JOG_BACKWARD, "backward", "backward, over"),
    ] {
        run.mark(name);
        run.hold(button)?;
        run.wait(4.0)?;
        run.mark(over);
        run.release(button)?;
        run.until("winder_status.zero_speed", 10.0)?;
        run.wait(0.5)?;
    }
    run.until("mode = 1", 5.0)
}

fn thread(run: &mut Run) -> Done {
    run.recover()?;
    run.press(request::DRIVES_ON)?;
    run.until("winder_status.drives_on", 5.0)?;
    run.mark("no web");
    run.press(request::THREAD)?;
    run.wait(1.0)?;
    run.mark("web is led");
    run.press(request::WEB_LED)?;
    run.until("winder_status.web_threaded", 3.0)?;
    run.wait(0.5)?;
    run.mark("thread");
    run.press(request::THREAD)?;
    run.wait(0.5)?;
    run.press(request::RUN)?;
    run.until("winder_status.tension_detected", 30.0)?;
    run.mark("tight");
    run.wait(2.0)?;
    run.mark("threaded");
    Ok(())
}

fn run(run: &mut Run) -> Done {
    run.recover()?;
    run.tighten()?;
    run.mark("run");
    run.speed_up(SPEEDS[0])?;
    run.wait(3.0)?;
    run.mark("at speed");
    run.wait(1.0)?;
    run.mark("core and parent roll in run");
    run.press(request::NEW_CORE)?;
    run.press(request::NEW_PARENT_ROLL)?;
    run.wait(1.0)?;
    run.mark("other set-points");
    run.ask(&image::OPERATOR_V_SET, SPEEDS[1])?;
    run.ask(&image::OPERATOR_TENSION_SET, TENSION + 50.0)?;
    run.wait(8.0)?;
    run.mark("followed");
    run.mark("stop");
    run.press(request::STOP)?;
    run.until("winder_status.zero_speed", 40.0)?;
    run.wait(2.0)?;
    run.mark("stopped");
    run.ask(&image::OPERATOR_TENSION_SET, TENSION)?;
    run.wait(0.3)
}

/// A new core, a tight web, and run up to the end of the set.
fn wind(run: &mut Run, began: &'static str) -> Done {
    run.press(request::NEW_CORE)?;
    run.wait(0.5)?;
    run.tighten()?;
    run.mark(began);
    run.ask(&image::OPERATOR_V_SET, SET_SPEED)?;
    run.press(request::RUN)?;
    run.until("mode = run", 3.0)?;
    run.until("mode != run", 120.0)?;
    run.until("winder_status.zero_speed", 60.0)
}

fn set_to_length(run: &mut Run) -> Done {
    run.recover()?;
    // the counter wraps within the next 65 536 pulses, 43 m
    let shown = run
        .now()
        .map_or(0, |now| now.image.feedback.double(&image::PULSES_RD));
    let high = (shown >> 16) as u16;
    let ahead = run.own(&image::PULSES_AHEAD).wrapping_add(u16::MAX - high);
    run.inject(&image::PULSES_AHEAD, ahead, 0);
    run.wait(0.5)?;
    run.ask(&image::OPERATOR_LENGTH_SET, LENGTH)?;
    run.mark("core of the first set");
    wind(run, "first set")?;
    run.mark("first set stands");
    run.wait(3.0)?;
    run.mark("first set rests");
    run.press(request::THREAD)?;
    run.press(request::RUN)?;
    run.wait(2.0)?;
    run.mark("first set over");
    Ok(())
}

fn set_to_diameter(run: &mut Run) -> Done {
    run.ask(&image::OPERATOR_LENGTH_SET, 0.0)?;
    run.recover()?;
    run.ask(&image::OPERATOR_DIAMETER_SET, DIAMETER)?;
    run.ask(&image::OPERATOR_TAPER, 100.0 * TAPER)?;
    run.ask(&image::OPERATOR_FORCE, FORCE)?;
    run.ask(&image::OPERATOR_RIDER, RIDER)?;
    let wound = wind(run, "second set");
    if wound.is_ok() {
        run.mark("second set stands");
        run.wait(3.0)?;
        run.mark("second set rests");
    }
    run.ask(&image::OPERATOR_DIAMETER_SET, 0.0)?;
    run.ask(&image::OPERATOR_TAPER, 0.0)?;
    run.ask(&image::OPERATOR_FORCE, 0.0)?;
    run.ask(&image::OPERATOR_RIDER, 0.0)?;
    wound
}

/// Takes the web out and puts in a parent roll of this diameter, mm.
fn change_parent_roll(run: &mut Run, diameter: f64) -> Done {
    run.press(request::WEB_REMOVED)?;
    run.wait(0.3)?;
    run.press(request::NEW_CORE)?;
    run.wait(0.3)?;
    let full = diameter >= PARENTS[0];
    let counts = (diameter * f64::from(image::PARENT_ROLL_PUT_IN.counts)) as u16;
    run.inject(&image::PARENT_ROLL_PUT_IN, if full { 0 } else { counts }, 0);
    run.ask(&image::OPERATOR_PARENT, diameter)?;
    run.press(request::NEW_PARENT_ROLL)?;
    run.wait(1.5)?;
    run.until("winder_status.preset_taken", 5.0)
}

fn parent_roll_end(run: &mut Run) -> Done {
    run.recover()?;
    change_parent_roll(run, PARENTS[1])?;
    run.mark("nearly used up");
    run.ask(&image::OPERATOR_PARENT_END, PARENTS[2])?;
    let wound = wind_down(run);
    run.ask(&image::OPERATOR_PARENT_END, 0.0)?;
    run.recover()?;
    let changed = change_parent_roll(run, PARENTS[0]);
    run.stand(0);
    changed.and(wound)
}

fn wind_down(run: &mut Run) -> Done {
    run.tighten()?;
    run.mark("last layers");
    run.stand(alarm::PARENT_ROLL_END);
    run.speed_up(SPEEDS[0])?;
    run.until("mode != run", 60.0)?;
    run.until("winder_status.zero_speed", 40.0)?;
    run.mark("used up");
    run.wait(1.0)?;
    run.press(request::RUN)?;
    run.wait(1.0)?;
    run.mark("used up, over");
    Ok(())
}

/// From drives off to run at the slow speed.
fn slow(run: &mut Run) -> Done {
    run.recover()?;
    run.tighten()?;
    run.speed_up(SLOW)?;
    run.wait(1.0)
}

/// Puts something in at run, waits for a fault, and does what an operator does who is in a hurry: thread and run before
/// he acknowledges, and then only acknowledges. `names` are those of the fault, of the hurry, of the acknowledge and of
/// the end.
fn hurry(run: &mut Run, names: [&'static str; 3]) -> Done {
    run.until("winder_status.zero_speed", 40.0)?;
    run.wait(1.0)?;
    run.mark(names[0]);
    run.press(request::DRIVES_ON)?;
    run.press(request::THREAD)?;
    run.press(request::RUN)?;
    run.wait(1.0)?;
    run.sound();
    run.wait(0.5)?;
    run.mark(names[1]);
    run.press(request::ACKNOWLEDGE)?;
    run.wait(3.0)?;
    run.mark(names[2]);
    Ok(())
}

fn web_break(run: &mut Run) -> Done {
    slow(run)?;
    run.mark("web breaks");
    run.inject(&image::FAULT_WEB_BREAK, 2, alarm::WEB_BREAK);
    run.until("winder_status.web_break", 3.0)?;
    run.mark("web break is told");
    hurry(
        run,
        [
            "web break stands",
            "web break acknowledged",
            "web break over",
        ],
    )
}

fn trip_fd(run: &mut Run) -> Done {
    slow(run)?;
    run.mark("front drum trips");
    run.inject(&image::FAULT_DRIVES, 1 << 2, alarm::TRIP_FD);
    run.until("fault != 0", 3.0)?;
    hurry(
        run,
        [
            "front drum stands",
            "front drum acknowledged",
            "front drum over",
        ],
    )
}

fn trip_uw(run: &mut Run) -> Done {
    slow(run)?;
    run.mark("unwind trips");
    run.inject(
        &image::FAULT_DRIVES,
        1 << 0,
        alarm::TRIP_UW | alarm::WEB_BREAK,
    );
    run.until("fault != 0", 3.0)?;
    hurry(run, ["unwind stands", "unwind acknowledged", "unwind over"])
}

fn emergency_stop(run: &mut Run) -> Done {
    slow(run)?;
    run.mark("emergency stop");
    run.excuse(alarm::EMERGENCY_STOP);
    run.hold(request::EMERGENCY_STOP)?;
    run.until("mode != run", 3.0)?;
    run.mark("emergency stop is obeyed");
    run.until("winder_status.zero_speed", 40.0)?;
    run.wait(1.0)?;
    run.mark("emergency stop is released");
    run.release(request::EMERGENCY_STOP)?;
    run.wait(2.0)?;
    run.mark("emergency stop over");
    Ok(())
}

fn load_cells(run: &mut Run) -> Done {
    slow(run)?;
    run.mark("load cells stick");
    // the tension that is not seen may tear the web
    let reasons = alarm::LOAD_CELL | alarm::WEB_BREAK;
    run.inject(&image::FAULT_SENSORS, 1 << 2, reasons);
    run.wait(1.0)?;
    run.ask(&image::OPERATOR_TENSION_SET, TENSION + 100.0)?;
    let stopped = run.until("mode != run", 12.0);
    run.mark("load cells, over");
    run.ask(&image::OPERATOR_TENSION_SET, TENSION)?;
    run.wait(1.0)?;
    stopped
}

fn encoder(run: &mut Run) -> Done {
    slow(run)?;
    run.mark("encoder is silent");
    let reasons = alarm::ENCODER | alarm::WEB_BREAK;
    run.inject(&image::FAULT_SENSORS, 1 << 0, reasons);
    run.until("fault != 0", 3.0)?;
    hurry(
        run,
        ["encoder stands", "encoder acknowledged", "encoder over"],
    )
}

fn brake(run: &mut Run) -> Done {
    slow(run)?;
    run.inject(&image::FAULT_MACHINE, 1 << 4, alarm::BRAKE);
    run.press(request::STOP)?;
    run.until("winder_status.zero_speed", 40.0)?;
    run.mark("brake does not close");
    run.until("fault != 0", 5.0)?;
    hurry(run, ["brake stands", "brake acknowledged", "brake over"])
}

fn hot(run: &mut Run) -> Done {
    slow(run)?;
    run.mark("motor is warm");
    let reasons = alarm::MOTOR_HOT | alarm::TRIP_RR;
    run.inject(&image::FAULT_DRIVES, 1 << 7, reasons);
    let stood = run.until("winder_status.zero_speed", 20.0);
    run.mark("motor, over");
    run.sound();
    run.wait(11.0)?;
    stood
}

fn link(run: &mut Run) -> Done {
    slow(run)?;
    run.mark("link is lost");
    run.inject(&image::FAULT_DRIVES, 1 << 10, alarm::LINK);
    run.wait(12.0)?;
    run.mark("link is back");
    run.sound();
    run.wait(4.0)?;
    run.mark("link, over");
    run.recover()
}

/// The drives' heartbeat has 16 bits and counts every 10 ms: it wraps every 11 minutes.
fn heartbeat(run: &mut Run) -> Done {
    run.wrap(250.0)?;
    run.wait(2.0)
}
