//! The tables of `docs/drive.md`, written from those that the drive logic executes.
//!
//! Not here: the text around them. A table stands between two marks, `<!-- name -->` and `<!-- end -->`;
//! [`refreshed`] renews what is between them, and a test holds the committed page against it.

use std::fmt::Write;

use model_core::exchange::{TuneAbort, TuneStep};
use model_core::image::{Direction, Kind, SIGNALS, Signal};
use model_core::logic::faults::FAULTS;
use model_core::logic::table::{Cause, Condition, Outcome};
use model_core::logic::{Mode, Refusal};

/// The page as it was when this program was built.
pub const PAGE: &str = include_str!("../../docs/drive.md");

const END: &str = "<!-- end -->";

/// A table by its mark.
type Part = (&'static str, fn() -> String);

/// Every table.
const TABLES: [Part; 9] = [
    ("diagram", diagram),
    ("transitions", transitions),
    ("requests", requests),
    ("refusals", refusals),
    ("faults", faults),
    ("auto-tune", autotune),
    ("commands", || signals(Direction::Command)),
    ("feedback", || signals(Direction::Feedback)),
    ("bits", bits),
];

/// A page with all its tables as they are now.
pub fn refreshed(page: &str) -> String {
    TABLES.iter().fold(page.to_owned(), |page, (name, table)| {
        let mark = format!("<!-- {name} -->\n");
        let Some((before, rest)) = page.split_once(&mark) else {
            return page;
        };
        let Some((_, after)) = rest.split_once(END) else {
            return page;
        };
        format!("{before}{mark}{}{END}{after}", table())
    })
}

/// The marks that a page lacks.
pub fn missing(page: &str) -> Vec<&'static str> {
    let lacks = |name: &&str| !page.contains(&format!("<!-- {name} -->\n"));
    TABLES
        .map(|(name, _)| name)
        .into_iter()
        .filter(lacks)
        .collect()
}

/// A table of Markdown.
struct Table(String);

impl Table {
    fn of(columns: &[&str]) -> Self {
        let mut table = Self(String::new());
        table.row(columns);
        table.row(&vec!["---"; columns.len()]);
        table
    }

    fn row(&mut self, cells: &[&str]) {
        for cell in cells {
            let _ = write!(self.0, "| {} ", cell.replace('|', "\\|"));
        }
        self.0.push_str("|\n");
    }
}

fn diagram() -> String {
    let mut text = String::from("```mermaid\nstateDiagram-v2\n    [*] --> Off\n");
    for &from in Mode::ALL {
        for &to in Mode::ALL {
            let causes: Vec<_> = Cause::ALL
                .iter()
                .filter(|cause| cause.outcome(from) == Outcome::Go(to))
                .map(|cause| format!("{cause:?}"))
                .collect();
            if !causes.is_empty() {
                let _ = writeln!(text, "    {from:?} --> {to:?}: {}", causes.join(", "));
            }
        }
    }
    text + "```\n"
}

fn transitions() -> String {
    let mut columns = vec!["Cause".to_owned()];
    columns.extend(Mode::ALL.iter().map(|mode| format!("{mode:?}")));
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut table = Table::of(&columns);
    for &cause in Cause::ALL {
        let mut cells = vec![format!("**{cause:?}**: {}", cause.name())];
        cells.extend(Mode::ALL.iter().map(|mode| match cause.outcome(*mode) {
            Outcome::Go(to) => format!("→ {to:?}"),
            Outcome::Stay => "·".to_owned(),
            Outcome::Refuse(refusal) => format!("✗ {}", refusal as u16),
        }));
        let cells: Vec<&str> = cells.iter().map(String::as_str).collect();
        table.row(&cells);
    }
    table.0
}

fn requests() -> String {
    let list = |conditions: &[Condition]| -> String {
        let each = conditions.iter().map(|condition| {
            let refusal = condition.refusal();
            format!("{condition:?} (✗ {})", refusal as u16)
        });
        each.collect::<Vec<_>>().join(", ")
    };
    let mut table = Table::of(&[
        "Request",
        "Needs before its mode is looked at",
        "Needs besides",
    ]);
    for cause in Cause::ALL {
        if !(cause.needs().is_empty() && cause.needs_then().is_empty()) {
            let (first, then) = (list(cause.needs()), list(cause.needs_then()));
            table.row(&[cause.name(), &first, &then]);
        }
    }
    table.0
}

fn codes<'a>(texts: impl Iterator<Item = &'a str>) -> String {
    let mut table = Table::of(&["Code", "Meaning"]);
    for (code, text) in texts.enumerate() {
        table.row(&[&code.to_string(), text]);
    }
    table.0
}

fn refusals() -> String {
    codes(Refusal::NAMES.iter().copied())
}

fn faults() -> String {
    let mut table = Table::of(&[
        "Code",
        "Fault",
        "Sections with ZSW1 bit 3",
        "The winder makes",
    ]);
    for row in FAULTS {
        let names = ["uw", "rd", "fd", "rr"];
        let sections = row.sections.into_array().into_iter().zip(names);
        let sections: Vec<_> = sections
            .filter_map(|(is, name)| is.then_some(name))
            .collect();
        table.row(&[
            &(row.fault as u16).to_string(),
            row.fault.name(),
            &sections.join(" "),
            row.reaction.name(),
        ]);
    }
    table.0
}

fn autotune() -> String {
    let steps = codes(TuneStep::TEXTS.into_iter());
    let aborts = codes(TuneAbort::TEXTS.into_iter());
    format!("`autotune_step`:\n\n{steps}\n`autotune_abort`:\n\n{aborts}")
}

fn signals(direction: Direction) -> String {
    let mut table = Table::of(&[
        "Word", "Name", "Section", "Type", "Count", "Limits", "Meaning",
    ]);
    for s in SIGNALS.iter().filter(|s| s.direction == direction) {
        let scaled = matches!(s.kind, Kind::U16 | Kind::I16 | Kind::U32);
        let count = match (scaled, s.unit) {
            (false, _) => String::new(),
            (true, unit) => format!("{} {unit}", 1.0 / f64::from(s.counts)),
        };
        let limits = match direction {
            Direction::Command if scaled => format!("{} … {}", s.limits.0, s.limits.1),
            _ => String::new(),
        };
        table.row(&[
            &s.word.to_string(),
            &format!("`{}`", s.name),
            s.section.name(),
            s.kind.name(),
            count.trim_end(),
            &limits,
            s.description,
        ]);
    }
    table.0
}

fn bits() -> String {
    let mut text = String::new();
    let mut seen: Vec<*const [model_core::image::Bit]> = Vec::new();
    for s in SIGNALS {
        let Kind::Bits(bits) = s.kind else { continue };
        if seen.contains(&std::ptr::from_ref(bits)) {
            continue;
        }
        seen.push(bits);
        let alike = |t: &&Signal| matches!(t.kind, Kind::Bits(b) if std::ptr::eq(b, bits));
        let names: Vec<_> = SIGNALS.iter().filter(alike).collect();
        let names: Vec<_> = names.iter().map(|s| format!("`{}`", s.name)).collect();
        let _ = writeln!(text, "{}:\n", names.join(", "));
        let mut table = Table::of(&["Bit", "Name", "1 means"]);
        for bit in bits {
            table.row(&[
                &bit.number.to_string(),
                &format!("`{}`", bit.name),
                bit.description,
            ]);
        }
        text += &table.0;
        text.push('\n');
    }
    text
}
