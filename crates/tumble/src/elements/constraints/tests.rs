//! Constraints by hand.

use super::*;
use crate::elements::{Distance, Linear};

#[test]
fn all_elements_come_once_and_none_side_by_side_share_a_node() {
    // A strip of rows of 50, with links to the right, up and to one hub that more than 64 links have.
    let n = 3 * CLUSTER as u32;
    let near = (0..n - 50).flat_map(|i| [[i, i + 1], [i, i + 50]]);
    let members: Vec<_> = near
        .chain((1000..1100).map(|i| [7, i]))
        .map(|nodes| Members { nodes, rest: [1.0], law: [], stiffness: 1.0, damping: 0.0 })
        .collect();
    let all: Vec<u32> = members.iter().flat_map(|m| m.nodes).collect();
    let (given, order) = sorted(n as usize, 2, &all, &[]);
    let mut sum = given.clone();
    sum.sort_unstable();
    assert!(sum.into_iter().eq(0..members.len() as u32));
    let ranges: Vec<_> = order.clusters.iter().flatten().chain(&order.between).cloned().collect();
    assert_eq!(ranges.first().map(|r| r.start), Some(0));
    assert!(ranges.windows(2).all(|r| r[0].end == r[1].start) && ranges.last().map(|r| r.end) == Some(given.len()));
    let nodes = |range: &Range<usize>| -> Vec<u32> {
        let mut all: Vec<u32> = given[range.clone()].iter().flat_map(|e| members[*e as usize].nodes).collect();
        all.sort_unstable();
        all
    };
    for range in &ranges {
        assert!(nodes(range).windows(2).all(|n| n[0] < n[1]), "{range:?} shares a node");
    }
    assert_eq!(order.clusters.len(), 3);
    for (c, cluster) in order.clusters.iter().enumerate() {
        assert!(cluster.iter().flat_map(nodes).all(|i| i as usize / CLUSTER == c));
    }
    // Only links over the two borders are left: 50 up and one to the right each.
    assert_eq!(order.between.iter().map(Range::len).sum::<usize>(), 2 * 51);
}

#[test]
fn links_inside_and_between_clusters_are_all_satisfied_in_their_order() {
    // A zigzag over three clusters, whose links are to be shorter than they are; and links between its rows of 64, of which packs have
    // nodes one behind the other.
    let n = 3 * CLUSTER as u32;
    let h = 0.01;
    let link = |nodes: [u32; 2], rest| {
        let stiffness = if nodes[0].is_multiple_of(5) { f64::INFINITY } else { 1e4 * f64::from(nodes[0] % 5) };
        Members { nodes, rest: [rest], law: [], stiffness, damping: 0.0 }
    };
    let across = (0..n - 64).map(|i| link([i, i + 64], if i % 2 == 0 { 0.3 } else { 0.05 }));
    let members: Vec<_> = (0..n - 1).map(|i| link([i, i + 1], 0.7)).chain(across).collect();
    let start: Vec<Row> = (0..n).map(|i| [(i % 64) as Real * 0.8, 0.6 * (i % 2) as Real, 0.1 * (i / 64) as Real, 1.0]).collect();
    let all: Vec<u32> = members.iter().flat_map(|m| m.nodes).collect();
    let (given, _) = sorted(n as usize, 2, &all, &[]);
    let columns = Columns::new(n as usize, n as usize, &[], &members, &[]).unwrap();
    let [first, second] = &columns.nodes;
    let along = |e: usize, l: usize| [first, second].iter().all(|i| i.get()[e + l] == i.get()[e] + l as u32);
    for e in 0..given.len() {
        let run = (1..255.min(given.len() - e)).find(|l| !along(e, *l)).unwrap_or(255.min(given.len() - e));
        assert_eq!(usize::from(columns.runs[e]), run);
    }
    assert!(columns.runs.iter().any(|run| *run >= 16));
    for iterations in [1, 2] {
        let mut x = start.clone();
        let mut links = Projected::<Distance, Linear, 2, 1, 1, 0>::new(n as usize, n as usize, &[], &members, &[]).unwrap();
        // One link after the other, in double precision, by (elements.5) with masses of 1.
        let mut expected: Vec<[f64; 3]> = start.iter().map(|x| [0, 1, 2].map(|c| f64::from(x[c]))).collect();
        let mut lambda = vec![0.0; given.len()];
        for iteration in 0..iterations {
            links.project(&mut x, &Projection { h, before: &start, iteration, iterations, plain: None, walls: Walls::default() });
            for (e, lambda) in given.iter().zip(&mut lambda) {
                let Members { nodes: [a, b], rest: [rest], stiffness, .. } = members[*e as usize];
                let ([a, b], alpha) = ([a as usize, b as usize], 1.0 / (stiffness * h * h));
                let d: [f64; 3] = std::array::from_fn(|c| expected[b][c] - expected[a][c]);
                let length = d.iter().map(|d| d * d).sum::<f64>().sqrt();
                let step = -(length - rest + alpha * *lambda) / (2.0 + alpha);
                *lambda += step;
                for c in 0..3 {
                    expected[a][c] -= step * d[c] / length;
                    expected[b][c] += step * d[c] / length;
                }
            }
        }
        let off = |(x, e): (&Row, &[f64; 3])| (0..3).map(|c| (f64::from(x[c]) - e[c]).abs()).fold(0.0, f64::max);
        let most = x.iter().zip(&expected).map(off).fold(0.0, f64::max);
        // Some roundings of numbers up to 51.
        assert!(most < 200.0 * f64::from(Real::EPSILON), "{iterations}: {most}");
    }
}
#[test]
fn a_link_that_got_another_row_moves_that_one() {
    // Sixteen links side by side, whole packs of which lie one behind the other; one of them then ends elsewhere.
    let link = |i| Members { nodes: [i, i + 16], rest: [0.5], law: [], stiffness: f64::INFINITY, damping: 0.0 };
    let mut links = Projected::<Distance, Linear, 2, 1, 1, 0>::new(64, 64, &[], &(0..16).map(link).collect::<Vec<_>>(), &[]).unwrap();
    links.rewire(&[(3, 1, 40)]);
    let mut x: Vec<Row> = (0..64).map(|i| [0.0, (i / 16) as Real, 0.0, 1.0]).collect();
    let step = Projection { h: 0.01, before: &[], iteration: 0, iterations: 1, plain: None, walls: Walls::default() };
    links.project(&mut x, &step);
    assert_eq!([2, 18, 3, 40, 19].map(|i| x[i][1]), [0.25, 0.75, 0.75, 1.25, 1.0]);
}
