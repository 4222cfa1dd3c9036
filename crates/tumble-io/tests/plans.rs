//! Plans of each format, what is wrong with them, and what repair makes of that.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use proptest::prelude::*;
use tumble_io::plan::{Area, Floor, Format, Kind, Opening, Options, Plan, Point, lint, read, repair};

/// Two rooms with a door between them and an exit, in metres: the same in each format.
const WKT: &str = "# a comment
wall LINESTRING (6 2.4, 6 4, 0 4, 0 0, 6 0, 6 1.6)
LINESTRING (6 4, 9 4, 9 3)
wall LINESTRING (6 0,
  9 0, 9 1)
door \"office door\" LINESTRING (6 1.6, 6 2.4)
exit LINESTRING (9 1, 9 3)
start count=20 POLYGON ((0.5 0.5, 5 0.5, 5 3.5, 0.5 3.5, 0.5 0.5))
";

const GEOJSON: &str = r#"{"type": "FeatureCollection", "features": [
 {"type": "Feature", "properties": {"kind": "wall"}, "geometry": {"type": "MultiLineString", "coordinates":
   [[[6,2.4],[6,4],[0,4],[0,0],[6,0],[6,1.6]], [[6,4],[9,4],[9,3]], [[6,0],[9,0],[9,1]]]}},
 {"type": "Feature", "properties": {"Layer": "A-DOOR", "name": "office door"}, "geometry": {"type": "LineString", "coordinates": [[6,1.6],[6,2.4]]}},
 {"type": "Feature", "properties": {"kind": "exit"}, "geometry": {"type": "LineString", "coordinates": [[9,1],[9,3]]}},
 {"type": "Feature", "properties": {"kind": "start", "count": "20"}, "geometry": {"type": "Polygon", "coordinates":
   [[[0.5,0.5],[5,0.5],[5,3.5],[0.5,3.5],[0.5,0.5]]]}}]}"#;

/// In centimetres of paper, y down; the second wall by `use`, the rest turned and shifted by transforms.
const SVG: &str = r##"<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="i" xmlns:xlink="x" width="9cm" viewBox="0 0 9 4">
<defs><path id="corner" d="M6 0 h3 v1"/></defs>
<g inkscape:label="Wände"><path d="M6 1.6 V0 H0 V4 h6 v-1.6"/><use xlink:href="#corner"/>
<g transform="translate(0,4) scale(1 -1)"><path d="m6,0 3,0 0,1"/></g></g>
<g id="layer2"><line class="door" x1="6" y1="2.4" x2="6" y2="1.6" data-name="office door"/></g>
<g transform="matrix(1 0 0 1 9 3)"><path class="exit" d="M 0 0 V -2"/></g>
<rect class="start" x=".5" y=".5" width="4.5" height="3" data-count="20"/>
<g inkscape:label="old walls" style="display: none"><path d="M0 0 L 9 4"/></g></svg>"##;

/// In millimetres. The door is a symbol: a block with a leaf and an arc, mirrored and turned.
fn dxf() -> String {
    let line = |layer: &str, p: [f64; 4]| format!("0\nLINE\n8\n{layer}\n10\n{}\n20\n{}\n11\n{}\n21\n{}\n", p[0], p[1], p[2], p[3]);
    let corners = |points: &[[f64; 2]]| points.iter().map(|p| format!("10\n{}\n20\n{}\n", p[0], p[1])).collect::<String>();
    let polyline = |layer: &str, closed: u8, points: &[[f64; 2]]| {
        format!("0\nLWPOLYLINE\n8\n{layer}\n90\n{}\n70\n{closed}\n{}", points.len(), corners(points))
    };
    [
        "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n",
        "0\nSECTION\n2\nTABLES\n0\nTABLE\n2\nLAYER\n0\nLAYER\n2\nA-WALL-DEMO\n70\n0\n62\n-7\n0\nLAYER\n2\nTreppen\n70\n0\n62\n7\n0\nENDTAB\n0\nENDSEC\n",
        "0\nSECTION\n2\nBLOCKS\n0\nBLOCK\n2\nLEAF\n10\n0\n20\n0\n",
        // The leaf stands open along y; shut it lies along x.
        &line("0", [0.0, 0.0, 0.0, 1.0]),
        "0\nARC\n8\n0\n10\n0\n20\n0\n40\n1\n50\n0\n51\n90\n0\nENDBLK\n0\nENDSEC\n",
        "0\nSECTION\n2\nENTITIES\n",
        &polyline("A-WALL", 0, &[[6000.0, 2400.0], [6000.0, 4000.0], [0.0, 4000.0], [0.0, 0.0], [6000.0, 0.0], [6000.0, 1600.0]]),
        &line("A-WALL", [6000.0, 4000.0, 9000.0, 4000.0]),
        &line("A-WALL", [9000.0, 4000.0, 9000.0, 3000.0]),
        &polyline("A-WALL", 0, &[[6000.0, 0.0], [9000.0, 0.0], [9000.0, 1000.0]]),
        &line("A-WALL-DEMO", [0.0, 0.0, 9000.0, 4000.0]),
        // Turned by 90 degrees: shut along y, from the hinge at y = 1600.
        "0\nINSERT\n8\nA-DOOR\n2\nLEAF\n10\n6000\n20\n1600\n41\n800\n42\n800\n50\n90\n",
        &line("EXIT", [9000.0, 1000.0, 9000.0, 3000.0]),
        &polyline("start", 1, &[[500.0, 500.0], [5000.0, 500.0], [5000.0, 3500.0], [500.0, 3500.0]]),
        "0\nTEXT\n8\nA-ANNO\n1\nOffice\n0\nENDSEC\n0\nEOF\n",
    ]
    .concat()
}

