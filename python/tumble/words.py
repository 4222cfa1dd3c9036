"""The reference page of the scene language, from its JSON Schema: `python -m tumble.words > docs/scene.md`."""

from typing import Any

from tumble import columns, measures
from tumble._engine import Scene

Schema = dict[str, Any]

HEAD = """# Scene reference

Generated from the schema by `python -m tumble.words`; a test keeps it up to date. A scene is a TOML or JSON file or a
Python dict. Lengths are in metres, z is up; a key without a default is required.

```toml
version = 1
[[system]]
integrator = "implicit_euler"
substeps = 4
[[sheet]]
name = "flag"
size = [1.0, 0.6]
resolution = [20, 12]                          # masses along each side, x first
links = { structural = 500.0, shear = { modulus = 200.0, damping = 0.1 }, bend = 5.0 }
pin = ["corner 0 0", "edge x-", { center = [0.5, 0.3, 0.0], radius = 0.1 }]
[[force]]
kind = "drag"                                  # `kind` selects the type of a force or field
rate = 0.2
[[collider]]
name = "ball"
shape = { sphere = { radius = 0.3 } }          # the single key selects the type of a shape
[[collider]]
name = "bunny"
shape = { mesh = { path = "bunny.ply" } }
```

Only masses collide with solids: between two masses a sheet may cut into a sharp edge, and thin objects may pass through. Where
that matters, give the collider `edges = true` and the system `self_contact`."""


def page() -> str:
    """The whole page in Markdown."""
    schema = Scene.schema()
    definitions: dict[str, Schema] = schema["$defs"]
    lines = [HEAD, "", "## Scene", "", schema.get("description", ""), "", *_table(schema, definitions)]
    for name in _order(schema, definitions):
        definition = definitions[name]
        lines += ["", f"## {name}", "", definition.get("description", ""), ""]
        if "properties" in definition:
            lines += _table(definition, definitions)
        branches: list[Schema] = definition.get("oneOf") or definition.get("anyOf") or []
        for branch in branches:
            lines += _branch(branch, definitions)
    lines += ["", *_books()]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _books() -> list[str]:
    """What comes out: the numbers of the ledger and the columns."""
    lines = [
        "## Numbers of the ledger",
        "",
        "What nothing in the scene measures is `nan` in `ledger.csv` and `None` in Python.",
        "",
    ]
    lines += ["| number | what | unit |", "|---|---|---|"]
    for measure in (*measures.LEDGER, *measures.REPORT):
        if measure.columns:
            names = ", ".join(f"`{column}`" for column in measure.columns)
            lines.append(f"| {names} | {measure.doc} | {_unit(measure.unit)} |")
    lines += [
        "",
        "## Columns",
        "",
        "Those of frames leave if `output.columns` names them, but for what is marked with *.",
    ]
    lines += ["", "| column | what | of each | unit | in |", "|---|---|---|---|---|"]
    for column in columns.COLUMNS.values():
        mark = "" if column.asked or not column.in_frames else "*"
        where = "frames" if column.in_frames else "static"
        places = ", ".join(column.places)
        lines.append(f"| `{column.name}`{mark} | {column.doc} | {places} | {_unit(column.unit)} | {where} |")
    return lines


def _unit(unit: str) -> str:
    return "–" if unit == "1" else unit


def _order(schema: Schema, definitions: dict[str, Schema]) -> list[str]:
    """Definitions in the order in which the schema first names them."""
    found: list[str] = []

    def visit(node: Any) -> None:
        if isinstance(node, dict):
            reference = node.get("$ref", "")
            name = reference.rpartition("/")[2]
            if name in definitions and name not in found:
                found.append(name)
                visit(definitions[name])
            for key, value in node.items():
                if key != "$defs":
                    visit(value)
        elif isinstance(node, list):
            for value in node:
                visit(value)

    visit(schema)
    return found


def _branch(branch: Schema, definitions: dict[str, Schema]) -> list[str]:
    text = branch.get("description", "").replace("\n", " ")
    if "const" in branch:
        return [f"- `{branch['const']}`: {text}"]
    if "enum" in branch:
        return [f"- `{word}`" for word in branch["enum"]]
    if "properties" not in branch:
        return [f"- {_type(branch, definitions)}: {text}"]
    kind = branch["properties"].get("kind", {}).get("const")
    keys = list(branch["properties"])
    if kind is not None:
        title = f'### kind = "{kind}"'
    elif len(keys) == 1:
        title = f"### {keys[0]}"
        inner = branch["properties"][keys[0]]
        if "properties" in inner:
            return ["", title, "", text, "", *_table(inner, definitions)]
        if "$ref" in inner:
            return ["", title, "", f"{text} Its keys are those of {_type(inner, definitions)}."]
    else:
        title = "### a table"
    return ["", title, "", text, "", *_table(branch, definitions)]


def _table(schema: Schema, definitions: dict[str, Schema]) -> list[str]:
    required = schema.get("required", [])
    lines = ["| key | description | type | default |", "|---|---|---|---|"]
    for key, value in schema.get("properties", {}).items():
        if key == "kind" and "const" in value:
            continue
        text = value.get("description", "").replace("\n", " ").replace("|", "\\|")
        default = "" if key in required else _default(value)
        lines.append(f"| `{key}` | {text} | {_type(value, definitions)} | {default} |")
    return lines


def _default(value: Schema) -> str:
    default = value.get("default")
    if default is None or isinstance(default, dict) or default == []:
        return "–"
    return f"`{str(default).lower() if isinstance(default, bool) else default}`"


def _type(value: Schema, definitions: dict[str, Schema]) -> str:
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        unit = f" {value['x-unit']}" if "x-unit" in value else ""
        return f"[{name}](#{name.lower()}){unit}"
    for key in ("anyOf", "oneOf"):
        if key in value:
            own = {"x-unit": value["x-unit"]} if "x-unit" in value else {}
            branches = [own | branch for branch in value[key] if branch.get("type") != "null"]
            return " or ".join(_type(branch, definitions) for branch in branches)
    unit = f" {value['x-unit']}" if value.get("x-unit", "1") != "1" else ""
    types = value.get("type", "")
    kind = next((t for t in types if t != "null"), "") if isinstance(types, list) else types
    if kind == "array":
        of = _type(value.get("items", {}), definitions)
        count = value.get("minItems") if value.get("minItems") == value.get("maxItems") else None
        return f"{count or 'list of'} × {of}{unit}" if count else f"list of {of}{unit}"
    bounds = [
        f"{sign} {value[key]:g}"
        for sign, key in ((">=", "minimum"), (">", "exclusiveMinimum"), ("<=", "maximum"), ("<", "exclusiveMaximum"))
        if key in value
    ]
    return " ".join([kind, *bounds]) + unit


if __name__ == "__main__":
    print(page(), end="")
