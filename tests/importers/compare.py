"""compare.py DLSYS MODEL FILE [TIMES]: distances of vertices of OBJ files of random times from the triangles of the same module in a GLB or USD file.

Joints of stems are listed apart: OBJ files have mitres, collars and flat ends where stems meet, and GLB and USD files half balls. So modules that are nothing
but a stem are apart, and of other modules the vertices that lie inside of a stem of their own, or no further from it than it is thick, as at the foot of a stalk.
Exit status 1 if a module is missing, or if a vertex of an organ is further away than the accuracy.
"""
import random
import subprocess
import sys
import tempfile

import numpy as np

# The default of the program, in parts of the extent.
ACCURACY = 5e-4


def groups(path):
    """Vertices and faces of the groups of an OBJ file, by name."""
    vertices, faces, current = [], {}, None
    for line in open(path):
        words = line.split()
        if line.startswith("v "):
            vertices.append([float(x) for x in words[1:]])
        elif line.startswith("g "):
            current = faces.setdefault(words[1], [])
        elif line.startswith("f "):
            current.append([int(corner.split("/")[0]) - 1 for corner in words[1:4]])
    vertices = np.array(vertices)
    return {name: vertices[np.unique(corners)] for name, corners in faces.items()}


def distance(point, a, b, c):
    """The distance of a point from the nearest of many triangles."""
    ab, ac, ap = b - a, c - a, point - a
    dot = lambda u, v: (u * v).sum(1)
    uu, uv, vv, d, e = dot(ab, ab), dot(ab, ac), dot(ac, ac), dot(ab, ap), dot(ac, ap)
    area = uu * vv - uv * uv
    safe = np.where(area > 0, area, 1)
    s, t = (vv * d - uv * e) / safe, (uu * e - uv * d) / safe
    inside = (s >= 0) & (t >= 0) & (s + t <= 1) & (area > 0)
    best = np.where(inside, np.linalg.norm(ap - s[:, None] * ab - t[:, None] * ac, axis=1), np.inf)
    for start, way in ((a, ab), (a, ac), (b, c - b)):
        square = dot(way, way)
        part = np.clip(dot(point - start, way) / np.where(square > 0, square, 1), 0, 1)
        best = np.minimum(best, np.linalg.norm(point - start - part[:, None] * way, axis=1))
    return best.min()


def closed(places, triangles):
    """The triangles that share every edge with another one: the bodies of stems."""
    _, same = np.unique(np.round(places / np.ptp(places, axis=0).max(), 5), axis=0, return_inverse=True)
    corners = same.reshape(-1)[triangles]
    edges = np.sort(np.stack([corners, np.roll(corners, -1, 1)], 2), 2)
    flat = (edges[..., 0] == edges[..., 1]).any(1)
    corners, edges, triangles = corners[~flat], edges[~flat], triangles[~flat]
    _, number, count = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
    shared = (count[number.reshape(-1)].reshape(-1, 3) % 2 == 0).all(1)
    # A patch has triangles without an open edge, too: bodies are those all of whose neighbours have none.
    open_places = set(corners[~shared].ravel())
    while True:
        touching = shared & np.isin(corners, list(open_places)).any(1)
        if not touching.any():
            return triangles[shared]
        open_places |= set(corners[touching].ravel())
        shared &= ~touching


def is_joint(point, a, b, c):
    """True if a point is inside of closed bodies, or no further from them than they are thick: a cylinder's radius is twice its volume through its area."""
    if not len(a):
        return False
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    volume = abs((a * np.cross(b, c)).sum() / 6)
    if distance(point, a, b, c) <= 3 * volume / area:
        return True
    # Inside, their solid angle is not 0 (Van Oosterom and Strackee).
    a, b, c = a - point, b - point, c - point
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    dot = lambda u, v: (u * v).sum(1)
    above = dot(a, np.cross(b, c))
    below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
    return abs(np.arctan2(above, below).sum()) > np.pi


def main(program, model, path, count=6):
    if path.endswith(".glb"):
        from glb import Glb as File
    else:
        from usd import UsdFile as File
    file, chance = File(path), random.Random(1)
    times = sorted(round(chance.uniform(file.first, file.last), 6) for _ in range(int(count)))
    extent, found, missing, hidden = file.extent(), {"stems": [], "organs": []}, 0, 0
    with tempfile.TemporaryDirectory() as folder:
        at = ",".join(map(str, times))
        subprocess.run([program, "render", model, "--at", at, "--format", "obj", "-o", folder, "-q"], check=True)
        for i, time in enumerate(times):
            shown = {}
            for name, thing in file.shown((time - file.first) * file.seconds).items():
                shown[".".join(name.split(".")[:2])] = thing
            for name, vertices in groups(f"{folder}/frame-{i:04d}.obj").items():
                if name not in shown:
                    missing += 1
                    print(f"{name} is missing at t = {time}")
                    continue
                places, triangles, node = shown[name]
                kind = "stems" if node["stem"] else "organs"
                some = vertices[np.linspace(0, len(vertices) - 1, min(len(vertices), 40)).astype(int)] * file.metres
                corners = [places[triangles[:, k]] for k in range(3)]
                far = [(distance(point, *corners) / extent, point) for point in some]
                if kind == "organs" and max(far, key=lambda pair: pair[0])[0] > ACCURACY:
                    bodies = closed(places, triangles)
                    kind = "stems" if len(bodies) == len(triangles) else kind
                    seen = [(d, p) for d, p in far if d <= ACCURACY or not is_joint(p, *[places[bodies[:, k]] for k in range(3)])]
                    hidden += len(far) - len(seen)
                    far = seen
                found[kind].append((max(d for d, _ in far), name, time))
    for kind, all_of in found.items():
        if all_of:
            worst, middle = max(all_of), sorted(all_of)[len(all_of) // 2]
            print(f"{model}: {len(all_of)} {kind}, largest distance {worst[0]:.1e} of the extent ({worst[1]}, t = {worst[2]}), median {middle[0]:.1e}")
    print(f"{model}: {hidden} vertices of organs further away than the accuracy belong to joints of their stems")
    return missing == 0 and max(found["organs"], default=(0,))[0] <= ACCURACY


sys.exit(0 if main(*sys.argv[1:]) else 1)
