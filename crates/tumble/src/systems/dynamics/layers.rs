//! Soft surfaces keep off themselves and each other: pairs of near features are found at the start of a sub-step, projected like any
//! other constraint with friction, and whatever would still pass is held back at its end. Nothing here is in a snapshot: pairs depend on
//! positions and velocities alone.
//!
//!   C = n . Σ w_i x_i - thickness >= 0,   dx_i = m_i^-1 w_i n max(0, -C)/Σ_j m_j^-1 w_j²            (positions.4)

use super::Dynamics;
use super::corners::Corners;
use super::tear::Tear;
use crate::geometry::mesh_contact::{Detector, Owner, Pair, Topology, crossed, tangled, untangle_directions};
use crate::geometry::{Collider, Friction, Vector};
use crate::math::{Real, Row, Vec3, axpy, row, sub, xyz, xyz64};
use crate::state::{Object, State};
use std::sync::Arc;
use tumble_interface::scene::SelfContact;
use tumble_interface::warning::{Code, Warning};

/// Pairs are looked for along the ways that vertices are about to go, within the thickness and this many times the way of the fastest
/// one in a sub-step: elements turn vertices off their ways.
const ASIDE: f64 = 0.5;
/// That reach over the thickness, at least and at most.
const REACH: (f64, f64) = (1.5, 8.0);
/// Rounds in which a bad start, or what the fastest have passed, is untangled before each exchange interval; and in which pairs are pushed apart
/// after a step of a scheme that has no sweeps.
const ROUNDS: usize = 4;
/// Rounds in which what starts too near is parted.
const PARTINGS: usize = 16;

/// Surfaces of a system, and who is near whom.
pub struct Layers {
    topology: Topology,
    detector: Detector,
    friction: Friction,
    thickness: f64,
    sewn: Vec<[u32; 2]>,
    /// Places at the start, for surfaces that tear.
    rest: Vec<Row>,
    /// Where vertices are about to go in a sub-step [m].
    ways: Vec<Vector>,
    /// Solids that they meet, too.
    corners: Corners,
}

/// What passes through each other.
pub struct Crossing {
    /// How many edges pass through triangles.
    pub count: usize,
    /// Of the first two: the vertices of the soft one, or of the edge.
    pub vertices: Vec<u32>,
    /// And the other one.
    pub other: Other,
}

/// What something soft passes through.
pub enum Other {
    /// Something soft, with this vertex.
    Soft(u32),
    /// This collider.
    Solid(String),
}

impl Layers {
    /// All triangles and curves of the objects, and those of solids that have edges; `sewn` points count as one. `None` if there is
    /// nothing that could meet.
    pub fn new(
        words: &SelfContact,
        objects: &[Object],
        sewn: impl Iterator<Item = [u32; 2]>,
        state: &State,
        colliders: &Arc<Vec<Collider>>,
    ) -> Option<Self> {
        let points = objects.iter().map(|o| o.points.end).max()?;
        let corners = Corners::new(colliders, points);
        let mut layers = Self {
            topology: Topology::default(),
            detector: Detector::new(),
            friction: Friction { sliding: words.friction, resting: words.friction_static.unwrap_or(words.friction) },
            thickness: words.thickness,
            sewn: sewn.collect(),
            rest: corners.joined(&state.x, 0.0).into_owned(),
            ways: Vec::new(),
            corners,
        };
        layers.rest.truncate(layers.corners.vertices());
        layers.topology = layers.meeting(objects, &[]);
        let soft = layers.topology.points().first().is_some_and(|i| (*i as usize) < points);
        soft.then_some(layers)
    }

    /// The longest edge of what is soft, where it starts [m].
    pub fn longest_edge(&self) -> f64 {
        let soft = |e: &&[u32; 2]| (e[0].max(e[1]) as usize) < self.corners.points();
        let length = |[a, b]: &[u32; 2]| (xyz64(self.rest[*a as usize]) - xyz64(self.rest[*b as usize])).norm();
        self.topology.edges().iter().filter(soft).map(length).fold(0.0, f64::max)
    }

    /// Takes up what has torn.
    pub fn renew(&mut self, objects: &[Object], tears: &[Tear]) {
        self.topology = self.meeting(objects, tears);
        self.detector = Detector::new();
    }

