# SPDX-License-Identifier: Apache-2.0
"""Changes to uncompressed 16-bit DICOM images (explicit VR, little endian) for tools/drills/falsify.py: elements and pixels."""
import random
import struct
from array import array

LONG_FORM = {b"OB", b"OW", b"OF", b"SQ", b"UT", b"UN"}
PIXELS = (0x7FE0, 0x0010)
EXPLICIT_LITTLE = b"1.2.840.10008.1.2.1"


def elements(data):
    """Yields (tag, VR, start of the element, start of its value, length) of the top level; sequences are passed over."""
    at = 132
    while at < len(data):
        group, element, vr = struct.unpack_from("<HH2s", data, at)
        if vr in LONG_FORM:
            length, value = struct.unpack_from("<I", data, at + 8)[0], at + 12
        else:
            length, value = struct.unpack_from("<H", data, at + 6)[0], at + 8
        if length == 0xFFFFFFFF:
            length = data.index(b"\xfe\xff\xdd\xe0", value) + 8 - value
        yield (group, element), vr, at, value, length
        at = value + length


class Dicom:
    """One image file: its text elements and its pixels, row by row."""

    def __init__(self, path):
        self.path, self.data = path, bytearray(path.read_bytes())
        if self.text((0x0002, 0x0010)).encode() != EXPLICIT_LITTLE:
            raise ValueError(f"{path}: compressed, or not explicit little endian")

    def find(self, tag):
        return next((e for e in elements(self.data) if e[0] == tag), None)

    def text(self, tag):
        found = self.find(tag)
        return bytes(self.data[found[3]:found[3] + found[4]]).strip(b"\0 ").decode() if found else None

    def number(self, tag):
        _, _, _, value, _ = self.find(tag)
        return struct.unpack_from("<H", self.data, value)[0]

    def set_text(self, tag, text):
        """Replaces the value of a short-form text element, if it is there."""
        found = self.find(tag)
        if not found:
            return self
        _, _, at, value, length = found
        packed = text.encode() + (b" " if len(text) % 2 else b"")
        self.data[at + 6:value + length] = struct.pack("<H", len(packed)) + packed
        return self

    def scale_text(self, tag, factor):
        """Multiplies each number of a multi-valued decimal string."""
        if self.text(tag):
            self.set_text(tag, "\\".join(f"{float(v) * factor:.6g}" for v in self.text(tag).split("\\")))
        return self

    @property
    def size(self):
        return self.number((0x0028, 0x0011)), self.number((0x0028, 0x0010))

    def pixels(self):
        _, _, _, value, length = self.find(PIXELS)
        return array("H", bytes(self.data[value:value + length]))

    def set_pixels(self, pixels):
        _, _, _, value, length = self.find(PIXELS)
        self.data[value:value + length] = pixels.tobytes()
        return self

    def write(self, path=None):
        (path or self.path).write_bytes(self.data)


def resampled(image, source_of):
    """The image whose pixel (u, v) is the one at `source_of(u, v)`, bilinear; the edge continues outside."""
    (width, height), old = image.size, image.pixels()
    new = array("H", bytes(2 * width * height))
    for v in range(height):
        for u in range(width):
            x, y = source_of(u, v)
            x, y = min(max(x, 0), width - 1.001), min(max(y, 0), height - 1.001)
            i, j = int(x), int(y)
            a, b, at = x - i, y - j, j * width + i
            new[v * width + u] = int((old[at] * (1 - a) + old[at + 1] * a) * (1 - b)
                                     + (old[at + width] * (1 - a) + old[at + width + 1] * a) * b + 0.5)
    return image.set_pixels(new)


def radial(image, share):
    """Radial distortion that moves a point at half the image's width from its centre by `share` of that distance."""
    width, height = image.size
    cx, cy, half = (width - 1) / 2, (height - 1) / 2, width / 2

    def source(u, v):
        x, y = u - cx, v - cy
        k = 1 + share * (x * x + y * y) / (half * half)
        return cx + k * x, cy + k * y

    return resampled(image, source)


def scaled(image, factor, other=None):
    """Enlarged about its centre; `other` is the factor of rows, where it differs."""
    width, height = image.size
    cx, cy, down = (width - 1) / 2, (height - 1) / 2, other or factor
    return resampled(image, lambda u, v: (cx + (u - cx) / factor, cy + (v - cy) / down))


def turned(image):
    width, _ = image.size
    return resampled(image, lambda u, v: (v, width - 1 - u))


def flipped(image):
    width, _ = image.size
    return resampled(image, lambda u, v: (width - 1 - u, v))


def moved(image, du, dv):
    return resampled(image, lambda u, v: (u - du, v - dv))


def raised(image, power, top=4095):
    """Another response of the detector: grey values to a power."""
    table = array("H", (int(top * (min(g, top) / top) ** power + 0.5) for g in range(65536)))
    return image.set_pixels(array("H", (table[g] for g in image.pixels())))


def quantised(image, levels, top=4095):
    step = top / (levels - 1)
    table = array("H", (min(65535, int(round(g / step) * step)) for g in range(65536)))
    return image.set_pixels(array("H", (table[g] for g in image.pixels())))


def covered(image, u0, v0, u1, v1, grey):
    """A rectangle of one grey value: a lead marker, a text field."""
    (width, height), pixels = image.size, image.pixels()
    for v in range(max(0, int(v0)), min(height, int(v1))):
        for u in range(max(0, int(u0)), min(width, int(u1))):
            pixels[v * width + u] = grey
    return image.set_pixels(pixels)


def disc(image, u0, v0, radius, share):
    """A round shadow: grey values times `share`, with an edge of one pixel."""
    (width, height), pixels = image.size, image.pixels()
    for v in range(max(0, int(v0 - radius - 2)), min(height, int(v0 + radius + 3))):
        for u in range(max(0, int(u0 - radius - 2)), min(width, int(u0 + radius + 3))):
            inside = min(1.0, max(0.0, radius + 0.5 - ((u - u0) ** 2 + (v - v0) ** 2) ** 0.5))
            at = v * width + u
            pixels[at] = int(pixels[at] * (1 - inside * (1 - share)) + 0.5)
    return image.set_pixels(pixels)


def noisy(image, sigma, seed, top=4095):
    draw = random.Random(seed).gauss
    return image.set_pixels(array("H", (min(top, max(0, int(g + draw(0, sigma) + 0.5))) for g in image.pixels())))
