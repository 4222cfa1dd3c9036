//! Mends a triangle mesh: what stands in it twice, has no area, faces the wrong way or meets too many others along an edge.
//!
//! Every step does nothing to a mesh that does not need it, so that a sound one comes back as it is, bit by bit. Holes are left open: what
//! belongs there, nobody knows. Where several ways are right, the order in the file decides.
//! Verified by `tests/repair.rs` of `tumble-io`.

use crate::Mesh;
use crate::mesh::SLIVER;
use crate::triples::{cross, dot, sub};
use std::collections::{HashMap, HashSet};

/// Rounds of all steps, and of the first of them; a few are enough for all but contrived meshes.
const ROUNDS: usize = 32;

/// Repairs of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Repairs {
    /// Vertices that became one with another at the same place.
    pub welded: usize,
    /// Triangles that stood there already.
    pub repeated: usize,
    /// Triangles without an area.
    pub degenerate: usize,
    /// Triangles that were turned around.
    pub turned: usize,
    /// Edges of more than two triangles that were taken apart.
    pub split: usize,
    /// Vertices that belonged to no triangle.
    pub unused: usize,
}

impl Repairs {
    /// Whether nothing had to be done.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// The mesh mended, and what was done:
///
/// 1. triangles that stand there twice are dropped;
/// 2. rims that lie on each other are sewn: their vertices become one, as do the ends of edges without length;
/// 3. triangles without area are dropped; where others would be torn apart, the neighbour across the longest side is cut in two instead;
/// 4. triangles are turned to face as most of those that they hang together with;
/// 5. edges of more than two triangles come apart into the surfaces that meet there;
/// 6. closed pieces that face inward are turned, but not hollows within others.
///
/// Vertices that are nearly at one place ([`Mesh::places`]) count as being there; the first stays where it is. Those of no triangle go.
/// An edge that is divided on both sides at the same place stays whole, but may come open where more is broken around it.
/// A mesh whose triangles all have no area comes back without any. Surfaces with one side only stay as they are.
pub fn repair(mesh: &Mesh) -> (Mesh, Repairs) {
    let (mut work, mut done) = (Work::of(mesh), Repairs { unused: mesh.unused, ..Repairs::default() });
    for _ in 0..ROUNDS {
        let before = done;
        done.repeated += work.drop_repeated();
        let mut turned = 0;
        for _ in 0..ROUNDS {
            // Which rims belong together shows when triangles are turned alike, and where to cut when rims are sewn.
            let (sewn, aligned) = (work.sew(), work.align());
            let (cut, gone) = work.cut_neighbours();
            done.welded += sewn;
            turned += aligned;
            done.degenerate += gone;
            if sewn + aligned + cut == 0 {
                break;
            }
        }
        done.degenerate += work.drop_degenerate();
        turned += work.align();
        done.split += work.split();
        let out = work.turn_out();
        if before == done && turned + out == 0 {
            break;
        }
    }
    done.turned = work.triangles.iter().filter(|t| t.turned).count();
    if done.is_none() {
        return (mesh.clone(), done);
    }
    // Vertices that were not merged keep their position.
    work.vertices[..mesh.vertices.len()].copy_from_slice(&mesh.vertices);
    (work.finish(!mesh.texture.is_empty()), done)
}

/// A triangle: its vertices and texture coordinates, and whether it was turned around.
#[derive(Debug, Clone)]
struct Triangle {
    at: [u32; 3],
    texture: Option<[[f64; 2]; 3]>,
    turned: bool,
}

impl Triangle {
    fn turn(&mut self) {
        self.at.swap(1, 2);
        if let Some(texture) = &mut self.texture {
            texture.swap(1, 2);
        }
        self.turned = !self.turned;
    }

    /// Whether it has a vertex twice.
    fn repeats(&self) -> bool {
        self.at[0] == self.at[1] || self.at[1] == self.at[2] || self.at[2] == self.at[0]
    }

