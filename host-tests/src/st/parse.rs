//! From a text to its syntax tree.
//!
//! Not here: whether names and types fit.

use super::lex::{Placed, Token, lex};
use super::{Error, Type};

/// Statements and expressions may be nested so deep.
const DEPTH: usize = 60;
/// An expression may have so many operators in a row: what works on it goes down as deep.
const HEIGHT: usize = 100;

/// What a unit of the text is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Role {
    /// A function, with the type it returns.
    Function(String),
    /// A function block.
    FunctionBlock,
    /// The program.
    Program,
}

/// A function, function block or program.
#[derive(Clone, Debug)]
pub struct Pou {
    /// What it is.
    pub role: Role,
    /// Its name.
    pub name: String,
    /// Its line.
    pub line: usize,
    /// Its variables.
    pub variables: Vec<Declaration>,
    /// What it does.
    pub body: Vec<Statement>,
}

/// Where a variable belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    /// `VAR_INPUT`.
    Input,
    /// `VAR_OUTPUT`.
    Output,
    /// `VAR`.
    Local,
    /// `VAR CONSTANT`.
    Constant,
}

/// A variable's declaration.
#[derive(Clone, Debug)]
pub struct Declaration {
    /// Where it belongs.
    pub block: Block,
    /// Its name.
    pub name: String,
    /// The name of its type.
    pub of: String,
    /// What it begins with.
    pub initial: Option<Expression>,
    /// Its line.
    pub line: usize,
}

/// A statement with its line.
#[derive(Clone, Debug)]
pub struct Statement {
    /// Its line.
    pub line: usize,
    /// What it does.
    pub kind: StatementKind,
}

/// What a statement does.
#[derive(Clone, Debug)]
pub enum StatementKind {
    /// `target := value`.
    Assign(Vec<String>, Expression),
    /// A function block is called.
    Call(String, Vec<Argument>),
    /// Conditions with what is done, and what otherwise.
    If(Vec<(Expression, Vec<Statement>)>, Vec<Statement>),
    /// Labels with what is done, and what otherwise.
    Case(
        Expression,
        Vec<(Vec<Label>, Vec<Statement>)>,
        Vec<Statement>,
    ),
    /// Variable, from, to, by.
    For(String, [Expression; 2], Option<Expression>, Vec<Statement>),
    /// As long as.
    While(Expression, Vec<Statement>),
    /// Until.
    Repeat(Vec<Statement>, Expression),
    /// Leaves the loop.
    Exit,
    /// Leaves the unit.
    Return,
}

/// A label of a `CASE`: one value, or a range.
pub type Label = (Expression, Option<Expression>);

/// An argument of a call.
#[derive(Clone, Debug)]
pub enum Argument {
    /// By its place.
    Plain(Expression),
    /// `name := value`.
    In(String, Expression),
    /// `name => target`.
    Out(String, Vec<String>),
}

impl Argument {
    fn height(&self) -> usize {
        match self {
            Self::Plain(value) | Self::In(_, value) => value.height,
            Self::Out(..) => 0,
        }
    }
}

/// An expression with its line.
#[derive(Clone, Debug)]
pub struct Expression {
    /// Its line.
    pub line: usize,
    /// What it is.
    pub kind: ExpressionKind,
    /// How many operators stand one above the other.
    height: usize,
}

impl Expression {
    fn leaf(line: usize, kind: ExpressionKind) -> Self {
        Self {
            line,
            kind,
            height: 0,
        }
    }

    fn above(
        line: usize,
        kind: ExpressionKind,
        below: impl IntoIterator<Item = usize>,
    ) -> Result<Self, Error> {
        let height = 1 + below.into_iter().max().unwrap_or(0);
        if height > HEIGHT {
            return Err(Error::new(
                line,
                format!("more than {HEIGHT} operators in one expression"),
            ));
        }
        Ok(Self { line, kind, height })
    }
}

