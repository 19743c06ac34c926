//! Words, numbers and signs of a text, each with its line.
//!
//! Not here: what they mean together.

use super::{Error, Type};

/// A piece of the text.
#[derive(Clone, Debug, PartialEq)]
pub enum Token {
    /// A name or a word of the language, in small letters: the language knows no difference.
    Word(String),
    /// A whole number, with its type if it tells one.
    Integer(Option<Type>, i64),
    /// A number with a point.
    Real(f64),
    /// A duration, ms.
    Time(i64),
    /// Anything else.
    Sign(&'static str),
}

/// A piece and its line.
#[derive(Clone, Debug)]
pub struct Placed {
    /// The piece.
    pub token: Token,
    /// Its line.
    pub line: usize,
}

/// Signs, the longer ones first.
const SIGNS: [&str; 23] = [
    ":=", "=>", "<=", ">=", "<>", "**", "..", "+", "-", "*", "/", "(", ")", "[", "]", "<", ">",
    "=", ";", ",", ":", ".", "&",
];

/// Units of a duration, ms; the longer names first.
const UNITS: [(&str, f64); 5] = [
    ("ms", 1.0),
    ("d", 86.4e6),
    ("h", 3.6e6),
    ("m", 6e4),
    ("s", 1e3),
];

/// Cuts a text into its pieces.
pub fn lex(text: &str) -> Result<Vec<Placed>, Error> {
    let mut lexer = Lexer {
        rest: text,
        line: 1,
    };
    let mut tokens = Vec::new();
    while lexer.skip()? {
        let line = lexer.line;
        let token = lexer.token()?;
        tokens.push(Placed { token, line });
    }
    Ok(tokens)
}

struct Lexer<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Lexer<'a> {
    fn error(&self, what: impl Into<String>) -> Error {
        Error::new(self.line, what)
    }

    /// Takes so many bytes off; they end at a letter's end.
    fn take(&mut self, bytes: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(bytes);
        self.line += taken.matches('\n').count();
        self.rest = rest;
        taken
    }

    /// Goes over blanks and comments; false at the end.
    fn skip(&mut self) -> Result<bool, Error> {
        loop {
            let blank = self.rest.len() - self.rest.trim_start().len();
            self.take(blank);
            let comment = if self.rest.starts_with("//") {
                self.rest.find('\n').unwrap_or(self.rest.len())
            } else if let Some(inside) = self.rest.strip_prefix("(*") {
                let end = inside.find("*)");
                2 + 2 + end.ok_or_else(|| self.error("a comment begins here and does not end"))?
            } else {
                return Ok(!self.rest.is_empty());
            };
            self.take(comment);
        }
    }

    fn token(&mut self) -> Result<Token, Error> {
        let first = self.rest.chars().next().unwrap_or(' ');
        if first.is_ascii_digit() {
            return self.number();
        }
        if first.is_ascii_alphabetic() || first == '_' {
            return self.word();
        }
        match SIGNS.iter().find(|sign| self.rest.starts_with(**sign)) {
            Some(sign) => {
                self.take(sign.len());
                Ok(Token::Sign(sign))
            }
            None => Err(self.error(match first {
                '%' => "located variables (%…) are not used here: map the program's inputs and outputs by name".into(),
                '\'' | '"' => "strings are not known here".into(),
                '{' => "pragmas are not known here".into(),
                other => format!("`{other}` is no sign of the language"),
            })),
        }
    }

