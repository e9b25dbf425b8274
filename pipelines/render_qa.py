#!/usr/bin/env python3
"""Looks at a simulation with other people's eyes: meshio reads the VTU, pyvista renders it.

    render_qa.py DEFORMED.vtu [--reference REFERENCE.vtu] -o PICTURE.png [--json REPORT.json]

Three views of the same cut brain from the files alone: at rest (labels), the reference state where there is one, and
deformed with the error of every node in mm. DEFORMED.vtu needs the cell array `label` and the point array
`displacement` (mm). The reference is the `displacement` of REFERENCE.vtu on the same mesh, or the point array
`reference_displacement` of DEFORMED.vtu. The error is recomputed here and compared with `rmse_mm` of the file.

Exit codes: 0 all checks hold, 3 input rejected, 4 a check failed (the picture is written all the same).
Nothing of hgm's own code is used. Needs pyvista and meshio (requirements-test.txt); no display.
"""

import argparse
import json
import sys

import meshio
import numpy as np

REST, REFERENCE, DEFORMED = "rest", "reference", "deformed"
#: Agreement asked of the file's own error with the one recomputed here, mm.
SAME_MM = 1e-5


class Rejected(Exception):
    """An input that cannot be used; the message names file and field."""


def read(path):
    try:
        mesh = meshio.read(path, file_format="vtu")
    except BaseException as error:  # meshio ends the program on some damaged files
        raise Rejected(f"{path}: not a readable VTU: {error}") from error
    if "tetra" not in mesh.cells_dict:
        raise Rejected(f"{path}: no tetrahedra")
    if "label" not in mesh.cell_data_dict:
        raise Rejected(f"{path}: cell array `label` is missing")
    return mesh


def vectors(mesh, path, name):
    if name not in mesh.point_data:
        raise Rejected(f"{path}: point array `{name}` is missing")
    values = np.asarray(mesh.point_data[name], float)
    if values.shape != mesh.points.shape or not np.isfinite(values).all():
        raise Rejected(f"{path}: point array `{name}` is not one finite 3-vector per node")
    return values


def volumes(points, tets):
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6


def measure(path, reference_path):
    """Displacements by state, per-node error, and what the numbers say."""
    mesh = read(path)
    tets, label = mesh.cells_dict["tetra"], mesh.cell_data_dict["label"]["tetra"]
    u = vectors(mesh, path, "displacement")
    states = {DEFORMED: u}
    if reference_path:
        other = read(reference_path)
        if other.points.shape != mesh.points.shape or np.abs(other.points - mesh.points).max() > 1e-9:
            raise Rejected(f"{reference_path}: its nodes are not those of {path}")
        states[REFERENCE] = vectors(other, reference_path, "displacement")
    elif "reference_displacement" in mesh.point_data:
        states[REFERENCE] = vectors(mesh, path, "reference_displacement")

    rest_mm3, deformed_mm3 = volumes(mesh.points, tets), volumes(mesh.points + u, tets)
    checks = {
        "rest_volumes_positive": bool((rest_mm3 > 0).all()),
        "deformed_volumes_positive": bool((deformed_mm3 > 0).all()),
    }
    report = {
        "nodes": len(mesh.points),
        "tetrahedra": len(tets),
        "volume_ml_by_label": {str(k): round(float(rest_mm3[label == k].sum()) / 1e3, 6) for k in np.unique(label)},
        "displacement_max_mm": float(np.linalg.norm(u, axis=1).max()),
        "volume_change_percent": float(100 * (deformed_mm3.sum() / rest_mm3.sum() - 1)),
        "node_sets": {
            name: int(values.sum())
            for name, values in sorted(mesh.point_data.items())
            if values.dtype.kind in "iu" and values.ndim == 1 and np.isin(values, (0, 1)).all()
        },
    }
    if "jacobian" in mesh.cell_data_dict:
        # Volume ratio of a linear tetrahedron, whatever the element that was solved.
        recomputed = deformed_mm3 / rest_mm3
        report["jacobian_largest_difference"] = float(np.abs(mesh.cell_data_dict["jacobian"]["tetra"] - recomputed).max())
    error = None
    if REFERENCE in states:
        error = np.linalg.norm(u - states[REFERENCE], axis=1)
        report["rmse_mm"] = float(np.sqrt((error**2).mean()))
    if "rmse_mm" in mesh.point_data:
        own = np.asarray(mesh.point_data["rmse_mm"], float).ravel()
        if "rmse_observed" in mesh.point_data:  # where a target surface was seen
            own = np.where(np.asarray(mesh.point_data["rmse_observed"]).ravel() > 0, own, np.nan)
        report["file_rmse_mm"] = float(np.sqrt((own[np.isfinite(own)] ** 2).mean())) if np.isfinite(own).any() else None
        if error is None:
            error = own
        else:
            difference = float(np.nanmax(np.abs(own - error), initial=0.0))
            report["rmse_largest_difference_mm"] = difference
            checks["rmse_agrees"] = difference <= SAME_MM
    report["checks"] = checks
    report["verdict"] = "pass" if all(checks.values()) else "fail"
    return mesh, states, error, report


