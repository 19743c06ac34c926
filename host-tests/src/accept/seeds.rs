//! Errors that a winder's control program may have, each a small patch of the reference program.
//!
//! Not here: finding them. A patch replaces one piece of the text, which must stand there exactly once; a program that
//! has changed underneath it is refused, not patched somewhere.

use anyhow::{Result, ensure};

use super::checks::Area;

/// An error.
pub struct Seed {
    /// Its name.
    pub name: &'static str,
    /// Where a commissioning engineer has to look.
    pub area: Area,
    /// What is wrong.
    pub what: &'static str,
    /// What stands in the program …
    pub search: &'static str,
    /// … and what in its place.
    pub replace: &'static str,
}

impl Seed {
    /// The program with the error.
    pub fn sow(&self, program: &str) -> Result<String> {
        let times = program.matches(self.search).count();
        ensure!(
            times == 1,
            "{}: what it replaces stands {times} times in the program, not once",
            self.name
        );
        Ok(program.replacen(self.search, self.replace, 1))
    }
}

/// Every error.
pub const SEEDS: &[Seed] = &[
    Seed {
        name: "preset-radius",
        area: Area::Preset,
        what: "the preset is a radius",
        search: "        preset := diameter;",
        replace: "        preset := diameter / 2;",
    },
    Seed {
        name: "preset-stale",
        area: Area::Preset,
        what: "the preset's value stays that of the first parent roll",
        search: "    d_preset_uw := parent.preset;",
        replace: "    IF plc_sets = 0 THEN d_preset_uw := parent.preset; END_IF;",
    },
    Seed {
        name: "preset-with-its-roll",
        area: Area::Preset,
        what: "the preset is taken over together with the new roll, which drops it",
        search: "accept := busy AND time.ET >= T#500ms AND time.ET < T#700ms;",
        replace: "accept := busy AND time.ET < T#200ms;",
    },
    Seed {
        name: "speed-scale",
        area: Area::Run,
        what: "the speed is in m/min, not in tenths of it",
        search: "v_set := MIN(operator_v_set, V_MAX);",
        replace: "v_set := MIN(operator_v_set, V_MAX) / 10;",
    },
    Seed {
        name: "speed-limit",
        area: Area::Run,
        what: "the speed is not limited to what the machine has",
        search: "v_set := MIN(operator_v_set, V_MAX);",
        replace: "v_set := operator_v_set;",
    },
    Seed {
        name: "acceleration",
        area: Area::Run,
        what: "the acceleration is twice the machine's",
        search: "accel_set : UINT := 450;",
        replace: "accel_set : UINT := 900;",
    },
    Seed {
        name: "run-edge",
        area: Area::Run,
        what: "run is an edge where the drives want a level",
        search: "OR bit(state = S_RUNNING, 16#0004)",
        replace: "OR bit(b_run.Q, 16#0004)",
    },
    Seed {
        name: "torque-limit",
        area: Area::Run,
        what: "the unwind's torque limit is in percent, not in tenths of it",
        search: "torque_limit_uw : UINT := 1500;",
        replace: "torque_limit_uw : UINT := 150;",
    },
    Seed {
        name: "stop-off1",
        area: Area::Run,
        what: "the stop switches the drives off",
        search: "            ELSIF b_stop.Q THEN
                state := S_STOPPING;
            END_IF;
        S_STOPPING:",
        replace: "            ELSIF b_stop.Q THEN
                switched_on := FALSE;
                state := S_STOPPING;
            END_IF;
        S_STOPPING:",
    },
    Seed {
        name: "core-interlock",
        area: Area::Run,
        what: "a new core is passed on while the web runs",
        search: "core_pulse(IN := b_core.Q AND standstill AND (state = S_OFF OR state = S_READY), PT",
        replace: "core_pulse(IN := b_core.Q, PT",
    },
    Seed {
        name: "on-from-power-up",
        area: Area::Start,
        what: "the drives are on from power-up",
        search: "    stw1 := 16#047E;",
        replace: "    stw1 := 16#047F;",
    },
    Seed {
        name: "control-word",
        area: Area::Start,
        what: "the ramp generator is not enabled",
        search: "    stw1 := 16#047E;",
        replace: "    stw1 := 16#046E;",
    },
    Seed {
        name: "tension-detection",
        area: Area::Thread,
        what: "a web that is led through is taken for a tight one",
        search: "tight := has(winder_status, 16#0002);",
        replace: "tight := has(winder_status, 16#0004);",
    },
    Seed {
        name: "web-interlock",
        area: Area::Thread,
        what: "thread does not wait for the web",
        search: "b_thread.Q AND threaded AND preset_taken",
        replace: "b_thread.Q AND preset_taken",
    },
    Seed {
        name: "stall-share",
        area: Area::Thread,
        what: "stall tension is that of run",
        search: "STALL_SHARE : REAL := 0.3;",
        replace: "STALL_SHARE : REAL := 1.0;",
    },
    Seed {
        name: "jog-swapped",
        area: Area::Maneuver,
        what: "the bits of jogging are swapped",
        search:
            "bit(has(operator_request, 16#0800) AND NOT has(operator_request, 16#1000), 16#0400)
            OR bit(has(operator_request, 16#1000) AND NOT has(operator_request, 16#0800), 16#0800);",
        replace:
            "bit(has(operator_request, 16#0800) AND NOT has(operator_request, 16#1000), 16#0800)
            OR bit(has(operator_request, 16#1000) AND NOT has(operator_request, 16#0800), 16#0400);",
    },
    Seed {
        name: "taper-sign",
        area: Area::Set,
        what: "the taper has the wrong sign",
        search: "(1.0 - UINT_TO_REAL(operator_taper) / 1000.0 * growth)",
        replace: "(1.0 + UINT_TO_REAL(operator_taper) / 1000.0 * growth)",
    },
    Seed {
        name: "force-constant",
        area: Area::Set,
        what: "the winding force does not follow the diameter",
        search: "REAL_TO_INT(INT_TO_REAL(operator_force) * growth)",
        replace: "operator_force",
    },
    Seed {
        name: "rider-sign",
        area: Area::Set,
        what: "the rider load falls where it is to rise",
        search: "(UINT_TO_REAL(operator_rider) - 1000.0) * growth",
        replace: "(1000.0 - UINT_TO_REAL(operator_rider)) * growth",
    },
    Seed {
        name: "diameter-as-radius",
        area: Area::Set,
        what: "the web left to a diameter is that to a radius",
        search: "web_between := 0.7853982 *",
        replace: "web_between := 3.1415927 *",
    },
    Seed {
        name: "no-jerk",
        area: Area::Set,
        what: "the stopping distance forgets the jerk",
        search: "fall := v_0 / a_max + a_max / j;",
        replace: "fall := v_0 / a_max;",
    },
    Seed {
        name: "pulses-wrap",
        area: Area::Set,
        what: "the encoder's wrap is taken for that of 16 bits",
        search: "    counted := counted + UDINT_TO_DINT(pulses - last);",
        replace: "    IF pulses < last THEN counted := counted + 65536; END_IF;
    counted := counted + UDINT_TO_DINT(pulses - last);",
    },
    Seed {
        name: "wrong-reset",
        area: Area::Set,
        what: "the length is reset with the sets, not with the core",
        search: "reset := core_pulse.Q);",
        replace: "reset := b_reset.Q);",
    },
    Seed {
        name: "set-count",
        area: Area::Set,
        what: "the sets are counted from 1",
        search: "        plc_sets := 0;",
        replace: "        plc_sets := 1;",
    },
    Seed {
        name: "set-not-remembered",
        area: Area::Set,
        what: "the end of a set is not remembered: thread is free again",
        search: "                    core_in := FALSE;
                    state := S_WOUND;",
        replace: "                    state := S_READY;",
    },
    Seed {
        name: "brake-timing",
        area: Area::Set,
        what: "the drum brakes are closed when the stop begins",
        search: "rest(IN := state = S_WOUND, PT",
        replace: "rest(IN := state = S_STOPPING OR state = S_WOUND, PT",
    },
    Seed {
        name: "rider-up-in-stop",
        area: Area::Set,
        what: "the rider roll is lifted when the stop begins",
        search: "winder_command_2 := bit(rest.Q OR",
        replace: "winder_command_2 := bit(state = S_STOPPING OR rest.Q OR",
    },
    Seed {
        name: "parent-end-radius",
        area: Area::Set,
        what: "the parent roll's end is a radius",
        search: "left := UINT_TO_REAL(operator_parent_end) / 10.0;",
        replace: "left := UINT_TO_REAL(operator_parent_end) / 20.0;",
    },
    Seed {
        name: "web-break-ignored",
        area: Area::Faults,
        what: "a web break is not looked at",
        search: "        2, 16: alarms := alarms OR 16#0001;\n",
        replace: "",
    },
    Seed {
        name: "trip-keeps-on",
        area: Area::Faults,
        what: "a trip does not take ON back",
        search: "has(alarms, 16#0ADE)",
        replace: "has(alarms, 16#0AC0)",
    },
    Seed {
        name: "trips-swapped",
        area: Area::Faults,
        what: "the trips of unwind and front drum are swapped",
        search: "        5: alarms := alarms OR 16#0002;
        6: alarms := alarms OR 16#0004;
        7: alarms := alarms OR 16#0008;",
        replace: "        7: alarms := alarms OR 16#0002;
        6: alarms := alarms OR 16#0004;
        5: alarms := alarms OR 16#0008;",
    },
    Seed {
        name: "off2-for-off3",
        area: Area::Faults,
        what: "the bits of OFF2 and OFF3 are swapped",
        search: "stw1 := stw1 AND NOT 16#0004;",
        replace: "stw1 := stw1 AND NOT 16#0002;",
    },
    Seed {
        name: "emergency-not-latched",
        area: Area::Faults,
        what: "the emergency stop goes with its push-button",
        search: "    IF has(operator_request, 16#0020) THEN
        emergency := TRUE;
    END_IF;",
        replace: "    emergency := has(operator_request, 16#0020);
    IF NOT emergency THEN
        alarms := alarms AND NOT 16#0800;
    END_IF;",
    },
    Seed {
        name: "acknowledges-itself",
        area: Area::Faults,
        what: "a fault is acknowledged by the program",
        search: "acknowledge_pulse(IN := b_acknowledge.Q AND standstill, PT",
        replace: "acknowledge_pulse(IN := (b_acknowledge.Q OR fault > 0) AND standstill, PT",
    },
    Seed {
        name: "restart",
        area: Area::Faults,
        what: "the sequence goes on by itself after an acknowledge",
        search: "                state := S_OFF;
                IF drives_on AND switched_on THEN
                    state := S_READY;",
        replace: "                switched_on := TRUE;
                state := S_SWITCHING_ON;
                IF drives_on AND switched_on THEN
                    thread_wanted := TRUE;
                    state := S_THREADING;",
    },
    Seed {
        name: "load-cell-band",
        area: Area::Faults,
        what: "the load cells' band is ten times too wide",
        search: "BAND : REAL := 0.15;",
        replace: "BAND : REAL := 1.5;",
    },
    Seed {
        name: "encoder-ignored",
        area: Area::Faults,
        what: "the faults of encoders are not mapped",
        search: "        3, 4: alarms := alarms OR 16#0040;\n",
        replace: "",
    },
    Seed {
        name: "one-brake-only",
        area: Area::Faults,
        what: "only two of the three brakes are mapped",
        search: "13..15: alarms",
        replace: "13..14: alarms",
    },
    Seed {
        name: "warm-motor-ignored",
        area: Area::Faults,
        what: "the warnings of motors are not looked at",
        search: "        OR bit(has(warnings, 16#000F), 16#0100)\n",
        replace: "",
    },
    Seed {
        name: "link-not-watched",
        area: Area::Link,
        what: "the drives' heartbeat is not watched",
        search: "        OR bit(link.lost, 16#0200)\n",
        replace: "",
    },
    Seed {
        name: "heartbeat-wrap",
        area: Area::Link,
        what: "the drives' heartbeat may not wrap",
        search: "    still(IN := counter = last, PT := T#300ms);
    last := counter;",
        replace: "    still(IN := counter <= last, PT := T#300ms);
    last := MAX(last, counter);",
    },
    Seed {
        name: "heartbeat-in-fault",
        area: Area::Link,
        what: "the PLC's heartbeat stands while there is a fault",
        search: "    heartbeat_plc := heartbeat_plc + 1;",
        replace: "    IF state <> S_FAULTED THEN heartbeat_plc := heartbeat_plc + 1; END_IF;",
    },
];
