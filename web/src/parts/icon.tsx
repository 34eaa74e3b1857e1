/** The few icons of the page, as line drawings; each stands beside its word. */

import type { JSX } from "preact";

const paths = {
  start: "M4 11 12 4l8 7M6 10v9h12v-9",
  plan: "M4 6l5-2 6 2 5-2v14l-5 2-6-2-5 2zM9 4v14M15 6v14",
  preflight: "M5 6h2M5 12h2M5 18h2M10 6h9M10 12h9M10 18h9",
  live: "M12 13v7M8.5 16.5a5 5 0 1 1 7 0M5.6 19.4a9 9 0 1 1 12.8 0M12 12h.01",
  map: "M4 5h16v14H4zM4 10h5v4H4M9 5v14M15 5v14M15 11h5",
  replay: "M5 5v5h5M5.5 10A7.5 7.5 0 1 1 4.6 14M12 8v4l3 2",
  report: "M7 3h7l4 4v14H7zM14 3v4h4M10 12h5M10 16h5",
  draw: "M4 20l4-1L19 8l-3-3L5 16zM14 7l3 3",
  file: "M4 6h6l2 2h8v11H4z",
  boat: "M3 14h18l-3 5H6zM12 3v9M12 4l6 8h-6",
  undo: "M8 6 4 10l4 4M4 10h10a5 5 0 0 1 0 10h-3",
  redo: "M16 6l4 4-4 4M20 10H10a5 5 0 0 0 0 10h3",
  whole: "M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5",
} as const;

export type IconName = keyof typeof paths;

export function Icon({ name }: { name: IconName }): JSX.Element {
  return (
    <svg
      class="icon"
      viewBox="0 0 24 24"
      aria-hidden="true"
      fill="none"
      stroke="currentColor"
      stroke-width="1.8"
      stroke-linecap="round"
      stroke-linejoin="round"
    >
      <path d={paths[name]} />
    </svg>
  );
}
