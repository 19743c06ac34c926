//! From a syntax tree to a program whose names and types are resolved.
//!
//! Not here: running it. Every variable has a place in one memory: a unit's variables stand one after the other in its
//! frame, an instance's frame within that of its owner, and a function has one frame of its own, since nothing calls
//! itself: what is called has been declared before.

use std::collections::HashMap;

use super::parse::{
    Argument, Block, Declaration, Expression, ExpressionKind, Pou, Role, Statement, StatementKind,
    parse,
};
use super::run::fold;
use super::standard::Standard;
use super::{Error, Type, Value};

/// A program's memory may have so many variables, all instances counted.
const MEMORY: usize = 100_000;
/// Function blocks may hold instances so deep.
const LEVELS: usize = 16;

/// An expression, resolved.
#[derive(Clone, Debug)]
pub(super) enum Code {
    Constant(Value),
    Load(usize),
    Not(Box<Code>),
    /// All bits of a type.
    Invert(Type, Box<Code>),
    Negate(Type, Box<Code>),
    Integer(Operator, Type, usize, Box<[Code; 2]>),
    Real(Operator, Box<[Code; 2]>),
    Compare(&'static str, Box<[Code; 2]>),
    Logic(&'static str, Box<[Code; 2]>),
    Convert(Type, Type, Box<Code>),
    Function(Function, Type, Vec<Code>),
    /// A unit's number, its inputs with their places, and where it leaves its result.
    Call(usize, Vec<(usize, Code)>, usize),
}

/// An operator of arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Modulo,
}

/// A function of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Abs,
    Min,
    Max,
    Limit,
    Select,
    Root,
    Left,
    Right,
    Truncate,
}

/// Name, function, how many inputs.
const FUNCTIONS: [(&str, Function, usize); 9] = [
    ("abs", Function::Abs, 1),
    ("min", Function::Min, 2),
    ("max", Function::Max, 2),
    ("limit", Function::Limit, 3),
    ("sel", Function::Select, 3),
    ("sqrt", Function::Root, 1),
    ("shl", Function::Left, 2),
    ("shr", Function::Right, 2),
    ("trunc", Function::Truncate, 1),
];

/// A statement, resolved. Places count from the frame of the unit it stands in.
#[derive(Clone, Debug)]
pub(super) enum Step {
    Assign(usize, usize, Code),
    /// A function block: its place, what it is, its inputs, its outputs.
    Call(
        usize,
        usize,
        Callee,
        Vec<(usize, Code)>,
        Vec<(usize, usize)>,
    ),
    If(usize, Vec<(Code, Vec<Step>)>, Vec<Step>),
    Case(usize, Code, Vec<Arm>, Vec<Step>),
    For(Box<Loop>),
    /// The condition is looked at before the body, or behind it.
    While(usize, bool, Code, Vec<Step>),
    Exit,
    Return,
}

/// The ranges of an arm of a `CASE`, and what is done there.
pub(super) type Arm = (Vec<(i64, i64)>, Vec<Step>);

#[derive(Clone, Debug)]
pub(super) struct Loop {
    pub line: usize,
    pub slot: usize,
    pub of: Type,
    pub from: Code,
    pub to: Code,
    pub by: i64,
    pub body: Vec<Step>,
}

/// What is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Callee {
    Standard(Standard),
    /// By its number.
    Unit(usize),
}

/// A variable of a frame.
#[derive(Clone, Debug)]
struct Member {
    block: Block,
    slot: usize,
    of: Kind,
    constant: Option<Value>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Plain(Type),
    Instance(Callee),
}

/// A unit, resolved.
#[derive(Clone, Debug)]
pub(super) struct Unit {
    name: String,
    role: Role,
    members: HashMap<String, Member>,
    /// Inputs in their order.
    inputs: Vec<(String, usize, Type)>,
    levels: usize,
    pub initial: Vec<Value>,
    pub body: Vec<Step>,
    /// Where a function's frame stands in the memory.
    pub base: usize,
}

