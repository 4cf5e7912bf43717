"""Draws the pictures on the organs of cherry.dls, leaf.png and blossom.png, and makes their surfaces: leaf.s, blossom.obj.

    python3 draw.py      (numpy, pillow)

Each picture is drawn at four times its size, with a hard edge, and reduced: what lies outside is transparent, and has the colour of the nearest inside.
"""
import numpy as np
from PIL import Image

FINE = 4
chance = np.random.default_rng(7)


def grid(width, height):
    """Coordinates from -1 to 1 to the right, and from 0 to 1 upwards."""
    x = (np.arange(width * FINE) + 0.5) / (width * FINE) * 2 - 1
    y = 1 - (np.arange(height * FINE) + 0.5) / (height * FINE)
    return np.meshgrid(x, y)


def noise(shape, cells):
    """Smooth noise from 0 to 1."""
    small = (chance.random((cells, cells)) * 255).astype(np.uint8)
    return np.asarray(Image.fromarray(small).resize((shape[1], shape[0]), Image.BICUBIC), dtype=float) / 255


def save(name, color, inside, size):
    """Colours (0 to 1) where `inside` is true; the mean of a pixel counts what is inside."""
    color = np.clip(color, 0, 1)
    cells = (size[1], FINE, size[0], FINE)
    part = inside.reshape(cells).mean((1, 3))
    weight = inside.astype(float) + 1e-6
    mean = (color * weight[..., None]).reshape(*cells, 3).sum((1, 3)) / weight.reshape(cells).sum((1, 3))[..., None]
    # 32 steps of a colour are enough, and make a small file.
    pixels = np.dstack([np.round(mean * 63) / 63, np.round(part * 15) / 15])
    Image.fromarray(np.round(pixels * 255).astype(np.uint8)).save(name, optimize=True)


def leaf(width=160, height=256):
    x, y = grid(width, height)
    # An ovate blade with teeth that point upwards, on a short stalk.
    along = np.clip((y - 0.08) / 0.9, 0, 1)
    half = 0.86 * 2.15 * along**0.55 * (1 - along)**0.8 * (0.78 + 0.22 * along)
    teeth = 1 - 0.1 * ((along * 22) % 1) * (along < 0.97)
    stalk = (np.abs(x) < 0.03) & (y < 0.2)
    inside = (np.abs(x) < half * teeth) & (y > 0.08) | stalk
    # Side veins leave the middle one upwards and bend to the tip.
    rise = y - 0.42 * np.abs(x) - 0.08 * np.abs(x) ** 2
    vein = np.abs((rise * 9 + 0.15 * np.sign(x)) % 1 - 0.5) * 2
    side = np.clip((vein - 0.88) / 0.12, 0, 1) * (1 - 0.6 * np.abs(x))
    middle = np.clip(1 - np.abs(x) / (0.012 + 0.03 * (1 - y)), 0, 1)
    swelling = 1 - 0.14 * vein**3
    shade = swelling * (0.86 + 0.2 * noise(x.shape, 9) + 0.05 * noise(x.shape, 40))
    blade = np.array([0.30, 0.52, 0.16]) + 0.12 * (1 - along)[..., None] * np.array([0.6, 0.5, 0.1])
    color = blade * shade[..., None]
    pale = np.array([0.68, 0.77, 0.42])
    color += (pale - color) * (0.55 * side + 0.85 * middle).clip(0, 1)[..., None]
    color[stalk & (y < 0.1)] = [0.55, 0.42, 0.25]
    save("leaf.png", color, inside, (width, height))


def blossom(side=192):
    x, y = grid(side, side)
    y = 2 * y - 1
    radius, angle = np.hypot(x, y), np.arctan2(x, y)
    fifth = 2 * np.pi / 5
    within = (angle + fifth / 2) % fifth - fifth / 2
    # Petals with a notch at the tip.
    petal = 0.97 * np.cos(within * 1.05) ** 0.35 * (1 - 0.16 * np.exp(-((within / 0.07) ** 2)))
    gap = np.abs(within) > fifth / 2 * (0.99 - 0.28 * np.clip((radius - 0.25) / 0.7, 0, 1) ** 3)
    inside = (radius < petal) & ~(gap & (radius > 0.22))
    streak = 0.5 + 0.5 * np.cos(within * 60)
    flush = np.clip(1 - radius / 0.55, 0, 1) ** 1.5
    color = np.array([0.985, 0.93, 0.945]) - flush[..., None] * np.array([0.06, 0.30, 0.20])
    color -= (0.03 * streak * (1 - flush) + 0.05 * noise(x.shape, 12))[..., None] * np.array([0.4, 1.0, 0.8])
    # Stamens: threads with yellow anthers, around a green middle.
    for i in range(18):
        turn, length = i * 2.399963, 0.24 + 0.14 * chance.random()
        away = np.abs(x * np.cos(turn) - y * np.sin(turn))
        out = x * np.sin(turn) + y * np.cos(turn)
        color[(away < 0.007) & (out > 0.05) & (out < length)] = [0.93, 0.62, 0.66]
        color[np.hypot(x - length * np.sin(turn), y - length * np.cos(turn)) < 0.028] = [0.93, 0.74, 0.22]
    color[radius < 0.06] = [0.55, 0.66, 0.25]
    save("blossom.png", color, inside, (side, side))


def cup(cells=8):
    """A shallow cup around +Y, one unit across, with the whole picture on it."""
    with open("blossom.obj", "w") as out:
        out.write("# A shallow cup around the heading (+Y), made by draw.py.\n")
        places = [(i / cells, j / cells) for j in range(cells + 1) for i in range(cells + 1)]
        for u, v in places:
            x, z = u - 0.5, v - 0.5
            out.write(f"v {x:g} {0.15 + 0.9 * (x * x + z * z):.4f} {-z:g}\n")
        for u, v in places:
            out.write(f"vt {u:g} {v:g}\n")
        for j in range(cells):
            for i in range(cells):
                a = j * (cells + 1) + i + 1
                corners = [a, a + 1, a + cells + 2, a + cells + 1]
                out.write("f " + " ".join(f"{c}/{c}" for c in corners) + "\n")


def blade():
    """A leaf as one patch, one unit long: folded a little along its middle, its tip hanging."""
    with open("leaf.s", "w") as out:
        out.write("-1 1  -1 1  -1 1\nCONTACT POINT X: 0 Y: 0 Z: 0\nEND POINT X: 0 Y: 1 Z: 0\n")
        out.write("HEADING X: 0 Y: 1 Z: 0\nUP X: 0 Y: 0 Z: 1\nSIZE: 1\n")
        out.write("leaf\nTOP COLOR: 1 DIFFUSE: 0 BOTTOM COLOR: 1 DIFFUSE: 0\n")
        out.write("AL: ~ A: ~ AR: ~\nL: ~ R: ~\nBL: ~ B: ~ BR: ~\n")
        for y, drop in [(0, 0), (0.36, 0.08), (0.72, 0.02), (1, -0.22)]:
            points = [(x, y, drop + 0.5 * abs(x) ** 1.5 * min(1, 2 * y)) for x in (-0.3125, -0.104, 0.104, 0.3125)]
            out.write("  ".join(f"{x:g} {y:g} {z:.4f}" for x, y, z in points) + "\n")


leaf()
blossom()
cup()
blade()
