/* SPDX-License-Identifier: MIT */
// The tools of the picture are buttons over it, and one card for the tool that was asked for. A tool is {id, name,
// title, body, start(), stop()}: its body stands in the card between start() and stop(). A tool with `isApart` has a
// place of its own on the page, and stays open beside the others.
import {byId, make, say} from './page.js';

export class Tools {
  #buttons = new Map();
  #open = null;
  #card = byId('tool');
  #title = make('h2');
  #body = make('div', {class: 'body'});

  constructor(tools) {
    this.tools = tools;
    const close = make('button', {type: 'button', class: 'quiet', click: () => this.leave()}, 'Close');
    this.#card.append(make('div', {class: 'head'}, this.#title, close), this.#body);
    for (const tool of tools) {
      const button = make('button', {type: 'button', id: `tool-${tool.id}`, title: tool.title, 'aria-expanded': 'false',
        'aria-controls': tool.isApart ? tool.id : 'tool', click: () => this.toggle(tool)}, tool.name);
      this.#buttons.set(tool, button);
      tool.changed = () => this.show();
      tool.leave = () => this.leave(tool);
      byId('tools').append(button);
    }
    document.addEventListener('keydown', (e) => {
      if (e.key !== 'Escape' || e.defaultPrevented) return;
      const tool = this.#open ?? tools.find((t) => t.isApart && t.isOpen);
      if (!tool) return;
      e.preventDefault();
      this.leave(tool);
    });
    // A key in the picture, or another button, may have changed which tools are shown as on.
    for (const type of ['keyup', 'click']) document.addEventListener(type, () => this.show());
    this.show();
  }

  toggle(tool) {
    if (tool.isOpen) return this.leave(tool);
    if (!tool.isApart) {
      if (this.#open) this.#stop(this.#open);
      this.#open = tool;
      say(this.#title, tool.title);
      this.#card.setAttribute('aria-label', tool.title);
      this.#body.replaceChildren(tool.body);
    }
    tool.isOpen = true;
    this.show();
    return tool.start();
  }

  #stop(tool) {
    tool.isOpen = false;
    if (tool === this.#open) this.#open = null;
    tool.stop();
  }

  leave(tool = this.#open) {
    if (!tool?.isOpen) return;
    this.#stop(tool);
    this.show();
    this.#buttons.get(tool).focus({preventScroll: true});
  }

  show() {
    this.#card.hidden = this.#open === null;
    for (const [tool, button] of this.#buttons) {
      button.setAttribute('aria-expanded', String(Boolean(tool.isOpen)));
      button.classList.toggle('on', Boolean(tool.isOn?.())); // it has an effect, open or not
    }
  }
}
