//! Overrides of single values of a scene.

use super::methods::resolve;
use tumble_interface::tree::{Node, Value};
use tumble_interface::{Scene, SceneError};

/// Sets the value at a dotted path of a scene, as `Node::set` does. Where it lies in a system that the scene leaves to defaults,
/// these are listed first.
pub fn set(node: &mut Node, path: &str, value: Node) -> Result<(), SceneError> {
    list_systems(node, path);
    node.set(path, value)
}

/// Applies an override `path=value`, as `Node::set_text` does, with the same addition.
pub fn set_text(node: &mut Node, assignment: &str) -> Result<(), SceneError> {
    list_systems(node, assignment.split('=').next().unwrap_or_default().trim());
    node.set_text(assignment)
}

/// What is wrong with the scene is told when it is read.
fn list_systems(node: &mut Node, path: &str) {
    let listed = |of: &Node| !matches!(&of.value, Value::List(items) if items.is_empty());
    if !path.starts_with("system.") || node.entry("system").is_some_and(listed) {
        return;
    }
    let Ok(scene) = Scene::from_tree(node) else { return };
    let word = |text: &str| Node::from(Value::Text(text.into()));
    let table = |name: &str, method: &str| Value::Table(vec![("name".into(), word(name)), ("method".into(), word(method))]);
    let systems = resolve(scene).system.iter().map(|plan| table(&plan.name, plan.method.name()).into()).collect();
    // A scene is a table, so that this cannot fail.
    let _ = node.set("system", Value::List(systems).into());
}