    /// Whether it runs from a to b.
    fn runs(&self, a: u32, b: u32) -> bool {
        (0..3).any(|k| self.at[k] == a && self.at[(k + 1) % 3] == b)
    }

    /// Which of its corners is at a vertex.
    fn corner(&self, vertex: u32) -> usize {
        self.at.iter().position(|i| *i == vertex).unwrap_or(0)
    }

    /// The corner that is at neither of two vertices.
    fn opposite(&self, a: u32, b: u32) -> usize {
        self.at.iter().position(|i| *i != a && *i != b).unwrap_or(0)
    }
}

fn sorted(mut t: [u32; 3]) -> [u32; 3] {
    t.sort_unstable();
    t
}

/// The edges of a triangle as (low vertex, high vertex).
fn edges_of(t: [u32; 3]) -> [[u32; 2]; 3] {
    let [a, b, c] = sorted(t);
    [[a, b], [b, c], [a, c]]
}

/// Equal for equal positions; -0 equals 0.
fn key(x: [f64; 3]) -> [u64; 3] {
    x.map(|x| (x + 0.0).to_bits())
}

/// Sets that grow together; the first of each stands for all.
struct Sets(Vec<usize>);

impl Sets {
    fn new(n: usize) -> Self {
        Self((0..n).collect())
    }

    fn find(&mut self, mut i: usize) -> usize {
        while self.0[i] != i {
            self.0[i] = self.0[self.0[i]];
            i = self.0[i];
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b)] = a.min(b);
    }
}

/// Edges as (low vertex, high vertex) with their triangles, in order of the first of these.
type Edges = Vec<([u32; 2], Vec<usize>)>;

struct Work {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<Triangle>,
}

impl Work {
    fn of(mesh: &Mesh) -> Self {
        let triangle = |(i, t): (usize, &[u32; 3])| Triangle { at: *t, texture: mesh.texture.get(i).copied().flatten(), turned: false };
        Self {
            vertices: mesh.places().into_iter().map(|first| mesh.vertices[first as usize]).collect(),
            triangles: mesh.triangles.iter().enumerate().map(triangle).collect(),
        }
    }

    fn at(&self, vertex: u32) -> [f64; 3] {
        self.vertices[vertex as usize]
    }

