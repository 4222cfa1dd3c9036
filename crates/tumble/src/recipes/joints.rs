//! Joints: words to points, axes and bodies.

use crate::geometry::Vector;
use crate::math::rotation::from_z_to;
use crate::math::{Quat, Signal};
use crate::systems::rigid::{Bodies, Body, Drive, Joint, Kind, Motor, WORLD};
use std::ops::Range;
use tumble_interface::check::{short, suggestion};
use tumble_interface::scene::{Animated, Joint as Words, JointKind, JointMotor};

/// A joint this many times further from a body than that reaches is far.
const FAR: f64 = 10.0;
/// Angles of hinges are known within half a turn; they stay this far from that [rad].
const HALF_TURN: f64 = 3.1;

/// What is wrong with which key.
type Wrong = (String, String);

/// The joints of words.
pub struct Made {
    /// They, in the order of the bodies.
    pub joints: Vec<Joint>,
    /// The first end that is far from its body: how far, and how far the body reaches [m].
    pub far: Option<[f64; 2]>,
}

/// Objects by name, their rows, and how many of these each of their bodies has.
pub type Named<'a> = [(&'a str, Range<usize>, usize)];

/// Object and index of an end: "flag 3".
pub fn named(words: &str) -> Option<(&str, usize)> {
    words.rsplit_once(' ').and_then(|(name, index)| Some((name.trim(), index.parse().ok()?)))
}

/// The row of an end: "link 3", or "door", if there is one.
fn row(words: &str, k: usize, objects: &Named<'_>) -> Result<usize, Wrong> {
    let wrong = |message: String| Err((format!(".between[{k}]"), message));
    let known = |name: &str| objects.iter().find(|(known, ..)| *known == name);
    let (name, index) = match (known(words), named(words)) {
        (None, Some((name, index))) => (name, Some(index)),
        _ => (words, None),
    };
    let Some((_, rows, each)) = known(name) else {
        let hint = suggestion(name, objects.iter().map(|(known, ..)| *known));
        let message = format!(
            "there is no body \"{name}\" in the system of the joint{hint}; for the world leave it out, soft objects are held by an [[anchor]]"
        );
        return wrong(message);
    };
    let count = rows.len() / each;
    match index {
        None if count > 1 => wrong(format!("\"{name}\" has {count} bodies; say which: \"{name} 0\"")),
        Some(index) if index >= count => {
            wrong(format!("there is no body {index} in \"{name}\"; the last one is {}", count.saturating_sub(1)))
        }
        index => Ok(rows.start + index.unwrap_or(0) * each),
    }
}

/// The second and the first body of each joint.
fn pairs(words: &Words, objects: &Named<'_>) -> Result<Vec<[u32; 2]>, Wrong> {
    match &words.between[..] {
        [name] if words.chain => {
            let Some((_, rows, each)) = objects.iter().find(|(known, ..)| known == name) else {
                return Err((row(name, 0, objects).err()).unwrap_or_else(|| (".between[0]".into(), "expected an object alone".into())));
            };
            if rows.len() < 2 * each {
                return Err((".chain".into(), format!("\"{name}\" has one body; a chain needs at least two")));
            }
            Ok((rows.start..rows.end - each).step_by(*each).map(|i| [i, i + each].map(|i| i as u32)).collect())
        }
        [_, ..] if words.chain => Err((".between".into(), "two names with chain = true; name the object whose bodies it joins".into())),
        [first, second] => {
            let [first, second] = [row(first, 0, objects)?, row(second, 1, objects)?];
            if first == second {
                return Err((".between".into(), "both ends are the same body".into()));
            }
            Ok(vec![[second as u32, first as u32]])
        }
        [first] => Ok(vec![[WORLD, row(first, 0, objects)? as u32]]),
        _ => Err((".between".into(), "expected one or two bodies".into())),
    }
}

/// Axes of which x is the given one.
fn axes(kind: &JointKind) -> Result<Quat<f64>, Wrong> {
    let (word, axis) = match kind {
        JointKind::Hinge { axis, .. } => ("hinge", *axis),
        JointKind::Slider { axis, .. } => ("slider", *axis),
        _ => return Ok(Quat { v: Vector::default(), w: 1.0 }),
    };
    let x = Vector::from(axis);
    if x.norm() < 1e-12 {
        return Err((format!(".kind.{word}.axis"), "[0, 0, 0], expected a direction".into()));
    }
    // A quarter of a turn about y takes x to z.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    Ok(from_z_to(x) * Quat { v: Vector { x: 0.0, y: -half, z: 0.0 }, w: half })
}

fn limits(word: &str, limits: Option<[f64; 2]>, most: f64) -> Result<Option<[f64; 2]>, Wrong> {
    match limits {
        Some([low, high]) if low > high => Err((format!(".kind.{word}.limits"), format!("[{low}, {high}], expected the least first"))),
        Some([low, high]) if low < -most || high > most => {
            Err((format!(".kind.{word}.limits"), format!("[{low}, {high}] rad, expected angles from {} to {most}", -most)))
        }
        Some([low, high]) if low > 0.0 || high < 0.0 => {
            Err((format!(".kind.{word}.limits"), format!("[{low}, {high}], but it starts at 0; put bodies where they may be")))
        }
        limits => Ok(limits),
    }
}