/// A variable of the program that the outside reads or writes.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Its name, in small letters.
    pub name: String,
    /// Where it belongs.
    pub block: Block,
    /// Its type.
    pub of: Type,
    pub(super) slot: usize,
}

/// A program that can be run.
#[derive(Clone, Debug)]
pub struct Program {
    pub(super) units: Vec<Unit>,
    pub(super) main: usize,
    pub(super) initial: Vec<Value>,
    variables: Vec<Variable>,
}

impl Program {
    /// Reads, checks and resolves a text.
    pub fn new(text: &str) -> Result<Self, Error> {
        let mut units: Vec<Unit> = Vec::new();
        let (mut main, mut base) = (None, 0);
        let parsed = parse(text)?;
        for pou in &parsed {
            let taken = units.iter().any(|unit| unit.name == pou.name);
            if taken || is_standard(&pou.name) {
                let what = format!("the name {} is taken", pou.name);
                return Err(Error::new(pou.line, what));
            }
            if pou.role == Role::Program && main.replace(units.len()).is_some() {
                return Err(Error::new(pou.line, "a second program: one is enough"));
            }
            let unit = Scope::unit(&units, pou, base)?;
            if matches!(pou.role, Role::Function(_)) {
                base += unit.initial.len();
            }
            units.push(unit);
        }
        let last = text.lines().count().max(1);
        let main = main.ok_or_else(|| Error::new(last, "there is no PROGRAM"))?;
        // functions first, the program behind them
        let mut initial = vec![Value::Bool(false); base];
        units[main].base = base;
        initial.extend(&units[main].initial);
        let variables = parsed
            .iter()
            .filter(|pou| pou.role == Role::Program)
            .flat_map(|pou| &pou.variables)
            .filter_map(|declared| {
                let member = &units[main].members[&declared.name];
                let (Kind::Plain(of), None) = (member.of, member.constant) else {
                    return None;
                };
                Some(Variable {
                    name: declared.name.clone(),
                    block: declared.block,
                    of,
                    slot: base + member.slot,
                })
            })
            .collect();
        Ok(Self {
            units,
            main,
            initial,
            variables,
        })
    }

    /// The program's variables, in the order of their declaration.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }
}

fn is_standard(name: &str) -> bool {
    Standard::of(name).is_some()
        || FUNCTIONS.iter().any(|(n, ..)| *n == name)
        || Type::of(name).is_some()
        || conversion(name).is_some()
}

/// The types of `A_TO_B`.
fn conversion(name: &str) -> Option<(Type, Type)> {
    let (from, to) = name.split_once("_to_")?;
    Some((Type::of(from)?, Type::of(to)?))
}

/// What a unit sees while it is resolved.
struct Scope<'a> {
    units: &'a [Unit],
    members: HashMap<String, Member>,
    name: &'a str,
    loops: usize,
}

impl<'a> Scope<'a> {
    fn unit(units: &'a [Unit], pou: &'a Pou, base: usize) -> Result<Unit, Error> {
        let mut scope = Self {
            units,
            members: HashMap::new(),
            name: &pou.name,
            loops: 0,
        };
        let (mut initial, mut inputs, mut levels) = (Vec::new(), Vec::new(), 1);
        if let Role::Function(returns) = &pou.role {
            let of = Type::of(returns)
                .ok_or_else(|| Error::new(pou.line, format!("{returns} is no type known here")))?;
            let member = Member {
                block: Block::Local,
                slot: 0,
                of: Kind::Plain(of),
                constant: None,
            };
            scope.members.insert(pou.name.clone(), member);
            initial.push(of.zero());
        }
        for declared in &pou.variables {
            let member = scope.declare(pou, declared, &mut initial, &mut levels)?;
            if let (Block::Input, Kind::Plain(of)) = (member.block, member.of) {
                inputs.push((declared.name.clone(), member.slot, of));
            }
            if scope
                .members
                .insert(declared.name.clone(), member)
                .is_some()
            {
                let what = format!("{} is declared twice", declared.name);
                return Err(Error::new(declared.line, what));
            }
            if initial.len() > MEMORY || base + initial.len() > MEMORY {
                let what = format!("more than {MEMORY} variables, instances counted");
                return Err(Error::new(declared.line, what));
            }
        }
        let body = scope.steps(&pou.body)?;
        Ok(Unit {
            name: pou.name.clone(),
            role: pou.role.clone(),
            members: scope.members,
            inputs,
            levels,
            initial,
            body,
            base,
        })
    }

