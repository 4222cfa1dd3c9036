//! Solids in a fluid: faces that are open in part.
//!
//!   D u = sum over faces of (w u + (1 - w) v)                                                       (gas.10)
//!
//! w is the open share of a face, found from the signed distance at its corners, v the velocity of the solid. Beyond a surface a
//! velocity is that of the image in it, with its part across (free slip) or all of it (no slip) reversed as seen from the solid,
//! and what is carried is that of the image (gas.11).
//!
//! A wall through which a cell would reach counts as thicker, to both sides alike, so that it lets nothing through wherever it lies
//! (gas.19).
//!
//! Source: [ng2009]. Degenerate: bars of meshes thinner than that obstruct like thicker ones; a solid that leaves a periodic box does not come back on the other side.
//! Tests: crates/tumble-f64/tests/solids.rs.

use super::immersed::Immersed;
use super::rows::{Face, beside};
use super::sides::Beyond;
use crate::geometry::{Collider, Shape, Vector};
use crate::linalg::poisson::{Joint, Weight, byte};
use crate::math::Real;
use crate::math::parallel::{self, Tasks};
use crate::operators::Spot;
use crate::state::{Field, Grid, Place, Vectors};
use std::sync::Arc;
use tumble_interface::Column;

/// Nodes along the edges of a block that one distance may settle.
const BLOCK: usize = 8;
/// How deep in a solid velocities and what is carried are known [cells].
const DEPTH: f64 = 2.5;
/// The least thickness of a wall, in widths of a cell along its normal: from no side a stencil of eight cells reaches past its middle.
const WALL: f64 = 2.0;
/// How often images are read: those close to the surface read each other.
const PASSES: usize = 4;
/// Distance of a point from a surface [m], the direction away from it, and its velocity [m/s].
type Near = (f64, Vector, Vector);

/// No cell.
const NONE: u32 = u32::MAX;

/// A face that is not wholly open, beside a cell with fluid.
struct Cut {
    axis: usize,
    at: u32,
    cells: [u32; 2],
    shut: Real,
    solid: u32,
    velocity: Real,
}

/// A face that no fluid passes.
struct Closed {
    at: u32,
    solid: u32,
    velocity: Real,
}

/// A closed face near the surface.
struct Ghost {
    axis: usize,
    at: u32,
    image: [Spot; 3],
    normal: [Real; 3],
    solid: u32,
    velocity: [Real; 3],
}

/// Lists of one plane of cells or faces.
#[derive(Default)]
struct Found {
    cuts: Vec<Cut>,
    closed: [Vec<Closed>; 3],
    ghosts: Vec<Ghost>,
    dead: Vec<(u32, u32)>,
    shades: Vec<(u32, Spot)>,
}

/// Solids in the box of a fluid.
pub struct Solids {
    colliders: Arc<Vec<Collider>>,
    /// Solids that the fluid moves, counted after the colliders.
    pub bodies: Vec<Immersed>,
    stick: bool,
    grid: Grid,
    /// Sides of the box that are held.
    held: [[bool; 2]; 3],
    /// When they are here [s].
    pub time: f64,
    nodes: Vec<Real>,
    /// Open shares of the lower faces of all cells.
    pub open: [Vec<u8>; 3],
    cuts: Vec<Cut>,
    closed: [Vec<Closed>; 3],
    ghosts: Vec<Ghost>,
    /// Their values before the forces.
    kept: Vec<Real>,
    dead: Vec<(u32, u32)>,
    shades: Vec<(u32, Spot)>,
}

impl Cut {
    /// Cells whose pressure pushes the solid along the axis, and by which share of a face.
    fn pushes(&self) -> impl Iterator<Item = (u32, Real)> {
        [(self.cells[0], self.shut), (self.cells[1], -self.shut)].into_iter().filter(|(cell, _)| *cell != NONE)
    }
}

/// The open share of the edge between two distances.
fn part(a: f64, b: f64) -> f64 {
    match (a > 0.0, b > 0.0) {
        (true, true) => 1.0,
        (false, false) => 0.0,
        (true, false) => a / (a - b),
        (false, true) => b / (b - a),
    }
}

