# SPDX-License-Identifier: MIT
"""This scans a panorama in Blender with geometry nodes. scanhead's points are compared with this independent scanner.

    blender -b --factory-startup -P blender_scan.py -- SCENE.obj STEP_DEG OUT STATION...

SCENE.obj has z up. STATION is x,y,z,heading,pitch,roll,leg,opening: metres in the scene's frame, degrees as a
configuration of scanhead has them; a tripod's length of leg (0: none), and its smallest opening. The nodes, for each
station:

    UV Sphere (180 / step rings, 360 / step segments) -> Transform (attitude): directions, each pole once
    Raycast from the station straight down -> height -> cosine of the legs' opening
    Raycast from the station along each direction onto the scene -> hit, position, normal
    Store Named Attribute: these, and whether the tripod hides the direction

This is for Blender 3.4 to 3.6. Later versions have other names for some nodes, and then the exit status is 77.

OUT has, for each station and each direction in Blender's order (the upper pole, then ring by ring downward,
counter-clockwise from x, then the lower pole), eight floats of 4 bytes in the machine's order: hit, hidden (0 or 1),
position, normal. The nodes have computed all of it, in single precision.
"""
import array
import math
import os
import sys

import bpy
import mathutils


class Tree:
    """A node tree that is written from its inputs to its outputs."""

    def __init__(self, name):
        self.tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
        self.tree.outputs.new("NodeSocketGeometry", "Geometry")

    def node(self, kind, inputs=(), **settings):
        """Adds a node. `inputs` gives, by number, another node's output or a value."""
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        for at, value in inputs:
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, node.inputs[at])
            else:
                node.inputs[at].default_value = value
        return node

    def math(self, operation, *values):
        return self.node("ShaderNodeMath", enumerate(values), operation=operation).outputs[0]

    def vector(self, value):
        return self.node("FunctionNodeInputVector", vector=value).outputs[0]


def socket(sockets, name, kind):
    """A node of several data types has a socket of that name for each type. The enabled one is meant."""
    return next(s for s in sockets if s.name == name and s.type == kind and s.enabled)


def raycast(t, target, source, direction):
    node = t.node("GeometryNodeRaycast")
    for name, value in (("Source Position", source), ("Ray Direction", direction)):
        t.tree.links.new(value, socket(node.inputs, name, "VECTOR"))
    socket(node.inputs, "Ray Length", "VALUE").default_value = 1000.0
    t.tree.links.new(target, node.inputs[0])
    return {name: next(s for s in node.outputs if s.name == name) for name in
            ("Is Hit", "Hit Position", "Hit Normal", "Hit Distance")}


def hidden_by(t, target, at, direction, leg, opening_deg):
    """Gives 1 if the direction's cosine with straight down is above that of the opening."""
    down = t.vector((0.0, 0.0, -1.0))
    below = raycast(t, target, at, down)
    least = math.cos(math.radians(opening_deg))
    asked = t.math("DIVIDE", below["Hit Distance"], leg)
    no_ground = t.math("SUBTRACT", 1.0, below["Is Hit"])
    opening = t.math("MINIMUM", t.math("ADD", asked, no_ground), least)
    cosine = t.node("ShaderNodeVectorMath", ((0, direction), (1, down)), operation="DOT_PRODUCT").outputs["Value"]
    return t.math("GREATER_THAN", cosine, opening)


def attitude(heading_deg, pitch_deg, roll_deg):
    """Turns the head's frame into the scene's: heading clockwise from y, then nose up, then right side down."""
    turn = mathutils.Matrix.Rotation
    z, x, y = (math.radians(a) for a in (-heading_deg, pitch_deg, roll_deg))
    return (turn(z, 3, "Z") @ turn(x, 3, "X") @ turn(y, 3, "Y")).to_euler("XYZ")


def scanner(scene, step_deg, station):
    x, y, z, heading, pitch, roll, leg, opening = station
    t = Tree("scanner")
    at = t.vector((x, y, z))
    target = t.node("GeometryNodeObjectInfo", transform_space="RELATIVE")
    target.inputs[0].default_value = scene
    target = target.outputs["Geometry"]
    sphere = t.node("GeometryNodeMeshUVSphere",
                    ((0, round(360 / step_deg)), (1, round(180 / step_deg)), (2, 1.0))).outputs[0]
    sphere = t.node("GeometryNodeTransform", ((0, sphere), (2, attitude(heading, pitch, roll)))).outputs[0]
    direction = t.node("GeometryNodeInputPosition").outputs[0]
    seen = raycast(t, target, at, direction)
    hidden = hidden_by(t, target, at, direction, leg, opening) if leg > 0 else None
    for name, kind, value in (("hit", "FLOAT", seen["Is Hit"]), ("hidden", "FLOAT", hidden),
                              ("position_m", "FLOAT_VECTOR", seen["Hit Position"]),
                              ("facing", "FLOAT_VECTOR", seen["Hit Normal"])):
        store = t.node("GeometryNodeStoreNamedAttribute", domain="POINT", data_type=kind)
        t.tree.links.new(sphere, store.inputs[0])
        store.inputs["Name"].default_value = name
        if value is not None:
            t.tree.links.new(value, socket(store.inputs, "Value", "VALUE" if kind == "FLOAT" else "VECTOR"))
        sphere = store.outputs[0]
    t.node("NodeGroupOutput", ((0, sphere),))
    return t.tree


def figures(mesh):
    """Returns the attributes of each vertex, one after the other."""
    n = len(mesh.vertices)
    out = array.array("f", bytes(4 * 8 * n))
    for name, first, width in (("hit", 0, 1), ("hidden", 1, 1), ("position_m", 2, 3), ("facing", 5, 3)):
        values = array.array("f", bytes(4 * width * n))
        mesh.attributes[name].data.foreach_get("value" if width == 1 else "vector", values)
        for k in range(width):
            out[first + k::8] = values[k::width]
    return out


def load(path):
    """Returns a mesh file as the one object of the scene."""
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    bpy.ops.wm.obj_import(filepath=path, forward_axis="Y", up_axis="Z")
    parts = [o for o in bpy.data.objects if o.type == "MESH"]
    bpy.context.view_layer.objects.active = parts[0]
    bpy.ops.object.join()
    return bpy.context.view_layer.objects.active


def holder_of(nodes=None):
    """Returns an object whose geometry the nodes make."""
    holder = bpy.data.objects.new("scanner", bpy.data.meshes.new("nothing"))
    bpy.context.collection.objects.link(holder)
    holder.modifiers.new("scanner", "NODES").node_group = nodes
    return holder


def scan(path, step_deg, out, stations):
    scene = load(path)
    holder = holder_of()
    with open(out, "wb") as file:
        for station in stations:
            holder.modifiers[0].node_group = scanner(scene, step_deg, station)
            done = holder.evaluated_get(bpy.context.evaluated_depsgraph_get())
            figures(done.to_mesh()).tofile(file)
            done.to_mesh_clear()


def main():
    path, step_deg, out, *stations = sys.argv[sys.argv.index("--") + 1:]
    scan(path, float(step_deg), out, [[float(v) for v in s.split(",")] for s in stations])


def run(what):
    """Runs a script's main function. Blender itself would end with 0 after an error."""
    if bpy.app.version >= (4, 0, 0):
        os._exit(77)
    try:
        what()
    except Exception as e:
        print(f"{os.path.basename(sys.argv[sys.argv.index('-P') + 1])}: {type(e).__name__}: {e}", file=sys.stderr)
        sys.stderr.flush()
        os._exit(1)


if __name__ == "__main__":
    run(main)
