//! The page on the drive system says what the drive system does.
#![allow(clippy::unwrap_used)]

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