/// The open share of a square, from the distances at its corners, in turn.                               (gas.10)
fn share(d: [f64; 4]) -> f64 {
    if d.iter().all(|d| *d > 0.0) {
        return 1.0;
    }
    if d.iter().all(|d| *d <= 0.0) {
        return 0.0;
    }
    const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut outline = [[0.0; 2]; 8];
    let mut n = 0;
    for i in 0..4 {
        let j = (i + 1) % 4;
        if d[i] > 0.0 {
            outline[n] = CORNERS[i];
            n += 1;
        }
        if (d[i] > 0.0) != (d[j] > 0.0) {
            let t = d[i] / (d[i] - d[j]);
            outline[n] = [0, 1].map(|c| CORNERS[i][c] + t * (CORNERS[j][c] - CORNERS[i][c]));
            n += 1;
        }
    }
    let twice: f64 = (0..n)
        .map(|i| {
            let (a, b) = (outline[i], outline[(i + 1) % n]);
            a[0] * b[1] - a[1] * b[0]
        })
        .sum();
    0.5 * twice
}

impl Solids {
    /// These colliders and bodies in a box; fluid sticks to them or slips along them.
    pub fn new(colliders: Arc<Vec<Collider>>, bodies: Vec<Immersed>, stick: bool, grid: Grid, sides: &[[Beyond; 2]; 3]) -> Self {
        let len = grid.lattice().len();
        let held = std::array::from_fn(|a| [0, 1].map(|end| grid.flat == Some(a) || sides[a][end].is_held()));
        Self {
            colliders,
            bodies,
            stick,
            grid,
            held,
            time: f64::NAN,
            nodes: vec![0.0; len],
            open: [(); 3].map(|()| vec![u8::OPEN; len]),
            cuts: Vec::new(),
            closed: Default::default(),
            ghosts: Vec::new(),
            kept: Vec::new(),
            dead: Vec::new(),
            shades: Vec::new(),
        }
    }

    /// Takes the colliders anew; says whether they are others.
    pub fn take_surfaces(&mut self, colliders: &Arc<Vec<Collider>>) -> bool {
        let others = !Arc::ptr_eq(&self.colliders, colliders);
        if others {
            self.colliders = colliders.clone();
            self.place(self.time);
        }
        others
    }

    /// Names of the colliders, then those of what the bodies belong to.
    pub fn names(&self) -> impl Iterator<Item = &String> {
        self.colliders.iter().map(|collider| &collider.name).chain(self.bodies.iter().map(Immersed::name))
    }

    /// Whether any of them moves.
    pub fn moves(&self) -> bool {
        !self.bodies.is_empty() || self.colliders.iter().any(Collider::moves)
    }

    /// Whether they leave the fluid alone.
    pub fn is_empty(&self) -> bool {
        self.cuts.is_empty() && self.dead.is_empty()
    }

    /// Whether they leave no cell to the fluid.
    pub fn fills(&self) -> bool {
        let cells: usize = self.grid.n.iter().product();
        self.dead.iter().map(|(_, n)| *n as usize).sum::<usize>() == cells
    }

    /// A point of the grid [m]; in the plane, in it.
    fn point(&self, place: Place, at: [usize; 3]) -> Vector {
        let mut x = self.grid.point(place, at);
        if let Some(axis) = self.grid.flat {
            x[axis] = self.grid.origin[axis];
        }
        x.into()
    }

    /// The nearest surface of a solid, no wall of it thinner than a cell needs; balls and capsules are none.                              (gas.19)
    fn thickened(&self, shape: &Shape, x: Vector, within: f64, surface: impl Fn(Vector, f64) -> Near) -> Near {
        let (d, n, v) = surface(x, within);
        let through: f64 = self.grid.axes().map(|a| <[f64; 3]>::from(n)[a].abs()).sum();
        let least = WALL * self.grid.dx * through;
        let round = matches!(shape, Shape::Sphere { .. } | Shape::Capsule { .. });
        if round || d.abs() > (DEPTH + 1.0) * self.grid.dx || least == 0.0 {
            return (d, n, v);
        }
        // As far behind the surface, the way back to the wall is what it lacks.
        let behind = surface(x - n * (d + least), least).0;
        (d - 0.5 * behind.max(0.0), n, v)
    }

