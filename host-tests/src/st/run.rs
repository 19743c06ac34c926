//! A program at work: once a cycle from its first statement to its last.
//!
//! Not here: where inputs come from and outputs go. A division by zero or a loop without end stops the program, as it
//! does a PLC.

use std::sync::Arc;

use super::compile::{Callee, Code, Function, Operator, Program, Step, Unit, Variable};
use super::{Error, Type, Value};

/// Statements that a cycle may take; a program that needs more hangs.
const WATCHDOG: u32 = 200_000;

/// A program with its memory; a clone goes on by itself.
#[derive(Clone, Debug)]
pub struct Runner {
    program: Arc<Program>,
    memory: Vec<Value>,
    now_ms: i64,
}

impl Runner {
    /// Before its first cycle.
    pub fn new(program: Arc<Program>) -> Self {
        Self {
            memory: program.initial.clone(),
            program,
            now_ms: 0,
        }
    }

    /// The program.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// The value of one of the program's variables.
    pub fn get(&self, variable: &Variable) -> Value {
        self.memory[variable.slot]
    }

    /// The value of the program's variable of this name, in small letters.
    pub fn value(&self, name: &str) -> Option<Value> {
        let found = self.program.variables().iter().find(|v| v.name == name)?;
        Some(self.get(found))
    }

    /// Gives one of the program's variables a value, cut to its width; a value of another kind changes nothing.
    pub fn set(&mut self, variable: &Variable, value: Value) {
        self.memory[variable.slot] = match (variable.of, value) {
            (Type::Bool, Value::Bool(_)) | (Type::Real, Value::Real(_)) => value,
            (of, Value::Int(value)) if of.width().is_some() => Value::Int(of.wrap(value)),
            _ => return,
        };
    }

    /// One cycle, `ms` after the one before.
    pub fn cycle(&mut self, ms: u32) -> Result<(), Error> {
        self.now_ms += i64::from(ms);
        let program = Arc::clone(&self.program);
        let mut at_work = AtWork {
            units: &program.units,
            memory: &mut self.memory,
            now_ms: self.now_ms,
            left: WATCHDOG,
        };
        let main = &program.units[program.main];
        at_work.steps(&main.body, main.base).map(|_| ())
    }
}

/// The value of an expression without variables.
pub(super) fn fold(code: &Code) -> Option<Value> {
    fn is_constant(code: &Code) -> bool {
        match code {
            Code::Constant(_) => true,
            Code::Load(_) | Code::Call(..) => false,
            Code::Not(x) | Code::Invert(_, x) | Code::Negate(_, x) | Code::Convert(_, _, x) => {
                is_constant(x)
            }
            Code::Integer(_, _, _, x)
            | Code::Real(_, x)
            | Code::Compare(_, x)
            | Code::Logic(_, x) => x.iter().all(is_constant),
            Code::Function(_, _, inputs) => inputs.iter().all(is_constant),
        }
    }
    if !is_constant(code) {
        return None;
    }
    let mut at_work = AtWork {
        units: &[],
        memory: &mut Vec::new(),
        now_ms: 0,
        left: 0,
    };
    at_work.eval(code, 0).ok()
}

/// How a list of statements has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flow {
    On,
    Exit,
    Return,
}

struct AtWork<'a> {
    units: &'a [Unit],
    memory: &'a mut Vec<Value>,
    now_ms: i64,
    left: u32,
}

impl<'a> AtWork<'a> {
    fn spend(&mut self, line: usize) -> Result<(), Error> {
        self.left = self.left.checked_sub(1).ok_or_else(|| {
            Error::new(
                line,
                format!("a cycle took more than {WATCHDOG} statements"),
            )
        })?;
        Ok(())
    }

    fn steps(&mut self, steps: &'a [Step], base: usize) -> Result<Flow, Error> {
        for step in steps {
            match self.step(step, base)? {
                Flow::On => {}
                ended => return Ok(ended),
            }
        }
        Ok(Flow::On)
    }

