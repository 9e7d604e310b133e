"""The robot and the four critters: each told from the others by outline and colour when it is thirty pixels large."""

import math

from modelling.gltf import Part
from modelling.palette import (BLACK, BLUE, CREAM, DARK, GREEN, ORANGE, PALE, PURPLE, SKY, STEEL, VERMILLION, WHITE,
                               YELLOW, mixed)
from modelling.shapes import ball, band, block, hull, lathe, loft, tube


def both(name, solids, joint):
    """A part and its mirror image on the other side."""
    return [
        Part(name + "_left", solids, joint),
        Part(name + "_right", [s.mirrored() for s in solids], (joint[0], -joint[1], joint[2])),
    ]


def limb(points, radii, colour, segments=4):
    """Never below the table."""
    return tube(points, radii, segments, colour).mapped(lambda p: (p[0], p[1], max(p[2], 0.0)))


def eyes(x, y, z, radius, look=(0.75, 0.35, 0.3)):
    """A pair: white balls with dark pupils that look forward."""
    length = math.sqrt(sum(c * c for c in look))
    at = [tuple(p + share * radius * c / length for p, c in zip((x, y, z), look)) for share in (0.7, 1.07)]
    out = []
    for solid in (ball(radius, 7, 5, WHITE).moved(x, y, z), tube(at, [0.6 * radius, 0.5 * radius], 7, BLACK, 30)):
        out += [solid, solid.mirrored()]
    return out


def robot():
    def wheel():
        # Around y, seen from the left: a tyre with blocks, a hub with five bolts.
        tyre = lathe([(0.155, -0.075), (0.2, -0.04), (0.2, 0.04), (0.155, 0.075)], 12, DARK, 30)
        tyre = tyre.painted(lambda m, c: BLACK if int(6 * (math.atan2(m[1], m[0]) / math.pi + 1)) % 2 else c)
        hub = lathe([(0.12, 0.06), (0.11, 0.092)], 7, PALE, 30)
        cap = lathe([(0.075, 0.08), (0.06, 0.115)], 5, ORANGE, 20)
        return [s.turned("x", -90) for s in (tyre, hub, cap)]

    tub = hull([(-0.44, 0.15, 0.17, 0.34), (-0.4, 0.2, 0.13, 0.37), (0.36, 0.2, 0.13, 0.37), (0.43, 0.16, 0.18, 0.33)],
               8, STEEL, 5)
    shell = hull([(-0.45, 0.17, 0.3, 0.37), (-0.42, 0.27, 0.27, 0.46), (-0.1, 0.29, 0.27, 0.5), (0.25, 0.28, 0.27, 0.46),
                  (0.45, 0.22, 0.28, 0.36), (0.48, 0.16, 0.29, 0.33)], 10, WHITE, 4)
    stripe = hull([(-0.4, 0.075, 0.4, 0.47), (-0.1, 0.085, 0.44, 0.515), (0.25, 0.08, 0.4, 0.475), (0.45, 0.06, 0.3, 0.375)],
                  6, GREEN, 5)
    lamp = lathe([(0.045, 0), (0.05, 0.02), (0.03, 0.035)], 5, YELLOW, 30).turned("y", 90).moved(0.44, 0.14, 0.315)
    fender = hull([(-0.2, 0.07, 0.36, 0.4), (-0.14, 0.09, 0.38, 0.45), (0.14, 0.09, 0.38, 0.45), (0.2, 0.07, 0.36, 0.4)], 6,
                  GREEN, 4)
    fenders = [fender.moved(dx, 0.31) for dx in (-0.27, 0.27)]
    vent = block(0.02, 0.2, 0.05, 0.008, DARK).moved(-0.46, 0, 0.23)
    body = [tub, shell, stripe, lamp, lamp.mirrored(), vent]
    body += fenders + [f.mirrored() for f in fenders]

    neck = lathe([(0.17, 0.48), (0.16, 0.545)], 12, DARK, 30)
    head = lathe([(0.15, 0.535), (0.225, 0.6), (0.2, 0.71), (0.12, 0.77), (0, 0.79)], 12, WHITE)
    collar = band([(0.232, 0.585), (0.232, 0.635), (0.2, 0.61)], 12, GREEN, 30)
    visor = hull([(0.08, 0.15, 0.645, 0.735), (0.2, 0.125, 0.645, 0.725), (0.225, 0.1, 0.655, 0.71)], 8, BLACK, 4)
    eye = ball(0.03, 6, 3, SKY).moved(0.218, 0.045, 0.685)
    barrels = []
    for y in (0.17, -0.17):
        barrels += [
            tube([(-0.02, y, 0.61), (0.3, y, 0.61)], [0.06, 0.055], 7, STEEL),
            tube([(0.3, y, 0.61), (0.45, y, 0.61)], [0.036, 0.036], 6, DARK),
            tube([(0.42, y, 0.61), (0.5, y, 0.61)], [0.05, 0.05], 7, ORANGE, 30),
        ]
    aerial = tube([(-0.12, -0.1, 0.72), (-0.16, -0.11, 0.94)], [0.014, 0.008], 5, DARK, up=(1, 0, 0))
    knob = ball(0.03, 6, 4, ORANGE).moved(-0.162, -0.11, 0.955)
    turret = [neck, head, collar, visor, eye, eye.mirrored(), aerial, knob] + barrels

    parts = [Part("body", body, (0, 0, 0.3)), Part("turret", turret, (0, 0, 0.5))]
    for place, x in (("front", 0.27), ("back", -0.27)):
        solids = [s.moved(x, 0.31, 0.2) for s in wheel()]
        parts += both("wheel_" + place, solids, (x, 0.31, 0.2))
    return parts