fn plan(text: &str, format: Format) -> Plan {
    read(text.as_bytes(), format, &Options::default()).unwrap()
}

/// Length of all walls, in metres.
fn length(plan: &Plan) -> f64 {
    let far = |w: &[Point]| ((w[1][0] - w[0][0]).powi(2) + (w[1][1] - w[0][1]).powi(2)).sqrt();
    plan.scale * plan.walls.iter().flat_map(|wall| wall.windows(2)).map(far).sum::<f64>()
}

fn near(a: [Point; 2], b: [Point; 2], scale: f64) {
    let close = |p: Point, q: Point| (0..2).all(|k| (scale * p[k] - q[k]).abs() < 1e-6);
    assert!((close(a[0], b[0]) && close(a[1], b[1])) || (close(a[0], b[1]) && close(a[1], b[0])), "{a:?} {b:?}");
}

#[test]
fn each_format_gives_the_same_plan() {
    let files = [
        (WKT.to_owned(), Format::Wkt, 1.0),
        (GEOJSON.to_owned(), Format::GeoJson, 1.0),
        (SVG.to_owned(), Format::Svg, 0.01),
        (dxf(), Format::Dxf, 0.001),
    ];
    for (text, format, scale) in files {
        let found = plan(&text, format);
        assert_eq!(found.faults, Vec::<String>::new(), "{format:?}");
        assert!((found.scale - scale).abs() < 1e-12, "{format:?}: {}", found.scale);
        // An SVG of 9 cm is drawn to a scale, here 1:100, and upside down.
        let metres = if format == Format::Svg { 1.0 } else { found.scale };
        assert!((length(&found) * metres / found.scale - 27.2).abs() < 1e-9, "{format:?}: {}", length(&found));
        let turned = |p: [f64; 2]| if format == Format::Svg { [p[0], p[1] - 4.0] } else { p };
        assert_eq!((found.doors.len(), found.exits.len(), found.starts.len()), (1, 1, 1), "{format:?}");
        near(found.doors[0].line, [turned([6.0, 1.6]), turned([6.0, 2.4])], metres);
        near(found.exits[0].line, [turned([9.0, 1.0]), turned([9.0, 3.0])], metres);
        assert_eq!(found.starts[0].points.len(), 4);
        if format != Format::Dxf {
            assert_eq!(found.doors[0].name.as_deref(), Some("office door"));
            assert_eq!(found.starts[0].count, Some(20.0));
        }
        assert!(found.is_plausible(metres), "{format:?}");
        assert!(!found.is_plausible(0.001 * metres), "{format:?}");
    }
}

