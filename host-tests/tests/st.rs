//! Structured Text: small programs with results that the standard gives, and texts that nobody would write.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use host_tests::accept::controller::REFERENCE;
use host_tests::st::{Program, Runner, Value};
use proptest::prelude::*;

/// A program of these variables and statements, before its first cycle.
fn program(variables: &str, body: &str) -> Runner {
    let text = format!("PROGRAM p\nVAR\n{variables}\nEND_VAR\n{body}\nEND_PROGRAM");
    Runner::new(Arc::new(Program::new(&text).unwrap()))
}

/// The value of `x` after one cycle.
fn x(variables: &str, body: &str) -> Value {
    let mut runner = program(variables, body);
    runner.cycle(10).unwrap();
    runner.value("x").unwrap()
}

fn error(text: &str) -> String {
    Program::new(text).unwrap_err().to_string()
}

#[test]
fn integers_wrap_in_their_width() {
    for (of, body, expected) in [
        ("INT", "x := 32767; x := x + 1;", -32768),
        ("UINT", "x := 0; x := x - 1;", 65535),
        ("USINT", "x := 200; x := x + 100;", 44),
        ("SINT", "x := 127; x := x * 2;", -2),
        ("UDINT", "x := 4294967295; x := x * x;", 1),
        ("DINT", "x := -7 / 2;", -3),
        ("DINT", "x := -7 MOD 2;", -1),
        ("WORD", "x := NOT 16#00FF;", 0xFF00),
        ("WORD", "x := SHL(16#8001, 1) OR 2#100;", 6),
        ("DINT", "x := UDINT_TO_DINT(UDINT#16 - 20);", -4),
        ("INT", "x := REAL_TO_INT(2.5);", 2),
        ("INT", "x := REAL_TO_INT(-3.5);", -4),
        ("DINT", "x := TRUNC(-3.9);", -3),
        ("INT", "x := LIMIT(-5, 17, 12);", 12),
        ("INT", "x := SEL(TRUE, 3, 4) + MIN(7, 6) * MAX(1, 2);", 16),
        ("TIME", "x := T#1m2s500ms - T#0.5s;", 62_000),
        (
            "INT",
            "x := BOOL_TO_INT(3 > 2 AND NOT (1 = 2) XOR FALSE);",
            1,
        ),
    ] {
        assert_eq!(
            x(&format!("x : {of};"), body),
            Value::Int(expected),
            "{body}"
        );
    }
}

#[test]
fn operators_bind_as_the_standard_has_it() {
    let real = |body| x("x : REAL; y : REAL := -2.0;", body);
    assert_eq!(real("x := 2.0 + 3.0 * 4.0 - 6.0 / 2.0;"), Value::Real(11.0));
    assert_eq!(real("x := -y * 3.0;"), Value::Real(6.0));
    assert_eq!(real("x := SQRT(ABS(y) * 8.0);"), Value::Real(4.0));
    let truth = |body| x("x : BOOL;", body);
    assert_eq!(truth("x := TRUE OR FALSE AND FALSE;"), Value::Bool(true));
    assert_eq!(truth("x := NOT TRUE OR 1 + 1 = 2;"), Value::Bool(true));
}

#[test]
fn statements_do_what_they_say() {
    for (body, expected) in [
        ("FOR i := 1 TO 10 BY 3 DO x := x + i; END_FOR;", 22),
        ("FOR i := 3 TO 1 BY -1 DO x := x * 10 + i; END_FOR;", 321),
        (
            "FOR i := 1 TO 9 DO IF i = 4 THEN EXIT; END_IF; x := i; END_FOR;",
            3,
        ),
        ("WHILE x < 5 DO x := x + 2; END_WHILE;", 6),
        ("REPEAT x := x + 1; UNTIL x >= 3 END_REPEAT;", 3),
        (
            "i := 7; CASE i OF 1, 2: x := 1; 3..7: x := 2; ELSE x := 3; END_CASE;",
            2,
        ),
        ("i := -1; CASE i OF 1: x := 1; -1: x := 4; END_CASE;", 4),
        ("i := 9; CASE i OF A: x := 5; B: x := 6; END_CASE;", 6),
        (
            "IF x > 0 THEN x := 1; ELSIF x = 0 THEN x := 2; ELSE x := 3; END_IF;",
            2,
        ),
        ("x := 1; RETURN; x := 2;", 1),
    ] {
        let mut runner = {
            let text = format!(
                "PROGRAM p\nVAR CONSTANT A : INT := 8; B : INT := A + 1; END_VAR\n\
                 VAR x : INT; i : INT; END_VAR\n{body}\nEND_PROGRAM"
            );
            Runner::new(Arc::new(Program::new(&text).unwrap()))
        };
        runner.cycle(10).unwrap();
        assert_eq!(runner.value("x"), Some(Value::Int(expected)), "{body}");
    }
}