/// What an expression is.
#[derive(Clone, Debug)]
pub enum ExpressionKind {
    /// TRUE or FALSE.
    Truth(bool),
    /// A whole number, with its type if it tells one.
    Integer(Option<Type>, i64),
    /// A number with a point.
    Real(f64),
    /// A duration, ms.
    Time(i64),
    /// A variable, or one of an instance.
    Path(Vec<String>),
    /// `NOT` or `-`.
    Unary(&'static str, Box<Expression>),
    /// Two operands.
    Binary(&'static str, Box<[Expression; 2]>),
    /// A function.
    Call(String, Vec<Argument>),
}

/// Operators by how strongly they bind, the weakest first.
const LEVELS: [&[&str]; 6] = [
    &["or"],
    &["xor"],
    &["and", "&"],
    &["=", "<>"],
    &["<", ">", "<=", ">="],
    &["+", "-"],
];
const PRODUCTS: &[&str] = &["*", "/", "mod"];

/// Words that are no names.
const RESERVED: [&str; 38] = [
    "if",
    "then",
    "elsif",
    "else",
    "end_if",
    "case",
    "of",
    "end_case",
    "for",
    "to",
    "by",
    "do",
    "end_for",
    "while",
    "end_while",
    "repeat",
    "until",
    "end_repeat",
    "exit",
    "return",
    "not",
    "and",
    "or",
    "xor",
    "mod",
    "true",
    "false",
    "program",
    "end_program",
    "function",
    "end_function",
    "function_block",
    "end_function_block",
    "var",
    "var_input",
    "var_output",
    "end_var",
    "constant",
];

/// Words that open what is not known here.
const UNKNOWN: [&str; 12] = [
    "type",
    "var_global",
    "var_external",
    "var_in_out",
    "var_temp",
    "configuration",
    "class",
    "interface",
    "namespace",
    "struct",
    "array",
    "method",
];

/// Reads a text.
pub fn parse(text: &str) -> Result<Vec<Pou>, Error> {
    let tokens = lex(text)?;
    let last = text.lines().count().max(1);
    let mut parser = Parser {
        tokens: &tokens,
        at: 0,
        last,
        depth: 0,
    };
    let mut units = Vec::new();
    while parser.at < tokens.len() {
        units.push(parser.unit()?);
    }
    Ok(units)
}

struct Parser<'a> {
    tokens: &'a [Placed],
    at: usize,
    /// The text's last line.
    last: usize,
    depth: usize,
}

impl Parser<'_> {
    fn line(&self) -> usize {
        self.tokens.get(self.at).map_or(self.last, |p| p.line)
    }

    fn token(&self) -> Option<&Token> {
        self.tokens.get(self.at).map(|p| &p.token)
    }

    fn wanted(&self, what: &str) -> Error {
        let found = match self.token() {
            None => "the end of the text".into(),
            Some(Token::Word(word)) if UNKNOWN.contains(&word.as_str()) => {
                let word = word.to_ascii_uppercase();
                return Error::new(self.line(), format!("{word} is not known here"));
            }
            Some(Token::Word(word)) => format!("`{word}`"),
            Some(Token::Sign(sign)) => format!("`{sign}`"),
            Some(Token::Integer(_, value)) => format!("{value}"),
            Some(Token::Real(value)) => format!("{value}"),
            Some(Token::Time(ms)) => format!("T#{ms}ms"),
        };
        Error::new(self.line(), format!("{what} is expected, not {found}"))
    }

    fn is(&self, text: &str) -> bool {
        match self.token() {
            Some(Token::Word(word)) => word == text,
            Some(Token::Sign(sign)) => *sign == text,
            _ => false,
        }
    }

    fn accept(&mut self, text: &str) -> bool {
        let is = self.is(text);
        self.at += usize::from(is);
        is
    }

    fn expect(&mut self, text: &str) -> Result<(), Error> {
        if self.accept(text) {
            return Ok(());
        }
        Err(self.wanted(&format!("`{}`", text.to_ascii_uppercase())))
    }

