# SPDX-License-Identifier: MIT
"""This measures how soon Blender has a panorama's points after its scanner was moved, with blender_scan.py's nodes.

    blender -b --factory-startup -P blender_live.py -- SCENE.obj STEP_DEG RADIUS_M N X Y Z

The scanner goes round X, Y, Z in N steps. Nothing is drawn. The last line on standard output is JSON: points of the last
place, and the milliseconds of each move, by the clock.
"""
import json
import math
import os
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "readers"))
import blender_scan  # noqa: E402 (its folder has to be in the path)
import bpy  # noqa: E402


def moved(scene, step_deg, middle, radius_m, n):
    holder = blender_scan.holder_of(blender_scan.scanner(scene, step_deg, [*middle, 0, 0, 0, 0, 0]))
    place = next(node for node in holder.modifiers[0].node_group.nodes if node.bl_idname == "FunctionNodeInputVector")
    took_ms, points = [], 0
    for k in range(n + 1):  # the first also builds Blender's BVH, and isn't counted
        x, y, z = middle
        start = time.perf_counter()
        place.vector = (x + radius_m * math.cos(k), y + radius_m * math.sin(k), z)
        done = holder.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = done.to_mesh()
        hit = blender_scan.figures(mesh)[0::8]
        took_ms.append(1000 * (time.perf_counter() - start))
        done.to_mesh_clear()
        points = sum(one > 0.5 for one in hit)
    return {"points": points, "ms": took_ms[1:]}


def main():
    path, *numbers = sys.argv[sys.argv.index("--") + 1:]
    step_deg, radius_m, n, *middle = map(float, numbers)
    print(json.dumps(moved(blender_scan.load(path), step_deg, middle, radius_m, int(n))))


blender_scan.run(main)
