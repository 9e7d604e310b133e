"""What lies about in the games."""

import math

from modelling.gltf import Part
from modelling.palette import (BLACK, BLUE, BRASS, CREAM, DARK, GOLD, GREEN, ORANGE, PALE, PURPLE, SKY, STEEL, VERMILLION,
                               WHITE, YELLOW, colour, mixed)
from modelling.shapes import ball, band, block, hull, lathe, loft, plate, regular, round_band, star, tube


def bolt():
    """A glowing dart."""
    core = hull([(-0.5, 0.0, 0.1, 0.18), (-0.3, 0.06, 0.08, 0.2), (0.2, 0.14, 0.0, 0.28), (0.36, 0.11, 0.03, 0.25),
                 (0.5, 0.0, 0.12, 0.16)], 10, SKY)
    core = core.painted(lambda m, c: WHITE if m[0] > 0.05 else c)
    fins = []
    for angle in (0, 120, 240):
        fin = loft([[(-0.46, -0.012, 0.05), (-0.14, -0.012, 0.05), (-0.36, -0.012, 0.14)],
                    [(-0.46, 0.012, 0.05), (-0.14, 0.012, 0.05), (-0.36, 0.012, 0.14)]], BLUE, 10)
        fins.append(fin.turned("x", angle).moved(z=0.14))
    rings = [round_band(r, 0.02, 12, 5, BLUE).turned("y", 90).moved(x, 0, 0.14) for x, r in ((0.1, 0.11), (-0.1, 0.09))]
    return [Part("body", [core, *fins, *rings], (0, 0, 0.14))]


def spit():
    """A flying drop with smaller ones behind it."""
    drop = hull([(-0.36, 0.0, 0.28, 0.3), (-0.2, 0.08, 0.22, 0.38), (0.05, 0.2, 0.1, 0.5), (0.25, 0.25, 0.06, 0.55),
                 (0.42, 0.17, 0.14, 0.47), (0.5, 0.0, 0.28, 0.34)], 12, GREEN, crease_deg=80)
    drop = drop.painted(lambda m, c: mixed(c, WHITE, max(0.0, 1.2 * (m[2] - 0.25))))
    drops = [ball(r, 8, 5, PURPLE).moved(x, y, z)
             for x, y, z, r in ((-0.32, 0.14, 0.4, 0.07), (-0.18, -0.16, 0.16, 0.08), (-0.45, -0.05, 0.2, 0.05), (-0.1, 0.2, 0.1, 0.06))]
    return [Part("body", [drop, *drops], (0, 0, 0.3))]


def pickup(accent, icon):
    """A stand with a sign that floats over it; the sign turns."""
    stand = lathe([(0.36, 0.0), (0.38, 0.03), (0.34, 0.1), (0.26, 0.13), (0.24, 0.11)], 8, DARK, 20)
    ring = lathe([(0.375, 0.045), (0.385, 0.06), (0.36, 0.09), (0.345, 0.095)], 8, accent, 20)
    glow = lathe([(0.22, 0.1), (0.2, 0.14), (0.1, 0.15)], 8, mixed(accent, WHITE, 0.5), 20)
    return [Part("base", [stand, ring, glow]), Part("icon", icon, (0, 0, 0.6))]


def upright(solid, thickness):
    """A plate that lies on z = 0, facing forward, its middle at the sign's height."""
    return solid.moved(z=-thickness / 2).turned("z", 90).turned("y", 90).moved(z=0.6)


def cross(arm, width):
    a, w = arm, width
    return [(a, -w), (a, w), (w, w), (w, a), (-w, a), (-w, w), (-a, w), (-a, -w), (-w, -w), (-w, -a), (w, -a), (w, -w)]


def pickup_heal():
    disc = upright(plate(regular(16, 0.36), 0.12, 0.08, WHITE), 0.12)
    sign = upright(plate(cross(0.27, 0.09), 0.2, 0.06, GREEN), 0.2)
    return pickup(GREEN, [disc, sign])


def pickup_rapid():
    out = []
    for y in (-0.19, 0.0, 0.19):
        # Half an arrow, and the other half.
        half = [(0.0, 0.15), (-0.32, -0.09), (-0.32, -0.2), (0.0, 0.04)]
        middle = (-0.16, -0.025)
        half = [(px - middle[0], py - middle[1]) for px, py in half]
        arrow = plate(half, 0.16, 0.08, mixed(ORANGE, YELLOW, (y + 0.19) / 0.38)).moved(middle[0], middle[1] + y)
        other = arrow.mapped(lambda p: (-p[0], p[1], p[2]), mirrored=True)
        out += [upright(arrow, 0.16), upright(other, 0.16)]
    return pickup(ORANGE, out)


