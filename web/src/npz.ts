/** Frames as an NPZ file, which numpy.load reads: a zip of arrays, not compressed. */
import type { Column, Frame, Numbers } from "./engine/protocol";

const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c >>> 0;
});

function crc(data: Uint8Array): number {
  let c = 0xffffffff;
  for (const b of data) c = TABLE[(c ^ b) & 255] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}

function npy(data: Numbers, shape: number[]): Uint8Array {
  const kind = data instanceof Float64Array ? "<f8" : data instanceof Uint32Array ? "<u4" : "<f4";
  const words = `{'descr': '${kind}', 'fortran_order': False, 'shape': (${shape.join(", ")}${shape.length === 1 ? "," : ""}), }`;
  const padded = `${words.padEnd(64 * Math.ceil((words.length + 11) / 64) - 11)}\n`;
  const out = new Uint8Array(10 + padded.length + data.byteLength);
  out.set([0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59, 1, 0, padded.length & 255, padded.length >> 8]);
  out.set(new TextEncoder().encode(padded), 10);
  out.set(new Uint8Array(data.buffer, data.byteOffset, data.byteLength), 10 + padded.length);
  return out;
}

/** A column as Python's `World.columns` has it: n, n x width, or nx x ny (x nz) (x width). */
function array({ data, width, points }: Column): [Numbers, number[]] {
  const shape = points.length ? [...points] : [data.length / width];
  if (width > 1) shape.push(width);
  if (points.length < 2) return [data, shape];
  // Here the first axis is the fastest; in the file it is the slowest.
  const out = data.slice();
  const [nx, ny, nz = 1] = points;
  let to = 0;
  for (let i = 0; i < nx; i++)
    for (let j = 0; j < ny; j++)
      for (let k = 0; k < nz; k++) {
        const from = width * (i + nx * (j + ny * k));
        for (let d = 0; d < width; d++) out[to++] = data[from + d];
      }
  return [out, shape];
}

/** `frames` as "OBJECT/COLUMN/000012.npy", and "time.npy". */
export function npz(frames: Frame[]): Blob {
  const files: [string, Uint8Array][] = [["time", npy(Float64Array.from(frames.map((f) => f.time)), [frames.length])]];
  for (const frame of frames) {
    for (const [object, columns] of Object.entries(frame.columns)) {
      for (const [name, column] of Object.entries(columns)) {
        files.push([`${object}/${name}/${String(frame.index).padStart(6, "0")}`, npy(...array(column))]);
      }
    }
  }
  const parts: Uint8Array[] = [];
  const directory: Uint8Array[] = [];
  let at = 0;
  for (const [name, data] of files) {
    const path = new TextEncoder().encode(`${name}.npy`);
    const sum = crc(data);
    const head = (signature: number, extra: number) => {
      const view = new DataView(new ArrayBuffer(extra));
      view.setUint32(0, signature, true);
      return view;
    };
    const local = head(0x04034b50, 30);
    const central = head(0x02014b50, 46);
    central.setUint16(4, 20, true);
    for (const [view, base] of [
      [local, 4],
      [central, 6],
    ] as const) {
      view.setUint16(base, 20, true);
      view.setUint16(base + 2, 0x0800, true);
      view.setUint16(base + 8, 0x21, true);
      view.setUint32(base + 10, sum, true);
      view.setUint32(base + 14, data.length, true);
      view.setUint32(base + 18, data.length, true);
      view.setUint16(base + 22, path.length, true);
    }
    central.setUint32(42, at, true);
    parts.push(new Uint8Array(local.buffer), path, data);
    directory.push(new Uint8Array(central.buffer), path);
    at += 30 + path.length + data.length;
  }
  const size = directory.reduce((s, d) => s + d.length, 0);
  const end = new DataView(new ArrayBuffer(22));
  end.setUint32(0, 0x06054b50, true);
  end.setUint16(8, files.length, true);
  end.setUint16(10, files.length, true);
  end.setUint32(12, size, true);
  end.setUint32(16, at, true);
  return new Blob([...parts, ...directory, new Uint8Array(end.buffer)] as Uint8Array<ArrayBuffer>[], { type: "application/zip" });
}