    fn name(&mut self) -> Result<String, Error> {
        match self.token() {
            Some(Token::Word(word)) if !RESERVED.contains(&word.as_str()) => {
                let name = word.clone();
                self.at += 1;
                Ok(name)
            }
            _ => Err(self.wanted("a name")),
        }
    }

    fn unit(&mut self) -> Result<Pou, Error> {
        let line = self.line();
        let (word, end) = [
            ("program", "end_program"),
            ("function_block", "end_function_block"),
            ("function", "end_function"),
        ]
        .into_iter()
        .find(|(word, _)| self.is(word))
        .ok_or_else(|| self.wanted("PROGRAM, FUNCTION_BLOCK or FUNCTION"))?;
        self.at += 1;
        let name = self.name()?;
        let role = match word {
            "program" => Role::Program,
            "function_block" => Role::FunctionBlock,
            _ => {
                self.expect(":")?;
                Role::Function(self.name()?)
            }
        };
        let mut variables = Vec::new();
        while let Some(block) = self.block() {
            self.declarations(block, &mut variables)?;
        }
        let body = self.statements(&[end])?;
        self.expect(end)?;
        self.accept(";");
        Ok(Pou {
            role,
            name,
            line,
            variables,
            body,
        })
    }

    fn block(&mut self) -> Option<Block> {
        let blocks = [
            ("var_input", Block::Input),
            ("var_output", Block::Output),
            ("var", Block::Local),
        ];
        let (_, block) = blocks.into_iter().find(|(word, _)| self.accept(word))?;
        let constant = block == Block::Local && self.accept("constant");
        Some(if constant { Block::Constant } else { block })
    }

    fn declarations(&mut self, block: Block, out: &mut Vec<Declaration>) -> Result<(), Error> {
        while !self.accept("end_var") {
            let line = self.line();
            let mut names = vec![self.name()?];
            while self.accept(",") {
                names.push(self.name()?);
            }
            if self.is("at") {
                return Err(Error::new(
                    line,
                    "located variables (AT %…) are not used here: map by name",
                ));
            }
            self.expect(":")?;
            if matches!(self.token(), Some(Token::Word(w)) if UNKNOWN.contains(&w.as_str())) {
                return Err(self.wanted("a type"));
            }
            let of = self.name()?;
            let initial = self.accept(":=").then(|| self.expression()).transpose()?;
            self.expect(";")?;
            out.extend(names.into_iter().map(|name| Declaration {
                block,
                name,
                of: of.clone(),
                initial: initial.clone(),
                line,
            }));
        }
        Ok(())
    }

    /// Runs a reader one level deeper.
    fn deeper<T>(&mut self, read: impl FnOnce(&mut Self) -> Result<T, Error>) -> Result<T, Error> {
        if self.depth == DEPTH {
            return Err(Error::new(
                self.line(),
                format!("nested more than {DEPTH} levels deep"),
            ));
        }
        self.depth += 1;
        let read = read(self);
        self.depth -= 1;
        read
    }

    /// Statements up to one of these words.
    fn statements(&mut self, ends: &[&str]) -> Result<Vec<Statement>, Error> {
        let mut statements = Vec::new();
        while !ends.iter().any(|end| self.is(end)) {
            if self.accept(";") {
                continue;
            }
            statements.push(self.deeper(Self::statement)?);
        }
        Ok(statements)
    }

    fn statement(&mut self) -> Result<Statement, Error> {
        let line = self.line();
        let kind = if self.accept("if") {
            self.if_statement()?
        } else if self.accept("case") {
            self.case()?
        } else if self.accept("for") {
            self.for_loop()?
        } else if self.accept("while") {
            let condition = self.expression()?;
            self.expect("do")?;
            let body = self.statements(&["end_while"])?;
            self.expect("end_while")?;
            StatementKind::While(condition, body)
        } else if self.accept("repeat") {
            let body = self.statements(&["until"])?;
            self.expect("until")?;
            let condition = self.expression()?;
            self.accept(";");
            self.expect("end_repeat")?;
            StatementKind::Repeat(body, condition)
        } else if self.accept("exit") {
            StatementKind::Exit
        } else if self.accept("return") {
            StatementKind::Return
        } else {
            self.plain()?
        };
        self.expect(";")?;
        Ok(Statement { line, kind })
    }

