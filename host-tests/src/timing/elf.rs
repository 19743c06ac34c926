//! What lies where in a firmware: names of addresses, addresses of names, sizes.
//!
//! Not here: code and data themselves.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use addr2line::Context as Lines;
use anyhow::{Context, Result};
use gimli::{Dwarf, EndianArcSlice, LittleEndian, SectionId};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, SymbolKind, elf};

use super::frames::{Function, deepest};

type Reader = EndianArcSlice<LittleEndian>;

/// The symbols, sections and lines of an ELF file.
pub struct Elf {
    /// By address: size and name as it was written.
    symbols: BTreeMap<u64, (u64, String)>,
    sizes: Sizes,
    stack: (u64, u64),
    lines: Lines<Reader>,
}

/// What a firmware takes of the memories, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Code, constants, and the first values of variables.
    pub flash: u64,
    /// Variables: with a first value, zero at first, and those that survive a reset.
    pub ram: u64,
    /// Memory for the stack.
    pub stack: u64,
    /// What the deepest calls take of it.
    pub deepest: u64,
}

impl Elf {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self> {
        let data = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        let file = object::File::parse(&*data)
            .with_context(|| format!("{} is not an ELF file", path.display()))?;
        let mut symbols = BTreeMap::new();
        for symbol in file.symbols() {
            let wanted = matches!(symbol.kind(), SymbolKind::Text | SymbolKind::Data);
            if let (true, Ok(name)) = (wanted && symbol.size() > 0, symbol.name()) {
                // the lowest bit of a function's address tells its instruction set
                let address = match symbol.kind() {
                    SymbolKind::Text => symbol.address() & !1,
                    _ => symbol.address(),
                };
                let name = format!("{:#}", rustc_demangle::demangle(name));
                symbols.insert(address, (symbol.size(), name));
            }
        }
        let symbol = |name| {
            let found = file.symbol_by_name(name).map(|symbol| symbol.address());
            found.with_context(|| format!("{} has no {name}", path.display()))
        };
        let stack = (symbol("_stack_end")?, symbol("_stack_start")?);
        let load = |id: SectionId| -> Result<Reader, gimli::Error> {
            let data = file
                .section_by_name(id.name())
                .and_then(|section| section.data().ok())
                .unwrap_or_default();
            Ok(EndianArcSlice::new(data.into(), LittleEndian))
        };
        let lines = Dwarf::load(load)
            .and_then(Lines::from_dwarf)
            .with_context(|| format!("cannot read the lines of {}", path.display()))?;
        let sizes = Sizes {
            deepest: deepest(&functions(&file)).0,
            ..sizes(&file, stack)
        };
        Ok(Self {
            symbols,
            sizes,
            stack,
            lines,
        })
    }

    /// What is at an address.
    pub fn name(&self, address: u64) -> Option<&str> {
        let (start, (size, name)) = self.symbols.range(..=address).next_back()?;
        (address < start + size).then_some(name)
    }

    /// Where something is, by the end of its name.
    pub fn find(&self, end: &str) -> Option<u64> {
        let mut all = self.symbols.iter();
        all.find(|(_, (_, name))| name.ends_with(end))
            .map(|(address, _)| *address)
    }

    /// The functions that an instruction is of, the innermost first: what has been inlined, and where.
    pub fn functions(&self, address: u64) -> Vec<String> {
        let mut names = Vec::new();
        if let Ok(mut frames) = self.lines.find_frames(address).skip_all_loads() {
            while let Ok(Some(frame)) = frames.next() {
                if let Some(name) = frame.function
                    && let Ok(name) = name.demangle()
                {
                    names.push(name.into_owned());
                }
            }
        }
        names
    }

    /// What it takes of the memories.
    pub fn sizes(&self) -> Sizes {
        self.sizes
    }

    /// Where the stack is: its lowest address, and that above it.
    pub fn stack(&self) -> (u64, u64) {
        self.stack
    }
}

/// Every function with what it takes of the stack, and whom it calls.
fn functions(file: &object::File<'_>) -> BTreeMap<u64, Function> {
    let mut functions = BTreeMap::new();
    for symbol in file.symbols().filter(|s| s.kind() == SymbolKind::Text) {
        let address = symbol.address() & !1;
        let section = symbol.section_index().map(|i| file.section_by_index(i));
        if let Some(Ok(section)) = section
            && let Ok(Some(code)) = section.data_range(address, symbol.size())
        {
            functions.insert(address, Function::read(code, address));
        }
    }
    functions
}

fn sizes(file: &object::File<'_>, stack: (u64, u64)) -> Sizes {
    let mut sizes = Sizes {
        stack: stack.1 - stack.0,
        ..Sizes::default()
    };
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else {
            continue;
        };
        let (allocated, writable) = (
            sh_flags & u64::from(elf::SHF_ALLOC) != 0,
            sh_flags & u64::from(elf::SHF_WRITE) != 0,
        );
        if !allocated {
            continue;
        }
        let size = section.size();
        // known by its symbols: not every script gives it a section
        if section.name() == Ok(".stack") {
            continue;
        }
        let stored = section.kind() != SectionKind::UninitializedData;
        if writable {
            sizes.ram += size;
        }
        if stored && section.name() != Ok(".uninit") {
            sizes.flash += size;
        }
    }
    sizes
}
