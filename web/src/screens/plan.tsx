/** Plan: draw or open the water; each change shows the resulting survey at once. */

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { JSX } from "preact";
import { api, type OutlineReading, type PlanPreview, type PlanSettings } from "../api";
import { Editor, type Tool } from "../map/editor";
import {
  boundsOf,
  emptySketch,
  noGoOf,
  regionOf,
  shapesOf,
  withoutShape,
  withRing,
  withShape,
  type Kind,
  type Sketch,
} from "../map/sketch";
import { fit, MapView, type Ground } from "../map/view";
import { Icon } from "../parts/icon";
import { OutlineForm } from "../parts/outline-form";
import { PlanFacts, PlanForm } from "../parts/plan-form";
import { chosen, complain, dismissAll, go, inWords, options, say, t } from "../state";
import type { Word } from "../words";

interface History {
  past: Sketch[];
  now: Sketch;
  future: Sketch[];
}

/** The sketch, kept while another screen is shown. */
let kept: { history: History; settings: PlanSettings; name: string } | null = null;

function defaults(): PlanSettings {
  const given = options.value?.settings ?? {};
  const number = (name: string, otherwise: number): number => given[name]?.default ?? otherwise;
  return {
    cell_m: number("cell_m", 10),
    pattern: options.value?.patterns[0]?.id ?? "auto",
    speed_min_mps: number("speed_min_mps", 0.5),
    speed_max_mps: number("speed_max_mps", 1.5),
    vessel: options.value?.vessels.find(({ id }) => id === "blueboat")?.id ?? options.value?.vessels[0]?.id ?? "",
    start: null,
    shore_margin_m: number("shore_margin_m", 0),
    no_go: null,
    current: null,
    wind: null,
    minutes: null,
  };
}

