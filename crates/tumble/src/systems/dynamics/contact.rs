//! Contact with solids. Implicit Euler sees it as penalty elements with friction inside Newton's method. All other
//! integrators resolve it by a pass over positions and velocities after each step: a penalty does not damp under implicit
//! midpoint, and BDF2 has a history that an impact makes wrong.

use crate::elements::{Block, Linear, PointPlane, forces};
use crate::geometry::{Collider, Friction, Impact, Touch, Vector};
use crate::math::{Real, Row, row, xyz64};
use crate::pool::Hit;
use std::ops::Range;

/// Penalty stiffness over m/h²: a resting mass sinks in by g h²/30, 0.006 mm at 240 steps a second.
const PENALTY: f64 = 30.0;
/// Penalty stiffness over that of the links which pull the mass in.
const GRIP: f64 = 4.0;
/// Speed below which friction of the implicit schemes is proportional to the speed [m/s].
const CREEP: f64 = 1e-3;

/// Impacts of one mass in one step; after the last it waits where it is for the next step.
const BOUNCES: usize = 256;

/// A step as contact sees it.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// Its start [s].
    pub t: f64,
    /// Its length [s].
    pub h: f64,
    /// Speed of approach below which nothing bounces [m/s]: the speed that gravity gives in two steps.
    pub resting: f64,
    /// Of the scheme: the velocity of the path is v + lead h a.                                    (contact.14)
    pub lead: f64,
    /// Whether impacts are observed.
    pub observed: bool,
}

impl Step {
    fn end(&self) -> f64 {
        self.t + self.h
    }
}

/// The part of contact that a scheme leaves to the pass.
#[derive(Debug, Clone, Copy)]
pub struct Response {
    /// The velocity of its path is v + lead h a.
    pub lead: f64,
    /// Whether its stages have seen the solids as penalties.
    pub penalty: bool,
    /// The share of the way to a matched shape that a sub-step takes, if that does not follow from the frequency of the shape.
    pub plain: Option<f64>,
}

/// The contact pass over masses after a step.
pub struct Pass<'a> {
    /// Solids.
    pub colliders: &'a [Collider],
    /// The step; whether impacts are observed depends on the row.
    pub step: Step,
    /// Whether the stages of the scheme have seen the solids as penalties.
    pub penalty: bool,
    /// Rows whose impacts are observed.
    pub observed: &'a [Range<usize>],
    /// Rows whose impulses on solids are counted.
    pub counted: &'a [Range<usize>],
}

/// What a contact pass has found.
#[derive(Debug, Default)]
pub struct Found {
    /// Whether a mass has touched a solid.
    pub touched: bool,
    /// Impacts of observed rows.
    pub hits: Vec<(usize, Hit)>,
    /// Impulses of counted rows on every solid [N s]; empty without any.
    pub pushes: Vec<Vector>,
    /// The normal of the contact that has changed the velocity most, and by how much [m/s].
    pub normal: (Vector, f64),
}

/// One mass, as the pass tells of it.
struct Teller<'a> {
    row: usize,
    /// Its mass [kg], 0 if its impulses are not counted.
    mass: f64,
    found: &'a mut Found,
}

impl Teller<'_> {
    fn hit(&mut self, hit: Hit) {
        self.found.hits.push((self.row, hit));
    }

    /// A contact with this normal has changed its velocity by this much.
    fn met(&mut self, normal: Vector, change: Vector) {
        let size = change.norm();
        if self.found.normal.1 <= size {
            self.found.normal = (normal, size);
        }
    }

    /// A solid has changed its velocity by this much.
    fn push(&mut self, solid: usize, change: Vector) {
        if self.mass > 0.0 {
            let push = &mut self.found.pushes[solid];
            *push = *push - change * self.mass;
        }
    }
}

