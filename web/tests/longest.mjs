/** A reporter of node:test: the ten longest tests. */
export default async function* longest(events) {
  const seen = [];
  for await (const { type, data } of events) {
    if ((type === "test:pass" || type === "test:fail") && data.details.type !== "suite")
      seen.push([data.details.duration_ms / 1000, data.file?.split("/").pop() ?? "", data.name]);
  }
  seen.sort((a, b) => b[0] - a[0]);
  yield "\nthe ten longest\n";
  for (const [seconds, file, name] of seen.slice(0, 10)) yield `${seconds.toFixed(1).padStart(6)} s  ${file}  ${name}\n`;
}
