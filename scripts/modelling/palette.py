"""Colours that are told apart with any kind of colour vision: Okabe and Ito, Color Universal Design (2008)."""


def colour(hexadecimal, alpha=1.0):
    return tuple(int(hexadecimal[i:i + 2], 16) / 255 for i in (0, 2, 4)) + (alpha,)


ORANGE = colour("E69F00")
SKY = colour("56B4E9")
GREEN = colour("009E73")
YELLOW = colour("F0E442")
BLUE = colour("0072B2")
VERMILLION = colour("D55E00")
PURPLE = colour("CC79A7")

WHITE = colour("F4F3EE")
PALE = colour("D9DCDD")
STEEL = colour("8B949C")
DARK = colour("3A4048")
BLACK = colour("1B1E22")
CREAM = colour("F6E7C1")
GOLD = colour("E9B634")
BRASS = colour("C08A2D")


def mixed(a, b, share):
    return tuple(p + share * (q - p) for p, q in zip(a, b))
