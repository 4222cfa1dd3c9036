import { h, type Page } from "../dom";
export const page: Page = (main) => {
  main.append(h("p", {}, "soon"));
  return () => {};
};