def shield_outline(size):
    points = [(-0.8, 0.85), (-0.8, 0.05), (-0.62, -0.45), (-0.3, -0.82), (0, -1), (0.3, -0.82), (0.62, -0.45), (0.8, 0.05),
              (0.8, 0.85), (0.4, 0.92), (0, 1.0), (-0.4, 0.92)]
    return [(size * x, size * y) for x, y in points]


def pickup_shield():
    rim = upright(plate(shield_outline(0.38), 0.14, 0.08, PALE), 0.14)
    face = upright(plate(shield_outline(0.29), 0.2, 0.06, BLUE), 0.2)
    badge = upright(plate(star(5, 0.15, 0.065, 90), 0.25, 0.12, YELLOW), 0.25)
    return pickup(BLUE, [rim, face, badge])


def pickup_bomb():
    shell = ball(0.29, 14, 9, DARK).moved(z=0.54)
    belt = band([(0.283, -0.045), (0.3, -0.03), (0.3, 0.03), (0.283, 0.045), (0.2, 0.045), (0.2, -0.045)], 14, VERMILLION, 30).moved(z=0.54)
    neck = lathe([(0.1, 0.78), (0.1, 0.86), (0.07, 0.88)], 8, STEEL, 30)
    fuse = tube([(0, 0, 0.86), (0.0, 0.03, 0.92), (0.0, 0.1, 0.95), (0.0, 0.16, 0.93)], [0.022, 0.022, 0.022, 0.02], 5, CREAM,
                up=(1, 0, 0))
    spark = plate(star(6, 0.085, 0.035), 0.05, 0.1, YELLOW).moved(z=-0.025).turned("y", 90).moved(0, 0.185, 0.92)
    return pickup(VERMILLION, [shell, belt, neck, fuse, spark])


def sun():
    middle = 0.5
    globe = ball(0.29, 18, 11, YELLOW).painted(lambda m, c: mixed(c, ORANGE, 0.75 * max(0.0, -m[2] / 0.29))).moved(z=middle)
    long, short = [], []
    for k in range(12):
        colour_, reach, width = (ORANGE, 0.5, 0.075) if k % 2 == 0 else (YELLOW, 0.42, 0.06)
        ray = lathe([(width, 0.31), (width * 0.9, 0.33), (0, reach)], 6, colour_, 25)
        (long if k % 2 == 0 else short).append(ray.turned("x", 30 * k).moved(z=middle))
    front = [ray.moved(z=-middle).turned("z", 90).moved(z=middle) for ray in long if abs(ray.faces[0][0][0][1]) > 0.05]
    return [Part("body", [globe], (0, 0, middle)), Part("rays", long + short + front, (0, 0, middle))]


def lens():
    """Its axis is x; the glass has a radius of 0.44 and its middle at z = 0.5."""
    radius, bulge, rows = 0.44, 0.11, 5
    # Two caps of a sphere, from the back to the front.
    sphere = (radius ** 2 + bulge ** 2) / (2 * bulge)
    cap = []
    for k in range(1, rows + 1):
        r = radius * k / rows
        cap.append((r, math.sqrt(sphere ** 2 - r ** 2) - (sphere - bulge)))
    profile = [(0, -bulge)] + [(r, -x) for r, x in cap[:-1]] + [(radius, 0.0)] + [(r, x) for r, x in cap[-2::-1]] + [(0, bulge)]
    glass = lathe(profile, 28, colour("BFE6F7", 0.25), 75).turned("y", 90).moved(z=0.5)
    rim = band([(0.43, -0.05), (0.49, -0.05), (0.5, -0.03), (0.5, 0.03), (0.49, 0.05), (0.43, 0.05), (0.425, 0.03), (0.425, -0.03)],
               28, BRASS, 30)
    rim = rim.painted(lambda m, c: mixed(c, GOLD, 0.8) if abs(m[2]) < 0.02 else c).turned("y", 90).moved(z=0.5)
    screws = [lathe([(0.022, 0.048), (0.022, 0.056), (0.012, 0.062)], 6, DARK, 30)
              .moved(0.465).turned("z", 120 * k + 30).turned("y", 90).moved(z=0.5) for k in range(3)]
    return [Part("rim", [rim, *screws], (0, 0, 0.5)), Part("glass", [glass], (0, 0, 0.5))]


def marble():
    """Six swirls from pole to pole, three of each colour, so that it is seen to roll."""
    solid = ball(0.5, 24, 16, WHITE, twist_deg=7.5)
    faces = []
    for index, (corners, _) in enumerate(solid.faces):
        swirl = (index % 24) // 4
        faces.append((corners, BLUE if swirl % 2 == 0 else WHITE))
    solid.faces = faces
    return [Part("body", [solid.moved(z=0.5)], (0, 0, 0.5))]


