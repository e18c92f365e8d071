from ripple_sim.solver.kept import Kept


def test_the_latest_small_results_are_kept():
    made = []

    def make(value):
        made.append(value)
        return value

    kept = Kept(2, lambda value: value < 100)
    for value in (1, 2, 1, 3, 1, 2, 500, 500):
        assert kept.get(str(value), lambda value=value: make(value)) == value
    assert made == [1, 2, 3, 2, 500, 500]  # 2 was not asked for as lately as 1, and 500 is too large
