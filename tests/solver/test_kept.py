import weakref

from ripple_sim.solver.cache import Kept, kept_with


def test_the_latest_small_results_are_kept():
    made = []

    def make(value):
        made.append(value)
        return value

    kept = Kept(2, lambda value: value < 100)
    for value in (1, 2, 1, 3, 1, 2, 500, 500):
        assert kept.get(str(value), lambda value=value: make(value)) == value
    assert made == [1, 2, 3, 2, 500, 500]  # 2 was not asked for as lately as 1, and 500 is too large


def test_what_is_made_from_an_object_is_made_once_and_kept_while_the_object_lives():
    class Thing:
        pass

    made = []

    @kept_with
    def make(owner):
        made.append(weakref.ref(result := Thing()))
        return result

    first, second = Thing(), Thing()
    assert make(first) is make(first)
    assert make(second) is not make(first)
    assert len(made) == 2
    del first
    assert made[0]() is None
    assert made[1]() is make(second)
