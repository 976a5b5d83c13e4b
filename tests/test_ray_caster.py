"""The ray caster: what it shows obeys projective geometry, and so does its truth."""

import math

import numpy as np
import pytest
import unsmear
from unsmear import synthetic
from unsmear.synthetic import (
    Body,
    Box,
    Camera,
    Disc,
    Light,
    Rectangle,
    Sky,
    Sphere,
    Surface,
    Terrain,
    World,
    looking,
    placed,
    record,
    turned,
)

SHAPE = (48, 64)
FOCAL = 60.0
SMOOTH = Surface(synthetic.texture((128, 128), seed=4, exponent=2.0), 6.0)
STILL = Camera(placed(), FOCAL)


def middle_coordinates() -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    return x - (SHAPE[1] - 1) / 2, y - (SHAPE[0] - 1) / 2


def hilly(seed: int = 1) -> Terrain:
    heights = 3 * synthetic.texture((32, 32), seed=seed, exponent=2.0)
    return Terrain(heights, 1.0)


def crowd() -> World:
    """Bodies of every kind that move, and a camera that turns and moves."""
    bodies = (
        Body(hilly(), SMOOTH, placed((0, 2.5, 0))),
        Body(Sphere(0.8), SMOOTH, placed((-1, 0, 5), velocity=(0.3, 0, 0), degrees=4)),
        Body(Box(1, 1.2, 0.8), SMOOTH, placed((1.2, 0, 6), axis=(1, 2, 3), degrees=5)),
        Body(Disc(0.6), SMOOTH, placed((0.2, -0.9, 4), axis=(0, 0, 1), degrees=9)),
        Body(Rectangle(1.5, 0.7), 0.9, placed((0, 0.6, 3.2), velocity=(-0.2, 0, 0.1))),
    )
    camera = looking(
        lambda t: (0.1 * t, -0.2, 0.15 * t), lambda _: (0, 0.2, 6), lambda t: 2 * t
    )
    return World(bodies, Camera(camera, FOCAL), SHAPE)


def test_a_plane_moves_by_its_homography() -> None:
    # Camera at C(t) turned by R(t), plane n . X = c: a point seen along d at time 0 is
    # at X = c d / (n . d), and at time 1 along R' (X - C): a homography of the pixel.
    tilt = turned((1, 1, 0), 30)
    plane = Body(Rectangle(), SMOOTH, placed((0, 0, 5), orientation=tilt))
    path = placed(velocity=(0.2, -0.1, 0.4), axis=(1, 2, 3), degrees=3)
    flow, visible = World((plane,), Camera(path, FOCAL), SHAPE).displacement(0, 1)
    x, y = middle_coordinates()
    normal = tilt[:, 2]
    c = normal @ [0, 0, 5]
    rotation, center = turned((1, 2, 3), 3), np.array([0.2, -0.1, 0.4])
    matrix = rotation.T @ (np.eye(3) - np.outer(center, normal) / c)
    to_pixels = np.diag([FOCAL, FOCAL, 1.0])
    homography = to_pixels @ matrix @ np.linalg.inv(to_pixels)
    moved = np.stack([x, y, np.ones(SHAPE)], axis=-1) @ homography.T
    expected = moved[..., :2] / moved[..., 2:] - np.stack([x, y], axis=-1)
    np.testing.assert_allclose(flow, expected, atol=1e-11)
    landed = np.abs(expected + np.stack([x, y], axis=-1))
    np.testing.assert_array_equal(visible, (landed <= [32, 24]).all(axis=-1))


