/* SPDX-License-Identifier: MIT */
// This module reports to the view what happens to its canvas: a lost context, another size, another theme.

// on: {lost(), restored(), resized(), themed()}
export function listenTo(canvas, on) {
  canvas.addEventListener('webglcontextlost', (e) => {
    e.preventDefault();
    on.lost();
  });
  canvas.addEventListener('webglcontextrestored', () => on.restored());
  new ResizeObserver(() => on.resized()).observe(canvas);
  new MutationObserver(() => on.themed()).observe(document.documentElement, {attributeFilter: ['data-theme']});
  canvas.setAttribute('role', 'application');
  canvas.setAttribute('aria-roledescription', 'picture of points in space');
}
