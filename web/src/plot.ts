/** Curves against time, live. */
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { h, show } from "./dom";

export interface Curve {
  label: string;
  /** Which of `CURVES`. */
  color: number;
  dash?: number[];
  width?: number;
  /** Goes on across points that are not there. */
  spans?: boolean;
}

/** Colours of curves on light and on dark, each with enough contrast. */
const CURVES = ["#2a6f97", "#c8553d", "#2d7d46", "#8a6d00", "#7b4fa3", "#0e7c86"];
const CURVES_DARK = ["#6db6e3", "#f08a73", "#6cc98a", "#d9bc4a", "#bd98e0", "#5cc8d2"];

const css = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
export const isDark = () => document.documentElement.dataset.theme === "dark";
/** The colour of a curve now, and as the page's own styles take it. */
export const curveColor = (k: number) => (isDark() ? CURVES_DARK : CURVES)[k % CURVES.length];
export const curveStyle = (k: number) => `light-dark(${CURVES[k % CURVES.length]}, ${CURVES_DARK[k % CURVES.length]})`;

interface PlotOptions {
  /** Read to those who do not see it. */
  label: string;
  x?: string;
  log?: boolean;
  height?: number;
  /** A line across at this x. */
  mark?: () => number | null;
}

/** Powers of ten, eight at most. */
function decades(low: number, high: number): number[] {
  const [a, b] = [Math.ceil(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];
  const stride = Math.max(1, Math.ceil((b - a + 1) / 8));
  return Array.from({ length: Math.max(0, Math.floor((b - a) / stride) + 1) }, (_, i) => 10 ** (a + i * stride));
}

/** Powers of ten alone. */
function power(v: number): string {
  const e = Math.log10(v);
  return Math.abs(e - Math.round(e)) < 1e-6 ? `10${raised(Math.round(e))}` : "";
}

const raised = (n: number): string => [...String(n)].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(c)])).join("");

export class Plot {
  readonly element: HTMLElement;
  private plot: uPlot | null = null;
  private data: uPlot.AlignedData = [[]];
  private readonly observer: ResizeObserver;
  private waiting = 0;
  private readonly repaint = () => this.build();

  constructor(
    private curves: Curve[],
    private readonly options: PlotOptions,
  ) {
    this.element = h("div", { class: "plot", role: "img", "aria-label": options.label });
    this.observer = new ResizeObserver(() => {
      const width = this.element.clientWidth;
      if (!this.plot) this.build();
      else if (Math.abs(width - this.plot.width) > 1) this.plot.setSize({ width, height: this.height });
    });
    this.observer.observe(this.element);
    addEventListener("themechange", this.repaint);
  }

  private get height(): number {
    return this.options.height ?? 150;
  }

  private build(): void {
    const width = this.element.clientWidth;
    if (!width) return;
    this.plot?.destroy();
    const { x, log, mark } = this.options;
    const axis = (side: number): uPlot.Axis => ({
      stroke: css("--muted"),
      grid: { stroke: css("--line"), width: 1 },
      ticks: { show: false },
      font: "11px system-ui, sans-serif",
      size: side === 3 ? 58 : 26,
      gap: 4,
      values: (_u, values) => values.map((v) => (v === null ? "" : side === 3 && log ? power(v) : show(v, 3))),
      side,
      splits: side === 3 && log ? (_u, _k, low, high) => decades(low, high) : undefined,
      space: side === 3 ? 24 : 60,
    });
    this.plot = new uPlot(
      {
        width,
        height: this.height,
        cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
        legend: { show: false },
        padding: [8, 8, 0, 0],
        scales: {
          x: { time: false },
          y: {
            distr: log ? 3 : 1,
            range: log ? (_u, low, high) => (low > 0 && high > 0 ? [low / 1.2, Math.max(high * 1.2, low * 10)] : [0.1, 10]) : undefined,
          },
        },
        axes: [axis(2), axis(3)],
        series: [
          { label: x ?? "" },
          ...this.curves.map(
            (c): uPlot.Series => ({
              label: c.label,
              stroke: curveColor(c.color),
              width: c.width ?? 1.75,
              dash: c.dash,
              spanGaps: c.spans,
              points: { show: false },
              value: (_u, v) => show(v),
            }),
          ),
        ],
        hooks: mark
          ? {
              draw: [
                (u) => {
                  const at = mark();
                  if (at === null || at < (u.scales.x.min ?? 0) || at > (u.scales.x.max ?? 0)) return;
                  const px = u.valToPos(at, "x", true);
                  u.ctx.save();
                  u.ctx.strokeStyle = css("--muted");
                  u.ctx.setLineDash([3, 3]);
                  u.ctx.beginPath();
                  u.ctx.moveTo(px, u.bbox.top);
                  u.ctx.lineTo(px, u.bbox.top + u.bbox.height);
                  u.ctx.stroke();
                  u.ctx.restore();
                },
              ],
            }
          : {},
      },
      this.data,
      this.element,
    );
  }

  setCurves(curves: Curve[]): void {
    this.curves = curves;
    this.data = [[], ...curves.map(() => [])];
    this.build();
  }

  /** x, then the values of each curve. Drawn with the next picture. */
  set(data: (number | null)[][]): void {
    this.data = data as uPlot.AlignedData;
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      if (this.plot) this.plot.setData(this.data);
      else this.build();
    });
  }

  close(): void {
    cancelAnimationFrame(this.waiting);
    this.observer.disconnect();
    removeEventListener("themechange", this.repaint);
    this.plot?.destroy();
    this.plot = null;
  }
}

/** Labels of curves with their colours, and what they are now. */
export function legend(curves: Curve[]): { element: HTMLElement; set: (values: string[]) => void } {
  const values = curves.map(() => h("span", { class: "value" }));
  const element = h(
    "ul",
    { class: "curves" },
    ...curves.map((c, i) =>
      h("li", {}, h("i", { class: c.dash ? "dash" : false, style: `--curve:${curveStyle(c.color)}` }), h("span", {}, c.label), values[i]),
    ),
  );
  return { element, set: (texts) => texts.forEach((t, i) => (values[i].textContent = t)) };
}