    /// What can meet. Copies of a vertex count as one where features that share it are told from others: both sides of a tear start
    /// from the same place.
    fn meeting(&self, objects: &[Object], tears: &[Tear]) -> Topology {
        let vertices = self.rest.len();
        let mut topology = Topology::new(vertices);
        for (index, object) in objects.iter().enumerate().filter(|(_, o)| o.stream.is_none()) {
            let first = object.points.start as u32;
            let torn = tears.iter().find(|tear| tear.object() == index);
            let whole = || object.triangles.iter().map(|t| t.map(|i| i + first)).collect();
            let triangles: Vec<[u32; 3]> = torn.map_or_else(whole, |tear| tear.triangles().to_vec());
            let strand = if object.curve_points > 0 { object.curve_points as usize } else { object.curve.len().max(1) };
            let strands = object.curve.chunks(strand);
            let segments: Vec<[u32; 2]> = strands.flat_map(|s| s.windows(2)).map(|c| [c[0] + first, c[1] + first]).collect();
            topology.add(Owner { radius: 0.5 * self.thickness, itself: true }, &triangles, &segments, &[]);
        }
        self.sewn.iter().for_each(|[a, b]| topology.weld(*a, *b));
        let mut rest = self.rest.clone();
        for [copy, of] in tears.iter().flat_map(|tear| tear.copies()) {
            topology.weld(copy, of);
            rest[copy as usize] = self.rest[of as usize];
        }
        self.corners.add_to(&mut topology, self.thickness);
        // Corners weigh nothing, as what is held.
        (0..vertices).filter(|i| rest[*i][3] == 0.0).for_each(|i| topology.fix(i as u32, true));
        topology.set_rest(&rest);
        topology
    }

    /// Edges that pass through triangles, when points are at x at time t; `None` where there are no triangles.
    pub fn intersections(&self, x: &[Row], t: f64) -> Option<u64> {
        let any = !self.topology.triangles().is_empty();
        any.then(|| crossed(&self.topology, &self.corners.joined(x, t)).0 as u64)
    }

    /// What passes through each other.
    pub fn crossing(&self, x: &[Row], t: f64) -> Option<Crossing> {
        let (count, first) = crossed(&self.topology, &self.corners.joined(x, t));
        let (edge, triangle) = first?;
        let (edge, triangle) = (self.topology.edges()[edge as usize], self.topology.triangles()[triangle as usize]);
        let solid = |vertices: &[u32]| Some(self.corners.name(self.corners.collider(vertices)?));
        let (vertices, other) = match (solid(&edge), solid(&triangle)) {
            (Some(name), _) => (triangle.to_vec(), Other::Solid(name)),
            (_, Some(name)) => (edge.to_vec(), Other::Solid(name)),
            _ => (edge.to_vec(), Other::Soft(triangle[0])),
        };
        Some(Crossing { count, vertices, other })
    }

    /// How many edges pass through triangles at the start, what the first two are, and where [m]; `None` if there are none.
    fn tangles(&self, objects: &[Object], x: &[Row]) -> Option<(usize, [String; 2], Vector)> {
        let Crossing { count, vertices, other } = self.crossing(x, 0.0)?;
        let place = vertices.iter().fold(Vector::default(), |sum, i| sum + xyz64(x[*i as usize])) * (1.0 / vertices.len() as f64);
        let other = match other {
            Other::Soft(vertex) => self.name(objects, vertex)?,
            Other::Solid(name) => name,
        };
        Some((count, [self.name(objects, vertices[0])?, other], place))
    }

    /// What a vertex belongs to.
    fn name(&self, objects: &[Object], vertex: u32) -> Option<String> {
        let soft = || objects.iter().find(|o| o.points.contains(&(vertex as usize))).map(|o| o.name.clone());
        self.corners.collider(&[vertex]).map(|i| self.corners.name(i)).or_else(soft)
    }

    /// Parts what is nearer than its thickness, all at rest: a push within a step would be a speed.
    fn part(&mut self, x: &mut [Row], corners: &Corners) {
        let thickness = self.topology.largest_thickness();
        for _ in 0..PARTINGS {
            self.detector.detect(&self.topology, x, REACH.0 * thickness);
            let start = x.to_vec();
            let pairs = self.detector.pairs().iter().filter(|pair| !corners.is_mass(pair));
            pairs.for_each(|pair| push(pair, Friction::default(), x, |i| start[i]));
            self.detector.hold(&self.topology, x);
            if *x == start[..] {
                break;
            }
        }
    }

