//! Soft surfaces keep off themselves and each other: pairs of near features are found at the start of a sub-step, projected like any
//! other constraint with friction, and whatever would still pass is held back at its end. Nothing here is in a snapshot: pairs depend on
//! positions and velocities alone.
//!
//!   C = n . Σ w_i x_i - thickness >= 0,   dx_i = m_i^-1 w_i n max(0, -C)/Σ_j m_j^-1 w_j²            (positions.4)

use super::core::Core;
use super::feature::{Feature, Span};
use super::solid_features::SolidFeatures;
use super::tear::Tear;
use crate::geometry::mesh_contact::{Detector, Owner, Pair, Topology, common_ways, crossed, tangled, untangle_directions};
use crate::geometry::{Collider, Friction, Vector};
use crate::math::{Real, Row, Vec3, axpy, row, sub, xyz, xyz64};
use crate::state::{Object, State};
use std::ops::Range;
use std::sync::Arc;
use tumble_interface::engine::StepReport;
use tumble_interface::scene;
use tumble_interface::warning::{Code, Warning};

/// Pairs are looked for along the ways that vertices are about to go, within the thickness and this many times the way of the fastest
/// one in a sub-step, beside what it has in common with all near it: elements turn vertices off their ways.
const ASIDE: f64 = 0.5;
/// That reach over the thickness, at least and at most.
const REACH: (f64, f64) = (1.5, 8.0);
/// Rounds in which a bad start, or a passage of the fastest, is untangled before each exchange interval; and in which pairs are pushed
/// apart after a step of a scheme that has no sweeps.
const ROUNDS: usize = 4;
/// Rounds in which surfaces that start too near are separated.
const SEPARATIONS: usize = 16;

/// Surfaces of a system, and the pairs of features that are near each other.
pub struct SelfContact {
    topology: Topology,
    detector: Detector,
    friction: Friction,
    thickness: f64,
    sewn: Vec<[u32; 2]>,
    /// Points of each object that meets others, and the corners of solids.
    parts: Vec<Range<usize>>,
    /// Places at the start, for surfaces that tear.
    rest: Vec<Row>,
    /// Displacements of vertices predicted for a sub-step [m].
    ways: Vec<Vector>,
    /// Positions before they are corrected; scratch.
    old: Vec<Row>,
    /// Solids that they meet, too.
    features: SolidFeatures,
}

/// An intersection of surfaces.
pub struct Crossing {
    /// How many edges pass through triangles.
    pub count: usize,
    /// Of the first two: the vertices of the soft one, or of the edge.
    pub vertices: Vec<u32>,
    /// And the other one.
    pub other: Other,
}

/// The other part of an intersection, beside a soft one.
pub enum Other {
    /// Something soft, with this vertex.
    Soft(u32),
    /// This collider.
    Solid(String),
}

impl SelfContact {
    /// All triangles and curves of the objects, and those of solids that have edges; `sewn` points count as one. `None` if there is
    /// nothing that could meet.
    pub fn new(
        words: &scene::SelfContact,
        objects: &[Object],
        sewn: &[[u32; 2]],
        state: &State,
        colliders: &Arc<Vec<Collider>>,
    ) -> Option<Self> {
        let points = objects.iter().map(|o| o.points.end).max()?;
        let features = SolidFeatures::new(colliders, points);
        let mut contact = Self {
            topology: Topology::default(),
            detector: Detector::new(),
            friction: Friction { sliding: words.friction, resting: words.friction_static.unwrap_or(words.friction) },
            thickness: words.thickness,
            sewn: sewn.to_vec(),
            parts: objects.iter().filter(|o| o.stream.is_none()).map(|o| o.points.clone()).collect(),
            rest: features.joined(&state.x, 0.0).into_owned(),
            ways: Vec::new(),
            old: Vec::new(),
            features,
        };
        contact.rest.truncate(contact.features.vertices());
        contact.parts.push(points..contact.features.vertices());
        contact.topology = contact.meeting(objects, &[]);
        // Hair alone meets nothing but the edges of solids.
        let meets = contact.features.vertices() > points || objects.iter().any(|o| o.curve_points == 0 && o.stream.is_none());
        let soft = contact.topology.points().first().is_some_and(|i| (*i as usize) < points);
        (soft && meets).then_some(contact)
    }

    /// Takes the solids anew.
    pub fn take_surfaces(&mut self, colliders: &Arc<Vec<Collider>>) {
        self.features.take_surfaces(colliders);
    }

    /// The longest edge of soft surfaces at the start [m].
    pub fn longest_edge(&self) -> f64 {
        let soft = |e: &&[u32; 2]| (e[0].max(e[1]) as usize) < self.features.points();
        let length = |[a, b]: &[u32; 2]| (xyz64(self.rest[*a as usize]) - xyz64(self.rest[*b as usize])).norm();
        self.topology.edges().iter().filter(soft).map(length).fold(0.0, f64::max)
    }

    /// Follows surfaces that have torn.
    pub fn renew(&mut self, objects: &[Object], tears: &[Tear]) {
        self.topology = self.meeting(objects, tears);
        self.detector = Detector::new();
    }