    /// Takes letters as long as they are of a kind.
    fn run(&mut self, of: impl Fn(char) -> bool) -> &'a str {
        let end = self.rest.find(|c| !of(c)).unwrap_or(self.rest.len());
        self.take(end)
    }

    fn word(&mut self) -> Result<Token, Error> {
        let word = self.run(|c| c.is_ascii_alphanumeric() || c == '_');
        if !self.rest.starts_with('#') {
            return Ok(Token::Word(word.to_ascii_lowercase()));
        }
        self.take(1);
        let kind = if word.eq_ignore_ascii_case("t") {
            Type::Time
        } else {
            Type::of(word).ok_or_else(|| self.error(format!("{word}# is no type known here")))?
        };
        match kind {
            Type::Time => self.time(),
            Type::Bool => {
                let truth = self.run(|c| c.is_ascii_alphanumeric());
                match truth.to_ascii_lowercase().as_str() {
                    "true" | "1" => Ok(Token::Word("true".into())),
                    "false" | "0" => Ok(Token::Word("false".into())),
                    _ => Err(self.error(format!("BOOL#{truth} is neither TRUE nor FALSE"))),
                }
            }
            kind => {
                let minus = self.rest.starts_with('-');
                if minus {
                    self.take(1);
                }
                match self.number()? {
                    Token::Integer(None, value) if kind != Type::Real => Ok(Token::Integer(
                        Some(kind),
                        if minus { -value } else { value },
                    )),
                    Token::Real(value) if kind == Type::Real => {
                        Ok(Token::Real(if minus { -value } else { value }))
                    }
                    _ => {
                        Err(self.error(format!("{word}# is not followed by a number of its type")))
                    }
                }
            }
        }
    }

    fn number(&mut self) -> Result<Token, Error> {
        let digits = self
            .run(|c| c.is_ascii_digit() || c == '_')
            .replace('_', "");
        if self.rest.starts_with('#') {
            self.take(1);
            let text = self.run(|c| c.is_ascii_alphanumeric() || c == '_');
            let radix = match digits.as_str() {
                "2" => 2,
                "8" => 8,
                "16" => 16,
                _ => return Err(self.error(format!("{digits}# is no base: 2, 8 or 16"))),
            };
            return i64::from_str_radix(&text.replace('_', ""), radix)
                .map(|value| Token::Integer(None, value))
                .map_err(|_| self.error(format!("{digits}#{text} is no number")));
        }
        let mut after = self.rest.chars();
        let point = after.next() == Some('.') && after.next().is_some_and(|c| c.is_ascii_digit());
        if !point {
            return digits
                .parse()
                .map(|value| Token::Integer(None, value))
                .map_err(|_| self.error(format!("{digits} is no number")));
        }
        self.take(1);
        let fraction = self
            .run(|c| c.is_ascii_digit() || c == '_')
            .replace('_', "");
        let mut text = format!("{digits}.{fraction}");
        if self.rest.starts_with(['e', 'E']) {
            self.take(1);
            text.push('e');
            if self.rest.starts_with(['+', '-']) {
                text += self.take(1);
            }
            text += self.run(|c| c.is_ascii_digit());
        }
        match text.parse::<f64>() {
            Ok(value) if (value as f32).is_finite() => Ok(Token::Real(value)),
            _ => Err(self.error(format!("{text} is no REAL"))),
        }
    }

    /// A duration: numbers with their units, as in `1m30s` or `0.5s`.
    fn time(&mut self) -> Result<Token, Error> {
        let minus = self.rest.starts_with('-');
        if minus {
            self.take(1);
        }
        let text = self.run(|c| c.is_ascii_alphanumeric() || c == '.' || c == '_');
        let wrong = || Error::new(self.line, format!("T#{text} is no duration"));
        let (text_small, mut total) = (text.to_ascii_lowercase().replace('_', ""), 0.0);
        let mut rest = text_small.as_str();
        while !rest.is_empty() {
            let end = rest
                .find(|c: char| c.is_ascii_alphabetic())
                .ok_or_else(wrong)?;
            let number: f64 = rest[..end].parse().map_err(|_| wrong())?;
            let unit = UNITS.iter().find(|(name, _)| rest[end..].starts_with(name));
            let (name, ms) = unit.ok_or_else(wrong)?;
            total += number * ms;
            rest = &rest[end + name.len()..];
        }
        let most = f64::from(i32::MAX);
        if text.is_empty() || total.fract() != 0.0 || total > most {
            return Err(wrong());
        }
        Ok(Token::Time(if minus {
            -(total as i64)
        } else {
            total as i64
        }))
    }
}
