declare module "virtual:sources" {
  const sources: Record<string, string[]>;
  export default sources;
}

declare module "virtual:scenes" {
  const scenes: Record<string, { title: string; precision: "single" | "double" }>;
  export default scenes;
}
