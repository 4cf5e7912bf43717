"""What a USD file shows at a time, by OpenUSD (usd-core), in the form of glb.py. As a script: usd.py FILE.usda...: all validators of OpenUSD; exit status 1 if one
finds anything."""
import re
import sys

import numpy as np
from pxr import Usd, UsdGeom


def name_of(prim):
    """The name of a module, from that of its prim."""
    found = re.fullmatch(r"(.+)_([0-9a-z]{13})((_\d+)?)", prim)
    return f"{found[1]}.{found[2]}{found[3].replace('_', '.')}" if found else prim


class UsdFile:
    def __init__(self, path):
        self.stage = Usd.Stage.Open(path)
        data = self.stage.GetRootLayer().customLayerData
        self.first, self.last = data["first_time"], data["last_time"]
        self.seconds, self.metres = data["seconds_per_unit"], data["metres_per_unit"]
        self.rate = self.stage.GetTimeCodesPerSecond()

    def shown(self, time):
        """Vertices, triangles and a description of everything that is visible and has a size, by name."""
        code, shown = time * self.rate, {}
        cache = UsdGeom.XformCache(code)
        for prim in self.stage.GetPrimAtPath("/Plant").GetChildren():
            parts = [prim] if prim.IsA(UsdGeom.Mesh) else [p for p in prim.GetChildren() if p.IsA(UsdGeom.Mesh)]
            vertices, triangles, count, stem = [], [], 0, False
            for part in sorted(parts, key=lambda part: part.GetName()):
                mesh, matrix = UsdGeom.Mesh(part), np.array(cache.GetLocalToWorldTransform(part))
                hidden = mesh.ComputeVisibility(code) == "invisible" or abs(np.linalg.det(matrix[:3, :3])) < 1e-30
                if hidden:
                    continue
                places = np.array(mesh.GetPointsAttr().Get(code), float)
                vertices.append(places @ matrix[:3, :3] + matrix[3, :3])
                triangles.append(np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3) + count)
                count += len(places)
                stem = stem or not (mesh.GetNormalsAttr().GetNumTimeSamples() or part.HasAttribute("xformOp:scale"))
            if vertices:
                name = name_of(prim.GetName())
                shown[name] = np.vstack(vertices), np.vstack(triangles), {"name": name, "stem": stem}
        return shown

    def end(self):
        return (self.last - self.first) * self.seconds

    def extent(self):
        """The largest side of the box around everything at the end."""
        all_of = np.vstack([v for v, _, node in self.shown(self.end()).values() if node["name"] != "ground"])
        return (all_of.max(0) - all_of.min(0)).max()


def validate(path):
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    found = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(path))
    print(f"{path}: {len(validators)} validators, {len(found)} errors")
    for error in found[:20]:
        print(f"  {error.GetIdentifier()}: {error.GetMessage()}")
    return not found


if __name__ == "__main__":
    sys.exit(0 if all([validate(path) for path in sys.argv[1:]]) else 1)
