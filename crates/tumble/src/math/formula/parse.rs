//! The grammar of formulas, by winnow's Pratt parser.

use winnow::ascii::{digit0, digit1, multispace0};
use winnow::combinator::{Infix, Prefix, alt, cut_err, delimited, expression, fail, opt, preceded, separated};
use winnow::error::{ContextError, ErrMode};
use winnow::prelude::*;
use winnow::token::{one_of, take_while};

/// A formula as it is written; names are not looked up yet.
#[derive(Debug, Clone, PartialEq)]
pub enum Tree {
    /// A number.
    Number(f64),
    /// A variable or a constant.
    Name(String),
    /// A function and its arguments; operators are functions, too.
    Call(String, Vec<Tree>),
}

/// Longest formula [characters].
const LENGTH: usize = 1000;
/// Deepest nesting of brackets; as many powers or signs may follow each other.
const DEPTH: usize = 32;

/// Reads one formula, or a list of them in square brackets.
pub fn parse(text: &str) -> Result<Vec<Tree>, String> {
    bounded(text)?;
    let list = delimited((multispace0, '['), separated(1.., sum, ','), cut_err((']', multispace0)));
    alt((list, sum.map(|one| vec![one]))).parse(text).map_err(|e| {
        let rest = text.get(e.offset()..).unwrap_or_default().trim();
        if rest.starts_with(['<', '>', '=', '!']) {
            "comparisons are <, <=, >, >=, ==, != of two values; write (0 < x)*(x < 1) for both of two".to_string()
        } else if rest.is_empty() {
            "it ends too early; expected a number, a name or \"(\"".to_string()
        } else {
            format!("cannot be read from \"{}\" on", rest.chars().take(20).collect::<String>())
        }
    })
}

/// Bounds what the recursion of the parser can meet.
fn bounded(text: &str) -> Result<(), String> {
    if text.len() > LENGTH {
        return Err(format!("{} characters long, expected at most {LENGTH}", text.len()));
    }
    let (mut open, mut deepest, mut signs, mut most_signs) = (Vec::new(), 0, 0, 0);
    for c in text.chars() {
        match c {
            '(' | '[' => open.push(c),
            ')' | ']' if open.pop() != Some(if c == ')' { '(' } else { '[' }) => {
                return Err(format!("a \"{c}\" that closes nothing"));
            }
            _ => {}
        }
        deepest = deepest.max(open.len());
        signs = if "+-^*".contains(c) { signs + 1 } else { signs * usize::from(c.is_whitespace()) };
        most_signs = most_signs.max(signs);
    }
    if let Some(c) = open.pop() {
        return Err(format!("a \"{c}\" that is never closed"));
    }
    if deepest > DEPTH || most_signs > DEPTH || text.matches(['^']).count() + text.matches("**").count() > DEPTH {
        return Err(format!("nested more than {DEPTH} deep"));
    }
    Ok(())
}

type Parsed<T> = Result<T, ErrMode<ContextError>>;

/// Comparisons, terms and factors: `-x^2` is -(x²), `2^3^2` is 2^9.
fn sum(input: &mut &str) -> Parsed<Tree> {
    fn call<const N: usize>(name: &str, arguments: [Tree; N]) -> Parsed<Tree> {
        Ok(Tree::Call(name.into(), arguments.into()))
    }
    let prefix = one_of(['-', '+']).map(|c| match c {
        '-' => Prefix(8, |_: &mut _, a| call("-", [a])),
        _ => Prefix(8, |_: &mut _, a| Ok(a)),
    });
    let comparison = alt(("<=", ">=", "==", "!=", "<", ">"));
    let infix = alt((comparison, "**", "^", "+", "-", "*", "/")).map(|operator| match operator {
        "<=" => Infix::Neither(3, |_: &mut _, a, b| call("<=", [a, b])),
        ">=" => Infix::Neither(3, |_: &mut _, a, b| call(">=", [a, b])),
        "==" => Infix::Neither(3, |_: &mut _, a, b| call("==", [a, b])),
        "!=" => Infix::Neither(3, |_: &mut _, a, b| call("!=", [a, b])),
        "<" => Infix::Neither(3, |_: &mut _, a, b| call("<", [a, b])),
        ">" => Infix::Neither(3, |_: &mut _, a, b| call(">", [a, b])),
        "+" => Infix::Left(5, |_: &mut _, a, b| call("+", [a, b])),
        "-" => Infix::Left(5, |_: &mut _, a, b| call("-", [a, b])),
        "*" => Infix::Left(7, |_: &mut _, a, b| call("*", [a, b])),
        "/" => Infix::Left(7, |_: &mut _, a, b| call("/", [a, b])),
        _ => Infix::Right(9, |_: &mut _, a, b| call("pow", [a, b])),
    });
    preceded(multispace0, expression(operand).prefix(delimited(multispace0, prefix, multispace0)).infix(preceded(multispace0, infix)))
        .parse_next(input)
        .and_then(|tree| multispace0.parse_next(input).map(|_: &str| tree))
}

fn operand(input: &mut &str) -> Parsed<Tree> {
    delimited(multispace0, alt((number, delimited('(', cut_err(sum), cut_err(')')), name)), multispace0).parse_next(input)
}

fn number(input: &mut &str) -> Parsed<Tree> {
    let mantissa = alt(((digit1, opt(('.', digit0))).void(), ('.', digit1).void()));
    let exponent = opt((one_of(['e', 'E']), opt(one_of(['+', '-'])), digit1));
    let text = (mantissa, exponent).take().parse_next(input)?;
    text.parse().map(Tree::Number).or_else(|_| fail.parse_next(input))
}

fn name(input: &mut &str) -> Parsed<Tree> {
    let first = |c: char| c.is_ascii_alphabetic() || c == '_';
    let name = (one_of(first), take_while(0.., |c: char| first(c) || c.is_ascii_digit())).take().parse_next(input)?;
    let arguments = delimited('(', cut_err(separated(0.., sum, ',')), cut_err(')'));
    let arguments: Option<Vec<Tree>> = opt(preceded(multispace0, arguments)).parse_next(input)?;
    Ok(match arguments {
        Some(arguments) => Tree::Call(name.into(), arguments),
        None => Tree::Name(name.into()),
    })
}