#[test]
fn layers_that_are_hidden_or_empty_are_listed() {
    let found = plan(&dxf(), Format::Dxf);
    let layer = |name: &str| found.layers.iter().find(|layer| layer.name == name).unwrap();
    assert!(layer("A-WALL-DEMO").hidden && layer("A-WALL-DEMO").kind.is_none());
    assert!(layer("Treppen").holds.is_empty() && layer("Treppen").kind == Some(Kind::Stair));
    assert_eq!(layer("A-ANNO").holds["text"], 1);
    assert_eq!((layer("A-WALL").holds["line"], layer("A-WALL").holds["polyline"]), (2, 2));
    // One that is named is taken, hidden or not, and no other of that kind.
    let options = Options { scale: None, layers: vec![(Kind::Wall, "a-wall-demo".to_owned())] };
    assert_eq!(read(dxf().as_bytes(), Format::Dxf, &options).unwrap().walls.len(), 1);
}

#[test]
fn arcs_and_curves_are_within_half_a_centimetre() {
    // A half circle of 10 m as a bulge of 1, and as a path of cubic curves within 0.03 % of it.
    let bulge = "0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\n8\nwall\n70\n0\n10\n0\n20\n0\n42\n1\n10\n20\n20\n0\n0\nENDSEC\n0\nEOF\n";
    let path = r#"<svg><path class="wall" d="M0 0 A10 10 0 0 0 20 0"/></svg>"#;
    for (text, format) in [(bulge, Format::Dxf), (path, Format::Svg)] {
        let found = plan(text, format);
        let wall = &found.walls[0];
        assert!((20..400).contains(&wall.len()), "{}", wall.len());
        let off = |p: Point| (((p[0] - 10.0).powi(2) + p[1].powi(2)).sqrt() - 10.0).abs();
        assert!(wall.iter().all(|p| off(*p) < 0.004), "{format:?}");
        assert!(wall.windows(2).all(|w| off([0.5 * (w[0][0] + w[1][0]), 0.5 * (w[0][1] + w[1][1])]) < 0.008), "{format:?}");
        assert!(wall.iter().all(|p| p[1] < 1e-9), "{format:?}: bulges to the right");
        assert_eq!(wall.last().copied().map(|p| [p[0].round(), p[1].round()]), Some([20.0, -0.0]));
    }
}

#[test]
fn blocks_of_rows_and_mirrored_ones_are_exploded() {
    let text = "0\nSECTION\n2\nBLOCKS\n0\nBLOCK\n2\nB\n10\n1\n20\n0\n0\nLINE\n8\n0\n10\n1\n20\n0\n11\n3\n21\n1\n0\nENDBLK\n0\nENDSEC\n\
        0\nSECTION\n2\nENTITIES\n0\nINSERT\n8\nwall\n2\nB\n10\n5\n20\n5\n41\n2\n42\n-1\n70\n2\n71\n3\n44\n10\n45\n20\n0\nINSERT\n8\nwall\n2\nB\n10\n5\n20\n0\n230\n-1\n\
        0\nENDSEC\n0\nEOF\n";
    let found = plan(text, Format::Dxf);
    let mut starts: Vec<Point> = found.walls.iter().map(|wall| wall[0]).collect();
    starts.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    assert_eq!(starts, [[-5.0, 0.0], [5.0, 5.0], [5.0, 25.0], [5.0, 45.0], [15.0, 5.0], [15.0, 25.0], [15.0, 45.0]]);
    assert!(found.walls.iter().any(|wall| wall[..] == [[5.0, 5.0], [9.0, 4.0]]));
    assert!(found.walls.iter().any(|wall| wall[..] == [[-5.0, 0.0], [-7.0, 1.0]]));
}

#[test]
fn double_doors_and_thin_outlines_are_one_gate_each() {
    let arc = |x: f64, from: f64| format!("0\nARC\n8\ndoor\n10\n{x}\n20\n0\n40\n1\n50\n{from}\n51\n{}\n", from + 90.0);
    // Hinges at 0 and 2: leaves meet at 1. Both stand open along y, as walls beside them say.
    let walls = "0\nLINE\n8\nwall\n10\n-3\n20\n0\n11\n0\n21\n0\n0\nLINE\n8\nwall\n10\n2\n20\n0\n11\n5\n21\n0\n";
    let leaves = "0\nLINE\n8\ndoor\n10\n0\n20\n0\n11\n0\n21\n1\n0\nLINE\n8\ndoor\n10\n2\n20\n0\n11\n2\n21\n1\n";
    let thin = "0\nLWPOLYLINE\n8\ndoor\n70\n1\n10\n7\n20\n0\n10\n8\n20\n0\n10\n8\n20\n0.2\n10\n7\n20\n0.2\n";
    let text = format!("0\nSECTION\n2\nENTITIES\n{walls}{}{}{leaves}{thin}0\nENDSEC\n0\nEOF\n", arc(0.0, 0.0), arc(2.0, 90.0));
    let found = plan(&text, Format::Dxf);
    assert_eq!(found.faults, Vec::<String>::new());
    assert_eq!(found.doors.len(), 2, "{:?}", found.doors);
    near(found.doors[0].line, [[0.0, 0.0], [2.0, 0.0]], 1.0);
    near(found.doors[1].line, [[7.0, 0.1], [8.0, 0.1]], 1.0);
}

