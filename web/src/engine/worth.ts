/** Limits of failures and files sent to the page. */
import type { Failure, Files } from "./protocol";

/** More mistakes than this nobody reads; a page that lists all of a hostile scene's stands still. */
const MOST_ISSUES = 100;
/** Longest message of one mistake, and of all together: names and words of scenes may have megabytes. */
const LONGEST = { one: 600, all: 6000 };

const cut = (text: string, most: number): string => (text.length > most ? `${text.slice(0, most)} …` : text);

const KEY = /^\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=/;
const HEADER = /^\s*\[+\s*([^\]]+?)\s*\]/;

/** What a line of TOML defines for the second time, and the line of the first where that is found. */
export function twice(toml: string, line: number): string | null {
  const lines = toml.split("\n", line);
  const own = lines[line - 1] ?? "";
  const before = lines.slice(0, -1);
  const first = (k: number): string => (k < 0 ? "" : `, first in line ${k + 1}`);
  const header = HEADER.exec(own)?.[1];
  if (header) return `the table "${header}"${first(before.findLastIndex((l) => HEADER.exec(l)?.[1] === header))}`;
  // Of an inline table the key is one of several in the line.
  const keys = [...own.replace(/"[^"]*"|'[^']*'/g, (s) => " ".repeat(s.length)).matchAll(/([\w-]+)\s*=(?!=)/g)].map((m) => m[1]);
  const inline = keys.find((key, i) => keys.indexOf(key) < i);
  if (inline) return `"${inline}"`;
  const key = KEY.exec(own)?.[1];
  if (!key) return null;
  const table = before.slice(before.findLastIndex((l) => HEADER.test(l)) + 1);
  const found = table.findLastIndex((l) => KEY.exec(l)?.[1] === key);
  return `"${key.replace(/^"(.*)"$/, "$1")}"${first(found < 0 ? -1 : before.length - table.length + found)}`;
}

/** A failure that a page can show, of a scene's text. */
export function readable(failure: Failure, toml = ""): Failure {
  return short(failure.message.includes(DUPLICATE) ? named(failure, toml) : failure);
}

const DUPLICATE = "duplicate key";

function named(failure: Failure, toml: string): Failure {
  const add = (message: string, line?: number | null) => {
    const what = line && message.endsWith(DUPLICATE) ? twice(toml, line) : null;
    return what ? `${message}: ${what}` : message;
  };
  return {
    ...failure,
    message: add(failure.message, failure.line),
    issues: failure.issues.map((issue) => ({ ...issue, message: add(issue.message, issue.line) })),
  };
}

function short(failure: Failure): Failure {
  const { issues } = failure;
  const lines = failure.message.split("\n", MOST_ISSUES).map((line) => cut(line, LONGEST.one));
  return {
    ...failure,
    message: `${cut(lines.join("\n"), LONGEST.all)}${issues.length > MOST_ISSUES ? "\n… and more" : ""}`,
    path: failure.path && cut(failure.path, LONGEST.one),
    issues: issues
      .slice(0, MOST_ISSUES)
      .map((issue) => ({ ...issue, path: cut(issue.path, LONGEST.one), message: cut(issue.message, LONGEST.one) })),
  };
}

/** Of the files that a person brought those that a scene misses; one that was dropped has no folder before its name. */
export function asked(missing: string[], files: Files): Map<string, Uint8Array> {
  const there = new Map(Object.entries(files));
  const found = new Map<string, Uint8Array>();
  for (const path of missing) {
    const bytes = there.get(path) ?? there.get(path.split(/[/\\]/).pop()!);
    if (bytes) found.set(path, bytes);
  }
  return found;
}
