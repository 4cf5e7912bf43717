"""compare.py DLSYS MODEL FILE [TIMES]: distances of vertices of OBJ files of random times from the triangles of the same module in a GLB or USD file.

Stems are listed apart: OBJ files have mitres and collars where stems meet, and GLB files half balls. Exit status 1 if a module is missing.
"""
import random
import subprocess
import sys
import tempfile

import numpy as np


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


def main(program, model, path, count=6):
    if path.endswith(".glb"):
        from glb import Glb as File
    else:
        from usd import UsdFile as File
    file, chance = File(path), random.Random(1)
    times = sorted(round(chance.uniform(file.first, file.last), 6) for _ in range(int(count)))
    extent, found, missing = file.extent(), {"stems": [], "organs": []}, 0
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
                found[kind].append((max(distance(point, *corners) for point in some) / extent, name, time))
    for kind, all_of in found.items():
        if all_of:
            worst, middle = max(all_of), sorted(all_of)[len(all_of) // 2]
            print(f"{model}: {len(all_of)} {kind}, largest distance {worst[0]:.1e} of the extent ({worst[1]}, t = {worst[2]}), median {middle[0]:.1e}")
    return missing == 0


sys.exit(0 if main(*sys.argv[1:]) else 1)
