"""Blender's importer of USD against OpenUSD at 50 random times, in two programs, because the two do not live in one.

blender_usd.py show FILE.usda OUT.npz (Python with bpy): the vertices that Blender shows.
blender_usd.py compare FILE.usda OUT.npz (Python with usd-core): their distances from those of usd.py. Exit status 1 if a vertex or the visibility of a prim differs."""
import random
import sys
import time

import numpy as np

# Relative to the extent: points in the file have six digits or so, and Blender has frames in single precision.
ALLOWED = 1e-4
TIMES = 50


def show(path, out):
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    begun = time.time()
    bpy.ops.wm.usd_import(filepath=path, merge_parent_xform=False)
    took, chance, scene, shown = time.time() - begun, random.Random(3), bpy.context.scene, {}
    played, codes = 0.0, []
    for i in range(TIMES):
        frame = chance.uniform(scene.frame_start, scene.frame_end)
        whole = int(frame)
        begun = time.time()
        scene.frame_set(whole, subframe=frame - whole)
        graph = bpy.context.evaluated_depsgraph_get()
        played += time.time() - begun
        codes.append(float(np.float32(whole) + np.float32(frame - whole)))
        parts = {}
        # In the order of usd.py; Blender numbers the same name in other prims.
        meshes = [thing for thing in bpy.data.objects if thing.type == "MESH"]
        for thing in sorted(meshes, key=lambda thing: thing.name.split(".")[0]):
            evaluated = thing.evaluated_get(graph)
            matrix = np.array(evaluated.matrix_world)
            if abs(np.linalg.det(matrix[:3, :3])) <= 1e-30:
                continue
            mesh = evaluated.to_mesh()
            places = np.empty(len(mesh.vertices) * 3)
            mesh.vertices.foreach_get("co", places)
            places = places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
            evaluated.to_mesh_clear()
            # Blender's +Z is up, and what is directly under the plant has its own name.
            prim = thing if thing.parent is None or thing.parent.name == "Plant" else thing.parent
            parts.setdefault(prim.name, []).append(np.stack([places[:, 0], places[:, 2], -places[:, 1]], 1))
        shown.update({f"{i}:{name}": np.vstack(places) for name, places in parts.items()})
    np.savez(out, codes=codes, **shown)
    print(f"{path}: imported in {took:.2f} s, {played / TIMES:.3f} s a frame")


def compare(path, out):
    from usd import UsdFile, name_of

    file, found = UsdFile(path), np.load(out)
    extent, worst, wrong, count = file.extent(), (0.0, "", 0.0), [], 0
    for i, code in enumerate(found["codes"]):
        shown = file.shown(code / file.rate)
        seen = {name_of(key.split(":", 1)[1]): found[key] for key in found.files if key.startswith(f"{i}:")}
        wrong += [f"{name} at {code / file.rate:.4f} s" for name in shown.keys() ^ seen.keys()]
        for name in shown.keys() & seen.keys():
            places = shown[name][0]
            same = len(places) == len(seen[name])
            far = np.linalg.norm(places - seen[name], axis=1).max() / extent if same else np.inf
            worst, count = max(worst, (far, name, code / file.rate)), count + len(places)
    print(f"{path}: {count} vertices in Blender at {TIMES} times, largest difference {worst[0]:.1e} of the extent ({worst[1]}, {worst[2]:.4f} s), "
          f"{len(wrong)} prims wrongly visible or hidden {' '.join(wrong[:5])}")
    return worst[0] <= ALLOWED and not wrong


if __name__ == "__main__":
    if sys.argv[1] == "show":
        show(*sys.argv[2:])
    else:
        sys.exit(0 if compare(*sys.argv[2:]) else 1)
