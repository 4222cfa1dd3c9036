//! A tree of boxes over features that move: built now and then, fitted to them each time.
//!
//! Nodes lie in the order of a walk from the root, each with the node after its last descendant, so that a walk needs no stack.
//! Boxes are in single precision, rounded outwards, relative to an origin near the features.

use crate::geometry::Vector;
use crate::math::parallel::{Tasks, chunks};

/// Features per leaf.
pub(super) const LEAF: usize = 8;
/// Leaves per task.
const TASK: usize = 64;
/// How much larger the sum of all boxes may grow before the tree is built anew.
const GROWTH: f64 = 1.5;

/// A box: lower corner, upper corner [m].
pub(super) type Box3 = [[f32; 3]; 2];

/// Meets no box; finite, so that it can be grown.
const NOTHING: Box3 = [[f32::MAX; 3], [f32::MIN; 3]];

/// A node. A leaf's `leaf` is its number, an inner node's is NONE; `last` is the last leaf in it.
#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Box3,
    after: u32,
    leaf: u32,
    last: u32,
}

const NONE: u32 = u32::MAX;

/// The boxes of a leaf's features: lower x y z, upper x y z. Places without one have empty boxes.
pub(super) type Leaf = [[f32; LEAF]; 6];

/// A tree over features 0..n.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    /// Features in the order of leaves.
    order: Vec<u32>,
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    /// Sum of the sides of all boxes when the tree was built.
    size: f64,
}

/// A box around points, rounded outwards; empty if one of them is not finite in single precision.
#[inline(always)]
pub(super) fn around<const N: usize>(points: [Vector; N], origin: Vector) -> Box3 {
    let mut b = NOTHING;
    for p in points {
        let p = p - origin;
        for (k, c) in [p.x, p.y, p.z].into_iter().enumerate() {
            let c = c as f32;
            b[0][k] = b[0][k].min(c);
            b[1][k] = b[1][k].max(c);
        }
    }
    let widest = (b[1][0] - b[0][0]) + (b[1][1] - b[0][1]) + (b[1][2] - b[0][2]);
    if !widest.is_finite() || points.iter().any(|p| !p.norm_sq().is_finite()) {
        return NOTHING;
    }
    for k in 0..3 {
        b[0][k] -= b[0][k].abs() * f32::EPSILON + f32::MIN_POSITIVE;
        b[1][k] += b[1][k].abs() * f32::EPSILON + f32::MIN_POSITIVE;
    }
    b
}

/// The box around two boxes.
#[inline(always)]
pub(super) fn union(a: &Box3, b: &Box3) -> Box3 {
    let mut u = *a;
    for k in 0..3 {
        u[0][k] = u[0][k].min(b[0][k]);
        u[1][k] = u[1][k].max(b[1][k]);
    }
    u
}

#[inline(always)]
fn overlap(a: &Box3, b: &Box3) -> bool {
    let mut yes = true;
    for k in 0..3 {
        yes &= a[0][k] <= b[1][k] && b[0][k] <= a[1][k];
    }
    yes
}

/// A box that is larger by a distance on all sides.
#[inline(always)]
pub(super) fn grown(b: &Box3, by: f32) -> Box3 {
    let mut g = *b;
    for k in 0..3 {
        g[0][k] -= by + g[0][k].abs() * f32::EPSILON;
        g[1][k] += by + g[1][k].abs() * f32::EPSILON;
    }
    g
}

impl Tree {
    /// Fits the boxes to the features, and builds the tree anew where that has become much worse than it was.
    pub fn fit(&mut self, n: usize, bounds: impl Fn(u32) -> Box3 + Sync) {
        if self.order.len() == n && self.refit(&bounds) <= GROWTH * self.size {
            return;
        }
        self.order = (0..n as u32).collect();
        let mut centres = vec![[0.0; 3]; n];
        chunks(&mut centres, |start, centres| {
            for (k, centre) in centres.iter_mut().enumerate() {
                let [l, h] = bounds((start + k) as u32);
                // Non-finite points are placed anywhere.
                *centre = [0, 1, 2].map(|k| if (l[k] + h[k]).is_finite() { l[k] + h[k] } else { 0.0 });
            }
        });
        self.nodes.clear();
        self.leaves = vec![[[0.0; LEAF]; 6]; n.div_ceil(LEAF)];
        if n > 0 {
            split(&mut self.order, 0, &centres, &mut self.nodes);
        }
        self.size = self.refit(&bounds);
    }

