"""Obstacles, contact points and forces of contacts: pages and figures show them where they are."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots import Box, Capsule, Cylinder, Environment, HalfSpace, Mesh, Sphere
from softrobots.environment.obstacles import Obstacle
from softrobots.statics.contact.contact import Contact
from softrobots.view.appearance import CONTACT_COLOUR
from softrobots.view.mesh_triangles import triangles
from softrobots.view.scene import SceneBuilder
from softrobots.view.surroundings import drawn_obstacles
from softrobots.view.viewer import view
from softrobots.view.warm_start import next_solution
from tests.support.packed_pages import scene_of

TURN = Rotation.from_euler("xyz", (0.4, -0.7, 1.1)).as_matrix()
PLACE = np.array((0.5, -0.2, 0.3))
MOVE = np.eye(4)
MOVE[:3, :3], MOVE[:3, 3] = Rotation.from_euler("zyx", (0.3, 0.2, -0.5)).as_matrix(), (0.1, 0.2, -0.1)
CORNERS = np.array([(x, y, z) for x in (-0.05, 0.05) for y in (-0.1, 0.1) for z in (-0.2, 0.2)])
"""Corners of the box, as a mesh, shape (8, 3) [m]."""
ROUND = 1.0 - np.cos(np.pi / 16.0)
"""Share of a radius by which a polygon of 16 corners or more is inside of its circle, in one direction."""


def corners_of(obstacle: Obstacle, ground: float = -np.inf) -> np.ndarray:
    """Corners of what is drawn of an obstacle, world axes, shape (n, 3) [m]."""
    (drawn,) = drawn_obstacles(Environment([obstacle]), np.array((0.6, 0.0, 0.1)), 1.2, ground)
    corners = triangles(drawn.geometry)[0]
    return corners @ drawn.pose[:3, :3].T + drawn.pose[:3, 3]


@pytest.mark.parametrize("pose", [None, MOVE], ids=["fixed", "moved"])
@pytest.mark.parametrize(
    ("obstacle", "reach", "error"),
    [  # farthest distance from the centre along a direction in the obstacle's own axes, in closed form
        (Box((0.1, 0.2, 0.4), PLACE, TURN), lambda u: np.abs(u) @ (0.05, 0.1, 0.2), 1e-12),
        (Mesh(CORNERS, PLACE, TURN), lambda u: np.abs(u) @ (0.05, 0.1, 0.2), 1e-12),
        (Sphere(0.25, PLACE), lambda u: 0.25 * np.linalg.norm(u), 2 * 0.25 * ROUND),
        (Cylinder(0.1, 0.4, PLACE, TURN), lambda u: 0.1 * np.hypot(u[0], u[1]) + 0.2 * abs(u[2]), 0.1 * ROUND),
        (Capsule(0.1, 0.4, PLACE, TURN), lambda u: 0.1 * np.linalg.norm(u) + 0.2 * abs(u[2]), 2 * 0.1 * ROUND),
    ],
    ids=["box", "mesh", "sphere", "cylinder", "capsule"],
)
def test_a_solid_is_drawn_where_the_obstacle_is(
    obstacle: Obstacle, reach: object, error: float, pose: np.ndarray | None, rng: np.random.Generator
) -> None:
    """Its extent along any direction is that of the obstacle, up to the corners that stand for what is round."""
    corners = corners_of(dataclasses.replace(obstacle, pose=pose))
    moved = np.eye(4) if pose is None else pose
    centre = moved[:3, :3] @ PLACE + moved[:3, 3]
    axes = moved[:3, :3] @ (TURN if hasattr(obstacle, "rotation") else np.eye(3))
    for direction in rng.normal(size=(40, 3)):
        unit = direction / np.linalg.norm(direction)
        least = reach(axes.T @ unit) - float(((corners - centre) @ unit).max())
        assert -1e-12 <= least <= error + 1e-12


def test_a_sheet_lies_behind_the_plane_of_its_half_space() -> None:
    """Its front is in the plane, its back 1.2 cm behind; upright ones stand on the ground."""
    normal = np.array((-0.6, 0.0, 0.8))
    depths = corners_of(HalfSpace(5.0 * normal, offset=-0.3)) @ normal + 0.3
    assert np.allclose(np.sort(depths), [-0.012] * 4 + [0.0] * 4, atol=1e-12)
    upright = corners_of(HalfSpace((-1, 0, 0), offset=-0.9), ground=-0.2)
    assert np.allclose((upright.min(axis=0), upright.max(axis=0)), [(0.9, -0.6, -0.2), (0.912, 0.6, 1.0)], atol=1e-12)
    floor = corners_of(HalfSpace((0, 0, 1), offset=-0.5), ground=-0.2)
    assert np.allclose((floor.min(axis=0), floor.max(axis=0)), [(0.0, -0.6, -0.512), (1.2, 0.6, -0.5)], atol=1e-12)
    turned = corners_of(HalfSpace((0, 0, 1), pose=MOVE))
    along = MOVE[:3, 2]
    assert float((turned @ along).max()) == pytest.approx(MOVE[:3, 3] @ along, abs=1e-12)


def leaning(arm: sr.SoftModel) -> sr.Equilibrium:
    """An arm with made-up contacts: 25 N of a wall at its tip, 12 and 5 N of a post, and a floor that is only touched."""
    post = Cylinder(0.05, 0.3, (0.4, -0.3, 0.1), name="post")
    floor = HalfSpace((0, 0, 1), offset=-0.4, name="floor")
    world = Environment([HalfSpace((-1, 0, 0), offset=-1.06, name="wall"), post, floor])
    held = sr.solve_equilibrium(arm, (0.0, 0.9, -0.4), (0, 0, -20))

    def contact(link: str, obstacle: str, point: tuple[float, ...], force: tuple[float, ...]) -> Contact:
        size = float(np.linalg.norm(force))
        unit, status = np.array(force) / max(size, 1e-12), "pressed" if size else "touching"
        one = np.array(point, dtype=float)
        return Contact(link, obstacle, one, one.copy(), unit, size, np.array(force), 0.0, size > 0, status, np.zeros(3))

    contacts = (
        contact("link_2", "wall", (1.06, 0.0, 0.6), (-25.0, 0.0, 0.0)),
        contact("link_1", "post", (0.4, -0.25, 0.2), (0.0, 12.0, 0.0)),
        contact("link_1", "post", (0.45, -0.25, 0.2), (3.0, 4.0, 0.0)),
        contact("link_1", "floor", (0.3, 0.0, -0.4), (0.0, 0.0, 0.0)),
    )
    return dataclasses.replace(held, load=dataclasses.replace(held.load, environment=world), contacts=contacts)


def test_a_page_holds_obstacles_points_arrows_and_newtons(arm: sr.SoftModel) -> None:
    """Arrows of contacts end at their points, as long as their forces are beside the 20 N on the tip."""
    import umsgpack

    held = leaning(arm)
    with view(arm, held) as viewer:
        text = viewer.html()
    rows = re.findall(r"</span>([^<]*)</div>", text)
    told = {"obstacle", "wall presses with 25 N", "post presses with 17 N at 2 points", "touches floor", "force 20 N"}
    assert told <= set(rows)
    commands = [umsgpack.unpackb(one) for one in scene_of(text)[1]]
    placed = {
        one["path"].removeprefix("/meshcat/softrobots/"): np.array(one["matrix"]).reshape(4, 4).T
        for one in commands
        if one["type"] == "set_transform"
    }
    solids = {
        one["path"].removeprefix("/meshcat/softrobots/"): one["object"]["geometries"][0]
        for one in commands
        if one["type"] == "set_object"
    }
    assert {name for name in solids if name.startswith("obstacles/")} == {f"obstacles/{n}/body" for n in range(3)}
    assert np.allclose(placed["obstacles/1"][:3, 3], (0.4, -0.3, 0.1), atol=1e-5)
    assert (solids["obstacles/1/body"]["radiusTop"], solids["obstacles/1/body"]["height"]) == pytest.approx(
        (0.05, 0.3), abs=1e-5
    )
    lengths = {}
    for name, contact in zip(("link_2/wall/0", "link_1/post/0", "link_1/post/1"), held.contacts, strict=False):
        pose, head = placed[f"load/contact/{name}"], placed[f"load/contact/{name}/head"]
        assert np.allclose(placed[f"contacts/{name}"][:3, 3], contact.point, atol=1e-5)
        tip = head @ (0.0, 0.5 * solids[f"load/contact/{name}/head"]["height"], 0.0, 1.0)
        assert np.allclose((pose @ tip)[:3], contact.point, atol=1e-4)
        assert np.allclose(pose[:3, 1] * contact.normal_force, contact.force, atol=1e-3)
        lengths[contact.normal_force] = solids[f"load/contact/{name}/shaft"]["height"]
    lengths[20.0] = solids[f"load/{arm.tip}/shaft"]["height"]
    assert np.ptp([length / force for force, length in lengths.items()]) < 1e-5
    assert "load/contact/link_1/floor/0" not in placed


def test_figures_show_them_too(arm: sr.SoftModel) -> None:
    held = leaning(arm)
    (axes,) = sr.plot(held).axes
    labels = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert {"obstacle", "wall presses with 25 N", "post presses with 17 N at 2 points", "touches floor"} <= set(labels)
    violet = [line for line in axes.lines if line.get_color() == f"#{CONTACT_COLOUR:06x}"]
    points = [np.ravel(line.get_data_3d()) for line in violet]
    assert np.allclose(points, [contact.point for contact in held.contacts], atol=1e-12)
    shafts = [np.array(one._segments3d[0]) for one in axes.collections if hasattr(one, "_segments3d")]
    behind = 1.06 + 0.2 * 1.2  # the arrow of the largest force comes from behind the wall, a fifth of the arm long
    assert any(np.allclose(sorted(map(tuple, ends)), [(1.06, 0, 0.6), (behind, 0, 0.6)], atol=1e-9) for ends in shafts)


def test_obstacles_of_the_same_surroundings_are_made_once(arm: sr.SoftModel) -> None:
    """A live page that shows state after state does not send them again."""
    builder, held = SceneBuilder(arm), leaning(arm)
    assert builder.loaded(held).obstacles is builder.loaded(leaning(arm)).obstacles
    assert builder.relaxed().obstacles == ()


def test_live_targets_are_reached_while_leaning(arm: sr.SoftModel) -> None:
    """A target at the wall, where the link of 55 mm touches it at 1 m; and back, where it does not."""
    wall = Environment([HalfSpace((-1, 0, 0), offset=-1.0, name="wall")])
    start = sr.solve_equilibrium(arm, (0.0, 0.9, -0.4), (0, 0, -20), environment=wall)
    there = next_solution(start, (0.945, 0.1, 0.7), (0, 0, -20)).equilibrium
    assert np.allclose(there.tip_position, (0.945, 0.1, 0.7), atol=1e-8)
    assert [contact.obstacle for contact in there.contacts] == ["wall"]
    back = next_solution(there, (0.8, 0.1, 0.7), (0, 0, -20)).equilibrium
    assert back.contacts == ()
    assert back.load.environment == wall


def test_what_touches_is_drawn_around_links(arm: sr.SoftModel) -> None:
    """The capsule of the last link ends in a half ball of 55 mm beyond the tip; alone a robot has none."""
    wall = Environment([HalfSpace((-1, 0, 0), offset=-2.0)])
    builder = SceneBuilder(arm)
    scene = builder.loaded(sr.solve_equilibrium(arm, (0.3, 0.0, 0.0), environment=wall))
    last = scene.capsules[-1]  # base to tip
    corners = triangles(last.geometry)[0] @ last.pose[:3, :3].T + last.pose[:3, 3]
    along = np.array((np.cos(0.3), np.sin(0.3), 0.0))
    assert float((corners @ along).max()) == pytest.approx(1.2 + 0.055, abs=1e-9)
    assert np.allclose(corners.mean(axis=0), (0.63 + 0.57 / 2) * along, atol=1e-9)
    assert builder.loaded(sr.solve_equilibrium(arm, (0.3, 0.0, 0.0))).capsules == ()


def lifted(way: float) -> np.ndarray:
    """A motion along z, shape (4, 4), by a way [m]."""
    pose = np.eye(4)
    pose[2, 3] = way
    return pose


def test_a_path_in_contact_is_played(arm: sr.SoftModel) -> None:
    """Obstacles move by their poses, the arrow grows with its force, and the point appears when the tip touches."""
    import umsgpack

    world = Environment([HalfSpace((-1, 0, 0), offset=-1.0, name="wall"), Sphere(0.1, (0.5, -0.4, 0.1), pose=lifted)])
    weights = np.array((0.0, 10.0, 20.0, 40.0))
    path = sr.follow_contact(arm, (0.0, 0.9, -0.4), np.outer(weights, (0, 0, -1)), environment=world, parameters=0.01 * weights)
    with view(arm, path) as viewer:
        text = viewer.html()
        with pytest.raises(sr.ParameterError, match="whose parameter is no time"):
            viewer.animate(path, speed=2.0)
    largest = path.equilibria[-1].contacts[0].normal_force
    assert f"wall presses with 0 to {largest:.3g} N" in text
    played = umsgpack.unpackb(scene_of(text)[1][-1])
    assert played["type"] == "set_animation"
    tracks = {
        (one["path"].removeprefix("/meshcat/softrobots/"), track["name"]): [key["value"] for key in track["keys"]]
        for one in played["animations"]
        for track in one["clip"]["tracks"]
    }
    heights = [place[2] for place in tracks["obstacles/1", ".position"]]
    assert np.allclose(heights, 0.1 + 0.01 * weights, atol=1e-5)
    (name,) = {name for name, _ in tracks if name.startswith("contacts/")}
    assert tracks[name, ".visible"] == [False, False, True, True]
    shares = [scale[0] for scale in tracks[f"load/contact/{name.removeprefix('contacts/')}", ".scale"]]
    forces = [sum(contact.normal_force for contact in state.contacts) for state in path.equilibria]
    assert np.allclose(shares, np.array(forces) / largest, atol=1e-5)