    /// Features that can meet. Copies of a vertex count as one where features that share it are told from others: both sides of a tear start
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
            let owner = Owner { radius: 0.5 * self.thickness, itself: true, hair: object.curve_points > 0 };
            topology.add(owner, &triangles, &segments, &[]);
        }
        self.sewn.iter().for_each(|[a, b]| topology.weld(*a, *b));
        let mut rest = self.rest.clone();
        for [copy, of] in tears.iter().flat_map(|tear| tear.copies()) {
            topology.weld(copy, of);
            rest[copy as usize] = self.rest[of as usize];
        }
        self.features.add_to(&mut topology, self.thickness);
        // Solid features weigh nothing, as held points.
        (0..vertices).filter(|i| rest[*i][3] == 0.0).for_each(|i| topology.fix(i as u32, true));
        topology.set_rest(&rest);
        topology
    }

    /// Edges that pass through triangles, when points are at x at time t; `None` where there are no triangles.
    pub fn intersections(&self, x: &[Row], t: f64) -> Option<u64> {
        let any = !self.topology.triangles().is_empty();
        any.then(|| crossed(&self.topology, &self.features.joined(x, t)).0 as u64)
    }

    /// The first intersection, and the count of all.
    pub fn crossing(&self, x: &[Row], t: f64) -> Option<Crossing> {
        let (count, first) = crossed(&self.topology, &self.features.joined(x, t));
        let (edge, triangle) = first?;
        let (edge, triangle) = (self.topology.edges()[edge as usize], self.topology.triangles()[triangle as usize]);
        let solid = |vertices: &[u32]| Some(self.features.name(self.features.collider(vertices)?));
        let (vertices, other) = match (solid(&edge), solid(&triangle)) {
            (Some(name), _) => (triangle.to_vec(), Other::Solid(name)),
            (_, Some(name)) => (edge.to_vec(), Other::Solid(name)),
            _ => (edge.to_vec(), Other::Soft(triangle[0])),
        };
        Some(Crossing { count, vertices, other })
    }

    /// The number of edges that pass through triangles at the start, the objects of the first, and its place [m]; `None` if there are none.
    fn tangles(&self, objects: &[Object], x: &[Row]) -> Option<(usize, [String; 2], Vector)> {
        let Crossing { count, vertices, other } = self.crossing(x, 0.0)?;
        let place = vertices.iter().fold(Vector::default(), |sum, i| sum + xyz64(x[*i as usize])) * (1.0 / vertices.len() as f64);
        let other = match other {
            Other::Soft(vertex) => self.name(objects, vertex)?,
            Other::Solid(name) => name,
        };
        Some((count, [self.name(objects, vertices[0])?, other], place))
    }

    /// The object or solid of a vertex.
    fn name(&self, objects: &[Object], vertex: u32) -> Option<String> {
        let soft = || objects.iter().find(|o| o.points.contains(&(vertex as usize))).map(|o| o.name.clone());
        self.features.collider(&[vertex]).map(|i| self.features.name(i)).or_else(soft)
    }

    /// Separates surfaces nearer than their thickness, all at rest: a push within a step would be a speed.
    fn separate(&mut self, x: &mut [Row], features: &SolidFeatures) {
        let thickness = self.topology.largest_thickness();
        for _ in 0..SEPARATIONS {
            self.detector.detect(&self.topology, x, REACH.0 * thickness);
            let start = x.to_vec();
            let pairs = self.detector.pairs().iter().filter(|pair| !features.is_mass(pair));
            pairs.for_each(|pair| push(pair, Friction::default(), x, |i| start[i]));
            self.detector.hold(&self.topology, x);
            if *x == start[..] {
                break;
            }
        }
    }

    /// The number of vertices that could move and lie exactly where others do, the objects of the first, and its place [m]; `None` if none do.
    fn coincident_vertices(&self, objects: &[Object], x: &[Row]) -> Option<(usize, [String; 2], Vector)> {
        let x = &*self.features.joined(x, 0.0);
        let mut points = self.topology.points().to_vec();
        let place = |i: u32| [0, 1, 2].map(|k| (x[i as usize][k] + 0.0).to_bits());
        points.sort_unstable_by_key(|i| (place(*i), *i));
        let free = |i: u32| x[i as usize][3] > 0.0;
        let same = |two: &[u32]| place(two[0]) == place(two[1]) && (free(two[0]) || free(two[1])) && self.topology.meet([two[0]], [two[1]]);
        let coincident: Vec<&[u32]> = points.windows(2).filter(|two| same(two)).collect();
        let first = *coincident.first()?;
        Some((coincident.len(), [self.name(objects, first[0])?, self.name(objects, first[1])?], xyz64(x[first[0] as usize])))
    }

    /// Untangles surfaces that have passed; those still tangled, or `inside` a solid, are left alone until they are out.
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

