/** A way that time went: the frames that are kept of it, within a bound of memory, and the books of all. */
import type { Frame, Ledger } from "./engine/protocol";

const sizeOf = (frame: Frame): number =>
  Object.values(frame.columns).reduce((s, o) => s + Object.values(o).reduce((t, c) => t + c.data.byteLength, 0), 0);

export class Way {
  ledgers: Ledger[] = [];
  /** Index of its last frame. */
  last = 0;
  private readonly frames = new Map<number, Frame>();
  private bytes = 0;

  /** `most`: bytes that the numbers of all frames may take. */
  constructor(private readonly most: number) {}

  /** The same way, within another bound. Frames are shared, not copied. */
  copy(most: number): Way {
    const made = new Way(most);
    for (const frame of this.frames.values()) made.put(frame);
    made.ledgers = [...this.ledgers];
    made.last = this.last;
    made.thin();
    return made;
  }

  /** Adds a frame. What came after it is gone. */
  take(frame: Frame): void {
    if (frame.index < this.last) this.forget(frame.index + 1);
    this.put(frame);
    this.last = frame.index;
    const first = frame.index - frame.ledgers.length + 1;
    frame.ledgers.forEach((ledger, i) => (this.ledgers[Math.max(first, 0) + i] = ledger));
    this.ledgers.length = frame.index + 1;
    this.thin();
  }

  private put(frame: Frame): void {
    this.drop(frame.index);
    this.frames.set(frame.index, frame);
    this.bytes += sizeOf(frame);
  }

  /** Every second one goes, oldest first, until the rest fits; first and last ones stay, and those before the last as long as they can. */
  private thin(): void {
    if (this.bytes <= this.most) return;
    for (let near = 64; this.bytes > 0.75 * this.most && this.frames.size > 2; near = Math.max(near >> 1, 1)) {
      const indices = this.kept;
      for (let i = 1; i < indices.length - near && this.bytes > 0.75 * this.most; i += 2) this.drop(indices[i]);
    }
  }

  /** Keeps only so many frames, the last ones. */
  trim(count: number): void {
    for (const old of this.kept) if (old < this.last - count) this.drop(old);
    // Nor the books of long ago.
    for (let i = this.last - 3000; i >= 0 && this.ledgers[i]; i--) delete this.ledgers[i];
  }

  private drop(index: number): void {
    const frame = this.frames.get(index);
    if (!frame) return;
    this.bytes -= sizeOf(frame);
    this.frames.delete(index);
  }

  /** Forgets all frames from this one on. */
  forget(from: number): void {
    for (const index of [...this.frames.keys()]) if (index >= from) this.drop(index);
  }

  frame(index: number): Frame | undefined {
    return this.frames.get(index);
  }

  /** Indices of frames that are kept, rising. */
  get kept(): number[] {
    return [...this.frames.keys()].sort((a, b) => a - b);
  }

  /** The kept frame nearest to an index. */
  near(index: number): Frame | undefined {
    const kept = this.kept;
    return kept.length ? this.frames.get(kept.reduce((a, b) => (Math.abs(b - index) < Math.abs(a - index) ? b : a))) : undefined;
  }

  get memory(): number {
    return this.bytes;
  }
}