impl Pass<'_> {
    /// Resolves the contacts of one mass, `before` being its position and velocity when the step began; says whether it touched a solid.
    pub fn mass(&self, row: usize, before: (Row, Row), x: &mut Row, v: &mut Row, found: &mut Found) -> bool {
        if x[3] <= 0.0 {
            return false;
        }
        let among = |ranges: &[Range<usize>]| ranges.iter().any(|rows| rows.contains(&row));
        let step = Step { observed: among(self.observed), ..self.step };
        let mass = if among(self.counted) { 1.0 / f64::from(x[3]) } else { 0.0 };
        if mass > 0.0 {
            found.pushes.resize(self.colliders.len(), Vector::default());
        }
        let teller = &mut Teller { row, mass, found };
        let resolve = if self.penalty { bounce } else { resolve };
        let touched = resolve(self.colliders, &step, before, x, v, teller);
        found.touched |= touched;
        touched
    }

    /// The same of the rows from `start` on.
    pub fn rows(&self, start: usize, before: [&[Row]; 2], x: &mut [Row], v: &mut [Row], found: &mut Found) {
        for (k, (x, v)) in x.iter_mut().zip(v).enumerate() {
            self.mass(start + k, (before[0][k], before[1][k]), x, v, found);
        }
    }
}

/// Moves one mass out of the solids and gives it the velocity after the impact; says whether it touched one. `before` is
/// where it was when the step began, and its velocity then.
///
/// First the solids on its way, impact by impact; then, where it ended too deep, position: out along the normal; of the
/// way made along the surface as much is taken back as friction allows, mu times the depth. Velocity: v_n -> -e v_n, and
/// v_t loses at most mu times the change of v_n, all relative to the surface. `teller` hears of impacts faster than
/// `resting`.                                                                        (contact.2, contact.3)
fn resolve(colliders: &[Collider], step: &Step, before: (Row, Row), x: &mut Row, v: &mut Row, teller: &mut Teller<'_>) -> bool {
    let pull = (xyz64(*v) - xyz64(before.1)) * (1.0 / step.h);
    let ahead = pull * (step.lead * step.h);
    let mut touched = meet(colliders, step, before, (pull, ahead), x, v, teller);
    for (solid, collider) in colliders.iter().enumerate() {
        // A container bends towards masses that go along its wall, and has corners where three walls meet.
        for _ in 0..if collider.inside { 3 } else { 1 } {
            let (position, velocity) = (xyz64(*x), xyz64(*v));
            let Some(Touch { depth, normal, velocity: surface }) = collider.touch(position, step.end()) else { break };
            touched = true;
            let way = position - xyz64(before.0) - surface * step.h;
            let along = way - normal * way.dot(normal);
            let friction = collider.friction_at(step.end());
            let back = friction.takes(along.norm(), depth);
            let position = position + normal * depth - along.normalized() * back;
            let approach = (velocity - surface).dot(normal);
            let arriving = velocity;
            let velocity = rebound((collider, friction), velocity - surface, ahead, normal, step.resting) + surface;
            teller.push(solid, velocity - arriving);
            teller.met(normal, velocity - arriving);
            if step.observed && approach < -step.resting {
                teller.hit(Hit { time: step.end(), x: position, v: velocity, normal });
            }
            *x = row(real(position), x[3]);
            *v = row(real(velocity), 0.0);
        }
    }
    touched
}

/// The velocity after an impact, relative to the surface; that of the path is `ahead` of it.      (contact.3, contact.14)
fn rebound((collider, friction): (&Collider, Friction), velocity: Vector, ahead: Vector, normal: Vector, resting: f64) -> Vector {
    let (approach, ahead, e) = (velocity.dot(normal), ahead.dot(normal), collider.restitution);
    let slide = velocity - normal * approach;
    let bounce = if e > 0.0 && approach < -resting { -e * (approach + ahead) - ahead } else { 0.0 };
    let after = approach.max(bounce);
    slide - rubbed(slide, friction, after - approach) + normal * after
}

/// The part of a slide that friction takes.
fn rubbed(slide: Vector, friction: Friction, press: f64) -> Vector {
    slide.normalized() * friction.takes(slide.norm(), press)
}