def test_a_ball_turns_as_spheres_do() -> None:
    # Seen along d = (x / f, y / f, 1), the ball (centre (0, 0, 4), radius 1) is met at
    # the smaller root of |l d - C|^2 = 1; the point moves with velocity w x (X - C).
    degrees = 3.0
    spin = placed((0, 0, 4), degrees=degrees)
    world = World((Body(Sphere(1.0), SMOOTH, spin),), STILL, SHAPE)
    x, y = middle_coordinates()
    d = np.stack([x / FOCAL, y / FOCAL, np.ones(SHAPE)], axis=-1)
    b, a = 4.0 * d[..., 2], (d**2).sum(axis=-1)
    inside = b**2 - a * 15.0
    on = inside > 0.05
    depth = (b - np.sqrt(np.maximum(inside, 0))) / a
    way = depth[..., None] * d - [0, 0, 4]
    after = way @ turned((0, 1, 0), degrees).T + [0, 0, 4]
    expected = FOCAL * after[..., :2] / after[..., 2:] - np.stack([x, y], axis=-1)
    flow, _ = world.displacement(0, 1)
    np.testing.assert_allclose(flow[on], expected[on], atol=1e-11)
    assert np.abs(flow[on]).max() > 0.9
    assert (flow[inside < 0] == 0).all()
    # Velocity: w = (0, omega, 0), w x r = omega (r_z, 0, -r_x), projected.
    omega = math.radians(degrees)
    vx, vz = omega * way[..., 2], -omega * way[..., 0]
    u = FOCAL * (vx - x / FOCAL * vz) / depth
    v = FOCAL * (-y / FOCAL * vz) / depth
    velocity = world.velocity(0, 1e-4)
    # The central difference errs by h^2 / 6 times the third derivative: 1e-9.
    np.testing.assert_allclose(velocity[on], np.stack([u, v], -1)[on], atol=1e-7)


def test_what_rests_has_exactly_no_flow() -> None:
    world = crowd()
    rest = tuple(
        Body(b.solid, b.surface, lambda _, p=b.pose: p(0.3)) for b in world.bodies
    )
    eye = world.camera.pose
    camera = Camera(lambda _: eye(0.7), FOCAL)
    s = record(World(rest, camera, SHAPE), n_frames=2)
    assert (s.flow == 0).all() and (s.velocity == 0).all() and s.visible.all()
    np.testing.assert_array_equal(s.sharp[0], s.sharp[1])


def test_flow_carries_brightness() -> None:
    s = record(crowd(), n_frames=2)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    u, v = (np.ascontiguousarray(c, float) for c in np.moveaxis(s.flow[0], -1, 0))
    assert np.abs(s.flow[0]).max() > 4
    deviation = s.sharp[0][s.visible[0]].std()

    def error(sign: float) -> float:
        back = unsmear._unsmear.sample(
            s.sharp[1], y + sign * v, x + sign * u, 3, "replicate"
        )
        # The median: pixels of outlines mix two bodies and keep no brightness.
        return float(np.median(np.abs(back - s.sharp[0])[s.visible[0]]))

    assert error(1.0) < 0.02 * deviation
    assert error(-1.0) > 5 * error(1.0)


def holds(body: Body, points: np.ndarray, time: float) -> np.ndarray:
    """Whether points (N, 3) lie within a body, plates taken 2e-3 thick."""
    rotation, position = body.pose(time)
    q = (points - position) @ rotation
    solid = body.solid
    if isinstance(solid, Terrain):
        return -q[:, 1] < solid.height(q[:, 0], q[:, 2])
    if isinstance(solid, Sphere):
        return (q**2).sum(axis=1) < solid.radius**2
    if isinstance(solid, Box):
        return (np.abs(q) < [0.5, 0.6, 0.4]).all(axis=1)
    thin = np.abs(q[:, 2]) < 1e-3
    if isinstance(solid, Disc):
        return thin & ((q[:, :2] ** 2).sum(axis=1) < solid.radius**2)
    return thin & (np.abs(q[:, :2]) < [0.75, 0.35]).all(axis=1)


