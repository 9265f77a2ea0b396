# SPDX-License-Identifier: MIT
# This writes x, y, z of a PLY file's vertices. It reads the file by its header alone (Python's struct module). A third
# name gets the corners of its faces.
import struct
import sys

TYPES = {"double": "d", "float": "f", "uchar": "B", "ushort": "H", "int": "i"}
with open(sys.argv[1], "rb") as ply, open(sys.argv[2], "w") as out:
    names, layout, count = {}, {}, {}
    for line in iter(ply.readline, b"end_header\n"):
        word = line.decode().split()
        if word[:1] == ["format"] and word[1] != "binary_little_endian":
            sys.exit("not little-endian")
        if word[:1] == ["element"]:
            element = word[1]
            names[element], layout[element], count[element] = [], "<", int(word[2])
        if word[:2] == ["property", "list"]:
            # faces are triangles, so three corners follow their number
            layout[element] += TYPES[word[2]] + 3 * TYPES[word[3]]
            names[element] += ["n", 0, 1, 2]
        elif word[:1] == ["property"]:
            layout[element] += TYPES[word[1]]
            names[element].append(word[2])
    at = [names["vertex"].index(n) for n in ("x", "y", "z")]
    body = ply.read()
    size = {e: count[e] * struct.calcsize(layout[e]) for e in count}
    if len(body) != sum(size.values()):
        sys.exit("the body has another length")
    vertices = struct.iter_unpack(layout["vertex"], body[: size["vertex"]])
    for vertex in vertices:
        print(*(repr(vertex[i]) for i in at), file=out)
    if len(sys.argv) > 3:
        with open(sys.argv[3], "w") as faces:
            for face in struct.iter_unpack(layout["face"], body[size["vertex"] :]):
                if face[0] != 3:
                    sys.exit("not a triangle")
                print(*face[1:4], file=faces)
