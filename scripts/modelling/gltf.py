"""Parts made of solids, written as binary glTF 2.0. The same parts give the same bytes."""

import json
import math
import struct

FLOAT, UNSIGNED_SHORT = 5126, 5123
VERTICES, INDICES = 34962, 34963


class Part:
    """`joint`: where the part turns, in the model's frame; solids are in the model's frame too."""

    def __init__(self, name, solids, joint=(0.0, 0.0, 0.0)):
        self.name, self.solids, self.joint = name, solids, joint


def _linear(c):
    return c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4


def _gltf_axes(p):
    """glTF looks along +z with y up; models here look along +x with z up."""
    return (p[1], p[2], p[0])


def _normal(corners):
    """Of a polygon (Newell), as long as twice its area."""
    n = [0.0, 0.0, 0.0]
    for a, b in zip(corners, corners[1:] + corners[:1]):
        n[0] += (a[1] - b[1]) * (a[2] + b[2])
        n[1] += (a[2] - b[2]) * (a[0] + b[0])
        n[2] += (a[0] - b[0]) * (a[1] + b[1])
    return n


def _key(p):
    return tuple(round(c, 5) + 0.0 for c in p)


def _vertices_of(solid, shade):
    """Corners with normals averaged over the faces that meet softly, then triangles."""
    limit = math.cos(math.radians(solid.crease_deg))
    faces, around = [], {}
    for corners, colour in solid.faces:
        normal = _normal(corners)
        length = math.sqrt(sum(c * c for c in normal))
        if length < 1e-12:
            continue
        unit = tuple(c / length for c in normal)
        faces.append((corners, colour, unit))
        for p in corners:
            around.setdefault(_key(p), []).append((unit, length))
    for corners, colour, unit in faces:
        face = []
        for p in corners:
            total = [0.0, 0.0, 0.0]
            for other, area in around[_key(p)]:
                if sum(a * b for a, b in zip(unit, other)) >= limit:
                    total = [t + area * o for t, o in zip(total, other)]
            length = math.sqrt(sum(c * c for c in total))
            normal = tuple(c / length for c in total)
            face.append((_key(p), tuple(round(c, 4) + 0.0 for c in normal), shade(p, colour)))
        for i in range(1, len(face) - 1):
            triangle = (face[0], face[i], face[i + 1])
            if len({v[0] for v in triangle}) == 3:
                yield triangle


def write_model(name, parts, darker_below=0.72):
    """The bytes. `darker_below`: the brightness at the bottom of the model; its top has 1."""
    heights = [p[2] for part in parts for solid in part.solids for corners, _ in solid.faces for p in corners]
    low, high = min(heights), max(heights)

    def shade(p, colour):
        light = darker_below + (1 - darker_below) * (p[2] - low) / (high - low)
        linear = [min(1.0, _linear(c) * light) for c in colour[:3]] + [colour[3]]
        return tuple(round(65535 * c) for c in linear)

    data = bytearray()
    views, accessors, meshes, nodes = [], [], [], []

    def add(content, target, component, count, kind, **more):
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content), "target": target})
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": count, "type": kind, **more})
        data.extend(content)
        data.extend(bytes(-len(data) % 4))
        return len(accessors) - 1

    for part in parts:
        vertices, indices, places = [], [], {}
        for solid in part.solids:
            for triangle in _vertices_of(solid, shade):
                for position, normal, colour in triangle:
                    local = _key(tuple(a - b for a, b in zip(position, part.joint)))
                    vertex = (_gltf_axes(local), _gltf_axes(normal), colour)
                    if vertex not in places:
                        places[vertex] = len(vertices)
                        vertices.append(vertex)
                    indices.append(places[vertex])
        assert len(vertices) < 65536, part.name
        # What a reader gets are floats: the bounds have to be of those.
        floats = [struct.unpack("<3f", struct.pack("<3f", *v[0])) for v in vertices]
        meshes.append({
            "name": part.name,
            "primitives": [{
                "attributes": {
                    "POSITION": add(b"".join(struct.pack("<3f", *v[0]) for v in vertices), VERTICES, FLOAT,
                                    len(vertices), "VEC3", min=[min(f[k] for f in floats) for k in range(3)],
                                    max=[max(f[k] for f in floats) for k in range(3)]),
                    "NORMAL": add(b"".join(struct.pack("<3f", *v[1]) for v in vertices), VERTICES, FLOAT,
                                  len(vertices), "VEC3"),
                    "COLOR_0": add(b"".join(struct.pack("<4H", *v[2]) for v in vertices), VERTICES, UNSIGNED_SHORT,
                                   len(vertices), "VEC4", normalized=True),
                },
                "indices": add(b"".join(struct.pack("<H", i) for i in indices), INDICES, UNSIGNED_SHORT,
                               len(indices), "SCALAR"),
                "material": 0,
            }],
        })
        nodes.append({"name": part.name, "mesh": len(meshes) - 1, "translation": list(_gltf_axes(_key(part.joint)))})

    blend = any(colour[3] < 1 for part in parts for solid in part.solids for _, colour in solid.faces)
    document = {
        "asset": {"version": "2.0", "generator": "Parallax make-models"},
        "scene": 0,
        "scenes": [{"name": name, "nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [{
            "name": "painted",
            "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.7},
            **({"alphaMode": "BLEND"} if blend else {}),
        }],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(document, separators=(",", ":"), sort_keys=True).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(data)
    return (struct.pack("<4sII", b"glTF", 2, length) + struct.pack("<I4s", len(text), b"JSON") + text +
            struct.pack("<I4s", len(data), b"BIN\0") + bytes(data))
