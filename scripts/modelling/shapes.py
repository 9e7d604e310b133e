"""Closed low-poly solids. Frame: +x forward, y to the left, z up, metres.

A solid is a list of faces, counter-clockwise seen from outside; a face is its corners and a colour. Every function
here gives a closed surface, so that a part made of solids has an inside.
"""

import math


class Solid:
    """`crease_deg`: edges whose faces differ by more stay sharp."""

    def __init__(self, faces, crease_deg=40.0):
        self.faces = faces  # [(corners, (r, g, b, a))], colours sRGB-encoded 0..1
        self.crease_deg = crease_deg

    def mapped(self, function, mirrored=False):
        faces = [(tuple(function(p) for p in corners), colour) for corners, colour in self.faces]
        if mirrored:
            faces = [(corners[::-1], colour) for corners, colour in faces]
        return Solid(faces, self.crease_deg)

    def moved(self, x=0.0, y=0.0, z=0.0):
        return self.mapped(lambda p: (p[0] + x, p[1] + y, p[2] + z))

    def scaled(self, x, y=None, z=None):
        y, z = (x if y is None else y), (x if z is None else z)
        return self.mapped(lambda p: (p[0] * x, p[1] * y, p[2] * z))

    def mirrored(self):
        return self.mapped(lambda p: (p[0], -p[1], p[2]), mirrored=True)

    def turned(self, axis, degrees):
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn = {
            "x": lambda p: (p[0], c * p[1] - s * p[2], s * p[1] + c * p[2]),
            "y": lambda p: (c * p[0] + s * p[2], p[1], -s * p[0] + c * p[2]),
            "z": lambda p: (c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]),
        }[axis]
        return self.mapped(turn)

    def painted(self, function):
        """`function(middle, colour)` gives each face its colour."""
        faces = []
        for corners, colour in self.faces:
            middle = tuple(sum(p[k] for p in corners) / len(corners) for k in range(3))
            faces.append((corners, function(middle, colour)))
        return Solid(faces, self.crease_deg)

    def creased(self, degrees):
        return Solid(self.faces, degrees)


def loft(rings, colour, crease_deg=40.0):
    """Rings of equally many points, each counter-clockwise seen from the end towards the start; the ends are closed.
    A ring of one point is a tip."""
    faces = []
    n = max(len(r) for r in rings)
    for a, b in zip(rings, rings[1:]):
        for i in range(n):
            j = (i + 1) % n
            corners = [a[i % len(a)], a[j % len(a)], b[j % len(b)], b[i % len(b)]]
            if len(a) == 1:
                corners = [a[0], b[j], b[i]]
            elif len(b) == 1:
                corners = [a[i], a[j], b[0]]
            faces.append((tuple(corners), colour))
    if len(rings[0]) > 1:
        faces.append((tuple(rings[0][::-1]), colour))
    if len(rings[-1]) > 1:
        faces.append((tuple(rings[-1]), colour))
    return Solid(faces, crease_deg)


def lathe(profile, segments, colour, crease_deg=40.0, twist_deg=0.0):
    """Around z; `profile` is (radius, z) from below to above. `twist_deg`: how far each ring turns over the one below."""
    rings = []
    for k, (radius, z) in enumerate(profile):
        if radius == 0:
            rings.append([(0.0, 0.0, z)])
            continue
        turn = math.radians(twist_deg) * k
        angles = [turn + 2 * math.pi * i / segments for i in range(segments)]
        rings.append([(radius * math.cos(a), radius * math.sin(a), z) for a in angles])
    return loft(rings, colour, crease_deg)


def ball(radius, segments, rows, colour, twist_deg=0.0):
    """An ellipsoid is a ball that is scaled."""
    profile = []
    for k in range(rows + 1):
        a = math.pi * k / rows
        profile.append((0 if k in (0, rows) else radius * math.sin(a), -radius * math.cos(a)))
    return lathe(profile, segments, colour, crease_deg=80, twist_deg=twist_deg)


def hull(sections, segments, colour, power=2.0, crease_deg=50.0):
    """A body along x. `sections`: (x, half_width, low, high), from the back to the front; half_width 0 is a tip.
    `power`: 2 is round, more is boxier."""

    def round_(value):
        return math.copysign(abs(value) ** (2 / power), value)

    rings = []
    for x, half_width, low, high in sections:
        middle = (low + high) / 2
        if half_width == 0:
            rings.append([(x, 0.0, middle)])
            continue
        ring = []
        for i in range(segments):
            a = 2 * math.pi * (i + 0.5) / segments
            ring.append((x, half_width * round_(math.cos(a)), middle + (high - low) / 2 * round_(math.sin(a))))
        rings.append(ring)
    return loft(rings, colour, crease_deg)


def _sum(a, b, share=1.0):
    return tuple(p + share * q for p, q in zip(a, b))


def _difference(a, b):
    return tuple(p - q for p, q in zip(a, b))


def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _unit(a):
    length = math.sqrt(sum(p * p for p in a))
    return tuple(p / length for p in a)