    fn step(&mut self, step: &'a Step, base: usize) -> Result<Flow, Error> {
        match step {
            Step::Assign(line, slot, code) => {
                self.spend(*line)?;
                self.memory[base + slot] = self.eval(code, base)?;
            }
            Step::Call(line, instance, callee, inputs, outputs) => {
                self.spend(*line)?;
                for (slot, code) in inputs {
                    self.memory[base + slot] = self.eval(code, base)?;
                }
                let at = base + instance;
                match callee {
                    Callee::Standard(standard) => {
                        let end = at + standard.pins().len();
                        standard.call(&mut self.memory[at..end], self.now_ms);
                    }
                    Callee::Unit(number) => {
                        let units = self.units;
                        self.steps(&units[*number].body, at)?;
                    }
                }
                for (from, to) in outputs {
                    self.memory[base + to] = self.memory[base + from];
                }
            }
            Step::If(line, arms, otherwise) => {
                self.spend(*line)?;
                for (condition, body) in arms {
                    if self.eval(condition, base)?.truth() {
                        return self.steps(body, base);
                    }
                }
                return self.steps(otherwise, base);
            }
            Step::Case(line, selector, arms, otherwise) => {
                self.spend(*line)?;
                let value = self.eval(selector, base)?.integer();
                let holds = |ranges: &[(i64, i64)]| {
                    ranges
                        .iter()
                        .any(|(from, to)| (*from..=*to).contains(&value))
                };
                let arm = arms.iter().find(|(ranges, _)| holds(ranges));
                let body = arm.map_or(otherwise, |(_, body)| body);
                return self.steps(body, base);
            }
            Step::For(l) => {
                let from = self.eval(&l.from, base)?.integer();
                let to = self.eval(&l.to, base)?.integer();
                let mut i = from;
                self.memory[base + l.slot] = Value::Int(i);
                while if l.by > 0 { i <= to } else { i >= to } {
                    self.spend(l.line)?;
                    match self.steps(&l.body, base)? {
                        Flow::Exit => break,
                        Flow::Return => return Ok(Flow::Return),
                        Flow::On => {}
                    }
                    // the body may have changed it, and it may wrap
                    i = l.of.wrap(self.memory[base + l.slot].integer() + l.by);
                    self.memory[base + l.slot] = Value::Int(i);
                }
            }
            Step::While(line, before, condition, body) => {
                let mut first = !before;
                while first || self.eval(condition, base)?.truth() {
                    first = false;
                    self.spend(*line)?;
                    match self.steps(body, base)? {
                        Flow::Exit => break,
                        Flow::Return => return Ok(Flow::Return),
                        Flow::On => {}
                    }
                }
            }
            Step::Exit => return Ok(Flow::Exit),
            Step::Return => return Ok(Flow::Return),
        }
        Ok(Flow::On)
    }

    fn eval(&mut self, code: &'a Code, base: usize) -> Result<Value, Error> {
        Ok(match code {
            Code::Constant(value) => *value,
            Code::Load(slot) => self.memory[base + slot],
            Code::Not(x) => Value::Bool(!self.eval(x, base)?.truth()),
            Code::Invert(of, x) => Value::Int(of.wrap(!self.eval(x, base)?.integer())),
            Code::Negate(of, x) => negate(*of, self.eval(x, base)?),
            Code::Integer(operator, of, line, x) => {
                let (a, b) = (self.eval(&x[0], base)?, self.eval(&x[1], base)?);
                integer(*operator, *of, *line, a.integer(), b.integer())?
            }
            Code::Real(operator, x) => {
                let (a, b) = (self.eval(&x[0], base)?, self.eval(&x[1], base)?);
                real(*operator, a.real(), b.real())
            }
            Code::Compare(operator, x) => {
                compare(operator, self.eval(&x[0], base)?, self.eval(&x[1], base)?)
            }
            Code::Logic(operator, x) => {
                logic(operator, self.eval(&x[0], base)?, self.eval(&x[1], base)?)
            }
            Code::Convert(from, to, x) => convert(*from, *to, self.eval(x, base)?),
            Code::Function(f, of, inputs) => {
                let mut values = [Value::Bool(false); 3];
                for (value, input) in values.iter_mut().zip(inputs) {
                    *value = self.eval(input, base)?;
                }
                function(*f, *of, &values)
            }
            Code::Call(number, inputs, result) => {
                let unit = &self.units[*number];
                // an input may call the same function
                let mut values = Vec::with_capacity(inputs.len());
                for (slot, input) in inputs {
                    values.push((*slot, self.eval(input, base)?));
                }
                let frame = unit.base..unit.base + unit.initial.len();
                self.memory[frame].copy_from_slice(&unit.initial);
                for (slot, value) in values {
                    self.memory[unit.base + slot] = value;
                }
                self.steps(&unit.body, unit.base)?;
                self.memory[unit.base + result]
            }
        })
    }
}

