/** A small chart over time: uPlot in the colours of the page. */

import { useEffect, useRef } from "preact/hooks";
import type { JSX } from "preact";
import uPlot from "uplot";
import { number, painted } from "../state";

export interface Curve {
  label: string;
  ink: string; // name of a custom property
  width?: number;
  dash?: number[];
}

export interface ChartProps {
  title: string;
  unit: string;
  curves: Curve[];
  /** x, then one column for each curve. */
  data: uPlot.AlignedData;
  height?: number;
  /** Horizontal reference lines, such as the speed window. */
  guides?: number[];
  /** Indices of two columns, the low and high ends of an interval; the area between is filled. */
  band?: [number, number];
  xLabel?: (value: number) => string;
  onPoint?: (index: number | null) => void;
}

export function Chart(props: ChartProps): JSX.Element {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const last = useRef(props);
  last.current = props;
  const coat = painted.value;
  useEffect(() => {
    const place = box.current;
    if (!place) return;
    plot.current = new uPlot(settings(last, place.clientWidth || 280), last.current.data, place);
    const watcher = new ResizeObserver(() =>
      plot.current?.setSize({ width: place.clientWidth, height: last.current.height ?? 110 }),
    );
    watcher.observe(place);
    return () => {
      watcher.disconnect();
      plot.current?.destroy();
      plot.current = null;
    };
  }, [coat, props.title, props.unit]);
  useEffect(() => plot.current?.setData(props.data), [props.data]);
  return (
    <figure class="chart">
      <figcaption>
        {props.title} <span class="unit">{props.unit}</span>
      </figcaption>
      <div ref={box} aria-hidden="true" />
    </figure>
  );
}

function ink(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim() || "#888";
}

function settings(last: { current: ChartProps }, width: number): uPlot.Options {
  const props = last.current;
  const axis = { stroke: ink("--faint"), grid: { stroke: ink("--line"), width: 1 }, ticks: { show: false } };
  const xLabel = props.xLabel ?? clock;
  return {
    width,
    height: props.height ?? 110,
    legend: { show: false },
    cursor: { y: false, points: { size: 7 }, drag: { x: false, y: false } },
    scales: { x: { time: false }, y: { range: (_, low, high) => span(low, high, last.current.guides) } },
    axes: [
      { ...axis, size: 24, space: 60, values: (_, marks) => marks.map(xLabel) },
      { ...axis, size: 46, space: 26, values: (_, marks) => marks.map((mark) => number.value(mark, digits(marks))) },
    ],
    series: [
      {},
      ...props.curves.map((curve) => ({
        label: curve.label,
        stroke: ink(curve.ink),
        width: curve.width ?? 2,
        spanGaps: false,
        points: { show: false },
        ...(curve.dash ? { dash: curve.dash } : {}),
      })),
    ],
    ...(props.band ? { bands: [{ series: [props.band[1], props.band[0]], fill: ink("--band") }] } : {}),
    hooks: {
      draw: [(made) => drawGuides(made, last.current.guides ?? [])],
      setCursor: [(made) => last.current.onPoint?.(made.cursor.idx ?? null)],
    },
  };
}

function span(low: number | null, high: number | null, guides: number[] = []): [number, number] {
  const values = [low, high, ...guides].filter((value): value is number => Number.isFinite(value));
  if (!values.length) return [0, 1];
  const least = Math.min(...values);
  const most = Math.max(...values);
  const margin = Math.max((most - least) * 0.1, Math.abs(most) * 1e-3, 1e-6);
  return [least - margin, most + margin];
}

function digits(marks: number[]): number {
  const step = Math.abs((marks[1] ?? 1) - (marks[0] ?? 0));
  return step >= 1 || step === 0 ? 0 : Math.min(4, Math.ceil(-Math.log10(step)));
}

function clock(seconds: number): string {
  const whole = Math.max(0, Math.round(seconds));
  const minutes = Math.floor(whole / 60);
  return `${minutes}:${String(whole % 60).padStart(2, "0")}`;
}

function drawGuides(plot: uPlot, guides: number[]): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.strokeStyle = ink("--guide");
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.setLineDash([5 * devicePixelRatio, 4 * devicePixelRatio]);
  for (const guide of guides) {
    const y = plot.valToPos(guide, "y", true);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
  }
  ctx.restore();
}
