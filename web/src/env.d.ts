declare module "virtual:sources" {
  const sources: Record<string, string[]>;
  export default sources;
}
