/** What the colours of a map mean. */

import type { ComponentChildren, JSX } from "preact";
import { gradient, scaleOf } from "../map/colours";
import { reading } from "../state";

export function Legend({
  title,
  unit,
  layer,
  range,
  children,
}: {
  title: string;
  unit: string;
  layer: string;
  range: [number, number];
  children?: ComponentChildren;
}): JSX.Element {
  const middle = (range[0] + range[1]) / 2;
  return (
    <div class="legend">
      <div class="legend-title">
        {title} <span class="unit">{unit}</span>
      </div>
      <div class="legend-bar" style={{ background: gradient(scaleOf(layer)) }} />
      <div class="legend-marks">
        {[range[0], middle, range[1]].map((value) => (
          <span key={value}>{reading(value)}</span>
        ))}
      </div>
      {children}
    </div>
  );
}