#[test]
fn files_that_are_no_plans_say_why() {
    let cases = [
        ("", Format::Dxf, "empty"),
        ("AC1027", Format::Dxf, "DWG"),
        ("AutoCAD Binary DXF", Format::Dxf, "binary"),
        ("0\nSECTION\nx\n", Format::Dxf, "no group code"),
        ("0\nSECTION\n2\nENTITIES\n0\nENDSEC\n", Format::Dxf, "cut off"),
        ("<svg", Format::Svg, "no XML"),
        ("<html/>", Format::Svg, "expected <svg>"),
        (r#"<svg><path class="wall" d="M0 0 L x"/></svg>"#, Format::Svg, "its path"),
        (r#"<svg><line class="wall" x2="3%"/></svg>"#, Format::Svg, "no length"),
        (r##"<svg><g id="a"><use href="#a"/></g></svg>"##, Format::Svg, "without end"),
        ("{}", Format::GeoJson, "FeatureCollection"),
        ("[", Format::GeoJson, "no JSON"),
        ("wall LINESTRING (0 0, 1", Format::Wkt, "never closed"),
        ("wall LINESTRING (0 0, 1 1e999)", Format::Wkt, "no finite number"),
        ("wall LINESTRING (0 0, 1)", Format::Wkt, "no points"),
        ("wall CIRCLE (0 0)", Format::Wkt, "no geometry"),
    ];
    for (text, format, part) in cases {
        let message = read(text.as_bytes(), format, &Options::default()).unwrap_err();
        assert!(message.contains(part) && !message.contains('\n') && message.chars().count() < 320, "{message}");
    }
}

fn floor() -> Floor {
    let opening = |name: &str, from: Point, to: Point| Opening { name: name.to_owned(), from, to };
    Floor {
        walls: vec![
            vec![[6.0, 2.4], [6.0, 4.0], [0.0, 4.0], [0.0, 0.0], [6.0, 0.0], [6.0, 1.6]],
            vec![[6.0, 4.0], [9.0, 4.0], [9.0, 3.0]],
            vec![[6.0, 0.0], [9.0, 0.0], [9.0, 1.0]],
        ],
        door: vec![opening("door", [6.0, 1.6], [6.0, 2.4])],
        exit: vec![opening("out", [9.0, 1.0], [9.0, 3.0])],
        start: vec![Area {
            name: "people".to_owned(),
            points: vec![[0.5, 0.5], [5.0, 0.5], [5.0, 3.5], [0.5, 3.5]],
            people: Some(20.0),
            exit: vec![],
        }],
        link: vec![],
        radius: 0.18,
    }
}

#[track_caller]
fn kinds(floor: &Floor) -> Vec<&'static str> {
    let found = lint(floor);
    assert!(found.iter().all(|finding| !finding.places.is_empty() && !finding.text.is_empty() && !finding.cure.is_empty()));
    found.iter().map(|finding| finding.kind).collect()
}

type Change = fn(&mut Floor);

/// What is done to a floor that is right, what is told then, and whether repair mends it.
const FAULTS: [(&str, bool, Change); 14] = [
    ("size", false, |f| f.walls.iter_mut().flatten().for_each(|p| *p = [1000.0 * p[0], 1000.0 * p[1]])),
    ("outside", false, |f| (f.exit[0].from, f.exit[0].to) = ([20.0, 1.0], [20.0, 3.0])),
    ("narrow", false, |f| (f.door[0].from, f.walls[0][5]) = ([6.0, 2.1], [6.0, 2.1])),
    ("closed", true, |f| f.walls.push(vec![[9.02, 0.9], [9.02, 3.1]])),
    ("crossed", false, |f| f.walls.push(vec![[8.0, 2.0], [9.5, 2.0]])),
    ("jamb", true, |f| f.door.push(Opening { name: "hole".to_owned(), from: [7.5, 0.05], to: [7.5, 3.98] })),
    ("double", true, |f| f.walls.push(vec![[1.0, 0.0], [3.0, 0.0]])),
    ("crossing", true, |f| f.walls.push(vec![[7.0, 1.0], [8.0, 3.0], [8.0, 1.0], [7.0, 3.0]])),
    ("sliver", true, |f| f.walls.push(vec![[7.0, 1.0], [7.3, 1.0], [7.3, 1.001], [7.0, 1.0]])),
    ("gap", true, |f| f.walls[2][0] = [6.05, 0.03]),
    ("start", false, |f| f.start[0].points.iter_mut().for_each(|p| p[0] -= 10.0)),
    ("locked", false, |f| f.walls.push(vec![[6.0, 1.6], [6.0, 2.0], [6.0, 2.4]])),
    ("full", false, |f| f.start[0].people = Some(200.0)),
    ("unused", false, |f| f.exit.push(Opening { name: "other".to_owned(), from: [1.0, 4.0], to: [2.0, 4.0] })),
];

#[test]
fn every_fault_is_told_and_mended_where_that_is_said() {
    assert_eq!(kinds(&floor()), Vec::<&str>::new());
    for (kind, mends, change) in FAULTS {
        let mut wrong = floor();
        change(&mut wrong);
        let told = kinds(&wrong);
        if kind == "unused" {
            // Behind the wall in which it stands.
            assert!(told.contains(&"closed"), "{told:?}");
            continue;
        }
        assert!(told.contains(&kind), "{kind}: {told:?}");
        let (mended, done) = repair(&wrong);
        if mends {
            assert!(done.iter().any(|finding| finding.kind == kind), "{kind}: {done:?}");
            let left: Vec<&str> = kinds(&mended).into_iter().filter(|left| *left == kind).collect();
            assert!(left.is_empty(), "{kind}: {:?}", lint(&mended));
            assert_eq!(repair(&mended).1, Vec::new(), "{kind}: repaired twice");
        }
    }
}

#[test]
fn a_plan_of_many_lines_is_looked_at_quickly() {
    // A grid of 20,000 walls of 3 m, each of which ends 0.05 m before the next.
    let wall = |k: usize| {
        let (x, y) = (4.0 * (k % 100) as f64, 4.0 * (k / 200) as f64);
        if (k / 100).is_multiple_of(2) { vec![[x + 0.05, y], [x + 4.0, y]] } else { vec![[x, y + 0.05], [x, y + 4.0]] }
    };
    let big = Floor { walls: (0..20_000).map(wall).collect(), door: vec![], exit: vec![], start: vec![], link: vec![], radius: 0.18 };
    let begin = std::time::Instant::now();
    assert!(kinds(&big).contains(&"gap"));
    let (mended, _) = repair(&big);
    assert!(!kinds(&mended).contains(&"gap"));
    assert!(begin.elapsed().as_secs() < 60, "{:?}", begin.elapsed());
}

#[test]
fn repair_leaves_a_plan_alone_that_is_right() {
    let (mended, done) = repair(&floor());
    assert_eq!((mended, done), (floor(), Vec::new()));
}

#[test]
fn a_wall_that_goes_on_through_a_gate_ends_at_its_jambs() {
    let mut wrong = floor();
    wrong.walls = vec![vec![[0.0, 0.0], [9.0, 0.0], [9.0, 4.0], [0.0, 4.0], [0.0, 0.0]], vec![[6.0, 0.0], [6.0, 4.0]]];
    assert!(kinds(&wrong).contains(&"closed"));
    let (mended, _) = repair(&wrong);
    assert_eq!(kinds(&mended), Vec::<&str>::new());
    let total: f64 =
        mended.walls.iter().flat_map(|wall| wall.windows(2)).map(|w| (w[1][0] - w[0][0]).abs() + (w[1][1] - w[0][1]).abs()).sum();
    assert!((total - (26.0 + 4.0 - 2.0 - 0.8)).abs() < 1e-9, "{total}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn changed_files_are_survived(which in 0..4_usize, at in any::<prop::sample::Index>(), cut in 0..40_usize, word in "[-0-9.e(),<>\"\n]{0,12}") {
        let files = [(dxf(), Format::Dxf), (SVG.to_owned(), Format::Svg), (GEOJSON.to_owned(), Format::GeoJson), (WKT.to_owned(), Format::Wkt)];
        let (text, format) = &files[which];
        let mut bytes = text.clone().into_bytes();
        let at = at.index(bytes.len());
        let end = (at + cut).min(bytes.len());
        bytes.splice(at..end, word.bytes());
        match read(&bytes, *format, &Options::default()) {
            Ok(plan) => {
                prop_assert!(plan.walls.iter().flatten().flatten().all(|x| x.is_finite()));
                let s = plan.scale;
                let metres = |p: Point| [s * p[0], s * p[1]];
                let gates = |gates: &[tumble_io::plan::Gate]| gates.iter().enumerate().map(|(k, g)| Opening { name: format!("{k}"), from: metres(g.line[0]), to: metres(g.line[1]) }).collect();
                let walls = plan.walls.iter().map(|wall| wall.iter().map(|p| metres(*p)).collect()).collect();
                let start = plan.starts.iter().map(|a| Area { name: String::new(), points: a.points.iter().map(|p| metres(*p)).collect(), people: a.count, exit: vec![] });
                let floor = Floor { walls, door: gates(&plan.doors), exit: gates(&plan.exits), start: start.collect(), link: vec![], radius: 0.18 };
                lint(&floor);
                let (mended, _) = repair(&floor);
                prop_assert!(mended.walls.iter().flatten().flatten().all(|x| x.is_finite()));
                lint(&mended);
            }
            Err(message) => prop_assert!(!message.is_empty() && !message.contains('\n') && message.chars().count() < 320, "{message}"),
        }
    }

    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        for format in Format::ALL {
            let _ = read(&bytes, format, &Options::default());
        }
    }
}

/// Two floors, the upper one drawn beside the lower: a name makes a pair, or a layer. The second line is drawn from its other end.
#[test]
fn lines_of_one_name_link_floors() {
    let wkt = "wall LINESTRING (0 0, 0 3)\nlink \"stairs\" LINESTRING (4 0, 4 3)\nlink \"stairs\" LINESTRING (14 3, 14 0)\n";
    let plan = read(wkt.as_bytes(), Format::Wkt, &Options::default()).unwrap();
    assert_eq!(plan.faults, Vec::<String>::new());
    assert_eq!(plan.links.len(), 1);
    assert_eq!((plan.links[0].name.as_str(), plan.links[0].lines), ("stairs", [[[4.0, 0.0], [4.0, 3.0]], [[14.0, 0.0], [14.0, 3.0]]]));
    let line = |layer: &str, x: f64| format!("0\nLINE\n8\n{layer}\n10\n{x}\n20\n0\n11\n{x}\n21\n3\n");
    let all = [line("A-WALL", 0.0), line("LINK-1", 4.0), line("LINK-1", 14.0), line("LINK-2", 5.0)].concat();
    let dxf = format!("0\nSECTION\n2\nENTITIES\n{all}0\nENDSEC\n0\nEOF\n");
    let plan = read(dxf.as_bytes(), Format::Dxf, &Options::default()).unwrap();
    assert_eq!(plan.links.iter().map(|link| link.name.as_str()).collect::<Vec<_>>(), ["LINK-1"]);
    assert!(plan.faults[0].contains("\"LINK-2\" has 1 line, expected 2") && plan.faults.len() == 1, "{:?}", plan.faults);
}

/// A room without a door of its own is left by a link, and is locked without it.
#[test]
fn a_link_is_a_way_out() {
    let mut plan = floor();
    let room = |x: f64| vec![[x, 1.0], [x, 4.0], [x + 4.0, 4.0], [x + 4.0, 0.0], [x, 0.0]];
    plan.walls.push(room(20.0));
    plan.start[0].points = vec![[21.0, 0.5], [23.5, 0.5], [23.5, 3.5], [21.0, 3.5]];
    plan.start[0].people = Some(10.0);
    // A wall closes the room, and there is a link across it.
    plan.walls.push(vec![[20.0, 0.0], [20.0, 1.0]]);
    assert!(kinds(&plan).contains(&"locked"));
    plan.link = vec![[[[3.0, 1.0], [3.0, 2.0]], [[22.0, 1.0], [22.0, 2.0]]]];
    assert!(!kinds(&plan).contains(&"locked") && !kinds(&plan).contains(&"link"));
    plan.link[0][1] = [[22.0, 1.0], [22.0, 2.2]];
    assert!(kinds(&plan).contains(&"link"));
}
