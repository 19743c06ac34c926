//! Marks for QEMU's counting plugin: where a section begins and ends, and what it was.
//!
//! Does not count anything itself. Without the plugin a mark is a call that returns.
//!
//! A mark is one instruction long, so that QEMU's plugin interface, which names the function that an instruction
//! belongs to, names it exactly once a call.

// The plugin finds the functions by their unmangled names; their bodies are one instruction of assembler.
#![allow(unsafe_code)]

macro_rules! marks {
    ($($(#[$doc:meta])* $name:ident;)*) => {
        $(
            $(#[$doc])*
            #[unsafe(no_mangle)]
            #[unsafe(naked)]
            pub extern "C" fn $name() {
                core::arch::naked_asm!("bx lr")
            }
        )*
    };
}

marks! {
    /// A section begins.
    count_begin;
    /// It ends.
    count_end;
    /// It was empty: what the marks themselves take.
    count_as_nothing;
    /// A step of the motion alone.
    count_as_motion;
    /// A step of the plant, the windup as one body, without brakes.
    count_as_smooth;
    /// The same with brakes.
    count_as_braked;
    /// A step of the plant with nips that may slip and do not.
    count_as_gripping;
    /// With a nip that slips.
    count_as_sliding;
    /// The plant's task: a step and its hash.
    count_as_tick;
    /// A cycle of the regulators.
    count_as_drive;
    /// A cycle of the logic.
    count_as_logic;
}