def render(mesh, states, error, picture, size):
    """One row of views, cut open beside the midline and seen from the left and the front."""
    import pyvista as pv

    grid = pv.UnstructuredGrid({pv.CellType.TETRA: mesh.cells_dict["tetra"]}, mesh.points)
    grid.cell_data["label"] = mesh.cell_data_dict["label"]["tetra"]
    for state, u in states.items():
        grid.point_data[state] = u
        grid.point_data[f"{state} size"] = np.linalg.norm(u, axis=1)
    if error is not None:
        grid.point_data["error"] = error
    # Cut at rest, then moved: all states show the same cut.
    kept = grid.clip("-x", origin=(mesh.points[:, 0].mean() - 12, 0, 0))
    labels = np.unique(kept.cell_data["label"])
    longest = max(grid.point_data[f"{state} size"].max() for state in states)
    panels = [state for state in (REST, REFERENCE, DEFORMED) if state == REST or state in states]

    plotter = pv.Plotter(off_screen=True, shape=(1, len(panels)), window_size=(size * len(panels), size), border=False)
    plotter.set_background("white")
    bar = {"vertical": False, "color": "black", "position_x": 0.15, "position_y": 0.02, "width": 0.7, "height": 0.1,
           "title_font_size": size // 32, "label_font_size": size // 36}
    for column, state in enumerate(panels):
        plotter.subplot(0, column)
        part = kept.copy()
        if state == REST:
            plotter.add_mesh(part, scalars="label", cmap="cividis", n_colors=len(labels), show_edges=True, line_width=0.3,
                             scalar_bar_args={**bar, "title": "label", "n_labels": len(labels), "fmt": "%.0f"})
        else:
            part.points = part.points + part.point_data[state]
            with_error = state == DEFORMED and error is not None
            name = "error of the node, mm" if with_error else "displacement, mm"
            top = np.nanmax(error) if with_error else longest
            part.point_data[name] = part.point_data["error" if with_error else f"{state} size"]
            plotter.add_mesh(part, scalars=name, cmap="viridis", clim=(0, max(float(top), 1e-9)), nan_color="lightgrey",
                             scalar_bar_args={**bar, "title": name, "n_labels": 3, "fmt": "%.2f"})
        plotter.add_text(state, font_size=size // 60, color="black", position="upper_left")
        # From the left and a little from the front, so that the cut is seen.
        centre = np.array(grid.center)
        direction = np.array([-1.0, 0.35, 0.25])
        plotter.camera_position = [centre + 4 * grid.length * direction, centre, (0, 0, 1)]
        plotter.reset_camera()
        plotter.camera.zoom(1.15)
    plotter.link_views()
    plotter.screenshot(picture)
    plotter.close()


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("deformed")
    parser.add_argument("--reference")
    parser.add_argument("-o", "--output", required=True, help="PNG")
    parser.add_argument("--json", dest="report", help="what was measured; standard output if not given")
    parser.add_argument("--size", type=int, default=900, help="pixels per view")
    options = parser.parse_args(arguments)
    try:
        mesh, states, error, report = measure(options.deformed, options.reference)
    except Rejected as message:
        print(f"render_qa: {message}", file=sys.stderr)
        return 3
    render(mesh, states, error, options.output, options.size)
    text = json.dumps(report, indent=1, sort_keys=True) + "\n"
    if options.report:
        with open(options.report, "w", encoding="utf-8") as file:
            file.write(text)
    else:
        sys.stdout.write(text)
    return 0 if report["verdict"] == "pass" else 4


if __name__ == "__main__":
    sys.exit(main())
