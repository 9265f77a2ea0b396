/* SPDX-License-Identifier: MIT */
// This module turns the camera to a flat view (no perspective) from the top, the front or the side, and returns to the
// view before. Where a section is turned, these are the sides of the section. The module is pure.

import {radians} from './view_camera.js';

export const SIDES = [['top', 'Top', 'T'], ['front', 'Front', 'F'], ['side', 'Side', 'S']];

// The front is seen from the south, the side from the east. The heading of a box section turns both.
export function lookFromSide(camera, side) {
  if (!camera.flat) camera.before = {azimuth: camera.azimuth, elevation: camera.elevation};
  const heading = radians(camera.section?.kind === 'box' ? camera.section.heading_deg : 0);
  const [azimuth, elevation] = {top: [0, -Math.PI / 2], front: [0, 0], side: [-Math.PI / 2, 0]}[side];
  camera.lookFlat(heading + azimuth, elevation);
}

// Returns to perspective, in the direction from before the flat views.
export function lookDeep(camera) {
  if (camera.flat) Object.assign(camera, camera.before, {flat: false});
}

export function lookBy(camera, key) {
  const side = SIDES.find(([, , letter]) => letter === key.toUpperCase());
  if (side) lookFromSide(camera, side[0]);
  else lookDeep(camera);
}
