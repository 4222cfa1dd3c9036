import { MAPS as OF } from "../engine/looks";

/** Maps of colours, as in the pictures that `tumble render` makes: seventeen colours each (sRGB), linear between them. */
const MAPS = {
  viridis: "440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1fa088 28ae80 3fbc73 5ec962 84d44b addc30 d8e219 fde725",
  cividis: "00224e 002e6a 1a386f 32436d 434e6c 535a6d 61656f 6f7073 7d7c78 8c8878 9b9476 aba072 bcae6c cdbb63 dec958 f0d846 fee838",
  inferno: "000004 0b0724 210c4a 3d0965 57106e 71196e 8a226a a32c61 bc3754 d24644 e45a31 f1731d f98e09 fcac11 f9cb35 f2ea69 fcffa4",
  RdBu_r: "053061 175290 2a71b2 3f8ec0 6bacd1 9bc9e0 c2ddec e0ecf3 f7f6f6 fbe5d8 fbccb4 f5aa89 e48066 d05548 ba2832 930e26 67001f",
  PuOr_r: "2d004b 451871 5f3a91 7b6aa8 9990bf b7b1d5 cfcfe5 e4e5f0 f7f7f6 fce8cd fed59f fdbc6b ee9b39 d97b12 bd6109 9e4c07 7f3b08",
  PRGn: "40004b 621a6e 7f3c8d 9568a6 ae8bbd c7abd2 dec9e2 ede2ee f6f7f6 e4f2e0 cbeac5 abdda5 7ec37f 50a65a 298440 10632b 00441b",
  // Grey in the middle: thin links without strain must be seen before light and dark.
  strain: "163a9e 1c48ab 2257b8 2766c5 2d74d2 467ec6 6087ba 7990ad 929aa1 a68c85 b97d68 cc6e4c e06030 d24e28 c43d1f b62c16 a81a0e",
} as const;

export type MapName = keyof typeof MAPS;

/** Colours of what only a page shows. */
const OWN: Record<string, MapName> = { difference: "RdBu_r", strain: "strain" };

export const mapOf = (column: string): MapName => OWN[column] ?? (OF[column] as MapName | undefined) ?? "viridis";

function stops(name: MapName): number[][] {
  return MAPS[name].split(" ").map((code) => [0, 2, 4].map((i) => parseInt(code.slice(i, i + 2), 16)));
}

/** A map as 256 pixels of RGBA, sRGB. */
export function table(name: MapName): Uint8Array {
  const known = stops(name);
  const out = new Uint8Array(256 * 4);
  for (let i = 0; i < 256; i++) {
    const t = (i / 255) * (known.length - 1);
    const k = Math.min(Math.floor(t), known.length - 2);
    for (let c = 0; c < 3; c++) out[4 * i + c] = Math.round(known[k][c] + (t - k) * (known[k + 1][c] - known[k][c]));
    out[4 * i + 3] = 255;
  }
  return out;
}

/** A map as a CSS gradient from left to right. */
export function gradient(name: MapName): string {
  return `linear-gradient(90deg, ${stops(name)
    .map((c) => `rgb(${c.join(" ")})`)
    .join(", ")})`;
}
