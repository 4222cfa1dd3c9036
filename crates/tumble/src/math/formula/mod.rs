//! Formulas of time, place and velocity: read once, evaluated for many masses.
//!
//! The words are parsed by winnow; functions are those of `table.rs`, so that bits stay portable. A formula becomes
//! instructions for a stack, without loops or jumps. What does not change is computed once, what changes only in time once
//! for all masses, and the rest column by column, an operation on 128 masses at a time.

mod parse;
mod table;

use super::{Row, Vec3};
use parse::{Tree, parse};
use std::ops::Range;
use table::{CONSTANTS, FUNCTIONS, Function};
use tumble_interface::check::suggestion;

/// The variables: time [s], position [m], velocity [m/s].
const VARIABLES: [&str; 7] = ["t", "x", "y", "z", "vx", "vy", "vz"];

/// Which variables a formula may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Of {
    /// t.
    Time,
    /// x, y, z: what a scene begins with, or what does not change.
    Start,
    /// t, x, y, z.
    Place,
    /// t, x, y, z, vx, vy, vz.
    Motion,
}

impl Of {
    /// Which of all variables.
    fn range(self) -> Range<usize> {
        match self {
            Self::Time => 0..1,
            Self::Start => 1..4,
            Self::Place => 0..4,
            Self::Motion => 0..7,
        }
    }
}

/// Masses that an operation takes at a time.
const BLOCK: usize = 128;
/// Numbers that wait on the stack at most.
const STACK: usize = 64;

#[derive(Clone, Copy)]
enum Instruction {
    Constant(f64),
    Variable(usize),
    /// A value that has been computed for all masses.
    Slot(usize),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Square,
    One(fn(f64) -> f64),
    Two(fn(f64, f64) -> f64),
    Three(fn(f64, f64, f64) -> f64),
}

/// Dependency of a value.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum DependsOn {
    Constant,
    Time,
    Mass,
}

/// A formula of one to three components.
#[derive(Clone)]
pub struct Formula {
    /// The values that depend on time only.
    prelude: Vec<Vec<Instruction>>,
    components: Vec<Vec<Instruction>>,
    varies: bool,
}

impl std::fmt::Debug for Formula {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Formula of {} components", self.components.len())
    }
}

impl Formula {
    /// Reads a formula of so many components, or says what is wrong with it.
    pub fn new(text: &str, components: usize, of: Of) -> Result<Self, String> {
        let faulty = |message: String| format!("\"{}\": {message}", shortened(text));
        let trees = parse(text).map_err(faulty)?;
        if trees.len() != components {
            let expected = if components == 1 { "one".into() } else { format!("{components}, as in \"[-y, x, 0]\"") };
            return Err(faulty(format!("{} components, expected {expected}", trees.len())));
        }
        let mut formula = Self { prelude: Vec::new(), components: Vec::new(), varies: false };
        for tree in &trees {
            let mut code = Vec::new();
            let kind = formula.emit(tree, of, &mut code).map_err(faulty)?;
            formula.varies |= kind == DependsOn::Mass;
            if kind == DependsOn::Time {
                code = vec![formula.slot(code)];
            }
            formula.components.push(code);
        }
        let longest = formula.prelude.iter().chain(&formula.components).map(|code| depth(code)).max();
        if longest.is_some_and(|n| n > STACK) {
            return Err(faulty(format!("more than {STACK} values wait for each other; use fewer brackets")));
        }
        Ok(formula)
    }

    /// Three formulas of one component each, as one.
    pub fn joined(parts: [Self; 3]) -> Self {
        let mut all = Self { prelude: Vec::new(), components: Vec::new(), varies: false };
        for part in parts {
            let shift = all.prelude.len();
            all.prelude.extend(part.prelude);
            all.varies |= part.varies;
            let moved = |i| if let Instruction::Slot(k) = i { Instruction::Slot(k + shift) } else { i };
            all.components.extend(part.components.into_iter().map(|code| code.into_iter().map(moved).collect()));
        }
        all
    }

