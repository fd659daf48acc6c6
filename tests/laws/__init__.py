"""Laws of every public function, over sizes, conditions, units, kinds of numbers and orders in memory."""

COVERED: set[str] = set()
"""Public names that some law here is about, such as ``spd.distance``; `test_every_public_name_has_laws` compares."""


def covers(*names):
    """Say which public names a test is about: whole names, or one room and names in it, ``spd: mean dispersion``."""

    def remember(test):
        for name in names:
            room, colon, inside = name.partition(": ")
            COVERED.update(f"{room}.{one}" for one in inside.split()) if colon else COVERED.add(name)
        return test

    return remember