    /// The nearest surface: whose, its distance [m], the direction away from it, its velocity [m/s].
    fn nearest(&self, x: Vector, t: f64, within: f64) -> (usize, f64, Vector, Vector) {
        let mut best = (0, f64::INFINITY, Vector::default(), Vector::default());
        for (i, collider) in self.colliders.iter().enumerate() {
            let (d, n, v) = self.thickened(&collider.shape, x, within, |x, within| collider.surface(x, t, within));
            if d < best.1 {
                best = (i, d, n, v);
            }
        }
        for (i, body) in self.bodies.iter().enumerate() {
            let (d, n, v) = self.thickened(&body.hull.solid.shape, x, within, |x, within| body.near(x, &self.grid, within));
            if d < best.1 {
                best = (self.colliders.len() + i, d, n, v);
            }
        }
        best
    }

    /// Puts them where they are at time t [s].
    pub fn place(&mut self, t: f64) {
        self.time = t;
        self.measure(t);
        self.weigh();
        let n = self.grid.n;
        let planes: Vec<Found> = parallel::map(n[2] + 1, |k| self.search(k, t));
        let Self { cuts, closed, ghosts, dead, shades, .. } = self;
        cuts.clear();
        ghosts.clear();
        dead.clear();
        shades.clear();
        closed.iter_mut().for_each(Vec::clear);
        for mut plane in planes {
            cuts.append(&mut plane.cuts);
            ghosts.append(&mut plane.ghosts);
            dead.append(&mut plane.dead);
            shades.append(&mut plane.shades);
            closed.iter_mut().zip(&mut plane.closed).for_each(|(all, more)| all.append(more));
        }
        self.list_faces();
    }

    /// Lists the faces of each body.
    fn list_faces(&mut self) {
        let (first, grid) = (self.colliders.len(), self.grid);
        let mut bodies = std::mem::take(&mut self.bodies);
        bodies.iter_mut().for_each(Immersed::leave);
        for cut in &self.cuts {
            let Some(body) = (cut.solid as usize).checked_sub(first).and_then(|i| bodies.get_mut(i)) else { continue };
            body.meet(cut.axis, self.face_point(cut.axis, cut.at), cut.pushes(), &grid);
        }
        bodies.iter_mut().for_each(Immersed::sort);
        self.bodies = bodies;
    }

    /// The centre of a face, by its number.
    fn face_point(&self, axis: usize, number: u32) -> Vector {
        self.point(Place::Face(axis), self.grid.lattice().place(number as usize))
    }

    /// Gives the faces of bodies their velocities.
    pub fn follow(&mut self) {
        let (first, grid) = (self.colliders.len(), self.grid);
        let (mut cuts, mut closed, mut ghosts) =
            (std::mem::take(&mut self.cuts), std::mem::take(&mut self.closed), std::mem::take(&mut self.ghosts));
        let of = |solid: u32, axis: usize, at: u32| -> Option<[f64; 3]> {
            let body = (solid as usize).checked_sub(first).and_then(|i| self.bodies.get(i))?;
            Some(body.velocity_at(self.face_point(axis, at), &grid).into())
        };
        for cut in &mut cuts {
            of(cut.solid, cut.axis, cut.at).iter().for_each(|v| cut.velocity = v[cut.axis] as Real);
        }
        for (axis, closed) in closed.iter_mut().enumerate() {
            closed.iter_mut().for_each(|face| of(face.solid, axis, face.at).iter().for_each(|v| face.velocity = v[axis] as Real));
        }
        for ghost in &mut ghosts {
            of(ghost.solid, ghost.axis, ghost.at).iter().for_each(|v| ghost.velocity = v.map(|v| v as Real));
        }
        (self.cuts, self.closed, self.ghosts) = (cuts, closed, ghosts);
    }

