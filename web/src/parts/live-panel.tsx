/** The panel beside the live map: current readings, charts of the last minutes, and the log. */

import { useEffect, useState } from "preact/hooks";
import type { JSX } from "preact";
import type { AlignedData } from "uplot";
import type { LogLine, Quantity } from "../api";
import type { Stream } from "../live/stream";
import { duration, language, reading, t, tr } from "../state";
import { Chart } from "./chart";

/** The boats of a fleet: the selected one, and the progress of each with its part. */
export function Boats({ stream }: { stream: Stream }): JSX.Element | null {
  void stream.pulse.value;
  void stream.snapshot.value;
  const chosen = stream.chosen.value;
  if (stream.boats.size < 2) return null;
  return (
    <div class="values boats" role="group" aria-label={t("boats")}>
      {[...stream.boats.values()].map(({ boat, status }) => (
        <button
          key={boat}
          class="value"
          aria-pressed={boat === chosen}
          onClick={() => stream.choose(boat)}
        >
          <span class="value-name">
            {t("boatNumber", { n: boat })}
            {status.state && ` · ${t(`state_${status.state}`)}`}
          </span>
          <span class="value-read">
            {status.targets ? `${status.reached ?? 0}/${status.targets}` : "–"}{" "}
            <span class="unit">{t("cells")}</span>
          </span>
        </button>
      ))}
    </div>
  );
}

export function Values({
  stream,
  chosen,
  choose,
}: {
  stream: Stream;
  chosen: string | null;
  choose: (id: string) => void;
}): JSX.Element {
  void stream.pulse.value;
  const quantities = stream.snapshot.value?.quantities ?? [];
  const last = stream.samples[stream.samples.length - 1];
  return (
    <div class="values" role="group" aria-label={t("quantity")}>
      {quantities.map((quantity, i) => (
        <button
          key={quantity.id}
          class="value"
          aria-pressed={quantity.id === chosen}
          onClick={() => choose(quantity.id)}
        >
          <span class="value-name">{tr(quantity.label)}</span>
          <span class="value-read">
            {reading(last?.[3][i])} <span class="unit">{quantity.unit}</span>
          </span>
        </button>
      ))}
    </div>
  );
}

/** Time between redraws of the charts [ms]; more often would only cost energy. */
const EACH_MS = 500;
const POINTS = 400;

/** Every n-th item, so that at most `POINTS` are drawn. */
function thinned<T>(items: readonly T[]): T[] {
  const step = Math.ceil(items.length / POINTS) || 1;
  return items.filter((_, i) => (items.length - 1 - i) % step === 0);
}

export function LiveCharts({ stream, quantity }: { stream: Stream; quantity: Quantity | null }): JSX.Element {
  const [, turn] = useState(0);
  useEffect(() => {
    let seen = -1;
    const timer = setInterval(() => {
      if (document.hidden || stream.beat === seen) return;
      seen = stream.beat;
      turn((old) => old + 1);
    }, EACH_MS);
    return () => clearInterval(timer);
  }, [stream]);
  const snapshot = stream.snapshot.peek();
  if (!snapshot) return <p role="status">{t("loading")}</p>;
  const place = snapshot.quantities.findIndex((item) => item.id === quantity?.id);
  const samples = thinned(stream.samples);
  const track = thinned(stream.track);
  const pushes = thinned(stream.pushes);
  const values: AlignedData = [samples.map((s) => s[0]), samples.map((s) => s[3][place] ?? null)];
  const speeds: AlignedData = [track.map((p) => p[0]), track.map((p) => p[3])];
  const thrusts: AlignedData = [
    pushes.map((p) => p[0]),
    pushes.map((p) => p[1]),
    pushes.map((p) => p[2]),
  ];
  return (
    <section class="charts" aria-label={t("lastMinutes", { n: 10 })}>
      {quantity && (
        <Chart title={tr(quantity.label)} unit={quantity.unit} data={values} curves={[{ label: tr(quantity.label), ink: "--curve-1" }]} />
      )}
      <Chart
        title={t("speed")}
        unit={`m/s · ${t("window")}`}
        data={speeds}
        guides={snapshot.speed_window}
        curves={[{ label: t("speed"), ink: "--curve-2" }]}
      />
      <Chart
        title={t("thrusts")}
        unit={`N · ${t("left")} —  ${t("right")} - -`}
        data={thrusts}
        curves={[
          { label: t("left"), ink: "--curve-1" },
          { label: t("right"), ink: "--curve-3", dash: [5, 3] },
        ]}
      />
    </section>
  );
}

export function LiveEvents({ stream }: { stream: Stream }): JSX.Element {
  const events = stream.events.value;
  return (
    <section class="events" aria-label={t("events")}>
      <h2>{t("events")}</h2>
      {events.length === 0 ? (
        <p class="quiet">{t("noEvents")}</p>
      ) : (
        <EventList events={events.slice(-40).reverse()} />
      )}
    </section>
  );
}

export function EventList({ events, go }: { events: LogLine[]; go?: (t: number) => void }): JSX.Element {
  const locale = language.value === "fr" ? "fr-FR" : "en-GB";
  return (
    <ol class="event-list">
      {events.map((event, i) => (
        <li key={`${event.time}-${event.code}-${i}`} class={event.level}>
          {go ? (
            <button class="linkish" onClick={() => go(event.t)}>
              {duration(event.t)}
            </button>
          ) : (
            <time dateTime={event.time}>{new Date(event.time).toLocaleTimeString(locale)}</time>
          )}
          <span>
            {event.level !== "info" && <strong class="level">{event.level === "error" ? "✕ " : "! "}</strong>}
            {event.message}
          </span>
        </li>
      ))}
    </ol>
  );
}