    fn declare(
        &self,
        pou: &Pou,
        declared: &Declaration,
        initial: &mut Vec<Value>,
        levels: &mut usize,
    ) -> Result<Member, Error> {
        let wrong = |what: String| Err(Error::new(declared.line, what));
        let slot = initial.len();
        let member = |of, constant| Member {
            block: declared.block,
            slot,
            of,
            constant,
        };
        if let Some(of) = Type::of(&declared.of) {
            let value = match &declared.initial {
                Some(expression) => self.constant(expression, of)?,
                None => of.zero(),
            };
            if declared.block == Block::Constant {
                return Ok(member(Kind::Plain(of), Some(value)));
            }
            initial.push(value);
            return Ok(member(Kind::Plain(of), None));
        }
        let callee = match Standard::of(&declared.of) {
            Some(standard) => {
                initial.extend(standard.pins().iter().map(|(_, _, of)| of.zero()));
                Callee::Standard(standard)
            }
            None => {
                let found = self
                    .units
                    .iter()
                    .position(|unit| unit.name == declared.of && unit.role == Role::FunctionBlock);
                let Some(number) = found else {
                    let names = self.units.iter().map(|unit| unit.name.as_str());
                    let names = names.chain(Type::ALL.iter().map(|t| t.name()));
                    let near = nearest(&declared.of, names);
                    return wrong(format!("{} is no type declared before{near}", declared.of));
                };
                *levels = (*levels).max(1 + self.units[number].levels);
                initial.extend(&self.units[number].initial);
                Callee::Unit(number)
            }
        };
        if *levels > LEVELS {
            return wrong(format!(
                "function blocks within each other more than {LEVELS} deep"
            ));
        }
        if declared.block != Block::Local || matches!(pou.role, Role::Function(_)) {
            return wrong("an instance stands in VAR of a program or function block".into());
        }
        if declared.initial.is_some() {
            return wrong("an instance has no initial value".into());
        }
        Ok(member(Kind::Instance(callee), None))
    }

    fn member(&self, line: usize, name: &str) -> Result<&Member, Error> {
        self.members.get(name).ok_or_else(|| {
            let near = nearest(name, self.members.keys().map(String::as_str));
            Error::new(line, format!("{name} is not declared{near}"))
        })
    }

    /// Place and type of a variable, or of an instance's; and whether it may be written.
    fn place(&self, line: usize, path: &[String]) -> Result<(usize, Type, bool), Error> {
        let [name, rest @ ..] = path else {
            return Err(Error::new(line, "a name is missing"));
        };
        let member = self.member(line, name)?;
        match (member.of, rest) {
            (Kind::Plain(of), []) => {
                let writable = !matches!(member.block, Block::Input | Block::Constant);
                Ok((member.slot, of, writable))
            }
            (Kind::Plain(of), _) => {
                let what = format!("{name} is a {} and has no parts", of.name());
                Err(Error::new(line, what))
            }
            (Kind::Instance(_), []) => Err(Error::new(
                line,
                format!("{name} is a function block, not a value"),
            )),
            (Kind::Instance(callee), [pin]) => {
                let (slot, of, block) = self.pin(line, callee, pin)?;
                if block == Block::Local {
                    let what = format!("{name}.{pin} is neither input nor output");
                    return Err(Error::new(line, what));
                }
                Ok((member.slot + slot, of, block == Block::Input))
            }
            _ => Err(Error::new(
                line,
                "only an instance's own inputs and outputs can be seen",
            )),
        }
    }

