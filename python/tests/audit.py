"""Are there known faults in what tumble depends on, and are the licences such that it may? `make audit`.

cargo-deny for the Rust crates (rules in deny.toml), pip-audit for the Python packages of .venv, npm audit for the browser's.
Each asks a database in the network. What cannot be asked is told, and is no all-clear. Ends with 1 where something was found,
with 3 where nothing was, but not everything could be asked; `--no-install` asks only with what is there.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DENY = ROOT / "target" / "tools" / "cargo-deny"
OWN = ROOT / ".venv-audit"
"""pip-audit has an environment of its own, so that it does not audit itself."""


@dataclass(frozen=True)
class Finding:
    """Result of a query: `bad` is None if it could not be made."""

    subject: str
    bad: bool | None
    text: str

    def __str__(self) -> str:
        verdict = {True: "FOUND", False: "clean", None: "NOT ASKED"}[self.bad]
        return f"{self.subject:28} {verdict:10} {self.text}"


def ask(*command: str | Path, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Runs a command; one that is not there is one that failed."""
    try:
        return subprocess.run([str(c) for c in command], cwd=cwd, capture_output=True, text=True, check=False)
    except OSError as error:
        return subprocess.CompletedProcess([], 127, "", f"{command[0]}: {error.strerror}")


def last_line(text: str) -> str:
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "it does not say why")


def rust(install: bool) -> list[Finding]:
    """Licences, bans and sources need no network; advisories need that of RustSec."""
    subjects = {"Rust licences, sources": ("licenses", "bans", "sources"), "Rust advisories": ("advisories",)}
    tool = shutil.which("cargo-deny") or str(DENY / "bin" / "cargo-deny")
    if not Path(tool).is_file():
        made = ask("cargo", "install", "--quiet", "--locked", "cargo-deny", "--root", DENY) if install else None
        if made is None or made.returncode != 0:
            why = "is not installed" if made is None else f"cannot be installed: {last_line(made.stderr)}"
            return [Finding(subject, None, f"cargo-deny {why}") for subject in subjects]
    return [
        judge_rust(subject, ask(tool, "--format", "json", "check", *checks)) for subject, checks in subjects.items()
    ]


def judge_rust(subject: str, done: subprocess.CompletedProcess[str]) -> Finding:
    if done.returncode == 0:
        return Finding(subject, False, "deny.toml is kept")
    faults, logged = [], ""
    for line in done.stderr.splitlines():
        try:
            told = json.loads(line)
            kind, fields = told["type"], told["fields"]
        except (ValueError, KeyError, TypeError):
            logged = line
            continue
        if kind == "diagnostic" and fields.get("severity") == "error":
            faults.append(fields["message"])
        elif kind == "log" and fields.get("level") == "ERROR":
            logged = fields["message"]
    if faults:
        return Finding(subject, True, "; ".join(dict.fromkeys(faults)))
    return Finding(subject, None, f"cargo-deny: {last_line(logged)}")


def python(install: bool) -> list[Finding]:
    """The packages that are installed beside tumble."""
    subject = "Python packages"
    tool = OWN / "bin" / "pip-audit"
    if not tool.is_file():
        if not install:
            return [Finding(subject, None, "pip-audit is not installed")]
        made = ask(sys.executable, "-m", "venv", OWN)
        made = made if made.returncode != 0 else ask(OWN / "bin" / "pip", "install", "--quiet", "pip-audit>=2.10,<3")
        if made.returncode != 0:
            return [Finding(subject, None, f"pip-audit cannot be installed: {last_line(made.stderr)}")]
    listed = ask(sys.executable, "-m", "pip", "freeze", "--exclude-editable")
    pinned = [line for line in listed.stdout.splitlines() if "==" in line]
    if not pinned:
        return [Finding(subject, None, f"pip lists no packages: {last_line(listed.stderr)}")]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "requirements.txt"
        file.write_text("\n".join(pinned))
        done = ask(
            tool, "--requirement", file, "--no-deps", "--disable-pip", "--format", "json", "--progress-spinner", "off"
        )
    return [judge_python(subject, done)]


def judge_python(subject: str, done: subprocess.CompletedProcess[str]) -> Finding:
    try:
        packages = json.loads(done.stdout)["dependencies"]
    except (ValueError, KeyError):
        return Finding(subject, None, f"pip-audit: {last_line(done.stderr)}")
    faults = [f"{p['name']} {p['version']}: {v['id']}" for p in packages for v in p.get("vulns", ())]
    # pip-audit ends with 0 where its database does not answer.
    skipped = [p["name"] for p in packages if "skip_reason" in p]
    if faults:
        return Finding(subject, True, "; ".join(faults))
    if skipped or not packages:
        return Finding(subject, None, f"the database did not answer for {len(skipped)} of {len(packages)} packages")
    return Finding(subject, False, f"{len(packages)} packages")


def node(install: bool) -> list[Finding]:
    """The packages of web/package-lock.json."""
    return [judge_node("browser packages", ask("npm", "audit", "--json", cwd=ROOT / "web"))]


def judge_node(subject: str, done: subprocess.CompletedProcess[str]) -> Finding:
    try:
        told = json.loads(done.stdout)
        counts = told["metadata"]["vulnerabilities"]
    except (ValueError, KeyError):
        why = told.get("message") if done.stdout.strip().startswith("{") else None
        return Finding(subject, None, f"npm audit: {why or last_line(done.stderr)}")
    if counts["total"]:
        return Finding(
            subject, True, "; ".join(f"{name}: {v['severity']}" for name, v in told["vulnerabilities"].items())
        )
    return Finding(subject, False, f"{told['metadata']['dependencies']['total']} packages")


def main(arguments: Sequence[str], questions: Sequence[Callable[[bool], list[Finding]]] = (rust, python, node)) -> int:
    install = "--no-install" not in arguments
    findings = []
    for question in questions:
        for finding in question(install):
            print(finding, flush=True)
            findings.append(finding)
    if any(finding.bad for finding in findings):
        return 1
    missing = [finding.subject for finding in findings if finding.bad is None]
    print(f"not an all-clear: {', '.join(missing)} could not be asked" if missing else "nothing is known")
    return 3 if missing else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