/// Follows a mass through its step from impact to impact, under the acceleration `pull` that the step has found; says whether
/// there was one. The velocity of its path is `ahead` of its own. Slow contact that ends in touch is left to the pass at the
/// end.                                                                               (contact.12, contact.14)
fn meet(
    colliders: &[Collider],
    step: &Step,
    before: (Row, Row),
    (pull, ahead): (Vector, Vector),
    x: &mut Row,
    v: &mut Row,
    teller: &mut Teller<'_>,
) -> bool {
    let (mut from, mut to) = (xyz64(before.0), xyz64(*x));
    let (mut start, mut end) = (xyz64(before.1), xyz64(*v));
    let mut gone = 0.0;
    let (mut touched, mut held) = (false, None);
    for bounce in 0..BOUNCES {
        let left = step.h - gone;
        let mut first: Option<(Impact, usize)> = None;
        for (solid, collider) in colliders.iter().enumerate() {
            let Some(hit) = collider.sweep(from, to, step.t + gone, step.end()) else { continue };
            let speeds = [start + (end - start) * hit.part, (to - from) * (1.0 / left), end];
            let approach = speeds.map(|v| (v - hit.velocity).dot(hit.normal)).into_iter().fold(f64::INFINITY, f64::min);
            let stays = || collider.touch(to, step.end()).is_some_and(|t| t.normal.dot(hit.normal) > 0.0);
            if first.as_ref().is_none_or(|(f, _)| hit.part < f.part) && (approach < -step.resting || !stays()) {
                first = Some((hit, solid));
            }
        }
        let Some((hit, solid)) = first else { break };
        touched = true;
        let collider = &colliders[solid];
        // The path up to here is as if no solid had held it for the rest.
        let unhindered = start + pull * left;
        let before = held.replace(solid);
        if let Some(before) = before {
            teller.push(before, unhindered - end);
        }
        let (n, surface) = (hit.normal, hit.velocity);
        let bend = pull * (0.5 * left * left);
        let s = on_parabola(hit.part, ((to - from) - surface * left).dot(n), bend.dot(n));
        from = from + (to - from) * s - bend * (s * (1.0 - s));
        gone += left * s;
        let arriving = start + pull * (left * s) - surface;
        let friction = collider.friction_at(step.t + gone);
        start = rebound((collider, friction), arriving, ahead, n, step.resting);
        teller.met(n, start - arriving);
        if step.observed && arriving.dot(n) < -step.resting {
            teller.hit(Hit { time: step.t + gone, x: from, v: start + surface, normal: n });
        }
        let rest = step.h - gone;
        let (press, lift) = (pull.dot(n), start.dot(n) + ahead.dot(n).min(0.0));
        if lift <= 0.01 * step.resting && press < 0.0 {
            // It stays on the surface, which takes the pressing part, and rubs.
            let free = start + (pull - n * press) * rest;
            let slide = free - n * free.dot(n);
            let after = free - rubbed(slide, friction, -press * rest);
            to = from + ((start + after) * 0.5 + surface) * rest;
            (start, end) = (start + surface, after + surface);
        } else {
            start = start + surface;
            to = from + (start + ahead) * rest + pull * (0.5 * rest * rest);
            end = start + pull * rest;
        }
        if bounce + 1 == BOUNCES || rest <= 0.0 {
            // It waits between this solid and that before, each of which holds it along its normal.
            (to, end) = (from, start);
            let change = end - unhindered;
            let own = n * change.dot(n);
            teller.push(solid, own);
            teller.push(before.unwrap_or(solid), change - own);
            break;
        }
        teller.push(solid, end - unhindered);
    }
    if touched {
        *x = row(real(to), x[3]);
        *v = row(real(end), 0.0);
    }
    touched
}

/// When the plane that a straight way meets at `part` is met by the parabola with the same ends: the straight way changes
/// its height by `fall` < 0, and the parabola lies lower than it by `bend` s (1 - s).
pub fn on_parabola(part: f64, fall: f64, bend: f64) -> f64 {
    // bend s² + (fall - bend) s - fall part = 0 has one root that is on the way down.
    let (b, c) = (fall - bend, -fall * part);
    let under = (b * b - 4.0 * bend * c).max(0.0).sqrt() - b;
    let s = if under > 0.0 && c > 0.0 {
        2.0 * c / under
    } else if b > 0.0 && bend < 0.0 {
        // It starts in touch, goes up and comes down again.
        -b / bend
    } else {
        part
    };
    if s.is_finite() { s.clamp(0.0, 1.0) } else { part }
}