/// What a timer shows in each cycle of 100 ms, for an input that is 1 where the text has a `1`.
fn timer(kind: &str, input: &str) -> String {
    let variables = format!("t : {kind}; i : BOOL; x : BOOL; e : TIME;");
    let mut runner = program(&variables, "t(IN := i, PT := T#250ms, Q => x, ET => e);");
    let i = runner.program().variables()[0].clone();
    assert_eq!(i.name, "i");
    let mut shown = String::new();
    for c in input.chars() {
        runner.set(&i, Value::Bool(c == '1'));
        runner.cycle(100).unwrap();
        shown.push(if runner.value("x") == Some(Value::Bool(true)) {
            '1'
        } else {
            '0'
        });
    }
    shown
}

/// The diagrams of IEC 61131-3, in cycles: a time of 250 ms is over in the third cycle behind its beginning.
#[test]
fn timers_are_those_of_the_standard() {
    assert_eq!(timer("TON", "0111111011100"), "0000111000000");
    assert_eq!(timer("TOF", "0110000110100"), "0111110111111");
    assert_eq!(timer("TP", "0111110100000"), "0111000111000");
}

#[test]
fn edges_and_counters() {
    let mut runner = program(
        "r : R_TRIG; f : F_TRIG; c : CTU; i : BOOL; x : INT; n : INT; full : BOOL;",
        "r(CLK := i); f(CLK := i); c(CU := i, R := FALSE, PV := 2);
         IF r.Q THEN x := x + 1; END_IF; IF f.Q THEN x := x + 10; END_IF;
         n := c.CV; full := c.Q;",
    );
    let i = runner.program().variables()[0].clone();
    for c in "0110100".chars() {
        runner.set(&i, Value::Bool(c == '1'));
        runner.cycle(10).unwrap();
    }
    assert_eq!(runner.value("x"), Some(Value::Int(22)));
    assert_eq!(runner.value("n"), Some(Value::Int(2)));
    assert_eq!(runner.value("full"), Some(Value::Bool(true)));
}

/// Each instance has a memory of its own, a function has none.
#[test]
fn blocks_remember_and_functions_forget() {
    let text = "
        FUNCTION twice : INT VAR_INPUT a : INT; b : INT := 2; END_VAR VAR n : INT; END_VAR
            n := n + a; twice := n * b;
        END_FUNCTION
        FUNCTION_BLOCK Count VAR_INPUT inc : INT := 1; END_VAR VAR_OUTPUT n : INT; END_VAR
            n := n + inc;
        END_FUNCTION_BLOCK
        FUNCTION_BLOCK Pair VAR_OUTPUT n : INT; END_VAR VAR a : Count; b : Count; END_VAR
            a(); b(inc := 10); n := a.n + b.n;
        END_FUNCTION_BLOCK
        PROGRAM p VAR one : Pair; two : Pair; x : INT; y : INT; z : INT; END_VAR
            one(); one(); two(n => y); x := one.n;
            z := twice(twice(3), b := 3);
        END_PROGRAM";
    let mut runner = Runner::new(Arc::new(Program::new(text).unwrap()));
    runner.cycle(10).unwrap();
    let value = |name| runner.value(name);
    assert_eq!(value("x"), Some(Value::Int(22)));
    assert_eq!(value("y"), Some(Value::Int(11)));
    assert_eq!(value("z"), Some(Value::Int(18)));
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let p = |body: &str| {
        format!("PROGRAM p\nVAR speed : INT; r : REAL; t : TON; END_VAR\n{body}\nEND_PROGRAM")
    };
    for (text, expected) in [
        (
            p("spede := 1;"),
            "line 3: spede is not declared; the nearest is speed",
        ),
        (
            p("speed := 1.0;"),
            "line 3: a INT is expected, not a REAL: convert it (REAL_TO_INT)",
        ),
        (
            p("r := speed;"),
            "line 3: a REAL is expected, not a INT: convert it (INT_TO_REAL)",
        ),
        (
            p("speed := 40000;"),
            "line 3: 40000 is outside INT: -32768 to 32767",
        ),
        (
            p("speed := 1;\nspeed := 2"),
            "line 5: `;` is expected, not `end_program`",
        ),
        (
            p("t(IN := TRUE, PZ := T#1s);"),
            "line 3: the function block has no pz; the nearest is pt",
        ),
        (
            p("t.q := TRUE;"),
            "line 3: t.q is an input or a constant: it is not written here",
        ),
        (
            p("speed := foo(1);"),
            "line 3: FOO is no function declared before",
        ),
        (
            p("speed := %IW3;"),
            "line 3: located variables (%…) are not used here: map the program's inputs and outputs by name",
        ),
        (p("EXIT;"), "line 3: EXIT stands in no loop"),
        (p("r := é;"), "line 3: `é` is no sign of the language"),
        (
            p("(* speed := 1;"),
            "line 3: a comment begins here and does not end",
        ),
        (
            "FUNCTION f : INT f := 1; END_FUNCTION".into(),
            "line 1: there is no PROGRAM",
        ),
        (
            "VAR_GLOBAL x : INT; END_VAR".into(),
            "line 1: VAR_GLOBAL is not known here",
        ),
    ] {
        assert_eq!(error(&text), expected, "{text}");
    }
}