    /// An assignment, or the call of a function block.
    fn plain(&mut self) -> Result<StatementKind, Error> {
        let path = self.path()?;
        if let ([name], true) = (&path[..], self.is("(")) {
            return Ok(StatementKind::Call(name.clone(), self.arguments()?));
        }
        self.expect(":=")?;
        Ok(StatementKind::Assign(path, self.expression()?))
    }

    fn path(&mut self) -> Result<Vec<String>, Error> {
        let mut path = vec![self.name()?];
        while self.accept(".") {
            path.push(self.name()?);
        }
        if self.is("[") {
            return Err(Error::new(self.line(), "arrays are not known here"));
        }
        Ok(path)
    }

    fn if_statement(&mut self) -> Result<StatementKind, Error> {
        let (mut arms, mut otherwise) = (Vec::new(), Vec::new());
        loop {
            let condition = self.expression()?;
            self.expect("then")?;
            arms.push((condition, self.statements(&["elsif", "else", "end_if"])?));
            if self.accept("elsif") {
                continue;
            }
            if self.accept("else") {
                otherwise = self.statements(&["end_if"])?;
            }
            self.expect("end_if")?;
            return Ok(StatementKind::If(arms, otherwise));
        }
    }

    fn case(&mut self) -> Result<StatementKind, Error> {
        let selector = self.expression()?;
        self.expect("of")?;
        let (mut arms, mut otherwise) = (Vec::new(), Vec::new());
        while !self.is("else") && !self.is("end_case") {
            let mut labels = vec![self.label()?];
            while self.accept(",") {
                labels.push(self.label()?);
            }
            self.expect(":")?;
            let mut body = Vec::new();
            while !self.is("else") && !self.is("end_case") && !self.at_label() {
                if !self.accept(";") {
                    body.push(self.deeper(Self::statement)?);
                }
            }
            arms.push((labels, body));
        }
        if self.accept("else") {
            otherwise = self.statements(&["end_case"])?;
        }
        self.expect("end_case")?;
        Ok(StatementKind::Case(selector, arms, otherwise))
    }

    /// A number, or a name that `:` or `,` follows, begins the next arm of a `CASE`.
    fn at_label(&self) -> bool {
        let next = self.tokens.get(self.at + 1).map(|p| &p.token);
        let follows = |sign| matches!(next, Some(Token::Sign(s)) if *s == sign);
        match self.token() {
            Some(Token::Integer(..)) | Some(Token::Sign("-")) | None => true,
            Some(Token::Word(_)) => [":", ",", ".."].into_iter().any(follows),
            _ => false,
        }
    }

    fn label(&mut self) -> Result<Label, Error> {
        let from = self.expression()?;
        let to = self.accept("..").then(|| self.expression()).transpose()?;
        Ok((from, to))
    }

    fn for_loop(&mut self) -> Result<StatementKind, Error> {
        let name = self.name()?;
        self.expect(":=")?;
        let from = self.expression()?;
        self.expect("to")?;
        let to = self.expression()?;
        let by = self.accept("by").then(|| self.expression()).transpose()?;
        self.expect("do")?;
        let body = self.statements(&["end_for"])?;
        self.expect("end_for")?;
        Ok(StatementKind::For(name, [from, to], by, body))
    }

