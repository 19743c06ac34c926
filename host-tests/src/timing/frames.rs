//! How deep a firmware's functions use the stack, by their compiled instructions.
//!
//! Not here: calls through pointers, of which the instructions do not tell where they lead; what an interrupt adds.
//!
//! Source: Armv7-M architecture reference manual, A5 (encodings) and A7.7 (`BL`, `B`, `PUSH`, `STMDB`, `STR`, `SUB`,
//! `VPUSH`).

use std::collections::{BTreeMap, BTreeSet};

/// A function: what it takes of the stack, in bytes, and whom it calls.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Function {
    /// Pushed and set aside.
    pub frame: u64,
    /// Their addresses.
    pub calls: BTreeSet<u64>,
}

impl Function {
    /// Of its instructions at an address.
    pub fn read(code: &[u8], address: u64) -> Self {
        let mut function = Self::default();
        let words: Vec<_> = code
            .chunks_exact(2)
            .map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
            .collect();
        let mut at = 0;
        while let Some(&first) = words.get(at) {
            // three patterns of the highest bits are of instructions of two words
            let wide = first >> 11 >= 0b11101;
            match words.get(at + 1).filter(|_| wide) {
                Some(&second) => function.wide(first, second, address + 2 * at as u64),
                None => function.narrow(first),
            }
            at += 1 + usize::from(wide);
        }
        function
    }

    fn narrow(&mut self, word: u16) {
        self.frame += match word {
            // PUSH: eight registers and the link register
            0xb400..=0xb5ff => 4 * u64::from((word & 0x1ff).count_ones()),
            // SUB SP, SP, #imm7 words
            0xb080..=0xb0ff => 4 * u64::from(word & 0x7f),
            _ => 0,
        };
    }

    fn wide(&mut self, first: u16, second: u16, address: u64) {
        let imm12 = u32::from(first >> 10 & 1) << 11
            | u32::from(second >> 12 & 7) << 8
            | u32::from(second & 0xff);
        let to_sp = second & 0x8f00 == 0x0d00;
        self.frame += match (first & 0xfbff, first, second) {
            // STMDB SP!
            (_, 0xe92d, list) => 4 * u64::from(list.count_ones()),
            // STR Rt, [SP, #-4]!
            (_, 0xf84d, second) if second & 0xfff == 0xd04 => 4,
            // VPUSH: so many words
            (_, 0xed2d | 0xed6d, second) if second & 0xe00 == 0xa00 => 4 * u64::from(second & 0xff),
            // SUB SP, SP, a constant that is expanded, or one that is not
            (0xf1ad, ..) if to_sp => expand(imm12).into(),
            (0xf2ad, ..) if to_sp => imm12.into(),
            _ => 0,
        };
        // BL, and B at the end of a function
        if first & 0xf800 == 0xf000 && matches!(second & 0xd000, 0xd000 | 0x9000) {
            let sign = u32::from(first >> 10 & 1);
            let [j1, j2] = [13, 11].map(|bit| !(u32::from(second >> bit) ^ sign) & 1);
            let offset = sign << 24
                | j1 << 23
                | j2 << 22
                | u32::from(first & 0x3ff) << 12
                | u32::from(second & 0x7ff) << 1;
            let offset = i64::from((offset << 7).cast_signed() >> 7);
            self.calls.insert((address + 4).wrapping_add_signed(offset));
        }
    }
}

/// A constant of Thumb, as far as frames have it: a byte rotated, or as it is.
fn expand(imm12: u32) -> u32 {
    match imm12 >> 8 {
        0 => imm12 & 0xff,
        _ => (0x80 | imm12 & 0x7f).rotate_right(imm12 >> 7),
    }
}

/// The deepest calls: their bytes, and the address that they begin at.
pub fn deepest(functions: &BTreeMap<u64, Function>) -> (u64, u64) {
    let mut known = BTreeMap::new();
    let all = functions
        .keys()
        .map(|at| (depth(functions, *at, &mut known), *at));
    all.max().unwrap_or_default()
}

/// A function with the deepest that it calls. Who calls itself counts once.
fn depth(functions: &BTreeMap<u64, Function>, at: u64, known: &mut BTreeMap<u64, u64>) -> u64 {
    let Some(function) = functions.get(&at) else {
        return 0;
    };
    if let Some(depth) = known.get(&at) {
        return *depth;
    }
    known.insert(at, 0);
    let calls = function.calls.iter().filter(|to| **to != at);
    let below = calls.map(|to| depth(functions, *to, known)).max();
    let depth = function.frame + below.unwrap_or_default();
    known.insert(at, depth);
    depth
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the GNU assembler: three functions, of which the last calls the first again.
    ///
    /// `outer: push {r4-r7, lr}; stmdb sp!, {r8, r9, sl, fp}; vpush {d8-d9}; sub sp, #16; bl inner; b.w last`,
    /// `inner: sub.w sp, sp, #35840; subw sp, sp, #1036; str lr, [sp, #-4]!; bx lr`,
    /// `last: sub.w sp, sp, #512; bl outer; bx lr`
    const OUTER: [u16; 10] = [
        0xb5f0, 0xe92d, 0x0f00, 0xed2d, 0x8b04, 0xb084, 0xf000, 0xf802, 0xf000, 0xb807,
    ];
    const INNER: [u16; 7] = [0xf5ad, 0x4d0c, 0xf2ad, 0x4d0c, 0xf84d, 0xed04, 0x4770];
    const LAST: [u16; 5] = [0xf5ad, 0x7d00, 0xf7ff, 0xffeb, 0x4770];

    fn function(words: &[u16], address: u64) -> Function {
        let code: Vec<_> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        Function::read(&code, address)
    }

    #[test]
    fn frames_and_calls_are_those_of_the_assembler() {
        let outer = function(&OUTER, 0);
        assert_eq!(outer.frame, 20 + 16 + 16 + 16);
        assert_eq!(outer.calls, [0x14, 0x22].into());
        let inner = function(&INNER, 0x14);
        assert_eq!(inner.frame, 35840 + 1036 + 4);
        assert!(inner.calls.is_empty());
        let last = function(&LAST, 0x22);
        assert_eq!((last.frame, last.calls.clone()), (512, [0].into()));

        let functions = [(0, outer), (0x14, inner), (0x22, last)].into();
        assert_eq!(deepest(&functions), (68 + 36880, 0));
    }
}
