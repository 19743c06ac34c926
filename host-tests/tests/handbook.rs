//! The page on the drive system says what the drive system does, and a board is as small as its page says.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use host_tests::handbook::{PAGE, missing, refreshed};

/// To renew it: `cargo winder signals --markdown > drive.md`, then put it in place of the old one.
#[test]
fn the_page_has_the_tables_of_the_logic() {
    assert_eq!(missing(PAGE), Vec::<&str>::new());
    let now = refreshed(PAGE);
    for (number, (old, new)) in (1..).zip(PAGE.lines().zip(now.lines())) {
        assert_eq!(old, new, "docs/drive.md, line {number}");
    }
    assert_eq!(PAGE.lines().count(), now.lines().count());
}

/// A table that is out of date is renewed, and nothing else is touched.
#[test]
fn only_tables_are_renewed() {
    let page = "before\n<!-- refusals -->\nold\n<!-- end -->\nafter\n";
    let now = refreshed(page);
    assert!(now.starts_with("before\n<!-- refusals -->\n| Code | Meaning |\n"));
    assert!(now.contains("| 7 | the diameter preset is not between spool and full roll |\n"));
    assert!(now.ends_with("<!-- end -->\nafter\n") && !now.contains("old"));
    assert_eq!(refreshed(&now), now);
}

/// What all boards do is the library's, what some do is of the packages that they share.
#[test]
fn a_dev_board_is_one_small_package() {
    const LINES: usize = 600;
    let boards = Path::new(env!("CARGO_MANIFEST_DIR")).join("../firmware/boards");
    for board in ["nucleo-h743zi2", "nucleo-f207zg"] {
        let sources = fs::read_dir(boards.join(board).join("src")).unwrap();
        let lines: usize = sources
            .map(|file| fs::read_to_string(file.unwrap().path()).unwrap())
            .map(|source| source.lines().count())
            .sum();
        assert!(lines > 0 && lines <= LINES, "{board}: {lines} lines");
    }
}