    fn edges(&self) -> Edges {
        let mut index = HashMap::new();
        let mut edges: Edges = Vec::new();
        for (i, t) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t.at[k], t.at[(k + 1) % 3]);
                let ends = [a.min(b), a.max(b)];
                let e = *index.entry(ends).or_insert_with(|| {
                    edges.push((ends, Vec::new()));
                    edges.len() - 1
                });
                edges[e].1.push(i);
            }
        }
        edges
    }

    fn drop(&mut self, which: &[bool]) -> usize {
        let before = self.triangles.len();
        let mut all = which.iter();
        self.triangles.retain(|_| all.next() != Some(&true));
        before - self.triangles.len()
    }

    /// Triangles that hang together by edges of two.
    fn pieces(&self, edges: &Edges) -> Sets {
        let mut pieces = Sets::new(self.triangles.len());
        for faces in edges.iter().map(|(_, faces)| faces).filter(|faces| faces.len() == 2) {
            pieces.join(faces[0], faces[1]);
        }
        pieces
    }

    /// How many triangles with different vertices meet at each edge; those with a vertex twice do not count.
    fn meeting(&self) -> HashMap<[u32; 2], usize> {
        let mut meeting = HashMap::new();
        let different: HashSet<[u32; 3]> = self.triangles.iter().filter(|t| !t.repeats()).map(|t| sorted(t.at)).collect();
        different.into_iter().flat_map(edges_of).for_each(|ends| *meeting.entry(ends).or_default() += 1);
        meeting
    }

    /// Keeps the first of triangles that lie at the same three places and face the same way; of those that share their vertices it also keeps
    /// one only, however they face, or none where the surface goes on without them. Returns how many are gone.
    fn drop_repeated(&mut self) -> usize {
        let mut repeated = 0;
        for slivers in [false, true] {
            // If an edge is divided on both sides, two slivers of the surface coincide.
            let meeting = self.meeting();
            let belongs = |t: [u32; 3]| edges_of(t).iter().all(|ends| meeting.get(ends) == Some(&2));
            let mut drop = vec![false; self.triangles.len()];
            let mut seen = HashMap::new();
            for (i, t) in self.triangles.iter().enumerate().filter(|(_, t)| self.sliver(t.at).is_some() == slivers) {
                let mut places = t.at.map(|i| key(self.at(i)));
                let least = (0..3).fold(0, |l, k| if places[k] < places[l] { k } else { l });
                places.rotate_left(least);
                let first = *seen.entry(places).or_insert(i);
                drop[i] = first != i && !(slivers && belongs(t.at) && belongs(self.triangles[first].at));
            }
            repeated += self.drop(&drop);
        }
        let meeting = self.meeting();
        let mut copies: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
        for (i, t) in self.triangles.iter().enumerate() {
            copies.entry(sorted(t.at)).or_default().push(i);
        }
        let mut drop = vec![false; self.triangles.len()];
        for (t, all) in copies.iter().filter(|(_, all)| all.len() > 1) {
            let goes_on = edges_of(*t).iter().all(|ends| meeting.get(ends).is_some_and(|n| *n > 2));
            all.iter().skip(usize::from(!goes_on)).for_each(|i| drop[*i] = true);
        }
        repeated + self.drop(&drop)
    }

    /// Makes the vertices of rims that lie on each other one, and the ends of edges without length; returns how many are gone.
    fn sew(&mut self) -> usize {
        let mut sets = Sets::new(self.vertices.len());
        // Rims by the places of their ends, low key first.
        let mut rims: HashMap<[[u64; 3]; 2], usize> = HashMap::new();
        let mut found: Vec<Vec<([u32; 2], usize)>> = Vec::new();
        let edges = self.edges();
        let mut pieces = self.pieces(&edges);
        for ([a, b], faces) in edges {
            if a != b && faces.len() == 1 {
                let (p, q) = (key(self.at(a)), key(self.at(b)));
                let (places, ends) = if p <= q { ([p, q], [a, b]) } else { ([q, p], [b, a]) };
                let e = *rims.entry(places).or_insert_with(|| {
                    found.push(Vec::new());
                    found.len() - 1
                });
                found[e].push((ends, faces[0]));
            }
        }
        for rims in found.iter().filter(|rims| rims.len() > 1) {
            let forward = rims.iter().filter(|(ends, t)| self.triangles[*t].runs(ends[0], ends[1])).count();
            if 0 < forward && forward < rims.len() || rims.len() == 2 && pieces.find(rims[0].1) != pieces.find(rims[1].1) {
                for (ends, _) in &rims[1..] {
                    (0..2).for_each(|k| sets.join(rims[0].0[k] as usize, ends[k] as usize));
                }
            }
        }
        for t in &self.triangles {
            let sides = self.sides(t.at);
            let longest = sides.iter().copied().fold(0.0, f64::max);
            for k in 0..3 {
                if sides[k] <= SLIVER * SLIVER * longest {
                    sets.join(t.at[k] as usize, t.at[(k + 1) % 3] as usize);
                }
            }
        }
        let mut gone = vec![false; self.vertices.len()];
        for i in self.triangles.iter_mut().flat_map(|t| &mut t.at) {
            let kept = sets.find(*i as usize) as u32;
            gone[*i as usize] |= kept != *i;
            *i = kept;
        }
        gone.iter().filter(|gone| **gone).count()
    }

    /// Squares of the lengths of the sides.
    fn sides(&self, t: [u32; 3]) -> [f64; 3] {
        std::array::from_fn(|k| {
            let side = sub(self.at(t[(k + 1) % 3]), self.at(t[k]));
            dot(side, side)
        })
    }

    /// Start of the longest side of a triangle without area; `None` if it has area.
    fn sliver(&self, t: [u32; 3]) -> Option<usize> {
        let sides = self.sides(t);
        let longest = (0..3).fold(0, |l, k| if sides[k] > sides[l] { k } else { l });
        let n = cross(sub(self.at(t[1]), self.at(t[0])), sub(self.at(t[2]), self.at(t[0])));
        (dot(n, n).sqrt() <= SLIVER * sides[longest]).then_some(longest)
    }

    /// Drops triangles without area; returns how many.
    fn drop_degenerate(&mut self) -> usize {
        let drop: Vec<bool> = self.triangles.iter().map(|t| t.repeats() || self.sliver(t.at).is_some()).collect();
        self.drop(&drop)
    }

    /// If the middle corner b of a triangle without area lies on a side of a neighbour, the side is cut there, and the triangle is gone.
    /// Triangles with a vertex twice go as well. Returns how often something was done, and how many triangles are gone.
    ///
    /// ```text
    ///      d                 d
    ///     / \               /|\
    ///    s---e     ->      s-b-e       s and e are the ends of the longest side of s b e, which has no area
    ///     \b/
    /// ```
    /// If the neighbour has no area either, two shorter ones come out.
    fn cut_neighbours(&mut self) -> (usize, usize) {
        let drop: Vec<bool> = self.triangles.iter().map(Triangle::repeats).collect();
        let mut gone = self.drop(&drop);
        let mut edges: HashMap<[u32; 2], Vec<usize>> = self.edges().into_iter().collect();
        let mut busy = vec![false; self.triangles.len()];
        let mut cut = gone;
        for i in 0..self.triangles.len() {
            let t = self.triangles[i].at;
            let Some(k) = self.sliver(t).filter(|_| !busy[i]) else { continue };
            let (p, q, b) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            let Some(&[one, two]) = edges.get(&[p.min(q), p.max(q)]).map(Vec::as_slice) else { continue };
            let other = if one == i { two } else { one };
            if busy[other] || other == i {
                continue;
            }
            let neighbour = self.triangles[other].clone();
            let j = neighbour.opposite(p, q);
            let [d, s, e] = [0, 1, 2].map(|m| neighbour.at[(j + m) % 3]);
            let (left, right) = ([d, s, b], [d, b, e]);
            let ends = [b.min(d), b.max(d)];
            let flat = self.sliver(neighbour.at).is_some();
            let longest = |t: [u32; 3]| self.sides(t).into_iter().fold(0.0, f64::max);
            let is_better = |part: [u32; 3]| if flat { longest(part) < longest(t) } else { self.sliver(part).is_none() };
            if d == b || edges.contains_key(&ends) || !is_better(left) || !is_better(right) {
                continue;
            }
            gone += usize::from(!flat);
            let texture = neighbour.texture.map(|c| {
                let way = sub(self.at(e), self.at(s));
                let part = dot(sub(self.at(b), self.at(s)), way) / dot(way, way).max(f64::MIN_POSITIVE);
                let [d, s, e] = [0, 1, 2].map(|m| c[(j + m) % 3]);
                (d, s, e, [0, 1].map(|m| s[m] + part * (e[m] - s[m])))
            });
            let turned = neighbour.turned;
            self.triangles[other] = Triangle { at: left, texture: texture.map(|(d, s, _, b)| [d, s, b]), turned };
            self.triangles[i] = Triangle { at: right, texture: texture.map(|(d, _, e, b)| [d, b, e]), turned };
            edges.insert(ends, Vec::new());
            (busy[i], busy[other]) = (true, true);
            cut += 1;
        }
        (cut, gone)
    }

    /// Turns triangles that face another way than most of those that they hang together with by edges of two; returns how many.
    fn align(&mut self) -> usize {
        let mut turned = 0;
        let n = self.triangles.len();
        let mut next: Vec<Vec<(usize, bool)>> = vec![Vec::new(); n];
        for ([a, b], faces) in self.edges() {
            if let [t, u] = faces[..] {
                let odd = self.triangles[t].runs(a, b) == self.triangles[u].runs(a, b);
                next[t].push((u, odd));
                next[u].push((t, odd));
            }
        }
        let mut odd: Vec<Option<bool>> = vec![None; n];
        for seed in 0..n {
            if odd[seed].is_some() {
                continue;
            }
            odd[seed] = Some(false);
            let (mut piece, mut has_two_sides) = (vec![seed], true);
            let mut k = 0;
            while let Some(&t) = piece.get(k) {
                for &(u, differs) in &next[t] {
                    let own = odd[t] == Some(true);
                    match odd[u] {
                        None => {
                            odd[u] = Some(own != differs);
                            piece.push(u);
                        }
                        Some(other) => has_two_sides &= other == (own != differs),
                    }
                }
                k += 1;
            }
            let wrong = piece.iter().filter(|t| odd[**t] == Some(true)).count();
            if has_two_sides {
                let minority = 2 * wrong <= piece.len();
                turned += if minority { wrong } else { piece.len() - wrong };
                piece.iter().filter(|t| (odd[**t] == Some(true)) == minority).for_each(|t| self.triangles[*t].turn());
            }
        }
        turned
    }

    /// Takes edges of more than two triangles apart; returns how many there were.
    fn split(&mut self) -> usize {
        let edges = self.edges();
        let many = edges.iter().filter(|(_, faces)| faces.len() > 2).count();
        if many == 0 {
            return 0;
        }
        let mut pieces = self.pieces(&edges);
        // Corners that stay together.
        let mut corners = Sets::new(3 * self.triangles.len());
        let mut on_many = vec![false; self.vertices.len()];
        let mut sheets: HashMap<[u32; 2], Vec<Vec<usize>>> = HashMap::new();
        for (ends, faces) in edges {
            let groups = if faces.len() > 2 {
                ends.iter().for_each(|i| on_many[*i as usize] = true);
                self.sheets(ends, &faces, &mut pieces)
            } else {
                vec![faces]
            };
            for pair in groups.iter().flat_map(|group| group.windows(2)) {
                for i in ends {
                    corners.join(3 * pair[0] + self.triangles[pair[0]].corner(i), 3 * pair[1] + self.triangles[pair[1]].corner(i));
                }
            }
            if groups.len() > 1 {
                sheets.insert(ends, groups);
            }
        }
        let mut copies: HashMap<usize, u32> = HashMap::new();
        let mut taken = vec![false; self.vertices.len()];
        let mut origin: Vec<u32> = (0..self.vertices.len() as u32).collect();
        for t in 0..self.triangles.len() {
            for k in 0..3 {
                let vertex = self.triangles[t].at[k];
                if !on_many[vertex as usize] {
                    continue;
                }
                let fan = corners.find(3 * t + k);
                let (vertices, origin) = (&mut self.vertices, &mut origin);
                self.triangles[t].at[k] = *copies.entry(fan).or_insert_with(|| {
                    if std::mem::replace(&mut taken[vertex as usize], true) {
                        vertices.push(vertices[vertex as usize]);
                        origin.push(vertex);
                        vertices.len() as u32 - 1
                    } else {
                        vertex
                    }
                });
            }
        }
        self.divide(&sheets, &origin);
        many
    }

    /// The surfaces that meet at an edge: pairs of triangles, and single ones. Two that hang together elsewhere, alone of their piece, are a
    /// pair; else those are that have the inside between them.
    fn sheets(&self, [a, b]: [u32; 2], faces: &[usize], pieces: &mut Sets) -> Vec<Vec<usize>> {
        let forward = |t: usize| self.triangles[t].runs(a, b);
        let (mut sheets, mut rest): (Vec<Vec<usize>>, Vec<usize>) = (Vec::new(), Vec::new());
        for t in faces {
            let own: Vec<usize> = faces.iter().copied().filter(|u| pieces.find(*u) == pieces.find(*t)).collect();
            match own[..] {
                [first, second] if forward(first) != forward(second) => {
                    if first == *t {
                        sheets.push(own);
                    }
                }
                _ => rest.push(*t),
            }
        }
        // Around the edge, from the first on.
        let way = sub(self.at(b), self.at(a));
        let length_sq = dot(way, way);
        let wing = |t: usize| {
            let x = sub(self.at(self.triangles[t].at[self.triangles[t].opposite(a, b)]), self.at(a));
            let along = dot(x, way) / length_sq;
            std::array::from_fn(|m| x[m] - along * way[m])
        };
        let zero: [f64; 3] = rest.first().map_or([0.0; 3], |t| wing(*t));
        let quarter = cross(way, zero);
        let turn = |t: usize| {
            let w = wing(t);
            let (x, y) = (dot(w, zero) * length_sq.sqrt(), dot(w, quarter));
            // Grows with the angle, from 0 to 4.
            let part = y / (x.abs() + y.abs()).max(f64::MIN_POSITIVE);
            if x < 0.0 {
                2.0 - part
            } else if y < 0.0 {
                4.0 + part
            } else {
                part
            }
        };
        let mut around: Vec<(f64, usize)> = rest.iter().map(|t| (turn(*t), *t)).collect();
        around.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
        let mut around: Vec<usize> = around.into_iter().map(|(_, t)| t).collect();
        // The inside is behind what runs forward, before what runs back.
        while let n @ 2.. = around.len()
            && let Some(k) = (0..n).find(|k| forward(around[*k]) && !forward(around[(k + n - 1) % n]))
        {
            let (one, other) = (around[k], around[(k + n - 1) % n]);
            sheets.push(vec![one.min(other), one.max(other)]);
            around.retain(|t| *t != one && *t != other);
        }
        // Two that face the same way can be turned, unless one turns with the other.
        match around[..] {
            [one, other] if pieces.find(one) != pieces.find(other) => sheets.push(vec![one.min(other), one.max(other)]),
            _ => sheets.extend(around.into_iter().map(|t| vec![t])),
        }
        sheets.sort_unstable();
        sheets
    }

    /// If surfaces still share an edge because they are connected around both of its ends, all but the first get a vertex at its midpoint. `sheets`
    /// are by edges of the vertices `origin`.
    fn divide(&mut self, sheets: &HashMap<[u32; 2], Vec<Vec<usize>>>, origin: &[u32]) {
        let mut busy = vec![false; self.triangles.len()];
        for ([a, b], faces) in self.edges() {
            let old = [a, b].map(|i| origin[i as usize]);
            let Some(groups) = sheets.get(&[old[0].min(old[1]), old[0].max(old[1])]).filter(|_| faces.len() > 2) else { continue };
            let own = groups.iter().filter(|group| group.iter().any(|t| faces.contains(t)));
            for group in own.skip(1) {
                // One side of a triangle at a time: what is left is found in the next round.
                if group.iter().any(|t| busy[*t]) {
                    continue;
                }
                let (x, y) = (self.at(a), self.at(b));
                let middle = self.vertices.len() as u32;
                self.vertices.push(std::array::from_fn(|m| 0.5 * (x[m] + y[m])));
                for t in group {
                    busy[*t] = true;
                    let whole = self.triangles[*t].clone();
                    let k = whole.opposite(a, b);
                    let [c, p, q] = [0, 1, 2].map(|m| whole.at[(k + m) % 3]);
                    let texture = whole.texture.map(|at| {
                        let [c, p, q] = [0, 1, 2].map(|m| at[(k + m) % 3]);
                        (c, p, q, [0, 1].map(|m| 0.5 * (p[m] + q[m])))
                    });
                    let part = |at, texture| Triangle { at, texture, turned: whole.turned };
                    self.triangles[*t] = part([c, p, middle], texture.map(|(c, p, _, m)| [c, p, m]));
                    self.triangles.push(part([c, middle, q], texture.map(|(c, _, q, m)| [c, m, q])));
                }
            }
        }
    }

    /// Turns closed pieces that face inward, unless they are hollows: inside of another piece. Returns how many triangles that were.
    fn turn_out(&mut self) -> usize {
        let edges = self.edges();
        let mut sets = Sets::new(self.triangles.len());
        edges.iter().flat_map(|(_, faces)| faces.windows(2)).for_each(|pair| sets.join(pair[0], pair[1]));
        let mut open = vec![false; self.triangles.len()];
        for ([a, b], faces) in &edges {
            let whole = matches!(faces[..], [t, u] if self.triangles[t].runs(*a, *b) != self.triangles[u].runs(*a, *b));
            open[sets.find(faces[0])] |= !whole;
        }
        let mut pieces: Vec<Vec<usize>> = vec![Vec::new(); self.triangles.len()];
        (0..self.triangles.len()).for_each(|t| pieces[sets.find(t)].push(t));
        let pieces: Vec<Vec<usize>> =
            pieces.into_iter().zip(open).filter(|(piece, open)| !piece.is_empty() && !open).map(|p| p.0).collect();
        let volumes: Vec<f64> = pieces.iter().map(|piece| self.volume(piece)).collect();
        let all_in = volumes.iter().sum::<f64>() < 0.0;
        let inside_out: Vec<bool> = (0..pieces.len())
            .map(|i| {
                let negative = (volumes[i] < 0.0) != (all_in && volumes[i] != 0.0);
                let Some(t) = pieces[i].first().filter(|_| negative) else { return all_in };
                let x = self.at(self.triangles[*t].at[0]);
                let around = pieces.iter().enumerate().filter(|(j, piece)| *j != i && self.is_inside(x, piece)).count();
                // Turned with all others, and back if it is none of the hollows.
                all_in != (around % 2 == 0)
            })
            .collect();
        let wrong: Vec<usize> = pieces.iter().zip(inside_out).filter(|(_, turn)| *turn).flat_map(|(piece, _)| piece).copied().collect();
        wrong.iter().for_each(|t| self.triangles[*t].turn());
        wrong.len()
    }

    /// Six times the volume in a closed piece.
    fn volume(&self, piece: &[usize]) -> f64 {
        // From one of its own vertices, so that nothing is lost far from the origin.
        let origin = piece.first().map_or([0.0; 3], |t| self.at(self.triangles[*t].at[0]));
        let six = |t: &usize| {
            let [a, b, c] = self.triangles[*t].at.map(|i| sub(self.at(i), origin));
            dot(a, cross(b, c))
        };
        piece.iter().map(six).sum()
    }

    /// Whether a closed piece winds around a point, by the solid angles of its triangles.
    fn is_inside(&self, x: [f64; 3], piece: &[usize]) -> bool {
        let angle = |t: &usize| {
            let corners = self.triangles[*t].at.map(|i| sub(self.at(i), x));
            let [a, b, c] = corners;
            let [la, lb, lc] = corners.map(|x| dot(x, x).sqrt());
            2.0 * dot(a, cross(b, c)).atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
        };
        piece.iter().map(angle).sum::<f64>().abs() > 2.0 * std::f64::consts::PI
    }

    /// Without vertices that no triangle uses.
    fn finish(self, has_texture: bool) -> Mesh {
        let mut used = vec![false; self.vertices.len()];
        self.triangles.iter().flat_map(|t| t.at).for_each(|i| used[i as usize] = true);
        let new: Vec<u32> = used
            .iter()
            .scan(0, |kept, used| {
                *kept += u32::from(*used);
                Some(*kept - u32::from(*used))
            })
            .collect();
        Mesh {
            vertices: self.vertices.into_iter().zip(used).filter_map(|(x, used)| used.then_some(x)).collect(),
            triangles: self.triangles.iter().map(|t| t.at.map(|i| new[i as usize])).collect(),
            texture: if has_texture { self.triangles.iter().map(|t| t.texture).collect() } else { Vec::new() },
            ..Mesh::default()
        }
    }
}
