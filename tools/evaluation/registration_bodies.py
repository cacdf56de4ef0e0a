# SPDX-License-Identifier: Apache-2.0
"""What the evaluations of registration register: modelled knees by CT or surface, and a patient's head. Each writes a subject's volumes
into a folder, names those of a kind of input, and has targets (mm, model)."""
import numpy as np

import bone_ct
import bone_surface
import head_ct

KINDS = ("right", "patient", "mirrored", "tibia", "moved", "hidden", "scaled", "camera", "one_view")
TARGETS = np.array([[x, y, z] for x in (-20, 0, 20) for y in (-20, 0, 20) for z in (-20, 0, 20)
                    if abs(x) + abs(y) + abs(z) in (20, 60)], float)


class Knees:
    name, model, kinds = "knee", "femur", KINDS
    arm_mm = 30
    scale_sigma = 0  # the volumes' sizes are exact, but where a kind is about them
    targets = np.array([0, 5, 20.0]) + TARGETS

    def subject(self, number, other=False):
        return number % 4 + (4 if other else 0)

    def write(self, folder, subject):
        folder.mkdir()
        knee = bone_ct.Knee(subject)
        scan = bone_ct.rounded(knee.scanned())
        bone_ct.write_nrrd(folder / "true.nrrd", bone_ct.rounded(knee.hu))
        bone_ct.write_nrrd(folder / "scan.nrrd", scan)
        bone_ct.write_nrrd(folder / "mirrored.nrrd", scan[:, :, ::-1])
        bone_ct.write_nrrd(folder / "scaled.nrrd", scan, 1.03 * bone_ct.VOXEL_MM)
        for name, mask in (("femur", knee.femur), ("tibia", knee.tibia)):
            bone_ct.write_nrrd(folder / f"{name}.nrrd", mask.astype(np.uint8))
            bone_ct.write_nrrd(folder / f"mirrored_{name}.nrrd", mask[:, :, ::-1].astype(np.uint8))
            bone_ct.write_nrrd(folder / f"scaled_{name}.nrrd", mask.astype(np.uint8), 1.03 * bone_ct.VOXEL_MM)

    def files(self, folder, kind):
        """The model's keys of case.json, with the files' places."""
        if kind in ("mirrored", "scaled"):
            return {"volume": folder / f"{kind}.nrrd", "mask": folder / f"{kind}_femur.nrrd"}
        return {"volume": folder / "scan.nrrd", "mask": folder / ("tibia.nrrd" if kind == "tibia" else "femur.nrrd")}


class Surfaces(Knees):
    """The knees' bones as surfaces of their masks. In the images the femur goes on beyond the surface's end."""
    name, kinds = "surface", ("right", "patient", "mirrored", "tibia", "scaled")
    scale_sigma = 0.005  # a mask's size is not exact
    end_mm = 80  # of the surface along the shaft

    def write(self, folder, subject):
        super().write(folder, subject)
        knee = bone_ct.Knee(subject)
        femur, tibia = (mask & (np.abs(knee.s) < self.end_mm) for mask in (knee.femur_itself, knee.tibia_itself))
        for name, mask, scale in (("femur", femur, 1), ("tibia", tibia, 1), ("mirrored", femur[:, :, ::-1], 1), ("scaled", femur, 1.03)):
            triangles = bone_surface.triangles_of(mask, 0.5, scale * bone_ct.VOXEL_MM, scale * bone_ct.LOW)
            bone_surface.write_stl(folder / f"{name}.stl", triangles)

    def files(self, folder, kind):
        return {"surface": folder / f"{kind if kind in ('tibia', 'mirrored', 'scaled') else 'femur'}.stl"}


class Heads:
    name, model, kinds = "head", "head", tuple(kind for kind in KINDS if kind not in ("patient", "tibia"))
    scale_sigma = 0

    def __init__(self, path):
        self.head = head_ct.Head(path)
        self.targets = self.head.targets()
        self.arm_mm = np.linalg.norm(self.targets - self.targets.mean(axis=0), axis=1).mean()

    def subject(self, number, other=False):
        return 0

    def write(self, folder, subject):
        folder.mkdir()
        scan, voxel_mm, centre = bone_ct.rounded(self.head.scanned()), self.head.voxel_mm, head_ct.GRID_SHIFT_MM
        bone_ct.write_nrrd(folder / "true.nrrd", self.head.hu, voxel_mm)
        bone_ct.write_nrrd(folder / "scan.nrrd", scan, voxel_mm, centre)
        bone_ct.write_nrrd(folder / "mirrored.nrrd", scan[:, :, ::-1], voxel_mm, centre * [-1, 1, 1])
        bone_ct.write_nrrd(folder / "scaled.nrrd", scan, 1.03 * voxel_mm, 1.03 * centre)

    def files(self, folder, kind):
        return {"volume": folder / f"{kind if kind in ('mirrored', 'scaled') else 'scan'}.nrrd", "window_hu": head_ct.WINDOW_HU}
