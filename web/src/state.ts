/** The state that all screens share: the present screen, language and theme, and messages. */

import { computed, effect, signal } from "@preact/signals";
import { ApiError, api, type Label, type Options } from "./api";
import { words, type Word } from "./words";

export type Language = "en" | "fr";
export type Theme = "day" | "night" | "sunlight";
export const screens = ["start", "plan", "preflight", "live", "map", "replay", "report"] as const;
export type Screen = (typeof screens)[number];

function kept<T extends string>(key: string, allowed: readonly T[], otherwise: T): T {
  const value = localStorage.getItem(key);
  return allowed.find((item) => item === value) ?? otherwise;
}

export const language = signal<Language>(
  kept("grebe-language", ["en", "fr"], navigator.language.startsWith("fr") ? "fr" : "en"),
);
export const theme = signal<Theme>(
  kept(
    "grebe-theme",
    ["day", "night", "sunlight"],
    matchMedia("(prefers-color-scheme: dark)").matches ? "night" : "day",
  ),
);
/** Counts changes of theme, after they take effect, so that canvases are repainted. */
export const painted = signal(0);

effect(() => {
  document.documentElement.lang = language.value;
  localStorage.setItem("grebe-language", language.value);
});
effect(() => {
  document.documentElement.dataset["theme"] = theme.value;
  localStorage.setItem("grebe-theme", theme.value);
  painted.value = painted.peek() + 1;
});

/** The word in the language of the page, with its {names} filled in. */
export function t(word: Word, values: Record<string, string | number> = {}): string {
  const text = words[word][language.value === "fr" ? 1 : 0];
  return text.replace(/\{(\w+)\}/g, (_, name: string) => String(values[name] ?? ""));
}

export function tr(label: Label): string {
  return label[language.value];
}

export interface Route {
  screen: Screen;
  id: string | null;
}

function read(): Route {
  const [, screen, id] = location.hash.split("/");
  const known = screens.find((item) => item === screen) ?? "start";
  return { screen: known, id: id ? decodeURIComponent(id) : null };
}

export const route = signal<Route>(read());
addEventListener("hashchange", () => {
  route.value = read();
});

export function go(screen: Screen, id: string | null = null): void {
  location.hash = `#/${screen}${id ? `/${encodeURIComponent(id)}` : ""}`;
}

/** The survey that the screens after Plan show. */
export const chosen = signal<{ id: string; name: string } | null>(null);

export const options = signal<Options | null>(null);
export async function loadOptions(): Promise<void> {
  options.value = await api.options();
}

export interface Notice {
  key: number;
  kind: "info" | "warning" | "error";
  text: string;
}
export const notices = signal<Notice[]>([]);
let lastKey = 0;

export function say(kind: Notice["kind"], text: string): void {
  const notice = { key: ++lastKey, kind, text };
  notices.value = [...notices.value.slice(-2), notice];
  if (kind === "info") setTimeout(() => dismiss(notice.key), 6000);
}

export function dismiss(key: number): void {
  notices.value = notices.value.filter((notice) => notice.key !== key);
}

/** Forget all notices, as before something is tried again. */
export function dismissAll(): void {
  notices.value = [];
}

/** Show what went wrong, in the server's words, or in the page's if there was no answer. */
export function complain(cause: unknown): void {
  if (cause instanceof DOMException && cause.name === "AbortError") return;
  say("error", inWords(cause));
}

export function inWords(cause: unknown): string {
  if (cause instanceof ApiError) {
    if (cause.status === 0) return t("unreachable");
    if (cause.status === 401 || (cause.status === 403 && cause.code.includes("token")))
      return t("unknownPage");
    return cause.message;
  }
  return cause instanceof Error ? cause.message : String(cause);
}

export const number = computed(() => {
  const locale = language.value === "fr" ? "fr-FR" : "en-GB";
  const made = new Map<number, Intl.NumberFormat>();
  return (value: number, digits = 0): string => {
    let format = made.get(digits);
    if (!format) {
      format = new Intl.NumberFormat(locale, {
        minimumFractionDigits: digits,
        maximumFractionDigits: digits,
      });
      made.set(digits, format);
    }
    return format.format(value);
  };
});

/** A value with about three significant digits, as an instrument shows it. */
export function reading(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  return number.value(value, size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3);
}

export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  const whole = Math.max(0, Math.round(seconds));
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor((whole % 3600) / 60);
  if (hours > 0) return `${hours} h ${String(minutes).padStart(2, "0")}`;
  return minutes > 0 ? `${minutes} min ${String(whole % 60).padStart(2, "0")}` : `${whole} s`;
}

export function area(squareMetres: number): string {
  return squareMetres >= 1e6
    ? `${number.value(squareMetres / 1e6, 2)} km²`
    : `${number.value(squareMetres / 1e4, squareMetres < 1e5 ? 2 : 1)} ha`;
}

export function distance(metres: number): string {
  return metres >= 2000 ? `${number.value(metres / 1000, 2)} km` : `${number.value(metres)} m`;
}