    /// Contribution of bodies to the pressure matrix of the cells that `has` says; `density` is that of the fluid [kg/m³].
    pub fn joints(&self, density: f64, has: impl Fn(u32) -> bool) -> Vec<Joint> {
        let mass = (0..self.grid.dimension()).fold(density, |m, _| m * self.grid.dx);
        self.bodies.iter().map(|body| body.joint(mass, &has)).collect()
    }

    /// The speed of the fastest body [m/s].
    pub fn fastest(&self) -> f64 {
        self.bodies.iter().map(|body| body.fastest(&self.grid)).fold(0.0, f64::max)
    }

    /// The largest component of the velocity of a solid across a face that it cuts [m/s].
    pub fn fastest_cut(&self) -> f64 {
        self.cuts.iter().map(|cut| f64::from(cut.velocity.abs())).fold(0.0, f64::max)
    }

    /// Signed distances at the nodes. Where all of a block is farther from the surface than its own size, one of them does for it.
    fn measure(&mut self, t: f64) {
        let (grid, l) = (self.grid, self.grid.lattice());
        let points: [usize; 3] = std::array::from_fn(|a| if grid.flat == Some(a) { 1 } else { grid.n[a] + 1 });
        let mut nodes = std::mem::take(&mut self.nodes);
        let (plane, first) = (l.stride[2], l.at(0, 0, 0) - l.stride[1]);
        let this = &*self;
        nodes[first..].chunks_mut(BLOCK * plane).enumerate().in_parallel(|(block, nodes)| {
            let from = block * BLOCK;
            for j0 in (0..points[1]).step_by(BLOCK) {
                for i0 in (0..points[0]).step_by(BLOCK) {
                    let low = [i0, j0, from];
                    let high: [usize; 3] = std::array::from_fn(|a| (low[a] + BLOCK).min(points[a]));
                    if low[2] >= high[2] {
                        continue;
                    }
                    let (a, b) = (this.point(Place::Node, low), this.point(Place::Node, high.map(|h| h - 1)));
                    let reach = 0.5 * (b - a).norm() + (DEPTH + 2.0) * grid.dx;
                    let middle = this.nearest((a + b) * 0.5, t, reach).1;
                    for k in low[2]..high[2] {
                        for j in low[1]..high[1] {
                            let row = (k - from) * plane + (j + 1) * l.stride[1];
                            for i in low[0]..high[0] {
                                nodes[row + i] = if middle.abs() >= reach {
                                    middle as Real
                                } else {
                                    this.nearest(this.point(Place::Node, [i, j, k]), t, 2.0 * reach).1 as Real
                                };
                            }
                        }
                    }
                }
            }
        });
        self.nodes = nodes;
    }

    /// The corners of a face in turn, as numbers from its own; twice the same edge in the plane.
    fn corners(&self, axis: usize) -> [usize; 4] {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let step = |a: usize| if self.grid.flat == Some(a) { 0 } else { self.grid.lattice().stride[a] };
        [0, step(b), step(b) + step(c), step(c)]
    }

    /// The open shares of all faces.
    fn weigh(&mut self) {
        let (grid, l) = (self.grid, self.grid.lattice());
        let mut open = std::mem::take(&mut self.open);
        for axis in grid.axes() {
            let points: [usize; 3] = std::array::from_fn(|a| grid.n[a] + usize::from(a == axis));
            let corners = self.corners(axis);
            let (plane, first) = (l.stride[2], l.at(0, 0, 0) - l.stride[1]);
            let nodes = &self.nodes;
            open[axis][first..].chunks_mut(plane).take(points[2]).enumerate().in_parallel(|(k, open)| {
                for j in 0..points[1] {
                    let at = l.at(0, j, k);
                    let row = &mut open[at - first - k * plane..][..points[0]];
                    for (i, open) in row.iter_mut().enumerate() {
                        let d = corners.map(|c| f64::from(nodes[at + i + c]));
                        *open = byte(match grid.flat {
                            None => share(d),
                            Some(_) => part(d[0], d[2]),
                        });
                    }
                }
            });
        }
        self.open = open;
    }

