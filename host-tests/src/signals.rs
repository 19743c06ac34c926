//! The signal list: as CSV, as a block of IEC 61131-3 variables, as a page.
//!
//! Not here: the signals themselves. They stand in [`model_core::image::SIGNALS`], and this list cannot say
//! anything else than the simulator does.

use std::fmt::Write as _;
use std::io::Write;

use firmware::link::registers::FLOATS;
use model_core::image::{Direction, Kind, SIGNALS, Signal};

/// The columns.
pub const HEADER: [&str; 9] = [
    "name",
    "direction",
    "section",
    "type",
    "unit",
    "scale",
    "modbus_table",
    "modbus_address",
    "description",
];

/// Bits in a word: bit `b` of word `w` is the coil or discrete input `16·w + b`.
const BITS: u16 = 16;

/// Writes a row for every signal, and one for every named bit of a bit word.
pub fn write(out: impl Write) -> csv::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(HEADER)?;
    for s in SIGNALS {
        let (direction, word_table, bit_table) = match s.direction {
            Direction::Command => ("command", "holding_register", "coil"),
            Direction::Feedback => ("feedback", "input_register", "discrete_input"),
        };
        csv.write_record([
            s.name,
            direction,
            s.section.name(),
            s.kind.name(),
            s.unit,
            &(1.0 / f64::from(s.counts)).to_string(),
            word_table,
            &s.word.to_string(),
            &description(s),
        ])?;
        let Kind::Bits(bits) = s.kind else { continue };
        for bit in bits {
            csv.write_record([
                &format!("{}.{}", s.name, bit.name),
                direction,
                s.section.name(),
                "bool",
                "",
                "1",
                bit_table,
                &(BITS * s.word + u16::from(bit.number)).to_string(),
                bit.description,
            ])?;
        }
    }
    csv.flush()?;
    Ok(())
}

/// First word of a PLC's own addresses for what it exchanges with a Modbus station; those of OpenPLC's first one.
const PLC_WORD: u16 = 100;

/// A block of global variables in the syntax of IEC 61131-3: `%QW` for what the PLC writes, `%IW` for what it reads.
///
/// A pair of words is two variables, since PLCs differ in the order of the words of a `UDINT`.
pub fn iec() -> String {
    let mut text = String::from(
        "(* Modbus: %QW100 + n is holding register n, %IW100 + n is input register n; n counts from 0. *)\nVAR_GLOBAL\n",
    );
    for s in SIGNALS {
        let area = match s.direction {
            Direction::Command => 'Q',
            Direction::Feedback => 'I',
        };
        let kind = match s.kind {
            Kind::I16 => "INT",
            Kind::Bits(_) => "WORD",
            Kind::U16 | Kind::U32 | Kind::Code(_) => "UINT",
        };
        let halves: &[&str] = match s.kind {
            Kind::U32 => &["_high", "_low"],
            _ => &[""],
        };
        let scale = match s.unit {
            "" => String::new(),
            unit => format!(" [{} {unit}]", 1.0 / f64::from(s.counts)),
        };
        for (word, half) in (PLC_WORD + s.word..).zip(halves) {
            let _ = writeln!(
                text,
                "    {}{half} AT %{area}W{word} : {kind}; (* {}{scale} *)",
                s.name, s.description
            );
        }
    }
    text + "END_VAR\n"
}

/// The page `docs/signals.md`.
pub fn page() -> String {
    let mut text = String::from(
        "# Signals\n\nWritten by `cargo winder signals --format markdown`. Registers, coils and discrete inputs count \
         from 0, as they travel.\nA value is the word times its scale. The float of a signal stands at 1000 + 2 × its \
         register and the next, high word\nfirst, in the unit, for commands as for feedback.\n",
    );
    for (direction, title) in [
        (
            Direction::Command,
            "Commands: holding registers, read and written",
        ),
        (Direction::Feedback, "Feedback: input registers"),
    ] {
        let _ = write!(
            text,
            "\n## {title}\n\n| Register | Float | Name | Type | Scale | Unit | Limits | Meaning |\n|---|---|---|---|---|---|---|---|\n"
        );
        for s in SIGNALS.iter().filter(|s| s.direction == direction) {
            let _ = writeln!(
                text,
                "| {} | {} | `{}` | {} | {} | {} | {} to {} | {} |",
                s.word,
                FLOATS + 2 * s.word,
                s.name,
                s.kind.name(),
                1.0 / f64::from(s.counts),
                s.unit,
                s.limits.0,
                s.limits.1,
                description(s)
            );
        }
        let (bits, title) = match direction {
            Direction::Command => ("Coil", "Coils: single bits of the commands"),
            Direction::Feedback => (
                "Discrete input",
                "Discrete inputs: single bits of the feedback",
            ),
        };
        let _ = write!(
            text,
            "\n## {title}\n\n| {bits} | Name | 1 means |\n|---|---|---|\n"
        );
        for s in SIGNALS.iter().filter(|s| s.direction == direction) {
            let Kind::Bits(named) = s.kind else { continue };
            for bit in named {
                let _ = writeln!(
                    text,
                    "| {} | `{}.{}` | {} |",
                    BITS * s.word + u16::from(bit.number),
                    s.name,
                    bit.name,
                    bit.description
                );
            }
        }
    }
    text
}