/// After an implicit step: a mass that came in faster than `resting` leaves with e times its speed. One that the penalty
/// could not hold, deeper than gravity takes it in two steps or beyond the solid, is caught on its way.
fn bounce(colliders: &[Collider], step: &Step, before: (Row, Row), x: &mut Row, v: &mut Row, teller: &mut Teller<'_>) -> bool {
    let (from, to) = (xyz64(before.0), xyz64(*x));
    // An impact that the penalty slows down over some steps is one.
    let fresh = |collider: &Collider| step.observed && collider.touch(from, step.t).is_none();
    for collider in colliders {
        let deep = collider.touch(to, step.end());
        if deep.is_some_and(|t| t.depth > collider.thickness + step.resting * step.h && t.depth < -2.0 * step.h * approach(&t, before.1)) {
            // As if nothing had held it.
            *v = before.1;
            *x = row(real(from + xyz64(*v) * step.h), x[3]);
            return resolve(colliders, &Step { observed: fresh(collider), ..*step }, before, x, v, teller);
        }
        if let Some(hit) = collider.sweep(from, to, step.t, step.end())
            && !deep.is_some_and(|t| t.normal.dot(hit.normal) > 0.0)
        {
            return resolve(colliders, &Step { observed: fresh(collider), ..*step }, before, x, v, teller);
        }
    }
    let mut touched = false;
    for collider in colliders.iter().filter(|c| c.restitution > 0.0 || step.observed) {
        let Some(touch) = collider.touch(xyz64(*x), step.end()) else { continue };
        let approach = approach(&touch, before.1);
        let (normal, velocity) = (touch.normal, xyz64(*v));
        let wanted = touch.velocity.dot(normal) - collider.restitution * approach;
        if collider.restitution > 0.0 && approach < -step.resting && velocity.dot(normal) < wanted {
            *v = row(real(velocity + normal * (wanted - velocity.dot(normal))), 0.0);
            touched = true;
        }
        if approach < -step.resting && fresh(collider) {
            teller.hit(Hit { time: step.end(), x: to, v: xyz64(*v), normal });
        }
    }
    touched
}

fn approach(touch: &Touch, v: Row) -> f64 {
    (xyz64(v) - touch.velocity).dot(touch.normal)
}

/// Penalty stiffness [N/m] of a mass [kg] that its links hold with `grip` [N/m], in a stage of length gh.   (contact.6)
pub fn stiffness(mass: Real, grip: Real, gh: f64) -> f64 {
    PENALTY * f64::from(mass) / (gh * gh) + GRIP * f64::from(grip)
}

/// mu times the depth of a mass at time t.
fn friction_depth(collider: &Collider, t: f64, (x, v): (Row, Row), resting: f64) -> f64 {
    let Friction { sliding, resting: still } = collider.friction_at(t);
    if still == 0.0 {
        return 0.0;
    }
    let Some(touch) = collider.touch(xyz64(x), t) else { return 0.0 };
    let velocity = xyz64(v) - touch.velocity;
    let slide = velocity - touch.normal * velocity.dot(touch.normal);
    touch.depth * if still > sliding && slide.norm() <= resting { still } else { sliding }
}

/// What Newton's method has found out about the friction of a mass when it last linearized a stage.
#[derive(Debug, Clone, Copy, Default)]
pub struct Slip {
    /// The velocity of the mass there [m/s].
    pub velocity: Vector,
    /// Friction against it, over mu N: a vector of length 1 at most.
    pub share: Vector,
}

/// Penalty and friction of one mass in an implicit stage.
pub struct Penalty {
    touch: Touch,
    rest: [f64; 4],
    stiffness: f64,
    /// mu times the normal force at the start of the stage [N].
    friction: f64,
    slide: Vector,
}

