/** Choice of theme and language: in the rail, or in a narrow window on the Start screen. */

import type { JSX } from "preact";
import { language, t, theme, type Language, type Theme } from "../state";

export function Wishes(): JSX.Element {
  return (
    <div class="rail-settings">
      <label>
        <span>{t("theme")}</span>
        <select
          value={theme.value}
          onChange={(event) => {
            theme.value = event.currentTarget.value as Theme;
          }}
        >
          <option value="day">{t("day")}</option>
          <option value="night">{t("night")}</option>
          <option value="sunlight">{t("sunlight")}</option>
        </select>
      </label>
      <label>
        <span>{t("language")}</span>
        <select
          value={language.value}
          onChange={(event) => {
            language.value = event.currentTarget.value as Language;
          }}
        >
          <option value="en">English</option>
          <option value="fr">Français</option>
        </select>
      </label>
    </div>
  );
}