    /// An input or output of a function block.
    fn pin(&self, line: usize, callee: Callee, pin: &str) -> Result<(usize, Type, Block), Error> {
        let unknown = |names: &mut dyn Iterator<Item = &str>| {
            let near = nearest(pin, names);
            Error::new(line, format!("the function block has no {pin}{near}"))
        };
        match callee {
            Callee::Standard(standard) => {
                let pins = standard.pins();
                let found = pins.iter().position(|(_, name, _)| *name == pin);
                let slot =
                    found.ok_or_else(|| unknown(&mut pins.iter().map(|(_, name, _)| *name)))?;
                let (input, _, of) = pins[slot];
                Ok((slot, of, if input { Block::Input } else { Block::Output }))
            }
            Callee::Unit(number) => {
                let members = &self.units[number].members;
                match members.get(pin) {
                    Some(Member {
                        block,
                        slot,
                        of: Kind::Plain(of),
                        constant: None,
                    }) => Ok((*slot, *of, *block)),
                    _ => Err(unknown(&mut members.keys().map(String::as_str))),
                }
            }
        }
    }

    fn steps(&mut self, statements: &[Statement]) -> Result<Vec<Step>, Error> {
        statements.iter().map(|s| self.step(s)).collect()
    }

    fn step(&mut self, statement: &Statement) -> Result<Step, Error> {
        let line = statement.line;
        Ok(match &statement.kind {
            StatementKind::Assign(path, value) => {
                let (slot, of, writable) = self.place(line, path)?;
                if !writable {
                    let what = format!(
                        "{} is an input or a constant: it is not written here",
                        path.join(".")
                    );
                    return Err(Error::new(line, what));
                }
                Step::Assign(line, slot, self.value(value, of)?)
            }
            StatementKind::Call(name, arguments) => self.call_block(line, name, arguments)?,
            StatementKind::If(arms, otherwise) => {
                let mut resolved = Vec::new();
                for (condition, body) in arms {
                    resolved.push((self.value(condition, Type::Bool)?, self.steps(body)?));
                }
                Step::If(line, resolved, self.steps(otherwise)?)
            }
            StatementKind::Case(selector, arms, otherwise) => {
                let of = self.natural(selector).unwrap_or(Type::Int);
                if !of.is_integer() && !of.is_bits() {
                    let what = format!("CASE takes an integer, not {}", of.name());
                    return Err(Error::new(line, what));
                }
                let selector = self.value(selector, of)?;
                let mut resolved = Vec::new();
                for (labels, body) in arms {
                    let mut ranges = Vec::new();
                    for (from, to) in labels {
                        let from_value = self.constant(from, of)?.integer();
                        let to = match to {
                            Some(to) => self.constant(to, of)?.integer(),
                            None => from_value,
                        };
                        ranges.push((from_value, to));
                    }
                    resolved.push((ranges, self.steps(body)?));
                }
                Step::Case(line, selector, resolved, self.steps(otherwise)?)
            }
            StatementKind::For(name, [from, to], by, body) => {
                let (slot, of, writable) = self.place(line, std::slice::from_ref(name))?;
                if !of.is_integer() || !writable {
                    let what = format!("{name} cannot count a loop: an integer in VAR does");
                    return Err(Error::new(line, what));
                }
                let by = match by {
                    Some(by) => self.constant(by, of)?.integer(),
                    None => 1,
                };
                if by == 0 {
                    return Err(Error::new(line, "a loop BY 0 never ends"));
                }
                let (from, to) = (self.value(from, of)?, self.value(to, of)?);
                let body = self.in_loop(body)?;
                Step::For(Box::new(Loop {
                    line,
                    slot,
                    of,
                    from,
                    to,
                    by,
                    body,
                }))
            }
            StatementKind::While(condition, body) => {
                let condition = self.value(condition, Type::Bool)?;
                Step::While(line, true, condition, self.in_loop(body)?)
            }
            StatementKind::Repeat(body, condition) => {
                let until = self.value(condition, Type::Bool)?;
                Step::While(line, false, Code::Not(Box::new(until)), self.in_loop(body)?)
            }
            StatementKind::Exit if self.loops == 0 => {
                return Err(Error::new(line, "EXIT stands in no loop"));
            }
            StatementKind::Exit => Step::Exit,
            StatementKind::Return => Step::Return,
        })
    }

