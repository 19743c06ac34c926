//! Structured Text of IEC 61131-3, executed as it stands.
//!
//! Not here: the other four languages, arrays, structures, strings, pointers, methods, global and located variables.
//! What is not known is refused with its line; nothing is passed over.
//!
//! A text holds functions, function blocks and one program. It is read into a syntax tree ([`parse`]), checked and
//! resolved ([`compile`]), and run once a cycle ([`run`]). The rules are the strict ones on which CODESYS, TwinCAT and
//! OpenPLC agree: operands of one type, conversions written out, declaration before use. Integers wrap in their
//! width, `REAL` is an IEEE single, `TIME` counts whole milliseconds of the caller's clock, a variable that is given
//! no value begins as 0.
//!
//! | Known | |
//! |---|---|
//! | Types | `BOOL`, `SINT`, `USINT`, `INT`, `UINT`, `DINT`, `UDINT`, `BYTE`, `WORD`, `DWORD`, `REAL`, `TIME` |
//! | Statements | `:=`, `IF`, `CASE`, `FOR`, `WHILE`, `REPEAT`, `EXIT`, `RETURN`, calls of function blocks |
//! | Functions | `ABS`, `MIN`, `MAX`, `LIMIT`, `SEL`, `SQRT`, `SHL`, `SHR`, `TRUNC`, `A_TO_B` of two types |
//! | Function blocks | `TON`, `TOF`, `TP`, `R_TRIG`, `F_TRIG`, `CTU`, `CTD`, `SR`, `RS` |

pub mod compile;
mod lex;
pub mod parse;
pub mod run;
mod standard;

use std::fmt;

pub use compile::{Program, Variable};
pub use run::Runner;

/// What is wrong with a text, or with what it did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong.
    pub what: String,
}

impl Error {
    fn new(line: usize, what: impl Into<String>) -> Self {
        let what = what.into();
        Self { line, what }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.what)
    }
}

impl std::error::Error for Error {}

/// An elementary type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    /// True or false.
    Bool,
    /// 8 bits, signed.
    Sint,
    /// 8 bits, unsigned.
    Usint,
    /// 16 bits, signed.
    Int,
    /// 16 bits, unsigned.
    Uint,
    /// 32 bits, signed.
    Dint,
    /// 32 bits, unsigned.
    Udint,
    /// 8 bits.
    Byte,
    /// 16 bits.
    Word,
    /// 32 bits.
    Dword,
    /// IEEE single.
    Real,
    /// Milliseconds, signed, 32 bits.
    Time,
}

impl Type {
    /// Every type.
    pub const ALL: [Self; 12] = [
        Self::Bool,
        Self::Sint,
        Self::Usint,
        Self::Int,
        Self::Uint,
        Self::Dint,
        Self::Udint,
        Self::Byte,
        Self::Word,
        Self::Dword,
        Self::Real,
        Self::Time,
    ];

    /// As it is written.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bool => "BOOL",
            Self::Sint => "SINT",
            Self::Usint => "USINT",
            Self::Int => "INT",
            Self::Uint => "UINT",
            Self::Dint => "DINT",
            Self::Udint => "UDINT",
            Self::Byte => "BYTE",
            Self::Word => "WORD",
            Self::Dword => "DWORD",
            Self::Real => "REAL",
            Self::Time => "TIME",
        }
    }

    /// The type of a name, in capitals or not.
    pub fn of(name: &str) -> Option<Self> {
        let same = |t: &Self| t.name().eq_ignore_ascii_case(name);
        Self::ALL.into_iter().find(same)
    }

    fn is_integer(self) -> bool {
        use Type::*;
        matches!(self, Sint | Usint | Int | Uint | Dint | Udint)
    }

    fn is_bits(self) -> bool {
        matches!(self, Self::Byte | Self::Word | Self::Dword)
    }

    /// Width in bits, and whether it is signed, of all that is held as an integer.
    fn width(self) -> Option<(u32, bool)> {
        use Type::*;
        Some(match self {
            Sint => (8, true),
            Usint | Byte => (8, false),
            Int => (16, true),
            Uint | Word => (16, false),
            Dint | Time => (32, true),
            Udint | Dword => (32, false),
            Bool | Real => return None,
        })
    }

    /// Least and largest value of all that is held as an integer.
    pub fn range(self) -> Option<(i64, i64)> {
        let (bits, signed) = self.width()?;
        Some(if signed {
            (-(1 << (bits - 1)), (1 << (bits - 1)) - 1)
        } else {
            (0, (1 << bits) - 1)
        })
    }

    /// Takes an integer into the type's width, as its bits would be cut.
    fn wrap(self, value: i64) -> i64 {
        let Some((bits, signed)) = self.width() else {
            return value;
        };
        let cut = value & ((1 << bits) - 1);
        if signed && cut >> (bits - 1) == 1 {
            cut - (1 << bits)
        } else {
            cut
        }
    }

    /// The value a variable begins with.
    fn zero(self) -> Value {
        match self {
            Self::Bool => Value::Bool(false),
            Self::Real => Value::Real(0.0),
            _ => Value::Int(0),
        }
    }
}

/// A value; integers, bit strings and times are all held as one kind of integer, within their width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// `BOOL`.
    Bool(bool),
    /// Integers, bit strings, and `TIME` in ms.
    Int(i64),
    /// `REAL`.
    Real(f32),
}

impl Value {
    /// The truth; a number is none.
    pub fn truth(self) -> bool {
        matches!(self, Self::Bool(true))
    }

    /// The integer; anything else is 0.
    pub fn integer(self) -> i64 {
        match self {
            Self::Int(value) => value,
            _ => 0,
        }
    }

    /// The number; a truth is 0.
    pub fn real(self) -> f32 {
        match self {
            Self::Real(value) => value,
            _ => 0.0,
        }
    }
}