    /// How many vertices that could move lie exactly where others do, whose objects the first two are, and where [m]; `None` if none do.
    fn twins(&self, objects: &[Object], x: &[Row]) -> Option<(usize, [String; 2], Vector)> {
        let x = &*self.corners.joined(x, 0.0);
        let mut points = self.topology.points().to_vec();
        let place = |i: u32| [0, 1, 2].map(|k| (x[i as usize][k] + 0.0).to_bits());
        points.sort_unstable_by_key(|i| (place(*i), *i));
        let free = |i: u32| x[i as usize][3] > 0.0;
        let same = |two: &[u32]| place(two[0]) == place(two[1]) && (free(two[0]) || free(two[1])) && self.topology.meet([two[0]], [two[1]]);
        let twins: Vec<&[u32]> = points.windows(2).filter(|two| same(two)).collect();
        let first = *twins.first()?;
        Some((twins.len(), [self.name(objects, first[0])?, self.name(objects, first[1])?], xyz64(x[first[0] as usize])))
    }

    /// Untangles what has passed, before an interval; what is still tangled, or `inside` a solid, is left alone until it is out.
    fn untangle(&mut self, x: &mut [Row], inside: &[bool]) {
        for round in 0..=ROUNDS {
            let crossings = self.detector.intersections(&self.topology, x);
            let mut loose = if crossings.is_empty() { Vec::new() } else { tangled(&self.topology, &crossings, 1) };
            loose.resize(loose.len().max(inside.len()), false);
            loose.iter_mut().zip(inside).for_each(|(loose, inside)| *loose |= inside);
            self.detector.set_loose(loose);
            if crossings.is_empty() || round == ROUNDS {
                break;
            }
            let step = 0.5 * self.topology.largest_thickness();
            let ways = untangle_directions(&self.topology, x, &crossings, step);
            for (x, way) in x.iter_mut().zip(ways) {
                *x = axpy(*x, 1.0, row(Vec3 { x: way.x as Real, y: way.y as Real, z: way.z as Real }, 0.0));
            }
        }
    }
}

impl Dynamics {
    /// Surfaces that pass through each other as they are, or lie in each other, as a sentence with the place; `None` if none do, or may.
    pub fn tangles(&self) -> Option<Warning> {
        let layers = self.layers.as_ref()?;
        let told = |(n, [one, other], place): (usize, [String; 2], Vector), passing: bool| {
            let other = if one == other { "itself".to_string() } else { format!("\"{other}\"") };
            let place = <[f64; 3]>::from(place).map(|x| format!("{x:.4}")).join(", ");
            let message = if passing {
                format!(
                    "{n} edges pass through triangles at the start; at [{place}] \"{one}\" passes through {other}. They are pushed out as \
                     far as that succeeds; move one of them so that none passes"
                )
            } else {
                format!(
                    "{n} vertices lie exactly where others do; at [{place}] \"{one}\" lies in {other}. Nothing tells which side each belongs \
                     to, so that they stay in each other: move one of them by a little"
                )
            };
            Warning::new(Code::TangledStart, format!("system \"{}\"", self.name), message)
        };
        let passing = layers.tangles(&self.objects, &self.state.x).map(|found| told(found, true));
        passing.or_else(|| layers.twins(&self.objects, &self.state.x).map(|found| told(found, false)))
    }

    /// Before an interval from t on: what is tangled, and at the start what is too near.
    pub(super) fn untangle(&mut self, t: f64) {
        let Some(layers) = &mut self.layers else { return };
        let mut corners = std::mem::take(&mut layers.corners);
        self.unclamped.clone_from(&self.state.x);
        corners.place(t, 0.0);
        corners.with_end(&mut self.state.x, |corners, x| {
            let inside = corners.inside(&layers.topology, x, t);
            layers.untangle(x, &inside);
            if t == 0.0 {
                corners.lift(&layers.topology, x, t);
                layers.part(x, corners);
            }
        });
        layers.corners = corners;
        // What has been moved has another past.
        self.memory.ready &= self.state.x == self.unclamped;
    }

    /// Before a sub-step from t on of length h [s]: who is near whom.
    pub(super) fn find_pairs(&mut self, t: f64, h: f64) {
        let Some(layers) = &mut self.layers else { return };
        let n = layers.corners.points();
        let gravity = Vector::from(self.laws.gravity) * h;
        let (x, v) = (&self.state.x[..n], &self.state.v[..n]);
        layers.ways.clear();
        layers.ways.extend(x.iter().zip(v).map(|(x, v)| (xyz64(*v) + if x[3] > 0.0 { gravity } else { Vector::default() }) * h));
        layers.corners.place(t, h);
        layers.ways.extend(layers.corners.ways());
        let farthest = layers.ways.iter().map(|w| w.norm_sq()).fold(0.0, f64::max).sqrt();
        let thickness = layers.topology.largest_thickness();
        let reach = (thickness + ASIDE * farthest).clamp(REACH.0 * thickness, REACH.1 * thickness);
        layers.detector.detect_along(&layers.topology, &layers.corners.at_start(x), &layers.ways, reach);
        layers.corners.run_belts(t, h);
    }

