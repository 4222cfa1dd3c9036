"""`make audit`: what it makes of what the tools say; and, without any network, the licences of all that tumble depends on."""

import json
import shutil
import subprocess
import tomllib
from typing import Any

import audit
import pytest

ALLOWED = set(tomllib.loads((audit.ROOT / "deny.toml").read_text())["licenses"]["allow"])


def done(code: int, out: Any = "", err: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.CompletedProcess([], code, out if isinstance(out, str) else json.dumps(out), err)


def test_what_cannot_be_asked_is_no_all_clear() -> None:
    # As pip-audit ends where the registry has no such interface: with 0.
    skipped = {"dependencies": [{"name": "a", "skip_reason": "Dependency not found on PyPI"}], "fixes": []}
    for finding in (
        audit.judge_python("p", done(0, skipped)),
        audit.judge_python("p", done(1, "", "Traceback\nConnectionError: no such host\n")),
        audit.judge_python("p", done(0, {"dependencies": []})),
        audit.judge_node("n", done(1, {"message": "405 Method Not Allowed", "statusCode": 405})),
        audit.judge_node("n", done(127, "", "npm: No such file or directory")),
        audit.judge_node("n", done(1, "not json", "")),
        audit.judge_rust(
            "r", done(1, "", '{"type": "log", "fields": {"level": "ERROR", "message": "failed to fetch"}}\n')
        ),
        audit.judge_rust("r", done(127, "", "cargo-deny: No such file or directory")),
    ):
        assert finding.bad is None and "NOT ASKED" in str(finding), finding
    assert "no such host" in audit.judge_python("p", done(1, "", "Traceback\nno such host\n")).text
    assert "405" in audit.judge_node("n", done(1, {"message": "405 Method Not Allowed"})).text
    assert (
        "failed to fetch"
        in audit.judge_rust(
            "r", done(1, "", '{"type":"log","fields":{"level":"ERROR","message":"failed to fetch"}}')
        ).text
    )
    assert audit.ask("/nowhere/tool").returncode == 127


def test_faults_are_found_and_named() -> None:
    faulty = {
        "dependencies": [{"name": "a", "version": "1", "vulns": [{"id": "PYSEC-1"}]}, {"name": "b", "skip_reason": "?"}]
    }
    assert audit.judge_python("p", done(1, faulty)) == audit.Finding("p", True, "a 1: PYSEC-1")
    counts = {"vulnerabilities": {"total": 1}, "dependencies": {"total": 9}}
    told = {"metadata": counts, "vulnerabilities": {"left-pad": {"severity": "high"}}}
    assert audit.judge_node("n", done(1, told)) == audit.Finding("n", True, "left-pad: high")
    error = json.dumps({"type": "diagnostic", "fields": {"severity": "error", "message": "unsound"}})
    warning = json.dumps({"type": "diagnostic", "fields": {"severity": "warning", "message": "old"}})
    assert audit.judge_rust("r", done(1, "", f"{warning}\n{error}\n{error}\nsummary")) == audit.Finding(
        "r", True, "unsound"
    )


def test_clean_is_clean(capsys: pytest.CaptureFixture[str]) -> None:
    packages = {"dependencies": [{"name": "a", "version": "1", "vulns": []}]}
    counts = {"vulnerabilities": {"total": 0}, "dependencies": {"total": 9}}
    clean = [
        audit.judge_python("p", done(0, packages)),
        audit.judge_node("n", done(0, {"metadata": counts, "vulnerabilities": {}})),
        audit.judge_rust("r", done(0)),
    ]
    assert [finding.bad for finding in clean] == [False, False, False]
    missing, bad = audit.Finding("m", None, ""), audit.Finding("b", True, "")
    assert audit.main([], [lambda _: clean]) == 0
    assert "nothing is known" in capsys.readouterr().out
    assert audit.main([], [lambda _: clean, lambda _: [missing]]) == 3
    assert "not an all-clear: m could not be asked" in capsys.readouterr().out
    assert audit.main([], [lambda _: [bad], lambda _: [missing]]) == 1


def allowed(licence: str) -> bool:
    """Whether a licence expression can be met with licences that deny.toml allows."""
    words = licence.replace("/", " OR ").replace("(", " ( ").replace(")", " ) ").split()

    def one() -> bool:
        if words[0] == "(":
            words.pop(0)
            found = any_of()
            assert words.pop(0) == ")"
            return found
        name = words.pop(0)
        if words[:1] == ["WITH"]:
            name = f"{name} WITH {words[1]}"
            del words[:2]
        return name in ALLOWED

    def all_of() -> bool:
        found = one()
        while words[:1] == ["AND"]:
            words.pop(0)
            found = one() and found
        return found

    def any_of() -> bool:
        found = all_of()
        while words[:1] == ["OR"]:
            words.pop(0)
            found = all_of() or found
        return found

    found = any_of()
    assert not words
    return found


def test_expressions_of_licences_are_understood() -> None:
    assert (
        allowed("MIT OR GPL-3.0-only")
        and allowed("GPL-3.0-only/MIT")
        and allowed("(GPL-3.0-only OR MIT) AND Unicode-3.0")
    )
    assert allowed("Apache-2.0 WITH LLVM-exception")
    for bad in (
        "GPL-3.0-only",
        "MIT AND GPL-3.0-only",
        "GPL-3.0-only OR LGPL-2.1",
        "(MIT OR ISC) AND GPL-2.0",
        "MIT WITH x",
    ):
        assert not allowed(bad), bad


@pytest.mark.skipif(shutil.which("cargo") is None, reason="no cargo here")
def test_the_licences_of_all_crates_are_allowed() -> None:
    # Of the platforms that are built here, whose crates are there: nothing has to be fetched.
    host = audit.ask("rustc", "-vV").stdout.partition("host: ")[2].split()[0]
    platforms = [f"--filter-platform={platform}" for platform in (host, "wasm32-unknown-unknown")]
    told = audit.ask("cargo", "metadata", "--locked", "--format-version", "1", *platforms)
    assert told.returncode == 0, told.stderr
    packages = json.loads(told.stdout)["packages"]
    assert len(packages) > 100
    assert [f"{p['name']}: {p['license']}" for p in packages if not (p["license"] and allowed(p["license"]))] == []
    registry = "registry+https://github.com/rust-lang/crates.io-index"
    assert {p["source"] for p in packages} == {None, registry}


def test_the_licences_of_the_browsers_packages_are_allowed() -> None:
    packages = json.loads((audit.ROOT / "web" / "package-lock.json").read_text())["packages"]
    assert len(packages) > 50
    assert [
        f"{name}: {p.get('license')}" for name, p in packages.items() if not allowed(p.get("license", "none"))
    ] == []
    away = [
        p["resolved"]
        for p in packages.values()
        if not p.get("resolved", "https://registry.npmjs.org/").startswith("https://registry.npmjs.org/")
    ]
    assert away == []
