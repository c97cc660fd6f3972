"""Where the pushes of an arm begin: coasts stay in the joint ranges and clear of everything."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from metaid.errors import PlantError
from metaid.plant import ArmPlant, ArmSettings, load_plant
from metaid.plant.description import draw_starts
from metaid.plant.description.starts import CLEARANCE, MARGIN, SPEED

HORIZON = 0.3
# A slide on a rail without ends, on which a pendulum hangs beside a wall.
CART = """<mujoco><worldbody><geom name="wall" type="box" pos="{wall} 0 0" size="0.1 1 1"/>
<body><joint name="rail" type="slide" axis="1 0 0"/><geom name="cart" size="0.1"/>
<body><joint name="swing" axis="0 1 0"/><geom name="rod" type="capsule" fromto="0 0 -0.2 0 0 -0.5" size="0.02"/></body>
</body></worldbody></mujoco>"""

# Clear at home alone.
BLOCKED = """<mujoco><worldbody><geom name="wall" type="box" pos="-0.55 0 -0.6" size="0.5 1 0.6"/>
<body><joint axis="0 1 0" range="0 57" limited="true"/><geom name="rod" type="capsule" fromto="0 0 0 0 0 -0.5"
size="0.02"/></body></worldbody></mujoco>"""


def cart(folder: Path, wall: float, **entries: object) -> ArmPlant:
    """A pendulum on a cart, its wall that far away."""
    (folder / "cart.xml").write_text(CART.format(wall=wall), encoding="utf-8")
    return ArmPlant("cart", ArmSettings.model_validate({"mjcf": str(folder / "cart.xml"), **entries}))


@pytest.mark.parametrize("name", ["pa10", "scara"])
def test_coasts_stay_in_the_ranges_and_touch_nothing(name: str) -> None:
    """All the way, in the user's whole file, but for shapes that touch at home."""
    plant = load_plant(name)
    assert isinstance(plant, ArmPlant)
    whole, tree = plant.arm.whole, plant.tree
    data = mujoco.MjData(whole.model)
    data.qpos[:] = whole.at(plant.home)
    mujoco.mj_forward(whole.model, data)
    at_home = {tuple(pair) for pair in data.contact.geom.tolist()}
    margin = MARGIN * (tree.high - tree.low)
    starts = draw_starts(plant, 8, HORIZON, seed=1)
    for start in starts:
        for time in np.linspace(0.0, HORIZON, 40):
            coordinates = start.pose + time * start.speeds
            assert (coordinates >= tree.low + 0.999 * margin).all()
            assert (coordinates <= tree.high - 0.999 * margin).all()
            data.qpos[:] = whole.at(coordinates)
            mujoco.mj_forward(whole.model, data)
            assert {tuple(pair) for pair in data.contact.geom.tolist()} <= at_home
    fastest = np.abs([start.speeds for start in starts]).max(axis=0)
    assert (fastest[~tree.slides] > 0.5 * SPEED).all()
    assert fastest.max() <= SPEED


def test_starts_depend_on_the_seed_alone(tmp_path: Path) -> None:
    """And not on what the arm weighs, which a search may not see."""
    first, again, heavier, other = (
        draw_starts(cart(tmp_path, 2.0, rotor=rotor), 3, HORIZON, seed)
        for rotor, seed in (({}, 1), ({}, 1), ({"swing": 5.0}, 1), ({}, 2))
    )
    for one, two, three, four in zip(first, again, heavier, other, strict=True):
        assert (one.pose == two.pose).all()
        assert (one.speeds == three.speeds).all()
        assert (one.pose != four.pose).all()


def test_no_coast_of_a_slide_without_limits_ends_near_the_wall(tmp_path: Path) -> None:
    """A wall 0.5 m away takes a part of the rail from the cart, from the start to the end."""
    near, far = (
        [start.pose[0] + HORIZON * start.speeds[0] for start in draw_starts(cart(tmp_path, wall), 40, HORIZON, seed=1)]
        for wall in (0.5, 3.0)
    )
    assert max(near) <= 0.5 - 0.1 - 0.1 - CLEARANCE
    assert max(far) > 0.35
    (away,) = draw_starts(cart(tmp_path, 0.5, home={"rail": 5.0}), 1, HORIZON, seed=1)
    assert abs(away.pose[0] - 5.0) < 0.5


def test_arm_that_is_never_clear_is_refused(tmp_path: Path) -> None:
    """One line names the two shapes that were in each other's way, and what is allowed."""
    (tmp_path / "arm.xml").write_text(BLOCKED, encoding="utf-8")
    blocked = ArmPlant("blocked", ArmSettings(mjcf=str(tmp_path / "arm.xml")))
    with pytest.raises(
        PlantError, match=r"in 2000 of 2000 draws 'wall' and 'rod' came within 0\.02 m \(allowed: shapes"
    ):
        draw_starts(blocked, 1, HORIZON, seed=1)


def test_file_without_shapes_is_not_looked_at(tmp_path: Path) -> None:
    """Any pose in the ranges will do."""
    text = CART.format(wall=0.0).replace("<geom ", '<geom contype="0" conaffinity="0" ')
    (tmp_path / "cart.xml").write_text(text, encoding="utf-8")
    assert len(draw_starts(ArmPlant("cart", ArmSettings(mjcf=str(tmp_path / "cart.xml"))), 5, HORIZON, seed=1)) == 5