    fn in_loop(&mut self, body: &[Statement]) -> Result<Vec<Step>, Error> {
        self.loops += 1;
        let steps = self.steps(body);
        self.loops -= 1;
        steps
    }

    fn call_block(&self, line: usize, name: &str, arguments: &[Argument]) -> Result<Step, Error> {
        let member = self.member(line, name)?;
        let Kind::Instance(callee) = member.of else {
            return Err(Error::new(line, format!("{name} is no function block")));
        };
        let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
        for argument in arguments {
            match argument {
                Argument::Plain(_) => {
                    let what = "a function block's inputs are given by name: IN := …";
                    return Err(Error::new(line, what));
                }
                Argument::In(pin, value) => match self.pin(line, callee, pin)? {
                    (slot, of, Block::Input) => {
                        inputs.push((member.slot + slot, self.value(value, of)?));
                    }
                    _ => return Err(Error::new(line, format!("{pin} is no input of {name}"))),
                },
                Argument::Out(pin, target) => match self.pin(line, callee, pin)? {
                    (slot, of, Block::Output) => {
                        let (to, target_of, writable) = self.place(line, target)?;
                        if target_of != of || !writable {
                            let what = format!(
                                "{pin} of {name} is a {} and cannot go to {}",
                                of.name(),
                                target.join(".")
                            );
                            return Err(Error::new(line, what));
                        }
                        outputs.push((member.slot + slot, to));
                    }
                    _ => return Err(Error::new(line, format!("{pin} is no output of {name}"))),
                },
            }
        }
        Ok(Step::Call(line, member.slot, callee, inputs, outputs))
    }

    /// The type of an expression by itself; none for numbers that take the type of what is around them.
    fn natural(&self, e: &Expression) -> Option<Type> {
        match &e.kind {
            ExpressionKind::Truth(_) => Some(Type::Bool),
            ExpressionKind::Integer(of, _) => *of,
            ExpressionKind::Real(_) => Some(Type::Real),
            ExpressionKind::Time(_) => Some(Type::Time),
            ExpressionKind::Path(path) => self.place(e.line, path).ok().map(|(_, of, _)| of),
            ExpressionKind::Unary(_, operand) => self.natural(operand),
            ExpressionKind::Binary("=" | "<>" | "<" | ">" | "<=" | ">=", _) => Some(Type::Bool),
            ExpressionKind::Binary(_, operands) => self
                .natural(&operands[0])
                .or_else(|| self.natural(&operands[1])),
            ExpressionKind::Call(name, arguments) => {
                if let Some((_, to)) = conversion(name) {
                    return Some(to);
                }
                match name.as_str() {
                    "trunc" => return Some(Type::Dint),
                    "sqrt" => return Some(Type::Real),
                    _ => {}
                }
                if let Some(unit) = self.function(name) {
                    return match unit.members[&unit.name].of {
                        Kind::Plain(of) => Some(of),
                        Kind::Instance(_) => None,
                    };
                }
                let skip = usize::from(name == "sel");
                arguments
                    .iter()
                    .skip(skip)
                    .find_map(|argument| match argument {
                        Argument::Plain(value) | Argument::In(_, value) => self.natural(value),
                        Argument::Out(..) => None,
                    })
            }
        }
    }

    fn function(&self, name: &str) -> Option<&Unit> {
        let is = |unit: &&Unit| unit.name == name && matches!(unit.role, Role::Function(_));
        self.units.iter().find(is)
    }

    /// An expression whose value is known before the program runs.
    fn constant(&self, e: &Expression, of: Type) -> Result<Value, Error> {
        let code = self.value(e, of)?;
        fold(&code).ok_or_else(|| Error::new(e.line, "a constant is expected"))
    }

    /// An expression of this type.
    fn value(&self, e: &Expression, of: Type) -> Result<Code, Error> {
        let natural = self.natural(e);
        let (code, is) = self.expression(e, natural.unwrap_or(of))?;
        if is == of {
            return Ok(code);
        }
        let (is, of) = (is.name(), of.name());
        Err(Error::new(
            e.line,
            format!("a {of} is expected, not a {is}: convert it ({is}_TO_{of})"),
        ))
    }