impl Penalty {
    /// The contacts of a mass at x with velocity v, with this penalty stiffness [N/m]. Friction takes its normal force from
    /// `start`, where the mass was when the stage began: with that force held fixed friction has a convex potential, and
    /// Newton's method converges. So does it with the coefficient of rest or of sliding, faster than `resting`, at that time.
    ///
    /// `times` are those of the start and of the end of the stage.
    pub fn of(
        colliders: &[Collider],
        times: (f64, f64),
        stiffness: f64,
        (x, v): (Row, Row),
        start: (Row, Row),
        resting: f64,
    ) -> impl Iterator<Item = Penalty> {
        colliders.iter().filter_map(move |collider| {
            let position = xyz64(x);
            let touch = collider.touch(position, times.1)?;
            let velocity = xyz64(v) - touch.velocity;
            let n = touch.normal;
            Some(Penalty {
                rest: [n.x, n.y, n.z, n.dot(position) + touch.depth],
                stiffness,
                friction: stiffness * friction_depth(collider, times.0, start, resting),
                slide: velocity - n * velocity.dot(n),
                touch,
            })
        })
    }

    /// The part of a vector along the surface.
    fn along(&self, v: Vector) -> Vector {
        v - self.touch.normal * v.dot(self.touch.normal)
    }

    /// mu times the normal force at the start of the stage [N].
    pub fn friction(&self) -> f64 {
        self.friction
    }

    /// mu N/|v_t|, finite where the mass rests [N s/m].
    fn drag(&self) -> f64 {
        self.friction / self.slide.norm().max(CREEP)
    }

    /// The share of friction that the last linear system has predicted for this slide, pulled back to the unit disk.      (contact.27)
    pub fn share(&self, last: &Slip) -> Vector {
        let (slide, before) = (self.along(last.velocity - self.touch.velocity), self.along(last.share));
        let speed = slide.norm();
        let turned = if speed > CREEP { before * (slide.dot(self.slide - slide) / speed) } else { Vector::default() };
        let share = (self.slide - turned) * (1.0 / speed.max(CREEP));
        share * (1.0 / share.norm().max(1.0))
    }

    /// The force [N]: the point-plane element and Coulomb friction.
    pub fn force(&self, x: Row) -> Vector {
        let [push] = forces::<PointPlane, Linear, f64, 1, 1, 4, 0>(self.stiffness, [], self.rest, [x.map(f64::from)], None);
        push - self.slide * self.drag()
    }

    /// -df/dx - df/dv / gh, of the primal-dual Newton method with this share of friction: positive semidefinite, and the exact matrix where the
    /// share is the direction of the slide.                                                          (contact.26), [chan1999]
    pub fn matrix(&self, gh: f64, share: Vector) -> Block {
        let n = self.touch.normal;
        let drag = self.drag() / gh;
        let (t, w) = (if self.slide.norm() > CREEP { self.slide.normalized() } else { Vector::default() }, share * 0.5);
        let k = self.stiffness - drag;
        let block = [
            k * n.x * n.x + drag * (1.0 - 2.0 * w.x * t.x),
            k * n.y * n.y + drag * (1.0 - 2.0 * w.y * t.y),
            k * n.z * n.z + drag * (1.0 - 2.0 * w.z * t.z),
            k * n.x * n.y - drag * (w.x * t.y + w.y * t.x),
            k * n.y * n.z - drag * (w.y * t.z + w.z * t.y),
            k * n.z * n.x - drag * (w.z * t.x + w.x * t.z),
        ];
        block.map(|b| b as Real)
    }
}

