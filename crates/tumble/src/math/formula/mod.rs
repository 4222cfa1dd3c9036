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
use table::{COMPARISONS, CONSTANTS, FUNCTIONS, Function};
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
        let mut stack: Vec<Values> = Vec::new();
        let mut results = [Values::Same(0.0); 3];
        for (b, x) in x.chunks(BLOCK).enumerate() {
            let v = &v[b * BLOCK..b * BLOCK + x.len()];
            let variable = |i: usize| {
                let (rows, c) = if i < 4 { (x, i.wrapping_sub(1)) } else { (v, i - 4) };
                if i == 0 { Values::Same(t) } else { of_each(rows.len(), |k| f64::from(rows[k][c])) }
            };
            for (code, result) in self.components.iter().zip(&mut results) {
                columns(code, x.len(), &variable, &slots, &mut stack);
                *result = stack.pop().unwrap_or(Values::Same(0.0));
            }
            for k in 0..x.len() {
                each(b * BLOCK + k, std::array::from_fn(|c| results[c].get(k)));
            }
        }
    }

    /// Calls `each(i, value)` with one component at n points of a line along x, the i-th of which is at `x(i)`; what depends on the other
    /// coordinates alone is computed once.
    pub fn along(&self, component: usize, t: f64, n: usize, x: impl Fn(usize) -> f64, [y, z]: [f64; 2], mut each: impl FnMut(usize, f64)) {
        let (slots, mut stack) = (self.slots(t), Vec::new());
        for start in (0..n).step_by(BLOCK) {
            let here = (n - start).min(BLOCK);
            let variable = |i: usize| match i {
                1 => of_each(here, |k| x(start + k)),
                _ => Values::Same([t, 0.0, y, z, 0.0, 0.0, 0.0][i]),
            };
            columns(&self.components[component], here, &variable, &slots, &mut stack);
            let values = stack.pop().unwrap_or(Values::Same(0.0));
            (0..here).for_each(|k| each(start + k, values.get(k)));
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
    let compared = COMPARISONS.iter().find(|(known, _)| *known == name).map(|(_, f)| Instruction::Two(*f));
    if let Some(one) = one.or(compared) {
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

/// A value for all masses of a block: the same for all, or one for each.
#[derive(Clone, Copy)]
#[allow(clippy::large_enum_variant)] // a few of them, on a stack that is kept
enum Values {
    Same(f64),
    Each([f64; BLOCK]),
}

impl Values {
    fn get(&self, k: usize) -> f64 {
        match self {
            Self::Same(value) => *value,
            Self::Each(values) => values[k],
        }
    }
}

/// Runs the instructions for a block of n masses and leaves the result on the stack: the same operations as `scalar`.
fn columns(code: &[Instruction], n: usize, variable: &impl Fn(usize) -> Values, slots: &[f64], stack: &mut Vec<Values>) {
    for instruction in code {
        match *instruction {
            Instruction::Constant(c) => stack.push(Values::Same(c)),
            Instruction::Slot(i) => stack.push(Values::Same(slots[i])),
            Instruction::Variable(i) => stack.push(variable(i)),
            Instruction::Negate => each(stack, n, |a| -a),
            Instruction::Square => each(stack, n, |a| a * a),
            Instruction::One(f) => each(stack, n, f),
            Instruction::Add => both(stack, n, |a, b| a + b),
            Instruction::Subtract => both(stack, n, |a, b| a - b),
            Instruction::Multiply => both(stack, n, |a, b| a * b),
            Instruction::Divide => both(stack, n, |a, b| a / b),
            Instruction::Two(f) => both(stack, n, f),
            Instruction::Three(f) => {
                if let (Some(c), Some(b), Some(a)) = (stack.pop(), stack.pop(), stack.last_mut()) {
                    *a = match (*a, b, c) {
                        (Values::Same(a), Values::Same(b), Values::Same(c)) => Values::Same(f(a, b, c)),
                        (a, b, c) => of_each(n, |k| f(a.get(k), b.get(k), c.get(k))),
                    };
                }
            }
        }
    }
}

#[inline(always)]
fn of_each(n: usize, f: impl Fn(usize) -> f64) -> Values {
    let mut out = [0.0; BLOCK];
    for (k, out) in out[..n].iter_mut().enumerate() {
        *out = f(k);
    }
    Values::Each(out)
}

#[inline(always)]
fn each(stack: &mut [Values], n: usize, f: impl Fn(f64) -> f64) {
    match stack.last_mut() {
        Some(Values::Same(a)) => *a = f(*a),
        Some(Values::Each(a)) => a[..n].iter_mut().for_each(|a| *a = f(*a)),
        None => {}
    }
}

#[inline(always)]
fn both(stack: &mut Vec<Values>, n: usize, f: impl Fn(f64, f64) -> f64) {
    let (Some(b), Some(a)) = (stack.pop(), stack.last_mut()) else { return };
    match (&mut *a, b) {
        (Values::Each(a), Values::Each(b)) => a[..n].iter_mut().zip(&b[..n]).for_each(|(a, b)| *a = f(*a, *b)),
        (Values::Each(a), Values::Same(b)) => a[..n].iter_mut().for_each(|a| *a = f(*a, b)),
        (Values::Same(same), Values::Each(b)) => {
            let same = *same;
            *a = of_each(n, |k| f(same, b[k]));
        }
        (Values::Same(a), Values::Same(b)) => *a = f(*a, b),
    }
}

#[cfg(test)]
mod tests;
