/** Limits of failures and files sent to the page. */
import type { Failure, Files } from "./protocol";

/** More mistakes than this nobody reads; a page that lists all of a hostile scene's stands still. */
const MOST_ISSUES = 100;
/** Longest message of one mistake, and of all together: names and words of scenes may have megabytes. */
const LONGEST = { one: 600, all: 6000 };

const cut = (text: string, most: number): string => (text.length > most ? `${text.slice(0, most)} …` : text);

/** A failure that a page can show. */
export function readable(failure: Failure): Failure {
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