def tube(points, radii, segments, colour, crease_deg=60.0, up=(0.0, 0.0, 1.0)):
    """Along a path; a radius of 0 at an end is a tip. `up` must never lie along the path."""
    rings = []
    for k, (point, radius) in enumerate(zip(points, radii)):
        if radius == 0:
            rings.append([point])
            continue
        before, after = points[max(k - 1, 0)], points[min(k + 1, len(points) - 1)]
        along = _unit(_difference(after, before))
        side = _unit(_cross(up, along))
        top = _cross(along, side)
        ring = []
        for i in range(segments):
            a = 2 * math.pi * (i + 0.5) / segments
            ring.append(_sum(_sum(point, side, radius * math.cos(a)), top, radius * math.sin(a)))
        rings.append(ring)
    return loft(rings, colour, crease_deg)


def block(x, y, z, chamfer, colour):
    """A box centred on the origin with cut edges; sizes are whole lengths."""
    x, y, z, c = x / 2, y / 2, z / 2, chamfer
    faces = []

    def outward(corners):
        middle = tuple(sum(p[k] for p in corners) for k in range(3))
        normal = _cross(_difference(corners[1], corners[0]), _difference(corners[2], corners[0]))
        if sum(p * q for p, q in zip(middle, normal)) < 0:
            corners = corners[::-1]
        faces.append((tuple(corners), colour))

    def corner(sx, sy, sz, flat):
        """The corner's point that lies on the face across the axis `flat`."""
        inner = [x - c, y - c, z - c]
        inner[flat] += c
        return (sx * inner[0], sy * inner[1], sz * inner[2])

    signs = (-1, 1)
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for s in signs:
            quad = []
            for su, sv in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                sign = [0, 0, 0]
                sign[axis], sign[u], sign[v] = s, su, sv
                quad.append(corner(*sign, axis))
            outward(quad)
        for su in signs:  # the four edges along this axis
            for sv in signs:
                quad = []
                for s, flat in ((-1, u), (1, u), (1, v), (-1, v)):
                    sign = [0, 0, 0]
                    sign[axis], sign[u], sign[v] = s, su, sv
                    quad.append(corner(*sign, flat))
                outward(quad)
    for sx in signs:
        for sy in signs:
            for sz in signs:
                outward([corner(sx, sy, sz, k) for k in range(3)])
    return Solid(faces, 20)


def plate(outline, thickness, bevel, colour):
    """From z = 0 upwards. `outline`: (x, y), counter-clockwise, seen whole from the origin; edges are cut by `bevel`, a
    share of its size."""
    n = len(outline)

    def ring(share, z):
        return [(p[0] * share, p[1] * share, z) for p in outline]

    cut = min(bevel, thickness / 3)
    rings = [ring(1 - bevel, 0.0), ring(1, cut), ring(1, thickness - cut), ring(1 - bevel, thickness)]
    faces = []
    for a, b in zip(rings, rings[1:]):
        for i in range(n):
            j = (i + 1) % n
            faces.append(((a[i], a[j], b[j], b[i]), colour))
    for i in range(n):
        j = (i + 1) % n
        faces.append((((0.0, 0.0, 0.0), rings[0][j], rings[0][i]), colour))
        faces.append((((0.0, 0.0, thickness), rings[-1][i], rings[-1][j]), colour))
    return Solid(faces, 25)


def band(profile, segments, colour, crease_deg=40.0):
    """A ring around z; `profile`: (radius, z) around its cross-section, counter-clockwise with the radius to the right
    and z up."""
    faces = []
    n = len(profile)
    for i in range(segments):
        a, b = 2 * math.pi * i / segments, 2 * math.pi * (i + 1) / segments
        for k in range(n):
            (r0, z0), (r1, z1) = profile[k], profile[(k + 1) % n]
            corners = (
                (r0 * math.cos(a), r0 * math.sin(a), z0),
                (r0 * math.cos(b), r0 * math.sin(b), z0),
                (r1 * math.cos(b), r1 * math.sin(b), z1),
                (r1 * math.cos(a), r1 * math.sin(a), z1),
            )
            faces.append((corners, colour))
    return Solid(faces, crease_deg)


def round_band(radius, thickness, segments, rows, colour):
    around = [2 * math.pi * k / rows for k in range(rows)]
    return band([(radius + thickness * math.cos(a), thickness * math.sin(a)) for a in around], segments, colour, 80)


def star(points, outer, inner, turn_deg=0.0):
    out = []
    for k in range(2 * points):
        a = math.radians(turn_deg) + math.pi * k / points
        radius = outer if k % 2 == 0 else inner
        out.append((radius * math.cos(a), radius * math.sin(a)))
    return out


def regular(corners, radius, turn_deg=0.0):
    angles = [math.radians(turn_deg) + 2 * math.pi * k / corners for k in range(corners)]
    return [(radius * math.cos(a), radius * math.sin(a)) for a in angles]
