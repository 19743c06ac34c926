//! What a signal of the process image is: its name, its place, how it stands in its words.
//!
//! Not here: the signals themselves; they are the image's.

/// Who writes a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the winder PLC to the simulator.
    Command,
    /// From the simulator to the winder PLC.
    Feedback,
}

/// The part of the machine a signal belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// The winder as a whole.
    Winder,
    /// The unwind and its drive.
    Unwind,
    /// The rear drum and its drive.
    RearDrum,
    /// The front drum and its drive.
    FrontDrum,
    /// The rider roll and its drive.
    RiderRoll,
    /// The simulator itself: what no real winder has.
    Simulator,
}

impl Section {
    /// The name in lists.
    pub const fn name(self) -> &'static str {
        match self {
            Section::Winder => "winder",
            Section::Unwind => "uw",
            Section::RearDrum => "rd",
            Section::FrontDrum => "fd",
            Section::RiderRoll => "rr",
            Section::Simulator => "simulator",
        }
    }
}

/// A named bit of a word.
#[derive(Clone, Copy, Debug)]
pub struct Bit {
    /// Number, 0 the least significant.
    pub number: u8,
    /// Name, appended to the word's.
    pub name: &'static str,
    /// What 1 means.
    pub description: &'static str,
}

impl Bit {
    /// From the columns of a table.
    pub const fn new(number: u8, name: &'static str, description: &'static str) -> Self {
        Self {
            number,
            name,
            description,
        }
    }
}

/// How a signal stands in its words.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// An unsigned scaled integer.
    U16,
    /// A signed scaled integer, two's complement.
    I16,
    /// An unsigned 32-bit integer in two words, high word first; a counter wraps.
    U32,
    /// Single bits.
    Bits(&'static [Bit]),
    /// A code; the index is the value.
    Code(&'static [&'static str]),
}

impl Kind {
    /// The name in lists.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::U16 => "u16",
            Kind::I16 => "i16",
            Kind::U32 => "u32",
            Kind::Bits(_) => "bits",
            Kind::Code(_) => "code",
        }
    }
    /// The words it takes.
    pub const fn words(self) -> u16 {
        match self {
            Kind::U32 => 2,
            _ => 1,
        }
    }
}

/// One signal of the image.
#[derive(Clone, Copy, Debug)]
pub struct Signal {
    /// Name, unique.
    pub name: &'static str,
    /// Who writes it.
    pub direction: Direction,
    /// The part of the machine it belongs to.
    pub section: Section,
    /// How it stands in its words.
    pub kind: Kind,
    /// Unit of the scaled value.
    pub unit: &'static str,
    /// Counts for one unit: 10 means that 1 count is 0.1 unit.
    pub counts: f32,
    /// Smallest and largest value, in the unit. A set-point outside is limited, as a drive does.
    pub limits: (f32, f32),
    /// First word in the block of its direction.
    pub word: u16,
    /// What it means, in a sentence.
    pub description: &'static str,
}