def test_visibility_against_brute_force() -> None:
    world = crowd()
    flow, visible = world.displacement(0, 1)
    hits = world.cast(0, np.stack(middle_coordinates(), axis=-1).reshape(-1, 2))
    _, eye = world.camera.pose(1)
    x, y = middle_coordinates()
    landed = flow + np.stack([x, y], axis=-1)
    inside = (np.abs(landed) <= [SHAPE[1] / 2, SHAPE[0] / 2]).all(axis=-1).ravel()
    # Every seventh pixel, and all that are said to be hidden behind something.
    solid = inside & (hits.body >= 0)
    tested = solid & ((np.arange(solid.size) % 7 == 0) | ~visible.ravel())
    expected = visible.ravel().copy()
    steps = np.linspace(0.05, 0.99, 2500)[:, None]
    for n in np.flatnonzero(tested):
        own = world.bodies[hits.body[n]]
        rotation, position = own.pose(1)
        path = eye + steps * (rotation @ hits.point[n] + position - eye)
        expected[n] = not any(holds(b, path, 1).any() for b in world.bodies)
    # At outlines the sampled ray may miss what it grazes, or graze its own body.
    wrong = (expected != visible.ravel()) & tested
    assert wrong.sum() <= 0.02 * tested.sum()
    assert (tested & ~expected).sum() >= 40


def test_solids_are_where_their_equations_say() -> None:
    rng = np.random.default_rng(3)
    origin = rng.normal(size=(400, 3)) * [3, 1, 3] - [0, 5, 0]
    direction = rng.normal(size=(400, 3)) + np.array([0, 1, 0])
    hills = hilly()
    for solid, inside in (
        (Sphere(1.5), lambda p: np.linalg.norm(p, axis=1) - 1.5),
        (Box(2, 3, 4), lambda p: (np.abs(p) - [1, 1.5, 2]).max(axis=1)),
        (Rectangle(2, 3), lambda p: p[:, 2]),
        (hills, lambda p: p[:, 1] + hills.height(p[:, 0], p[:, 2])),
    ):
        distance = solid.meet(origin, direction)
        met = np.isfinite(distance)
        assert 0 < met.sum() < 400 and (distance > 0).all()
        points = origin[met] + distance[met, None] * direction[met]
        way = distance[met] * np.linalg.norm(direction[met], axis=1)
        # Rays that graze a hill may end above it by 3e-4 of their way, less than a
        # pixel covers; the others are met exactly, as all else is.
        above = 1e-3 + 3e-4 * way if solid is hills else 1e-12
        assert (np.abs(inside(points)) <= above).all()
        assert np.quantile(np.abs(inside(points)), 0.8) < 1e-12
        _, normal = solid.chart(points)
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1)