fn description(signal: &Signal) -> String {
    let codes = match signal.kind {
        Kind::Code(codes) => codes,
        Kind::U32 => return format!("{} (two words, high word first)", signal.description),
        _ => return signal.description.to_owned(),
    };
    let codes: Vec<_> = codes
        .iter()
        .enumerate()
        .map(|(code, text)| format!("{code} = {text}"))
        .collect();
    format!("{}: {}", signal.description, codes.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn rows() -> Vec<csv::StringRecord> {
        let mut list = Vec::new();
        write(&mut list).unwrap();
        let mut reader = csv::Reader::from_reader(list.as_slice());
        assert_eq!(reader.headers().unwrap(), HEADER.as_slice());
        reader.records().map(Result::unwrap).collect()
    }

    #[test]
    fn every_signal_and_every_named_bit_has_its_row() {
        let rows = rows();
        let mut next = rows.iter();
        for s in SIGNALS {
            let row = next.next().unwrap();
            assert_eq!(&row[0], s.name);
            assert_eq!(row[7].parse::<u16>().unwrap(), s.word, "{}", s.name);
            let one = row[5].parse::<f64>().unwrap() * f64::from(s.counts);
            assert!((one - 1.0).abs() < 1e-9, "{}", s.name);
            let table = match s.direction {
                Direction::Command => "holding_register",
                Direction::Feedback => "input_register",
            };
            assert_eq!(&row[6], table, "{}", s.name);
            if let Kind::Bits(bits) = s.kind {
                for bit in bits {
                    let row = next.next().unwrap();
                    assert_eq!(&row[0], format!("{}.{}", s.name, bit.name));
                    assert_eq!(&row[3], "bool");
                    let address: u16 = row[7].parse().unwrap();
                    assert_eq!((address / 16, address % 16), (s.word, bit.number.into()));
                }
            }
        }
        assert!(next.next().is_none());
    }

    #[test]
    fn the_committed_page_is_that_of_the_signals() {
        assert!(
            page() == include_str!("../../docs/signals.md"),
            "renew it: cargo winder signals --format markdown > docs/signals.md"
        );
    }

    /// What an IEC 61131-3 compiler reads of a line: identifier, address, type.
    #[test]
    fn every_word_has_one_variable_of_the_plc() {
        let text = iec();
        let mut addresses = HashSet::new();
        for line in text.lines().filter(|line| line.contains(" AT ")) {
            let mut parts = line.split_whitespace();
            let name = parts.next().unwrap();
            assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'));
            assert_eq!(parts.next(), Some("AT"));
            assert!(addresses.insert(parts.next().unwrap().to_owned()), "{line}");
            let (open, close) = (line.matches("(*").count(), line.matches("*)").count());
            assert_eq!((open, close), (1, 1), "{line}");
        }
        let words = model_core::image::COMMAND_WORDS + model_core::image::FEEDBACK_WORDS;
        assert_eq!(addresses.len(), words);
    }

    #[test]
    fn no_two_rows_share_a_name_or_an_address() {
        let (mut names, mut addresses) = (HashSet::new(), HashSet::new());
        for row in rows() {
            assert!(names.insert(row[0].to_owned()), "{}", &row[0]);
            assert!(
                addresses.insert((row[6].to_owned(), row[7].to_owned())),
                "{}",
                &row[0]
            );
        }
    }

    #[test]
    fn codes_are_spelled_out() {
        let rows = rows();
        let mode = rows.iter().find(|r| &r[0] == "mode").unwrap();
        assert!(mode[8].contains("4 = run"), "{}", &mode[8]);
    }
}
