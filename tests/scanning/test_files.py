"""Meshes, point clouds and height maps of every kind, whole and damaged."""

import imageio.v3
import numpy as np
import pytest
import trimesh

from toolkit.errors import InputError
from toolkit.scanning.files import MESHES, ReadOptions, read_scan

HEIGHTS = np.array([[0.3, 0.4], [0.0, 0.1], [0.0, 0.2]])


@pytest.mark.parametrize("kind", [kind for kind in MESHES if kind != "gltf"])
def test_a_mesh_keeps_its_shape_and_its_height(kind, steps, tmp_path):
    path = tmp_path / f"steps.{kind.upper()}"
    turned = steps.copy()
    if kind == "glb":  # its standard says that y is up
        turned.vertices = turned.vertices[:, [0, 2, 1]] * [1, 1, -1]
    turned.export(path, file_type=kind)
    scan = read_scan(path, ReadOptions())
    assert len(scan.triangles) == 36
    np.testing.assert_allclose(scan.bounds, steps.bounds, atol=1e-5)
    again = trimesh.Trimesh(scan.vertices, scan.triangles)
    assert again.volume == pytest.approx(steps.volume, rel=1e-5)


def test_options_turn_scale_and_move_a_mesh(steps, tmp_path):
    path = tmp_path / "steps.stl"
    steps.copy().apply_scale(1000.0).export(path)
    scan = read_scan(path, ReadOptions(scale=0.001, up="y", origin=(0.0, 0.0, -1.0)))
    low, high = steps.bounds
    np.testing.assert_allclose(
        scan.bounds, [[low[0], -high[2], low[1] + 1], [high[0], -low[2], high[1] + 1]], atol=1e-5
    )


def test_a_cloud_loses_points_that_are_not_finite(tmp_path):
    points = np.random.default_rng(0).random((50, 3))
    points[7, 1] = np.nan
    trimesh.PointCloud(points).export(tmp_path / "cloud.ply")
    scan = read_scan(tmp_path / "cloud.ply", ReadOptions())
    assert scan.vertices.shape == (49, 3) and len(scan.triangles) == 0


def test_a_pcd_cloud(tmp_path):
    pypcd4 = pytest.importorskip("pypcd4")
    points = np.random.default_rng(0).random((50, 3)).astype(np.float32)
    for encoding in pypcd4.Encoding:
        pypcd4.PointCloud.from_xyz_points(points).save(tmp_path / "cloud.pcd", encoding=encoding)
        np.testing.assert_allclose(read_scan(tmp_path / "cloud.pcd", ReadOptions()).vertices, points, atol=1e-5)


def check_map(scan, cell: tuple[float, float], scale: float = 1.0):
    """Whether a scan is the mesh of `HEIGHTS`."""
    assert scan.triangles.shape == (4, 3)
    x, y, z = scan.vertices.T
    column, row = np.round(x / cell[0]).astype(int), np.round(y / cell[1]).astype(int)
    np.testing.assert_allclose(z, scale * HEIGHTS[::-1][row, column], atol=1e-6)
    corners = scan.vertices[scan.triangles]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()


def test_an_array_of_heights(tmp_path):
    np.save(tmp_path / "map.npy", HEIGHTS)
    check_map(read_scan(tmp_path / "map.npy", ReadOptions(cell=0.5)), (0.5, 0.5))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_an_image_of_heights(kind, tmp_path):
    imageio.v3.imwrite(tmp_path / "map.png", np.round(HEIGHTS * 100).astype(kind))
    check_map(read_scan(tmp_path / "map.png", ReadOptions(cell=0.5, scale=0.02)), (0.5, 0.5), 2.0)