def test_poses_are_their_equations() -> None:
    motion = {"velocity": (1, -2, 3), "acceleration": (0.5, 1, -1)}
    rotation, position = placed((1, 2, 3), **motion, axis=(0, 0, 2), degrees=30)(2.0)
    np.testing.assert_allclose(position, [1 + 2 + 1, 2 - 4 + 2, 3 + 6 - 2])
    # By 60 degrees about z (ahead): from x (right) to y (down).
    half, root = 0.5, math.sqrt(3) / 2
    expected = [[half, -root, 0], [root, half, 0], [0, 0, 1]]
    np.testing.assert_allclose(rotation, expected, atol=1e-15)
    view, eye = looking(lambda t: (0, 0, t), lambda _: (1, 0, 1), lambda _: 90.0)(0.0)
    # Half to the right, and rolled by a quarter: the picture's right is down.
    np.testing.assert_allclose(view[:, 2], [math.sqrt(half), 0, math.sqrt(half)])
    np.testing.assert_allclose(view[:, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_array_equal(eye, 0)


def test_no_two_sides_of_a_box_show_the_same_part() -> None:
    corner = np.array([[-0.3, 0.2, 0.4]])
    places = []
    for side in range(3):
        for sign in (-1.0, 1.0):
            point = corner.copy()
            point[0, side] = sign
            place, normal = Box(2, 2, 2).chart(point)
            places.append(place[0])
            assert normal[0, side] == sign
    apart = np.abs(np.subtract.outer(*2 * (np.array(places)[:, 0],)))
    assert (apart + 9 * np.eye(6) > 2).all()


def test_hills_are_met_at_the_first_crossing() -> None:
    hills = hilly(2)
    rng = np.random.default_rng(5)
    origin = np.column_stack([rng.uniform(0, 32, 60), np.full(60, -5.0), np.zeros(60)])
    direction = np.column_stack([np.zeros(60), rng.uniform(0.05, 0.5, 60), np.ones(60)])
    distance = hills.meet(origin, direction)
    steps = np.linspace(0, 100, 10001)
    for o, d, met in zip(origin, direction, distance, strict=True):
        at = o + steps[:, None] * d
        below = -at[:, 1] < hills.height(at[:, 0], at[:, 2])
        # Either the first sample below ground is just behind, or the ray skims a crest
        # within what a pixel covers, which counts as meeting it.
        first = steps[np.argmax(below)] if below.any() else np.inf
        near = o + met * d
        gap = -near[1] - hills.height(near[:1], near[2:])[0]
        assert met <= first + 1e-6 and 0 <= gap + 1e-6 and gap < 0.05
    slope = np.array(hills.slopes(origin[:, 0], origin[:, 0]))
    step = 1e-6
    rise = [
        (
            hills.height(origin[:, 0] + step * i, origin[:, 0] + step * j)
            - hills.height(origin[:, 0] - step * i, origin[:, 0] - step * j)
        )
        / (2 * step)
        for i, j in ((1, 0), (0, 1))
    ]
    np.testing.assert_allclose(slope, rise, atol=1e-8)


def test_sky_turns_with_its_pose_alone() -> None:
    clouds = Surface(synthetic.texture((64, 64), seed=6, exponent=2.0), 2.0)
    camera = Camera(placed(velocity=(3, 1, 2)), FOCAL)
    sky = Sky(clouds, placed(degrees=1.0))
    flow, _ = World((), camera, SHAPE, sky=sky).displacement(0, 1)
    x, y = middle_coordinates()
    d = np.stack([x / FOCAL, y / FOCAL, np.ones(SHAPE)], -1) @ turned((0, 1, 0), 1).T
    expected = FOCAL * d[..., :2] / d[..., 2:] - np.stack([x, y], axis=-1)
    np.testing.assert_allclose(flow, expected, atol=1e-11)
    assert (flow[..., 0] > 1).all()  # about y, by a positive angle: to the right


def test_clouds_change() -> None:
    one, two = (Surface(np.full((2, 2), v), 1.0) for v in (0.2, 0.6))
    sky = Sky(one, placed(), two, 0.1)
    world = World((), STILL, (3, 4), sky=sky)
    for time, value in ((0.0, 0.4), (2.0, 0.48)):
        np.testing.assert_allclose(world.render(time), value)


def test_a_ball_throws_its_shadow() -> None:
    # Light along (1, 0, 2): the ball's shadow on the wall at z = 8 is centred where the
    # light through its middle (0, 0, 4) lands, at x = 2; it spans 1 vertically.
    bodies = (
        Body(Rectangle(), 1.0, placed((0, 0, 8))),
        Body(Sphere(1.0), 1.0, placed((0, 0, 4))),
    )
    world = World(bodies, STILL, SHAPE, light=Light((1, 0, 2), ambient=0.25), rays=1)
    x, y = middle_coordinates()
    shown = world.render(0)
    wall = np.hypot(x, y) > 1.1 * FOCAL / np.sqrt(15)
    across, up = x * 8 / FOCAL - 2, y * 8 / FOCAL
    # The wall faces -z: cos = 2 / sqrt(5); the circle is stretched by as much along x.
    radius = np.hypot(across * 2 / np.sqrt(5), up)
    lit, dark = wall & (radius > 1.01), wall & (radius < 0.99)
    np.testing.assert_allclose(shown[lit], 0.25 + 0.75 * 2 / np.sqrt(5))
    np.testing.assert_allclose(shown[dark], 0.25)
    assert dark.sum() > 40


def test_patterns_are_splines_and_their_means() -> None:
    flat = Surface(np.full((8, 16), 0.3), 2.0)
    place = np.random.default_rng(0).uniform(-9, 9, (50, 2))
    for footprint in (0.0, 0.2, 0.7, 50.0):
        np.testing.assert_allclose(flat.at(place, np.full(50, footprint)), 0.3)
    # A wave of n px per period is weakened by the cubic B-spline to
    # (2 + cos w) / 3 of its amplitude at the pixels, w = 2 pi / n.
    phase = 2 * np.pi * np.arange(32) / 8
    wave = Surface(np.tile(np.cos(phase), (4, 1)), 32.0)
    middles = np.column_stack([np.arange(32) + 0.5, np.full(32, 0.5)])
    gain = (2 + np.cos(np.pi / 4)) / 3
    sharp = wave.at(middles, np.zeros(32))
    np.testing.assert_allclose(sharp, gain * np.cos(phase), atol=1e-12)
    # A footprint of two periods leaves nothing but the mean.
    np.testing.assert_allclose(wave.at(middles, np.full(32, 16.0)), 0, atol=1e-12)
    half = wave.at(middles, np.full(32, math.sqrt(2)))
    coarse = wave.at(middles, np.full(32, 2.0))
    np.testing.assert_allclose(half, (sharp + coarse) / 2)


def test_a_blurred_frame_is_the_mean_of_sharp_ones() -> None:
    world = crowd()
    s = record(world, n_frames=1, exposure=0.5, n_subframes=3)
    parts = [world.render(o / 6) for o in (-1, 0, 1)]
    np.testing.assert_allclose(s.blurred[0], np.mean(parts, axis=0), atol=1e-12)
    still = record(world, n_frames=1)
    np.testing.assert_array_equal(still.sharp, still.blurred)


def test_a_pixel_is_the_mean_of_its_rays() -> None:
    # The edge of a bright plate cuts the middle column's pixels in half.
    plate = Body(Rectangle(2.0, 9.0), 1.0, placed((1.0, 0, 1)))
    world = World((plate,), Camera(placed(), 2.0), (3, 3), sky=0.0, rays=4)
    np.testing.assert_allclose(world.render(0)[1], [0, 0.5, 1])


def test_what_passes_the_camera_has_no_flow() -> None:
    plate = Body(Rectangle(), 1.0, placed((0, 0, 1), velocity=(0, 0, -2)))
    flow, visible = World((plate,), STILL, (4, 4)).displacement(0, 1)
    assert np.isnan(flow).all() and not visible.any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Sphere(0), "radius"),
        (lambda: Box(1, -1, 1), "width, height and depth"),
        (lambda: Rectangle(np.nan), "width and height"),
        (lambda: Terrain(np.zeros(4), 1.0), "heights"),
        (lambda: Terrain(np.zeros((4, 4)), 0.0), "spacing"),
        (lambda: Surface(np.zeros((4, 6)), 1.0), "powers of 2"),
        (lambda: Surface(np.full((4, 4), np.nan), 1.0), "finite"),
        (lambda: Surface(np.zeros((4, 4)), 0.0), "size"),
        (lambda: Camera(placed(), 0.0), "focal"),
        (lambda: Light((0, 0, 0)), "direction"),
        (lambda: Light((0, 1, 0), ambient=2.0), "ambient"),
        (lambda: World((), STILL, (0, 4)), "shape"),
        (lambda: World((), STILL, (4, 4), rays=0), "rays"),
        (lambda: placed((0, 0)), "position"),
        (lambda: placed(velocity=(0, 0, np.inf)), "velocity"),
        (lambda: placed(orientation=np.ones((3, 3))), "orientation"),
        (lambda: placed(axis=(0, 0, 0)), "axis"),
        (lambda: looking(lambda _: (0, 0, 0), lambda _: (0, 1, 0), float)(0), "target"),
        (lambda: synthetic.checkers((4, 4), (5, 1)), "fields"),
    ],
)
def test_bad_input_is_named(call, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
