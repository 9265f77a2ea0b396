/* SPDX-License-Identifier: MIT */
// This script sets the theme before anything is drawn, so that a dark page does not begin with a light flash. The
// script is no module, since modules run after the first picture of a page. session.js takes over from there.
(() => {
  let theme = null;
  try {
    theme = localStorage.getItem('scanhead.theme');
  } catch { /* private windows store nothing */ }
  document.documentElement.dataset.theme = theme ?? (matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light');
})();