export function Plan({ id }: { id: string | null }): JSX.Element {
  const [history, setHistory] = useState<History>(
    kept?.history ?? { past: [], now: emptySketch, future: [] },
  );
  const [settings, setSettings] = useState<PlanSettings>(kept?.settings ?? defaults());
  const [name, setName] = useState(kept?.name ?? "");
  const [tool, setTool] = useState<Tool>(null);
  const [selected, setSelected] = useState<number | null>(null);
  const [points, setPoints] = useState(0);
  const [opened, setOpened] = useState<{ file: File; reading: OutlineReading } | null>(null);
  const ground = useRef<Ground | null>(null);
  const editor = useRef<Editor | null>(null);
  const sketch = history.now;
  kept = { history, settings, name };

  const change = (make: (sketch: Sketch) => Sketch): void =>
    setHistory(({ past, now }) => ({ past: [...past.slice(-99), now], now: make(now), future: [] }));
  const undo = (): void =>
    setHistory((old) => {
      const last = old.past[old.past.length - 1];
      if (!last) return old;
      return { past: old.past.slice(0, -1), now: last, future: [old.now, ...old.future] };
    });
  const redo = (): void =>
    setHistory((old) => {
      const [first, ...rest] = old.future;
      return first ? { past: [...old.past, old.now], now: first, future: rest } : old;
    });
  const pick = (next: Tool): void => {
    setTool(next);
    setSelected(null);
    if (next) ground.current?.map.getContainer().focus();
  };

  function ready(made: Ground): void {
    ground.current = made;
    editor.current = new Editor(made.map, {
      finish: (shape) => {
        change((old) => withShape(old, shape));
        pick(null);
      },
      start: (at) => {
        change((old) => ({ ...old, start: at }));
        setTool(null);
      },
      select: setSelected,
      change: (index, ring) => change((old) => withRing(old, index, ring)),
      drop: (index) => change((old) => withoutShape(old, index)),
      leave: () => pick(null),
      progress: setPoints,
    });
    show(kept?.history.now ?? emptySketch);
  }

  function show(drawn: Sketch): void {
    const bounds = boundsOf(drawn.shapes.flatMap((shape) => shape.ring));
    if (bounds && ground.current) fit(ground.current, bounds);
  }

  useEffect(() => {
    if (!id) return;
    void api
      .survey(id)
      .then((survey) => {
        const drawn = {
          shapes: shapesOf(survey.region, survey.settings?.no_go ?? null),
          start: survey.settings?.start ?? null,
        };
        setHistory({ past: [], now: drawn, future: [] });
        if (survey.settings) setSettings(survey.settings);
        setName(survey.name);
        show(drawn);
      })
      .catch(complain);
  }, [id]);
  useEffect(() => editor.current?.use(tool), [tool]);
  useEffect(() => editor.current?.show(sketch, selected), [sketch, selected, tool]);
  useEffect(() => {
    const pressed = (event: KeyboardEvent): void => {
      if (!(event.ctrlKey || event.metaKey) || event.target instanceof HTMLInputElement) return;
      const key = event.key.toLowerCase();
      if (key === "z" && !event.shiftKey) undo();
      else if (key === "y" || (key === "z" && event.shiftKey)) redo();
      else return;
      event.preventDefault();
    };
    addEventListener("keydown", pressed);
    return () => removeEventListener("keydown", pressed);
  }, []);

  const request = useMemo(() => {
    const region = regionOf(sketch);
    if (!region) return null;
    return { region, settings: { ...settings, start: sketch.start, no_go: noGoOf(sketch) } };
  }, [sketch, settings]);
  const preview = usePreview(request);

  useEffect(() => {
    const water = ground.current?.water;
    if (!water) return;
    const plan = request ? preview.plan : null;
    water.setRegion(request?.region ?? null);
    water.setNoGo(request?.settings.no_go ?? null);
    water.setCells(
      plan?.targets.features.map((target) => target.geometry.coordinates[0] ?? []) ?? [],
      plan?.targets.features.map(() => "open" as const) ?? [],
    );
    water.setWay(plan?.route.coordinates ?? []);
    water.setUncovered(plan?.uncovered ?? null);
  }, [preview.plan, request]);

  async function openOutline(file: File, reading: OutlineReading): Promise<void> {
    setOpened({ file, reading });
    dismissAll();
    try {
      const outline = await api.outline(file, reading);
      const shapes = shapesOf(outline.region);
      change((old) => ({ shapes: [...shapes, ...old.shapes.filter((shape) => shape.kind === "noGo")], start: old.start }));
      setName((old) => old || outline.name);
      if (outline.notes.length) say("warning", outline.notes.join(" "));
      show({ shapes, start: null });
    } catch (cause) {
      complain(cause);
    }
  }

  async function keep(): Promise<void> {
    if (!request) return;
    try {
      const survey = await api.plan({ ...request, name: name.trim() || t("water") });
      chosen.value = { id: survey.id, name: survey.name };
      say("info", t("planKept", { name: survey.name }));
      go("preflight", survey.id);
    } catch (cause) {
      complain(cause);
    }
  }

  const hint: Word = tool === "start" ? "startHint" : tool ? "drawHint" : selected !== null ? "editHint" : "emptyHint";
  return (
    <div class="split">
      <h1 class="unseen">{t("plan")}</h1>
      <div class="stage">
        <Tools
          tool={tool}
          pick={pick}
          undo={history.past.length ? undo : null}
          redo={history.future.length ? redo : null}
          openOutline={(file) => void openOutline(file, { islands: "named", crs: "" })}
        />
        <MapView onReady={ready} crosshair={tool !== null}>
          {(tool || selected !== null || !sketch.shapes.length) && <p class="hint">{t(hint)}</p>}
          {tool && tool !== "start" && (
            <div class="draw-acts">
              <button class="button" onClick={() => editor.current?.addCentre()}>
                {t("point")}
              </button>
              <button class="button primary" disabled={points < 3} onClick={() => editor.current?.finish()}>
                {t("finish")}
              </button>
              <button class="button" onClick={() => pick(null)}>
                {t("cancel")}
              </button>
            </div>
          )}
          {!tool && selected !== null && (
            <div class="draw-acts">
              <button
                class="button"
                onClick={() => {
                  change((old) => withoutShape(old, selected));
                  setSelected(null);
                }}
              >
                {t("deleteShape")}
              </button>
            </div>
          )}
        </MapView>
      </div>
      <aside class="panel" aria-label={t("settings")}>
        <label class="field wide">
          <span>{t("name")}</span>
          <input value={name} maxLength={80} onInput={(event) => setName(event.currentTarget.value)} />
        </label>
        {!sketch.shapes.length && <GoTo ground={ground} />}
        {opened && (
          <OutlineForm
            name={opened.file.name}
            reading={opened.reading}
            change={(reading) => void openOutline(opened.file, reading)}
          />
        )}
        <PlanFacts plan={request ? preview.plan : null} busy={preview.busy} failure={preview.failure} />
        <button
          class="button primary tall"
          disabled={!preview.plan || preview.busy || preview.plan.problems.length > 0}
          onClick={() => void keep()}
        >
          {t("savePlan")}
        </button>
        <PlanForm settings={settings} change={setSettings} problems={preview.plan?.problems ?? []} />
      </aside>
    </div>
  );
}