    fn expression(&self, e: &Expression, of: Type) -> Result<(Code, Type), Error> {
        let line = e.line;
        Ok(match &e.kind {
            ExpressionKind::Truth(truth) => (Code::Constant(Value::Bool(*truth)), Type::Bool),
            ExpressionKind::Real(value) => (Code::Constant(Value::Real(*value as f32)), Type::Real),
            ExpressionKind::Time(ms) => (Code::Constant(Value::Int(*ms)), Type::Time),
            ExpressionKind::Integer(told, value) => {
                let of = told.unwrap_or(of);
                let range = of.range().filter(|_| of != Type::Time).ok_or_else(|| {
                    let hint = if of == Type::Real {
                        ": write it with a point"
                    } else {
                        ""
                    };
                    Error::new(
                        line,
                        format!("a {} is expected, not {value}{hint}", of.name()),
                    )
                })?;
                if *value < range.0 || *value > range.1 {
                    let (low, high) = range;
                    let what = format!("{value} is outside {}: {low} to {high}", of.name());
                    return Err(Error::new(line, what));
                }
                (Code::Constant(Value::Int(*value)), of)
            }
            ExpressionKind::Path(path) => {
                let (slot, of, _) = self.place(line, path)?;
                let constant = match &path[..] {
                    [name] => self.member(line, name)?.constant,
                    _ => None,
                };
                (constant.map_or(Code::Load(slot), Code::Constant), of)
            }
            ExpressionKind::Unary(operator, operand) => {
                let operand = Box::new(self.value(operand, of)?);
                let code = match *operator {
                    "not" if of == Type::Bool => Code::Not(operand),
                    "not" if of.is_bits() => Code::Invert(of, operand),
                    "-" if of == Type::Real || of == Type::Time || of.is_integer() => {
                        Code::Negate(of, operand)
                    }
                    _ => {
                        let operator = operator.to_ascii_uppercase();
                        let what = format!("{operator} does not take a {}", of.name());
                        return Err(Error::new(line, what));
                    }
                };
                (code, of)
            }
            ExpressionKind::Binary(operator, operands) => {
                self.binary(line, operator, operands, of)?
            }
            ExpressionKind::Call(name, arguments) => self.call(line, name, arguments, of)?,
        })
    }

    fn binary(
        &self,
        line: usize,
        operator: &'static str,
        operands: &[Expression; 2],
        wanted: Type,
    ) -> Result<(Code, Type), Error> {
        let comparison = matches!(operator, "=" | "<>" | "<" | ">" | "<=" | ">=");
        let natural = self
            .natural(&operands[0])
            .or_else(|| self.natural(&operands[1]));
        let of = natural.unwrap_or(if comparison { Type::Dint } else { wanted });
        let both = Box::new([self.value(&operands[0], of)?, self.value(&operands[1], of)?]);
        if comparison {
            return Ok((Code::Compare(operator, both), Type::Bool));
        }
        let arithmetic = match operator {
            "+" => Some(Operator::Add),
            "-" => Some(Operator::Subtract),
            "*" => Some(Operator::Multiply),
            "/" => Some(Operator::Divide),
            "mod" => Some(Operator::Modulo),
            _ => None,
        };
        let sum = matches!(operator, "+" | "-");
        let code = match arithmetic {
            Some(a) if of.is_integer() || (of == Type::Time && sum) => {
                Code::Integer(a, of, line, both)
            }
            Some(a) if of == Type::Real && a != Operator::Modulo => Code::Real(a, both),
            None if of == Type::Bool || of.is_bits() => Code::Logic(operator, both),
            _ => {
                let operator = operator.to_ascii_uppercase();
                let what = format!("`{operator}` does not take a {}", of.name());
                return Err(Error::new(line, what));
            }
        };
        Ok((code, of))
    }

