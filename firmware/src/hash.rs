//! A short hash for what must not be mistaken for something else by chance. Nobody is kept from making two equal.

/// FNV-1a. Source: Fowler, Noll, Vo, draft-eastlake-fnv, 32 bits.
pub fn fnv1a(bytes: impl IntoIterator<Item = u8>) -> u32 {
    const START: u32 = 0x811c_9dc5;
    const PRIME: u32 = 0x0100_0193;
    let step = |hash: u32, byte| (hash ^ u32::from(byte)).wrapping_mul(PRIME);
    bytes.into_iter().fold(START, step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the draft's own table.
    #[test]
    fn the_hash_is_fnv1a() {
        for (text, hash) in [
            ("", 0x811c_9dc5),
            ("a", 0xe40c_292c),
            ("foobar", 0xbf9c_f968),
        ] {
            assert_eq!(fnv1a(text.bytes()), hash, "{text}");
        }
    }
}
