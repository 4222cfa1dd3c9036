//! Columns as typed arrays.

use js_sys::{Array, Float32Array, Float64Array, Object, Reflect, Uint32Array};
use tumble_interface::{Column, Data};
use wasm_bindgen::{JsCast, JsValue};

/// An object without a prototype: names come from the scene, and one of them may be `__proto__`.
fn table() -> Object {
    Object::create(JsValue::NULL.unchecked_ref())
}

fn put(table: &Object, key: &str, value: &JsValue) {
    // A plain object takes every key.
    let _ = Reflect::set(table, &key.into(), value);
}

/// object -> column -> { data, width, points, unit }
pub fn columns(columns: Vec<Column>) -> Object {
    let all = table();
    for column in columns {
        let data: JsValue = match &column.data {
            Data::F32(data) => Float32Array::from(&data[..]).into(),
            Data::F64(data) => Float64Array::from(&data[..]).into(),
            Data::U32(data) => Uint32Array::from(&data[..]).into(),
        };
        let points: Array = column.points.iter().map(|n| JsValue::from_f64(*n as f64)).collect();
        let one = table();
        put(&one, "data", &data);
        put(&one, "width", &JsValue::from_f64(column.width as f64));
        put(&one, "points", &points);
        put(&one, "unit", &column.unit.into());
        let key: JsValue = column.object.as_str().into();
        let of_object = match Reflect::get(&all, &key) {
            Ok(found) if found.is_object() => found.unchecked_into(),
            _ => table(),
        };
        put(&of_object, &column.name, &one);
        put(&all, &column.object, &of_object);
    }
    all
}

/// { columns, about }
pub fn with_columns(all: Vec<Column>, about: &str) -> Object {
    let one = table();
    put(&one, "columns", &columns(all));
    put(&one, "about", &about.into());
    one
}