def swarmer():
    """Round and low: a beetle."""
    wings = hull([(-0.48, 0.0, 0.2, 0.3), (-0.44, 0.17, 0.14, 0.36), (-0.28, 0.31, 0.11, 0.49), (-0.05, 0.36, 0.1, 0.55),
                  (0.14, 0.31, 0.11, 0.49), (0.22, 0.22, 0.14, 0.4)], 12, VERMILLION)
    wings = wings.painted(lambda m, c: DARK if m[2] < 0.22 else c)
    seam = hull([(-0.44, 0.02, 0.3, 0.385), (-0.28, 0.026, 0.42, 0.52), (-0.05, 0.026, 0.5, 0.578), (0.16, 0.022, 0.4, 0.5)],
                6, BLACK, 4)
    spots = []
    for x, y, z, r, roll, pitch in ((-0.2, 0.19, 0.41, 0.08, -40, -18), (0.04, 0.19, 0.44, 0.075, -38, 12)):
        spot = lathe([(r, 0.0), (0.75 * r, 0.04)], 8, BLACK, 20).turned("y", pitch).turned("x", roll).moved(x, y, z)
        spots += [spot, spot.mirrored()]
    head = ball(0.17, 9, 6, BLACK).scaled(0.85, 1.1, 0.85).moved(0.27, 0, 0.26)
    feeler = limb([(0.35, 0.06, 0.37), (0.43, 0.13, 0.5), (0.47, 0.2, 0.5)], [0.022, 0.016, 0.022], DARK)
    parts = [Part("body", [wings, seam, *spots, head, feeler, feeler.mirrored()] + eyes(0.34, 0.115, 0.31, 0.062),
                  (0, 0, 0.3))]
    fang = limb([(0.36, 0.06, 0.17), (0.46, 0.09, 0.16), (0.5, 0.02, 0.15)], [0.035, 0.03, 0], CREAM)
    parts.append(Part("jaw", [fang, fang.mirrored()], (0.34, 0, 0.18)))
    for place, x, out in (("front", 0.13, 0.13), ("middle", -0.06, 0.0), ("back", -0.25, -0.13)):
        hip = (x, 0.2, 0.2)
        leg = limb([hip, (x + out, 0.42, 0.28), (x + 1.6 * out, 0.5, 0.0)], [0.05, 0.042, 0.014], BLACK)
        parts += both("leg_" + place, [leg], hip)
    return parts


