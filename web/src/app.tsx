/** The frame of all screens: navigation, theme and language, and messages. */

import { useEffect } from "preact/hooks";
import type { JSX } from "preact";
import { Icon } from "./parts/icon";
import { Wishes } from "./parts/wishes";
import { Live } from "./screens/live";
import { MapScreen } from "./screens/map";
import { Plan } from "./screens/plan";
import { Preflight } from "./screens/preflight";
import { Replay } from "./screens/replay";
import { Report } from "./screens/report";
import { Start } from "./screens/start";
import {
  chosen,
  complain,
  dismiss,
  go,
  loadOptions,
  notices,
  options,
  route,
  screens,
  t,
  type Screen,
} from "./state";
import { api } from "./api";

export function App(): JSX.Element {
  useEffect(() => void loadOptions().catch(complain), []);
  const { screen, id } = route.value;
  useEffect(() => void choose(id), [id]);
  useEffect(() => {
    document.title = `${t(screen)} · ${chosen.value?.name ?? "Grebe"}`;
    document.getElementById("main")?.focus({ preventScroll: true });
  }, [screen]);
  return (
    <div class="frame">
      <a class="skip" href="#main" onClick={skip}>
        {t("skip")}
      </a>
      <Rail screen={screen} />
      <main id="main" tabIndex={-1} class={`screen at-${screen}`}>
        {options.value ? <Current screen={screen} id={id} /> : <Waiting />}
      </main>
      <Notices />
    </div>
  );
}

function skip(event: Event): void {
  event.preventDefault();
  document.getElementById("main")?.focus();
}

async function choose(id: string | null): Promise<void> {
  if (!id || chosen.value?.id === id) return;
  try {
    const survey = await api.survey(id);
    chosen.value = { id, name: survey.name };
  } catch (cause) {
    complain(cause);
  }
}

function Waiting(): JSX.Element {
  return (
    <div class="waiting" role="status">
      <h1>Grebe</h1>
      <p>{notices.value.length ? "" : t("loading")}</p>
      <button class="button" onClick={() => void loadOptions().catch(complain)}>
        {t("again")}
      </button>
    </div>
  );
}

function Current({ screen, id }: { screen: Screen; id: string | null }): JSX.Element {
  if (screen === "start") return <Start />;
  if (screen === "plan") return <Plan key={id ?? ""} id={id} />;
  if (!id) return <NoSurvey />;
  switch (screen) {
    case "preflight":
      return <Preflight key={id} id={id} />;
    case "live":
      return <Live key={id} id={id} />;
    case "map":
      return <MapScreen key={id} id={id} />;
    case "replay":
      return <Replay key={id} id={id} />;
    case "report":
      return <Report key={id} id={id} />;
  }
}

function NoSurvey(): JSX.Element {
  return (
    <div class="page">
      <h1>{t("recent")}</h1>
      <p>{t("chooseFirst")}</p>
      <button class="button primary" onClick={() => go("start")}>
        {t("start")}
      </button>
    </div>
  );
}

function Rail({ screen }: { screen: Screen }): JSX.Element {
  const id = chosen.value?.id ?? null;
  return (
    <nav class="rail" aria-label={t("screens")}>
      <ul>
        {screens.map((item) => {
          const needs = item !== "start" && item !== "plan";
          const target = needs ? id : item === "plan" && screen === "plan" ? route.value.id : null;
          return (
            <li key={item}>
              <a
                href={`#/${item}${target ? `/${encodeURIComponent(target)}` : ""}`}
                aria-current={item === screen ? "page" : undefined}
                class={needs && !id ? "faint" : ""}
              >
                <Icon name={item} />
                <span>{t(item)}</span>
              </a>
            </li>
          );
        })}
      </ul>
      <Wishes />
    </nav>
  );
}

function Notices(): JSX.Element {
  return (
    <div class="notices" role="status" aria-live="polite">
      {notices.value.map((notice) => (
        <div key={notice.key} class={`notice ${notice.kind}`}>
          <span>{notice.text}</span>
          <button aria-label={t("close")} onClick={() => dismiss(notice.key)}>
            ×
          </button>
        </div>
      ))}
    </div>
  );
}
