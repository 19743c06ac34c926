//! The interface's document has every route, as the table of the code has it.

use std::fmt::Write as _;

use firmware::hmi::routes::ROUTES;

const DOCUMENT: &str = include_str!("../../docs/api.md");

#[test]
fn the_document_has_the_table_of_routes() {
    let mut table = String::from("| Request | Session | |\n|---|---|---|\n");
    for route in ROUTES {
        let session = if route.login { "yes" } else { "" };
        let request = format!("{} {}", route.method.name(), route.path);
        writeln!(table, "| `{request}` | {session} | {} |", route.about).unwrap();
    }
    assert!(
        DOCUMENT.contains(&table),
        "docs/api.md needs this:\n{table}"
    );
}