def flanker():
    """Long, flat and wide-legged, with a fin: a water strider."""
    body = hull([(-0.5, 0.0, 0.2, 0.24), (-0.34, 0.06, 0.17, 0.28), (-0.08, 0.1, 0.15, 0.33), (0.16, 0.1, 0.15, 0.34),
                 (0.26, 0.07, 0.17, 0.3)], 10, SKY)
    body = body.painted(lambda m, c: BLUE if m[2] < 0.2 else c)
    head = hull([(0.2, 0.08, 0.18, 0.31), (0.28, 0.16, 0.18, 0.33), (0.36, 0.12, 0.18, 0.3), (0.5, 0.0, 0.2, 0.22)], 8, BLUE)
    fin = hull([(-0.46, 0.012, 0.22, 0.52), (-0.36, 0.03, 0.24, 0.5), (-0.1, 0.02, 0.3, 0.35)], 4, BLUE, 2, 20)
    tail = loft([[(-0.3, 0.03, 0.2), (-0.3, 0.03, 0.24), (-0.46, 0.03, 0.22)],
                 [(-0.4, 0.2, 0.26), (-0.4, 0.2, 0.28), (-0.5, 0.2, 0.27)]], BLUE, 20)
    parts = [Part("body", [body, head, fin, tail, tail.mirrored()] + eyes(0.31, 0.13, 0.29, 0.05), (0, 0, 0.24))]
    blade = limb([(0.36, 0.05, 0.16), (0.46, 0.1, 0.15), (0.5, 0.04, 0.14)], [0.03, 0.028, 0], WHITE)
    parts.append(Part("jaw", [blade, blade.mirrored()], (0.34, 0, 0.17)))
    for place, x, reach in (("front", 0.14, 0.24), ("back", -0.14, -0.3)):
        hip = (x, 0.08, 0.24)
        leg = limb([hip, (x + 0.45 * reach, 0.3, 0.42), (x + reach, 0.5, 0.0)], [0.045, 0.038, 0.016], BLUE)
        knee = ball(0.052, 6, 4, SKY).moved(x + 0.45 * reach, 0.3, 0.42)
        parts += both("leg_" + place, [leg, knee], hip)
    return parts


def jumper():
    """Knees over its back and eyes on top: a hopper."""
    body = hull([(-0.36, 0.0, 0.2, 0.26), (-0.28, 0.12, 0.15, 0.36), (-0.2, 0.16, 0.14, 0.43), (-0.14, 0.185, 0.145, 0.47),
                 (-0.04, 0.21, 0.16, 0.53), (0.03, 0.22, 0.17, 0.565), (0.15, 0.22, 0.2, 0.6), (0.28, 0.17, 0.26, 0.58),
                 (0.36, 0.0, 0.36, 0.48)], 10, YELLOW)

    def striped(middle, colour_):
        if middle[2] < 0.27:
            return CREAM
        return BLACK if -0.2 < middle[0] < -0.14 or -0.04 < middle[0] < 0.03 else colour_

    body = body.painted(striped)
    parts = [Part("body", [body] + eyes(0.22, 0.13, 0.6, 0.1), (0, 0, 0.36))]
    lip = hull([(0.16, 0.15, 0.22, 0.3), (0.3, 0.13, 0.25, 0.32), (0.4, 0.06, 0.29, 0.335)], 8, ORANGE, 3)
    parts.append(Part("jaw", [lip], (0.16, 0, 0.27)))
    hip = (-0.06, 0.19, 0.27)
    thigh = limb([hip, (-0.18, 0.26, 0.42), (-0.3, 0.31, 0.58), (-0.42, 0.35, 0.7)], [0.06, 0.1, 0.075, 0.035], YELLOW, 6)
    knee = ball(0.05, 6, 4, BLACK).moved(-0.42, 0.35, 0.7)
    shin = limb([(-0.42, 0.35, 0.7), (-0.28, 0.36, 0.35), (-0.16, 0.37, 0.03)], [0.036, 0.034, 0.026], BLACK, 5)
    foot = hull([(-0.24, 0.03, 0.0, 0.05), (-0.1, 0.055, 0.0, 0.06), (0.1, 0.075, 0.0, 0.025)], 6, BLACK, 3).moved(y=0.37)
    parts += both("leg_back", [thigh, knee, shin, foot], hip)
    shoulder = (0.2, 0.15, 0.28)
    arm = limb([shoulder, (0.26, 0.27, 0.22), (0.34, 0.29, 0.0)], [0.045, 0.035, 0.02], BLACK, 5)
    parts += both("leg_front", [arm], shoulder)
    return parts


