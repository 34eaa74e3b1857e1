/** The commands pause, return and stop, always within reach; and who steers. */

import { useEffect, useRef, useState } from "preact/hooks";
import type { JSX } from "preact";
import { ApiError, api, type Command } from "../api";
import type { Stream } from "../live/stream";
import { chosen, complain, duration, go, number, t } from "../state";

/** Time for the second press of a command that needs two [ms]. */
const ARMED_MS = 3000;

export function Commands({ id, stream }: { id: string; stream: Stream }): JSX.Element {
  const [armed, setArmed] = useState<Command | null>(null);
  const timer = useRef(0);
  const status = stream.status.value;
  const lease = stream.lease.value;
  const under = status?.state === "running" || status?.state === "returning" || status?.state === "paused";
  const paused = status?.state === "paused" || status?.state === "returning";

  async function send(command: Command): Promise<void> {
    setArmed(null);
    try {
      if (stream.lease.peek().holder !== "you") {
        // Every page may stop the boat; other commands need the lease, or that nobody holds it.
        if (command === "stop" || stream.lease.peek().holder === null)
          stream.lease.value = await api.lease(true);
      }
      await api.command(id, command);
    } catch (cause) {
      complain(cause instanceof ApiError && cause.status === 409 ? new Error(cause.message || t("otherSteers")) : cause);
    }
  }

  /** The first press arms, the second sends. */
  function twice(command: Command): void {
    clearTimeout(timer.current);
    if (armed === command) {
      void send(command);
      return;
    }
    setArmed(command);
    timer.current = window.setTimeout(() => setArmed(null), ARMED_MS);
  }

  const act = useRef({ send, twice });
  act.current = { send, twice };
  useEffect(() => {
    const pressed = (event: KeyboardEvent): void => {
      if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
      const at = event.target;
      if (at instanceof HTMLInputElement || at instanceof HTMLSelectElement) return;
      const state = stream.status.peek()?.state;
      if (event.key === "Escape") act.current.twice("stop");
      else if (event.key === "r" || event.key === "R") act.current.twice("return");
      else if (event.key === " " && !(at instanceof HTMLButtonElement))
        void act.current.send(state === "paused" || state === "returning" ? "continue" : "pause");
      else return;
      event.preventDefault();
    };
    addEventListener("keydown", pressed);
    return () => removeEventListener("keydown", pressed);
  }, [stream]);

  async function lead(take: boolean): Promise<void> {
    try {
      stream.lease.value = await api.lease(take);
    } catch (cause) {
      complain(cause);
    }
  }

  const coverage = status?.coverage ?? 0;
  const holder = lease.holder;
  return (
    <section class="commands" aria-label={t("controls")}>
      {status && !under ? (
        <div class="pushes">
          <span class={`badge ${status.state}`}>{t(`state_${status.state}`)}</span>
          {status.state !== "complete" && (
            <button class="push primary" onClick={() => go("preflight", chosen.value?.id ?? id)}>
              {status.state === "planned" ? t("launch") : t("resume")}
            </button>
          )}
        </div>
      ) : (
        <div class="pushes">
          <button class="push" disabled={!under || holder === "other"} onClick={() => void send(paused ? "continue" : "pause")}>
            <strong>{paused ? t("continue") : t("pause")}</strong>
            <kbd aria-hidden="true">Space</kbd>
          </button>
          <button
            class={`push${armed === "return" ? " armed" : ""}`}
            disabled={!under || holder === "other" || status?.state === "returning"}
            onClick={() => twice("return")}
          >
            <strong>{armed === "return" ? t("pressAgain") : t("return")}</strong>
            <kbd aria-hidden="true">R R</kbd>
          </button>
          <button class={`push stop${armed === "stop" ? " armed" : ""}`} disabled={!under} onClick={() => twice("stop")}>
            <strong>{armed === "stop" ? t("pressAgain") : t("stop")}</strong>
            <kbd aria-hidden="true">Esc Esc</kbd>
          </button>
        </div>
      )}
      <div class="progress">
        <div
          class="meter"
          role="progressbar"
          aria-label={t("coverage")}
          aria-valuemin={0}
          aria-valuemax={100}
          aria-valuenow={Math.round(100 * coverage)}
        >
          <span style={{ width: `${100 * coverage}%` }} />
        </div>
        <div class="progress-text">
          <strong>{number.value(100 * coverage, 1)} %</strong>
          <span>
            {status ? `${number.value(status.reached)}/${number.value(status.targets)}` : "–"} {t("cells")}
          </span>
          <span>
            {t("eta")} <strong>{under ? duration(status?.eta_s) : "–"}</strong>
          </span>
        </div>
      </div>
      <div class="lease">
        <span class={holder === "other" ? "warn-text" : ""}>
          {t(holder === "you" ? "youSteer" : holder === "other" ? "otherSteers" : "nobodySteers")}
        </span>
        <button class="button" onClick={() => void lead(holder !== "you")}>
          {t(holder === "you" ? "giveUp" : "takeOver")}
        </button>
      </div>
    </section>
  );
}