/// The joints that words describe; `signal` reads what may change in time.
pub fn joints(
    words: &Words,
    objects: &Named<'_>,
    bodies: &Bodies,
    signal: &mut dyn FnMut(&str, &Animated, [f64; 2]) -> Signal,
) -> Result<Made, Wrong> {
    let mut drive = |word: &str, motor: &Option<JointMotor>, most: f64| {
        let key = |kind: &str| format!(".kind.{word}.motor.{kind}.value");
        motor.as_ref().map(|motor| match motor {
            JointMotor::Speed { value, strength } => Motor {
                drive: Drive::Speed(signal(&key("speed"), value, [f64::NEG_INFINITY, f64::INFINITY])),
                strength: strength.unwrap_or(f64::INFINITY),
            },
            JointMotor::Target { value, stiffness, damping, strength } => Motor {
                drive: Drive::Target(signal(&key("target"), value, [-most, most]), [*stiffness, *damping]),
                strength: strength.unwrap_or(f64::INFINITY),
            },
        })
    };
    let turn = axes(&words.kind)?;
    let (is_free, to) = match &words.kind {
        JointKind::Rope { to, .. } | JointKind::Spring { to, .. } => (true, to.is_some()),
        kind => (matches!(kind, JointKind::Ball {}), false),
    };
    if is_free && words.break_torque.is_some() {
        return Err((".break_torque".into(), "given, but it turns freely and holds no torque; take break_force".into()));
    }
    if words.chain && to {
        return Err((".kind".into(), "`to` with chain = true: ropes and springs of a chain join centres; leave it out".into()));
    }
    let (limits, motor) = match &words.kind {
        JointKind::Hinge { limits: range, motor, .. } => (limits("hinge", *range, HALF_TURN)?, drive("hinge", motor, HALF_TURN)),
        JointKind::Slider { limits: range, motor, .. } => (limits("slider", *range, f64::INFINITY)?, drive("slider", motor, f64::INFINITY)),
        _ => (None, None),
    };
    if words.chain && words.at.is_some() {
        return Err((".at".into(), "given with chain = true, whose joints are between neighbours; leave it out".into()));
    }
    let mut made = Made { joints: Vec::new(), far: None };
    for pair in pairs(words, objects)? {
        let [base, body] = pair.map(|i| bodies.rows.get(i as usize));
        let center = |body: Option<&Body>| body.map_or(Vector::default(), |body| body.x);
        let line = match &words.kind {
            JointKind::Rope { to, .. } => Some(("rope", to)),
            JointKind::Spring { to, .. } => Some(("spring", to)),
            _ => None,
        };
        let middle = (center(base) + center(body)) * 0.5;
        let at = words.at.map_or(if words.chain && line.is_none() { middle } else { center(body) }, Vector::from);
        let to = match line {
            None => at,
            Some((word, None)) if base.is_none() => {
                return Err((format!(".kind.{word}.to"), "missing, expected where in the world its other end is".into()));
            }
            Some((_, to)) => to.map_or(center(base), Vector::from),
        };
        let apart = (to - at).norm();
        let kind = match &words.kind {
            JointKind::Fixed {} => Kind::Fixed,
            JointKind::Ball {} => Kind::Ball,
            JointKind::Hinge { .. } => Kind::Hinge,
            JointKind::Slider { .. } => Kind::Slider,
            JointKind::Rope { length, .. } => Kind::Rope(length.unwrap_or(apart)),
            JointKind::Spring { stiffness, damping, length, .. } => Kind::Spring([length.unwrap_or(apart), *stiffness, *damping]),
        };
        if kind == Kind::Rope(0.0) {
            return Err((".kind.rope.length".into(), "missing, for its ends start in one place".into()));
        }
        if let Kind::Rope(length) = kind
            && apart > length * (1.0 + 1e-9)
        {
            let message = format!("{length} m, but its ends start {} m apart; make it longer, or start them closer", short(apart));
            return Err((".kind.rope.length".into(), message));
        }
        let ends = [(base, to), (body, at)];
        for (body, end, i) in ends.iter().zip(pair).filter_map(|((body, end), i)| Some(((*body)?, end, i))) {
            let (away, reach) = ((*end - body.x).norm(), bodies.hulls[bodies.hull[i as usize] as usize].reach);
            if away > FAR * reach {
                made.far = made.far.or(Some([away, reach]));
            }
        }
        let own = |body: Option<&Body>, p: Vector| body.map_or(p, |body| body.q.conj().turn(p - body.x));
        made.joints.push(Joint {
            collides: words.collide,
            pair,
            at: ends.map(|(body, end)| own(body, end)),
            turn: [base, body].map(|body| body.map_or(turn, |body| body.q.conj() * turn)),
            kind,
            limits,
            motor: motor.clone(),
            breaks: [words.break_force, words.break_torque].map(|most| most.unwrap_or(f64::INFINITY)),
            broken: false,
            load: [Vector::default(); 2],
        });
    }
    Ok(made)
}