    /// Whether fluid passes a face; what is held at a side passes none to a solid.
    fn passes(&self, axis: usize, at: [usize; 3]) -> bool {
        let end = match at[axis] {
            _ if self.grid.periodic[axis] => None,
            0 => Some(0),
            i if i == self.grid.n[axis] => Some(1),
            _ => None,
        };
        !end.is_some_and(|end| self.held[axis][end]) && self.open[axis][self.face(axis, at)] > 0
    }

    /// The number of a face; the last of a periodic axis is the first.
    fn face(&self, axis: usize, mut at: [usize; 3]) -> usize {
        if self.grid.periodic[axis] && at[axis] == self.grid.n[axis] {
            at[axis] = 0;
        }
        self.grid.lattice().at(at[0], at[1], at[2])
    }

    fn alive(&self, cell: [usize; 3]) -> bool {
        self.grid.axes().any(|axis| {
            let mut upper = cell;
            upper[axis] += 1;
            self.passes(axis, cell) || self.passes(axis, upper)
        })
    }

    /// Everything that is cut or closed in a plane of cells and their lower faces.
    fn search(&self, k: usize, t: f64) -> Found {
        let (grid, l) = (self.grid, self.grid.lattice());
        let mut found = Found::default();
        for axis in grid.axes() {
            let points = grid.points(Place::Face(axis));
            if k >= points[2] {
                continue;
            }
            for j in 0..points[1] {
                let at = l.at(0, j, k);
                for i in 0..points[0] {
                    let open = self.open[axis][at + i];
                    if open == u8::OPEN {
                        continue;
                    }
                    let end = match [i, j, k][axis] {
                        _ if grid.periodic[axis] => None,
                        0 => Some(0),
                        m if m == grid.n[axis] => Some(1),
                        _ => None,
                    };
                    if end.is_some_and(|end| self.held[axis][end]) {
                        continue;
                    }
                    self.face_found(axis, [i, j, k], open, t, &mut found);
                }
            }
        }
        if k == grid.n[2] {
            return found;
        }
        for j in 0..grid.n[1] {
            for i in 0..grid.n[0] {
                let cell = [i, j, k];
                let at = l.at(i, j, k);
                let mut cut = false;
                for axis in grid.axes() {
                    let mut upper = cell;
                    upper[axis] += 1;
                    let w = [cell, upper].map(|face| self.open[axis][self.face(axis, face)]);
                    cut |= w != [u8::OPEN; 2];
                }
                if !cut {
                    continue;
                }
                let x = self.point(Place::Cell, cell);
                if self.alive(cell) {
                    continue;
                }
                match found.dead.last_mut() {
                    Some((start, n)) if *start + *n == at as u32 => *n += 1,
                    _ => found.dead.push((at as u32, 1)),
                }
                if self.depth(Place::Cell, at) < DEPTH * grid.dx {
                    let (_, d, normal, _) = self.nearest(x, t, 4.0 * grid.dx);
                    if let Some((image, _)) = self.image(x, d, normal) {
                        found.shades.push((at as u32, self.spot(Place::Cell, image)));
                    }
                }
            }
        }
        found
    }

    /// How deep a face or cell is at most, by one of its nodes [m].
    fn depth(&self, place: Place, at: usize) -> f64 {
        let corners = if let Place::Face(axis) = place { self.corners(axis) } else { [0; 4] };
        corners.iter().map(|c| -f64::from(self.nodes[at + c])).fold(f64::INFINITY, f64::min)
    }

