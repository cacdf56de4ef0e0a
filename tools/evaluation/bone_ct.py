# SPDX-License-Identifier: Apache-2.0
"""A CT of a modelled knee: femur, tibia and fibula of random shape with cortical shell and trabecular structure, in soft
tissue. For tests of the registration: neither shape nor densities come from this program's other models.

Patient frame L, P, S (mm), a left knee, the joint line at S = 0. Needs NumPy."""
import numpy as np

VOXEL_MM = 0.8
SIZE = (168, 168, 240)  # along L, P, S
LOW = np.array([-0.5 * VOXEL_MM * (n - 1) for n in SIZE])
AIR, FAT, MUSCLE, MARROW, CORTEX = -1000, -90, 45, -30, 1350


def smooth_field(rng, sigma_mm):
    """Unit variance, correlated over sigma."""
    noise = np.fft.rfftn(rng.standard_normal(SIZE[::-1]).astype(np.float32))
    return scaled(blurred_spectrum(noise, sigma_mm))


def blurred_spectrum(spectrum, sigma_mm, size=SIZE, voxel_mm=VOXEL_MM):
    """`size` and `voxel_mm` (one number or three) along L, P, S."""
    for axis, (count, spacing) in enumerate(zip(size[::-1], np.broadcast_to(voxel_mm, 3)[::-1])):
        frequency = (np.fft.rfftfreq if axis == 2 else np.fft.fftfreq)(count, spacing)
        shape = [1, 1, 1]
        shape[axis] = -1
        spectrum = spectrum * np.exp(-2 * (np.pi * sigma_mm * frequency.reshape(shape)) ** 2)
    return np.fft.irfftn(spectrum, size[::-1])


def scaled(field):
    return (field / field.std()).astype(np.float32)


def blurred(volume, sigma_mm, voxel_mm=VOXEL_MM):
    return blurred_spectrum(np.fft.rfftn(volume), sigma_mm, volume.shape[::-1], voxel_mm)


def united(*distances):
    """Smooth union over about 6 mm."""
    soft = 3.0
    return -soft * np.log(sum(np.exp(-np.clip(d, -60, 60) / soft) for d in distances))


class Knee:
    """Hounsfield units `hu`, masks `femur`, `tibia`, grown by a voxel, and `femur_itself`, `tibia_itself`, and `femur_shape`,
    an implicit function of the femur, negative inside; arrays (S, P, L)."""

    def __init__(self, seed):
        rng = np.random.default_rng([seed, 22])
        axes = [LOW[i] + VOXEL_MM * np.arange(SIZE[i]) for i in range(3)]
        self.s, self.p, self.l = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij", sparse=True)
        self.vary = lambda value, by=0.08: value * (1 + by * rng.uniform(-1, 1))
        rough = [1.2 * smooth_field(rng, 10) for _ in range(2)]
        femur, tibia, fibula = self.femur_distance() + rough[0], self.tibia_distance() + rough[1], self.fibula_distance()
        gap = 1.5  # cartilage
        femur, tibia = np.maximum(femur, gap - tibia), np.maximum(tibia, gap - femur)
        texture = smooth_field(rng, 0.9)
        self.hu = self.soft_tissue(rng)
        for distance in (femur, tibia, fibula):
            self.fill(distance, texture)
        self.femur, self.tibia = femur < VOXEL_MM, (tibia < VOXEL_MM) & (femur > 0)
        self.femur_itself, self.tibia_itself, self.femur_shape = femur < 0, tibia < 0, femur
        self.noise = rng.standard_normal(SIZE[::-1]).astype(np.float32)

    def scanned(self):
        """As a scanner gives it: blurred, with noise."""
        return blurred(self.hu, 0.45) + 25 * self.noise

    def ellipsoid(self, centre, radii):
        radii = [self.vary(r) for r in radii]
        q = [(axis - c) / r for axis, c, r in zip((self.l, self.p, self.s), centre, radii)]
        return (np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2) - 1) * min(radii)

    def shaft(self, centre, radius, flare, begin, end):
        """Along S from `begin` on: from the elliptical `flare` to a circle of `radius` at `end`."""
        radius = self.vary(radius)
        share = np.clip((self.s - begin) / (end - begin), 0, 1) ** 0.7
        a, b = (f + (radius - f) * share for f in flare)
        q = np.sqrt(((self.l - centre[0]) / a) ** 2 + ((self.p - centre[1]) / b) ** 2)
        beyond = (begin - self.s) * np.sign(end - begin)
        return np.maximum((q - 1) * np.minimum(a, b), beyond)

    def femur_distance(self):
        bone = united(self.shaft((0, -2), 13.5, (35, 25), 14, 75), self.ellipsoid((-23, 8, 13), (19, 31, 23)),
                      self.ellipsoid((23, 6, 13), (17, 29, 22)))
        return np.maximum(bone, -self.ellipsoid((0, 24, 2), (9, 22, 21)))

    def tibia_distance(self):
        tubercle = self.ellipsoid((3, -20, -38), (7, 6, 12))
        return united(self.shaft((0, 3), 13.5, (37, 25), -4, -70), tubercle)

    def fibula_distance(self):
        return self.shaft((33, 16), 5, (9, 9), -22, -45)

    def soft_tissue(self, rng):
        distance = np.sqrt((self.l / self.vary(60)) ** 2 + (self.p / self.vary(58)) ** 2) * 59 - 59 + 0 * self.s
        muscle = MUSCLE + 12 * smooth_field(rng, 4)
        return np.where(distance < -9, muscle, np.where(distance < 0, FAT, AIR)).astype(np.float32)

    def fill(self, distance, texture):
        far = np.clip((np.abs(self.s) - 25) / 35, 0, 1)  # from the joint towards the shaft
        cortex_mm, canal = 1.2 + 3 * far, (1 - far)
        spongy = MARROW + canal * (330 + 130 * texture)
        share = np.clip(0.5 - distance / VOXEL_MM, 0, 1)
        shell = np.clip(0.5 + (distance + cortex_mm) / VOXEL_MM, 0, 1)
        self.hu = (1 - share) * self.hu + share * (shell * CORTEX + (1 - shell) * spongy)


def write_nrrd(path, array, voxel_mm=VOXEL_MM, centre=(0, 0, 0)):
    """(S, P, L) array; `voxel_mm` (one number or three) along L, P, S; `centre` of the volume, mm."""
    kind = {"int16": "int16", "uint8": "uint8"}[str(array.dtype)]
    size, step = array.shape[::-1], [float(v) for v in np.broadcast_to(voxel_mm, 3)]
    low = [float(c) - 0.5 * v * (n - 1) for c, v, n in zip(centre, step, size)]
    header = (f"NRRD0004\ntype: {kind}\ndimension: 3\nspace: left-posterior-superior\nsizes: {size[0]} {size[1]} {size[2]}\n"
              f"space directions: ({step[0]},0,0) (0,{step[1]},0) (0,0,{step[2]})\nendian: little\nencoding: raw\n"
              f"space origin: ({low[0]},{low[1]},{low[2]})\n\n")
    path.write_bytes(header.encode() + np.ascontiguousarray(array).tobytes())


def rounded(hu):
    return np.clip(np.rint(hu), -1024, 3000).astype(np.int16)
