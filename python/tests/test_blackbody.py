"""Light of black bodies against published numbers and closed forms."""

import fake_run
import numpy as np
import pytest

from tumble.pictures import Studio, blackbody, volumes
from tumble.pictures.drawn import Smoke

STEFAN = 5.670374419e-8
"""W/(m² K⁴), CODATA 2018."""

WIEN = 2.897771955e-3
"""m K, CODATA 2018."""


@pytest.mark.parametrize("t", [500.0, 1900.0, 5772.0])
def test_laws_of_wien_and_of_stefan_and_boltzmann(t: float) -> None:
    wave = WIEN / t * np.linspace(0.99, 1.01, 2001)
    assert wave[np.argmax(blackbody.planck(wave, t))] == pytest.approx(WIEN / t, rel=2e-5)  # steps of 1e-5
    # pi int B dl = sigma T⁴; between peak/50 and 4000 peak all but 2e-9 of it, trapezoids in ln l.
    wave = WIEN / t * np.geomspace(0.02, 4000, 20001)
    total = np.trapezoid(blackbody.planck(wave, t) * wave, np.log(wave))
    assert np.pi * total == pytest.approx(STEFAN * t**4, rel=1e-8)


def test_a_body_at_6000_k_as_in_tables() -> None:
    """At 500 nm: c1 = 2 h c² = 1.191043e-16 W m²/sr, c2 = 0.01438777 m K (CODATA)."""
    expected = 1.191042972e-16 / 500e-9**5 / (np.exp(0.01438776877 / (500e-9 * 6000)) - 1)
    assert blackbody.planck(500e-9, 6000.0) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("t", "x", "y", "off"),
    [
        # The Planckian locus of the CIE's tables (1931), as in Wyszecki and Stiles. Measured: 0.0106, 0.0025, 0.0001.
        (1000.0, 0.6528, 0.3444, 0.012),
        (2000.0, 0.5267, 0.4133, 0.003),
        (6500.0, 0.3135, 0.3236, 0.0005),
    ],
)
def test_colours_lie_on_the_planckian_locus(t: float, x: float, y: float, off: float) -> None:
    got = blackbody.chromaticity(t)
    assert got == pytest.approx([x, y], abs=off)


def test_the_table_keeps_what_it_was_made_of() -> None:
    t = np.array([1003.0, 1514.0, 1900.0, 3001.0], dtype=np.float32)
    expected = blackbody.colors(t) / blackbody.colors(1900.0).max()
    # Between entries 10 K apart powers are off by (10 d/dT)² ln B/8, 4e-4 at 1000 K.
    np.testing.assert_allclose(blackbody.glow(t, 1900.0), expected, rtol=1e-3, atol=1e-7)
    assert expected[2].max() == pytest.approx(1.0)


def test_film_is_linear_in_the_dark_and_white_in_the_light() -> None:
    dim = np.array([[1e-4, 2e-4, 0.0]])
    layers = (1 - 3 * blackbody.CROSSTALK) * dim + blackbody.CROSSTALK * 3e-4
    np.testing.assert_allclose(blackbody.developed(dim), layers, rtol=2e-4)
    red, yellow, white = blackbody.developed(np.array([[1.0, 0.1, 0.0], [20.0, 4.0, 0.0], [400.0, 90.0, 0.0]]))
    assert red[0] > 0.5 > 3 * red[1] and yellow[1] > 0.95 > 2 * yellow[2] and white.min() > 0.99


def test_light_of_a_glowing_block_is_kirchhoffs() -> None:
    """B (1 - exp(-tau)) of each colour, and then on film; between cells ln B is linear, so that exp(k x) stays one."""
    from tumble.pictures.framing import Camera

    n, tau = 20, 1.5
    y = np.eye(3)[1]
    view = Camera(-y, np.zeros(3), np.eye(3)[2], 0.8, (64, 48), True)
    extinction = np.full((n, n, n), tau / 0.4, dtype=np.float32)
    source = np.broadcast_to(np.array([0.3, 0.2, 0.1], dtype=np.float32), (n, n, n, 3))
    dark, depth = np.zeros((48, 64, 3)), np.full((48, 64), np.inf)
    cube = Smoke("", np.full(3, -0.2), 0.4 / n, extinction, (0.0, 0.0, 0.0), glow=source)
    got = volumes.smoke(dark, depth, [cube], view)[24, 32]
    expected = blackbody.developed(np.array([0.3, 0.2, 0.1]) * (1 - np.exp(-tau)))
    np.testing.assert_allclose(got, expected, rtol=2e-4)
    # Along the ray, with s = tau/0.4: int s exp(-s x) exp(-k x) dx = s/(s + k) (1 - exp(-(s + k) 0.4)).
    s, k = tau / 0.4, 4.0
    fall = np.exp(-k * 0.4 / n * (np.arange(n) + 0.5)).astype(np.float32)
    slanted = Smoke("", cube.low, cube.spacing, extinction, cube.color, glow=source * fall[None, :, None, None])
    got = volumes.smoke(dark, depth, [slanted], view)[24, 32]
    light = np.array([0.3, 0.2, 0.1]) * s / (s + k) * (1 - np.exp(-(s + k) * 0.4))
    np.testing.assert_allclose(got, blackbody.developed(light), rtol=2e-3)


def test_a_hot_gas_glows_and_a_cold_one_does_not() -> None:
    run = fake_run.plume(12)
    cold = next(t for t in Studio(run, "matplotlib").things(4) if isinstance(t, Smoke))
    assert cold.glow is None and cold.emission is None
    before = run.frame

    def hotter(i: int) -> dict[str, dict[str, np.ndarray]]:
        table = before(i)
        (name,) = (k for k, v in table.items() if "temperature" in v)
        warm = table[name]["temperature"]
        share = (warm - warm.min()) / max(np.ptp(warm), 1e-9)
        return {**table, name: {**table[name], "temperature": 300 + 1500 * share}}

    run.frame = hotter  # type: ignore[method-assign]
    studio = Studio(run, "matplotlib")
    hot = next(t for t in studio.things(4) if isinstance(t, Smoke))
    assert hot.glow is not None
    # Kirchhoff: the light of a cell over what it takes away is that of a black body.
    i = np.unravel_index(np.argmax(hot.glow[..., 0]), hot.extinction.shape)
    t = hotter(4)[hot.name]["temperature"][i]
    from tumble.pictures import things

    expected = things.EXPOSURE * blackbody.colors(t)[0] / blackbody.colors(1800.0).max()
    assert hot.glow[i][0] == pytest.approx(expected, rel=1e-2)
    run.scene = {**run.scene, "camera": {**run.scene.get("camera", {}), "look": "night"}}
    shown = Studio(run, "matplotlib").picture(4).astype(int)
    assert (shown[..., 0] - shown[..., 2]).max() > 20  # that of the sky is -11