    fn face_found(&self, axis: usize, at: [usize; 3], open: u8, t: f64, found: &mut Found) {
        let (grid, number) = (self.grid, self.face(axis, at) as u32);
        let cell = |number: usize| grid.lattice().place(number);
        let cells = match beside(&grid, axis, at) {
            Face::Between(low, high) => [Some(low), Some(high)],
            Face::Lower(high) => [None, Some(high)],
            Face::Upper(low) => [Some(low), None],
        };
        let cells = cells.map(|c| c.filter(|c| self.alive(cell(*c))).map_or(NONE, |c| c as u32));
        let near = self.depth(Place::Face(axis), number as usize) < (DEPTH + 1.0) * grid.dx;
        if !near {
            // Deep faces only fill pictures.
            found.closed[axis].push(Closed { at: number, solid: NONE, velocity: 0.0 });
            return;
        }
        let x = self.point(Place::Face(axis), at);
        let (solid, d, normal, v) = self.nearest(x, t, 4.0 * grid.dx);
        let (solid, v): (u32, [f64; 3]) = (solid as u32, v.into());
        if cells != [NONE; 2] {
            let shut = 1.0 - open.value();
            found.cuts.push(Cut { axis, at: number, cells, shut, solid, velocity: v[axis] as Real });
        }
        if open > 0 {
            return;
        }
        found.closed[axis].push(Closed { at: number, solid, velocity: v[axis] as Real });
        if let Some((image, normal)) = self.image(x, d, normal) {
            let mut spots = [Spot::default(); 3];
            grid.axes().for_each(|a| spots[a] = self.spot(Place::Face(a), image));
            let velocity = v.map(|v| v as Real);
            found.ghosts.push(Ghost { axis, at: number, image: spots, normal: normal.map(|n| n as Real), solid, velocity });
        }
    }

    /// The image of a point in the surface, and the normal in the plane; none if there is no normal.
    fn image(&self, x: Vector, d: f64, normal: Vector) -> Option<(Vector, [f64; 3])> {
        let mut n: [f64; 3] = normal.into();
        if let Some(flat) = self.grid.flat {
            n[flat] = 0.0;
        }
        let n = Vector::from(n);
        let size = n.norm();
        if !(size > 1e-3 && -d < DEPTH * self.grid.dx) {
            return None;
        }
        let n = n * (1.0 / size);
        // Not itself, which a face closed by rounding would be.
        Some((x + n * (2.0 * (-d).max(0.25 * self.grid.dx)), n.into()))
    }

    fn spot(&self, place: Place, x: Vector) -> Spot {
        Spot::new(&self.grid, place, x)
    }

    fn read(&self, data: &[Real], spot: &Spot) -> Real {
        spot.read(self.grid.lattice().stride, data)
    }

    /// Gives closed faces the velocity of their solid.
    pub fn close(&self, u: &mut Vectors) {
        for part in &mut u.parts {
            let Place::Face(axis) = part.place else { continue };
            self.closed[axis].iter().for_each(|face| part.data[face.at as usize] = face.velocity);
        }
    }

    /// Makes velocities what they carry through the open share of each face.
    pub fn narrow(&self, u: &mut Vectors) {
        for (axis, part) in self.grid.axes().zip(&mut u.parts) {
            self.free(part);
            self.cuts.iter().filter(|cut| cut.axis == axis).for_each(|cut| part.data[cut.at as usize] *= 1.0 - cut.shut);
        }
    }

    /// Sets a direction to zero where the velocity is given.
    pub fn free(&self, part: &mut Field) {
        let Place::Face(axis) = part.place else { return };
        self.closed[axis].iter().for_each(|face| part.data[face.at as usize] = 0.0);
    }

    /// Gives closed faces near the surface what their images say.                               (gas.11)
    pub fn extend(&self, u: &mut Vectors) {
        let axes: Vec<usize> = self.grid.axes().collect();
        for _ in 0..PASSES {
            for ghost in &self.ghosts {
                let mut v = [0.0; 3];
                for (a, part) in axes.iter().zip(&u.parts) {
                    v[*a] = self.read(&part.data, &ghost.image[*a]);
                }
                let slip: [Real; 3] = std::array::from_fn(|a| ghost.velocity[a] - v[a]);
                let back = if self.stick {
                    slip[ghost.axis]
                } else {
                    ghost.normal[ghost.axis] * axes.iter().map(|a| ghost.normal[*a] * slip[*a]).sum::<Real>()
                };
                let value = v[ghost.axis] + 2.0 * back;
                if let Some(index) = axes.iter().position(|a| *a == ghost.axis) {
                    u.parts[index].data[ghost.at as usize] = value;
                }
            }
        }
    }