    /// The step [s] in which those that are about to meet in h [s] go half of their thickness past each other; infinite if none are.
    /// (contact.21)
    pub(super) fn longest_among_pairs(&self, h: f64) -> f64 {
        let Some(layers) = &self.layers else { return f64::INFINITY };
        let passing = |pair: &Pair| {
            let parts = pair.vertices.iter().zip(pair.weights);
            let way = parts.fold(Vector::default(), |sum, (v, w)| sum + layers.ways[*v as usize] * f64::from(w));
            way.norm() / f64::from(pair.thickness)
        };
        0.5 * h / layers.detector.pairs().iter().map(passing).fold(0.0, f64::max)
    }

    /// In a sweep: pushes pairs apart that are too near, with friction on what they slide in the sub-step.
    pub(super) fn push_apart(&mut self) {
        let Some(Layers { detector, friction, corners, .. }) = &mut self.layers else { return };
        let (before, points) = (&self.before, corners.points());
        corners.with_end(&mut self.state.x, |corners, x| {
            for pair in detector.pairs().iter().filter(|pair| !corners.is_mass(pair)) {
                let friction = corners.friction(pair).unwrap_or(*friction);
                push(pair, friction, x, |i| if i < points { before[i] } else { corners.start[i - points] });
            }
        });
    }

    /// After a step from t on of length h [s] of a scheme without sweeps: pushes pairs apart. Velocities change by as much as positions in h.
    pub(super) fn part_layers(&mut self, t: f64, h: f64) {
        let Some(layers) = &mut self.layers else { return };
        // The step may be shorter than the one for which pairs were looked for.
        layers.corners.place(t, h);
        layers.corners.run_belts(t, h);
        self.unclamped.clone_from(&self.state.x);
        (0..ROUNDS).for_each(|_| self.push_apart());
        self.take_along(h);
    }

    /// Velocities follow what has moved away from `unclamped`.
    fn take_along(&mut self, h: f64) {
        let Some(layers) = &self.layers else { return };
        let inverse_h = (1.0 / h) as Real;
        for ((x, old), v) in self.state.x.iter().zip(&self.unclamped).zip(&mut self.state.v).take(layers.corners.points()) {
            let change = sub(*x, *old);
            if change[..3] != [0.0; 3] && x[3] > 0.0 {
                *v = axpy(*v, inverse_h, [change[0], change[1], change[2], 0.0]);
                self.memory.ready = false;
            }
        }
    }

    /// After a sub-step of length h [s]: holds back what would pass through something.
    pub(super) fn hold_layers(&mut self, h: f64) {
        let Some(layers) = &mut self.layers else { return };
        self.unclamped.clone_from(&self.state.x);
        let (topology, detector) = (&layers.topology, &mut layers.detector);
        let held = layers.corners.with_end(&mut self.state.x, |_, x| detector.hold(topology, x).held);
        if held > 0 {
            self.take_along(h);
        }
    }
}

/// Projects one pair.
fn push(pair: &Pair, friction: Friction, x: &mut [Row], before: impl Fn(usize) -> Row) {
    let at = pair.vertices.map(|v| v as usize);
    let n = Vec3::from(pair.normal);
    let (mut d, mut weight) = (n * 0.0, 0.0);
    for k in 0..4 {
        d = d + xyz(x[at[k]]) * pair.weights[k];
        weight += x[at[k]][3] * pair.weights[k] * pair.weights[k];
    }
    let depth = pair.thickness - n.dot(d);
    if !(depth > 0.0 && weight > 0.0) {
        return;
    }
    let mut slid = d;
    for k in 0..4 {
        slid = slid - xyz(before(at[k])) * pair.weights[k];
    }
    let slid = slid - n * n.dot(slid);
    // All or a part of the way; the bits of one coefficient are those of its product with the depth.
    let (way, most) = (slid.norm(), friction.sliding as Real * depth);
    let back = if way > friction.resting as Real * depth && way > most { slid * (most / way) } else { slid };
    let push = (n * depth - back) * (1.0 / weight);
    for k in 0..4 {
        let i = at[k];
        x[i] = axpy(x[i], x[i][3] * pair.weights[k], row(push, 0.0));
    }
}