fn negate(of: Type, value: Value) -> Value {
    match value {
        Value::Real(x) => Value::Real(-x),
        other => Value::Int(of.wrap(-other.integer())),
    }
}

fn integer(operator: Operator, of: Type, line: usize, a: i64, b: i64) -> Result<Value, Error> {
    let by_zero = || Error::new(line, "division by zero");
    Ok(Value::Int(of.wrap(match operator {
        Operator::Add => a + b,
        Operator::Subtract => a - b,
        // of two of 32 bits only the lower half counts
        Operator::Multiply => a.wrapping_mul(b),
        Operator::Divide => a.checked_div(b).ok_or_else(by_zero)?,
        Operator::Modulo => a.checked_rem(b).ok_or_else(by_zero)?,
    })))
}

/// A `REAL` divided by zero is infinite, as IEEE 754 has it.
fn real(operator: Operator, a: f32, b: f32) -> Value {
    Value::Real(match operator {
        Operator::Add => a + b,
        Operator::Subtract => a - b,
        Operator::Multiply => a * b,
        Operator::Divide | Operator::Modulo => a / b,
    })
}

fn compare(operator: &str, a: Value, b: Value) -> Value {
    let order = match (a, b) {
        (Value::Real(a), Value::Real(b)) => a.partial_cmp(&b),
        (Value::Bool(a), Value::Bool(b)) => a.partial_cmp(&b),
        _ => a.integer().partial_cmp(&b.integer()),
    };
    use std::cmp::Ordering::{Equal, Greater, Less};
    Value::Bool(match operator {
        "=" => order == Some(Equal),
        "<>" => order != Some(Equal),
        "<" => order == Some(Less),
        ">" => order == Some(Greater),
        "<=" => matches!(order, Some(Less | Equal)),
        _ => matches!(order, Some(Greater | Equal)),
    })
}

fn logic(operator: &str, a: Value, b: Value) -> Value {
    match (a, b) {
        (Value::Bool(a), Value::Bool(b)) => Value::Bool(match operator {
            "and" => a && b,
            "or" => a || b,
            _ => a != b,
        }),
        _ => Value::Int(match operator {
            "and" => a.integer() & b.integer(),
            "or" => a.integer() | b.integer(),
            _ => a.integer() ^ b.integer(),
        }),
    }
}

/// From one type to another: to an integer a `REAL` is rounded, half to even, and cut to the width.
fn convert(from: Type, to: Type, value: Value) -> Value {
    let whole = match (from, value) {
        (Type::Bool, value) => i64::from(value.truth()),
        // the cast saturates, and takes NaN to 0
        (Type::Real, value) => value.real().round_ties_even() as i64,
        (_, value) => value.integer(),
    };
    match to {
        Type::Bool => Value::Bool(whole != 0),
        Type::Real if from == Type::Real => value,
        Type::Real => Value::Real(whole as f32),
        to => Value::Int(to.wrap(whole)),
    }
}

fn function(f: Function, of: Type, x: &[Value]) -> Value {
    let less = |a: Value, b: Value| compare("<", a, b).truth();
    let smaller = |a, b| if less(b, a) { b } else { a };
    let larger = |a, b| if less(a, b) { b } else { a };
    match (f, x) {
        (Function::Abs, [Value::Real(a), ..]) => Value::Real(a.abs()),
        (Function::Abs, [a, ..]) => Value::Int(of.wrap(a.integer().abs())),
        (Function::Min, [a, b, ..]) => smaller(*a, *b),
        (Function::Max, [a, b, ..]) => larger(*a, *b),
        (Function::Limit, [low, value, high]) => smaller(larger(*value, *low), *high),
        (Function::Select, [which, a, b]) => {
            if which.truth() {
                *b
            } else {
                *a
            }
        }
        (Function::Root, [a, ..]) => Value::Real(a.real().sqrt()),
        (Function::Truncate, [a, ..]) => Value::Int(Type::Dint.wrap(a.real() as i64)),
        (Function::Left | Function::Right, [a, n, ..]) => {
            let (bits, _) = of.width().unwrap_or((0, false));
            let n = u32::try_from(n.integer()).unwrap_or(bits).min(bits);
            let shifted = if f == Function::Left {
                a.integer() << n
            } else {
                a.integer() >> n
            };
            Value::Int(of.wrap(shifted))
        }
        _ => of.zero(),
    }
}
