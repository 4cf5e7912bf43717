"""What a GLB file shows at a time, by the glTF 2.0 specification: for comparisons with other readers."""
import json
import struct

import numpy as np

TYPES = {5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


class Glb:
    def __init__(self, path):
        data = open(path, "rb").read()
        length = struct.unpack_from("<I", data, 12)[0]
        self.json = json.loads(data[20:20 + length])
        self.bytes = data[28 + length:]
        extras = self.json["asset"]["extras"]
        self.first, self.last = extras["first_time"], extras["last_time"]
        self.seconds, self.metres = extras["seconds_per_unit"], extras["metres_per_unit"]
        self.tracks = {}
        for animation in self.json.get("animations", []):
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                times, values = self.accessor(sampler["input"]), self.accessor(sampler["output"])
                key = channel["target"]["node"], channel["target"]["path"]
                self.tracks[key] = times.astype(float), values.astype(float).reshape(len(times), -1)

    def accessor(self, number):
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        width = WIDTHS[accessor["type"]]
        found = np.frombuffer(self.bytes, TYPES[accessor["componentType"]], accessor["count"] * width, start)
        return found.reshape(-1, width) if width > 1 else found

    def value(self, node, path, time, otherwise):
        if (node, path) not in self.tracks:
            return np.array(self.json["nodes"][node].get(path, otherwise), float)
        times, values = self.tracks[node, path]
        if time <= times[0] or time >= times[-1]:
            return values[0] if time <= times[0] else values[-1]
        i = np.searchsorted(times, time, "right") - 1
        w = (time - times[i]) / (times[i + 1] - times[i])
        a, b = values[i], values[i + 1]
        if path != "rotation":
            return a * (1 - w) + b * w
        b = -b if a @ b < 0 else b
        angle = np.arccos(min(a @ b, 1))
        mixed = a if angle < 1e-6 else (np.sin((1 - w) * angle) * a + np.sin(w * angle) * b) / np.sin(angle)
        return mixed / np.linalg.norm(mixed)

    def shown(self, time):
        """Vertices, triangles and a description of everything that has a size, by name."""
        shown = {}
        for number, node in enumerate(self.json["nodes"]):
            scale = self.value(number, "scale", time, [1, 1, 1])
            if "mesh" not in node or scale[0] == 0:
                continue
            x, y, z, w = self.value(number, "rotation", time, [0, 0, 0, 1])
            turn = np.array([
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
            weights = self.value(number, "weights", time, [])
            vertices, triangles, count = [], [], 0
            for primitive in self.json["meshes"][node["mesh"]]["primitives"]:
                places = self.accessor(primitive["attributes"]["POSITION"]).astype(float)
                for weight, target in zip(weights, primitive.get("targets", [])):
                    places += weight * self.accessor(target["POSITION"])
                vertices.append(places)
                triangles.append(self.accessor(primitive["indices"]).astype(int).reshape(-1, 3) + count)
                count += len(places)
            at = self.value(number, "translation", time, [0, 0, 0])
            stem = self.json["meshes"][node["mesh"]]["name"].startswith("stem-")
            shown[node["name"]] = (np.vstack(vertices) * scale) @ turn.T + at, np.vstack(triangles), {"name": node["name"], "stem": stem}
        return shown

    def end(self):
        return (self.last - self.first) * self.seconds

    def extent(self):
        """The largest side of the box around everything at the end."""
        all_of = [v for v, _, node in self.shown(self.end()).values() if node["name"] != "ground"]
        all_of = np.vstack(all_of)
        return (all_of.max(0) - all_of.min(0)).max()