def coin():
    """Standing on its edge, facing forward."""
    disc = lathe([(0.4, -0.045), (0.4, 0.045)], 28, mixed(GOLD, ORANGE, 0.55), 30)
    rim = band([(0.385, -0.06), (0.48, -0.06), (0.5, -0.045), (0.5, 0.045), (0.48, 0.06), (0.385, 0.06), (0.37, 0.045), (0.37, -0.045)],
               28, GOLD, 30)
    badge = plate(star(5, 0.3, 0.125, 90), 0.13, 0.1, mixed(YELLOW, WHITE, 0.15)).moved(z=-0.065)
    solids = [s.turned("z", 90).turned("y", 90).moved(z=0.5) for s in (disc, rim, badge)]
    return [Part("body", solids, (0, 0, 0.5))]


def goal():
    """A flat target: what rolls gets onto it from every side."""
    rings = []
    for k, (radius, colour_) in enumerate(((0.5, GREEN), (0.4, WHITE), (0.3, GREEN), (0.2, WHITE), (0.1, YELLOW))):
        low, high = (0.0 if k == 0 else 0.012 * k), 0.02 + 0.012 * k
        rings.append(lathe([(radius, low), (radius - 0.015, high)], 28, colour_, 20))
    posts = []
    for k in range(4):
        post = lathe([(0.035, 0.0), (0.03, 0.16), (0.02, 0.17)], 6, DARK, 30)
        lamp = ball(0.042, 6, 4, YELLOW).moved(z=0.2)
        posts += [s.moved(0.455).turned("z", 45 + 90 * k) for s in (post, lamp)]
    return [Part("body", rings + posts)]


def ramp():
    """Rises towards +x, from the table to 0.36."""
    def wedge(x0, x1, y0, y1, z0, z1, colour_):
        left = [(x0, y1, 0.0), (x1, y1, 0.0), (x1, y1, z1), (x0, y1, z0)]
        right = [(x0, y0, 0.0), (x1, y0, 0.0), (x1, y0, z1), (x0, y0, z0)]
        return loft([left, right], colour_, 10)

    deck = wedge(-0.5, 0.5, -0.27, 0.27, 0.004, 0.36, PALE)
    deck = deck.painted(lambda m, c: STEEL if abs(m[1]) > 0.2 or m[0] > 0.4 else c)
    rail = wedge(-0.5, 0.5, 0.27, 0.32, 0.05, 0.42, BLUE)
    signs = []
    slope = math.degrees(math.atan2(0.356, 1.0))
    for x in (-0.3, 0.0, 0.3):
        half = [(0.1, 0.0), (0.0, 0.15), (-0.09, 0.15), (0.01, 0.0)]
        middle = (0.005, 0.075)
        left = plate([(a - middle[0], b - middle[1]) for a, b in half], 0.018, 0.05, ORANGE).moved(*middle)
        z = 0.004 + 0.356 * (x + 0.5) - 0.005
        signs += [s.turned("y", -slope).moved(x, 0, z) for s in (left, left.mirrored())]
    posts = [lathe([(0.03, 0.0), (0.03, 0.46), (0.018, 0.48)], 6, YELLOW, 30).moved(0.47, y) for y in (0.295, -0.295)]
    return [Part("body", [deck, rail, rail.mirrored(), *signs, *posts])]


def flag():
    foot = lathe([(0.13, 0.0), (0.13, 0.03), (0.06, 0.055)], 12, DARK, 30)
    pole = lathe([(0.022, 0.04), (0.018, 0.96)], 8, PALE, 30)
    knob = ball(0.035, 8, 5, GOLD).moved(z=0.965)
    columns, rows = 8, 4
    length, top, height, thick = 0.62, 0.93, 0.4, 0.008

    def wave(x):
        return 0.05 * math.sin(2 * math.pi * x / 0.55) * min(1.0, x / 0.2)

    def corner(i, j, side):
        x = length * i / columns
        return (-(0.015 + x), wave(x) - side * thick, top - height * j / rows - 0.05 * x)

    faces = []
    for i in range(columns):
        for j in range(rows):
            checked = VERMILLION if (i // 2 + j // 1) % 2 == 0 else WHITE
            quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            faces.append((tuple(corner(a, b, 1) for a, b in quad), checked))
            faces.append((tuple(corner(a, b, -1) for a, b in quad[::-1]), checked))
    border = [(i, 0) for i in range(columns)] + [(columns, j) for j in range(rows)]
    border += [(i, rows) for i in range(columns, 0, -1)] + [(0, j) for j in range(rows, 0, -1)]
    for a, b in zip(border, border[1:] + border[:1]):
        faces.append(((corner(*a, -1), corner(*b, -1), corner(*b, 1), corner(*a, 1)), WHITE))
    cloth = foot.__class__(faces, 45)
    return [Part("pole", [foot, pole, knob]), Part("cloth", [cloth], (0, 0, 0.73))]