    fn call(
        &self,
        line: usize,
        name: &str,
        arguments: &[Argument],
        wanted: Type,
    ) -> Result<(Code, Type), Error> {
        let shown = name.to_ascii_uppercase();
        if let Some(unit) = self.function(name) {
            return self.call_unit(line, unit, arguments);
        }
        let plain: Option<Vec<&Expression>> = arguments
            .iter()
            .map(|argument| match argument {
                Argument::Plain(value) => Some(value),
                _ => None,
            })
            .collect();
        let plain = plain
            .ok_or_else(|| Error::new(line, format!("{shown} takes its inputs by their place")))?;
        let count = |wanted: usize| {
            if plain.len() == wanted {
                return Ok(());
            }
            let what = format!("{shown} takes {wanted} inputs, not {}", plain.len());
            Err(Error::new(line, what))
        };
        if let Some((from, to)) = conversion(name) {
            count(1)?;
            let value = Box::new(self.value(plain[0], from)?);
            return Ok((Code::Convert(from, to, value), to));
        }
        let Some((_, function, inputs)) = FUNCTIONS.iter().find(|(n, ..)| *n == name) else {
            let names = FUNCTIONS.iter().map(|(n, ..)| *n);
            let names = names.chain(self.units.iter().map(|unit| unit.name.as_str()));
            let near = nearest(name, names);
            return Err(Error::new(
                line,
                format!("{shown} is no function declared before{near}"),
            ));
        };
        count(*inputs)?;
        let skip = usize::from(*function == Function::Select);
        let of = plain
            .iter()
            .skip(skip)
            .find_map(|value| self.natural(value))
            .unwrap_or(wanted);
        let number = of == Type::Real || of.is_integer() || of == Type::Time;
        let fits = match function {
            Function::Root | Function::Truncate => of == Type::Real,
            Function::Left | Function::Right => of.is_bits(),
            Function::Abs => number && of != Type::Time,
            Function::Min | Function::Max | Function::Limit => number,
            Function::Select => true,
        };
        if !fits {
            return Err(Error::new(
                line,
                format!("{shown} does not take a {}", of.name()),
            ));
        }
        let mut codes = Vec::new();
        for (i, value) in plain.iter().enumerate() {
            let of = match (function, i) {
                (Function::Select, 0) => Type::Bool,
                (Function::Left | Function::Right, 1) => Type::Int,
                _ => of,
            };
            codes.push(self.value(value, of)?);
        }
        let returns = if *function == Function::Truncate {
            Type::Dint
        } else {
            of
        };
        Ok((Code::Function(*function, of, codes), returns))
    }

    fn call_unit(
        &self,
        line: usize,
        unit: &Unit,
        arguments: &[Argument],
    ) -> Result<(Code, Type), Error> {
        let number = self
            .units
            .iter()
            .position(|u| u.name == unit.name)
            .unwrap_or(0);
        let mut inputs = Vec::new();
        for (i, argument) in arguments.iter().enumerate() {
            let (found, value) = match argument {
                Argument::Plain(value) => (unit.inputs.get(i), value),
                Argument::In(name, value) => (unit.inputs.iter().find(|(n, ..)| n == name), value),
                Argument::Out(..) => {
                    return Err(Error::new(
                        line,
                        "a function has no outputs here but its result",
                    ));
                }
            };
            let (_, slot, of) = found.ok_or_else(|| {
                let what = format!("{} has no such input", unit.name.to_ascii_uppercase());
                Error::new(line, what)
            })?;
            inputs.push((*slot, self.value(value, *of)?));
        }
        match unit.members[&unit.name].of {
            Kind::Plain(of) => Ok((Code::Call(number, inputs, 0), of)),
            Kind::Instance(_) => Err(Error::new(line, format!("{} is no function", self.name))),
        }
    }
}

/// The name that was perhaps meant.
fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> String {
    let near = names
        .filter(|n| !n.is_empty())
        .map(|n| {
            (
                strsim::damerau_levenshtein(name, &n.to_ascii_lowercase()),
                n,
            )
        })
        .filter(|(distance, n)| *distance <= n.len() / 2)
        .min();
    near.map_or(String::new(), |(_, n)| format!("; the nearest is {n}"))
}
