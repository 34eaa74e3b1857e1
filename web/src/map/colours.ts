/** Colours that suit the colour-blind: cividis for values, viridis for uncertainty (17 stops each). */

const stops = {
  cividis:
    "00224e 002e6a 1a386f 32436d 434e6c 535a6d 61656f 6f7073 7d7c78 8c8878 9b9476 aba072 bcae6c cdbb63 dec958 f0d846 fee838",
  viridis:
    "440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1fa088 28ae80 3fbc73 5ec962 84d44b addc30 d8e219 fde725",
  // Blue below zero, orange above, pale in the middle.
  difference:
    "0b3c7d 2166ac 4393c3 92c5de d1e5f0 f4f4f0 fde0b6 fdb863 e08214 b35806 7f3b08",
} as const;

export type Scale = keyof typeof stops;

/** 256 colours, (256 * 3,) bytes. */
function table(name: Scale): Uint8Array {
  const given = stops[name].split(" ").map((hex) => Number.parseInt(hex, 16));
  const made = new Uint8Array(768);
  for (let i = 0; i < 256; i++) {
    const place = (i / 255) * (given.length - 1);
    const low = Math.min(Math.floor(place), given.length - 2);
    const share = place - low;
    for (let channel = 0; channel < 3; channel++) {
      const shift = 16 - 8 * channel;
      const from = ((given[low] ?? 0) >> shift) & 255;
      const to = ((given[low + 1] ?? 0) >> shift) & 255;
      made[3 * i + channel] = Math.round(from + share * (to - from));
    }
  }
  return made;
}

const tables: Record<Scale, Uint8Array> = {
  cividis: table("cividis"),
  viridis: table("viridis"),
  difference: table("difference"),
};

export function coloursOf(scale: Scale): Uint8Array {
  return tables[scale];
}

/** A bar of the scale, low to high, for a legend. */
export function gradient(scale: Scale): string {
  const hexes = stops[scale].split(" ");
  return `linear-gradient(to right, ${hexes.map((hex) => `#${hex}`).join(", ")})`;
}

export function scaleOf(layer: string): Scale {
  if (layer === "difference") return "difference";
  return layer === "sd" || layer === "quality" ? "viridis" : "cividis";
}