    fn arguments(&mut self) -> Result<Vec<Argument>, Error> {
        self.expect("(")?;
        let mut arguments = Vec::new();
        while !self.accept(")") {
            if !arguments.is_empty() {
                self.expect(",")?;
            }
            let named = match (self.token(), self.tokens.get(self.at + 1).map(|p| &p.token)) {
                (Some(Token::Word(name)), Some(Token::Sign(sign @ (":=" | "=>")))) => {
                    Some((name.clone(), *sign))
                }
                _ => None,
            };
            arguments.push(match named {
                Some((name, sign)) => {
                    self.at += 2;
                    if sign == ":=" {
                        Argument::In(name, self.expression()?)
                    } else {
                        Argument::Out(name, self.path()?)
                    }
                }
                None => Argument::Plain(self.expression()?),
            });
        }
        Ok(arguments)
    }

    fn expression(&mut self) -> Result<Expression, Error> {
        self.deeper(|parser| parser.level(0))
    }

    fn level(&mut self, level: usize) -> Result<Expression, Error> {
        let (operators, next) = match LEVELS.get(level) {
            Some(operators) => (*operators, level + 1),
            None => return self.product(),
        };
        let mut left = self.level(next)?;
        while let Some(operator) = self.operator(operators) {
            let line = left.line;
            let right = self.level(next)?;
            left = binary(line, operator, left, right)?;
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Expression, Error> {
        let mut left = self.unary()?;
        while let Some(operator) = self.operator(PRODUCTS) {
            let line = left.line;
            let right = self.unary()?;
            left = binary(line, operator, left, right)?;
        }
        if self.is("**") {
            return Err(Error::new(self.line(), "`**` is not known here: multiply"));
        }
        Ok(left)
    }

    fn operator(&mut self, of: &[&'static str]) -> Option<&'static str> {
        of.iter().copied().find(|operator| self.accept(operator))
    }

    fn unary(&mut self) -> Result<Expression, Error> {
        let line = self.line();
        if self.accept("+") {
            return self.deeper(Self::unary);
        }
        let Some(operator) = self.operator(&["not", "-"]) else {
            return self.primary();
        };
        let operand = Box::new(self.deeper(Self::unary)?);
        let height = operand.height;
        let kind = match (operator, &operand.kind) {
            // the least integer has no positive
            ("-", ExpressionKind::Integer(kind, value)) => ExpressionKind::Integer(*kind, -value),
            ("-", ExpressionKind::Real(value)) => ExpressionKind::Real(-value),
            ("-", ExpressionKind::Time(ms)) => ExpressionKind::Time(-ms),
            _ => ExpressionKind::Unary(operator, operand),
        };
        Expression::above(line, kind, [height])
    }

    fn primary(&mut self) -> Result<Expression, Error> {
        let line = self.line();
        if self.accept("(") {
            let inner = self.expression()?;
            self.expect(")")?;
            return Ok(inner);
        }
        let kind = match self.token().cloned() {
            Some(Token::Integer(kind, value)) => ExpressionKind::Integer(kind, value),
            Some(Token::Real(value)) => ExpressionKind::Real(value),
            Some(Token::Time(ms)) => ExpressionKind::Time(ms),
            Some(Token::Word(word)) if word == "true" => ExpressionKind::Truth(true),
            Some(Token::Word(word)) if word == "false" => ExpressionKind::Truth(false),
            Some(Token::Word(_)) => {
                let path = self.path()?;
                let ([name], true) = (&path[..], self.is("(")) else {
                    return Ok(Expression::leaf(line, ExpressionKind::Path(path)));
                };
                let arguments = self.arguments()?;
                let heights: Vec<_> = arguments.iter().map(Argument::height).collect();
                let call = ExpressionKind::Call(name.clone(), arguments);
                return Expression::above(line, call, heights);
            }
            _ => return Err(self.wanted("a value")),
        };
        self.at += 1;
        Ok(Expression::leaf(line, kind))
    }
}

fn binary(
    line: usize,
    operator: &'static str,
    left: Expression,
    right: Expression,
) -> Result<Expression, Error> {
    let operator = if operator == "&" { "and" } else { operator };
    let heights = [left.height, right.height];
    let kind = ExpressionKind::Binary(operator, Box::new([left, right]));
    Expression::above(line, kind, heights)
}