/// A vector in the precision of states.
pub fn real(v: Vector) -> crate::math::Vec3<Real> {
    crate::math::Vec3 { x: v.x as Real, y: v.y as Real, z: v.z as Real }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn penalty(friction: f64, slide: [f64; 2]) -> Penalty {
        let normal = Vector { x: 0.0, y: 0.0, z: 1.0 };
        let slide = Vector { x: slide[0], y: slide[1], z: 0.0 };
        Penalty { touch: Touch { depth: 0.0, normal, velocity: Vector::default() }, rest: [0.0; 4], stiffness: 0.0, friction, slide }
    }

    /// Newton's iterations until the slide of 1 kg that starts with `v` and would have `free` without friction has an error below 1e-5 of the
    /// residual's scale, and the slide; the exact matrix has the direction of the slide for the share.
    fn solved(friction: f64, mut v: [f64; 2], free: [f64; 2], exact: bool) -> (usize, [f64; 2]) {
        let gh = 0.01;
        let vector = |v: [f64; 2]| Vector { x: v[0], y: v[1], z: 0.0 };
        let mut slip = Slip { velocity: vector(v), share: Vector::default() };
        for k in 0..30 {
            let one = penalty(friction, v);
            let push = one.slide * one.drag();
            let r = [(v[0] - free[0]) / gh + push.x, (v[1] - free[1]) / gh + push.y];
            if r[0].hypot(r[1]) < 1e-5 * (1.0 / gh + friction / CREEP) * CREEP {
                return (k, v);
            }
            let share = if exact { one.slide * (1.0 / one.slide.norm().max(CREEP)) } else { one.share(&slip) };
            slip = Slip { velocity: one.slide, share };
            let [xx, yy, _, xy, ..] = one.matrix(gh, share).map(|b| f64::from(b) * gh * gh);
            let (a, b) = (xx + 1.0, yy + 1.0);
            let det = a * b - xy * xy;
            v = [v[0] - gh * (b * r[0] - xy * r[1]) / det, v[1] - gh * (a * r[1] - xy * r[0]) / det];
        }
        (30, v)
    }

    #[test]
    fn what_comes_to_rest_is_found_in_few_iterations() {
        for friction in [200.0, 1000.0] {
            for free in [[-0.3, 0.4], [0.3, 0.1], [5e-4, 0.2]] {
                let (few, v) = solved(friction, [0.5, 0.1], free, false);
                let (many, _) = solved(friction, [0.5, 0.1], free, true);
                // It creeps with m v*/gh = mu N v/v_c + m v/gh.
                let creep = f64::hypot(free[0], free[1]) / (1.0 + 0.01 * friction / CREEP);
                assert!(few <= 8 && many == 30, "{few} {many}");
                assert!((v[0].hypot(v[1]) / creep - 1.0).abs() < 1e-2 && creep < CREEP, "{v:?} {creep:e}");
            }
        }
        // Where it goes on sliding, friction takes mu N gh/m of its speed.
        let (few, v) = solved(10.0, [0.5, 0.1], [-0.3, 0.4], false);
        assert!(few <= 6 && (v[0].hypot(v[1]) - 0.4).abs() < 1e-4, "{few} {v:?}");
    }

    #[test]
    fn the_matrix_of_friction_is_exact_for_what_slides_on_and_never_indefinite() {
        for slide in [[0.3, -0.1], [2e-4, 5e-4]] {
            let one = penalty(7.0, slide);
            let share = one.slide * (1.0 / one.slide.norm().max(CREEP));
            let [xx, yy, zz, xy, ..] = one.matrix(0.5, share).map(f64::from);
            let force = |a: f64, b: f64| {
                let one = penalty(7.0, [slide[0] + a, slide[1] + b]);
                one.slide * one.drag()
            };
            let e = 1e-6;
            let (along_x, along_y) = ((force(e, 0.0) - force(-e, 0.0)) * (0.5 / e), (force(0.0, e) - force(0.0, -e)) * (0.5 / e));
            let scale = 2.0 * one.drag();
            for (found, wanted) in [(xx, 2.0 * along_x.x), (xy, 2.0 * along_x.y), (yy, 2.0 * along_y.y), (zz, 0.0)] {
                assert!((found - wanted).abs() < 1e-4 * scale, "{slide:?}: {found} {wanted}");
            }
            // From a slide in the creeping range the linear system predicts more than there can be.
            let far =
                penalty(7.0, [30.0 * slide[0], 30.0 * slide[1]]).share(&Slip { velocity: Vector { x: 1e-4, ..Vector::default() }, share });
            assert!((far.norm() - 1.0).abs() < 1e-12, "{far:?}");
            for turn in 0..12 {
                let (sin, cos) = f64::from(turn).sin_cos();
                let [xx, yy, _, xy, ..] = one.matrix(0.5, Vector { x: cos, y: sin, z: 0.0 }).map(f64::from);
                assert!(xx + yy > 0.0 && xx * yy - xy * xy > -1e-6 * scale * scale, "{turn}: {xx} {yy} {xy}");
            }
        }
    }
}