    /// Fits the boxes, and returns the sum of their sides.
    fn refit(&mut self, bounds: &(impl Fn(u32) -> Box3 + Sync)) -> f64 {
        let mut whole = vec![NOTHING; self.leaves.len()];
        let fit = |leaf: &mut Leaf, whole: &mut Box3, order: &[u32]| {
            let [low, high] = [[f32::MAX; LEAF], [f32::MIN; LEAF]];
            *leaf = [low, low, low, high, high, high];
            for (l, i) in order.iter().enumerate() {
                let b = bounds(*i);
                for k in 0..3 {
                    leaf[k][l] = b[0][k];
                    leaf[3 + k][l] = b[1][k];
                }
                *whole = union(whole, &b);
            }
        };
        let tasks = self.leaves.chunks_mut(TASK).zip(whole.chunks_mut(TASK)).zip(self.order.chunks(LEAF * TASK));
        tasks.in_parallel(|((leaves, whole), order)| {
            leaves.iter_mut().zip(whole).zip(order.chunks(LEAF)).for_each(|((leaf, whole), order)| fit(leaf, whole, order));
        });
        let mut size = 0.0;
        for i in (0..self.nodes.len()).rev() {
            let node = self.nodes[i];
            self.nodes[i].bounds = if node.leaf == NONE {
                let left = &self.nodes[i + 1];
                union(&left.bounds, &self.nodes[left.after as usize].bounds)
            } else {
                whole[node.leaf as usize]
            };
            let [l, h] = self.nodes[i].bounds;
            let sides = f64::from(h[0] - l[0]) + f64::from(h[1] - l[1]) + f64::from(h[2] - l[2]);
            size += if sides.is_finite() { sides } else { 0.0 };
        }
        size
    }

    /// Number of leaves.
    pub fn n_leaves(&self) -> usize {
        self.leaves.len()
    }

    /// The features of a leaf.
    #[inline(always)]
    pub fn features(&self, leaf: usize) -> &[u32] {
        &self.order[leaf * LEAF..((leaf + 1) * LEAF).min(self.order.len())]
    }

    /// The box of the feature at a place of a leaf.
    #[inline(always)]
    pub fn bounds(&self, leaf: usize, place: usize) -> Box3 {
        let b = &self.leaves[leaf];
        [[b[0][place], b[1][place], b[2][place]], [b[3][place], b[4][place], b[5][place]]]
    }

    /// Calls `f` for all leaves that a box meets, from a leaf on.
    #[inline(always)]
    pub fn walk(&self, b: &Box3, from: u32, mut f: impl FnMut(u32)) {
        let mut i = 0;
        while let Some(node) = self.nodes.get(i) {
            if node.last < from || !overlap(&node.bounds, b) {
                i = node.after as usize;
                continue;
            }
            if node.leaf != NONE {
                f(node.leaf);
            }
            i += 1;
        }
    }

    /// Which features of a leaf a box meets, as bits.
    #[inline(always)]
    pub fn mask(&self, leaf: u32, b: &Box3) -> u32 {
        let of = &self.leaves[leaf as usize];
        let mut apart = [false; LEAF];
        for l in 0..LEAF {
            apart[l] = (of[0][l] > b[1][0])
                | (of[1][l] > b[1][1])
                | (of[2][l] > b[1][2])
                | (of[3][l] < b[0][0])
                | (of[4][l] < b[0][1])
                | (of[5][l] < b[0][2]);
        }
        // One bit for each: eight bools are the bytes 0 or 1 of a number, and the factor moves them to its top byte.
        let bytes = u64::from_le_bytes(apart.map(u8::from));
        !(bytes.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32 & 0xff
    }
}

/// The box around a leaf's features.
pub(super) fn whole(tree: &Tree, leaf: usize) -> Box3 {
    (0..tree.features(leaf).len()).fold(NOTHING, |b, l| union(&b, &tree.bounds(leaf, l)))
}

/// Splits at the median of the longest axis of the centres, at a multiple of LEAF, so that all leaves but the last are full.
fn split(order: &mut [u32], first: usize, centres: &[[f32; 3]], nodes: &mut Vec<Node>) {
    let me = nodes.len();
    nodes.push(Node { bounds: NOTHING, after: 0, leaf: NONE, last: ((first + order.len() - 1) / LEAF) as u32 });
    if order.len() <= LEAF {
        nodes[me].leaf = (first / LEAF) as u32;
    } else {
        let mut b = NOTHING;
        for i in order.iter() {
            let c = centres[*i as usize];
            b = union(&b, &[c, c]);
        }
        let d = [0, 1, 2].map(|k| b[1][k] - b[0][k]);
        let axis = if d[0] >= d[1] && d[0] >= d[2] { 0 } else { 1 + usize::from(d[2] > d[1]) };
        let half = order.len().div_ceil(LEAF) / 2 * LEAF;
        order.select_nth_unstable_by(half, |a, b| centres[*a as usize][axis].total_cmp(&centres[*b as usize][axis]).then(a.cmp(b)));
        let (left, right) = order.split_at_mut(half);
        split(left, first, centres, nodes);
        split(right, first + half, centres, nodes);
    }
    nodes[me].after = nodes.len() as u32;
}
