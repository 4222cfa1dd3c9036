use super::*;
use proptest::prelude::*;

fn value(text: &str) -> f64 {
    let x = Vec3 { x: 0.3, y: -1.2, z: 2.5 };
    Formula::new(text, 1, Of::Motion).unwrap().at(0.7, x, Vec3 { x: 4.0, y: 5.0, z: 6.0 })[0]
}

fn fault(text: &str) -> String {
    Formula::new(text, 1, Of::Place).unwrap_err()
}

#[test]
fn operators_bind_as_in_mathematics() {
    let (t, x, y, z) = (0.7_f64, 0.3_f64, -1.2_f64, 2.5_f64);
    let cases = [
        ("1 + 2*3", 7.0),
        ("8 - 3 - 2", 3.0),
        ("8/4/2", 1.0),
        ("-x^2", -(x * x)),
        ("2^3^2", 512.0),
        ("2**3", 8.0),
        ("2^-1", 0.5),
        ("2*-x", -2.0 * x),
        ("--3 - -2", 5.0),
        (" ( x+y ) * z ", (x + y) * z),
        ("1e-3 + .5 + 2.", 2.501),
        ("sin(t) + cos( x )*tan(y)", t.sin() + x.cos() * y.tan()),
        ("atan2(y, x) + hypot(x, y, z)", y.atan2(x) + (x * x + y * y + z * z).sqrt()),
        ("asin(x) + acos(x) - pi/2", 0.0),
        ("exp(ln(z)) + log10(1000) + sqrt(abs(y))", z + 3.0 + 1.2_f64.sqrt()),
        ("min(x, y, z) + max(x, y) + floor(y) + ceil(y) + sign(y)", -1.2 + 0.3 - 2.0 - 1.0 - 1.0),
        ("mod(y, 1) + step(0, y) + step(0, z)", -1.2 + 2.0 + 0.0 + 1.0),
        ("smoothstep(0, 5, z) + clamp(z, 0, 1) + mix(1, 3, 0.25)", 0.5 + 1.0 + 1.5),
        ("vx*vy - vz", 14.0),
        ("tanh(x) - sinh(x)/cosh(x)", 0.0),
        ("z^2.5 - pow(z, 2.5) + e", std::f64::consts::E),
        ("(x < 1) + 10*(x > 1) + 100*(x <= 0.3) + 1000*(x >= y) + 1e4*(x == y) + 1e5*(x != y)", 1.0 + 100.0 + 1000.0 + 1e5),
        ("2*x + 1 < z*1", 1.0),
        ("if(t < 0.5, 7, if(y < 0, 8, 9))", 8.0),
    ];
    for (text, expected) in cases {
        assert!((value(text) - expected).abs() < 1e-14 * (1.0 + expected.abs()), "{text} = {}, not {expected}", value(text));
    }
}

#[test]
fn faults_are_named() {
    for (text, message) in [
        ("foo*2", "\"foo*2\": unknown name \"foo\"; did you mean \"floor\"? (known: t, x, y, z, pi, e, sin, cos,"),
        ("sine(x)", "unknown name \"sine\"; did you mean \"sin\"?"),
        ("vx", "unknown name \"vx\""),
        ("1/0", "a division gives inf, expected a finite number"),
        ("sqrt(-1)*x", "sqrt gives NaN"),
        ("1e999", "too large"),
        ("sin(1, 2)", "sin of 2 values, expected one"),
        ("max(1)", "max of 1 values, expected two or more"),
        ("sin", "\"sin\" is a function; write sin(...)"),
        ("x(2)", "\"x\" is no function"),
        ("(x", "a \"(\" that is never closed"),
        ("x)", "a \")\" that closes nothing"),
        ("x +", "ends too early"),
        ("", "ends too early"),
        ("2 x", "cannot be read from \"x\" on"),
        ("x $ 2", "cannot be read from \"$ 2\" on"),
        ("[x, y]", "2 components, expected one"),
        ("0 < x < 1", "write (0 < x)*(x < 1) for both of two"),
        ("x = 1", "comparisons are <, <=, >, >=, ==, !="),
        ("if(x > 1, 2)", "if of 2 values, expected three"),
    ] {
        let found = fault(text);
        assert!(found.contains(message), "{text}: {found}");
    }
    assert!(Formula::new("[-y, x]", 3, Of::Place).unwrap_err().contains("2 components, expected 3"));
    for text in ["(".repeat(40) + "x" + &")".repeat(40), "-".repeat(40) + "x", "x^".repeat(40) + "x", "x+".repeat(600) + "x"] {
        let found = fault(&text);
        assert!(found.contains("nested") || found.contains("long"), "{found}");
    }
}

#[test]
fn columns_have_the_bits_of_single_places() {
    // Two blocks and a part; time alone, place and constants mixed.
    let rows: Vec<Row> = (0..300).map(|i| [i as super::super::Real * 0.01, 1.0, (i % 7) as super::super::Real, 0.0]).collect();
    let formula = Formula::new("[sin(t)*x^2 - y/(2 + cos(x)), 3*t, clamp(z, 1, 4)*vy + exp(2)]", 3, Of::Motion).unwrap();
    assert!(formula.varies() && !Formula::new("sin(t) + 2", 1, Of::Motion).unwrap().varies());
    let mut seen = 0;
    formula.rows(0.4, &rows, &rows, |i, value| {
        let x = crate::math::xyz64(rows[i]);
        assert_eq!(value.map(f64::to_bits), formula.at(0.4, x, x).map(f64::to_bits));
        let by_hand = 0.4_f64.sin() * x.x * x.x - x.y / (2.0 + x.x.cos());
        assert!((value[0] - by_hand).abs() < 1e-13 && value[1] == 3.0 * 0.4);
        seen += 1;
    });
    assert_eq!(seen, 300);
}

#[test]
fn a_line_has_the_bits_of_its_points() {
    let formula = Formula::new("[sin(t)*x^2 - y/(2 + cos(z)), if(x < 1.5, sin(3*y), x*z), 3*t + exp(z)]", 3, Of::Place).unwrap();
    let x = |i: usize| 0.01 * i as f64;
    for component in 0..3 {
        let mut seen = 0;
        formula.along(component, 0.4, 300, x, [0.7, -1.3], |i, value| {
            let point = Vec3 { x: x(i), y: 0.7, z: -1.3 };
            assert_eq!(value.to_bits(), formula.at(0.4, point, point)[component].to_bits());
            seen += 1;
        });
        assert_eq!(seen, 300);
    }
}

proptest! {
    #[test]
    fn no_text_panics(text in "[-+*/^()<>=!x,y.0-9 e\\[\\]sin_µ]{0,60}") {
        if let Ok(formula) = Formula::new(&text, 1, Of::Motion) {
            formula.at(0.0, Vec3 { x: 1.0, y: 2.0, z: 3.0 }, Vec3 { x: 0.0, y: 0.0, z: 0.0 });
        }
    }
}