    /// The same, kept for [`Solids::recall`]: forces move the fluid by h a before viscosity balances them, and images of that would
    /// slip.
    pub fn keep(&mut self, u: &mut Vectors) {
        self.extend(u);
        let axes: [Option<usize>; 3] = std::array::from_fn(|axis| self.grid.axes().position(|a| a == axis));
        let value = |ghost: &Ghost| axes[ghost.axis].map_or(0.0, |index| u.parts[index].data[ghost.at as usize]);
        self.kept.clear();
        self.kept.extend(self.ghosts.iter().map(value));
    }

    /// Gives closed faces near the surface what was kept.
    pub fn recall(&self, u: &mut Vectors) {
        let axes: [Option<usize>; 3] = std::array::from_fn(|axis| self.grid.axes().position(|a| a == axis));
        for (ghost, value) in self.ghosts.iter().zip(&self.kept) {
            if let Some(index) = axes[ghost.axis] {
                u.parts[index].data[ghost.at as usize] = *value;
            }
        }
    }

    /// Gives cells just inside the solids what their images say.                                (gas.11)
    pub fn shade(&self, f: &mut Field) {
        for _ in 0..PASSES {
            for (at, image) in &self.shades {
                f.data[*at as usize] = self.read(&f.data, image);
            }
        }
    }

    /// Sets what solids have instead of fluid.
    pub fn clear(&self, data: &mut [Real], value: f64) {
        self.dead.iter().for_each(|(at, n)| data[*at as usize..(at + n) as usize].fill(value as Real));
    }

    /// Makes the right-hand side of open faces that of cut ones.                                  (gas.10)
    pub fn correct(&self, u: &Vectors, b: &mut Field) {
        let dx = self.grid.dx as Real;
        for (axis, part) in self.grid.axes().zip(&u.parts) {
            for cut in self.cuts.iter().filter(|cut| cut.axis == axis) {
                let more = dx * cut.shut * (cut.velocity - part.data[cut.at as usize]);
                for (cell, sign) in cut.cells.iter().zip([-1.0, 1.0]).filter(|(cell, _)| **cell != NONE) {
                    b.data[*cell as usize] += sign * more;
                }
            }
        }
        self.clear(&mut b.data, 0.0);
    }

    /// Distance of the middle of a cell from the nearest surface [m], the mean of those of its corners; far away a lower bound.
    pub fn middle(&self, cell: usize) -> Real {
        self.middle_and_normal(cell).0
    }

    /// The same with the direction away from the surface; far away there is none.
    pub fn middle_and_normal(&self, cell: usize) -> (Real, [Real; 3]) {
        self.among_nodes(cell, [0.5; 3])
    }

    /// The same of a place, in cells from the lowest corner of the box.
    pub fn near(&self, x: &[Real; 3]) -> (Real, [Real; 3]) {
        let (mut base, mut part) = ([0; 3], [0.0; 3]);
        for a in self.grid.axes() {
            let s = x[a].max(0.0).min(self.grid.n[a] as Real);
            base[a] = (s as usize).min(self.grid.n[a] - 1);
            part[a] = s - base[a] as Real;
        }
        self.among_nodes(self.grid.lattice().at(base[0], base[1], base[2]), part)
    }

    /// Distance and normal within a cell.
    fn among_nodes(&self, cell: usize, part: [Real; 3]) -> (Real, [Real; 3]) {
        let stride = self.grid.lattice().stride;
        let (mut distance, mut slope) = (0.0, [0.0; 3]);
        for corner in 0..8 {
            let mut at = cell;
            let mut weight = [1.0; 3];
            let mut sign = [0.0; 3];
            for a in self.grid.axes() {
                let upper = corner >> a & 1 == 1;
                at += if upper { stride[a] } else { 0 };
                (weight[a], sign[a]) = if upper { (part[a], 1.0) } else { (1.0 - part[a], -1.0) };
            }
            if self.grid.flat.is_some_and(|flat| corner >> flat & 1 == 1) {
                continue;
            }
            let d = self.nodes[at];
            distance += weight[0] * weight[1] * weight[2] * d;
            slope[0] += sign[0] * weight[1] * weight[2] * d;
            slope[1] += weight[0] * sign[1] * weight[2] * d;
            slope[2] += weight[0] * weight[1] * sign[2] * d;
        }
        let size = slope.iter().map(|s| s * s).sum::<Real>().sqrt();
        (distance, if size > 0.0 { slope.map(|s| s / size) } else { [0.0; 3] })
    }