function GoTo({ ground }: { ground: { current: Ground | null } }): JSX.Element {
  const [bad, setBad] = useState(false);
  function move(text: string): void {
    const [lat, lon] = text.split(/[,;\s]+/).filter(Boolean).map(Number);
    const good = lat !== undefined && lon !== undefined && Math.abs(lat) <= 85 && Math.abs(lon) <= 180;
    setBad(!good);
    if (good) ground.current?.map.setView([lat, lon], 16);
  }
  return (
    <label class={`field wide${bad ? " bad" : ""}`}>
      <span>{t("goTo")}</span>
      <input placeholder="46.45, 6.55" aria-invalid={bad} onChange={(event) => move(event.currentTarget.value)} />
      {bad && <span class="bad-text">{t("goToBad")}</span>}
    </label>
  );
}

interface Previewed {
  plan: PlanPreview | null;
  busy: boolean;
  failure: string;
}

/** The plan for the request, made shortly after its last change; an older answer never replaces it. */
function usePreview(request: { region: NonNullable<ReturnType<typeof regionOf>>; settings: PlanSettings } | null): Previewed {
  const [state, setState] = useState<Previewed>({ plan: null, busy: false, failure: "" });
  useEffect(() => {
    if (!request) {
      setState({ plan: null, busy: false, failure: "" });
      return;
    }
    setState((old) => ({ ...old, busy: true }));
    const stopper = new AbortController();
    const timer = setTimeout(() => {
      void api
        .preview(request, stopper.signal)
        .then((plan) => setState({ plan, busy: false, failure: "" }))
        .catch((cause: unknown) => {
          if (!stopper.signal.aborted) setState({ plan: null, busy: false, failure: inWords(cause) });
        });
    }, 350);
    return () => {
      clearTimeout(timer);
      stopper.abort();
    };
  }, [request]);
  return state;
}

function Tools(props: {
  tool: Tool;
  pick: (tool: Tool) => void;
  undo: (() => void) | null;
  redo: (() => void) | null;
  openOutline: (file: File) => void;
}): JSX.Element {
  const input = useRef<HTMLInputElement>(null);
  const kinds: [Kind | "start", Word][] = [
    ["water", "water"],
    ["island", "island"],
    ["noGo", "noGo"],
    ["start", "startPoint"],
  ];
  return (
    <div class="tools" role="toolbar" aria-label={t("draw")}>
      {kinds.map(([kind, word]) => (
        <button
          key={kind}
          class={`tool ${kind}`}
          aria-pressed={props.tool === kind}
          onClick={() => props.pick(props.tool === kind ? null : kind)}
        >
          <span class="swatch" aria-hidden="true" />
          {t(word)}
        </button>
      ))}
      <button class="tool" onClick={() => input.current?.click()}>
        <Icon name="file" />
        {t("outlineFile")}
      </button>
      <input
        ref={input}
        class="unseen"
        type="file"
        tabIndex={-1}
        aria-label={t("outlineFile")}
        onChange={(event) => {
          const file = event.currentTarget.files?.[0];
          event.currentTarget.value = "";
          if (file) props.openOutline(file);
        }}
      />
      <span class="gap" />
      <button class="tool" disabled={!props.undo} onClick={() => props.undo?.()}>
        <Icon name="undo" />
        {t("undo")}
      </button>
      <button class="tool" disabled={!props.redo} onClick={() => props.redo?.()}>
        <Icon name="redo" />
        {t("redo")}
      </button>
    </div>
  );
}

