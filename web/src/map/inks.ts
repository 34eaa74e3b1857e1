/** The colours of the map in the present theme. */

export interface Inks {
  water: string;
  shore: string;
  cell: string;
  reached: string;
  currentCell: string;
  givenUp: string;
  route: string;
  track: string;
  horizon: string;
  boat: string;
  halo: string;
  bad: string;
  graticule: string;
  graticuleText: string;
}

export function readInks(): Inks {
  const style = getComputedStyle(document.documentElement);
  const ink = (name: string): string => style.getPropertyValue(`--ink-${name}`).trim() || "#000";
  return {
    water: ink("water"),
    shore: ink("shore"),
    cell: ink("cell"),
    reached: ink("reached"),
    currentCell: ink("current"),
    givenUp: ink("given-up"),
    route: ink("route"),
    track: ink("track"),
    horizon: ink("horizon"),
    boat: ink("boat"),
    halo: ink("halo"),
    bad: ink("bad"),
    graticule: ink("graticule"),
    graticuleText: ink("graticule-text"),
  };
}