#[test]
fn what_stops_a_plc_stops_the_program() {
    for (body, expected) in [
        ("x := 1 / x;", "line 5: division by zero"),
        (
            "WHILE TRUE DO x := 1; END_WHILE;",
            "line 5: a cycle took more than 200000 statements",
        ),
    ] {
        let mut runner = program("x : INT;", body);
        assert_eq!(runner.cycle(10).unwrap_err().to_string(), expected);
    }
}

proptest! {
    /// No text makes the reader panic or hang.
    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,200}") {
        let _ = Program::new(&text);
    }

    /// Nor one made of the language's own pieces, which comes further; and what is read, runs or stops.
    #[test]
    fn any_pieces_are_read_or_refused(pieces in proptest::collection::vec(0..PIECES.len(), 0..60)) {
        let body: Vec<_> = pieces.into_iter().map(|i| PIECES[i]).collect();
        let text = format!("PROGRAM p VAR x : INT; b : BOOL; t : TON; r : REAL; END_VAR {} END_PROGRAM", body.join(" "));
        if let Ok(program) = Program::new(&text) {
            let mut runner = Runner::new(Arc::new(program));
            let _ = runner.cycle(10);
        }
    }

    /// Nor the reference program with a piece cut out of it.
    #[test]
    fn a_damaged_program_is_read_or_refused(at in 0..REFERENCE.len(), bytes in 1..40usize) {
        let (before, rest) = REFERENCE.split_at(at);
        let _ = Program::new(&format!("{before}{}", &rest[bytes.min(rest.len())..]));
    }

    /// Integers go as those of the machine do.
    #[test]
    fn arithmetic_is_the_machine_s(a: i16, b: i16) {
        let wrapped = a.wrapping_mul(b).wrapping_add(a).wrapping_sub(b);
        let body = format!("x := INT#{a} * INT#{b} + INT#{a} - INT#{b};");
        prop_assert_eq!(x("x : INT;", &body), Value::Int(wrapped.into()));
    }
}

const PIECES: [&str; 40] = [
    "x",
    "b",
    "t",
    "r",
    ":=",
    ";",
    "(",
    ")",
    "IF",
    "THEN",
    "ELSE",
    "END_IF",
    "CASE",
    "OF",
    ":",
    "END_CASE",
    "FOR",
    "TO",
    "DO",
    "END_FOR",
    "WHILE",
    "END_WHILE",
    "+",
    "-",
    "*",
    "/",
    "MOD",
    "AND",
    "NOT",
    "=",
    "<",
    "1",
    "2.5",
    "T#1s",
    "TRUE",
    "ABS",
    ",",
    "..",
    "IN",
    ".Q",
];