impl SelfContact {
    /// Surfaces that pass through each other as they are, or lie in each other, as a sentence with the place; `None` if none do, or may.
    pub fn tangled_start(&self, core: &Core) -> Option<Warning> {
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
            Warning::new(Code::TangledStart, format!("system \"{}\"", core.name), message)
        };
        let passing = self.tangles(&core.objects, &core.state.x).map(|found| told(found, true));
        passing.or_else(|| self.coincident_vertices(&core.objects, &core.state.x).map(|found| told(found, false)))
    }

    /// The step [s] in which pairs that are about to meet in h [s] go half of their thickness past each other; infinite if none are.
    /// (contact.21)
    pub fn longest_step(&self, h: f64) -> f64 {
        let passing = |pair: &Pair| {
            let parts = pair.vertices.iter().zip(pair.weights);
            let way = parts.fold(Vector::default(), |sum, (v, w)| sum + self.ways[*v as usize] * f64::from(w));
            way.norm() / f64::from(pair.thickness)
        };
        0.5 * h / self.detector.pairs().iter().map(passing).fold(0.0, f64::max)
    }

    /// Velocities follow the changes of positions since `old`; says whether there were any.
    fn carry_velocities(&self, State { x, v }: &mut State, h: f64) -> bool {
        let (inverse_h, mut moved) = ((1.0 / h) as Real, false);
        for ((x, old), v) in x.iter().zip(&self.old).zip(v).take(self.features.points()) {
            let change = sub(*x, *old);
            if change[..3] != [0.0; 3] && x[3] > 0.0 {
                *v = axpy(*v, inverse_h, [change[0], change[1], change[2], 0.0]);
                moved = true;
            }
        }
        moved
    }
}

impl Feature for SelfContact {
    /// Untangles surfaces and, at the start of a run, separates those that are too near.
    fn begin(&mut self, core: &mut Core, t: f64) {
        let mut features = std::mem::take(&mut self.features);
        self.old.clone_from(&core.state.x);
        features.place(Span { t, h: 0.0 });
        features.with_end(&mut core.state.x, |features, x| {
            let inside = features.inside(&self.topology, x, t);
            self.untangle(x, &inside);
            if t == 0.0 {
                features.lift(&self.topology, x, t);
                self.separate(x, features);
            }
        });
        self.features = features;
        // Points that have been moved have another past.
        core.memory.ready &= core.state.x == self.old;
    }

    /// Finds pairs of near features.
    fn before(&mut self, core: &mut Core, step: Span) {
        let n = self.features.points();
        let gravity = Vector::from(core.laws.gravity.at(step.t)) * step.h;
        let (x, v) = (&core.state.x[..n], &core.state.v[..n]);
        self.ways.clear();
        self.ways.extend(x.iter().zip(v).map(|(x, v)| (xyz64(*v) + if x[3] > 0.0 { gravity } else { Vector::default() }) * step.h));
        self.features.place(step);
        self.ways.extend(self.features.ways());
        let thickness = self.topology.largest_thickness();
        let start = self.features.at_start(x);
        // What is no part of a feature, as spare vertices of what tears, goes with none.
        let points = self.topology.points();
        let from = |v: usize| points.partition_point(|p| (*p as usize) < v);
        let parts: Vec<&[u32]> = self.parts.iter().map(|part| &points[from(part.start)..from(part.end)]).collect();
        let common =
            common_ways(&parts, &start, &self.ways, REACH.1 * thickness, &|centre, radius| self.features.are_near(centre, radius, step));
        let beside = |v: usize| (self.ways[v] - common.get(v).copied().unwrap_or_default()).norm_sq();
        let farthest = points.iter().map(|v| beside(*v as usize)).fold(0.0, f64::max).sqrt();
        let reach = (thickness + ASIDE * farthest).clamp(REACH.0 * thickness, REACH.1 * thickness);
        self.detector.detect_along(&self.topology, &start, &self.ways, &common, reach);
        self.features.run_belts(step);
    }

    /// Pushes pairs apart that are too near, with friction on their slide in the sub-step.
    fn sweep(&mut self, core: &mut Core) {
        let Self { detector, friction, features, .. } = self;
        let (before, points) = (&core.before, features.points());
        features.with_end(&mut core.state.x, |features, x| {
            for pair in detector.pairs().iter().filter(|pair| !features.is_mass(pair)) {
                let friction = features.friction(pair).unwrap_or(*friction);
                push(pair, friction, x, |i| if i < points { before[i] } else { features.start[i - points] });
            }
        });
    }

    /// Pushes pairs apart; velocities change by as much as positions in the sub-step.
    fn relax(&mut self, core: &mut Core, step: Span) {
        // The step may be shorter than the one for which pairs were looked for.
        self.features.place(step);
        self.features.run_belts(step);
        self.old.clone_from(&core.state.x);
        (0..ROUNDS).for_each(|_| self.sweep(core));
        core.memory.ready &= !self.carry_velocities(&mut core.state, step.h);
    }

    /// Holds back whatever would pass through something.
    fn after(&mut self, core: &mut Core, step: Span, _: &mut StepReport) {
        self.old.clone_from(&core.state.x);
        let (topology, detector) = (&self.topology, &mut self.detector);
        let held = self.features.with_end(&mut core.state.x, |_, x| detector.hold(topology, x).held);
        if held > 0 {
            core.memory.ready &= !self.carry_velocities(&mut core.state, step.h);
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