def test_a_geotiff_knows_its_cells_and_its_holes(tmp_path):
    rasterio = pytest.importorskip("rasterio")
    values = np.vstack([HEIGHTS, [[0.5, -9999.0]]]).astype(np.float32)
    form = {"driver": "GTiff", "width": 2, "height": 4, "count": 1, "dtype": "float32", "nodata": -9999.0}
    with rasterio.open(tmp_path / "map.tif", "w", **form, transform=rasterio.Affine(0.5, 0, 5e5, 0, -0.4, 6e6)) as file:
        file.write(values, 1)
    scan = read_scan(tmp_path / "map.tif", ReadOptions())
    assert scan.triangles.shape == (5, 3)
    np.testing.assert_allclose(scan.bounds, [[0.0, 0.0, 0.0], [0.5, 1.2, 0.5]], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "options", "message"),
    [
        ("none.obj", None, {}, "No such file"),
        ("empty.obj", b"", {}, "is empty"),
        ("scan.xyz", b"0 0 0", {}, r"files that end in .xyz are not known; known are obj, stl"),
        ("text.obj", b"hello", {}, "holds no triangles"),
        ("text.stl", b"hello", {}, "holds no triangles|is damaged"),
        ("latin.stl", b"solid \xfcber\nfacet\nvertex 0 0 \xff\nendsolid\n", {}, "is damaged"),
        ("text.ply", b"hello", {}, "is damaged"),
        ("text.glb", b"hello, this is text", {}, "is damaged"),
        ("text.pcd", b"hello", {}, "is damaged|needs the package pypcd4"),
        ("text.png", b"hello", {}, "is damaged"),
        ("text.npy", b"hello", {}, "is damaged"),
        ("text.tif", b"hello", {}, "is damaged|needs the package rasterio"),
        ("corner.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", {}, "is damaged"),
        ("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", {}, "holds no triangles|is damaged"),
        ("far.obj", b"v 5e5 0 0\nv 500001 0 0\nv 5e5 1 0\nf 1 2 3\n", {}, "--origin 500000,0,0"),
        ("small.obj", b"v 0 0 0\nv 1e-3 0 0\nv 0 1e-3 0\nf 1 2 3\n", {}, "give --scale"),
    ],
)
def test_what_cannot_be_used_is_one_line(name, content, options, message, tmp_path, capfd):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as error:
        read_scan(tmp_path / name, ReadOptions(**options))
    assert "\n" not in str(error.value) and name in str(error.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("array", "options", "message"),
    [
        (HEIGHTS, {}, "give --cell"),
        (np.zeros((3, 3, 3)), {"cell": 1.0}, "an array of 3 dimensions"),
        (np.array([["a", "b"]]), {"cell": 1.0}, "is damaged"),
        (np.zeros((1, 5)), {"cell": 1.0}, "1 x 5 heights"),
        (np.zeros((2000, 2000), np.int8), {"cell": 1.0}, "at most 1000000 are read"),
        (np.full((3, 3), np.nan), {"cell": 1.0}, "holds no triangles"),
        (np.array([{}, {}], object), {"cell": 1.0}, "is damaged"),
    ],
)
def test_arrays_that_are_no_heights(array, options, message, tmp_path):
    np.save(tmp_path / "map.npy", array)
    with pytest.raises(InputError, match=message):
        read_scan(tmp_path / "map.npy", ReadOptions(**options))


def test_grey_levels_need_a_unit_and_colours_are_no_heights(tmp_path):
    imageio.v3.imwrite(tmp_path / "map.png", np.zeros((4, 4), np.uint8))
    with pytest.raises(InputError, match="give --scale"):
        read_scan(tmp_path / "map.png", ReadOptions(cell=0.1))
    imageio.v3.imwrite(tmp_path / "map.png", np.arange(48, dtype=np.uint8).reshape(4, 4, 3))
    with pytest.raises(InputError, match="it has colours"):
        read_scan(tmp_path / "map.png", ReadOptions(cell=0.1, scale=1.0))


@pytest.mark.parametrize("kind", ["obj", "stl", "ply", "glb", "off"])
def test_files_cut_off_anywhere_are_read_or_refused(kind, steps, tmp_path):
    steps.export(tmp_path / f"whole.{kind}")
    content = (tmp_path / f"whole.{kind}").read_bytes()
    for share in np.linspace(0.05, 0.95, 10):
        (tmp_path / f"cut.{kind}").write_bytes(content[: int(share * len(content))])
        try:
            read_scan(tmp_path / f"cut.{kind}", ReadOptions())
        except InputError as error:
            assert "\n" not in str(error)