    /// A constant.
    pub fn constant(value: f64) -> Self {
        Self { prelude: Vec::new(), components: vec![vec![Instruction::Constant(value)]], varies: false }
    }

    /// Whether it differs from mass to mass.
    pub fn varies(&self) -> bool {
        self.varies
    }

    fn slot(&mut self, code: Vec<Instruction>) -> Instruction {
        self.prelude.push(code);
        Instruction::Slot(self.prelude.len() - 1)
    }

    /// Appends the instructions of a tree.
    fn emit(&mut self, tree: &Tree, of: Of, code: &mut Vec<Instruction>) -> Result<DependsOn, String> {
        match tree {
            Tree::Number(value) => constant(*value, code),
            Tree::Name(name) => {
                if let Some((_, value)) = CONSTANTS.iter().find(|(n, _)| n == name) {
                    return constant(*value, code);
                }
                if FUNCTIONS.iter().any(|(function, _)| function == name) {
                    return Err(format!("\"{name}\" is a function; write {name}(...)"));
                }
                if of == Of::Start && name == "t" {
                    return Err("t has no meaning in a value that does not change; give a number, or a formula of x, y, z".into());
                }
                let Some(index) = of.range().find(|i| VARIABLES[*i] == name) else {
                    return Err(unknown(name, of));
                };
                code.push(Instruction::Variable(index));
                Ok(if index == 0 { DependsOn::Time } else { DependsOn::Mass })
            }
            Tree::Call(name, arguments) => self.call(name, arguments, of, code),
        }
    }

    fn call(&mut self, name: &str, arguments: &[Tree], of: Of, code: &mut Vec<Instruction>) -> Result<DependsOn, String> {
        let (start, mut parts, mut kind) = (code.len(), Vec::new(), DependsOn::Constant);
        for argument in arguments {
            let mut part = Vec::new();
            let own = self.emit(argument, of, &mut part)?;
            kind = kind.max(own);
            parts.push((own, part));
        }
        let instructions = operation(name, &parts, of)?;
        let pairs = instructions.len() > 1;
        for (k, (own, part)) in parts.into_iter().enumerate() {
            // A part that waits for time only, in what differs from mass to mass, is computed once for all.
            match (own, kind) {
                (DependsOn::Time, DependsOn::Mass) => code.push(self.slot(part)),
                _ => code.extend(part),
            }
            if pairs && k > 0 {
                code.push(instructions[k - 1]);
            }
        }
        match instructions[..] {
            [Instruction::Square] => {
                // The exponent is on the stack as well.
                code.pop();
                code.push(Instruction::Square);
            }
            [one] => code.push(one),
            _ => {}
        }
        if kind == DependsOn::Constant && depth(code) <= STACK {
            let value = scalar(&code[start..], &[0.0; 7], &[]);
            code.truncate(start);
            if !value.is_finite() {
                return Err(format!("{} gives {value}, expected a finite number", called(name)));
            }
            code.push(Instruction::Constant(value));
        }
        Ok(kind)
    }

