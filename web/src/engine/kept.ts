/** Snapshots by frame, within a bound of memory: the first always, the others ever more thinly. */
export class Kept {
  private readonly states = new Map<number, Uint8Array>();
  private bytes = 0;
  private stride = 1;

  /** Small states are many before they are large: their number has a bound of its own. */
  constructor(
    private readonly most: number,
    private readonly count = 8192,
  ) {}

  /** Keeps a frame if it is one of those that are kept now. */
  add(frame: number, save: () => Uint8Array): void {
    if (frame % this.stride !== 0 && frame !== 0) return;
    if (frame !== 0 && this.first * 2 > this.most) return;
    this.forget(frame);
    const state = save();
    this.states.set(frame, state);
    this.bytes += state.length;
    this.thin();
  }

  private thin(): void {
    while ((this.bytes > this.most || this.states.size > this.count) && this.states.size > 2) {
      this.stride *= 2;
      for (const kept of [...this.states.keys()]) if (kept % this.stride !== 0) this.forget(kept);
    }
  }

  /** The same states within another bound. They are shared, not copied. */
  copy(most: number): Kept {
    const made = new Kept(most);
    made.stride = this.stride;
    for (const [frame, state] of this.states) {
      made.states.set(frame, state);
      made.bytes += state.length;
    }
    made.thin();
    return made;
  }

  /** The state of the kept frame at or before this one. */
  at(frame: number): Uint8Array {
    let found = 0;
    for (const kept of this.states.keys()) if (kept <= frame && kept > found) found = kept;
    const state = this.states.get(found);
    if (!state) throw new Error("the first frame was not stored");
    return state;
  }

  /** Forgets all frames from this one on, but never the first. */
  cut(frame: number): void {
    for (const kept of [...this.states.keys()]) if (kept >= Math.max(frame, 1)) this.forget(kept);
  }

  /** Frames that are kept, rising. */
  frames(): number[] {
    return [...this.states.keys()].sort((a, b) => a - b);
  }

  private get first(): number {
    return this.states.get(0)?.length ?? 0;
  }

  private forget(frame: number): void {
    this.bytes -= this.states.get(frame)?.length ?? 0;
    this.states.delete(frame);
  }
}
