"""blender.py FILE.glb...: Blender's importer against glb.py at 50 random times. Exit status 1 if a vertex or the visibility of a node differs."""
import random
import sys
import time

import bpy
import numpy as np

from glb import Glb

# Relative to the extent: times are in single precision, and a scale grows from 0 to 1 in half a millisecond.
ALLOWED = 1e-4


def compare(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    begun = time.time()
    bpy.ops.import_scene.gltf(filepath=path)
    took = time.time() - begun
    glb, chance = Glb(path), random.Random(3)
    scene, extent = bpy.context.scene, glb.extent()
    rate = scene.render.fps / scene.render.fps_base
    worst, wrong, count = 0.0, 0, 0
    for _ in range(50):
        frame = chance.uniform(0, glb.end()) * rate
        whole = int(frame)
        scene.frame_set(whole, subframe=frame - whole)
        graph = bpy.context.evaluated_depsgraph_get()
        # Blender has frames in single precision.
        shown = glb.shown(float(np.float32(whole) + np.float32(frame - whole)) / rate)
        for thing in (thing for thing in bpy.data.objects if thing.type == "MESH"):
            evaluated = thing.evaluated_get(graph)
            matrix = np.array(evaluated.matrix_world)
            visible = abs(np.linalg.det(matrix[:3, :3])) > 1e-36
            if visible != (thing.name in shown):
                wrong += 1
            if not visible or thing.name not in shown:
                continue
            mesh = evaluated.to_mesh()
            places = np.empty(len(mesh.vertices) * 3)
            mesh.vertices.foreach_get("co", places)
            places = places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
            # Blender's +Z is up.
            places = np.stack([places[:, 0], places[:, 2], -places[:, 1]], 1)
            worst = max(worst, np.linalg.norm(places - shown[thing.name][0], axis=1).max() / extent)
            count += len(places)
            evaluated.to_mesh_clear()
    print(f"{path}: imported in {took:.2f} s, {count} vertices at 50 times, largest difference {worst:.1e} of the extent, "
          f"{wrong} nodes wrongly visible or hidden")
    return worst <= ALLOWED and wrong == 0


sys.exit(0 if all([compare(path) for path in sys.argv[1:]]) else 1)
