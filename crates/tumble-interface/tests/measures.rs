//! The tables of measures: merging, and that the schema of `[expect]` says the same.

use std::collections::HashSet;
use tumble_interface::engine::{Ledger, StepReport};
use tumble_interface::measures::{About, BOUNDS, Bound, LEDGER, Merge, REPORT};
use tumble_interface::scene::{Expect, Scene};

#[test]
fn systems_merge_as_the_table_says() {
    let soft = Ledger { time: 2.0, mass: 3.0, momentum: [1.0, 0.0, -1.0], stretch: Some(1.5), contacts: Some(2), ..Ledger::default() };
    let gas = Ledger { time: 2.0, mass: 0.5, momentum: [0.5, 2.0, 0.0], divergence: Some(0.25), speed: Some(4.0), ..Ledger::default() };
    let mut total = Ledger::default();
    [&soft, &gas, &soft].iter().for_each(|books| total.add_system(books));
    assert_eq!((total.time, total.mass, total.momentum), (2.0, 6.5, [2.5, 2.0, -2.0]));
    assert_eq!((total.stretch, total.contacts, total.speed, total.divergence), (Some(1.5), Some(4), Some(4.0), Some(0.25)));
    // Not measured is not zero.
    assert_eq!((total.heat, total.volume, total.angular_momentum), (None, None, None));
    assert!(total.measures("contacts") && total.measures("energy") && !total.measures("heat") && !total.measures("warmth"));
}

#[test]
fn later_states_replace_earlier_ones_and_efforts_add_up() {
    let mut books = Ledger { stretch: Some(3.0), mass: 2.0, ..Ledger::default() };
    books.add_interval(&Ledger { stretch: Some(1.0), mass: 1.0, ..Ledger::default() });
    assert_eq!((books.stretch, books.mass), (Some(1.0), 1.0));

    let one = StepReport { steps: 2, sweeps: 20, residual: Some(1e-3), pressure: vec![1.0, 0.1], ..StepReport::default() };
    let two = StepReport { steps: 3, sweeps: 6, residual: Some(1e-5), step_range: Some((0.1, 0.2)), ..StepReport::default() };
    let mut total = one.clone();
    total.add_interval(&two);
    assert_eq!((total.steps, total.sweeps, total.residual, total.step_range), (5, 26, Some(1e-3), Some((0.1, 0.2))));
    assert_eq!((total.courant, total.pressure), (None, vec![1.0, 0.1]));
}

#[test]
fn a_residual_that_is_no_number_stays() {
    let mut report = StepReport::default();
    [1e-3, f64::NAN, 1e-2].into_iter().for_each(|residual| report.left(residual));
    assert!(report.residual.is_some_and(f64::is_nan));
    for (first, second) in [(1e-2, f64::NAN), (f64::NAN, 1e-2)] {
        let [mut total, later] = [first, second].map(|residual| StepReport { residual: Some(residual), ..StepReport::default() });
        total.add_interval(&later);
        assert!(total.residual.is_some_and(f64::is_nan), "{first} and {second}");
    }
    report.passed(0.5);
    assert_eq!(report.courant, Some(0.5));
}

#[test]
fn what_leaves_is_what_the_tables_say() {
    for (tree, table) in [(serde_json::to_value(Ledger::default()), LEDGER), (serde_json::to_value(StepReport::default()), REPORT)] {
        let tree = tree.unwrap();
        assert_eq!(tree.as_object().unwrap().len(), table.len());
        for measure in table {
            assert_eq!(tree[measure.name].is_null(), measure.optional, "{}", measure.name);
            assert!(!measure.doc.is_empty() && measure.doc.ends_with('.'), "{measure:?}");
            // A maximum over systems has a value that is about something smaller than the world.
            assert_eq!(measure.systems == Merge::Max, measure.about != About::World, "{}", measure.name);
        }
    }
    let columns: Vec<&str> = LEDGER.iter().chain(REPORT).flat_map(|measure| measure.columns).copied().collect();
    assert_eq!(columns.iter().collect::<HashSet<_>>().len(), columns.len());
    assert!(columns.contains(&"sweeps"));
}

#[test]
fn every_bound_of_the_schema_has_a_measure_of_its_unit() {
    let schema = Scene::schema();
    let words = schema["$defs"]["Expect"]["properties"].as_object().unwrap();
    let known: HashSet<&str> = BOUNDS.iter().map(|bound| bound.name).collect();
    let asked: HashSet<&str> = words.keys().map(String::as_str).filter(|word| *word != "probe").collect();
    assert_eq!(known, asked);
    for bound in BOUNDS {
        assert_eq!(words[bound.name]["x-unit"].as_str().unwrap_or("1"), bound.unit(), "{}", bound.name);
    }
    let expect = Expect { max_speed: Some(1.0), broken_links: Some(0), ..Expect::default() };
    assert_eq!(Bound::asked(&expect).map(|bound| bound.name).collect::<Vec<_>>(), ["max_speed", "broken_links"]);
}
