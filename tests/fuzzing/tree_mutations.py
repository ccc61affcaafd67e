"""Mutations of a document's tree: dicts, lists and values, as JSON and TOML have them."""

import copy
import random
from typing import Any

from tests.fuzzing.extremes import LONGEST_TEXT, NUMBERS, ODD_CHARACTERS, STRINGS, SecondKey, extreme
from tests.fuzzing.tree_text import json_text

LONGEST_LIST = 20_000
"""A choice: members of a repeated list. A quadratic reader takes seconds for them, a linear one does not."""


def mutate_tree(tree: dict[Any, Any], rng: random.Random) -> None:
    """Change one to five places of `tree`, mostly one or two."""
    for _ in range(min(1 + int(rng.expovariate(1.2)), 5)):
        places = _places(tree)
        if not places:
            return
        # By name first: else the numbers of matrices and long lists would be chosen before all else.
        names: dict[str, list[tuple[Any, Any]]] = {}
        for container, key, name in places:
            names.setdefault(name, []).append((container, key))
        container, key = rng.choice(names[rng.choice(list(names))])
        places = [(each, at) for each, at, _ in places]
        rng.choices(_MUTATIONS, _WEIGHTS)[0](container, key, places, rng)


def _places(tree: dict[Any, Any]) -> list[tuple[Any, Any, str]]:
    """Container, key, and name: the key, or for members of a list the list's own and a star."""
    found: list[tuple[Any, Any, str]] = []
    left: list[tuple[Any, str]] = [(tree, "")]
    while left and len(found) < 5000:
        container, of = left.pop()
        keys = container if isinstance(container, dict) else range(len(container))
        for key in keys:
            name = key if isinstance(key, str) else f"{of}*"
            found.append((container, key, name))
            if isinstance(container[key], dict | list):
                left.append((container[key], name))
    return found


def _replace(container: Any, key: Any, places: list[tuple[Any, Any]], rng: random.Random) -> None:
    container[key] = extreme(rng)


def _change_alike(container: Any, key: Any, places: list[tuple[Any, Any]], rng: random.Random) -> None:
    """Another value of the same type, which gets further than one of another type."""
    value = container[key]
    if isinstance(value, bool):
        container[key] = not value
    elif isinstance(value, int | float):
        near = (value + 1, value - 1, -value, value * 10, value * 1000, value / 2, float(value))
        container[key] = rng.choice(near) if rng.random() < 0.5 else rng.choice(NUMBERS)
    elif isinstance(value, str):
        texts = [each[name] for each, name in places if isinstance(each[name], str)]
        at = rng.randrange(len(value) + 1)
        odd = value[:at] + rng.choice(ODD_CHARACTERS) + value[at:]
        container[key] = rng.choice((rng.choice(STRINGS), rng.choice(texts), odd))
    elif isinstance(value, list):
        rng.shuffle(value)
    else:
        container[key] = {}


def _delete(container: Any, key: Any, places: list[tuple[Any, Any]], rng: random.Random) -> None:
    del container[key]


def _double_key(container: Any, key: Any, places: list[tuple[Any, Any]], rng: random.Random) -> None:
    if isinstance(container, dict) and isinstance(key, str):
        container[SecondKey(key)] = extreme(rng) if rng.random() < 0.5 else container[key]
    else:
        _repeat(container, key, places, rng)


def _rename_key(container: Any, key: Any, places: list[tuple[Any, Any]], rng: random.Random) -> None:
    if isinstance(container, dict):
        names = [name for each, name in places if isinstance(each, dict) and isinstance(name, str)]
        container[rng.choice(STRINGS) if rng.random() < 0.3 else rng.choice(names)] = container.pop(key)
    else:
        _replace(container, key, places, rng)


def _splice(container: Any, key: Any, places: list[tuple[Any, Any]], rng: random.Random) -> None:
    """What stands at another place, whole."""
    source, name = rng.choice(places)
    container[key] = copy.deepcopy(source[name])


def _repeat(container: Any, key: Any, places: list[tuple[Any, Any]], rng: random.Random) -> None:
    value = container[key]
    times = min(2 ** rng.choice((1, 1, 1, 2, 3, 6, 10, 14)), LONGEST_TEXT // len(json_text(value) + " "))
    if isinstance(value, list) and value:
        # Copies of their own: one object in many places would take a later change in all of them.
        count = max(min(times, LONGEST_LIST // len(value)), 1)
        container[key] = [copy.deepcopy(each) for _ in range(count) for each in value]
    elif isinstance(value, str):
        container[key] = value * times
    elif isinstance(container, list) and len(container) < LONGEST_LIST:
        container[key:key] = [copy.deepcopy(value) for _ in range(min(times, LONGEST_LIST))]
    else:
        container[key] = [value, value]


def _shorten(container: Any, key: Any, places: list[tuple[Any, Any]], rng: random.Random) -> None:
    value = container[key]
    if isinstance(value, list | str) and value:
        container[key] = value[: rng.randrange(len(value))]
    else:
        del container[key]


_MUTATIONS = (_replace, _change_alike, _delete, _double_key, _rename_key, _splice, _repeat, _shorten)
_WEIGHTS = (20, 40, 10, 2, 4, 12, 8, 6)