    /// The area of a face [m²]; in the plane, of one metre across it.
    pub fn area(&self) -> f64 {
        (1..self.grid.dimension()).fold(1.0, |a, _| a * self.grid.dx)
    }

    /// By how much a pressure is higher at the surface in a cell than at its middle [Pa], from its slope among the cells that `has` says. (pic.13)
    pub fn rise(&self, pressure: &Field, cell: u32, has: &impl Fn(u32) -> bool) -> f64 {
        let (lattice, at) = (self.grid.lattice(), cell as usize);
        let (distance, normal) = self.middle_and_normal(at);
        let wet = |at: usize| has(at as u32) && self.alive(lattice.place(at));
        let p = |at: usize| f64::from(pressure.data[at]);
        let along = |axis: usize| {
            let (low, high) = (at - lattice.stride[axis], at + lattice.stride[axis]);
            let slope = match (wet(low), wet(high)) {
                (true, true) => 0.5 * (p(high) - p(low)),
                (true, false) => p(at) - p(low),
                (false, true) => p(high) - p(at),
                (false, false) => 0.0,
            };
            -slope * f64::from(normal[axis])
        };
        self.grid.axes().map(along).sum::<f64>() * f64::from(distance) / self.grid.dx
    }

    /// Gives bodies for h seconds what a pressure is higher at their surface than at the middle of the cells that `has` says.         (pic.13)
    pub fn lift(&mut self, h: f64, pressure: &Field, has: impl Fn(u32) -> bool) {
        let scale = h * self.area();
        let wrenches: Vec<_> = self.bodies.iter().map(|body| body.sum(|cell| self.rise(pressure, cell, &has), &has)).collect();
        self.bodies.iter_mut().zip(wrenches).for_each(|(body, wrench)| body.yield_to(&wrench, scale));
    }

    /// Columns of the force of the pressure that cells have [N], three numbers for a collider and for each body of an object; in the plane, of one
    /// metre across it.                                                                                              (gas.12)
    pub fn forces(&self, pressure: impl Fn(u32) -> f64) -> impl Iterator<Item = Column> {
        let mut each = vec![[0.0; 3]; self.colliders.len() + self.bodies.len()];
        for cut in &self.cuts {
            let p: f64 = cut.pushes().map(|(cell, share)| f64::from(share) * pressure(cell)).sum();
            each[cut.solid as usize][cut.axis] += self.area() * p;
        }
        let mut all: Vec<(&str, Vec<f64>)> = Vec::new();
        for (name, force) in self.names().zip(each) {
            match all.last_mut().filter(|(last, _)| last == name) {
                Some((_, forces)) => forces.extend(force),
                None => all.push((name, force.to_vec())),
            }
        }
        all.into_iter().map(|(name, forces)| Column::new(name, "force", forces))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_squares_by_hand() {
        assert_eq!(share([1.0; 4]), 1.0);
        assert_eq!(share([-1.0; 4]), 0.0);
        // A corner cut off at 1/4 and 1/2: a triangle of 1/16 is closed.
        assert!((share([-1.0, 3.0, 2.0, 1.0]) - 15.0 / 16.0).abs() < 1e-15);
        assert!((share([1.0, -3.0, -2.0, -1.0]) - 1.0 / 16.0).abs() < 1e-15);
        // Across.
        assert!((share([1.0, 1.0, -3.0, -3.0]) - 0.25).abs() < 1e-15);
        assert!((part(1.0, -3.0) - 0.25).abs() < 1e-15 && (part(-3.0, 1.0) - 0.25).abs() < 1e-15);
    }
}