    fn slots(&self, t: f64) -> Vec<f64> {
        let variables = [t, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        self.prelude.iter().map(|code| scalar(code, &variables, &[])).collect()
    }

    /// The components at one place; those that it does not have are 0.
    pub fn at(&self, t: f64, x: Vec3<f64>, v: Vec3<f64>) -> [f64; 3] {
        let (variables, slots) = ([t, x.x, x.y, x.z, v.x, v.y, v.z], self.slots(t));
        std::array::from_fn(|c| self.components.get(c).map_or(0.0, |code| scalar(code, &variables, &slots)))
    }

    /// Calls `each(row, components)` for every row.
    pub fn rows(&self, t: f64, x: &[Row], v: &[Row], mut each: impl FnMut(usize, [f64; 3])) {
        let slots = self.slots(t);
        let mut stack: Vec<[f64; BLOCK]> = Vec::new();
        let mut results = [[0.0; BLOCK]; 3];
        for (b, x) in x.chunks(BLOCK).enumerate() {
            let v = &v[b * BLOCK..b * BLOCK + x.len()];
            for (code, result) in self.components.iter().zip(&mut results) {
                columns(code, t, x, v, &slots, &mut stack);
                *result = stack.pop().unwrap_or([0.0; BLOCK]);
            }
            for k in 0..x.len() {
                each(b * BLOCK + k, [results[0][k], results[1][k], results[2][k]]);
            }
        }
    }
}

fn constant(value: f64, code: &mut Vec<Instruction>) -> Result<DependsOn, String> {
    if !value.is_finite() {
        return Err("a number that is too large".into());
    }
    code.push(Instruction::Constant(value));
    Ok(DependsOn::Constant)
}

/// The instructions of a call: one, or one after each argument but the first.
fn operation(name: &str, arguments: &[(DependsOn, Vec<Instruction>)], of: Of) -> Result<Vec<Instruction>, String> {
    let n = arguments.len();
    let one = match (name, n) {
        ("-", 1) => Some(Instruction::Negate),
        ("+", 2) => Some(Instruction::Add),
        ("-", 2) => Some(Instruction::Subtract),
        ("*", 2) => Some(Instruction::Multiply),
        ("/", 2) => Some(Instruction::Divide),
        ("pow", 2) if matches!(arguments[1].1[..], [Instruction::Constant(2.0)]) => Some(Instruction::Square),
        _ => None,
    };
    if let Some(one) = one {
        return Ok(vec![one]);
    }
    let Some((_, function)) = FUNCTIONS.iter().find(|(known, _)| *known == name) else {
        if CONSTANTS.iter().any(|(c, _)| *c == name) || VARIABLES.contains(&name) {
            return Err(format!("\"{name}\" is no function; write {name}*(...)"));
        }
        return Err(unknown(name, of));
    };
    let wrong = |expected: &str| Err(format!("{name} of {n} values, expected {expected}"));
    match *function {
        Function::One(f) if n == 1 => Ok(vec![Instruction::One(f)]),
        Function::Two(f) if n == 2 => Ok(vec![Instruction::Two(f)]),
        Function::Three(f) if n == 3 => Ok(vec![Instruction::Three(f)]),
        Function::Fold(f) if n >= 2 => Ok(vec![Instruction::Two(f); n - 1]),
        Function::One(_) => wrong("one"),
        Function::Two(_) => wrong("two"),
        Function::Three(_) => wrong("three"),
        Function::Fold(_) => wrong("two or more"),
    }
}

fn called(name: &str) -> String {
    match name {
        "/" => "a division".into(),
        "+" | "-" | "*" => format!("\"{name}\""),
        _ => name.into(),
    }
}

fn unknown(name: &str, of: Of) -> String {
    let known = || {
        let names = VARIABLES[of.range()].iter().copied();
        names.chain(CONSTANTS.iter().map(|c| c.0)).chain(FUNCTIONS.iter().map(|f| f.0))
    };
    let hint = suggestion(name, known());
    format!("unknown name \"{name}\"{hint} (known: {})", known().collect::<Vec<_>>().join(", "))
}

fn shortened(text: &str) -> String {
    if text.chars().count() > 60 { format!("{}...", text.chars().take(60).collect::<String>()) } else { text.into() }
}

/// How many values wait on the stack at most.
fn depth(code: &[Instruction]) -> usize {
    let (mut now, mut most) = (0_usize, 0);
    for instruction in code {
        match instruction {
            Instruction::Constant(_) | Instruction::Variable(_) | Instruction::Slot(_) => now += 1,
            Instruction::Negate | Instruction::Square | Instruction::One(_) => {}
            Instruction::Three(_) => now = now.saturating_sub(2),
            _ => now = now.saturating_sub(1),
        }
        most = most.max(now);
    }
    most
}

/// Runs the instructions for one place. The stack has room: `Formula::new` has measured it.
fn scalar(code: &[Instruction], variables: &[f64; 7], slots: &[f64]) -> f64 {
    let (mut stack, mut top) = ([0.0; STACK + 1], 0);
    for instruction in code {
        match *instruction {
            Instruction::Constant(c) => push(&mut stack, &mut top, c),
            Instruction::Variable(i) => push(&mut stack, &mut top, variables[i]),
            Instruction::Slot(i) => push(&mut stack, &mut top, slots[i]),
            Instruction::Negate => stack[top] = -stack[top],
            Instruction::Square => stack[top] = stack[top] * stack[top],
            Instruction::One(f) => stack[top] = f(stack[top]),
            Instruction::Add => pair(&mut stack, &mut top, |a, b| a + b),
            Instruction::Subtract => pair(&mut stack, &mut top, |a, b| a - b),
            Instruction::Multiply => pair(&mut stack, &mut top, |a, b| a * b),
            Instruction::Divide => pair(&mut stack, &mut top, |a, b| a / b),
            Instruction::Two(f) => pair(&mut stack, &mut top, f),
            Instruction::Three(f) => {
                top -= 2;
                stack[top] = f(stack[top], stack[top + 1], stack[top + 2]);
            }
        }
    }
    stack[top]
}

fn push(stack: &mut [f64; STACK + 1], top: &mut usize, value: f64) {
    *top += 1;
    stack[*top] = value;
}

#[inline(always)]
fn pair(stack: &mut [f64; STACK + 1], top: &mut usize, f: impl Fn(f64, f64) -> f64) {
    *top -= 1;
    stack[*top] = f(stack[*top], stack[*top + 1]);
}

/// Runs the instructions for a block of rows and leaves the result on the stack: the same operations as `scalar`.
fn columns(code: &[Instruction], t: f64, x: &[Row], v: &[Row], slots: &[f64], stack: &mut Vec<[f64; BLOCK]>) {
    for instruction in code {
        match *instruction {
            Instruction::Constant(c) => stack.push([c; BLOCK]),
            Instruction::Slot(i) => stack.push([slots[i]; BLOCK]),
            Instruction::Variable(0) => stack.push([t; BLOCK]),
            Instruction::Variable(i) => {
                let (rows, c) = if i < 4 { (x, i - 1) } else { (v, i - 4) };
                let mut column = [0.0; BLOCK];
                for (number, row) in column.iter_mut().zip(rows) {
                    *number = f64::from(row[c]);
                }
                stack.push(column);
            }
            Instruction::Negate => each(stack, |a| -a),
            Instruction::Square => each(stack, |a| a * a),
            Instruction::One(f) => each(stack, f),
            Instruction::Add => both(stack, |a, b| a + b),
            Instruction::Subtract => both(stack, |a, b| a - b),
            Instruction::Multiply => both(stack, |a, b| a * b),
            Instruction::Divide => both(stack, |a, b| a / b),
            Instruction::Two(f) => both(stack, f),
            Instruction::Three(f) => {
                if let (Some(c), Some(b), Some(a)) = (stack.pop(), stack.pop(), stack.last_mut()) {
                    for k in 0..BLOCK {
                        a[k] = f(a[k], b[k], c[k]);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn each(stack: &mut [[f64; BLOCK]], f: impl Fn(f64) -> f64) {
    if let Some(a) = stack.last_mut() {
        for number in a {
            *number = f(*number);
        }
    }
}

#[inline(always)]
fn both(stack: &mut Vec<[f64; BLOCK]>, f: impl Fn(f64, f64) -> f64) {
    if let (Some(b), Some(a)) = (stack.pop(), stack.last_mut()) {
        for k in 0..BLOCK {
            a[k] = f(a[k], b[k]);
        }
    }
}

#[cfg(test)]
mod tests;
