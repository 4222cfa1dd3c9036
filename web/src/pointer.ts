/** Pointer interaction with a world: pointers pull masses by a spring, and stir gases. Fingers work side by side. */
import type { Vector3 } from "three";
import type { Vector } from "./engine/protocol";
import type { Session } from "./session";
import type { Stage } from "./view/stage";

interface Held {
  mass?: { point: Vector3; object: string; row: number };
  last: Vector3 | null;
  time: number;
  busy: boolean;
}

interface Stirring {
  /** Density of dye that comes with the stirring [kg/m³]. */
  dye?: () => number;
  /** Radius over the width of the picture. */
  size?: () => number;
  /** Whether a pointer stirs while it plays that only passes over, without dye. */
  hovers?: boolean;
}

/** A pass over a point is some events long; each gives a part of the pointer's velocity. */
const SHARE = 0.22;

export function pointers(
  canvas: HTMLCanvasElement,
  stage: Stage,
  session: Session,
  { dye, size, hovers = false }: Stirring = {},
): () => void {
  const held = new Map<number, Held>();
  const down = (event: PointerEvent) => {
    if (event.button !== 0 || !session.info) return;
    const gas = stage.stirred;
    const near = gas ? null : stage.nearest(event, event.pointerType === "touch" ? 34 : 18);
    if (!near && !gas) return;
    event.stopPropagation();
    canvas.setPointerCapture(event.pointerId);
    stage.turning = false;
    held.set(event.pointerId, {
      mass: near ?? undefined,
      last: stage.under(event, near?.point ?? gas?.through),
      time: performance.now(),
      busy: false,
    });
    void session.branch().catch(() => {});
    if (!session.playing) session.play();
  };
  /** A pointer without a button. */
  let over: Held | null = null;
  const passing = (event: PointerEvent): Held | null => {
    const stirs = hovers && session.playing && !event.buttons && event.pointerType !== "touch";
    over = stirs ? (over ?? { last: null, time: 0, busy: false }) : null;
    return over;
  };
  const leave = () => (over = null);
  const move = (event: PointerEvent) => {
    const own = held.get(event.pointerId) ?? passing(event);
    if (!own) return;
    const gas = stage.stirred;
    const at = stage.under(event, own.mass?.point ?? gas?.through);
    if (!at) return;
    if (own.mass) {
      const { object, row, point } = own.mass;
      const x = session.shown?.columns[object]?.position?.data;
      if (x) stage.spring(point.clone().set(x[3 * row], x[3 * row + 1], x[3 * row + 2]), at);
      if (own.busy) return;
      own.busy = true;
      void session
        .grab(object, row, at.toArray() as Vector)
        .catch(() => {})
        .finally(() => (own.busy = false));
      return;
    }
    if (!gas || own.busy) return;
    if (!own.last) {
      own.last = at;
      own.time = performance.now();
      return;
    }
    const seconds = Math.max((performance.now() - own.time) / 1000, 0.004);
    const push = at
      .clone()
      .sub(own.last)
      .multiplyScalar(SHARE / seconds);
    own.last = at;
    own.time = performance.now();
    own.busy = true;
    void session
      .stir(gas.name, at.toArray() as Vector, push.toArray() as Vector, stage.width * (size?.() ?? 1 / 30), own === over ? 0 : dye?.())
      .catch(() => {})
      .finally(() => (own.busy = false));
  };
  const up = (event: PointerEvent) => {
    const own = held.get(event.pointerId);
    if (!own) return;
    held.delete(event.pointerId);
    stage.spring();
    stage.turning = true;
    if (own.mass) void session.release().catch(() => {});
  };
  // Before the camera's own listener hears of it.
  canvas.addEventListener("pointerdown", down, { capture: true });
  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("pointerleave", leave);
  return () => {
    canvas.removeEventListener("pointerdown", down, { capture: true });
    canvas.removeEventListener("pointermove", move);
    canvas.removeEventListener("pointerup", up);
    canvas.removeEventListener("pointercancel", up);
    canvas.removeEventListener("pointerleave", leave);
  };
}
