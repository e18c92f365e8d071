"""Two hundred random models of every kind: impulses are the bodies' change of momentum, or a warning says that not."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from momentum_balance import MomentumBalance
from random_hit import RandomHit
from random_models import RandomModel

from ripple_sim import Material, Ripples
from ripple_sim.errors import RippleWarning

RESOLUTION, TOLERANCE = 16, 0.01
# as long as this the surface receives every force as it comes [s]
AT_ONCE = 0.1


def hit(seed: int) -> tuple[Ripples, MomentumBalance, list[str]]:
    """Let a random model's geoms meet; warnings of its impulses."""
    random = RandomModel(seed)
    scene = RandomHit(random)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RippleWarning)
        speed = 0.4 * random.size / RESOLUTION / random.timestep
        materials = {name: Material(speed=speed, density=1.0) for name in random.targets}
        ripples = Ripples(scene.model, materials, resolution=RESOLUTION, backend="cpu", conserve_volume=False)
        balance = MomentumBalance(scene.model, random.targets)
        for _ in range(min(scene.steps, int(AT_ONCE / random.timestep))):
            balance.before(scene.data)
            scene.step()
            ripples.step(scene.data)
            balance.after(scene.data, ripples.last_impulses)
    return ripples, balance, [text for text in (str(each.message) for each in caught) if "too high" not in text]


@pytest.mark.parametrize("block", range(10))
def test_impulses_are_the_change_of_momentum_or_a_warning_says_that_not(
    block: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # MuJoCo notes in a file that it became unstable
    monkeypatch.chdir(tmp_path)
    touched = 0
    for seed in range(20 * block, 20 * block + 20):
        ripples, balance, told = hit(seed)
        for name in ripples:
            waves = ripples[name]
            assert np.isfinite(waves.height).all(), (seed, name)
            assert np.isfinite(waves.velocity).all(), (seed, name)
            pairs = [pair for (target, _), pair in balance.pairs.items() if target == name]
            reported = sum(pair.reported for pair in pairs)
            if told or not reported:
                continue
            touched += 1
            given = sum(pair.given for pair in pairs)
            assert given == pytest.approx(reported, rel=TOLERANCE), (seed, name)
            assert sum(abs(pair.felt - pair.reported) for pair in pairs) <= TOLERANCE * reported, (seed, name)
            assert waves.momentum() == pytest.approx(-given, rel=TOLERANCE), (seed, name)
    assert touched >= 5
