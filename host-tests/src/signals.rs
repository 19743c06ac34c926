//! The signal list as CSV.
//!
//! Not here: the signals themselves. They stand in [`model_core::image::SIGNALS`], and this list cannot say
//! anything else than the simulator does.

use std::io::Write;

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
