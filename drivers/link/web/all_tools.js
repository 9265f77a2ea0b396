/* SPDX-License-Identifier: MIT */
// This module has the tools of the picture, in the order of their buttons, and what they share.
import {fetchJson, newest} from './page.js';
import {MeasureTool} from './measure_tool.js';
import {PanoramaTool} from './panorama_tool.js';
import {SectionTool} from './section_tool.js';
import {SidesTool} from './sides_tool.js';
import {Tools} from './tools.js';

// These are the errors that the head expects of its points. A recording and an older head report none.
class Expected {
  #stations = [];
  #begin = newest();

  async ask() {
    const isNewest = this.#begin(), quality = await fetchJson('/quality');
    if (isNewest()) this.#stations = quality?.stations ?? [];
  }

  // Returns the errors that the head expects of a station's last scan; null: they are not known.
  of(station) {
    return this.#stations.find(({number}) => number === station)?.expected ?? null;
  }
}

// Returns the tools by their names. names(mode, label) returns the name of a surface or a station for people.
export function startTools(view, names) {
  const tools = {sides: new SidesTool(view), section: new SectionTool(view), measure: new MeasureTool(view, names, new Expected()),
    panorama: new PanoramaTool(view, names)};
  new Tools(Object.values(tools));
  return tools;
}
