# Writes x, y, z of a PLY file's vertices, read by its header alone (Python's struct module).
import struct
import sys

TYPES = {"double": "d", "float": "f", "uchar": "B", "ushort": "H"}
with open(sys.argv[1], "rb") as ply, open(sys.argv[2], "w") as out:
    names, layout, count = [], "<", 0
    for line in iter(ply.readline, b"end_header\n"):
        word = line.decode().split()
        if word[:1] == ["format"] and word[1] != "binary_little_endian":
            sys.exit("not little-endian")
        if word[:2] == ["element", "vertex"]:
            count = int(word[2])
        if word[:1] == ["property"]:
            layout += TYPES[word[1]]
            names.append(word[2])
    at = [names.index(n) for n in ("x", "y", "z")]
    body = ply.read()
    if len(body) != count * struct.calcsize(layout):
        sys.exit("the body has another length")
    for vertex in struct.iter_unpack(layout, body):
        print(*(repr(vertex[i]) for i in at), file=out)
