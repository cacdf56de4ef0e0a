# SPDX-License-Identifier: Apache-2.0
"""Matplotlib figures. Each function draws into `ax` (a new figure where None) and returns it."""
import numpy as np


def _axes(ax):
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt
    return plt.subplots(figsize=(6, 6))[1]


def _show_all(ax, points):
    """Axes that hold all points, which quiver's arrows do not extend by themselves."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.05 * (high - low).max()
    ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))


def overlay(result, view=0, ax=None):
    """Rectified image of a view with its fiducials, their labels and the located points.

    result: Result; view: name or index. Axes in rectified pixels, u right, v down.
    """
    ax = _axes(ax)
    ax.imshow(result.rectified_image(view), cmap="gray", interpolation="nearest")
    calibration = result.calibration
    for fiducial in calibration.fiducials(view):
        if fiducial["uv"] is None:
            continue
        used = fiducial["status"] == "used"
        ax.plot(*fiducial["uv"], "+" if used else "x", color="lime" if used else "red", markersize=9)
        ax.annotate(fiducial["label"], fiducial["uv"], xytext=(5, -5), textcoords="offset points", color="lime",
                    fontsize=9)
    for point in result.points:
        if point.xyz_mm is not None:
            uv = calibration.project(point.xyz_mm, view)
            ax.plot(*uv, "o", mfc="none", color="orange")
            ax.annotate(point.name, uv, xytext=(5, 5), textcoords="offset points", color="orange", fontsize=10)
    ax.set(xlabel="u (px)", ylabel="v (px)", title=result.names[view] if isinstance(view, int) else view)
    return ax


def residuals(calibration, view=0, ax=None, scale=None):
    """Arrows from each fiducial's image towards its projection, enlarged; rejected ones by a cross, in gray.

    calibration: Calibration with fiducials. scale: enlargement; chosen from the largest residual of a used fiducial
    where None. Axes in rectified pixels.
    """
    ax = _axes(ax)
    seen = [f for f in calibration.fiducials(view) if f["uv"] is not None]
    used = np.array([f["status"] == "used" for f in seen], bool)
    if not used.any():
        raise ValueError("the calibration holds no fiducials of this view")
    uv = np.array([f["uv"] for f in seen])
    off = calibration.project(np.array([f["xyz_mm"] for f in seen]), view) - uv
    largest = np.linalg.norm(off[used], axis=1).max()
    if scale is None:
        scale = 0.1 * np.ptp(uv, axis=0).max() / max(largest, 1e-12)
    for which, arrow, mark in ((used, "tab:red", "k."), (~used, "gray", "kx")):
        ax.quiver(uv[which, 0], uv[which, 1], scale * off[which, 0], scale * off[which, 1], angles="xy",
                  scale_units="xy", scale=1, color=arrow, width=0.004)
        ax.plot(uv[which, 0], uv[which, 1], mark)
    for fiducial in seen:
        ax.annotate(fiducial["label"], fiducial["uv"], xytext=(4, 4), textcoords="offset points", fontsize=9)
    rms = np.sqrt(np.mean(np.sum(off[used] ** 2, axis=1)))
    rejected = f", {np.count_nonzero(~used)} rejected" if not used.all() else ""
    ax.set(xlabel="u (px)", ylabel="v (px)", aspect="equal",
           title=f"residuals {rms:.3f} px rms, arrows x {scale:.0f}{rejected}")
    _show_all(ax, np.vstack([uv, (uv + scale * off)[used]]))
    ax.invert_yaxis()
    return ax


def phantom(measured, ax=None, scale=None):
    """Arrows from the nominal places of the balls to the measured ones, enlarged, seen along the axis of least extent.

    measured: MeasuredPhantom of a case with a nominal file. scale: enlargement; chosen from the largest difference where
    None. Axes in mm, calibrator frame.
    """
    ax = _axes(ax)
    off = measured.from_nominal_mm
    if np.isnan(off).any():
        raise ValueError("the phantom was measured without a nominal file")
    nominal = measured.xyz_mm - off
    extent = np.ptp(nominal, axis=0)
    if scale is None:
        scale = 0.2 * extent.max() / max(np.linalg.norm(off, axis=1).max(), 1e-12)
    across, up = sorted(np.argsort(extent, kind="stable")[1:])
    ax.plot(nominal[:, across], nominal[:, up], "ko", mfc="lightgray", markersize=9)
    ax.quiver(nominal[:, across], nominal[:, up], scale * off[:, across], scale * off[:, up], angles="xy",
              scale_units="xy", scale=1, color="tab:red", width=0.004)
    for label, ball in zip(measured.labels, nominal):
        ax.annotate(label, (ball[across], ball[up]), xytext=(6, 6), textcoords="offset points", fontsize=9)
    rms = np.sqrt(np.mean(np.sum(off ** 2, axis=1)))
    ax.set(xlabel=f"{'xyz'[across]} (mm)", ylabel=f"{'xyz'[up]} (mm)",
           title=f"measured less nominal: {rms:.2f} mm rms, arrows x {scale:.0f}", aspect="equal")
    ax.margins(0.2)
    return ax


def tre_map(calibration, centre_mm, *, half_mm, step_mm, sigma_px, z_mm=None, ax=None):
    """Predicted TRE (rms, mm) over x and y of the calibrator frame, in the lattice plane nearest to z_mm.

    centre_mm: (3,); half_mm, step_mm: extent and step of the lattice; sigma_px: noise of a pick per axis; z_mm: the
    centre's where None, else within the lattice (ValueError).
    """
    ax = _axes(ax)
    volume = calibration.tre_map(centre_mm, half_mm=half_mm, step_mm=step_mm, sigma_px=sigma_px)
    first, step, rms = volume["first_mm"], volume["step_mm"], volume["rms_mm"]
    z = centre_mm[2] if z_mm is None else z_mm
    k = round((z - first[2]) / step)
    if not 0 <= k < rms.shape[2]:
        raise ValueError(f"z_mm: {z:g} is outside the lattice, {first[2]:g} to {first[2] + step * (rms.shape[2] - 1):g}")
    x, y = (first[i] + step * np.arange(rms.shape[i]) for i in (0, 1))
    filled = ax.contourf(x, y, rms[:, :, k].T, levels=12, cmap="viridis")  # contourf takes rows along y
    ax.figure.colorbar(filled, ax=ax, label="predicted TRE (mm rms)")
    ax.set(xlabel="x (mm)", ylabel="y (mm)", title=f"z = {first[2] + step * k:.1f} mm, calibrator frame",
           aspect="equal")
    return ax
