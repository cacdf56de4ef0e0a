# SPDX-License-Identifier: Apache-2.0
import threading
import time

import cv2
import numpy as np
import pytest

import helicarm

HEIGHT, WIDTH = 300, 420


def drawn(centres, radius=8.0, ground=180.0, depth=90.0):
    """Shadows of balls at sub-pixel centres (u, v), blurred as by a detector; (HEIGHT, WIDTH)."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    image = np.full((HEIGHT, WIDTH), ground)
    for cu, cv in centres:
        chord = np.sqrt(np.maximum(1 - ((u - cu) ** 2 + (v - cv) ** 2) / radius ** 2, 0))
        image -= depth * chord
    image = cv2.GaussianBlur(image, (0, 0), 1.2)
    return np.clip(image + np.random.default_rng(1).normal(0, 1.5, image.shape), 0, 255).round().astype(np.uint8)


CENTRES = np.array([[60.3, 50.7], [350.2, 61.6], [200.45, 150.1], [380.8, 240.3], [90.6, 251.9]])


def image_of(pixels, **more):
    return helicarm.XrayImage(pixels, pixel_mm=0.2, source_detector_mm=1000, **more)


def test_marks_come_as_u_v_of_a_non_square_image():
    found = helicarm.detect(image_of(drawn(CENTRES)), kind="balls")
    order = [np.argmin(np.linalg.norm(found["uv"] - c, axis=1)) for c in CENTRES]
    assert len(found["uv"]) == len(CENTRES)
    assert np.abs(found["uv"][order] - CENTRES).max() < 0.1
    assert found["radius_px"] == pytest.approx(8.0, abs=0.5)


def test_marks_agree_with_opencv():
    pixels = drawn(CENTRES)
    mask = (pixels < 140).astype(np.uint8)
    _, _, _, centroids = cv2.connectedComponentsWithStats(mask)
    found = helicarm.detect(image_of(pixels), kind="balls")["uv"]
    for centroid in centroids[1:]:
        assert np.linalg.norm(found - centroid, axis=1).min() < 0.3


@pytest.mark.parametrize("scale", [1, 4, 16, 257])
def test_sixteen_bit_pixels_have_the_range_of_their_file(tmp_path, scale):
    pixels = drawn(CENTRES).astype(np.uint16) * scale
    cv2.imwrite(str(tmp_path / "image.png"), pixels)
    images = [image_of(pixels), helicarm.read_image(tmp_path / "image.png")]
    assert images[0].range == images[1].range
    found = [helicarm.detect(image, kind="balls")["uv"] for image in images]
    assert np.array_equal(*found) and len(found[0]) == len(CENTRES)


def test_pixels_are_shared_and_read_only():
    pixels = drawn(CENTRES)
    image = image_of(pixels)
    view = image.pixels
    assert view.shape == image.shape == (HEIGHT, WIDTH)
    assert np.array_equal(view, pixels)
    assert np.shares_memory(view, image.pixels)
    assert not view.flags.writeable
    del image
    assert view[150, 200] == pixels[150, 200]


def test_strided_and_transposed_arrays_keep_their_meaning():
    pixels = drawn(CENTRES)
    assert np.array_equal(image_of(np.asfortranarray(pixels)).pixels, pixels)
    assert np.array_equal(image_of(pixels[::2, ::3]).pixels, pixels[::2, ::3])
    assert image_of(pixels.T).shape == (WIDTH, HEIGHT)


def test_files_read_as_opencv_reads_them(tmp_path):
    pixels = drawn(CENTRES)
    cv2.imwrite(str(tmp_path / "a.png"), pixels)
    (tmp_path / "a.json").write_text('{"pixel_mm": 0.2, "source_detector_mm": null}')
    image = helicarm.read_image(tmp_path / "a.png")
    assert np.array_equal(image.pixels, cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED))
    assert image.name == "a" and image.pixel_mm.tolist() == [0.2, 0.2] and image.source_detector_mm is None


@pytest.mark.parametrize("pixels, code", [(np.zeros((4, 5, 3), np.uint8), "bad_size"), (np.zeros((0, 5), np.uint8), "bad_size"),
                                          (np.zeros((4, 5)), "bad_value"), (np.array([["a"]]), "bad_value")])
def test_pixels_that_are_no_image_are_refused(pixels, code):
    with pytest.raises(helicarm.InputError) as error:
        image_of(pixels)
    assert error.value.code == code


def test_not_finite_pixels_are_refused():
    pixels = np.zeros((4, 5))
    pixels[1, 2] = np.nan
    with pytest.raises(helicarm.InputError, match="not_finite"):
        image_of(pixels, range=(0, 1))


def test_missing_file_has_code_and_message(tmp_path):
    with pytest.raises(helicarm.InputError) as error:
        helicarm.read_image(tmp_path / "none.dcm")
    assert error.value.code == "missing_file" and "none.dcm" in error.value.message
    assert isinstance(error.value, helicarm.HelicarmError) and not isinstance(error.value, helicarm.RefusedError)


def test_unknown_kind_is_an_input_error():
    with pytest.raises(helicarm.InputError, match="usage"):
        helicarm.detect(image_of(drawn(CENTRES)), kind="cats")


def test_detection_lets_other_threads_run():
    image = image_of(cv2.resize(drawn(CENTRES), (1600, 1100)))
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.perf_counter()
    helicarm.detect(image, kind="balls")
    end = time.perf_counter()
    done.set()
    thread.join()
    assert sum(begin < t < end for t in ticks) >= 3
