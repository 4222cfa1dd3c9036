//! Faults of a mesh in words: what is wrong, where, and a cure that cures. Verified by `tests/faults.rs` of `tumble-io`.

use crate::Mesh;
use crate::mesh::Defects;
use crate::repair::repair;
use crate::triples::{dot, sub};

/// What a mesh is mended with.
const REPAIR: &str = "mend the file with `tumble check SCENE --repair`";
/// A vertex lies on an edge if it is no further from it than this part of its length.
const ON_EDGE: f64 = 1e-6;
/// Open edges that are looked at for vertices on them.
const LOOKED_AT: usize = 64;

/// Why a mesh has no inside.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Its defects; those that a repair leaves, if it leaves some.
    pub defects: Defects,
    /// Where one of them is: `around (0.5, 0, 1)`.
    pub place: String,
    /// What to do about it.
    pub cure: String,
}

impl Mesh {
    /// Why the mesh has no inside; `None` if no edge is open or bad.
    pub fn fault(&self) -> Option<Fault> {
        let (defects, first) = self.doubtful();
        let place = |mesh: &Self, first: [Option<[u32; 2]>; 2]| first[0].or(first[1]).map_or(String::new(), |ends| mesh.around(&ends));
        if defects.open_edges + defects.bad_edges == 0 {
            return None;
        }
        let (mended, done) = repair(self);
        let (left, first_left) = mended.doubtful();
        if mended.triangles.is_empty() {
            return Some(Fault { defects, place: place(self, first), cure: "no triangle has an area: export the mesh again".into() });
        }
        if left.open_edges + left.bad_edges == 0 {
            return Some(Fault { defects, place: place(self, first), cure: REPAIR.into() });
        }
        let (place, cure) = if let (Some(ends), true) = (first_left[1], left.bad_edges > 0) {
            (mended.around(&ends), "its surface has one side only, like a Möbius strip, which no repair changes: model it with two sides")
        } else if let Some(vertex) = mended.vertex_on_edge() {
            (
                mended.around(&[vertex]),
                "a vertex lies there on an edge that does not end at it (a T-junction): divide that edge at the vertex",
            )
        } else {
            (place(&mended, first_left), "close the hole there")
        };
        let rest = if done.is_none() { "" } else { "; what else is wrong is mended by `tumble check SCENE --repair`" };
        Some(Fault { defects: left, place, cure: format!("{cure}{rest}") })
    }

    /// What is wrong with the mesh as a soft surface, in one line; `None` if nothing is.
    pub fn unsound(&self) -> Option<String> {
        let words = |mesh: &Self| {
            let (flaws, first) = mesh.flawed();
            let place = if first.is_empty() { String::new() } else { format!(", for example {}", mesh.around(&first)) };
            (!flaws.is_none()).then(|| format!("{flaws}{place}"))
        };
        let told = words(self)?;
        let (mended, done) = repair(self);
        let rest = if done.is_none() { "" } else { "; what else is wrong is mended by `tumble check SCENE --repair`" };
        Some(match words(&mended) {
            None => format!("{told}; {REPAIR}"),
            Some(left) if mended.flaws().turned > 0 => format!(
                "{left}: the surface has one side only, like a Möbius strip, which no repair changes; cut it open there if it is to have two{rest}"
            ),
            Some(left) => format!("{left}, which no repair changes; mend that where the mesh was made{rest}"),
        })
    }

    /// The middle of some vertices, in words.
    fn around(&self, vertices: &[u32]) -> String {
        let n = vertices.len() as f64;
        let middle = [0, 1, 2].map(|a| vertices.iter().map(|i| self.vertices[*i as usize][a] / n).sum::<f64>());
        format!("around {}", place(middle))
    }

    /// The first vertex that lies on the inside of an open edge.
    fn vertex_on_edge(&self) -> Option<u32> {
        let open = self.edges().into_iter().filter(|(_, faces)| faces.len() == 1).map(|(ends, _)| ends);
        let on = |[a, b]: [u32; 2]| {
            let (a, b) = (self.vertices[a as usize], self.vertices[b as usize]);
            let along = sub(b, a);
            let length_sq = dot(along, along);
            self.vertices.iter().position(|x| {
                let way = sub(*x, a);
                let part = dot(way, along) / length_sq;
                let off = [0, 1, 2].map(|k| way[k] - part * along[k]);
                (ON_EDGE..1.0 - ON_EDGE).contains(&part) && dot(off, off) <= ON_EDGE * ON_EDGE * length_sq
            })
        };
        open.take(LOOKED_AT).find_map(on).map(|i| i as u32)
    }
}

/// A place as messages show it, to nine digits: `(0.5, 0, 1)`.
pub fn place(x: [f64; 3]) -> String {
    let largest = x.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let short = x.map(|x| if x.abs() < 1e-9 * largest { 0.0 } else { format!("{x:.8e}").parse().unwrap_or(x) + 0.0 });
    format!("({}, {}, {})", short[0], short[1], short[2])
}