def spitter():
    """Upright, with a snout like a trumpet over a bulging sack."""
    sack = lathe([(0, 0.1), (0.2, 0.12), (0.33, 0.24), (0.345, 0.38), (0.27, 0.52), (0.16, 0.62), (0, 0.66)], 10, PURPLE, 80)
    sack = sack.turned("y", -14).moved(-0.14, 0, 0.02).painted(lambda m, c: mixed(c, WHITE, 0.55) if m[2] < 0.2 else c)
    warts = []
    for x, y, z, r in ((-0.44, 0.1, 0.42, 0.07), (-0.36, 0.2, 0.56, 0.06), (-0.2, 0.31, 0.42, 0.065), (-0.36, 0.26, 0.3, 0.05)):
        wart = ball(r, 6, 3, GREEN).moved(x, y, z)
        warts += [wart, wart.mirrored()]
    dark = mixed(PURPLE, BLACK, 0.45)
    neck = tube([(-0.12, 0, 0.45), (0.04, 0, 0.72), (0.2, 0, 0.8), (0.32, 0, 0.8)], [0.2, 0.16, 0.115, 0.09], 8, PURPLE)
    # The trumpet is hollow: its inside goes back from the rim.
    trumpet = lathe([(0.085, 0), (0.1, 0.08), (0.185, 0.2), (0.185, 0.225), (0.14, 0.2), (0.06, 0.1), (0, 0.09)], 10, dark, 35)
    trumpet = trumpet.painted(lambda m, c: GREEN if m[2] > 0.095 and m[0] ** 2 + m[1] ** 2 < 0.013 else c)
    trumpet = trumpet.turned("y", 90).moved(0.29, 0, 0.8)
    crest = hull([(-0.2, 0.014, 0.66, 0.78), (-0.1, 0.03, 0.7, 0.92), (0.0, 0.03, 0.78, 1.0), (0.12, 0.014, 0.86, 0.94)], 6, dark)
    parts = [Part("body", [sack, neck, trumpet, crest, *warts] + eyes(0.1, 0.125, 0.86, 0.065, (0.8, 0.5, 0.1)),
                  (0, 0, 0.4))]
    lip = hull([(0.22, 0.05, 0.63, 0.7), (0.36, 0.085, 0.58, 0.64), (0.47, 0.1, 0.555, 0.6), (0.5, 0.06, 0.57, 0.59)], 8, dark, 3)
    parts.append(Part("jaw", [lip], (0.22, 0, 0.68)))
    for place, x, out in (("front", 0.06, 0.12), ("back", -0.3, -0.1)):
        hip = (x, 0.2, 0.22)
        leg = limb([hip, (x + 0.6 * out, 0.36, 0.2), (x + out, 0.36, 0.0)], [0.09, 0.08, 0.07], dark, 6)
        parts += both("leg_" + place, [leg], hip)
    return parts
